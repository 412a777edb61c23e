//! Counts the instructions of the peer `postcard` with `cobs`.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use footprint::count_server;
use peers::PostcardServer;
use peers::work::POSTCARD;

#[entry]
fn main() -> ! {
    count_server::run::<PostcardServer>(POSTCARD)
}
