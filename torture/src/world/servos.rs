//! The servo bus with everything that can happen on it, and what is true about each servo.
//!
//! ```text
//!   controller ──▶ damage ──▶ Plant: seven simulated servos
//!   controller ◀── damage ◀──
//! ```

use std::collections::VecDeque;

use host_sim::plant::{self, Plant};
use host_sim::servo::Fault;
use motion_core::servo_bus::frame::{Decoder, Reading};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use super::damage::damage;
use crate::dice::Dice;
use crate::per_joint::PerJoint;

/// A servo that was switched on hears nothing for so long.
const BOOT_TIME: Duration = Duration::from_millis(200);
/// Answers are held up on the wire for up to this long.
const LONGEST_DELAY: Duration = Duration::from_millis(40);
/// Bytes of the longest answer to what the arm asks, and some more.
const LONGEST_ANSWER: usize = 32;
/// A torque frame that was lost has been repeated after this.
const REFRESHED: Duration = Duration::from_millis(600);
/// Two deceptions within this time may be believed: nobody can tell.
const DECEPTION_TIME: Duration = Duration::from_millis(1_000);

/// How a servo is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Health {
    /// It answers every question since then.
    Well(Instant),
    /// It answers none since then.
    Silent(Instant),
    /// Now and then.
    Unclear,
}

/// What its last answer said, before any damage.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Said {
    pub(super) alarms: u8,
    pub(super) decivolts: u8,
    pub(super) celsius: u8,
}

/// How often frames are damaged or held up, in a million.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Disturbance {
    pub(super) damaged: u64,
    pub(super) late: u64,
}

/// Seven servos behind a wire.
#[derive(Debug)]
pub(super) struct Servos {
    plant: Plant,
    settings: plant::Settings,
    disturbance: Disturbance,
    /// What is held up on the wire.
    held_up: VecDeque<(Instant, Vec<u8>)>,
    faults: PerJoint<Option<Fault>>,
    /// Since when the servo is as it is.
    since: PerJoint<Instant>,
    disturbed_at: Instant,
    said: PerJoint<Said>,
    /// What was heard of the answer that is on its way.
    piece: Vec<u8>,
    /// An answer that is no later than this is one, and an answer that is later than that is none.
    in_time: Duration,
    too_late: Duration,
    /// When damage last passed for an answer of this servo, and until when it may be believed.
    deceived_at: PerJoint<Instant>,
    deceived_until: PerJoint<Instant>,
    pub(super) damaged_frames: u64,
    pub(super) deceptions: u64,
}

impl Servos {
    pub(super) fn new(now: Instant, settings: plant::Settings, [in_time, too_late]: [Duration; 2]) -> Self {
        Self {
            plant: Plant::with_settings(now, settings),
            settings,
            disturbance: Disturbance::default(),
            held_up: VecDeque::new(),
            faults: PerJoint::all(None),
            since: PerJoint::all(now + BOOT_TIME),
            disturbed_at: now,
            said: PerJoint::default(),
            piece: Vec::new(),
            in_time,
            too_late,
            deceived_at: PerJoint::all(Instant::ZERO),
            deceived_until: PerJoint::all(Instant::ZERO),
            damaged_frames: 0,
            deceptions: 0,
        }
    }

    /// What the torque switch reads where the motor is on.
    pub(super) const fn torque_codes(&self) -> motion_core::TorqueCodes {
        self.settings.torque_codes
    }

    pub(super) fn position(&self, joint: Joint) -> u16 {
        self.plant.position_counts(joint)
    }

    pub(super) fn said(&self, joint: Joint) -> Said {
        self.said[joint]
    }

    /// Takes bytes from the controller.
    pub(super) fn hear(&mut self, now: Instant, bytes: &[u8], dice: &mut Dice) {
        if self.disturbance.damaged > 0 && dice.in_a_million(self.disturbance.damaged) {
            self.disturb(now);
            self.plant.bytes(now, &damage(bytes, dice));
        } else {
            self.plant.bytes(now, bytes);
        }
    }

    fn disturb(&mut self, now: Instant) {
        self.disturbed_at = now;
        self.damaged_frames += 1;
    }

    /// What is through to the controller.
    pub(super) fn say(&mut self, now: Instant, dice: &mut Dice) -> Vec<u8> {
        let mut bytes = self.plant.poll(now);
        if !bytes.is_empty() {
            self.note(&bytes);
            if self.disturbance != Disturbance::default() {
                bytes = self.pass(now, bytes, dice);
            }
        }
        while self.held_up.front().is_some_and(|(at, _)| *at <= now) {
            self.held_up.pop_front().into_iter().for_each(|(_, held)| bytes.extend(held));
        }
        bytes
    }

    /// Takes down what a servo said, where nothing else was on the wire. It may come in pieces.
    fn note(&mut self, bytes: &[u8]) {
        if bytes.starts_with(&[0xFF, 0xFF]) || self.piece.len() > LONGEST_ANSWER {
            self.piece.clear();
        }
        self.piece.extend_from_slice(bytes);
        if let &[0xFF, 0xFF, id, length, alarms, _, _, _, _, _, _, decivolts, celsius, ref rest @ ..] =
            self.piece.as_slice()
            && usize::from(length) == rest.len() + 9
            && let Some(joint) = Joint::from_index(id)
        {
            self.said[joint] = Said { alarms, decivolts, celsius };
        }
    }

