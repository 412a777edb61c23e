//! No joint moves by more than its set-point asked for, unless state 0 or 2, its servo's own power, a hand, or a fault
//! of the controller did it (D12).
//!
//! ```text
//!   goals, as the servos hear them ──▶ Span: from where the joint may be ──▶ true angle inside? ◀── Plant
//!   state, power, hands, faults    ──▶ Excuse, until the joint has torque and a goal again
//! ```
//!
//! It outlives restarts of the controller: a joint that holds goes on holding. A span always contains the joint, as
//! long as it moves towards its goal only. Behind the joint the span shrinks more slowly than a servo moves, so a
//! joint that lags behind is inside, and a joint that falls is not.

use arm_sim::plant::Plant;
use motion_core::calibration::{MicroDegrees, angle_from_counts};
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{Decoder, Instruction, register};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};
use std::collections::VecDeque;

use crate::per_joint::PerJoint;
use crate::violation::{Check, ensure};

/// Between two looks at the joints. The heaviest joint, when it is freed, is past the tolerance in 30 ms.
const EVERY: Duration = Duration::from_millis(5);
/// How far outside its span a joint may be, in millidegrees. Goals are whole counts of up to 0.29 degrees, the plant droops
/// by less than 0.1 degrees under the heaviest load, and its motor stops within 0.02 degrees of where it should be.
const TOLERANCE: i32 = 450;
/// How fast the span shrinks behind the joint, in millidegrees a second. A servo that is far behind makes 372 degrees/s.
const SHRINK_PER_SECOND: u64 = 80_000;
/// A servo may still be on its way to a goal that is so old: its set-point and its motor lag behind by 30 ms.
const LATELY: Duration = Duration::from_millis(100);
/// A joint that is given torque may still be falling, or on its way to what it was told before.
const SETTLED: Duration = Duration::from_millis(200);
/// Frames that are remembered as the controller's own. A servo may see a frame late, behind bytes that noise left.
const REMEMBERED: usize = 8;

/// Why a joint may move by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Excuse {
    /// Its servo was switched on, or starts again: there is no torque before the controller gives it.
    Power,
    /// State 0 or 2.
    State,
    /// Somebody holds or turns it.
    Hand,
    /// The controller failed, and put the servos into damping.
    Fault,
    /// Noise damaged a command, or passed for one: what the servos were told is not known.
    Noise,
}

/// Where a joint may be, in millidegrees.
#[derive(Clone, Copy, Debug)]
struct Span {
    low: i32,
    high: i32,
}

impl Span {
    const fn at(angle: i32) -> Self {
        Self { low: angle, high: angle }
    }

    fn reach(&mut self, angle: i32) {
        self.low = self.low.min(angle);
        self.high = self.high.max(angle);
    }

    /// Shrinks towards the goals of late, but not past the joint.
    fn shrink(&mut self, goals: Self, angle: i32, by: i32) {
        self.low = (self.low + by).min(angle.max(self.low)).min(goals.low);
        self.high = (self.high - by).max(angle.min(self.high)).max(goals.high);
    }

    fn excess(&self, angle: i32) -> i32 {
        (angle - self.high).max(self.low - angle)
    }
}

/// What is known of a joint.
#[derive(Clone, Copy, Debug)]
struct Held {
    /// Why it may move by itself, and not before when that ends.
    excuse: Option<(Excuse, Instant)>,
    /// The last goal that its servo heard since it has had power.
    goal: Option<i32>,
    /// The goals since a multiple of [`LATELY`], and between that and the one before.
    goals: [Span; 2],
    span: Span,
}

impl Held {
    /// The goals of late become older ones.
    fn age(&mut self) {
        let [new, _] = self.goals;
        self.goals = [Span::at(self.goal.unwrap_or(0)), new];
    }
}

/// All joints.
#[derive(Debug)]
pub(super) struct Hold {
    joints: PerJoint<Held>,
    looked_at: Instant,
    /// Hears what the servos hear.
    decoder: Decoder,
    sent: VecDeque<Vec<u8>>,
}

impl Hold {
    pub(super) const fn new(now: Instant) -> Self {
        let excuse = Some((Excuse::Power, now));
        Self {
            joints: PerJoint::all(Held { excuse, goal: None, goals: [Span::at(0); 2], span: Span::at(0) }),
            looked_at: now,
            decoder: Decoder::new(),
            sent: VecDeque::new(),
        }
    }

    /// A joint may move by itself from now on, and until its servo has torque and a goal again.
    pub(super) fn excuse(&mut self, now: Instant, joint: Joint, excuse: Excuse) {
        let held = &mut self.joints[joint];
        held.excuse = Some((excuse, now + SETTLED));
        held.goal = None;
    }

    /// Likewise for all joints.
    pub(super) fn excuse_all(&mut self, now: Instant, excuse: Excuse) {
        Joint::ALL.into_iter().for_each(|joint| self.excuse(now, joint, excuse));
    }

