//! Traffic as text, with the names of the register table.
//!
//! ```text
//!   read present-position 1..7
//!   answer present-position 1..7 = 90 90 65 90 90 90 80 °
//!   write eeprom-lock = 0 (open), motor-state = 1 (servo)
//!   write (map 2.1) tip-position = -50 185 50 mm, tool-direction = 0 0 -1
//!   report present-angle 1..7 = 90 90 65 90 90 90 80 °
//!   alarm: level 1, IK6 has no solution
//!   3 bytes that are no frame: 01 02 03
//! ```

use std::fmt;

use protocol_core::registers::map::find;
use protocol_core::registers::map21::find_readable;
use protocol_core::registers::{Map, Register};

use crate::map21_text;
use crate::names::name_of;
use crate::register_text::entries;
use crate::traffic::Traffic;
use host_link::{Snapshot, Span};

/// A read of more rows shows only the first and the last.
const MAX_ROWS_NAMED: usize = 3;
/// Noise shows at most this many bytes.
const MAX_NOISE_SHOWN: usize = 32;

impl fmt::Display for Traffic {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read { address, count } => {
                write!(out, "read {}", names(Span::new(*address, *count).unwrap_or(Span::NONE)))
            }
            Self::Answer { address, values } => {
                write!(out, "answer {}", assignments(*address, values, find_readable))
            }
            Self::Write { address, values } => write!(out, "write {}", assignments(*address, values, find)),
            Self::WriteMap21 { address, values } => {
                let row = |address| Map::V21.find(address);
                write!(out, "write (map 2.1) {}", assignments(*address, values, row))
            }
            Self::Report { address, values } => {
                write!(out, "report {}", assignments(*address, values, find_readable))
            }
            Self::Alarm { level, kind: kind @ 5..=7 } => {
                write!(out, "alarm: level {level}, IK{kind} has no solution")
            }
            Self::Alarm { level, kind } => write!(out, "alarm: level {level}, kind {kind}"),
            Self::TooFar { address, count } => {
                write!(out, "{count} registers from {address} on, but the last register is 255")
            }
            Self::Noise(bytes) => noise(bytes, out),
        }
    }
}

fn noise(bytes: &[u8], out: &mut fmt::Formatter<'_>) -> fmt::Result {
    match bytes {
        [0xAA, 0x77, 3 | 4 | 5 | 6 | 8, ..] => {
            write!(out, "a damaged frame or a part of one, {} bytes:", bytes.len())?
        }
        [_] => write!(out, "1 byte that is no frame:")?,
        _ => write!(out, "{} bytes that are no frame:", bytes.len())?,
    }
    for byte in bytes.iter().take(MAX_NOISE_SHOWN) {
        write!(out, " {byte:02X}")?;
    }
    if bytes.len() > MAX_NOISE_SHOWN { out.write_str(" ..") } else { Ok(()) }
}

/// Registers of one row, or of one hole in the table.
#[derive(Clone, Copy)]
struct RowSpan {
    row: Option<&'static Register>,
    first: u8,
    last: u8,
}

fn row_spans(span: Span, find: impl Fn(u8) -> Option<&'static Register>) -> Vec<RowSpan> {
    let mut row_spans: Vec<RowSpan> = Vec::new();
    for address in span.addresses() {
        let row = find(address);
        match row_spans.last_mut() {
            Some(row_span) if row_span.row == row => row_span.last = address,
            _ => row_spans.push(RowSpan { row, first: address, last: address }),
        }
    }
    row_spans
}

impl RowSpan {
    /// `target-position 1..7`, `device-id`, `no register 61..63`.
    fn name(self) -> String {
        let Some(row) = self.row else { return format!("no register {}", range(self.first, self.last)) };
        match (row.joint_at(self.first), row.joint_at(self.last)) {
            (Some(first), Some(last)) => format!("{} {}", name_of(row), range(first.number(), last.number())),
            _ if self.count() < usize::from(row.count) => {
                format!("{} ({} of it)", name_of(row), range(self.first, self.last))
            }
            _ => name_of(row),
        }
    }

    fn count(self) -> usize {
        usize::from(self.last.saturating_sub(self.first)) + 1
    }

    fn assignment(self, values: &Snapshot) -> String {
        let bytes: Vec<u8> = (self.first..=self.last).map(|address| values.at(address)).collect();
        if let Some(row) = self.row.filter(|_| self.row != find(self.first)) {
            return format!("{} = {}", self.name(), map21_text::values(row, &bytes));
        }
        let entries = entries(&Snapshot { address: self.first, values: bytes });
        let numbers: Vec<&str> = entries.iter().map(|entry| entry.value.as_str()).collect();
        let comment = match (self.row, entries.as_slice()) {
            (Some(row), [only]) => comment(row, &only.meaning),
            (Some(row), _) => suffix(row.unit.symbol()),
            (None, _) => String::new(),
        };
        format!("{} = {}{comment}", self.name(), numbers.join(" "))
    }
}

/// The meaning of a single value: a unit as it is, other text in brackets.
fn comment(row: &Register, words: &str) -> String {
    if words == row.unit.symbol() || words.is_empty() { suffix(words) } else { format!(" ({words})") }
}

