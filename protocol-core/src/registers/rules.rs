//! The rules for writes, generated from both tables at compile time. The firmware image holds two bytes per
//! address up to the last writable one of each map, eight more per value that those two bytes cannot check, and the
//! defaults. It holds none of the tables' text.

use super::map::{MAP, PRESENT_POSITION, refusal};
use super::map21::MAP_21;
use super::range::{Range, SIGN};
use super::spec::{Access, Region, Register};

/// Address of the first EEPROM register.
pub(super) const EEPROM_START: u8 = eeprom_bounds(MAP).0;
/// Address behind the last EEPROM register.
pub(super) const EEPROM_END: u8 = eeprom_bounds(MAP).1;
const _: () = assert!(EEPROM_END == eeprom_bounds(MAP_21).1, "both maps have the same EEPROM region");

/// The rules of all addresses that function 06 can write.
static RULES: [Rule; writable_end(MAP)] = rules(MAP);
/// The rules of all addresses that function 04 can write.
static RULES_21: [Rule; writable_end(MAP_21)] = rules(MAP_21);
/// The rules of all values that function 06 can write and a [`Rule`] does not check, in ascending order. Map 2.1 has none.
static VALUE_RULES: [ValueRule; checked_values(MAP)] = value_rules(MAP);
/// Address of the first value that a [`ValueRule`] checks: the start of the extended block.
pub(super) const EXTENDED_START: u8 = first_checked_value(MAP);
const _: () = assert!(checked_values(MAP_21) == 0, "function 04 writes bytes that a mask and a limit check");
/// The values of a new arm after power-up.
pub(super) static DEFAULTS: [u8; 256] = defaults();

/// The rules of map 2.2, from the address `start` on.
pub(super) fn rules_from(start: u8) -> &'static [Rule] {
    RULES.get(usize::from(start)..).unwrap_or(&[])
}

/// The rules of map 2.1, from the address `start` on.
pub(super) fn rules_21_from(start: u8) -> &'static [Rule] {
    RULES_21.get(usize::from(start)..).unwrap_or(&[])
}

/// The rule of map 2.2 for one address.
pub(super) fn rule(address: u8) -> Rule {
    RULES.get(usize::from(address)).copied().unwrap_or(Rule::CLOSED)
}

/// The rule of map 2.1 for one address.
pub(super) fn rule_21(address: u8) -> Rule {
    RULES_21.get(usize::from(address)).copied().unwrap_or(Rule::CLOSED)
}

/// Is a byte that function 04 writes to this address readable there? At 54 to 60 a read gives the present positions (M3).
pub(super) const fn keeps_bytes_of_21(address: u8) -> bool {
    !PRESENT_POSITION.holds(address)
}

/// The reason why a write has no effect ([D16](crate::decisions#d16), [D22](crate::decisions#d22)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Refused {
    /// One of [`refusal`](super::map::refusal).
    pub reason: u8,
    /// The first register that causes the refusal; of a two-byte register its low byte.
    pub address: u8,
}

/// The rule for a write to one register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rule {
    /// The bits of the magnitude. If the mask is 0, a write has no effect.
    mask: u8,
    max: u8,
}

impl Rule {
    const CLOSED: Self = Self { mask: 0, max: 0 };

    const fn of(register: &Register) -> Self {
        match (register.access, register.range) {
            (Access::ReadWrite, Range::UpTo(max)) => Self { mask: 0xFF, max },
            (Access::ReadWrite, Range::SignMagnitude(max)) => Self { mask: !SIGN, max },
            (Access::ReadWrite, Range::Biased(max)) => Self { mask: !SIGN, max: 2 * max },
            // A `ValueRule` checks the value.
            (Access::ReadWrite, _) => Self { mask: 0xFF, max: 0xFF },
            _ => Self::CLOSED,
        }
    }

    pub(super) const fn is_open(self) -> bool {
        self.mask != 0
    }

    /// Returns whether the value is in range. A register without effect allows any value.
    pub(super) const fn allows(self, value: u8) -> bool {
        value & self.mask <= self.max
    }

    /// As [`Self::allows`], for a rule of map 2.1, whose offsets are biased instead of in sign and magnitude.
    pub(super) const fn allows_21(self, value: u8) -> bool {
        let bias = if self.mask == !SIGN { self.max / 2 } else { 0 };
        value.wrapping_add(bias) & self.mask <= self.max
    }
}

