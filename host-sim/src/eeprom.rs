//! The settings image on disk: its path, its lock, and the check that it is an image.

use std::fs::{self, DirBuilder, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use arm_sim::flash::{ERASED, Flash, SIZE};
use protocol_core::journal::{Journal, Opened};
use rustix::fs::{CWD, RenameFlags, renameat_with};
use rustix::io::Errno;

use crate::image_file::ImageFile;
use crate::per_arm;

/// Where the settings are stored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Eeprom {
    /// In memory: lost at the end.
    Memory,
    /// In this file of the user's state directory.
    UsersOwn(&'static str),
    /// In the file of `--eeprom FILE`.
    File(PathBuf),
}

impl Eeprom {
    /// The default of a simulated arm.
    pub const SIMULATED: Self = Self::UsersOwn("eeprom.bin");
    /// The default of an arm of real servos. It has a file of its own, because its offsets are not valid for the simulated arm.
    pub const REAL_SERVOS: Self = Self::UsersOwn("servos.bin");
    /// The default of an arm with the maker's controller. It has a file of its own, because its values have other encodings.
    pub const STOCK: Self = Self::UsersOwn("stock.bin");
}

impl From<&str> for Eeprom {
    fn from(argument: &str) -> Self {
        if argument == "none" { Self::Memory } else { Self::File(argument.into()) }
    }
}

/// Why the image cannot be used. Each message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// Neither `XDG_STATE_HOME` nor `HOME` is set.
    #[error(
        "no state directory, as neither XDG_STATE_HOME nor HOME is set: name a file with --eeprom FILE, or use --eeprom none"
    )]
    NoStateDirectory,
    /// Another process holds the lock.
    #[error("settings image {} is in use by another simulator: end that one, or use --eeprom FILE with a file of its own, or --eeprom none", .0.display())]
    Locked(PathBuf),
    /// The path is not a file of 32 KiB.
    #[error("{} is no settings image ({found}, not a file of {SIZE} bytes): delete it, or name another with --eeprom FILE", path.display())]
    NotAnImage {
        /// The path that was opened.
        path: PathBuf,
        /// The length of the file, or that it is no regular file.
        found: String,
    },
    /// The file has the right size, but is not blank and has no valid record.
    #[error("settings image {} is damaged: delete it to start with default settings, or name another with --eeprom FILE", .0.display())]
    Damaged(PathBuf),
    /// The operating system refused.
    #[error("cannot {verb} settings image {}: {cause}: choose another with --eeprom FILE, or use --eeprom none", path.display())]
    Refused {
        /// What the program could not do: `open`, `lock` and others, as in the message.
        verb: &'static str,
        /// The path of the image.
        path: PathBuf,
        /// The system's reason.
        cause: io::Error,
    },
}

impl Eeprom {
    /// The path of the image; `None` for memory. With several arms, each number has its own file.
    ///
    /// # Errors
    /// [`ImageError::NoStateDirectory`].
    pub fn path(&self, arm: Option<u16>) -> Result<Option<PathBuf>, ImageError> {
        let path = match self {
            Self::Memory => return Ok(None),
            Self::File(path) => path.clone(),
            Self::UsersOwn(file) => users_own(|name| std::env::var_os(name).map(PathBuf::from))?.join(file),
        };
        Ok(Some(per_arm::path(&path, arm)))
    }

    /// Opens the image as a flash, and creates a blank image if there is none. The image is locked against other simulators
    /// while it is open.
    ///
    /// # Errors
    /// See [`ImageError`].
    pub fn open(&self, arm: Option<u16>) -> Result<Flash<ImageFile>, ImageError> {
        let Some(path) = self.path(arm)? else { return Ok(Flash::on(ImageFile::in_memory())) };
        let refused = |verb, cause| ImageError::Refused { verb, path: path.clone(), cause };
        if matches!(self, Self::UsersOwn(_))
            && let Some(directory) = path.parent()
        {
            let made = DirBuilder::new().recursive(true).mode(0o700).create(directory);
            made.map_err(|cause| refused("make the directory of", cause))?;
        }
        let file = match open_existing(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                make_blank(&path).map_err(|cause| refused("make", cause))?;
                open_existing(&path)
            }
            other => other,
        };
        let file = file.map_err(|cause| refused("open", cause))?;
        file.try_lock().map_err(|reason| match reason {
            TryLockError::WouldBlock => ImageError::Locked(path.clone()),
            TryLockError::Error(cause) => refused("lock", cause),
        })?;
        check_size(&file, &path)?;
        let image = ImageFile::open(file).map_err(|cause| refused("read", cause))?;
        // Opening a damaged journal erases the flash, so open a copy to check it.
        match Journal::open(Flash::on(image.copy())) {
            (_, Opened::Damaged) => Err(ImageError::Damaged(path)),
            _ => Ok(Flash::on(image)),
        }
    }
}

fn open_existing(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).write(true).open(path)
}

/// The user's state directory. By the XDG base directory specification, a relative path counts as unset.
fn users_own(variable: impl Fn(&str) -> Option<PathBuf>) -> Result<PathBuf, ImageError> {
    let absolute = |name| variable(name).filter(|path| path.is_absolute());
    let state = absolute("XDG_STATE_HOME").or_else(|| Some(absolute("HOME")?.join(".local/state")));
    Ok(state.ok_or(ImageError::NoStateDirectory)?.join("7bot"))
}

