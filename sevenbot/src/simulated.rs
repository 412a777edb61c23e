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
//! Virtual time passes only while the program waits for a reply or a report, in [`Arm::sleep`], and where a call of
//! [`SharedSimulation::with`] advances it. So the result does not depend on how long the program computes, and is the same
//! on every machine. [`RealTimeLine`] is an arm in real time: the port `sim` of the programs.

use std::io::ErrorKind;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

pub use arm_sim::{Simulation, SimulationConfig};
use protocol_core::time;

use crate::arm::Arm;
use crate::arm_options::ArmOptions;
use crate::error::{OpenError, PortError};
use crate::host_line::HostLine;

pub use crate::real_time_line::{RealTimeLine, simulated_port};

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

/// A simulation that an [`Arm`] shares with the program that observes or changes it.
#[derive(Clone, Debug)]
pub struct SharedSimulation {
    simulation: Arc<Mutex<Simulation>>,
    clock: Arc<Mutex<HostClock>>,
}

/// The clock of the host line. It goes on evenly when a restore changes the arm's time.
#[derive(Debug, Default)]
struct HostClock {
    /// How far this clock is ahead of the arm's time, in microseconds, because of restores.
    ahead: i64,
    /// When the cable of the host line is pulled.
    unplugged: Option<Duration>,
    restores: u64,
}

impl HostClock {
    fn at(&self, now: time::Instant) -> Duration {
        Duration::from_micros(now.as_micros().saturating_add_signed(self.ahead))
    }
}

impl SharedSimulation {
    /// Makes a simulation that can be shared. [`Self::line`] leads to its arm.
    #[must_use]
    pub fn new(simulation: Simulation) -> Self {
        Self { simulation: Arc::new(Mutex::new(simulation)), clock: Arc::default() }
    }

    /// Pulls the cable of the host line after this time: then sends and receives fail.
    pub fn unplug(&self, after: Duration) {
        let time = self.elapsed() + after;
        self.clock().unplugged = Some(time);
    }

    /// Replaces the simulation, for example by an earlier copy. The clock of the host line goes on without a step, so that due
    /// times and timeouts stay valid.
    pub fn restore(&self, other: Simulation) {
        self.with(|simulation| {
            let (before, after) = (simulation.now().as_micros(), other.now().as_micros());
            let mut clock = self.clock();
            clock.ahead = clock.ahead.saturating_add_unsigned(before).saturating_sub_unsigned(after);
            clock.restores = clock.restores.saturating_add(1);
            let is_paced = simulation.is_paced();
            *simulation = other;
            simulation.set_paced(is_paced);
        });
    }

    /// The number of calls of [`Self::restore`].
    #[must_use]
    pub fn restores(&self) -> u64 {
        self.clock().restores
    }

    fn clock(&self) -> MutexGuard<'_, HostClock> {
        self.clock.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The time of the host line since the start.
    fn elapsed(&self) -> Duration {
        self.with(|simulation| self.clock().at(simulation.now()))
    }

    fn check_plug(&self) -> Result<(), PortError> {
        let elapsed = self.elapsed();
        let is_unplugged = self.clock().unplugged.is_some_and(|time| elapsed >= time);
        if is_unplugged { Err(PortError::Lost(ErrorKind::BrokenPipe)) } else { Ok(()) }
    }

    /// Calls `work` with the simulation. No time passes for the arm, unless `work` advances it.
    pub fn with<T>(&self, work: impl FnOnce(&mut Simulation) -> T) -> T {
        // After a panic in `work` the simulation can go on, so a poisoned lock is no error.
        work(&mut self.simulation.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The host's end of the simulation's line.
    #[must_use]
    pub fn line(&self) -> SimulatedLine {
        SimulatedLine { simulation: self.clone(), start: Instant::now() }
    }
}

/// The host's end of the line of a simulated arm.
#[derive(Clone, Debug)]
pub struct SimulatedLine {
    simulation: SharedSimulation,
    /// The time of the line's clock at virtual time 0.
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
            simulation.advance_until(timeout.into(), |simulation| !simulation.received().is_empty());
            simulation.take_received()
        }))
    }

    fn now(&self) -> Instant {
        self.start + self.simulation.elapsed()
    }

    fn sleep(&mut self, duration: Duration) {
        self.simulation.with(|simulation| simulation.advance(duration.into()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Angle, Joint};

    #[test]
    fn the_clock_of_the_line_goes_on_when_the_arm_is_restored() {
        let shared = SharedSimulation::new(Simulation::new(SimulationConfig::default()));
        let mut line = shared.line();
        let (start, before) = (line.now(), shared.with(|simulation| simulation.clone()));
        line.sleep(Duration::from_secs(10));
        let later = shared.with(|simulation| simulation.clone());
        shared.unplug(Duration::from_secs(1));
        shared.restore(before);
        assert_eq!(line.now() - start, Duration::from_secs(10));
        line.sleep(Duration::from_secs(1));
        assert_eq!(line.now() - start, Duration::from_secs(11));
        assert_eq!(line.send(&[0]), Err(PortError::Lost(ErrorKind::BrokenPipe)), "a second after the order");
        shared.restore(later);
        assert_eq!(line.now() - start, Duration::from_secs(11), "also forward");
    }

    #[test]
    fn the_arm_moves_at_its_speed_in_the_time_of_the_computer() {
        let start = Instant::now();
        let mut arm =
            Arm::over(Box::new(RealTimeLine::new(1)), "sim", ArmOptions::default()).expect("an arm");
        let base = Joint::ALL[0];
        arm.set_target(base, Angle::from_degrees(100).expect("an angle")).expect("taken");
        while arm.positions().expect("positions")[0].degrees() < 100 {}
        // 10 degrees at the default speed of 114 degrees/s take 88 ms.
        assert!(start.elapsed() > Duration::from_millis(85), "{:?}", start.elapsed());
    }

    /// A third of a second is no whole number of microseconds.
    #[test]
    fn a_wait_in_slices_of_what_is_left_ends() {
        let mut line = SharedSimulation::new(Simulation::new(SimulationConfig::default())).line();
        let end = line.now() + Duration::from_secs(1) / 3;
        for _ in 0..2 {
            line.sleep(end.saturating_duration_since(line.now()));
        }
        assert!(line.now() >= end);
    }
}
