//! A hold without a hub: which registers it reads, and what it writes.

use super::super::intent::Intent;
use super::*;

const NOW: Instant = Instant::ZERO;

/// The values from register 128 on: the bytes 1 to 14 as targets, and the bytes 21 to 32 as positions. Joint 3 was not
/// measured.
fn values() -> Vec<u8> {
    let mut values: Vec<u8> = (1..15).collect();
    values.extend([21, 22, 23, 24, 0xFF, 0xFF, 25, 26, 27, 28, 29, 30, 31, 32]);
    values
}

/// A hold that knows which joints move.
fn hold(moving: u8, is_streaming: bool) -> ArmHold {
    let mut hold = ArmHold::new(true, is_streaming);
    assert_eq!(hold.next_read(NOW), Some((242, 2)));
    assert_eq!(hold.next_read(NOW), None);
    assert_eq!(hold.frames(242, &[0, moving], &HeldTargets::default()), []);
    hold
}

#[test]
fn joints_that_move_or_are_silent_get_their_positions() {
    let mut hold = hold(0b111_0111, false);
    assert!(!hold.is_over());
    assert_eq!(hold.next_read(NOW), Some((128, 61)));
    let mut values = values();
    let frames = hold.frames(128, &values, &HeldTargets::default());
    assert_eq!(frames, [(128, vec![21, 22, 23, 24]), (136, vec![27, 28, 29, 30, 31, 32])]);
    assert!(!hold.is_over());
    assert_eq!(hold.next_read(NOW), Some((128, 61)));
    values[..4].copy_from_slice(&[21, 22, 23, 24]);
    values[8..14].copy_from_slice(&[27, 28, 29, 30, 31, 32]);
    assert_eq!(hold.frames(128, &values, &HeldTargets::default()), []);
    assert!(hold.is_over());
}

#[test]
fn a_joint_that_moves_and_was_not_measured_is_not_held() {
    for (moving, is_confirmed) in [(0b100, false), (0b1, true)] {
        let mut hold = hold(moving, false);
        for _ in 0..2 {
            assert_eq!(hold.next_read(NOW), Some((128, 61)));
            let mut values = values();
            values[..2].copy_from_slice(&[21, 22]);
            hold.frames(128, &values, &HeldTargets::default());
        }
        assert!(hold.is_over());
        assert_eq!(hold.is_confirmed(), is_confirmed, "{moving:b}");
        let next = hold.for_unmeasured();
        assert_eq!(next.as_ref().map(|next| next.repeats), (!is_confirmed).then_some(MOST_REPEATS - 1));
        let last = next.map(|next| ArmHold { repeats: 0, has_unmeasured: true, ..next });
        assert!(last.is_none_or(|last| last.for_unmeasured().is_none()), "others have to have their turns");
    }
}

#[test]
fn d24_joints_that_have_reached_their_targets_keep_them() {
    assert!(hold(0, false).is_over(), "nothing is read or written");
    let mut hold = hold(0, true);
    assert_eq!(hold.next_read(NOW), Some((128, 61)));
    let frames = hold.frames(128, &values(), &HeldTargets::default());
    assert_eq!(frames, [(128, (1..15).collect())], "the end of a stream that has points left");
}

#[test]
fn an_arm_without_hundredths_is_held_in_whole_degrees() {
    let mut hold = ArmHold::new(false, false);
    assert_eq!(hold.next_read(NOW), Some((46, 15)));
    assert!(hold.take_brake(), "before the first read");
    assert_eq!(hold.next_read(NOW + Duration::from_millis(99)), None);
    assert_eq!(hold.next_read(NOW + REPEAT_PERIOD), Some((46, 15)), "the reply is lost");
    assert!(hold.take_brake() && !hold.take_brake(), "again");
    let values = [9, 9, 9, 9, 9, 9, 9, 0, 1, 2, 3, 4, 5, 6, 7];
    assert_eq!(hold.frames(46, &values, &HeldTargets::default()), [(46, vec![1, 2, 3, 4, 5, 6, 7])]);
}

#[test]
fn a_joint_that_brakes_towards_the_target_of_a_stop_keeps_it() {
    let mut held = HeldTargets::default();
    let targets = [Some(0x0201), None, None, None, None, None, None];
    held.note_write(Intent::Stop, &targets);
    let mut values = values();
    values[14..16].copy_from_slice(&[1, 3]);
    let mut braking = hold(0b1, false);
    braking.next_read(NOW);
    assert_eq!(braking.frames(128, &values, &held), []);
    assert!(braking.is_over());
    values[14..16].copy_from_slice(&[1, 9]);
    let mut far = hold(0b1, false);
    far.next_read(NOW);
    assert_eq!(far.frames(128, &values, &held), [(128, vec![1, 9])], "it moves back from far away");
    held.note_write(Intent::Motion, &[None; 7]);
    values[14..16].copy_from_slice(&[1, 3]);
    let mut moving = hold(0b1, false);
    moving.next_read(NOW);
    assert_eq!(moving.frames(128, &values, &held), [(128, vec![1, 3])], "it moves elsewhere");
}

#[test]
fn what_a_client_held_after_the_read_was_sent_is_not_overwritten() {
    let mut held = HeldTargets::default();
    let mut hold = hold(0b11, false);
    hold.next_read(NOW);
    let targets = [Some(0x1614), None, None, None, None, None, None];
    held.note_write(Intent::Stop, &targets);
    hold.note_held(&targets);
    assert_eq!(hold.frames(128, &values(), &held), [(130, vec![23, 24])], "the other joint");
}
