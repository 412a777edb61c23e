//! Arms that are not at a serial port: behind `sevenbot serve`, or simulated in this program. An address takes the place of
//! the port's name. Also lists the servers of this user on this computer.
//!
//! ```text
//!   tcp://HOST:PORT ──▶ address ──▶ socket_line ──▶ Arm
//!   tls://HOST:PORT ──▶    ▲            └── tls
//!   unix:PATH       ──▶    │
//!   sevenbot://NAME ──▶ local_server: the servers of this user; mdns: those of the local network; known_names: where
//!                       they were last
//!   sim, sim:SEED   ──▶ RealTimeLine ──▶ Arm
//! ```

mod address;
mod directories;
mod known_names;
mod local_server;
#[cfg(feature = "mdns")]
pub mod mdns;
mod socket_line;
#[cfg(feature = "tls")]
mod tls;

use crate::error::OpenError;
use crate::host_line::HostLine;
use crate::open_port::OpenPort;
use crate::real_time_line::{RealTimeLine, simulated_port};

pub use self::address::{Address, CERTIFICATE_VARIABLE, TOKEN_VARIABLE, is_token};
pub use self::known_names::{KnownName, NAME_RULE, forget, is_name, known_names, remember};
pub use self::local_server::{LocalServer, Registered, servers, serving};
pub use self::socket_line::SocketLine;

/// Opens a serial port, connects to a server, or switches a simulated arm on. Servers over TCP get the token of the environment
/// variable [`TOKEN_VARIABLE`].
///
/// # Errors
/// The port cannot be opened, or the server cannot be reached.
pub fn open_line(name: &str, baud: u32) -> Result<Box<dyn HostLine>, OpenError> {
    open_line_with_token(name, baud, None)
}

/// As [`open_line`], with this token; `None`: the token of the environment variable.
///
/// # Errors
/// As [`open_line`].
pub fn open_line_with_token(
    name: &str,
    baud: u32,
    token: Option<&str>,
) -> Result<Box<dyn HostLine>, OpenError> {
    if let Some(seed) = simulated_port(name) {
        return Ok(Box::new(RealTimeLine::new(seed)));
    }
    Ok(match Address::parse(name) {
        Some(address) => Box::new(SocketLine::connect(&address, token)?),
        None => Box::new(OpenPort::open(name, baud)?),
    })
}
