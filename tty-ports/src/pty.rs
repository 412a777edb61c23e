//! The port: a pseudo-terminal that other programs of this user open like a serial port.
//!
//! ```text
//!   program ◀──▶ master ═══ kernel ═══ terminal (/dev/pts/N) ◀──▶ client, then the next client
//! ```
//!
//! The program also keeps the terminal open. So the port and its raw mode persist while there is no client. When the last
//! client has closed the port, the program resets what this client left: an exclusive lock, another terminal mode, unread
//! answers. This module knows no frames and no time.

use std::ffi::OsStr;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags, fchmod, fcntl_setfl, open};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{
    Action, OptionalActions, QueueSelector, Termios, ioctl_tiocnxcl, tcflow, tcflush, tcgetattr, tcsetattr,
};
use tracing::{info, warn};

use crate::clients::{ClientWatch, Clients};

/// A pseudo-terminal, both ends open.
#[derive(Debug)]
pub struct Pty {
    master: OwnedFd,
    terminal: OwnedFd,
    path: PathBuf,
    /// `None` if clients are not counted: then one client is assumed at all times.
    watch: Option<ClientWatch>,
    client_count: usize,
}

impl Pty {
    /// Opens a pseudo-terminal in raw mode that only this user can open. `clients` counts its clients, if the system reports
    /// them.
    ///
    /// # Errors
    /// The system has no pseudo-terminal left, or refuses to open one.
    pub fn open(clients: Option<&mut Clients>) -> io::Result<Self> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        fcntl_setfl(&master, OFlags::RDWR | OFlags::NONBLOCK)?;
        let name = ptsname(&master, Vec::new())?;
        let terminal = open(&*name, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        fchmod(&terminal, Mode::RUSR | Mode::WUSR)?;
        make_raw(&terminal, &mut tcgetattr(&terminal)?)?;
        let path = PathBuf::from(OsStr::from_bytes(name.to_bytes()));
        let watch = clients.and_then(|clients| clients.watch(&path).inspect_err(Self::warn_of).ok());
        Ok(Self { master, terminal, path, watch, client_count: 0 })
    }

    /// A port on which every read and every write fails.
    ///
    /// # Errors
    /// See [`Pty::open`].
    #[cfg(feature = "test-support")]
    pub fn broken() -> io::Result<Self> {
        let mut port = Self::open(None)?;
        // The write end of a pipe whose read end is closed.
        port.master = io::pipe()?.1.into();
        Ok(port)
    }

    /// Logs a warning: the clients of a port cannot be counted, so its output piles up unread.
    pub fn warn_of(error: &io::Error) {
        warn!("cannot see clients come and go ({error}): output piles up unread");
    }

    /// The path that clients open.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file descriptor that becomes readable when a client writes.
    #[must_use]
    pub fn master(&self) -> BorrowedFd<'_> {
        self.master.as_fd()
    }

    /// Reads bytes that clients have written. 0 means that no bytes are waiting.
    ///
    /// # Errors
    /// The pseudo-terminal failed.
    pub fn read(&self, bytes: &mut [u8]) -> io::Result<usize> {
        none_if_blocked(rustix::io::read(&self.master, bytes))
    }

    /// Writes bytes to the clients. Returns how many were accepted.
    ///
    /// # Errors
    /// The pseudo-terminal failed.
    pub fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        none_if_blocked(rustix::io::write(&self.master, bytes))
    }

    /// The baud rate that the client chose, in bits per second.
    ///
    /// # Errors
    /// The pseudo-terminal failed.
    pub fn baud(&self) -> io::Result<u32> {
        Ok(tcgetattr(&self.terminal)?.output_speed())
    }

    /// Does a client have the port open?
    #[must_use]
    pub const fn has_client(&self) -> bool {
        self.watch.is_none() || self.client_count > 0
    }

    /// Did a client open the port, or the last client close it, since the last call of [`Pty::update_clients`]?
    #[must_use]
    pub fn has_news(&self, clients: &Clients) -> bool {
        self.watch.is_some_and(|watch| clients.has_news(watch))
    }

    /// Updates the number of clients. Returns whether the last client has closed the port; then the port is reset.
    ///
    /// # Errors
    /// The pseudo-terminal failed.
    pub fn update_clients(&mut self, clients: &mut Clients) -> io::Result<bool> {
        let Some(watch) = self.watch else { return Ok(false) };
        let news = clients.take_news(watch);
        let count = clients.count(watch);
        self.client_count = count;
        if news.was_emptied {
            self.reset(count == 0)?;
        }
        match (news.was_opened, news.was_emptied, count) {
            (true, _, 1..) => info!("port open ({count} client{})", if count == 1 { "" } else { "s" }),
            (_, true, 0) => info!("port closed"),
            _ => {}
        }
        Ok(news.was_emptied)
    }

    /// Drops unread answers and the exclusive lock of the last client; its unread *requests* stay. Resets the terminal mode
    /// only if no new client has the port open, because a new client may have set the mode.
    fn reset(&self, is_unused: bool) -> io::Result<()> {
        tcflush(&self.terminal, QueueSelector::IFlush)?;
        // Resume output that the last client has suspended (XOFF). Otherwise it stays suspended for the next client.
        tcflow(&self.terminal, Action::OOn)?;
        ioctl_tiocnxcl(&self.terminal)?;
        let mut mode = tcgetattr(&self.terminal)?;
        if is_unused {
            make_raw(&self.terminal, &mut mode)?;
        }
        Ok(())
    }
}

fn make_raw(terminal: &OwnedFd, mode: &mut Termios) -> io::Result<()> {
    mode.make_raw();
    Ok(tcsetattr(terminal, OptionalActions::Now, mode)?)
}

