//! `Arm`: a real arm or a simulated one.

use std::sync::{Arc, Mutex};

use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
use sevenbot::cartesian::{DOWN, TipTarget, Vector};
use sevenbot::moves::JointMove;
use sevenbot::simulated::{self, SharedSimulation, SimulationConfig};

use crate::arguments::{self, Goals, options, pace};
use crate::errors::{not_opened, raised, warn_of};
use crate::motion::{self, PlayOptions, RecordOptions, TipWish};
use crate::recording::Recording;
use crate::registers::{self, Registers, Shown, Values};
use crate::simulation::{Simulation, duration};
use crate::status::Status;
use crate::stream::Stream;
use crate::tip::Tip;
use crate::worker::{Worker, lock};
use crate::{bulk, ports};

mod calls;

/// Seven angles.
type Angles = (f64, f64, f64, f64, f64, f64, f64);

/// A 7Bot V2 arm.
///
/// `Arm("/dev/ttyUSB0")` opens a port, `Arm()` the only port with an arm that answers, and `Arm.simulated()` an arm in
/// virtual time. All have the same methods. `with Arm() as arm:` stops what moves at the end, as `stop()`, and closes the port.
///
/// Angles are degrees, 0 to 180, joint 1 first; positions millimetres; times seconds.
#[pyclass(frozen, module = "sevenbot")]
pub(crate) struct Arm {
    worker: Arc<Worker>,
    simulation: Option<SharedSimulation>,
    /// The move that `wait` waits for.
    sent: Mutex<Option<Arc<JointMove>>>,
    port: String,
    firmware: String,
    chip: String,
    map: &'static str,
}

#[pymethods]
impl Arm {
    #[new]
    #[pyo3(signature = (port = None, *, baud = 115_200, timeout = 0.5, attempts = 3, map = None))]
    fn new(
        py: Python<'_>,
        port: Option<String>,
        baud: u32,
        timeout: f64,
        attempts: u32,
        map: Option<&str>,
    ) -> PyResult<Self> {
        let options = options(baud, timeout, attempts, map)?;
        let port = port.map_or_else(|| ports::only_one(py, baud), Ok)?;
        let opened = py.detach(|| sevenbot::Arm::open_with(&port, options));
        let arm = opened.map_err(|why| not_opened(py, &port, &why))?;
        Ok(Self::of(arm, None))
    }

    /// An arm in virtual time. The same calls give the same values on every machine.
    ///
    /// `seed` determines the random faults of the host line, 0 to 2**64 - 1. `attempts` and `timeout` are as for a port.
    #[classmethod]
    #[pyo3(signature = (seed = 1, *, timeout = 0.5, attempts = 3, map = None))]
    fn simulated(
        _: &Bound<'_, PyType>,
        py: Python<'_>,
        seed: u64,
        timeout: f64,
        attempts: u32,
        map: Option<&str>,
    ) -> PyResult<Self> {
        let options = options(115_200, timeout, attempts, map)?;
        let opened = py.detach(|| simulated::arm_with(SimulationConfig::default(), options));
        let (arm, simulation) = opened.map_err(|why| not_opened(py, "simulated", &why))?;
        simulation.with(|simulation| simulation.set_seed(seed));
        Ok(Self::of(arm, Some(simulation)))
    }

    /// The simulation behind this arm; `None` for a real one.
    #[getter]
    fn simulation(&self) -> Option<Simulation> {
        self.simulation.clone().map(Simulation::of)
    }

    /// The name of the port.
    #[getter]
    fn port(&self) -> &str {
        &self.port
    }

    /// The firmware's version, such as `"3.0"`.
    #[getter]
    fn firmware(&self) -> &str {
        &self.firmware
    }

    /// The chip's unique number, twelve hexadecimal digits.
    #[getter]
    fn chip_id(&self) -> &str {
        &self.chip
    }

    /// The register map of the frames, `"2.1"` or `"2.2"`. Names and addresses are those of map 2.2 with both.
    #[getter]
    fn map(&self) -> &str {
        self.map
    }

    /// The registers as a mapping: `arm.registers["speed.1"] = 10`.
    #[getter]
    fn registers(&self) -> Registers {
        Registers::of(Arc::clone(&self.worker))
    }

