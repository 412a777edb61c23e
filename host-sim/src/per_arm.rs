//! File names and chip ids of several arms in one process.

use std::path::{Path, PathBuf};

/// The path of the arm with this number: `./7bot` becomes `./7bot-3`, `arm.bin` becomes `arm-3.bin`. `None`: there is
/// only one arm, and its path does not change.
#[must_use]
pub fn path(path: &Path, number: Option<u16>) -> PathBuf {
    let Some(number) = number else { return path.to_owned() };
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{number}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// The chip id of the arm with this number. The first arm has the id `first`, each further arm the next id.
#[must_use]
pub fn chip_id(first: [u8; 6], number: Option<u16>) -> [u8; 6] {
    let [a, b, c, d, e, f] = first;
    let id = u64::from_be_bytes([0, 0, a, b, c, d, e, f]);
    let [_, _, id @ ..] = id.wrapping_add(u64::from(number.unwrap_or(1).saturating_sub(1))).to_be_bytes();
    id
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_is_before_the_extension() {
        for (whole, third) in
            [("./7bot", "./7bot-3"), ("/tmp/a.b/arm.bin", "/tmp/a.b/arm-3.bin"), (".x", ".x-3")]
        {
            assert_eq!(path(Path::new(whole), Some(3)), Path::new(third));
            assert_eq!(path(Path::new(whole), None), Path::new(whole));
        }
    }

    #[test]
    fn chip_ids_are_consecutive() {
        assert_eq!(chip_id([1, 2, 3, 4, 5, 255], None), [1, 2, 3, 4, 5, 255]);
        assert_eq!(chip_id([1, 2, 3, 4, 5, 255], Some(1)), [1, 2, 3, 4, 5, 255]);
        assert_eq!(chip_id([1, 2, 3, 4, 5, 255], Some(3)), [1, 2, 3, 4, 6, 1]);
        assert_eq!(chip_id([255; 6], Some(2)), [0; 6]);
    }
}
