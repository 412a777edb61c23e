//! The motor and the position control of a simulated servo, in steps of a millisecond.
//!
//! ```text
//!   goal ──▶ set-point, at the speed or in the time of the goal ──▶ error ──▶ duty ──▶ torque ──▶ speed ──▶ position
//!                                                                    ▲      weight, hand, obstacles ─┘         │
//!                                                                    └─────────────────────────────────────────┘
//! ```
//!
//! Control is proportional, with a derivative term: `duty = (error + D × change of the error) / 4.3 degrees`, from
//! -1 to 1. The motor is voltage-driven: `torque = stall torque × (duty - speed / 372 degrees per second)`. So droop and
//! following error are proportional to the load (register 60, the duty): a joint that carries half the stall torque is about
//! 2 degrees off its set-point.
//!
//! Without torque, the weight turns the joint against friction and drag, to the mechanical ends of the servo at 0 and
//! 1023 counts. All values are integers and all steps are equal, so the motion does not depend on how often the simulation is
//! polled. This module knows no frames.

use motion_core::servo_bus::Reading;
use protocol_core::registers::Joint;

use super::gear::{Gear, Torques};
use super::registers::ServoGoal;
use super::surroundings::Surroundings;
use super::units::{COUNT, COUNT_PER_SECOND};
use crate::parameters::{DERIVATIVE_FILTER_MS, FULL_DUTY_ERROR, NO_LOAD_SPEED, ServoParameters};

/// The upper mechanical end of the servo. The lower end is 0.
const END: i64 = Reading::MAX_POSITION as i64 * COUNT;
/// Thousandths of a degree in a radian.
const MILLIDEGREES_PER_RADIAN: i64 = 57_296;
/// The value of a duty of 1, at which the motor gets the whole voltage.
const FULL_DUTY: i64 = 1_000_000;

/// A motor with its gear and its position sensor. Positions, distances and errors are in millionths of a count.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Motor {
    gear: Gear,
    /// The distance in a step at full speed without load.
    no_load_distance: i64,
    /// The error for full duty.
    full_error: i64,
    /// The drag of the driven motor by its back EMF, in micronewton metre seconds per radian.
    back_emf: i64,
    pub(crate) surroundings: Surroundings,
    position: i64,
    /// The mode in the last step.
    mode: MotorMode,
    /// The position that the control aims at in this step.
    set_point: i64,
    target: i64,
    /// How far the set-point moves in a step.
    rate: i64,
    /// The distance that the motor turned in the last step.
    moved: i64,
    /// The distance between set-point and position in the last step.
    error: i64,
    /// The filtered change of the error per step.
    error_change: i64,
    /// In millionths. Positive values are towards more counts.
    duty: i64,
    /// The torque in the last step, in 0.1 % of the stall torque.
    torque: i16,
    /// Another simulation moves the joint: see [`Self::measure`].
    is_outside: bool,
}

/// What determines the motion of a motor in a step, besides its surroundings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum MotorMode {
    /// Something outside the servo holds the joint in place.
    Held,
    /// The drag of the gear.
    Free,
    /// The drag of the gear, and of the motor with its windings shorted.
    Damped,
    /// The position control.
    Driven,
    /// The position control, but something keeps the joint from turning.
    Blocked,
}

impl MotorMode {
    const fn is_controlled(self) -> bool {
        matches!(self, Self::Driven | Self::Blocked)
    }

    const fn is_held(self) -> bool {
        matches!(self, Self::Held | Self::Blocked)
    }
}

impl Motor {
    /// The motor of a joint's servo, at rest.
    pub(crate) fn new(joint: Joint, position_counts: u16) -> Self {
        let position = i64::from(position_counts) * COUNT;
        let parameters = ServoParameters::of(joint);
        let no_load_distance = NO_LOAD_SPEED * parameters.half_turn * COUNT_PER_SECOND / 180_000;
        Self {
            gear: Gear(*parameters),
            no_load_distance,
            full_error: FULL_DUTY_ERROR * parameters.half_turn * COUNT / 180_000,
            back_emf: back_emf(parameters, no_load_distance),
            surroundings: Surroundings::default(),
            position,
            mode: MotorMode::Held,
            set_point: position,
            target: position,
            rate: 0,
            moved: 0,
            error: 0,
            error_change: 0,
            duty: 0,
            torque: 0,
            is_outside: false,
        }
    }

