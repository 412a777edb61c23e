//! Counts the instructions of a server that parses nothing and returns each piece. The size of this program is subtracted
//! from the sizes of the other programs that count a server.

#![no_std]
#![no_main]

use footprint::opaque;
use peers::Server;

/// A server that returns each piece as the reply.
#[derive(Default)]
struct Nothing;

impl Server for Nothing {
    fn feed(&mut self, piece: &[u8], reply: &mut impl FnMut(&[u8])) {
        reply(opaque(piece));
    }

    fn end(&mut self, _: &mut impl FnMut(&[u8])) {}

    fn executed(&self) -> usize {
        opaque(0)
    }
}

footprint::count_program!(Nothing, peers::work::SEVEN_BOT);