    /// The value of a register, or a list if the name has several: `arm.get("offset")`.
    ///
    /// Numbers are in the units of docs/registers.md. An unknown name raises `KeyError`.
    fn get(&self, py: Python<'_>, name: &str) -> PyResult<Shown> {
        registers::get(py, &self.worker, name)
    }

    /// Writes a register, or several with one number for all or one each, and reads them back.
    ///
    /// Raises `ValueError` for a number out of range, and `NotTaken` if the arm does not take it. `unlock=True` opens the
    /// EEPROM lock (register 28) for this write. A target of a driven joint is a move: `ArmProblem` is raised if the joint does
    /// not answer or has let go, and nothing is written. Motor state 1 is watched for half a second as `stop()`. A motor state
    /// without torque warns of servos that do not answer.
    #[pyo3(signature = (name, values, *, unlock = false))]
    fn set(&self, py: Python<'_>, name: &str, values: Values, unlock: bool) -> PyResult<()> {
        registers::set(py, &self.worker, name, &values, unlock)
    }

    /// The measured angles in degrees, joint 1 first: in steps of 0.01 with this project's firmware, else of 1.
    ///
    /// Raises `ArmProblem` if a servo does not answer, because its angle is unknown then; `status()` has the others.
    #[getter]
    fn angles(&self, py: Python<'_>) -> PyResult<Angles> {
        let read = self.worker.call(py, |arm, _| motion::known_angles(arm))?;
        Ok(raised(py, read)?.into())
    }

    /// Where the arm is: tip, tool and wrist in millimetres, and the angles. Raises `ArmProblem` as `angles` does.
    #[pyo3(name = "where")]
    fn where_(&self, py: Python<'_>) -> PyResult<Tip> {
        let read = self.worker.call(py, |arm, _| {
            arm.wait_until_settled()?;
            motion::known_angles(arm)
        })?;
        raised(py, read).map(Tip::at)
    }

