//! Parts of protocol-core, called directly: the reduction of the chip id, the host's side of the protocol, lookups in the
//! register table, and the register file with any input.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use footprint::{any_bytes, any_time, opaque};
use protocol_core::chip_id;
use protocol_core::registers::map::{self, FRAMES_ACCEPTED};
use protocol_core::registers::spec::well_formed;
use protocol_core::registers::{JOINTS, Joint, MAP, Register, RegisterFile};
use protocol_core::request::{Reply, Request};
use protocol_core::wire::deframer::gap;
use protocol_core::wire::{Deframer, FrameBuffer, ToHost};

#[entry]
fn main() -> ! {
    loop {
        opaque(chip_id::reduce(opaque([0; 12])));
        host_side();
        table();
        register_file();
    }
}

fn host_side() {
    let mut frame = FrameBuffer::new();
    Request::Read { address: opaque(0), count: opaque(0) }.encode(&mut frame);
    opaque(frame.as_slice());
    Request::Write { address: opaque(0), values: any_bytes() }.encode(&mut frame);
    opaque(frame.as_slice());
    let mut deframer = Deframer::<ToHost>::new(gap(opaque(0)));
    opaque(deframer.push(any_time(), any_bytes()));
    while let Some(Ok(frame)) = deframer.pull() {
        opaque(Reply::from_frame(frame));
    }
}

fn table() {
    opaque(well_formed(opaque(MAP)));
    opaque(map::baud_rate(opaque(0)));
    let joint = Joint::new(opaque(1)).or(Joint::from_index(opaque(0)));
    if let (Some(row), Some(joint)) = (map::find(opaque(0)), joint) {
        register_row(row, joint);
    }
}

fn register_row(row: &Register, joint: Joint) {
    opaque((joint.number(), joint.index(), joint.bit()));
    opaque((row.of(joint), row.joint_at(opaque(0)), row.default_at(opaque(0)), row.unit.symbol()));
    opaque((row.range.decode(opaque(0)), row.range.encode(opaque(0)), row.range.bounds()));
    opaque((row.range.contains(opaque(0)), JOINTS));
}

fn register_file() {
    let mut file = RegisterFile::new(opaque([0; 6]), None);
    file.set(opaque(0), opaque(0));
    file.increment(&opaque(FRAMES_ACCEPTED));
    if let Ok(accepted) = file.check(opaque(0), any_bytes()) {
        opaque(accepted.value_at(opaque(0)));
        opaque(file.first_changed_setting(&accepted));
        file.apply(&accepted);
    }
    opaque(file.image());
    opaque(file.get(opaque(0)));
}
