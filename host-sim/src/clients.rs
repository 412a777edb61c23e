//! Is anybody at the other end of a port? Counts who opens and closes terminals, through inotify.
//!
//! The simulator keeps its ports open itself, so the kernel never says by itself that the last client has
//! gone. inotify reports each open and each close, but it merges equal reports that follow each other
//! unread: two opens in a row would count as one. Watching the directory besides the terminals puts a
//! report from the directory between any two from a terminal, and nothing is merged.
//!
//! One instance for all ports: a user has 128 of them, by default.

use std::collections::HashMap;
use std::io;
use std::mem::{MaybeUninit, take};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::Path;

use rustix::fs::inotify::{self, CreateFlags, ReadFlags, Reader, WatchFlags};
use rustix::io::Errno;

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
#[derive(Debug, Default)]
struct Presence {
    count: usize,
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
        self.ports.insert(watch, Presence::default());
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
        let mut buffer = [MaybeUninit::uninit(); BUFFER_LENGTH];
        let mut reader = Reader::new(&self.inotify, &mut buffer);
        loop {
            match reader.next() {
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
    fn take_note(&mut self, event: ReadFlags) {
        if event.contains(ReadFlags::OPEN) {
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
