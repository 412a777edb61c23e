//! Those compared by `cargo xtask bench` and `cargo xtask count`: servers that take a stream of requests in pieces
//! and hand out replies. The same code runs on the host, against the clock, and on the chip, where instructions are
//! counted. It knows nothing of how it is measured.

#![no_std]

mod inbox;
mod mavlink;
mod modbus_core;
mod ours;
mod postcard;
mod rmodbus;
pub mod work;

pub use mavlink::MavlinkServer;
pub use modbus_core::ModbusCoreServer;
pub use ours::OurServer;
pub use postcard::PostcardServer;
pub use rmodbus::RmodbusServer;

/// Takes a stream of requests and answers it.
pub trait Server {
    /// Takes the next piece of the stream and hands out the replies that follow from it.
    fn feed(&mut self, piece: &[u8], reply: &mut impl FnMut(&[u8]));

    /// The line has been silent for long: whatever is still unfinished stays so.
    fn end(&mut self, reply: &mut impl FnMut(&[u8]));

    /// How many requests were carried out so far.
    fn carried_out(&self) -> usize;
}
