//! The peer modbus-core under the meter.

#![no_std]
#![no_main]

use bench_servers::ModbusCoreServer;
use bench_servers::work::MODBUS_RTU;
use cortex_m_rt::entry;
use footprint::contest;

#[entry]
fn main() -> ! {
    contest::run::<ModbusCoreServer>(MODBUS_RTU)
}
