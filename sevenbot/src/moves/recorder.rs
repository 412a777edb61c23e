//! The poses of an arm that moves or is guided, with the times of their measurement.

use std::time::{Duration, Instant};

use protocol_core::registers::map::FEEDBACK_FREQUENCY;

use super::error::MoveError;
use super::report_clock::ReportClock;
use crate::arm::Arm;
use crate::fine_angle::FineAngle;
use crate::health::MoveCheck;
use host_link::Span;

/// Without a report for this time, the arm has stopped reporting. The lowest rate is 1 Hz.
const REPORT_TIMEOUT: Duration = Duration::from_secs(3);

/// A pose from one report of the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordedPose {
    /// The time of the measurement, since the first pose.
    pub time: Duration,
    /// When the report arrived, on the clock of the arm's line.
    pub received: Instant,
    /// The angles, joint 1 first.
    pub pose: [FineAngle; 7],
}

/// Turns the reports of an arm into poses.
///
/// ```
/// use sevenbot::moves::{MoveError, Recorder};
/// use sevenbot::simulated::{self, SimulationConfig};
/// use std::time::Duration;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let (mut arm, _) = simulated::arm(SimulationConfig::default())?;
/// let content = arm.exact_positions()?;
/// let poses = arm.with_reports(50, content, |arm| {
///     let mut recorder = Recorder::begin(arm, 50, content)?;
///     (0..10).map(|_| recorder.next(arm, Duration::from_secs(1))).collect::<Result<Vec<_>, MoveError>>()
/// })?;
/// let last = poses.into_iter().flatten().last().ok_or("no pose")?;
/// assert_eq!((last.time.as_millis(), last.pose[6].nearest().degrees()), (180, 80));
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Recorder {
    clock: ReportClock,
    last_report: Instant,
    check: MoveCheck,
}

impl Recorder {
    /// For the reports of [`Arm::with_reports`] with the same arguments. Drops reports that were received before, because they
    /// may be of an earlier move.
    ///
    /// # Errors
    /// A servo does not answer, so that its position is unknown: [`MoveError::Problems`]. Also the errors of [`Arm::read`].
    pub fn begin(arm: &mut Arm, hz: u8, content: u8) -> Result<Self, MoveError> {
        let mut check = MoveCheck::of_positions(arm);
        check.check(arm)?;
        arm.reports().for_each(drop);
        Ok(Self { clock: ReportClock::new(arm.report_period(hz, content)), last_report: arm.now(), check })
    }

    /// The next pose; `None` if none arrives within `timeout`.
    ///
    /// # Errors
    /// A servo does not answer, so that its position is unknown, or the controller restarted: [`MoveError::Problems`]. An
    /// exchange failed, or no report has arrived for three seconds.
    pub fn next(&mut self, arm: &mut Arm, timeout: Duration) -> Result<Option<RecordedPose>, MoveError> {
        self.check.poll(arm)?;
        if let Some(report) = arm.next_report(timeout)? {
            self.last_report = report.received;
            let received = report.received;
            return Ok(Some(RecordedPose {
                time: self.clock.time_of(received),
                received,
                pose: report.pose(),
            }));
        }
        if arm.now() > self.last_report + REPORT_TIMEOUT {
            // Does the arm answer at all?
            arm.read_span(Span::of(&FEEDBACK_FREQUENCY))?;
            return Err(MoveError::ReportsStopped);
        }
        Ok(None)
    }
}
