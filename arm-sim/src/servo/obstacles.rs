//! The weight, the contacts and the obstacles of a joint, and alarms that are forced on its servo.

use super::Servo;
use super::surroundings::{Side, Surface};
use crate::fault_count::FaultCount;

/// An alarm that is forced on a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Trip {
    /// The servo latches an overload.
    Overload,
    /// The servo is 5 degrees Celsius hotter than its limit, and cools down.
    Heat,
}

/// [`Trip::Heat`] exceeds the temperature limit by this, in degrees Celsius.
const EXCESS_CELSIUS: u8 = 5;

impl Servo {
    /// Sets the torque of the arm's weight in micronewton metres, positive towards more counts, and the inertia of the arm in
    /// gram square millimetres.
    pub(crate) const fn set_arm(&mut self, weight: i64, inertia: i64) {
        self.motor.surroundings.weight = weight;
        self.motor.surroundings.inertia = inertia;
    }

    /// The torque of the arm's weight. When it changes, a servo at rest has to be simulated again. A change of the inertia has no
    /// effect on a servo at rest.
    pub(crate) const fn weight(&self) -> i64 {
        self.motor.surroundings.weight
    }

    /// Sets the torque of the arm's contacts in its room, in micronewton metres, positive towards more counts.
    pub(crate) const fn set_contact(&mut self, torque: i64) {
        self.motor.surroundings.contact = torque;
    }

    /// The torque of the arm's contacts in its room, as [`Servo::set_contact`] sets it.
    pub(crate) const fn contact(&self) -> i64 {
        self.motor.surroundings.contact
    }

    /// Sets or removes the wall, and resets the count of the milliseconds in which the joint touched it.
    pub(crate) fn set_wall(&mut self, wall: Option<Surface>) {
        self.motor.surroundings.wall = wall;
        self.wall_count = FaultCount::default();
    }

    /// Sets or removes the thing between the claws. A new thing resets the count of its milliseconds; a removal keeps the
    /// count.
    pub(crate) fn set_thing(&mut self, thing: Option<Surface>) {
        self.motor.surroundings.thing = thing;
        if thing.is_some() {
            self.thing_count = FaultCount::default();
        }
    }

    pub(crate) const fn thing(&self) -> Option<Surface> {
        self.motor.surroundings.thing
    }

    /// Sets the torque of a hand in micronewton metres, positive towards more counts. Resets the count of the milliseconds in
    /// which the joint was pushed.
    pub(crate) fn push(&mut self, torque: i64) {
        self.motor.surroundings.push = torque;
        self.push_count = FaultCount::default();
    }

    /// The milliseconds in which the joint touched its wall, touched the thing between the claws, and was pushed.
    pub(crate) const fn obstacle_counts(&self) -> [FaultCount; 3] {
        [self.wall_count, self.thing_count, self.push_count]
    }

    /// The side of the joint on which an obstacle at this position is.
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
