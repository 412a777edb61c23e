//! The page in a browser, and its WebSocket with frames at `/frames`.
//!
//! ```text
//!   browser ── GET /, /style.css ... ──▶ PageConnection ──▶ answer: a file
//!           ── GET /frames, upgrade ───▶ PageConnection ──▶ FrameSocket ◀── binary messages ──▶ Hub
//! ```
//!
//! The files are public: they are part of the program. The arm is behind the token, and `Host` and `Origin` have to be this
//! server's own (see [`super::handshake`] for the reason).

mod answer;
mod connection;
mod frame_socket;

use std::borrow::Cow;
use std::fmt;
use std::net::SocketAddr;

pub(crate) use self::answer::Site;
pub(crate) use self::connection::PageConnection;

/// Finds a file of the page by its path below the root, such as `index.html`.
pub type PageFiles = fn(&str) -> Option<Cow<'static, [u8]>>;

/// A page to serve.
#[derive(Clone)]
pub struct PageConfig {
    /// Where to listen. It should be an address of the loopback interface.
    pub address: SocketAddr,
    /// The secret that `/frames?token=TOKEN` needs.
    pub token: String,
    /// The files.
    pub files: PageFiles,
}

impl fmt::Debug for PageConfig {
    /// Without the secret.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("PageConfig").field("address", &self.address).finish_non_exhaustive()
    }
}
