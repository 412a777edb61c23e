//! Writes an MCAP file with messages of ROS 2, moment by moment.
//!
//! ```text
//!   Moment, Telemetry ──▶ /joint_states, /robot_joint_command, /tf, /vacuum ──┐
//!   Health ─────────────▶ /diagnostics ───────────────────────────────────────┼─▶ chunk ──▶ file, once a second
//!   the model, once ────▶ /robot_description, /tf_static ─────────────────────┘
//! ```
//!
//! The writer never seeks, so the output may be a pipe. If the program is killed, the file has whole chunks, or whole messages with
//! [`McapLayout::Live`]. Readers recover these.

use std::collections::HashMap;
use std::io::{self, Write};
use std::time::Duration;

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions};
use sevenbot::recording::Moment;
use sevenbot::{FineAngle, Health};

use crate::cdr;
use crate::diagnosis;
use crate::joints::{all_names, names, to_radians, with_passive};
use crate::messages::{
    BoolMessage, Diagnostics, Header, JointStateMessage, RosMessage, StringMessage, Time, Transform,
    Transforms,
};
use crate::telemetry::Telemetry;
use crate::topics;

/// The duration of a chunk. At most this much of the recording is lost if the program is killed.
const CHUNK: Duration = Duration::from_secs(1);
/// The greatest torque in the URDF, in N m. It stands for the stall torque of the servos, which is not measured.
const STALL_TORQUE: f64 = 2.0;

/// How messages go to the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum McapLayout {
    /// Once a second, with an index: for a file.
    Indexed,
    /// Each moment at once, without an index: for a program that reads the file while it grows.
    Live,
}

/// Writes a recording as MCAP.
///
/// ```
/// use recording_formats::{McapLayout, McapWriter, ReadError, Telemetry, read};
/// use sevenbot::recording::Moment;
/// use sevenbot::{Angle, FineAngle};
/// use std::time::Duration;
///
/// let pose = [FineAngle::from(Angle::from_register(90)); 7];
/// let moment = |time| Moment { time: Duration::from_millis(time), pose, vacuum: false };
/// let mut file = Vec::new();
/// let mut writer = McapWriter::new(&mut file, McapLayout::Indexed)?;
/// let start = Duration::from_secs(1_700_000_000);
/// for moment in [moment(0), moment(20)] {
///     writer.add(start + moment.time, &moment, &Telemetry::default())?;
/// }
/// writer.finish()?;
/// drop(writer);
/// let recording = read(&file[..])?;
/// assert!(recording.moments().eq([moment(0), moment(20)]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct McapWriter<W: Write> {
    writer: mcap::Writer<NoSeek<W>>,
    layout: McapLayout,
    channels: HashMap<&'static str, Channel>,
    chunk_begin: Option<Duration>,
    /// The time of the first moment in the recording.
    first_time: Duration,
    vacuum: Option<bool>,
    /// Moments that are in the output.
    written: u64,
    open: u64,
}

#[derive(Clone, Copy)]
struct Channel {
    id: u16,
    next: u32,
}

