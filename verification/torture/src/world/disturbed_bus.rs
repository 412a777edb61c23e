//! The servo bus with disturbances, and the true state of each servo.
//!
//! ```text
//!   controller ──▶ corruption ──────────▶ Plant: seven simulated servos
//!   controller ◀── corruption, delay ◀──
//! ```

use std::collections::VecDeque;

use arm_sim::plant::{Plant, SupplyFault, Thing, Wall};
use arm_sim::servo::{ServoConfig, ServoFault, Trip};
use motion_core::servo_bus::Torque;
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use super::corruption::corrupt;
use super::joint_truth::JointTruth;
use super::motion_checker::{Exemption, MotionChecker};
use super::push_rule::{Push, PushRule};
use super::status_reply::{StatusFields, status_replies, whole_status};
use crate::per_joint::PerJoint;
use crate::seeded_rng::SeededRng;
use crate::violation::Check;

/// A servo does not respond for this long after it is switched on.
const BOOT_TIME: Duration = Duration::from_millis(200);
/// A servo starts in the first step with supply.
const STEP: Duration = Duration::from_millis(1);
/// The longest delay of a reply on the wire.
const MAX_DELAY: Duration = Duration::from_millis(40);
/// Kept bytes of an incomplete reply. The longest reply of a servo is shorter.
const MAX_REPLY: usize = 32;
/// The controller repeats a lost torque frame within this time.
const REPEAT_TIME: Duration = Duration::from_millis(600);
/// Half of a servo timeout with which silent servos do not delay the readings of the others.
const SHORT: Duration = Duration::from_micros(2_500);
/// A servo that has responded for this long is known to the controller.
const SETTLED: Duration = Duration::from_millis(3_000);
/// The controller may accept a false reading if two undetected errors come within this time.
const MISREAD_TIME: Duration = Duration::from_millis(1_000);

/// Whether a servo replies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Availability {
    /// It has replied to every read since this time.
    Responding(Instant),
    /// It has replied to no read since this time.
    Silent(Instant),
    /// It replies to some reads.
    Uncertain,
}

/// The number of disturbed frames in a million.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct DisturbanceRates {
    pub(super) corrupted: u64,
    pub(super) delayed: u64,
}

/// Seven simulated servos behind a disturbed wire.
#[derive(Debug)]
pub(super) struct DisturbedBus {
    plant: Plant,
    motion_checker: MotionChecker,
    truths: PerJoint<JointTruth>,
    /// A hand pushes the joint, a wall is in its way, or a thing is between the claws.
    has_push: PerJoint<bool>,
    has_wall: PerJoint<bool>,
    has_thing: bool,
    push_rules: PerJoint<PushRule>,
    /// The supply of the servos is cut.
    is_stopped: bool,
    settings: ServoConfig,
    disturbance: DisturbanceRates,
    /// Frames that are delayed on the wire, with the time of their arrival.
    delayed: VecDeque<(Instant, Vec<u8>)>,
    faults: PerJoint<Option<ServoFault>>,
    /// The time of the last change of each servo's fault.
    since: PerJoint<Instant>,
    disturbed_at: Instant,
    /// The time of the last restart of the controller alone.
    pub(super) restarted_at: Instant,
    last_status: PerJoint<StatusFields>,
    /// The received part of an incomplete reply.
    partial_reply: Vec<u8>,
    /// A reply with at most the first delay is in time. From the second delay on, it is a timeout.
    timely_limit: Duration,
    late_limit: Duration,
    /// The last undetected error in a reply of each servo, and the time until which a false reading may be in use.
    undetected_error_at: PerJoint<Instant>,
    misread_until: PerJoint<Instant>,
    pub(super) disturbed_frames: u64,
    pub(super) undetected_errors: u64,
}

