//! Without an obstacle the protection changes nothing (D27).

use crate::rig::{Rig, ToServos};

use super::{BLOCKED, LET_GO};

/// Motions in which a joint turns back at full speed, so that its push lasts longest.
const TURNS_AT_FULL_SPEED: [u64; 4] = [78, 1111, 3009, 3707];

/// Small reproducible numbers.
struct Numbers(u64);

impl Numbers {
    fn one_of<T: Copy>(&mut self, values: &[T]) -> T {
        let index = self.below(u64::try_from(values.len()).expect("few values"));
        values[usize::try_from(index).expect("few values")]
    }

    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end
    }
}

/// A legal pose of joints 1 to 7.
fn pose(numbers: &mut Numbers) -> [u8; 7] {
    let two = 20 + numbers.below(140);
    let three = (84_u64.saturating_sub(two)).max(10) + numbers.below(120);
    let three = three.min(226 - two).min(170);
    let mut any = |from: u64, to: u64| u8::try_from(from + numbers.below(to - from)).expect("a byte");
    let [one, four, five, six] = [any(0, 180), any(0, 180), any(10, 170), any(0, 180)];
    [one, u8::try_from(two).unwrap(), u8::try_from(three).unwrap(), four, five, six, any(0, 84)]
}

/// Every frame for the servos during some moves with a payload.
fn frames_of_moves(seed: u64, protection: u8) -> (Vec<(u64, ToServos)>, u8) {
    let mut numbers = Numbers(seed);
    let mut rig = Rig::started();
    // A gripper or a suction cup.
    let has_gripper = numbers.below(2) == 0;
    rig.write(30, &[u8::from(has_gripper)]);
    rig.write(192, &[protection, 70, if numbers.below(2) == 0 { 20 } else { 40 }]);
    rig.plant.set_load(numbers.one_of(&[0, 100, 200, 300]));
    rig.run_ms(500);
    let mut blocked = 0;
    for _ in 0..4 {
        let speed = numbers.one_of(&[0, 0, 10, 60, 100]);
        rig.write(32, &[speed; 7]);
        let to = pose(&mut numbers);
        if numbers.below(2) == 0 {
            rig.write(184, &[0, 0]);
            rig.write(46, &to);
            rig.run_ms(100 + numbers.below(2_000));
        } else {
            rig.write(184, &[20, 0]);
            for step in 1..=numbers.below(100) {
                let words = to.map(|degrees| (u64::from(degrees) * 100 + step).to_le_bytes());
                let bytes: Vec<u8> = words.iter().flat_map(|word| [word[0], word[1]]).collect();
                rig.write(128, &bytes);
                rig.run_ms(20);
            }
        }
        blocked |= rig.get(BLOCKED) | rig.get(LET_GO);
    }
    (rig.to_servos, blocked)
}

#[test]
fn d27_free_motion_with_300_g_is_byte_for_byte_that_without_protection() {
    let seeds: u64 = std::env::var("FREE_MOTIONS").ok().and_then(|count| count.parse().ok()).unwrap_or(40);
    let mut bad = Vec::new();
    for seed in (0..seeds).chain(TURNS_AT_FULL_SPEED) {
        let ((with, blocked), (without, _)) = (frames_of_moves(seed, 1), frames_of_moves(seed, 0));
        if with != without || blocked != 0 {
            let at = with.iter().zip(&without).position(|(a, b)| a != b);
            let first = at.map(|at| (&with[at], &without[at]));
            bad.push(format!("seed {seed}: {first:?}, flags {blocked:#b}"));
        }
    }
    assert!(bad.is_empty(), "{} of {seeds}: {bad:#?}", bad.len());
}
