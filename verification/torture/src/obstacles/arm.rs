//! An arm in front of an obstacle, and the functions that several experiments use.

use arm_sim::plant::Plant;
use protocol_core::registers::map::PROTECTION;
use protocol_core::time::{Duration, Instant};

/// The time to wait after the start, and after a pose was written or a payload was set.
pub(super) const SETTLE_TIME: Duration = Duration::from_millis(3_000);
/// The time between two points of a stream, in milliseconds.
pub(super) const PERIOD_MS: u8 = 20;

/// An arm in front of an obstacle: a controller with simulated servos.
pub trait ObstacleArm: Sized {
    /// The reason why an experiment cannot continue.
    type Error;

    /// Switches a new arm on.
    ///
    /// # Errors
    /// The arm does not start.
    fn start() -> Result<Self, Self::Error>;

    /// The current time of the simulated servos.
    fn now(&self) -> Instant;

    /// The simulated servos, with their load and the obstacles around them.
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

    /// Lets at least a millisecond pass.
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

/// Starts an arm, waits until it holds still, and switches its protection on or off.
pub(super) fn start<A: ObstacleArm>(is_protected: bool) -> Result<A, A::Error> {
    let mut arm = A::start()?;
    arm.run(SETTLE_TIME)?;
    arm.write(PROTECTION.address, &[u8::from(is_protected)])?;
    Ok(arm)
}

/// Formats permille as percent with one decimal.
pub(super) fn percent(permille: u16) -> String {
    format!("{}.{} %", permille / 10, permille % 10)
}

/// Formats thousandths of a degree as degrees with one decimal, rounded up.
pub(super) fn degrees(millidegrees: u32) -> String {
    let tenths = millidegrees.div_ceil(100);
    format!("{}.{}°", tenths / 10, tenths % 10)
}
