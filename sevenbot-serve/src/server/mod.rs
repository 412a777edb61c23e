//! The server: the hub between the arm's serial port and the connections of its clients.
//!
//! ```text
//!   ArmPort ◀──▶ SharedHub ◀───┬─▶ FrameSession ◀──▶ PtyPort, or byte_connection: TCP, TLS, Unix socket
//!                              ├─▶ FrameSession ◀──▶ web_socket ◀──▶ WebServer: HTTP, files of the page
//!                              ├─▶ MakerSession ◀──▶ web_socket
//!                              └─▶ Class ◀──▶ ClassSession ◀──▶ web_socket
//! ```
//!
//! One task serves the arm's port, and one each connection. All run in one thread: at 115 200 baud the arm's line carries at most
//! 1,650 frames a second in each direction, which is little work for one thread.

mod access;
mod admission;
mod answer;
mod arm_location;
mod arm_port;
mod arm_serial;
mod breakage;
mod byte_connection;
mod byte_server;
mod class;
mod class_session;
mod class_site;
mod config;
mod descriptors;
mod frame_session;
mod listener;
#[cfg(unix)]
mod local_socket;
mod network;
mod new_key;
mod notice;
mod pace;
#[cfg(target_os = "linux")]
mod pty;
#[cfg(target_os = "linux")]
mod readiness;
mod seat;
mod shared;
mod site;
mod start_error;
mod stop;
mod tls;
#[cfg(not(target_os = "linux"))]
mod unsupported;
mod web_server;
mod web_socket;

use std::io;
use std::net::{IpAddr, SocketAddr};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::TcpListener;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::mpsc;
use tokio_rustls::TlsAcceptor;

use self::arm_port::ArmPort;
use self::listener::open_tcp;
#[cfg(unix)]
use self::local_socket::LocalSocket;
use self::network::Network;
use self::notice::Notices;
#[cfg(target_os = "linux")]
use self::pty::PtyPort;
use self::shared::SharedHub;
#[cfg(not(unix))]
use self::unsupported::LocalSocket;
#[cfg(not(target_os = "linux"))]
use self::unsupported::PtyPort;
use crate::hub::Hub;

pub use self::access::AccessPolicy;
pub use self::answer::PageFiles;
pub use self::arm_location::ArmLocation;
pub use self::config::ServerConfig;
pub use self::new_key::NewKey;
pub use self::notice::{Notice, RefusalReason};
pub use self::site::{ClassConfig, PageConfig};
pub use self::start_error::StartError;
pub use self::stop::ServerStop;
pub use self::tls::TlsFiles;

/// Notices about refused clients that may wait. More are dropped.
const MOST_NOTICES: usize = 4;
/// Time between two notices about refused clients, so that a flood of them fills no log.
const NOTICE_PERIOD: Duration = Duration::from_millis(200);

/// Number of turns of tasks after which the runtime checks which other connections have bytes. A flood keeps tasks ready all
/// the time, and a stop must not wait for many of their turns.
const POLL_INTERVAL: u32 = 4;

/// A server that has opened everything but the arm's port.
#[derive(Debug)]
pub struct Server {
    runtime: Runtime,
    ptys: Vec<PtyPort>,
    socket: Option<LocalSocket>,
    tcp: Option<TcpListener>,
    web_socket: Option<TcpListener>,
    page: Option<TcpListener>,
    class: Option<TcpListener>,
    tls: Option<TlsSettings>,
    config: ServerConfig,
}

/// A wrapper with [`std::fmt::Debug`], which [`TlsAcceptor`] lacks.
#[derive(Clone)]
struct TlsSettings(TlsAcceptor);

impl std::fmt::Debug for TlsSettings {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("TlsSettings")
    }
}

