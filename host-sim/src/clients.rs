//! Is anybody at the other end of a port? Counts who opens and closes terminals, through inotify.
//!
//! The simulator keeps its ports open itself, so the kernel never says by itself that the last client has
//! gone. inotify reports each open and each close, but it merges equal reports that follow each other
//! unread: two opens in a row would count as one. Watching the directory besides the terminals puts a
//! report from the directory between any two from a terminal, and nothing is merged.
//!
//! The queue of reports is bounded. When it has overflowed, the counts are wrong; then the open files of all
//! processes are looked at instead, until nobody has the port open and counting can begin anew.
//!
//! One instance for all ports: a user has 128 of them, by default.

use std::collections::HashMap;
use std::io;
use std::mem::{MaybeUninit, take};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};

use rustix::fs::inotify::{self, CreateFlags, ReadFlags, Reader, WatchFlags};
use rustix::io::Errno;
use tracing::warn;

use crate::holders::has_other_holder;

/// Room for a few dozen reports at a time.
const BUFFER_LENGTH: usize = 2_048;

/// Who has which port open besides the simulator.
#[derive(Debug)]
pub struct Clients {
    inotify: OwnedFd,
    ports: HashMap<i32, Presence>,
    /// There is news of a port since the last call of [`Clients::take_fresh`].
    is_fresh: bool,
}

/// A port whose clients are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Watch(i32);

/// Clients of one port.
#[derive(Debug)]
struct Presence {
    terminal: PathBuf,
    /// How many there are; where reports were lost, 1 for any number.
    count: usize,
    /// Reports were lost since nobody had it open.
    has_lost_count: bool,
    /// Something happened since the count was last found to be right.
    is_stale: bool,
    news: Traffic,
}

/// What happened at a port since it was last asked about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Somebody opened it.
    pub came: bool,
    /// At some moment the last client had gone.
    pub emptied: bool,
}

impl Clients {
    /// No ports yet.
    ///
    /// # Errors
    /// inotify is not to be had, for example because this user's limit of instances is reached.
    pub fn new() -> io::Result<Self> {
        let inotify = inotify::init(CreateFlags::NONBLOCK | CreateFlags::CLOEXEC)?;
        Ok(Self { inotify, ports: HashMap::new(), is_fresh: false })
    }

    /// Counts the clients of a terminal from now on. Nobody but the simulator may have it open yet.
    ///
    /// # Errors
    /// inotify refuses.
    pub fn watch(&mut self, terminal: &Path) -> io::Result<Watch> {
        let events = WatchFlags::OPEN | WatchFlags::CLOSE_WRITE | WatchFlags::CLOSE_NOWRITE;
        if let Some(directory) = terminal.parent() {
            inotify::add_watch(&self.inotify, directory, events)?;
        }
        let watch = inotify::add_watch(&self.inotify, terminal, events)?;
        let terminal = terminal.to_owned();
        let presence =
            Presence { terminal, count: 0, has_lost_count: false, is_stale: false, news: Traffic::default() };
        self.ports.insert(watch, presence);
        Ok(Watch(watch))
    }

    /// How many clients have a port open.
    #[must_use]
    pub fn count(&self, port: Watch) -> usize {
        self.ports.get(&port.0).map_or(0, |port| port.count)
    }

    /// What [`Clients::look`] has found out about a port since this was last asked.
    pub fn news(&mut self, port: Watch) -> Traffic {
        self.ports.get_mut(&port.0).map(|port| take(&mut port.news)).unwrap_or_default()
    }

    /// Is there any?
    #[must_use]
    pub fn has_news(&self, port: Watch) -> bool {
        self.ports.get(&port.0).is_some_and(|port| port.news != Traffic::default())
    }

    /// Has [`Clients::look`] found out about any port since this was last asked?
    pub fn take_fresh(&mut self) -> bool {
        take(&mut self.is_fresh)
    }

    /// Takes note of everybody who came and went since the last call.
    ///
    /// # Errors
    /// inotify fails.
    pub fn look(&mut self) -> io::Result<()> {
        self.read_reports()?;
        for port in self.ports.values_mut().filter(|port| port.is_stale) {
            port.recount();
            self.is_fresh = true;
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
                    self.ports.values_mut().for_each(Presence::lose_count);
                }
                Ok(event) => {
                    if let Some(port) = self.ports.get_mut(&event.wd()) {
                        port.take_note(event.events());
                        self.is_fresh = true;
                    }
                }
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => return Ok(()),
                Err(error) => return Err(error.into()),
            }
        }
    }
}

impl Presence {
    const fn lose_count(&mut self) {
        self.has_lost_count = true;
        self.is_stale = true;
    }

    /// Finds out whether anybody is there, where reports cannot tell.
    fn recount(&mut self) {
        let was_there = self.count > 0;
        let is_there = has_other_holder(&self.terminal);
        self.count = usize::from(is_there);
        self.news.came |= is_there && !was_there;
        self.news.emptied |= !is_there;
        self.has_lost_count = is_there;
        self.is_stale = false;
    }

    fn take_note(&mut self, event: ReadFlags) {
        if self.has_lost_count {
            self.is_stale = true;
        } else if event.contains(ReadFlags::OPEN) {
            self.count += 1;
            self.news.came = true;
        } else if event.intersects(ReadFlags::CLOSE_WRITE | ReadFlags::CLOSE_NOWRITE) {
            self.count = self.count.saturating_sub(1);
            self.news.emptied |= self.count == 0;
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

    /// How many reports the kernel keeps.
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
            clients.look().unwrap();
            pty.take_note_of(&mut clients).unwrap();
            assert!(pty.has_client());
            // Each opens and closes, and each report is followed by one of the directory: four reports.
            (0..limit() / 4 + 100).for_each(|_| drop(open(&pty)));
            let last = stays.then(|| open(&pty));
            drop(first);
            clients.look().unwrap();
            assert!(clients.take_fresh());
            pty.take_note_of(&mut clients).unwrap();
            assert_eq!(pty.has_client(), stays);
            drop(last);
            clients.look().unwrap();
            pty.take_note_of(&mut clients).unwrap();
            assert!(!pty.has_client());
            let _next = open(&pty);
            clients.look().unwrap();
            pty.take_note_of(&mut clients).unwrap();
            assert!(pty.has_client(), "counted as ever");
        }
    }
}