/// Creates a blank image atomically. If another simulator has created an image in the meantime, its image stays, except on a
/// file system without `RENAME_NOREPLACE`.
fn make_blank(path: &Path) -> io::Result<()> {
    let mut draft = path.as_os_str().to_owned();
    draft.push(format!(".{}.new", std::process::id()));
    // Remove a draft that an earlier process left. A symbolic link that another user planted is removed, not followed.
    let _ = fs::remove_file(&draft);
    let made = write_blank(Path::new(&draft)).and_then(|()| publish(Path::new(&draft), path));
    if made.is_err() {
        let _ = fs::remove_file(&draft);
    }
    made
}

fn write_blank(path: &Path) -> io::Result<()> {
    let mut file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(path)?;
    file.write_all(&[ERASED; SIZE])?;
    file.sync_all()
}

fn publish(draft: &Path, path: &Path) -> io::Result<()> {
    match renameat_with(CWD, draft, CWD, path, RenameFlags::NOREPLACE) {
        Err(Errno::EXIST) => fs::remove_file(draft),
        // Some network file systems do not support the flag.
        Err(Errno::INVAL | Errno::NOSYS) => fs::rename(draft, path),
        other => Ok(other?),
    }
}

fn check_size(file: &File, path: &Path) -> Result<(), ImageError> {
    let metadata = file.metadata().map_err(|cause| ImageError::Refused {
        verb: "look at",
        path: path.to_owned(),
        cause,
    })?;
    let found = match (metadata.is_file(), metadata.len()) {
        (true, length) if length == SIZE as u64 => return Ok(()),
        (true, length) => format!("{length} bytes long"),
        (false, _) => "no regular file".to_owned(),
    };
    Err(ImageError::NotAnImage { path: path.to_owned(), found })
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn the_path_follows_the_xdg_specification() {
        let none = |_: &str| None;
        assert!(matches!(users_own(none), Err(ImageError::NoStateDirectory)));
        let home = |name: &str| (name == "HOME").then(|| "/home/ada".into());
        assert_eq!(users_own(home).unwrap(), Path::new("/home/ada/.local/state/7bot"));
        let both = |name: &str| Some(if name == "HOME" { "/home/ada" } else { "/state" }.into());
        assert_eq!(users_own(both).unwrap(), Path::new("/state/7bot"));
        let relative = |name: &str| Some(if name == "HOME" { "/home/ada" } else { "state" }.into());
        assert_eq!(users_own(relative).unwrap(), Path::new("/home/ada/.local/state/7bot"));
    }

    #[test]
    fn a_planted_link_is_not_followed() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("arm.bin");
        let victim = directory.path().join("victim");
        fs::write(&victim, "letters").unwrap();
        let draft = directory.path().join(format!("arm.bin.{}.new", std::process::id()));
        std::os::unix::fs::symlink(&victim, &draft).unwrap();
        Eeprom::File(path.clone()).open(None).unwrap();
        assert_eq!(fs::read(&victim).unwrap(), b"letters");
        assert!(fs::symlink_metadata(&path).unwrap().is_file() && !draft.exists());
        // A link that is planted just before the file is created is not followed either.
        std::os::unix::fs::symlink(&victim, &draft).unwrap();
        assert!(write_blank(&draft).is_err());
        assert_eq!(fs::read(&victim).unwrap(), b"letters");
    }

    #[test]
    fn a_new_image_is_blank_private_and_locked_and_leaves_no_draft() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("arm.bin");
        let eeprom = Eeprom::File(path.clone());
        let flash = eeprom.open(None).unwrap();
        assert_eq!(fs::read(&path).unwrap(), [ERASED; SIZE]);
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
        assert!(matches!(eeprom.open(None), Err(ImageError::Locked(_))));
        drop(flash);
        eeprom.open(None).unwrap();
    }

    #[test]
    fn an_image_of_another_simulator_is_not_replaced() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("arm.bin");
        fs::write(&path, [7; SIZE]).unwrap();
        make_blank(&path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), [7; SIZE]);
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }

    #[test]
    fn other_files_are_refused_and_not_changed() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("notes.txt");
        fs::write(&path, "shopping list").unwrap();
        let error = Eeprom::File(path.clone()).open(None).unwrap_err();
        assert!(error.to_string().contains("13 bytes long"), "{error}");
        assert_eq!(fs::read(&path).unwrap(), b"shopping list");
        let error = Eeprom::File("/dev/null".into()).open(None).unwrap_err();
        assert!(error.to_string().contains("no regular file"), "{error}");
        let error = Eeprom::File(directory.path().into()).open(None).unwrap_err();
        assert!(matches!(error, ImageError::Refused { verb: "open", .. }), "{error}");
        let error = Eeprom::File(directory.path().join("none/arm.bin")).open(None).unwrap_err();
        assert!(matches!(error, ImageError::Refused { verb: "make", .. }), "{error}");
    }

    #[test]
    fn none_means_memory() {
        assert_eq!(Eeprom::from("none"), Eeprom::Memory);
        assert_eq!(Eeprom::from("./none"), Eeprom::File("./none".into()));
        assert_eq!(Eeprom::Memory.path(None).unwrap(), None);
    }
}
