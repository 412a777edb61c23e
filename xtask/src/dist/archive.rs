//! Archives with the same bytes for the same files: sorted names, one time, no owner.

use std::io::{Cursor, Write};

use flate2::{Compression, GzBuilder};
use tar::{EntryType, Header};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use crate::run::TaskResult;

/// A file that goes into an archive.
#[derive(Clone, Debug)]
pub(super) struct PackedFile {
    /// Its path below the root of the archive, with `/`.
    pub(super) path: String,
    pub(super) bytes: Vec<u8>,
    pub(super) is_program: bool,
}

impl PackedFile {
    pub(super) fn text(path: impl Into<String>, bytes: impl Into<Vec<u8>>) -> Self {
        Self { path: path.into(), bytes: bytes.into(), is_program: false }
    }

    pub(super) fn program(path: impl Into<String>, bytes: Vec<u8>) -> Self {
        Self { path: path.into(), bytes, is_program: true }
    }

    /// A copy of the file below a folder.
    pub(super) fn below(&self, folder: &str) -> Self {
        Self { path: format!("{folder}/{}", self.path), ..self.clone() }
    }

    /// Its permissions on Unix.
    pub(super) const fn mode(&self) -> u32 {
        if self.is_program { 0o755 } else { 0o644 }
    }
}

fn sorted(files: &[PackedFile]) -> Vec<&PackedFile> {
    let mut sorted: Vec<_> = files.iter().collect();
    sorted.sort_by(|one, other| one.path.cmp(&other.path));
    sorted
}

/// A `.tar.gz` whose files have the time `epoch`, in seconds since 1970.
pub(super) fn tar_gz(files: &[PackedFile], epoch: u64) -> TaskResult<Vec<u8>> {
    let mut archive = tar::Builder::new(Vec::new());
    for file in sorted(files) {
        let mut header = Header::new_gnu();
        header.set_entry_type(EntryType::Regular);
        header.set_size(u64::try_from(file.bytes.len())?);
        header.set_mode(file.mode());
        header.set_mtime(epoch);
        archive.append_data(&mut header, &file.path, file.bytes.as_slice())?;
    }
    gzip(&archive.into_inner()?, Compression::default())
}

/// The bytes compressed by gzip, without a name and a time.
pub(super) fn gzip(bytes: &[u8], level: Compression) -> TaskResult<Vec<u8>> {
    let mut encoder = GzBuilder::new().write(Vec::new(), level);
    encoder.write_all(bytes)?;
    Ok(encoder.finish()?)
}

/// A `.zip`. The format has no time zone and begins in 1980. All files have its first day as their time.
pub(super) fn zip(files: &[PackedFile]) -> TaskResult<Vec<u8>> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for file in sorted(files) {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .last_modified_time(DateTime::default())
            .unix_permissions(file.mode());
        archive.start_file(&file.path, options)?;
        archive.write_all(&file.bytes)?;
    }
    Ok(archive.finish()?.into_inner())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use std::io::Read;

    use flate2::read::GzDecoder;

    use super::*;

    fn files() -> Vec<PackedFile> {
        vec![PackedFile::text("b/note.txt", "note"), PackedFile::program("a/run", vec![1, 2, 3])]
    }

    #[test]
    fn the_order_of_the_files_changes_no_byte() {
        let mut turned = files();
        turned.reverse();
        assert_eq!(tar_gz(&files(), 7).unwrap(), tar_gz(&turned, 7).unwrap());
        assert_eq!(zip(&files()).unwrap(), zip(&turned).unwrap());
    }

    #[test]
    fn an_archive_holds_what_was_packed() {
        let mut archive = tar::Archive::new(GzDecoder::new(Cursor::new(tar_gz(&files(), 7).unwrap())));
        let mut found = Vec::new();
        for entry in archive.entries().unwrap() {
            let mut entry = entry.unwrap();
            let path = entry.path().unwrap().display().to_string();
            let (mode, time) = (entry.header().mode().unwrap(), entry.header().mtime().unwrap());
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes).unwrap();
            found.push((path, mode, time, bytes));
        }
        let wanted = [("a/run", 0o755, 7, vec![1, 2, 3]), ("b/note.txt", 0o644, 7, b"note".to_vec())];
        assert_eq!(found, wanted.map(|(path, mode, time, bytes)| (path.to_owned(), mode, time, bytes)));
    }
}
