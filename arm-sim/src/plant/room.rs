//! The arm in its room: what it touches, carries and drops.

use alloc::boxed::Box;

use protocol_core::registers::{JOINTS, Joint};

use super::pose::AngleScale;
use super::{Plant, Thing};
use crate::scene::Scene;
use crate::world::{ArmInWorld, Effect, World};

impl Plant {
    /// Puts a scene on the table round the arm, or takes it away. What the arm carried is gone.
    pub fn set_scene(&mut self, scene: Option<Scene>) {
        self.leave_room();
        self.world = scene.map(|scene| Box::new(World::new(scene)));
    }

    /// The room, if there is a scene.
    #[must_use]
    pub fn world(&self) -> Option<&World> {
        self.world.as_deref()
    }

    /// Lets the suction cup of a scene suck, or let go.
    pub const fn set_sucking(&mut self, is_sucking: bool) {
        self.is_sucking = is_sucking;
        self.rest_until = self.now;
    }

    fn leave_room(&mut self) {
        if self.world.take().is_some() {
            self.drop_thing();
            self.set_contacts([0.0; 6]);
        }
    }

    /// A step of the room, after a step of the joints.
    pub(super) fn follow_in_room(&mut self) {
        let arm = self.arm_in_room();
        let Some(world) = &mut self.world else { return };
        let effect = world.step(arm);
        if world.is_moving() {
            self.rest_until = self.now;
        }
        self.apply(&effect);
    }

    fn arm_in_room(&self) -> ArmInWorld {
        let mut angles = [0.0; JOINTS];
        for (angle, joint) in angles.iter_mut().zip(Joint::ALL) {
            *angle = f64::from(self.angle(joint)) / 1_000.0;
        }
        ArmInWorld { angles, is_gripping: self.is_thing_gripped, is_sucking: self.is_sucking }
    }

    fn apply(&mut self, &Effect { torques, claw_stop, load_g }: &Effect) {
        self.set_contacts(torques);
        // Claws that hold something keep what they hold: its angle is that of the moment when they closed.
        let stop = claw_stop.map(millidegrees);
        if !self.is_thing_gripped && stop != self.thing.map(|thing| thing.millidegrees) {
            self.set_thing(stop.map(|millidegrees| Thing { millidegrees, stiffness: None }));
        }
        if load_g != self.load_g {
            self.set_load(load_g);
        }
    }

    /// The torques of contacts on joints 1 to 6, in mN m towards greater angles.
    fn set_contacts(&mut self, torques: [f64; 6]) {
        for (torque, joint) in torques.into_iter().zip(Joint::ALL) {
            let torque = AngleScale::of(joint).torque_towards_counts(micronewton_metres(torque));
            let servo = self.servo(joint);
            if servo.is_some_and(|servo| servo.contact() != torque) {
                self.servo_mut(joint).into_iter().for_each(|servo| servo.set_contact(torque));
            }
        }
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "a part below a micronewton metre has no effect, and too much saturates"
)]
const fn micronewton_metres(millinewton_metres: f64) -> i64 {
    (millinewton_metres * 1_000.0) as i64
}

#[expect(clippy::cast_possible_truncation, reason = "joint 7 has 0 to 84 degrees")]
const fn millidegrees(degrees: f64) -> i32 {
    (degrees * 1_000.0) as i32
}
