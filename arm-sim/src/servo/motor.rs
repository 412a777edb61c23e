//! The motor and the position control of a simulated servo, in steps of a millisecond.
//!
//! ```text
//!   goal ──▶ set-point, at the speed or in the time of the goal ──▶ position, which lags behind
//!                                                   arm's weight ──▶ and droops
//! ```
//!
//! With torque, control is proportional: a load turns the joint away from its set-point, by a count at the stall
//! torque. Without torque, the weight turns the joint as [`gear`](super::gear) describes, to the mechanical ends of the
//! servo at 0 and 1023 counts.
//!
//! All values are integers and all steps are equal, so a run does not depend on how often its caller looks. The speed
//! limit is the motor's (62 rpm); lag and droop are assumed, as no arm was measured. There are no frames here.

use motion_core::calibration::angle_from_counts;
use motion_core::servo_bus::Reading;
use protocol_core::registers::Joint;

use super::gear::{Drag, Gear};
use super::registers::Goal;
use super::units::{COUNT, COUNT_PER_SECOND};

/// The upper mechanical end of the servo. The lower end is 0.
const END: i64 = Reading::MAX_POSITION as i64 * COUNT;
/// 62 revolutions a minute, in micro-degrees per second.
const MAX_SPEED: i64 = 372_000_000;
/// Each step reduces the distance to the set-point by this part: a time constant of 20 ms.
const LAG_STEPS: i64 = 20;
/// At a distance of less than 1/16 count the position becomes the set-point.
const SNAP_DISTANCE: i64 = COUNT / 16;
/// The load of the motor for each count between set-point and position, in 0.1 %.
const LOAD_PER_COUNT: i64 = 10;
/// The distance by which a load turns the joint away from its set-point, in millionths of a count for each millionth of
/// the stall torque: a count (0.21 degrees of joints 1 to 4) at that torque.
const DROOP: i64 = 1;

/// A motor with its gear and its position sensor.
#[derive(Clone, Debug)]
pub(crate) struct Motor {
    gear: Gear,
    /// The longest distance of a step.
    max_distance: i64,
    position: i64,
    /// The torque of the arm's weight, in micronewton metres, towards more counts.
    weight: i64,
    /// The mode in the last step.
    mode: MotorMode,
    /// The position that the control aims at in this step.
    set_point: i64,
    target: i64,
    /// The distance of the set-point in a step.
    rate: i64,
    /// The distance that the motor turned in the last step.
    moved: i64,
}

/// What acts on a motor in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MotorMode {
    /// Something outside the servo holds it in place.
    Held,
    /// Weight, friction and this drag.
    Released(Drag),
    /// Its control.
    Driven,
    /// Its control, but something keeps it from turning.
    Blocked,
}

impl Motor {
    /// The motor of a joint's servo, at rest.
    pub(crate) fn new(joint: Joint, position_counts: u16) -> Self {
        let position = i64::from(position_counts) * COUNT;
        Self {
            gear: Gear::of(joint),
            max_distance: max_distance(joint),
            position,
            weight: 0,
            mode: MotorMode::Held,
            set_point: position,
            target: position,
            rate: 0,
            moved: 0,
        }
    }

    /// Starts a move from the set-point.
    pub(crate) fn start(&mut self, goal: Goal) {
        self.target = i64::from(goal.position_counts) * COUNT;
        let distance = (self.target - self.set_point).abs();
        let rate = match (i64::from(goal.speed), i64::from(goal.time_ms)) {
            (0, 0) => self.max_distance,
            // Rounded up: otherwise the move takes a step too many.
            (0, millis) => (distance + millis - 1) / millis,
            (speed, _) => speed * COUNT_PER_SECOND,
        };
        self.rate = rate.min(self.max_distance);
    }

    /// Ends the move: set-point and target become the position.
    pub(crate) const fn stop(&mut self) {
        self.set_point = self.position;
        self.target = self.position;
    }

