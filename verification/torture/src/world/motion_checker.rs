//! Checks that no joint moves by itself (D12).
//!
//! ```text
//!   goals that the servos receive ──▶ AngleRange, which contains the joint ──▶ true angle inside? ◀── Plant
//!   state, power, hands, panics   ──▶ Exemption, until the joint has torque and a goal again
//! ```
//!
//! The checker outlives restarts of the controller: a joint that holds its goal continues to hold it. The range shrinks
//! behind a joint that moves to its goal, more slowly than a servo moves. So a joint that lags behind is inside the
//! range, and a joint that falls is outside.
//!
//! Torque comes back with a goal of the controller, never by itself with the goal that the servo had before (D28).
//!
//! A joint with a payload, or that meets an obstacle or a hand, may be past its goals as long as its servo drives it back.
//!
//! A joint yields to its load: it droops, and when the controller alone restarts, the measured position is its new goal
//! and it droops once more. With a payload it also runs past its goal. The tolerance follows from the load and the speed
//! of each joint.

use arm_sim::plant::Plant;
use motion_core::calibration::{MicroDegrees, angle_from_counts};
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{Decoder, Instruction, register};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};
use std::collections::VecDeque;

use crate::per_joint::PerJoint;
use crate::violation::{Check, ensure};

/// The time between two checks. The heaviest joint, if it falls, exceeds the tolerance in 30 ms.
const CHECK_PERIOD: Duration = Duration::from_millis(5);
/// The accepted distance of a joint from its range, in millidegrees, without load and speed. A goal is a multiple of up
/// to 0.29 degrees, and the angle is measured after the goal is computed.
const TOLERANCE: i32 = 450;
/// Millidegrees per second by which the range shrinks behind the joint. A servo far from its goal moves at 372 degrees/s.
const SHRINK_PER_SECOND: u64 = 80_000;
/// A servo may still approach a goal of this age: its set-point and its motor lag behind by 30 ms.
const GOAL_AGE: Duration = Duration::from_millis(100);
/// When the set-point of a joint that pushes comes back at once (D27), the derivative term of its servo turns the joint
/// away from its goal for a moment: by this much, in millidegrees.
const RECOIL: i32 = 2_000;
/// A joint that something has turned past its goals is back this long after it is gone.
const OVERRUN_TIME: Duration = Duration::from_millis(1_000);
/// A servo with this load, in 0.1 %, drives its joint back.
const DRIVES_BACK: i16 = 100;
/// A joint that is given torque may still fall, or approach an older goal, for this time.
const SETTLE_TIME: Duration = Duration::from_millis(200);
/// The number of sent frames that are kept for comparison. A servo may decode a frame late, after noise.
const MAX_SENT_FRAMES: usize = 8;

/// Why a joint may move without a goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Exemption {
    /// Its servo has restarted, and has no torque until the controller gives it.
    PowerLoss,
    /// The motor state is not servo.
    MotorState,
    /// A hand turns it, or something holds it.
    Hand,
    /// The panic handler switched the servos to damping.
    Panic,
    /// Noise corrupted a command or formed one, so the command that the servo received is unknown.
    Noise,
}

/// The angles that a joint may have, in millidegrees.
#[derive(Clone, Copy, Debug)]
struct AngleRange {
    low: i32,
    high: i32,
}

impl AngleRange {
    const fn at(angle: i32) -> Self {
        Self { low: angle, high: angle }
    }

    fn reach(&mut self, angle: i32) {
        self.low = self.low.min(angle);
        self.high = self.high.max(angle);
    }

    /// Shrinks towards the recent goals, but not past the joint.
    fn shrink(&mut self, goals: Self, angle: i32, by: i32) {
        self.low = (self.low + by).min(angle.max(self.low)).min(goals.low);
        self.high = (self.high - by).max(angle.min(self.high)).max(goals.high);
    }

    /// True if a servo with this load, positive towards greater angles, drives a joint at this angle towards the range.
    fn is_driven_back(&self, angle: i32, load: i16) -> bool {
        (angle > self.high && load < -DRIVES_BACK) || (angle < self.low && load > DRIVES_BACK)
    }

    fn excess(&self, angle: i32) -> i32 {
        (angle - self.high).max(self.low - angle)
    }
}

/// The checked state of a joint.
#[derive(Clone, Copy, Debug)]
struct JointBounds {
    /// Why it may move without a goal, and the earliest end of that.
    exemption: Option<(Exemption, Instant)>,
    /// The last goal that its servo has received since it has had power.
    goal: Option<i32>,
    /// The goals of the present period of [`GOAL_AGE`], and of the period before.
    goals: [AngleRange; 2],
    range: AngleRange,
    /// Until then the joint may run past its goals if its servo drives it back.
    overruns_until: Instant,
    /// Its servo had torque at the last check.
    had_torque: bool,
    /// How far it was outside its range at the last check.
    excess: i32,
    /// The greatest yield in the present period, and in the period before.
    yields: [i32; 2],
}

