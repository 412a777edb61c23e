//! What the page has of a class.

use classroom::LentArm;

use super::class_socket::ClassSocket;
use crate::class::Membership;

/// The class asks a tab that does not answer each 4 s, and others more often.
const SILENCE_MS: f64 = 10_000.0;
/// The most that one look adds to a silence, in milliseconds.
const LONGEST_LOOK_MS: f64 = 1_000.0;

/// A tab in a class, or one that wants to join it.
#[derive(Default)]
pub(super) struct ClassTab {
    /// `None`: the pupil types a name.
    pub(super) member: Option<Membership>,
    pub(super) socket: Option<ClassSocket>,
    /// When to connect again, in the browser's milliseconds.
    pub(super) retry: Option<f64>,
    /// For how long the class has said nothing while the page ran, in milliseconds, and the time of the last look.
    silence: (f64, f64),
    /// When to connect to the real arm again.
    pub(super) arm_retry: Option<f64>,
    pub(super) code: String,
    pub(super) name: String,
    /// The class's real arm, as the class told last.
    pub(super) arm: Option<LentArm>,
}

impl ClassTab {
    /// What the real arm's address needs, while this tab has it.
    pub(super) fn arm_query(&self) -> Option<String> {
        let is_own = self.arm.as_ref().is_some_and(|arm| arm.is_yours);
        self.member.as_ref()?.key().filter(|_| is_own).map(|key| format!("?token={key}"))
    }

    /// Returns whether the message is on its way.
    pub(super) fn send(&self, text: &str) -> bool {
        self.socket.as_ref().is_some_and(|socket| socket.send(text))
    }

    /// The class said something, or a connection to it begins.
    pub(super) const fn hear(&mut self) {
        self.silence.0 = 0.0;
    }

    /// Has the connection ended? A network that is gone closes nothing. `time`: of this look.
    pub(super) fn is_lost(&mut self, time: f64) -> bool {
        let (silence, last) = self.silence;
        // A computer that was suspended looks before the browser hands over the messages.
        self.silence = (silence + (time - last).clamp(0.0, LONGEST_LOOK_MS), time.max(last));
        self.socket.as_ref().is_some_and(|socket| socket.is_closed() || silence > SILENCE_MS)
    }
}
