use sevenbot::FineAngle;

use super::*;
use crate::recorder::PageRecorder;

const WAVE: &str = "7bot-recording 2\n0 90 90 65 90 90 90 80 0\n2 120.5 90 65 90 90 90 80 1\n";

fn seconds(seconds: u64) -> Instant {
    Instant::from_micros(seconds * 1_000_000)
}

/// The registers of an arm in its standard pose, except joint 1, whose angle is given in hundredths of a degree.
fn registers(joint_1: u16) -> Snapshot {
    let mut registers = Snapshot { address: 0, values: vec![0; 256] };
    let angles = [joint_1, 9_000, 6_500, 9_000, 9_000, 9_000, 8_000].map(u16::to_le_bytes);
    for first in [128, 142] {
        registers.values[first..first + 14].copy_from_slice(angles.as_flattened());
    }
    registers.values[191] = 1;
    registers
}

#[test]
fn a_movement_that_begins_elsewhere_is_refused_or_approached() {
    let refused = PagePlayer::new(WAVE, &registers(10_000), None, seconds(0)).expect_err("10 degrees");
    let PlayRefusal::TooFar(far) = refused else { panic!("{refused:?}") };
    assert_eq!((far.joints.len(), far.joints[0].1, far.joints[0].2), (1, 100.0, 90.0));
    let way = Some(Duration::from_secs(2));
    let player = PagePlayer::new(WAVE, &registers(10_000), way, seconds(0)).expect("a way");
    assert_eq!(player.approach.duration(), Duration::from_secs(2));
    let near = PagePlayer::new(WAVE, &registers(9_400), None, seconds(0)).expect("near");
    assert_eq!(near.approach.duration(), Duration::from_millis(200));
}

#[test]
fn a_recording_is_a_file_of_the_command_line() {
    let mut registers = registers(9_005);
    registers.values[240] = 1;
    let mut recorder = PageRecorder::new(seconds(1));
    for time in [1, 1, 2] {
        assert_eq!(recorder.add(seconds(time), &registers, false), Ok(()));
    }
    registers.values[242] = 0b100;
    assert!(recorder.add(seconds(3), &registers, false).is_err(), "joint 3 is silent: its angle is old");
    let text = recorder.finish().expect("something was measured");
    let recording = Recording::parse(&text).expect("a recording");
    let moments: Vec<_> = recording.moments().map(|moment| (moment.time, moment.pose[0])).collect();
    let angle = FineAngle::from_hundredths(9_005).expect("an angle");
    assert_eq!(moments, [(Duration::ZERO, angle), (Duration::from_secs(1), angle)]);
    assert!(PageRecorder::new(seconds(1)).finish().is_none());
}

#[test]
fn what_the_arm_cannot_play_is_refused() {
    let refused =
        |text| PagePlayer::new(text, &registers(9_000), None, seconds(0)).expect_err("no recording");
    assert_eq!(refused("hello"), PlayRefusal::NoRecording(RecordingError::NotARecording));
    let leap = "7bot-recording 2\n0 90 90 65 90 90 90 80 0\n0.1 150 90 65 90 90 90 80 1\n";
    let PlayRefusal::NoRecording(why) = refused(leap) else { panic!("a leap") };
    assert!(why.to_string().contains("the motors reach 372"), "{why}");
}
