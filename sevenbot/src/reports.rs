//! The reports that an arm sends without a request (D14, M4): which frames are reports, how often they come, and those that
//! the caller has not taken yet.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use protocol_core::registers::map::{FINE_POSITION, PRESENT_POSITION};
use protocol_core::registers::map21::Map;
use protocol_core::report_kind::ReportKind;

use crate::fine_angle::FineAngle;
use crate::fine_state::FineState;
use crate::identity::Firmware;
use crate::map_view::MapView;
use crate::units::Angle;
use host_link::{Snapshot, Span};

/// Reports kept until the caller takes them: 20 s at 50 Hz, the highest rate of map 2.2 (D14). The oldest are dropped first.
const REPORTS_KEPT: usize = 1_000;

/// The number of bytes in a report besides its values.
const REPORT_OVERHEAD: u32 = 7;
/// Ten bits of each byte, counted twice: reports fill at most half of the line (D14).
const BITS_PER_BYTE: u32 = 2 * 10;

/// The present positions, and velocities and loads if register 189 asks for them. The arm sends reports without a request
/// ([D14](protocol_core::decisions#d14), [D26](protocol_core::decisions#d26)).
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use std::time::Duration;
///
/// let mut arm = sevenbot::Arm::open("/dev/ttyUSB0", 115_200)?;
/// arm.write(sevenbot::map::FEEDBACK_FREQUENCY.address, &[30])?;
/// while let Some(report) = arm.next_report(Duration::from_secs(1))? {
///     println!("{:?}: {:?}", report.received, report.positions);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Report {
    /// When it was read from the port.
    pub received: Instant,
    /// The positions, joint 1 first.
    pub positions: [Angle; 7],
    /// Positions in hundredths of a degree, velocities and loads; `None` in a report of whole degrees. Velocities and loads
    /// are 0 in a report without them.
    pub fine: Option<FineState>,
}

impl Report {
    /// The positions, joint 1 first, as exactly as the report has them. A joint that was not measured yet is at 0.
    #[must_use]
    pub fn pose(&self) -> [FineAngle; 7] {
        let mut pose = self.positions.map(FineAngle::from);
        let fine = self.fine.map_or([None; 7], |fine| fine.positions);
        for (angle, fine) in pose.iter_mut().zip(fine) {
            *angle = fine.unwrap_or(*angle);
        }
        pose
    }

    /// From the values of a report, at this time.
    fn new(report: &Snapshot, view: MapView, received: Instant) -> Self {
        if FINE_POSITION.address != report.address {
            let positions = view.view(report, Span::of(&PRESENT_POSITION)).joints(&PRESENT_POSITION);
            return Self { received, positions: positions.map(Angle::from_register), fine: None };
        }
        let fine = FineState::new(report);
        let whole = |angle: Option<FineAngle>| angle.map_or(Angle::from_register(0), FineAngle::nearest);
        Self { received, positions: fine.positions.map(whole), fine: Some(fine) }
    }
}

/// The reports that were received and not taken yet, oldest first.
#[derive(Debug, Default)]
pub(crate) struct ReportQueue(VecDeque<Report>);

impl ReportQueue {
    /// Keeps a report that arrived at `now`, if the map of this arm has such a report.
    pub(crate) fn keep(&mut self, map: Map, report: &Snapshot, view: MapView, now: Instant) {
        if map != view.map || !view.reports().contains(&report.span()) {
            return;
        }
        if self.0.len() >= REPORTS_KEPT {
            self.0.pop_front();
        }
        self.0.push_back(Report::new(report, view, now));
    }

    /// Takes the oldest report.
    pub(crate) fn pop(&mut self) -> Option<Report> {
        self.0.pop_front()
    }

    pub(crate) fn drain(&mut self) -> impl Iterator<Item = Report> {
        self.0.drain(..)
    }
}

/// The time between two reports of this content, see [`ReportKind::of_content`], at this frequency and baud rate.
pub(crate) fn report_period(firmware: Firmware, hertz: u8, content: u8, baud: u32) -> Duration {
    let hertz = u32::from(hertz.max(1));
    let (_, count) = ReportKind::of_content(content).registers();
    let bits = BITS_PER_BYTE * (REPORT_OVERHEAD + u32::from(count));
    match firmware {
        // The maker's firmware sends a report when more than 1000 ms / hertz have passed.
        Firmware::Makers => Duration::from_millis(u64::from(1_000 / hertz) + 1),
        Firmware::Ours | Firmware::Unknown => Duration::from_secs(1) / hertz.min(baud / bits).max(1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_period_of_reports_depends_on_firmware_content_and_line() {
        let second = Duration::from_secs(1);
        assert_eq!(report_period(Firmware::Ours, 50, 0, 115_200), second / 50);
        assert_eq!(report_period(Firmware::Ours, 50, 0, 9_600), second / 34);
        assert_eq!(report_period(Firmware::Ours, 50, 1, 9_600), second / 22);
        assert_eq!(report_period(Firmware::Ours, 50, 2, 9_600), second / 9);
        assert_eq!(report_period(Firmware::Makers, 30, 0, 115_200), Duration::from_millis(34));
    }

    #[test]
    fn a_report_has_the_positions_that_register_189_asks_for() {
        let view = MapView { map: Map::V22, firmware: Firmware::Ours };
        let report =
            |address, values: Vec<u8>| Report::new(&Snapshot { address, values }, view, Instant::now());
        let whole = report(54, vec![90, 91, 92, 93, 94, 95, 96]);
        assert_eq!((whole.fine, whole.pose()[1].hundredths()), (None, 9_100));
        let mut values = [0x41, 0x23].repeat(7);
        values[12..].copy_from_slice(&[0xFF, 0xFF]);
        let fine = report(142, values);
        assert_eq!((fine.pose()[0].hundredths(), fine.positions[0].degrees()), (9_025, 90));
        assert_eq!((fine.pose()[6].hundredths(), fine.fine.map(|fine| fine.positions[6])), (0, Some(None)));
    }
}
