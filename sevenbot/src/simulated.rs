//! An arm in virtual time, for tests and for programs without an arm.
//!
//! ```
//! use sevenbot::simulated::{self, SimulationConfig};
//! use sevenbot::{Angle, Joint};
//! use std::time::{Duration, Instant};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let (mut arm, simulation) = simulated::arm(SimulationConfig::default())?;
//! let base = Joint::ALL[0];
//! arm.set_target(base, Angle::from_degrees(120).ok_or("an angle")?)?;
//! let start = Instant::now();
//! arm.sleep(Duration::from_secs(60));
//! assert!(start.elapsed() < Duration::from_secs(60), "the minute is virtual");
//! assert_eq!(arm.positions()?[0].degrees(), 120);
//! // The true angle, in thousandths of a degree, and a fault.
//! simulation.with(|simulation| assert_eq!(simulation.plant().angle(base) / 1_000, 120));
//! simulation.with(|simulation| simulation.plant_mut().set_fault(base, "missing".parse().ok()));
//! arm.sleep(Duration::from_secs(1));
//! assert_eq!(arm.status()?.map(|status| status.missing()), Some(1));
//! # Ok(())
//! # }
//! ```
//!
//! Time passes only while the arm is asked or slept for, and in [`SharedSimulation::with`]. So a program may think as long
//! as it likes, and gives the same result on every machine.

use std::io::ErrorKind;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

pub use arm_sim::{Simulation, SimulationConfig};
use protocol_core::time;

use crate::arm::Arm;
use crate::arm_options::ArmOptions;
use crate::error::{OpenError, PortError};
use crate::host_line::HostLine;

/// A simulated arm, and its simulation.
///
/// # Errors
/// Those of [`Arm::over`].
pub fn arm(config: SimulationConfig) -> Result<(Arm, SharedSimulation), OpenError> {
    arm_with(config, ArmOptions::default())
}

/// As [`arm`], with other timeouts or another map.
///
/// # Errors
/// Those of [`Arm::over`].
pub fn arm_with(config: SimulationConfig, options: ArmOptions) -> Result<(Arm, SharedSimulation), OpenError> {
    let simulation = SharedSimulation::new(Simulation::new(config));
    Ok((Arm::over(Box::new(simulation.line()), "simulated", options)?, simulation))
}

/// A simulation that an [`Arm`] and a test share.
#[derive(Clone, Debug)]
pub struct SharedSimulation {
    simulation: Arc<Mutex<Simulation>>,
    /// When the cable of the host line is pulled.
    unplugged: Arc<Mutex<Option<time::Instant>>>,
}

impl SharedSimulation {
    /// Shares a simulation.
    #[must_use]
    pub fn new(simulation: Simulation) -> Self {
        Self { simulation: Arc::new(Mutex::new(simulation)), unplugged: Arc::default() }
    }

    /// Pulls the cable of the host line after this time: then sends and receives fail.
    pub fn unplug(&self, after: Duration) {
        let time = self.with(|simulation| simulation.now()) + virtual_time(after);
        *self.unplugged.lock().unwrap_or_else(PoisonError::into_inner) = Some(time);
    }

    fn check_plug(&self) -> Result<(), PortError> {
        let unplugged = *self.unplugged.lock().unwrap_or_else(PoisonError::into_inner);
        let is_unplugged = unplugged.is_some_and(|time| self.with(|simulation| simulation.now()) >= time);
        if is_unplugged { Err(PortError::Lost(ErrorKind::BrokenPipe)) } else { Ok(()) }
    }

    /// Does something with the simulation, while no time passes for the arm.
    pub fn with<T>(&self, work: impl FnOnce(&mut Simulation) -> T) -> T {
        // A panic in `work` leaves a simulation that can go on.
        work(&mut self.simulation.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The host's end of its line.
    #[must_use]
    pub fn line(&self) -> SimulatedLine {
        SimulatedLine { simulation: self.clone(), start: Instant::now() }
    }
}

/// The host's end of the line of a simulated arm.
#[derive(Clone, Debug)]
pub struct SimulatedLine {
    simulation: SharedSimulation,
    /// The virtual time 0.
    start: Instant,
}

impl HostLine for SimulatedLine {
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.simulation.check_plug()?;
        self.simulation.with(|simulation| simulation.send(bytes));
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, PortError> {
        self.simulation.check_plug()?;
        Ok(self.simulation.with(|simulation| {
            simulation.advance_until(virtual_time(timeout), |simulation| !simulation.received().is_empty());
            simulation.take_received()
        }))
    }

    fn now(&self) -> Instant {
        let elapsed = self.simulation.with(|simulation| simulation.now().as_micros());
        self.start + Duration::from_micros(elapsed)
    }

    fn sleep(&mut self, duration: Duration) {
        self.simulation.with(|simulation| simulation.advance(virtual_time(duration)));
    }
}

fn virtual_time(duration: Duration) -> time::Duration {
    time::Duration::from_micros(u64::try_from(duration.as_micros()).unwrap_or(u64::MAX))
}
