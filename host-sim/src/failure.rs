//! The errors of the program `host-sim`, and their exit statuses.

use std::io;
use std::path::PathBuf;

use arm_sim::faults::ArmFault;
use host_sim::eeprom::ImageError;
use host_sim::private_socket::SocketError;
use host_sim::servos_only::ServosOnlyError;
use host_sim::session_file::SessionFileError;
use tty_ports::serial::SerialError;
use tty_ports::symlink::SymlinkError;

#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error("--link {0}")]
    Symlink(#[from] SymlinkError),
    #[error("--angles {}: {cause}", path.display())]
    Angles { path: PathBuf, cause: io::Error },
    #[error("--servos {0}")]
    Serial(#[from] SerialError),
    #[error(transparent)]
    Socket(#[from] SocketError),
    #[error(
        "--fault {0}: without a controller there is no host line and no flash: see FAULTS in host-sim --help"
    )]
    FaultOfController(ArmFault),
    #[error("no pseudo-terminal: {0}: is /dev/pts mounted, and does 'ulimit -n' allow more files?")]
    Port(io::Error),
    #[error(transparent)]
    Session(#[from] SessionFileError),
    #[error("cannot catch signals: {0}")]
    Signals(io::Error),
    #[error("the operating system failed: {0}")]
    Running(io::Error),
}

impl From<ServosOnlyError> for Failure {
    fn from(error: ServosOnlyError) -> Self {
        match error {
            ServosOnlyError::Symlink(error) => Self::Symlink(error),
            ServosOnlyError::System(cause) => Self::Running(cause),
        }
    }
}

impl Failure {
    /// The exit status, as in `--help`.
    pub(crate) const fn status(&self) -> u8 {
        if matches!(self, Self::Running(_) | Self::Session(SessionFileError::Different { .. })) {
            1
        } else {
            2
        }
    }
}
