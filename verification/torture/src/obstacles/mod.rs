//! Measures what becomes of the arm at obstacles, with and without its protection (`torture obstacles`; on the emulated image
//! `cargo xtask obstacles`).
//!
//! A joint is driven against a wall, in a matrix of poses, payloads and speeds, by a target or by a stream of points. A
//! second table has alarms that are forced on a servo, and emergency stops under a stream. A third one has things between
//! the claws. All values are true values of the plant, sampled once per millisecond. Push is the load of a joint that stands
//! still, in 0.1 % of its stall torque.

mod grip;
mod mishap;
mod simulated;
mod wall;

use arm_sim::plant::Plant;
use protocol_core::registers::map::PROTECTION;
use protocol_core::time::{Duration, Instant};

pub use mishap::Mishap;
pub use simulated::SimulatedObstacleArm;
pub use wall::{WallCase, WallResult, push_against_wall};

/// The time for the start, and for a pose.
const SETTLE_TIME: Duration = Duration::from_millis(3_000);
/// The time between two points of a stream, in milliseconds.
const PERIOD_MS: u8 = 20;

/// An arm in front of an obstacle: a controller with simulated servos.
pub trait ObstacleArm: Sized {
    /// Why an experiment cannot go on.
    type Error;

    /// Switches a new arm on.
    ///
    /// # Errors
    /// It does not start.
    fn start() -> Result<Self, Self::Error>;

    /// The time of the servos.
    fn now(&self) -> Instant;

    /// The servos and what is around them.
    fn plant(&mut self) -> &mut Plant;

    /// Writes registers.
    ///
    /// # Errors
    /// The controller is gone.
    fn write(&mut self, address: u8, values: &[u8]) -> Result<(), Self::Error>;

    /// Reads a register.
    ///
    /// # Errors
    /// The controller is gone, or does not reply.
    fn read(&mut self, address: u8) -> Result<u8, Self::Error>;

    /// Lets a millisecond pass, or a little more.
    ///
    /// # Errors
    /// The controller is gone.
    fn step(&mut self) -> Result<(), Self::Error>;

    /// Lets this time pass.
    ///
    /// # Errors
    /// The controller is gone.
    fn run(&mut self, time: Duration) -> Result<(), Self::Error> {
        let end = self.now() + time;
        while self.now() < end {
            self.step()?;
        }
        Ok(())
    }
}

/// A new arm with or without protection.
fn start<A: ObstacleArm>(is_protected: bool) -> Result<A, A::Error> {
    let mut arm = A::start()?;
    arm.run(SETTLE_TIME)?;
    arm.write(PROTECTION.address, &[u8::from(is_protected)])?;
    Ok(arm)
}

/// The experiments of a run.
#[derive(Clone, Debug)]
pub struct Experiments {
    walls: Vec<WallCase>,
    mishaps: &'static [Mishap],
    grip_time: Duration,
}

impl Experiments {
    /// All experiments: for virtual time.
    #[must_use]
    pub fn all() -> Self {
        let grip_time = Duration::from_millis(3_600_000);
        Self { walls: WallCase::all(), mishaps: &Mishap::ALL, grip_time }
    }

    /// A few of them, which take some minutes in real time.
    #[must_use]
    pub fn few() -> Self {
        let grip_time = Duration::from_millis(60_000);
        Self { walls: WallCase::few(), mishaps: &Mishap::SHORT_STOPS, grip_time }
    }

    /// Makes these experiments, each with an arm of its own, and returns their tables.
    ///
    /// # Errors
    /// An arm fails.
    pub fn measure<A: ObstacleArm>(&self) -> Result<String, A::Error> {
        let walls = wall::tables::<A>(&self.walls)?;
        let mishaps = mishap::table::<A>(self.mishaps)?;
        Ok(format!("{walls}\n{mishaps}\n{}", grip::table::<A>(self.grip_time)?))
    }
}

/// Percent with one decimal.
fn percent(permille: u16) -> String {
    format!("{}.{} %", permille / 10, permille % 10)
}

/// Degrees with one decimal, rounded up.
fn degrees(millidegrees: u32) -> String {
    let tenths = millidegrees.div_ceil(100);
    format!("{}.{}°", tenths / 10, tenths % 10)
}
