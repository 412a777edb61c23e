//! The port served by a thread, for systems that do not report the readiness of serial ports. The thread reads and writes in
//! turn: on Windows a port does only one of the two at a time, so a read that waits delays a write.
//!
//! ```text
//!   port ──▶ thread ──▶ inbox ──▶ read()
//!   port ◀── thread ◀── outbox ◀── write()
//! ```

use std::io::{self, ErrorKind};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use serialport::SerialPort;
use tokio::sync::Notify;

use crate::server::shared::lock;

/// How long a read waits for its first byte, and so the longest time by which it delays a write.
const READ_TIMEOUT: Duration = Duration::from_millis(5);
/// A port that takes no bytes for this long has failed.
const WRITE_TIMEOUT: Duration = Duration::from_secs(2);
/// Bytes that are read or written at once: 22 ms at 115 200 baud.
const PIECE: usize = 256;

/// An open port. Dropping it ends its thread.
#[derive(Debug)]
pub(crate) struct ArmSerial(Arc<PortState>);

/// What the thread and the server share.
#[derive(Debug, Default)]
struct PortState {
    boxes: Mutex<Boxes>,
    /// Bytes came into the inbox, or the port failed.
    arrived: Notify,
    /// The bytes of the outbox were written, or the port failed.
    written: Notify,
}

#[derive(Debug, Default)]
struct Boxes {
    /// Bytes that have arrived.
    inbox: Vec<u8>,
    /// Bytes that are to be written.
    outbox: Vec<u8>,
    /// Why no more bytes will arrive.
    failure: Option<ErrorKind>,
    is_closed: bool,
}

impl ArmSerial {
    pub(crate) fn open(path: &Path, baud: u32) -> io::Result<Self> {
        let mut port = serialport::new(path.to_string_lossy(), baud).timeout(READ_TIMEOUT).open()?;
        let state = Arc::new(PortState::default());
        let of_thread = Arc::clone(&state);
        thread::spawn(move || {
            if let Err(error) = of_thread.serve(port.as_mut()) {
                lock(&of_thread.boxes).failure = Some(error.kind());
                of_thread.arrived.notify_one();
                of_thread.written.notify_one();
            }
        });
        Ok(Self(state))
    }

    /// Reads bytes that have arrived. If it returns fewer than asked for, no more have arrived.
    pub(crate) fn read(&self, bytes: &mut [u8]) -> io::Result<usize> {
        let mut boxes = lock(&self.0.boxes);
        if let (true, Some(failure)) = (boxes.inbox.is_empty(), boxes.failure) {
            return Err(failure.into());
        }
        let count = boxes.inbox.len().min(bytes.len());
        bytes.iter_mut().zip(boxes.inbox.drain(..count)).for_each(|(to, from)| *to = from);
        Ok(count)
    }

    /// Sends bytes. Returns how many were accepted.
    pub(crate) fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        let mut boxes = lock(&self.0.boxes);
        if let Some(failure) = boxes.failure {
            return Err(failure.into());
        }
        let before = boxes.outbox.len();
        boxes.outbox.extend(bytes.iter().take(PIECE.saturating_sub(before)));
        Ok(boxes.outbox.len() - before)
    }

    /// Ends when there is something to read, or an error.
    pub(crate) async fn readable(&self) -> io::Result<()> {
        self.0.arrived.notified().await;
        Ok(())
    }

    /// Ends when the bytes of an earlier [`Self::write`] were written, or the port has failed.
    pub(crate) async fn writable(&self) -> io::Result<()> {
        self.0.written.notified().await;
        Ok(())
    }
}

impl Drop for ArmSerial {
    fn drop(&mut self) {
        lock(&self.0.boxes).is_closed = true;
    }
}

impl PortState {
    /// Reads and writes until the port fails or is closed.
    fn serve(&self, port: &mut dyn SerialPort) -> io::Result<()> {
        let mut piece = [0; PIECE];
        while !lock(&self.boxes).is_closed {
            let outbox = std::mem::take(&mut lock(&self.boxes).outbox);
            if !outbox.is_empty() {
                port.set_timeout(WRITE_TIMEOUT)?;
                port.write_all(&outbox)?;
                port.set_timeout(READ_TIMEOUT)?;
                self.written.notify_one();
            }
            // Some systems wait until all bytes that a read asks for are there.
            let waiting = usize::try_from(port.bytes_to_read()?).unwrap_or(PIECE).clamp(1, PIECE);
            match port.read(piece.get_mut(..waiting).unwrap_or_default()) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(count) => {
                    lock(&self.boxes).inbox.extend(piece.iter().take(count));
                    self.arrived.notify_one();
                }
                Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

#[cfg(all(test, target_os = "linux"))]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use tty_ports::pty::Pty;

    use super::*;

    /// Longer than any wait on a busy machine.
    const TIMEOUT: Duration = Duration::from_secs(60);

    /// Waits for `count` bytes of the port, or its error.
    async fn receive(port: &ArmSerial, count: usize) -> io::Result<Vec<u8>> {
        let mut received = Vec::new();
        while received.len() < count {
            tokio::time::timeout(TIMEOUT, port.readable()).await??;
            let mut bytes = [0; 64];
            let count = port.read(&mut bytes)?;
            received.extend(bytes.iter().take(count));
        }
        Ok(received)
    }

    #[test]
    fn bytes_pass_both_ways_and_the_end_of_the_port_is_an_error() {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let pty = Pty::open(None).unwrap();
        let port = ArmSerial::open(pty.path(), 115_200).unwrap();
        assert_eq!(port.write(&[7; 2 * PIECE]).unwrap(), PIECE, "no more than fit");
        let mut taken = 0;
        runtime.block_on(async {
            tokio::time::timeout(TIMEOUT, port.writable()).await.expect("written in time").unwrap();
            while taken < PIECE {
                taken += pty.read(&mut [0; 2 * PIECE]).unwrap();
                tokio::time::sleep(Duration::from_millis(1)).await;
            }
            assert_eq!(taken, PIECE);
            assert_eq!(port.read(&mut [0; 8]).unwrap(), 0, "nothing has come, and the call does not wait");
            assert_eq!(pty.write(b"answer").unwrap(), 6);
            assert_eq!(receive(&port, 6).await.unwrap(), b"answer");
            drop(pty);
            assert!(receive(&port, 1).await.is_err());
        });
        assert!(port.write(b"more").is_err());
    }
}
