//! HTTP: the files of the page, and the WebSockets at `/frames`, `/ws`, `/class` and `/teacher`.
//!
//! ```text
//!   browser ── GET /, /style.css ... ──▶ WebServer ──▶ answer: a file
//!           ── GET /frames, upgrade ───▶ WebServer ──▶ web_socket: frames ◀── binary messages ──▶ Hub
//!   maker's program ── GET /ws ────────▶ WebServer ──▶ web_socket: commands ◀── text messages ──▶ Hub
//! ```

use std::convert::Infallible;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use http_body_util::Full;
use hyper::body::{Bytes, Incoming};
use hyper::server::conn::http1;
use hyper::upgrade::OnUpgrade;
use hyper::{Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use protocol_core::time::Instant;
use socket2::{SockRef, Socket};
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::TlsAcceptor;
use tower_http::compression::Compression;

use super::admission::{ConnectionAdmission, Place, TooManyWait};
use super::answer::{HttpAnswer, Protocol, refusal};
use super::breakage::Breakage;
use super::byte_connection::ByteStream;
use super::class::Class;
use super::class_session::ClassSession;
use super::listener::{SEND_BUFFER, accept_tcp};
use super::new_key::NewKey;
use super::notice::{Notice, Notices, RefusalReason};
use super::shared::{SharedHub, lock};
use super::site::Site;
use super::web_socket::{WebClient, serve_frames, serve_maker, serve_text};

/// How long a request and its answer may take.
const TIMEOUT: Duration = Duration::from_secs(30);
/// How long a client may take for the head of its request, and the handshake of TLS.
const HEAD_TIMEOUT: Duration = Duration::from_secs(5);
/// The longest request, in bytes.
const LONGEST_REQUEST: usize = 16 * 1_024;
/// Bytes of a file that wait in the kernel for a slow client. Linux reserves twice as many.
const FILE_BUFFER: usize = 256 * 1_024;

/// The state that all connections of a port share.
#[derive(Clone)]
pub(super) struct WebServer {
    pub(super) shared: Arc<SharedHub>,
    pub(super) admission: Arc<ConnectionAdmission>,
    pub(super) notices: Notices,
    pub(super) site: Site,
    pub(super) tls: Option<TlsAcceptor>,
    /// The class, if the site is one, and how it gets the keys of its pupils.
    pub(super) class: Option<(Arc<Class>, NewKey)>,
}

/// An accepted request for a WebSocket.
struct Upgrade {
    connection: OnUpgrade,
    protocol: Protocol,
    place: Place,
    /// Bytes that wait behind the request were sent at this time or later.
    since: Instant,
}

impl WebServer {
    /// Serves all clients of a port.
    pub(super) async fn serve(self, listener: TcpListener) {
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

    /// Answers one request, and then serves the WebSocket if it asked for one.
    async fn serve_client(&self, stream: TcpStream, peer: SocketAddr) {
        // An error does no harm: a smaller buffer is only slower.
        let _ = SockRef::from(&stream).set_send_buffer_size(FILE_BUFFER);
        let Ok(socket) = SockRef::from(&stream).try_clone() else { return };
        let answered = self.admission.log_in(TIMEOUT, self.answer_request(stream, peer)).await;
        let Some(Upgrade { connection, protocol, place, since }) = answered else { return };
        let Ok(connection) = connection.await else { return };
        let _ = socket.set_send_buffer_size(SEND_BUFFER);
        let Ok(breakage) = Breakage::of(&socket) else { return };
        drop::<Socket>(socket);
        let client = WebClient { stream: TokioIo::new(connection), since };
        let serve = async {
            match (protocol, &self.class) {
                (Protocol::Frames, _) => serve_frames(&self.shared, client).await,
                (Protocol::Maker { is_browser }, _) => serve_maker(&self.shared, client, is_browser).await,
                (Protocol::Class(role), Some((class, new_key))) => {
                    let Some(key) = new_key() else { return };
                    serve_text(&self.shared, client, || ClassSession::open(class, role, key)).await;
                }
                (Protocol::LentArm(lease), Some((class, _))) => {
                    class.while_lent(lease, serve_frames(&self.shared, client)).await;
                }
                (Protocol::Class(_) | Protocol::LentArm(_), None) => {}
            }
        };
        let _ = breakage.or_end(serve).await;
        drop(place);
    }

    async fn answer_request(&self, stream: TcpStream, peer: SocketAddr) -> Option<Upgrade> {
        let secured: Box<dyn ByteStream> = match &self.tls {
            None => Box::new(stream),
            Some(tls) => Box::new(tokio::time::timeout(HEAD_TIMEOUT, tls.accept(stream)).await.ok()?.ok()?),
        };
        let upgrade = Arc::new(Mutex::new(None));
        let service = tower::service_fn(|request: Request<Incoming>| {
            let upgrade = Arc::clone(&upgrade);
            async move { Ok::<_, Infallible>(self.answer(request, peer, &upgrade).await) }
        });
        let service = TowerToHyperService::new(Compression::new(service));
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(HEAD_TIMEOUT)
            .max_buf_size(LONGEST_REQUEST)
            .serve_connection(TokioIo::new(secured), service);
        let _ = connection.with_upgrades().await;
        lock(&upgrade).take()
    }

    async fn answer(
        &self,
        mut request: Request<Incoming>,
        peer: SocketAddr,
        upgrade: &Mutex<Option<Upgrade>>,
    ) -> Response<Full<Bytes>> {
        let since = self.shared.earliest();
        // Only a request that needs a token is delayed after wrong tokens. The files are public.
        if !self.site.is_public(&request) && self.admission.wait(Some(peer.ip())).await == Err(TooManyWait) {
            self.refused(peer, RefusalReason::Full);
            let text = "Too many wrong tokens came from your address. Try again in a minute.\n";
            return refusal(StatusCode::TOO_MANY_REQUESTS, text);
        }
        let (response, protocol) = match self.site.answer(&request) {
            HttpAnswer::Whole(response) => {
                if response.status() == StatusCode::UNAUTHORIZED {
                    self.admission.note(Some(peer.ip()), false);
                    self.refused(peer, RefusalReason::WrongToken);
                }
                return response;
            }
            HttpAnswer::Upgrade(response, protocol) => (response, protocol),
        };
        self.admission.note(Some(peer.ip()), true);
        let place = if protocol.has_reserved_place() {
            self.admission.reserved_place()
        } else {
            self.admission.place()
        };
        let Some(place) = place else {
            self.refused(peer, RefusalReason::Full);
            let text = "The server has too many clients. Close a page or a program, and try again.\n";
            return refusal(StatusCode::SERVICE_UNAVAILABLE, text);
        };
        let connection = hyper::upgrade::on(&mut request);
        *lock(upgrade) = Some(Upgrade { connection, protocol, place, since });
        response
    }

    fn refused(&self, peer: SocketAddr, reason: RefusalReason) {
        self.notices.send(Notice::Refused { peer: Some(peer), reason });
    }
}
