//! WebSockets: frames in binary messages for the page; the maker's commands, or the messages of a class, in text messages.

use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::task::{Context, Poll};
use std::{io, mem};

use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{FutureExt, SinkExt, StreamExt};
use protocol_core::time::{Duration, Instant};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio_tungstenite::WebSocketStream;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Error, Message};

use super::frame_session::FrameSession;
use super::pace::ClientPace;
use super::seat::{End, Seat};
use super::shared::SharedHub;
use crate::maker::MakerClient;

/// The longest message of a page, in bytes.
const LONGEST_FRAMES: usize = 4_096;
/// The longest message of the maker's programs, as in the maker's firmware, and of a class.
const LONGEST_COMMAND: usize = 2_048;
/// Time for a client to close its connection after it was told to. Then the server closes it.
const CLOSE_TIMEOUT: Duration = Duration::from_millis(1_000);
/// Bytes that a client may send without a whole message among them: fragments without end fill no memory, but cost time.
const MOST_UNFINISHED: usize = 32 * 1_024;

/// A stream that fails when a client sends too many bytes without a whole message.
struct Metered<S> {
    stream: S,
    unfinished: Arc<AtomicUsize>,
}

impl<S: AsyncRead + Unpin> AsyncRead for Metered<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let outcome = Pin::new(&mut self.stream).poll_read(context, buffer);
        let count = buffer.filled().len().saturating_sub(before);
        if self.unfinished.fetch_add(count, Ordering::Relaxed) > MOST_UNFINISHED {
            return Poll::Ready(Err(io::Error::other("a message without an end")));
        }
        outcome
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Metered<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

type Socket<S> = WebSocketStream<Metered<S>>;
type Sink<S> = SplitSink<Socket<S>, Message>;

struct Messages<S> {
    stream: SplitStream<Socket<S>>,
    unfinished: Arc<AtomicUsize>,
}

impl<S: AsyncRead + AsyncWrite + Unpin> Messages<S> {
    /// The next message. The error tells how the connection ended.
    async fn next(&mut self) -> Result<Message, End> {
        match self.stream.next().await {
            Some(Ok(Message::Close(_))) | None | Some(Err(Error::ConnectionClosed)) => Err(End::Clean),
            Some(Ok(message)) => Ok(message),
            // Many programs close the connection without a close message.
            Some(Err(Error::Protocol(tungstenite::error::ProtocolError::ResetWithoutClosingHandshake))) => {
                Err(End::Clean)
            }
            Some(Err(_)) => Err(End::Broken),
        }
    }

    /// Returns the bytes that were read since the last call. The count for [`MOST_UNFINISHED`] begins again at 0.
    fn take_count(&self) -> usize {
        self.unfinished.swap(0, Ordering::Relaxed)
    }
}

type Sending<S> = Pin<Box<dyn Future<Output = (Sink<S>, Result<(), Error>)> + Send>>;

/// Sends one message after the other, while the task does other things.
enum MessageSender<S> {
    Idle(Sink<S>),
    Busy(Sending<S>),
    Failed,
}

impl<S: AsyncRead + AsyncWrite + Unpin + Send + 'static> MessageSender<S> {
    const fn is_idle(&self) -> bool {
        matches!(self, Self::Idle(_))
    }

    fn start(&mut self, message: Message) {
        if let Self::Idle(mut sink) = mem::replace(self, Self::Failed) {
            *self = Self::Busy(Box::pin(async move {
                let outcome = sink.send(message).await;
                (sink, outcome)
            }));
        }
    }

    /// Ends when the message is sent.
    async fn done(&mut self) -> Result<(), End> {
        let Self::Busy(sending) = self else { return std::future::pending().await };
        let (sink, outcome) = sending.await;
        *self = Self::Idle(sink);
        outcome.map_err(|_| End::Broken)
    }
}

async fn open<S>(stream: S, longest: usize) -> (MessageSender<S>, Messages<S>)
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    let config = WebSocketConfig::default()
        .max_message_size(Some(longest))
        .max_frame_size(Some(longest))
        .read_buffer_size(2 * longest)
        .write_buffer_size(0);
    let unfinished = Arc::new(AtomicUsize::new(0));
    let metered = Metered { stream, unfinished: Arc::clone(&unfinished) };
    let socket = WebSocketStream::from_raw_socket(metered, Role::Server, Some(config)).await;
    let (sink, stream) = socket.split();
    (MessageSender::Idle(sink), Messages { stream, unfinished })
}

/// Processes the messages of one client.
pub(super) trait SocketSession {
    /// Processes the messages and the news of the hub, as far as possible. Returns the next message for the client, if it
    /// `can_send` one.
    fn advance(&mut self, can_send: bool) -> Option<Message>;

    fn has_room(&self) -> bool;

    /// Has the client sent more than it may, so that its connection ends?
    fn is_overrun(&self) -> bool {
        false
    }

    /// Takes a message that the client sent at `since` or later.
    fn put(&mut self, since: Instant, message: Message);

    /// Ends when [`SocketSession::advance`] has something to do.
    fn news(&self) -> impl Future<Output = ()> + Send;

    /// The connection has ended.
    fn close(self, end: End);
}

