//! A plant with a clock, and the frames of a master.

#![allow(clippy::indexing_slicing, clippy::unwrap_used)] // A panic is a failed test.
#![allow(dead_code)] // Each test file uses only a part of the rig.

use arm_sim::plant::Plant;
use arm_sim::servo::ServoConfig;
use motion_core::TorqueCodes;
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{Decoder, Reading, ServoFrameBuffer, read, register, sync_write, write};
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::{Duration, Instant};

/// The pause of a master between the last byte that it received and its next frame.
const GUARD_TIME: Duration = Duration::from_micros(100);

/// Is a joint without load at its goal? Static friction holds it within a count.
pub fn near(counts: u16, goal: u16) -> bool {
    counts.abs_diff(goal) <= 1
}

pub struct Rig {
    pub plant: Plant,
    pub now: Instant,
}

impl Rig {
    pub fn with(config: ServoConfig) -> Self {
        Self { plant: Plant::with_config(Instant::ZERO, config), now: Instant::ZERO }
    }

    /// An arm in the standard pose whose servos have started. A hand holds each joint.
    pub fn ready() -> Self {
        let mut rig = Self::with(ServoConfig::default());
        rig.pass(200);
        rig
    }

    /// Like [`Self::ready`], with torque. The goal of each joint is its position.
    pub fn driven() -> Self {
        let mut rig = Self::ready();
        rig.all_goals(Joint::ALL.map(|joint| rig.counts(joint)));
        rig.all_torque(Torque::On);
        rig.pass(1_000);
        rig
    }

    pub fn pass(&mut self, millis: u64) {
        self.now = self.now + Duration::from_millis(millis);
        assert_eq!(self.plant.poll(self.now), [], "a servo sends without a question");
    }

    pub fn send(&mut self, encode: impl FnOnce(&mut ServoFrameBuffer)) {
        let mut buffer = ServoFrameBuffer::new();
        encode(&mut buffer);
        self.plant.bytes(self.now, &buffer);
    }

    /// Sends a frame and waits for all bytes. Returns them, and the microseconds since the start of the frame.
    pub fn ask(&mut self, encode: impl FnOnce(&mut ServoFrameBuffer)) -> (Vec<u8>, u64) {
        let asked_at = self.now;
        self.send(encode);
        let mut bytes = Vec::new();
        while let Some(due) = self.plant.deadline() {
            self.now = due;
            bytes.extend(self.plant.poll(due));
        }
        let took = (self.now - asked_at).as_micros();
        self.now = self.now + GUARD_TIME;
        (bytes, took)
    }

    /// A joint's answer to a read of eight bytes, with its error bits.
    pub fn reading(&mut self, joint: Joint) -> Option<(Reading, u8)> {
        let question = |b: &mut ServoFrameBuffer| read(b, joint.index(), register::PRESENT_POSITION, 8);
        let (bytes, _) = self.ask(question);
        let mut decoder = Decoder::new();
        decoder.push(&bytes);
        let answer = decoder.pull()?.ok()?;
        assert_eq!(answer.id, joint.index());
        Some((Reading::parse(answer.params)?, answer.code))
    }

    /// Writes a code to the torque switch of a joint.
    pub fn torque(&mut self, joint: Joint, code: u8) {
        let (ack, _) = self.ask(|b| write(b, joint.index(), register::TORQUE_SWITCH, &[code]));
        assert_eq!(ack.len(), 6);
    }

    pub fn goal(&mut self, joint: Joint, position: u16, time_ms: u16, speed: u16) {
        let data: Vec<u8> = [position, time_ms, speed].into_iter().flat_map(u16::to_be_bytes).collect();
        self.ask(|b| write(b, joint.index(), register::GOAL_POSITION, &data));
    }

    /// Sets the torque of all joints.
    pub fn all_torque(&mut self, torque: Torque) {
        let code = TorqueCodes::default().code(torque);
        self.send(|b| sync_write(b, register::TORQUE_SWITCH, (0..7).map(|id| (id, [code]))));
        self.pass(1);
    }

    /// Sets the goals of all joints, at full speed.
    pub fn all_goals(&mut self, counts: [u16; JOINTS]) {
        let goal = |(id, counts): (u8, u16)| {
            let [high, low] = counts.to_be_bytes();
            (id, [high, low, 0, 0, 0, 0])
        };
        self.send(|b| sync_write(b, register::GOAL_POSITION, (0..).zip(counts).map(goal)));
        self.pass(1);
    }

    pub fn counts(&self, joint: Joint) -> u16 {
        self.plant.position_counts(joint)
    }

    /// The angles of the joints in thousandths of a degree.
    pub fn pose(&self) -> [i32; JOINTS] {
        Joint::ALL.map(|joint| self.plant.angle(joint))
    }

    /// The distance of each joint in this many milliseconds, in thousandths of a degree.
    pub fn turn_in(&mut self, millis: u64) -> [i32; JOINTS] {
        let before = self.pose();
        self.pass(millis);
        let after = self.pose();
        std::array::from_fn(|joint| after[joint] - before[joint])
    }

    /// Lets all joints go that a hand holds.
    pub fn let_go(&mut self) {
        Joint::ALL.into_iter().for_each(|joint| self.plant.let_go(joint));
    }
}
