//! The streams of reports: register 53 of map 2.2, or registers 82 and 90 of map 2.1 ([D14](protocol_core::decisions#d14),
//! [M4](protocol_core::decisions#m4)).
//!
//! Streams of the two maps never run at the same time. The streams of map 2.1 share the half of the line that D14
//! allows. This file does not know the values in a report.

use protocol_core::registers::RegisterFile;
use protocol_core::registers::map::{FEEDBACK_FREQUENCY, REPORT_CONTENT};
use protocol_core::registers::map21::{
    ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY, PRESENT_ANGLE, PRESENT_LOAD,
};
use protocol_core::report_kind::ReportKind;
use protocol_core::time::Instant;

use crate::report_timer::{ReportTimer, highest_frequency};

#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Reports {
    /// What the reports of `joints` hold.
    kind: ReportKind,
    /// Positions in map 2.2, angles in map 2.1.
    joints: ReportTimer,
    loads: ReportTimer,
    /// When the next report of either stream is due.
    due: Instant,
}

impl Reports {
    pub(crate) const OFF: Self = Self {
        kind: ReportKind::Positions,
        joints: ReportTimer::OFF,
        loads: ReportTimer::OFF,
        due: Instant::FAR_FUTURE,
    };

    /// Takes the frequencies from the registers. They apply from `now` on. `baud` is in bits per second.
    pub(crate) fn set(&mut self, now: Instant, registers: &RegisterFile, baud: u32) {
        let frequencies =
            [ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY].map(|row| registers.get(row.address));
        let (kind, joints, loads) = if frequencies == [0, 0] {
            let kind = ReportKind::of_content(registers.get(REPORT_CONTENT.address));
            (kind, registers.get(FEEDBACK_FREQUENCY.address), 0)
        } else {
            let [angles, loads] = shares(frequencies, highest_frequency(baud, PRESENT_ANGLE.count));
            (ReportKind::Angles, angles, loads)
        };
        if kind.map() != self.kind.map() {
            self.joints = ReportTimer::OFF;
        }
        self.kind = kind;
        let (_, count) = kind.registers();
        self.joints.set(now, joints, highest_frequency(baud, count));
        self.loads.set(now, loads, highest_frequency(baud, PRESENT_LOAD.count));
        self.due = self.joints.due().min(self.loads.due());
    }

    /// When the next report is due.
    pub(crate) const fn due(&self) -> Instant {
        self.due
    }

    /// The kind of the report that is due, once for each report; `None` if none is due.
    pub(crate) fn poll_due(&mut self, now: Instant) -> Option<ReportKind> {
        if self.due > now {
            return None;
        }
        let kind = if !self.joints.poll_due(now) {
            self.loads.poll_due(now).then_some(ReportKind::Loads)
        } else {
            Some(self.kind)
        };
        self.due = self.joints.due().min(self.loads.due());
        kind
    }
}

/// Two frequencies in Hz that are together at most `most`, in the ratio of the wanted ones. A stream that is wanted
/// keeps at least 1 Hz.
fn shares(wanted: [u8; 2], most: u32) -> [u8; 2] {
    let sum: u32 = wanted.iter().map(|&frequency| u32::from(frequency)).sum();
    if sum <= most {
        return wanted;
    }
    wanted.map(|frequency| {
        let share = (u32::from(frequency) * most).checked_div(sum).and_then(|share| u8::try_from(share).ok());
        share.unwrap_or(frequency).max(frequency.min(1))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::registers::Register;

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    fn registers(values: [(Register, u8); 2]) -> RegisterFile {
        let mut registers = RegisterFile::new([0; 6], None);
        for (row, frequency) in values {
            registers.set(row.address, frequency);
        }
        registers
    }

    /// How many reports of positions, angles and loads there are in a second.
    fn in_a_second(registers: &RegisterFile, baud: u32) -> [usize; 3] {
        let mut reports = Reports::OFF;
        reports.set(at(0), registers, baud);
        let mut kinds = Vec::new();
        for now in (0..=1_000_000).step_by(500).map(at) {
            kinds.extend(std::iter::from_fn(|| reports.poll_due(now)));
        }
        [ReportKind::Positions, ReportKind::Angles, ReportKind::Loads]
            .map(|kind| kinds.iter().filter(|&&found| found == kind).count())
    }

    #[test]
    fn m04_each_stream_has_its_frequency() {
        let both = registers([(ANGLE_FEEDBACK_FREQUENCY, 30), (LOAD_FEEDBACK_FREQUENCY, 5)]);
        assert_eq!(in_a_second(&both, 115_200), [0, 30, 5]);
        let positions = registers([(FEEDBACK_FREQUENCY, 50), (LOAD_FEEDBACK_FREQUENCY, 0)]);
        assert_eq!(in_a_second(&positions, 115_200), [50, 0, 0]);
    }

    #[test]
    fn d26_a_report_holds_what_register_189_says() {
        let kinds = [(0, ReportKind::Positions), (1, ReportKind::FinePositions), (2, ReportKind::FineState)];
        for (content, kind) in kinds {
            let mut reports = Reports::OFF;
            let frequency = (FEEDBACK_FREQUENCY, 50);
            reports.set(at(0), &registers([frequency, (REPORT_CONTENT, content)]), 9_600);
            let count = (0..=1_000_000).step_by(500).filter_map(|now| reports.poll_due(at(now)));
            let most = [34, 22, 9][usize::from(content)];
            assert_eq!(count.filter(|&found| found == kind).count(), most, "{kind:?}");
        }
        assert_eq!(kinds.map(|(_, kind)| kind.registers()), [(54, 7), (142, 14), (142, 42)]);
        assert_eq!(kinds.map(|(_, kind)| kind.is_extended()), [false, true, true]);
    }

    #[test]
    fn m04_both_streams_together_take_at_most_half_the_line() {
        let both = registers([(ANGLE_FEEDBACK_FREQUENCY, 100), (LOAD_FEEDBACK_FREQUENCY, 100)]);
        assert_eq!(in_a_second(&both, 9_600), [0, 17, 17]);
        assert_eq!((shares([100, 1], 34), shares([1, 100], 34)), ([33, 1], [1, 33]));
        assert_eq!((shares([100, 0], 34), shares([0, 0], 34)), ([34, 0], [0, 0]));
        assert_eq!((shares([20, 14], 34), shares([100, 100], 411)), ([20, 14], [100, 100]));
        for (angles, loads) in (0..=100).flat_map(|angles| (0..=100).map(move |loads| (angles, loads))) {
            let [a, b] = shares([angles, loads], 34);
            assert!(a + b <= 34 && (a == 0) == (angles == 0) && (b == 0) == (loads == 0), "{angles} {loads}");
        }
    }
}
