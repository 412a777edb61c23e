//! The whole controller: a host that says anything, servos that answer well, badly or not at all, time that
//! passes in steps of any size, a host link that may be full, and a storage that may fail.

mod servos;
mod shell;
mod watch;

use arbitrary::Arbitrary;
use motion_core::{Config, Storage, TorqueCodes};
use protocol_core::registers::{Image, Joint};
use protocol_core::request::Request;
use protocol_core::time::Duration;
use protocol_core::wire::FrameBuffer;
use shell::Shell;

/// What is tried.
#[derive(Arbitrary, Debug)]
pub struct Input<'a> {
    stored: Option<[u8; Image::LENGTH]>,
    storage: Outcome,
    servo_timeout_ms: u8,
    free_on_damping: bool,
    steps: Vec<Step<'a>>,
}

#[derive(Arbitrary, Clone, Copy, Debug)]
enum Outcome {
    Ready,
    Full,
    Broken,
}

#[derive(Arbitrary, Debug)]
enum Step<'a> {
    /// The shell's loop turns, on time, this often.
    Turns {
        count: u8,
    },
    /// The shell was held up, this long.
    Late {
        micros: u32,
    },
    MuchLater {
        micros: u64,
    },
    Bytes(&'a [u8]),
    Read {
        address: u8,
        count: u8,
    },
    Write {
        address: u8,
        values: &'a [u8],
    },
    // Writes that have an effect.
    State(u8),
    Pose {
        speed: u8,
        time: u8,
        degrees: [u8; 7],
    },
    Offsets([u8; 7]),
    Pump(bool),
    ServoBytes(&'a [u8]),
    /// Which servos are there, bit n-1 for joint n.
    Answering {
        joints: u8,
    },
    Hand {
        joint: u8,
        counts: u16,
    },
    HostRoom(u16),
    NextSave(Outcome),
    Faults(u8),
}

impl From<Outcome> for Storage {
    fn from(outcome: Outcome) -> Self {
        match outcome {
            Outcome::Ready => Self::Ready,
            Outcome::Full => Self::Full,
            Outcome::Broken => Self::Broken,
        }
    }
}

/// Tries it. Panics where something does not hold.
pub fn run(input: &Input<'_>) {
    let timeout = Duration::from_millis(input.servo_timeout_ms.into());
    let torque_codes =
        if input.free_on_damping { TorqueCodes::FreeOnDamping } else { TorqueCodes::default() };
    let config = Config {
        chip_id: [1, 2, 3, 4, 5, 6],
        faults: 0,
        servo_timeout: timeout,
        guard_time: Duration::from_micros(100),
        torque_codes,
    };
    let mut shell = Shell::new(config, input.stored.map(Image).as_ref(), input.storage.into());
    for step in &input.steps {
        shell.step(step);
        shell.turn();
    }
    shell.end();
}

impl Shell {
    fn step(&mut self, step: &Step<'_>) {
        match *step {
            Step::Turns { count } => self.turns(count.into()),
            Step::Late { micros } => self.pass(micros.into()),
            Step::MuchLater { micros } => self.pass(micros),
            Step::Bytes(bytes) => self.hear(bytes),
            Step::Read { address, count } => self.request(&Request::Read { address, count }),
            Step::Write { address, values } => self.request(&Request::Write { address, values }),
            Step::State(state) => self.request(&Request::Write { address: 29, values: &[state % 3] }),
            Step::Pose { speed, time, degrees } => {
                self.request(&Request::Write { address: 32, values: &[speed % 101; 7] });
                self.request(&Request::Write { address: 39, values: &[time % 101; 7] });
                self.request(&Request::Write { address: 46, values: &degrees.map(|angle| angle % 181) });
            }
            Step::Offsets(offsets) => {
                self.request(&Request::Write { address: 28, values: &[0] });
                self.request(&Request::Write { address: 13, values: &offsets.map(|offset| offset & 0x8F) });
            }
            Step::Pump(sucks) => self.request(&Request::Write { address: 31, values: &[sucks.into()] }),
            Step::ServoBytes(bytes) => self.servo_bytes(bytes),
            Step::Answering { joints } => self.servos.answering = joints,
            Step::Hand { joint, counts } => {
                self.servos.counts[usize::from(joint) % Joint::ALL.len()] = counts % 1_024;
            }
            Step::HostRoom(room) => self.room = room.into(),
            Step::NextSave(outcome) => self.next_save = outcome.into(),
            Step::Faults(bits) => self.controller.raise_faults(bits),
        }
    }

    fn request(&mut self, request: &Request<'_>) {
        let mut frame = FrameBuffer::new();
        request.encode(&mut frame);
        self.hear(&frame);
    }
}
