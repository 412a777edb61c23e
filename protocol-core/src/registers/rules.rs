//! The rules for writes, generated from both tables at compile time. The image holds two bytes per register and map, six
//! per word, and none of the tables' text. A word is a register of two bytes.

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
/// The rules of all words that function 06 can write, in ascending order. Map 2.1 has none.
static WORDS: [WordRule; writable_words(MAP)] = word_rules(MAP);
/// Address of the first word that can be written.
pub(super) const WORDS_START: u8 = first_word(MAP);
const _: () = assert!(writable_words(MAP_21) == 0, "function 04 writes no words");
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

/// The reason why a write has no effect (D16, D22).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Refused {
    /// One of [`refusal`](super::map::refusal).
    pub reason: u8,
    /// The first register that is the reason; of a two-byte register its low byte.
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
            // The two bytes are checked together, by a `WordRule`.
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

    /// The same for a rule of map 2.1, which has biased ranges in place of signs and magnitudes.
    pub(super) const fn allows_21(self, value: u8) -> bool {
        let bias = if self.mask == !SIGN { self.max / 2 } else { 0 };
        value.wrapping_add(bias) & self.mask <= self.max
    }
}

/// The rule for a write to one word: 0, or a number from `min` to `max`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct WordRule {
    /// The address of the low byte.
    address: u8,
    min: u16,
    max: u16,
}

impl WordRule {
    const fn of(register: &Register, address: u8) -> Self {
        let (min, max) = match register.range {
            Range::WordUpTo(max) => (0, max),
            Range::ZeroOr(min, max) => (min, max),
            _ => (0, u16::MAX),
        };
        Self { address, min, max }
    }

    const fn allows(self, word: u16) -> bool {
        word == 0 || (self.min <= word && word <= self.max)
    }

    /// The reason why a write of `values` from `start` on is refused because of this word, if it is (D22).
    fn refusal(self, start: u8, values: &[u8]) -> Option<u8> {
        let byte = |address: u8| values.get(usize::from(address.checked_sub(start)?)).copied();
        match (byte(self.address), byte(self.address + 1)) {
            (None, None) => None,
            (Some(low), Some(high)) => {
                (!self.allows(u16::from_le_bytes([low, high]))).then_some(refusal::OUT_OF_RANGE)
            }
            _ => Some(refusal::HALF_A_WORD),
        }
    }
}

/// The first word because of which a write of `values` from `start` on is refused (D22).
pub(super) fn first_refused_word(start: u8, values: &[u8]) -> Option<Refused> {
    let refused = |word: &WordRule| {
        let reason = word.refusal(start, values)?;
        Some(Refused { reason, address: word.address })
    };
    WORDS.iter().find_map(refused)
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

const fn is_writable_word(row: &Register) -> bool {
    matches!(row.access, Access::ReadWrite) && row.range.width() == 2
}

const fn writable_words(map: &[Register]) -> usize {
    let mut words = 0;
    let mut rest = map;
    while let [row, tail @ ..] = rest {
        if is_writable_word(row) {
            words += row.count as usize / 2;
        }
        rest = tail;
    }
    words
}

const fn first_word(map: &[Register]) -> u8 {
    let mut rest = map;
    while let [row, tail @ ..] = rest {
        if is_writable_word(row) {
            return row.address;
        }
        rest = tail;
    }
    u8::MAX
}

#[allow(clippy::indexing_slicing, clippy::cast_possible_truncation)]
const fn word_rules<const WORDS: usize>(map: &[Register]) -> [WordRule; WORDS] {
    let mut words = [WordRule { address: 0, min: 0, max: 0 }; WORDS];
    let (mut rest, mut index) = (map, 0);
    while let [row, tail @ ..] = rest {
        let mut offset = 0;
        while is_writable_word(row) && offset < row.count {
            words[index] = WordRule::of(row, row.address + offset);
            (index, offset) = (index + 1, offset + 2);
        }
        rest = tail;
    }
    words
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

/// The defaults of map 2.1, and over them those of map 2.2 (M3).
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
        assert_eq!((writable_end(MAP), eeprom_bounds(MAP)), (190, (8, 28)));
        let rules: [Rule; 190] = rules(MAP);
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
    fn d22_the_word_rules_follow_from_the_table() {
        assert_eq!((writable_words(MAP), writable_words(MAP_21), first_word(MAP)), (8, 0, 128));
        assert_eq!(first_word(MAP_21), u8::MAX);
        let words: [WordRule; 8] = word_rules(MAP);
        assert_eq!(words, WORDS);
        let addresses = words.map(|word| word.address);
        assert_eq!(addresses, [128, 130, 132, 134, 136, 138, 140, 184]);
        for (word, raw) in words.iter().flat_map(|word| (0..=u16::MAX).map(move |raw| (word, raw))) {
            let row = MAP.iter().find(|row| row.holds(word.address));
            assert_eq!(Some(word.allows(raw)), row.map(|row| row.range.contains(raw)), "{word:?}: {raw}");
        }
        assert_eq!(WordRule::of(&MAP[0], 0), WordRule { address: 0, min: 0, max: u16::MAX });
    }

    #[test]
    fn a_rule_allows_what_the_range_of_its_row_contains() {
        for row in
            MAP.iter().chain(MAP_21).filter(|row| row.access == Access::ReadWrite && row.range.width() == 1)
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
