//! `Arm`: a real arm or a simulated one.

use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
use sevenbot::cartesian::{TipTarget, Vector};
use sevenbot::map::motor_state;
use sevenbot::moves::JointMove;

use crate::arguments::{self, OpenArguments, PortName, PoseGoals, ToolDirection, pace, whole};
use crate::bulk;
use crate::errors::{InvalidType, NotServed, raised, without_attribute};
use crate::motion::{self, PlayOptions, RecordOptions, TipRequest};
use crate::numbers::{PoseDegrees, Values, duration, seed};
use crate::observation::{JointReadings, Observation, monotonic};
use crate::opening::{self, ArmFacts};
use crate::ports::{self, Wanted};
use crate::recording::Recording;
use crate::registers::{self, Registers, Shown};
use crate::simulation::Simulation;
use crate::status::Status;
use crate::stream::Stream;
use crate::tip::Tip;
use crate::worker::{Worker, lock};

mod calls;

/// A 7Bot V2 arm.
///
/// `Arm("/dev/ttyUSB0")` opens a port, `Arm("tcp://HOST:PORT", token="...")` connects to a server, `Arm()` opens the only port with
/// an arm that answers, `Arm(id=5)` the port of the arm with this number (register 11), `Arm(chip="...")` that of the arm with this `chip_id`,
/// and `Arm.simulated()` is an arm in virtual time. All have the same methods. `with Arm() as arm:` stops what moves at the
/// end, as `stop()`, and closes the port.
///
/// Angles are degrees, 0 to 180, joint 1 first; positions millimetres; times seconds.
#[pyclass(frozen, subclass, module = "sevenbot")]
pub(crate) struct Arm {
    worker: Arc<Worker>,
    simulation: Option<Simulation>,
    /// The move that `wait` waits for.
    sent: Mutex<Option<Arc<JointMove>>>,
    facts: ArmFacts,
}

#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
#[pymethods]
impl Arm {
    #[new]
    #[pyo3(signature = (port = None, *, id = None, chip = None, token = None, baud = 115_200, timeout = 0.5, attempts = 3, map = None))]
    fn new(
        py: Python<'_>,
        port: Option<PortName>,
        id: Option<i64>,
        chip: Option<&str>,
        token: Option<String>,
        baud: i64,
        timeout: f64,
        attempts: i64,
        map: Option<&str>,
    ) -> PyResult<Self> {
        let options = OpenArguments { baud, timeout, attempts, map }.options(py)?;
        let wanted = Wanted::of(py, id, chip)?;
        let port = wanted.port(py, port, options.baud)?;
        let token = ports::token(py, &port, token)?;
        opening::port(py, &port, token, options).map(|(worker, facts)| Self::of(worker, facts, None))
    }

    /// An arm in virtual time. The same calls give the same values on every machine.
    ///
    /// `seed` determines the random faults of the host line, 0 to 2**64 - 1. `attempts` and `timeout` are as for a port.
    #[classmethod]
    #[pyo3(signature = (seed = None, *, timeout = 0.5, attempts = 3, map = None), text_signature = "(seed=1, *, timeout=0.5, attempts=3, map=None)")]
    fn simulated(
        _: &Bound<'_, PyType>,
        py: Python<'_>,
        seed: Option<&Bound<'_, PyAny>>,
        timeout: f64,
        attempts: i64,
        map: Option<&str>,
    ) -> PyResult<Py<SimulatedArm>> {
        let options = OpenArguments { baud: 115_200, timeout, attempts, map }.options(py)?;
        let seed = seed.map_or(Ok(1), self::seed)?;
        let (worker, facts, simulation) = opening::simulated(py, seed, options)?;
        let simulation = Simulation::of(simulation);
        SimulatedArm::of(py, Self::of(worker, facts, Some(simulation.clone())), simulation)
    }

    /// The simulation behind this arm; `None` for a real one.
    #[getter]
    fn simulation(&self) -> Option<Simulation> {
        self.simulation.clone()
    }

    /// The name of the port.
    #[getter]
    fn port(&self) -> &str {
        &self.facts.port
    }

    /// The firmware's version, such as `"3.0"`.
    #[getter]
    fn firmware(&self) -> &str {
        &self.facts.firmware
    }

    /// The chip's unique number, twelve hexadecimal digits.
    #[getter]
    fn chip_id(&self) -> &str {
        &self.facts.chip
    }

    /// The register map of the frames, `"2.1"` or `"2.2"`. Names and addresses are those of map 2.2 with both.
    #[getter]
    fn map(&self) -> &str {
        self.facts.map
    }

    /// Whether a long call shows its progress on a terminal. `True` at first.
    #[getter]
    fn progress(&self) -> bool {
        self.worker.progress_switch().load(Ordering::Relaxed)
    }

    #[setter]
    fn set_progress(&self, shown: bool) {
        self.worker.progress_switch().store(shown, Ordering::Relaxed);
    }

    /// The registers as a mapping: `arm.registers["speed.1"] = 10`.
    #[getter]
    fn registers(&self) -> Registers {
        Registers::of(Arc::clone(&self.worker), Arc::clone(&self.facts.names))
    }

