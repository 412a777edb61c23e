//! Moves joints to targets and waits until they arrive.
//!
//! The arm's moving bits describe set-points, and a servo arrives later or never. So the wait has two parts: until no
//! set-point moves, and until the measured positions have settled.

use std::time::{Duration, Instant};

use protocol_core::registers::Joint;
use protocol_core::registers::map::{PRESENT_POSITION, SPEED, TARGET_POSITION, TIME};

use super::error::MoveError;
use super::observer::{Observer, Stage};
use super::pace::{Pace, PaceBefore};
use crate::arm::Arm;
use crate::error::Error;
use crate::fine_state::FineTargets;
use crate::health::{MoveCheck, MoveCheckError, MoveState, Problem, ProblemKind};
use crate::joints::{JointSnapshot, bits, frames_for, joints_of};
use crate::units::{MoveTime, Speed, move_duration};
use host_link::{Snapshot, Span};

/// Time between two reads of a moving arm.
const POLL_PERIOD: Duration = Duration::from_millis(50);
/// A move may take twice its duration, plus this.
const MARGIN: Duration = Duration::from_secs(5);
/// A joint has settled if its position has not changed for this time.
const STILL_TIME: Duration = Duration::from_millis(300);
/// Joints have this time to settle. A joint that oscillates never does.
const SETTLE_TIMEOUT: Duration = Duration::from_secs(2);
/// A joint that is slower than this rests: 1 degree/s, in tenths.
const STILL_VELOCITY: u16 = 10;
/// A joint this near to its target has arrived: positions are whole degrees.
const ARRIVED_DEGREES: u8 = 1;
/// A joint that settled this near to its target has reached it: servos have play.
const TOLERANCE_DEGREES: u8 = 2;

const RESTARTED: Problem = Problem::of_arm(ProblemKind::Restarted);

/// Targets in degrees, joint 1 first; `None` for joints that stay.
pub type Targets = [Option<u8>; 7];

impl Arm {
    /// The joints after start-up: [`Arm::wait_until_settled`]. If the motors drive them, ends a stream whose program is gone:
    /// [`Arm::end_abandoned_stream`].
    ///
    /// # Errors
    /// [`MoveError::NotDriven`] if the motors do not drive the joints, [`MoveError::Problems`] if a lost supply is the reason,
    /// and the errors of [`Arm::read`] and [`Arm::end_abandoned_stream`].
    pub fn driven_joints(&mut self) -> Result<JointSnapshot, MoveError> {
        let joints = self.wait_until_settled()?;
        if joints.is_driven() {
            self.end_abandoned_stream()?;
            Ok(joints)
        } else if self.health()?.is_supply_lost == Some(true) {
            Err(MoveError::Problems(vec![Problem::of_arm(ProblemKind::SupplyLost)]))
        } else {
            Err(MoveError::NotDriven { state: joints.motor_state() })
        }
    }
}

/// A move that was sent to the arm.
///
/// ```
/// use sevenbot::moves::JointMove;
/// use sevenbot::simulated::{self, SimulationConfig};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let (mut arm, _) = simulated::arm(SimulationConfig::default())?;
/// arm.driven_joints()?;
/// let there = JointMove::begin(&mut arm, [Some(120), None, None, None, None, None, None])?;
/// assert!(there.finish(&mut arm, &mut ())?[0] >= 119, "within a degree");
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct JointMove {
    targets: Targets,
    is_rounded: bool,
    /// A joint this near to its target, in whole degrees, needs no more time to settle. 0 for targets in hundredths: one degree
    /// between rounded angles can be nearly two degrees.
    arrived: u8,
    /// Speeds, durations and positions before the move.
    plan: Snapshot,
    check: MoveCheck,
    start: Instant,
}

impl JointMove {
    /// Sends the targets, and verifies that the arm took them. Joints with neighbouring numbers start together.
    ///
    /// # Errors
    /// The motors are off, or a joint with a target cannot be driven now ([`MoveError::Problems`]): nothing was sent. Or the arm
    /// does not take the targets or carry them out, another program stopped it, or an exchange failed.
    pub fn begin(arm: &mut Arm, targets: Targets) -> Result<Self, MoveError> {
        let check = MoveCheck::begin(arm, joints_of(&targets))?;
        let plan = arm.read_span(Span::between(&SPEED, &PRESENT_POSITION))?;
        arm.write_all_checked(&frames_for(&TARGET_POSITION, &targets)).map_err(MoveError::of_motion)?;
        Self::sent(arm, targets, ARRIVED_DEGREES, plan, check)
    }

