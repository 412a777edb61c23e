//! The host: it asks for everything that can be asked for, at any pace, over a line that may be disturbed.

use protocol_core::registers::map::{
    DEVICE_ID, EEPROM_LOCK, FEEDBACK_FREQUENCY, MOTOR_STATE, OFFSET, PRESENT_POSITION, SPEED, STATUS_VERSION,
    TARGET_POSITION, TIME, VACUUM_PUMP, motor_state,
};
use protocol_core::time::{Duration, Instant};

use super::asked::{Asked, Stream};
use super::damage::{damage, noise};
use crate::dice::Dice;

/// A sender may pause inside a frame for 100 ms; this is less.
const LONGEST_PAUSE: Duration = Duration::from_millis(90);

/// How much the host has to say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mood {
    /// A request every few seconds.
    Idle,
    /// A few a second.
    Steady,
    /// Bursts of many, back to back.
    Eager,
}

/// A stretch of bytes with nothing but pauses inside.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    /// Each part, and the pause before it.
    pub(super) parts: Vec<(Duration, Vec<u8>)>,
    /// What it asks, if it is whole.
    pub(super) asked: Option<Asked>,
}

/// The host.
#[derive(Debug)]
pub(super) struct Client {
    mood: Mood,
    mood_until: Instant,
    pub(super) next_at: Instant,
    /// How many pieces in a million are damaged.
    pub(super) damaged: u64,
    settings_per_mille: u64,
    stream: Stream,
}

impl Client {
    pub(super) fn new(now: Instant, settings_per_mille: u64) -> Self {
        let (mood, stream) = (Mood::Steady, Stream::default());
        Self { mood, mood_until: now, next_at: now, damaged: 0, settings_per_mille, stream }
    }

    /// The arm starts: what was on the line is gone.
    pub(super) fn start_over(&mut self, now: Instant) {
        self.stream = Stream::default();
        self.next_at = self.next_at.max(now);
    }

    /// What is sent now; says when it is called next by `next_at`.
    pub(super) fn burst(&mut self, now: Instant, dice: &mut Dice) -> Vec<Piece> {
        if now >= self.mood_until {
            self.mood = dice.one_of(&[Mood::Idle, Mood::Steady, Mood::Steady, Mood::Eager], Mood::Idle);
            self.mood_until =
                now + dice.any_scale(Duration::from_millis(500), Duration::from_millis(120_000));
        }
        let (count, pause) = match self.mood {
            Mood::Idle => (1, Duration::from_millis(2_500)),
            Mood::Steady => (1 + dice.below(2), Duration::from_millis(300)),
            Mood::Eager => (1 + dice.below(20), Duration::from_millis(400)),
        };
        self.next_at = now + dice.wait(pause);
        loop {
            let pieces: Vec<_> = (0..count).map(|_| self.piece(dice)).collect();
            let mut stream = self.stream.clone();
            pieces.iter().for_each(|piece| stream.add(&piece.bytes(), piece.asked.is_some()));
            if !stream.has_phantom() {
                stream.trim();
                self.stream = stream;
                return pieces;
            }
        }
    }

    fn piece(&self, dice: &mut Dice) -> Piece {
        let asked = self.something(dice);
        if self.damaged > 0 && dice.in_a_million(self.damaged) {
            let bytes = if dice.one_in(4) { noise(40, dice) } else { damage(&asked.bytes(), dice) };
            return Piece { parts: vec![(any_pause(dice), bytes)], asked: None };
        }
        Piece { parts: in_parts(asked.bytes(), dice), asked: Some(asked) }
    }

    fn something(&self, dice: &mut Dice) -> Asked {
        if dice.one_in(2) { self.read(dice) } else { self.write(dice) }
    }

    fn read(&self, dice: &mut Dice) -> Asked {
        let (address, count) = match dice.below(6) {
            0 => (STATUS_VERSION.address, 16),
            1 => (PRESENT_POSITION.address, 7),
            2 => (TARGET_POSITION.address, 7),
            3 => (0, 255),
            // Any range, one in a few past the end.
            _ => (dice.byte(), if dice.one_in(8) { dice.byte() } else { dice.up_to(20) }),
        };
        Asked::Read { address, count }
    }

