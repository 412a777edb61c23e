//! Events of the server while it runs.

use std::net::SocketAddr;
use std::path::PathBuf;

use tokio::sync::mpsc::Sender;

use crate::hub::HoldOutcome;

/// An event of the server while it runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Notice {
    /// A 7Bot V2 answers on the port.
    ArmFound(PathBuf),
    /// The port cannot be opened, or was lost. The server tries it again twice a second.
    ArmLost {
        /// The port that failed. With a search the server may try another one next.
        port: PathBuf,
        /// The error of the port, as text.
        reason: String,
    },
    /// The port is open, and no 7Bot V2 answers.
    ArmSilent(PathBuf),
    /// The server held the arm by itself, and that failed.
    HoldFailed(HoldOutcome),
    /// A client of the network was refused. At most five of these notices come in a second.
    Refused {
        /// The address and port from which the client connected.
        peer: Option<SocketAddr>,
        /// What was wrong with the client, or that there was no room for it.
        reason: RefusalReason,
    },
}

/// Why the server refuses a client, for [`Notice::Refused`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RefusalReason {
    /// Its token, or its class code, is wrong or missing.
    WrongToken,
    /// There are too many clients, or too many connections of its address wait for the check of their tokens.
    Full,
    /// It does not speak frames, but for example HTTP.
    NoFrames,
}

/// Where tasks send notices. When many wait, more are dropped.
#[derive(Clone, Debug)]
pub(super) struct Notices(pub(super) Sender<Notice>);

impl Notices {
    pub(super) fn send(&self, notice: Notice) {
        let _ = self.0.try_send(notice);
    }
}
