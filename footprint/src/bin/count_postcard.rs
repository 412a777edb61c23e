//! The peers postcard and cobs under the meter.

#![no_std]
#![no_main]

use bench_servers::PostcardServer;
use bench_servers::work::POSTCARD;
use cortex_m_rt::entry;
use footprint::contest;

#[entry]
fn main() -> ! {
    contest::run::<PostcardServer>(POSTCARD)
}
