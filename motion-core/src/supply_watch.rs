//! Finds out that the servos lost their supply: an emergency stop (D29).
//!
//! ```text
//!   all driven servos silent for 1 s ──▶ they answer ──▶ none has torque: the supply was lost
//!                                                   └──▶ one has torque: a cable or an adapter was gone
//! ```
//!
//! This file does not know registers or the bus.

use protocol_core::time::{Duration, Instant};

/// A shorter silence is a dip: each joint engages where it is measured.
const LOST_AFTER: Duration = Duration::from_millis(1_000);
/// The servos start together. After the first of them has answered, the others get this time.
const DECIDE_AFTER: Duration = Duration::from_millis(300);

/// What follows from the torque switch of a servo that was silent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// The other servos decide.
    Undecided,
    /// This servo alone has restarted.
    Restarted,
    /// The supply of all servos was lost.
    SupplyLost,
}

/// Watches the supply of the servos.
#[derive(Clone, Debug)]
pub(crate) struct SupplyWatch {
    all_silent_since: Option<Instant>,
    /// All driven servos were silent for long enough.
    was_outage: bool,
    /// The servos that have restarted, and when the first was found: bit n-1 for joint n.
    restarted: Option<(Instant, u8)>,
}

impl SupplyWatch {
    /// No servo is silent.
    pub(crate) const NEW: Self = Self { all_silent_since: None, was_outage: false, restarted: None };

    /// A question was not answered at `now`. `are_all_silent` tells about the driven servos.
    pub(crate) fn unanswered(&mut self, now: Instant, are_all_silent: bool) {
        if are_all_silent && self.restarted.is_none() {
            self.all_silent_since.get_or_insert(now);
        }
    }

    /// A driven servo answered at `now`.
    pub(crate) fn answered(&mut self, now: Instant) {
        if let Some(since) = self.all_silent_since.take() {
            self.was_outage |= now - since >= LOST_AFTER;
        }
    }

    /// A driven servo that was silent has kept its torque.
    pub(crate) const fn has_torque(&mut self) {
        *self = Self::NEW;
    }

    /// A driven servo was found without torque. `joint` is its bit, `driven` has the bits of all driven joints.
    pub(crate) fn has_no_torque(&mut self, now: Instant, joint: u8, driven: u8) -> Verdict {
        if !self.was_outage {
            return Verdict::Restarted;
        }
        let (first_at, joints) = self.restarted.unwrap_or((now, 0));
        self.restarted = Some((first_at, joints | joint));
        if (joints | joint) & driven == driven || now - first_at >= DECIDE_AFTER {
            *self = Self::NEW;
            return Verdict::SupplyLost;
        }
        Verdict::Undecided
    }
}
