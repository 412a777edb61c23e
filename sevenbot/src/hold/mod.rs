//! A verified stop: writes targets that hold the arm, reads them back, and writes those again that differ.
//!
//! ```text
//!   time, joints ──▶ Hold ──▶ HoldStep::Write ──▶ HoldStep::Read ──▶ Write again, until no target differs ──▶ Holds
//!                    └─ at once: slow all joints down, before the first read
//! ```
//!
//! On an arm with the extended block, targets are the measured positions in hundredths of a degree, so that a stop moves no
//! joint. A joint that has reached its target keeps it, so that repeated stops do not make the arm sink. Targets stay within
//! the limits of register 188, because the arm takes no others ([D25](protocol_core::decisions#d25)). On other arms targets are
//! whole degrees. [`crate::joints`] interprets the registers of each joint.
//!
//! [`Hold`] does no input or output. [`Arm::hold`] is the shell for a blocking program; the page in a browser has another.

use std::time::Duration;

use protocol_core::registers::Joint;
use protocol_core::registers::map::{SET_POINT_PERIOD, SPEED};

use crate::arm::Arm;
use crate::checked_write::{MismatchCause, NotTaken, WriteError, WriteMismatch};
use crate::error::Error;
use crate::joints::{JointSnapshot, POLL_PERIOD, START_UP_TIME};

mod held_joints;

pub use held_joints::HeldJoints;
use held_joints::SentTarget;

/// Targets are written this many times before their loss is an error.
const HOLD_ATTEMPTS: u32 = 5;
/// A stop that restores speeds at its end is written again if nothing confirms it for this time.
const REPEAT_PERIOD: Duration = Duration::from_millis(100);
/// The slowest speed, 1.9 degrees/s. It acts on moves that go on (D11), and bounds streams (D23).
const BRAKE: [u8; 7] = [1; 7];

