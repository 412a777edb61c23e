//! Joints that another simulation moves, while this one simulates the controller and the electronics of the servos.
//!
//! ```text
//!   set-points, torque switches ──▶ MuJoCo, or another simulation of the arm and what it touches
//!   positions, velocities, loads ◀──┘
//! ```
//!
//! Such a joint meets the obstacles of the other simulation. The weight, the walls and the hands that hold or push in this
//! simulation, and faults that block a servo, have no effect on it. Alarms, heat, the supply and all faults of the servo bus
//! still act on it.

use protocol_core::registers::Joint;

use super::Plant;
use super::pose::AngleScale;

/// The state of a joint in another simulation. The angle does not include the offset of registers 13 to 19.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutsideState {
    /// In thousandths of a degree.
    pub angle: i32,
    /// In thousandths of a degree per second.
    pub velocity: i32,
    /// The duty of the motor in 0.1 %, positive towards greater angles. At standstill, it is the torque in 0.1 % of the stall
    /// torque.
    pub load: i16,
}

impl Plant {
    /// Sets the present state of a joint from another simulation, which moves the joint from now on. With `None` this simulation
    /// moves the joint again. Until the next call, the joint continues at the velocity in `state`.
    pub fn measure(&mut self, joint: Joint, state: Option<OutsideState>) {
        let scale = AngleScale::of(joint);
        let Some(servo) = self.servo_mut(joint) else { return };
        let Some(OutsideState { angle, velocity, load }) = state else {
            servo.move_inside();
            return;
        };
        // A step is a thousandth of a second.
        let moved = scale.distance(velocity.into()) / 1_000;
        let load = i16::try_from(scale.torque_towards_counts(load.into())).unwrap_or(0);
        servo.measure(scale.position(angle.into()), moved, load);
    }

    /// The angle that a servo's control aims at, in thousandths of a degree. It moves to the goal at the speed or in the time of
    /// the goal. Without torque it is the joint's angle.
    #[must_use]
    pub fn set_point(&self, joint: Joint) -> i32 {
        let set_point = self.servo(joint).map_or(0, |servo| AngleScale::of(joint).angle(servo.set_point()));
        i32::try_from(set_point).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use motion_core::servo_bus::Torque;
    use protocol_core::time::Duration;

    use super::*;
    use crate::Simulation;
    use crate::request::Request;

    const JOINT: Joint = Joint::ALL[2];
    const MILLISECOND: Duration = Duration::from_millis(1);

    fn started() -> Simulation {
        let mut arm = Simulation::default();
        arm.advance(Duration::from_millis(1_000));
        arm
    }

    fn at(angle: i32) -> OutsideState {
        OutsideState { angle, velocity: 0, load: 0 }
    }

    #[test]
    fn a_joint_is_where_the_other_simulation_says() {
        let mut arm = started();
        let state = OutsideState { angle: 70_000, velocity: 30_000, load: -250 };
        arm.plant_mut().measure(JOINT, Some(state));
        arm.advance(Duration::from_millis(10));
        let moved = f64::from(arm.plant().angle(JOINT) - 70_000);
        assert!((moved - 300.0).abs() < 30.0, "10 ms at 30 degrees a second: {moved}");
        arm.send_request(&Request::Read { address: 0, count: 255 });
        arm.plant_mut().measure(JOINT, Some(at(75_000)));
        arm.advance(Duration::from_millis(100));
        let register = |address| arm.registers().get(address);
        assert_eq!(register(56), 75, "the position of joint 3");
        assert_eq!(arm.plant().load(JOINT), 0);
    }

    #[test]
    fn the_set_point_goes_to_the_target_and_the_joint_does_not() {
        let mut arm = started();
        arm.plant_mut().measure(JOINT, Some(at(65_000)));
        arm.send_request(&Request::Write { address: 48, values: &[80] });
        let mut before = arm.plant().set_point(JOINT);
        for _ in 0..1_000 {
            arm.advance(MILLISECOND);
            let set_point = arm.plant().set_point(JOINT);
            assert!((set_point - before).abs() < 400, "372 degrees a second at most");
            before = set_point;
        }
        assert!((before - 80_000).abs() < 200, "{before}");
        assert_eq!(arm.plant().torque(JOINT), Some(Torque::On));
        assert!((arm.plant().angle(JOINT) - 65_000).abs() < 2);
        // The joint goes to its set-point when this simulation moves it again.
        arm.plant_mut().measure(JOINT, None);
        arm.advance(Duration::from_millis(1_000));
        assert!((arm.plant().angle(JOINT) - 80_000).abs() < 1_500);
    }

    #[test]
    fn a_load_trips_the_protection_and_heats() {
        let mut arm = started();
        let pressed = OutsideState { load: 1_000, ..at(65_000) };
        arm.plant_mut().measure(JOINT, Some(pressed));
        arm.advance(Duration::from_millis(3_000));
        assert!(arm.plant().is_overloaded(JOINT));
    }
}
