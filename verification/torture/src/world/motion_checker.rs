//! Checks that no joint moves by itself (D12).
//!
//! ```text
//!   goals that the servos receive ──▶ AngleRange, which contains the joint ──▶ true angle inside? ◀── Plant
//!   state, power, hands, panics   ──▶ Exemption, until the joint has torque and a goal again
//! ```
//!
//! The checker outlives restarts of the controller: a joint that holds its goal continues to hold it. The range shrinks
//! behind a joint that moves to its goal, more slowly than a servo moves. So a joint that lags behind is inside the
//! range, and a joint that falls is outside.
//!
//! After a loss of power, torque comes back with a goal of the controller, never by itself (D29).
//!
//! A joint that carries a payload, or meets an obstacle or a hand, may be past its goals while its servo drives it back.
//!
//! A joint yields to its load: it droops, and when the controller alone restarts, the measured position may be its new
//! goal, and then it droops once more. With a payload it also runs past its goal. The tolerance follows from the load and
//! the speed of each joint.

mod bounds;
mod received_commands;

use arm_sim::plant::Plant;
use motion_core::servo_bus::Torque;
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use crate::per_joint::PerJoint;
use crate::violation::{Check, ensure};
pub(super) use bounds::Exemption;
use bounds::{AngleRange, JointBounds};
use received_commands::{DecodedCommand, ReceivedCommands, millidegrees};

/// The time between two checks. A joint that falls needs longer to exceed its tolerance.
const CHECK_PERIOD: Duration = Duration::from_millis(5);
/// Millidegrees per second by which the range shrinks behind the joint. A servo far from its goal moves at 372 degrees/s.
const SHRINK_PER_SECOND: u64 = 80_000;
/// A servo may still approach a goal of this age: its set-point and its motor lag behind by 30 ms.
const GOAL_AGE: Duration = Duration::from_millis(100);
/// When the set-point of a joint that pushes comes back fast, the derivative term of its servo turns the joint away from its
/// goal for a moment: by this much, in millidegrees.
const RECOIL: i32 = 2_000;
/// A joint that was turned past its goals is back within this time after the cause is gone.
const OVERRUN_TIME: Duration = Duration::from_millis(1_000);
/// A joint that is given torque may still fall, or approach an older goal, for this time.
const SETTLE_TIME: Duration = Duration::from_millis(200);

#[derive(Debug)]
pub(super) struct MotionChecker {
    joints: PerJoint<JointBounds>,
    checked_at: Instant,
    received: ReceivedCommands,
}

impl MotionChecker {
    pub(super) const fn new(now: Instant) -> Self {
        Self {
            joints: PerJoint::all(JointBounds::without_power(now)),
            checked_at: now,
            received: ReceivedCommands::new(),
        }
    }

    /// Exempts a joint until its servo has torque and a goal again.
    pub(super) fn exempt(&mut self, now: Instant, joint: Joint, exemption: Exemption) {
        let bounds = &mut self.joints[joint];
        bounds.exemption = Some((exemption, now + SETTLE_TIME));
        bounds.goal = None;
        bounds.awaits_goal &= exemption == Exemption::PowerLoss;
    }

    /// Allows [`RECOIL`] more in this period, because the set-point of a joint that pushes may come back at once (D27), or fast
    /// from far behind a wall.
    pub(super) fn may_recoil(&mut self, joint: Joint, plant: &Plant) {
        let [largest, _] = &mut self.joints[joint].yields;
        *largest = (*largest).max(yield_of(joint, plant).saturating_add(RECOIL));
    }

    /// A payload, an obstacle or a hand may turn or hold the joint past its goals while its servo drives it back.
    pub(super) fn may_overrun(&mut self, now: Instant, joint: Joint) {
        self.joints[joint].overruns_until = now + OVERRUN_TIME;
    }

    pub(super) fn exempt_all(&mut self, now: Instant, exemption: Exemption) {
        Joint::ALL.into_iter().for_each(|joint| self.exempt(now, joint, exemption));
    }

    /// Records that all servos lost their power, and with it the bytes of an incomplete frame.
    pub(super) fn power_cycle(&mut self, now: Instant) {
        self.received.clear();
        self.exempt_all(now, Exemption::PowerLoss);
    }

    /// Applies the commands in `received`: the frame `sent`, as the servos receive it after disturbances. Exempts all joints if
    /// the two differ.
    pub(super) fn frame_sent(&mut self, now: Instant, sent: &[u8], received: &[u8]) {
        if sent != received {
            self.exempt_all(now, Exemption::Noise);
        }
        for command in self.received.of_frame(sent, received) {
            self.apply(now, command);
        }
    }