    /// Changes the stall torque, the friction and the drag. The position control and the speed without load stay the same.
    pub(crate) fn set_parameters(&mut self, parameters: &ServoParameters) {
        self.gear = Gear(*parameters);
        self.back_emf = back_emf(parameters, self.no_load_distance);
    }

    /// Starts a move from the set-point.
    pub(crate) fn start(&mut self, goal: ServoGoal) {
        self.target = i64::from(goal.position_counts) * COUNT;
        let distance = (self.target - self.set_point).abs();
        let rate = match (i64::from(goal.speed), i64::from(goal.time_ms)) {
            (0, 0) => self.no_load_distance,
            // Rounded up: otherwise the move takes one step more.
            (0, millis) => (distance + millis - 1) / millis,
            (speed, _) => speed * COUNT_PER_SECOND,
        };
        self.rate = rate.min(self.no_load_distance);
    }

    /// Does the last move go to the position of this goal?
    pub(crate) fn is_started(&self, goal: ServoGoal) -> bool {
        self.target == i64::from(goal.position_counts) * COUNT
    }

    /// Ends the move: set-point and target become the position, and the motor has no duty.
    pub(crate) const fn stop(&mut self) {
        self.set_point = self.position;
        self.target = self.position;
        (self.error, self.error_change, self.duty) = (0, 0, 0);
    }

    /// Simulates a [`STEP`](super::units::STEP).
    pub(crate) fn step(&mut self, mode: MotorMode) {
        self.mode = mode;
        if self.is_outside {
            self.step_outside();
            return;
        }
        if mode.is_controlled() {
            self.control();
        } else {
            self.stop();
        }
        let before = self.position;
        if !mode.is_held() {
            let (low, high) = self.range();
            self.position = (before + self.next_speed()).clamp(low, high);
        }
        self.moved = self.position - before;
        self.torque = self.torque_in_step();
        if !mode.is_controlled() {
            self.stop();
        }
    }

    /// A step in which another simulation moves the joint: it goes on from the last measurement at the measured speed.
    fn step_outside(&mut self) {
        self.position = (self.position + self.moved).clamp(0, END);
        if self.mode.is_controlled() {
            self.advance_set_point();
        } else {
            (self.set_point, self.target) = (self.position, self.position);
        }
        self.torque = self.torque_in_step();
    }

    /// Lets another simulation move the joint from now on. The arguments are its measurements: the position, the distance in a
    /// step, and the duty in millionths.
    pub(crate) fn measure(&mut self, position: i64, moved: i64, duty: i64) {
        self.is_outside = true;
        self.position = position.clamp(0, END);
        (self.moved, self.duty) = (moved, duty.clamp(-FULL_DUTY, FULL_DUTY));
    }

    /// This simulation moves the joint again.
    pub(crate) const fn move_inside(&mut self) {
        self.is_outside = false;
    }

    /// The position that the control aims at.
    pub(crate) const fn set_point(&self) -> i64 {
        self.set_point
    }

    fn advance_set_point(&mut self) {
        self.set_point += (self.target - self.set_point).clamp(-self.rate, self.rate);
    }

    /// Moves the set-point towards the target, and sets the duty.
    fn control(&mut self) {
        self.advance_set_point();
        let error = self.set_point - self.position;
        let change = error - self.error;
        self.error_change = (self.error_change * (DERIVATIVE_FILTER_MS - 1) + change) / DERIVATIVE_FILTER_MS;
        self.error = error;
        let aim = error + self.gear.0.derivative_ms * self.error_change;
        self.duty = (aim * FULL_DUTY / self.full_error.max(1)).clamp(-FULL_DUTY, FULL_DUTY);
    }

