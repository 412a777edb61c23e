//! Calls of several methods of `Arm`.

use std::sync::{Arc, Mutex};

use pyo3::prelude::*;
use sevenbot::cartesian::Vector;
use sevenbot::fine::FineTargets;
use sevenbot::moves::Pace;
use sevenbot::simulated::SharedSimulation;

use super::{Angles, Arm};
use crate::errors::raised;
use crate::motion;
use crate::recording::Recording;
use crate::worker::{Worker, lock};

impl Arm {
    pub(super) fn of(arm: sevenbot::Arm, simulation: Option<SharedSimulation>) -> Self {
        let (port, map) = (arm.port().to_owned(), arm.map().version());
        let (firmware, chip) = (arm.identity().version(), arm.identity().chip_name());
        Self { worker: Worker::start(arm), simulation, sent: Mutex::new(None), port, firmware, chip, map }
    }

    pub(crate) const fn worker(&self) -> &Worker {
        &self.worker
    }

    /// Starts a move, and waits for it.
    pub(super) fn go(
        &self,
        py: Python<'_>,
        targets: FineTargets,
        pace: Pace,
        wait: bool,
    ) -> PyResult<Option<Angles>> {
        let sent = self.worker.call(py, move |arm, _| motion::begin(arm, targets, pace))?;
        *lock(&self.sent) = Some(Arc::new(raised(py, sent)?));
        if wait { self.wait(py) } else { Ok(None) }
    }

    /// Plans a straight line, and plays it.
    pub(super) fn move_straight(
        &self,
        py: Python<'_>,
        tip: Vector,
        tool: Vector,
        speed: f64,
    ) -> PyResult<Angles> {
        let work = move |arm: &mut _, _: &mut _| motion::straight_line(arm, tip, tool, speed);
        let line = raised(py, self.worker.call(py, work)?)?;
        self.play_moments(py, line, 1.0, 1)?;
        self.angles(py)
    }

    /// Plays a recording, and returns the measured one.
    pub(super) fn play_moments(
        &self,
        py: Python<'_>,
        moments: sevenbot::recording::Recording,
        speed: f64,
        times: u32,
    ) -> PyResult<Recording> {
        let work = move |arm: &mut _, watch: &mut _| motion::play(arm, &moments, speed, times, watch);
        let measured = raised(py, self.worker.call(py, work)?)?;
        Recording::parse(py, &measured)
    }
}
