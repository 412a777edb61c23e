//! `Simulation`: the arm behind `Arm.simulated()`, its clock, faults and hands.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Mutex;
use std::time::Duration;

use arm_sim::faults::{ArmFault, FaultLocation};
use arm_sim::plant::HEAVIEST_LOAD_G;
use arm_sim::scene::SceneError;
use arm_sim::world::Object;
use motion_core::calibration::{MicroDegrees, counts_from_angle};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sevenbot::Joint;
use sevenbot::simulated::SharedSimulation;

use crate::arguments::{angle, whole};
use crate::errors::{Closed, InvalidValue, without_attribute};
use crate::numbers::{PoseDegrees, duration};
use crate::worker::lock;

/// Virtual time between two checks of Python's signals. It takes some tens of milliseconds of processor time.
const ADVANCE_SLICE: Duration = Duration::from_secs(20);

/// The simulated arm of `Arm.simulated()`.
///
/// Its time is virtual: it passes only while the arm is asked, in `Arm.sleep` and in `advance`. A program may think as long
/// as it likes, and gets the same result on every machine.
#[pyclass(frozen, module = "sevenbot")]
#[derive(Clone)]
pub(crate) struct Simulation {
    shared: SharedSimulation,
    /// The process that made the simulation. A forked process has a copy, whose lock may be held for ever.
    process: u32,
}

/// A simulated arm at one instant: servos, registers, settings and time. Two are equal if all of their state is equal.
///
/// `pickle` keeps it for the same version of this package. As any pickle, load it only if you trust its source.
#[pyclass(frozen, module = "sevenbot")]
pub(crate) struct SimulationSnapshot(Mutex<arm_sim::Simulation>);

impl SimulationSnapshot {
    pub(crate) const fn of(simulation: arm_sim::Simulation) -> Self {
        Self(Mutex::new(simulation))
    }

    /// A copy of the arm.
    pub(crate) fn arm(&self) -> arm_sim::Simulation {
        lock(&self.0).clone()
    }

    fn bytes(&self) -> Vec<u8> {
        lock(&self.0).to_bytes()
    }
}

impl Simulation {
    pub(crate) fn of(shared: SharedSimulation) -> Self {
        Self { shared, process: std::process::id() }
    }

    /// The simulation that the arm and its line share.
    pub(crate) const fn shared_with_line(&self) -> &SharedSimulation {
        &self.shared
    }

    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut arm_sim::Simulation) -> T + Send,
    ) -> PyResult<T> {
        self.shared(py).map(|shared| py.detach(|| shared.with(work)))
    }

    fn shared(&self, py: Python<'_>) -> PyResult<&SharedSimulation> {
        if self.process == std::process::id() { Ok(&self.shared) } else { Err(Closed::raise_forked(py)) }
    }
}

fn joint(py: Python<'_>, number: i64) -> PyResult<Joint> {
    let joint = u8::try_from(number).ok().and_then(Joint::new);
    joint.ok_or_else(|| InvalidValue::raise(py, &format!("joint {number}: use 1 to 7")))
}

pub(crate) fn fault(py: Python<'_>, text: &str) -> PyResult<ArmFault> {
    text.parse().map_err(|why| InvalidValue::raise(py, &format!("{text}: {why}")))
}

/// How long a fault lasts; `None`: until it is taken back.
pub(crate) fn fault_time(py: Python<'_>, seconds: Option<f64>) -> PyResult<Option<arm_sim::Duration>> {
    Ok(seconds.map(|seconds| duration(py, seconds)).transpose()?.map(Into::into))
}

/// Where faults are; `None`: everywhere.
pub(crate) fn fault_location(py: Python<'_>, text: Option<&str>) -> PyResult<Option<FaultLocation>> {
    let parse = |text: &str| text.parse().map_err(|why| InvalidValue::raise(py, &format!("{why}")));
    text.map(parse).transpose()
}

#[pymethods]
impl Simulation {
    /// The virtual time since power-up, in seconds.
    #[getter]
    fn now(&self, py: Python<'_>) -> PyResult<f64> {
        let micros = self.with(py, |simulation| simulation.now().as_micros());
        let micros = micros.map_err(|error| without_attribute(py, error))?;
        Ok(Duration::from_micros(micros).as_secs_f64())
    }

    /// Lets this many seconds pass, 0 to 86400. Ctrl-C ends it early.
    fn advance(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let mut left = duration(py, seconds)?;
        while !left.is_zero() {
            let slice = left.min(ADVANCE_SLICE);
            self.with(py, |simulation| simulation.advance(slice.into()))?;
            left = left.saturating_sub(slice);
            py.check_signals()?;
        }
        Ok(())
    }

