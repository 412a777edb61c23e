//! The seven joints: their measured positions, their drives, and the goals and torque of their servos
//! ([D9](protocol_core::decisions#d9), [D12](protocol_core::decisions#d12), [D13](protocol_core::decisions#d13)).
//!
//! ```text
//!   targets, offsets, state ──▶ ┌──────────────────────────┐ ──▶ goals, torque
//!   readings, silence       ──▶ │ 7 × PositionFilter, Drive│ ──▶ positions, alarms
//!                               └──────────────────────────┘
//! ```
//!
//! linkage.rs lets joints 2 and 3 wait for each other. This file does not know the frames or the timing of the bus.

mod linkage;

use protocol_core::registers::map::{
    BLOCKED_JOINTS, FINE_TARGET, LET_GO_JOINTS, MEASURED_JOINTS, SERVO_ALARMS, SPEED, TARGET_POSITION, TIME,
};
use protocol_core::registers::{Accepted, JOINTS, Joint, RegisterFile};
use protocol_core::time::{Duration, Instant};

use crate::calibration::{MicroDegrees, angle_from_counts, counts_from_angle};
use crate::drive::Drive;
use crate::joint_state::{JointState, Measured};
use crate::motor_state::MotorState;
use crate::reach::Reached;
use crate::servo_bus::{Answer, Question, Torque};
use crate::supply_watch::SupplyWatch;

/// Shorter than the 200 ms or so for which a restarting servo executes nothing. So a servo that has answered within this
/// time has not completed a restart since.
const RESTART_TIME: Duration = Duration::from_millis(180);

/// The seven joints and their motor state.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Joints {
    joints: [JointState; JOINTS],
    state: MotorState,
    supply: SupplyWatch,
    /// Before this time, every engaged joint has answered within [`RESTART_TIME`] or is doubted already.
    doubt_at: Instant,
}

impl Joints {
    /// Joints at power-up. In the servo state each waits to engage.
    pub(crate) fn new(state: MotorState) -> Self {
        let mut drive = Drive::RELEASED;
        if state == MotorState::Servo {
            drive.wait();
        }
        let joints = Joint::ALL.map(|joint| JointState::new(joint, drive.clone()));
        Self { joints, state, supply: SupplyWatch::NEW, doubt_at: Instant::ZERO }
    }

    fn joint(&self, joint: Joint) -> Option<&JointState> {
        self.joints.get(usize::from(joint.index()))
    }

    fn joint_mut(&mut self, joint: Joint) -> Option<&mut JointState> {
        self.joints.get_mut(usize::from(joint.index()))
    }

    fn each(&self) -> impl Iterator<Item = (Joint, &JointState)> {
        Joint::ALL.into_iter().zip(&self.joints)
    }

    fn each_mut(&mut self) -> impl Iterator<Item = (Joint, &mut JointState)> {
        Joint::ALL.into_iter().zip(&mut self.joints)
    }

    fn set_of(&self, belongs: impl Fn(&JointState) -> bool) -> u8 {
        self.each().filter(|(_, state)| belongs(state)).fold(0, |bits, (joint, _)| bits | joint.bit())
    }

    /// Enters a motor state. The servo state takes the measured positions as targets ([D13](protocol_core::decisions#d13)).
    /// Returns whether the state changed.
    pub(crate) fn set_state(&mut self, state: MotorState, registers: &mut RegisterFile) -> bool {
        if state == self.state {
            return false;
        }
        self.state = state;
        self.supply = SupplyWatch::NEW;
        for joint in &mut self.joints {
            joint.set_driven(state == MotorState::Servo);
            if state == MotorState::Servo
                && let Some(angle) = joint.known_angle()
            {
                joint.set_target(angle, registers);
            }
        }
        true
    }

    /// Records that the host wrote the motor state, perhaps the present one: joints that are let go may engage again
    /// ([D28](protocol_core::decisions#d28)). Returns whether any joint is let go.
    pub(crate) fn order(&mut self) -> bool {
        self.supply.ordered(self.joints.iter().any(|state| state.position.is_known()));
        self.joints.iter_mut().for_each(JointState::order);
        self.joints.iter().any(JointState::is_let_go)
    }

    /// Forgets all obstacles, because the protection is switched off ([D27](protocol_core::decisions#d27)).
    pub(crate) fn forget_obstacles(&mut self) {
        self.joints.iter_mut().for_each(JointState::forget_obstacle);
    }

    /// Starts the moves to the targets in a write that was applied, whose frame came at `now`. `period` is the set-point period
    /// before the write, in milliseconds.
    pub(crate) fn set_targets(
        &mut self,
        now: Instant,
        accepted: &Accepted<'_>,
        period: u16,
        registers: &mut RegisterFile,
    ) {
        for (joint, state) in self.each_mut() {
            if let Some(degrees) = accepted.value_at(TARGET_POSITION.of(joint)) {
                state.move_to(degrees, registers.get(TIME.of(joint)));
            }
        }
        if accepted.is_extended() {
            self.set_fine_targets(now, accepted, period, registers);
        }
    }