impl DisturbedBus {
    pub(super) fn new(
        now: Instant,
        settings: ServoConfig,
        [timely_limit, late_limit]: [Duration; 2],
    ) -> Self {
        Self {
            plant: Plant::with_config(now, settings),
            motion_checker: MotionChecker::new(now),
            truths: PerJoint::default(),
            has_push: PerJoint::default(),
            has_wall: PerJoint::default(),
            has_thing: false,
            push_rules: PerJoint::default(),
            is_stopped: false,
            settings,
            disturbance: DisturbanceRates::default(),
            delayed: VecDeque::new(),
            faults: PerJoint::all(None),
            since: PerJoint::all(now + BOOT_TIME),
            disturbed_at: now,
            restarted_at: Instant::ZERO,
            last_status: PerJoint::default(),
            partial_reply: Vec::new(),
            timely_limit,
            late_limit,
            undetected_error_at: PerJoint::all(Instant::ZERO),
            misread_until: PerJoint::all(Instant::ZERO),
            disturbed_frames: 0,
            undetected_errors: 0,
        }
    }

    /// The codes of the torque switch register.
    pub(super) const fn torque_codes(&self) -> motion_core::TorqueCodes {
        self.settings.torque_codes
    }

    pub(super) fn position(&self, joint: Joint) -> u16 {
        self.plant.position_counts(joint)
    }

    /// The goal that the servo of a joint truly holds, in counts.
    pub(super) fn servo_goal(&self, joint: Joint) -> u16 {
        self.plant.goal_counts(joint)
    }

    pub(super) fn last_status(&self, joint: Joint) -> StatusFields {
        self.last_status[joint]
    }

    /// Transmits a frame of the controller.
    pub(super) fn send(&mut self, now: Instant, bytes: &[u8], rng: &mut SeededRng) {
        if self.disturbance.corrupted > 0 && rng.in_a_million(self.disturbance.corrupted) {
            self.disturb(now);
            self.deliver(now, bytes, &corrupt(bytes, rng));
        } else {
            self.deliver(now, bytes, bytes);
        }
    }

    fn deliver(&mut self, now: Instant, sent: &[u8], received: &[u8]) {
        let before = self.plant.collisions();
        self.plant.bytes(now, received);
        if self.plant.collisions() == before {
            self.motion_checker.frame_sent(now, sent, received);
        } else {
            // A collision with a late reply: no servo receives the frame, and the reply is corrupted.
            self.motion_checker.frame_sent(now, sent, &[]);
            self.disturbed_at = now;
        }
    }

    /// Transmits a frame of the panic handler.
    pub(super) fn send_panic_frame(&mut self, now: Instant, frame: &[u8]) {
        self.motion_checker.exempt_all(now, Exemption::Panic);
        self.deliver(now, frame, frame);
    }

    /// Exempts all joints from the motion check: the motor state is not servo.
    pub(super) fn exempt_all_by_state(&mut self, now: Instant) {
        self.motion_checker.exempt_all(now, Exemption::MotorState);
    }

    /// Checks that no joint has moved by itself. `is_guarded` tells that the controller runs and protects the servos.
    /// `limits` are those of the pushes in 0.1 %; `None` without protection.
    pub(super) fn check_motion(
        &mut self,
        now: Instant,
        is_servo: bool,
        is_guarded: bool,
        limits: PerJoint<Option<i16>>,
    ) -> Check {
        // The joints move while the controller is off, too.
        self.plant.bytes(now, &[]);
        if !is_servo {
            self.truths = PerJoint::default();
        }
        for joint in Joint::ALL {
            self.check_push(now, joint, limits[joint].filter(|_| is_guarded))?;
        }
        for joint in Joint::ALL.into_iter().filter(|_| is_servo) {
            let (torque, push) = (self.plant.torque(joint), self.plant.motor_torque(joint));
            self.truths[joint].observe(now, torque, push, limits[joint]);
            if self.last_status[joint].alarms != 0 {
                self.truths[joint].has_alarm(now);
            }
            if self.truths[joint].may_give_way(now) {
                self.motion_checker.may_recoil(joint, &self.plant);
            }
        }
        for joint in Joint::ALL {
            let meets_thing = joint.number() == 7 && self.has_thing;
            let meets_any = self.has_push[joint] || self.has_wall[joint] || meets_thing;
            if meets_any || self.plant.load_grams() > 0 {
                self.motion_checker.may_overrun(now, joint);
            }
        }
        let is_guarded = is_guarded && self.is_undisturbed(now);
        self.motion_checker.check(now, is_servo, is_guarded, &self.plant)
    }

