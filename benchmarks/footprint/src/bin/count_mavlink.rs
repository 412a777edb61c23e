//! Counts the instructions of the peer `mavlink`.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use footprint::count_server;
use peers::MavlinkServer;
use peers::work::MAVLINK;

#[entry]
fn main() -> ! {
    count_server::run::<MavlinkServer>(MAVLINK)
}
