//! Counts the instructions of the peer `modbus-core`.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use footprint::count_server;
use peers::ModbusCoreServer;
use peers::work::MODBUS_RTU;

#[entry]
fn main() -> ! {
    count_server::run::<ModbusCoreServer>(MODBUS_RTU)
}
