//! Generates the writes of map 2.1, including the writes of the maker's programs.

use super::host_request::HostRequest;
use crate::seeded_rng::SeededRng;

/// Converts a write of map 2.2 to a write of the same registers in map 2.1. Apart from settings, about half of the writes of
/// map 2.1 are made in this way, so that both maps change the same registers.
pub(super) fn of_map22(request: (u8, Vec<u8>)) -> HostRequest {
    let (address, values) = request;
    HostRequest::WriteMap21 { address, values }
}

/// A write in map 2.1, in most cases of registers that only this map can write.
pub(super) fn write(rng: &mut SeededRng) -> HostRequest {
    let (address, values) = match rng.below(16) {
        0..=3 => (68, position(rng)),
        4..=6 => (54, [position(rng), direction(rng)].concat()),
        7 | 8 => (54, [position(rng), direction(rng), direction(rng)].concat()),
        // Both blocks.
        9 => (54, [position(rng), direction(rng), direction(rng), vec![1, 0], position(rng)].concat()),
        10 => (82, vec![frequency(rng)]),
        11 => (90, vec![frequency(rng)]),
        12 => (66, vec![rng.up_to(2)]),
        // An empty write, which stops the reports of register 53 (M4).
        13 => (rng.byte(), Vec::new()),
        // A part of the blocks.
        14 => (54 + rng.up_to(19), (0..=rng.below(12)).map(|_| rng.byte()).collect()),
        _ => (rng.byte(), vec![rng.up_to(3); rng.below(256)]),
    };
    HostRequest::WriteMap21 { address, values }
}

/// A write of settings or of the lock. A few are out of range.
pub(super) fn settings(rng: &mut SeededRng) -> HostRequest {
    let (address, values) = match rng.below(8) {
        0..=2 => (28, vec![u8::from(rng.one_in(6))]),
        3 => (20, vec![options(rng)]),
        4 => (13 + rng.joint().index(), vec![offset(rng)]),
        5 => (13, offsets(rng)),
        // The initial settings that the maker's programs write.
        6 => (11, [vec![rng.byte(), rng.up_to(7)], offsets(rng)].concat()),
        _ => (11, [vec![rng.byte(), rng.up_to(8)], offsets(rng), vec![options(rng)]].concat()),
    };
    HostRequest::WriteMap21 { address, values }
}

fn options(rng: &mut SeededRng) -> u8 {
    let most = if rng.one_in(20) { 5 } else { 3 };
    rng.up_to(most)
}

fn offsets(rng: &mut SeededRng) -> Vec<u8> {
    (0..7).map(|_| offset(rng)).collect()
}

/// Any of the three encodings.
fn offset(rng: &mut SeededRng) -> u8 {
    if rng.one_in(100) {
        return rng.byte();
    }
    let (least, more) = rng.one_of(&[(0, 16), (112, 32), (240, 15)], (112, 32));
    least + rng.up_to(more)
}

fn frequency(rng: &mut SeededRng) -> u8 {
    match rng.below(4) {
        0 => 0,
        1 => rng.up_to(102),
        _ => rng.up_to(30),
    }
}

/// A position in front of the arm, about half of these within its reach. One in eight is any position.
fn position(rng: &mut SeededRng) -> Vec<u8> {
    if rng.one_in(8) {
        return (0..6).map(|_| rng.byte()).collect();
    }
    let mut coordinate = |least: u16, count: usize| {
        let millimetres = usize::from(least) + rng.below(count);
        u16::try_from(millimetres).unwrap_or(least).to_be_bytes()
    };
    // Millimetres plus 1024: x is -200 to 200, y 0 to 300, z 0 to 300.
    [coordinate(824, 401), coordinate(1_024, 301), coordinate(1_024, 301)].concat()
}

/// Down, or any direction.
fn direction(rng: &mut SeededRng) -> Vec<u8> {
    if rng.one_in(2) { vec![128, 128, 127] } else { (0..3).map(|_| rng.byte()).collect() }
}
