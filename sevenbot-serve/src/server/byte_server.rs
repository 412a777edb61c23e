//! Clients that send frames as bytes: over TCP, TLS, or a Unix socket.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio::io::AsyncReadExt;
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::TlsAcceptor;

use super::admission::{ConnectionAdmission, TooManyWait};
use super::breakage::Breakage;
use super::byte_connection::{self, ByteStream, First, NoFrames};
use super::listener::accept_tcp;
#[cfg(unix)]
use super::local_socket::LocalSocket;
use super::notice::{Notice, Notices, RefusalReason};
use super::shared::SharedHub;
#[cfg(not(unix))]
use super::unsupported::LocalSocket;
use crate::token::is_equal;

/// How long the handshake of TLS, the token, and the wait for its check may take together.
const LOGIN_TIMEOUT: Duration = Duration::from_secs(5);
/// The first line holds the token. After this many bytes without a line feed it counts as whole.
const LONGEST_LINE: usize = 256;

/// The state that all connections of a TCP port, or of the Unix socket, share.
#[derive(Clone)]
pub(super) struct ByteServer {
    pub(super) shared: Arc<SharedHub>,
    pub(super) admission: Arc<ConnectionAdmission>,
    pub(super) notices: Notices,
    pub(super) token: Option<String>,
    pub(super) tls: Option<TlsAcceptor>,
}

impl ByteServer {
    /// Serves all clients of a TCP port.
    pub(super) async fn serve_tcp(self, listener: TcpListener) {
        loop {
            let connection = self.admission.connection().await;
            let (stream, peer) = accept_tcp(&listener).await;
            let server = self.clone();
            tokio::spawn(async move {
                server.serve_client(stream, peer).await;
                drop(connection);
            });
        }
    }

    /// Serves all clients of a Unix socket. They are programs of this user, and need no token.
    pub(super) async fn serve_local(self, socket: LocalSocket) {
        loop {
            let stream = socket.accept().await;
            // Without a free place the connection is closed.
            let Some(place) = self.admission.place() else { continue };
            let server = self.clone();
            tokio::spawn(async move {
                let first = First { bytes: Vec::new(), since: server.shared.earliest() };
                let _ = byte_connection::serve(&server.shared, stream, first).await;
                drop(place);
            });
        }
    }

    async fn serve_client(&self, stream: TcpStream, peer: SocketAddr) {
        let refuse = |reason| self.notices.send(Notice::Refused { peer: Some(peer), reason });
        let Ok(breakage) = Breakage::of(&stream) else { return };
        let login = async {
            let mut stream = self.secure(stream).await.ok()?;
            let first = match &self.token {
                None => First { bytes: Vec::new(), since: self.shared.earliest() },
                Some(token) => self.read_token(&mut stream, peer, token).await?,
            };
            Some((stream, first))
        };
        let Some((stream, first)) = self.admission.log_in(LOGIN_TIMEOUT, login).await else { return };
        let Some(_place) = self.admission.place() else { return refuse(RefusalReason::Full) };
        let served = breakage.or_end(byte_connection::serve(&self.shared, stream, first)).await;
        if served == Some(Err(NoFrames)) {
            refuse(RefusalReason::NoFrames);
        }
    }

    async fn secure(&self, stream: TcpStream) -> io::Result<Box<dyn ByteStream>> {
        Ok(match &self.tls {
            None => Box::new(stream),
            Some(tls) => Box::new(tls.accept(stream).await?),
        })
    }

    /// Reads the first line, and checks it after the delay that earlier wrong tokens cause. Returns the bytes after the line;
    /// `None` if the line is not the token, or if the connection ends or is refused.
    async fn read_token(
        &self,
        stream: &mut Box<dyn ByteStream>,
        peer: SocketAddr,
        token: &str,
    ) -> Option<First> {
        let mut line = Vec::new();
        let (given, rest, since) = loop {
            let mut bytes = [0; LONGEST_LINE];
            let count = stream.read(&mut bytes).await.ok().filter(|&count| count > 0)?;
            let since = self.shared.earliest();
            line.extend_from_slice(bytes.get(..count)?);
            if let Some(end) = line.iter().position(|&byte| byte == b'\n') {
                break (line.get(..end)?, line.get(end + 1..)?, since);
            }
            if line.len() >= LONGEST_LINE {
                break (line.as_slice(), &[][..], since);
            }
        };
        if self.admission.wait(Some(peer.ip())).await == Err(TooManyWait) {
            self.notices.send(Notice::Refused { peer: Some(peer), reason: RefusalReason::Full });
            return None;
        }
        let is_right = is_equal(given.strip_suffix(b"\r").unwrap_or(given), token.as_bytes());
        self.admission.note(Some(peer.ip()), is_right);
        if !is_right {
            self.notices.send(Notice::Refused { peer: Some(peer), reason: RefusalReason::WrongToken });
        }
        is_right.then(|| First { bytes: rest.to_vec(), since })
    }
}
