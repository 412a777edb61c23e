//! Goes to the first point of a stream or a recording.
//!
//! ```text
//!   Arm::standing ──▶ Approach::plan ──▶ SetPointStream::approach, or frames in whole degrees
//! ```

use std::time::{Duration, Instant};

use protocol_core::registers::Joint;
use protocol_core::registers::map::{PRESENT_POSITION, SPEED, TARGET_POSITION};

use super::error::MoveError;
use super::observer::Observer;
use crate::approach::{Approach, Standing};
use crate::arm::Arm;
use crate::error::Error;
use crate::fine_angle::FineAngle;
use crate::stream::SetPointStream;
use crate::units::Speed;
use host_link::Span;

/// The longest time between two questions to the observer.
const POLL_PERIOD: Duration = Duration::from_millis(20);

impl Arm {
    /// Where the arm stands, as exact as it tells.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn standing(&mut self) -> Result<Standing, Error> {
        let registers = self.read_span(Span::between(&SPEED, &PRESENT_POSITION))?;
        let speeds = Joint::ALL.map(|joint| registers.at(SPEED.of(joint)));
        let speeds = speeds.map(|steps| Speed::from_steps(steps).unwrap_or(Speed::MAXIMUM));
        let Some(fine) = self.fine_state_if_served()? else {
            let [measured, targets] =
                [&PRESENT_POSITION, &TARGET_POSITION].map(|row| registers.joints(row).map(f64::from));
            return Ok(Standing { measured: measured.map(Some), targets, speeds });
        };
        let measured = fine.positions.map(|angle| angle.map(FineAngle::degrees));
        Ok(Standing { measured, targets: self.fine_targets()?.map(FineAngle::degrees), speeds })
    }
}

impl SetPointStream<'_> {
    /// Streams the way to a first point, if there is one. Afterwards the next point is due.
    ///
    /// # Errors
    /// The observer ended it, or the port failed. The joints then stop at the last point.
    pub fn approach(&mut self, way: &Approach, observer: &mut dyn Observer) -> Result<(), MoveError> {
        if way.duration().is_zero() {
            return Ok(());
        }
        let (start, period) = (self.arm().now(), self.period());
        let mut number = 0;
        loop {
            let time = period.saturating_mul(number);
            self.wait_until(start + time, observer)?;
            if time >= way.duration() + period {
                return Ok(());
            }
            self.send(&way.at(time))?;
            number = number.saturating_add(1);
        }
    }

    fn wait_until(&mut self, end: Instant, observer: &mut dyn Observer) -> Result<(), MoveError> {
        loop {
            if !observer.goes_on() {
                return Err(MoveError::Interrupted);
            }
            let left = end.saturating_duration_since(self.arm().now());
            if left.is_zero() {
                return Ok(());
            }
            // Reports that come meanwhile would fill the buffer of the port.
            self.arm().next_report(left.min(POLL_PERIOD))?;
            self.keep_alive()?;
        }
    }
}