/// Why it is uncertain whether the arm holds. The arm may still be moving.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the arm may not hold: {0}")]
pub struct HoldError(#[from] pub WriteError);

impl Arm {
    /// Makes every joint hold its present position, and verifies the targets. Returns the joints as read back.
    ///
    /// - If the motors do not drive the joints (state 0 or 2), writes no targets.
    /// - A joint whose servo does not answer gets its last measured position as its target, and none if it was never
    ///   measured.
    /// - After power-up waits up to 0.7 s for the joints that are not measured yet. The other joints hold at once.
    /// - A stream of another program ends at each joint. Its set-point period stays as it was ([D23](protocol_core::decisions#d23)).
    ///
    /// # Errors
    /// An exchange failed, or the arm does not take the targets: it may be moving.
    pub fn hold(&mut self) -> Result<JointSnapshot, HoldError> {
        self.hold_through_restarts().map(|(joints, _)| joints)
    }

    /// As [`Arm::hold`]. Also returns whether the controller restarted meanwhile.
    pub(crate) fn hold_through_restarts(&mut self) -> Result<(JointSnapshot, bool), HoldError> {
        let held = self.with_min_attempts(|arm| match arm.has_extended_block()? {
            true => arm.without_set_point_period(|arm| arm.hold_until_verified(true)),
            false => arm.hold_until_verified(false),
        });
        Ok(held?)
    }

    fn hold_until_verified(&mut self, is_fine: bool) -> Result<(JointSnapshot, bool), WriteError> {
        let mut hold = Hold::default();
        loop {
            let now = self.elapsed();
            match hold.poll(now) {
                HoldStep::Read => {
                    let joints = self.held_joints(is_fine)?;
                    hold.joints(now, self.elapsed(), &joints);
                }
                HoldStep::Write(frames) => {
                    for (address, values) in frames {
                        self.write(address, &values)?;
                    }
                }
                HoldStep::Wait(until) => self.sleep(until.saturating_sub(now)),
                HoldStep::Holds(joints) | HoldStep::NotDriven(joints) => {
                    return Ok((joints, hold.has_restarted));
                }
                HoldStep::NotTaken(lost) => return Err(self.explained_by_server(lost).into()),
            }
        }
    }

    fn held_joints(&mut self, is_fine: bool) -> Result<HeldJoints, Error> {
        // Read the status first: then the next status shows a restart during these reads.
        let joints = self.joints()?;
        let fine = is_fine.then(|| self.read_span(HeldJoints::FINE_REGISTERS)).transpose()?;
        Ok(HeldJoints::new(joints, fine))
    }
}

type RegisterWrites = Vec<(u8, Vec<u8>)>;

/// A stop in progress. All times count from the same instant.
///
/// ```
/// use sevenbot::hold::{Hold, HoldStep};
/// use std::time::Duration;
///
/// let mut stop = Hold::at_once(None);
/// let HoldStep::Write(frames) = stop.poll(Duration::ZERO) else { return Err("a frame at once") };
/// assert_eq!(frames, [(32, vec![1; 7])], "no joint is faster than 1.9 degrees per second from now on");
/// assert_eq!(stop.poll(Duration::ZERO), HoldStep::Read);
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Hold {
    /// The joints when they were read first.
    before: Option<JointSnapshot>,
    sent: [Option<SentTarget>; 7],
    losses: u32,
    has_restarted: bool,
    /// When the joints were read first.
    start: Option<Duration>,
    /// The speeds to restore at the end; `None` if there are none, or they were restored.
    speeds: Option<[u8; 7]>,
    /// Were the restored speeds written at least once?
    is_restoring: bool,
    stage: HoldStage,
    /// A read shows the effect of the frames only if it was sent at this time or later.
    written: Duration,
    /// The time of the last write of the unconfirmed frames.
    repeated: Duration,
}

/// How far a stop has come.
#[derive(Clone, Debug, Default)]
enum HoldStage {
    /// The joints are to be read.
    #[default]
    Reading,
    /// A joint is not measured yet. The joints are to be read at this time.
    Waiting(Duration),
    /// These frames are to be written.
    Writing(RegisterWrites),
    /// These frames were written, and the joints are to be read.
    Verifying(RegisterWrites),
    Ended(HoldStep),
}

/// What a stop has to do next.
#[derive(Clone, Debug, PartialEq)]
pub enum HoldStep {
    /// Write these frames, each an address and its values.
    Write(Vec<(u8, Vec<u8>)>),
    /// Read the joints for [`Hold::joints`].
    Read,
    /// Nothing is due before this time.
    Wait(Duration),
    /// Every joint with a known position holds: the stop is over.
    Holds(JointSnapshot),
    /// The motors do not drive the joints: there is nothing to stop.
    NotDriven(JointSnapshot),
    /// The arm does not take these targets, or the speeds to restore. It may be moving.
    NotTaken(NotTaken),
}

impl Hold {
    /// A stop that acts before the first read: it slows all joints down, and sends them to where they were measured last, if
    /// that is known. It writes this again every 100 ms until the arm confirms it. The speeds are restored at the end; without
    /// `known`, to their defaults. If the motors are off in `known`, it writes nothing before the first read.
    #[must_use]
    pub fn at_once(known: Option<&HeldJoints>) -> Self {
        let speeds = known.map_or_else(
            || SPEED.default_bytes(),
            |known| Joint::ALL.map(|joint| known.joints.speed(joint).steps()),
        );
        Self::slowing_down(known, speeds)
    }

    /// A second stop after this one. As [`Self::at_once`], but restores the speeds from before the first stop.
    #[must_use]
    pub fn again(&self, known: Option<&HeldJoints>) -> Self {
        self.speeds.map_or_else(|| Self::at_once(known), |speeds| Self::slowing_down(known, speeds))
    }

    /// Restores these speeds at the end. For a stop while the registers hold other speeds temporarily, as during a playback.
    #[must_use]
    pub const fn restoring(mut self, speeds: [u8; 7]) -> Self {
        self.speeds = Some(speeds);
        self
    }

    fn slowing_down(known: Option<&HeldJoints>, speeds: [u8; 7]) -> Self {
        if known.is_some_and(|known| !known.joints.is_driven()) {
            return Self::default();
        }
        let mut frames: RegisterWrites = Vec::new();
        if known.is_some_and(HeldJoints::is_fine) {
            // With a period, a target would be one more point of a stream (D23).
            frames.push((SET_POINT_PERIOD.address, vec![0, 0]));
        }
        frames.push((SPEED.address, BRAKE.to_vec()));
        // The joints may have moved since `known` was read: the first read replaces these targets.
        frames.extend(
            known.into_iter().flat_map(|known| known.frames(&known.targets_to_write(&[None; 7], false))),
        );
        Self { speeds: Some(speeds), stage: HoldStage::Writing(frames), ..Self::default() }
    }

    /// What is to be done at `now`. Call it again after each step, until a step ends the stop.
    pub fn poll(&mut self, now: Duration) -> HoldStep {
        match &self.stage {
            HoldStage::Ended(end) => end.clone(),
            HoldStage::Waiting(until) if now < *until => HoldStep::Wait(*until),
            HoldStage::Writing(frames) => {
                let frames = frames.clone();
                (self.written, self.repeated) = (now, now);
                self.stage = HoldStage::Verifying(frames.clone());
                HoldStep::Write(frames)
            }
            HoldStage::Verifying(frames) if self.speeds.is_some() && now >= self.repeated + REPEAT_PERIOD => {
                self.repeated = now;
                HoldStep::Write(frames.clone())
            }
            HoldStage::Reading | HoldStage::Waiting(_) | HoldStage::Verifying(_) => HoldStep::Read,
        }
    }

    /// Takes the joints that arrived at `now`, from reads that were sent at `asked` or later. Ignores joints from reads that
    /// were sent before the last frames.
    pub fn joints(&mut self, asked: Duration, now: Duration, joints: &HeldJoints) {
        if asked < self.written || matches!(self.stage, HoldStage::Ended(_) | HoldStage::Writing(_)) {
            return;
        }
        let start_up = *self.start.get_or_insert(now) + START_UP_TIME;
        self.stage = match self.step(joints, now >= start_up) {
            HoldStep::Write(frames) => HoldStage::Writing(frames),
            HoldStep::Wait(_) => HoldStage::Waiting(now + POLL_PERIOD),
            HoldStep::Read => HoldStage::Reading,
            end => HoldStage::Ended(end),
        };
    }

    /// The next step, given the joints as they are now. `is_past_start_up`: 0.7 s have passed since the first read, after
    /// which each joint is measured or missing.
    fn step(&mut self, now: &HeldJoints, is_past_start_up: bool) -> HoldStep {
        if self.before.as_ref().is_some_and(|before| now.joints.has_restarted_since(before)) {
            // The restart discarded the targets. The arm holds by itself, and measures its joints anew (D12). The frame that
            // slows the joints down may have arrived after the restart, so the default speeds are restored.
            let speeds = self.speeds.map(|_| SPEED.default_bytes());
            *self = Self { has_restarted: true, speeds, ..Self::default() };
        }
        let before = self.before.get_or_insert_with(|| now.joints.clone());
        if !now.joints.is_driven() {
            return self.restore_speeds(now).unwrap_or_else(|| HoldStep::NotDriven(now.joints.clone()));
        }
        if let Err(lost) = NotTaken::check(now.lost_targets(&self.sent, before)) {
            self.losses += 1;
            if self.losses >= HOLD_ATTEMPTS {
                return HoldStep::NotTaken(lost);
            }
        }
        let targets = now.targets_to_write(&self.sent, is_past_start_up);
        for ((sent, target), joint) in self.sent.iter_mut().zip(targets).zip(Joint::ALL) {
            let may_be_unmeasured = now.may_be_unmeasured(joint, is_past_start_up);
            *sent = target.map(|value| SentTarget { value, may_be_unmeasured }).or(*sent);
        }
        if targets != [None; 7] {
            return HoldStep::Write(now.frames(&targets));
        }
        if Joint::ALL.into_iter().any(|joint| now.may_be_unmeasured(joint, is_past_start_up)) {
            return HoldStep::Wait(POLL_PERIOD);
        }
        self.restore_speeds(now).unwrap_or_else(|| HoldStep::Holds(now.joints.clone()))
    }

    /// The step that restores the speeds; `None` if that is not needed.
    fn restore_speeds(&mut self, now: &HeldJoints) -> Option<HoldStep> {
        let wanted = self.speeds?;
        let found = Joint::ALL.map(|joint| now.joints.speed(joint).steps());
        if found == wanted {
            self.speeds = None;
            return None;
        }
        let is_lost = std::mem::replace(&mut self.is_restoring, true);
        self.losses = if is_lost { self.losses + 1 } else { 0 };
        if self.losses < HOLD_ATTEMPTS {
            return Some(HoldStep::Write(vec![(SPEED.address, wanted.to_vec())]));
        }
        let rows =
            Joint::ALL.into_iter().zip(wanted).zip(found).filter(|((_, wanted), found)| wanted != found);
        let lost = rows.map(|((joint, wanted), found)| WriteMismatch {
            address: SPEED.of(joint),
            wanted: wanted.into(),
            found: found.into(),
            cause: MismatchCause::Unknown,
        });
        NotTaken::check(lost.collect()).err().map(HoldStep::NotTaken)
    }
}

#[cfg(test)]
mod tests;
