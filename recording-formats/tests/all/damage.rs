//! MCAP files that are cut off, as a kill or a full disk leaves them, files with wrong bytes, and files that are not a
//! recording of one arm.

use recording_formats::{Format, McapLayout, McapReadError, ReadError, convert, read};
use sevenbot::recording::{Moment, Recording};

use crate::{mcap_bytes, recording};

/// The moments that can be read, and whether the reader says that these are not all.
fn readable(bytes: &[u8]) -> (Vec<Moment>, bool) {
    match read(bytes) {
        Ok(recording) => (recording.moments().collect(), false),
        Err(ReadError::Damaged { readable, .. }) => (readable.moments().collect(), true),
        Err(_) => (Vec::new(), true),
    }
}

fn is_part(part: &[Moment], of: &Recording) -> bool {
    part.iter().copied().eq(of.moments().take(part.len()))
}

#[test]
fn a_file_that_is_cut_off_has_its_whole_chunks() {
    // Three seconds: three chunks, and the rest.
    let whole = recording(160);
    for (layout, lost_at_most) in [(McapLayout::Indexed, 51), (McapLayout::Live, 1)] {
        let bytes = mcap_bytes(&whole, layout);
        let per_moment = bytes.len() / 160;
        let mut last = 0;
        for end in (0..bytes.len()).step_by(1_009) {
            let (part, is_damaged) = readable(&bytes[..end]);
            assert!(is_damaged && is_part(&part, &whole), "{end} bytes of {layout:?}");
            assert!(part.len() >= last, "more bytes have no fewer moments");
            last = part.len();
            let there = (end / per_moment).saturating_sub(8);
            assert!(part.len() + lost_at_most >= there.min(160), "{} of {there} at {end}", part.len());
        }
        let (part, is_damaged) = readable(&bytes[..bytes.len() - 1]);
        assert!(is_damaged && part.len() == 160, "only the end is missing");
    }
}

#[test]
fn a_cut_file_says_so() {
    let bytes = mcap_bytes(&recording(100), McapLayout::Indexed);
    let said = read(&bytes[..bytes.len() * 3 / 4]).expect_err("it is cut off").to_string();
    assert!(said.starts_with("the file ends in the middle; 51 moments, 1.0 s, can be read"), "{said}");
    let said = read(&bytes[..100]).expect_err("it is cut off").to_string();
    assert_eq!(said, "the file ends in the middle, before its first moment");
}

#[test]
fn a_converted_cut_file_is_whole_and_has_all_its_messages() {
    let bytes = mcap_bytes(&recording(100), McapLayout::Indexed);
    let mut whole = Vec::new();
    let converted = convert(&bytes[..bytes.len() * 3 / 4], Format::Mcap, &mut whole);
    assert!(matches!(converted, Err(ReadError::Damaged { .. })), "it says that this is not all");
    let again = read(whole.as_slice()).expect("a whole file");
    assert!(again.moments().eq(recording(100).moments().take(51)));
    let summary = mcap::Summary::read(&whole).expect("a file").expect("an index");
    assert_eq!(summary.stats.expect("statistics").message_count, 2 * 51 + 5);
}

#[test]
fn a_wrong_byte_never_passes_as_another_movement() {
    let whole = recording(60);
    let mut random = fastrand::Rng::with_seed(5);
    for layout in [McapLayout::Indexed, McapLayout::Live] {
        let bytes = mcap_bytes(&whole, layout);
        for _ in 0..300 {
            let mut wrong = bytes.clone();
            let place = random.usize(0..bytes.len());
            wrong[place] ^= random.u8(1..=255);
            if let Ok(recording) = read(wrong.as_slice()) {
                assert!(recording.moments().eq(whole.moments()), "byte {place} of {layout:?}");
            }
        }
    }
}

#[test]
fn other_mcap_files_are_refused_with_the_reason() {
    let file = |topics: &[&str]| {
        let mut bytes = Vec::new();
        let options = mcap::WriteOptions::new().disable_seeking(true);
        let mut writer = options.create(mcap::write::NoSeek::new(&mut bytes)).expect("a file");
        for topic in topics {
            let schema = writer.add_schema("sensor_msgs/msg/JointState", "ros2msg", b"").expect("a schema");
            let channel = writer.add_channel(schema, topic, "cdr", &Default::default()).expect("a channel");
            let head = mcap::records::MessageHeader {
                channel_id: channel,
                sequence: 0,
                log_time: 5,
                publish_time: 5,
            };
            writer.write_to_known_channel(&head, &joint_state(0.0)).expect("memory");
            if topic.contains("beyond") {
                writer.write_to_known_channel(&head, &joint_state(4.0)).expect("memory");
            }
        }
        writer.finish().expect("memory");
        drop(writer);
        bytes
    };
    let refused = |topics: &[&str]| match read(file(topics).as_slice()) {
        Err(ReadError::Mcap(error)) => error,
        other => panic!("{other:?}"),
    };
    assert_eq!(refused(&[]), McapReadError::NoJoints);
    assert_eq!(refused(&["/joint_velocities"]), McapReadError::NoJoints);
    let two = ["/left/joint_states", "/right/joint_states"];
    assert_eq!(refused(&two), McapReadError::SeveralArms(two.map(str::to_owned).to_vec()));
    let read = read(file(&["/robot_joint_states", "/robot_joint_command"]).as_slice()).expect("a recording");
    let pose: Vec<u16> =
        read.moments().flat_map(|moment| moment.pose).map(sevenbot::FineAngle::hundredths).collect();
    assert_eq!(pose, [9_000, 9_000, 6_500, 9_000, 9_000, 9_000, 0]);
}

/// A message with all joints at this angle in radians, encoded by hand.
fn joint_state(radians: f64) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    let number = |bytes: &mut Vec<u8>, value: u32| {
        while !bytes.len().is_multiple_of(4) {
            bytes.push(0);
        }
        bytes.extend(value.to_le_bytes());
    };
    for value in [0, 0, 1] {
        number(&mut bytes, value);
    }
    bytes.push(0);
    number(&mut bytes, 7);
    for joint in 1..=7 {
        number(&mut bytes, 8);
        bytes.extend(format!("joint_{joint}\0").bytes());
    }
    number(&mut bytes, 7);
    while bytes.len() % 8 != 4 {
        bytes.push(0);
    }
    for _ in 0..7 {
        bytes.extend(radians.to_le_bytes());
    }
    number(&mut bytes, 0);
    number(&mut bytes, 0);
    bytes
}
