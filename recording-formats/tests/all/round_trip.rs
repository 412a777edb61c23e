//! A recording that is written in any format and read back is unchanged. Input that is not a recording is refused.

use recording_formats::{Format, McapLayout, ReadError, convert, read, write};
use sevenbot::recording::{Recording, RecordingError};

use crate::{mcap_bytes, recording};

/// Three moments, the first one 5 s after the start.
const LATE: &str = "7bot-recording 2
5.000 90 90 65 90 90 90 80 0
5.020 90.25 90 65 90 90 90 80 0
5.040 90.5 90 65 90 90 90 80 1
";

#[test]
fn every_format_has_the_whole_recording() {
    let recording = recording(200);
    for format in Format::ALL {
        let mut bytes = Vec::new();
        write(&recording, format, &mut bytes).expect("memory");
        let again = read(bytes.as_slice()).unwrap_or_else(|error| panic!("{format:?}: {error}"));
        assert!(again.moments().eq(recording.moments()), "{format:?}");
    }
    for layout in [McapLayout::Indexed, McapLayout::Live] {
        let again = read(mcap_bytes(&recording, layout).as_slice()).expect("a recording");
        assert!(again.moments().eq(recording.moments()), "{layout:?}");
    }
}

#[test]
fn every_format_has_the_time_of_the_first_moment() {
    let recording = Recording::parse(LATE).expect("a recording");
    let same = |bytes: &[u8]| read(bytes).expect("a recording").moments().eq(recording.moments());
    for format in Format::ALL {
        let mut bytes = Vec::new();
        convert(LATE.as_bytes(), format, &mut bytes).expect("memory");
        assert!(same(&bytes), "{format:?}");
        let mut copy = Vec::new();
        convert(bytes.as_slice(), Format::Mcap, &mut copy).expect("memory");
        assert!(same(&copy), "{format:?}, and then MCAP");
    }
    assert!(same(&mcap_bytes(&recording, McapLayout::Live)), "recorded directly");
}

#[test]
fn csv_has_names_and_its_errors_have_lines() {
    let mut bytes = Vec::new();
    write(&recording(2), Format::Csv, &mut bytes).expect("memory");
    let text = String::from_utf8(bytes).expect("text");
    let (head, lines) = text.split_once('\n').expect("lines");
    assert_eq!(head, "seconds,joint_1,joint_2,joint_3,joint_4,joint_5,joint_6,joint_7,vacuum");
    assert!(lines.starts_with("0.000,") && lines.contains("\n0.020,"), "{lines}");
    let refused = |text: &str| match read(text.as_bytes()) {
        Err(ReadError::Text(error)) => error.to_string(),
        other => panic!("{other:?}"),
    };
    let wrong = format!("{head}\r\n0,90,90,65,90,90,90,80,0\r\n1,90,90,181,90,90,90,80,0\r\n");
    assert!(refused(&wrong).starts_with("line 3: joint 3 cannot go to `181`"), "{}", refused(&wrong));
    assert_eq!(refused(head), "the recording contains no movement");
    let other = "time,joint_1\n0,90\n";
    assert!(refused(other).starts_with("this is not a recording"), "{}", refused(other));
}

#[test]
fn what_is_no_recording_is_refused_early() {
    let endless = std::io::repeat(b'x');
    assert!(matches!(read(endless), Err(ReadError::Text(RecordingError::NotARecording))));
    assert!(matches!(read(&b""[..]), Err(ReadError::Text(RecordingError::NotARecording))));
    assert!(matches!(read(&b"7bot-recording 2\n\xFF"[..]), Err(ReadError::NotText)));
    let text = "7bot-recording 1\n0 90 90 65 90 90 90 80 0\n";
    let read = read(text.as_bytes()).expect("a recording");
    assert!(read.moments().eq(Recording::parse(text).expect("a recording").moments()));
}
