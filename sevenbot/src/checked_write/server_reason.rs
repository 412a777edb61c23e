//! The reason of a server between a program and the arm that passes no writes on.

use std::fmt;

use host_link::sharing::{DrivenBy, SharingState};

/// Why a server does not pass on what a program writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServerReason {
    /// It was started with `--read-only`.
    ReadOnly,
    /// A stop of another program ended what this one sends.
    Stopped,
    /// One program moves the arm at a time, and now another one does.
    AnotherDrives,
}

impl fmt::Display for ServerReason {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::ReadOnly => {
                "the server was started with --read-only, so nobody can change the arm through it"
            }
            Self::Stopped => "another program stopped the arm; pause for a second, then try again",
            Self::AnotherDrives => {
                "the server lets one program move the arm at a time, and another one does now"
            }
        })
    }
}

impl ServerReason {
    pub(super) fn of(state: &SharingState) -> Option<Self> {
        match state {
            state if state.is_read_only => Some(Self::ReadOnly),
            state if state.is_stopped => Some(Self::Stopped),
            state if state.has_one_driver && state.driven_by == DrivenBy::Another => {
                Some(Self::AnotherDrives)
            }
            _ => None,
        }
    }
}
