//! The arm behind the controller: seven simulated servos on one wire. Bytes in, bytes out, time as an
//! argument.
//!
//! ```text
//!   plant.bytes(now, ..)  ──▶ Decoder ──▶ every Servo hears every frame
//!                                             │ answers
//!   plant.poll(now)  ◀── Wire: 1 Mbaud ◀──────┘
//! ```
//!
//! The arm has weight: a loaded joint without torque falls, and one with torque droops a little. After power-up
//! a hand holds each joint until it has torque.
//!
//! The same calls at the same times give the same bytes, on every machine. Knows nothing of the controller.

mod pose;
mod sine;
mod weight;
mod wire;

use motion_core::calibration::{MicroDegrees, counts_from_angle};
use motion_core::servo_bus::frame::Decoder;
use motion_core::servo_bus::{Torque, TorqueCodes};
use protocol_core::registers::map::TARGET_POSITION;
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::{Duration, Instant};

use crate::servo::units::STEP;
use crate::servo::{Fault, Make, Servo};
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
    /// After a servo's own start, does the first goal switch its torque on? Some servos do so.
    pub goal_starts_torque: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            boot_time: Duration::from_millis(200),
            return_delay: Duration::from_micros(250),
            torque_codes: TorqueCodes::default(),
            goal_starts_torque: false,
        }
    }
}

