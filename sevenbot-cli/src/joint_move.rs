//! Moves joints to targets and waits until they arrive.
//!
//! The arm's moving bits describe set-points, and a servo arrives later or never. So the wait has two parts: until no
//! set-point moves, and until the measured positions have settled.

use std::time::{Duration, Instant};

use sevenbot::fine::FineTargets;
use sevenbot::joints::{JointSnapshot, StepBaseError, frames_for};
use sevenbot::map::{PRESENT_POSITION, SPEED, TARGET_POSITION, TIME};
use sevenbot::register_text::{joints, motor_state_name};
use sevenbot::units::move_duration;
use sevenbot::{Arm, Joint, MoveTime, Snapshot, Span, Speed};

use crate::command_error::CommandError;
use crate::interrupt::Interrupt;
use crate::printer::note;
use crate::progress::Progress;
use crate::write_result::motors_obey;

/// Time between two reads of a moving arm.
const POLL_PERIOD: Duration = Duration::from_millis(50);
/// A move may take twice its duration, plus this.
const MARGIN: Duration = Duration::from_secs(5);
/// A joint has settled if its position has not changed for this time.
const STILL_TIME: Duration = Duration::from_millis(300);
/// Joints have this time to settle. A joint that oscillates never does.
const SETTLE_TIMEOUT: Duration = Duration::from_secs(2);
/// A joint this near to its target has arrived: positions are whole degrees.
const ARRIVED_DEGREES: u8 = 1;
/// A joint that settled this near to its target has reached it: servos have play.
const TOLERANCE_DEGREES: u8 = 2;

/// Targets in degrees, joint 1 first; `None` for joints that stay.
pub(crate) type Targets = [Option<u8>; 7];

/// The target after a relative step, in degrees. It may be out of range.
pub(crate) fn step_target(joints: &JointSnapshot, joint: Joint, degrees: i16) -> Result<i16, CommandError> {
    let base = joints.step_base(joint).map_err(|reason| {
        let advice = match reason {
            StepBaseError::Silent => "",
            StepBaseError::PowerUpTarget { .. } => "; `sevenbot stop` sets its target to its position",
        };
        CommandError::Arm(format!(
            "joint {} cannot make a step: {reason}{advice}; nothing was moved",
            joint.number()
        ))
    })?;
    Ok(i16::from(base).saturating_add(degrees))
}

/// The joints after start-up. Fails if the motors do not drive them.
pub(crate) fn driven_joints(arm: &mut Arm) -> Result<JointSnapshot, CommandError> {
    let joints = arm.wait_until_settled()?;
    if joints.is_driven() {
        return Ok(joints);
    }
    let state = joints.motor_state();
    let word = motor_state_name(state);
    Err(CommandError::Arm(format!(
        "the arm's motors are in state {state}, {word}: use `sevenbot state servo` first"
    )))
}

/// A move that was sent to the arm.
pub(crate) struct JointMove {
    targets: Targets,
    /// Speeds, durations and positions before the move.
    plan: Snapshot,
    start: Instant,
}

impl JointMove {
    /// Sends the targets to all joints at the same time.
    pub(crate) fn begin(arm: &mut Arm, targets: Targets) -> Result<Self, CommandError> {
        let plan = arm.read_span(Span::between(&SPEED, &PRESENT_POSITION))?;
        motors_obey(arm.write_all_checked(&frames_for(&TARGET_POSITION, &targets)))?;
        Ok(Self { targets, plan, start: Instant::now() })
    }

    /// As [`Self::begin`], in hundredths of a degree. An arm without the extended block takes the nearest whole degrees.
    pub(crate) fn begin_fine(arm: &mut Arm, targets: FineTargets) -> Result<Self, CommandError> {
        let whole = targets.map(|angle| angle.map(|angle| angle.nearest().degrees()));
        if targets.iter().flatten().all(|angle| angle.is_whole()) {
            return Self::begin(arm, whole);
        }
        if !arm.has_extended_block()? {
            note("this arm takes whole degrees: each joint goes to the nearest one");
            return Self::begin(arm, whole);
        }
        let plan = arm.read_span(Span::between(&SPEED, &PRESENT_POSITION))?;
        motors_obey(arm.set_fine_targets_checked(&targets))?;
        Ok(Self { targets: whole, plan, start: Instant::now() })
    }

    /// Waits until all joints have arrived. Returns their positions.
    pub(crate) fn finish(&self, arm: &mut Arm, interrupt: Interrupt) -> Result<[u8; 7], CommandError> {
        let progress = Progress::new(self.degrees_left(&self.plan.joints(&PRESENT_POSITION)), "degrees");
        self.wait_until_still(arm, interrupt, &progress)?;
        progress.say("settling");
        self.settle(arm, interrupt, &progress)
    }

