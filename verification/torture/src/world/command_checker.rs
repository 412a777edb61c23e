//! Checks the commands to the servos (D10, D12, D13).
//!
//! - No goal is out of reach at the allowed speed.
//! - Goals are sent only in motor state servo, and torque switches follow the motor state.
//! - Until the end of start-up, and to silent servos, only reads are sent.
//! - Torque is switched on only where a servo stands, or was read on. After an unanswered question it is read before the
//!   next goal (D28, D29).
//! - A joint that lost its torque holds where it gets torque again, unless the host wrote a target meanwhile (D28, D29).
//! - A goal that no speed allows comes nearer to the measured position, because the joint gives way (D27).

use motion_core::calibration::{MicroDegrees, counts_from_angle};
use motion_core::servo_bus::Torque;
use motion_core::{CYCLE, TorqueCodes};
use protocol_core::registers::map::{
    LIMITS, MISSING_SERVOS, MOTOR_STATE, MOVING_JOINTS, SPEED, TARGET_POSITION, limit, motor_state,
};
use protocol_core::registers::{Joint, RegisterFile};
use protocol_core::time::{Duration, Instant};

use super::attempts::EngagementAttempts;
use super::disturbed_bus::{Availability, DisturbedBus};
use super::reachable_range::ReachableRange;
use super::register_model::RegisterModel;
use super::servo_replies::ServoReplies;
use crate::linkage_goals::LinkageGoals;
use crate::per_joint::PerJoint;
use crate::violation::{Check, Violation, ensure};

/// Start-up ends after this time at the latest (D12).
const MAX_START_UP: Duration = Duration::from_millis(500);
/// The number of reads without a reply after which a servo is silent: three have failed (D12), one may be in progress.
const MAX_UNANSWERED: u8 = 4;

/// A servo that has responded for this long has shown its torque.
const ANSWERS_AFTER: Duration = Duration::from_millis(3_000);

/// A joint that had no goal for this long is let go, unless it is silent: an alarm freed it. It is not driven any more.
const LET_GO_TIME: Duration = Duration::from_millis(10_000);

/// A joint that had no goal for this long is not driven at present.
const FOLLOWED_TIME: Duration = Duration::from_millis(1_000);

/// Counts of one control cycle at 372 degrees/s. A set-point may be ahead of the last goal by one cycle, and by one more
/// for each cycle in which a read delays the goals.
const ONE_CYCLE: u16 = 19;

/// The commands that the servos have received.
#[derive(Debug)]
pub(super) struct CommandChecker {
    codes: TorqueCodes,
    /// The largest distance of a set-point from the last goal, in counts, and its time.
    ahead: u16,
    ahead_time: Duration,
    started_at: Instant,
    ranges: PerJoint<Option<ReachableRange>>,
    /// The ranges of joints that get no goals for the time being. Their set-points stand still (D29).
    paused: PerJoint<Option<ReachableRange>>,
    /// When a joint last got no goal beside others that did.
    pub(super) paused_at: PerJoint<Instant>,
    /// When a joint last got a goal.
    pub(super) goal_at: PerJoint<Instant>,
    /// The last goal of a joint whose servo was lost, and its tolerance in counts. A found servo may continue from that
    /// goal (D12). The tolerance grows when offsets change.
    kept_goals: PerJoint<Option<(u16, u16)>>,
    /// The joint had no goal since the start: its first one may be the goal that its servo holds (D12).
    is_first: PerJoint<bool>,
    /// The joint is not driven any more, whatever its servo does: its next torque is for a new goal.
    is_released: PerJoint<bool>,
    /// True if the last command switched the torque on. False for a lost servo.
    is_on: PerJoint<bool>,
    replies: ServoReplies,
    wire_free_at: Instant,
    linkage: LinkageGoals,
    /// When each joint was last given torque, when its servo was last lost, and when the host last wrote its target.
    engaged_at: PerJoint<Option<Instant>>,
    servo_lost_at: PerJoint<Option<Instant>>,
    target_written_at: PerJoint<Option<Instant>>,
    /// How often each joint was given torque since register 29 was written.
    attempts: PerJoint<EngagementAttempts>,
    pub(super) count: u64,
    pub(super) engagements: u64,
}

/// The state of the arm when a command is sent.
pub(super) struct CommandContext<'a> {
    pub(super) now: Instant,
    pub(super) registers: &'a RegisterFile,
    pub(super) model: &'a RegisterModel,
    pub(super) bus: &'a DisturbedBus,
}