    /// Gives the arm a fault, for `seconds` or until `clear`: `"3=missing"`, `"5=late=20"`, `"supply=off"`, `"bus=echo"`.
    /// Also what a joint meets: `"2=wall=60"`, `"2=wall=60/500"` (soft, mN m per degree), `"2=push=-300"` (mN m),
    /// `"7=thing=30"`.
    ///
    /// The words are those of `host-sim --fault`. A wrong word raises `ValueError` with the list.
    #[pyo3(signature = (fault, seconds = None))]
    fn fault(&self, py: Python<'_>, fault: &str, seconds: Option<f64>) -> PyResult<()> {
        let (fault, time) = (self::fault(py, fault)?, fault_time(py, seconds)?);
        self.with(py, |simulation| simulation.set_fault(fault, time)).map(|_| ())
    }

    /// Does something to the arm after this many seconds, 0 to 86400, also during a call: `later(2, "restart")`,
    /// `"fault 3=missing"`, `"fault supply=off 300000"` (for 300,000 microseconds), `"halt"`, `"trip 2"`, `"power-cycle"`.
    ///
    /// The words are those of a session of `host-sim --record`. A wrong word raises `ValueError` with the list.
    fn later(&self, py: Python<'_>, seconds: f64, action: &str) -> PyResult<()> {
        let action: arm_sim::Action =
            action.parse().map_err(|why| InvalidValue::raise(py, &format!("{action}: {why}")))?;
        let time = duration(py, seconds)?.into();
        self.with(py, |simulation| simulation.plan(time, action))
    }

    /// Pulls the cable of the line after this many seconds, 0 to 86400. There is no way to plug it in again.
    #[pyo3(signature = (seconds = 0.0))]
    fn unplug(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let (time, shared) = (duration(py, seconds)?, self.shared(py)?);
        py.detach(|| shared.unplug(time));
        Ok(())
    }

    /// Takes all faults back, or those at one location: `"3"`, `"supply"`, `"line"`.
    ///
    /// Returns how often each took effect, as text.
    #[pyo3(signature = (location = None))]
    fn clear(&self, py: Python<'_>, location: Option<&str>) -> PyResult<Vec<String>> {
        let location = fault_location(py, location)?;
        let ended = self.with(py, |simulation| simulation.end_faults(location))?;
        Ok(ended.iter().map(ToString::to_string).collect())
    }

    /// The present faults, and how often each took effect so far, as text.
    #[getter]
    fn faults(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        Ok(self.with(py, |simulation| simulation.faults())?.iter().map(ToString::to_string).collect())
    }

    /// The true angles of joints 1 to 7 in degrees, without offsets and without noise.
    #[getter]
    fn angles(&self, py: Python<'_>) -> PyResult<PoseDegrees> {
        let angles = self.with(py, |simulation| Joint::ALL.map(|joint| simulation.plant().angle(joint)));
        let angles = angles.map_err(|error| without_attribute(py, error))?;
        Ok(angles.map(|angle| f64::from(angle) / 1_000.0).into())
    }

    /// Turns a joint by hand to an angle of 0 to 180 degrees, and holds it there until it has torque or `let_go`.
    fn move_by_hand(&self, py: Python<'_>, joint: i64, degrees: f64) -> PyResult<()> {
        let joint = self::joint(py, joint)?;
        let angle = angle(py, "", degrees)?;
        let counts = counts_from_angle(joint, MicroDegrees(i32::from(angle.hundredths()) * 10_000), 0);
        self.with(py, |simulation| {
            simulation.plant_mut().move_by_hand(joint, counts);
            simulation.plant_mut().hold(joint);
        })
    }

    /// Lets a hand hold a joint where it is, until it has torque. Has no effect on a joint with torque.
    fn hold_by_hand(&self, py: Python<'_>, joint: i64) -> PyResult<()> {
        let joint = self::joint(py, joint)?;
        self.with(py, |simulation| simulation.plant_mut().hold(joint))
    }

    /// Takes the hand away from a joint: without torque, a loaded joint falls.
    fn let_go(&self, py: Python<'_>, joint: i64) -> PyResult<()> {
        let joint = self::joint(py, joint)?;
        self.with(py, |simulation| simulation.plant_mut().let_go(joint))
    }

