//! The state of the page in a class.

use classroom::LentArm;

use super::class_socket::ClassSocket;
use crate::class::Membership;

/// The connection counts as lost after this silence of the server, in milliseconds. The server sends each tab a question at
/// least every 4 s.
const SILENCE_MS: f64 = 10_000.0;
/// One check adds at most this to the measured silence, in milliseconds.
const LONGEST_LOOK_MS: f64 = 1_000.0;

/// A tab that is in a class or about to join one.
#[derive(Default)]
pub(super) struct ClassTab {
    /// The membership; `None` while the pupil types a name.
    pub(super) member: Option<Membership>,
    pub(super) socket: Option<ClassSocket>,
    /// When to connect again, in the browser's milliseconds.
    pub(super) retry: Option<f64>,
    /// The silence of the server while the page ran, and the time of the last check, both in milliseconds.
    silence: (f64, f64),
    /// When to connect to the real arm again, in the browser's milliseconds.
    pub(super) arm_retry: Option<f64>,
    pub(super) code: String,
    pub(super) name: String,
    /// Who has the class's real arm, according to the last message; `None` if no pupil has it, or after the connection was
    /// lost.
    pub(super) arm: Option<LentArm>,
}

impl ClassTab {
    /// The query for the connection to the real arm; `None` while this tab does not have the arm.
    pub(super) fn arm_query(&self) -> Option<String> {
        let is_own = self.arm.as_ref().is_some_and(|arm| arm.is_yours);
        self.member.as_ref()?.key().filter(|_| is_own).map(|key| format!("?token={key}"))
    }

    /// Sends a message. Returns false if there is no open connection, or if the socket did not accept the message.
    pub(super) fn send(&self, text: &str) -> bool {
        self.socket.as_ref().is_some_and(|socket| socket.send(text))
    }

    /// Resets the silence: a message has arrived, or a new connection begins.
    pub(super) const fn hear(&mut self) {
        self.silence.0 = 0.0;
    }

    /// Adds the time since the last check to the silence. Returns true if the connection is lost: closed, or silent for too long,
    /// as after a network failure.
    pub(super) fn is_lost(&mut self, time: f64) -> bool {
        let (silence, last) = self.silence;
        // Limit the share of one check: after a suspend, it may run before the browser delivers the waiting messages.
        self.silence = (silence + (time - last).clamp(0.0, LONGEST_LOOK_MS), time.max(last));
        self.socket.as_ref().is_some_and(|socket| socket.is_closed() || silence > SILENCE_MS)
    }
}
