//! The linkage of joints 2 and 3 during moves (D25): set-points never break it, and they always reach their targets.

use motion_core::calibration::MicroDegrees;
use motion_core::limits::{linkage_allows, linkage_step};
use motion_core::trajectory::Trajectory;
use protocol_core::time::Instant;

type Pair = [u8; 2];

fn is_legal([two, three]: Pair) -> bool {
    linkage_allows(MicroDegrees::from_degrees(two), MicroDegrees::from_degrees(three))
}

/// All legal pairs of angles on a grid of `step` degrees.
fn legal_pairs(step: usize) -> Vec<Pair> {
    let angles = || (0..=180_u8).step_by(step);
    angles().flat_map(|two| angles().map(move |three| [two, three])).filter(|pair| is_legal(*pair)).collect()
}

/// Moves from one legal pair to another, as the controller does. Panics if a set-point breaks the linkage, or does not arrive
/// within the sum of the times of the two moves.
fn travel(from: Pair, to: Pair, speeds: Pair, times: Pair) {
    let mut moves = from.map(|angle| Trajectory::holding(MicroDegrees::from_degrees(angle)));
    for (trajectory, (to, time)) in moves.iter_mut().zip(to.into_iter().zip(times)) {
        trajectory.move_to(MicroDegrees::from_degrees(to), time);
    }
    let cycles = |index: usize| match (speeds[index], times[index]) {
        (0, time) => u32::from(time) * 10 + 50,
        (speed, _) => 180_000 / (u32::from(speed) * 19) + 2,
    };
    for _ in 0..cycles(0) + cycles(1) {
        let before = moves.each_ref().map(Trajectory::set_point);
        for (trajectory, speed) in moves.iter_mut().zip(speeds) {
            trajectory.advance(Instant::ZERO, speed);
        }
        let after = moves.each_ref().map(Trajectory::set_point);
        let allowed = linkage_step(before, after);
        for (trajectory, (after, allowed)) in moves.iter_mut().zip(after.into_iter().zip(allowed)) {
            if after != allowed {
                trajectory.hold_back(allowed);
            }
        }
        let [two, three] = allowed;
        assert!(
            linkage_allows(two, three),
            "{from:?} to {to:?} at {speeds:?} in {times:?}: {two:?} {three:?}"
        );
        if moves.iter().all(|trajectory| !trajectory.is_moving()) {
            return;
        }
    }
    panic!("{from:?} to {to:?} at {speeds:?} in {times:?} does not arrive");
}

/// A generator that is the same on every machine (SplitMix64 with a shorter last step).
struct Random(u64);

impl Random {
    fn byte(&mut self, most: u8) -> u8 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        u8::try_from((mixed >> 33) % (u64::from(most) + 1)).unwrap()
    }
}

fn every_pair_of(pairs: &[Pair], slowest: u8, seed: u64) {
    let mut random = Random(seed);
    for &from in pairs {
        for &to in pairs {
            let speeds = [0; 2].map(|_: u8| match random.byte(3) {
                0 => 0,
                _ => random.byte(100 - slowest) + slowest,
            });
            let times = [random.byte(30), random.byte(30)];
            travel(from, to, speeds, times);
        }
    }
}

#[test]
fn d25_the_linkage_is_kept_between_pairs_on_a_grid_of_nine_degrees() {
    every_pair_of(&legal_pairs(9), 1, 4_711);
}

/// 406 million moves.
#[test]
#[ignore = "takes minutes; a step of the long tests"]
fn d25_the_linkage_is_kept_between_all_pairs_of_whole_degrees() {
    let pairs = legal_pairs(1);
    println!("{} legal pairs", pairs.len());
    every_pair_of(&pairs, 20, 90_210);
}

#[test]
fn d25_a_move_without_a_time_goes_on_at_full_speed_after_waiting() {
    let mut trajectory = Trajectory::holding(MicroDegrees(0));
    trajectory.move_to(MicroDegrees(7_000_000), 0);
    for _ in 0..3 {
        trajectory.advance(Instant::ZERO, 0);
        trajectory.hold_back(MicroDegrees(0));
    }
    trajectory.advance(Instant::ZERO, 0);
    assert_eq!(trajectory.set_point(), MicroDegrees(3_720_000), "372 degrees/s");
}
