//! The steps of a servo: supply, alarms, the mode of the motor, and the reported values.

use motion_core::servo_bus::{Reading, Torque};
use protocol_core::time::Instant;

use super::motor::MotorMode;
use super::protection::Protection;
use super::units::STEP;
use super::{Reported, Servo};
use crate::parameters::BROWN_OUT_DECIVOLTS;

impl Servo {
    /// Simulates the millisecond that ends at `now`, with this supply voltage. Returns whether the servo turned.
    pub fn step(&mut self, now: Instant, supply_decivolts: u8) -> bool {
        if self.fault.takes_restart(now) {
            self.power_cycle(now + self.config.boot_time);
        }
        self.follow_supply(now, supply_decivolts);
        self.temperature.steps(self.motor.torque(), 1);
        self.count_obstacles(1);
        let mode = self.motor_mode(now);
        self.count_stuck(1);
        if self.is_at_rest(mode, supply_decivolts) {
            self.protection.rest();
            return false;
        }
        let before = self.motor.position();
        self.motor.step(mode);
        self.protection.step(self.motor.torque());
        self.update_registers(supply_decivolts);
        before != self.motor.position()
    }

    /// Switches the servo off below the brown-out voltage, and starts it when the voltage returns.
    fn follow_supply(&mut self, now: Instant, supply_decivolts: u8) {
        let has_supply = self.ready_at != Instant::FAR_FUTURE;
        if supply_decivolts < BROWN_OUT_DECIVOLTS && has_supply {
            self.power_cycle(Instant::FAR_FUTURE);
        } else if supply_decivolts >= BROWN_OUT_DECIVOLTS && !has_supply {
            self.ready_at = now + self.config.boot_time;
        }
    }

    /// Would a step in this mode, with this supply voltage, change nothing?
    fn is_at_rest(&self, mode: MotorMode, supply_decivolts: u8) -> bool {
        let is_steady = self.motor.is_at_rest(mode) && !Protection::is_overload(self.motor.torque());
        is_steady && self.reported == Some(self.report(supply_decivolts))
    }

    /// The time until which steps with this supply voltage change nothing, if no call changes the servo. Call it after the step
    /// that ended at `now`. [`Servo::rest`] replaces these steps.
    pub(crate) fn rest_until(&self, now: Instant, supply_decivolts: u8) -> Instant {
        if !self.is_at_rest(self.motor_mode(now), supply_decivolts) {
            return now;
        }
        let start = if self.ready_at > now { self.ready_at } else { Instant::FAR_FUTURE };
        let event = start.min(self.fault.restarts_at()).as_micros().saturating_sub(1);
        let heating = now.as_micros() + u64::from(self.temperature.steps_to_update()) * STEP.as_micros();
        Instant::from_micros(event.min(heating))
    }

    /// Simulates steps that change nothing but sums and counts.
    pub(crate) fn rest(&mut self, steps: u32) {
        self.temperature.steps(self.motor.torque(), steps);
        self.count_obstacles(steps);
        self.count_stuck(steps);
        self.protection.rest();
    }

    /// The mode of the motor in the step that ends at `now`.
    fn motor_mode(&self, now: Instant) -> MotorMode {
        let is_stuck = self.fault.is_stuck();
        if self.has_torque() {
            return if is_stuck { MotorMode::Blocked } else { MotorMode::Driven };
        }
        if is_stuck || self.is_held || self.is_supported {
            MotorMode::Held
        } else if self.torque(now) == Some(Torque::Damping) {
            MotorMode::Damped
        } else {
            MotorMode::Free
        }
    }

    fn count_stuck(&mut self, steps: u32) {
        if self.fault.is_stuck() {
            self.fault.count_steps(steps, self.would_turn());
        }
    }

    /// Would the joint turn if it were not stuck?
    fn would_turn(&self) -> bool {
        let is_held = !self.has_torque() && (self.is_held || self.is_supported);
        !is_held && !self.motor.is_balanced()
    }

    fn count_obstacles(&mut self, steps: u32) {
        if !self.motor.surroundings.has_contact() {
            return;
        }
        let Self { motor, wall_count, thing_count, push_count, .. } = self;
        let (around, position) = (&motor.surroundings, motor.position());
        let touches = [
            (around.wall.map(|wall| wall.is_touched(position)), wall_count),
            (around.thing.map(|thing| thing.is_touched(position)), thing_count),
            ((around.push != 0).then_some(true), push_count),
        ];
        for (touches, count) in touches {
            touches.into_iter().for_each(|touches| count.count_many(steps.into(), touches));
        }
    }

    fn report(&self, decivolts: u8) -> Reported {
        let celsius = self.temperature.celsius();
        let errors = self.protection.errors(self.registers.limits(), celsius, decivolts);
        Reported { decivolts, celsius, errors }
    }

    /// Begins and ends alarms. When an alarm that switched the motor off ends, the motor moves to the stored goal.
    fn update_errors(&mut self, errors: u8) {
        self.registers.set_errors(errors);
        if self.protection.unload(errors, self.registers.limits()) && self.is_on {
            self.update_reading();
            self.motor.stop();
            self.motor.start(self.registers.goal());
        }
    }

    fn update_registers(&mut self, voltage_decivolts: u8) {
        let reported = self.report(voltage_decivolts);
        (self.reported, self.is_reading_old) = (Some(reported), true);
        self.update_errors(reported.errors);
    }

    /// Writes the latest measurements into the registers, if they are not there yet. Call it before the motor is changed outside
    /// a step.
    pub(super) fn update_reading(&mut self) {
        let Some(reported) = self.reported.filter(|_| self.is_reading_old) else { return };
        self.is_reading_old = false;
        self.registers.set_reading(&Reading {
            position_counts: self.motor.position_counts(),
            speed: self.motor.speed(),
            load: self.motor.load(),
            voltage_decivolts: reported.decivolts,
            temperature_celsius: reported.celsius,
        });
        self.registers.set_moving(self.motor.is_moving());
    }
}