/// Frames in binary messages: the same bytes as over TCP. A frame may be spread over messages, and a message may hold several.
impl SocketSession for FrameSession {
    fn advance(&mut self, can_send: bool) -> Option<Message> {
        self.exchange();
        (can_send && !self.output().is_empty()).then(|| Message::binary(self.take_output()))
    }

    fn has_room(&self) -> bool {
        FrameSession::has_room(self)
    }

    fn put(&mut self, since: Instant, message: Message) {
        if let Message::Binary(bytes) = message {
            FrameSession::put(self, since, &bytes);
        }
    }

    fn news(&self) -> impl Future<Output = ()> + Send {
        FrameSession::news(self)
    }

    fn close(self, end: End) {
        FrameSession::close(self, end);
    }
}

/// A client of the maker's WebSocket: commands in text messages. A dropped session is a broken connection.
struct MakerSession {
    seat: Seat,
    client: MakerClient,
}

impl MakerSession {
    fn open(shared: &Arc<SharedHub>, is_browser: bool) -> Self {
        let connect = |hub: &mut _| MakerClient::connect(hub, is_browser);
        let (seat, client) = Seat::take(shared, connect, MakerClient::id);
        Self { seat, client }
    }
}

impl SocketSession for MakerSession {
    fn advance(&mut self, can_send: bool) -> Option<Message> {
        let Self { seat, client } = self;
        seat.shared().with_client(|hub, now| client.advance(hub, now));
        can_send.then(|| client.take_answer()).flatten().map(Message::text)
    }

    fn has_room(&self) -> bool {
        // A stop behind other commands must not wait for them.
        true
    }

    fn is_overrun(&self) -> bool {
        self.client.is_overrun()
    }

    fn put(&mut self, since: Instant, message: Message) {
        if let Message::Text(text) = message {
            self.client.message(since, &text);
        }
    }

    fn news(&self) -> impl Future<Output = ()> + Send {
        self.seat.news_until(Instant::FAR_FUTURE)
    }

    fn close(mut self, end: End) {
        if end == End::Clean {
            self.advance(false);
        }
        self.seat.leave(end);
    }
}

/// A client of a WebSocket that was just opened.
pub(super) struct WebClient<S> {
    pub(super) stream: S,
    /// The bytes that have arrived already were sent at this time or later.
    pub(super) since: Instant,
}

/// Serves a client whose messages carry frames.
pub(super) async fn serve_frames<S>(shared: &Arc<SharedHub>, client: WebClient<S>)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    serve(shared, client, LONGEST_FRAMES, || FrameSession::open(shared)).await;
}

/// Serves a client of the maker's WebSocket.
pub(super) async fn serve_maker<S>(shared: &Arc<SharedHub>, client: WebClient<S>, is_browser: bool)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    serve(shared, client, LONGEST_COMMAND, || MakerSession::open(shared, is_browser)).await;
}

/// Serves a client whose messages are text. `session` opens its session once the WebSocket is open.
pub(super) async fn serve_text<S, T: SocketSession>(
    shared: &SharedHub,
    client: WebClient<S>,
    session: impl FnOnce() -> T,
) where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    serve(shared, client, LONGEST_COMMAND, session).await;
}

/// Serves a client until it ends. `longest`: bytes of its longest message.
async fn serve<S, T: SocketSession>(
    shared: &SharedHub,
    client: WebClient<S>,
    longest: usize,
    session: impl FnOnce() -> T,
) where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let (mut sender, mut messages) = open(client.stream, longest).await;
    let mut session = session();
    // The last time at which no message waited to be read. Messages that are read now were sent later.
    let mut last_empty = client.since;
    let mut pace = ClientPace::new(shared.baud);
    let mut end_at = Instant::FAR_FUTURE;
    let end = loop {
        if let Some(message) = session.advance(sender.is_idle()) {
            if message.is_close() {
                end_at = shared.now() + CLOSE_TIMEOUT;
            }
            sender.start(message);
        }
        if session.is_overrun() {
            break End::Broken;
        }
        let has_room = session.has_room();
        let waits_for_input = has_room && pace.free_at() <= shared.now();
        if waits_for_input {
            match messages.next().now_or_never() {
                Some(Ok(message)) => {
                    pace.note(shared.now(), messages.take_count());
                    session.put(last_empty, message);
                    // Yield, so that a flood does not keep the thread from other connections.
                    tokio::task::yield_now().await;
                    continue;
                }
                Some(Err(end)) => break end,
                None => last_empty = shared.now(),
            }
        }
        tokio::select! {
            message = messages.next(), if waits_for_input => match message {
                Ok(message) => {
                    pace.note(shared.now(), messages.take_count());
                    session.put(shared.earliest(), message);
                }
                Err(end) => break end,
            },
            sent = sender.done() => if let Err(end) = sent { break end },
            () = shared.sleep_until(pace.free_at()), if has_room && !waits_for_input => {}
            () = session.news() => {}
            () = shared.sleep_until(end_at) => break End::Broken,
        }
        if waits_for_input {
            last_empty = shared.earliest();
        }
    };
    session.close(end);
    // Close the connection after this wait only. Otherwise a client could evade the pace by short connections without a whole
    // message.
    pace.note(shared.now(), messages.take_count());
    shared.sleep_until(pace.free_at()).await;
}
