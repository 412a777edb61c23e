//! What ends a move or a stream, with an arm of literal registers.

#![cfg(unix)]

use std::sync::{Arc, Mutex};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::fake::{execute, makers_arm, moving_registers, scripted_arm};
use protocol_core::request::Request;
use serialport::TTYPort;
use sevenbot::health::{MoveCheck, MoveCheckError, ProblemKind};
use sevenbot::map::{
    BLOCKED_JOINTS, EFFECTOR_TYPE, FRAMES_ACCEPTED, GRIP_LIMIT, LET_GO_JOINTS, LOAD, MISSING_SERVOS,
    MOTOR_STATE, SET_POINT_PERIOD, SUPPLY_LOST,
};
use sevenbot::moves::{JointMove, MoveError};
use sevenbot::stream::{SetPointStream, StreamOptions};
use sevenbot::{Arm, FineAngle, Joint};

type Registers = Arc<Mutex<[u8; 256]>>;

const ALL: u8 = 0x7F;

/// An arm with all blocks, and its registers. It counts the frames that it accepts.
fn arm() -> (Arm, Registers, TTYPort) {
    let registers = moving_registers();
    {
        let mut registers = registers.lock().unwrap();
        (registers[191], registers[192], registers[199]) = (1, 1, 1);
    }
    let shown = Arc::clone(&registers);
    let (port, held) = scripted_arm(move |_, request| {
        let mut registers = registers.lock().unwrap();
        let counter = usize::from(FRAMES_ACCEPTED.address);
        registers[counter] = registers[counter].wrapping_add(1);
        execute(&mut registers, request)
    });
    (Arm::open(&port, 115_200).unwrap(), shown, held)
}

fn set(registers: &Registers, row: sevenbot::Register, value: u8) {
    registers.lock().unwrap()[usize::from(row.address)] = value;
}

