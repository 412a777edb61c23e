//! Failures of ports and of exchanges with an arm.

use std::fmt;
use std::io;
use std::time::Duration;

use host_link::Span;

/// Why a port cannot be opened, or has no arm.
///
/// ```no_run
/// use sevenbot::{Arm, OpenError};
///
/// match Arm::open("/dev/ttyUSB0", 115_200) {
///     Ok(_) => println!("an arm"),
///     Err(OpenError::WrongDevice { code }) => println!("something else, with device code {code}"),
///     Err(error) => println!("{error}"),
/// }
/// ```
#[derive(Clone, Debug, thiserror::Error)]
pub enum OpenError {
    /// There is no serial port or socket of this name, and no server with it is known. On Windows a serial port that is missing is
    /// [`Self::Unusable`].
    #[error("there is no such port")]
    NotFound,
    /// This user may not open the port.
    #[error("no permission to open this port")]
    PermissionDenied {
        /// The group that may open it, if the system tells.
        group: Option<String>,
    },
    /// Another program has the port open.
    #[error("another program has this port open")]
    Busy,
    /// The port cannot be used as a serial port, or the server cannot be used. Holds the reason as text.
    #[error("this port cannot be used: {0}")]
    Unusable(String),
    /// The port opened, but then no arm answered, or the port failed.
    #[error(transparent)]
    Silent(#[from] Error),
    /// The device is not a 7Bot V2: its device code is not 7.
    #[error("the device on this port is not a 7Bot V2: its device code is {code}, not 7")]
    WrongDevice {
        /// The value of register 0.
        code: u8,
    },
}

/// Why an exchange with an open arm failed.
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sevenbot::{Arm, Error};
///
/// let mut arm = Arm::open("/dev/ttyUSB0", 115_200)?;
/// match arm.positions() {
///     Ok(positions) => println!("{positions:?}"),
///     Err(Error::NoAnswer { received, .. }) => println!("no answer: {received}"),
///     Err(error) => println!("{error}"),
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// The registers reach past 255, or one frame does not hold all of them. Nothing was sent.
    #[error("{count} registers from {address} on: the last register is 255, and one frame holds 255 values")]
    OutsideMap {
        /// The first register.
        address: u8,
        /// The number of registers to read or to write.
        count: usize,
    },
    /// A read was not answered in any attempt.
    #[error("no answer to a read of {span} in {} ms: {received}", waited.saturating_mul(*attempts).as_millis())]
    NoAnswer {
        /// The registers of the read.
        span: Span,
        /// The number of attempts, at least 1.
        attempts: u32,
        /// The timeout of each attempt. The read failed after `attempts` times this.
        waited: Duration,
        /// What was received instead.
        received: ReceiveCounts,
    },
    /// The port takes no more bytes, or the connection is gone.
    #[error(transparent)]
    Port(#[from] PortError),
}

/// Why an open port failed.
///
/// ```
/// use sevenbot::PortError;
///
/// let gone = PortError::Lost(std::io::ErrorKind::BrokenPipe);
/// assert_eq!(gone.to_string(), "the connection is gone: broken pipe");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PortError {
    /// The port takes no more bytes: no program reads at its other end.
    #[error("the port takes no more bytes: nothing reads at its other end")]
    Stalled,
    /// The port failed, for example because the cable was pulled, or the simulator or the server ended.
    #[error("the connection is gone{}", reason(*.0))]
    Lost(io::ErrorKind),
}

/// The reason of the system after a colon; empty if it has no name.
fn reason(kind: io::ErrorKind) -> String {
    match kind.to_string().as_str() {
        "other error" | "uncategorized error" => String::new(),
        name => format!(": {name}"),
    }
}

impl From<PortError> for OpenError {
    fn from(error: PortError) -> Self {
        Self::Silent(error.into())
    }
}

/// Counts of the bytes and frames received instead of an answer.
///
/// ```
/// let received = sevenbot::ReceiveCounts { bytes: 12, ..Default::default() };
/// assert_eq!(received.to_string(), "12 bytes were received, none of them a frame");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReceiveCounts {
    /// All bytes, with echoes.
    pub bytes: usize,
    /// Echoes of sent frames. Counted on a servo bus only.
    pub echoes: usize,
    /// Good frames that are neither the answer nor a counted echo.
    pub other_frames: usize,
    /// Frames with a wrong checksum, or with a range past register 255.
    pub damaged_frames: usize,
    /// Good frames that the same line delivered before this exchange.
    pub earlier_frames: usize,
}

impl fmt::Display for ReceiveCounts {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self { bytes: 0, .. } => out.write_str("nothing was received"),
            Self { damaged_frames: 0, other_frames: 0, echoes: 1.., .. } => {
                out.write_str("only the echo of the question was received")
            }
            Self { damaged_frames: 0, other_frames: 0, bytes, .. } => {
                write!(out, "{bytes} bytes were received, none of them a frame")
            }
            Self { damaged_frames, other_frames, .. } => {
                write!(out, "{damaged_frames} damaged and {other_frames} other frames were received")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lost_port_names_no_reason_without_a_name() {
        let said = |kind| PortError::Lost(kind).to_string();
        assert_eq!(said(io::ErrorKind::Other), "the connection is gone");
        let input_output = io::Error::from_raw_os_error(5);
        assert_eq!(said(input_output.kind()), "the connection is gone");
        assert_eq!(said(io::ErrorKind::BrokenPipe), "the connection is gone: broken pipe");
    }

    #[test]
    fn a_missing_answer_reports_the_received_bytes() {
        let said = |received| {
            let span = Span::new(54, 7).expect("a span");
            Error::NoAnswer { span, attempts: 3, waited: Duration::from_millis(500), received }.to_string()
        };
        let nothing = said(ReceiveCounts::default());
        assert_eq!(nothing, "no answer to a read of 54..60 in 1500 ms: nothing was received");
        let garbage = said(ReceiveCounts { bytes: 12, ..ReceiveCounts::default() });
        assert!(garbage.ends_with("12 bytes were received, none of them a frame"), "{garbage}");
        let frames =
            said(ReceiveCounts { bytes: 50, other_frames: 2, damaged_frames: 1, ..ReceiveCounts::default() });
        assert!(frames.ends_with("1 damaged and 2 other frames were received"), "{frames}");
    }
}
