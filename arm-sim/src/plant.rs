//! The arm at the other end of the servo bus: seven simulated servos on one wire, under the weight of the arm.
//!
//! ```text
//!   plant.bytes(now, ..) ──▶ Decoder ──▶ each Servo that the frame addresses
//!                                             │ answers
//!   plant.poll(now) ◀── Wire ◀────────────────┘
//! ```
//!
//! Without torque, a loaded joint falls. With torque, it droops in proportion to its load. After power-up a hand holds each
//! joint until the joint has torque. The same calls at the same times give the same bytes on every machine. The plant does
//! not know the controller.

mod disturbance;
mod inertia;
mod obstacles;
mod outside;
mod pose;
mod rest;
mod room;
mod sine;
mod steps;
mod supply;
mod weight;
mod wire;

use alloc::boxed::Box;
use alloc::vec::Vec;

use motion_core::calibration::{MicroDegrees, counts_from_angle};
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{Decoder, Instruction};
use protocol_core::registers::map::TARGET_POSITION;
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::Instant;

use crate::fault_count::FaultCount;
use crate::servo::units::STEP;
use crate::servo::{Servo, ServoConfig, ServoFault};
use crate::world::World;
pub use obstacles::{HIGHEST_STIFFNESS, STRONGEST_PUSH, Thing, Wall};
pub use outside::OutsideState;
use pose::{AngleScale, JointSines};
use rest::Rest;
use supply::Supply;
pub use supply::{SupplyFault, UnknownSupplyFault};
pub use weight::HEAVIEST_LOAD_G;
use wire::Wire;

/// The baud rate in the factory settings of the servos, in bits per second.
const DELIVERED_BAUD: u32 = 1_000_000;

/// Seven servos on one wire.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Plant {
    config: ServoConfig,
    servos: [Servo; JOINTS],
    scales: [AngleScale; JOINTS],
    /// The pose for which the servos are loaded with the arm's weight.
    pose: JointSines,
    /// The weight in the gripper for which the servos are loaded, in grams. `None`: the servos are not loaded yet.
    weighed_g: Option<u16>,
    decoder: Decoder,
    wire: Wire,
    supply: Supply,
    /// The weight that was put into the gripper, in grams.
    load_g: u16,
    /// The weight of the object of the room that the arm carries, in grams.
    carried_g: u16,
    /// The claws have touched the thing between them.
    is_thing_gripped: bool,
    /// The angle at which the claws touch an object of the room that is between them, in thousandths of a degree. `None`: between
    /// the claws is nothing, or a thing that a person put there.
    room_stop: Option<i32>,
    /// The table and the things on it. `None` without a scene.
    world: Option<Box<World>>,
    /// The pump sucks.
    is_sucking: bool,
    has_echo: bool,
    /// Number of echoed bytes.
    echo_count: FaultCount,
    /// The times of the controller's bytes are exact, so that collisions can be simulated.
    has_exact_times: bool,
    /// Number of frames of the controller that were lost by a collision.
    collisions: u64,
    /// The motors are simulated up to this time.
    now: Instant,
    rests: [Rest; JOINTS],
    /// Until this time all servos rest and the supply does not change, unless a call changes them.
    rest_until: Instant,
}

impl Plant {
    /// An arm that is powered up at `now`, in the standard pose (90, 90, 65, 90, 90, 90, 80 degrees).
    #[must_use]
    pub fn new(now: Instant) -> Self {
        Self::with_config(now, ServoConfig::default())
    }

    /// Like [`Self::new`], with servos of this configuration.
    #[must_use]
    pub fn with_config(now: Instant, config: ServoConfig) -> Self {
        let ready_at = now + config.boot_time;
        let servo = |joint| Servo::new(joint, config, standard_position_counts(joint), ready_at);
        let mut plant = Self {
            config,
            servos: Joint::ALL.map(servo),
            scales: Joint::ALL.map(AngleScale::of),
            pose: JointSines::of([0; JOINTS]),
            weighed_g: None,
            decoder: Decoder::new(),
            wire: Wire::at_baud(DELIVERED_BAUD),
            supply: Supply::default(),
            load_g: 0,
            carried_g: 0,
            is_thing_gripped: false,
            room_stop: None,
            world: None,
            is_sucking: false,
            has_echo: false,
            echo_count: FaultCount::default(),
            has_exact_times: true,
            collisions: 0,
            now,
            rests: [Rest::NONE; JOINTS],
            rest_until: now,
        };
        plant.update_weight();
        plant
    }

    /// Sets the baud rate of the wire, in bits per second. Initially it is 1 Mbaud. Bytes on the wire are lost.
    pub fn set_baud(&mut self, baud: u32) {
        self.wire = Wire::at_baud(baud);
    }

    /// The baud rate of the wire, in bits per second.
    #[must_use]
    pub const fn baud(&self) -> u32 {
        self.wire.baud()
    }