    /// Moves joints: `arm.pose(120, 90, 65.25, None, None, None, 80)`, or one list of seven.
    ///
    /// Angles are 0 to 180 degrees in steps of 0.01; `None` leaves a joint. `speed` is 1.9 to 190 degrees per second in
    /// steps of 1.9, rounded down; or `duration` 0.1 to 10 seconds. Both stay set for later moves. Waits until the joints
    /// have arrived and returns the measured angles; with `wait=False` returns `None` at once. Raises `ArmProblem` if a joint of the
    /// move is blocked, let go or silent, the servos have no supply, or the controller restarted.
    ///
    /// Warns with `GuardWarning` if the way leads below the table or into the base: see `move_to`.
    #[pyo3(signature = (*angles, speed = None, duration = None, wait = true, table = None, guard = true))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn pose(
        &self,
        py: Python<'_>,
        angles: &Bound<'_, PyTuple>,
        speed: Option<f64>,
        duration: Option<f64>,
        wait: bool,
        table: Option<f64>,
        guard: bool,
    ) -> PyResult<Option<Angles>> {
        let (targets, pace) = (Goals::of(angles)?.targets()?, pace(speed, duration)?);
        self.warn_of_way(py, targets, pace, arguments::guard(table, guard)?)?;
        self.go(py, targets, pace, wait)
    }

    /// Moves the tip to x, y, z in millimetres, with the tool in a direction of any length, by default straight down.
    ///
    /// `speed` and `duration` are those of `pose`. With `straight` the tip moves on a straight line, from its present
    /// targets, with `speed` in millimetres per second (default 50). Raises `OutOfReach` with the nearest point within
    /// reach; then nothing moves.
    ///
    /// The guard keeps the arm above a table at the height `table` in millimetres, by default the foot of the base (-60),
    /// and 10 mm away from the base, also on the way. It knows no suction cup and no claw: raise the table by its length.
    /// Raises `OutsideGuard` with the nearest allowed point; then nothing moves. `guard=False` checks none of this.
    #[pyo3(signature = (x, y, z, *, tool = None, speed = None, duration = None, wait = true, straight = false,
                        table = None, guard = true))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn move_to(
        &self,
        py: Python<'_>,
        x: f64,
        y: f64,
        z: f64,
        tool: Option<(f64, f64, f64)>,
        speed: Option<f64>,
        duration: Option<f64>,
        wait: bool,
        straight: bool,
        table: Option<f64>,
        guard: bool,
    ) -> PyResult<Option<Angles>> {
        let tip = Vector::new(x, y, z);
        let tool = tool.map_or(DOWN, |(x, y, z)| Vector::new(x, y, z));
        let guard = arguments::guard(table, guard)?;
        let wish = TipWish { tip, tool, speed, guard };
        let target = raised(py, TipTarget::guarded(tip, tool, guard.as_ref()))?;
        if straight {
            return self.move_straight(py, wish).map(Some);
        }
        self.go_to_tip(py, wish, target, pace(speed, duration)?, wait)
    }

    /// Waits until the joints of the last move have arrived, and returns the measured angles.
    ///
    /// Raises `NotReached` if a joint does not arrive. Ctrl-C makes the arm hold.
    fn wait(&self, py: Python<'_>) -> PyResult<Option<Angles>> {
        let Some(sent) = lock(&self.sent).take() else { return Ok(None) };
        let finished = self.worker.call(py, move |arm, watch| motion::finish(arm, &sent, watch))?;
        Ok(Some(raised(py, finished)?.into()))
    }

    /// Waits this many seconds, 0 to 86400, on the clock of the arm: virtual time for a simulated one.
    fn sleep(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let time = duration(seconds)?;
        let slept = self.worker.call(py, move |arm, watch| motion::sleep(arm, time, watch))?;
        raised(py, slept)
    }

    /// Makes every joint hold its position, and watches for half a second whether it does. Ends a move of another thread.
    ///
    /// Returns the targets in degrees. If the motors are off, writes nothing. Raises `ArmProblem` if a joint is silent or has let
    /// go, the servos have no supply, or the controller restarted; the other joints hold. Raises `MayMove` if the arm does not
    /// answer.
    fn stop(&self, py: Python<'_>) -> PyResult<Vec<u16>> {
        self.worker.interrupt();
        lock(&self.sent).take();
        let held = self.worker.call(py, |arm, _| arm.hold_and_watch())?;
        raised(py, held).map(|joints| joints.targets().map(u16::from).to_vec())
    }

    /// The health of the arm: each joint, alarms, supply, and what needs attention. `None` if the firmware does not tell, as
    /// the maker's.
    fn status(&self, py: Python<'_>) -> PyResult<Option<Status>> {
        let read = self.worker.call(py, |arm, _| Status::read(arm))?;
        raised(py, read)
    }

    /// Moves slowly to a pose in which the arm may be let go, switches the motors to damping, and checks for two seconds that the
    /// arm stays. Returns the measured angles.
    ///
    /// Without angles it is the pose that was kept for this arm, or the standard park pose, which is right for an empty gripper:
    /// rear arm upright, forearm folded up. `keep=True` keeps the given angles for this arm. If a joint sinks by more than 2 degrees,
    /// the arm holds again, and `NotReached` is raised. `arm.set("motor-state", 1)` makes a parked arm hold.
    #[pyo3(signature = (*angles, keep = false))]
    fn park(&self, py: Python<'_>, angles: &Bound<'_, PyTuple>, keep: bool) -> PyResult<Angles> {
        let pose = if angles.is_empty() { None } else { Some(Goals::of(angles)?.targets()?) };
        if keep && pose.is_none() {
            return Err(PyValueError::new_err("keep=True needs seven angles"));
        }
        let parked = self.worker.call(py, move |arm, watch| motion::park(arm, pose, keep, watch))?;
        Ok(raised(py, parked)?.map_err(|error| PyOSError::new_err(error.to_string()))?.into())
    }

    /// A stream of set-points, one each `period` seconds, 0.005 to 1: a context manager.
    ///
    /// If the program sends nothing for `watchdog` seconds, 0.01 to 2.55 or 0 for never, the arm holds; with `damping` it
    /// sinks slowly. Needs this project's firmware, or raises `NotServed`. `approach`: seconds to go smoothly to the first
    /// point, 0.1 to 60; without it a point further than 5 degrees raises `TooFar`. `table` and `guard`: see `pose`.
    #[pyo3(signature = (period = 0.02, *, watchdog = 0.3, damping = false, approach = None, table = None,
                        guard = true))]
    fn stream(
        &self,
        period: f64,
        watchdog: f64,
        damping: bool,
        approach: Option<f64>,
        table: Option<f64>,
        guard: bool,
    ) -> PyResult<Stream> {
        let (rule, guard) = (arguments::approach(approach)?, arguments::guard(table, guard)?);
        Stream::new(Arc::clone(&self.worker), period, (watchdog, damping), rule, guard)
    }

    /// Records the positions for `seconds`, 0 to 86400, or until Ctrl-C, `hz` times a second, 1 to 50.
    ///
    /// With `guided` the motors go off, so that you can guide the arm by hand: it falls unless you hold it. At the end it
    /// holds where it is.
    #[pyo3(signature = (seconds = None, *, hz = 30, guided = false))]
    fn record(&self, py: Python<'_>, seconds: Option<f64>, hz: u8, guided: bool) -> PyResult<Recording> {
        if !(1..=50).contains(&hz) {
            return Err(PyValueError::new_err("use 1 to 50 moments per second"));
        }
        let limit = seconds.map(duration).transpose()?;
        self.record_moments(py, RecordOptions { limit, hz, is_guided: guided })
    }

    /// Plays a recording, `speed` times as fast (0.1 to 10), `times` times, and returns the measured positions of the
    /// first run.
    ///
    /// The whole recording is checked before the arm moves. Ctrl-C makes it hold. `approach`: seconds to go smoothly to the
    /// first pose, 0.1 to 60, also between the runs; without it a pose further than 5 degrees raises `TooFar`.
    ///
    /// Warns with `GuardWarning` if the recording leads below the table or into the base: see `move_to`.
    #[pyo3(signature = (recording, *, speed = 1.0, times = 1, approach = None, table = None, guard = true))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn play(
        &self,
        py: Python<'_>,
        recording: &Recording,
        speed: f64,
        times: u32,
        approach: Option<f64>,
        table: Option<f64>,
        guard: bool,
    ) -> PyResult<Recording> {
        if !(0.1..=10.0).contains(&speed) || times == 0 {
            return Err(PyValueError::new_err("use a speed of 0.1 to 10, and at least one time"));
        }
        raised(py, recording.moments().check_speeds(speed))?;
        let guard = arguments::guard(table, guard)?;
        if let Some(breach) = guard.and_then(|guard| guard.check_recording(recording.moments()).err()) {
            warn_of(py, &breach)?;
        }
        let options = PlayOptions { factor: speed, times, approach: arguments::approach(approach)? };
        self.play_moments(py, recording.moments().clone(), options)
    }

    /// Reads all positions `count` times, one read after the other, or one each `period` seconds.
    ///
    /// Raises `ArmProblem` if a servo does not answer meanwhile, or the controller restarts.
    ///
    /// Returns times in seconds and angles in degrees: numpy arrays of shape (n,) and (n, 7) if numpy is installed. Python
    /// threads run meanwhile, and do not delay the reads.
    #[pyo3(signature = (count, *, period = 0.0))]
    fn sample<'py>(
        &self,
        py: Python<'py>,
        count: u32,
        period: f64,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let period = duration(period)?;
        let work = move |arm: &mut _, watch: &mut _| motion::sample(arm, count, period, watch);
        let (times, rows) = raised(py, self.worker.call(py, work)?)?;
        Ok((bulk::numbers(py, &times)?, bulk::angles(py, &rows)?))
    }

    /// Closes the port. The arm goes on with its move: `stop()` makes it hold.
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
            // The first failure is the cause of this one.
            Err(_) if failed => Ok(false),
            other => other.map(|()| false),
        }
    }

    fn __repr__(&self) -> String {
        let state = if self.worker.is_open() { "" } else { ", closed" };
        format!("<Arm at {}, firmware {}, map {}{state}>", self.port, self.firmware, self.map)
    }
}