    fn apply(&mut self, now: Instant, command: DecodedCommand) {
        match command {
            DecodedCommand::Goal(joint, angle) => {
                let bounds = &mut self.joints[joint];
                if bounds.goal.is_none() {
                    bounds.goals = [AngleRange::at(angle); 2];
                }
                bounds.goal = Some(angle);
                bounds.awaits_goal = false;
                let [new, _] = &mut bounds.goals;
                new.reach(angle);
                bounds.range.reach(angle);
            }
            DecodedCommand::Noise(joint) => self.exempt(now, joint, Exemption::Noise),
        }
    }

    /// Checks all joints. `is_servo` is true if the motor state is servo, or was when the controller stopped. `is_guarded`
    /// tells that the controller knows the servos and protects them.
    pub(super) fn check(&mut self, now: Instant, is_servo: bool, is_guarded: bool, plant: &Plant) -> Check {
        if !is_servo {
            self.exempt_all(now, Exemption::MotorState);
        }
        if now - self.checked_at < CHECK_PERIOD {
            return Ok(());
        }
        let shrunk = (now - self.checked_at).as_micros() * SHRINK_PER_SECOND / 1_000_000;
        if now.as_micros() / GOAL_AGE.as_micros() != self.checked_at.as_micros() / GOAL_AGE.as_micros() {
            self.joints.0.iter_mut().for_each(JointBounds::age);
        }
        self.checked_at = now;
        let by = i32::try_from(shrunk).unwrap_or(i32::MAX).min(1_000_000);
        for joint in Joint::ALL {
            self.check_return_of_torque(joint, is_guarded, plant)?;
            self.check_joint(now, joint, by, plant)?;
        }
        Ok(())
    }

    /// Checks that a servo that lost its power has torque again only after it has received a goal.
    fn check_return_of_torque(&mut self, joint: Joint, is_guarded: bool, plant: &Plant) -> Check {
        let bounds = &mut self.joints[joint];
        let has_torque = plant.torque(joint) == Some(Torque::On);
        let had_torque = std::mem::replace(&mut bounds.had_torque, has_torque);
        let is_back = has_torque && !had_torque;
        ensure(!(is_back && bounds.awaits_goal && is_guarded), || {
            format!("the torque of joint {} came back by itself", joint.number())
        })
    }

    fn check_joint(&mut self, now: Instant, joint: Joint, by: i32, plant: &Plant) -> Check {
        let (angle, torque) = (plant.angle(joint), plant.torque(joint));
        let [largest, _] = &mut self.joints[joint].yields;
        *largest = (*largest).max(yield_of(joint, plant));
        if !plant.has_power(joint) {
            self.exempt(now, joint, Exemption::PowerLoss);
            self.joints[joint].awaits_goal = true;
        }
        let bounds = &mut self.joints[joint];
        if torque.is_none() {
            bounds.suspend(now + SETTLE_TIME);
        }
        let Some(goal) = bounds.goal else { return Ok(()) };
        let [mut goals, old] = bounds.goals;
        goals.reach(old.low);
        goals.reach(old.high);
        if let Some((_, until)) = bounds.exemption {
            if torque == Some(Torque::On) && now >= until {
                bounds.exemption = None;
                bounds.range = goals;
                bounds.range.reach(angle);
            }
            return Ok(());
        }
        bounds.range.shrink(goals, angle, by);
        let (range, tolerance) = (bounds.range, bounds.tolerance());
        let excess = range.excess(angle);
        let comes_back = excess < std::mem::replace(&mut bounds.excess, excess);
        let is_driven_back = comes_back || range.is_driven_back(angle, load_of(joint, plant));
        let overruns = now < bounds.overruns_until && is_driven_back;
        ensure(overruns || excess <= tolerance, || {
            format!(
                "joint {} moved by itself to {angle} millidegrees with the goal {goal} and torque {torque:?}; \
                 its range is {} to {}, and its tolerance {tolerance}",
                joint.number(),
                range.low,
                range.high
            )
        })
    }
}

/// How far a driven joint may be off its set-point, in millidegrees: by the droop of its own load, and by the distance
/// in which its motor can stop it. This distance hides no fall: the load of a joint is smaller than the stall torque, so a
/// joint falls farther than the distance in which its motor can stop it.
fn yield_of(joint: Joint, plant: &Plant) -> i32 {
    let droop = plant.droop(joint).unwrap_or(i32::MAX);
    droop.saturating_add(plant.stopping_distance(joint))
}

/// The load of a joint in 0.1 %, positive towards greater angles.
fn load_of(joint: Joint, plant: &Plant) -> i16 {
    let load = plant.load(joint);
    if millidegrees(joint, 1_000) > millidegrees(joint, 0) { load } else { -load }
}

#[cfg(test)]
mod tests {
    use arm_sim::servo::Trip;

