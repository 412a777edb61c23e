//! One slot: 32 bytes that hold one record of the settings.
//!
//! ```text
//!   word  0            1 .. 5          6                          7
//!        ┌────────────┬───────────────┬──────────────────────────┬──────┐
//!        │ generation │ 20 bytes data │ CRC-32 of words 0 to 5   │ seal │
//!        └────────────┴───────────────┴──────────────────────────┴──────┘
//!         numbers: low byte first                                  programmed last
//! ```
//!
//! The CRC is CRC-32/ISO-HDLC. Over 192 bits its Hamming distance is six: one wrong bit is corrected, and up to four
//! wrong bits never decode as another record. This file does not know the address of a slot.

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};

use crate::registers::Image;

/// The unit of programming.
pub(super) type Word = [u8; 4];
pub(super) type Slot = [Word; 8];
/// Bytes of a slot.
pub(super) const LENGTH: u32 = 32;
/// An erased slot. A slot may also read like this after a power cut at the very beginning of its first word.
pub(super) const BLANK: Slot = [[0xFF; 4]; 8];

/// The seal is programmed after the other seven words were verified, so in a sealed slot these words have no half-programmed
/// cells. The seal has as many ones as zeros, so wear or a power cut does not produce it by chance.
const SEAL: Word = [0x5E, 0xA1, 0xC3, 0x96];
const CHECK: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// The last generation; the next one is 0. A blank word is not a generation. Wrap-around is unreachable in practice, but
/// damaged flash may hold any generation.
const LAST_GENERATION: u32 = u32::MAX / 2;

pub(super) const fn generation_after(generation: u32, steps: u32) -> u32 {
    generation.wrapping_add(steps) & LAST_GENERATION
}

/// The content of a valid slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Record {
    /// Grows with each move of the log to the other sector; equal for all records of a sector.
    pub(super) generation: u32,
    pub(super) image: Image,
    /// The slot is sealed and needed no correction, so later starts will read the same.
    pub(super) firm: bool,
}

impl Record {
    /// Was this record written after `other`? The two are in different sectors, so their generations differ.
    pub(super) fn is_later_than(&self, other: &Self) -> bool {
        let steps = self.generation.wrapping_sub(other.generation) & LAST_GENERATION;
        (1..=LAST_GENERATION / 2).contains(&steps)
    }
}

/// Encodes a sealed slot.
pub(super) fn encode(generation: u32, image: &Image) -> Slot {
    let mut covered = [[0; 4]; 6];
    let bytes = generation.to_le_bytes().into_iter().chain(image.0);
    for (to, from) in covered.as_flattened_mut().iter_mut().zip(bytes) {
        *to = from;
    }
    let check = CHECK.checksum(covered.as_flattened()).to_le_bytes();
    let [generation, a, b, c, d, e] = covered;
    [generation, a, b, c, d, e, check, SEAL]
}

/// Decodes a slot; `None` if it holds no valid record.
pub(super) fn decode(slot: &Slot) -> Option<Record> {
    let [mut covered @ .., check, seal] = *slot;
    let difference = CHECK.checksum(covered.as_flattened()) ^ u32::from_le_bytes(check);
    let sealed = seal == SEAL;
    // Without a seal, a wrong bit is a sign of a power cut: more bits may read wrong at the next start.
    if difference != 0 && !(sealed && correct(covered.as_flattened_mut(), difference)) {
        return None;
    }
    let [generation, data @ ..] = covered;
    let generation = u32::from_le_bytes(generation);
    // The CRC of a blank word and five zero words is blank, too. An erase that was cut twice can leave that.
    if generation > LAST_GENERATION {
        return None;
    }
    let image = Image(*data.as_flattened().first_chunk()?);
    Some(Record { generation, image, firm: sealed && difference == 0 })
}

