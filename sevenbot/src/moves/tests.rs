//! Moves of a simulated arm under faults: refusals, error reports, and the values that are put back.

use std::error::Error;
use std::time::Duration;

use protocol_core::registers::Joint;
use protocol_core::registers::map::{LIMITS, MOTOR_STATE, SET_POINT_PERIOD, SPEED, limit, motor_state};

use super::{
    ConnectionLost, JointMove, MoveError, Observer, Pace, PaceBefore, ParkError, Player, Recorder, Stage,
};
use crate::arm::Arm;
use crate::fine_angle::FineAngle;
use crate::fine_state::FineTargets;
use crate::health::{Problem, ProblemKind};
use crate::recording::Recording;
use crate::simulated::{self, SharedSimulation, SimulationConfig};
use crate::units::{MoveTime, Speed};

/// A simulated arm whose motors drive it.
fn driven_arm() -> (Arm, SharedSimulation) {
    let (mut arm, simulation) = simulated::arm(SimulationConfig::default()).expect("an arm");
    arm.driven_joints().expect("it is driven");
    (arm, simulation)
}

fn set_fault(simulation: &SharedSimulation, fault: &str) {
    simulation.with(|arm| arm.set_fault(fault.parse().expect("a fault"), None));
}

#[test]
fn a_move_that_is_refused_leaves_the_speeds_and_durations() {
    let (mut arm, simulation) = driven_arm();
    arm.write_all_checked(&[(SPEED.address, vec![30; 7]), (LIMITS.address, vec![limit::LINKAGE])])
        .expect("taken");
    let base = [FineAngle::from_degrees(100.0), None, None, None, None, None, None];
    // Against the limit of the linkage.
    let folded = [None, FineAngle::from_degrees(0.0), FineAngle::from_degrees(0.0), None, None, None, None];
    let in_half_a_second = Pace { speed: None, time: MoveTime::from_steps(5) };
    let refused = |arm: &mut Arm, targets| {
        let error = JointMove::begin_at_pace(arm, targets, in_half_a_second).expect_err("refused");
        let pace = arm.read(SPEED.address, 14).expect("an answer");
        assert_eq!(pace, [[30; 7], [0; 7]].concat(), "{error}");
        error
    };
    assert!(matches!(refused(&mut arm, folded), MoveError::NotTaken(_)));
    set_fault(&simulation, "1=missing");
    arm.sleep(Duration::from_secs(1));
    assert!(matches!(refused(&mut arm, base), MoveError::Problems(_)));
}

#[test]
fn after_a_failed_move_the_speeds_are_put_back_when_the_other_joints_rest() {
    let (mut arm, simulation) = driven_arm();
    set_fault(&simulation, "1=stuck");
    let targets = [120.0, 130.0, 65.0, 90.0, 90.0, 90.0, 80.0].map(FineAngle::from_degrees);
    let before = PaceBefore::read(&mut arm, &targets).expect("an answer");
    let slowly = Pace { speed: Speed::from_steps(5), time: None };
    let begun = JointMove::begin_at_pace(&mut arm, targets, slowly).expect("taken");
    assert!(matches!(begun.finish(&mut arm, &mut ()), Err(MoveError::Problems(_))), "joint 1 is blocked");
    assert!(matches!(before.put_back(&mut arm), Err(MoveError::StillMoving { bits: 0b10, .. })));
    assert_eq!(before.wait_for_rest(&mut arm, &mut ()), Ok(()));
    assert_eq!(before.put_back(&mut arm), Ok(()));
    assert_eq!(arm.read(SPEED.address, 7), Ok(SPEED.default_bytes().to_vec()));
}

#[test]
fn without_supply_nothing_is_written_so_that_the_motors_stay_off_when_it_comes_back() {
    let (mut arm, simulation) = driven_arm();
    arm.write_motion(MOTOR_STATE.address, &[motor_state::DAMPING]).expect("a write");
    set_fault(&simulation, "supply=off");
    arm.sleep(Duration::from_secs(2));
    let none = Err(MoveError::Problems(vec![Problem::of_arm(ProblemKind::NoServoAnswers)]));
    assert_eq!(arm.engage_and_watch(), none);
    // With the effector, register 30, in the same frame.
    assert_eq!(arm.set_registers(MOTOR_STATE.address, &[motor_state::SERVO, 0], false), none);
    simulation.with(|arm| drop(arm.end_faults(None)));
    arm.sleep(Duration::from_secs(2));
    assert_eq!(arm.joints().map(|joints| joints.motor_state()), Ok(motor_state::DAMPING));
    assert_eq!(arm.engage_and_watch(), Ok(()));
}