    use super::*;
    use crate::violation::Violation;
    use crate::world::scripted_arm::{ScriptedArm, goal_frame, torque_frame};

    /// A joint that carries weight.
    const JOINT: Joint = Joint::ALL[2];

    fn says(check: &Check, what: &str) -> bool {
        matches!(check, Err(Violation(text)) if text.contains(what))
    }

    /// An arm whose servo has restarted and is back, without torque.
    fn restarted() -> ScriptedArm {
        let mut arm = ScriptedArm::with_engaged(JOINT);
        arm.run(1_000).unwrap();
        arm.bus.restart_servo(arm.now, JOINT);
        arm.run(1_000).unwrap();
        assert!(arm.bus.is_free(JOINT));
        arm
    }

    #[test]
    fn torque_that_comes_back_without_a_goal_is_noticed() {
        // The planted fault: a controller that refreshes torque without reading it.
        let mut arm = restarted();
        let noticed = arm.send_unchecked(&torque_frame(JOINT, Torque::On)).and_then(|()| arm.run(10));
        assert!(says(&noticed, "the torque of joint 3 came back by itself"), "{noticed:?}");
    }

    #[test]
    fn torque_that_comes_back_after_an_emergency_stop_is_noticed() {
        let mut arm = ScriptedArm::with_engaged(JOINT);
        arm.run(1_000).unwrap();
        arm.bus.begin_stop(arm.now);
        arm.run(300).unwrap();
        arm.bus.end_stop(arm.now);
        arm.run(1_000).unwrap();
        let noticed = arm.send_unchecked(&torque_frame(JOINT, Torque::On)).and_then(|()| arm.run(10));
        assert!(says(&noticed, "the torque of joint 3 came back by itself"), "{noticed:?}");
    }

    #[test]
    fn torque_with_a_goal_and_torque_of_an_unguarded_arm_may_come_back() {
        let mut with_goal = restarted();
        let position = with_goal.bus.position(JOINT);
        with_goal.send_unchecked(&goal_frame(JOINT, position)).unwrap();
        with_goal.send_unchecked(&torque_frame(JOINT, Torque::On)).unwrap();
        assert_eq!(with_goal.run(100), Ok(()));
        let mut unguarded = restarted();
        unguarded.is_guarded = false;
        unguarded.send_unchecked(&torque_frame(JOINT, Torque::On)).unwrap();
        assert_eq!(unguarded.run(10), Ok(()), "without protection, or after a stall");
    }

    #[test]
    fn a_servo_that_was_hot_may_hold_its_goal_again_by_itself() {
        // This joint carries no weight, so it stands still without torque.
        let joint = Joint::ALL[0];
        let cools = |arm: &mut ScriptedArm| {
            assert!(!arm.bus.has_torque(joint));
            while !arm.bus.has_torque(joint) {
                arm.run(100)?;
            }
            arm.run(100)
        };
        let mut arm = ScriptedArm::with_engaged(joint);
        arm.run(1_000).unwrap();
        arm.bus.trip(arm.now, joint, Trip::Heat);
        arm.run(100).unwrap();
        assert_eq!(cools(&mut arm), Ok(()));
        // The servo restarts hot, and receives a goal and torque while the alarm lasts.
        arm.bus.trip(arm.now, joint, Trip::Heat);
        arm.bus.restart_servo(arm.now, joint);
        arm.run(1_000).unwrap();
        let position = arm.bus.position(joint);
        arm.send_unchecked(&goal_frame(joint, position)).unwrap();
        arm.send_unchecked(&torque_frame(joint, Torque::On)).unwrap();
        assert_eq!(cools(&mut arm), Ok(()));
    }

    #[test]
    fn a_joint_that_falls_is_noticed_unless_it_is_exempt() {
        for exemption in [None, Some(Exemption::MotorState)] {
            let mut arm = ScriptedArm::with_engaged(JOINT);
            arm.bus.set_load(arm.now, 300);
            arm.run(500).unwrap();
            arm.send_unchecked(&torque_frame(JOINT, Torque::Free)).unwrap();
            if exemption.is_some() {
                arm.bus.exempt_all_by_state(arm.now);
            }
            let check = arm.run(2_000);
            assert_eq!(says(&check, "joint 3 moved by itself"), exemption.is_none(), "{check:?}");
        }
    }

    #[test]
    fn a_joint_may_be_turned_past_its_goal_while_its_servo_drives_it_back() {
        let mut arm = ScriptedArm::with_engaged(JOINT);
        arm.run(500).unwrap();
        arm.bus.push(arm.now, JOINT, 1_000);
        assert_eq!(arm.run(1_000), Ok(()));
        arm.bus.push(arm.now, JOINT, 0);
        assert_eq!(arm.run(2_000), Ok(()), "back at its goal");
    }
}
