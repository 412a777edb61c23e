//! A stable name for the port: a symbolic link that exists while the program runs.
//!
//! A program that was killed leaves its link. The next program may replace this link, but never the link of a running
//! program, nor a link to anything but a pseudo-terminal. The kernel reuses the numbers of pseudo-terminals. So a link whose
//! target exists may still be a link of a killed program. Two facts distinguish the link of a running program. The program
//! holds a lock, which the kernel frees when the process ends. And its pseudo-terminal is older than its link.

use std::fs::{self, Metadata};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::{SocketAddr, UnixListener};
use std::path::{Path, PathBuf};

/// Where the system keeps its pseudo-terminals. A link to one that is gone was left by a program that was killed.
const TERMINALS: &str = "/dev/pts";

/// Why the link was not created. Each message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum SymlinkError {
    /// The path exists and is not a symbolic link.
    #[error("{}: that is no symbolic link, so it is not replaced: remove it, or choose another path", .0.display())]
    Taken(PathBuf),
    /// The path is a symbolic link of a running program, or a link to something that exists: perhaps to the port of another
    /// program.
    #[error(
        "{}: that link leads to {}, which exists, so it is not replaced: end the program that serves this port, remove \
         the link, or choose another path",
        path.display(), target.display()
    )]
    InUse {
        /// Where the link should be.
        path: PathBuf,
        /// Where the link that is already there leads.
        target: PathBuf,
    },
    /// The path is a symbolic link to something that does not exist and is not a pseudo-terminal. So [`Symlink`] did not
    /// create it.
    #[error(
        "{}: this link leads to {}, not to a pseudo-terminal, so it is not replaced: remove it, or choose another path",
        path.display(), target.display()
    )]
    Foreign {
        /// Where the link should be.
        path: PathBuf,
        /// Where the link that is already there leads.
        target: PathBuf,
    },
    /// The operating system did not read, remove or create a link.
    #[error("{}: {cause}: choose a path in a directory that exists and that you can write to", path.display())]
    Refused {
        /// Where the link should be.
        path: PathBuf,
        /// The system's reason.
        cause: io::Error,
    },
}

/// A symbolic link. Dropping it removes the link, unless another program has replaced it.
#[derive(Debug)]
pub struct Symlink {
    path: PathBuf,
    port: PathBuf,
    _lock: LinkLock,
}

/// The lock of a path: an abstract socket, which has no file, and which the kernel closes when the process ends.
#[derive(Debug)]
struct LinkLock {
    /// Another program, or another [`Symlink`] of this program, holds the lock.
    is_taken: bool,
    /// `None` if the lock is taken or cannot be created.
    _socket: Option<UnixListener>,
}

impl LinkLock {
    fn new(path: &Path) -> Self {
        let bound = lock_address(path).and_then(|address| UnixListener::bind_addr(&address));
        let is_taken = bound.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::AddrInUse);
        Self { is_taken, _socket: bound.ok() }
    }
}

/// The name of the lock: device and inode of the directory, and a hash of the link's name in it.
fn lock_address(path: &Path) -> io::Result<SocketAddr> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let directory = fs::metadata(parent)?;
    let mut hasher = DefaultHasher::new();
    path.file_name().hash(&mut hasher);
    let name = format!("7bot-link-{:x}-{:x}-{:x}", directory.dev(), directory.ino(), hasher.finish());
    SocketAddr::from_abstract_name(name)
}

impl Symlink {
    /// Creates a link at `path` to `port`, which this program has open. Replaces only a link that a killed program has
    /// left: a link to a pseudo-terminal that is gone, whose number was reused since, or whose number `port` now has.
    ///
    /// # Errors
    /// See [`SymlinkError`].
    pub fn new(path: &Path, port: &Path) -> Result<Self, SymlinkError> {
        let refused = |cause| SymlinkError::Refused { path: path.to_owned(), cause };
        let lock = LinkLock::new(path);
        match fs::symlink_metadata(path) {
            Ok(metadata) if !metadata.is_symlink() => return Err(SymlinkError::Taken(path.to_owned())),
            Ok(metadata) => take_away(path, port, &metadata, &lock)?,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(refused(error)),
        }
        // Fails if another program has created something there in the meantime.
        std::os::unix::fs::symlink(port, path).map_err(refused)?;
        Ok(Self { path: path.to_owned(), port: port.to_owned(), _lock: lock })
    }
}

/// Removes a link that a killed program has left.
fn take_away(path: &Path, port: &Path, link: &Metadata, lock: &LinkLock) -> Result<(), SymlinkError> {
    let refused = |cause| SymlinkError::Refused { path: path.to_owned(), cause };
    let target = fs::read_link(path).map_err(refused)?;
    if lock.is_taken {
        return Err(SymlinkError::InUse { path: path.to_owned(), target });
    }
    if target != port {
        check_left_behind(path, &target, link)?;
    }
    // Another program that starts now may replace the link at the same time, so check the link that was moved away.
    let mut aside = path.as_os_str().to_owned();
    aside.push(format!(".{}.old", std::process::id()));
    let aside = PathBuf::from(aside);
    fs::rename(path, &aside).map_err(refused)?;
    if fs::read_link(&aside).is_ok_and(|moved| moved == target) {
        return fs::remove_file(&aside).map_err(refused);
    }
    let _ = fs::rename(&aside, path);
    Err(SymlinkError::InUse { path: path.to_owned(), target })
}