    /// Checks the push of a joint, with the limit that the controller keeps.
    fn check_push(&mut self, now: Instant, joint: Joint, limit: Option<i16>) -> Check {
        let responds =
            |joint| matches!(self.availability(joint), Availability::Responding(since) if now >= since);
        // Each silent servo costs a timeout: with long ones the others are read a few times a second.
        let is_read_often = self.timely_limit <= SHORT || Joint::ALL.into_iter().all(responds);
        let can_limit = is_read_often && responds(joint) && self.is_undisturbed(now);
        let push = Push {
            permille: self.plant.motor_torque(joint),
            speed: self.plant.load(joint).saturating_sub(self.plant.motor_torque(joint)),
            limit: limit.filter(|_| can_limit),
            is_overloaded: self.plant.is_overloaded(joint),
        };
        self.push_rules[joint].check(now, joint, push)
    }

    /// True if all servos respond and have torque.
    pub(super) fn all_hold(&self, now: Instant) -> bool {
        let responds = |joint: Joint| matches!(self.availability(joint), Availability::Responding(since) if now - since > SETTLED);
        let holds =
            |joint: &Joint| responds(*joint) && self.has_torque(*joint) && !self.may_be_let_go(*joint, now);
        Joint::ALL.iter().all(holds)
    }

    /// What the servo of a joint did.
    pub(super) fn truth(&self, joint: Joint) -> &JointTruth {
        &self.truths[joint]
    }

    /// True if the servo may be let go, as the controller sees it (D28): it lost its torque, or a false reading says so.
    pub(super) fn may_be_let_go(&self, joint: Joint, now: Instant) -> bool {
        let is_off = self.plant.torque(joint) != Some(Torque::On);
        let lacks_order = is_off && !self.is_undisturbed(now);
        self.truths[joint].may_be_let_go(now) || lacks_order || self.may_be_misread(joint, now)
    }

    /// True if the servo has power and holds no torque.
    pub(super) fn is_free(&self, joint: Joint) -> bool {
        matches!(self.plant.torque(joint), Some(torque) if torque != Torque::On)
    }

    /// True if the servo drives its motor.
    pub(super) fn has_torque(&self, joint: Joint) -> bool {
        self.plant.torque(joint) == Some(Torque::On)
    }

    fn disturb(&mut self, now: Instant) {
        self.disturbed_at = now;
        self.disturbed_frames += 1;
    }

    /// Returns the bytes that reach the controller now.
    pub(super) fn receive(&mut self, now: Instant, rng: &mut SeededRng) -> Vec<u8> {
        let mut bytes = self.plant.poll(now);
        if !bytes.is_empty() {
            self.record_status(&bytes);
            if self.disturbance != DisturbanceRates::default() {
                bytes = self.disturb_reply(now, bytes, rng);
            }
        }
        while self.delayed.front().is_some_and(|(at, _)| *at <= now) {
            self.delayed.pop_front().into_iter().for_each(|(_, held)| bytes.extend(held));
        }
        bytes
    }

    /// Records the status in a reply that was alone on the wire. The reply may come in parts of any length.
    fn record_status(&mut self, bytes: &[u8]) {
        self.partial_reply.extend_from_slice(bytes);
        let starts = 0..self.partial_reply.len();
        let status = starts.filter_map(|start| self.partial_reply.get(start..)).find_map(whole_status);
        if let Some((joint, status)) = status {
            self.last_status[joint] = status;
            self.partial_reply.clear();
        }
        let excess = self.partial_reply.len().saturating_sub(MAX_REPLY);
        self.partial_reply.drain(..excess);
    }

