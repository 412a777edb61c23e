use super::*;
use crate::servo_bus::frame::{error, status};

const J3: Joint = Joint::ALL[2];
const GUARD: Duration = Duration::from_micros(100);

fn at(micros: u64) -> Instant {
    Instant::from_micros(micros)
}

fn bus() -> Bus {
    Bus::new(1_000_000, Duration::from_millis(3), GUARD, TorqueCodes::default())
}

/// May a read be sent?
fn is_idle(bus: &Bus, now: Instant) -> bool {
    bus.is_free(now) && !bus.is_asking()
}

fn reading() -> Reading {
    Reading { position_counts: 500, speed: 0, load: 0, voltage_decivolts: 74, temperature_celsius: 30 }
}

fn answer_of(id: u8, error: u8) -> Vec<u8> {
    let mut buffer = ServoFrameBuffer::new();
    status(&mut buffer, id, error, &reading().to_bytes());
    buffer.to_vec()
}

fn measured(alarms: u8) -> Option<Outcome> {
    Some(Outcome::Measured { joint: J3, answer: answer_with(alarms), is_timely: true })
}

/// The outcome without the time that the answer took.
fn without_time(bus: &mut Bus, now: Instant) -> Option<Outcome> {
    let mut outcome = bus.poll(now);
    if let Some(Outcome::Measured { answer, .. }) = &mut outcome {
        answer.answer_micros = 0;
    }
    outcome
}

fn answer_with(alarms: u8) -> Answer {
    Answer { reading: reading(), alarms, torque: None, answer_micros: 0 }
}

#[test]
fn a_servo_answers_a_read() {
    let mut bus = bus();
    bus.ask(at(0), J3, Question::Reading);
    assert_eq!(bus.frame(), [0xFF, 0xFF, 2, 4, 2, 56, 8, 0xB7]);
    assert!(!is_idle(&bus, at(1)));
    let answer = answer_of(2, error::OVERLOAD);
    bus.bytes(at(200), &answer[..5]);
    assert_eq!(bus.poll(at(200)), None);
    bus.bytes(at(300), &answer[5..]);
    assert_eq!(without_time(&mut bus, at(300)), measured(error::OVERLOAD));
    assert!(!is_idle(&bus, at(399)) && is_idle(&bus, at(400)), "the guard time after the answer");
}

#[test]
fn the_longest_answer_time_of_each_servo_is_kept() {
    let mut bus = bus();
    for (start, answered, answer_micros) in [(0, 600, 520), (10_000, 10_900, 820), (20_000, 20_700, 620)] {
        bus.ask(at(start), J3, Question::Reading);
        bus.bytes(at(answered), &answer_of(2, 0));
        let answer = Answer { answer_micros, ..answer_with(0) };
        assert_eq!(bus.poll(at(answered)), Some(Outcome::Measured { joint: J3, answer, is_timely: true }));
    }
    bus.ask(at(30_000), Joint::ALL[0], Question::Reading);
    assert_eq!(bus.poll(at(33_080)), Some(Outcome::Failed { joint: Joint::ALL[0] }));
    assert_eq!(bus.take_longest_answers(), [0, 0, 820, 0, 0, 0, 0], "the read takes 80 us");
    assert_eq!(bus.take_longest_answers(), [0; JOINTS], "reset by the call");
}

#[test]
fn no_answer_is_a_failure_after_the_timeout() {
    let mut bus = bus();
    bus.ask(at(0), J3, Question::Reading);
    assert_eq!(bus.deadline(at(0)), Some(at(3_080)), "eight bytes and the timeout");
    assert_eq!(bus.poll(at(3_079)), None);
    assert_eq!(bus.poll(at(3_080)), Some(Outcome::Failed { joint: J3 }));
    assert_eq!(bus.poll(at(3_081)), None, "reported once");
}

