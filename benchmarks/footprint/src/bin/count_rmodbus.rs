//! Counts the instructions of the peer `rmodbus`.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use footprint::count_server;
use peers::RmodbusServer;
use peers::work::MODBUS_RTU;

#[entry]
fn main() -> ! {
    count_server::run::<RmodbusServer>(MODBUS_RTU)
}
