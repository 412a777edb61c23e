//! Reads a recording from an MCAP file of this crate, or from a bag of `ros/sevenbot_ros`.
//!
//! A file that is cut off is read as far as its records are complete.

use std::collections::BTreeMap;
use std::io::{self, Read};
use std::time::Duration;

use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use mcap::{McapError, Message};
use sevenbot::recording::{Moment, Recording};
use sevenbot::{FineAngle, Joint};

use crate::cdr;
use crate::joints::{names, to_degrees};
use crate::messages::{BoolMessage, JointStateMessage, RosMessage};
use crate::read_error::{McapReadError, ReadError};
use crate::topics::first_time;

/// In bytes. No recording of an arm has longer records. Without a bound, a damaged length would fill the memory.
const LONGEST_RECORD: usize = 64 * 1_024 * 1_024;
/// The last words of topics with the states of joints, the preferred one first.
const STATES: [&str; 2] = ["joint_states", "robot_joint_states"];
/// The last word of the topic with the state of the pump.
const VACUUM: &str = "vacuum";
/// The resolution of the times of a recording. A moment is skipped if its rounded time is that of the previous one.
const RESOLUTION: Duration = Duration::from_millis(1);

/// Reads the recording, and passes each message on.
pub(crate) fn read(
    source: impl Read,
    mut pass_on: impl FnMut(&Message) -> io::Result<()>,
) -> Result<Recording, ReadError> {
    let options = LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_record_length_limit(LONGEST_RECORD);
    let mut tracks = Tracks::default();
    for message in MessageReader::new_with_options(source, options) {
        match message {
            Ok(message) => {
                tracks.add(&message)?;
                pass_on(&message)?;
            }
            Err(McapError::Io(error)) => return Err(error.into()),
            Err(McapError::UnsupportedCompression(name)) => {
                return Err(McapReadError::Compressed(name).into());
            }
            Err(damage) => return Err(tracks.damaged(told(&damage))),
        }
    }
    Ok(tracks.recording()?)
}

fn told(damage: &McapError) -> String {
    match damage {
        McapError::UnexpectedEof | McapError::UnexpectedEoc => "the file ends in the middle".to_owned(),
        McapError::BadDataCrc { .. } => {
            "the checksum of the file is wrong, so a moment may be wrong or missing".to_owned()
        }
        other => format!("the file is damaged ({other})"),
    }
}

/// The moments of each topic, while the file is read.
#[derive(Default)]
struct Tracks {
    by_topic: BTreeMap<String, Track>,
    vacuum: bool,
}

#[derive(Default)]
struct Track {
    /// The stamp of the first moment, since 1970; its log time if it has no stamp.
    start: Duration,
    /// The time that the recording gives to the first moment, from the metadata of the topic's channel.
    first_time: Duration,
    moments: Vec<Moment>,
}

impl Tracks {
    fn add(&mut self, message: &Message) -> Result<(), McapReadError> {
        let is = |name: &str| message.channel.schema.as_ref().is_some_and(|schema| schema.name == name);
        let word = last_word(&message.channel.topic);
        if word == VACUUM && is(BoolMessage::NAME) {
            self.vacuum = cdr::decode::<BoolMessage>(&message.data).map_or(self.vacuum, |switch| switch.data);
        }
        if !(STATES.contains(&word) && is(JointStateMessage::NAME)) {
            return Ok(());
        }
        let Some(state) = cdr::decode::<JointStateMessage>(&message.data) else { return Ok(()) };
        let Some(positions) = positions(&state) else { return Ok(()) };
        // Some programs leave the stamp at 0. Then the time at which the message was logged counts.
        let stamp = state.header.stamp.since_epoch().filter(|stamp| !stamp.is_zero());
        let time = stamp.unwrap_or(Duration::from_nanos(message.log_time));
        let track = self.by_topic.entry(message.channel.topic.clone()).or_default();
        if track.moments.is_empty() {
            (track.start, track.first_time) = (time, first_time(&message.channel.metadata));
        }
        track.add(time, positions, self.vacuum)
    }

    /// The recording from the preferred topic.
    fn recording(self) -> Result<Recording, McapReadError> {
        let preferred = |word: &str| -> Vec<String> {
            self.by_topic.keys().filter(|topic| last_word(topic) == word).cloned().collect()
        };
        let topics = STATES.into_iter().map(preferred).find(|topics| !topics.is_empty());
        let topics = topics.ok_or(McapReadError::NoJoints)?;
        let [topic] = topics.as_slice() else { return Err(McapReadError::SeveralArms(topics)) };
        let moments = self.by_topic.get(topic).map(|track| track.moments.clone()).unwrap_or_default();
        Ok(Recording::of_moments(moments)?)
    }

    fn damaged(self, cause: String) -> ReadError {
        match self.recording() {
            Ok(readable) => ReadError::Damaged { readable, cause },
            Err(McapReadError::NoJoints) => McapReadError::Unreadable(cause).into(),
            Err(other) => other.into(),
        }
    }
}

impl Track {
    fn add(&mut self, at: Duration, radians: [f64; 7], vacuum: bool) -> Result<(), McapReadError> {
        let last = self.moments.last().map(|last| last.time);
        let (time, seconds) = (at.checked_sub(self.start), last.unwrap_or_default().as_secs_f64());
        let time = time.map(|time| time.saturating_add(self.first_time));
        let time = in_whole_milliseconds(time.ok_or(McapReadError::TimeGoesBack { seconds })?);
        match last {
            Some(last) if time < last => return Err(McapReadError::TimeGoesBack { seconds }),
            Some(last) if time < last + RESOLUTION => return Ok(()),
            _ => {}
        }
        let pose = pose(radians, time.as_secs_f64())?;
        self.moments.push(Moment { time, pose, vacuum });
        Ok(())
    }
}

/// The nearest time that a text file can hold.
fn in_whole_milliseconds(time: Duration) -> Duration {
    let milliseconds = (time + RESOLUTION / 2).as_millis();
    Duration::from_millis(u64::try_from(milliseconds).unwrap_or(u64::MAX))
}

/// The topic without its namespace.
fn last_word(topic: &str) -> &str {
    topic.rsplit('/').next().unwrap_or(topic)
}

/// The positions of joints 1 to 7 in radians; `None` if the message lacks one.
fn positions(state: &JointStateMessage) -> Option<[f64; 7]> {
    let mut positions = [0.0; 7];
    for (position, name) in positions.iter_mut().zip(names()) {
        let place = state.name.iter().position(|other| other == name)?;
        *position = *state.position.get(place)?;
    }
    Some(positions)
}

fn pose(radians: [f64; 7], seconds: f64) -> Result<[FineAngle; 7], McapReadError> {
    let mut pose = [FineAngle::from(sevenbot::Angle::from_register(0)); 7];
    for ((angle, radians), joint) in pose.iter_mut().zip(radians).zip(Joint::ALL) {
        let degrees = to_degrees(joint, radians);
        *angle =
            FineAngle::from_degrees(degrees).ok_or(McapReadError::OutOfRange { joint, degrees, seconds })?;
    }
    Ok(pose)
}
