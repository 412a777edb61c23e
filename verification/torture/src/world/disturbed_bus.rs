//! The servo bus with disturbances, and the true state of each servo.
//!
//! ```text
//!   controller ──▶ corruption ──────────▶ Plant: seven simulated servos
//!   controller ◀── corruption, delay ◀──
//! ```

mod misreadings;
mod motion;
mod outside;
mod reply_comparison;
mod truth;

use std::collections::VecDeque;

use arm_sim::plant::Plant;
use arm_sim::servo::{ServoConfig, ServoFault};
use motion_core::servo_bus::frame::Instruction;
use protocol_core::time::{Duration, Instant};

use super::corruption::corrupt;
use super::joint_truth::JointTruth;
use super::motion_checker::{Exemption, MotionChecker};
use super::push_rule::PushRule;
use super::status_reply::{StatusFields, whole_status};
use crate::per_joint::PerJoint;
use crate::seeded_rng::SeededRng;
use misreadings::Misreadings;
use reply_comparison::ReplyComparison;

/// A servo does not respond for this long after it is switched on.
const BOOT_TIME: Duration = Duration::from_millis(200);
/// The longest delay of a reply on the wire.
const MAX_DELAY: Duration = Duration::from_millis(40);
/// In counts per second. The controller may reject the readings of a joint that turns faster: its limit is 2,000 (D12).
const BELIEVED_SPEED: u16 = 1_900;
/// The largest number of kept bytes of an incomplete reply: one less than the longest complete reply has.
const MAX_REPLY: usize = 32;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Availability {
    /// The servo has replied to every read since this time.
    Responding(Instant),
    /// The servo has replied to no read since this time.
    Silent(Instant),
    /// The servo replies to some reads.
    Uncertain,
}

impl Availability {
    /// True if the servo replies to every read now. The time in `Responding` is in the future while a servo starts.
    fn has_responded(self, now: Instant) -> bool {
        matches!(self, Self::Responding(since) if now >= since)
    }
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
    /// A hand pushes the joint.
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
    /// When each servo's fault or supply last changed, or when the servo responds again after a start.
    since: PerJoint<Instant>,
    disturbed_at: Instant,
    /// The time of the last restart of the controller alone.
    pub(super) restarted_at: Instant,
    last_status: PerJoint<StatusFields>,
    /// When each servo last reported a speed above [`BELIEVED_SPEED`].
    outran_at: PerJoint<Instant>,
    /// The received part of an incomplete reply.
    partial_reply: Vec<u8>,
    /// A reply that is late by at most `timely_limit` is in time. From `late_limit` on, its read has timed out.
    timely_limit: Duration,
    late_limit: Duration,
    misreadings: Misreadings,
    comparison: ReplyComparison,
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
            outran_at: PerJoint::all(Instant::ZERO),
            partial_reply: Vec::new(),
            timely_limit,
            late_limit,
            misreadings: Misreadings::default(),
            comparison: ReplyComparison::new(),
            disturbed_frames: 0,
            undetected_errors: 0,
        }
    }

    /// The codes of the torque switch register.
    pub(super) const fn torque_codes(&self) -> motion_core::TorqueCodes {
        self.settings.torque_codes
    }

    /// Transmits a frame of the controller.
    pub(super) fn send(&mut self, now: Instant, bytes: &[u8], rng: &mut SeededRng) {
        if bytes.get(4) == Some(&(Instruction::Read as u8)) {
            self.comparison.asked();
        }
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

    fn disturb(&mut self, now: Instant) {
        self.disturbed_at = now;
        self.disturbed_frames += 1;
    }

    /// Returns the bytes that reach the controller now, after disturbances.
    pub(super) fn receive(&mut self, now: Instant, rng: &mut SeededRng) -> Vec<u8> {
        let is_disturbed = self.disturbance != DisturbanceRates::default();
        let mut bytes = self.plant.poll(now).to_vec();
        if !bytes.is_empty() {
            self.record_status(now, &bytes);
            if is_disturbed {
                self.comparison.sent(&bytes);
                bytes = self.disturb_reply(now, bytes, rng);
            }
        }
        while self.delayed.front().is_some_and(|(at, _)| *at <= now) {
            self.delayed.pop_front().into_iter().for_each(|(_, held)| bytes.extend(held));
        }
        if is_disturbed {
            self.count_undetected_errors(now, &bytes);
        }
        bytes
    }

    /// Records the status of a complete reply as the servo sent it. The reply may come in parts of any length.
    fn record_status(&mut self, now: Instant, bytes: &[u8]) {
        self.partial_reply.extend_from_slice(bytes);
        let starts = 0..self.partial_reply.len();
        let status = starts.filter_map(|start| self.partial_reply.get(start..)).find_map(whole_status);
        if let Some((joint, status)) = status {
            self.last_status[joint] = status;
            self.truths[joint].answers(now, status);
            if status.speed > BELIEVED_SPEED {
                self.outran_at[joint] = now;
            }
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
            return corrupt(&bytes, rng);
        }
        bytes
    }

    /// Counts the corrupted replies with a valid checksum, one corrupted reply in 256, and records them as possible misreadings.
    fn count_undetected_errors(&mut self, now: Instant, received: &[u8]) {
        for joint in self.comparison.received(received) {
            self.undetected_errors += 1;
            self.misreadings.undetected_error(now, joint);
        }
    }

    pub(super) fn deadline(&self) -> Option<Instant> {
        let delayed = self.delayed.front().map(|(at, _)| *at);
        [delayed, self.plant.deadline()].into_iter().flatten().min()
    }

    pub(super) fn set_disturbance(&mut self, now: Instant, disturbance: DisturbanceRates) {
        self.disturbance = disturbance;
        self.disturbed_at = now;
        self.comparison.asked();
    }
}