    fn set_fine_targets(
        &mut self,
        now: Instant,
        accepted: &Accepted<'_>,
        period: u16,
        registers: &mut RegisterFile,
    ) {
        for (joint, state) in self.each_mut() {
            let Some(centidegrees) = accepted.word_at(FINE_TARGET.of(joint)) else { continue };
            let angle = MicroDegrees::from_centidegrees(centidegrees);
            match period {
                0 => state.approach(angle, registers.get(TIME.of(joint)), registers),
                millis => state.stream_to(now, angle, Duration::from_millis(millis.into()), registers),
            }
        }
    }

    /// Starts the moves to the joint angles that reach the positions in a write that was applied
    /// ([M7](protocol_core::decisions#m7)).
    pub(crate) fn reach(&mut self, reached: &Reached, registers: &mut RegisterFile) {
        for ((joint, state), target) in self.each_mut().zip(reached.targets) {
            if let Some(angle) = target {
                state.approach(angle, registers.get(TIME.of(joint)), registers);
            }
        }
    }

    /// Re-expresses the set-points under the new offsets ([D9](protocol_core::decisions#d9)): a changed offset changes the
    /// angle of a joint that did not move. From there the joint moves to its target at its speed.
    pub(crate) fn rebase_offsets(&mut self, before: &[i8; JOINTS], registers: &RegisterFile) {
        for ((joint, state), &before) in self.each_mut().zip(before) {
            let offset = registers.offset(joint);
            if offset != before {
                let counts = counts_from_angle(joint, state.drive.set_point(), before);
                let set_point = angle_from_counts(joint, counts, offset);
                state.drive.rebase_offset(set_point, state.target(), registers.get(TIME.of(joint)));
                state.release_set_point();
            }
        }
    }

    /// Processes an answer. If `may_engage`, a waiting or silent joint at rest may engage.
    pub(crate) fn measured(
        &mut self,
        now: Instant,
        joint: Joint,
        answer: &Answer,
        may_engage: bool,
        registers: &mut RegisterFile,
    ) -> Measured {
        if answer.torque.is_some_and(|held| held.is_on) {
            self.supply.has_torque();
        }
        if self.supply.is_undecided(now) && self.driven() == 0 {
            self.supply.none_driven();
        }
        let may_engage = may_engage && !self.supply.is_undecided(now);
        let Some(state) = self.joint_mut(joint) else { return Measured::Rejected };
        let was_driven = state.drive.has_set_point();
        let outcome = state.read(now, answer, may_engage, registers);
        if was_driven || state.drive.has_set_point() {
            self.supply.answered(now);
        }
        match outcome {
            // After an emergency stop, an old alarm may reveal the lost supply before the torque switch does.
            Measured::Freed | Measured::TorqueLost if self.is_supply_lost(joint) => Measured::SupplyLost,
            Measured::TorqueLost => {
                self.joint_mut(joint).into_iter().for_each(|state| state.lose_torque(now));
                Measured::ServoChanged
            }
            Measured::TurnedPast => self.catch_up(joint, registers),
            _ => outcome,
        }
    }

    /// Decides whether the supply was lost, after the servo of this joint was found without torque
    /// ([D28](protocol_core::decisions#d28), [D29](protocol_core::decisions#d29)).
    fn is_supply_lost(&mut self, joint: Joint) -> bool {
        let others = self.driven() & !joint.bit();
        self.supply.is_lost(others != 0)
    }

    /// The joints with a set-point, bit n-1 for joint n.
    #[inline(never)]
    fn driven(&self) -> u8 {
        self.set_of(|state| state.drive.has_set_point())
    }

    /// Records that a servo did not answer. Returns whether it counts as silent from now on.
    pub(crate) fn failed(&mut self, now: Instant, joint: Joint) -> bool {
        let Some(state) = self.joint_mut(joint) else { return false };
        let fell_silent = state.failed(now);
        let mut driven = self.joints.iter().filter(|state| state.drive.has_set_point()).peekable();
        let are_driven_silent = driven.peek().is_some() && driven.all(|state| state.is_unanswered);
        // A servo that answers has supply, even if its joint only waits to engage.
        let are_all_silent = are_driven_silent && !self.joints.iter().any(JointState::waits_and_answers);
        self.supply.unanswered(now, are_all_silent);
        fell_silent
    }

    /// Records that the last answer of this servo was processed late: the servo may have restarted since
    /// ([D29](protocol_core::decisions#d29)).
    pub(crate) fn doubt(&mut self, joint: Joint) {
        let engaged = self.joint_mut(joint).filter(|state| state.drive.is_engaged());
        engaged.into_iter().for_each(JointState::doubt_torque);
    }