impl CommandChecker {
    pub(super) fn new(now: Instant, codes: TorqueCodes, servo_timeout: Duration) -> Self {
        let cycles = 1 + servo_timeout.as_micros() / CYCLE.as_micros();
        Self {
            codes,
            ahead_time: Duration::from_micros(servo_timeout.as_micros() + 2 * CYCLE.as_micros()),
            ahead: ONE_CYCLE.saturating_mul(u16::try_from(cycles).unwrap_or(u16::MAX)),
            started_at: now,
            ranges: PerJoint::all(None),
            paused: PerJoint::all(None),
            paused_at: PerJoint::all(now),
            goal_at: PerJoint::all(now),
            kept_goals: PerJoint::all(None),
            is_first: PerJoint::all(true),
            is_released: PerJoint::all(false),
            is_on: PerJoint::all(false),
            replies: ServoReplies::new(codes),
            wire_free_at: now,
            linkage: LinkageGoals::default(),
            engaged_at: PerJoint::all(None),
            servo_lost_at: PerJoint::all(None),
            target_written_at: PerJoint::all(None),
            attempts: PerJoint::default(),
            count: 0,
            engagements: 0,
        }
    }

    /// Takes bytes that the controller receives.
    pub(super) fn replies_received(&mut self, now: Instant, bytes: &[u8]) {
        self.replies.received(now, bytes);
    }

    /// The arm finds its supply lost only after its driven servos were silent, and while none answers with torque (D29).
    pub(super) fn check_lost_supply(&self, now: Instant, bus: &DisturbedBus) -> Check {
        let responding_for = |joint: Joint| match bus.availability(joint) {
            Availability::Responding(since) => now - since,
            Availability::Silent(_) | Availability::Uncertain => Duration::ZERO,
        };
        let was_silent = |joint: Joint| {
            self.replies.was_silent_for_a_second(joint, now) || responding_for(joint) == Duration::ZERO
        };
        let holds = |joint: Joint| {
            let answers = responding_for(joint) > ANSWERS_AFTER && self.replies.is_steady(joint, now);
            answers && bus.has_torque(joint) && !bus.may_be_let_go(joint, now)
        };
        let any_silent = Joint::ALL.into_iter().any(was_silent);
        let holding = Joint::ALL.into_iter().find(|joint| holds(*joint)).map(Joint::number);
        ensure(!bus.is_undisturbed(now) || (any_silent && holding.is_none()), || {
            format!(
                "the supply counts as lost, after a silence: {any_silent}, and joint {holding:?} has torque"
            )
        })
    }

    /// The last position that the controller has read, in counts.
    pub(super) fn measured(&self, joint: Joint) -> Option<u16> {
        self.replies.position(joint)
    }

    pub(super) fn is_on(&self, joint: Joint) -> bool {
        self.is_on[joint]
    }

    /// The goal that the servo of a joint held with torque before the controller started, in counts. Until the joint has
    /// torque from this controller, its goal may be this one (D12).
    pub(super) fn held_goal(&self, joint: Joint) -> Option<u16> {
        self.replies.held_goal(joint).filter(|_| self.is_first[joint])
    }

    /// The last goal of a joint that is driven.
    pub(super) fn goal(&self, joint: Joint) -> Option<u16> {
        self.ranges[joint].or(self.paused[joint]).map(|range| range.last_goal)
    }

    /// True if the joint was given torque, or was silent since then.
    fn is_driven(&self, joint: Joint) -> bool {
        (self.is_on[joint] && !self.is_released[joint]) || self.kept_goals[joint].is_some()
    }

    /// True if the joint was given torque so often that only a write of register 29 gives it torque again (D28).
    pub(super) fn is_exhausted(&self, joint: Joint) -> bool {
        self.attempts[joint].is_exhausted
    }

    /// The host wrote the target of a joint.
    pub(super) fn target_written(&mut self, now: Instant, joint: Joint) {
        self.target_written_at[joint] = Some(now);
    }

    /// Register 29 was written: the attempts count anew (D28).
    pub(super) fn state_written(&mut self) {
        self.attempts = PerJoint::default();
        self.replies.forget_outage();
    }

