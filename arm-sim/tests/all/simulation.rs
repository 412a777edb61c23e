//! The simulation with its own clock: its results do not depend on the pieces in which time passes. Also copies, settings and the
//! bytes of a host that sends too much.

use arm_sim::request::Request;
use arm_sim::{Duration, Joint, ServoFault, Simulation};
use protocol_core::registers::map::FEEDBACK_FREQUENCY;

const MILLI: Duration = Duration::from_millis(1);

const fn is_send<T: Send>() {}

const fn millis(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

/// An arm that reports at 50 Hz while a joint moves and a servo fails. Time passes in these pieces.
fn session(pieces: impl Iterator<Item = u64>) -> (Vec<u8>, Simulation) {
    let mut arm = Simulation::default();
    arm.send_request(&Request::Write { address: FEEDBACK_FREQUENCY.address, values: &[50] });
    for (number, piece) in pieces.enumerate() {
        arm.advance(millis(piece));
        if arm.now().as_micros() == 1_000_000 {
            arm.send_request(&Request::Write { address: 46, values: &[150] });
            arm.plant_mut().set_fault(Joint::ALL[3], Some(ServoFault::Garbled(3)));
        }
        assert!(number < 100_000);
    }
    (arm.take_received(), arm)
}

#[test]
fn the_result_does_not_depend_on_the_pieces_of_time() {
    let (whole, arm) = session([1_000, 4_000].into_iter());
    assert!(whole.len() > 200 * 14, "reports for five seconds: {}", whole.len());
    let (pieces, other) = session(std::iter::repeat_n(1, 5_000));
    assert_eq!(whole, pieces);
    assert_eq!(arm.plant().angle(Joint::ALL[0]), other.plant().angle(Joint::ALL[0]));
}

#[test]
fn a_copy_continues_as_the_original_does() {
    is_send::<Simulation>();
    let (_, mut arm) = session([1_000, 500].into_iter());
    let mut copy = arm.clone();
    arm.advance(millis(2_000));
    copy.advance(millis(2_000));
    assert_eq!(arm.take_received(), copy.take_received());
    assert_eq!(
        Joint::ALL.map(|joint| arm.plant().angle(joint)),
        Joint::ALL.map(|joint| copy.plant().angle(joint))
    );
}

#[test]
fn settings_outlive_the_power_and_belong_to_the_copy() {
    let mut arm = Simulation::default();
    let mut blank = arm.clone();
    arm.send_request(&Request::Write { address: 28, values: &[0] });
    arm.send_request(&Request::Write { address: 11, values: &[42] });
    arm.advance(millis(100));
    for arm in [&mut arm, &mut blank] {
        arm.power_cycle();
        arm.advance(millis(100));
    }
    assert_eq!((arm.registers().get(11), blank.registers().get(11)), (42, 0));
}

#[test]
fn all_bytes_of_a_host_that_sends_too_much_are_sent_in_the_end() {
    let mut arm = Simulation::default();
    arm.advance(millis(300));
    for _ in 0..1_000 {
        arm.send_request(&Request::Read { address: 54, count: 7 });
    }
    assert!(arm.advance_until(millis(3_000), |arm| arm.received().len() == 14_000));
    assert!(!arm.advance_until(MILLI, |arm| arm.received().len() > 14_000));
}
