//! Counts the instructions of this project's parse-and-answer path.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use footprint::count_server;
use peers::OurServer;
use peers::work::SEVEN_BOT;

#[entry]
fn main() -> ! {
    count_server::run::<OurServer>(SEVEN_BOT)
}