    /// Bytes through a wire that is not quiet.
    fn pass(&mut self, now: Instant, bytes: Vec<u8>, dice: &mut Dice) -> Vec<u8> {
        if dice.in_a_million(self.disturbance.late) {
            self.disturb(now);
            let at = now + dice.any_scale(Duration::from_micros(20), LONGEST_DELAY);
            let place = self.held_up.partition_point(|(earlier, _)| *earlier <= at);
            self.held_up.insert(place, (at, bytes));
            return Vec::new();
        }
        if dice.in_a_million(self.disturbance.damaged) {
            self.disturb(now);
            let damaged = damage(&bytes, dice);
            self.look_for_deception(now, &bytes, &damaged);
            return damaged;
        }
        bytes
    }

    /// One damaged answer in 256 has a right checksum.
    fn look_for_deception(&mut self, now: Instant, true_bytes: &[u8], damaged: &[u8]) {
        for (joint, _, params) in answers(damaged) {
            if answers(true_bytes).iter().any(|(other, _, truth)| *other == joint && *truth == params) {
                continue;
            }
            self.deceptions += 1;
            if now - self.deceived_at[joint] < DECEPTION_TIME {
                self.deceived_until[joint] = now + DECEPTION_TIME;
            }
            self.deceived_at[joint] = now;
        }
    }

    /// May the controller believe something about this joint that was never true?
    pub(super) fn is_deceived(&self, joint: Joint, now: Instant) -> bool {
        now < self.deceived_until[joint]
    }

    pub(super) fn deadline(&self) -> Option<Instant> {
        let held_up = self.held_up.front().map(|(at, _)| *at);
        [held_up, self.plant.deadline()].into_iter().flatten().min()
    }

    pub(super) fn set_disturbance(&mut self, now: Instant, disturbance: Disturbance) {
        self.disturbance = disturbance;
        self.disturbed_at = now;
    }

    pub(super) fn set_echo(&mut self, has_echo: bool) {
        self.plant.set_echo(has_echo);
    }

    pub(super) fn set_fault(&mut self, now: Instant, joint: Joint, fault: Option<Fault>) {
        let was_missing = self.faults[joint] == Some(Fault::Missing);
        let _ = self.plant.poll(now);
        self.plant.set_fault(joint, fault);
        self.faults[joint] = fault;
        self.since[joint] = if was_missing { now + BOOT_TIME } else { now };
    }

    /// The supply dips: the servo starts again, with its torque off.
    pub(super) fn reset(&mut self, now: Instant, joint: Joint) {
        let fault = self.faults[joint];
        self.set_fault(now, joint, Some(Fault::Missing));
        self.set_fault(now, joint, fault.filter(|fault| *fault != Fault::Missing));
    }

    pub(super) fn power_cycle(&mut self, now: Instant) {
        self.plant.power_cycle(now);
        self.held_up.clear();
        self.since = PerJoint::all(now + BOOT_TIME);
    }

    /// Turns a joint from outside.
    pub(super) fn turn(&mut self, joint: Joint, counts: u16) {
        self.plant.move_by_hand(joint, counts);
    }

    /// Does the controller hear every word of the servos, and they of it, for long enough that they are as it
    /// thinks they are?
    pub(super) fn wire_is_quiet(&self, now: Instant) -> bool {
        self.disturbance == Disturbance::default() && now - self.disturbed_at > REFRESHED
    }

    /// How far an answer can be from the truth and still be like the one before, in counts: a single
    /// deception may be believed where it makes no more difference than a joint at rest does by itself.
    pub(super) fn likeness(&self, joint: Joint, now: Instant) -> u64 {
        if now - self.deceived_at[joint] < DECEPTION_TIME { 8 } else { 0 }
    }

    /// How old an answer can be when it comes.
    pub(super) fn age_of_answers(&self, joint: Joint) -> Duration {
        let held_up = if self.disturbance.late > 0 { LONGEST_DELAY } else { Duration::ZERO };
        match self.faults[joint] {
            Some(Fault::Late(by)) => by.max(held_up),
            _ => held_up,
        }
    }

    pub(super) fn health(&self, joint: Joint) -> Health {
        let since = self.since[joint];
        // Where damage passed for its answers, it did not look silent.
        let silent = Health::Silent(since.max(self.deceived_until[joint]));
        match self.faults[joint] {
            Some(Fault::Missing | Fault::Garbled(1)) => silent,
            Some(Fault::Late(by)) if by >= self.too_late => silent,
            Some(Fault::Late(by)) if by > self.in_time => Health::Unclear,
            Some(Fault::Garbled(_)) => Health::Unclear,
            _ => Health::Well(since.max(self.disturbed_at)),
        }
    }
}

/// The answers in these bytes that no checksum speaks against.
fn answers(bytes: &[u8]) -> Vec<(Joint, u8, Vec<u8>)> {
    let mut decoder = Decoder::new();
    decoder.push(bytes);
    let mut found = Vec::new();
    while let Some(result) = decoder.pull() {
        if let Ok(frame) = result
            && let Some(joint) = Joint::from_index(frame.id)
            && frame.params.len() >= usize::from(Reading::REGISTERS)
        {
            found.push((joint, frame.code, frame.params.to_vec()));
        }
    }
    found
}
