//! The line of a simulated arm in real time, inside the program that uses it.

use std::thread::sleep;
use std::time::{Duration, Instant};

use arm_sim::{Simulation, SimulationConfig};

use crate::error::PortError;
use crate::host_line::HostLine;

/// Time between two looks for received bytes: shorter than one byte at 9,600 baud.
const POLL_PERIOD: Duration = Duration::from_millis(1);
/// How long the arm has been on when its line opens, so that its servos are measured.
const ON_BEFORE: Duration = Duration::from_secs(1);

/// The seed of the arm, if the name of a port is `sim` (seed 1) or `sim:SEED`.
///
/// ```
/// use sevenbot::simulated::simulated_port;
///
/// assert_eq!((simulated_port("sim"), simulated_port("sim:42")), (Some(1), Some(42)));
/// assert_eq!(simulated_port("./sim"), None, "a file");
/// ```
#[must_use]
pub fn simulated_port(name: &str) -> Option<u64> {
    match name.strip_prefix("sim")? {
        "" => Some(1),
        seed => seed.strip_prefix(':')?.parse().ok(),
    }
}

/// The host's end of the line to a simulated arm that runs in real time.
///
/// The arm exists as long as the line, with factory settings. The simulation runs only while the line is used; each use
/// first lets it catch up with the computer's clock.
///
/// ```
/// use sevenbot::simulated::RealTimeLine;
/// use sevenbot::{Arm, ArmOptions};
///
/// # fn main() -> Result<(), sevenbot::OpenError> {
/// let mut arm = Arm::over(Box::new(RealTimeLine::new(1)), "sim", ArmOptions::default())?;
/// assert_eq!(arm.identity().version(), Arm::open("sim", 115_200)?.identity().version());
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct RealTimeLine {
    simulation: Simulation,
    /// When the line opened, [`ON_BEFORE`] after the arm was switched on.
    opened: Instant,
}

impl RealTimeLine {
    /// A line to a new arm that has been on for one second. Faults of its line are drawn from `seed`.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut simulation = Simulation::new(SimulationConfig::default());
        simulation.set_seed(seed);
        Self { simulation, opened: Instant::now() }
    }

    /// Runs the simulation until now.
    fn catch_up(&mut self) {
        let lived = Duration::from_micros(self.simulation.now().as_micros());
        self.simulation.advance((ON_BEFORE + self.opened.elapsed()).saturating_sub(lived).into());
    }
}

impl HostLine for RealTimeLine {
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.catch_up();
        self.simulation.send(bytes);
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, PortError> {
        let end = Instant::now() + timeout;
        loop {
            self.catch_up();
            let left = end.saturating_duration_since(Instant::now());
            if !self.simulation.received().is_empty() || left.is_zero() {
                return Ok(self.simulation.take_received());
            }
            sleep(left.min(POLL_PERIOD));
        }
    }
}
