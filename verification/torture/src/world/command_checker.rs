//! Checks the commands to the servos (D10, D12, D13, D25, D27 to D29).
//!
//! - No goal is out of reach at the allowed speed.
//! - Goals are sent only in motor state servo. Torque switches follow the motor state, apart from torque-off to a servo without
//!   torque (D28).
//! - Until the end of start-up only reads are sent. A silent servo gets neither goals nor torque.
//! - Torque is switched on only at the position of a servo, and refreshed only after it was read as on. After an unanswered
//!   read, the torque is read before the next goal (D28, D29).
//! - A joint that lost its torque holds the position where it gets torque again, unless the host wrote a target meanwhile
//!   (D28, D29).
//! - A goal beyond the allowed speed is nearer to the measured position, because the joint gives way (D27).
//! - Goals of joints 2 and 3 keep the linkage while that limit is on (D25). A joint that has arrived has its target as goal.
//! - A joint that was let go gets torque only after its alarm, and at most three times in a minute (D28).

mod frames;
mod goals;
mod lost_supply;
mod position;
mod torque;

use motion_core::{CYCLE, TorqueCodes};
use protocol_core::registers::map::SPEED;
use protocol_core::registers::{Joint, RegisterFile};
use protocol_core::time::{Duration, Instant};

use super::attempts::EngagementAttempts;
use super::disturbed_bus::DisturbedBus;
use super::reachable_range::ReachableRange;
use super::register_model::RegisterModel;
use super::servo_replies::ServoReplies;
use crate::linkage_goals::LinkageGoals;
use crate::per_joint::PerJoint;
use crate::violation::Violation;
use crate::world_counts::WorldCounts;

/// If a joint gets no goal for this long although its servo answers, it is let go because of an alarm, and no longer driven.
const LET_GO_TIME: Duration = Duration::from_millis(10_000);

/// Counts of one control cycle at 372 degrees/s: 17.6, and a margin. A set-point may be ahead of the last goal by one cycle, and
/// by one more for each cycle in which a read delays the goals.
const ONE_CYCLE: u16 = 19;

/// The checker, with the state that follows from the commands and replies so far.
#[derive(Debug)]
pub(super) struct CommandChecker {
    codes: TorqueCodes,
    /// How far a set-point may be ahead of the last goal, in counts, and the longest time from a goal until a read fails and
    /// stops the set-point.
    ahead: u16,
    ahead_time: Duration,
    started_at: Instant,
    ranges: PerJoint<Option<ReachableRange>>,
    /// The ranges of joints that get no goals at present. Their set-points stand still (D29).
    paused: PerJoint<Option<ReachableRange>>,
    /// When a frame of goals last had no goal for the joint.
    pub(super) paused_at: PerJoint<Instant>,
    /// When a joint last got a goal.
    pub(super) goal_at: PerJoint<Instant>,
    /// The last goal of a joint whose servo was lost, and its tolerance in counts. A servo that answers again may continue from
    /// that goal (D12). The tolerance grows when offsets change.
    kept_goals: PerJoint<Option<(u16, u16)>>,
    /// True until the joint has torque from this controller or is released. Until then its goal may be that of its servo (D12).
    is_first: PerJoint<bool>,
    /// True if the joint is no longer driven, whatever its servo does. Its next torque needs a new goal.
    is_released: PerJoint<bool>,
    /// True if the last command switched the torque on. False for a lost servo.
    is_on: PerJoint<bool>,
    replies: ServoReplies,
    wire_free_at: Instant,
    linkage: LinkageGoals,
    /// When each joint was last given torque, when its servo was last lost, and when the host last wrote its target or an offset.
    engaged_at: PerJoint<Option<Instant>>,
    servo_lost_at: PerJoint<Option<Instant>>,
    target_written_at: PerJoint<Option<Instant>>,
    /// True if the last target came while the joint may have been let go. The target is kept until the joint engages (D28).
    is_written_for_later: PerJoint<bool>,
    /// How often each joint was given torque since register 29 was written.
    attempts: PerJoint<EngagementAttempts>,
    count: u64,
    engagements: u64,
}

/// The state of the arm when a command is sent.
pub(super) struct CommandContext<'a> {
    pub(super) now: Instant,
    pub(super) registers: &'a RegisterFile,
    pub(super) model: &'a RegisterModel,
    pub(super) bus: &'a DisturbedBus,
}

