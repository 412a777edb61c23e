//! A client whose frames come over a stream of bytes: TCP, TLS, or a Unix socket.

use std::sync::Arc;

use futures_util::FutureExt;
use protocol_core::time::Instant;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};

use super::frame_session::FrameSession;
use super::pace::ClientPace;
use super::seat::End;
use super::shared::SharedHub;

/// Bytes that are read at once. Between two pieces of a flood other connections have their turns.
const PIECE: usize = 512;
/// The first byte of a frame. A web page can reach this port, but its data begins with a method of HTTP or the handshake of
/// TLS.
const FIRST_BYTE: u8 = 0xAA;

pub(super) trait ByteStream: AsyncRead + AsyncWrite + Unpin + Send {}

impl<S: AsyncRead + AsyncWrite + Unpin + Send> ByteStream for S {}

/// The client was disconnected, because its first byte does not begin a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NoFrames;

/// The bytes that a client has sent before its session began.
#[derive(Debug)]
pub(super) struct First {
    pub(super) bytes: Vec<u8>,
    /// These bytes, and what waits behind them, were sent at this time or later.
    pub(super) since: Instant,
}

/// Serves a client until it ends.
///
/// # Errors
/// The client's first byte does not begin a frame.
pub(super) async fn serve(
    shared: &Arc<SharedHub>,
    stream: impl ByteStream,
    First { bytes: first, since }: First,
) -> Result<(), NoFrames> {
    let (mut reader, mut writer) = tokio::io::split(stream);
    let mut client = FrameStream { session: FrameSession::open(shared), has_begun: false };
    // The last time at which no byte waited to be read. Bytes that are read now were sent later.
    let mut last_empty = since;
    let mut pace = ClientPace::new(shared.baud);
    let mut piece = vec![0; PIECE];
    client.put(last_empty, &first)?;
    let end = loop {
        client.session.exchange();
        let has_room = client.session.has_room();
        let waits_for_input = has_room && pace.free_at() <= shared.now();
        if waits_for_input {
            match receive(&mut reader, &mut piece).now_or_never() {
                Some(Ok(bytes)) => {
                    pace.note(shared.now(), bytes.len());
                    client.put(last_empty, bytes)?;
                    // Yield, so that a flood does not keep the thread from other connections.
                    tokio::task::yield_now().await;
                    continue;
                }
                Some(Err(end)) => break end,
                None => last_empty = shared.now(),
            }
        }
        let session = &mut client.session;
        tokio::select! {
            received = receive(&mut reader, &mut piece), if waits_for_input => match received {
                Ok(bytes) => {
                    pace.note(shared.now(), bytes.len());
                    client.put(shared.earliest(), bytes)?;
                }
                Err(end) => break end,
            },
            written = writer.write(session.output()), if !session.output().is_empty() => match written {
                Ok(count) => session.consume(count),
                Err(_) => break End::Broken,
            },
            () = shared.sleep_until(pace.free_at()), if has_room && !waits_for_input => {}
            () = session.news() => {}
        }
        if waits_for_input {
            last_empty = shared.earliest();
        }
    };
    client.session.close(end);
    Ok(())
}

/// A client whose first byte has to be [`FIRST_BYTE`].
struct FrameStream {
    session: FrameSession,
    has_begun: bool,
}

impl FrameStream {
    /// Takes bytes that the client sent at `since` or later.
    fn put(&mut self, since: Instant, bytes: &[u8]) -> Result<(), NoFrames> {
        self.has_begun |= bytes.first() == Some(&FIRST_BYTE);
        self.session.put(since, bytes);
        if self.has_begun || bytes.is_empty() { Ok(()) } else { Err(NoFrames) }
    }
}

/// Receives bytes. The error tells how the connection ended.
async fn receive<'a>(reader: &mut (impl AsyncRead + Unpin), piece: &'a mut [u8]) -> Result<&'a [u8], End> {
    match reader.read(piece).await {
        Ok(0) => Err(End::Clean),
        Ok(count) => Ok(piece.get(..count).unwrap_or_default()),
        Err(_) => Err(End::Broken),
    }
}