impl JointBounds {
    /// Starts a new period for the goals and for the yield.
    fn age(&mut self) {
        let [new, _] = self.goals;
        self.goals = [AngleRange::at(self.goal.unwrap_or(0)), new];
        let [new, _] = self.yields;
        self.yields = [0, new];
    }

    /// How far the joint may be outside its range.
    fn tolerance(&self) -> i32 {
        let [new, old] = self.yields;
        new.max(old).saturating_add(TOLERANCE)
    }
}

/// The checker of all joints.
#[derive(Debug)]
pub(super) struct MotionChecker {
    joints: PerJoint<JointBounds>,
    checked_at: Instant,
    /// Decodes the commands that reach the servos.
    decoder: Decoder,
    sent: VecDeque<Vec<u8>>,
}

impl MotionChecker {
    pub(super) const fn new(now: Instant) -> Self {
        let exemption = Some((Exemption::PowerLoss, now));
        Self {
            joints: PerJoint::all(JointBounds {
                exemption,
                goal: None,
                goals: [AngleRange::at(0); 2],
                range: AngleRange::at(0),
                overruns_until: now,
                had_torque: false,
                excess: 0,
                yields: [0; 2],
            }),
            checked_at: now,
            decoder: Decoder::new(),
            sent: VecDeque::new(),
        }
    }

    /// Exempts a joint until its servo has torque and a goal again.
    pub(super) fn exempt(&mut self, now: Instant, joint: Joint, exemption: Exemption) {
        let bounds = &mut self.joints[joint];
        bounds.exemption = Some((exemption, now + SETTLE_TIME));
        bounds.goal = None;
    }

    /// The set-point of a joint that pushes may come back at once (D27).
    pub(super) fn may_recoil(&mut self, joint: Joint, plant: &Plant) {
        let [largest, _] = &mut self.joints[joint].yields;
        *largest = (*largest).max(yield_of(joint, plant).saturating_add(RECOIL));
    }

    /// A payload, an obstacle or a hand may turn or hold the joint past its goals while its servo drives it back.
    pub(super) fn may_overrun(&mut self, now: Instant, joint: Joint) {
        self.joints[joint].overruns_until = now + OVERRUN_TIME;
    }

    /// Exempts all joints.
    pub(super) fn exempt_all(&mut self, now: Instant, exemption: Exemption) {
        Joint::ALL.into_iter().for_each(|joint| self.exempt(now, joint, exemption));
    }

    /// All servos lost their power, and the bytes of an incomplete frame.
    pub(super) fn power_cycle(&mut self, now: Instant) {
        self.decoder.clear();
        self.exempt_all(now, Exemption::PowerLoss);
    }

    /// Applies the commands in `received`: the frame `sent`, as the servos receive it after disturbances.
    pub(super) fn frame_sent(&mut self, now: Instant, sent: &[u8], received: &[u8]) {
        if self.sent.len() == MAX_SENT_FRAMES {
            self.sent.pop_front();
        }
        self.sent.push_back(sent.to_vec());
        if sent != received {
            self.exempt_all(now, Exemption::Noise);
        }
        for piece in received.chunks(Decoder::CAPACITY / 2) {
            self.decoder.push(piece);
            while let Some(command_checker) = self.next_commands() {
                command_checker.into_iter().for_each(|command| self.apply(now, command));
            }
        }
    }

    /// The commands in the next received frame; `None` if there is no complete frame.
    fn next_commands(&mut self) -> Option<Vec<DecodedCommand>> {
        let Self { decoder, sent, .. } = self;
        let Ok(frame) = decoder.pull()? else { return Some(Vec::new()) };
        let is_own = sent.iter().any(|own| {
            matches!(own.as_slice(), [_, _, id, _, code, params @ .., _]
            if *id == frame.id && *code == frame.code && params == frame.params)
        });
        Some(match (Instruction::from_code(frame.code), frame.params) {
            (Some(Instruction::SyncWrite), [register::GOAL_POSITION, 6, items @ ..]) if is_own => {
                items.chunks_exact(7).filter_map(goal).collect()
            }
            (Some(Instruction::SyncWrite | Instruction::Write), _) if !is_own => {
                Joint::ALL.map(DecodedCommand::Noise).to_vec()
            }
            _ => Vec::new(),
        })
    }

    fn apply(&mut self, now: Instant, command: DecodedCommand) {
        match command {
            DecodedCommand::Goal(joint, angle) => {
                let bounds = &mut self.joints[joint];
                if bounds.goal.is_none() {
                    bounds.goals = [AngleRange::at(angle); 2];
                }
                bounds.goal = Some(angle);
                let [new, _] = &mut bounds.goals;
                new.reach(angle);
                bounds.range.reach(angle);
            }
            DecodedCommand::Noise(joint) => self.exempt(now, joint, Exemption::Noise),
        }
    }

