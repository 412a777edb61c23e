//! What the controller may tell the servos: never to jump, never faster than allowed, nothing while the joints are not
//! to be driven; questions only until start-up is over and to silent joints; no torque state but that of register 29
//! (D10, D12, D13).

use motion_core::calibration::{MicroDegrees, counts_from_angle};
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::Decoder;
use motion_core::{CYCLE, TorqueCodes};
use protocol_core::registers::map::{
    MISSING_SERVOS, MOTOR_STATE, MOVING_JOINTS, OFFSET, SPEED, TARGET_POSITION, motor_state,
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
/// Start-up is over by then, whatever the servos do (D12).
const START_UP: Duration = Duration::from_millis(500);
/// Start-up is over before, once so many answers of each servo agree.
const ANSWERS: u8 = 2;
/// A servo that left so many questions unanswered has been silent for three of them (D12): the last may be under way.
const UNANSWERED: u8 = 4;

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

/// The way of one control cycle at 372 degrees/s, in counts: a set-point may be that far past the last goal sent, and for
/// each cycle that a question held the goals up.
const ONE_CYCLE: u16 = 19;

/// What was told to the servos so far.
#[derive(Debug)]
pub(super) struct Commands {
    codes: TorqueCodes,
    /// How far a set-point may be past the last goal sent, in counts.
    ahead: u16,
    started_at: Instant,
    reach: PerJoint<Option<Reach>>,
    /// The goal of a joint whose servo fell silent, and how far off it may be because offsets changed since. The joint
    /// may be driven on from there (D12).
    kept: PerJoint<Option<(u16, u16)>>,
    /// Was torque on, when last told? Not known, so false, of a servo that was silent since.
    is_on: PerJoint<bool>,
    /// Hears what the controller hears.
    decoder: Decoder,
    answers: PerJoint<u8>,
    /// Questions since the last answer.
    unanswered: PerJoint<u8>,
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
    pub(super) fn new(now: Instant, codes: TorqueCodes, servo_timeout: Duration) -> Self {
        let cycles = 1 + servo_timeout.as_micros() / CYCLE.as_micros();
        Self {
            codes,
            ahead: ONE_CYCLE.saturating_mul(u16::try_from(cycles).unwrap_or(u16::MAX)),
            started_at: now,
            reach: PerJoint::all(None),
            kept: PerJoint::all(None),
            is_on: PerJoint::all(false),
            decoder: Decoder::new(),
            answers: PerJoint::all(0),
            unanswered: PerJoint::all(0),
            wire_free_at: now,
            count: 0,
            engagements: 0,
        }
    }

    /// The controller hears these bytes from the servo bus.
    pub(super) fn answered(&mut self, bytes: &[u8]) {
        for piece in bytes.chunks(Decoder::CAPACITY / 2) {
            self.decoder.push(piece);
            while let Some(heard) = self.decoder.pull() {
                let Some(frame) = heard.ok().filter(|frame| frame.params.len() >= 8) else { continue };
                let Some(joint) = Joint::from_index(frame.id) else { continue };
                self.answers[joint] = self.answers[joint].saturating_add(1);
                self.unanswered[joint] = 0;
            }
        }
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
        self.kept[joint] = None;
    }

    /// The joint's servo fell silent. It may go on holding.
    pub(super) fn falls_silent(&mut self, joint: Joint) {
        self.kept[joint] = self.goal(joint).map(|goal| (goal, self.ahead)).or(self.kept[joint]);
        self.reach[joint] = None;
        self.is_on[joint] = false;
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
        self.kept.0.iter_mut().flatten().for_each(|(_, slack)| *slack += 1);
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
            [2, 56, 8..=16] if *id < 7 => {
                let joint = Joint::from_index(*id).ok_or_else(|| no_frame(frame))?;
                self.unanswered[joint] = self.unanswered[joint].saturating_add(1);
                // As the controller does: what was left of earlier answers is none to this question.
                self.decoder.clear();
                Ok(())
            }
            _ if self.is_starting(here.now) => {
                Err(Violation(format!("{frame:02x?}, and start-up is not over")))
            }
            [0x83, 40, 1, items @ ..] if *id == 0xFE => self.judge_torque(items, here),
            [0x83, 42, 6, items @ ..] if *id == 0xFE => self.judge_goals(items, here),
            _ => Err(no_frame(frame)),
        }
    }

    fn is_starting(&self, now: Instant) -> bool {
        now < self.started_at + START_UP && self.answers.0.iter().any(|answers| *answers < ANSWERS)
    }

    /// Torque switches have the state of register 29, and nothing else (D13).
    fn judge_torque(&mut self, items: &[u8], here: &Circumstances<'_>) -> Check {
        let state = here.arm.get(MOTOR_STATE.address);
        let torque = match state {
            motor_state::SERVO => Torque::On,
            motor_state::FORCELESS => Torque::Free,
            _ => Torque::Damping,
        };
        for item in items.chunks(2) {
            let [id, code] = *item else { return Err(no_frame(items)) };
            let Some(joint) = Joint::from_index(id) else { return Err(no_frame(items)) };
            ensure(code == self.codes.code(torque), || {
                format!("the torque switch of joint {} is set to {code} in state {state}", joint.number())
            })?;
            let is_on = torque == Torque::On;
            if is_on {
                self.check_answers(joint, "is given torque", here)?;
            }
            if is_on && !self.is_on[joint] {
                let reach = self.reach[joint];
                let goal = reach
                    .ok_or_else(|| Violation(format!("joint {} has torque and no goal", joint.number())))?;
                self.check_place(joint, goal.last, "is given torque", here)?;
                self.kept[joint] = None;
                self.engagements += 1;
            }
            self.is_on[joint] = is_on;
        }
        Ok(())
    }

    /// To a silent servo nothing but questions is sent (D12).
    fn check_answers(&self, joint: Joint, what: &str, here: &Circumstances<'_>) -> Check {
        let is_flagged = here.arm.get(MISSING_SERVOS.address) & joint.bit() != 0;
        // On a disturbed bus an answer may come together with bytes that hide it from the simple count here.
        let is_silent = self.unanswered[joint] >= UNANSWERED && here.servos.wire_is_quiet(here.now);
        ensure(!is_flagged && !is_silent, || {
            let (number, unanswered) = (joint.number(), self.unanswered[joint]);
            format!("joint {number} {what} and is silent: {unanswered} questions without an answer")
        })
    }

    /// A joint is driven from where it is, or from the goal it kept while its servo was silent, if that is near (D12).
    fn check_place(&self, joint: Joint, goal: u16, what: &str, here: &Circumstances<'_>) -> Check {
        let is_kept = self.kept[joint].is_some_and(|(kept, slack)| goal.abs_diff(kept) <= slack);
        check_place(joint, goal, if is_kept { 3 * degree(joint) } else { 0 }, what, here)
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
            self.check_answers(joint, "is driven", here)?;
            self.judge_goal(joint, u16::from_be_bytes([high, low]), here)?;
        }
        for joint in Joint::ALL.into_iter().filter(|joint| !told[*joint]) {
            self.reach[joint] = None;
        }
        Ok(())
    }

    fn judge_goal(&mut self, joint: Joint, goal: u16, here: &Circumstances<'_>) -> Check {
        let speed = limit(joint, here.arm.get(SPEED.of(joint)));
        let place = i64::from(goal) * COUNT;
        let Some(before) = self.reach[joint] else {
            self.check_place(joint, goal, "is driven", here)?;
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

/// A joint without torque may fall between its measurement and the frame that gives it torque, in counts: 130 degrees/s
/// for 20 ms, past which the arm measures again.
const FALLEN: u16 = 12;

fn check_place(joint: Joint, goal: u16, more: u16, what: &str, here: &Circumstances<'_>) -> Check {
    let place = here.servos.position(joint);
    // A joint may still be on its way when it is measured, and an answer may be old.
    let made_since = here.servos.age_of_answers(joint).as_micros() * 1_757 / 1_000_000;
    let fallen = if here.servos.has_torque(joint) { 0 } else { FALLEN };
    let near = u64::from(degree(joint) + more + fallen) + made_since + here.servos.likeness(joint, here.now);
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
