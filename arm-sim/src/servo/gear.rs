//! The gear of a simulated servo: friction, inertia and drag, and the speed that a torque gives a joint.
//!
//! A joint at rest turns when the torque exceeds the static friction. Sliding friction reduces the torque on a joint that turns.
//! Both grow by a share of the torque from outside. Friction reduces a low speed to exactly 0, so that a joint comes to rest.
//! The step is semi-implicit, so it is stable with any drag and any friction. The values are in
//! [`parameters`](crate::parameters), all integers.

use super::units::COUNT_PER_SECOND;
use crate::parameters::{CREEP_COUNTS_PER_SECOND, LOAD_FRICTION_PERCENT, ServoParameters};

/// Below this speed, in millionths of a count per step, a joint has static friction.
const CREEP: i64 = CREEP_COUNTS_PER_SECOND * COUNT_PER_SECOND;

/// The torques on a joint in a step, in micronewton metres, positive towards more counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Torques {
    pub(super) motor: i64,
    /// The torque from outside the servo.
    pub(super) outside: i64,
}

impl Torques {
    pub(super) const fn net(self) -> i64 {
        self.motor + self.outside
    }

    const fn load_friction(self) -> i64 {
        self.outside.abs() * LOAD_FRICTION_PERCENT / 100
    }
}

#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Gear(pub(super) ServoParameters);

impl Gear {
    /// Does static friction hold a joint at rest?
    pub(super) const fn holds(self, torques: Torques) -> bool {
        torques.net().abs() <= self.0.static_friction + torques.load_friction()
    }

    /// The greatest torque that the motor needs against the torque from outside, if all friction acts against the motor.
    pub(super) const fn highest_load(self, torques: Torques) -> i64 {
        torques.outside.abs() + self.0.static_friction + torques.load_friction()
    }

    /// The speed after a step, in millionths of a count per step. `drag` is in micronewton metre seconds per radian. `inertia` is
    /// the inertia of the arm in gram square millimetres.
    pub(super) fn speed_after(self, speed: i64, torques: Torques, drag: i64, inertia: i64) -> i64 {
        if speed == 0 && self.holds(torques) {
            return 0;
        }
        // A torque in micronewton metres divided by an inertia in gram square millimetres is the change of speed in a
        // millisecond, in radians per second. A drag divided by an inertia is the share of the speed that is lost in a
        // millisecond.
        let inertia = self.0.rotor_inertia + inertia;
        let momentum = speed * inertia + torques.net() * self.0.counts_per_kiloradian;
        let own = if speed.abs() < CREEP { self.0.static_friction } else { self.0.sliding_friction };
        let friction = (own + torques.load_friction()) * self.0.counts_per_kiloradian;
        let left = (momentum.abs() - friction).max(0) * momentum.signum();
        left / (inertia + drag).max(1)
    }
}

#[cfg(test)]
mod tests {
    use protocol_core::registers::Joint;

    use super::*;

    const LEVEL: i64 = 459_448;
    /// The inertia of the forearm with its tool, in gram square millimetres.
    const INERTIA: i64 = 8_700_000;

    fn gear() -> Gear {
        Gear(*ServoParameters::of(Joint::ALL[2]))
    }

    /// The speed that joint 3 reaches from rest in this many milliseconds at this torque, in degrees per second.
    fn degrees_per_second(outside: i64, drag: i64, millis: u32) -> i64 {
        let torques = Torques { motor: 0, outside };
        let speed = (0..millis).fold(0, |speed, _| gear().speed_after(speed, torques, drag, INERTIA));
        speed * 180 / 850 / COUNT_PER_SECOND
    }

    #[test]
    fn friction_holds_a_light_load() {
        let ServoParameters { free_drag, damped_drag, .. } = gear().0;
        assert_eq!(degrees_per_second(105_000, free_drag, 1_000), 0);
        assert_eq!(degrees_per_second(-105_000, damped_drag, 1_000), 0);
        assert!(degrees_per_second(110_000, free_drag, 1_000) > 0);
    }

    #[test]
    fn a_level_forearm_reaches_102_degrees_per_second_free_and_4_damped() {
        let ServoParameters { free_drag, damped_drag, .. } = gear().0;
        assert_eq!(degrees_per_second(LEVEL, free_drag, 2_000), 102);
        assert_eq!(degrees_per_second(-LEVEL, free_drag, 2_000), -102);
        assert_eq!(degrees_per_second(LEVEL, damped_drag, 2_000), 4);
        let after_a_time_constant = degrees_per_second(LEVEL, free_drag, 94);
        assert!((63..=66).contains(&after_a_time_constant), "{after_a_time_constant}");
    }

    #[test]
    fn friction_stops_a_joint_whose_load_is_gone() {
        let mut speed = 500_000;
        let mut steps = 0;
        while speed != 0 {
            let torques = Torques { motor: 0, outside: 50_000 };
            speed = gear().speed_after(speed, torques, gear().0.free_drag, INERTIA);
            assert!(speed >= 0, "it reverses");
            steps += 1;
            assert!(steps < 2_000, "it does not stop");
        }
    }

    #[test]
    fn a_loaded_gear_needs_a_share_of_its_load_more() {
        let holds = |motor, outside| gear().holds(Torques { motor, outside });
        assert!(holds(1_000_000 + 150_000, -1_000_000) && !holds(1_000_000 + 150_001, -1_000_000));
        assert!(holds(1_000_000 - 150_000, -1_000_000) && !holds(1_000_000 - 150_001, -1_000_000));
    }
}