    /// True if the controller may not know yet whether the supply was lost (D29). While a servo does not answer, no joint
    /// gets torque then.
    pub(super) fn is_undecided(&self) -> bool {
        self.replies.was_outage()
    }

    /// The joint is no longer driven. Its next goal need not be near the last one.
    pub(super) fn forget(&mut self, joint: Joint) {
        self.linkage.reset();
        (self.ranges[joint], self.paused[joint]) = (None, None);
        self.kept_goals[joint] = None;
        self.is_first[joint] = false;
        self.is_released[joint] = true;
        self.replies.forget_doubt(joint);
    }

    /// The joint's servo was lost. It may hold its last goal.
    pub(super) fn servo_lost(&mut self, now: Instant, joint: Joint) {
        self.linkage.reset();
        self.servo_lost_at[joint] = Some(now);
        // A joint that has only its goal has no torque to keep: it engages anew where it is.
        let had_torque = self.is_driven(joint) && now - self.goal_at[joint] < LET_GO_TIME;
        let goal = self.goal(joint).map(|goal| (goal, self.ahead)).or(self.kept_goals[joint]);
        self.kept_goals[joint] = goal.filter(|_| had_torque);
        (self.ranges[joint], self.paused[joint]) = (None, None);
        self.is_on[joint] = false;
    }

    /// A written speed is allowed until the next frame, even if another write replaces it.
    pub(super) fn speed_written(&mut self, model: &RegisterModel) {
        for (joint, ranges) in Joint::ALL.into_iter().zip(self.ranges.0.iter_mut().zip(&mut self.paused.0)) {
            for range in [ranges.0, ranges.1].into_iter().flatten() {
                range.allow_speed(joint, model.get(SPEED.of(joint)));
            }
        }
    }

    /// Offsets changed: the controller computes its set-points again, from whole counts. Its targets stay in degrees, so
    /// that they are elsewhere in counts, as after a write.
    pub(super) fn offsets_changed(&mut self, now: Instant) {
        self.linkage.reset();
        self.target_written_at = PerJoint::all(Some(now));
        self.ranges.0.iter_mut().flatten().for_each(ReachableRange::widen);
        self.paused.0.iter_mut().flatten().for_each(ReachableRange::widen);
        self.kept_goals.0.iter_mut().flatten().for_each(|(_, tolerance)| *tolerance += 1);
    }

    /// Checks a frame to the servos.
    pub(super) fn check(&mut self, frame: &[u8], context: &CommandContext<'_>) -> Check {
        self.count += 1;
        ensure(context.now >= self.wire_free_at, || "a frame before the end of the last one".to_owned())?;
        self.wire_free_at = context.now + Duration::from_micros(10 * frame.len() as u64);
        let [0xFF, 0xFF, id, length, body @ .., sum] = frame else { return Err(invalid_frame(frame)) };
        let covered = body.iter().fold(id.wrapping_add(*length), |sum, byte| sum.wrapping_add(*byte));
        let is_whole = usize::from(*length) == body.len() + 1 && *sum == !covered;
        match body {
            _ if !is_whole => Err(invalid_frame(frame)),
            [2, 56, count @ 8..=11] | [2, 40, count @ 24..=27] if *id < 7 => {
                let joint = Joint::from_index(*id).ok_or_else(|| invalid_frame(frame))?;
                let has_goals = context.now - self.goal_at[joint] < FOLLOWED_TIME;
                let is_driven = self.is_driven(joint) && (has_goals || self.kept_goals[joint].is_some());
                self.replies.asked(context.now, joint, *count, is_driven);
                Ok(())
            }
            _ if self.is_starting(context.now) => {
                Err(Violation(format!("{frame:02x?} before the end of start-up")))
            }
            [0x83, 40, 1, items @ ..] if *id == 0xFE => self.check_torque_switches(items, context),
            [0x83, 42, 6, items @ ..] if *id == 0xFE => self.check_goals(items, context),
            _ => Err(invalid_frame(frame)),
        }
    }

    fn is_starting(&self, now: Instant) -> bool {
        now < self.started_at + MAX_START_UP && !self.replies.have_all_started()
    }

