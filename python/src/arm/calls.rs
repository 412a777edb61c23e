//! The work of methods of `Arm` that takes more than one step.

use std::sync::{Arc, Mutex};

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use sevenbot::approach::ApproachRule;
use sevenbot::cartesian::{Guard, TipTarget};
use sevenbot::fine::FineTargets;
use sevenbot::moves::{GuardedMoveError, MoveError, Pace, TipMove};

use super::Arm;
use crate::arguments::LinePace;
use crate::errors::{InvalidType, InvalidValue, file_error, raised, warn_of};
use crate::motion::{self, PlayOptions, RecordOptions, RecordedText, TipRequest};
use crate::numbers::PoseDegrees;
use crate::opening::ArmFacts;
use crate::recording::Recording;
use crate::simulation::Simulation;
use crate::watch::Watch;
use crate::worker::{Worker, lock};

impl Arm {
    pub(super) fn of(worker: Worker, facts: ArmFacts, simulation: Option<Simulation>) -> Self {
        Self { worker: Arc::new(worker), simulation, sent: Mutex::new(None), facts }
    }

    /// Starts a move. If `wait`, waits for its end and returns the measured angles; otherwise returns `None`.
    pub(super) fn go(
        &self,
        py: Python<'_>,
        targets: FineTargets,
        pace: Pace,
        wait: bool,
    ) -> PyResult<Option<PoseDegrees>> {
        let sent = self.worker.call(py, move |arm, watch| match watch.is_stopped() {
            true => Err(MoveError::Interrupted),
            false => motion::begin(arm, targets, pace),
        })?;
        *lock(&self.sent) = Some(Arc::new(raised(py, sent)?));
        if wait { self.wait(py) } else { Ok(None) }
    }

    /// Starts a move of the tip, if the guard allows the way. Waits and returns as [`Self::go`] does.
    pub(super) fn go_to_tip(
        &self,
        py: Python<'_>,
        request: TipRequest,
        target: TipTarget,
        pace: Pace,
        wait: bool,
    ) -> PyResult<Option<PoseDegrees>> {
        let planned = self.worker.call(py, move |arm, _| -> Result<FineTargets, GuardedMoveError> {
            let targets = TipMove::of(arm, &target, request.tip, request.tool)?.targets;
            request.guard.map_or(Ok(()), |guard| arm.check_way(&targets, pace, &guard))?;
            Ok(targets)
        })?;
        let targets = raised(py, planned)?;
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
        let breach =
            self.worker.call(py, move |arm, _| motion::breach_on_way(arm, &targets, pace, &guard))?;
        let breach = raised(py, breach)?;
        breach.map_or(Ok(()), |breach| warn_of(py, &breach))
    }

    /// Plans a straight line, plays it, and returns the measured angles. Fails if `wait` is false.
    pub(super) fn move_straight(
        &self,
        py: Python<'_>,
        request: TipRequest,
        pace: LinePace,
        wait: bool,
    ) -> PyResult<PoseDegrees> {
        if !wait {
            let message = "straight=True needs wait=True: this program leads the tip until it is there";
            return Err(InvalidType::raise(py, message));
        }
        raised(py, TipTarget::guarded(request.tip, request.tool, request.guard.as_ref()))?;
        let line = self.worker.call(py, move |arm, _| motion::straight_line(arm, request, pace))?;
        // The line begins at the targets of the arm.
        let options = PlayOptions { factor: 1.0, times: 1, approach: ApproachRule::Slowly };
        self.play_moments(py, raised(py, line)?, options)?;
        self.angles(py)
    }

    /// Parks the arm. With `keep`, also saves `pose` as the park pose of this arm.
    pub(super) fn park_at(
        &self,
        py: Python<'_>,
        pose: Option<FineTargets>,
        keep: bool,
    ) -> PyResult<PoseDegrees> {
        let parked = self.worker.call(py, move |arm, watch| motion::park(arm, pose, keep, watch))?;
        let path = sevenbot::park_poses::path().unwrap_or_else(|| "park-poses".into());
        Ok(raised(py, parked)?.map_err(|why| file_error(py, &path, &why))?.into())
    }

    /// Records until the time is over, or Ctrl-C ends a recording without a limit. Any other failure has the moments that were
    /// recorded before it in its attribute `recording`.
    pub(super) fn record_moments(&self, py: Python<'_>, options: RecordOptions) -> PyResult<Recording> {
        let work = move |arm: &mut sevenbot::Arm, watch: &mut Watch<'_>| motion::record(arm, options, watch);
        let ((RecordedText { text, arrivals }, outcome), signal) = self.worker.call_until_signal(py, work)?;
        let ends_it =
            |signal: &PyErr| options.limit.is_none() && signal.is_instance_of::<PyKeyboardInterrupt>(py);
        let failure = signal.filter(|signal| !ends_it(signal)).or(raised(py, outcome).err());
        let has_moments = !arrivals.is_empty();
        let recording = || Recording::of_text(py, &text).map(|recording| recording.with_arrivals(arrivals));
        match failure {
            None => recording(),
            Some(failure) if !has_moments => Err(failure),
            Some(failure) => {
                failure.value(py).setattr("recording", recording()?)?;
                Err(failure)
            }
        }
    }

    /// Interrupts calls of other threads, makes a moving arm hold, and closes the port. Does nothing if the port is closed.
    pub(super) fn hold_and_close(&self, py: Python<'_>) -> PyResult<()> {
        if !self.worker.is_open() {
            return Ok(());
        }
        // Ends calls of other threads. Otherwise this call would wait for them.
        self.worker.interrupt();
        let held = self.worker.call(py, |arm, _| motion::hold_if_moving(arm));
        self.worker.close(py);
        held.and_then(|held| raised(py, held))
    }

    /// Checks the speeds of a recording, warns if it leaves the guard, and plays it. Returns the recording of the measured
    /// positions.
    pub(super) fn play_guarded(
        &self,
        py: Python<'_>,
        moments: &sevenbot::recording::Recording,
        options: PlayOptions,
        guard: Option<Guard>,
    ) -> PyResult<Recording> {
        if !(0.1..=10.0).contains(&options.factor) {
            return Err(InvalidValue::raise(py, "use a speed of 0.1 to 10 times that of the recording"));
        }
        raised(py, moments.check_speeds(options.factor))?;
        if let Some(breach) = guard.and_then(|guard| guard.check_recording(moments).err()) {
            warn_of(py, &breach)?;
        }
        self.play_moments(py, moments.clone(), options)
    }

    /// Plays a recording. Returns the recording of the measured positions.
    pub(super) fn play_moments(
        &self,
        py: Python<'_>,
        moments: sevenbot::recording::Recording,
        options: PlayOptions,
    ) -> PyResult<Recording> {
        let played = self.worker.call(py, move |arm, watch| motion::play(arm, &moments, options, watch))?;
        Recording::of_text(py, &raised(py, played)?)
    }
}
