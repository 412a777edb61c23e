//! The streams of reports: register 53 of map 2.2, or registers 82 and 90 of map 2.1 (D14, M4).
//!
//! The streams of both maps never run at the same time. The streams of map 2.1 share the half of the line that D14 allows.
//! This file does not know the values in a report.

use protocol_core::registers::map::{FEEDBACK_FREQUENCY, PRESENT_POSITION};
use protocol_core::registers::map21::{
    ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY, Map, PRESENT_ANGLE, PRESENT_LOAD,
};
use protocol_core::registers::{Register, RegisterFile};
use protocol_core::time::Instant;

use crate::report_timer::{ReportTimer, highest_frequency};

/// What a report holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ReportKind {
    /// The present positions of map 2.2.
    Positions,
    /// The present angles of map 2.1.
    Angles,
    /// The present loads of map 2.1.
    Loads,
}

impl ReportKind {
    /// The registers in the report.
    pub(crate) const fn registers(self) -> Register {
        match self {
            Self::Positions => PRESENT_POSITION,
            Self::Angles => PRESENT_ANGLE,
            Self::Loads => PRESENT_LOAD,
        }
    }

    /// The map whose form the report has.
    pub(crate) const fn map(self) -> Map {
        match self {
            Self::Positions => Map::V22,
            Self::Angles | Self::Loads => Map::V21,
        }
    }
}

/// The streams that run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reports {
    /// The map of `joints`.
    map: Map,
    /// Positions in map 2.2, angles in map 2.1.
    joints: ReportTimer,
    loads: ReportTimer,
    /// When the next report of either stream is due.
    due: Instant,
}

impl Reports {
    /// No stream.
    pub(crate) const OFF: Self =
        Self { map: Map::V22, joints: ReportTimer::OFF, loads: ReportTimer::OFF, due: Instant::FAR_FUTURE };

    /// Sets the frequencies that the registers hold from `now` on. `baud` is in bits per second.
    pub(crate) fn set(&mut self, now: Instant, registers: &RegisterFile, baud: u32) {
        let frequencies =
            [ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY].map(|row| registers.get(row.address));
        let (map, joints, loads) = if frequencies == [0, 0] {
            (Map::V22, registers.get(FEEDBACK_FREQUENCY.address), 0)
        } else {
            let [angles, loads] = shares(frequencies, highest_frequency(baud));
            (Map::V21, angles, loads)
        };
        if map != self.map {
            (self.map, self.joints) = (map, ReportTimer::OFF);
        }
        self.joints.set(now, joints, baud);
        self.loads.set(now, loads, baud);
        self.due = self.joints.due().min(self.loads.due());
    }

    /// When the next report is due.
    pub(crate) const fn due(&self) -> Instant {
        self.due
    }

    /// The report that is due, once for each report.
    pub(crate) fn poll_due(&mut self, now: Instant) -> Option<ReportKind> {
        if self.due > now {
            return None;
        }
        let kind = if !self.joints.poll_due(now) {
            self.loads.poll_due(now).then_some(ReportKind::Loads)
        } else if self.map == Map::V22 {
            Some(ReportKind::Positions)
        } else {
            Some(ReportKind::Angles)
        };
        self.due = self.joints.due().min(self.loads.due());
        kind
    }
}

/// Two frequencies in Hz that are together at most `most`, in the ratio of the wanted ones. A wanted one keeps at least
/// 1 Hz.
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

    /// How many reports of each kind there are in a second.
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