impl CommandContext<'_> {
    /// True if the controller knows the state of the joint's servo.
    fn is_known(&self, joint: Joint) -> bool {
        self.bus.is_undisturbed(self.now) && !self.bus.may_be_misread(joint, self.now)
    }
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
            is_written_for_later: PerJoint::all(false),
            attempts: PerJoint::default(),
            count: 0,
            engagements: 0,
        }
    }

    /// The number of checked commands and engagements.
    pub(super) fn counts(&self) -> WorldCounts {
        WorldCounts { commands: self.count, engagements: self.engagements, ..WorldCounts::default() }
    }

    /// Records the replies in the bytes that the controller receives.
    pub(super) fn replies_received(&mut self, now: Instant, bytes: &[u8]) {
        self.replies.received(now, bytes);
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

    /// True if the joint was given torque and not released, or if its servo was lost since then.
    fn is_driven(&self, joint: Joint) -> bool {
        (self.is_on[joint] && !self.is_released[joint]) || self.kept_goals[joint].is_some()
    }

    /// True if the joint was given torque so often that the controller may wait for a write of register 29 (D28).
    pub(super) fn is_exhausted(&self, joint: Joint) -> bool {
        self.attempts[joint].is_exhausted
    }

    /// Records that the host wrote the target of a joint, and whether the joint may be let go at that time.
    pub(super) fn target_written(&mut self, now: Instant, joint: Joint, may_be_let_go: bool) {
        self.target_written_at[joint] = Some(now);
        self.is_written_for_later[joint] = may_be_let_go;
    }

    /// True if the last target of the host came while the joint may have been let go, and the joint did not engage since (D28).
    pub(super) fn keeps_target(&self, joint: Joint) -> bool {
        self.is_written_for_later[joint] && self.engaged_at[joint] <= self.target_written_at[joint]
    }

    /// Register 29 was written: the attempts count anew (D28), and an outage is forgotten (D29).
    pub(super) fn state_written(&mut self) {
        self.attempts = PerJoint::default();
        self.replies.forget_outage();
    }

    /// True if the controller may not know yet whether the supply was lost (D29). In this case no joint gets
    /// torque while a servo does not answer.
    pub(super) fn is_undecided(&self) -> bool {
        self.replies.was_outage()
    }

    /// The joint is no longer driven. Its next goal need not be near the last one.
    fn forget(&mut self, joint: Joint) {
        self.linkage.reset();
        (self.ranges[joint], self.paused[joint]) = (None, None);
        self.kept_goals[joint] = None;
        self.is_first[joint] = false;
        self.is_released[joint] = true;
        self.replies.forget_doubt(joint);
    }

    /// The motor state changed to or from servo, so each joint begins anew, without a goal.
    pub(super) fn state_changed(&mut self) {
        Joint::ALL.into_iter().for_each(|joint| self.forget(joint));
        // A joint that engages anew keeps a target that the host wrote since the change.
        self.engaged_at = PerJoint::all(None);
    }

    /// The servo of the joint fell silent. It may still hold its last goal.
    pub(super) fn servo_lost(&mut self, now: Instant, joint: Joint) {
        self.linkage.reset();
        self.servo_lost_at[joint] = Some(now);
        // A joint that has a goal but no torque engages anew at its position.
        let had_torque = self.is_driven(joint) && now - self.goal_at[joint] < LET_GO_TIME;
        let goal = self.goal(joint).map(|goal| (goal, self.ahead)).or(self.kept_goals[joint]);
        self.kept_goals[joint] = goal.filter(|_| had_torque);
        (self.ranges[joint], self.paused[joint]) = (None, None);
        self.is_on[joint] = false;
    }

    /// Allows a written speed until the next goal of each joint, even if another write replaces it.
    pub(super) fn speed_written(&mut self, model: &RegisterModel) {
        for (joint, ranges) in Joint::ALL.into_iter().zip(self.ranges.0.iter_mut().zip(&mut self.paused.0)) {
            for range in [ranges.0, ranges.1].into_iter().flatten() {
                range.allow_speed(joint, model.get(SPEED.of(joint)));
            }
        }
    }

    /// Offsets changed: the controller computes its set-points again, from whole counts. The targets stay the same in
    /// degrees, so they change in counts, as after a write.
    pub(super) fn offsets_changed(&mut self, now: Instant) {
        self.linkage.reset();
        self.target_written_at = PerJoint::all(Some(now));
        self.ranges.0.iter_mut().flatten().for_each(ReachableRange::widen);
        self.paused.0.iter_mut().flatten().for_each(ReachableRange::widen);
        self.kept_goals.0.iter_mut().flatten().for_each(|(_, tolerance)| *tolerance += 1);
    }
}

fn invalid_frame(bytes: &[u8]) -> Violation {
    Violation(format!("not a command to servos: {bytes:02x?}"))
}
