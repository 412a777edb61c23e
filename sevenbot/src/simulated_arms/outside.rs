//! Arms whose joints another simulation moves: measurements in, set-points out.

use std::ops::Range;

use arm_sim::plant::OutsideState;
use arm_sim::{Joint, Simulation};
use motion_core::servo_bus::Torque;
use protocol_core::time::{Duration, Instant};

use super::observation::Number;
use super::{JOINTS, StepError};

/// The numbers of a measurement: seven positions in degrees, seven velocities in degrees per second, seven loads in percent of
/// the stall torque, as in an observation. A joint whose position is NaN is moved by the simulation here.
pub const MEASURED: usize = 3 * JOINTS;
/// The numbers of what the servos want.
pub const WANTED: usize = 3 * JOINTS;
/// The angles that the servos' control aims at, in degrees.
pub const SET_POINTS: Range<usize> = 0..7;
/// Their velocities in degrees per second.
pub const SET_VELOCITIES: Range<usize> = 7..14;
/// 1: the motor drives its joint; 2: it damps it; 0: it does neither.
pub const DRIVES: Range<usize> = 14..21;

/// Measurements beyond this are no degrees, and no degrees per second.
const MOST: f64 = 100_000.0;

/// The first measurement that is no number where the position is one.
pub(super) fn check<T: Number>(measured: &[T]) -> Result<(), StepError> {
    for (arm, row) in measured.as_chunks::<MEASURED>().0.iter().enumerate() {
        for joint in 0..JOINTS {
            let values = [0, 1, 2].map(|kind| row[kind * JOINTS + joint].widen());
            let wrong = values.into_iter().find(|value| !(-MOST..=MOST).contains(value));
            if let Some(value) = wrong.filter(|_| !values[0].is_nan()) {
                return Err(StepError::Measured { arm, joint: joint + 1, value });
            }
        }
    }
    Ok(())
}

/// Tells the arm what was measured, lets time pass, and writes what the servos want.
pub(super) fn exchange<T: Number, N: Number>(
    arm: &mut Simulation,
    measured: &[T],
    time: Duration,
    wanted: &mut [N],
) {
    for (joint, index) in Joint::ALL.into_iter().zip(0..) {
        let value = |kind: usize| measured.get(kind * JOINTS + index).map_or(f64::NAN, |value| value.widen());
        arm.plant_mut().measure(joint, state([0, 1, 2].map(value)));
    }
    let set_points =
        |arm: &Simulation| Joint::ALL.map(|joint| f64::from(arm.plant().set_point(joint)) / 1_000.0);
    let before = set_points(arm);
    arm.advance(time);
    let after = set_points(arm);
    let seconds = (Instant::ZERO + time).as_micros() as f64 / 1e6;
    let velocities = after.into_iter().zip(before).map(|(after, before)| (after - before) / seconds);
    let drives = Joint::ALL.map(|joint| drive(arm.plant().torque(joint)));
    let numbers = after.into_iter().chain(velocities).chain(drives);
    wanted.iter_mut().zip(numbers).for_each(|(place, number)| *place = N::nearest(number));
}

#[expect(clippy::cast_possible_truncation, reason = "checked to be small")]
fn state([position, velocity, load]: [f64; 3]) -> Option<OutsideState> {
    let thousandths = |value: f64| (value * 1_000.0).round() as i32;
    (!position.is_nan()).then(|| OutsideState {
        angle: thousandths(position),
        velocity: thousandths(velocity),
        load: (load.clamp(-100.0, 100.0) * 10.0).round() as i16,
    })
}

const fn drive(torque: Option<Torque>) -> f64 {
    match torque {
        Some(Torque::On) => 1.0,
        Some(Torque::Damping) => 2.0,
        _ => 0.0,
    }
}
