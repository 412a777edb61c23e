//! Makes an arm hold, and watches whether the joints stay.
//!
//! ```text
//!   Arm::hold, or motor state 1 ──▶ Arm::watch_hold: half a second ──▶ Ok, or the reason why a joint does not hold
//! ```
//!
//! The arm needs some time to notice a silent servo, or one without torque. So an arm that was just told to hold is watched.

use std::time::Duration;

use protocol_core::registers::Joint;
use protocol_core::registers::map::{MOTOR_STATE, motor_state};

use super::error::MoveError;
use crate::arm::Arm;
use crate::health::{MoveCheck, Problem, ProblemKind};
use crate::joints::{JointSnapshot, bits};

/// The arm usually notices within 300 ms that a servo has let go (D28), and sooner that a servo is silent.
const WATCH_TIME: Duration = Duration::from_millis(500);
/// A joint whose target still changes after this time does not hold. The arm reports a joint that gives way as blocked
/// after a second (D27).
const LONGEST_WATCH: Duration = Duration::from_millis(2_000);
const POLL_PERIOD: Duration = Duration::from_millis(50);
/// A target that the arm itself gives a joint is at most this far from the joint: on the simulated arm, a joint that pushes with
/// the default limit is at most 4 degrees from its set-point (D27).
const OWN_TARGET_DEGREES: u8 = 4;
/// A joint that is further than this from its target, and further than at the start, does not hold. A loaded joint droops by
/// up to 1.5 degrees, and one that was stopped at speed comes back to its target.
pub const HELD_DEGREES: u8 = 10;

impl Arm {
    /// As [`Arm::hold`], and then [`Arm::watch_hold`] if the motors drive the joints.
    ///
    /// ```
    /// use sevenbot::moves::MoveError;
    /// use sevenbot::simulated::{self, SimulationConfig};
    /// use std::time::Duration;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let (mut arm, simulation) = simulated::arm(SimulationConfig::default())?;
    /// arm.driven_joints()?;
    /// arm.hold_and_watch()?;
    /// simulation.with(|simulation| {
    ///     simulation.plant_mut().set_fault(sevenbot::Joint::ALL[1], "missing".parse().ok());
    /// });
    /// assert!(matches!(arm.hold_and_watch(), Err(MoveError::Problems(_))));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`MoveError::MayMove`] if the arm did not take the targets that hold it, or does not answer any more. The errors of
    /// [`Arm::watch_hold`]. [`MoveError::Problems`] if the controller restarted; after its restart it holds the arm.
    pub fn hold_and_watch(&mut self) -> Result<JointSnapshot, MoveError> {
        let (joints, has_restarted) = self.hold_through_restarts()?;
        if joints.is_driven() {
            self.watch_hold().map_err(|error| match error {
                MoveError::Exchange(error) => MoveError::MayMove(error.into()),
                other => other,
            })?;
        }
        if has_restarted {
            return Err(restarted());
        }
        Ok(joints)
    }

    /// Makes the motors drive the joints where they are (motor state 1), and then [`Arm::watch_hold`].
    ///
    /// # Errors
    /// [`MoveError::Problems`] if no servo answers (then nothing is written) or the controller restarted. Also the errors of
    /// [`Arm::write_motion`] and [`Arm::watch_hold`].
    pub fn engage_and_watch(&mut self) -> Result<(), MoveError> {
        let before = self.joints()?;
        self.some_servo_answers()?;
        self.write_motion(MOTOR_STATE.address, &[motor_state::SERVO])?;
        if self.joints()?.has_restarted_since(&before) {
            return Err(restarted());
        }
        self.watch_hold()
    }

    /// Fails if no servo answers. In motor state 1 the motors would start as soon as their supply is switched on.
    pub(super) fn some_servo_answers(&mut self) -> Result<(), MoveError> {
        self.has_none(|kind| kind == ProblemKind::NoServoAnswers)
    }

    /// Watches for half a second whether all joints hold their targets. A joint that engages or gives way gets its own position
    /// as its target. Then the watch goes on for another half second, until the joint stays or the arm reports a problem.
    ///
    /// # Errors
    /// The motors do not drive the joints, a joint is silent, let go or newly blocked, a servo has an alarm, the supply was lost,
    /// the controller restarted, another program stopped the arm or wrote a target further than 4 degrees away, or an exchange
    /// failed. [`MoveError::NotHeld`] if a joint is further than 10 degrees from its target at the end, and further than at the
    /// start, or still gives way after 2 seconds.
    pub fn watch_hold(&mut self) -> Result<(), MoveError> {
        let mut check = MoveCheck::begin(self, bits(Joint::ALL))?;
        let mut begun = self.joints()?;
        let mut end = self.now() + WATCH_TIME;
        let longest = self.now() + LONGEST_WATCH;
        loop {
            let joints = self.joints()?;
            // Check after the joints are read. A restart also changes targets, and the check reports it as a restart.
            check.check(self)?;
            let changed: Vec<_> = Joint::ALL
                .into_iter()
                .filter(|joint| joints.target(*joint) != begun.target(*joint))
                .collect();
            if !changed.is_empty() {
                // The arm itself changes a target only to a value near the joint. Any other change comes from another program.
                if changed.iter().any(|joint| distance(&joints, *joint) > OWN_TARGET_DEGREES) {
                    return Err(MoveError::OtherTargets);
                }
                if self.now() >= longest {
                    let gives_way = |joint| (joint, joints.present(joint), begun.target(joint));
                    return Err(MoveError::NotHeld { away: changed.into_iter().map(gives_way).collect() });
                }
                (begun, end) = (joints.clone(), self.now() + WATCH_TIME);
            }
            if self.now() >= end {
                check_held(&begun, &joints)?;
                return self.no_alarm();
            }
            self.sleep(POLL_PERIOD);
        }
    }

    /// Fails if a servo has an alarm: it may have switched itself off.
    fn no_alarm(&mut self) -> Result<(), MoveError> {
        self.has_none(ProblemKind::is_alarm)
    }

    /// Fails if the arm has a problem of a kind for which `is_such` is true.
    fn has_none(&mut self, is_such: fn(ProblemKind) -> bool) -> Result<(), MoveError> {
        let mut problems = self.health()?.problems();
        problems.retain(|problem| is_such(problem.kind));
        if problems.is_empty() { Ok(()) } else { Err(MoveError::Problems(problems)) }
    }
}

/// The distance of a joint from its target, in degrees.
fn distance(joints: &JointSnapshot, joint: Joint) -> u8 {
    joints.present(joint).abs_diff(joints.target(joint))
}

/// Fails if something drags joints away from their targets.
fn check_held(begun: &JointSnapshot, now: &JointSnapshot) -> Result<(), MoveError> {
    let away = Joint::ALL
        .into_iter()
        .filter(|joint| distance(now, *joint) > distance(begun, *joint).max(HELD_DEGREES));
    let away: Vec<_> = away.map(|joint| (joint, now.present(joint), now.target(joint))).collect();
    if away.is_empty() { Ok(()) } else { Err(MoveError::NotHeld { away }) }
}

fn restarted() -> MoveError {
    MoveError::Problems(vec![Problem::of_arm(ProblemKind::Restarted)])
}
