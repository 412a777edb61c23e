//! The gear of a simulated servo: torque, friction and inertia, and the motion without torque.
//!
//! | | joints 1 to 4 | joints 5 to 7 | source |
//! | --- | --- | --- | --- |
//! | stall torque | 1618 mN m | 230 mN m | datasheet of the 15 kg cm servo at 7.4 V (16.5 kg cm); assumed |
//! | friction of the gear | 100 mN m | 15 mN m | assumed |
//! | drag without torque | 200 mN m s/rad | 40 mN m s/rad | assumed |
//! | drag, damping | 5000 mN m s/rad | 1000 mN m s/rad | assumed |
//! | inertia, with the arm's share | 20 g m² | 1 g m² | assumed |
//!
//! A joint at rest does not move if its load is below the friction. Otherwise it accelerates until the drag equals the
//! rest of the load: a level forearm falls at up to 103 degrees/s without torque and sinks at 4.1 degrees/s with damping.
//! All values are integers.

use protocol_core::registers::Joint;

use super::units::{COUNT_PER_SECOND, STEP};

/// The constants of a gear.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gear {
    /// The torque at which it cannot turn, in micronewton metres.
    stall: i64,
    /// The torque below which it does not start to turn, and which it loses while it turns; likewise.
    friction: i64,
    /// The torque that it loses per speed, in millinewton metre seconds per radian.
    free_drag: i64,
    /// Likewise, while the motor brakes.
    damped_drag: i64,
    /// The moment of inertia, in gram square metres.
    inertia: i64,
    /// Counts in a thousand radians.
    counts_per_kiloradian: i64,
}

/// Joints 1 to 4: 850 counts in half a turn.
const LARGE: Gear = Gear {
    stall: 1_618_000,
    friction: 100_000,
    free_drag: 200,
    damped_drag: 5_000,
    inertia: 20,
    counts_per_kiloradian: 270_563,
};

/// Joints 5 to 7: 625 counts in half a turn.
const SMALL: Gear = Gear {
    stall: 230_000,
    friction: 15_000,
    free_drag: 40,
    damped_drag: 1_000,
    inertia: 1,
    counts_per_kiloradian: 198_944,
};

/// The resistance of a motor without torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Drag {
    /// The gear alone.
    Free,
    /// The gear, and the motor with its windings shorted.
    Damped,
}

impl Gear {
    pub(crate) const fn of(joint: Joint) -> Self {
        if joint.number() < 5 { LARGE } else { SMALL }
    }

    /// A torque in micronewton metres, in millionths of the stall torque.
    pub(crate) fn share_of_stall(&self, torque: i64) -> i64 {
        torque * 1_000_000 / self.stall.max(1)
    }

    /// Does the friction hold this torque?
    pub(crate) const fn holds(&self, torque: i64) -> bool {
        torque.abs() <= self.friction
    }

    /// The speed after a step at this torque, in millionths of a count per step.
    pub(crate) fn speed_after(&self, speed: i64, torque: i64, drag: Drag) -> i64 {
        let towards = if speed == 0 { torque.signum() } else { speed.signum() };
        if speed == 0 && self.holds(torque) {
            return 0;
        }
        let drag = match drag {
            Drag::Free => self.free_drag,
            Drag::Damped => self.damped_drag,
        };
        let net = torque - towards * self.friction;
        // Micronewton metres by millinewton metre seconds: thousandths of a radian per second.
        let last = net * self.counts_per_kiloradian / drag.max(1) * COUNT_PER_SECOND / 1_000_000;
        let rate = drag * STEP_MICROS / self.inertia.max(1);
        let after = speed + (last - speed) * rate.min(1_000_000) / 1_000_000;
        // Friction stops a joint and does not reverse it.
        if after * towards < COUNT_PER_SECOND && self.holds(torque) { 0 } else { after }
    }
}

/// The length of a step in millionths of a second.
const STEP_MICROS: i64 = STEP.as_micros().cast_signed();

#[cfg(test)]
mod tests {
    use super::*;

    /// The speed of joint 3 in degrees per second, after this many milliseconds at this torque from rest.
    fn degrees_per_second(torque: i64, drag: Drag, millis: u32) -> i64 {
        let gear = Gear::of(Joint::ALL[2]);
        let speed = (0..millis).fold(0, |speed, _| gear.speed_after(speed, torque, drag));
        speed * 180 / 850 / COUNT_PER_SECOND
    }

    #[test]
    fn friction_holds_a_light_load() {
        assert_eq!(degrees_per_second(100_000, Drag::Free, 1_000), 0);
        assert_eq!(degrees_per_second(-100_000, Drag::Damped, 1_000), 0);
    }

    #[test]
    fn a_level_forearm_reaches_103_degrees_per_second_free_and_4_damped() {
        let level = 459_448;
        assert_eq!(degrees_per_second(level, Drag::Free, 2_000), 102);
        assert_eq!(degrees_per_second(-level, Drag::Free, 2_000), -102);
        assert_eq!(degrees_per_second(level, Drag::Damped, 2_000), 4);
        let after_a_time_constant = degrees_per_second(level, Drag::Free, 100);
        assert!((63..=66).contains(&after_a_time_constant), "{after_a_time_constant}");
    }

    #[test]
    fn friction_stops_a_joint_whose_load_is_gone() {
        let gear = Gear::of(Joint::ALL[2]);
        let mut speed = 500_000;
        let mut steps = 0;
        while speed != 0 {
            speed = gear.speed_after(speed, 50_000, Drag::Free);
            assert!(speed >= 0, "it reverses");
            steps += 1;
            assert!(steps < 1_000, "it does not stop");
        }
    }
}