/// Corrects the one bit that explains this `difference` of the CRC; returns false if there is no such bit.
///
/// The CRC is linear, so the effect of a bit depends only on its position. The effect of the last bit is the polynomial.
/// The effect of each earlier bit is the effect of the next bit, shifted by one step.
fn correct(covered: &mut [u8], difference: u32) -> bool {
    const POLYNOMIAL: u32 = CRC_32_ISO_HDLC.poly.reverse_bits();
    let mut effect = POLYNOMIAL;
    for byte in covered.iter_mut().rev() {
        for bit in (0..8).rev() {
            if effect == difference {
                *byte ^= 1 << bit;
                return true;
            }
            effect = (effect >> 1) ^ if effect & 1 == 1 { POLYNOMIAL } else { 0 };
        }
    }
    // A single bit of difference means that the CRC itself has the wrong bit and the data are correct.
    difference.is_power_of_two()
}

/// The first word of a sector that was erased, verified as blank and prepared for `generation`.
///
/// Each generation has its own mark, so an older mark that survives an interrupted erase is not valid. The mark is a CRC,
/// because the marks of neighbouring generations must differ in many bits.
pub(super) const fn mark(generation: u32) -> Word {
    CHECK.checksum(&generation.to_le_bytes()).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    const IMAGE: Image = Image([0, 0, 0, 7, 1, 0x85, 3, 0, 16, 0x90, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);

    fn flipped(slot: &Slot, bits: &[usize]) -> Slot {
        let mut slot = *slot;
        for bit in bits {
            slot.as_flattened_mut()[bit / 8] ^= 1 << (bit % 8);
        }
        slot
    }

    #[test]
    fn any_single_wrong_bit_leaves_the_record_but_not_firm() {
        let slot = encode(3, &IMAGE);
        assert_eq!(decode(&slot), Some(Record { generation: 3, image: IMAGE, firm: true }));
        for bit in 0..256 {
            let record = decode(&flipped(&slot, &[bit]));
            assert_eq!(record, Some(Record { generation: 3, image: IMAGE, firm: false }), "bit {bit}");
        }
    }

    #[test]
    fn two_wrong_bits_never_make_another_record() {
        let slot = encode(3, &IMAGE);
        for (first, second) in (0..256).flat_map(|first| (0..first).map(move |second| (first, second))) {
            let record = decode(&flipped(&slot, &[first, second]));
            let same = |record: Record| record.image == IMAGE && record.generation == 3;
            assert!(record.is_none_or(same), "bits {first}, {second}: {record:?}");
        }
    }

    #[test]
    fn a_wrong_bit_is_not_corrected_without_a_seal() {
        let mut slot = encode(3, &IMAGE);
        slot[7] = [0xFF; 4];
        assert!(decode(&slot).is_some_and(|record| !record.firm));
        for bit in 0..224 {
            assert_eq!(decode(&flipped(&slot, &[bit])), None, "bit {bit}");
        }
    }

    #[test]
    fn blank_and_zeroed_slots_hold_no_record() {
        assert_eq!(decode(&BLANK), None);
        assert_eq!(decode(&[[0; 4]; 8]), None);
    }

    #[test]
    fn runs_of_ones_and_zeros_left_by_an_erase_hold_no_record() {
        let step = if cfg!(miri) { 32 } else { 1 };
        let ends = (0..=256).step_by(step);
        for (from, to) in ends.clone().flat_map(|from| ends.clone().map(move |to| (from, to))) {
            let mut slot = [0; 32];
            (from..to).for_each(|bit| slot[bit / 8] |= 1 << (bit % 8));
            let words =
                |slot: [u8; 32]| std::array::from_fn(|word| std::array::from_fn(|at| slot[4 * word + at]));
            assert_eq!(decode(&words(slot)), None, "ones from bit {from} to {to}");
            assert_eq!(decode(&words(slot.map(|byte| !byte))), None, "zeros from bit {from} to {to}");
        }
    }

    #[test]
    fn marks_of_neighbouring_generations_differ_in_many_bits() {
        for (a, b) in (0..2_000_u32).flat_map(|a| (a + 1..a + 4).map(move |b| (a, b))) {
            let differing = u32::from_le_bytes(mark(a)) ^ u32::from_le_bytes(mark(b));
            assert!(differing.count_ones() >= 6, "{a} and {b}");
        }
    }
}
