use motion_core::servo_bus::frame::{self, ServoFrameBuffer};

use super::*;

const JOINT: Joint = Joint::ALL[5];
const UNTIL_DOUBT: Duration = Duration::from_millis(70);

fn at_ms(millis: u64) -> Instant {
    Instant::from_micros(millis * 1_000)
}

/// The servo is asked, and does not answer.
fn fails(replies: &mut ServoReplies, millis: u64) {
    replies.asked(at_ms(millis), JOINT, 10, true);
}

/// The servo is asked, and answers that its torque is on.
fn is_on(replies: &mut ServoReplies, millis: u64) {
    has(replies, millis, Torque::On);
}

/// The servo is asked, and answers that it has this torque.
fn has(replies: &mut ServoReplies, millis: u64, torque: Torque) {
    replies.asked(at_ms(millis), JOINT, 24, true);
    let mut params = [0; 24];
    params[0] = TorqueCodes::default().code(torque);
    let mut answer = ServoFrameBuffer::new();
    frame::status(&mut answer, JOINT.index(), 0, &params);
    replies.received(at_ms(millis + 1), &answer);
}

/// The servo is asked, and answers with this position in counts.
fn stands(replies: &mut ServoReplies, millis: u64, counts: u16) {
    replies.asked(at_ms(millis), JOINT, 8, true);
    let [high, low] = counts.to_be_bytes();
    let mut answer = ServoFrameBuffer::new();
    frame::status(&mut answer, JOINT.index(), 0, &[high, low, 0, 0, 0, 0, 0, 0]);
    replies.received(at_ms(millis + 1), &answer);
}

#[test]
fn a_set_point_may_move_between_all_doubts_since_the_last_goal() {
    let mut replies = ServoReplies::new(TorqueCodes::default());
    let ahead = |replies: &mut ServoReplies, millis| {
        replies.take_trusted_time(JOINT, at_ms(millis), UNTIL_DOUBT).as_micros() / 1_000
    };
    is_on(&mut replies, 0);
    assert_eq!(ahead(&mut replies, 3), 70 + 3);
    fails(&mut replies, 10);
    is_on(&mut replies, 80);
    assert_eq!(ahead(&mut replies, 85), 70 + 4, "one doubt");
    fails(&mut replies, 90);
    is_on(&mut replies, 160);
    fails(&mut replies, 170);
    is_on(&mut replies, 240);
    assert_eq!(ahead(&mut replies, 245), 2 * 70 + 4, "two doubts without a goal between them");
    assert_eq!(ahead(&mut replies, 255), 70 + 14);
}

#[test]
fn a_servo_that_answers_while_another_is_asked_tells_nothing() {
    let mut replies = ServoReplies::new(TorqueCodes::default());
    is_on(&mut replies, 0);
    fails(&mut replies, 10);
    replies.asked(at_ms(20), Joint::ALL[0], 24, true);
    let mut late = ServoFrameBuffer::new();
    frame::status(&mut late, JOINT.index(), 0, &[0; 10]);
    replies.received(at_ms(21), &late);
    assert_eq!(replies.unanswered(JOINT), 1);
}

#[test]
fn lost_torque_counts_until_the_joint_is_given_torque_also_if_a_goal_switched_it_on() {
    let mut replies = ServoReplies::new(TorqueCodes::default());
    is_on(&mut replies, 0);
    has(&mut replies, 10, Torque::Damping);
    is_on(&mut replies, 20);
    has(&mut replies, 30, Torque::Damping);
    assert!(!replies.was_lost(JOINT) && replies.was_read_off(JOINT), "one reading may be false");
    has(&mut replies, 40, Torque::Damping);
    is_on(&mut replies, 50);
    assert!(replies.was_lost(JOINT) && !replies.was_read_off(JOINT));
    replies.forget_doubt(JOINT);
    assert!(!replies.was_lost(JOINT));
}

#[test]
fn a_servo_that_answers_once_after_each_silence_may_still_be_driven_without_torque() {
    let mut replies = ServoReplies::new(TorqueCodes::default());
    is_on(&mut replies, 0);
    for start in (10..500).step_by(100) {
        [0, 10, 20].into_iter().for_each(|millis| fails(&mut replies, start + millis));
        has(&mut replies, start + 30, Torque::Damping);
    }
    let has_outage_after = |answers: u64| {
        let mut replies = replies.clone();
        (0..answers).for_each(|n| has(&mut replies, 600 + n, Torque::Damping));
        [700, 710, 1_720].into_iter().for_each(|millis| fails(&mut replies, millis));
        replies.was_outage()
    };
    assert_eq!([0, 1, 2].map(has_outage_after), [true, true, false]);
}

#[test]
fn the_next_goal_may_follow_from_each_position_since_the_last_goal() {
    let mut replies = ServoReplies::new(TorqueCodes::default());
    let mut measured = |millis, position: u16| {
        stands(&mut replies, millis, position);
        replies.positions(JOINT).collect::<Vec<_>>()
    };
    measured(0, 500);
    measured(10, 466);
    assert_eq!(measured(20, 480), [466, 500]);
    replies.goal_is_sent(JOINT);
    stands(&mut replies, 30, 409);
    let positions = |replies: &ServoReplies| replies.positions(JOINT).collect::<Vec<_>>();
    assert_eq!(positions(&replies), [409, 409, 466, 500], "they may have come too late for the last goal");
    [(); 2].into_iter().for_each(|()| replies.goal_is_sent(JOINT));
    assert_eq!(positions(&replies), [409, 409], "none is newer");
}

#[test]
fn a_driven_servo_is_doubtful_after_a_silence_until_its_torque_is_read() {
    let mut replies = ServoReplies::new(TorqueCodes::default());
    is_on(&mut replies, 0);
    fails(&mut replies, 10);
    assert!(!replies.is_doubtful(JOINT), "the reply may be on its way");
    fails(&mut replies, 20);
    assert!(replies.is_doubtful(JOINT) && replies.unanswered(JOINT) == 2);
    is_on(&mut replies, 30);
    assert!(!replies.is_doubtful(JOINT));
    [40, 50].into_iter().for_each(|millis| has(&mut replies, millis, Torque::Damping));
    fails(&mut replies, 60);
    fails(&mut replies, 70);
    assert!(!replies.is_doubtful(JOINT), "it was read off twice, so it is not driven");
}

#[test]
fn an_outage_begins_when_all_driven_servos_are_silent_for_a_second_and_ends_with_torque() {
    let mut replies = ServoReplies::new(TorqueCodes::default());
    is_on(&mut replies, 0);
    [10, 20, 900].into_iter().for_each(|millis| fails(&mut replies, millis));
    assert!(!replies.was_outage());
    fails(&mut replies, 911);
    assert!(replies.was_outage());
    has(&mut replies, 1_200, Torque::Damping);
    assert!(replies.was_outage() && replies.was_silent_for_a_second(JOINT, at_ms(1_300)));
    is_on(&mut replies, 1_210);
    assert!(!replies.was_outage());
    assert!(!replies.was_silent_for_a_second(JOINT, at_ms(4_300)), "long ago");
}