    /// Doubts the torque of servos that were not heard for long, so that it is read before the next goal: after a late call,
    /// or on a bus with many missing servos, they may have restarted unnoticed ([D29](protocol_core::decisions#d29)).
    fn doubt_torque(&mut self, now: Instant) {
        if now < self.doubt_at {
            return;
        }
        self.doubt_at = now + RESTART_TIME;
        for joint in self.joints.iter_mut().filter(|joint| joint.drive.is_engaged()) {
            match joint.position.heard_at().map(|heard| heard + RESTART_TIME) {
                Some(later) if now <= later => self.doubt_at = self.doubt_at.min(later),
                _ => joint.doubt_torque(),
            }
        }
    }

    /// Lets joints whose torque is pending wait again, or be silent again, if their measurement is too old. After a late call
    /// they may no longer be where they were measured.
    pub(crate) fn expire_pending(&mut self, now: Instant) {
        for (_, state) in self.each_mut() {
            if state.drive.is_torque_pending() && !state.position.is_fresh(now) {
                state.drive.mark_silent();
            }
        }
    }

    /// Advances the set-points of the joints that take goals by the control cycle that ends at `end`. Returns whether there is
    /// such a joint.
    pub(crate) fn advance(&mut self, now: Instant, end: Instant, registers: &mut RegisterFile) -> bool {
        self.doubt_torque(now);
        let before = self.kept_linkage(registers);
        let mut any = false;
        for (joint, state) in self.each_mut() {
            if state.takes_goals() {
                state.advance(end, registers.get(SPEED.of(joint)), registers);
                any = true;
            }
        }
        if let Some(before) = before {
            self.keep_linkage(before, JointState::gives_way_from);
        }
        any
    }

    /// Holds every joint at its set-point ([D24](protocol_core::decisions#d24)).
    pub(crate) fn hold(&mut self, registers: &mut RegisterFile) {
        for joint in &mut self.joints {
            joint.hold(registers);
        }
    }

    /// Shows the registers of the extended block and of the protection block that follow from the joints
    /// ([D21](protocol_core::decisions#d21), [D27](protocol_core::decisions#d27), [D28](protocol_core::decisions#d28)).
    pub(crate) fn show_extended(&self, registers: &mut RegisterFile) {
        for joint in &self.joints {
            joint.show_extended(registers);
        }
        registers.set(MEASURED_JOINTS.address, self.set_of(JointState::was_measured));
        registers.set(BLOCKED_JOINTS.address, self.set_of(JointState::is_blocked));
        registers.set(LET_GO_JOINTS.address, self.set_of(JointState::is_let_go));
        let alarms = self.joints.iter().fold(0, |alarms, state| alarms | state.alarms);
        registers.set(SERVO_ALARMS.address, alarms);
    }

    /// Is any joint sent a goal at `now`?
    pub(crate) fn any_goal(&self, now: Instant) -> bool {
        self.joints.iter().any(|state| state.takes_goal_at(now))
    }

    /// The goals of the joints that are sent one at `now`, in servo counts.
    pub(crate) fn goals(&self, now: Instant, registers: &RegisterFile) -> impl Iterator<Item = (Joint, u16)> {
        self.each().filter(move |(_, state)| state.takes_goal_at(now)).map(|(joint, state)| {
            (joint, counts_from_angle(joint, state.drive.set_point(), registers.offset(joint)))
        })
    }

    /// The torque for each servo; `None` leaves the switch unchanged. The caller has to send all of them: from now on
    /// joints that are given torque may move.
    pub(crate) fn take_torque(&mut self, is_protected: bool) -> [Option<Torque>; JOINTS] {
        let mut switches = [None; JOINTS];
        for (switch, joint) in switches.iter_mut().zip(&mut self.joints) {
            *switch = self.state.torque().or_else(|| joint.take_torque(is_protected));
        }
        switches
    }

    /// What the joint's servo is to be asked at `now`, if anything. See [`JointState::wants_torque_read`].
    pub(crate) fn question(&self, joint: Joint, now: Instant, is_refresh_near: bool) -> Option<Question> {
        let state = self.joint(joint).filter(|state| state.position.wants_asking(now))?;
        let wants_torque = state.wants_torque_read(is_refresh_near);
        Some(if wants_torque { Question::TorqueAndReading } else { Question::Reading })
    }

    /// The joints whose servos do not answer, bit n-1 for joint n.
    pub(crate) fn silent(&self) -> u8 {
        self.set_of(|state| !state.position.is_known())
    }

    /// The joints whose set-point has not reached its target, or whose target waits until they engage, bit n-1 for joint n.
    pub(crate) fn moving(&self) -> u8 {
        self.set_of(|state| state.drive.is_moving())
    }

    /// Does any servo report an error?
    pub(crate) fn any_alarm(&self) -> bool {
        self.joints.iter().any(|state| state.alarms != 0)
    }

    /// The highest temperature of a servo, in degrees Celsius; 0 while unknown.
    pub(crate) fn hottest(&self) -> u8 {
        self.joints.iter().map(|state| state.temperature).max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests;
