//! Counts the instructions of the peer `postcard` with `cobs`.

#![no_std]
#![no_main]

use bench_servers::PostcardServer;
use bench_servers::work::POSTCARD;
use cortex_m_rt::entry;
use footprint::count_server;

#[entry]
fn main() -> ! {
    count_server::run::<PostcardServer>(POSTCARD)
}