    #[doc = include_str!("arm/help/get.txt")]
    fn get(&self, py: Python<'_>, name: &str) -> PyResult<Shown> {
        registers::get(py, &self.worker, name)
    }

    #[doc = include_str!("arm/help/set.txt")]
    #[pyo3(signature = (name, values, *, unlock = false))]
    fn set(&self, py: Python<'_>, name: &str, values: Values, unlock: bool) -> PyResult<()> {
        registers::set(py, &self.worker, name, &values, unlock)
    }

    #[doc = include_str!("arm/help/angles.txt")]
    #[getter]
    fn angles(&self, py: Python<'_>) -> PyResult<PoseDegrees> {
        let read =
            self.worker.read(py, motion::known_angles).map_err(|error| without_attribute(py, error))?;
        Ok(raised(py, read)?.into())
    }

    #[doc = include_str!("arm/help/observe.txt")]
    fn observe(&self, py: Python<'_>) -> PyResult<Observation> {
        let asked = monotonic(py)?;
        let read = raised(py, self.worker.read(py, JointReadings::read)?)?;
        let served =
            read.ok_or_else(|| NotServed::of_arm(py, "positions in hundredths, velocities and loads"));
        served?.observation(py, asked)
    }

    #[doc = include_str!("arm/help/is_connected.txt")]
    #[getter]
    fn is_connected(&self, py: Python<'_>) -> PyResult<bool> {
        self.worker.answers(py)
    }

    #[doc = include_str!("arm/help/torque_on.txt")]
    fn torque_on(&self, py: Python<'_>) -> PyResult<()> {
        registers::set(py, &self.worker, "motor-state", &Values::One(motor_state::SERVO.into()), false)
    }

    #[doc = include_str!("arm/help/torque_off.txt")]
    fn torque_off(&self, py: Python<'_>) -> PyResult<()> {
        registers::set(py, &self.worker, "motor-state", &Values::One(motor_state::FORCELESS.into()), false)
    }

    /// Where the arm is: tip, tool and wrist in millimetres, and the angles. Raises `ArmProblem` as `angles` does.
    #[pyo3(name = "where")]
    fn where_(&self, py: Python<'_>) -> PyResult<Tip> {
        let read = self.worker.read(py, |arm| {
            arm.wait_until_settled()?;
            motion::known_angles(arm)
        })?;
        raised(py, read).map(Tip::at)
    }

    #[doc = include_str!("arm/help/pose.txt")]
    #[pyo3(signature = (*angles, speed = None, duration = None, wait = true, table = None, guard = true))]
    fn pose(
        &self,
        py: Python<'_>,
        angles: &Bound<'_, PyTuple>,
        speed: Option<f64>,
        duration: Option<f64>,
        wait: bool,
        table: Option<f64>,
        guard: bool,
    ) -> PyResult<Option<PoseDegrees>> {
        let (targets, pace) = (PoseGoals::of(angles)?.targets(py)?, pace(py, speed, duration)?);
        self.warn_of_way(py, targets, pace, arguments::guard(py, table, guard)?)?;
        self.go(py, targets, pace, wait)
    }

