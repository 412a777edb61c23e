//! A teacher's screen: the messages that are due for it.

use protocol_core::time::{Duration, Instant};

use crate::message::{NotGiven, ToTeacher};

/// The shortest time between two messages with the state of the class.
const PERIOD: Duration = Duration::from_millis(100);
/// The time between two of these messages without an event in the class. The time of a lease, and which tabs are silent, still
/// change then.
const LONGEST_PERIOD: Duration = Duration::from_millis(500);

#[derive(Debug, Default)]
pub(crate) struct Desk {
    was_welcomed: bool,
    not_given: Option<NotGiven>,
    /// The last message with the state of the class: the number of the last change in it, and when it was sent.
    shown: Option<(u64, Instant)>,
}

impl Desk {
    /// Keeps the reason why the real arm was not given, until it is sent or a later reason replaces it.
    pub(crate) const fn refuse(&mut self, why: NotGiven) {
        self.not_given = Some(why);
    }

    fn is_class_due(&self, now: Instant, change: u64) -> bool {
        self.shown.is_none_or(|(shown, at)| now - at >= if shown == change { LONGEST_PERIOD } else { PERIOD })
    }

    /// True if a message is due.
    pub(crate) fn has_message(&self, now: Instant, change: u64) -> bool {
        !self.was_welcomed || self.not_given.is_some() || self.is_class_due(now, change)
    }

    /// The next message for the screen. `change` is the number of the last change in the class.
    pub(crate) fn next_message(
        &mut self,
        now: Instant,
        change: u64,
        welcome: impl FnOnce() -> ToTeacher,
        class: impl FnOnce() -> ToTeacher,
    ) -> Option<ToTeacher> {
        if !std::mem::replace(&mut self.was_welcomed, true) {
            return Some(welcome());
        }
        if let Some(why) = self.not_given.take() {
            return Some(ToTeacher::NotGiven(why));
        }
        self.is_class_due(now, change).then(|| {
            self.shown = Some((change, now));
            class()
        })
    }
}