    /// All servos lost their power: what was left of a frame is gone.
    pub(super) fn power_cycle(&mut self, now: Instant) {
        self.decoder.clear();
        self.excuse_all(now, Excuse::Power);
    }

    /// The controller sent a frame, and the servos heard these bytes.
    pub(super) fn heard(&mut self, now: Instant, sent: &[u8], heard: &[u8]) {
        if self.sent.len() == REMEMBERED {
            self.sent.pop_front();
        }
        self.sent.push_back(sent.to_vec());
        if sent != heard {
            self.excuse_all(now, Excuse::Noise);
        }
        for piece in heard.chunks(Decoder::CAPACITY / 2) {
            self.decoder.push(piece);
            while let Some(commands) = self.next_commands() {
                commands.into_iter().for_each(|command| self.obeyed(now, command));
            }
        }
    }

    /// What the next frame tells the servos; `None`: there is no further frame.
    fn next_commands(&mut self) -> Option<Vec<Command>> {
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
                Joint::ALL.map(Command::Noise).to_vec()
            }
            _ => Vec::new(),
        })
    }

    fn obeyed(&mut self, now: Instant, command: Command) {
        match command {
            Command::Goal(joint, angle) => {
                let held = &mut self.joints[joint];
                if held.goal.is_none() {
                    held.goals = [Span::at(angle); 2];
                }
                held.goal = Some(angle);
                let [new, _] = &mut held.goals;
                new.reach(angle);
                held.span.reach(angle);
            }
            Command::Noise(joint) => self.excuse(now, joint, Excuse::Noise),
        }
    }

    /// Looks at all joints. `is_servo`: the joints are to be driven, or were when the controller stopped.
    pub(super) fn look(&mut self, now: Instant, is_servo: bool, plant: &Plant) -> Check {
        if !is_servo {
            self.excuse_all(now, Excuse::State);
        }
        if now - self.looked_at < EVERY {
            return Ok(());
        }
        let shrunk = (now - self.looked_at).as_micros() * SHRINK_PER_SECOND / 1_000_000;
        if now.as_micros() / LATELY.as_micros() != self.looked_at.as_micros() / LATELY.as_micros() {
            self.joints.0.iter_mut().for_each(Held::age);
        }
        self.looked_at = now;
        let by = i32::try_from(shrunk).unwrap_or(i32::MAX).min(1_000_000);
        Joint::ALL.into_iter().try_for_each(|joint| self.look_at(now, joint, by, plant))
    }

    fn look_at(&mut self, now: Instant, joint: Joint, by: i32, plant: &Plant) -> Check {
        let (angle, torque) = (plant.angle(joint), plant.torque(joint));
        if torque.is_none() {
            self.excuse(now, joint, Excuse::Power);
        }
        let held = &mut self.joints[joint];
        let Some(goal) = held.goal else { return Ok(()) };
        let [mut goals, old] = held.goals;
        goals.reach(old.low);
        goals.reach(old.high);
        if let Some((_, until)) = held.excuse {
            if torque == Some(Torque::On) && now >= until {
                held.excuse = None;
                held.span = goals;
                held.span.reach(angle);
            }
            return Ok(());
        }
        held.span.shrink(goals, angle, by);
        let Held { span, .. } = *held;
        ensure(span.excess(angle) <= TOLERANCE, || {
            format!(
                "joint {} moved by itself to {angle} millidegrees with the goal {goal} and torque {torque:?}; \
                 it may be from {} to {}",
                joint.number(),
                span.low,
                span.high
            )
        })
    }
}

/// What a frame tells one servo, as far as it matters here.
#[derive(Clone, Copy, Debug)]
enum Command {
    /// To go to this angle, in millidegrees.
    Goal(Joint, i32),
    /// Something that the controller never said.
    Noise(Joint),
}

fn goal(item: &[u8]) -> Option<Command> {
    let &[id, high, low, ..] = item else { return None };
    let counts = u16::from_be_bytes([high, low]);
    Joint::from_index(id).map(|joint| Command::Goal(joint, millidegrees(joint, counts)))
}

/// The angle of a joint whose servo is at this position, with no offset.
fn millidegrees(joint: Joint, counts: u16) -> i32 {
    let MicroDegrees(angle) = angle_from_counts(joint, counts, 0);
    angle / 1_000
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_contains_a_joint_that_lags_behind_and_not_one_that_falls() {
        let goal = Span::at(10_000);
        let mut span = Span { low: 0, high: 10_000 };
        span.shrink(goal, 2_000, 3_000);
        assert_eq!((span.low, span.high), (2_000, 10_000), "not past the joint");
        span.shrink(goal, 9_900, 8_000);
        assert_eq!((span.low, span.excess(9_900)), (9_900, 0));
        span.shrink(goal, 4_000, 0);
        assert_eq!(span.excess(4_000), 5_900, "back is no way to the goal");
        span.shrink(goal, 11_000, 0);
        assert_eq!(span.excess(11_000), 1_000);
    }
}