    /// Checks all joints. `is_servo` is true if the motor state is servo, or was when the controller stopped. `is_guarded`
    /// tells that the controller knows the servos and protects them.
    pub(super) fn check(&mut self, now: Instant, is_servo: bool, is_guarded: bool, plant: &Plant) -> Check {
        if !is_servo {
            self.exempt_all(now, Exemption::MotorState);
        }
        if now - self.checked_at < CHECK_PERIOD {
            return Ok(());
        }
        let shrunk = (now - self.checked_at).as_micros() * SHRINK_PER_SECOND / 1_000_000;
        if now.as_micros() / GOAL_AGE.as_micros() != self.checked_at.as_micros() / GOAL_AGE.as_micros() {
            self.joints.0.iter_mut().for_each(JointBounds::age);
        }
        self.checked_at = now;
        let by = i32::try_from(shrunk).unwrap_or(i32::MAX).min(1_000_000);
        for joint in Joint::ALL {
            self.check_return_of_torque(joint, is_guarded, plant)?;
            self.check_joint(now, joint, by, plant)?;
        }
        Ok(())
    }

    /// A servo that lost its torque does not have it again before it has received a goal.
    fn check_return_of_torque(&mut self, joint: Joint, is_guarded: bool, plant: &Plant) -> Check {
        let bounds = &mut self.joints[joint];
        let has_torque = plant.torque(joint) == Some(Torque::On);
        let is_back = has_torque && !std::mem::replace(&mut bounds.had_torque, has_torque);
        let was_lost = matches!(bounds.exemption, Some((Exemption::PowerLoss, _)));
        ensure(!(is_back && was_lost && is_guarded) || bounds.goal.is_some(), || {
            format!("the torque of joint {} came back by itself", joint.number())
        })
    }

    fn check_joint(&mut self, now: Instant, joint: Joint, by: i32, plant: &Plant) -> Check {
        let (angle, torque) = (plant.angle(joint), plant.torque(joint));
        let [largest, _] = &mut self.joints[joint].yields;
        *largest = (*largest).max(yield_of(joint, plant));
        if torque.is_none() {
            self.exempt(now, joint, Exemption::PowerLoss);
        }
        let bounds = &mut self.joints[joint];
        let Some(goal) = bounds.goal else { return Ok(()) };
        let [mut goals, old] = bounds.goals;
        goals.reach(old.low);
        goals.reach(old.high);
        if let Some((_, until)) = bounds.exemption {
            if torque == Some(Torque::On) && now >= until {
                bounds.exemption = None;
                bounds.range = goals;
                bounds.range.reach(angle);
            }
            return Ok(());
        }
        bounds.range.shrink(goals, angle, by);
        let (range, tolerance) = (bounds.range, bounds.tolerance());
        let excess = range.excess(angle);
        let comes_back = excess < std::mem::replace(&mut bounds.excess, excess);
        let is_driven_back = comes_back || range.is_driven_back(angle, load_of(joint, plant));
        let overruns = now < bounds.overruns_until && is_driven_back;
        ensure(overruns || excess <= tolerance, || {
            format!(
                "joint {} moved by itself to {angle} millidegrees with the goal {goal} and torque {torque:?}; \
                 its range is {} to {}, and its tolerance {tolerance}",
                joint.number(),
                range.low,
                range.high
            )
        })
    }
}

/// How far a driven joint may be off its set-point, in millidegrees: by the droop of its own load, and by the distance
/// in which its motor can stop it. The second one hides no fall: a joint that falls has a smaller torque than its motor,
/// so it falls further than that distance.
fn yield_of(joint: Joint, plant: &Plant) -> i32 {
    let droop = plant.droop(joint).unwrap_or(i32::MAX);
    droop.saturating_add(plant.stopping_distance(joint))
}

/// The load of a joint in 0.1 %, positive towards greater angles.
fn load_of(joint: Joint, plant: &Plant) -> i16 {
    let load = plant.load(joint);
    if millidegrees(joint, 1_000) > millidegrees(joint, 0) { load } else { -load }
}

/// The effect of a frame on one servo.
#[derive(Clone, Copy, Debug)]
enum DecodedCommand {
    /// A goal, in millidegrees.
    Goal(Joint, i32),
    /// A command that the controller did not send.
    Noise(Joint),
}

fn goal(item: &[u8]) -> Option<DecodedCommand> {
    let &[id, high, low, ..] = item else { return None };
    let counts = u16::from_be_bytes([high, low]);
    Joint::from_index(id).map(|joint| DecodedCommand::Goal(joint, millidegrees(joint, counts)))
}

/// The angle of a joint for a position of its servo, without the joint's offset.
fn millidegrees(joint: Joint, counts: u16) -> i32 {
    let MicroDegrees(angle) = angle_from_counts(joint, counts, 0);
    angle / 1_000
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lagging_joint_is_inside_its_range_and_a_falling_joint_is_not() {
        let goal = AngleRange::at(10_000);
        let mut range = AngleRange { low: 0, high: 10_000 };
        range.shrink(goal, 2_000, 3_000);
        assert_eq!((range.low, range.high), (2_000, 10_000), "not past the joint");
        range.shrink(goal, 9_900, 8_000);
        assert_eq!((range.low, range.excess(9_900)), (9_900, 0));
        range.shrink(goal, 4_000, 0);
        assert_eq!(range.excess(4_000), 5_900, "away from the goal");
        range.shrink(goal, 11_000, 0);
        assert_eq!(range.excess(11_000), 1_000);
    }
}