    fn write(&self, dice: &mut Dice) -> Asked {
        let (address, values) = if dice.in_a_million(self.settings_per_mille * 1_000) {
            settings(dice)
        } else {
            match dice.below(16) {
                0..=5 => targets(dice),
                6 | 7 => per_joint(SPEED.address, 100, dice),
                8 => per_joint(TIME.address, 100, dice),
                9 | 10 => (MOTOR_STATE.address, vec![state(dice)]),
                11 => (FEEDBACK_FREQUENCY.address, vec![dice.up_to(50)]),
                12 => (VACUUM_PUMP.address, vec![dice.up_to(1)]),
                13 => pose(dice),
                14 => (dice.byte(), (0..dice.below(12)).map(|_| dice.byte()).collect()),
                _ => (dice.byte(), vec![dice.up_to(30); dice.below(256)]),
            }
        };
        Asked::Write { address, values }
    }
}

impl Piece {
    fn bytes(&self) -> Vec<u8> {
        self.parts.iter().flat_map(|(_, bytes)| bytes.iter().copied()).collect()
    }
}

/// State 1 twice as often as the others.
fn state(dice: &mut Dice) -> u8 {
    let states = [motor_state::DAMPING, motor_state::SERVO, motor_state::SERVO, motor_state::FORCELESS];
    dice.one_of(&states, motor_state::SERVO)
}

fn targets(dice: &mut Dice) -> (u8, Vec<u8>) {
    if dice.one_in(2) {
        return (TARGET_POSITION.of(dice.joint()), vec![dice.up_to(180)]);
    }
    (TARGET_POSITION.address, (0..7).map(|_| dice.up_to(180)).collect())
}

/// A value for one joint, or for all.
fn per_joint(address: u8, most: u8, dice: &mut Dice) -> (u8, Vec<u8>) {
    let value = if dice.one_in(4) { 0 } else { dice.up_to(most) };
    if dice.one_in(2) { (address + dice.joint().index(), vec![value]) } else { (address, vec![value; 7]) }
}

/// From the motor state to the targets in one frame.
fn pose(dice: &mut Dice) -> (u8, Vec<u8>) {
    let head = [state(dice), dice.up_to(1), dice.up_to(1)];
    let speeds = [dice.up_to(100); 7];
    let times = [dice.up_to(100); 7];
    let targets = (0..7).map(|_| dice.up_to(180));
    let values = head.into_iter().chain(speeds).chain(times).chain(targets.collect::<Vec<_>>());
    (MOTOR_STATE.address, values.collect())
}

/// Settings, or the lock before them; one in a few is out of range.
fn settings(dice: &mut Dice) -> (u8, Vec<u8>) {
    match dice.below(6) {
        0 | 1 => (EEPROM_LOCK.address, vec![u8::from(dice.one_in(6))]),
        2 => (DEVICE_ID.address, vec![dice.byte()]),
        3 => (DEVICE_ID.address, vec![dice.byte(), dice.up_to(8)]),
        4 => (OFFSET.of(dice.joint()), vec![offset(dice)]),
        _ => (OFFSET.address, (0..7).map(|_| offset(dice)).collect()),
    }
}

fn offset(dice: &mut Dice) -> u8 {
    let most = if dice.one_in(40) { 127 } else { 16 };
    dice.up_to(most) | dice.one_of(&[0, 0x80], 0)
}

fn any_pause(dice: &mut Dice) -> Duration {
    if dice.one_in(3) {
        dice.any_scale(Duration::from_micros(10), Duration::from_millis(300))
    } else {
        Duration::ZERO
    }
}

/// Cuts a frame anywhere, with pauses that a sender may make.
fn in_parts(bytes: Vec<u8>, dice: &mut Dice) -> Vec<(Duration, Vec<u8>)> {
    let mut parts = Vec::new();
    let mut rest = bytes;
    let mut pause = any_pause(dice);
    while dice.one_in(4) && rest.len() > 1 {
        let tail = rest.split_off(1 + dice.below(rest.len() - 1));
        parts.push((pause, rest));
        rest = tail;
        pause = if dice.one_in(2) {
            dice.any_scale(Duration::from_micros(10), LONGEST_PAUSE)
        } else {
            Duration::ZERO
        };
    }
    parts.push((pause, rest));
    parts
}
