//! This project's parse-and-answer path: deframer, request, register file, reply.

use protocol_core::registers::RegisterFile;
use protocol_core::request::{Reply, Request};
use protocol_core::time::Instant;
use protocol_core::wire::deframer::{ABANDON_AFTER, gap};
use protocol_core::wire::{Deframer, FrameBuffer, ToArm};

use crate::Server;

/// This project's server: [`Deframer`] and [`RegisterFile`] of protocol-core.
pub struct OurServer {
    now: Instant,
    deframer: Deframer<ToArm>,
    registers: RegisterFile,
    reply: FrameBuffer,
    executed: usize,
}

impl Default for OurServer {
    fn default() -> Self {
        Self {
            now: Instant::ZERO,
            deframer: Deframer::new(gap(115_200)),
            registers: RegisterFile::new([1, 2, 3, 4, 5, 6], None),
            reply: FrameBuffer::new(),
            executed: 0,
        }
    }
}

impl OurServer {
    fn answer(&mut self, reply: &mut impl FnMut(&[u8])) {
        while let Some(found) = self.deframer.pull() {
            let Ok(frame) = found else { continue };
            match Request::from_frame(frame) {
                Request::Read { address, count } => {
                    Reply { address, values: self.registers.read(address, count) }.encode(&mut self.reply);
                    reply(&self.reply);
                    self.executed += 1;
                }
                Request::Write { address, values } => {
                    if let Ok(accepted) = self.registers.check(address, values) {
                        self.registers.apply(&accepted);
                        self.executed += 1;
                    }
                }
                Request::WriteMap21 { address, values } => {
                    if let Ok(accepted) = self.registers.check_map21(address, values) {
                        self.registers.apply(&accepted);
                        self.executed += 1;
                    }
                }
            }
        }
    }
}

impl Server for OurServer {
    fn feed(&mut self, piece: &[u8], reply: &mut impl FnMut(&[u8])) {
        let mut rest = piece;
        while !rest.is_empty() {
            let taken = self.deframer.push(self.now, rest);
            self.answer(reply);
            rest = rest.get(taken..).unwrap_or(&[]);
        }
    }

    fn end(&mut self, reply: &mut impl FnMut(&[u8])) {
        self.now = self.now + ABANDON_AFTER;
        self.deframer.push(self.now, &[]);
        self.answer(reply);
    }

    fn executed(&self) -> usize {
        self.executed
    }
}
