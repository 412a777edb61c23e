//! Grades and arithmetic of the joints' offsets (docs/protocol.md, D9).

use std::io::{self, Write};

use anstyle::Style;
use serde::Serialize;
use sevenbot::map::OFFSET;
use sevenbot::{Joint, Snapshot};

use crate::printer::Printable;
use crate::style::{BAD, BOLD, GOOD, WARNING};

/// The largest good offset, from the maker's table.
const GOOD_UP_TO: i16 = 10;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Grade {
    /// The joint is well assembled.
    Good,
    /// Beyond [`GOOD_UP_TO`], but the register can hold the offset.
    Acceptable,
    /// The register cannot hold the offset. The joint has to be assembled again.
    Bad,
}

impl Grade {
    pub(super) fn of(offset: i16) -> Self {
        match offset {
            _ if OFFSET.range.encode_byte(offset).is_none() => Self::Bad,
            _ if offset.abs() <= GOOD_UP_TO => Self::Good,
            _ => Self::Acceptable,
        }
    }

    pub(super) const fn word(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Acceptable => "acceptable",
            Self::Bad => "bad",
        }
    }

    pub(super) const fn style(self) -> Style {
        match self {
            Self::Good => GOOD,
            Self::Acceptable => WARNING,
            Self::Bad => BAD,
        }
    }
}

/// The offset that changes the reading from `measured` to `actual` degrees.
pub(super) fn corrected(joint: Joint, offset: i16, measured: u8, actual: u8) -> i16 {
    let error = i16::from(actual) - i16::from(measured);
    // A reversed joint subtracts its offset.
    if is_reversed(joint) { offset - error } else { offset + error }
}

/// Is the joint's servo mounted in reverse (D9)?
fn is_reversed(joint: Joint) -> bool {
    (2..=6).contains(&joint.number())
}

/// The offsets of all joints, joint 1 first, in degrees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Offsets(pub(super) [i16; 7]);

impl From<Snapshot> for Offsets {
    fn from(registers: Snapshot) -> Self {
        Self(registers.joints(&OFFSET).map(|byte| OFFSET.range.decode_byte(byte)))
    }
}

impl Offsets {
    /// The register values. An offset out of range becomes 0.
    pub(super) fn bytes(self) -> [u8; 7] {
        self.0.map(|offset| OFFSET.range.encode_byte(offset).unwrap_or(0))
    }

    pub(super) fn of(self, joint: Joint) -> i16 {
        let pairs = Joint::ALL.into_iter().zip(self.0);
        pairs.filter(|(other, _)| *other == joint).map(|(_, offset)| offset).sum()
    }

    pub(super) fn with(mut self, joint: Joint, offset: i16) -> Self {
        let pairs = Joint::ALL.into_iter().zip(&mut self.0);
        pairs.filter(|(other, _)| *other == joint).for_each(|(_, held)| *held = offset);
        self
    }
}

#[derive(Debug, Serialize)]
pub(super) struct OffsetTable {
    joints: Vec<OffsetRow>,
}

#[derive(Debug, Serialize)]
struct OffsetRow {
    joint: u8,
    offset_degrees: i16,
    grade: Grade,
    /// The old offset, if it differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    before: Option<i16>,
}

impl OffsetTable {
    pub(super) fn new(before: Offsets, now: Offsets) -> Self {
        let row = |joint: Joint| {
            let (was, is) = (before.of(joint), now.of(joint));
            let before = (was != is).then_some(was);
            OffsetRow { joint: joint.number(), offset_degrees: is, grade: Grade::of(is), before }
        };
        Self { joints: Joint::ALL.into_iter().map(row).collect() }
    }
}

impl Printable for OffsetTable {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{BOLD}joint  offset{BOLD:#}")?;
        for OffsetRow { joint, offset_degrees, grade, before } in &self.joints {
            let (style, word) = (grade.style(), grade.word());
            let was = before.map_or_else(String::new, |was| format!("  (was {was}°)"));
            writeln!(out, "{joint:>5}  {offset_degrees:>5}°  {style}{word}{style:#}{was}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grades_follow_the_makers_table() {
        let words: Vec<&str> = [0, 10, -10, 11, -16, 17, -300].map(|offset| Grade::of(offset).word()).into();
        assert_eq!(words, ["good", "good", "good", "acceptable", "acceptable", "bad", "bad"]);
    }

    #[test]
    fn a_reversed_joint_subtracts_the_error() {
        assert_eq!(corrected(Joint::ALL[0], 2, 90, 95), 7);
        assert_eq!(corrected(Joint::ALL[1], 2, 90, 95), -3, "reversed");
        assert_eq!(corrected(Joint::ALL[6], 0, 80, 79), -1);
    }

    #[test]
    fn one_joint_is_changed_and_the_others_are_not() {
        let offsets = Offsets([1, 2, 3, 4, 5, 6, 7]).with(Joint::ALL[2], -5);
        assert_eq!(offsets.0, [1, 2, -5, 4, 5, 6, 7]);
        assert_eq!(offsets.of(Joint::ALL[2]), -5);
        assert_eq!(offsets.bytes(), [1, 2, 0x85, 4, 5, 6, 7]);
    }
}