fn suffix(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(" {unit}") }
}

fn range(first: u8, last: u8) -> String {
    if first == last { first.to_string() } else { format!("{first}..{last}") }
}

fn names(span: Span) -> String {
    let row_spans = row_spans(span, find_readable);
    match row_spans.as_slice() {
        [] => span.to_string(),
        [first, .., last] if row_spans.len() > MAX_ROWS_NAMED => {
            format!("{} to {} ({span})", first.name(), last.name())
        }
        _ => row_spans.iter().map(|row_span| row_span.name()).collect::<Vec<_>>().join(", "),
    }
}

fn assignments(address: u8, values: &[u8], find: impl Fn(u8) -> Option<&'static Register>) -> String {
    let values = Snapshot { address, values: values.to_vec() };
    let row_spans = row_spans(values.span(), find);
    if row_spans.is_empty() {
        return values.span().to_string();
    }
    row_spans.iter().map(|row_span| row_span.assignment(&values)).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_shown_with_register_names() {
        let read = |address, count| Traffic::Read { address, count }.to_string();
        assert_eq!(read(54, 7), "read present-position 1..7");
        assert_eq!(read(60, 3), "read present-position 7, tool-direction (61..62 of it)");
        assert_eq!(read(98, 2), "read no register 98..99");
        assert_eq!(read(3, 2), "read chip-id (3..4 of it)");
        assert_eq!(read(10, 0), "read no register at 10");
        assert_eq!(read(0, 61), "read device-code to present-position 1..7 (0..60)");
        let answer = Traffic::Answer { address: 54, values: vec![90, 90, 65, 90, 90, 90, 80] };
        assert_eq!(answer.to_string(), "answer present-position 1..7 = 90 90 65 90 90 90 80 °");
    }

    #[test]
    fn values_are_followed_by_their_meaning() {
        let write = |address, values: &[u8]| Traffic::Write { address, values: values.to_vec() }.to_string();
        assert_eq!(write(28, &[0, 1]), "write eeprom-lock = 0 (open), motor-state = 1 (servo)");
        assert_eq!(write(13, &[0x85, 3]), "write offset 1..2 = -5 3 °");
        assert_eq!(write(53, &[30]), "write feedback-frequency = 30 Hz");
        assert_eq!(write(254, &[74]), "write supply-voltage = 74 (7.4 V)");
        assert_eq!(write(46, &[]), "write no register at 46");
        assert_eq!(write(246, &[1, 1]), "write frames-accepted = 257");
        assert_eq!(write(2, b"SIM\0\0\x01"), "write chip-id = 53494D000001");
    }

    #[test]
    fn writes_of_map_21_read_by_its_table() {
        let write =
            |address, values: &[u8]| Traffic::WriteMap21 { address, values: values.to_vec() }.to_string();
        assert_eq!(write(13, &[126, 254]), "write (map 2.1) offset 1..2 = -2 -2 °");
        let ik6 = write(54, &[0x03, 0xCE, 0x04, 0xB9, 0x04, 0x32, 0x80, 0x80, 0x7F]);
        assert_eq!(ik6, "write (map 2.1) tip-position = -50 185 50 mm, tool-direction = 0 0 -1");
        assert_eq!(write(68, &[4]), "write (map 2.1) wrist-position (68 of it) = 4");
        assert_eq!(write(29, &[2]), "write (map 2.1) motor-state = 2 (forceless)");
        assert_eq!(write(53, &[0]), "write (map 2.1) end-length = 0");
        assert_eq!(write(82, &[30]), "write (map 2.1) angle-feedback-frequency = 30 Hz");
        assert_eq!(write(0, &[]), "write (map 2.1) no register at 0");
    }

    #[test]
    fn reports_and_alarms_have_words() {
        let report =
            |address, values: &[u8]| Traffic::Report { address, values: values.to_vec() }.to_string();
        let angles = "report present-angle 1..7 = 90 90 65 90 90 90 80 °";
        assert_eq!(report(83, &[90, 90, 65, 90, 90, 90, 80]), angles);
        assert_eq!(report(91, &[128, 93]), "report present-load 1..2 = 0 -35");
        assert_eq!(Traffic::Alarm { level: 1, kind: 6 }.to_string(), "alarm: level 1, IK6 has no solution");
        assert_eq!(Traffic::Alarm { level: 0, kind: 1 }.to_string(), "alarm: level 0, kind 1");
    }

    #[test]
    fn noise_is_shown_in_hexadecimal() {
        assert_eq!(Traffic::Noise(vec![1]).to_string(), "1 byte that is no frame: 01");
        assert_eq!(Traffic::Noise(vec![1, 0xAB]).to_string(), "2 bytes that are no frame: 01 AB");
        let damaged = Traffic::Noise(vec![0xAA, 0x77, 3, 1]).to_string();
        assert_eq!(damaged, "a damaged frame or a part of one, 4 bytes: AA 77 03 01");
        assert!(Traffic::Noise(vec![0; 40]).to_string().ends_with("00 .."));
        let far = Traffic::TooFar { address: 250, count: 7 }.to_string();
        assert_eq!(far, "7 registers from 250 on, but the last register is 255");
    }
}
