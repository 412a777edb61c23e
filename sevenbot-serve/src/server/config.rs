//! The configuration of a server at its start.

use std::net::SocketAddr;
use std::path::PathBuf;

use super::access::AccessPolicy;
use super::arm_location::ArmLocation;
use super::site::{ClassConfig, PageConfig};
use super::tls::TlsFiles;
use crate::hub::HubOptions;

/// What a server serves, and to whom.
#[derive(Clone, Debug)]
pub struct ServerConfig {
    /// The serial port of the arm; `None`: there is no arm.
    pub arm: Option<ArmLocation>,
    /// The baud rate of the arm's line, in bits per second.
    pub baud: u32,
    /// Links to pseudo-terminals; Linux only.
    pub ptys: Vec<PathBuf>,
    /// A Unix socket for programs of this user; not on Windows.
    pub socket: Option<PathBuf>,
    /// Address for clients that speak frames over TCP.
    pub tcp: Option<SocketAddr>,
    /// Address for clients of the maker's WebSocket.
    pub web_socket: Option<SocketAddr>,
    /// The page for a browser of this computer, for `sevenbot view`; `None`: there is none.
    pub page: Option<PageConfig>,
    /// The page for a class, and the teacher's screen; `None`: there is no class.
    pub class: Option<ClassConfig>,
    /// Who may connect over TCP and the maker's WebSocket.
    pub access: AccessPolicy,
    /// The certificate for TCP, the maker's WebSocket and the class; `None`: they are not encrypted.
    pub tls: Option<TlsFiles>,
    /// May clients write, and may only one at a time move the arm?
    pub options: HubOptions,
}

impl ServerConfig {
    /// A server without any way to connect yet. `baud` is the rate of the arm's line, in bits per second.
    #[must_use]
    pub const fn new(arm: Option<ArmLocation>, baud: u32) -> Self {
        Self {
            arm,
            baud,
            ptys: Vec::new(),
            socket: None,
            tcp: None,
            web_socket: None,
            page: None,
            class: None,
            access: AccessPolicy { token: None, allows_any_page: false },
            tls: None,
            options: HubOptions { is_read_only: false, has_one_driver: false },
        }
    }
}
