//! Uses inotify to count the clients of each port. A client is a program that has the terminal of the port open; a program
//! that opens it twice counts as two.
//!
//! The program itself keeps its ports open, so the kernel does not report that the last client has closed a port. inotify
//! reports each open and each close. But it merges consecutive equal reports that have not been read yet: two opens in a row
//! would count as one. So the directory of the terminals is watched too. Each report of a terminal is then followed by a report
//! of the directory, and no reports of the terminal are merged.
//!
//! The queue of reports is bounded, and after an overflow the counts are wrong. Then the open files of all processes are
//! searched instead, until no client has the port open and counting starts again.
//!
//! All ports of a program share one inotify instance, because a user may have only 128 instances by default.

use std::collections::HashMap;
use std::io;
use std::mem::{MaybeUninit, take};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};

use rustix::fs::inotify::{self, CreateFlags, ReadFlags, Reader, WatchFlags};
use rustix::io::Errno;
use tracing::warn;

use crate::holders::has_other_holder;

/// Bytes for a few dozen reports.
const BUFFER_LENGTH: usize = 2_048;

/// Counts the clients of all ports, with one inotify instance.
#[derive(Debug)]
pub struct Clients {
    inotify: OwnedFd,
    ports: HashMap<i32, WatchedPort>,
    /// Clients opened or closed a port since the last call of [`Clients::take_has_changed`].
    has_changed: bool,
}

/// A port whose clients are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClientWatch(i32);

#[derive(Debug)]
struct WatchedPort {
    terminal: PathBuf,
    /// Number of clients. After an overflow, 1 stands for any number.
    count: usize,
    /// Reports were lost, and [`WatchedPort::recount`] has not found the port without a client since.
    has_lost_count: bool,
    /// The count may be wrong until [`WatchedPort::recount`].
    is_stale: bool,
    news: PortNews,
}

/// The events at a port since the last call of [`Clients::take_news`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PortNews {
    /// A client opened the port, or was found after reports were lost.
    pub was_opened: bool,
    /// The last client closed it, or none was found after reports were lost.
    pub was_emptied: bool,
}

impl Clients {
    /// Creates an inotify instance, without ports.
    ///
    /// # Errors
    /// The system refuses to create one, for example because this user's limit is reached.
    pub fn new() -> io::Result<Self> {
        let inotify = inotify::init(CreateFlags::NONBLOCK | CreateFlags::CLOEXEC)?;
        Ok(Self { inotify, ports: HashMap::new(), has_changed: false })
    }

    /// Counts the clients of a terminal from now on. The caller makes sure that no other program has it open yet.
    ///
    /// # Errors
    /// inotify refuses to watch the terminal or its directory.
    pub fn watch(&mut self, terminal: &Path) -> io::Result<ClientWatch> {
        let events = WatchFlags::OPEN | WatchFlags::CLOSE_WRITE | WatchFlags::CLOSE_NOWRITE;
        if let Some(directory) = terminal.parent() {
            inotify::add_watch(&self.inotify, directory, events)?;
        }
        let watch = inotify::add_watch(&self.inotify, terminal, events)?;
        let terminal = terminal.to_owned();
        let presence = WatchedPort {
            terminal,
            count: 0,
            has_lost_count: false,
            is_stale: false,
            news: PortNews::default(),
        };
        self.ports.insert(watch, presence);
        Ok(ClientWatch(watch))
    }

    /// Number of clients that have a port open. After lost reports, 1 stands for any number.
    #[must_use]
    pub fn count(&self, port: ClientWatch) -> usize {
        self.ports.get(&port.0).map_or(0, |port| port.count)
    }

    /// The events at a port since the last call of this function, up to the last [`Clients::update`].
    pub fn take_news(&mut self, port: ClientWatch) -> PortNews {
        self.ports.get_mut(&port.0).map(|port| take(&mut port.news)).unwrap_or_default()
    }

