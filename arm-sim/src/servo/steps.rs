//! The steps of a servo: supply, mode of the motor, overload, and what the registers report.

use motion_core::servo_bus::frame::error;
use motion_core::servo_bus::{Reading, Torque};
use protocol_core::time::Instant;

use super::gear::Drag;
use super::motor::MotorMode;
use super::units::STEP;
use super::{Reported, Servo};

/// A load above this, in 0.1 %, is an overload.
const OVERLOAD: u16 = 800;
/// After this many steps of overload a servo turns its motor off, until torque is switched off and on.
const OVERLOAD_STEPS: u32 = 1_000;
/// A servo restarts below this supply voltage, in 0.1 V: assumed.
const BROWN_OUT_DECIVOLTS: u8 = 45;
/// A servo reports a wrong voltage below this, in 0.1 V: Feetech's factory setting.
const LOWEST_DECIVOLTS: u8 = 50;

impl Servo {
    /// Simulates the millisecond that ends at `now`, with this supply voltage. Returns whether the servo turned.
    pub fn step(&mut self, now: Instant, supply_decivolts: u8) -> bool {
        if self.fault.takes_restart(now) {
            self.power_cycle(now + self.config.boot_time);
        }
        self.follow_supply(now, supply_decivolts);
        self.temperature.steps(self.load(), 1);
        let mode = self.motor_mode(now);
        self.fault.count_steps(1, self.would_turn());
        if self.is_at_rest(mode, supply_decivolts) {
            // Most steps change nothing.
            self.overload_steps = 0;
            return false;
        }
        let before = self.motor.position();
        self.motor.step(mode);
        self.check_overload();
        self.update_registers(supply_decivolts);
        before != self.motor.position()
    }

    /// Loses power below the brown-out voltage, and starts when the voltage returns.
    fn follow_supply(&mut self, now: Instant, supply_decivolts: u8) {
        let has_supply = self.ready_at != Instant::FAR_FUTURE;
        if supply_decivolts < BROWN_OUT_DECIVOLTS && has_supply {
            self.power_cycle(Instant::FAR_FUTURE);
        } else if supply_decivolts >= BROWN_OUT_DECIVOLTS && !has_supply {
            self.ready_at = now + self.config.boot_time;
        }
    }

    /// Does a step in this mode, with this supply voltage, change nothing?
    fn is_at_rest(&self, mode: MotorMode, supply_decivolts: u8) -> bool {
        let is_steady = self.motor.is_at_rest(mode) && self.load() <= OVERLOAD;
        is_steady && self.reported == Some(self.report(supply_decivolts))
    }

    /// After the step that ended at `now`: until when steps with this supply voltage change nothing, if no call changes
    /// the servo. [`Servo::rest`] then replaces them.
    pub(crate) fn rest_until(&self, now: Instant, supply_decivolts: u8) -> Instant {
        if !self.is_at_rest(self.motor_mode(now), supply_decivolts) {
            return now;
        }
        let start = if self.ready_at > now { self.ready_at } else { Instant::FAR_FUTURE };
        let event = start.min(self.fault.restarts_at()).as_micros().saturating_sub(1);
        let heating = now.as_micros() + u64::from(self.temperature.steps_to_update()) * STEP.as_micros();
        Instant::from_micros(event.min(heating))
    }

    /// Simulates steps that change nothing.
    pub(crate) fn rest(&mut self, steps: u32) {
        self.temperature.steps(self.load(), steps);
        self.fault.count_steps(steps, self.would_turn());
        self.overload_steps = 0;
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
            MotorMode::Released(Drag::Damped)
        } else {
            MotorMode::Released(Drag::Free)
        }
    }

    /// Would it turn if it were not stuck?
    fn would_turn(&self) -> bool {
        if self.has_torque() {
            !self.motor.is_at_set_point()
        } else {
            !self.is_held && !self.is_supported && !self.motor.holds_weight()
        }
    }

    fn check_overload(&mut self) {
        self.overload_steps = if self.load() > OVERLOAD { self.overload_steps + 1 } else { 0 };
        self.is_overloaded |= self.overload_steps >= OVERLOAD_STEPS;
    }

    fn report(&self, decivolts: u8) -> Reported {
        Reported { decivolts, celsius: self.temperature.celsius(), is_overloaded: self.is_overloaded }
    }

    fn update_registers(&mut self, voltage_decivolts: u8) {
        self.reported = Some(self.report(voltage_decivolts));
        self.registers.set_reading(&Reading {
            position_counts: self.motor.position_counts(),
            speed: self.motor.speed(),
            load: self.motor.load(),
            voltage_decivolts,
            temperature_celsius: self.temperature.celsius(),
        });
        self.registers.set_moving(self.motor.is_moving());
        let overload = if self.is_overloaded { error::OVERLOAD } else { 0 };
        let voltage = if voltage_decivolts < LOWEST_DECIVOLTS { error::VOLTAGE } else { 0 };
        self.registers.set_errors(overload | voltage);
    }
}
