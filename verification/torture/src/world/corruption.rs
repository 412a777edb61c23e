//! Corruption of bytes on a line.

use crate::seeded_rng::SeededRng;

/// Bytes of headers on either line.
const LIKELY: [u8; 8] = [0xAA, 0x77, 0xAA, 0x77, 0x06, 0x03, 0xFF, 0xFF];

/// The bytes after one random kind of corruption, and sometimes a second.
pub(super) fn corrupt(bytes: &[u8], rng: &mut SeededRng) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    corrupt_once(&mut bytes, rng);
    if rng.one_in(4) {
        corrupt_once(&mut bytes, rng);
    }
    bytes
}

fn corrupt_once(bytes: &mut Vec<u8>, rng: &mut SeededRng) {
    let index = rng.below(bytes.len());
    match rng.below(7) {
        0 => bytes.get_mut(index).into_iter().for_each(|byte| *byte ^= 1 << rng.below(8)),
        1 => bytes.get_mut(index).into_iter().for_each(|byte| *byte = rng.byte()),
        2 => drop(bytes.drain(index..(index + 1).min(bytes.len()))),
        3 => bytes.get(index).copied().into_iter().for_each(|byte| bytes.insert(index, byte)),
        4 => bytes.truncate(index),
        5 => {
            let from = bytes.split_off(index);
            bytes.extend(noise(8, rng));
            bytes.extend(from);
        }
        _ => *bytes = noise(40, rng),
    }
}

/// 1 to `most` random bytes, half of them from headers.
pub(super) fn noise(most: usize, rng: &mut SeededRng) -> Vec<u8> {
    let count = 1 + rng.below(most);
    (0..count).map(|_| if rng.one_in(2) { rng.one_of(&LIKELY, 0) } else { rng.byte() }).collect()
}