    /// Torque switches are set to the motor state in register 29 (D13).
    fn check_torque_switches(&mut self, items: &[u8], context: &CommandContext<'_>) -> Check {
        let state = context.registers.get(MOTOR_STATE.address);
        let torque = match state {
            motor_state::SERVO => Torque::On,
            motor_state::FORCELESS => Torque::Free,
            _ => Torque::Damping,
        };
        for item in items.chunks(2) {
            let [id, code] = *item else { return Err(invalid_frame(items)) };
            let Some(joint) = Joint::from_index(id) else { return Err(invalid_frame(items)) };
            if torque == Torque::On && code == self.codes.code(Torque::Damping) {
                self.check_torque_off(joint, context)?;
                continue;
            }
            ensure(code == self.codes.code(torque), || {
                format!("the torque switch of joint {} is set to {code} in state {state}", joint.number())
            })?;
            if torque == Torque::On {
                self.check_torque_on(joint, context)?;
            }
            self.is_on[joint] = torque == Torque::On;
        }
        Ok(())
    }

    /// Only a servo that holds no torque is switched off in state servo (D28).
    fn check_torque_off(&mut self, joint: Joint, context: &CommandContext<'_>) -> Check {
        let bus = context.bus;
        let is_known = bus.is_undisturbed(context.now) && !bus.may_be_misread(joint, context.now);
        ensure(!is_known || !bus.has_torque(joint), || {
            format!("joint {} holds its torque and is freed in state servo", joint.number())
        })?;
        self.forget(joint);
        self.is_on[joint] = false;
        Ok(())
    }

    /// Torque is switched on where a joint stands, and refreshed where it was read on.
    fn check_torque_on(&mut self, joint: Joint, context: &CommandContext<'_>) -> Check {
        let number = joint.number();
        self.check_responding(joint, "is given torque", context)?;
        let is_fresh = self.replies.take_read_on(joint);
        let is_released = std::mem::take(&mut self.is_released[joint]);
        let is_known = context.bus.is_undisturbed(context.now);
        let is_engaging = !self.is_on[joint]
            || is_released
            || self.replies.was_read_off(joint)
            || (context.bus.is_free(joint) && is_known);
        if !is_engaging {
            return ensure(is_fresh || !is_known, || {
                format!("the torque of joint {number} is refreshed, but was not read on since the last time")
            });
        }
        // The goal may be missing in the last frame of goals. What counts is that its servo has it.
        let range = self.ranges[joint]
            .or(self.paused[joint])
            .ok_or_else(|| Violation(format!("joint {number} is given torque without a goal")))?;
        self.check_position(joint, range.last_goal, "is given torque", context)?;
        self.check_servo_goal(joint, range.last_goal, context)?;
        self.kept_goals[joint] = None;
        self.is_first[joint] = false;
        self.replies.forget_doubt(joint);
        self.check_held_target(joint, range.last_goal, context)?;
        self.engaged_at[joint] = Some(context.now);
        self.attempts[joint].add(context.now);
        self.engagements += 1;
        Ok(())
    }

    /// A servo without torque holds the goal that was sent to it, so that it does not go to an older one with its torque.
    fn check_servo_goal(&self, joint: Joint, goal: u16, context: &CommandContext<'_>) -> Check {
        let bus = context.bus;
        let held = bus.servo_goal(joint);
        let is_known = bus.is_undisturbed(context.now) && !bus.may_be_misread(joint, context.now);
        ensure(!is_known || !bus.is_free(joint) || held.abs_diff(goal) <= 1, || {
            format!("joint {} is given torque with the goal {held} instead of {goal}", joint.number())
        })
    }

    /// The target of a joint that lost its torque since it was last given torque is where it gets torque again, unless the
    /// host wrote one since then.
    fn check_held_target(&self, joint: Joint, goal: u16, context: &CommandContext<'_>) -> Check {
        let bus = context.bus;
        let Some((lost_at, engaged_at)) = bus.truth(joint).lost_at().zip(self.engaged_at[joint]) else {
            return Ok(());
        };
        // Before it lost its torque, the servo may have been silent: a target that came then is taken, too (D12).
        let silent_at = self.servo_lost_at[joint].filter(|at| *at > engaged_at);
        let since = silent_at.map_or(lost_at, |at| at.min(lost_at));
        let is_written = self.target_written_at[joint].is_some_and(|at| at >= since);
        let is_known = bus.is_undisturbed(context.now) && !bus.may_be_misread(joint, context.now);
        let target = context.registers.get(TARGET_POSITION.of(joint));
        if lost_at < engaged_at || is_written || !is_known || matches!(target, 0 | 180) {
            return Ok(());
        }
        let wanted = target_counts(joint, context.registers, context.model);
        ensure(goal.abs_diff(wanted) <= degree(joint) / 2 + 1, || {
            format!(
                "joint {} gets torque again at {goal} counts, and its target is {target} degrees ({wanted} counts)",
                joint.number()
            )
        })
    }

