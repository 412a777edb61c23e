//! How an arm is opened: a port, or an arm in virtual time.

use std::io::ErrorKind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use sevenbot::host_line::HostLine;
use sevenbot::network::open_line_with_token;
use sevenbot::simulated::{SharedSimulation, Simulation, SimulationConfig};
use sevenbot::{ArmOptions, OpenError, PortError};

use crate::errors::not_opened;
use crate::registers::readable_names;
use crate::worker::{SIGNAL_PERIOD, Worker};

/// Facts that are read from an arm when it is opened.
pub(crate) struct ArmFacts {
    pub(crate) port: String,
    pub(crate) firmware: String,
    pub(crate) chip: String,
    pub(crate) map: &'static str,
    /// The names of the registers that can be read.
    pub(crate) names: Arc<[String]>,
}

impl ArmFacts {
    fn of(arm: &mut sevenbot::Arm) -> Self {
        Self {
            port: arm.port().to_owned(),
            firmware: arm.identity().version(),
            chip: arm.identity().chip_name(),
            map: arm.map().version(),
            names: readable_names(arm).into(),
        }
    }
}

/// Opens a port. A signal of Python ends the opening. `token` is for a server that demands one.
pub(crate) fn port(
    py: Python<'_>,
    port: &str,
    token: Option<String>,
    options: ArmOptions,
) -> PyResult<(Worker, ArmFacts)> {
    let name = port.to_owned();
    let open = move |is_cancelled| {
        let line = open_line_with_token(&name, options.baud, token.as_deref())?;
        let line = CancellableLine { line, is_cancelled };
        sevenbot::Arm::over(Box::new(line), &name, options)
    };
    Worker::start(py, Box::new(open), ArmFacts::of)?.map_err(|why| not_opened(py, port, &why))
}

/// Opens an arm in virtual time.
pub(crate) fn simulated(
    py: Python<'_>,
    seed: u64,
    options: ArmOptions,
) -> PyResult<(Worker, ArmFacts, SharedSimulation)> {
    let simulation = SharedSimulation::new(Simulation::new(SimulationConfig::default()));
    let line = simulation.line();
    let open = move |_| sevenbot::Arm::over(Box::new(line), "simulated", options);
    let opened = Worker::start(py, Box::new(open), ArmFacts::of)?;
    let (worker, opened) = opened.map_err(|why: OpenError| not_opened(py, "simulated", &why))?;
    simulation.with(|simulation| simulation.set_seed(seed));
    Ok((worker, opened, simulation))
}

/// A line whose waits for bytes end early when the opening of the arm was cancelled.
#[derive(Debug)]
struct CancellableLine {
    line: Box<dyn HostLine>,
    is_cancelled: Arc<AtomicBool>,
}

impl HostLine for CancellableLine {
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.line.send(bytes)
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, PortError> {
        let end = self.now() + timeout;
        loop {
            let left = end.saturating_duration_since(self.now());
            let bytes = self.line.receive(left.min(SIGNAL_PERIOD))?;
            if !bytes.is_empty() || left <= SIGNAL_PERIOD {
                return Ok(bytes);
            }
            if self.is_cancelled.load(Ordering::Relaxed) {
                return Err(PortError::Lost(ErrorKind::Interrupted));
            }
        }
    }

    fn now(&self) -> Instant {
        self.line.now()
    }

    fn sleep(&mut self, duration: Duration) {
        self.line.sleep(duration);
    }
}
