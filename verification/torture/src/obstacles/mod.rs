//! Measures falls, pushes and speeds of the arm at obstacles, after alarms and after emergency stops, with and without its
//! protection (`torture obstacles`; on the emulated image `cargo xtask obstacles`).
//!
//! The first tables show a joint that is driven against a wall, in a matrix of poses, payloads and speeds, by a target or by
//! a stream of points. The next tables show forced alarms and emergency stops, first under a stream, then in that matrix at
//! speed 60. The last table shows things between the claws.
//!
//! Angles and pushes are true values of the plant, sampled about once per millisecond. Motor state, temperature and alarms
//! are registers. A push is the duty of the joint's motor in 0.1 %. While the joint stands still, this is its torque relative
//! to the stall torque.

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

/// The cases at walls and of mishaps, and how long things stay between the claws.
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