    /// Delays or corrupts a reply.
    fn disturb_reply(&mut self, now: Instant, bytes: Vec<u8>, rng: &mut SeededRng) -> Vec<u8> {
        if rng.in_a_million(self.disturbance.delayed) {
            self.disturb(now);
            let at = now + rng.any_scale(Duration::from_micros(20), MAX_DELAY);
            let index = self.delayed.partition_point(|(earlier, _)| *earlier <= at);
            self.delayed.insert(index, (at, bytes));
            return Vec::new();
        }
        if rng.in_a_million(self.disturbance.corrupted) {
            self.disturb(now);
            let corrupted = corrupt(&bytes, rng);
            self.count_undetected_errors(now, &bytes, &corrupted);
            return corrupted;
        }
        bytes
    }

    /// Counts corrupted replies with a valid checksum: one in 256.
    fn count_undetected_errors(&mut self, now: Instant, true_bytes: &[u8], corrupted: &[u8]) {
        let sent = status_replies(true_bytes);
        for (joint, _) in status_replies(corrupted).into_iter().filter(|reply| !sent.contains(reply)) {
            self.undetected_errors += 1;
            if now - self.undetected_error_at[joint] < MISREAD_TIME {
                self.misread_until[joint] = now + MISREAD_TIME;
            }
            self.undetected_error_at[joint] = now;
        }
    }

    /// True if the controller may use a false reading of this joint.
    pub(super) fn may_be_misread(&self, joint: Joint, now: Instant) -> bool {
        now < self.misread_until[joint]
    }

    pub(super) fn deadline(&self) -> Option<Instant> {
        let delayed = self.delayed.front().map(|(at, _)| *at);
        [delayed, self.plant.deadline()].into_iter().flatten().min()
    }

    pub(super) fn set_disturbance(&mut self, now: Instant, disturbance: DisturbanceRates) {
        self.disturbance = disturbance;
        self.disturbed_at = now;
    }

    pub(super) fn set_echo(&mut self, has_echo: bool) {
        self.plant.set_echo(has_echo);
    }

    pub(super) fn set_fault(&mut self, now: Instant, joint: Joint, fault: Option<ServoFault>) {
        let was_missing = self.faults[joint] == Some(ServoFault::Missing);
        let _ = self.plant.poll(now);
        self.plant.set_fault(joint, fault);
        self.faults[joint] = fault;
        if was_missing || fault == Some(ServoFault::Missing) {
            self.motion_checker.exempt(now, joint, Exemption::PowerLoss);
        }
        if fault == Some(ServoFault::Stuck) {
            // It may stop where it overshot its goal.
            self.motion_checker.exempt(now, joint, Exemption::Hand);
        }
        self.since[joint] = if was_missing { now + BOOT_TIME } else { now };
    }

    /// Restarts a servo, as after a dip of its supply. Its torque is off after that.
    pub(super) fn restart_servo(&mut self, now: Instant, joint: Joint) {
        let fault = self.faults[joint];
        self.set_fault(now, joint, Some(ServoFault::Missing));
        self.set_fault(now, joint, fault.filter(|fault| *fault != ServoFault::Missing));
    }

    pub(super) fn power_cycle(&mut self, now: Instant) {
        self.end_stop(now);
        self.plant.power_cycle(now);
        self.motion_checker.power_cycle(now);
        self.delayed.clear();
        self.since = PerJoint::all(now + BOOT_TIME);
    }

    /// The true angle of a joint in millidegrees.
    pub(super) fn angle(&self, joint: Joint) -> i32 {
        self.plant.angle(joint)
    }

    /// Puts a wall in the way of a joint, or takes it away.
    pub(super) fn set_wall(&mut self, now: Instant, joint: Joint, wall: Option<Wall>) {
        self.plant.bytes(now, &[]);
        self.plant.set_wall(joint, wall);
        self.has_wall[joint] = wall.is_some();
    }

    /// Puts a thing between the claws, or takes it away.
    pub(super) fn set_thing(&mut self, now: Instant, thing: Option<Thing>) {
        self.plant.bytes(now, &[]);
        self.plant.set_thing(thing);
        self.has_thing = thing.is_some();
    }

