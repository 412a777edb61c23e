//! The arm in its room: what it touches, carries and drops.

use alloc::boxed::Box;

use super::{Plant, Thing};
use crate::scene::Scene;
use crate::world::{ArmInWorld, Effect, Object, World};

impl Plant {
    /// Puts a scene on the table round the arm, or removes it. The arm loses the object of the room that it carries.
    pub fn set_scene(&mut self, scene: Option<Scene>) {
        self.leave_room();
        self.world = scene.map(|scene| Box::new(World::new(scene)));
    }

    /// The room, if there is a scene.
    #[must_use]
    pub fn world(&self) -> Option<&World> {
        self.world.as_deref()
    }

    /// The cubes and cylinders of the room, in the order of the scene. Empty without a scene.
    #[must_use]
    pub fn objects(&self) -> &[Object] {
        self.world().map_or(&[], World::objects)
    }

    /// Sets whether the suction cup of a scene sucks.
    pub const fn set_sucking(&mut self, is_sucking: bool) {
        self.is_sucking = is_sucking;
        self.rest_until = self.now;
    }

    fn leave_room(&mut self) {
        self.world = None;
        self.apply(&Effect::default());
    }

    /// A step of the room, after a step of the joints.
    pub(super) fn follow_in_room(&mut self) {
        if self.world.is_none() {
            return;
        }
        let arm = self.arm_in_room();
        let Some(world) = &mut self.world else { return };
        let effect = world.step(arm);
        if world.is_moving() {
            self.rest_until = self.now;
        }
        self.apply(&effect);
    }

    fn arm_in_room(&self) -> ArmInWorld {
        let angles = self.angles().map(|angle| f64::from(i32::try_from(angle).unwrap_or(0)) / 1_000.0);
        let is_gripping = self.is_thing_gripped && self.room_stop.is_some();
        ArmInWorld { angles, is_gripping, is_sucking: self.is_sucking }
    }

    fn apply(&mut self, &Effect { torques, claw_stop, load_g }: &Effect) {
        self.set_contacts(torques);
        // Claws that hold an object keep the angle at which they closed on it. A thing that a person put between them stays, too.
        let is_held = self.is_thing_gripped && load_g != 0;
        let is_of_a_person = self.has_thing() && self.room_stop.is_none();
        let stop = claw_stop.map(millidegrees);
        if !is_held && !is_of_a_person && stop != self.room_stop {
            self.set_thing(stop.map(|millidegrees| Thing { millidegrees, stiffness: None }));
            self.room_stop = stop;
        }
        if load_g != self.carried_g {
            self.carried_g = load_g;
            self.update_weight();
        }
    }

    /// The torques of contacts on joints 1 to 6, in mN m towards greater angles.
    fn set_contacts(&mut self, torques: [f64; 6]) {
        let servos = self.servos.iter_mut().zip(&mut self.rests).zip(self.scales);
        for (((servo, rest), scale), torque) in servos.zip(torques) {
            let torque = scale.torque_towards_counts(micronewton_metres(torque));
            if servo.contact() != torque {
                rest.end(servo, self.now);
                servo.set_contact(torque);
                self.rest_until = self.now;
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
