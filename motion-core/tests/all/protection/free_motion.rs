//! Without an obstacle the protection changes nothing (D27).

use crate::free_moves::FreeMoves;
use crate::rig::{Rig, ToServos};

use super::{BLOCKED, LET_GO};

/// Seeds of motions in which a joint reverses at full speed, so that its push lasts longest.
const TURNS_AT_FULL_SPEED: [u64; 4] = [78, 1111, 3009, 3707];

/// Every frame for the servos during the moves of a seed, and the bits of the joints that were blocked or let go.
fn frames_of_moves(seed: u64, protection: u8) -> (Vec<(u64, ToServos)>, u8) {
    let mut rig = Rig::started();
    let moves = FreeMoves::of(seed, protection);
    rig.plant.set_load(moves.grams);
    let mut blocked = 0;
    for step in &moves.steps {
        rig.write(step.address, &step.values);
        rig.run_ms(step.wait_ms);
        blocked |= rig.get(BLOCKED) | rig.get(LET_GO);
    }
    (rig.to_servos, blocked)
}

#[test]
fn d27_free_motion_with_300_g_is_byte_for_byte_that_without_protection() {
    let mut bad = Vec::new();
    for seed in (0..40).chain(TURNS_AT_FULL_SPEED) {
        let ((with, blocked), (without, _)) = (frames_of_moves(seed, 1), frames_of_moves(seed, 0));
        if with != without || blocked != 0 {
            let at = with.iter().zip(&without).position(|(a, b)| a != b);
            let first = at.map(|at| (&with[at], &without[at]));
            bad.push(format!("seed {seed}: {first:?}, flags {blocked:#b}"));
        }
    }
    assert!(bad.is_empty(), "{bad:#?}");
}