    /// Pushes a joint with a torque in millinewton metres. 0 ends the push, and the joint may turn back.
    pub(super) fn push(&mut self, now: Instant, joint: Joint, torque: i16) {
        self.plant.bytes(now, &[]);
        self.motion_checker.exempt(now, joint, Exemption::Hand);
        self.plant.push(joint, torque);
        self.has_push[joint] = torque != 0;
    }

    /// Puts a weight into the gripper, in grams.
    pub(super) fn set_load(&mut self, now: Instant, grams: u16) {
        self.plant.bytes(now, &[]);
        self.plant.set_load(grams);
    }

    /// Forces an alarm on a servo.
    pub(super) fn trip(&mut self, now: Instant, joint: Joint, trip: Trip) {
        self.plant.bytes(now, &[]);
        self.plant.trip(joint, trip);
        self.push_rules[joint].overload_is_forced();
    }

    /// Cuts the supply of all servos.
    pub(super) fn begin_stop(&mut self, now: Instant) {
        self.plant.bytes(now, &[]);
        self.plant.set_supply_fault(Some(SupplyFault::Off));
        self.motion_checker.exempt_all(now, Exemption::PowerLoss);
        self.is_stopped = true;
        self.since = PerJoint::all(now);
    }

    /// The supply of the servos is back.
    pub(super) fn end_stop(&mut self, now: Instant) {
        self.plant.bytes(now, &[]);
        self.plant.set_supply_fault(None);
        if std::mem::take(&mut self.is_stopped) {
            self.since = PerJoint::all(now + BOOT_TIME + STEP);
        }
    }

    /// A hand moves the joint to this position.
    pub(super) fn turn_by_hand(&mut self, now: Instant, joint: Joint, counts: u16) {
        self.motion_checker.exempt(now, joint, Exemption::Hand);
        self.plant.move_by_hand(joint, counts);
    }

    /// The hand releases the joint.
    pub(super) fn release_by_hand(&mut self, joint: Joint) {
        self.plant.let_go(joint);
    }

    /// True if there have been no disturbances for long enough that the controller knows the state of the servos.
    pub(super) fn is_undisturbed(&self, now: Instant) -> bool {
        self.disturbance == DisturbanceRates::default() && now - self.disturbed_at > REPEAT_TIME
    }

    /// The accepted error of a position reading, in counts. The controller may accept a single undetected error if it is
    /// no larger than the motion of a joint at rest.
    pub(super) fn position_tolerance(&self, joint: Joint, now: Instant) -> u64 {
        if now - self.undetected_error_at[joint] < MISREAD_TIME { 8 } else { 0 }
    }

    /// The largest age of a reading when its reply arrives.
    pub(super) fn reply_age(&self, joint: Joint) -> Duration {
        let delayed = if self.disturbance.delayed > 0 { MAX_DELAY } else { Duration::ZERO };
        match self.faults[joint] {
            Some(ServoFault::Late(by)) => by.max(delayed),
            _ => delayed,
        }
    }

    pub(super) fn availability(&self, joint: Joint) -> Availability {
        let since = self.since[joint];
        // A corrupted reply with a valid checksum ends a silence.
        let silent = Availability::Silent(since.max(self.misread_until[joint]));
        match self.faults[joint] {
            _ if self.is_stopped => silent,
            Some(ServoFault::Missing | ServoFault::Garbled(1)) => silent,
            // After a restart, the controller may take an old reply for the reply to its next read, and so on.
            Some(ServoFault::Late(_)) if self.restarted_at > since => Availability::Uncertain,
            Some(ServoFault::Late(by)) if by >= self.late_limit => silent,
            Some(ServoFault::Late(by)) if by > self.timely_limit => Availability::Uncertain,
            Some(ServoFault::Garbled(_)) => Availability::Uncertain,
            _ => Availability::Responding(since.max(self.disturbed_at)),
        }
    }
}
