//! Goes to the first point of a stream or a recording.
//!
//! ```text
//!   Arm::standing ──▶ Approach::plan ──▶ SetPointStream::approach, or frames in whole degrees
//! ```

use std::time::Duration;

use protocol_core::registers::map::{EXTENDED_VERSION, FINE_TARGET, PRESENT_POSITION, SPEED};

use super::drive::{POLL_PERIOD, drive};
use super::error::MoveError;
use super::observer::Observer;
use crate::approach::{Approach, Standing};
use crate::arm::Arm;
use crate::error::Error;
use crate::movement_run::MovementRun;
use crate::stream::SetPointStream;
use host_link::{Snapshot, Span};

/// The set-points reach the last point of a stream within this time.
const ARRIVAL_TIMEOUT: Duration = Duration::from_secs(100);
/// Afterwards the joints have this time to settle.
const SETTLE_TIMEOUT: Duration = Duration::from_secs(2);

impl Arm {
    /// Where the arm stands: in hundredths of a degree with the extended block, otherwise in whole degrees.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn standing(&mut self) -> Result<Standing, Error> {
        let mut registers = Snapshot { address: 0, values: vec![0; 256] };
        registers.put(&self.read_span(Span::between(&SPEED, &PRESENT_POSITION))?);
        if self.has_extended_block()? {
            registers.put(&self.read_span(Span::between(&FINE_TARGET, &EXTENDED_VERSION))?);
        }
        Ok(Standing::of(&registers))
    }
}

impl SetPointStream<'_> {
    /// Streams the way to a first point, if its duration is not 0. Afterwards the next point is due.
    ///
    /// # Errors
    /// The observer ended the approach, this program paused for too long, the port failed, or the arm does not follow:
    /// [`SetPointStream::check`]. The joints then stop at the last point.
    pub fn approach(&mut self, way: &Approach, observer: &mut dyn Observer) -> Result<(), MoveError> {
        if way.duration().is_zero() {
            return Ok(());
        }
        let run = MovementRun::approach(*way, self.arm().elapsed(), self.period());
        drive(run, self, observer, Self::wait_until)
    }

    /// Waits until the joints of the stream stand at their last points. `wait` waits until a time of [`Arm::elapsed`].
    ///
    /// # Errors
    /// A joint does not arrive: [`MoveError::NotReached`], or the errors of [`SetPointStream::check`]. Also the errors of `wait`,
    /// and failed exchanges.
    pub fn wait_until_arrived<E: From<MoveError>>(
        &mut self,
        mut wait: impl FnMut(&mut Self, Duration) -> Result<(), E>,
    ) -> Result<(), E> {
        let deadline = self.arm().elapsed() + ARRIVAL_TIMEOUT;
        // The set-points reach a point at most two periods and a control cycle after its frame (D23).
        let mut next = self.arm().elapsed() + 2 * self.period();
        loop {
            wait(self, next)?;
            // Each read also keeps the watchdog of the arm from acting.
            let state = self.check_now().map_err(MoveError::from)?;
            let now = self.arm().elapsed();
            if now >= deadline || state.moving.is_none_or(|moving| moving & !state.missing == 0) {
                break;
            }
            next = now + self.period();
        }
        self.end_check();
        let deadline = self.arm().elapsed() + SETTLE_TIMEOUT;
        loop {
            self.check_now().map_err(MoveError::from)?;
            let joints = self.joints();
            let health = self.arm().health().map_err(MoveError::from)?;
            let (now, away) = (self.arm().elapsed(), health.away_from_targets(joints));
            if away.is_empty() {
                return Ok(());
            }
            if now >= deadline {
                return Err(MoveError::NotReached { away, missing: 0, retargeted: 0 }.into());
            }
            wait(self, now + self.period())?;
        }
    }

    /// Waits until a time of [`Arm::elapsed`], and keeps the watchdog of the arm from acting. Reports are dropped.
    ///
    /// # Errors
    /// The observer ended the wait, or the port failed.
    pub fn wait_until(&mut self, end: Duration, observer: &mut dyn Observer) -> Result<(), MoveError> {
        loop {
            if !observer.goes_on() {
                return Err(MoveError::Interrupted);
            }
            let left = end.saturating_sub(self.arm().elapsed());
            if left.is_zero() {
                return Ok(());
            }
            // Short reads of the observer take their turn here.
            observer.pause(self.arm(), Duration::ZERO);
            // Reports that come meanwhile would fill the buffer of the port.
            self.arm().next_report(left.min(POLL_PERIOD))?;
            self.keep_alive()?;
        }
    }
}
