//! Parses register names: `target-position.3`, `SPEED`, `12`, `54..60`, `status-version..255`. The names come from the
//! register tables. Map 2.2 goes before map 2.1, as in a read ([M3](protocol_core::decisions#m3)).

use protocol_core::registers::map21::{MAP_21, find_readable};
use protocol_core::registers::{Joint, MAP, Register};

use host_link::Span;

/// Why a text is not the name of registers.
///
/// ```
/// use sevenbot::names::{NameError, parse};
///
/// assert_eq!(parse("nonsense"), Err(NameError::Unknown));
/// assert_eq!(parse("target.3").map(sevenbot::Span::address), Ok(48));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NameError {
    /// The text is empty, or it is not a number and no register name starts with it. Rows of map 2.1 do not count if map 2.2
    /// uses all their addresses.
    #[error("there is no register of this name: `sevenbot registers` lists the names")]
    Unknown,
    /// Several register names start with the text.
    #[error("this could be {}", .0.iter().map(|row| name_of(row)).collect::<Vec<_>>().join(" or "))]
    Ambiguous(Vec<&'static Register>),
    /// The text after the dot is not a joint, 1 to 7.
    #[error("a joint is a number from 1 to 7")]
    NoJoint,
    /// The row does not have a value for each joint.
    #[error("{} has no joints", name_of(.0))]
    NotPerJoint(&'static Register),
    /// The number is not an address, 0 to 255, or an end of the range is missing.
    #[error("a register's number is 0 to 255")]
    NoAddress,
    /// The range ends before it starts.
    #[error("the range ends before it begins")]
    EmptyRange,
    /// The range has all 256 registers, and one frame holds 255.
    #[error("one frame holds 255 registers, and this range has 256: split it into 0..254 and 255")]
    TooLong,
}

/// The name of a row as users write it: `target-position`.
#[must_use]
pub fn name_of(row: &Register) -> String {
    row.name.to_ascii_lowercase().replace('_', "-")
}

/// The name of one register: `target-position.3`, or `chip-id+2` and `fine-target.3+1` for a later byte of a longer value;
/// `register 67` if the tables have none.
#[must_use]
pub fn name_of_register(address: u8) -> String {
    let Some(row) = find_readable(address) else { return format!("register {address}") };
    let joint = row.joint_at(address);
    let name = joint.map_or(name_of(row), |joint| format!("{}.{}", name_of(row), joint.number()));
    match address.saturating_sub(joint.map_or(row.address, |joint| row.of(joint))) {
        0 => name,
        offset => format!("{name}+{offset}"),
    }
}

/// Parses a number (`12`), a range with both ends (`54..60`), or a name. An end of a range may be a name, too.
///
/// A name may be in any case, with `-` or `_`, and shortened while it is unique. `.3` selects joint 3.
///
/// # Errors
/// The text is not the name of registers.
pub fn parse(text: &str) -> Result<Span, NameError> {
    if let Some((first, last)) = text.split_once("..") {
        let end = |text: &str| if text.trim().is_empty() { Err(NameError::NoAddress) } else { one_end(text) };
        return range(end(first)?, end(last)?);
    }
    one_end(text)
}

/// The registers from the first of one span to the last of another.
fn range(first: Span, last: Span) -> Result<Span, NameError> {
    let last = last.addresses().last().ok_or(NameError::NoAddress)?;
    let distance = last.checked_sub(first.address()).ok_or(NameError::EmptyRange)?;
    let count = distance.checked_add(1).ok_or(NameError::TooLong)?;
    Span::new(first.address(), count).ok_or(NameError::NoAddress)
}

/// A number or a name.
fn one_end(text: &str) -> Result<Span, NameError> {
    let text = text.trim();
    if text.starts_with(|first: char| first.is_ascii_digit()) {
        return Ok(Span::one(address(text)?));
    }
    let (name, joint) = text.split_once('.').map_or((text, None), |(name, joint)| (name, Some(joint)));
    let row = row(name)?;
    joint.map_or(Ok(shown(row)), |joint| one_joint(row, joint))
}

fn address(text: &str) -> Result<u8, NameError> {
    text.parse().map_err(|_| NameError::NoAddress)
}

fn one_joint(row: &'static Register, joint: &str) -> Result<Span, NameError> {
    let joint = joint.parse().ok().and_then(Joint::new).ok_or(NameError::NoJoint)?;
    let span = Span::new(row.of(joint), row.range.width()).filter(|_| row.per_joint);
    span.ok_or(NameError::NotPerJoint(row))
}

/// The part of a row that a read shows: of a row that only map 2.1 has, the addresses that map 2.2 does not use.
fn shown(row: &Register) -> Span {
    let is_shown = |address: &u8| MAP.contains(row) || find_readable(*address) == Some(row);
    let addresses = || Span::of(row).addresses().filter(is_shown);
    let count = u8::try_from(addresses().count()).unwrap_or_default();
    addresses().next().and_then(|first| Span::new(first, count)).unwrap_or(Span::NONE)
}

/// The row of this name. A whole name counts in both maps, unless map 2.2 uses all addresses of a row of map 2.1. A shortened one
/// is searched in map 2.1 only if no name of map 2.2 begins with it.
fn row(name: &str) -> Result<&'static Register, NameError> {
    let wanted = name.to_ascii_uppercase().replace('-', "_");
    let rows =
        || MAP.iter().chain(MAP_21.iter().filter(|row| !MAP.contains(row) && shown(row) != Span::NONE));
    if let Some(row) = rows().find(|row| row.name == wanted) {
        return Ok(row);
    }
    let is_candidate = |row: &&Register| !wanted.is_empty() && row.name.starts_with(&wanted);
    let mut candidates: Vec<_> = MAP.iter().filter(is_candidate).collect();
    if candidates.is_empty() {
        candidates = rows().filter(is_candidate).collect();
    }
    match candidates.as_slice() {
        [] => Err(NameError::Unknown),
        [only] => Ok(only),
        _ => Err(NameError::Ambiguous(candidates)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(address: u8, count: u8) -> Result<Span, NameError> {
        Ok(Span::new(address, count).expect("a span"))
    }

    #[test]
    fn every_row_is_found_by_its_name_in_any_spelling() {
        for row in MAP {
            for name in [name_of(row), row.name.to_owned(), row.name.to_ascii_lowercase()] {
                assert_eq!(parse(&name), Ok(Span::of(row)), "{name}");
            }
        }
    }

    #[test]
    fn registers_of_map_21_have_their_names() {
        assert_eq!((parse("options"), parse("opt")), (span(20, 1), span(20, 1)));
        assert_eq!((parse("wrist-position"), parse("disc")), (span(68, 6), span(63, 3)));
        assert_eq!(parse("tool-direction"), span(61, 2), "60 is the present position of joint 7");
        assert_eq!((parse("present-angle.7"), parse("load-f")), (span(89, 1), span(90, 1)));
        assert_eq!((parse("present"), parse("load")), (span(54, 7), span(170, 14)), "map 2.2 goes first");
        assert_eq!((parse("offset"), parse("o")), (span(13, 7), span(13, 7)));
        assert_eq!(parse("tip-position"), Err(NameError::Unknown), "map 2.2 uses all its addresses");
        assert_eq!(name_of_register(62), "tool-direction+2");
    }

    #[test]
    fn joints_numbers_ranges_and_short_names() {
        assert_eq!(parse("Target-Position.3"), span(48, 1));
        assert_eq!(parse("target"), span(46, 7));
        assert_eq!(parse("12"), span(12, 1));
        assert_eq!(parse("54..60"), span(54, 7));
        assert_eq!(parse("255..255"), span(255, 1));
        assert_eq!(parse("1..255"), span(1, 255));
        assert_eq!(parse("status-version..255"), span(240, 16));
        assert_eq!(parse("speed.2..target-position"), span(33, 20), "to the last of the seven");
    }

    #[test]
    fn invalid_names_give_the_reason() {
        assert_eq!(parse("nonsense"), Err(NameError::Unknown));
        assert_eq!(parse(""), Err(NameError::Unknown));
        assert_eq!(parse("speed.8"), Err(NameError::NoJoint));
        assert_eq!(parse("speed.x"), Err(NameError::NoJoint));
        assert!(matches!(parse("device-id.1"), Err(NameError::NotPerJoint(_))));
        assert!(matches!(parse("device"), Err(NameError::Ambiguous(rows)) if rows.len() == 2));
        for text in ["256", "0..256", "1..", ".."] {
            assert_eq!(parse(text), Err(NameError::NoAddress), "{text}");
        }
        assert_eq!(parse("60..54"), Err(NameError::EmptyRange));
        assert_eq!(parse("speed.9..46"), Err(NameError::NoJoint));
        assert_eq!(parse("0..255"), Err(NameError::TooLong));
    }

    #[test]
    fn each_register_of_a_row_has_a_name() {
        assert_eq!(name_of_register(48), "target-position.3");
        assert_eq!(name_of_register(2), "chip-id");
        assert_eq!(name_of_register(4), "chip-id+2");
        assert_eq!(name_of_register(67), "register 67");
        assert_eq!([132, 133].map(name_of_register), ["fine-target.3", "fine-target.3+1"]);
        assert_eq!(parse("fine-target.3"), span(132, 2));
    }
}
