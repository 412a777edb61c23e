//! The arm at the other end of the servo bus: seven simulated servos on one wire, under the weight of the arm.
//!
//! ```text
//!   plant.bytes(now, ..) ──▶ Decoder ──▶ each Servo gets each frame
//!                                             │ answers
//!   plant.poll(now) ◀── Wire: 1 Mbaud ◀───────┘
//! ```
//!
//! A loaded joint falls without torque and droops a little with torque. After power-up a hand holds each joint until it
//! has torque. The same calls at the same times give the same bytes on every machine. The plant does not know the
//! controller.

mod pose;
mod sine;
mod weight;
mod wire;

use alloc::vec::Vec;

use motion_core::calibration::{MicroDegrees, counts_from_angle};
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{Decoder, Instruction};
use protocol_core::registers::map::TARGET_POSITION;
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::{Duration, Instant};

use crate::servo::units::STEP;
use crate::servo::{Servo, ServoConfig, ServoFault};
use wire::Wire;

/// The supply voltage without load, in 0.1 V.
const SUPPLY_DECIVOLTS: u16 = 74;
/// The voltage drop for each servo with full load, in 0.1 V.
const DROP_DECIVOLTS: u16 = 3;
/// If no call comes for longer than this, the arm stands still during the time before.
const LONGEST_CATCH_UP: Duration = Duration::from_millis(100_000);

/// Seven servos on one wire.
#[derive(Clone, Debug)]
pub struct Plant {
    config: ServoConfig,
    servos: [Servo; JOINTS],
    decoder: Decoder,
    wire: Wire,
    has_echo: bool,
    /// The times of the controller's bytes are exact, so that collisions can be simulated.
    has_exact_times: bool,
    /// Number of frames of the controller that were lost by a collision.
    collisions: u64,
    /// The motors are simulated up to this time.
    now: Instant,
    /// Steps that end by then change nothing but the sums behind the temperatures, unless a call changes a servo.
    rest_until: Instant,
}

impl Plant {
    /// An arm that is powered up at `now`, in the standard pose (90, 90, 65, 90, 90, 90, 80 degrees).
    #[must_use]
    pub fn new(now: Instant) -> Self {
        Self::with_config(now, ServoConfig::default())
    }

    /// Likewise, with servos of this make.
    #[must_use]
    pub fn with_config(now: Instant, config: ServoConfig) -> Self {
        let ready_at = now + config.boot_time;
        let servo = |joint| Servo::new(joint, config, standard_position_counts(joint), ready_at);
        let mut plant = Self {
            config,
            servos: Joint::ALL.map(servo),
            decoder: Decoder::new(),
            wire: Wire::new(),
            has_echo: false,
            has_exact_times: true,
            collisions: 0,
            now,
            rest_until: now,
        };
        plant.update_weight();
        plant
    }

