//! The servers that `cargo xtask bench` compares. Each takes a stream of requests in pieces and returns replies. The same
//! code is timed on the host, and its instructions are counted in the emulator. It does not know how it is measured.

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

/// Parses a stream of requests and replies to them.
pub trait Server {
    /// Takes the next piece of the stream and passes each reply to `reply`.
    fn feed(&mut self, piece: &[u8], reply: &mut impl FnMut(&[u8]));

    /// Ends the stream like a silence longer than any timeout: drops an unfinished frame, and answers complete requests behind its
    /// header. [`PostcardServer`] does nothing, because a mark ends its frames.
    fn end(&mut self, reply: &mut impl FnMut(&[u8]));

    /// The number of requests executed so far.
    fn executed(&self) -> usize;
}
