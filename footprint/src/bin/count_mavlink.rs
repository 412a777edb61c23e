//! Counts the instructions of the peer `mavlink`.

#![no_std]
#![no_main]

use bench_servers::MavlinkServer;
use bench_servers::work::MAVLINK;
use cortex_m_rt::entry;
use footprint::count_server;

#[entry]
fn main() -> ! {
    count_server::run::<MavlinkServer>(MAVLINK)
}