fn act(simulation: &SharedSimulation, action: &str) {
    simulation.with(|arm| drop(arm.act(action.parse().expect("an action"))));
}

fn pose(degrees: [u8; 7]) -> FineTargets {
    degrees.map(|degrees| FineAngle::from_degrees(degrees.into()))
}

#[test]
fn a_park_that_fails_lets_no_joint_race() {
    let (mut arm, simulation) = driven_arm();
    let folded = pose([90, 90, 100, 90, 140, 90, 80]);
    JointMove::begin_fine(&mut arm, folded)
        .and_then(|there| there.finish(&mut arm, &mut ()))
        .expect("a pose");
    arm.write_checked(SPEED.address, &[0; 7]).expect("taken");
    set_fault(&simulation, "5=stuck");
    assert!(matches!(arm.park(None, &mut ()), Err(ParkError::Move(MoveError::Problems(_)))));
    let positions = |arm: &mut Arm| arm.joints().expect("an answer").positions();
    let before = positions(&mut arm);
    arm.sleep(Duration::from_secs(2));
    let after = positions(&mut arm);
    assert!(
        before.iter().zip(after).all(|(before, after)| before.abs_diff(after) <= 2),
        "{before:?} to {after:?}"
    );
    assert_eq!(arm.read(SPEED.address, 7), Ok(vec![0; 7]));
}

