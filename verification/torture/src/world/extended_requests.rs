//! Generates the writes of the extended block.

use protocol_core::registers::map::TARGET_POSITION;

use super::extended_model::{LIMITS, PERIOD, REPORT_CONTENT, WATCHDOG, fine_target};
use crate::seeded_rng::SeededRng;

/// A write of the extended block. A few are out of range, or cover half of a two-byte register.
pub(crate) fn write(rng: &mut SeededRng) -> (u8, Vec<u8>) {
    match rng.below(16) {
        0..=4 => (fine_target(rng.joint()), fine(rng)),
        5..=8 => {
            (fine_target(protocol_core::registers::Joint::ALL[0]), (0..7).flat_map(|_| fine(rng)).collect())
        }
        9 | 10 => (PERIOD, period(rng)),
        11 => (LIMITS, vec![rng.up_to(3)]),
        12 if rng.one_in(2) => (WATCHDOG, vec![timeout(rng), u8::from(rng.one_in(3))]),
        12 => (REPORT_CONTENT, vec![content(rng)]),
        // The targets in both views.
        13 => (TARGET_POSITION.address, (0..96).map(|_| rng.up_to(60)).collect()),
        _ => (124 + rng.up_to(68), (0..rng.below(20)).map(|_| rng.up_to(64)).collect()),
    }
}

fn fine(rng: &mut SeededRng) -> Vec<u8> {
    let most = if rng.one_in(100) { 65_536 } else { 18_001 };
    word(rng.below(most))
}

fn period(rng: &mut SeededRng) -> Vec<u8> {
    let most = rng.one_of(&[1, 50, 50, 1_003], 1);
    word(rng.below(most))
}

/// Off, or up to 2.55 s.
fn timeout(rng: &mut SeededRng) -> u8 {
    if rng.one_in(3) { 0 } else { rng.byte() }
}

fn content(rng: &mut SeededRng) -> u8 {
    let most = if rng.one_in(20) { 3 } else { 2 };
    rng.up_to(most)
}

fn word(value: usize) -> Vec<u8> {
    u16::try_from(value).unwrap_or(0).to_le_bytes().to_vec()
}
