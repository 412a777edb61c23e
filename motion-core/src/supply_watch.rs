//! Finds out that the servos lost their supply: an emergency stop ([D29](protocol_core::decisions#d29)).
//!
//! ```text
//!   all driven servos silent for 1 s ──▶ undecided: no joint engages ──▶ one answers with torque: only the line was cut
//!                                                                   ├──▶ all have answered without torque: the supply was lost
//!                                                                   └──▶ the host writes the motor state
//! ```
//!
//! A servo that has not answered yet may still hold its joint, so the arm is not damped before all have answered. This file
//! does not know registers or the bus.

use protocol_core::time::{Duration, Instant};

/// The shortest silence of all driven servos that may be a lost supply. After a shorter one, each joint whose servo
/// restarted engages where it is measured.
const LOST_AFTER: Duration = Duration::from_millis(1_000);

/// Watches the supply of the servos.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct SupplyWatch {
    all_silent_since: Option<Instant>,
    /// All driven servos were silent for long enough, and since then none answered with torque.
    was_outage: bool,
}

impl SupplyWatch {
    /// No servo is silent.
    pub(crate) const NEW: Self = Self { all_silent_since: None, was_outage: false };

    /// Records that a question was not answered at `now`. `are_all_silent` tells whether all driven servos are silent.
    pub(crate) fn unanswered(&mut self, now: Instant, are_all_silent: bool) {
        if are_all_silent && !self.was_outage {
            self.all_silent_since.get_or_insert(now);
        }
    }

    /// Records that no joint is driven any more: the silence of servos without torque tells nothing about the supply.
    pub(crate) const fn none_driven(&mut self) {
        self.all_silent_since = None;
    }

    /// Records that a driven servo answered at `now`.
    pub(crate) fn answered(&mut self, now: Instant) {
        self.was_outage = self.is_undecided(now);
        self.all_silent_since = None;
    }

    /// Records that a servo has kept its torque.
    pub(crate) const fn has_torque(&mut self) {
        *self = Self::NEW;
    }

    /// Records that the host wrote the motor state. Servos that answer have supply, so the order counts for them: their joints
    /// may engage, although no driven servo has answered yet. While no servo answers, the outage continues.
    pub(crate) const fn ordered(&mut self, any_answers: bool) {
        self.was_outage = false;
        if any_answers {
            self.all_silent_since = None;
        }
    }

    /// Returns whether the supply may have been lost. Until that is decided, no joint may engage.
    pub(crate) fn is_undecided(&self, now: Instant) -> bool {
        self.was_outage || self.all_silent_since.is_some_and(|since| now - since >= LOST_AFTER)
    }

    /// Decides whether the supply was lost, after the servo of a driven joint was found without torque. `are_others_driven`
    /// tells whether other joints still count as driven: while there is one, the supply does not count as lost.
    pub(crate) const fn is_lost(&mut self, are_others_driven: bool) -> bool {
        let is_lost = self.was_outage && !are_others_driven;
        if is_lost {
            *self = Self::NEW;
        }
        is_lost
    }
}