    /// The weight in the gripper in grams, 0 to 1000.
    #[getter]
    fn load_grams(&self, py: Python<'_>) -> PyResult<u16> {
        self.with(py, |simulation| simulation.plant().load_grams())
    }

    #[setter]
    fn set_load_grams(&self, py: Python<'_>, grams: i64) -> PyResult<()> {
        let grams = whole(py, "load_grams", grams, 0, i64::from(HEAVIEST_LOAD_G))?;
        self.with(py, |simulation| simulation.plant_mut().set_load(grams))
    }

    /// Drops all that the gripper holds: the thing between the claws, the weight, and an object of the scene.
    fn drop_load(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, |arm| drop(arm.act(arm_sim::Action::Drop)))
    }

    /// What stands on the table, as text: `"cube red 30 40 0 200; cylinder can 40 60 100 -80 200"`. docs/simulation.md describes it.
    /// `None`: there is no table. Setting it puts all things in their places.
    #[getter]
    fn scene(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let scene =
            |arm: &mut arm_sim::Simulation| arm.plant().world().map(|world| world.scene().to_string());
        self.with(py, scene)
    }

    #[setter]
    fn set_scene(&self, py: Python<'_>, scene: Option<&str>) -> PyResult<()> {
        let scene = scene.map(str::parse).transpose();
        let scene = scene.map_err(|error: SceneError| InvalidValue::raise(py, &error.to_string()))?;
        self.with(py, |arm| drop(arm.act(arm_sim::Action::Scene(scene))))
    }

    /// Where the middle of each thing of the scene is, by its name: x, y and z in mm.
    #[getter]
    fn things(&self, py: Python<'_>) -> PyResult<BTreeMap<String, [f64; 3]>> {
        self.with(py, |arm| {
            let place = |object: &Object| {
                let at = object.frame.origin;
                (object.item.name.clone(), [at.x, at.y, at.z])
            };
            arm.plant().objects().iter().map(place).collect()
        })
    }

    /// Forces an alarm on a joint's servo, which switches its motor off: `"overload"`, until its torque is switched off
    /// and on, or `"heat"`, until it has cooled down. An overload has no effect on a joint without torque.
    #[pyo3(signature = (joint, alarm = "overload"))]
    fn trip(&self, py: Python<'_>, joint: i64, alarm: &str) -> PyResult<()> {
        let joint = self::joint(py, joint)?;
        let alarm = match alarm {
            "overload" => arm_sim::servo::Trip::Overload,
            "heat" => arm_sim::servo::Trip::Heat,
            _ => return Err(InvalidValue::raise(py, "alarm must be \"overload\" or \"heat\"")),
        };
        self.with(py, |arm| drop(arm.act(arm_sim::Action::Trip(joint, alarm))))
    }

    /// Switches the arm off and on. The settings stay.
    fn power_cycle(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, |simulation| simulation.power_cycle())
    }

    /// Switches the arm off, until `power_cycle`. Loaded joints fall.
    fn power_off(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, |simulation| simulation.power_off())
    }

    /// A copy of the arm as it is now.
    fn snapshot(&self, py: Python<'_>) -> PyResult<SimulationSnapshot> {
        self.with(py, |simulation| simulation.clone()).map(SimulationSnapshot::of)
    }

    /// Makes the arm as it was at a snapshot, its time included. The clock of its line goes on: sleeps, streams and timeouts are
    /// as long as without it.
    fn restore(&self, py: Python<'_>, snapshot: &SimulationSnapshot) -> PyResult<()> {
        let (copy, shared) = (snapshot.arm(), self.shared(py)?);
        py.detach(|| shared.restore(copy));
        Ok(())
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("<Simulation at {:.3} s, {} faults>", self.now(py)?, self.faults(py)?.len()))
    }
}

#[pymethods]
impl SimulationSnapshot {
    /// From the bytes of another: what `pickle` calls.
    #[staticmethod]
    fn _of_bytes(py: Python<'_>, bytes: &[u8]) -> PyResult<Self> {
        let simulation = arm_sim::Simulation::from_bytes(bytes);
        simulation.map(Self::of).map_err(|why| InvalidValue::raise(py, &why.to_string()))
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.bytes() == other.bytes()
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.bytes().hash(&mut hasher);
        hasher.finish()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        Ok((py.get_type::<Self>().getattr("_of_bytes")?, (PyBytes::new(py, &self.bytes()),)))
    }

    fn __repr__(&self) -> String {
        let micros = lock(&self.0).now().as_micros();
        format!("<SimulationSnapshot at {:.3} s>", Duration::from_micros(micros).as_secs_f64())
    }
}
