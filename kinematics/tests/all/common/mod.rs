//! Random legal poses that several tests share.

use fastrand::Rng;
use kinematics::forward;
use kinematics::limits::check_arm;

/// Random angles of joints 1 to 6 that break no limit, without end. The wrist is not on the base axis, where it has no
/// heading.
pub fn legal_poses(seed: u64) -> impl Iterator<Item = [f64; 6]> {
    println!("seed {seed}");
    let mut random = Rng::with_seed(seed);
    std::iter::repeat_with(move || std::array::from_fn(|_| random.f64() * 180.0))
        .filter(|&angles| check_arm(angles).is_ok() && distance_from_axis(angles) > 0.002)
}

fn distance_from_axis(angles: [f64; 6]) -> f64 {
    let wrist = forward(angles).arm.wrist;
    wrist.x.hypot(wrist.y)
}
