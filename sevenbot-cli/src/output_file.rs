//! A file for a result: opened before the work, written at its end, or part by part after [`OutputFile::begin`].
//!
//! So a path that cannot be written is refused before anything moves, and an existing file keeps its content until the result is
//! there, or until [`OutputFile::begin`].

use std::fs::{self, File};
use std::io::{self, IsTerminal, Stdout, Write};
use std::path::{Path, PathBuf};

use sevenbot::whole_file;

use crate::command_error::CommandError;

/// May an existing file be replaced?
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub(crate) struct ForceArg {
    /// Replace an existing file.
    #[arg(long)]
    pub(crate) force: bool,
}

#[derive(Debug)]
pub(crate) struct OutputFile {
    path: PathBuf,
    /// `None` while it is replaced: some file systems of Windows replace no open file.
    file: Option<File>,
    /// It did not exist before, and is removed unless its result is written or [`OutputFile::begin`] was called.
    is_new: bool,
}

impl OutputFile {
    /// Opens the file. `source` is read by the same command, and is never replaced.
    pub(crate) fn open(path: &Path, source: Option<&Path>, force: ForceArg) -> Result<Self, CommandError> {
        if source.is_some_and(|source| is_same(path, source)) {
            return Err(CommandError::file(path, "this is the file that is read: choose another name"));
        }
        if path.is_file() && !force.force {
            return Err(CommandError::file(path, "the file exists; --force replaces it"));
        }
        let is_new = !path.exists();
        // A new file does not follow a link that another user planted.
        let opened = File::options().write(true).create_new(is_new).open(path);
        let file = opened.map_err(|error| CommandError::file(path, error))?;
        Ok(Self { path: path.to_owned(), file: Some(file), is_new })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the content. An existing file is replaced by the whole content, or not at all.
    pub(crate) fn write(mut self, content: &[u8]) -> Result<(), CommandError> {
        let special = self.file.take().filter(|file| file.metadata().is_ok_and(|there| !there.is_file()));
        let written = special
            .map_or_else(|| whole_file::write(&self.path, content), |mut special| special.write_all(content));
        self.is_new &= written.is_err();
        written.map_err(|error| CommandError::file(&self.path, error))
    }

    /// Empties the file, for a result that is written part by part.
    pub(crate) fn begin(mut self) -> Result<File, CommandError> {
        self.is_new = false;
        let emptied = self.file.take().ok_or_else(|| io::ErrorKind::NotFound.into()).and_then(emptied);
        emptied.map_err(|error| CommandError::file(&self.path, error))
    }
}

/// A pipe has no length.
fn emptied(file: File) -> io::Result<File> {
    if file.metadata()?.is_file() {
        file.set_len(0)?;
    }
    Ok(file)
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        if self.is_new {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Standard output for the content of a file, unchanged: the printer would remove escape sequences from it. `binary` names a
/// format that a terminal cannot show: then a terminal is an error.
pub(crate) fn stdout_for(binary: Option<&str>) -> Result<Stdout, CommandError> {
    let stdout = io::stdout();
    match binary.filter(|_| stdout.is_terminal()) {
        None => Ok(stdout),
        Some(name) => {
            let advice = "write it to a file, or redirect the output";
            Err(CommandError::Usage(format!("a terminal cannot show {name}: {advice}")))
        }
    }
}

/// Do both paths name one file, which need not exist?
pub(crate) fn is_same(one: &Path, other: &Path) -> bool {
    place(one).is_ok_and(|one| place(other).is_ok_and(|other| one == other))
}

/// The path of a file without links, or the path that it would have.
fn place(path: &Path) -> io::Result<PathBuf> {
    if let Ok(place) = fs::canonicalize(path) {
        return Ok(place);
    }
    let path = std::path::absolute(path)?;
    let folder = fs::canonicalize(path.parent().unwrap_or(&path))?;
    Ok(folder.join(path.file_name().unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORCE: ForceArg = ForceArg { force: true };

    #[test]
    fn a_file_is_replaced_only_on_request_and_only_by_a_result() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("drawing.svg");
        drop(OutputFile::open(&path, None, ForceArg::default()).expect("a new file"));
        assert!(!path.exists(), "nothing was written");
        OutputFile::open(&path, None, ForceArg::default())
            .and_then(|file| file.write(b"long"))
            .expect("a file");
        let refused = OutputFile::open(&path, None, ForceArg::default()).expect_err("it exists");
        assert!(refused.message().is_some_and(|said| said.contains("--force")), "{refused:?}");
        drop(OutputFile::open(&path, None, FORCE).expect("the file"));
        assert_eq!(fs::read(&path).expect("a file"), b"long");
        OutputFile::open(&path, None, FORCE).and_then(|file| file.write(b"new")).expect("a file");
        assert_eq!(fs::read(&path).expect("a file"), b"new");
        OutputFile::open(&path, None, FORCE).and_then(OutputFile::begin).expect("a file");
        assert_eq!(fs::read(&path).expect("a file"), b"");
    }

    #[cfg(unix)]
    #[test]
    fn a_planted_link_is_not_followed() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("arm.toml");
        std::os::unix::fs::symlink(folder.path().join("not there"), &path).expect("a link");
        OutputFile::open(&path, None, FORCE).expect_err("a link to nothing");
    }

    #[test]
    fn the_source_is_never_replaced() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("move.txt");
        fs::write(&path, "years").expect("a file");
        let other_name = folder.path().join(".").join("move.txt");
        assert!(OutputFile::open(&other_name, Some(&path), FORCE).is_err());
        assert_eq!(fs::read(&path).expect("a file"), b"years");
        let new = |name: &str| folder.path().join(name).join("new.txt");
        assert!(is_same(&new("."), &new("")) && !is_same(&new("."), &path), "files that are not there yet");
    }
}
