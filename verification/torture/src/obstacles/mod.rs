//! Measures what becomes of the arm at obstacles, with and without its protection (`torture obstacles`; on the emulated image
//! `cargo xtask obstacles`).
//!
//! The first tables have a joint that is driven against a wall, in a matrix of poses, payloads and speeds, by a target or by
//! a stream of points. The next ones have forced alarms and emergency stops, first under a stream, then in that matrix. The
//! last one has things between the claws. All values are true values of the plant, sampled once per millisecond. Push is the
//! load of a joint that stands still, in 0.1 % of its stall torque.

mod arm;
mod grip;
mod mishap;
mod mishap_matrix;
mod simulated;
mod wall;

use protocol_core::time::Duration;

pub use arm::ObstacleArm;
pub use mishap::Mishap;
pub use simulated::SimulatedObstacleArm;
pub use wall::{WallCase, WallResult, push_against_wall};

/// The experiments of a run.
#[derive(Clone, Debug)]
pub struct Experiments {
    walls: Vec<WallCase>,
    mishaps: &'static [Mishap],
    matrix: Option<Vec<WallCase>>,
    grip_time: Duration,
}

impl Experiments {
    /// All experiments. They take hours of virtual time.
    #[must_use]
    pub fn all() -> Self {
        let grip_time = Duration::from_millis(3_600_000);
        let matrix = Some(WallCase::at_usual_speed());
        Self { walls: WallCase::all(), mishaps: &Mishap::ALL, matrix, grip_time }
    }

    /// A few experiments, which take some minutes in real time.
    #[must_use]
    pub fn few() -> Self {
        let grip_time = Duration::from_millis(60_000);
        Self { walls: WallCase::few(), mishaps: &Mishap::SHORT_STOPS, matrix: None, grip_time }
    }

    /// Makes these experiments, each with an arm of its own, and returns their tables.
    ///
    /// # Errors
    /// An arm fails.
    pub fn measure<A: ObstacleArm>(&self) -> Result<String, A::Error> {
        let walls = wall::tables::<A>(&self.walls)?;
        let mishaps = mishap::table::<A>(self.mishaps)?;
        let matrix = self.matrix.as_deref().map(mishap_matrix::tables::<A>).transpose()?.unwrap_or_default();
        Ok(format!("{walls}\n{mishaps}\n{matrix}\n{}", grip::table::<A>(self.grip_time)?))
    }
}
