//! Makes an arm hold, and watches whether it does.
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
use crate::joints::JointSnapshot;

/// The arm notices a servo that let go after at most 200 ms (D28), and a silent one sooner.
const WATCH_TIME: Duration = Duration::from_millis(500);
const POLL_PERIOD: Duration = Duration::from_millis(50);

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
    /// [`MoveError::MayMove`] if the arm did not take the targets that hold it. Those of [`Arm::watch_hold`], also if the controller
    /// restarted: it then holds the arm.
    pub fn hold_and_watch(&mut self) -> Result<JointSnapshot, MoveError> {
        let (joints, has_restarted) = self.hold_through_restarts()?;
        if joints.is_driven() {
            self.watch_hold()?;
        }
        if has_restarted {
            return Err(restarted());
        }
        Ok(joints)
    }

    /// Makes the motors drive the joints where they are (motor state 1), and then [`Arm::watch_hold`].
    ///
    /// # Errors
    /// As [`Arm::write_motion`] and [`Arm::watch_hold`].
    pub fn engage_and_watch(&mut self) -> Result<(), MoveError> {
        let before = self.joints()?;
        self.write_motion(MOTOR_STATE.address, &[motor_state::SERVO])?;
        if self.joints()?.has_restarted_since(&before) {
            return Err(restarted());
        }
        self.watch_hold()
    }

    /// Watches for half a second whether all joints hold their targets.
    ///
    /// # Errors
    /// The motors do not drive the joints, a joint is silent, blocked or let go, a servo has an alarm, the supply was lost, the controller restarted,
    /// another program wrote a target, or an exchange failed.
    pub fn watch_hold(&mut self) -> Result<(), MoveError> {
        let all = Joint::ALL.into_iter().fold(0, |bits, joint| bits | joint.bit());
        let mut check = MoveCheck::begin(self, all)?;
        let held = self.joints()?.targets();
        let end = self.now() + WATCH_TIME;
        loop {
            check.check(self)?;
            if self.joints()?.targets() != held {
                return Err(MoveError::OtherTargets);
            }
            if self.now() >= end {
                return self.no_alarm();
            }
            self.sleep(POLL_PERIOD);
        }
    }

    /// Fails if a servo has an alarm: it may have switched itself off.
    fn no_alarm(&mut self) -> Result<(), MoveError> {
        let mut problems = self.health()?.problems();
        problems.retain(|problem| problem.kind.is_alarm());
        if problems.is_empty() { Ok(()) } else { Err(MoveError::Problems(problems)) }
    }
}

fn restarted() -> MoveError {
    MoveError::Problems(vec![Problem::of_arm(ProblemKind::Restarted)])
}