#[test]
fn echo_noise_and_answers_of_other_servos_are_dropped() {
    let mut bus = bus();
    bus.ask(at(0), J3, Question::Reading);
    let echo = bus.frame().to_vec();
    bus.bytes(at(200), &echo);
    bus.bytes(at(300), &[0xFF, 0x00, 0xFF, 0xFF]);
    bus.bytes(at(400), &answer_of(1, 0));
    let mut damaged = answer_of(2, 0);
    damaged[6] ^= 1;
    bus.bytes(at(500), &damaged);
    assert_eq!(bus.poll(at(500)), None);
    bus.bytes(at(600), &answer_of(2, 0));
    assert_eq!(without_time(&mut bus, at(600)), measured(0));
}

#[test]
fn an_answer_with_a_damaged_byte_fails() {
    let answer = answer_of(2, 0);
    for at_byte in 0..=answer.len() {
        let mut bus = bus();
        bus.ask(at(0), J3, Question::Reading);
        let echo = bus.frame().to_vec();
        bus.bytes(at(80), &echo);
        let (before, behind) = answer.split_at(at_byte);
        bus.bytes(at(200), before);
        bus.damaged_byte(at(200));
        bus.bytes(at(200), behind);
        let is_whole = before.is_empty() || behind.is_empty();
        assert_eq!(
            without_time(&mut bus, at(200)),
            measured(0).filter(|_| is_whole),
            "damage before byte {at_byte}"
        );
        if !is_whole {
            assert_eq!(bus.poll(at(3_079)), None);
            assert_eq!(bus.poll(at(3_080)), Some(Outcome::Failed { joint: J3 }));
        }
    }
}

#[test]
fn a_damaged_byte_keeps_the_guard_time() {
    let mut bus = bus();
    bus.damaged_byte(at(1_000));
    assert!(!bus.is_free(at(1_099)) && bus.is_free(at(1_100)));
}

#[test]
fn noise_delays_a_frame_by_a_millisecond_at_most() {
    let mut bus = bus();
    bus.set_torque(at(0), [(J3, Torque::Damping)].into_iter());
    let free_at = 100 + 10 * u64::try_from(bus.frame().len()).unwrap();
    assert_eq!(bus.deadline(at(0)), Some(at(free_at)));
    for now in (free_at..free_at + 1_000).step_by(50) {
        bus.bytes(at(now), &[0x55]);
        assert!(!bus.is_free(at(now)), "{now}");
    }
    assert!(bus.is_free(at(free_at + 1_000)));
}

#[test]
fn a_late_answer_of_another_servo_is_dropped() {
    let mut bus = bus();
    bus.ask(at(0), Joint::ALL[1], Question::Reading);
    assert!(bus.poll(at(4_000)).is_some());
    bus.bytes(at(4_000), &answer_of(1, 0));
    assert!(!is_idle(&bus, at(4_099)), "the servo may still drive the line");
    bus.ask(at(4_100), J3, Question::Reading);
    assert_eq!(bus.poll(at(4_101)), None, "the decoder is cleared before a read");
    bus.bytes(at(4_102), &answer_of(1, 0));
    assert_eq!(bus.poll(at(4_102)), None, "an answer of another servo");
}

#[test]
fn a_late_answer_of_the_same_servo_is_recognised_by_its_length() {
    let mut bus = bus();
    bus.ask(at(0), J3, Question::Reading);
    assert_eq!(bus.poll(at(4_000)), Some(Outcome::Failed { joint: J3 }));
    bus.ask(at(4_000), J3, Question::Reading);
    assert_eq!(bus.frame()[6], 9, "one more register");
    bus.bytes(at(4_300), &answer_of(2, 0));
    assert_eq!(bus.poll(at(4_300)), None, "the answer to the first read");
    let mut longer = ServoFrameBuffer::new();
    status(&mut longer, 2, 0, &[reading().to_bytes().as_slice(), &[0]].concat());
    bus.bytes(at(4_400), &longer);
    assert_eq!(without_time(&mut bus, at(4_400)), measured(0));
}

#[test]
fn an_answer_with_an_invalid_position_is_a_failure() {
    let mut bus = bus();
    bus.ask(at(0), J3, Question::Reading);
    let mut buffer = ServoFrameBuffer::new();
    status(&mut buffer, 2, 0, &[0xFF; 8]);
    bus.bytes(at(100), &buffer);
    assert_eq!(bus.poll(at(100)), None);
    assert_eq!(bus.poll(at(9_000)), Some(Outcome::Failed { joint: J3 }));
}