    /// A silent servo receives only reads (D12).
    fn check_responding(&self, joint: Joint, what: &str, context: &CommandContext<'_>) -> Check {
        let is_flagged = context.registers.get(MISSING_SERVOS.address) & joint.bit() != 0;
        // On a disturbed bus the controller may decode a reply that this decoder misses.
        let unanswered = self.replies.unanswered(joint);
        let is_silent = unanswered >= MAX_UNANSWERED && context.bus.is_undisturbed(context.now);
        ensure(!is_flagged && !is_silent, || {
            let number = joint.number();
            format!("joint {number} {what} while its servo is silent: {unanswered} reads without a reply")
        })
    }

    /// A joint starts from its position, or from a near goal that it kept while its servo was lost or the controller
    /// restarted (D12).
    fn check_position(&self, joint: Joint, goal: u16, what: &str, context: &CommandContext<'_>) -> Check {
        let bus = context.bus;
        let held = self.held_goal(joint).map(|held| (held, 1));
        let is_at = |(kept, tolerance): (u16, u16)| goal.abs_diff(kept) <= tolerance;
        let is_kept = self.kept_goals[joint].into_iter().chain(held).any(is_at);
        let degrees = if is_kept { 4 } else { 1 };
        let fall = if bus.has_torque(joint) { 0 } else { MAX_FALL };
        // After its reading the joint may go on moving: the servo may execute a corrupted goal. A reply may be old.
        let speed = u64::from(bus.last_status(joint).speed);
        let moved = (bus.reply_age(joint).as_micros() * 1_757 + FRESH_FOR.as_micros() * speed) / 1_000_000;
        let error = bus.position_tolerance(joint, context.now);
        let tolerance = u64::from(degrees * degree(joint) + fall) + moved + error;
        let position = bus.position(joint);
        let is_near =
            u64::from(goal.abs_diff(position)) <= tolerance || bus.may_be_misread(joint, context.now);
        ensure(is_near, || {
            format!("joint {} {what} at {position} counts with the goal {goal}", joint.number())
        })
    }

    fn check_goals(&mut self, items: &[u8], context: &CommandContext<'_>) -> Check {
        let state = context.registers.get(MOTOR_STATE.address);
        ensure(state == motor_state::SERVO, || format!("goals are sent in motor state {state}"))?;
        let mut has_goal = PerJoint::all(false);
        for item in items.chunks(7) {
            let &[id, high, low, ref rest @ ..] = item else { return Err(invalid_frame(items)) };
            let Some(joint) = Joint::from_index(id) else { return Err(invalid_frame(items)) };
            ensure(*rest == [0, 10, 0, 0], || {
                format!("time and speed of joint {}: {rest:?}", joint.number())
            })?;
            has_goal[joint] = true;
            self.goal_at[joint] = context.now;
            self.check_responding(joint, "is driven", context)?;
            self.check_goal(joint, u16::from_be_bytes([high, low]), context)?;
        }
        for joint in Joint::ALL.into_iter().filter(|joint| !has_goal[*joint]) {
            self.paused[joint] = self.ranges[joint].take().or(self.paused[joint]);
            self.paused_at[joint] = context.now;
        }
        self.check_linkage(context)
    }

    /// The goals of joints 2 and 3 keep the linkage, if it limits them (D25). A joint that gives way may leave it (D27).
    fn check_linkage(&mut self, context: &CommandContext<'_>) -> Check {
        let [_, two, three, ..] = Joint::ALL;
        let gives_way = |joint| context.bus.truth(joint).may_give_way(context.now);
        let is_off = context.registers.get(LIMITS.address) & limit::LINKAGE == 0;
        if is_off || gives_way(two) || gives_way(three) {
            self.linkage.reset();
            return Ok(());
        }
        let offset = |joint| context.model.offset(joint);
        let goal = |joint| self.ranges[joint].map(|range: ReachableRange| range.last_goal);
        self.linkage.check([goal(two), goal(three)], [offset(two), offset(three)])
    }

