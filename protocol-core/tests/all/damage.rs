//! A million good frames for each kind of disturbance: how many are lost, and how late the others are (D3 to D5).

use crate::disturbed_line::{Disturbance, run};
use crate::stream::GAP_US;

const FRAMES: usize = 1_000_000;
/// At most five frames in a million are lost: where disturbed bytes happen to form a frame with a correct checksum.
const MOST_LOST: usize = 5;

fn check(disturbance: Disturbance, most_lost: usize) {
    let (name, seed) = (disturbance.name(), 7);
    let tally = run(disturbance, seed, FRAMES);
    println!("{name}: {tally:?} (seed {seed})");
    assert!(tally.lost <= most_lost, "{name}: {} lost", tally.lost);
    assert!(tally.worst_delay_us <= GAP_US, "{name}: {} us late", tally.worst_delay_us);
}

#[test]
fn d03_noise() {
    check(Disturbance::Noise, MOST_LOST);
}

#[test]
fn d03_truncated_frame() {
    check(Disturbance::TruncatedFrame, MOST_LOST);
}

#[test]
fn d03_flipped_bit() {
    check(Disturbance::FlippedBit, MOST_LOST);
}

#[test]
fn d03_lost_byte() {
    check(Disturbance::LostByte, MOST_LOST);
}

#[test]
fn d03_doubled_byte() {
    check(Disturbance::DoubledByte, MOST_LOST);
}

#[test]
fn d04_false_long_header() {
    check(Disturbance::FalseLongHeader, MOST_LOST);
}

#[test]
fn d04_pause_of_5_ms_inside_a_good_frame() {
    check(Disturbance::Pauses, 0);
}

#[test]
fn d05_frames_back_to_back_at_full_line_rate() {
    check(Disturbance::BackToBack, 0);
}
