//! Twenty seconds of an idle arm, for a profiler: docs/simulation.md shows where the time goes.

use arm_sim::{Duration, Simulation};

/// Steps of 10 ms.
const STEPS: u32 = 2_000;

fn main() {
    let mut arm = Simulation::default();
    for _ in 0..STEPS {
        arm.advance(Duration::from_millis(10));
    }
}
