//! Checks that the servo of a joint that engages shows the goal that was sent to it ([D12](protocol_core::decisions#d12)).
//!
//! ```text
//!   goal sent ──▶ question ──▶ it shows the goal ──────────────────────────▶ torque
//!       ▲                 └──▶ it shows another: the frame was lost
//!       │                             │      └─ for the third time ─▶ the goal three times more, then torque
//!       └── measured again, 10 ms later
//! ```
//!
//! If a frame of goals is lost and the frame of torque behind it arrives, the servo goes to an old goal. Some servos
//! may not show a new goal while their torque is off. So a servo that shows another goal three times gets the goal three
//! more times, directly before torque. A servo that does show its goal then goes to an old one only if six frames in a row
//! are lost, three of them at least 10 ms apart. This file does not know the value of a goal.

/// A servo that has shown another goal this often counts as one that does not show goals.
const HIDDEN_AFTER: u8 = 3;
/// How often the goal is sent again, directly before torque, if the servo counts as one that does not show goals.
const REPEATS: u8 = 3;

/// Whether the servo of one joint has shown its goal.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct GoalCheck {
    /// Successive answers that showed another goal, including answers of earlier engagements.
    misses: u8,
    /// The joint may get torque.
    is_done: bool,
    /// The servo was known to have torque when its joint engaged.
    had_torque: bool,
}

impl GoalCheck {
    /// No goal was sent.
    pub(crate) const NEW: Self = Self { misses: 0, is_done: false, had_torque: false };

    /// Begins the check of a goal that will be sent. `had_torque` tells whether the servo is known to have torque.
    pub(crate) const fn begin(&mut self, had_torque: bool) {
        self.is_done = false;
        self.had_torque = had_torque;
    }

    /// Was the servo known to have torque when its joint engaged?
    pub(crate) const fn had_torque(self) -> bool {
        self.had_torque
    }

    /// Records that the joint may get torque, because its servo shows the goal or has torque already.
    pub(crate) const fn shown(&mut self) {
        self.misses = 0;
        self.is_done = true;
    }

    /// Records that the servo shows another goal. Returns how often the goal has to be sent directly before torque; `None` if the
    /// servo has to be asked again.
    pub(crate) fn hidden(&mut self) -> Option<u8> {
        self.misses = self.misses.saturating_add(1).min(HIDDEN_AFTER);
        (self.misses == HIDDEN_AFTER).then_some(REPEATS)
    }

    /// Records that the joint may get torque without a check of its new goal, which is sent directly before torque.
    pub(crate) const fn done(&mut self) {
        self.is_done = true;
    }

    /// May the joint get torque?
    pub(crate) const fn is_done(self) -> bool {
        self.is_done
    }
}