/// Carries out an action once, as soon as the motors are off.
struct WhenLetGo(SharedSimulation, Option<&'static str>);

impl Observer for WhenLetGo {
    fn pause(&mut self, arm: &mut Arm, time: Duration) {
        arm.sleep(time);
        if arm.joints().is_ok_and(|joints| !joints.is_driven())
            && let Some(action) = self.1.take()
        {
            act(&self.0, action);
        }
    }
}

#[test]
fn an_arm_is_not_parked_if_something_happens_while_it_is_watched() {
    for action in ["fault 3=missing", "fault supply=off", "restart", "power-cycle"] {
        let (mut arm, simulation) = driven_arm();
        let parked = arm.park(None, &mut WhenLetGo(simulation, Some(action)));
        assert!(matches!(parked, Err(ParkError::Move(_))), "{action}: {parked:?}");
    }
}

#[test]
fn a_servo_that_switches_itself_off_ends_a_move_and_an_older_alarm_does_not() {
    let (mut arm, simulation) = driven_arm();
    let slowly = Pace { speed: Speed::from_steps(5), time: None };
    let go = |arm: &mut Arm, degrees| {
        JointMove::begin_at_pace(arm, pose([90, degrees, 65, 90, 90, 90, 80]), slowly)
    };
    let begun = go(&mut arm, 110).expect("taken");
    arm.sleep(Duration::from_millis(500));
    act(&simulation, "trip 7");
    let Err(MoveError::Problems(problems)) = begun.finish(&mut arm, &mut ()) else { panic!("it is told") };
    assert!(problems.contains(&Problem::of_arm(ProblemKind::Overload)), "{problems:?}");
    let again = go(&mut arm, 100).and_then(|begun| begun.finish(&mut arm, &mut ()));
    assert!(again.is_ok(), "{again:?}");
}

#[test]
fn a_joint_that_is_dragged_away_does_not_hold() {
    let (hold, engage) = (|arm: &mut Arm| arm.hold_and_watch().map(drop), Arm::engage_and_watch);
    for (push, holds) in [("2=push=-300", true), ("2=push=-3000", false)] {
        for watch in [hold as fn(&mut Arm) -> Result<(), MoveError>, engage] {
            let (mut arm, simulation) = driven_arm();
            set_fault(&simulation, push);
            arm.sleep(Duration::from_millis(200));
            let held = watch(&mut arm);
            let text = held.as_ref().err().map(ToString::to_string).unwrap_or_default();
            assert_eq!(held.is_ok(), holds, "{push}: {text}");
            assert!(holds || text.starts_with("the arm does not hold: joint 2 is at 0°, not "), "{text}");
        }
    }
}

#[test]
fn a_joint_that_gives_way_gets_its_target_from_no_other_program() {
    let (mut arm, simulation) = driven_arm();
    simulation.with(|arm| arm.plant_mut().set_load(500));
    let level = [90, 90, 20, 90, 60, 90, 80].map(|degrees| FineAngle::from_degrees(degrees.into()));
    let blocked = JointMove::begin_fine(&mut arm, level).and_then(|there| there.finish(&mut arm, &mut ()));
    let Err(MoveError::Problems(problems)) = blocked else { panic!("{blocked:?}") };
    assert!(problems.iter().any(|problem| problem.kind == ProblemKind::Blocked), "{problems:?}");
    let sinking = arm.joints().expect("an answer");
    assert_eq!(arm.engage_and_watch(), Ok(()), "it holds once it has sunk far enough");
    assert!(arm.joints().expect("an answer").target(Joint::ALL[2]) > sinking.target(Joint::ALL[2]) + 3);
}

/// Interrupts the line to the arm during the playback, for this number of seconds.
struct Interruption(SharedSimulation, u64);

impl Observer for Interruption {
    fn progress(&mut self, stage: Stage, done: u64, _: u64) {
        if (stage, done) == (Stage::Playing, 50) {
            let (fault, duration) = ("line=loss=100%".parse().expect("a fault"), Duration::from_secs(self.1));
            self.0.with(|arm| arm.set_fault(fault, Some(duration.into())));
        }
    }
}

/// The arm after an interruption, and whether the player reported that it could not restore the speeds.
fn after_interruption(seconds: u64) -> (Arm, bool) {
    let text = "7bot-recording 1\n0 90 90 65 90 90 90 80 0\n4 130 90 65 90 90 90 80 0\n";
    let mut player = Player::new(&Recording::parse(text).expect("a recording"), 1.0);
    let (mut arm, simulation) = driven_arm();
    arm.write_checked(SPEED.address, &[30; 7]).expect("taken");
    let failed = player.play(&mut arm, 1, &mut Interruption(simulation.clone(), seconds));
    let error = failed.expect_err("the line was interrupted");
    assert!(error.is_connection_lost(), "{error}");
    simulation.with(|arm| drop(arm.end_faults(None)));
    (arm, player.has_left_pace())
}

#[test]
fn the_speeds_are_put_back_when_the_line_works_again() {
    let (mut arm, has_left_pace) = after_interruption(3);
    assert_eq!((has_left_pace, arm.read(SPEED.address, 7)), (false, Ok(vec![30; 7])));
    assert_eq!(arm.read(SET_POINT_PERIOD.address, 4), Ok(vec![0; 4]));
}

#[test]
fn what_a_player_cannot_put_back_the_next_move_does() {
    let (mut arm, has_left_pace) = after_interruption(3_600);
    assert_eq!((has_left_pace, arm.read(SPEED.address, 7)), (true, Ok(vec![0; 7])));
    arm.driven_joints().expect("it is driven");
    assert_eq!(arm.read(SPEED.address, 7), Ok(SPEED.default_bytes().to_vec()));
    assert_eq!(arm.read(SET_POINT_PERIOD.address, 4), Ok(vec![0; 4]));
}

#[test]
fn reports_from_before_the_recording_are_no_poses_of_it() -> Result<(), Box<dyn Error>> {
    let (mut arm, _) = simulated::arm(SimulationConfig::default())?;
    let content = arm.exact_positions()?;
    arm.with_reports(50, content, |arm| -> Result<(), MoveError> {
        arm.sleep(Duration::from_millis(500));
        // A read receives the reports that wait in the line.
        arm.positions()?;
        let begun = arm.now();
        let mut recorder = Recorder::begin(arm, 50, content)?;
        let first = recorder.next(arm, Duration::from_secs(1))?;
        assert!(first.is_some_and(|pose| pose.received > begun), "{first:?}");
        Ok(())
    })?;
    Ok(())
}
