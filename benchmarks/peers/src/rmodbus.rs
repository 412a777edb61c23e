//! The peer `rmodbus`. It guesses the length of a frame and processes it, registers included. The stream is
//! implemented here.

use rmodbus::server::ModbusFrame;
use rmodbus::server::context::ModbusContext;
use rmodbus::server::storage::ModbusStorage;
use rmodbus::{ModbusProto, guess_request_frame_len};

use crate::Server;
use crate::inbox::Inbox;
use crate::work::{REGISTERS, STATION, initial_words};

/// A Modbus RTU server with all functions of `rmodbus`.
pub struct RmodbusServer {
    inbox: Inbox,
    registers: ModbusStorage<1, 1, 1, REGISTERS>,
    reply: heapless::Vec<u8, 256>,
    executed: usize,
}

impl Default for RmodbusServer {
    fn default() -> Self {
        let mut registers = ModbusStorage::new();
        // Cannot fail: both hold the same number of registers.
        let _ = registers.set_holdings_bulk(0, &initial_words());
        Self { inbox: Inbox::new(), registers, reply: heapless::Vec::new(), executed: 0 }
    }
}

impl RmodbusServer {
    /// Parses one request at the front. Returns `false` if it needs more bytes.
    fn answer_one(&mut self, reply: &mut impl FnMut(&[u8])) -> bool {
        let Ok(length) = guess_request_frame_len(self.inbox.bytes(), ModbusProto::Rtu) else {
            return self.skip_invalid_byte();
        };
        let Some(bytes) = self.inbox.bytes().get(..usize::from(length)) else { return false };
        let mut frame = ModbusFrame::new(STATION, bytes, ModbusProto::Rtu, &mut self.reply);
        let is_request = frame.parse().is_ok() && frame.processing_required;
        if !is_request {
            self.inbox.take(1);
            return true;
        }
        let processed = if frame.readonly {
            frame.process_read(&self.registers)
        } else {
            frame.process_write(&mut self.registers)
        };
        let answered = processed.is_ok() && frame.error.is_none() && frame.finalize_response().is_ok();
        if answered {
            reply(&self.reply);
            self.executed += 1;
        }
        self.inbox.take(usize::from(length));
        true
    }

    /// Drops one byte if the length cannot be guessed although enough bytes have arrived.
    fn skip_invalid_byte(&mut self) -> bool {
        /// The length of every valid frame can be guessed from this many bytes.
        const MIN_BYTES: usize = 7;
        let is_invalid = self.inbox.bytes().len() >= MIN_BYTES;
        if is_invalid {
            self.inbox.take(1);
        }
        is_invalid
    }
}

impl Server for RmodbusServer {
    fn feed(&mut self, piece: &[u8], reply: &mut impl FnMut(&[u8])) {
        self.inbox.push(piece);
        while self.answer_one(reply) {}
    }

    fn end(&mut self, reply: &mut impl FnMut(&[u8])) {
        while !self.inbox.bytes().is_empty() {
            if !self.answer_one(reply) {
                self.inbox.take(1);
            }
        }
    }

    fn executed(&self) -> usize {
        self.executed
    }
}
