//! `Stream`: set-points at a fixed period, in hundredths of a degree.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use sevenbot::FineAngle;
use sevenbot::approach::{Approach, ApproachRule, FirstPoints};
use sevenbot::cartesian::Guard;
use sevenbot::fine::FineTargets;
use sevenbot::moves::{MoveError, Observer};
use sevenbot::simulated::SharedSimulation;
use sevenbot::stream::{StreamError, StreamOptions, StreamPace};

use crate::arguments::PoseGoals;
use crate::errors::{Closed, raised, warn_of};
use crate::latest::LatestSlot;
use crate::stream_counts::StreamCounts;
use crate::watch::{PacedStream, StreamOrder, Watch};
use crate::worker::{Worker, lock};

/// The longest time between two checks whether the watchdog needs a frame before the next point. It is too long for a watchdog of
/// 20 ms or less.
const SLICE: Duration = Duration::from_millis(20);

/// A stream of set-points, a context manager: `with arm.stream(0.02) as stream: stream.send(...)`.
///
/// `send` waits until the next point is due, `latest` does not wait. If the program sends nothing for longer than the watchdog's
/// time, the arm holds. At the end it waits until the joints stand at their last points, and raises `ArmProblem` or `NotReached` if one
/// does not get there. The registers of the stream have their old values again.
#[pyclass(frozen, module = "sevenbot")]
pub(crate) struct Stream {
    worker: Arc<Worker>,
    options: StreamOptions,
    rule: ApproachRule,
    /// `None` without a guard, and after the first warning.
    guard: Mutex<Option<Guard>>,
    /// `None` for a real arm.
    simulation: Option<SharedSimulation>,
    slot: Arc<LatestSlot>,
}

impl Stream {
    pub(crate) fn new(
        worker: Arc<Worker>,
        options: StreamOptions,
        rule: ApproachRule,
        guard: Option<Guard>,
        simulation: Option<SharedSimulation>,
    ) -> Self {
        Self { worker, options, rule, guard: Mutex::new(guard), simulation, slot: Arc::default() }
    }
}

impl Stream {
    fn order(&self) -> StreamOrder {
        StreamOrder {
            options: self.options,
            rule: self.rule,
            slot: Arc::clone(&self.slot),
            simulation: self.simulation.clone(),
        }
    }

    /// Fails if this stream is not open, even if another stream of the arm is.
    fn check_open(&self, py: Python<'_>) -> PyResult<()> {
        if self.slot.is_open() { Ok(()) } else { Err(Closed::raise_no_stream(py)) }
    }

    /// Warns once if the guard would not allow the points of the stream.
    fn warn_of_pose(&self, py: Python<'_>, [t1, t2, t3, t4, t5, ..]: [f64; 7]) -> PyResult<()> {
        let mut guard = lock(&self.guard);
        let breach = guard.and_then(|guard| guard.check_pose([t1, t2, t3, t4, t5]).err());
        *guard = guard.filter(|_| breach.is_none());
        drop(guard);
        breach.map_or(Ok(()), |breach| warn_of(py, &breach))
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        // A forked process lacks the thread, which may have held a lock.
        if !self.worker.is_forked() && self.slot.is_open() {
            self.worker.abandon_stream();
        }
    }
}

impl PacedStream<'_> {
    /// Waits until the joints stand at their last points. After a failure of the whole arm they do not get there: then this
    /// function does not wait for them, and returns only a failure that the program has not received yet.
    fn arrive(&mut self, watch: &mut Watch<'_>) -> Result<(), MoveError> {
        self.finish_leading(watch)?;
        if self.has_failed {
            return self.slot.take_failure().map_or(Ok(()), Err);
        }
        if self.pace.counts().points == 0 && self.points.counts().sent == 0 {
            return Ok(());
        }
        self.stream.wait_until_arrived(|stream, end| stream.wait_until(end, watch))
    }

    /// Begins the stream again after a restore of the simulation and after a failure of the whole arm. The arm may be elsewhere
    /// then, and may have lost the registers of the stream.
    pub(crate) fn begin_again_if_lost(&mut self) -> Result<(), StreamError> {
        let restores = self.simulation.as_ref().map_or(0, SharedSimulation::restores);
        if self.restores != restores || self.has_failed {
            self.stream.begin_again()?;
            (self.restores, self.has_failed, self.first) = (restores, false, FirstPoints::default());
            self.pose = self.stream.arm().standing()?.targets;
            self.pace.restart(self.stream.arm().elapsed());
        }
        Ok(())
    }

    /// Sends a point when it is due. First approaches the first point of a joint. Returns the number of the point, and the last
    /// points of all joints in degrees.
    fn send_when_due(
        &mut self,
        point: &FineTargets,
        watch: &mut Watch<'_>,
    ) -> Result<(u32, [f64; 7]), MoveError> {
        self.points.stop();
        self.begin_again_if_lost()?;
        if let Some(first) = { self.first }.take(point) {
            self.approach(&first, watch)?;
            self.first.take(point);
        }
        loop {
            let left = self.pace.due().saturating_sub(self.elapsed());
            if left.is_zero() {
                break;
            }
            if !watch.goes_on() {
                return Err(MoveError::Interrupted);
            }
            self.stream.arm().sleep(left.min(SLICE));
            self.stream.keep_alive()?;
        }
        let now = self.elapsed();
        let number = self.pace.take(now);
        self.stream.send(point)?;
        self.stream.check()?;
        for (degrees, angle) in self.pose.iter_mut().zip(point) {
            *degrees = angle.map_or(*degrees, FineAngle::degrees);
        }
        Ok((number, self.pose))
    }

    /// Moves joints to their first point, by the rule of the stream. The period of later points begins after this move.
    pub(crate) fn approach(&mut self, first: &FineTargets, watch: &mut Watch<'_>) -> Result<(), MoveError> {
        // Before the end of start-up it is not known where the joints stand.
        self.stream.arm().wait_until_settled()?;
        let way = Approach::plan(&self.stream.arm().standing()?, first, self.rule)?;
        self.stream.approach(&way, watch)?;
        let now = self.stream.arm().elapsed();
        if self.pace.counts().points == 0 {
            self.pace = StreamPace::new(now, self.stream.period());
        } else if !way.duration().is_zero() {
            self.pace.restart(now);
        }
        Ok(())
    }
}

