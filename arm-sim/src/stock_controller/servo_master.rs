//! The maker's end of the servo bus: a queue of frames, and reads of one servo at a time.

use alloc::collections::VecDeque;

use motion_core::servo_bus::ByteTime;
use motion_core::servo_bus::frame::{self, Decoder, Reading, ServoFrameBuffer, register};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

/// A goal of a servo, as the maker's firmware sends it: time and speed together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct StockGoal {
    pub(super) position_counts: u16,
    pub(super) time_ms: u16,
    /// In counts per second.
    pub(super) speed: u16,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ReadOutcome {
    Measured(Reading),
    NoAnswer,
}

/// The master of the servo bus.
#[derive(Clone, Debug)]
pub(super) struct ServoMaster {
    /// Frames to send. `true`: a servo answers the frame.
    queue: VecDeque<(ServoFrameBuffer, bool)>,
    sending: ServoFrameBuffer,
    decoder: Decoder,
    /// The joint whose answer is outstanding.
    asked: Option<Joint>,
    /// No frame starts before this time. While an answer is outstanding, this is its timeout.
    busy_until: Instant,
    byte_time: ByteTime,
    timeout: Duration,
    guard_time: Duration,
}

impl ServoMaster {
    pub(super) fn new(baud: u32, timeout: Duration, guard_time: Duration) -> Self {
        Self {
            queue: VecDeque::new(),
            sending: ServoFrameBuffer::new(),
            decoder: Decoder::new(),
            asked: None,
            busy_until: Instant::ZERO,
            byte_time: ByteTime::at_baud(baud),
            timeout,
            guard_time,
        }
    }

    pub(super) fn set_torque(&mut self, code: u8) {
        let items = Joint::ALL.into_iter().map(|joint| (joint.index(), [code]));
        self.sync_write(register::TORQUE_SWITCH, items);
    }

    pub(super) fn set_goals(&mut self, goals: impl Iterator<Item = (Joint, StockGoal)>) {
        let items = goals.map(|(joint, goal)| {
            let [p1, p0] = goal.position_counts.to_be_bytes();
            let [t1, t0] = goal.time_ms.to_be_bytes();
            let [s1, s0] = goal.speed.to_be_bytes();
            (joint.index(), [p1, p0, t1, t0, s1, s0])
        });
        self.sync_write(register::GOAL_POSITION, items);
    }

    fn sync_write<const W: usize>(&mut self, first: u8, items: impl Iterator<Item = (u8, [u8; W])>) {
        let mut frame = ServoFrameBuffer::new();
        frame::sync_write(&mut frame, first, items);
        self.queue.push_back((frame, false));
    }

    /// Reads the measurements of a joint's servo. Call it again only after [`ServoMaster::take_outcome`] returned the outcome.
    pub(super) fn ask(&mut self, joint: Joint) {
        let mut frame = ServoFrameBuffer::new();
        frame::read(&mut frame, joint.index(), register::PRESENT_POSITION, Reading::REGISTERS);
        self.queue.push_back((frame, true));
        self.asked = Some(joint);
    }

    pub(super) fn bytes(&mut self, bytes: &[u8]) {
        self.decoder.push(bytes);
    }

    /// Is there a frame to send at `now`?
    pub(super) fn has_frame(&self, now: Instant) -> bool {
        now >= self.busy_until && !self.queue.is_empty()
    }

    /// Prepares the frame to send at `now`. Returns whether there is one.
    pub(super) fn prepare_frame(&mut self, now: Instant) -> bool {
        if !self.has_frame(now) {
            return false;
        }
        let Some((frame, has_answer)) = self.queue.pop_front() else { return false };
        let sent = now + self.byte_time.of(frame.len());
        self.busy_until = sent + if has_answer { self.timeout } else { self.guard_time };
        if has_answer {
            self.decoder.clear();
        }
        self.sending = frame;
        true
    }

    /// The frame of [`ServoMaster::prepare_frame`].
    pub(super) fn frame(&self) -> &[u8] {
        &self.sending
    }

    /// The outcome of the read, returned once. `None`: there is no read, or its answer is outstanding.
    pub(super) fn take_outcome(&mut self, now: Instant) -> Option<ReadOutcome> {
        let joint = self.asked?;
        if !self.queue.is_empty() {
            return None;
        }
        let outcome = match self.pull_reading(joint) {
            Some(reading) => {
                self.busy_until = now + self.guard_time;
                ReadOutcome::Measured(reading)
            }
            None if now >= self.busy_until => ReadOutcome::NoAnswer,
            None => return None,
        };
        self.asked = None;
        Some(outcome)
    }

    fn pull_reading(&mut self, joint: Joint) -> Option<Reading> {
        while let Some(found) = self.decoder.pull() {
            if let Ok(frame) = found
                && frame.id == joint.index()
                && let Some(reading) = Reading::parse(frame.params)
            {
                return Some(reading);
            }
        }
        None
    }

    /// When a frame can be sent or a read times out; [`Instant::FAR_FUTURE`] if the bus is idle.
    pub(super) fn deadline(&self) -> Instant {
        let is_idle = self.queue.is_empty() && self.asked.is_none();
        if is_idle { Instant::FAR_FUTURE } else { self.busy_until }
    }

    /// Sets how long a servo may take to answer.
    pub(super) const fn set_timeout(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }
}
