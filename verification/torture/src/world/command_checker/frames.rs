//! Which frames may go to the servos, and when.

use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use super::{CommandChecker, CommandContext, invalid_frame};
use crate::violation::{Check, Violation, ensure};

/// Start-up ends after this time at the latest (D12).
const MAX_START_UP: Duration = Duration::from_millis(500);
/// A joint that had no goal for this long is not driven at present.
const FOLLOWED_TIME: Duration = Duration::from_millis(1_000);

impl CommandChecker {
    /// Checks a frame to the servos.
    pub(crate) fn check(&mut self, frame: &[u8], context: &CommandContext<'_>) -> Check {
        self.count += 1;
        ensure(context.now >= self.wire_free_at, || "a frame before the end of the last one".to_owned())?;
        self.wire_free_at = context.now + Duration::from_micros(10 * frame.len() as u64);
        let [0xFF, 0xFF, id, length, body @ .., sum] = frame else { return Err(invalid_frame(frame)) };
        let covered = body.iter().fold(id.wrapping_add(*length), |sum, byte| sum.wrapping_add(*byte));
        let is_whole = usize::from(*length) == body.len() + 1 && *sum == !covered;
        match body {
            _ if !is_whole => Err(invalid_frame(frame)),
            [2, 56, count @ 8..=11] | [2, 40, count @ 24..=27] if *id < 7 => {
                let joint = Joint::from_index(*id).ok_or_else(|| invalid_frame(frame))?;
                let has_goals = context.now - self.goal_at[joint] < FOLLOWED_TIME;
                let is_driven = self.is_driven(joint) && (has_goals || self.kept_goals[joint].is_some());
                self.replies.asked(context.now, joint, *count, is_driven);
                Ok(())
            }
            _ if self.is_starting(context.now) => {
                Err(Violation(format!("{frame:02x?} before the end of start-up")))
            }
            [0x83, 40, 1, items @ ..] if *id == 0xFE => self.check_torque_switches(items, context),
            [0x83, 42, 6, items @ ..] if *id == 0xFE => self.check_goals(items, context),
            _ => Err(invalid_frame(frame)),
        }
    }

    fn is_starting(&self, now: Instant) -> bool {
        now < self.started_at + MAX_START_UP && !self.replies.have_all_started()
    }
}
