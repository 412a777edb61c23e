//! The reasons why a file is not a recording.

use std::io;

use sevenbot::Joint;
use sevenbot::recording::{Recording, RecordingError};

/// The bound on a text in bytes: more than a day of 50 moments a second.
pub(crate) const LONGEST_TEXT: u64 = 512 * 1_024 * 1_024;

/// Why a source is not a recording, or not a whole one.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The source cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The text has 512 MiB or more.
    #[error("this is longer than {LONGEST_TEXT} bytes: is it the right file?")]
    TooLong,
    /// The source is neither MCAP nor text in UTF-8.
    #[error("this is not text in UTF-8")]
    NotText,
    /// The text or CSV is not a valid recording.
    #[error(transparent)]
    Text(#[from] RecordingError),
    /// The MCAP file is not a valid recording of one arm, or cannot be read: see [`McapReadError`].
    #[error(transparent)]
    Mcap(#[from] McapReadError),
    /// The MCAP file is cut off or damaged.
    #[error("{cause}; {} moments, {:.1} s, can be read", .readable.moments().count(), .readable.duration().as_secs_f64())]
    Damaged {
        /// The part that can be read: all complete records of a file that is cut off.
        readable: Recording,
        /// What is wrong with the file.
        cause: String,
    },
}

/// Why a recording cannot be read from an MCAP file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum McapReadError {
    /// No topic has the states of the joints.
    #[error(
        "no message of a topic `joint_states` or `robot_joint_states` has the positions of joint_1 to joint_7"
    )]
    NoJoints,
    /// Several topics of the same name, in different namespaces, have the states of the joints. Holds the topics.
    #[error("this has the joints of several arms: {}", .0.join(", "))]
    SeveralArms(Vec<String>),
    /// The chunks are compressed with this method. Only uncompressed chunks are read.
    #[error("its chunks are compressed with {0}: only uncompressed files are read")]
    Compressed(String),
    /// A joint is beyond its range.
    #[error("at {seconds:.3} s joint {} is at {degrees:.2} degrees, and the range is 0 to 180", joint.number())]
    OutOfRange {
        /// The first joint beyond its range at that time.
        joint: Joint,
        /// Its angle in degrees of the registers.
        degrees: f64,
        /// The time of the moment in the recording, in seconds.
        seconds: f64,
    },
    /// A message is older than the previous one of its topic.
    #[error("after {seconds:.3} s the time goes back: are these two recordings?")]
    TimeGoesBack {
        /// The time of the previous moment in the recording, in seconds.
        seconds: f64,
    },
    /// The moments are not a valid recording.
    #[error(transparent)]
    Refused(#[from] RecordingError),
    /// The file is damaged before its first moment.
    #[error("{0}, before its first moment")]
    Unreadable(String),
}
