//! What the controller may tell the servos: never to jump, never faster than allowed, nothing while the
//! joints are not to be driven (D10, D12, D13).

use motion_core::TorqueCodes;
use motion_core::calibration::{MicroDegrees, counts_from_angle};
use motion_core::servo_bus::Torque;
use protocol_core::registers::map::{
    MOTOR_STATE, MOVING_JOINTS, OFFSET, SPEED, TARGET_POSITION, motor_state,
};
use protocol_core::registers::{Joint, RegisterFile};
use protocol_core::time::{Duration, Instant};

use super::model::Model;
use super::servos::Servos;
use crate::per_joint::PerJoint;
use crate::violation::{Check, Violation, ensure};

/// A thousand-millionth of a count: the unit of the arithmetic here.
const COUNT: i64 = 1_000_000_000;
/// A shell that is late makes up for one control cycle, and is in the middle of another.
const SLACK: Duration = Duration::from_millis(20);
/// Rounding to counts, at both ends of a way.
const ROUNDING: i64 = COUNT + COUNT / 100;

/// Where a joint may be told to go.
#[derive(Clone, Copy, Debug)]
struct Reach {
    /// The least of: any earlier goal, and what could be made since at the speed allowed.
    upper: i64,
    lower: i64,
    last: u16,
    speed: i64,
    at: Instant,
}

/// What was told to the servos so far.
#[derive(Debug)]
pub(super) struct Commands {
    codes: TorqueCodes,
    reach: PerJoint<Option<Reach>>,
    /// Was torque on, when last told?
    is_on: PerJoint<bool>,
    wire_free_at: Instant,
    pub(super) count: u64,
    pub(super) engagements: u64,
}

/// What a command is judged by.
pub(super) struct Circumstances<'a> {
    pub(super) now: Instant,
    pub(super) arm: &'a RegisterFile,
    pub(super) model: &'a Model,
    pub(super) servos: &'a Servos,
}

impl Commands {
    pub(super) fn new(now: Instant, codes: TorqueCodes) -> Self {
        let (reach, is_on) = (PerJoint::all(None), PerJoint::all(false));
        Self { codes, reach, is_on, wire_free_at: now, count: 0, engagements: 0 }
    }

    pub(super) fn is_on(&self, joint: Joint) -> bool {
        self.is_on[joint]
    }

    /// The last goal of a joint that is driven.
    pub(super) fn goal(&self, joint: Joint) -> Option<u16> {
        self.reach[joint].map(|reach| reach.last)
    }

    /// The joint is not driven any more: where it goes next has nothing to do with where it was.
    pub(super) fn forget(&mut self, joint: Joint) {
        self.reach[joint] = None;
    }

    /// A speed was written: it is in force until the next frame, or until it is written again.
    pub(super) fn speed_written(&mut self, model: &Model) {
        for (joint, reach) in Joint::ALL.into_iter().zip(&mut self.reach.0) {
            if let Some(reach) = reach {
                reach.speed = reach.speed.max(limit(joint, model.get(SPEED.of(joint))));
            }
        }
    }

    /// Offsets changed: places are reckoned anew, from whole counts.
    pub(super) fn places_are_renamed(&mut self) {
        for reach in self.reach.0.iter_mut().flatten() {
            reach.upper += COUNT;
            reach.lower -= COUNT;
        }
    }

    /// Judges a frame to the servos.
    pub(super) fn judge(&mut self, frame: &[u8], here: &Circumstances<'_>) -> Check {
        self.count += 1;
        ensure(here.now >= self.wire_free_at, || "two frames at once on the servo bus".to_owned())?;
        self.wire_free_at = here.now + Duration::from_micros(10 * frame.len() as u64);
        let [0xFF, 0xFF, id, length, body @ .., sum] = frame else { return Err(no_frame(frame)) };
        let covered = body.iter().fold(id.wrapping_add(*length), |sum, byte| sum.wrapping_add(*byte));
        let is_whole = usize::from(*length) == body.len() + 1 && *sum == !covered;
        match body {
            _ if !is_whole => Err(no_frame(frame)),
            [2, 56, 8..=16] if *id < 7 => Ok(()),
            [0x83, 40, 1, items @ ..] if *id == 0xFE => self.judge_torque(items, here),
            [0x83, 42, 6, items @ ..] if *id == 0xFE => self.judge_goals(items, here),
            _ => Err(no_frame(frame)),
        }
    }

    fn judge_torque(&mut self, items: &[u8], here: &Circumstances<'_>) -> Check {
        for item in items.chunks(2) {
            let [id, code] = *item else { return Err(no_frame(items)) };
            let Some(joint) = Joint::from_index(id) else { return Err(no_frame(items)) };
            let is_on = code == self.codes.code(Torque::On);
            if is_on {
                check_state(here, || format!("torque on for joint {}", joint.number()))?;
            }
            if is_on && !self.is_on[joint] {
                let reach = self.reach[joint];
                let goal = reach
                    .ok_or_else(|| Violation(format!("joint {} has torque and no goal", joint.number())))?;
                check_place(joint, goal.last, "is given torque", here)?;
                self.engagements += 1;
            }
            self.is_on[joint] = is_on;
        }
        Ok(())
    }

