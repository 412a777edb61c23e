//! Asks a server between a program and the arm why it drops writes.

use host_link::Span;
use host_link::sharing::{FIRST, SharingState};

use super::{MismatchCause, NotTaken, ServerReason, WriteMismatch};
use crate::arm::Arm;

/// Registers of a server: 232 to 238.
const SERVER: Option<Span> = Span::new(FIRST, 7);

impl Arm {
    /// Fills in missing causes: if a server in between drops writes, its reason becomes the cause of each register for which the
    /// arm gives none.
    pub(crate) fn explained_by_server(&mut self, NotTaken(mut lost): NotTaken) -> NotTaken {
        let is_unknown = |register: &&mut WriteMismatch| register.cause == MismatchCause::Unknown;
        let mut unknown = lost.iter_mut().filter(is_unknown).peekable();
        if unknown.peek().is_some()
            && let Some(reason) = self.server_reason()
        {
            unknown.for_each(|register| register.cause = MismatchCause::NotPassedOn(reason));
        }
        NotTaken(lost)
    }

    /// `None` if there is no server, if it drops no writes, if its registers cannot be read, or without a status block.
    fn server_reason(&mut self) -> Option<ServerReason> {
        if !self.identity().has_status_block() {
            return None;
        }
        ServerReason::of(&SharingState::of(&self.read_span(SERVER?).ok()?)?)
    }
}