fn none_if_blocked(outcome: rustix::io::Result<usize>) -> io::Result<usize> {
    match outcome {
        Err(Errno::AGAIN | Errno::INTR) => Ok(0),
        other => Ok(other?),
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{File, OpenOptions};
    use std::io::{Read, Write};
    use std::os::unix::fs::PermissionsExt;

    use rustix::io::ioctl_fionread;
    use rustix::termios::{InputModes, LocalModes, ioctl_tiocexcl};

    use super::*;

    fn open() -> (Pty, Clients) {
        let mut clients = Clients::new().unwrap();
        (Pty::open(Some(&mut clients)).unwrap(), clients)
    }

    fn update((pty, clients): &mut (Pty, Clients)) -> bool {
        clients.update().unwrap();
        pty.update_clients(clients).unwrap()
    }

    fn client(pty: &Pty) -> File {
        OpenOptions::new().read(true).write(true).open(pty.path()).unwrap()
    }

    /// Reads `length` bytes, and waits up to 10 s for them: a kernel thread passes them to the master with a delay.
    fn read_exactly(pty: &Pty, length: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        for _ in 0..10_000 {
            let mut piece = [0; 256];
            let count = pty.read(&mut piece).unwrap();
            bytes.extend(&piece[..count]);
            if bytes.len() >= length {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        bytes
    }

    #[test]
    fn all_bytes_pass_unchanged_in_both_directions() {
        let (pty, _) = open();
        let mode = std::fs::metadata(pty.path()).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        let all: Vec<u8> = (0..=255).collect();
        let mut client = client(&pty);
        client.write_all(&all).unwrap();
        assert_eq!(read_exactly(&pty, 256), all);
        assert_eq!(pty.write(&all).unwrap(), 256);
        let mut back = [0; 256];
        client.read_exact(&mut back).unwrap();
        assert_eq!(back.as_slice(), all);
    }

    #[test]
    fn clients_are_counted_even_if_reports_are_read_late() {
        let mut port = open();
        assert!(!port.0.has_client());
        let (first, second) = (client(&port.0), client(&port.0));
        assert!(!update(&mut port));
        drop(first);
        assert!(!update(&mut port));
        assert!(port.0.has_client(), "one of two clients is left");
        drop(second);
        assert!(update(&mut port));
        assert!(!port.0.has_client());
    }

    #[test]
    fn each_port_has_its_own_clients() {
        let mut clients = Clients::new().unwrap();
        let mut ptys = [(); 3].map(|()| Pty::open(Some(&mut clients)).unwrap());
        let _client = client(&ptys[1]);
        clients.update().unwrap();
        ptys.iter_mut().for_each(|pty| assert!(!pty.update_clients(&mut clients).unwrap()));
        assert_eq!(ptys.each_ref().map(Pty::has_client), [false, true, false]);
    }

    #[test]
    fn requests_of_a_client_that_left_stay_and_its_unread_answers_do_not() {
        let mut port = open();
        let mut visitor = client(&port.0);
        visitor.write_all(b"request").unwrap();
        while port.0.write(&[b'x'; 4_096]).unwrap() > 0 {}
        drop(visitor);
        assert!(update(&mut port));
        let (pty, _) = port;
        assert_eq!(read_exactly(&pty, 7), b"request");
        let next = client(&pty);
        pty.write(b"!").unwrap();
        for _ in 0..10_000 {
            if ioctl_fionread(&next).unwrap() > 0 {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        assert_eq!(ioctl_fionread(&next).unwrap(), 1);
    }

    #[test]
    fn the_next_client_gets_a_free_port_in_raw_mode() {
        let mut port = open();
        let visitor = client(&port.0);
        ioctl_tiocexcl(&visitor).unwrap();
        assert!(is_exclusive(&port.0.terminal));
        let mut mode = tcgetattr(&visitor).unwrap();
        let raw = (mode.input_modes, mode.local_modes);
        // Each changes bytes; PARMRK doubles the byte 0xFF.
        mode.local_modes |= LocalModes::ECHO | LocalModes::ICANON;
        mode.input_modes |= InputModes::PARMRK;
        tcsetattr(&visitor, OptionalActions::Now, &mode).unwrap();
        drop(visitor);
        update(&mut port);
        let (pty, _) = port;
        let mode = tcgetattr(&pty.terminal).unwrap();
        assert_eq!((mode.input_modes, mode.local_modes), raw);
        // Root may open a locked terminal, so read the lock itself.
        assert!(!is_exclusive(&pty.terminal));
    }

    #[test]
    fn output_that_a_client_suspended_goes_on_for_the_next_one() {
        let mut port = open();
        let visitor = client(&port.0);
        tcflow(&visitor, Action::OOff).unwrap();
        drop(visitor);
        assert!(update(&mut port));
        let (pty, _) = port;
        let mut next = OpenOptions::new().read(true).write(true).open(pty.path()).unwrap();
        rustix::io::ioctl_fionbio(&next, true).unwrap();
        next.write_all(b"request").unwrap();
        assert_eq!(read_exactly(&pty, 7), b"request");
    }

    /// Does the terminal have an exclusive lock? rustix has no safe wrapper of TIOCGEXCL.
    #[allow(unsafe_code)]
    fn is_exclusive(terminal: &OwnedFd) -> bool {
        use rustix::ioctl::{Getter, ioctl, opcode};
        const TIOCGEXCL: rustix::ioctl::Opcode = opcode::read::<i32>(b'T', 0x40);
        // SAFETY: the kernel writes one int (ioctl_tty(2)), and the getter makes room for one.
        unsafe { ioctl(terminal, Getter::<TIOCGEXCL, i32>::new()) }.unwrap() != 0
    }
}