fn told(checked: Result<impl std::fmt::Debug, MoveCheckError>) -> Vec<(ProblemKind, Option<u8>)> {
    match checked {
        Err(MoveCheckError::Problems(problems)) => {
            problems.iter().map(|problem| (problem.kind, problem.joint.map(Joint::number))).collect()
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn d30_a_check_tells_what_ends_a_move_and_at_which_joint() {
    let (mut arm, registers, _held) = arm();
    let mut check = MoveCheck::begin(&mut arm, ALL).unwrap();
    assert_eq!(check.check(&mut arm).unwrap().moving, Some(0b100_0001));
    set(&registers, BLOCKED_JOINTS, 0b10);
    assert_eq!(told(check.check(&mut arm)), [(ProblemKind::Blocked, Some(2))]);
    set(&registers, LET_GO_JOINTS, 0b100);
    let both = [(ProblemKind::LetGo, Some(3)), (ProblemKind::Blocked, Some(2))];
    assert_eq!(told(check.check(&mut arm)), both);
    set(&registers, MISSING_SERVOS, ALL);
    set(&registers, SUPPLY_LOST, 1);
    let supply = [(ProblemKind::SupplyLost, None), (ProblemKind::NoServoAnswers, None)];
    assert_eq!(told(check.check(&mut arm)), supply);
}

#[test]
fn d27_a_gripper_that_holds_something_is_not_blocked() {
    let (mut arm, registers, _held) = arm();
    let mut check = MoveCheck::begin(&mut arm, ALL).unwrap();
    set(&registers, BLOCKED_JOINTS, 0b100_0000);
    assert_eq!(told(check.check(&mut arm)), [(ProblemKind::Blocked, Some(7))], "a suction cup");
    set(&registers, EFFECTOR_TYPE, 1);
    assert!(check.check(&mut arm).unwrap().is_gripping);
    set(&registers, GRIP_LIMIT, 40);
    let claw_load = usize::from(LOAD.of(Joint::ALL[6]));
    for (tenths_of_a_percent, word) in [(-200_i16, "holds something"), (199, "moving")] {
        registers.lock().unwrap()[claw_load..claw_load + 2]
            .copy_from_slice(&tenths_of_a_percent.to_le_bytes());
        let health = arm.health().unwrap();
        assert_eq!(health.problems(), []);
        assert_eq!(health.joints[6].word(true), word, "the claw presses with {tenths_of_a_percent}");
    }
}

#[test]
fn joints_that_are_not_driven_by_the_move_do_not_end_it() {
    let (mut arm, registers, _held) = arm();
    set(&registers, BLOCKED_JOINTS, 0b10);
    set(&registers, LET_GO_JOINTS, 0b100);
    set(&registers, MISSING_SERVOS, 0b1000);
    let mut check = MoveCheck::begin(&mut arm, 1).unwrap();
    assert_eq!(check.check(&mut arm).unwrap().missing, 0b1000);
}

#[test]
fn a_joint_that_was_blocked_before_may_try_again() {
    let (mut arm, registers, _held) = arm();
    set(&registers, BLOCKED_JOINTS, 0b10);
    let mut check = MoveCheck::begin(&mut arm, ALL).unwrap();
    check.check(&mut arm).expect("a point of a stream clears the bit only when the joint is free");
    set(&registers, BLOCKED_JOINTS, 0);
    check.check(&mut arm).expect("it is free");
    set(&registers, BLOCKED_JOINTS, 0b10);
    assert_eq!(told(check.check(&mut arm)), [(ProblemKind::Blocked, Some(2))]);
}

#[test]
fn a_restart_and_motors_that_go_off_end_a_move() {
    let (mut arm, registers, _held) = arm();
    let mut check = MoveCheck::begin(&mut arm, ALL).unwrap();
    set(&registers, FRAMES_ACCEPTED, 0);
    assert_eq!(told(check.check(&mut arm)), [(ProblemKind::Restarted, None)]);
    set(&registers, MOTOR_STATE, 2);
    assert_eq!(check.check(&mut arm).unwrap_err(), MoveCheckError::NotDriven { state: 2 });
}

#[test]
fn d28_a_move_of_a_joint_that_let_go_sends_nothing() {
    let (mut arm, registers, _held) = arm();
    let before = registers.lock().unwrap()[46..53].to_vec();
    set(&registers, LET_GO_JOINTS, 0b10);
    let refused = JointMove::begin(&mut arm, [Some(10); 7]).unwrap_err();
    assert!(refused.to_string().starts_with("joint 2 let go"), "{refused}");
    assert_eq!(registers.lock().unwrap()[46..53], before);
    let base_only = [Some(150), None, None, None, None, None, None];
    JointMove::begin(&mut arm, base_only).expect("the other joints can be moved");
}

#[test]
fn d27_a_wait_ends_when_its_joint_is_blocked() {
    let (mut arm, registers, _held) = arm();
    let base_only = [Some(150), None, None, None, None, None, None];
    let sent = JointMove::begin(&mut arm, base_only).unwrap();
    // The write has cleared the moving bits of the scripted arm.
    registers.lock().unwrap()[243] = 1;
    set(&registers, BLOCKED_JOINTS, 1);
    match sent.finish(&mut arm, &mut ()) {
        Err(MoveError::Problems(problems)) => assert_eq!(problems[0].kind, ProblemKind::Blocked),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_wait_tells_that_a_joint_got_another_target() {
    let base_only = [Some(150), None, None, None, None, None, None];
    let told = "; a stop, another program or a fault of a servo gave joint 1 another target";
    for (stopped, words) in [(true, told), (false, "")] {
        let (mut arm, registers, _held) = arm();
        let sent = JointMove::begin(&mut arm, base_only).unwrap();
        if stopped {
            registers.lock().unwrap()[46] = 115;
        }
        let error = sent.finish(&mut arm, &mut ()).unwrap_err();
        assert!(matches!(error, MoveError::NotReached { .. }), "{error:?}");
        let position = registers.lock().unwrap()[54];
        let wanted = format!("the arm did not reach the pose: joint 1 is at {position}°, not 150°{words}");
        assert_eq!(error.to_string(), wanted);
    }
}

/// Checks the stream until a check fails. Returns the error.
fn wait_for_problem(stream: &mut SetPointStream<'_>) -> MoveCheckError {
    let deadline = Instant::now() + Duration::from_secs(30);
    loop {
        if let Err(error) = stream.check() {
            return error;
        }
        assert!(Instant::now() < deadline, "no check tells anything");
        sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_stream_tells_a_silent_joint_and_a_restart() {
    let (mut arm, registers, _held) = arm();
    let mut stream = SetPointStream::open(&mut arm, StreamOptions::new(20).unwrap()).unwrap();
    set(&registers, MISSING_SERVOS, 0b10);
    let angle = FineAngle::from_hundredths(9_000);
    stream.send(&[angle, None, None, None, None, None, None]).unwrap();
    for _ in 0..50 {
        stream.check().expect("joint 2 got no point");
        sleep(Duration::from_millis(5));
    }
    stream.send(&[None, angle, None, None, None, None, None]).unwrap();
    let silent = wait_for_problem(&mut stream);
    assert_eq!(told(Err::<(), _>(silent)), [(ProblemKind::NoAnswer, Some(2))]);
    set(&registers, MISSING_SERVOS, 0);
    set(&registers, SET_POINT_PERIOD, 0);
    let restarted = wait_for_problem(&mut stream);
    assert_eq!(told(Err::<(), _>(restarted)), [(ProblemKind::Restarted, None)]);
}

#[test]
fn a_stream_tells_an_arm_that_does_not_answer_any_more() {
    let registers = moving_registers();
    registers.lock().unwrap()[191] = 1;
    let is_silent = Arc::new(Mutex::new(false));
    let silence = Arc::clone(&is_silent);
    let (port, _held) = scripted_arm(move |_, request| {
        let bytes = execute(&mut registers.lock().unwrap(), request);
        let is_read = matches!(request, Request::Read { .. });
        if is_read && *silence.lock().unwrap() { Vec::new() } else { bytes }
    });
    let mut arm = Arm::open(&port, 115_200).unwrap();
    let mut stream = SetPointStream::open(&mut arm, StreamOptions::new(20).unwrap()).unwrap();
    *is_silent.lock().unwrap() = true;
    assert!(matches!(wait_for_problem(&mut stream), MoveCheckError::Exchange(_)));
    *is_silent.lock().unwrap() = false;
}

#[test]
fn the_makers_firmware_tells_its_motor_state_only() {
    let (port, _held) = makers_arm();
    let mut arm = Arm::open(&port, 115_200).unwrap();
    let mut check = MoveCheck::begin(&mut arm, ALL).unwrap();
    assert_eq!(check.check(&mut arm).unwrap().moving, None);
    let health = arm.health().unwrap();
    assert_eq!((health.problems(), health.faults), (Vec::new(), None));
    arm.write(MOTOR_STATE.address, &[2]).unwrap();
    assert_eq!(check.check(&mut arm).unwrap_err(), MoveCheckError::NotDriven { state: 2 });
}
