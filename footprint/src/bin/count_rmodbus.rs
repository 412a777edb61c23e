//! The peer rmodbus under the meter.

#![no_std]
#![no_main]

use bench_servers::RmodbusServer;
use bench_servers::work::MODBUS_RTU;
use cortex_m_rt::entry;
use footprint::contest;

#[entry]
fn main() -> ! {
    contest::run::<RmodbusServer>(MODBUS_RTU)
}
