//! This project's path under the meter.

#![no_std]
#![no_main]

use bench_servers::OurServer;
use bench_servers::work::SEVEN_BOT;
use cortex_m_rt::entry;
use footprint::contest;

#[entry]
fn main() -> ! {
    contest::run::<OurServer>(SEVEN_BOT)
}