    fn check_goal(&mut self, joint: Joint, goal: u16, context: &CommandContext<'_>) -> Check {
        let speed = context.registers.get(SPEED.of(joint));
        let ahead = self.replies.take_trusted_time(joint, context.now, self.ahead_time);
        let paused = self.paused[joint].take().map(|range| range.resumed(context.now, ahead));
        let before = self.ranges[joint].or(paused);
        let reached = before.and_then(|range| range.after(joint, goal, speed, context.now));
        let new = ReachableRange::at(joint, goal, speed, context.now);
        // A joint without torque that engages anew where it is did not move there.
        let is_engaging = !self.is_on[joint] || self.replies.was_read_off(joint);
        self.ranges[joint] = reached.filter(|_| paused.is_none() && !is_engaging).or(Some(new));
        self.check_doubt(joint, goal, context)?;
        match before {
            _ if reached.is_some() => check_arrival(joint, goal, context),
            Some(before) if self.gives_way(joint, before, goal, context) => {
                check_arrival(joint, goal, context)
            }
            Some(before) if paused.is_none() && !self.replies.was_read_off(joint) => Err(Violation(format!(
                "joint {} gets the goal {goal} after {}, out of reach with speed {speed}",
                joint.number(),
                before.last_goal
            ))),
            _ => {
                self.linkage.reset();
                self.check_position(joint, goal, "is driven", context)
            }
        }
    }

    /// A servo without torque gets no goal but where it stands. After an unanswered question its torque is read first
    /// (D29).
    fn check_doubt(&self, joint: Joint, goal: u16, context: &CommandContext<'_>) -> Check {
        if !context.bus.is_undisturbed(context.now) {
            return Ok(());
        }
        ensure(!self.replies.is_doubtful(joint), || {
            format!("joint {} gets a goal, but its torque was not read after a silence", joint.number())
        })?;
        if context.bus.is_free(joint) {
            return self.check_position(joint, goal, "gets a goal without torque", context);
        }
        Ok(())
    }

    /// True if this goal brings the set-point of a joint that pushes too hard nearer to the measured position (D27).
    fn gives_way(
        &self,
        joint: Joint,
        before: ReachableRange,
        goal: u16,
        context: &CommandContext<'_>,
    ) -> bool {
        let speed = context.registers.get(SPEED.of(joint));
        let reached = |position| before.giving_way(position).after(joint, goal, speed, context.now);
        let is_nearer = self.replies.position(joint).and_then(reached).is_some();
        is_nearer && context.bus.truth(joint).may_give_way(context.now)
    }
}

fn invalid_frame(bytes: &[u8]) -> Violation {
    Violation(format!("not a command to servos: {bytes:02x?}"))
}

/// Counts of a degree, with the rounding of a reading.
fn degree(joint: Joint) -> u16 {
    if joint.number() < 5 { 5 } else { 4 }
}

/// The controller reads a joint again before it gives torque later than this after a reading.
const FRESH_FOR: Duration = Duration::from_millis(20);
/// Counts that a joint without torque may fall in that time, at 130 degrees/s.
const MAX_FALL: u16 = 12;

/// The servo position of a joint's target register.
pub(super) fn target_counts(joint: Joint, registers: &RegisterFile, model: &RegisterModel) -> u16 {
    let degrees = MicroDegrees::from_degrees(registers.get(TARGET_POSITION.of(joint)));
    counts_from_angle(joint, model.host_target(joint).unwrap_or(degrees), model.offset(joint))
}

/// The goal of a joint that has arrived is its target. A target that the host did not write is the measured position,
/// rounded to degrees and limited to 0..=180.
fn check_arrival(joint: Joint, goal: u16, context: &CommandContext<'_>) -> Check {
    if context.registers.get(MOVING_JOINTS.address) & joint.bit() != 0 {
        return Ok(());
    }
    let target = context.registers.get(TARGET_POSITION.of(joint));
    let tolerance = match (context.model.has_host_target[joint], target) {
        (true, _) => 1,
        (false, 0 | 180) => return Ok(()),
        (false, _) => degree(joint) / 2 + 1,
    };
    let wanted = target_counts(joint, context.registers, context.model);
    ensure(goal.abs_diff(wanted) <= tolerance, || {
        format!(
            "joint {} has arrived at {target} degrees ({wanted} counts), but its goal is {goal}",
            joint.number()
        )
    })
}
