//! The messages of a file, read by the crate `mcap` alone.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::time::Duration;

use recording_formats::{JointMotion, McapLayout, McapWriter, Telemetry};
use sevenbot::recording::Moment;
use sevenbot::simulated::{self, SimulationConfig};
use sevenbot::{Angle, FineAngle};

use crate::START;

/// A file with two moments, their targets and motion, and one diagnosis. Joints 2 to 6 are at the zero of the model.
fn file() -> Vec<u8> {
    let pose = [180, 90, 65, 90, 90, 90, 60].map(|degrees| FineAngle::from(Angle::from_register(degrees)));
    let telemetry = Telemetry {
        targets: Some(pose),
        motion: Some(JointMotion { velocities: [90.0; 7], loads: [50.0; 7] }),
    };
    let (mut arm, _) = simulated::arm(SimulationConfig::default()).expect("an arm");
    arm.sleep(Duration::from_secs(1));
    let health = arm.health().expect("an answer");
    let mut bytes = Vec::new();
    let mut writer = McapWriter::new(&mut bytes, McapLayout::Indexed).expect("a file");
    for time in [0, 20] {
        let moment = Moment { time: Duration::from_millis(time), pose, vacuum: true };
        writer.add(START + moment.time, &moment, &telemetry).expect("memory");
    }
    writer.diagnose(START, &health, "sim").expect("memory");
    writer.finish().expect("memory");
    drop(writer);
    bytes
}

fn messages(bytes: &[u8]) -> BTreeMap<String, Vec<mcap::Message<'_>>> {
    let mut by_topic: BTreeMap<String, Vec<mcap::Message>> = BTreeMap::new();
    for message in mcap::MessageStream::new(bytes).expect("a file") {
        let message = message.expect("a message");
        by_topic.entry(message.channel.topic.clone()).or_default().push(message);
    }
    by_topic
}

#[test]
fn topics_and_interfaces_are_those_of_the_node() {
    let bytes = file();
    let topics: Vec<(String, String, usize)> = messages(&bytes)
        .into_iter()
        .map(|(topic, messages)| {
            let schema = messages[0].channel.schema.as_ref().expect("a schema");
            assert_eq!(
                (schema.encoding.as_str(), messages[0].channel.message_encoding.as_str()),
                ("ros2msg", "cdr")
            );
            (topic, schema.name.clone(), messages.len())
        })
        .collect();
    let expected = [
        ("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", 1),
        ("/joint_states", "sensor_msgs/msg/JointState", 2),
        ("/robot_description", "std_msgs/msg/String", 1),
        ("/robot_joint_command", "sensor_msgs/msg/JointState", 2),
        ("/tf", "tf2_msgs/msg/TFMessage", 2),
        ("/tf_static", "tf2_msgs/msg/TFMessage", 1),
        ("/vacuum", "std_msgs/msg/Bool", 1),
    ];
    assert_eq!(topics, expected.map(|(topic, name, count)| (topic.to_owned(), name.to_owned(), count)));
}

/// The fields of a message, after the four bytes that name the byte order.
struct Fields<'a> {
    bytes: &'a [u8],
    place: usize,
}

impl Fields<'_> {
    /// The next number of `N` bytes, aligned to a multiple of `N`.
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let begin = self.place.next_multiple_of(N);
        self.place = begin + N;
        self.bytes[begin..self.place].try_into().expect("the bytes of a number")
    }

    fn number(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    /// A text has its length before it, and a 0 at its end.
    fn text(&mut self) -> String {
        let begin = self.number() as usize + self.place;
        let text = &self.bytes[std::mem::replace(&mut self.place, begin)..begin];
        String::from_utf8(text.strip_suffix(&[0]).expect("a 0 at the end").to_vec()).expect("text")
    }

    fn texts(&mut self) -> Vec<String> {
        (0..self.number()).map(|_| self.text()).collect()
    }

    fn numbers(&mut self) -> Vec<f64> {
        (0..self.number()).map(|_| f64::from_le_bytes(self.take())).collect()
    }
}

#[test]
fn a_joint_state_has_time_names_and_radians() {
    let bytes = file();
    let all = messages(&bytes);
    let [_, second] = all["/joint_states"].as_slice() else { panic!("two messages") };
    let nanoseconds = u64::try_from((START + Duration::from_millis(20)).as_nanos()).expect("64 bits");
    assert_eq!((second.log_time, second.publish_time, second.sequence), (nanoseconds, nanoseconds, 1));
    let (order, fields) = second.data.split_at(4);
    assert_eq!(order, [0, 1, 0, 0]);
    let mut fields = Fields { bytes: fields, place: 0 };
    assert_eq!((u64::from(fields.number()), fields.number()), (START.as_secs(), 20_000_000));
    assert_eq!(fields.text(), "");
    let names = fields.texts();
    let joints = (1..=7).map(|number| format!("joint_{number}"));
    assert!(
        names.iter().cloned().eq(joints.chain(["elbow", "finger", "opposite_finger"].map(str::to_owned)))
    );
    let claw = 60_f64.to_radians();
    let half = 30_f64.to_radians();
    assert_eq!(fields.numbers(), [FRAC_PI_2, 0.0, 0.0, 0.0, 0.0, 0.0, claw, 0.0, half, -half]);
    let (fast, slow) = (FRAC_PI_2, FRAC_PI_2 / 2.0);
    assert_eq!(fields.numbers(), [fast, fast, fast, fast, fast, fast, fast, -fast, slow, -slow]);
    assert_eq!(fields.numbers(), [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    assert_eq!(fields.place, fields.bytes.len());
    let command = all["/robot_joint_command"][0].data.as_ref();
    assert!(command.ends_with(&[0; 8]), "a command has no velocities and no efforts");
}

#[test]
fn the_definitions_name_every_interface_that_they_use() {
    let bytes = file();
    for (topic, messages) in messages(&bytes) {
        let schema = messages[0].channel.schema.clone().expect("a schema");
        let text = String::from_utf8(schema.data.to_vec()).expect("text");
        let fields = text.lines().filter(|line| !line.starts_with(['=', 'M']));
        for used in fields.filter_map(|line| line.split_whitespace().next()).filter(|word| word.contains('/'))
        {
            let used = used.trim_end_matches("[]");
            assert!(text.contains(&format!("\nMSG: {used}\n")), "{topic}: {used}");
        }
    }
}

#[test]
fn a_healthy_arm_is_reported_as_healthy() {
    let bytes = file();
    let text = String::from_utf8_lossy(&messages(&bytes)["/diagnostics"][0].data).into_owned();
    for word in ["/sevenbot: arm", "healthy", "sim", "motors", "servo", "blocked", "none", "supply in V"] {
        assert!(text.contains(word), "{word}");
    }
}
