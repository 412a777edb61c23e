//! `pose`: all seven joints to an angle each, and if asked until they are there.

use std::io::Write;
use std::thread::sleep;
use std::time::{Duration, Instant};

use sevenbot::arm::STATUS;
use sevenbot::map::{
    MISSING_SERVOS, MOTOR_STATE, MOVING_JOINTS, PRESENT_POSITION, SPEED, TARGET_POSITION, TIME, motor_state,
};
use sevenbot::units::move_duration;
use sevenbot::words::{joints, motor_state_word};
use sevenbot::{Angle, Arm, Joint, MoveTime, Snapshot, Span, Speed};

use super::all_taken;
use clap::{ArgAction, Args, value_parser};

use crate::failure::Failure;
use crate::session::Session;

/// Send all seven joints to a pose.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot pose 90 90 65 90 90 90 80               the standard pose
  sevenbot pose 120 90 65 90 90 90 80 --speed 30   at 57 degrees per second
  sevenbot pose 60 90 65 90 90 90 80 --time 20 --wait

Exit status 1 when the arm did not take the pose, or with --wait did not reach it.")]
pub(crate) struct PoseArgs {
    /// Angles of joint 1 to 7 in degrees, 0 to 180.
    #[arg(value_names = ["A1", "A2", "A3", "A4", "A5", "A6", "A7"], num_args = 7, required = true,
          action = ArgAction::Set,
          value_parser = value_parser!(u8).range(0..=180))]
    pub(crate) angles: Vec<u8>,
    /// Speed of all joints in steps of 1.9 degrees per second, 1 to 100; 0 is the motors' maximum.
    #[arg(long, value_name = "N", value_parser = value_parser!(u8).range(0..=100))]
    pub(crate) speed: Option<u8>,
    /// Duration of the move in steps of 100 ms, 0 to 100; sets the speeds to 0, or it would not count.
    #[arg(long, value_name = "N", conflicts_with = "speed", value_parser = value_parser!(u8).range(0..=100))]
    pub(crate) time: Option<u8>,
    /// Wait until the arm is there.
    #[arg(long)]
    pub(crate) wait: bool,
}

/// Time between two looks at a moving arm.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// What a move may take beyond twice its duration.
const MARGIN: Duration = Duration::from_secs(5);
/// How long a joint may take to follow a set-point that has arrived.
const SETTLE: Duration = Duration::from_secs(2);
/// A joint this near to its target is there: registers are whole degrees, servos have some play.
const NEAR_DEGREES: u8 = 2;

pub(crate) fn run(session: &mut Session, args: &PoseArgs) -> Result<(), Failure> {
    take(&mut session.connect()?, args, &mut anstream::stdout())
}

fn take(arm: &mut Arm, args: &PoseArgs, out: &mut impl Write) -> Result<(), Failure> {
    let state = arm.read_span(Span::of(&MOTOR_STATE))?.byte(&MOTOR_STATE);
    if state != motor_state::SERVO {
        let word = motor_state_word(state);
        let how = "`sevenbot set motor-state 1` makes it hold where it is";
        return Err(Failure::Arm(format!(
            "the arm's motors are in state {state}, {word}: {how}, and then move"
        )));
    }
    set_pace(arm, args)?;
    let plan = arm.read_span(Span::between(&SPEED, &PRESENT_POSITION))?;
    all_taken(&arm.write_checked(TARGET_POSITION.address, &args.angles)?)?;
    if !args.wait {
        return Ok(());
    }
    wait_until_still(arm, time_out(&plan, &args.angles))?;
    let there = settle(arm, &args.angles);
    let [a, b, c, d, e, f, g] = arm.positions()?.map(Angle::degrees);
    writeln!(out, "{a} {b} {c} {d} {e} {f} {g}")?;
    there
}

fn set_pace(arm: &mut Arm, args: &PoseArgs) -> Result<(), Failure> {
    let speed = args.speed.or(args.time.map(|_| Speed::MAXIMUM.steps()));
    if let Some(steps) = speed {
        all_taken(&arm.write_checked(SPEED.address, &[steps; 7])?)?;
    }
    if let Some(steps) = args.time {
        all_taken(&arm.write_checked(TIME.address, &[steps; 7])?)?;
    }
    Ok(())
}

/// Twice what the slowest joint needs from where it is, and a margin.
fn time_out(plan: &Snapshot, angles: &[u8]) -> Duration {
    let slowest = Joint::ALL.iter().zip(angles).map(|(&joint, &angle)| {
        let speed = Speed::from_steps(plan.at(SPEED.of(joint))).unwrap_or(Speed::MAXIMUM);
        let time = MoveTime::from_steps(plan.at(TIME.of(joint))).unwrap_or(MoveTime::NONE);
        move_duration(plan.at(PRESENT_POSITION.of(joint)).abs_diff(angle), speed, time)
    });
    slowest.max().unwrap_or_default() * 2 + MARGIN
}

/// Waits until no set-point moves any more, but for joints whose servo does not answer.
fn wait_until_still(arm: &mut Arm, patience: Duration) -> Result<(), Failure> {
    let deadline = Instant::now() + patience;
    loop {
        let status = arm.read_span(STATUS)?;
        let moving = status.byte(&MOVING_JOINTS) & !status.byte(&MISSING_SERVOS);
        if moving == 0 {
            return Ok(());
        }
        if Instant::now() >= deadline {
            let seconds = patience.as_secs();
            return Err(Failure::Arm(format!("still moving after {seconds} s: {}", joints(moving))));
        }
        sleep(LOOK_EVERY);
    }
}

/// Waits until the joints have followed their set-points; fails with those that have not.
fn settle(arm: &mut Arm, angles: &[u8]) -> Result<(), Failure> {
    let deadline = Instant::now() + SETTLE;
    loop {
        let positions = arm.positions()?.map(Angle::degrees);
        let pairs = positions.into_iter().zip(angles).zip(Joint::ALL);
        let far = pairs.filter(|((present, target), _)| present.abs_diff(**target) > NEAR_DEGREES);
        let far: Vec<String> = far
            .map(|((present, target), joint)| {
                format!("joint {} is at {present}°, not {target}°", joint.number())
            })
            .collect();
        if far.is_empty() {
            return Ok(());
        }
        if Instant::now() >= deadline {
            let missing = arm.read_span(STATUS)?.byte(&MISSING_SERVOS);
            let cause =
                if missing == 0 { String::new() } else { format!("; {} not answering", joints(missing)) };
            return Err(Failure::Arm(format!("the arm did not reach the pose: {}{cause}", far.join(", "))));
        }
        sleep(LOOK_EVERY);
    }
}
