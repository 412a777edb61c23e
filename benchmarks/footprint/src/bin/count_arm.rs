//! Counts the instructions of the controller: control cycles with scripted answers of seven servos, the answer to a
//! request, and a checksum.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use footprint::meter::Meter;
use footprint::opaque;
use motion_core::servo_bus::frame::{self, Instruction, register};
use motion_core::{Config, Controller, Output, Storage, TorqueCodes};
use peers::work::SEVEN_BOT;
use protocol_core::registers::RegisterFile;
use protocol_core::registers::map::{MISSING_SERVOS, MOVING_JOINTS};
use protocol_core::request::{Reply, Request};
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::crc::checksum;
use protocol_core::wire::deframer::gap;
use protocol_core::wire::{Deframer, FrameBuffer, ToArm};

/// Every joint to 180 degrees at 19 degrees per second: all joints move during the whole count.
const FAR_AND_SLOW: [u8; 28] = *b"\xaa\x77\x06\x20\x15\x0a\x0a\x0a\x0a\x0a\x0a\x0a\x00\x00\
    \x00\x00\x00\x00\x00\xb4\xb4\xb4\xb4\xb4\xb4\xb4\xe3\x31";
/// Time for the start-up of the controller, in milliseconds.
const START: u64 = 1_000;
/// Number of control cycles that are counted.
const CYCLES: u64 = 100;
/// Milliseconds of a control cycle. The controller is polled once per millisecond.
const CYCLE: u64 = 10;

const READ: u8 = Instruction::Read as u8;
const SYNC_WRITE: u8 = Instruction::SyncWrite as u8;

struct Rig {
    meter: Meter,
    controller: Controller,
    answers: ScriptedAnswers,
    /// Answer that the controller has not received yet.
    answer: frame::FrameBuffer,
    /// Most instructions of a single call of `poll`.
    longest_call: u32,
}

#[entry]
fn main() -> ! {
    let config = Config {
        chip_id: opaque([0; 6]),
        faults: 0,
        servo_timeout: Duration::from_millis(3),
        guard_time: Duration::from_micros(100),
        torque_codes: TorqueCodes::default(),
    };
    let mut rig = Rig {
        meter: Meter::default(),
        controller: opaque(Controller::new(Instant::ZERO, config, None, Storage::Ready)),
        answers: ScriptedAnswers { positions: [511; 7] },
        answer: frame::FrameBuffer::new(),
        longest_call: 0,
    };
    (0..START).for_each(|millis| _ = rig.turn(millis));
    rig.controller.host_bytes(now(START), opaque(&FAR_AND_SLOW));
    let mut longest_cycle = 0;
    for cycle in 0..CYCLES {
        let start = START + cycle * CYCLE;
        longest_cycle = longest_cycle.max((start..start + CYCLE).map(|millis| rig.turn(millis)).sum());
    }
    rig.meter.tell("joints moving", u32::from(rig.controller.registers().get(MOVING_JOINTS.address)));
    rig.meter.tell("servos missing", u32::from(rig.controller.registers().get(MISSING_SERVOS.address)));
    rig.meter.tell("longest control cycle", longest_cycle);
    rig.meter.tell("longest poll", rig.longest_call);
    rig.meter.tell("read of 7, parse and answer alone", parse_and_answer(&rig.meter));
    let bytes = opaque([0x5A; 260]);
    rig.meter.tell("CRC of 260 bytes", rig.meter.count(|| _ = opaque(checksum(&bytes))));
    rig.meter.end()
}

/// Counts the instructions from a complete request in the deframer to its encoded reply.
fn parse_and_answer(meter: &Meter) -> u32 {
    let mut deframer = opaque(Deframer::<ToArm>::new(gap(115_200)));
    let registers = opaque(RegisterFile::new([0; 6], None));
    let mut reply = opaque(FrameBuffer::new());
    deframer.push(Instant::ZERO, opaque(SEVEN_BOT.read_of_7));
    let count = meter.count(|| {
        let Some(Ok(frame)) = deframer.pull() else { return };
        let Request::Read { address, count } = Request::from_frame(frame) else { return };
        Reply { address, values: registers.read(address, count) }.encode(&mut reply);
    });
    meter.tell("bytes of the reply", u32::try_from(reply.len()).unwrap_or(0));
    count
}

fn now(millis: u64) -> Instant {
    Instant::from_micros(millis * 1_000)
}

impl Rig {
    /// Runs one turn of the main loop. Returns the instructions of the controller.
    fn turn(&mut self, millis: u64) -> u32 {
        let Self { meter, controller, answers, answer, longest_call } = self;
        let now = now(millis);
        let mut sum = meter.count(|| {
            controller.host_bytes(now, &[]);
            controller.servo_bytes(now, answer);
        });
        answer.clear();
        loop {
            let mut output = Output::Wait(now);
            let poll = meter.count(|| output = opaque(controller.poll(now, opaque(512))));
            sum += poll;
            *longest_call = poll.max(*longest_call);
            match output {
                Output::ToServos(bytes) => answers.to(bytes).into_iter().for_each(|bytes| *answer = bytes),
                Output::Wait(_) => return sum,
                _ => {}
            }
        }
    }
}

/// Answers without servos: each position is the last goal, 511 before the first.
struct ScriptedAnswers {
    positions: [u16; 7],
}

impl ScriptedAnswers {
    /// The answer to a frame of the controller.
    fn to(&mut self, bytes: &[u8]) -> Option<frame::FrameBuffer> {
        match bytes {
            [0xFF, 0xFF, frame::BROADCAST, _, SYNC_WRITE, register::GOAL_POSITION, 6, items @ .., _] => {
                for item in items.chunks_exact(7) {
                    let &[id, high, low, ..] = item else { continue };
                    *self.positions.get_mut(usize::from(id))? = u16::from_be_bytes([high, low]);
                }
                None
            }
            &[0xFF, 0xFF, id, 4, READ, register::PRESENT_POSITION, count, _] => {
                let [high, low] = self.positions.get(usize::from(id))?.to_be_bytes();
                // Position, speed, load, 7.4 V, 30 degrees, and registers that are 0.
                let values = [high, low, 0, 0, 0, 0, 74, 30, 0, 0, 0];
                let mut answer = frame::FrameBuffer::new();
                frame::status(&mut answer, id, 0, values.get(..usize::from(count))?);
                Some(answer)
            }
            _ => None,
        }
    }
}
