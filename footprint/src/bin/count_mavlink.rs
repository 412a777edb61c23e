//! The peer mavlink under the meter.

#![no_std]
#![no_main]

use bench_servers::MavlinkServer;
use bench_servers::work::MAVLINK;
use cortex_m_rt::entry;
use footprint::contest;

#[entry]
fn main() -> ! {
    contest::run::<MavlinkServer>(MAVLINK)
}
