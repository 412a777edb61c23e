//! Counts the instructions of a server that does nothing. The size of this program is subtracted from that of the
//! others.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use footprint::{count_server, opaque};
use peers::Server;
use peers::work::SEVEN_BOT;

/// A server that returns each piece as the reply.
#[derive(Default)]
struct Nothing;

impl Server for Nothing {
    fn feed(&mut self, piece: &[u8], reply: &mut impl FnMut(&[u8])) {
        reply(opaque(piece));
    }

    fn end(&mut self, _: &mut impl FnMut(&[u8])) {}

    fn carried_out(&self) -> usize {
        opaque(0)
    }
}

#[entry]
fn main() -> ! {
    count_server::run::<Nothing>(SEVEN_BOT)
}