    /// The speed in this step, if no stiff obstacle and no end is in the way.
    fn next_speed(&self) -> i64 {
        let drag = match self.mode {
            MotorMode::Damped => self.gear.0.damped_drag,
            MotorMode::Driven => self.back_emf,
            _ => self.gear.0.free_drag,
        };
        self.gear.speed_after(self.moved, self.torques(), drag, self.surroundings.inertia)
    }

    /// The torques that would act at standstill: the back EMF is part of the drag.
    fn torques(&self) -> Torques {
        let motor = self.gear.0.stall_torque * self.duty / FULL_DUTY;
        Torques { motor, outside: self.surroundings.torque(self.position) }
    }

    /// The range of positions that the joint can reach from here.
    fn range(&self) -> (i64, i64) {
        self.surroundings.range(self.position, (0, END))
    }

    /// Turns the joint by hand to a position in counts.
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

    /// The load in 0.1 %, which is the duty. Positive values are towards more counts.
    pub(crate) fn load(&self) -> i16 {
        i16::try_from(self.duty * 1_000 / FULL_DUTY).unwrap_or(0)
    }

    /// The torque of the motor in 0.1 % of its stall torque: the duty less the part that the speed needs.
    pub(crate) const fn torque(&self) -> i16 {
        self.torque
    }

    fn torque_in_step(&self) -> i16 {
        if !self.mode.is_controlled() {
            return 0;
        }
        if self.moved == 0 {
            return self.load();
        }
        let for_speed = self.moved * FULL_DUTY / self.no_load_distance.max(1);
        i16::try_from((self.duty - for_speed) * 1_000 / FULL_DUTY).unwrap_or(0)
    }

    /// The greatest distance of the joint from its set-point under its present external load, in thousandths of a degree.
    /// `None`: load and friction reach the stall torque.
    pub(crate) fn droop(&self) -> Option<i64> {
        let load = self.gear.highest_load(self.torques());
        (load < self.gear.0.stall_torque).then_some(FULL_DUTY_ERROR * load / self.gear.0.stall_torque.max(1))
    }

    /// The distance in which the stall torque would stop the joint from its present speed, in thousandths of a degree.
    pub(crate) fn stopping_distance(&self) -> i64 {
        let milliradians_per_second = self.moved * 1_000 / self.gear.0.counts_per_kiloradian.max(1);
        // Half the inertia in gram square millimetres, times the square of this speed, is the energy in femtojoules.
        // `energy` is in picojoules.
        let inertia = self.gear.0.rotor_inertia + self.surroundings.inertia;
        let energy = inertia / 1_000 * milliradians_per_second * milliradians_per_second / 2;
        energy / self.gear.0.stall_torque.max(1) * MILLIDEGREES_PER_RADIAN / 1_000_000
    }

    /// Would a step in this mode change nothing?
    pub(crate) fn is_at_rest(&self, mode: MotorMode) -> bool {
        mode == self.mode
            && !self.is_outside
            && self.moved == 0
            && self.set_point == self.target
            && (self.error_change, self.error) == (0, self.set_point - self.position)
            && (mode.is_held() || self.is_balanced())
    }

    /// Does friction, an obstacle or a mechanical end hold the joint against all torques?
    pub(crate) fn is_balanced(&self) -> bool {
        let torques = self.torques();
        let (low, high) = self.range();
        let is_stopped = match torques.net().signum() {
            1 => self.position >= high,
            -1 => self.position <= low,
            _ => true,
        };
        is_stopped || self.gear.holds(torques)
    }

    /// Does the motor turn, or has the set-point not reached the target?
    pub(crate) const fn is_moving(&self) -> bool {
        self.moved != 0 || self.set_point != self.target
    }
}

/// The drag of a driven motor by its back EMF, in micronewton metre seconds per radian.
fn back_emf(parameters: &ServoParameters, no_load_distance: i64) -> i64 {
    parameters.stall_torque * parameters.counts_per_kiloradian / no_load_distance.max(1)
}

#[cfg(test)]
mod tests;