    /// Takes bytes that the controller starts to send at `now`: a whole frame, or a part of one. The servos do not
    /// receive them if a servo still drives the line.
    pub fn bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.advance(now);
        if bytes.is_empty() {
            return;
        }
        let (start, end) = self.wire.reserve(now, bytes.len());
        let has_collided = self.has_exact_times && self.wire.collide(start, end);
        if self.has_echo {
            self.wire.echo(start, bytes, has_collided);
        }
        if has_collided {
            self.collisions += 1;
            return;
        }
        for piece in bytes.chunks(Decoder::CAPACITY / 2) {
            self.decoder.push(piece);
            self.handle_frames(now, end + self.config.return_delay);
        }
    }

    fn handle_frames(&mut self, now: Instant, answer_at: Instant) {
        let Self { decoder, servos, wire, rest_until, .. } = self;
        while let Some(found) = decoder.pull() {
            // A servo does not answer a damaged frame.
            let Ok(frame) = found else { continue };
            if !matches!(Instruction::from_code(frame.code), Some(Instruction::Ping | Instruction::Read)) {
                *rest_until = self.now;
            }
            for answer in servos.iter_mut().filter_map(|servo| servo.handle_frame(now, &frame)) {
                wire.send(answer_at + answer.delay, &answer.bytes);
            }
        }
    }

    /// Number of frames of the controller that were lost because a servo drove the line.
    #[must_use]
    pub const fn collisions(&self) -> u64 {
        self.collisions
    }

    /// Simulates no collisions: for a controller behind a file descriptor, where the times of the bytes are unknown.
    pub const fn ignore_collisions(&mut self) {
        self.has_exact_times = false;
    }

    /// Simulates the arm up to `now`, and returns the bytes that the controller has received by then.
    #[must_use]
    pub fn poll(&mut self, now: Instant) -> Vec<u8> {
        self.advance(now);
        self.wire.take(now)
    }

    /// When the last byte of the next answer arrives; `None` if there is no answer. The motors need no calls: the next
    /// call simulates the time between.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        self.wire.deadline()
    }

    fn advance(&mut self, now: Instant) {
        let oldest = now.as_micros().saturating_sub(LONGEST_CATCH_UP.as_micros());
        self.now = self.now.max(Instant::from_micros(oldest));
        while self.now + STEP <= now {
            if self.now + STEP <= self.rest_until {
                self.rest(now.min(self.rest_until));
            } else {
                self.step();
            }
        }
    }

    /// Simulates one step.
    fn step(&mut self) {
        self.now = self.now + STEP;
        let supply = self.supply_decivolts();
        let mut has_turned = false;
        for servo in &mut self.servos {
            has_turned |= servo.step(self.now, supply);
        }
        if has_turned {
            self.update_weight();
        } else {
            let supply = self.supply_decivolts();
            let ends = self.servos.iter().map(|servo| servo.rest_until(self.now, supply));
            self.rest_until = ends.min().unwrap_or(self.now);
        }
    }

    /// Simulates the whole steps until `end`, which is not after `self.rest_until`.
    fn rest(&mut self, end: Instant) {
        let steps = (end - self.now).as_micros() / STEP.as_micros();
        let steps = u32::try_from(steps).unwrap_or(u32::MAX);
        self.servos.iter_mut().for_each(|servo| servo.rest(steps));
        self.now = self.now + Duration::from_micros(STEP.as_micros() * u64::from(steps));
    }

    /// The servos, for a change.
    const fn servos_mut(&mut self) -> &mut [Servo; JOINTS] {
        self.rest_until = self.now;
        &mut self.servos
    }

    /// Loads each servo with its share of the arm's weight in this pose.
    fn update_weight(&mut self) {
        let torques = weight::torques(self.pose());
        for ((servo, joint), torque) in self.servos_mut().iter_mut().zip(Joint::ALL).zip(torques) {
            servo.set_weight(if pose::is_reversed(joint) { -torque } else { torque });
        }
    }

    /// The angles of the joints in thousandths of a degree.
    fn pose(&self) -> [i64; JOINTS] {
        Joint::ALL.map(|joint| self.servo(joint).map_or(0, |servo| pose::angle(joint, servo.position())))
    }

    fn supply_decivolts(&self) -> u8 {
        let load: u16 = self.servos.iter().map(Servo::load).sum();
        let drop = u32::from(load) * u32::from(DROP_DECIVOLTS) / 1_000;
        u8::try_from(u32::from(SUPPLY_DECIVOLTS).saturating_sub(drop)).unwrap_or(0)
    }

    /// Sets or removes the fault of a joint's servo.
    pub fn set_fault(&mut self, joint: Joint, fault: Option<ServoFault>) {
        let (now, ready_at) = (self.now, self.now + self.config.boot_time);
        if let Some(servo) = self.servo_mut(joint) {
            servo.set_fault(now, fault, ready_at);
        }
    }

    /// Leaves only servos with these ids on the bus. An id from 0 to 6 goes to its joint's servo if that has no id yet;
    /// any other id goes to the first servo without an id.
    pub fn set_ids(&mut self, ids: &[u8]) {
        let mut free: Vec<Joint> = Joint::ALL.to_vec();
        for &id in ids {
            let own = free.iter().position(|joint| joint.index() == id);
            let other = || free.iter().position(|joint| !ids.contains(&joint.index()));
            let Some(index) = own.or_else(other) else { continue };
            let joint = free.remove(index);
            if let Some(servo) = self.servo_mut(joint) {
                servo.set_id(id);
            }
        }
        free.into_iter().for_each(|joint| self.set_fault(joint, Some(ServoFault::Missing)));
    }

    /// Interrupts the power of one servo at `now`: torque and goal are lost, and no hand holds the joint.
    pub fn restart_servo(&mut self, now: Instant, joint: Joint) {
        self.advance(now);
        let ready_at = now + self.config.boot_time;
        if let Some(servo) = self.servo_mut(joint) {
            servo.power_cycle(ready_at);
        }
    }

    /// Sets whether a goal switches torque on after a servo's own start.
    pub fn set_goal_starts_torque(&mut self, starts_torque: bool) {
        self.config.goal_starts_torque = starts_torque;
        let config = self.config;
        self.servos_mut().iter_mut().for_each(|servo| servo.set_config(config));
    }

    /// Sets whether the controller receives its own bytes, as on a bus with one wire for both directions.
    pub const fn set_echo(&mut self, has_echo: bool) {
        self.has_echo = has_echo;
    }

    /// Turns a joint by hand to a position in counts, and holds it there. A joint with torque turns back.
    pub fn move_by_hand(&mut self, joint: Joint, counts: u16) {
        if let Some(servo) = self.servo_mut(joint) {
            servo.move_by_hand(counts);
        }
        self.update_weight();
    }

    /// Lets a hand hold a joint until it has torque. Has no effect on a joint with torque.
    pub fn hold(&mut self, joint: Joint) {
        self.servo_mut(joint).into_iter().for_each(|servo| servo.hold_by_hand(true));
    }

    /// Ends [`Plant::hold`]: without torque, a loaded joint falls.
    pub fn let_go(&mut self, joint: Joint) {
        self.servo_mut(joint).into_iter().for_each(|servo| servo.hold_by_hand(false));
    }

    /// Sets whether a stand holds each joint that has no torque.
    pub fn support(&mut self, is_supported: bool) {
        self.servos_mut().iter_mut().for_each(|servo| servo.support(is_supported));
    }

    /// Switches power off and on: torque, goals and answers are lost, faults stay. A hand holds each joint until it has
    /// torque.
    pub fn power_cycle(&mut self, now: Instant) {
        self.advance(now);
        let ready_at = now + self.config.boot_time;
        for servo in self.servos_mut() {
            servo.power_cycle(ready_at);
            servo.hold_by_hand(true);
        }
        self.decoder.clear();
        self.wire.clear();
    }

    /// The true angle of a joint in thousandths of a degree, without any offset, at the last call with a time.
    #[must_use]
    pub fn angle(&self, joint: Joint) -> i32 {
        let angle = self.servo(joint).map_or(0, |servo| pose::angle(joint, servo.position()));
        i32::try_from(angle).unwrap_or(0)
    }

    /// The torque of a joint's motor at the last call with a time. `None` without power, and after an overload.
    #[must_use]
    pub fn torque(&self, joint: Joint) -> Option<Torque> {
        self.servo(joint).and_then(|servo| servo.torque(self.now))
    }

    /// The position of a joint's servo in counts, at the last call with a time.
    #[must_use]
    pub fn position_counts(&self, joint: Joint) -> u16 {
        self.servo(joint).map_or(0, Servo::position_counts)
    }

    /// Does a joint's servo drive it? Not without torque or power, and not after an overload.
    #[must_use]
    pub fn has_torque(&self, joint: Joint) -> bool {
        self.servo(joint).is_some_and(Servo::has_torque)
    }

    fn servo(&self, joint: Joint) -> Option<&Servo> {
        self.servos.get(usize::from(joint.index()))
    }

    fn servo_mut(&mut self, joint: Joint) -> Option<&mut Servo> {
        self.servos_mut().get_mut(usize::from(joint.index()))
    }
}

/// The position of a joint's servo in the standard pose.
fn standard_position_counts(joint: Joint) -> u16 {
    let degrees = TARGET_POSITION.default_at(TARGET_POSITION.of(joint));
    counts_from_angle(joint, MicroDegrees::from_degrees(degrees), 0)
}