    /// As [`Self::begin`], in hundredths of a degree. An arm without the extended block takes the nearest whole degrees.
    ///
    /// # Errors
    /// As [`JointMove::begin`].
    pub fn begin_fine(arm: &mut Arm, targets: FineTargets) -> Result<Self, MoveError> {
        let whole = targets.map(|angle| angle.map(|angle| angle.nearest().degrees()));
        if targets.iter().flatten().all(|angle| angle.is_whole()) {
            return Self::begin(arm, whole);
        }
        if !arm.has_extended_block()? {
            return Ok(Self { is_rounded: true, ..Self::begin(arm, whole)? });
        }
        let check = MoveCheck::begin(arm, joints_of(&whole))?;
        let plan = arm.read_span(Span::between(&SPEED, &PRESENT_POSITION))?;
        arm.set_fine_targets_checked(&targets).map_err(MoveError::of_motion)?;
        Self::sent(arm, whole, 0, plan, check)
    }

    /// As [`Self::begin_fine`], at this pace. After a failure, restores the speeds and durations, unless a joint moves.
    ///
    /// # Errors
    /// The errors of [`JointMove::begin`] and [`Pace::set`].
    pub fn begin_at_pace(arm: &mut Arm, targets: FineTargets, pace: Pace) -> Result<Self, MoveError> {
        if pace == Pace::default() {
            return Self::begin_fine(arm, targets);
        }
        MoveCheck::begin(arm, joints_of(&targets))?;
        let before = PaceBefore::read(arm, &targets)?;
        let begun = pace.set(arm, &targets).and_then(|()| Self::begin_fine(arm, targets));
        if begun.is_err() {
            // A second failure is ignored, because the first one tells more. The arm may have taken the targets: `put_back`
            // writes nothing while a joint moves.
            let _ = before.put_back(arm);
        }
        begun
    }

