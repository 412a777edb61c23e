//! The cells of a simulated flash in a file.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;

use arm_sim::flash::Cells;
use tracing::warn;

/// A settings image, which is [`SIZE`](arm_sim::flash::SIZE) bytes long. Every operation reaches the file before it
/// returns, in the order of the calls: a `kill -9` leaves what a power cut would leave.
#[derive(Debug)]
pub struct ImageFile(pub File);

impl Cells for ImageFile {
    fn read(&self, offset: usize, bytes: &mut [u8]) -> io::Result<()> {
        self.0.read_exact_at(bytes, offset as u64)
    }

    fn write(&mut self, offset: usize, bytes: &[u8]) -> io::Result<()> {
        let written = self.0.write_all_at(bytes, offset as u64);
        written.inspect_err(|error| warn!("cannot write to the settings image: {error}"))
    }
}

#[cfg(test)]
mod tests {
    use arm_sim::flash::{ERASED, Flash, SIZE};
    use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};

    use super::*;

    #[test]
    fn programming_and_erasing_reach_the_file() {
        let mut file = tempfile::tempfile().unwrap();
        io::Write::write_all(&mut file, &[ERASED; SIZE]).unwrap();
        let mut flash = Flash::on(ImageFile(file));
        let mut cells = [0; 4];
        flash.write(8, &[0xF0; 4]).unwrap();
        flash.write(8, &[0x3C; 4]).unwrap();
        flash.read(8, &mut cells).unwrap();
        assert_eq!(cells, [0x30; 4]);
        assert!(!flash.is_blank().unwrap());
        flash.erase(0, 16 * 1024).unwrap();
        assert!(flash.is_blank().unwrap());
    }
}
