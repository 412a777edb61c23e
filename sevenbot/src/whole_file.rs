//! Files that are replaced as a whole: another program, and the next start after a power cut or on a full disk, find the old
//! content or the new one.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;
use std::process;

/// Writes a file, or replaces it. Writes to anything else at the path, such as a pipe, directly.
///
/// # Errors
/// The file cannot be written, or its folder takes no other file. The old file is still there.
pub fn write(path: &Path, content: &[u8]) -> io::Result<()> {
    if path.exists() && !path.is_file() {
        return fs::write(path, content);
    }
    // Replace the file, not a link to it.
    let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let draft = path.with_added_extension(format!("{}.new", process::id()));
    // An earlier run may have left a file, or another user a link, which must not be followed.
    let _ = fs::remove_file(&draft);
    let written = File::create_new(&draft).and_then(|mut file| {
        file.write_all(content)?;
        file.sync_all()
    });
    written.and_then(|()| fs::rename(&draft, path)).inspect_err(|_| drop(fs::remove_file(&draft)))
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn a_planted_link_is_not_followed_and_a_link_of_the_user_stays() {
        let folder = tempfile::tempdir().expect("a folder");
        let [file, link, victim] = ["pose", "link", "victim"].map(|name| folder.path().join(name));
        let draft = folder.path().join(format!("pose.{}.new", process::id()));
        fs::write(&victim, "letters").expect("a file");
        symlink(&victim, &draft).expect("a link");
        write(&file, b"90").expect("a file");
        symlink(&file, &link).expect("a link");
        write(&link, b"91").expect("a file");
        assert_eq!([&file, &victim].map(|path| fs::read(path).expect("a file")), [&b"91"[..], b"letters"]);
        assert!(fs::symlink_metadata(&link).expect("a link").is_symlink() && !draft.exists());
        write(Path::new("/dev/null"), b"90").expect("a device");
        write(&folder.path().join("none").join("pose"), b"90").expect_err("no such folder");
    }
}
