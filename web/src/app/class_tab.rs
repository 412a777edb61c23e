//! What the page has of a class.

use classroom::LentArm;

use super::class_socket::ClassSocket;
use crate::class::Membership;

/// A tab in a class, or one that wants to join it.
#[derive(Default)]
pub(super) struct ClassTab {
    /// `None`: the pupil types a name.
    pub(super) member: Option<Membership>,
    pub(super) socket: Option<ClassSocket>,
    /// When to connect again, in the browser's milliseconds.
    pub(super) retry: Option<f64>,
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

    pub(super) fn send(&self, text: &str) {
        self.socket.iter().for_each(|socket| socket.send(text));
    }
}
