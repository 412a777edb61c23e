//! The messages of ROS 2 in a recording: their fields, and their definitions as text for readers without ROS.
//!
//! The fields have the order of the published interfaces, because CDR does not encode names.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// The separator and the name that stand before the definition of a used interface.
macro_rules! interface {
    ($name:literal) => {
        concat!(
            "================================================================================\nMSG: ",
            $name,
            "\n"
        )
    };
}

/// The definitions of a header and of the interface that it uses.
macro_rules! header {
    () => {
        concat!(
            interface!("std_msgs/Header"),
            "builtin_interfaces/Time stamp\nstring frame_id\n",
            interface!("builtin_interfaces/Time"),
            "int32 sec\nuint32 nanosec\n"
        )
    };
}

/// A message of a topic.
pub(crate) trait RosMessage: Serialize {
    /// The name of the interface with its package: `std_msgs/msg/Bool`.
    const NAME: &'static str;
    /// The definition of the interface, followed by the definitions of the interfaces that it uses.
    const DEFINITION: &'static str;
}

/// `builtin_interfaces/msg/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Time {
    pub(crate) sec: i32,
    pub(crate) nanosec: u32,
}

impl Time {
    /// Converts a time since 1970. A time after 2038 does not fit, and its seconds become `i32::MAX`.
    pub(crate) fn new(time: Duration) -> Self {
        Self { sec: i32::try_from(time.as_secs()).unwrap_or(i32::MAX), nanosec: time.subsec_nanos() }
    }

    /// The time since 1970; `None` before that.
    pub(crate) fn since_epoch(self) -> Option<Duration> {
        Some(Duration::from_secs(u64::try_from(self.sec).ok()?) + Duration::from_nanos(self.nanosec.into()))
    }
}

/// `std_msgs/msg/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Header {
    pub(crate) stamp: Time,
    pub(crate) frame_id: String,
}

/// `sensor_msgs/msg/JointState`. A list is empty where nothing is known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct JointStateMessage {
    pub(crate) header: Header,
    pub(crate) name: Vec<String>,
    /// In rad.
    pub(crate) position: Vec<f64>,
    /// In rad/s.
    pub(crate) velocity: Vec<f64>,
    /// In N m.
    pub(crate) effort: Vec<f64>,
}

impl RosMessage for JointStateMessage {
    const NAME: &'static str = "sensor_msgs/msg/JointState";
    const DEFINITION: &'static str = concat!(
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
        header!()
    );
}

/// `geometry_msgs/msg/TransformStamped`. Arrays stand for its nested messages, because CDR encodes both alike.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Transform {
    /// The frame of the header is the parent.
    pub(crate) header: Header,
    pub(crate) child_frame_id: &'static str,
    /// In m.
    pub(crate) translation: [f64; 3],
    /// A quaternion: x, y, z, w.
    pub(crate) rotation: [f64; 4],
}

/// `tf2_msgs/msg/TFMessage`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Transforms {
    pub(crate) transforms: Vec<Transform>,
}

impl RosMessage for Transforms {
    const NAME: &'static str = "tf2_msgs/msg/TFMessage";
    const DEFINITION: &'static str = concat!(
        "geometry_msgs/TransformStamped[] transforms\n",
        interface!("geometry_msgs/TransformStamped"),
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
        interface!("geometry_msgs/Transform"),
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
        interface!("geometry_msgs/Vector3"),
        "float64 x\nfloat64 y\nfloat64 z\n",
        interface!("geometry_msgs/Quaternion"),
        "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
        header!()
    );
}

/// `std_msgs/msg/String`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct StringMessage {
    pub(crate) data: String,
}

impl RosMessage for StringMessage {
    const NAME: &'static str = "std_msgs/msg/String";
    const DEFINITION: &'static str = "string data\n";
}

/// `std_msgs/msg/Bool`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct BoolMessage {
    pub(crate) data: bool,
}

impl RosMessage for BoolMessage {
    const NAME: &'static str = "std_msgs/msg/Bool";
    const DEFINITION: &'static str = "bool data\n";
}

/// `diagnostic_msgs/msg/KeyValue`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct KeyValue {
    pub(crate) key: &'static str,
    pub(crate) value: String,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct DiagnosticStatus {
    /// 0 is good, 1 a warning, 2 an error.
    pub(crate) level: u8,
    pub(crate) name: &'static str,
    pub(crate) message: String,
    pub(crate) hardware_id: String,
    pub(crate) values: Vec<KeyValue>,
}

/// `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Diagnostics {
    pub(crate) header: Header,
    pub(crate) status: Vec<DiagnosticStatus>,
}

impl RosMessage for Diagnostics {
    const NAME: &'static str = "diagnostic_msgs/msg/DiagnosticArray";
    const DEFINITION: &'static str = concat!(
        "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n",
        interface!("diagnostic_msgs/DiagnosticStatus"),
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\n",
        "byte level\nstring name\nstring message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values\n",
        interface!("diagnostic_msgs/KeyValue"),
        "string key\nstring value\n",
        header!()
    );
}
