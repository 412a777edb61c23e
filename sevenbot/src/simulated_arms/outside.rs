//! Arms whose joints another simulation moves: measurements in, set-points out.

use std::ops::Range;

use arm_sim::plant::OutsideState;
use arm_sim::{Joint, Simulation};
use motion_core::servo_bus::Torque;
use protocol_core::registers::JOINTS;
use protocol_core::time::Duration;

use super::observation::Number;
use super::step_error::{MOST, StepError};

/// How many numbers a measurement has: seven positions in degrees, seven velocities in degrees per second, seven loads in
/// percent of the stall torque, as in an observation. This simulation moves a joint whose position is NaN.
pub const MEASURED: usize = 3 * JOINTS;
/// How many numbers an exchange returns: [`SET_POINTS`], [`SET_VELOCITIES`] and [`DRIVES`].
pub const WANTED: usize = 3 * JOINTS;
/// The angles that the servos' control aims at, in degrees.
pub const SET_POINTS: Range<usize> = 0..7;
/// The velocities of the set-points, in degrees per second.
pub const SET_VELOCITIES: Range<usize> = 7..14;
/// 1: the motor drives the joint. 2: the motor damps the joint. 0: neither.
pub const DRIVES: Range<usize> = 14..21;

/// Skips the joints whose position is NaN. Fails at the first measurement of another joint that is no number or too large.
pub(super) fn check<T: Number>(measured: &[T]) -> Result<(), StepError> {
    for (arm, row) in measured.chunks(MEASURED).enumerate() {
        for joint in 1..=JOINTS {
            let values = of_joint(row, joint);
            let wrong = values.into_iter().find(|value| !(-MOST..=MOST).contains(value));
            if let Some(value) = wrong.filter(|_| !is_inside(values)) {
                return Err(StepError::Measured { arm, joint, value });
            }
        }
    }
    Ok(())
}

/// Position, velocity and load of a joint, by its number from 1.
fn of_joint<T: Number>(row: &[T], joint: usize) -> [f64; 3] {
    [0, 1, 2].map(|kind| row.get(kind * JOINTS + joint - 1).map_or(f64::NAN, |value| value.widen()))
}

/// Does this simulation move the joint?
const fn is_inside([position, ..]: [f64; 3]) -> bool {
    position.is_nan()
}

/// Gives the arm the measurements, lets time pass, and writes [`WANTED`] numbers.
pub(super) fn exchange<T: Number, N: Number>(
    arm: &mut Simulation,
    measured: &[T],
    time: Duration,
    wanted: &mut [N],
) {
    for joint in Joint::ALL {
        arm.plant_mut().measure(joint, state(of_joint(measured, joint.number().into())));
    }
    let set_points =
        |arm: &Simulation| Joint::ALL.map(|joint| f64::from(arm.plant().set_point(joint)) / 1_000.0);
    let before = set_points(arm);
    arm.advance(time);
    let after = set_points(arm);
    let seconds = std::time::Duration::from_micros(time.as_micros()).as_secs_f64();
    let velocities = after.into_iter().zip(before).map(|(after, before)| (after - before) / seconds);
    let drives = Joint::ALL.map(|joint| drive(arm.plant().torque(joint)));
    let numbers = after.into_iter().chain(velocities).chain(drives);
    wanted.iter_mut().zip(numbers).for_each(|(place, number)| *place = N::nearest(number));
}

#[expect(clippy::cast_possible_truncation, reason = "checked to be small")]
fn state(values: [f64; 3]) -> Option<OutsideState> {
    let [position, velocity, load] = values;
    let thousandths = |value: f64| (value * 1_000.0).round() as i32;
    (!is_inside(values)).then(|| OutsideState {
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