    /// Checks the arm after the targets were sent. If the controller restarted meanwhile, its speeds are the defaults: then
    /// makes the arm hold, and fails.
    fn sent(
        arm: &mut Arm,
        targets: Targets,
        arrived: u8,
        plan: Snapshot,
        mut check: MoveCheck,
    ) -> Result<Self, MoveError> {
        let start = arm.now();
        match check.check(arm) {
            Ok(_) => Ok(Self { targets, is_rounded: false, arrived, plan, check, start }),
            Err(MoveCheckError::Problems(problems)) if problems.contains(&RESTARTED) => {
                arm.hold()?;
                Err(MoveError::Problems(problems))
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Did the arm get whole degrees because it has no finer ones?
    #[must_use]
    pub const fn is_rounded(&self) -> bool {
        self.is_rounded
    }

    /// Waits until the joints with a target have arrived. Returns the positions of all joints in degrees.
    ///
    /// # Errors
    /// A joint with a target is blocked, let go or silent, a servo has a new alarm, the supply was lost, or the controller
    /// restarted: [`MoveError::Problems`]. The motors do not drive the joints, or another program stopped the arm. A joint still
    /// moves 5 s after twice the duration of the move, or settles away from its target; the observer ends the wait; or an
    /// exchange failed.
    pub fn finish(&self, arm: &mut Arm, observer: &mut dyn Observer) -> Result<[u8; 7], MoveError> {
        let mut check = self.check.clone();
        self.wait_until_still(arm, &mut check, observer)?;
        self.settle(arm, &mut check, observer)
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
        check: &mut MoveCheck,
        observer: &mut dyn Observer,
    ) -> Result<(), MoveError> {
        let timeout = self.timeout();
        loop {
            let state = check.check(arm)?;
            let moving = self.moving(arm, state)?;
            if moving == 0 {
                return Ok(());
            }
            if self.elapsed(arm) >= timeout {
                return Err(MoveError::StillMoving { bits: moving, after: timeout });
            }
            let present = positions(arm)?;
            self.report(observer, Stage::Moving, &present);
            pause(arm, observer)?;
        }
    }

    /// The joints of this move whose set-point moves.
    fn moving(&self, arm: &mut Arm, state: MoveState) -> Result<u8, MoveError> {
        if let Some(moving) = state.moving {
            return Ok(moving & joints_of(&self.targets));
        }
        // The maker's firmware has no moving bits: until the move should be over, joints that are not at their targets
        // count as moving.
        let away = self.away(&positions(arm)?, ARRIVED_DEGREES, state);
        let is_due = self.elapsed(arm) >= self.duration();
        Ok(if is_due { 0 } else { bits(away.iter().map(|(joint, ..)| *joint)) })
    }

    /// Waits until the joints have settled. Fails if one has not reached its target.
    fn settle(
        &self,
        arm: &mut Arm,
        check: &mut MoveCheck,
        observer: &mut dyn Observer,
    ) -> Result<[u8; 7], MoveError> {
        let (mut state, mut is_still) = (check.check(arm)?, self.is_still(arm)?);
        let mut last = positions(arm)?;
        let start = arm.now();
        let mut changed = start;
        // Without moving bits the joints may still be on their way: their duration is only an estimate.
        let timeout = if arm.identity().has_status_block() { SETTLE_TIMEOUT } else { self.timeout() };
        while !(is_still && self.away(&last, self.arrived, state).is_empty())
            && arm.now() < changed + STILL_TIME
            && arm.now() < start + timeout
        {
            pause(arm, observer)?;
            (state, is_still) = (check.check(arm)?, self.is_still(arm)?);
            let present = positions(arm)?;
            if present != last {
                changed = arm.now();
            }
            last = present;
            self.report(observer, Stage::Settling, &last);
        }
        match self.away(&last, TOLERANCE_DEGREES, state).as_slice() {
            [] => {
                check.end();
                check.check(arm)?;
                Ok(last)
            }
            away => Err(self.not_reached(arm, away.to_vec())),
        }
    }

    /// Do the joints of this move rest, as their servos measure it? Also true if the firmware does not tell.
    fn is_still(&self, arm: &mut Arm) -> Result<bool, Error> {
        let Some(fine) = arm.fine_state_if_served()? else { return Ok(true) };
        let velocities = fine.velocities.into_iter().zip(self.targets);
        let mut ours = velocities.filter(|(_, goal)| goal.is_some());
        Ok(ours.all(|(velocity, _)| velocity.unsigned_abs() < STILL_VELOCITY))
    }

    /// Why the joints settled away from their targets.
    fn not_reached(&self, arm: &mut Arm, away: Vec<(Joint, u8, u8)>) -> MoveError {
        let known = arm.driven_joints().and_then(|joints| {
            let missing = arm.status()?.map_or(0, |status| status.missing());
            let retargeted = self.goals().filter(|(joint, goal)| joints.target(*joint) != *goal);
            Ok((missing, bits(retargeted.map(|(joint, _)| joint))))
        });
        match known {
            Ok((missing, retargeted)) => MoveError::NotReached { away, missing, retargeted },
            Err(error) => error,
        }
    }

    fn elapsed(&self, arm: &Arm) -> Duration {
        arm.now().saturating_duration_since(self.start)
    }

    fn goals(&self) -> impl Iterator<Item = (Joint, u8)> {
        Joint::ALL.into_iter().zip(self.targets).filter_map(|(joint, goal)| Some((joint, goal?)))
    }

    /// The joints more than `degrees` from their targets: joint, position, target. A gripper that holds something has arrived.
    fn away(&self, present: &[u8; 7], degrees: u8, state: MoveState) -> Vec<(Joint, u8, u8)> {
        let pairs = Joint::ALL.into_iter().zip(present).zip(self.targets);
        let away = pairs.filter_map(|((joint, &is), goal)| Some((joint, is, goal?)));
        let grips = |joint: Joint| state.is_gripping && Joint::new(7) == Some(joint);
        away.filter(|(joint, is, goal)| is.abs_diff(*goal) > degrees && !grips(*joint)).collect()
    }

    /// The degrees left, summed over the joints of this move.
    fn degrees_left(&self, present: &[u8; 7]) -> u64 {
        self.away(present, 0, MoveState::default())
            .iter()
            .map(|(_, is, goal)| u64::from(is.abs_diff(*goal)))
            .sum()
    }

    fn report(&self, observer: &mut dyn Observer, stage: Stage, present: &[u8; 7]) {
        let total = self.degrees_left(&self.plan.joints(&PRESENT_POSITION));
        observer.progress(stage, total.saturating_sub(self.degrees_left(present)), total);
    }
}

/// Asks the observer whether to go on, and waits for the time between two reads.
fn pause(arm: &mut Arm, observer: &mut dyn Observer) -> Result<(), MoveError> {
    if !observer.goes_on() {
        return Err(MoveError::Interrupted);
    }
    observer.pause(arm, POLL_PERIOD);
    Ok(())
}

fn positions(arm: &mut Arm) -> Result<[u8; 7], Error> {
    Ok(arm.read_span(Span::of(&PRESENT_POSITION))?.joints(&PRESENT_POSITION))
}
