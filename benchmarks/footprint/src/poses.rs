//! Random poses, and a number mixed from the bits of their kinematics: the same on chip and host.
//!
//! `kinematics/tests/all/same_bits.rs` includes this file, so that the host checks the same number as the chip.

use kinematics::limits::check_arm;
use kinematics::{Vector, forward, ik7};

/// The number of random poses.
const RANDOM: usize = 255;
/// A pose with the wrist behind the base axis, at y = 0. Only the second heading that is tried lets the hand point down.
const AWAY: [f32; 6] = [0.0, 140.0, 0.0, 90.0, 180.0, 0.0];
/// [`mix`] of all poses, in order, beginning with 0.
pub const BITS: u32 = 2_661_855_130;

/// Angles of joints 1 to 6, in degrees, that break no limit.
pub fn poses() -> impl Iterator<Item = [f32; 6]> {
    let mut state = 1_u32;
    let mut angle = move |_| {
        // The generator of Numerical Recipes. Its high half is random enough.
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let [.., low, high] = state.to_le_bytes();
        f32::from(u16::from_le_bytes([low, high])) * (180.0 / 65_536.0)
    };
    let all = core::iter::repeat_with(move || [0; 6].map(&mut angle));
    all.filter(|&pose| check_arm(pose).is_ok()).take(RANDOM).chain([AWAY])
}

/// Mixes `bits` with the bits of a pose: the position of its tip, and the angles that inverse kinematics give for it.
#[must_use]
pub fn mix(bits: u32, pose: [f32; 6]) -> u32 {
    let hand = forward(pose).hand;
    let Vector { x, y, z } = hand.tip;
    let angles = ik7(hand.tip, hand.tool, hand.disc).unwrap_or([0.0; 6]);
    [x, y, z].iter().chain(&angles).fold(bits, |bits, number| bits.rotate_left(1) ^ number.to_bits())
}