#[pymethods]
impl Stream {
    fn __enter__<'py>(slf: PyRef<'py, Self>) -> PyResult<PyRef<'py, Self>> {
        slf.worker.open_stream(slf.py(), slf.order())?;
        Ok(slf)
    }

    #[pyo3(signature = (*exception))]
    fn __exit__(&self, py: Python<'_>, exception: &Bound<'_, PyTuple>) -> PyResult<bool> {
        self.check_open(py)?;
        let failed = exception.get_item(0).is_ok_and(|kind| !kind.is_none());
        let arrived = if failed {
            // End the approach of a first action, for which no call waits.
            self.worker.interrupt();
            Ok(Ok(()))
        } else {
            self.worker.stream_call(py, |stream, watch| stream.arrive(watch))
        };
        let closed = self.worker.close_stream(py);
        raised(py, arrived?)?;
        closed.map(|()| false)
    }

    /// Sends a point when it is due: seven angles, 0 to 180 degrees in steps of 0.01, `None` for joints without a point.
    ///
    /// Returns the number of the point, which grows by more than one if the program was late. Raises `ArmProblem` if a joint of
    /// the stream is blocked, let go or silent, the servos have no supply, or the controller restarted.
    ///
    /// The first point of a joint has to be within 5 degrees of where it stands, and is approached at up to 30 degrees per
    /// second; else `TooFar` is raised, unless the stream has an `approach`. Then the call takes that time. The first point below
    /// the table or in the base gives a `GuardWarning`. After `Simulation.restore`, and after a failure of the whole arm, such as a
    /// restart, the next point is a first one again.
    fn send(&self, py: Python<'_>, angles: PoseGoals) -> PyResult<u32> {
        let point = angles.targets(py)?;
        self.check_open(py)?;
        let sent = self.worker.stream_call(py, move |open, watch| {
            let sent = open.send_when_due(&point, watch);
            open.note_failure(&sent);
            sent
        })?;
        let (number, pose) = raised(py, sent)?;
        self.warn_of_pose(py, pose)?;
        Ok(number)
    }

    /// Offers an action, and does not wait: seven angles, as for `send`; `None` keeps the joint's angle in the action before.
    ///
    /// A thread outside the interpreter sends the newest action each `period`, and without a new one the last one again. Once
    /// the program has offered nothing for the time of `watchdog`, it sends nothing, so that the watchdog of the arm acts after
    /// the same time again. Returns how the actions became points so far: see `StreamCounts`.
    ///
    /// A failure of the thread is raised by the next call, which then offers nothing. The thread goes on after an `ArmProblem` of a joint.
    /// After all other failures, and after `Arm.stop` (`Interrupted`), it begins again with the next action. This is a first one,
    /// as of `send`, and so is the next one after the watchdog has acted. A simulated arm sends while its time passes: in
    /// `Arm.sleep`, or when the arm is asked. `record`, `sample` and moves hold the sender up.
    fn latest(&self, py: Python<'_>, angles: PoseGoals) -> PyResult<StreamCounts> {
        let action = angles.targets(py)?;
        let told = self.slot.offer(&action).ok_or_else(|| Closed::raise_no_stream(py))?;
        let told = raised(py, told)?;
        self.worker.wake(py)?;
        self.warn_of_pose(py, told.pose)?;
        Ok(told.counts.into())
    }

    /// How the actions of `latest` became points so far.
    #[getter]
    fn counts(&self) -> StreamCounts {
        self.slot.counts().into()
    }

    /// The time between two points in seconds.
    #[getter]
    fn period(&self) -> f64 {
        self.options.period().as_secs_f64()
    }

    fn __repr__(&self) -> String {
        format!("<Stream of a point each {} ms>", self.options.period().as_millis())
    }
}
