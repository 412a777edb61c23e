//! What happens while the server runs.

use std::path::PathBuf;

/// What happens to the server while it runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Notice {
    /// A 7Bot V2 answers on the port.
    ArmFound(PathBuf),
    /// The port cannot be opened, or was lost. It is tried again all the time.
    ArmLost {
        /// The port.
        port: PathBuf,
        /// Why.
        reason: String,
    },
    /// The port is open, and no 7Bot V2 answers.
    ArmSilent(PathBuf),
}
