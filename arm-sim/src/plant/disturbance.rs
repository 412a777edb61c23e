//! Disturbances of an arm: faults of its servos, bus and supply, a hand, a weight in the gripper, and the power switch.

use protocol_core::registers::Joint;
use protocol_core::time::Instant;

use super::Plant;
use super::supply::SupplyFault;
use super::weight::HEAVIEST_LOAD_G;
use crate::fault_count::FaultCount;
use crate::parameters::ServoParameters;
use crate::servo::ServoFault;

impl Plant {
    /// Sets or removes the fault of a joint's servo.
    pub fn set_fault(&mut self, joint: Joint, fault: Option<ServoFault>) {
        let (now, ready_at) = (self.now, self.now + self.config.boot_time);
        if let Some(servo) = self.servo_mut(joint) {
            servo.set_fault(now, fault, ready_at);
        }
    }

    /// How often the fault of a joint's servo took effect since it was set: see [`ServoFault`] for the units.
    #[must_use]
    pub fn fault_count(&self, joint: Joint) -> FaultCount {
        self.counted(joint).map_or_else(FaultCount::default, |servo| servo.fault_count())
    }

    /// Sets or removes the fault of the supply. A servo restarts below 4.5 V, and reports a wrong voltage below 5 V.
    pub fn set_supply_fault(&mut self, fault: Option<SupplyFault>) {
        self.supply.set_fault(self.now, fault);
        self.rest_until = self.now;
    }

    /// How often the fault of the supply took effect: in dips for [`SupplyFault::Dips`], otherwise in frames to the servos.
    #[must_use]
    pub const fn supply_fault_count(&self) -> FaultCount {
        self.supply.count()
    }

    /// Sets the weight in the gripper, in grams, limited to [`HEAVIEST_LOAD_G`]. 0 removes the weight.
    pub fn set_load(&mut self, grams: u16) {
        self.load_g = grams.min(HEAVIEST_LOAD_G);
        self.update_weight();
    }

    /// Scales the stall torque of all servos, and the friction and drag of their gears, in percent of the values in
    /// [`parameters`](crate::parameters). Friction by load stays. So simulated arms can differ from each other.
    pub fn scale_servos(&mut self, torque_percent: u16, friction_percent: u16) {
        for (servo, joint) in self.servos_mut().iter_mut().zip(Joint::ALL) {
            servo.set_parameters(&ServoParameters::of(joint).scaled(torque_percent, friction_percent));
        }
    }

    /// The weight in the gripper, in grams: the sum of [`Plant::set_load`] and of the carried object of the room.
    #[must_use]
    pub const fn load_grams(&self) -> u16 {
        self.load_g + self.carried_g
    }

    /// Interrupts the power of one servo at `now`. Torque and goal are lost, so a loaded joint falls unless a hand or a stand
    /// holds it.
    pub fn restart_servo(&mut self, now: Instant, joint: Joint) {
        self.advance(now);
        let ready_at = now + self.config.boot_time;
        if let Some(servo) = self.servo_mut(joint) {
            servo.power_cycle(ready_at);
        }
    }

    /// Sets [`ServoConfig::goal_starts_torque`](crate::servo::ServoConfig::goal_starts_torque) of all servos.
    pub fn set_goal_starts_torque(&mut self, starts_torque: bool) {
        self.config.goal_starts_torque = starts_torque;
        let config = self.config;
        self.servos_mut().iter_mut().for_each(|servo| servo.set_config(config));
    }

    /// Sets whether the controller receives its own bytes, as on a bus with one wire for both directions.
    pub fn set_echo(&mut self, has_echo: bool) {
        self.has_echo = has_echo;
        self.echo_count = FaultCount::default();
    }

    /// Number of bytes that were echoed since [`Plant::set_echo`].
    #[must_use]
    pub const fn echo_count(&self) -> FaultCount {
        self.echo_count
    }

    /// Turns a joint by hand to a position in counts, and holds it there. A joint with torque turns back.
    pub fn move_by_hand(&mut self, joint: Joint, counts: u16) {
        if let Some(servo) = self.servo_mut(joint) {
            servo.move_by_hand(counts);
        }
        self.update_weight();
    }

    /// Lets a hand hold a joint until the joint has torque. Has no effect on a joint with torque.
    pub fn hold(&mut self, joint: Joint) {
        self.servo_mut(joint).into_iter().for_each(|servo| servo.hold_by_hand(true));
    }

    /// The hand lets the joint go. Without torque, a loaded joint then falls.
    pub fn let_go(&mut self, joint: Joint) {
        self.servo_mut(joint).into_iter().for_each(|servo| servo.hold_by_hand(false));
    }

    /// Sets whether a stand holds each joint that has no torque.
    pub fn support(&mut self, is_supported: bool) {
        self.servos_mut().iter_mut().for_each(|servo| servo.support(is_supported));
    }

    /// Switches power off and on: torque, goals and answers are lost, the pump stops, faults stay. A hand holds each joint until
    /// the joint has torque.
    pub fn power_cycle(&mut self, now: Instant) {
        self.advance(now);
        self.supply.switch(true);
        self.is_sucking = false;
        let ready_at = now + self.config.boot_time;
        for servo in self.servos_mut() {
            servo.power_cycle(ready_at);
            servo.hold_by_hand(true);
        }
        self.decoder.clear();
        self.wire.clear();
    }

    /// Switches the power of all servos off at `now`, until [`Plant::power_cycle`]. The pump stops, and no hand holds a joint.
    pub fn power_off(&mut self, now: Instant) {
        self.advance(now);
        self.supply.switch(false);
        self.is_sucking = false;
        for servo in self.servos_mut() {
            servo.power_cycle(Instant::FAR_FUTURE);
            servo.hold_by_hand(false);
        }
        self.decoder.clear();
        self.wire.clear();
    }
}
