//! Influences on the servos other than frames: faults, obstacles, hands, payloads, alarms and the supply.

use arm_sim::plant::{SupplyFault, Thing, Wall};
use arm_sim::servo::{ServoFault, Trip};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use super::{BOOT_TIME, DisturbedBus};
use crate::per_joint::PerJoint;
use crate::world::motion_checker::Exemption;

/// A step of the plant. A servo starts in the first step with supply, so up to one step late.
const STEP: Duration = Duration::from_millis(1);

impl DisturbedBus {
    pub(crate) fn set_echo(&mut self, has_echo: bool) {
        self.plant.set_echo(has_echo);
    }

    pub(crate) fn set_fault(&mut self, now: Instant, joint: Joint, fault: Option<ServoFault>) {
        let was_missing = self.faults[joint] == Some(ServoFault::Missing);
        let _ = self.plant.poll(now);
        self.plant.set_fault(joint, fault);
        self.faults[joint] = fault;
        if was_missing || fault == Some(ServoFault::Missing) {
            self.motion_checker.exempt(now, joint, Exemption::PowerLoss);
        }
        if fault == Some(ServoFault::Stuck) {
            // The joint may get stuck where it overshot its goal.
            self.motion_checker.exempt(now, joint, Exemption::Hand);
        }
        self.since[joint] = if was_missing { now + BOOT_TIME } else { now };
    }

    /// Restarts a servo, as after a dip of its supply. Its torque is off after that.
    pub(crate) fn restart_servo(&mut self, now: Instant, joint: Joint) {
        let fault = self.faults[joint];
        self.set_fault(now, joint, Some(ServoFault::Missing));
        self.set_fault(now, joint, fault.filter(|fault| *fault != ServoFault::Missing));
    }

    pub(crate) fn power_cycle(&mut self, now: Instant) {
        self.end_stop(now);
        self.plant.power_cycle(now);
        self.motion_checker.power_cycle(now);
        self.delayed.clear();
        self.since = PerJoint::all(now + BOOT_TIME);
    }

    /// Puts a wall in the way of a joint, or takes it away.
    pub(crate) fn set_wall(&mut self, now: Instant, joint: Joint, wall: Option<Wall>) {
        self.plant.bytes(now, &[]);
        self.plant.set_wall(joint, wall);
        self.has_wall[joint] = wall.is_some();
    }

    /// Puts a thing between the claws, or takes it away.
    pub(crate) fn set_thing(&mut self, now: Instant, thing: Option<Thing>) {
        self.plant.bytes(now, &[]);
        self.plant.set_thing(thing);
        self.has_thing = thing.is_some();
    }

    /// Pushes a joint with a torque in millinewton metres. 0 ends the push, and the joint may turn back.
    pub(crate) fn push(&mut self, now: Instant, joint: Joint, torque: i16) {
        self.plant.bytes(now, &[]);
        self.motion_checker.exempt(now, joint, Exemption::Hand);
        self.plant.push(joint, torque);
        self.has_push[joint] = torque != 0;
    }

    /// Puts a weight into the gripper, in grams.
    pub(crate) fn set_load(&mut self, now: Instant, grams: u16) {
        self.plant.bytes(now, &[]);
        self.plant.set_load(grams);
    }

    /// Forces an alarm on a servo.
    pub(crate) fn trip(&mut self, now: Instant, joint: Joint, trip: Trip) {
        self.plant.bytes(now, &[]);
        self.plant.trip(joint, trip);
        self.push_rules[joint].overload_is_forced();
    }

    /// Cuts the supply of all servos.
    pub(crate) fn begin_stop(&mut self, now: Instant) {
        self.plant.bytes(now, &[]);
        self.plant.set_supply_fault(Some(SupplyFault::Off));
        self.motion_checker.exempt_all(now, Exemption::PowerLoss);
        self.is_stopped = true;
        self.since = PerJoint::all(now);
    }

    /// Restores the supply of all servos.
    pub(crate) fn end_stop(&mut self, now: Instant) {
        self.plant.bytes(now, &[]);
        self.plant.set_supply_fault(None);
        if std::mem::take(&mut self.is_stopped) {
            self.since = PerJoint::all(now + BOOT_TIME + STEP);
        }
    }

    /// A hand moves the joint to this position.
    pub(crate) fn turn_by_hand(&mut self, now: Instant, joint: Joint, counts: u16) {
        self.motion_checker.exempt(now, joint, Exemption::Hand);
        self.plant.move_by_hand(joint, counts);
    }

    pub(crate) fn release_by_hand(&mut self, joint: Joint) {
        self.plant.let_go(joint);
    }
}