impl Settings {
    const fn make(&self) -> Make {
        Make {
            boot_time: self.boot_time,
            codes: self.torque_codes,
            goal_starts_torque: self.goal_starts_torque,
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
    /// Is it known to the microsecond when the controller's bytes are on the wire?
    has_exact_times: bool,
    /// How many frames of the controller were lost because a servo drove the line.
    collisions: u64,
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
        let servo = |joint| Servo::new(joint, settings.make(), standard_position_counts(joint), ready_at);
        let mut plant = Self {
            settings,
            servos: Joint::ALL.map(servo),
            decoder: Decoder::new(),
            wire: Wire::new(),
            has_echo: false,
            has_exact_times: true,
            collisions: 0,
            now,
        };
        plant.weigh();
        plant
    }

    /// Takes bytes that the controller began to send at `now`: a whole frame, or a piece of one. They are lost for
    /// the servos if a servo still drives the line.
    pub fn bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.advance(now);
        if bytes.is_empty() {
            return;
        }
        let (begin, end) = self.wire.master_sends(now, bytes.len());
        let has_collided = self.has_exact_times && self.wire.collides(begin, end);
        if self.has_echo {
            self.wire.echo(begin, bytes, has_collided);
        }
        if has_collided {
            self.collisions += 1;
            return;
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

    /// How many frames of the controller were lost since the start because a servo drove the line.
    #[must_use]
    pub const fn collisions(&self) -> u64 {
        self.collisions
    }

    /// Simulates no collisions: for a controller behind a file descriptor, whose bytes come when the operating system
    /// hands them over, several frames at once perhaps.
    pub const fn ignore_collisions(&mut self) {
        self.has_exact_times = false;
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
            let mut has_turned = false;
            for servo in &mut self.servos {
                has_turned |= servo.step(self.now, supply);
            }
            if has_turned {
                self.weigh();
            }
        }
    }

    /// Loads every servo with its share of the arm's weight in this pose.
    fn weigh(&mut self) {
        let torques = weight::torques(self.pose());
        for ((servo, joint), torque) in self.servos.iter_mut().zip(Joint::ALL).zip(torques) {
            servo.load_with(if pose::is_reversed(joint) { -torque } else { torque });
        }
    }

    /// Each joint's angle in thousandths of a degree.
    fn pose(&self) -> [i64; JOINTS] {
        Joint::ALL.map(|joint| self.at(joint).map_or(0, |servo| pose::angle(joint, servo.position())))
    }

    fn supply_decivolts(&self) -> u8 {
        let load: u16 = self.servos.iter().map(Servo::load).sum();
        let sag = u32::from(load) * u32::from(SAG_DECIVOLTS) / 1_000;
        u8::try_from(u32::from(SUPPLY_DECIVOLTS).saturating_sub(sag)).unwrap_or(0)
    }

    /// Makes a joint's servo defective, or well again.
    pub fn set_fault(&mut self, joint: Joint, fault: Option<Fault>) {
        let (now, ready_at) = (self.now, self.now + self.settings.boot_time);
        if let Some(servo) = self.servo(joint) {
            servo.set_fault(now, fault, ready_at);
        }
    }

    /// Leaves only servos with these ids on the bus. An id from 0 to 6 belongs to its joint's servo, where that one
    /// is not taken yet; any other id goes to the first servo that has none.
    pub fn set_ids(&mut self, ids: &[u8]) {
        let mut free: Vec<Joint> = Joint::ALL.to_vec();
        for &id in ids {
            let own = free.iter().position(|joint| joint.index() == id);
            let other = || free.iter().position(|joint| !ids.contains(&joint.index()));
            let Some(place) = own.or_else(other) else { continue };
            let joint = free.remove(place);
            if let Some(servo) = self.servo(joint) {
                servo.set_id(id);
            }
        }
        free.into_iter().for_each(|joint| self.set_fault(joint, Some(Fault::Missing)));
    }

    /// Lets one servo lose its power for a moment at `now`: torque and goal are forgotten, and no hand holds it.
    pub fn restart_servo(&mut self, now: Instant, joint: Joint) {
        self.advance(now);
        let ready_at = now + self.settings.boot_time;
        if let Some(servo) = self.servo(joint) {
            servo.power_cycle(ready_at);
        }
    }

    /// Sets whether a goal switches torque on after a servo's own start.
    pub fn set_goal_starts_torque(&mut self, starts_torque: bool) {
        self.settings.goal_starts_torque = starts_torque;
        let make = self.settings.make();
        self.servos.iter_mut().for_each(|servo| servo.set_make(make));
    }

    /// Lets the controller hear its own bytes, as on a bus whose one wire is both sent and listened on.
    pub fn set_echo(&mut self, has_echo: bool) {
        self.has_echo = has_echo;
    }

    /// Turns a joint from outside, to a position in counts, and holds it there. With torque on, it goes back by
    /// itself.
    pub fn move_by_hand(&mut self, joint: Joint, counts: u16) {
        if let Some(servo) = self.servo(joint) {
            servo.move_by_hand(counts);
        }
        self.weigh();
    }

    /// A hand holds a joint where it is until the joint has torque. Does nothing where it has.
    pub fn hold(&mut self, joint: Joint) {
        self.servo(joint).into_iter().for_each(|servo| servo.hold_by_hand(true));
    }

    /// The hand lets go: without torque, a loaded joint falls.
    pub fn let_go(&mut self, joint: Joint) {
        self.servo(joint).into_iter().for_each(|servo| servo.hold_by_hand(false));
    }

    /// Supports the whole arm whenever it has no torque, as a stand does, or no longer.
    pub fn support(&mut self, is_supported: bool) {
        self.servos.iter_mut().for_each(|servo| servo.support(is_supported));
    }

    /// Power off and on: torque is off, goals and answers are forgotten, the faults stay. A hand holds the joints
    /// where they are until they have torque.
    pub fn power_cycle(&mut self, now: Instant) {
        self.advance(now);
        let ready_at = now + self.settings.boot_time;
        for servo in &mut self.servos {
            servo.power_cycle(ready_at);
            servo.hold_by_hand(true);
        }
        self.decoder.clear();
        self.wire.clear();
    }

    /// The true angle of a joint in thousandths of a degree, as of the last call with a time. No offset counts.
    #[must_use]
    pub fn angle(&self, joint: Joint) -> i32 {
        let angle = self.at(joint).map_or(0, |servo| pose::angle(joint, servo.position()));
        i32::try_from(angle).unwrap_or(0)
    }

    /// What a joint's servo does with its motor, as of the last call with a time; `None` where it does nothing: it has
    /// no power, or gave up after an overload.
    #[must_use]
    pub fn torque(&self, joint: Joint) -> Option<Torque> {
        self.at(joint).and_then(|servo| servo.torque_at(self.now))
    }

    /// Where a joint's servo is, in counts, as of the last call with a time.
    #[must_use]
    pub fn position_counts(&self, joint: Joint) -> u16 {
        self.at(joint).map_or(0, Servo::position_counts)
    }

    /// Does a joint's servo drive it? Not where it has no torque, gave up, or has no power.
    #[must_use]
    pub fn has_torque(&self, joint: Joint) -> bool {
        self.at(joint).is_some_and(Servo::has_torque)
    }

    fn at(&self, joint: Joint) -> Option<&Servo> {
        self.servos.get(usize::from(joint.index()))
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