    /// Takes bytes that the controller sends from `now` on, or after its earlier bytes. The servos do not receive them if a servo
    /// drives the line meanwhile, unless [`Plant::ignore_collisions`] was called.
    pub fn bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.advance(now);
        if bytes.is_empty() {
            return;
        }
        let (start, end) = self.wire.reserve(now, bytes.len());
        let has_collided = self.has_exact_times && self.wire.collide(start, end);
        if self.has_echo {
            self.echo_count.count_many(bytes.len() as u64, true);
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
        let Self { decoder, servos, wire, supply, rests, rest_until, .. } = self;
        while let Some(found) = decoder.pull() {
            // A servo does not answer a damaged frame.
            let Ok(frame) = found else { continue };
            if !matches!(Instruction::from_code(frame.code), Some(Instruction::Ping | Instruction::Read)) {
                *rest_until = self.now;
            }
            supply.count_frame();
            let addressed =
                servos.iter_mut().zip(rests.iter_mut()).filter(|(servo, _)| servo.is_addressed_by(&frame));
            for (servo, rest) in addressed {
                if !servo.is_unchanged_by(&frame) {
                    rest.end(servo, self.now);
                }
                if let Some(answer) = servo.handle_frame(now, &frame) {
                    wire.send(answer_at + answer.delay, &answer.bytes);
                }
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
    pub fn poll(&mut self, now: Instant) -> &[u8] {
        self.advance(now);
        self.wire.take(now)
    }

    /// When the last byte of the next answer or echo arrives; `None` if there is none. The motors need no calls at certain times:
    /// each call simulates the time since the call before, up to 100 s of it.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        self.wire.deadline()
    }

    /// Simulates the whole steps up to `now`. Most calls come within a step.
    #[inline]
    fn advance(&mut self, now: Instant) {
        if self.now + STEP <= now {
            self.catch_up(now);
        }
    }

    /// The servos, to change them. Ends their rest first.
    fn servos_mut(&mut self) -> &mut [Servo; JOINTS] {
        self.wake();
        &mut self.servos
    }

    /// The true angles of the joints, in thousandths of a degree.
    fn angles(&self) -> [i64; JOINTS] {
        let mut angles = [0; JOINTS];
        for ((angle, servo), scale) in angles.iter_mut().zip(&self.servos).zip(self.scales) {
            *angle = scale.angle(servo.position());
        }
        angles
    }

    /// The supply voltage of the servos at the last call with a time, in 0.1 V. 0 without supply.
    #[must_use]
    pub fn supply_decivolts(&self) -> u8 {
        self.supply.decivolts(self.now, self.servos.iter().map(Servo::current).sum())
    }

    /// Leaves only servos with these ids on the bus. An id from 0 to 6 goes to its joint's servo. A repeated id, or any other
    /// id, goes to the first free servo whose joint has no id in the list.
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

    /// The true angle of a joint in thousandths of a degree, without any offset, at the last call with a time.
    #[must_use]
    pub fn angle(&self, joint: Joint) -> i32 {
        let angle = self.servo(joint).map_or(0, |servo| AngleScale::of(joint).angle(servo.position()));
        i32::try_from(angle).unwrap_or(0)
    }

    /// The torque of a joint's motor at the last call with a time. `None` without power, and while an alarm switches off a motor
    /// whose torque switch is on.
    #[must_use]
    pub fn torque(&self, joint: Joint) -> Option<Torque> {
        self.servo(joint).and_then(|servo| servo.torque(self.now))
    }

    /// Had the servo of a joint started, and did it have power, at the last call with a time?
    #[must_use]
    pub fn has_power(&self, joint: Joint) -> bool {
        self.servo(joint).is_some_and(|servo| servo.has_power(self.now))
    }

    /// The position of a joint's servo in counts, at the last call with a time.
    #[must_use]
    pub fn position_counts(&self, joint: Joint) -> u16 {
        self.servo(joint).map_or(0, Servo::position_counts)
    }

    /// The goal that a joint's servo holds, in counts.
    #[must_use]
    pub fn goal_counts(&self, joint: Joint) -> u16 {
        self.servo(joint).map_or(0, Servo::goal_counts)
    }

    /// The torque of a joint's motor in 0.1 % of the stall torque: the load less the part that the speed needs. Positive
    /// values are towards more counts.
    #[must_use]
    pub fn motor_torque(&self, joint: Joint) -> i16 {
        self.servo(joint).map_or(0, Servo::motor_torque)
    }

    /// The greatest distance between a driven joint and its set-point under the present external load, in thousandths of a
    /// degree. `None`: load and friction reach the stall torque.
    #[must_use]
    pub fn droop(&self, joint: Joint) -> Option<i32> {
        self.servo(joint)?.droop().and_then(|droop| i32::try_from(droop).ok())
    }

    /// The distance in which the stall torque would stop a joint from its present speed, in thousandths of a degree.
    #[must_use]
    pub fn stopping_distance(&self, joint: Joint) -> i32 {
        self.servo(joint).map_or(0, |servo| i32::try_from(servo.stopping_distance()).unwrap_or(i32::MAX))
    }

    /// The load of a joint's motor, its duty, in 0.1 %. Positive values are towards more counts.
    #[must_use]
    pub fn load(&self, joint: Joint) -> i16 {
        self.servo(joint).map_or(0, Servo::signed_load)
    }

    /// Does a hand hold a joint until it has torque?
    #[must_use]
    pub fn is_held(&self, joint: Joint) -> bool {
        self.servo(joint).is_some_and(Servo::is_held)
    }

    /// Does a joint's servo drive the joint? `false` without torque or power, and while an alarm switches the motor off.
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