    /// The duration of the slowest joint.
    fn duration(&self) -> Duration {
        let durations = self.goals().map(|(joint, goal)| {
            let speed = Speed::from_steps(self.plan.at(SPEED.of(joint))).unwrap_or(Speed::MAXIMUM);
            let time = MoveTime::from_steps(self.plan.at(TIME.of(joint))).unwrap_or(MoveTime::NONE);
            move_duration(self.plan.at(PRESENT_POSITION.of(joint)).abs_diff(goal), speed, time)
        });
        durations.max().unwrap_or_default()
    }

    fn timeout(&self) -> Duration {
        self.duration() * 2 + MARGIN
    }

    fn wait_until_still(
        &self,
        arm: &mut Arm,
        interrupt: Interrupt,
        progress: &Progress,
    ) -> Result<(), CommandError> {
        let timeout = self.timeout();
        loop {
            let moving = self.moving(arm)?;
            if moving == 0 {
                return Ok(());
            }
            if self.start.elapsed() >= timeout {
                let seconds = timeout.as_secs();
                return Err(CommandError::Arm(format!("still moving after {seconds} s: {}", joints(moving))));
            }
            progress.set(self.degrees_done(&positions(arm)?));
            interrupt.sleep(POLL_PERIOD)?;
        }
    }

    /// The joints of this move whose set-point moves, without those whose servo does not answer.
    fn moving(&self, arm: &mut Arm) -> Result<u8, CommandError> {
        let ours = self.goals().fold(0, |bits, (joint, _)| bits | joint.bit());
        if let Some(status) = arm.status()? {
            return Ok(status.moving() & !status.missing() & ours);
        }
        // The maker's firmware has no moving bits: take the joints away from their targets, for the duration of the
        // move.
        let away = self.away(&positions(arm)?, ARRIVED_DEGREES);
        let is_due = self.start.elapsed() >= self.duration();
        Ok(if is_due { 0 } else { away.iter().fold(0, |bits, (joint, ..)| bits | joint.bit()) })
    }

    /// Waits until the joints have settled. Fails if one has not reached its target.
    fn settle(
        &self,
        arm: &mut Arm,
        interrupt: Interrupt,
        progress: &Progress,
    ) -> Result<[u8; 7], CommandError> {
        let mut last = positions(arm)?;
        let start = Instant::now();
        let mut changed = start;
        // Without moving bits the joints may still be on their way: their duration is only an estimate.
        let timeout = if arm.identity().has_status_block() { SETTLE_TIMEOUT } else { self.timeout() };
        while !self.away(&last, ARRIVED_DEGREES).is_empty()
            && changed.elapsed() < STILL_TIME
            && start.elapsed() < timeout
        {
            interrupt.sleep(POLL_PERIOD)?;
            let present = positions(arm)?;
            if present != last {
                changed = Instant::now();
            }
            last = present;
            progress.set(self.degrees_done(&last));
        }
        match self.away(&last, TOLERANCE_DEGREES).as_slice() {
            [] => Ok(last),
            away => Err(self.not_reached(arm, away)?),
        }
    }

    fn not_reached(&self, arm: &mut Arm, away: &[(Joint, u8, u8)]) -> Result<CommandError, CommandError> {
        driven_joints(arm)?;
        let words: Vec<String> = away
            .iter()
            .map(|(joint, is, goal)| format!("joint {} is at {is}°, not {goal}°", joint.number()))
            .collect();
        let missing = arm.status()?.map_or(0, |status| status.missing());
        let cause = if missing == 0 { String::new() } else { format!("; {} not answering", joints(missing)) };
        Ok(CommandError::Arm(format!("the arm did not reach the pose: {}{cause}", words.join(", "))))
    }

    fn goals(&self) -> impl Iterator<Item = (Joint, u8)> {
        Joint::ALL.into_iter().zip(self.targets).filter_map(|(joint, goal)| Some((joint, goal?)))
    }

    /// The joints more than `degrees` from their targets: joint, position, target.
    fn away(&self, present: &[u8; 7], degrees: u8) -> Vec<(Joint, u8, u8)> {
        let pairs = Joint::ALL.into_iter().zip(present).zip(self.targets);
        let away = pairs.filter_map(|((joint, &is), goal)| Some((joint, is, goal?)));
        away.filter(|(_, is, goal)| is.abs_diff(*goal) > degrees).collect()
    }

    /// The degrees left, summed over all joints.
    fn degrees_left(&self, present: &[u8; 7]) -> u64 {
        self.away(present, 0).iter().map(|(_, is, goal)| u64::from(is.abs_diff(*goal))).sum()
    }

    fn degrees_done(&self, present: &[u8; 7]) -> u64 {
        let total = self.degrees_left(&self.plan.joints(&PRESENT_POSITION));
        total.saturating_sub(self.degrees_left(present))
    }
}

fn positions(arm: &mut Arm) -> Result<[u8; 7], CommandError> {
    Ok(arm.read_span(Span::of(&PRESENT_POSITION))?.joints(&PRESENT_POSITION))
}