    fn judge_goals(&mut self, items: &[u8], here: &Circumstances<'_>) -> Check {
        check_state(here, || "goals".to_owned())?;
        let mut told = PerJoint::all(false);
        for item in items.chunks(7) {
            let &[id, high, low, ref rest @ ..] = item else { return Err(no_frame(items)) };
            let Some(joint) = Joint::from_index(id) else { return Err(no_frame(items)) };
            ensure(*rest == [0, 10, 0, 0], || {
                format!("time and speed of joint {}: {rest:?}", joint.number())
            })?;
            told[joint] = true;
            self.judge_goal(joint, u16::from_be_bytes([high, low]), here)?;
        }
        for joint in Joint::ALL.into_iter().filter(|joint| !told[*joint]) {
            self.forget(joint);
        }
        Ok(())
    }

    fn judge_goal(&mut self, joint: Joint, goal: u16, here: &Circumstances<'_>) -> Check {
        let speed = limit(joint, here.arm.get(SPEED.of(joint)));
        let place = i64::from(goal) * COUNT;
        let Some(before) = self.reach[joint] else {
            check_place(joint, goal, "is driven", here)?;
            let reach = Reach { upper: place, lower: place, last: goal, speed, at: here.now };
            self.reach[joint] = Some(reach);
            return Ok(());
        };
        let fastest = speed.max(before.speed);
        let made = fastest * micros(here.now - before.at);
        let slack = fastest * micros(SLACK) + ROUNDING;
        let (upper, lower) = (before.upper + made, before.lower - made);
        ensure(place <= upper + slack && place >= lower - slack, || {
            let (number, register) = (joint.number(), here.arm.get(SPEED.of(joint)));
            format!(
                "joint {number} is told to go from {} to {goal} counts with speed {register}",
                before.last
            )
        })?;
        // What was made at a higher speed is not to be made up for at a lower one.
        let is_slower = speed < before.speed;
        let (upper, lower) = if is_slower { (place, place) } else { (upper.min(place), lower.max(place)) };
        self.reach[joint] = Some(Reach { upper, lower, last: goal, speed, at: here.now });
        check_arrival(joint, goal, here)
    }
}

fn no_frame(bytes: &[u8]) -> Violation {
    Violation(format!("no servo would understand {bytes:02x?}"))
}

fn micros(time: Duration) -> i64 {
    i64::try_from(time.as_micros()).unwrap_or(i64::MAX).min(10_000_000)
}

/// Thousand-millionths of a count per microsecond, rounded up: a unit of the speed register is 1.9 degrees/s,
/// and 0 is 372.
fn limit(joint: Joint, speed: u8) -> i64 {
    let tenths = if speed == 0 { 3_720 } else { i64::from(speed) * 19 };
    tenths * counts_in_half_a_turn(joint) * 100 / 180 + 1
}

fn counts_in_half_a_turn(joint: Joint) -> i64 {
    if joint.number() < 5 { 850 } else { 625 }
}

/// A degree, and the rounding of a measurement.
fn degree(joint: Joint) -> u16 {
    if joint.number() < 5 { 5 } else { 4 }
}

fn check_state(here: &Circumstances<'_>, what: impl FnOnce() -> String) -> Check {
    let state = here.arm.get(MOTOR_STATE.address);
    ensure(state == motor_state::SERVO, || format!("{} in state {state}", what()))
}

fn check_place(joint: Joint, goal: u16, what: &str, here: &Circumstances<'_>) -> Check {
    let place = here.servos.position(joint);
    // A joint may still be on its way when it is measured, and an answer may be old.
    let made_since = here.servos.age_of_answers(joint).as_micros() * 1_757 / 1_000_000;
    let near = u64::from(degree(joint)) + made_since + here.servos.likeness(joint, here.now);
    let is_there = u64::from(goal.abs_diff(place)) <= near || here.servos.is_deceived(joint, here.now);
    ensure(is_there, || format!("joint {} {what} at {place} counts with the goal {goal}", joint.number()))
}

/// The servo position of a joint's target register.
pub(super) fn target_counts(joint: Joint, arm: &RegisterFile) -> u16 {
    let offset = OFFSET.range.decode(arm.get(OFFSET.of(joint)));
    let target = MicroDegrees::from_degrees(arm.get(TARGET_POSITION.of(joint)));
    counts_from_angle(joint, target, i8::try_from(offset).unwrap_or(0))
}

/// A joint that counts as arrived is told to be where the host wanted it, or, if the host did not say, where
/// it was measured: its target, but for the rounding to a degree and what lies beyond 0 and 180.
fn check_arrival(joint: Joint, goal: u16, here: &Circumstances<'_>) -> Check {
    if here.arm.get(MOVING_JOINTS.address) & joint.bit() != 0 {
        return Ok(());
    }
    let target = here.arm.get(TARGET_POSITION.of(joint));
    let off = match (here.model.aimed[joint], target) {
        (true, _) => 1,
        (false, 0 | 180) => return Ok(()),
        (false, _) => degree(joint) / 2 + 1,
    };
    let wanted = target_counts(joint, here.arm);
    ensure(goal.abs_diff(wanted) <= off, || {
        format!(
            "joint {} counts as arrived at {target} degrees, {wanted} counts, and holds {goal}",
            joint.number()
        )
    })
}