    /// Simulates a [`STEP`](super::units::STEP).
    pub(crate) fn step(&mut self, mode: MotorMode) {
        self.mode = mode;
        if let MotorMode::Held | MotorMode::Released(_) = mode {
            self.stop();
        }
        self.set_point += (self.target - self.set_point).clamp(-self.rate, self.rate);
        let distance = match mode {
            MotorMode::Held | MotorMode::Blocked => 0,
            MotorMode::Driven => self.driven_distance(),
            MotorMode::Released(drag) => self.gear.speed_after(self.moved, self.weight, drag),
        };
        let before = self.position;
        self.position = (before + distance).clamp(0, END);
        self.moved = self.position - before;
        if let MotorMode::Released(_) = mode {
            self.stop();
        }
    }

    fn driven_distance(&self) -> i64 {
        let lag = self.equilibrium() - self.position;
        if lag.abs() <= SNAP_DISTANCE {
            lag
        } else {
            (lag / LAG_STEPS).clamp(-self.max_distance, self.max_distance)
        }
    }

    /// The position at which control and weight are in equilibrium.
    fn equilibrium(&self) -> i64 {
        (self.set_point + DROOP * self.gear.share_of_stall(self.weight)).clamp(0, END)
    }

    /// Sets the torque of the arm's weight, in micronewton metres, towards more counts.
    pub(crate) const fn set_weight(&mut self, weight: i64) {
        self.weight = weight;
    }

    /// Turns it from outside.
    pub(crate) fn turn_to(&mut self, position_counts: u16) {
        self.position = i64::from(position_counts.min(Reading::MAX_POSITION)) * COUNT;
        self.moved = 0;
    }

    /// The position in millionths of a count.
    pub(crate) const fn position(&self) -> i64 {
        self.position
    }

    /// The position in counts, 0 to 1023.
    pub(crate) fn position_counts(&self) -> u16 {
        let counts = (self.position + COUNT / 2) / COUNT;
        u16::try_from(counts).unwrap_or(0).min(Reading::MAX_POSITION)
    }

    /// The speed in counts per second.
    pub(crate) fn speed(&self) -> i16 {
        i16::try_from(self.moved / COUNT_PER_SECOND).unwrap_or(0)
    }

    /// The load in 0.1 %. Positive values are towards more counts.
    pub(crate) fn load(&self) -> i16 {
        let load = match self.mode {
            MotorMode::Held | MotorMode::Released(_) => 0,
            MotorMode::Blocked => self.control_load(self.set_point),
            MotorMode::Driven => {
                self.control_load(self.equilibrium()) - self.gear.share_of_stall(self.weight) / 1_000
            }
        };
        i16::try_from(load.clamp(-1_000, 1_000)).unwrap_or(0)
    }

    const fn control_load(&self, aim: i64) -> i64 {
        (aim - self.position) * LOAD_PER_COUNT / COUNT
    }

    /// Does a step in this mode change nothing?
    pub(crate) fn is_at_rest(&self, mode: MotorMode) -> bool {
        let is_still = match mode {
            MotorMode::Held | MotorMode::Blocked => self.position == self.set_point,
            MotorMode::Released(_) => self.position == self.set_point && self.holds_weight(),
            MotorMode::Driven => self.position == self.equilibrium(),
        };
        is_still && mode == self.mode && self.moved == 0 && self.set_point == self.target
    }

    /// Is the position the set-point?
    pub(crate) const fn is_at_set_point(&self) -> bool {
        self.position == self.set_point
    }

    /// Do friction or a mechanical end hold the weight, without torque?
    pub(crate) const fn holds_weight(&self) -> bool {
        self.gear.holds(self.weight) || self.is_at_end()
    }

    /// Does a mechanical end stop the weight?
    const fn is_at_end(&self) -> bool {
        (self.position <= 0 && self.weight < 0) || (self.position >= END && self.weight > 0)
    }

    /// Does it turn, or has it not reached its target?
    pub(crate) const fn is_moving(&self) -> bool {
        self.moved != 0 || self.set_point != self.target
    }
}

/// The longest distance of a step, from the number of degrees in a count.
fn max_distance(joint: Joint) -> i64 {
    /// For either kind of servo, the angle of this many counts is a whole number of thousandths of a degree.
    const SPAN: u16 = 850;
    let angle = angle_from_counts(joint, SPAN, 0).0 - angle_from_counts(joint, 0, 0).0;
    MAX_SPEED * i64::from(SPAN) * COUNT_PER_SECOND / i64::from(angle).abs().max(1)
}

#[cfg(test)]
mod tests;