impl<W: Write> McapWriter<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn new(out: W, layout: McapLayout) -> io::Result<Self> {
        let options = options().use_chunks(layout == McapLayout::Indexed);
        Ok(Self {
            writer: options.create(NoSeek::new(out)).map_err(io_error)?,
            layout,
            channels: HashMap::new(),
            chunk_begin: None,
            first_time: Duration::ZERO,
            vacuum: None,
            written: 0,
            open: 0,
        })
    }

    /// Adds a moment, not earlier than the previous one. `at` is its time since 1970. The file stores `at` instead of
    /// [`Moment::time`]; of the latter it stores only the value of the first moment, as metadata.
    ///
    /// # Errors
    /// The output cannot be written. The file then holds at least the moments that [`McapWriter::written`] counts.
    pub fn add(&mut self, at: Duration, moment: &Moment, telemetry: &Telemetry) -> io::Result<()> {
        if self.vacuum.is_none() {
            self.first_time = moment.time;
            self.describe(at)?;
        }
        if self.vacuum.replace(moment.vacuum) != Some(moment.vacuum) {
            self.publish(topics::VACUUM, at, &BoolMessage { data: moment.vacuum })?;
        }
        if let Some(targets) = telemetry.targets {
            self.publish(topics::COMMANDS, at, &command(at, targets))?;
        }
        self.publish(topics::JOINT_STATES, at, &joint_state(at, moment.pose, telemetry))?;
        self.publish(topics::TRANSFORMS, at, &transforms(at, moment.pose, false))?;
        self.open += 1;
        self.end_chunk(at)
    }

    /// Adds the health of the arm at this port. `at` is a time since 1970.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn diagnose(&mut self, at: Duration, health: &Health, port: &str) -> io::Result<()> {
        let status = vec![diagnosis::status(health, port)];
        self.publish(topics::DIAGNOSTICS, at, &Diagnostics { header: header(at, ""), status })
    }

    /// The number of moments that are in the output, even if this program is killed now.
    #[must_use]
    pub const fn written(&self) -> u64 {
        self.written
    }

    /// Ends the file. Nothing can be added afterwards.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn finish(&mut self) -> io::Result<()> {
        self.writer.finish().map_err(io_error)?;
        self.written += std::mem::take(&mut self.open);
        Ok(())
    }

    /// Publishes the constant messages: the model, and the transforms of the fixed links.
    fn describe(&mut self, at: Duration) -> io::Result<()> {
        self.publish(topics::DESCRIPTION, at, &StringMessage { data: arm_model::urdf()? })?;
        let straight = [FineAngle::from(sevenbot::Angle::from_register(0)); 7];
        self.publish(topics::FIXED_TRANSFORMS, at, &transforms(at, straight, true))
    }

    fn end_chunk(&mut self, at: Duration) -> io::Result<()> {
        let begin = *self.chunk_begin.get_or_insert(at);
        if self.layout == McapLayout::Indexed && at < begin + CHUNK {
            return Ok(());
        }
        self.chunk_begin = None;
        self.writer.flush().map_err(io_error)?;
        self.written += std::mem::take(&mut self.open);
        Ok(())
    }

    fn publish<M: RosMessage>(&mut self, topic: &'static str, at: Duration, message: &M) -> io::Result<()> {
        let Channel { id, next } = self.channel::<M>(topic)?;
        self.channels.insert(topic, Channel { id, next: next.wrapping_add(1) });
        let nanoseconds = u64::try_from(at.as_nanos()).unwrap_or(u64::MAX);
        let head = MessageHeader {
            channel_id: id,
            sequence: next,
            log_time: nanoseconds,
            publish_time: nanoseconds,
        };
        let bytes = cdr::encode(message).map_err(io::Error::other)?;
        self.writer.write_to_known_channel(&head, &bytes).map_err(io_error)
    }

    fn channel<M: RosMessage>(&mut self, topic: &'static str) -> io::Result<Channel> {
        if let Some(known) = self.channels.get(topic) {
            return Ok(*known);
        }
        let schema =
            self.writer.add_schema(M::NAME, "ros2msg", M::DEFINITION.as_bytes()).map_err(io_error)?;
        let metadata = topics::metadata(topic, self.first_time);
        let id = self.writer.add_channel(schema, topic, "cdr", &metadata).map_err(io_error)?;
        Ok(Channel { id, next: 0 })
    }
}

/// The options of every file: uncompressed, and written without seeking.
pub(crate) fn options() -> WriteOptions {
    let library = concat!("sevenbot ", env!("CARGO_PKG_VERSION"));
    WriteOptions::new().compression(None).profile("ros2").library(library).disable_seeking(true)
}

pub(crate) fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

fn header(at: Duration, frame: &str) -> Header {
    Header { stamp: Time::new(at), frame_id: frame.to_owned() }
}

fn joint_state(at: Duration, pose: [FineAngle; 7], telemetry: &Telemetry) -> JointStateMessage {
    let (mut velocity, mut effort) = (Vec::new(), Vec::new());
    if let Some(motion) = telemetry.motion {
        velocity = with_passive(motion.velocities.map(f64::to_radians));
        effort = motion.loads.map(|percent| percent / 100.0 * STALL_TORQUE).to_vec();
        // The joints that follow have no motor.
        effort.resize(velocity.len(), 0.0);
    }
    JointStateMessage {
        header: header(at, ""),
        name: all_names().map(str::to_owned).collect(),
        position: with_passive(to_radians(pose)),
        velocity,
        effort,
    }
}

fn command(at: Duration, targets: [FineAngle; 7]) -> JointStateMessage {
    let position = to_radians(targets).to_vec();
    JointStateMessage {
        header: header(at, ""),
        name: names().map(str::to_owned).collect(),
        position,
        ..JointStateMessage::default()
    }
}

fn transforms(at: Duration, pose: [FineAngle; 7], fixed: bool) -> Transforms {
    let [a1, a2, a3, a4, a5, a6, _] = to_radians(pose);
    let links = arm_model::link_transforms([a1, a2, a3, a4, a5, a6]);
    let links = links.filter(|link| link.is_fixed == fixed).map(|link| Transform {
        header: header(at, link.parent),
        child_frame_id: link.child,
        translation: link.translation,
        rotation: link.rotation,
    });
    Transforms { transforms: links.collect() }
}
