//! rmodbus: it guesses a frame's length and processes a frame whole, registers included; the stream is the
//! caller's.

use rmodbus::server::ModbusFrame;
use rmodbus::server::context::ModbusContext;
use rmodbus::server::storage::ModbusStorage;
use rmodbus::{ModbusProto, guess_request_frame_len};

use crate::Server;
use crate::inbox::Inbox;
use crate::work::{STATION, initial_words};

/// The peer rmodbus.
pub struct RmodbusServer {
    inbox: Inbox,
    registers: ModbusStorage<1, 1, 1, 256>,
    reply: heapless::Vec<u8, 256>,
    carried_out: usize,
}

impl Default for RmodbusServer {
    /// A server that was sent nothing yet.
    fn default() -> Self {
        let mut registers = ModbusStorage::new();
        // Cannot fail: there are as many words as registers.
        let _ = registers.set_holdings_bulk(0, &initial_words());
        Self { inbox: Inbox::new(), registers, reply: heapless::Vec::new(), carried_out: 0 }
    }
}

impl RmodbusServer {
    /// Looks at the front for one request. `false`: it takes more bytes.
    fn answer_one(&mut self, reply: &mut impl FnMut(&[u8])) -> bool {
        let Ok(length) = guess_request_frame_len(self.inbox.bytes(), ModbusProto::Rtu) else {
            return self.give_up_on_what_is_none();
        };
        let Some(bytes) = self.inbox.bytes().get(..usize::from(length)) else { return false };
        let mut frame = ModbusFrame::new(STATION, bytes, ModbusProto::Rtu, &mut self.reply);
        let is_a_request = frame.parse().is_ok() && frame.processing_required;
        if !is_a_request {
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
            self.carried_out += 1;
        }
        self.inbox.take(usize::from(length));
        true
    }

    /// No length can be guessed: for want of bytes, or because no frame is that long.
    fn give_up_on_what_is_none(&mut self) -> bool {
        /// With so many bytes there is a length, if there is a frame.
        const ENOUGH: usize = 7;
        let is_none = self.inbox.bytes().len() >= ENOUGH;
        if is_none {
            self.inbox.take(1);
        }
        is_none
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

    fn carried_out(&self) -> usize {
        self.carried_out
    }
}
