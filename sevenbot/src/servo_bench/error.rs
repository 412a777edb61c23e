//! What can go wrong between a computer and servos, and what to check then.

use std::fmt;
use std::io;
use std::time::Duration;

/// Why an exchange with a servo failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// No answer that can be believed, though the servo was asked several times.
    NoAnswer {
        /// The servo.
        id: u8,
        /// How often it was asked.
        attempts: u32,
        /// How long each attempt waited.
        waited: Duration,
        /// What was heard instead.
        heard: Heard,
    },
    /// The servo answers, but the register does not hold what was written.
    NotTaken {
        /// The servo.
        id: u8,
        /// The first register that was written.
        register: u8,
    },
    /// The adapter does not know this baud rate.
    NoSuchRate {
        /// The rate.
        baud: u32,
    },
    /// The port takes no more bytes: its other side does not read.
    Stalled,
    /// The port is gone: the adapter was unplugged.
    PortLost(io::ErrorKind),
}

/// What was heard on the bus while an answer was missing, the echo of the question not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Heard {
    /// Bytes of any kind, echoes among them.
    pub bytes: usize,
    /// Echoes of what was sent.
    pub echoes: usize,
    /// Frames with a right checksum that are no answer to the question.
    pub other_frames: usize,
    /// Frames whose checksum was wrong.
    pub damaged_frames: usize,
}

impl fmt::Display for Error {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAnswer { id, attempts, waited, heard } => {
                let millis = waited.as_millis();
                write!(out, "servo {id} does not answer ({attempts} tries of {millis} ms): {heard}")
            }
            Self::NotTaken { id, register } => {
                write!(out, "servo {id} answers, but its register {register} does not hold what was written")
            }
            Self::NoSuchRate { baud } => write!(out, "this adapter does not know {baud} baud"),
            Self::Stalled => out.write_str("the port takes no more bytes: nothing reads at its other end"),
            Self::PortLost(kind) => write!(out, "the connection is gone: {kind}"),
        }
    }
}

impl std::error::Error for Error {}

impl fmt::Display for Heard {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self { bytes: 0, .. } => out.write_str("nothing was heard"),
            Self { damaged_frames: 0, other_frames: 0, echoes: 1.., .. } => {
                out.write_str("only the echo of the question was heard")
            }
            Self { damaged_frames: 0, other_frames: 0, bytes, .. } => {
                write!(out, "{bytes} bytes were heard, none of them a frame")
            }
            Self { damaged_frames, other_frames, .. } => {
                write!(out, "{damaged_frames} damaged and {other_frames} other frames were heard")
            }
        }
    }
}

impl Error {
    /// What a user should check, most likely first; empty where the message says it all.
    #[must_use]
    pub fn advice(&self) -> &'static [&'static str] {
        match self {
            Self::NoAnswer { heard: Heard { damaged_frames: 1.., .. }, .. } => &[
                "damaged answers: two servos with the same id, a loose plug, or a pull-up that is too weak",
                "leave one servo on the bus, and try again",
            ],
            Self::NoAnswer { .. } => &[
                "do the servos have their own power? The adapter does not supply them",
                "is the signal wire on the adapter's servo side, and the ground common to both?",
                "`sevenbot servo scan` finds ids and baud rates; `--rate` sets the rate for one command",
                "is the arm's controller off the bus? Two masters disturb each other",
            ],
            Self::NotTaken { .. } => {
                &["an overload or a voltage fault may make a servo refuse: see `sevenbot servo info`"]
            }
            Self::NoSuchRate { .. } => &["choose other rates with --rates, or use another adapter"],
            Self::Stalled | Self::PortLost(_) => &["was the adapter unplugged?"],
        }
    }
}
