//! The servo bus with everything that can happen on it, and what is true about each servo.
//!
//! ```text
//!   controller ──▶ damage ──▶ Plant: seven simulated servos
//!   controller ◀── damage ◀──
//! ```

use std::collections::VecDeque;

use arm_sim::plant::{self, Plant};
use arm_sim::servo::Fault;
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{Decoder, Reading};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use super::damage::damage;
use super::hold::{Excuse, Hold};
use crate::dice::Dice;
use crate::per_joint::PerJoint;
use crate::violation::Check;

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
    hold: Hold,
    settings: plant::Settings,
    disturbance: Disturbance,
    /// What is held up on the wire.
    held_up: VecDeque<(Instant, Vec<u8>)>,
    faults: PerJoint<Option<Fault>>,
    /// Since when the servo is as it is.
    since: PerJoint<Instant>,
    disturbed_at: Instant,
    /// When the controller last started again alone.
    pub(super) restarted_at: Instant,
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
            hold: Hold::new(now),
            settings,
            disturbance: Disturbance::default(),
            held_up: VecDeque::new(),
            faults: PerJoint::all(None),
            since: PerJoint::all(now + BOOT_TIME),
            disturbed_at: now,
            restarted_at: Instant::ZERO,
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
            self.pass_on(now, bytes, &damage(bytes, dice));
        } else {
            self.pass_on(now, bytes, bytes);
        }
    }

    fn pass_on(&mut self, now: Instant, sent: &[u8], heard: &[u8]) {
        let before = self.plant.collisions();
        self.plant.bytes(now, heard);
        if self.plant.collisions() == before {
            self.hold.heard(now, sent, heard);
        } else {
            // A late servo still spoke: nobody heard the frame, and the answer is damaged.
            self.hold.heard(now, sent, &[]);
            self.disturbed_at = now;
        }
    }

    /// The controller fails, and sends this frame by its fault path.
    pub(super) fn controller_fails(&mut self, now: Instant, frame: &[u8]) {
        self.hold.excuse_all(now, Excuse::Fault);
        self.pass_on(now, frame, frame);
    }

    /// The joints are not to be driven.
    pub(super) fn state_is_off(&mut self, now: Instant) {
        self.hold.excuse_all(now, Excuse::State);
    }

    /// Has any joint moved by itself?
    pub(super) fn look(&mut self, now: Instant, is_servo: bool) -> Check {
        self.hold.look(now, is_servo, &self.plant)
    }

    /// Does the servo turn its motor?
    pub(super) fn has_torque(&self, joint: Joint) -> bool {
        self.plant.torque(joint) == Some(Torque::On)
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

    /// Notes what a servo said, where nothing else was on the wire. Its answer may come in pieces of any length.
    fn note(&mut self, bytes: &[u8]) {
        self.piece.extend_from_slice(bytes);
        let answer = (0..self.piece.len()).find_map(|start| answer(self.piece.get(start..)?));
        if let Some((joint, said)) = answer {
            self.said[joint] = said;
            self.piece.clear();
        }
        let surplus = self.piece.len().saturating_sub(LONGEST_ANSWER);
        self.piece.drain(..surplus);
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
        if was_missing || fault == Some(Fault::Missing) {
            self.hold.excuse(now, joint, Excuse::Power);
        }
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
        self.hold.power_cycle(now);
        self.held_up.clear();
        self.since = PerJoint::all(now + BOOT_TIME);
    }

    /// Turns a joint from outside.
    pub(super) fn turn(&mut self, now: Instant, joint: Joint, counts: u16) {
        self.hold.excuse(now, joint, Excuse::Hand);
        self.plant.move_by_hand(joint, counts);
    }

    /// The hand lets go of a joint.
    pub(super) fn let_go(&mut self, joint: Joint) {
        self.plant.let_go(joint);
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
            // An answer under way in a restart may pass for that to the next question, and so on from there.
            Some(Fault::Late(_)) if self.restarted_at > since => Health::Unclear,
            Some(Fault::Late(by)) if by >= self.too_late => silent,
            Some(Fault::Late(by)) if by > self.in_time => Health::Unclear,
            Some(Fault::Garbled(_)) => Health::Unclear,
            _ => Health::Well(since.max(self.disturbed_at)),
        }
    }
}

fn has_right_checksum(frame: &[u8]) -> bool {
    let [_, _, covered @ .., checksum] = frame else { return false };
    covered.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte)) == !checksum
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
/// A whole answer with a right checksum, and nothing behind it.
fn answer(bytes: &[u8]) -> Option<(Joint, Said)> {
    let &[0xFF, 0xFF, id, length, alarms, _, _, _, _, _, _, decivolts, celsius, ref rest @ ..] = bytes else {
        return None;
    };
    let is_whole = usize::from(length) == rest.len() + 9 && has_right_checksum(bytes);
    Joint::from_index(id).filter(|_| is_whole).map(|joint| (joint, Said { alarms, decivolts, celsius }))
}
