//! An observation as a row of numbers.

use std::ops::Range;

use super::one_arm::SteppedArm;
use crate::cartesian::TipPose;
use crate::fine_angle::FineAngle;

/// How many numbers an observation has.
pub const WIDTH: usize = 32;
/// Measured positions in degrees; NaN for a joint that was not measured.
pub const POSITIONS: Range<usize> = 0..7;
/// Measured velocities in degrees per second.
pub const VELOCITIES: Range<usize> = 7..14;
/// Loads in percent of the stall torque.
pub const LOADS: Range<usize> = 14..21;
/// The tip in millimetres, x, y, z, by the measured positions; NaN if one of joints 1 to 5 was not measured. Only z does not need
/// joint 1.
pub const TIP: Range<usize> = 21..24;
/// 1 for a joint that an obstacle keeps from its target, otherwise 0.
pub const BLOCKED: Range<usize> = 24..31;
/// Seconds since the last reply: 0 if the read of the last step was answered.
pub const AGE: Range<usize> = 31..32;

/// A number of an array: `f32` or `f64`.
pub trait Number: Copy + Send + Sync {
    /// The same number as `f64`, without loss.
    fn widen(self) -> f64;
    /// The nearest number of this type.
    fn nearest(number: f64) -> Self;
}

impl Number for f64 {
    fn widen(self) -> f64 {
        self
    }

    fn nearest(number: f64) -> Self {
        number
    }
}

impl Number for f32 {
    fn widen(self) -> f64 {
        self.into()
    }

    #[expect(clippy::cast_possible_truncation, reason = "the nearest number is wanted")]
    fn nearest(number: f64) -> Self {
        number as Self
    }
}

impl SteppedArm {
    /// Writes what the host knows of the arm into a row of [`WIDTH`] numbers.
    pub(crate) fn write_row<N: Number>(&self, row: &mut [N]) {
        let state = self.state();
        let positions = state.positions.map(|angle| angle.map_or(f64::NAN, FineAngle::degrees));
        let tenths = |values: [i16; 7]| values.map(|value| f64::from(value) / 10.0);
        let bits = (0..7).map(|bit| f64::from(self.blocked() >> bit & 1));
        let age = std::time::Duration::from_micros(self.age().as_micros()).as_secs_f64();
        let numbers = positions.into_iter().chain(tenths(state.velocities)).chain(tenths(state.loads));
        let numbers = numbers.chain(tip(positions)).chain(bits).chain([age]);
        row.iter_mut().zip(numbers).for_each(|(place, number)| *place = N::nearest(number));
    }
}

fn tip([t1, t2, t3, t4, t5, t6, _]: [f64; 7]) -> [f64; 3] {
    let tip = TipPose::at([t1, t2, t3, t4, t5, t6]).tip;
    [tip.x, tip.y, tip.z]
}
