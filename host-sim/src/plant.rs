//! The arm behind the controller: seven simulated servos on one wire. Bytes in, bytes out, time as an
//! argument.
//!
//! ```text
//!   plant.bytes(now, ..)  ──▶ Decoder ──▶ every Servo hears every frame
//!                                             │ answers
//!   plant.poll(now)  ◀── Wire: 1 Mbaud ◀──────┘
//! ```
//!
//! The same calls at the same times give the same bytes, on every machine. Knows nothing of the controller.

mod wire;

use motion_core::calibration::{MicroDegrees, counts_from_angle};
use motion_core::servo_bus::TorqueCodes;
use motion_core::servo_bus::frame::Decoder;
use protocol_core::registers::map::TARGET_POSITION;
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::{Duration, Instant};

use crate::servo::motor::STEP;
use crate::servo::{Fault, Servo};
use wire::Wire;

/// The supply of an idle arm, in 0.1 V.
const SUPPLY_DECIVOLTS: u16 = 74;
/// What the supply loses while one servo pushes as hard as it can, in 0.1 V.
const SAG_DECIVOLTS: u16 = 3;
/// When nobody called for longer than this, the arm stood still for the time before.
const LONGEST_CATCH_UP: Duration = Duration::from_millis(100_000);

/// What differs from arm to arm.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// How long the servos are deaf after power-up. Real ones: about 200 ms.
    pub boot_time: Duration,
    /// The pause between the last byte of a question and the first of its answer.
    pub return_delay: Duration,
    /// What the codes of the torque switch mean.
    pub torque_codes: TorqueCodes,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            boot_time: Duration::from_millis(200),
            return_delay: Duration::from_micros(250),
            torque_codes: TorqueCodes::default(),
        }
    }
}

/// Seven servos on one wire.
#[derive(Clone, Debug)]
pub struct Plant {
    settings: Settings,
    servos: [Servo; JOINTS],
    decoder: Decoder,
    wire: Wire,
    has_echo: bool,
    /// The motors have gone as far as this.
    now: Instant,
}

impl Plant {
    /// An arm that is powered up at `now`, in the standard pose (90, 90, 65, 90, 90, 90, 80 degrees).
    #[must_use]
    pub fn new(now: Instant) -> Self {
        Self::with_settings(now, Settings::default())
    }

    /// Likewise, with these settings.
    #[must_use]
    pub fn with_settings(now: Instant, settings: Settings) -> Self {
        let ready_at = now + settings.boot_time;
        let servo =
            |joint| Servo::new(joint, settings.torque_codes, standard_position_counts(joint), ready_at);
        Self {
            settings,
            servos: Joint::ALL.map(servo),
            decoder: Decoder::new(),
            wire: Wire::new(),
            has_echo: false,
            now,
        }
    }

    /// Takes bytes that the controller began to send at `now`.
    pub fn bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.advance(now);
        let (begin, end) = self.wire.master_sends(now, bytes.len());
        if self.has_echo && !bytes.is_empty() {
            self.wire.send(begin, bytes);
        }
        for piece in bytes.chunks(Decoder::CAPACITY / 2) {
            self.decoder.push(piece);
            self.let_servos_hear(now, end + self.settings.return_delay);
        }
    }

    fn let_servos_hear(&mut self, now: Instant, answer_at: Instant) {
        let Self { decoder, servos, wire, .. } = self;
        while let Some(heard) = decoder.pull() {
            // A servo is silent about a frame that it did not understand.
            let Ok(frame) = heard else { continue };
            for answer in servos.iter_mut().filter_map(|servo| servo.hear(now, &frame)) {
                wire.send(answer_at + answer.delay, &answer.bytes);
            }
        }
    }

    /// Lets the arm move on to `now` and gives the bytes that are through to the controller by then.
    #[must_use]
    pub fn poll(&mut self, now: Instant) -> Vec<u8> {
        self.advance(now);
        self.wire.take(now)
    }

    /// When the answer that is on its way will be through to its last byte; `None` if there is none. The
    /// motors need no calls: what they do in the meantime is made up for in the next one.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        self.wire.deadline()
    }

    fn advance(&mut self, now: Instant) {
        let oldest = now.as_micros().saturating_sub(LONGEST_CATCH_UP.as_micros());
        self.now = self.now.max(Instant::from_micros(oldest));
        while self.now + STEP <= now {
            self.now = self.now + STEP;
            let supply = self.supply_decivolts();
            self.servos.iter_mut().for_each(|servo| servo.step(supply));
        }
    }

    fn supply_decivolts(&self) -> u8 {
        let load: u16 = self.servos.iter().map(Servo::load).sum();
        let sag = u32::from(load) * u32::from(SAG_DECIVOLTS) / 1_000;
        u8::try_from(u32::from(SUPPLY_DECIVOLTS).saturating_sub(sag)).unwrap_or(0)
    }

    /// Makes a joint's servo defective, or well again.
    pub fn set_fault(&mut self, joint: Joint, fault: Option<Fault>) {
        let ready_at = self.now + self.settings.boot_time;
        if let Some(servo) = self.servo(joint) {
            servo.set_fault(fault, ready_at);
        }
    }

    /// Lets the controller hear its own bytes, as on a bus whose one wire is both sent and listened on.
    pub fn set_echo(&mut self, has_echo: bool) {
        self.has_echo = has_echo;
    }

    /// Turns a joint from outside, to a position in counts. With torque on, it goes back by itself.
    pub fn move_by_hand(&mut self, joint: Joint, counts: u16) {
        if let Some(servo) = self.servo(joint) {
            servo.move_by_hand(counts);
        }
    }

    /// Power off and on: torque is off, goals and answers are forgotten; the joints stay where they are and
    /// the faults as they are.
    pub fn power_cycle(&mut self, now: Instant) {
        self.advance(now);
        let ready_at = now + self.settings.boot_time;
        self.servos.iter_mut().for_each(|servo| servo.power_cycle(ready_at));
        self.decoder.clear();
        self.wire.clear();
    }

    /// Where a joint's servo is, in counts, as of the last call with a time.
    #[must_use]
    pub fn position_counts(&self, joint: Joint) -> u16 {
        self.servos.get(usize::from(joint.index())).map_or(0, Servo::position_counts)
    }

    fn servo(&mut self, joint: Joint) -> Option<&mut Servo> {
        self.servos.get_mut(usize::from(joint.index()))
    }
}

/// Where a joint's servo is in the standard pose.
fn standard_position_counts(joint: Joint) -> u16 {
    let degrees = TARGET_POSITION.default_at(TARGET_POSITION.of(joint));
    counts_from_angle(joint, MicroDegrees::from_degrees(degrees), 0)
}
