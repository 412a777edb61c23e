//! Runs the controller with any host bytes, servo replies, delays, free space on the host link and storage results.

mod controller_loop;
mod extended_block;
mod invariants;
mod scripted_replies;

use arbitrary::Arbitrary;
use controller_loop::ControllerLoop;
use motion_core::{Config, Storage, TorqueCodes};
use protocol_core::registers::{Image, Joint};
use protocol_core::request::Request;
use protocol_core::time::Duration;
use protocol_core::wire::FrameBuffer;

/// The configuration, the stored settings, and the steps of a run.
#[derive(Arbitrary, Debug)]
pub struct Input<'a> {
    stored: Option<[u8; Image::LENGTH]>,
    storage: SaveResult,
    servo_timeout_ms: u8,
    free_on_damping: bool,
    steps: Vec<ControllerStep<'a>>,
}

#[derive(Arbitrary, Clone, Copy, Debug)]
enum SaveResult {
    Ready,
    Full,
    Broken,
}

#[derive(Arbitrary, Debug)]
enum ControllerStep<'a> {
    /// The shell's loop runs this many times, each time at the deadline of the controller.
    Run(u8),
    /// The shell is late by this time.
    LateMicros(u32),
    MuchLaterMicros(u64),
    Bytes(&'a [u8]),
    Read {
        address: u8,
        count: u8,
    },
    Write {
        address: u8,
        values: &'a [u8],
    },
    // The next four steps write values that are in range.
    State(u8),
    Pose {
        speed: u8,
        time: u8,
        degrees: [u8; 7],
    },
    Offsets([u8; 7]),
    Pump(bool),
    ServoBytes(&'a [u8]),
    /// The servos that reply: bit n-1 for joint n.
    Responding(u8),
    Hand {
        joint: u8,
        counts: u16,
    },
    HostRoom(u16),
    NextSave(SaveResult),
    Faults(u8),
}

impl From<SaveResult> for Storage {
    fn from(result: SaveResult) -> Self {
        match result {
            SaveResult::Ready => Self::Ready,
            SaveResult::Full => Self::Full,
            SaveResult::Broken => Self::Broken,
        }
    }
}

/// Runs the controller. Panics if an invariant is violated.
pub fn run(input: &Input<'_>) {
    let timeout = Duration::from_millis(input.servo_timeout_ms.into());
    let torque_codes =
        if input.free_on_damping { TorqueCodes::FreeOnDamping } else { TorqueCodes::default() };
    let config = Config {
        chip_id: [1, 2, 3, 4, 5, 6],
        faults: 0,
        servo_baud: 1_000_000,
        servo_timeout: timeout,
        guard_time: Duration::from_micros(100),
        torque_codes,
    };
    let mut controller_loop =
        ControllerLoop::new(config, input.stored.map(Image).as_ref(), input.storage.into());
    for step in &input.steps {
        controller_loop.step(step);
        controller_loop.run_once();
    }
    controller_loop.finish();
}

impl ControllerLoop {
    fn step(&mut self, step: &ControllerStep<'_>) {
        match *step {
            ControllerStep::Run(count) => self.run(count.into()),
            ControllerStep::LateMicros(micros) => self.pass(micros.into()),
            ControllerStep::MuchLaterMicros(micros) => self.pass(micros),
            ControllerStep::Bytes(bytes) => self.receive(bytes),
            ControllerStep::Read { address, count } => self.request(&Request::Read { address, count }),
            ControllerStep::Write { address, values } => self.request(&Request::Write { address, values }),
            ControllerStep::State(state) => {
                self.request(&Request::Write { address: 29, values: &[state % 3] })
            }
            ControllerStep::Pose { speed, time, degrees } => {
                self.request(&Request::Write { address: 32, values: &[speed % 101; 7] });
                self.request(&Request::Write { address: 39, values: &[time % 101; 7] });
                self.request(&Request::Write { address: 46, values: &degrees.map(|angle| angle % 181) });
            }
            ControllerStep::Offsets(offsets) => {
                self.request(&Request::Write { address: 28, values: &[0] });
                self.request(&Request::Write { address: 13, values: &offsets.map(|offset| offset & 0x8F) });
            }
            ControllerStep::Pump(sucks) => {
                self.request(&Request::Write { address: 31, values: &[sucks.into()] })
            }
            ControllerStep::ServoBytes(bytes) => self.servo_bytes(bytes),
            ControllerStep::Responding(joints) => self.replies.responding = joints,
            ControllerStep::Hand { joint, counts } => {
                self.replies.counts[usize::from(joint) % Joint::ALL.len()] = counts % 1_024;
            }
            ControllerStep::HostRoom(room) => self.room = room.into(),
            ControllerStep::NextSave(outcome) => self.next_save = outcome.into(),
            ControllerStep::Faults(bits) => self.controller.raise_faults(bits),
        }
    }

    fn request(&mut self, request: &Request<'_>) {
        let mut frame = FrameBuffer::new();
        request.encode(&mut frame);
        self.receive(&frame);
    }
}