    #[doc = include_str!("arm/help/move_to.txt")]
    #[pyo3(signature = (x, y, z, *, tool = None, speed = None, duration = None, wait = true, straight = false,
                        table = None, guard = true))]
    fn move_to(
        &self,
        py: Python<'_>,
        x: f64,
        y: f64,
        z: f64,
        tool: Option<ToolDirection>,
        speed: Option<f64>,
        duration: Option<f64>,
        wait: bool,
        straight: bool,
        table: Option<f64>,
        guard: bool,
    ) -> PyResult<Option<PoseDegrees>> {
        let (tip, tool) = (Vector::new(x, y, z), ToolDirection::or_down(tool));
        let guard = arguments::guard(py, table, guard)?;
        if straight {
            let pace = arguments::line_pace(py, speed, duration)?;
            return self.move_straight(py, TipRequest { tip, tool, guard }, pace, wait).map(Some);
        }
        let pace = pace(py, speed, duration)?;
        let target = raised(py, TipTarget::guarded(tip, tool, guard.as_ref()))?;
        self.go_to_tip(py, TipRequest { tip, tool, guard }, target, pace, wait)
    }

    #[doc = include_str!("arm/help/wait.txt")]
    fn wait(&self, py: Python<'_>) -> PyResult<Option<PoseDegrees>> {
        let Some(sent) = lock(&self.sent).take() else { return Ok(None) };
        let finished = self.worker.call(py, move |arm, watch| motion::finish(arm, &sent, watch))?;
        Ok(Some(raised(py, finished)?.into()))
    }

    /// Waits this many seconds, 0 to 86400, on the clock of the arm: virtual time for a simulated one.
    fn sleep(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let time = duration(py, seconds)?;
        raised(py, self.worker.sleep(py, time)?)
    }

    #[doc = include_str!("arm/help/stop.txt")]
    fn stop(&self, py: Python<'_>) -> PyResult<Vec<u16>> {
        self.worker.interrupt();
        lock(&self.sent).take();
        let held = self.worker.call(py, |arm, _| arm.hold_and_watch())?;
        raised(py, held).map(|joints| joints.targets().map(u16::from).to_vec())
    }

    #[doc = include_str!("arm/help/status.txt")]
    fn status(&self, py: Python<'_>) -> PyResult<Option<Status>> {
        let read = self.worker.read(py, Status::read)?;
        raised(py, read)
    }

    #[doc = include_str!("arm/help/park.txt")]
    #[pyo3(signature = (*angles, keep = false))]
    fn park(&self, py: Python<'_>, angles: &Bound<'_, PyTuple>, keep: bool) -> PyResult<PoseDegrees> {
        let pose = if angles.is_empty() { None } else { Some(PoseGoals::of(angles)?.targets(py)?) };
        if keep && pose.is_none() {
            return Err(InvalidType::raise(py, "keep=True needs seven angles"));
        }
        self.park_at(py, pose, keep)
    }

    #[doc = include_str!("arm/help/stream.txt")]
    #[pyo3(signature = (period = 0.02, *, watchdog = 0.3, damping = false, approach = None, table = None,
                        guard = true))]
    fn stream(
        &self,
        py: Python<'_>,
        period: f64,
        watchdog: f64,
        damping: bool,
        approach: Option<f64>,
        table: Option<f64>,
        guard: bool,
    ) -> PyResult<Stream> {
        let (rule, guard) = (arguments::approach(py, approach)?, arguments::guard(py, table, guard)?);
        let options = arguments::stream(py, period, watchdog, damping)?;
        let simulation = self.simulation.as_ref().map(|simulation| simulation.shared_with_line().clone());
        Ok(Stream::new(Arc::clone(&self.worker), options, rule, guard, simulation))
    }

    #[doc = include_str!("arm/help/record.txt")]
    #[pyo3(signature = (seconds = None, *, hz = 30, guided = false))]
    fn record(&self, py: Python<'_>, seconds: Option<f64>, hz: i64, guided: bool) -> PyResult<Recording> {
        let hz = whole(py, "hz", hz, 1, 50)?;
        let limit = seconds.map(|seconds| duration(py, seconds)).transpose()?;
        self.record_moments(py, RecordOptions { limit, hz, is_guided: guided })
    }

    #[doc = include_str!("arm/help/play.txt")]
    #[pyo3(signature = (recording, *, speed = 1.0, times = 1, approach = None, table = None, guard = true))]
    fn play(
        &self,
        py: Python<'_>,
        recording: &Recording,
        speed: f64,
        times: i64,
        approach: Option<f64>,
        table: Option<f64>,
        guard: bool,
    ) -> PyResult<Recording> {
        let times = whole(py, "times", times, 1, i64::from(u32::MAX))?;
        let guard = arguments::guard(py, table, guard)?;
        let options = PlayOptions { factor: speed, times, approach: arguments::approach(py, approach)? };
        self.play_guarded(py, recording.moments(), options, guard)
    }

    #[doc = include_str!("arm/help/sample.txt")]
    #[pyo3(signature = (count, *, period = 0.0))]
    fn sample<'py>(
        &self,
        py: Python<'py>,
        count: i64,
        period: f64,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (count, period) = (whole(py, "count", count, 0, i64::from(u32::MAX))?, duration(py, period)?);
        let sampled = self.worker.call(py, move |arm, watch| motion::sample(arm, count, period, watch))?;
        let (times, rows) = raised(py, sampled)?;
        Ok((bulk::numbers(py, &times)?, bulk::angles(py, &rows)?))
    }

    /// Closes the port. The arm goes on with its move: `stop()` makes it hold. Calls of other threads end as with `stop()`.
    fn close(&self, py: Python<'_>) {
        self.worker.close(py);
    }

    fn __enter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    #[pyo3(signature = (*exception))]
    fn __exit__(&self, py: Python<'_>, exception: &Bound<'_, PyTuple>) -> PyResult<bool> {
        let failed = exception.get_item(0).is_ok_and(|kind| !kind.is_none());
        match self.hold_and_close(py) {
            // Python then raises the exception of the `with` block instead of this failure.
            Err(_) if failed => Ok(false),
            other => other.map(|()| false),
        }
    }

    fn __repr__(&self) -> String {
        let state = if self.worker.is_open() { "" } else { ", closed" };
        let ArmFacts { port, firmware, map, .. } = &self.facts;
        format!("<Arm at {port}, firmware {firmware}, map {map}{state}>")
    }
}

/// An arm in virtual time: an `Arm` that always has its `simulation`.
#[pyclass(frozen, extends = Arm, module = "sevenbot")]
pub(crate) struct SimulatedArm(Simulation);

impl SimulatedArm {
    pub(crate) fn of(py: Python<'_>, arm: Arm, simulation: Simulation) -> PyResult<Py<Self>> {
        Py::new(py, PyClassInitializer::from(arm).add_subclass(Self(simulation)))
    }
}

#[pymethods]
impl SimulatedArm {
    /// The simulation behind this arm.
    #[getter]
    fn simulation(&self) -> Simulation {
        self.0.clone()
    }
}