    /// True if [`Clients::take_news`] would return an event.
    #[must_use]
    pub fn has_news(&self, port: ClientWatch) -> bool {
        self.ports.get(&port.0).is_some_and(|port| port.news != PortNews::default())
    }

    /// Did clients open or close any port since the last call of this function, up to the last [`Clients::update`]?
    pub fn take_has_changed(&mut self) -> bool {
        take(&mut self.has_changed)
    }

    /// Updates the counts from the reports since the last call.
    ///
    /// # Errors
    /// inotify fails.
    pub fn update(&mut self) -> io::Result<()> {
        self.read_reports()?;
        for port in self.ports.values_mut().filter(|port| port.is_stale) {
            port.recount();
            self.has_changed = true;
        }
        Ok(())
    }

    fn read_reports(&mut self) -> io::Result<()> {
        let mut buffer = [MaybeUninit::uninit(); BUFFER_LENGTH];
        let mut reader = Reader::new(&self.inotify, &mut buffer);
        loop {
            match reader.next() {
                Ok(event) if event.events().contains(ReadFlags::QUEUE_OVERFLOW) => {
                    warn!("lost count of clients: looking at the open files of all processes instead");
                    self.ports.values_mut().for_each(WatchedPort::lose_count);
                }
                Ok(event) => {
                    if let Some(port) = self.ports.get_mut(&event.wd()) {
                        port.count_event(event.events());
                        self.has_changed = true;
                    }
                }
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => return Ok(()),
                Err(error) => return Err(error.into()),
            }
        }
    }
}

impl WatchedPort {
    const fn lose_count(&mut self) {
        self.has_lost_count = true;
        self.is_stale = true;
    }

    /// Checks whether there is a client, after reports were lost.
    fn recount(&mut self) {
        let had_client = self.count > 0;
        let has_client = has_other_holder(&self.terminal);
        self.count = usize::from(has_client);
        self.news.was_opened |= has_client && !had_client;
        self.news.was_emptied |= !has_client;
        self.has_lost_count = has_client;
        self.is_stale = false;
    }

    fn count_event(&mut self, event: ReadFlags) {
        if self.has_lost_count {
            self.is_stale = true;
        } else if event.contains(ReadFlags::OPEN) {
            self.count += 1;
            self.news.was_opened = true;
        } else if event.intersects(ReadFlags::CLOSE_WRITE | ReadFlags::CLOSE_NOWRITE) {
            self.count = self.count.saturating_sub(1);
            self.news.was_emptied |= self.count == 0;
        }
    }
}

impl AsFd for Clients {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.inotify.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use super::*;
    use crate::pty::Pty;

    /// The number of reports that the kernel keeps for one inotify instance.
    fn limit() -> usize {
        let limit = std::fs::read_to_string("/proc/sys/fs/inotify/max_queued_events").unwrap();
        limit.trim().parse().unwrap()
    }

    fn open(pty: &Pty) -> File {
        File::options().read(true).write(true).open(pty.path()).unwrap()
    }

    #[test]
    fn an_overflow_of_the_reports_does_not_lose_a_client() {
        for stays in [true, false] {
            let mut clients = Clients::new().unwrap();
            let mut pty = Pty::open(Some(&mut clients)).unwrap();
            let first = open(&pty);
            clients.update().unwrap();
            pty.update_clients(&mut clients).unwrap();
            assert!(pty.has_client());
            // Each iteration causes four reports: an open and a close, each followed by a report of the directory.
            (0..limit() / 4 + 100).for_each(|_| drop(open(&pty)));
            let last = stays.then(|| open(&pty));
            drop(first);
            clients.update().unwrap();
            assert!(clients.take_has_changed());
            pty.update_clients(&mut clients).unwrap();
            assert_eq!(pty.has_client(), stays);
            drop(last);
            clients.update().unwrap();
            pty.update_clients(&mut clients).unwrap();
            assert!(!pty.has_client());
            let _next = open(&pty);
            clients.update().unwrap();
            pty.update_clients(&mut clients).unwrap();
            assert!(pty.has_client(), "counted as ever");
        }
    }
}
