//! The path from bytes to reply: deframer, request, register file, reply. No motion.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use footprint::{any_bytes, any_time, opaque};
use protocol_core::registers::{Accepted, Refused, RegisterFile};
use protocol_core::request::{Reply, Request};
use protocol_core::wire::deframer::gap;
use protocol_core::wire::{Deframer, FrameBuffer, ToArm};

#[entry]
fn main() -> ! {
    let mut deframer = Deframer::<ToArm>::new(gap(opaque(115_200)));
    let mut registers = RegisterFile::new(opaque([0; 6]), None);
    let mut reply = FrameBuffer::new();
    loop {
        opaque(deframer.push(any_time(), any_bytes()));
        while let Some(found) = deframer.pull() {
            match found {
                Ok(frame) => execute(Request::from_frame(frame), &mut registers, &mut reply),
                Err(defect) => {
                    opaque(defect);
                }
            }
        }
        opaque(deframer.deadline());
    }
}

fn execute(request: Request<'_>, registers: &mut RegisterFile, reply: &mut FrameBuffer) {
    match request {
        Request::Read { address, count } => {
            Reply { address, values: registers.read(address, count) }.encode(reply);
            opaque(reply.as_slice());
        }
        Request::Write { address, values } => apply(registers.check(address, values), registers),
        Request::WriteMap21 { address, values } => apply(registers.check_map21(address, values), registers),
    }
}

fn apply(checked: Result<Accepted<'_>, Refused>, registers: &mut RegisterFile) {
    match checked {
        Ok(accepted) => registers.apply(&accepted),
        Err(refused) => {
            opaque(refused);
        }
    }
}
