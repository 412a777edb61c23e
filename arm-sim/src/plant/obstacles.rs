//! Obstacles of the arm: walls, a hand that pushes, a thing between the claws. Also alarms that are forced on its servos.
//!
//! Angles are true angles, without any offset, in thousandths of a degree. Joint 7 closes towards smaller angles.

use protocol_core::registers::Joint;

use super::Plant;
use super::pose::AngleScale;
use crate::fault_count::FaultCount;
use crate::servo::surroundings::{Side, Surface};
use crate::servo::{Servo, Trip};

/// The highest stiffness of a soft obstacle, in millinewton metres per degree.
pub const HIGHEST_STIFFNESS: u16 = 5_000;
/// The greatest torque of a hand, in millinewton metres.
pub const STRONGEST_PUSH: i16 = 10_000;
/// When the claws open this far beyond a thing that they have touched, they drop it. In thousandths of a degree, assumed.
const DROP_DISTANCE: i64 = 2_000;
const CLAW: Joint = Joint::ALL[6];

/// A wall in the way of a joint: in front of the joint or behind it, depending on where the joint is when the wall is
/// set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Wall {
    /// Where the joint touches it.
    pub millidegrees: i32,
    /// The torque of the wall for each degree that the joint presses into it, in millinewton metres, 1 to
    /// [`HIGHEST_STIFFNESS`]. `None`: the wall does not give way.
    pub stiffness: Option<u16>,
}

/// A thing between the claws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Thing {
    /// The angle of joint 7 at which the claws touch it.
    pub millidegrees: i32,
    /// Like [`Wall::stiffness`].
    pub stiffness: Option<u16>,
}

impl Plant {
    /// Puts a wall in the way of a joint, or removes it. A joint has one wall.
    pub fn set_wall(&mut self, joint: Joint, wall: Option<Wall>) {
        let Some(servo) = self.servo_mut(joint) else { return };
        let obstacle = wall.map(|Wall { millidegrees, stiffness }| {
            let position = AngleScale::of(joint).position(millidegrees.into());
            obstacle(joint, servo.side_of(position), position, stiffness)
        });
        servo.set_wall(obstacle);
    }

    /// Puts a thing between the claws, or removes it. Joint 7 cannot close beyond the angle of a thing that does not give way.
    /// Set the weight of the thing with [`Plant::set_load`].
    pub fn set_thing(&mut self, thing: Option<Thing>) {
        (self.is_thing_gripped, self.room_stop) = (false, None);
        let obstacle = thing.map(|Thing { millidegrees, stiffness }| {
            let position = AngleScale::of(CLAW).position(millidegrees.into());
            obstacle(CLAW, Side::FewerCounts, position, stiffness)
        });
        self.servo_mut(CLAW).into_iter().for_each(|servo| servo.set_thing(obstacle));
    }

    /// Drops everything that the tool holds: the thing, the weight, and an object of the room.
    pub fn drop_thing(&mut self) {
        self.world.iter_mut().for_each(|world| world.tear_off());
        self.set_thing(None);
        self.set_load(0);
    }

    /// Pushes a joint by hand with a torque in millinewton metres, until the torque is set to 0. Positive values are towards
    /// greater angles.
    pub fn push(&mut self, joint: Joint, torque: i16) {
        let micronewton_metres = i64::from(torque.clamp(-STRONGEST_PUSH, STRONGEST_PUSH)) * 1_000;
        let torque = AngleScale::of(joint).torque_towards_counts(micronewton_metres);
        self.servo_mut(joint).into_iter().for_each(|servo| servo.push(torque));
    }

    /// Forces an alarm on a joint's servo.
    pub fn trip(&mut self, joint: Joint, trip: Trip) {
        self.servo_mut(joint).into_iter().for_each(|servo| servo.trip(trip));
    }

    /// Is an overload latched in a joint's servo? Register 19 of the servo tells whether an overload switches the motor off.
    #[must_use]
    pub fn is_overloaded(&self, joint: Joint) -> bool {
        self.servo(joint).is_some_and(Servo::is_overloaded)
    }

    /// Milliseconds in which a joint touched its wall, since the wall was set.
    #[must_use]
    pub fn wall_count(&self, joint: Joint) -> FaultCount {
        let [wall, _, _] = self.obstacle_counts(joint);
        wall
    }

    /// Milliseconds in which the claws touched the thing, since it was set.
    #[must_use]
    pub fn thing_count(&self) -> FaultCount {
        let [_, thing, _] = self.obstacle_counts(CLAW);
        thing
    }

    /// Milliseconds in which a hand pushed the joint, since the push was set.
    #[must_use]
    pub fn push_count(&self, joint: Joint) -> FaultCount {
        let [_, _, push] = self.obstacle_counts(joint);
        push
    }

    fn obstacle_counts(&self, joint: Joint) -> [FaultCount; 3] {
        self.counted(joint).map(|servo| servo.obstacle_counts()).unwrap_or_default()
    }

    /// Is a thing between the claws?
    #[must_use]
    pub fn has_thing(&self) -> bool {
        self.servo(CLAW).is_some_and(|servo| servo.thing().is_some())
    }

    /// Grips the thing when the claws touch it, and drops it when they open beyond it.
    pub(super) fn follow_claw(&mut self) {
        let Some((position, thing)) =
            self.servo(CLAW).and_then(|servo| servo.thing().map(|thing| (servo.position(), thing)))
        else {
            return;
        };
        self.is_thing_gripped |= thing.is_touched(position);
        let scale = AngleScale::of(CLAW);
        let opened = scale.angle(position) - scale.angle(thing.position);
        if self.is_thing_gripped && opened > DROP_DISTANCE {
            self.drop_thing();
        }
    }
}

fn obstacle(joint: Joint, side: Side, position: i64, stiffness: Option<u16>) -> Surface {
    let stiffness = stiffness.map(|stiffness| {
        AngleScale::of(joint).torque_per_count(i64::from(stiffness.clamp(1, HIGHEST_STIFFNESS)))
    });
    Surface { side, position, stiffness }
}