#[test]
fn all_goals_are_sent_in_one_frame() {
    let mut bus = bus();
    bus.set_goals(at(0), Joint::ALL.into_iter().map(|joint| (joint, 511 + u16::from(joint.index()))));
    assert_eq!(bus.frame().len(), 57);
    assert_eq!(bus.frame()[..14], [0xFF, 0xFF, 0xFE, 53, 0x83, 42, 6, 0, 1, 0xFF, 0, 10, 0, 0]);
    assert_eq!(bus.deadline(at(0)), Some(at(670)), "570 us on the wire, then the guard time");
    assert!(!is_idle(&bus, at(669)) && is_idle(&bus, at(670)));
}

#[test]
fn the_bus_is_busy_for_as_long_as_its_rate_requires() {
    let mut bus = Bus::new(115_200, Duration::from_millis(3), GUARD, TorqueCodes::default());
    bus.set_goals(at(0), Joint::ALL.into_iter().map(|joint| (joint, 511)));
    assert_eq!(bus.frame().len(), 57);
    assert_eq!(bus.deadline(at(0)), Some(at(5_049)), "4.95 ms on the wire, then the guard time");
    assert!(!bus.is_free(at(5_048)) && bus.is_free(at(5_049)));
    bus.ask(at(10_000), J3, Question::Reading);
    assert_eq!(bus.deadline(at(10_000)), Some(at(13_695)), "eight bytes take 0.695 ms");
}

#[test]
fn a_torque_frame_names_the_joints_given_and_uses_the_table_of_the_arm() {
    let mut bus = Bus::new(1_000_000, Duration::ZERO, GUARD, TorqueCodes::FreeOnDamping);
    bus.set_torque(at(0), [(J3, Torque::Free), (Joint::ALL[4], Torque::Damping)].into_iter());
    assert_eq!(bus.frame()[4..11], [0x83, 40, 1, 2, 0, 4, 2]);
}

#[test]
fn the_cycle_is_converted_to_milliseconds() {
    assert_eq!(u64::from(cycle_in_millis()) * 1_000, CYCLE.as_micros());
}

#[test]
fn goals_are_sent_while_an_answer_is_delayed() {
    let mut bus = bus();
    bus.set_answer_delay(Duration::from_millis(20));
    bus.ask(at(0), J3, Question::Reading);
    assert_eq!(bus.deadline(at(0)), Some(at(3_080)), "the servo may send until then");
    assert!(!bus.is_free(at(3_079)) && bus.is_free(at(3_080)) && !is_idle(&bus, at(3_080)));
    bus.set_goals(at(10_000), [(J3, 5)].into_iter());
    assert_eq!(bus.deadline(at(10_000)), Some(at(10_150 + 100)), "15 bytes and the guard time");
    assert_eq!(bus.poll(at(10_000)), None);
    bus.bytes(at(10_010), &answer_of(2, 0));
    assert_eq!(without_time(&mut bus, at(10_010)), measured(0));
    assert!(!is_idle(&bus, at(10_249)) && is_idle(&bus, at(10_250)), "the goals are still on the wire");
    assert_eq!(bus.deadline(at(10_250)), None);
    bus.ask(at(20_000), J3, Question::Reading);
    assert_eq!(bus.deadline(at(30_000)), Some(at(43_080)));
    assert_eq!(bus.poll(at(43_079)), None);
    assert_eq!(bus.poll(at(43_080)), Some(Outcome::Failed { joint: J3 }));
}

#[test]
fn an_answer_that_is_processed_after_the_timeout_is_not_timely() {
    for (taken_at, is_timely) in [(13_080, true), (13_081, false), (2_000_000, false)] {
        let mut bus = bus();
        bus.ask(at(0), J3, Question::Reading);
        bus.bytes(at(taken_at), &answer_of(2, 0));
        let outcome = Outcome::Measured { joint: J3, answer: answer_with(0), is_timely };
        assert_eq!(without_time(&mut bus, at(taken_at)), Some(outcome), "{taken_at}");
    }
}
