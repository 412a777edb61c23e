//! An arm in virtual time, through the library.

use std::time::Duration;

use sevenbot::moves::JointMove;
use sevenbot::simulated::{self, SharedSimulation, SimulationConfig};
use sevenbot::stream::{SetPointStream, StreamOptions, StreamPace};
use sevenbot::{Angle, Arm, Error, FineAngle, Joint};

fn arm() -> (Arm, SharedSimulation) {
    simulated::arm(SimulationConfig::default()).unwrap()
}

#[test]
fn a_hold_stops_a_moving_arm_and_waits_in_virtual_time() {
    let (mut arm, simulation) = arm();
    arm.wait_until_settled().unwrap();
    arm.set_target(Joint::ALL[0], Angle::from_degrees(150).unwrap()).unwrap();
    arm.sleep(Duration::from_millis(200));
    let at = arm.hold().unwrap().targets()[0];
    assert!((91..149).contains(&at), "{at}");
    arm.sleep(Duration::from_secs(5));
    let angle = simulation.with(|simulation| simulation.plant().angle(Joint::ALL[0]));
    assert!((angle - i32::from(at) * 1_000).abs() < 1_500, "{angle}");
}

#[test]
fn a_move_in_whole_degrees_ends_at_rest() {
    for (degrees, speed) in [(31, 60), (32, 100), (150, 0), (70, 60), (119, 0)] {
        let (mut arm, simulation) = arm();
        arm.driven_joints().unwrap();
        arm.write_checked(sevenbot::map::SPEED.address, &[speed; 7]).unwrap();
        let sent = JointMove::begin(&mut arm, [Some(degrees), None, None, None, None, None, None]).unwrap();
        let reached = sent.finish(&mut arm, &mut ()).unwrap();
        let angle = || simulation.with(|simulation| simulation.plant().angle(Joint::ALL[0]));
        let at_end = angle();
        arm.sleep(Duration::from_secs(2));
        assert!((angle() - at_end).abs() < 200, "{degrees}: from {at_end} to {}", angle());
        let now = arm.positions().unwrap().map(Angle::degrees);
        assert!(reached[0].abs_diff(now[0]) == 0, "{degrees}: {} was told, and it is {}", reached[0], now[0]);
    }
}

#[test]
fn a_halted_arm_does_not_answer_and_the_time_out_is_virtual() {
    let (mut arm, simulation) = arm();
    simulation.with(sevenbot::simulated::Simulation::halt_controller);
    let start = arm.now();
    let error = arm.positions().unwrap_err();
    assert!(matches!(error, Error::NoAnswer { attempts: 3, .. }), "{error}");
    let took = arm.now() - start;
    assert!((1_500..1_600).contains(&took.as_millis()), "{took:?}");
}

#[test]
fn a_stream_and_its_watchdog_are_exact() {
    let (mut arm, simulation) = arm();
    arm.sleep(Duration::from_secs(1));
    let options = StreamOptions::new(20).unwrap();
    let mut stream = SetPointStream::open(&mut arm, options).unwrap();
    let mut pace = StreamPace::new(stream.arm().elapsed(), options.period());
    for hundredths in (9_000..10_000).step_by(20) {
        let wait = pace.due().saturating_sub(stream.arm().elapsed());
        stream.arm().sleep(wait);
        pace.take(stream.arm().elapsed());
        stream.send(&[FineAngle::from_hundredths(hundredths), None, None, None, None, None, None]).unwrap();
    }
    assert_eq!(pace.counts().late, 0);
    // The program hangs: the arm holds after 300 ms.
    simulation.with(|simulation| simulation.advance(arm_sim::Duration::from_millis(299)));
    assert_eq!(stream.arm().status().unwrap().unwrap().faults(), 0);
    simulation.with(|simulation| simulation.advance(arm_sim::Duration::from_millis(302)));
    assert_ne!(stream.arm().status().unwrap().unwrap().faults(), 0);
}
