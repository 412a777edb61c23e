//! A pseudo-terminal that behaves like an arm of its own, for one program after the other.

use std::io;
use std::path::Path;
use std::sync::Arc;

use protocol_core::time::Instant;
use tty_ports::clients::Clients;
use tty_ports::pty::Pty;
use tty_ports::symlink::Symlink;

use super::frame_session::FrameSession;
use super::pace::ClientPace;
use super::readiness::Readiness;
use super::shared::SharedHub;
use super::start_error::StartError;

/// Bytes that are read at once: the size of the kernel's read buffer.
const PIECE: usize = 4_096;

#[derive(Debug)]
pub(super) struct PtyPort {
    pty: Pty,
    clients: Option<Clients>,
    _link: Symlink,
}

impl PtyPort {
    pub(super) fn open(link: &Path) -> Result<Self, StartError> {
        let mut clients = Clients::new().ok();
        let pty = Pty::open(clients.as_mut()).map_err(StartError::Pty)?;
        let link = Symlink::new(link, pty.path())?;
        Ok(Self { pty, clients, _link: link })
    }

    /// Serves programs. When the last program has closed the terminal, its writes are still carried out and its streams of
    /// reports end. The next program becomes a new client.
    pub(super) async fn serve(mut self, shared: Arc<SharedHub>) -> io::Result<()> {
        let master = Readiness::of(&self.pty.master())?;
        let opened = self.clients.as_ref().map(Readiness::of).transpose()?;
        let mut session = FrameSession::open(&shared);
        let mut last_empty = shared.now();
        let mut pace = ClientPace::new(shared.baud);
        // The session holds bytes of programs that have closed the terminal.
        let mut has_leftovers = false;
        loop {
            session.exchange();
            let count = self.receive(&mut session, &mut last_empty, &mut pace, &shared)?;
            let was_closed = self.was_closed()?;
            let is_open = self.pty.has_client();
            if was_closed || (has_leftovers && is_open) {
                session = session.succeed();
            }
            has_leftovers = !is_open && (has_leftovers || count > 0);
            if was_closed || count > 0 {
                // After a close without new bytes, the bytes in the session were read before the close: the previous program
                // sent them. While no program has the terminal open, all bytes come from previous programs.
                session.set_drops_reads(!is_open || (was_closed && count == 0));
            }
            session.exchange();
            self.send(&mut session)?;
            if count > 0 {
                tokio::task::yield_now().await;
                continue;
            }
            let waits_for_input = session.has_room() && pace.free_at() <= shared.now();
            tokio::select! {
                done = wait(&master, opened.as_ref(), &session, waits_for_input) => done?,
                () = shared.sleep_until(pace.free_at()), if session.has_room() && !waits_for_input => {}
            }
            if waits_for_input {
                last_empty = shared.earliest();
            }
        }
    }

    /// Reads bytes, unless earlier ones wait. While no program has the terminal open, reads at once, so that the kernel
    /// keeps no bytes for the next program.
    fn receive(
        &self,
        session: &mut FrameSession,
        last_empty: &mut Instant,
        pace: &mut ClientPace,
        shared: &SharedHub,
    ) -> io::Result<usize> {
        let is_free = session.has_room() && pace.free_at() <= shared.now();
        if !is_free && self.pty.has_client() {
            return Ok(0);
        }
        let mut bytes = [0; PIECE];
        let count = self.pty.read(&mut bytes)?;
        if count == 0 {
            *last_empty = shared.now();
        }
        pace.note(shared.now(), count);
        session.put(*last_empty, bytes.get(..count).unwrap_or_default());
        Ok(count)
    }

    /// Has the last program closed the terminal? Called after each read: the program that sent bytes has to be counted before
    /// its reply is written.
    fn was_closed(&mut self) -> io::Result<bool> {
        let Some(clients) = &mut self.clients else { return Ok(false) };
        clients.update()?;
        self.pty.update_clients(clients)
    }

    /// Writes replies and reports; without a program they are dropped.
    fn send(&self, session: &mut FrameSession) -> io::Result<()> {
        let count = match session.output() {
            [] => 0,
            bytes if self.pty.has_client() => self.pty.write(bytes)?,
            bytes => bytes.len(),
        };
        session.consume(count);
        Ok(())
    }
}

/// Waits until there is something to do.
async fn wait(
    master: &Readiness,
    opened: Option<&Readiness>,
    session: &FrameSession,
    waits_for_input: bool,
) -> io::Result<()> {
    let was_opened = async {
        match opened {
            Some(opened) => opened.readable().await,
            None => std::future::pending().await,
        }
    };
    tokio::select! {
        ready = master.readable(), if waits_for_input => ready?,
        ready = master.writable(), if !session.output().is_empty() => ready?,
        done = was_opened => done?,
        () = session.news() => {}
    }
    Ok(())
}
