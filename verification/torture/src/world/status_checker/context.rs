//! The true state of the arm, beside its registers.

use protocol_core::registers::{Joint, RegisterFile};
use protocol_core::time::{Duration, Instant};

use crate::world::command_checker::CommandChecker;
use crate::world::disturbed_bus::{Availability, DisturbedBus};
use crate::world::register_model::RegisterModel;
use crate::world::watchdog_model::WatchdogModel;

/// A joint may be late for this long after a frame of goals without one for it, for example because its servo left reads
/// unanswered.
const PAUSE: Duration = Duration::from_millis(1_000);
/// A joint that is driven gets a goal in each control cycle, or after each timeout on a bus with long timeouts.
const GOAL_PERIOD: Duration = Duration::from_millis(100);

/// The true state of the arm, and its registers.
pub(crate) struct StatusContext<'a> {
    pub(crate) now: Instant,
    pub(crate) registers: &'a RegisterFile,
    pub(crate) model: &'a RegisterModel,
    pub(crate) watchdog: &'a WatchdogModel,
    pub(crate) bus: &'a DisturbedBus,
    pub(crate) command_checker: &'a CommandChecker,
}

impl StatusContext<'_> {
    /// True if a joint need not continue its move: it gives way, it is let go, some reads are not answered, or the controller
    /// does not know whether the supply was lost. On a disturbed bus a joint may get no goals; if it is the only driven one, no
    /// frame of goals shows that it pauses.
    pub(super) fn may_be_late(&self, joint: Joint) -> bool {
        self.bus.truth(joint).may_give_way(self.now)
            || self.bus.may_be_let_go(joint, self.now)
            || self.command_checker.is_undecided()
            || self.bus.availability(joint) == Availability::Uncertain
            || self.now - self.command_checker.paused_at[joint] < PAUSE
            || (!self.bus.is_undisturbed(self.now)
                && self.now - self.command_checker.goal_at[joint] > GOAL_PERIOD)
    }
}
