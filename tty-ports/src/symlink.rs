//! A stable name for the port: a symbolic link that exists while the program runs.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Why the link was not created. Each message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum SymlinkError {
    /// The path exists and is not a symbolic link.
    #[error("{}: that is no symbolic link, so it is not replaced: remove it, or choose another path", .0.display())]
    Taken(PathBuf),
    /// The operating system refused.
    #[error("{}: {cause}: choose a path in a directory that exists and that you can write to", path.display())]
    Refused {
        /// The path.
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
}

impl Symlink {
    /// Creates a link at `path` to `port`. Replaces a symbolic link that an earlier program may have left.
    ///
    /// # Errors
    /// See [`SymlinkError`].
    pub fn new(path: &Path, port: &Path) -> Result<Self, SymlinkError> {
        let refused = |cause| SymlinkError::Refused { path: path.to_owned(), cause };
        match fs::symlink_metadata(path) {
            Ok(metadata) if !metadata.is_symlink() => return Err(SymlinkError::Taken(path.to_owned())),
            Ok(_) => replace(path, port).map_err(refused)?,
            Err(_) => std::os::unix::fs::symlink(port, path).map_err(refused)?,
        }
        Ok(Self { path: path.to_owned(), port: port.to_owned() })
    }
}

/// Replaces a link atomically.
fn replace(path: &Path, port: &Path) -> io::Result<()> {
    let mut draft = path.as_os_str().to_owned();
    draft.push(format!(".{}.new", std::process::id()));
    std::os::unix::fs::symlink(port, &draft)?;
    fs::rename(&draft, path).inspect_err(|_| {
        let _ = fs::remove_file(&draft);
    })
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

    #[test]
    fn a_link_that_another_program_took_over_stays() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("7bot");
        let first = Symlink::new(&path, Path::new("/dev/pts/5")).unwrap();
        let _second = Symlink::new(&path, Path::new("/dev/pts/6")).unwrap();
        drop(first);
        assert_eq!(fs::read_link(&path).unwrap(), Path::new("/dev/pts/6"));
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
