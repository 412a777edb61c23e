//! Is anybody at the other end of the port? Counts who opens and closes the terminal, through inotify.
//!
//! The simulator keeps the port open itself, so the kernel never says by itself that the last client has
//! gone. inotify reports each open and each close, but it merges equal reports that follow each other
//! unread: two opens in a row would count as one. Watching the directory besides the terminal puts a
//! report from the directory between any two from the terminal, and nothing is merged.

use std::io;
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::Path;

use rustix::fs::inotify::{self, CreateFlags, ReadFlags, Reader, WatchFlags};
use rustix::io::Errno;

/// Room for a few dozen reports at a time.
const BUFFER_LENGTH: usize = 2_048;

/// Who has the port open besides the simulator.
#[derive(Debug)]
pub struct Clients {
    inotify: OwnedFd,
    /// The watch on the terminal itself.
    terminal: i32,
    count: usize,
}

/// What a look at the reports brought to light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Traffic {
    /// Somebody opened the port.
    pub came: bool,
    /// At some moment since the last look, the last client had gone.
    pub emptied: bool,
}

impl Clients {
    /// Counts from now on. Nobody but the simulator may have the terminal open yet.
    ///
    /// # Errors
    /// inotify is not to be had, for example because this user's limit of instances is reached.
    pub fn watch(terminal: &Path) -> io::Result<Self> {
        let inotify = inotify::init(CreateFlags::NONBLOCK | CreateFlags::CLOEXEC)?;
        let events = WatchFlags::OPEN | WatchFlags::CLOSE_WRITE | WatchFlags::CLOSE_NOWRITE;
        if let Some(directory) = terminal.parent() {
            inotify::add_watch(&inotify, directory, events)?;
        }
        let terminal = inotify::add_watch(&inotify, terminal, events)?;
        Ok(Self { inotify, terminal, count: 0 })
    }

    /// How many clients have the port open.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.count
    }

    /// Takes note of everybody who came and went since the last call.
    ///
    /// # Errors
    /// inotify fails.
    pub fn look(&mut self) -> io::Result<Traffic> {
        let mut traffic = Traffic { came: false, emptied: false };
        let mut buffer = [MaybeUninit::uninit(); BUFFER_LENGTH];
        let mut reader = Reader::new(&self.inotify, &mut buffer);
        loop {
            let event = match reader.next() {
                Ok(event) if event.wd() == self.terminal => event.events(),
                Ok(_) | Err(Errno::INTR) => continue,
                Err(Errno::AGAIN) => return Ok(traffic),
                Err(error) => return Err(error.into()),
            };
            if event.contains(ReadFlags::OPEN) {
                self.count += 1;
                traffic.came = true;
            } else if event.intersects(ReadFlags::CLOSE_WRITE | ReadFlags::CLOSE_NOWRITE) {
                self.count = self.count.saturating_sub(1);
                traffic.emptied |= self.count == 0;
            }
        }
    }
}

impl AsFd for Clients {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.inotify.as_fd()
    }
}
