//! A server that does nothing, under the meter: what the others are larger by is theirs.

#![no_std]
#![no_main]

use bench_servers::Server;
use bench_servers::work::SEVEN_BOT;
use cortex_m_rt::entry;
use footprint::{contest, opaque};

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
    contest::run::<Nothing>(SEVEN_BOT)
}
