//! Files that are replaced as a whole: another program, and the next start after a power cut or on a full disk, find the old
//! content or the new one.

use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::process;
use std::sync::{Mutex, PoisonError};

/// Held during a write, because all threads of a process use the same name for the draft of a file.
static WRITING: Mutex<()> = Mutex::new(());

/// Writes a file, or replaces it and keeps its permissions. Writes directly to anything else at the path, such as a pipe, and to
/// a file whose folder takes no other file.
///
/// # Errors
/// The file cannot be written. The old one is still there, unless it is written directly.
pub fn write(path: &Path, content: &[u8]) -> io::Result<()> {
    let place = match fs::canonicalize(path) {
        // The file, not a link to it, is replaced.
        Ok(place) if place.is_file() => place,
        Err(_) if fs::symlink_metadata(path).is_err() => path.to_owned(),
        // No file, or a link to nothing.
        _ => return fs::write(path, content),
    };
    let _one_at_a_time = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
    // This open fails if the file is write-protected.
    let old = match File::options().write(true).open(&place).and_then(|old| old.metadata()) {
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        old => Some(old?),
    };
    match replace(&place, content, old.as_ref()) {
        Err(error) if old.is_some() && is_of_folder(&error) => fs::write(place, content),
        replaced => replaced,
    }
}

fn replace(place: &Path, content: &[u8], old: Option<&Metadata>) -> io::Result<()> {
    let draft = place.with_added_extension(format!("{}.new", process::id()));
    // Another user may have planted a link, which must not be followed.
    let _ = fs::remove_file(&draft);
    let file = File::create_new(&draft)?;
    fill(file, content, old)
        .and_then(|()| fs::rename(&draft, place))
        .inspect_err(|_| drop(fs::remove_file(&draft)))
}

fn fill(mut file: File, content: &[u8], old: Option<&Metadata>) -> io::Result<()> {
    old.map_or(Ok(()), |old| file.set_permissions(old.permissions()))?;
    file.write_all(content)?;
    file.sync_all()
}

/// Does the folder refuse a new file, or the system to give a file another place?
fn is_of_folder(error: &io::Error) -> bool {
    use ErrorKind::{PermissionDenied, ReadOnlyFilesystem, ResourceBusy};
    matches!(error.kind(), PermissionDenied | ReadOnlyFilesystem | ResourceBusy)
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    #[test]
    fn a_planted_link_is_not_followed_and_a_link_of_the_user_stays() {
        let folder = tempfile::tempdir().expect("a folder");
        let [file, link, victim] = ["pose", "link", "victim"].map(|name| folder.path().join(name));
        let draft = folder.path().join(format!("pose.{}.new", process::id()));
        fs::write(&victim, "letters").expect("a file");
        symlink(&victim, &draft).expect("a link");
        symlink(&file, &link).expect("a link");
        write(&link, b"90").expect("a file that is not there yet");
        write(&link, b"91").expect("a file");
        assert_eq!([&file, &victim].map(|path| fs::read(path).expect("a file")), [&b"91"[..], b"letters"]);
        assert!(fs::symlink_metadata(&link).expect("a link").is_symlink() && !draft.exists());
    }

    #[test]
    fn a_file_keeps_its_permissions_and_a_device_is_written_directly() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("pose");
        write(&file, b"90").expect("a file");
        fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).expect("the owner's");
        write(&file, b"91").expect("a file");
        assert_eq!(fs::metadata(&file).expect("a file").permissions().mode() & 0o777, 0o600);
        write(Path::new("/dev/null"), b"90").expect("a device");
        write(&folder.path().join("none").join("pose"), b"90").expect_err("no such folder");
    }
}
