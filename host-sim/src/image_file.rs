//! The cells of a simulated flash in a file.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::sync::Arc;

use arm_sim::flash::{Cells, Memory, SIZE};
use embedded_storage::nor_flash::NorFlashErrorKind;
use tracing::warn;

/// A settings image of [`SIZE`] bytes in memory, and in a file if it has one. Every write reaches the file before the
/// call returns, in the order of the calls. So `kill -9` leaves the same states as a power cut.
#[derive(Clone, Debug)]
pub struct ImageFile {
    memory: Memory,
    /// Clones share the file.
    file: Option<Arc<File>>,
}

impl ImageFile {
    /// A blank image without a file, which ends with the process.
    #[must_use]
    pub fn in_memory() -> Self {
        Self { memory: Memory::default(), file: None }
    }

    /// The image in a file.
    ///
    /// # Errors
    /// The file cannot be read, or is shorter than [`SIZE`].
    pub fn open(file: File) -> io::Result<Self> {
        let mut bytes = vec![0; SIZE];
        file.read_exact_at(&mut bytes, 0)?;
        Ok(Self { memory: Memory::holding(bytes), file: Some(Arc::new(file)) })
    }

    /// A copy of the bytes, without the file.
    #[must_use]
    pub fn copy(&self) -> Memory {
        self.memory.clone()
    }
}

impl Cells for ImageFile {
    fn read(&self, offset: usize, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        self.memory.read(offset, bytes)
    }

    fn write(&mut self, offset: usize, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        if let Some(file) = &self.file {
            file.write_all_at(bytes, offset as u64).map_err(|error| {
                warn!("cannot write to the settings image: {error}");
                NorFlashErrorKind::Other
            })?;
        }
        self.memory.write(offset, bytes)
    }
}

#[cfg(test)]
mod tests {
    use arm_sim::flash::{ERASED, Flash};
    use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};

    use super::*;

    #[test]
    fn programming_and_erasing_reach_the_file() {
        let file = tempfile::tempfile().unwrap();
        file.write_all_at(&[ERASED; SIZE], 0).unwrap();
        let mut flash = Flash::on(ImageFile::open(file.try_clone().unwrap()).unwrap());
        let mut bytes = [0; 4];
        flash.write(8, &[0xF0; 4]).unwrap();
        flash.write(8, &[0x3C; 4]).unwrap();
        flash.read(8, &mut bytes).unwrap();
        assert_eq!(bytes, [0x30; 4]);
        file.read_exact_at(&mut bytes, 8).unwrap();
        assert_eq!(bytes, [0x30; 4]);
        flash.erase(0, 16 * 1024).unwrap();
        file.read_exact_at(&mut bytes, 8).unwrap();
        assert_eq!(bytes, [ERASED; 4]);
    }

    #[test]
    fn a_file_that_cannot_be_written_is_an_error() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), [ERASED; SIZE]).unwrap();
        let mut flash = Flash::on(ImageFile::open(File::open(file.path()).unwrap()).unwrap());
        assert_eq!(flash.write(0, &[0; 4]), Err(NorFlashErrorKind::Other));
        assert_eq!(flash.erase(0, 16 * 1024), Err(NorFlashErrorKind::Other));
    }
}