/// The rule for a write to a value of two bytes, or to a byte with a minimum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ValueRule {
    /// The address of the byte, or of the low byte.
    address: u8,
    range: Range,
}

impl ValueRule {
    /// The reason for which this rule refuses a write of `values` from `start` on (D16, D22); `None` if it does not.
    fn refusal(self, start: u8, values: &[u8]) -> Option<u8> {
        let byte = |address: u8| values.get(usize::from(address.checked_sub(start)?)).copied();
        let high = if self.range.width() == 2 { byte(self.address + 1) } else { Some(0) };
        match (byte(self.address), high) {
            (Some(low), Some(high)) => {
                (!self.range.contains(u16::from_le_bytes([low, high]))).then_some(refusal::OUT_OF_RANGE)
            }
            (None, None) => None,
            (None, _) if self.range.width() == 1 => None,
            _ => Some(refusal::HALF_A_WORD),
        }
    }
}

/// The refusal of a write of `values` from `start` on by the first [`ValueRule`] that refuses it (D16, D22); `None` if none
/// does.
pub(super) fn first_refused_value(start: u8, values: &[u8]) -> Option<Refused> {
    let refused = |value: &ValueRule| {
        let reason = value.refusal(start, values)?;
        Some(Refused { reason, address: value.address })
    };
    VALUE_RULES.iter().find_map(refused)
}

// The functions below run at compile time and in a test. An index out of bounds is a build error, not a panic.

const fn writable_end(map: &[Register]) -> usize {
    let mut end = 0;
    let mut rest = map;
    while let [row, tail @ ..] = rest {
        if matches!(row.access, Access::ReadWrite) {
            end = row.address as usize + row.count as usize;
        }
        rest = tail;
    }
    end
}

const fn eeprom_bounds(map: &[Register]) -> (u8, u8) {
    let (mut start, mut end) = (0, 0);
    let mut rest = map;
    while let [row, tail @ ..] = rest {
        if matches!(row.region, Region::Eeprom) {
            if end == 0 {
                start = row.address;
            }
            end = row.address + row.count;
        }
        rest = tail;
    }
    (start, end)
}

/// Does a [`ValueRule`] check the values of this row?
const fn needs_value_rule(row: &Register) -> bool {
    let has_minimum = matches!(row.range, Range::Between(..));
    matches!(row.access, Access::ReadWrite) && (row.range.width() == 2 || has_minimum)
}

const fn checked_values(map: &[Register]) -> usize {
    let mut values = 0;
    let mut rest = map;
    while let [row, tail @ ..] = rest {
        if needs_value_rule(row) {
            values += row.count as usize / row.range.width() as usize;
        }
        rest = tail;
    }
    values
}

const fn first_checked_value(map: &[Register]) -> u8 {
    let mut rest = map;
    while let [row, tail @ ..] = rest {
        if needs_value_rule(row) {
            return row.address;
        }
        rest = tail;
    }
    u8::MAX
}

#[allow(clippy::indexing_slicing, clippy::cast_possible_truncation)]
const fn value_rules<const VALUES: usize>(map: &[Register]) -> [ValueRule; VALUES] {
    let mut values = [ValueRule { address: 0, range: Range::UpTo(0) }; VALUES];
    let (mut rest, mut index) = (map, 0);
    while let [row, tail @ ..] = rest {
        let mut offset = 0;
        while needs_value_rule(row) && offset < row.count {
            values[index] = ValueRule { address: row.address + offset, range: row.range };
            (index, offset) = (index + 1, offset + row.range.width());
        }
        rest = tail;
    }
    values
}

#[allow(clippy::indexing_slicing)]
const fn rules<const END: usize>(map: &[Register]) -> [Rule; END] {
    let mut rules = [Rule::CLOSED; END];
    let mut rest = map;
    while let [row, tail @ ..] = rest {
        let mut address = row.address as usize;
        while address < row.address as usize + row.count as usize && address < END {
            rules[address] = Rule::of(row);
            address += 1;
        }
        rest = tail;
    }
    rules
}

/// The defaults of map 2.1, overwritten by the defaults of map 2.2 (M3).
const fn defaults() -> [u8; 256] {
    set_defaults(set_defaults([0; 256], MAP_21), MAP)
}

