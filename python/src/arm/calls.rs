//! Calls of several methods of `Arm`.

use std::sync::{Arc, Mutex};

use pyo3::prelude::*;
use sevenbot::approach::ApproachRule;
use sevenbot::cartesian::{Guard, TipTarget};
use sevenbot::fine::FineTargets;
use sevenbot::moves::{GuardedMoveError, Pace, TipMove};
use sevenbot::simulated::SharedSimulation;

use super::{Angles, Arm};
use crate::errors::{raised, warn_of};
use crate::motion::{self, PlayOptions, RecordOptions, TipWish};
use crate::recording::Recording;
use crate::worker::{Worker, lock};

impl Arm {
    pub(super) fn of(arm: sevenbot::Arm, simulation: Option<SharedSimulation>) -> Self {
        let (port, map) = (arm.port().to_owned(), arm.map().version());
        let (firmware, chip) = (arm.identity().version(), arm.identity().chip_name());
        Self {
            worker: Arc::new(Worker::start(arm)),
            simulation,
            sent: Mutex::new(None),
            port,
            firmware,
            chip,
            map,
        }
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

    /// Starts a move of the tip, if the guard allows the way, and waits for it.
    pub(super) fn go_to_tip(
        &self,
        py: Python<'_>,
        wish: TipWish,
        target: TipTarget,
        pace: Pace,
        wait: bool,
    ) -> PyResult<Option<Angles>> {
        let work = move |arm: &mut _, _: &mut _| -> Result<FineTargets, GuardedMoveError> {
            let targets = TipMove::of(arm, &target, wish.tip, wish.tool)?.targets;
            wish.guard.map_or(Ok(()), |guard| arm.check_way(&targets, pace, &guard))?;
            Ok(targets)
        };
        let targets = raised(py, self.worker.call(py, work)?)?;
        self.go(py, targets, pace, wait)
    }

    /// Warns if the guard would not allow the way of the joints to these targets.
    pub(super) fn warn_of_way(
        &self,
        py: Python<'_>,
        targets: FineTargets,
        pace: Pace,
        guard: Option<Guard>,
    ) -> PyResult<()> {
        let Some(guard) = guard else { return Ok(()) };
        let work = move |arm: &mut _, _: &mut _| motion::breach_on_way(arm, &targets, pace, &guard);
        let breach = raised(py, self.worker.call(py, work)?)?;
        breach.map_or(Ok(()), |breach| warn_of(py, &breach))
    }

    /// Plans a straight line, and plays it.
    pub(super) fn move_straight(&self, py: Python<'_>, wish: TipWish) -> PyResult<Angles> {
        let work = move |arm: &mut _, _: &mut _| motion::straight_line(arm, wish);
        let line = raised(py, self.worker.call(py, work)?)?;
        // It begins at the targets of the arm.
        let options = PlayOptions { factor: 1.0, times: 1, approach: ApproachRule::Slowly };
        self.play_moments(py, line, options)?;
        self.angles(py)
    }

    /// Records until the time is over, or a signal of Python ends a recording without a limit.
    pub(super) fn record_moments(&self, py: Python<'_>, options: RecordOptions) -> PyResult<Recording> {
        let work = move |arm: &mut _, watch: &mut _| motion::record(arm, options, watch);
        let (recorded, signal) = self.worker.call_until_signal(py, work)?;
        match signal.filter(|_| options.limit.is_some()) {
            Some(signal) => Err(signal),
            None => Recording::parse(py, &raised(py, recorded)?),
        }
    }

    /// Makes a moving arm hold, and closes the port.
    pub(super) fn hold_and_close(&self, py: Python<'_>) -> PyResult<()> {
        if !self.worker.is_open() {
            return Ok(());
        }
        let held = self.worker.call(py, |arm, _| motion::hold_if_moving(arm));
        self.worker.close(py);
        held.and_then(|held| raised(py, held))
    }

    /// Plays a recording, and returns the measured one.
    pub(super) fn play_moments(
        &self,
        py: Python<'_>,
        moments: sevenbot::recording::Recording,
        options: PlayOptions,
    ) -> PyResult<Recording> {
        let work = move |arm: &mut _, watch: &mut _| motion::play(arm, &moments, options, watch);
        let measured = raised(py, self.worker.call(py, work)?)?;
        Recording::parse(py, &measured)
    }
}
