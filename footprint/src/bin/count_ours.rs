//! Counts the instructions of this project's parse-and-answer path.

#![no_std]
#![no_main]

use bench_servers::OurServer;
use bench_servers::work::SEVEN_BOT;
use cortex_m_rt::entry;
use footprint::count_server;

#[entry]
fn main() -> ! {
    count_server::run::<OurServer>(SEVEN_BOT)
}
