//! Counts the instructions of the peer `modbus-core`.

#![no_std]
#![no_main]

use bench_servers::ModbusCoreServer;
use bench_servers::work::MODBUS_RTU;
use cortex_m_rt::entry;
use footprint::count_server;

#[entry]
fn main() -> ! {
    count_server::run::<ModbusCoreServer>(MODBUS_RTU)
}
