//! Arms behind `sevenbot serve`: addresses in the place of a port, and the servers of this computer.
//!
//! ```text
//!   tcp://HOST:PORT ──▶ address ──▶ socket_line ──▶ Arm
//!   tls://HOST:PORT ──▶    ▲            └── tls
//!   unix:PATH       ──▶    │
//!   sevenbot://NAME ──▶ local_server: the servers of this user; mdns: those of the local network
//! ```

mod address;
mod local_server;
#[cfg(feature = "mdns")]
pub mod mdns;
mod socket_line;
#[cfg(feature = "tls")]
mod tls;

use crate::error::OpenError;
use crate::host_line::HostLine;
use crate::open_port::OpenPort;

pub use self::address::{Address, CERTIFICATE_VARIABLE, TOKEN_VARIABLE};
pub use self::local_server::{LocalServer, Registered, servers, serving};
pub use self::socket_line::SocketLine;

/// Opens a serial port, or connects to a server.
///
/// # Errors
/// The port cannot be opened, or the server not be reached.
pub fn open_line(name: &str, baud: u32) -> Result<Box<dyn HostLine>, OpenError> {
    Ok(match Address::parse(name) {
        Some(address) => Box::new(SocketLine::connect(&address)?),
        None => Box::new(OpenPort::open(name, baud)?),
    })
}
