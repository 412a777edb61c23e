//! Counts the instructions of the controller: control cycles with scripted replies of seven servos, the reply to a
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

/// A write of all targets, 180 degrees, at 19 degrees per second: all joints move during the whole count.
const SLOW_MOVE: [u8; 28] = *b"\xaa\x77\x06\x20\x15\x0a\x0a\x0a\x0a\x0a\x0a\x0a\x00\x00\
    \x00\x00\x00\x00\x00\xb4\xb4\xb4\xb4\xb4\xb4\xb4\xe3\x31";
/// Time for the start-up of the controller, in milliseconds.
const START_MILLIS: u64 = 1_000;
/// Number of control cycles that are counted.
const CYCLES: u64 = 300;
/// Control cycles from one write to the next. Torque is refreshed every 25 cycles, so writes meet each part of that period.
const CYCLES_OF_WRITE: u64 = 11;
/// Milliseconds of a control cycle. The main loop runs once per millisecond.
const CYCLE_MILLIS: u64 = 10;

const READ: u8 = Instruction::Read as u8;
const SYNC_WRITE: u8 = Instruction::SyncWrite as u8;

struct CountedController {
    meter: Meter,
    controller: Controller,
    servos: ScriptedServos,
    /// A reply that the controller has not received yet.
    reply: frame::ServoFrameBuffer,
    /// The largest number of instructions in a single call of `poll`.
    longest_call: u32,
}

#[entry]
fn main() -> ! {
    let config = Config {
        chip_id: opaque([0; 6]),
        faults: 0,
        servo_baud: opaque(1_000_000),
        servo_timeout: Duration::from_millis(3),
        guard_time: Duration::from_micros(100),
        torque_codes: TorqueCodes::default(),
    };
    let mut rig = CountedController {
        meter: Meter::default(),
        controller: opaque(Controller::new(Instant::ZERO, config, None, Storage::Ready)),
        servos: ScriptedServos { positions: [511; 7] },
        reply: frame::ServoFrameBuffer::new(),
        longest_call: 0,
    };
    (0..START_MILLIS).for_each(|millis| _ = rig.step(millis));
    let mut longest_cycle = 0;
    for cycle in 0..CYCLES {
        let start = START_MILLIS + cycle * CYCLE_MILLIS;
        if cycle % CYCLES_OF_WRITE == 0 {
            rig.controller.host_bytes(now(start), opaque(&SLOW_MOVE));
        }
        longest_cycle = longest_cycle.max((start..start + CYCLE_MILLIS).map(|millis| rig.step(millis)).sum());
    }
    rig.meter.print("joints moving", u32::from(rig.controller.registers().get(MOVING_JOINTS.address)));
    rig.meter.print("servos missing", u32::from(rig.controller.registers().get(MISSING_SERVOS.address)));
    rig.meter.print("longest control cycle", longest_cycle);
    rig.meter.print("longest poll", rig.longest_call);
    rig.meter.print("read of 7, parse and answer alone", parse_and_answer(&rig.meter));
    let bytes = opaque([0x5A; 260]);
    rig.meter.print("CRC of 260 bytes", rig.meter.count(|| _ = opaque(checksum(&bytes))));
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
    meter.print("bytes of the reply", u32::try_from(reply.len()).unwrap_or(0));
    count
}

fn now(millis: u64) -> Instant {
    Instant::from_micros(millis * 1_000)
}

impl CountedController {
    /// Runs the main loop once. Returns the instructions of the controller.
    fn step(&mut self, millis: u64) -> u32 {
        let Self { meter, controller, servos, reply, longest_call } = self;
        let now = now(millis);
        let mut sum = meter.count(|| {
            controller.host_bytes(now, &[]);
            controller.servo_bytes(now, reply);
        });
        reply.clear();
        loop {
            let mut output = Output::Wait(now);
            let poll = meter.count(|| output = opaque(controller.poll(now, opaque(512))));
            sum += poll;
            *longest_call = poll.max(*longest_call);
            match output {
                Output::ToServos(bytes) => {
                    servos.reply_to(bytes).into_iter().for_each(|bytes| *reply = bytes)
                }
                Output::Wait(_) => return sum,
                _ => {}
            }
        }
    }
}

/// Scripted servos: each position is the last goal, 511 before the first.
struct ScriptedServos {
    positions: [u16; 7],
}

impl ScriptedServos {
    /// The reply to a frame of the controller.
    fn reply_to(&mut self, bytes: &[u8]) -> Option<frame::ServoFrameBuffer> {
        match bytes {
            [0xFF, 0xFF, frame::BROADCAST, _, SYNC_WRITE, register::GOAL_POSITION, 6, items @ .., _] => {
                for item in items.chunks_exact(7) {
                    let &[id, high, low, ..] = item else { continue };
                    *self.positions.get_mut(usize::from(id))? = u16::from_be_bytes([high, low]);
                }
                None
            }
            &[0xFF, 0xFF, id, 4, READ, first, count, _] => {
                let [high, low] = self.positions.get(usize::from(id))?.to_be_bytes();
                // From register 40 on: torque on, the goal, and registers that are 0. From register 56 on: position, speed,
                // load, 7.4 V, 30 degrees, and registers that are 0.
                let values = [
                    1, 0, high, low, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, high, low, 0, 0, 0, 0, 74, 30, 0, 0,
                    0,
                ];
                let start = usize::from(first.checked_sub(register::TORQUE_SWITCH)?);
                let mut reply = frame::ServoFrameBuffer::new();
                frame::status(&mut reply, id, 0, values.get(start..start + usize::from(count))?);
                Some(reply)
            }
            _ => None,
        }
    }
}
