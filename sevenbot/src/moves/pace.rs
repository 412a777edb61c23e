//! How fast a move is, and how fast the joints were before it.

use std::time::Duration;

use super::error::MoveError;
use super::observer::Observer;
use crate::arm::Arm;
use crate::error::Error;
use crate::fine_state::FineTargets;
use crate::joints::{frames_for, joints_of};
use crate::units::{MoveTime, Speed};
use host_link::{Snapshot, Span};
use protocol_core::registers::Joint;
use protocol_core::registers::map::{BLOCKED_JOINTS, MISSING_SERVOS, MOVING_JOINTS, SPEED, TIME};

/// Time between two reads of an arm that comes to rest.
const POLL_PERIOD: Duration = Duration::from_millis(50);
/// No move takes longer: 180 degrees at 1.9 degrees/s.
const LONGEST_MOVE: Duration = Duration::from_secs(100);
/// Attempts of a read: on a line that loses 3 % of its bytes, about two of three succeed.
const ATTEMPTS: u32 = 5;

/// The pace of a move: a speed or a duration. The default keeps the registers of the arm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pace {
    /// The speed of the joints; `None`: the maximum with a `time`, otherwise unchanged.
    pub speed: Option<Speed>,
    /// The duration of the move; `None`: unchanged. It applies only at the maximum speed (D11).
    pub time: Option<MoveTime>,
}

impl Pace {
    /// Sets speed and duration of the joints with a target.
    ///
    /// # Errors
    /// The arm does not take the values, or an exchange failed.
    pub fn set(self, arm: &mut Arm, targets: &FineTargets) -> Result<(), MoveError> {
        let for_targets = |steps: u8| targets.map(|target| target.map(|_| steps));
        let speed = self.speed.or(self.time.map(|_| Speed::MAXIMUM));
        let speeds = speed.map(|speed| frames_for(&SPEED, &for_targets(speed.steps())));
        let times = self.time.map(|time| frames_for(&TIME, &for_targets(time.steps())));
        let frames: Vec<_> = speeds.into_iter().chain(times).flatten().collect();
        if frames.is_empty() {
            return Ok(());
        }
        Ok(arm.write_all_checked(&frames)?)
    }
}

/// The speeds and durations of the joints before a move, to be put back after it.
#[derive(Clone, Debug)]
pub struct PaceBefore {
    registers: Snapshot,
    /// The joints of the move, as [`Joint::bit`]s.
    joints: u8,
}

impl PaceBefore {
    /// Reads the speeds and durations before a move to these targets.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn read(arm: &mut Arm, targets: &FineTargets) -> Result<Self, Error> {
        let registers = arm.read_span(Span::between(&SPEED, &TIME))?;
        Ok(Self { registers, joints: joints_of(targets) })
    }

    /// The speeds other than the default, and the durations that apply with them. A move that sets no pace uses these. Each pair
    /// comes with its joints, as [`Joint::bit`](crate::Joint::bit)s.
    #[must_use]
    pub fn other_than_default(&self) -> Vec<(u8, Speed, MoveTime)> {
        let (speeds, times) = (self.registers.joints(&SPEED), self.registers.joints(&TIME));
        let mut others: Vec<(u8, Speed, MoveTime)> = Vec::new();
        for ((joint, steps), time) in Joint::ALL.into_iter().zip(speeds).zip(times) {
            let pace = Speed::from_steps(steps).zip(MoveTime::from_steps(time));
            let Some((speed, time)) = pace else { continue };
            if speed == Speed::DEFAULT || self.joints & joint.bit() == 0 {
                continue;
            }
            // A duration applies at the maximum speed only (D11).
            let time = if speed == Speed::MAXIMUM { time } else { MoveTime::NONE };
            match others.iter_mut().find(|other| (other.1, other.2) == (speed, time)) {
                Some((joints, ..)) => *joints |= joint.bit(),
                None => others.push((joint.bit(), speed, time)),
            }
        }
        others
    }

    /// The joints of the move whose set-point still moves, as [`Joint::bit`](crate::Joint::bit)s. Blocked and silent joints do
    /// not count. 0 from firmware that does not tell.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn moving(&self, arm: &mut Arm) -> Result<u8, Error> {
        if !arm.identity().has_status_block() {
            return Ok(0);
        }
        arm.with_attempts(ATTEMPTS, |arm| {
            // A bad line loses long answers more often, so these are two short reads.
            let blocked = arm.read_span(Span::of(&BLOCKED_JOINTS))?.byte(&BLOCKED_JOINTS);
            let now = arm.read_span(Span::between(&MISSING_SERVOS, &MOVING_JOINTS))?;
            Ok(self.joints & now.byte(&MOVING_JOINTS) & !now.byte(&MISSING_SERVOS) & !blocked)
        })
    }

    /// Waits until no joint of the move moves. When a move fails at one joint, the other joints go on to their targets.
    ///
    /// # Errors
    /// The observer ended the wait, a joint still moves after 100 s, or an exchange failed.
    pub fn wait_for_rest(&self, arm: &mut Arm, observer: &mut dyn Observer) -> Result<(), MoveError> {
        let start = arm.now();
        loop {
            let bits = self.moving(arm)?;
            if bits == 0 {
                return Ok(());
            }
            if arm.now() >= start + LONGEST_MOVE {
                return Err(MoveError::StillMoving { bits, after: LONGEST_MOVE });
            }
            if !observer.goes_on() {
                return Err(MoveError::Interrupted);
            }
            observer.pause(arm, POLL_PERIOD);
        }
    }

    /// Restores the speeds and durations, with several attempts on a bad line.
    ///
    /// # Errors
    /// [`MoveError::StillMoving`] if a joint of the move moves: another speed would act at once (D11), so nothing is written.
    /// Also fails if the registers do not take the values, or an exchange failed.
    pub fn put_back(&self, arm: &mut Arm) -> Result<(), MoveError> {
        match self.moving(arm)? {
            0 => self.put_back_at_once(arm),
            bits => Err(MoveError::StillMoving { bits, after: Duration::ZERO }),
        }
    }

    /// As [`Self::put_back`], also while a joint moves, which may then change its speed.
    ///
    /// # Errors
    /// The registers do not take the values, or an exchange failed.
    pub fn put_back_at_once(&self, arm: &mut Arm) -> Result<(), MoveError> {
        Ok(arm.put_back(&self.registers)?)
    }
}
