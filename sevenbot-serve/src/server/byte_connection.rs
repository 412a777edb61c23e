//! A client whose frames come over a stream of bytes: TCP, TLS, or a Unix socket.

use std::sync::Arc;

use futures_util::FutureExt;
use protocol_core::time::Instant;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};

use super::frame_session::{End, FrameSession};
use super::shared::Shared;

/// Bytes that are read at once.
const PIECE: usize = 4_096;
/// What a frame begins with. A web page can reach this port, but whatever it sends begins otherwise: the method of HTTP, or
/// the handshake of TLS.
const FIRST_BYTE: u8 = 0xAA;

/// A stream of bytes.
pub(super) trait ByteStream: AsyncRead + AsyncWrite + Unpin + Send {}

impl<S: AsyncRead + AsyncWrite + Unpin + Send> ByteStream for S {}

/// Why a client was disconnected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NoFrames;

/// Serves a client until it ends. `first`: bytes that it has sent already.
///
/// # Errors
/// The client speaks something else than frames.
pub(super) async fn serve(
    shared: &Arc<Shared>,
    stream: impl ByteStream,
    first: Vec<u8>,
) -> Result<(), NoFrames> {
    let (mut reader, mut writer) = tokio::io::split(stream);
    let mut session = FrameSession::open(shared);
    let mut has_begun = false;
    // When it was last seen that no byte waits to be read: what is read now was sent later.
    let mut last_empty = shared.now();
    let mut piece = vec![0; PIECE];
    let mut begin = |session: &mut FrameSession, since: Instant, bytes: &[u8]| {
        has_begun |= bytes.first() == Some(&FIRST_BYTE);
        session.put(since, bytes);
        if has_begun || bytes.is_empty() { Ok(()) } else { Err(NoFrames) }
    };
    begin(&mut session, last_empty, &first)?;
    let end = loop {
        session.exchange();
        if session.has_room() {
            match reader.read(&mut piece).now_or_never() {
                Some(Ok(0)) => break End::Clean,
                Some(Ok(count)) => {
                    begin(&mut session, last_empty, piece.get(..count).unwrap_or_default())?;
                    // So that a flood leaves the thread to others.
                    tokio::task::yield_now().await;
                    continue;
                }
                Some(Err(_)) => break End::Broken,
                None => last_empty = shared.now(),
            }
        }
        let waits_for_input = session.has_room();
        tokio::select! {
            read = reader.read(&mut piece), if session.has_room() => match read {
                Ok(0) => break End::Clean,
                Ok(count) => {
                    last_empty = shared.now();
                    begin(&mut session, last_empty, piece.get(..count).unwrap_or_default())?;
                }
                Err(_) => break End::Broken,
            },
            written = writer.write(session.output()), if !session.output().is_empty() => match written {
                Ok(count) => session.consume(count),
                Err(_) => break End::Broken,
            },
            () = session.news() => {}
        }
        if waits_for_input {
            last_empty = shared.now();
        }
    };
    session.close(end);
    Ok(())
}
