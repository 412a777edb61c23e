//! What a joint meets outside its servo, and alarms that are forced on it.

use super::Servo;
use super::surroundings::{Side, Surface};
use crate::fault_count::FaultCount;

/// An alarm that is forced on a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Trip {
    /// It latches an overload.
    Overload,
    /// It is 5 degrees Celsius hotter than its limit, and cools down.
    Heat,
}

/// A forced heat exceeds the limit by this, in degrees Celsius.
const EXCESS_CELSIUS: u8 = 5;

impl Servo {
    /// Sets the arm's torque in micronewton metres, towards more counts, and its inertia in gram square millimetres.
    pub(crate) const fn set_arm(&mut self, weight: i64, inertia: i64) {
        self.motor.surroundings.weight = weight;
        self.motor.surroundings.inertia = inertia;
    }

    /// The arm's torque. Its inertia has no effect on a joint at rest.
    pub(crate) const fn weight(&self) -> i64 {
        self.motor.surroundings.weight
    }

    /// Sets the torque of what the arm touches in its room, in micronewton metres, towards more counts.
    pub(crate) const fn set_contact(&mut self, torque: i64) {
        self.motor.surroundings.contact = torque;
    }

    /// That torque.
    pub(crate) const fn contact(&self) -> i64 {
        self.motor.surroundings.contact
    }

    /// Sets or takes away the wall. A wall counts the milliseconds in which the joint touches it.
    pub(crate) fn set_wall(&mut self, wall: Option<Surface>) {
        self.motor.surroundings.wall = wall;
        self.wall_count = FaultCount::default();
    }

    /// Sets or takes away what is between the claws.
    pub(crate) fn set_thing(&mut self, thing: Option<Surface>) {
        self.motor.surroundings.thing = thing;
        if thing.is_some() {
            self.thing_count = FaultCount::default();
        }
    }

    /// What is between the claws.
    pub(crate) const fn thing(&self) -> Option<Surface> {
        self.motor.surroundings.thing
    }

    /// Sets the torque of a hand in micronewton metres, towards more counts.
    pub(crate) fn push(&mut self, torque: i64) {
        self.motor.surroundings.push = torque;
        self.push_count = FaultCount::default();
    }

    /// Milliseconds in which it touched its wall, touched the thing between the claws, or was pushed.
    pub(crate) const fn obstacle_counts(&self) -> [FaultCount; 3] {
        [self.wall_count, self.thing_count, self.push_count]
    }

    /// The side at which an obstacle at this position is.
    pub(crate) const fn side_of(&self, position: i64) -> Side {
        if self.motor.position() <= position { Side::MoreCounts } else { Side::FewerCounts }
    }

    /// Is an overload latched?
    pub(crate) const fn is_overloaded(&self) -> bool {
        self.protection.is_overloaded()
    }

    /// Forces an alarm. An overload has no effect on a servo whose torque is off.
    pub(crate) fn trip(&mut self, trip: Trip) {
        match trip {
            Trip::Overload if self.is_on => self.protection.trip(),
            Trip::Overload => {}
            Trip::Heat => {
                self.temperature.set(self.registers.limits().max_celsius.saturating_add(EXCESS_CELSIUS));
            }
        }
    }
}