#[allow(clippy::indexing_slicing, clippy::cast_possible_truncation)]
const fn set_defaults(mut values: [u8; 256], map: &[Register]) -> [u8; 256] {
    let mut rest = map;
    while let [row, tail @ ..] = rest {
        let mut offset = 0;
        while offset < row.count as usize {
            let address = row.address as usize + offset;
            values[address] = row.default_at(address as u8);
            offset += 1;
        }
        rest = tail;
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs the compile-time functions at run time, so that coverage and mutation tests see them.
    #[test]
    fn the_rules_and_defaults_follow_from_the_table() {
        assert_eq!((writable_end(MAP), eeprom_bounds(MAP)), (195, (8, 28)));
        let rules: [Rule; 195] = rules(MAP);
        assert_eq!(rules.as_slice(), RULES.as_slice());
        assert_eq!(defaults(), DEFAULTS);
        let rule = |mask, max| Rule { mask, max };
        assert_eq!(rules[..9], [Rule::CLOSED; 9], "ROM and reserved registers");
        assert_eq!(rules[12..14], [rule(0xFF, 7), rule(0x7F, 16)]);
        assert_eq!(rules[28..30], [rule(0xFF, 1), rule(0xFF, 2)]);
    }

    #[test]
    fn m02_function_04_reaches_its_registers_and_no_other() {
        assert_eq!((writable_end(MAP_21), eeprom_bounds(MAP_21)), (91, (8, 28)));
        let rules: [Rule; 91] = rules(MAP_21);
        assert_eq!(rules.as_slice(), RULES_21.as_slice());
        let open: Vec<u8> = (0..=255).filter(|&address| rule_21(address).is_open()).collect();
        let expected = (11..=20).chain(28..=52).chain(54..=66).chain(68..=73).chain([82, 90]);
        assert_eq!(open, expected.collect::<Vec<u8>>());
        assert_eq!(rules[13], Rule { mask: 0x7F, max: 32 });
    }

    #[test]
    fn d22_the_value_rules_follow_from_the_table() {
        assert_eq!((checked_values(MAP), checked_values(MAP_21), first_checked_value(MAP)), (10, 0, 128));
        assert_eq!(first_checked_value(MAP_21), u8::MAX);
        let values: [ValueRule; 10] = value_rules(MAP);
        assert_eq!(values, VALUE_RULES);
        let addresses = values.map(|value| value.address);
        assert_eq!(addresses, [128, 130, 132, 134, 136, 138, 140, 184, 193, 194]);
    }

    #[test]
    fn d27_a_byte_with_a_minimum_is_refused_below_it_and_never_half() {
        let refused = |start, values: &[u8]| first_refused_value(start, values);
        let out_of_range = |address| Some(Refused { reason: refusal::OUT_OF_RANGE, address });
        for (limits, expected) in [
            ([20, 10], None),
            ([100, 100], None),
            ([19, 10], out_of_range(193)),
            ([20, 9], out_of_range(194)),
            ([101, 101], out_of_range(193)),
        ] {
            assert_eq!(refused(193, &limits), expected, "{limits:?}");
            assert_eq!(refused(192, &[1, limits[0], limits[1]]), expected, "{limits:?}");
        }
        assert_eq!(refused(193, &[20]), None);
        assert_eq!(refused(194, &[9]), out_of_range(194));
        assert_eq!(refused(185, &[0]), Some(Refused { reason: refusal::HALF_A_WORD, address: 184 }));
    }

    #[test]
    fn a_rule_allows_what_the_range_of_its_row_contains() {
        for row in
            MAP.iter().chain(MAP_21).filter(|row| row.access == Access::ReadWrite && !needs_value_rule(row))
        {
            let is_biased = matches!(row.range, Range::Biased(_));
            let is_signed = matches!(row.range, Range::SignMagnitude(_));
            for value in 0..=255 {
                let rule = Rule::of(row);
                assert!(
                    is_biased || rule.allows(value) == row.range.contains(value.into()),
                    "{row:?}: {value}"
                );
                assert!(
                    is_signed || rule.allows_21(value) == row.range.contains(value.into()),
                    "{row:?}: {value}"
                );
            }
        }
    }
}
