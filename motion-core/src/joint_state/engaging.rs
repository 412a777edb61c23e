//! How a waiting or silent joint engages: it is measured at rest, its servo is sent its goal, is asked whether it has the goal,
//! and is given torque ([D12](protocol_core::decisions#d12), [D29](protocol_core::decisions#d29)).

use protocol_core::registers::RegisterFile;
use protocol_core::registers::map::PROTECTION;
use protocol_core::time::Instant;

use super::JointState;
use crate::calibration::{MicroDegrees, angle_from_counts, counts_from_angle};
use crate::drive::{Target, is_near};
use crate::servo_bus::Answer;
use crate::torque_check::{TorqueCheck, TorqueFound};

impl JointState {
    /// Checks the goal that the servo shows while the torque of its joint is pending
    /// ([D12](protocol_core::decisions#d12)). Returns how often the goal has to be sent before torque; `None` if the
    /// joint must not get torque yet.
    pub(super) fn check_goal(
        &mut self,
        now: Instant,
        answer: &Answer,
        may_engage: bool,
        registers: &mut RegisterFile,
    ) -> Option<u8> {
        let held = answer.torque?;
        if !held.is_on && self.goal.had_torque() {
            // If a second answer confirms it, the servo has restarted since a read showed its torque on (D29).
            self.torque.doubt();
            if self.torque.answered(Some(false)) == TorqueFound::Lost {
                self.lose_torque(now);
            }
            return None;
        }
        if held.is_on && answer.alarms != 0 && answer.reading.load == 0 && !self.position.is_steady() {
            // An alarm keeps the servo from holding, and the joint falls (D28).
            self.lose_torque(now);
            self.let_go.follow(now, answer);
            return None;
        }
        let goal = counts_from_angle(self.joint, self.drive.set_point(), registers.offset(self.joint));
        let is_there = |counts: u16| counts.abs_diff(goal) <= 1;
        let repeats = if held.is_on || is_there(held.goal_counts) {
            self.goal.shown();
            Some(0)
        } else {
            self.goal.hidden()
        };
        let stays = may_engage && self.position.is_steady();
        let has_goal = stays && repeats == Some(0) && is_there(answer.reading.position_counts);
        // A servo with torque follows its goal already. If a question was not answered, no goal was sent since then, so send
        // it once more.
        if held.is_on || has_goal {
            let was_unanswered = !self.torque.is_trusted();
            self.torque = TorqueCheck::ORDERED;
            return Some(was_unanswered.into());
        }
        // The joint engages anew where it is now, with the next answer or with this one.
        self.drive.lose_torque(true);
        let repeats = repeats.filter(|_| stays)?;
        let angle = self.known_angle()?;
        let engages = self.engages(now, angle, registers);
        self.goal.done();
        engages.then_some(repeats.max(1))
    }

    /// Where a joint that was measured at `angle` engages. After a restart of the controller alone, the servo may still
    /// hold a goal; if it is near, the joint engages at that goal. At `angle` it would sag by the position error at
    /// which the servo carries the load.
    pub(super) fn place(
        &self,
        answer: &Answer,
        angle: MicroDegrees,
        registers: &RegisterFile,
    ) -> MicroDegrees {
        let held = answer.torque.filter(|held| self.is_first_engagement && held.is_on);
        let goal =
            held.map(|held| angle_from_counts(self.joint, held.goal_counts, registers.offset(self.joint)));
        goal.filter(|goal| is_near(*goal, angle)).unwrap_or(angle)
    }

    /// Engages a waiting or silent joint at `angle`, unless its servo may have restarted, or the joint is let go and may not
    /// engage yet. Returns whether the joint engaged.
    pub(super) fn engages(
        &mut self,
        now: Instant,
        angle: MicroDegrees,
        registers: &mut RegisterFile,
    ) -> bool {
        // The servo was silent, and it is not known yet whether it has restarted.
        if self.drive.is_silent() && !self.torque.is_trusted() {
            return false;
        }
        let is_protected = registers.get(PROTECTION.address) != 0;
        if !self.let_go.may_engage(now, self.temperature, is_protected) {
            return false;
        }
        let was_silent = self.drive.is_silent();
        let Some(target) = self.drive.engage(angle) else { return false };
        self.let_go.engaged(now);
        self.torque = TorqueCheck::ORDERED;
        self.goal.begin(was_silent);
        self.obstacle.release();
        if target == Target::Measured {
            self.set_target(angle, registers);
        }
        true
    }
}
