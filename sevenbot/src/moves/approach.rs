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

impl Arm {
    /// Where the arm stands, as exact as it tells.
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
    /// Streams the way to a first point, if there is one. Afterwards the next point is due.
    ///
    /// # Errors
    /// The observer ended it, the port failed, or the arm does not follow: [`SetPointStream::check`]. The joints then stop at
    /// the last point.
    pub fn approach(&mut self, way: &Approach, observer: &mut dyn Observer) -> Result<(), MoveError> {
        if way.duration().is_zero() {
            return Ok(());
        }
        let run = MovementRun::approach(*way, self.arm().elapsed(), self.period());
        drive(run, self, observer, Self::wait_until)
    }

    fn wait_until(&mut self, end: Duration, observer: &mut dyn Observer) -> Result<(), MoveError> {
        loop {
            if !observer.goes_on() {
                return Err(MoveError::Interrupted);
            }
            let left = end.saturating_sub(self.arm().elapsed());
            if left.is_zero() {
                return Ok(());
            }
            // Reports that come meanwhile would fill the buffer of the port.
            self.arm().next_report(left.min(POLL_PERIOD))?;
            self.keep_alive()?;
        }
    }
}
