//! The reports that an arm sends without a request (D14, M4): which frames are reports, how often they come, and those that
//! the caller has not taken yet.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use protocol_core::registers::map::PRESENT_POSITION;
use protocol_core::registers::map21::Map;

use crate::frame_port::Received;
use crate::identity::Firmware;
use crate::map_view::MapView;
use crate::span::Span;
use crate::units::Angle;

/// Reports kept until the caller takes them: 20 s at the highest rate (D14). The oldest are dropped first.
const REPORTS_KEPT: usize = 1_000;

/// A report has 14 bytes of ten bits, and reports fill at most half of the line (D14).
const BITS_PER_REPORT: u32 = 2 * 14 * 10;

/// The present positions. The arm sends them without a request (D14).
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
}

/// The reports that were received and not taken yet, oldest first.
#[derive(Debug, Default)]
pub(crate) struct ReportQueue(VecDeque<Report>);

impl ReportQueue {
    /// Keeps a frame if it is a report.
    pub(crate) fn keep(&mut self, received: &Received, view: MapView) {
        let report = match (received, view.map) {
            (Received::Reply(report), Map::V22) | (Received::Report(report), Map::V21) => report,
            _ => return,
        };
        if report.span() != view.report() {
            return;
        }
        if self.0.len() >= REPORTS_KEPT {
            self.0.pop_front();
        }
        let positions = view.view(report, Span::of(&PRESENT_POSITION));
        let positions = positions.joints(&PRESENT_POSITION).map(Angle::from_register);
        self.0.push_back(Report { received: Instant::now(), positions });
    }

    /// Takes the oldest report.
    pub(crate) fn pop(&mut self) -> Option<Report> {
        self.0.pop_front()
    }

    /// Takes all reports.
    pub(crate) fn drain(&mut self) -> impl Iterator<Item = Report> {
        self.0.drain(..)
    }
}

/// The time between two reports at this frequency and baud rate.
pub(crate) fn report_period(firmware: Firmware, hertz: u8, baud: u32) -> Duration {
    let hertz = u32::from(hertz.max(1));
    match firmware {
        // It sends when more than 1000 ms / hertz have passed.
        Firmware::Makers => Duration::from_millis(u64::from(1_000 / hertz) + 1),
        Firmware::Ours | Firmware::Unknown => {
            Duration::from_secs(1) / hertz.min(baud / BITS_PER_REPORT).max(1)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_period_of_reports_depends_on_firmware_and_line() {
        let second = Duration::from_secs(1);
        assert_eq!(report_period(Firmware::Ours, 50, 115_200), second / 50);
        assert_eq!(report_period(Firmware::Ours, 50, 9_600), second / 34);
        assert_eq!(report_period(Firmware::Makers, 30, 115_200), Duration::from_millis(34));
    }
}