impl Server {
    /// Opens everything but the arm's port.
    ///
    /// # Errors
    /// See [`StartError`].
    pub fn open(config: ServerConfig) -> Result<Self, StartError> {
        let runtime = Builder::new_current_thread().enable_all().event_interval(POLL_INTERVAL).build();
        let runtime = runtime.map_err(StartError::System)?;
        let inside = runtime.enter();
        let ptys = config.ptys.iter().map(|link| PtyPort::open(link)).collect::<Result<_, _>>()?;
        let tls = config.tls.as_ref().map(tls::acceptor).transpose()?.map(TlsSettings);
        let socket = config.socket.as_deref().map(LocalSocket::open).transpose()?;
        let tcp = config.tcp.map(open_tcp).transpose()?;
        let web_socket = config.web_socket.map(open_tcp).transpose()?;
        let page = config.page.as_ref().map(|page| open_tcp(page.address)).transpose()?;
        let class = config.class.as_ref().map(|class| open_tcp(class.address)).transpose()?;
        drop(inside);
        Ok(Self { runtime, ptys, socket, tcp, web_socket, page, class, tls, config })
    }

    /// The path of the Unix socket.
    #[must_use]
    pub fn socket_path(&self) -> Option<&Path> {
        self.socket.as_ref().map(LocalSocket::path)
    }

    /// The address for TCP clients, with the port that the system chose for port 0.
    #[must_use]
    pub fn tcp_address(&self) -> Option<SocketAddr> {
        address(self.tcp.as_ref())
    }

    /// The address for WebSocket clients, with the port that the system chose for port 0.
    #[must_use]
    pub fn web_socket_address(&self) -> Option<SocketAddr> {
        address(self.web_socket.as_ref())
    }

    /// The address of the page, with the port that the system chose for port 0.
    #[must_use]
    pub fn page_address(&self) -> Option<SocketAddr> {
        address(self.page.as_ref())
    }

    /// The address of the class, with the port that the system chose for port 0.
    #[must_use]
    pub fn class_address(&self) -> Option<SocketAddr> {
        address(self.class.as_ref())
    }

    /// The address of the class's page for a browser that reaches this host.
    #[must_use]
    pub fn class_page(&self, host: IpAddr) -> Option<String> {
        let port = self.class_address()?.port();
        Some(class_site::page(host, port, self.tls.is_some()))
    }

    /// Serves until it is stopped.
    ///
    /// # Errors
    /// The operating system fails at a pseudo-terminal.
    pub fn run(self, stop: &ServerStop, notify: &mut dyn FnMut(Notice)) -> io::Result<()> {
        let Self { runtime, ptys, socket, tcp, web_socket, page, class, tls, config } = self;
        runtime.block_on(async {
            let shared = SharedHub::new(Hub::new(config.baud, config.options), config.baud);
            tokio::spawn(Arc::clone(&shared).beat());
            let (arm_notices, mut arm_news) = mpsc::unbounded_channel();
            let (refusals, mut refused) = mpsc::channel(MOST_NOTICES);
            let (failures, mut failed) = mpsc::channel(1);
            if let Some(location) = config.arm.clone() {
                let port = ArmPort::new(location, config.baud);
                let notify = move |notice| drop(arm_notices.send(notice));
                tokio::spawn(port.serve(Arc::clone(&shared), notify));
            }
            for pty in ptys {
                let (shared, failures) = (Arc::clone(&shared), failures.clone());
                tokio::spawn(async move {
                    if let Err(error) = pty.serve(shared).await {
                        let _ = failures.send(error).await;
                    }
                });
            }
            let network =
                Network { shared, notices: Notices(refusals), tls: tls.map(|TlsSettings(tls)| tls) };
            descriptors::ask_for_more();
            network.spawn_class(&config, class);
            network.spawn(&config, socket, tcp, web_socket, page);
            let mut next_refusal = tokio::time::Instant::now();
            loop {
                tokio::select! {
                    () = stop.stopped() => return Ok(()),
                    Some(error) = failed.recv() => return Err(error),
                    Some(notice) = arm_news.recv() => notify(notice),
                    Some(notice) = refused.recv() => {
                        if tokio::time::Instant::now() >= next_refusal {
                            notify(notice);
                            next_refusal = tokio::time::Instant::now() + NOTICE_PERIOD;
                        }
                    }
                }
            }
        })
    }
}

fn address(listener: Option<&TcpListener>) -> Option<SocketAddr> {
    listener?.local_addr().ok()
}