/// Fails unless the link leads to a pseudo-terminal that is gone, or that is younger than the link.
fn check_left_behind(path: &Path, target: &Path, link: &Metadata) -> Result<(), SymlinkError> {
    let (path, target) = (path.to_owned(), target.to_owned());
    let is_terminal = target.starts_with(TERMINALS);
    match fs::metadata(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound && is_terminal => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Err(SymlinkError::Foreign { path, target }),
        Ok(terminal) if is_terminal && changed(&terminal) > changed(link) => Ok(()),
        // A target that cannot be examined counts as one that exists.
        _ => Err(SymlinkError::InUse { path, target }),
    }
}

/// The time of the last change of a file's inode (ctime), such as its creation or a change of its mode.
fn changed(metadata: &Metadata) -> (i64, i64) {
    (metadata.ctime(), metadata.ctime_nsec())
}

impl Drop for Symlink {
    fn drop(&mut self) {
        if fs::read_link(&self.path).is_ok_and(|target| target == self.port) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pty::Pty;

    #[test]
    fn a_link_exists_as_long_as_its_owner_and_replaces_a_stale_one() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("7bot");
        std::os::unix::fs::symlink("/dev/pts/none", &path).unwrap();
        let link = Symlink::new(&path, Path::new("/dev/pts/5")).unwrap();
        assert_eq!(fs::read_link(&path).unwrap(), Path::new("/dev/pts/5"));
        drop(link);
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);
    }

    /// A link at a path in a new directory.
    fn link_to(target: &Path) -> (tempfile::TempDir, PathBuf) {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("7bot");
        std::os::unix::fs::symlink(target, &path).unwrap();
        (directory, path)
    }

    #[test]
    fn a_link_to_a_port_that_exists_is_not_replaced() {
        let port = Pty::open(None).unwrap();
        let (directory, path) = link_to(port.path());
        let error = Symlink::new(&path, Path::new("/dev/pts/ours")).unwrap_err();
        assert!(matches!(&error, SymlinkError::InUse { target, .. } if target == port.path()), "{error}");
        assert_eq!(fs::read_link(&path).unwrap(), port.path());
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_link_of_a_program_that_runs_is_not_replaced_even_if_its_port_is_gone() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("7bot");
        let first = Symlink::new(&path, Path::new("/dev/pts/first")).unwrap();
        let second = Symlink::new(&path, Path::new("/dev/pts/second"));
        assert!(matches!(second, Err(SymlinkError::InUse { .. })), "{second:?}");
        assert_eq!(fs::read_link(&path).unwrap(), Path::new("/dev/pts/first"));
        drop(first);
        Symlink::new(&path, Path::new("/dev/pts/second")).unwrap();
    }

    #[test]
    fn a_left_link_whose_number_was_used_again_is_replaced() {
        let port = Pty::open(None).unwrap();
        let name = port.path().to_owned();
        let (_directory, path) = link_to(&name);
        drop(port);
        // Another test may get the number, and then this one shows nothing.
        std::thread::sleep(std::time::Duration::from_millis(20));
        let next = Pty::open(None).unwrap();
        if next.path() == name {
            Symlink::new(&path, Path::new("/dev/pts/ours")).unwrap();
        }
    }

    #[test]
    fn a_left_link_may_lead_to_the_new_port() {
        let port = Pty::open(None).unwrap();
        let (directory, path) = link_to(port.path());
        let link = Symlink::new(&path, port.path()).unwrap();
        assert_eq!(fs::read_link(&path).unwrap(), port.path());
        drop(link);
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_link_of_the_user_is_not_replaced() {
        for target in ["/dev/ttyUSB-unplugged", "notes.txt"] {
            let (directory, path) = link_to(Path::new(target));
            let error = Symlink::new(&path, Path::new("/dev/pts/ours")).unwrap_err();
            assert!(matches!(error, SymlinkError::Foreign { .. }), "{error}");
            fs::write(directory.path().join("notes.txt"), "years").unwrap();
            assert_eq!(fs::read_link(&path).unwrap(), Path::new(target));
        }
    }

    #[test]
    fn a_link_that_was_replaced_stays_at_the_end() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("7bot");
        let first = Symlink::new(&path, Path::new("/dev/pts/gone")).unwrap();
        fs::remove_file(&path).unwrap();
        std::os::unix::fs::symlink("/dev/pts/other", &path).unwrap();
        drop(first);
        assert_eq!(fs::read_link(&path).unwrap(), Path::new("/dev/pts/other"));
    }

    #[test]
    fn files_and_directories_are_not_replaced() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("thesis.tex");
        fs::write(&path, "years").unwrap();
        assert!(matches!(Symlink::new(&path, Path::new("/dev/pts/5")), Err(SymlinkError::Taken(_))));
        assert_eq!(fs::read(&path).unwrap(), b"years");
        let inside = directory.path().join("none/7bot");
        assert!(matches!(Symlink::new(&inside, Path::new("/dev/pts/5")), Err(SymlinkError::Refused { .. })));
    }
}
