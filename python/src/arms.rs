//! `SimulatedArms`: many simulated arms that step together.

use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex};
use std::thread::available_parallelism;
use std::time::Duration;

use arm_sim::plant::HEAVIEST_LOAD_G;
use numpy::{Element, PyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::types::PySlice;
use sevenbot::register_values::bytes;
use sevenbot::simulated_arms::{self as library, MEASURED, Number, StepError, WANTED, WIDTH};
use sevenbot::{Joint, names};

use crate::arguments::whole;
use crate::arrays::{self, each_number, given, is_single, numpy, writing};
use crate::bulk;
use crate::errors::{Closed, InvalidValue, raised, without_attribute};
use crate::numbers::{Values, duration};
use crate::simulation::{self, SimulationSnapshot, fault_location, fault_time};
use crate::worker::lock;

/// The allowed loads at the tip, in grams.
const GRAMS: std::ops::RangeInclusive<f64> = 0.0..=HEAVIEST_LOAD_G as f64;
const MOST_ARMS: i64 = 1_000_000;
/// The approximate memory of an arm, in bytes.
const ARM_BYTES: usize = 20_000;

/// Simulated arms that step together, for learning: `seen = arms.step(actions, 0.02)`, with an action of seven angles in degrees
/// for each arm.
///
/// `seen` is an array with a row for each arm. The slices `POSITIONS`, `VELOCITIES`, `LOADS`, `TIP`, `BLOCKED` and `AGE` name its
/// columns: `seen[:, arms.TIP]`. Each arm is a controller that parses frames and answers a read, with servos, virtual time,
/// faults and a load of its own. Its line takes no time. The results do not depend on the number of threads. `exchange` lets
/// another simulation move the joints.
///
/// The first arm has the seed `seed`, and each other one the next number; or give `seeds`. By default there is a thread for each
/// processor. Needs numpy.
#[pyclass(frozen, module = "sevenbot")]
pub(crate) struct SimulatedArms {
    arms: Arc<Mutex<library::SimulatedArms>>,
    /// The process that made the arms. A forked process has a copy of them, whose lock may be held for ever.
    process: u32,
    count: usize,
    threads: NonZeroUsize,
}

impl SimulatedArms {
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut library::SimulatedArms) -> T + Send,
    ) -> PyResult<T> {
        if self.is_forked() {
            return Err(Closed::raise_arms_forked(py));
        }
        Ok(py.detach(|| work(&mut lock(&self.arms))))
    }

    fn is_forked(&self) -> bool {
        self.process != std::process::id()
    }

    /// The method `step` for arrays with elements of type `N`.
    fn step_as<'py, N: Number + Element>(
        &self,
        py: Python<'py>,
        actions: Option<&Bound<'py, PyAny>>,
        time: Duration,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let actions: Option<PyReadonlyArray2<'py, N>> =
            actions.map(|actions| given(actions, [self.count, 7], "actions")).transpose()?;
        let numbers = actions.as_ref().map(|array| array.as_slice()).transpose();
        let numbers = numbers.map_err(arrays::gaps(py))?;
        let seen = self.fill::<N>(py, out, WIDTH, |arms, seen| arms.step(numbers, time, seen))?;
        py.check_signals()?;
        Ok(seen)
    }

    /// Fills and returns `out`, or a new array, with a row for each arm and this number of columns.
    fn fill<'py, N: Number + Element>(
        &self,
        py: Python<'py>,
        out: Option<&Bound<'py, PyAny>>,
        columns: usize,
        work: impl FnOnce(&mut library::SimulatedArms, &mut [N]) -> Result<(), StepError> + Send,
    ) -> PyResult<Bound<'py, PyAny>> {
        let out = arrays::out::<N>(py, out, [self.count, columns])?;
        let mut filled = writing(&out)?;
        let numbers = filled.as_slice_mut().map_err(arrays::gaps(py))?;
        let done = self.with(py, |arms| work(arms, numbers))?;
        drop(filled);
        done.map_err(|error| InvalidValue::raise(py, &error.to_string()))?;
        Ok(out.into_any())
    }

    fn mask(&self, mask: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Vec<bool>>> {
        arrays::mask(mask, self.count)
    }
}

#[pymethods]
impl SimulatedArms {
    /// Measured positions in degrees; NaN for a joint that was not measured.
    #[classattr]
    const POSITIONS: Columns = Columns(library::POSITIONS);
    /// Measured velocities in degrees per second.
    #[classattr]
    const VELOCITIES: Columns = Columns(library::VELOCITIES);
    /// Loads in percent of the stall torque.
    #[classattr]
    const LOADS: Columns = Columns(library::LOADS);
    /// The tip in millimetres, x, y, z, by the measured positions.
    #[classattr]
    const TIP: Columns = Columns(library::TIP);
    /// 1 for a joint that an obstacle keeps from its target, or else 0.
    #[classattr]
    const BLOCKED: Columns = Columns(library::BLOCKED);
    /// Seconds since the last reply: 0 if the last read was answered.
    #[classattr]
    const AGE: Columns = Columns(library::AGE);
    /// Of `exchange`: the angles that the servos' control aims at, in degrees.
    #[classattr]
    const SET_POINTS: Columns = Columns(library::SET_POINTS);
    /// Of `exchange`: the velocities of the set-points in degrees per second.
    #[classattr]
    const SET_VELOCITIES: Columns = Columns(library::SET_VELOCITIES);
    /// Of `exchange`: 1 for a motor that drives its joint, 2 for one that damps it, or else 0.
    #[classattr]
    const DRIVES: Columns = Columns(library::DRIVES);

    #[new]
    #[pyo3(signature = (n, seed = None, *, seeds = None, threads = None), text_signature = "(n, seed=1, *, seeds=None, threads=None)")]
    fn new(
        py: Python<'_>,
        n: i64,
        seed: Option<&Bound<'_, PyAny>>,
        seeds: Option<&Bound<'_, PyAny>>,
        threads: Option<i64>,
    ) -> PyResult<Self> {
        numpy(py)?;
        let count: usize = whole(py, "n", n, 1, MOST_ARMS)?;
        let threads = threads.map(|threads| whole::<usize>(py, "threads", threads, 1, 1_024)).transpose()?;
        let threads = threads.and_then(NonZeroUsize::new).or_else(|| available_parallelism().ok());
        let threads = threads.unwrap_or(NonZeroUsize::MIN);
        let seeds = arrays::seeds(count, seed, seeds)?;
        // Fail now: if the memory ran out later, the process would be aborted.
        let has_memory = Vec::<u8>::new().try_reserve_exact(count.saturating_mul(ARM_BYTES)).is_ok();
        if !has_memory {
            return Err(PyMemoryError::new_err(format!("there is not enough memory for {count} arms")));
        }
        let arms = py.detach(|| library::SimulatedArms::new(&seeds, threads));
        Ok(Self { arms: Arc::new(Mutex::new(arms)), process: std::process::id(), count, threads })
    }

    /// Sends each arm its action, the next set-point of seven angles of 0 to 180 degrees, lets `dt` pass, and reads its state.
    ///
    /// `actions` is an array (n, 7); arrays of float32 and float64 without gaps are not copied, unless `out` has the other type.
    /// With `None` the arms go on.
    /// `dt` is 0.005 to 1 second in whole milliseconds. Returns `out`, or a new array (n, 32), which is float32 if the actions are.
    /// A wrong action raises `ValueError` before any arm moves. Ctrl-C ends the call after the step.
    #[pyo3(signature = (actions, dt = 0.02, out = None))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        actions: Option<&Bound<'py, PyAny>>,
        dt: f64,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let time = duration(py, dt)?;
        if out.or(actions).is_some_and(is_single) {
            self.step_as::<f32>(py, actions, time, out)
        } else {
            self.step_as::<f64>(py, actions, time, out)
        }
    }

    /// Sends each arm its action as the next point of a stream of this period, as `step` does. No time passes.
    #[pyo3(signature = (actions, period = 0.02))]
    fn send(&self, py: Python<'_>, actions: &Bound<'_, PyAny>, period: f64) -> PyResult<()> {
        let time = duration(py, period)?;
        let actions: PyReadonlyArray2<'_, f64> = given(actions, [self.count, 7], "actions")?;
        let numbers = actions.as_slice().map_err(arrays::gaps(py))?;
        let sent = self.with(py, |arms| arms.send(numbers, time))?;
        sent.map_err(|error| InvalidValue::raise(py, &error.to_string()))
    }

    /// Lets another simulation, such as MuJoCo, move the joints: passes its measurements to the arms, lets `dt` pass, and returns
    /// what the servos want then.
    ///
    /// `measured` is an array (n, 21) with the columns `POSITIONS`, `VELOCITIES` and `LOADS`, in the units of an observation. A
    /// joint whose position is NaN is moved by this simulation. Returns `out`, or a new array (n, 21): `SET_POINTS` in degrees,
    /// `SET_VELOCITIES` in degrees per second, and `DRIVES`: 1 for a motor that drives its joint, 2 for one that damps it, or else
    /// 0. `dt` is 0.001 to 1 second in whole milliseconds. `send` gives actions, `read` the observations.
    #[pyo3(signature = (measured, dt = 0.002, out = None))]
    fn exchange<'py>(
        &self,
        py: Python<'py>,
        measured: &Bound<'py, PyAny>,
        dt: f64,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let time = duration(py, dt)?;
        let measured: PyReadonlyArray2<'py, f64> = given(measured, [self.count, MEASURED], "measured")?;
        let numbers = measured.as_slice().map_err(arrays::gaps(py))?;
        self.fill::<f64>(py, out, WANTED, |arms, wanted| arms.exchange(numbers, time, wanted))
    }

    /// Asks each arm for its state: `out`, or a new array (n, 32). No time passes.
    #[pyo3(signature = (out = None))]
    fn read<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        if out.is_some_and(is_single) {
            self.fill::<f32>(py, out, WIDTH, |arms, seen| arms.read(seen))
        } else {
            self.fill::<f64>(py, out, WIDTH, |arms, seen| arms.read(seen))
        }
    }

    /// The observations of the last reads: `out`, or a new array (n, 32). No time passes.
    #[pyo3(signature = (out = None))]
    fn observe<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        if out.is_some_and(is_single) {
            self.fill::<f32>(py, out, WIDTH, |arms, seen| arms.observe(seen))
        } else {
            self.fill::<f64>(py, out, WIDTH, |arms, seen| arms.observe(seen))
        }
    }

    /// Makes the arms of the mask (n truth values), or all, as they were after their start, or as a snapshot: time, faults and
    /// load, too. Each keeps its seed, or gets one of `seeds` (n numbers), and draws the same random numbers again.
    #[pyo3(signature = (mask = None, snapshot = None, *, seeds = None))]
    fn reset(
        &self,
        py: Python<'_>,
        mask: Option<&Bound<'_, PyAny>>,
        snapshot: Option<&SimulationSnapshot>,
        seeds: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let mask = self.mask(mask)?;
        let seeds = seeds.map(|each| arrays::seeds(self.count, None, Some(each))).transpose()?;
        let snapshot = snapshot.map(SimulationSnapshot::arm);
        self.with(py, move |arms| {
            for (index, seed) in seeds.into_iter().flatten().enumerate() {
                if mask.as_ref().is_none_or(|mask| mask.get(index) == Some(&true)) {
                    arms.set_seed(index, seed);
                }
            }
            arms.reset(mask.as_deref(), snapshot.as_ref());
        })
    }

    /// Gives the arms of the mask, or all with `None`, a fault, for `seconds` or until `clear` or `reset`. The words are those of
    /// `Simulation.fault`.
    #[pyo3(signature = (mask, fault, seconds = None))]
    fn fault(
        &self,
        py: Python<'_>,
        mask: Option<&Bound<'_, PyAny>>,
        fault: &str,
        seconds: Option<f64>,
    ) -> PyResult<()> {
        let mask = self.mask(mask)?;
        let (fault, time) = (simulation::fault(py, fault)?, fault_time(py, seconds)?);
        self.with(py, |arms| {
            arms.each(mask.as_deref(), |_, arm| {
                arm.set_fault(fault, time);
            });
        })
    }

    /// Takes the faults of the arms of the mask, or of all, back: all, or those at one location, `"3"`, `"supply"`, `"line"`.
    #[pyo3(signature = (mask = None, location = None))]
    fn clear(&self, py: Python<'_>, mask: Option<&Bound<'_, PyAny>>, location: Option<&str>) -> PyResult<()> {
        let mask = self.mask(mask)?;
        let location = fault_location(py, location)?;
        self.with(py, |arms| arms.each(mask.as_deref(), |_, arm| drop(arm.end_faults(location))))
    }

    /// Hangs a weight on the tip of the arms of the mask, or of all: grams, 0 to 1000, one number or one for each of the n arms.
    #[pyo3(signature = (grams, mask = None))]
    fn set_load(
        &self,
        py: Python<'_>,
        grams: &Bound<'_, PyAny>,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let mask = self.mask(mask)?;
        let grams = each_number(grams, self.count, "grams")?.into_iter();
        let grams = grams.map(|grams| arrays::steps(py, "grams", grams, GRAMS, 1.0));
        let grams: Vec<u16> = grams.collect::<PyResult<_>>()?;
        self.with(py, |arms| {
            arms.each(mask.as_deref(), |index, arm| {
                arm.plant_mut().set_load(grams.get(index).copied().unwrap_or_default());
            });
        })
    }

    /// Makes the servos of the arms of the mask, or of all, stronger or weaker, and their gears stiffer: factors of the stall torque
    /// and of all friction and drag, 0.1 to 10 in steps of 0.01, one number or one for each of the n arms. `reset` takes it back.
    #[pyo3(signature = (torque, friction, mask = None))]
    fn scale_servos(
        &self,
        py: Python<'_>,
        torque: &Bound<'_, PyAny>,
        friction: &Bound<'_, PyAny>,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let mask = self.mask(mask)?;
        let percents = |factors, name| -> PyResult<Vec<u16>> {
            let factors = each_number(factors, self.count, name)?;
            let percent = |factor: f64| arrays::steps(py, name, factor, 0.1..=10.0, 100.0);
            factors.into_iter().map(percent).collect()
        };
        let (torque, friction) = (percents(torque, "torque")?, percents(friction, "friction")?);
        self.with(py, |arms| {
            let percent = |percents: &[u16], index| percents.get(index).copied().unwrap_or(100);
            arms.each(mask.as_deref(), |index, arm| {
                arm.plant_mut().scale_servos(percent(&torque, index), percent(&friction, index));
            });
        })
    }

    /// Writes registers of the arms of the mask, or of all, in one frame each: `arms.set("push-limit", 50)`. Names and numbers
    /// are those of docs/registers.md. An arm refuses a write that its rules forbid.
    #[pyo3(signature = (name, values, mask = None))]
    fn set(
        &self,
        py: Python<'_>,
        name: &str,
        values: Values,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let mask = self.mask(mask)?;
        let span = raised(py, names::parse(name))?;
        let bytes = raised(py, bytes(span, values.as_slice()))?;
        self.with(py, |arms| arms.write(mask.as_deref(), span.address(), &bytes))
    }

    /// A copy of an arm as it is now, by its number from 0: for `reset`, and for `Simulation.restore`.
    fn snapshot(&self, py: Python<'_>, arm: i64) -> PyResult<SimulationSnapshot> {
        let last = i64::try_from(self.count).unwrap_or(i64::MAX).saturating_sub(1);
        let index: usize = whole(py, "arm", arm, 0, last)?;
        let copy = self.with(py, |arms| arms.arm(index).cloned())?;
        copy.map(SimulationSnapshot::of).ok_or_else(|| InvalidValue::raise(py, "there is no such arm"))
    }

    /// The true angles of all joints in degrees, without noise: an array (n, 7).
    #[getter]
    fn angles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rows = self.with(py, |arms| {
            let mut rows = Vec::new();
            let angles = |arm: &arm_sim::Simulation| Joint::ALL.map(|joint| arm.plant().angle(joint));
            arms.each(None, |_, arm| rows.push(angles(arm).map(|angle| f64::from(angle) / 1_000.0)));
            rows
        });
        bulk::angles(py, &rows.map_err(|error| without_attribute(py, error))?)
    }

    /// The virtual time of each arm in seconds: an array (n,).
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let times = self.with(py, |arms| {
            let mut times = Vec::new();
            let seconds = |micros| Duration::from_micros(micros).as_secs_f64();
            arms.each(None, |_, arm| times.push(seconds(arm.now().as_micros())));
            times
        });
        Ok(PyArray1::from_vec(py, times.map_err(|error| without_attribute(py, error))?))
    }

    /// The most threads that step the arms.
    #[getter]
    const fn threads(&self) -> usize {
        self.threads.get()
    }

    const fn __len__(&self) -> usize {
        self.count
    }

    fn __repr__(&self) -> String {
        format!("<SimulatedArms: {} arms, {} threads>", self.count, self.threads)
    }
}

impl Drop for SimulatedArms {
    fn drop(&mut self) {
        if self.is_forked() {
            // At the fork, another thread may have been changing the arms. So this copy is never dropped.
            std::mem::forget(Arc::clone(&self.arms));
        }
    }
}

/// Columns of an array, which Python sees as a slice.
struct Columns(std::ops::Range<usize>);

impl<'py> IntoPyObject<'py> for Columns {
    type Target = PySlice;
    type Output = Bound<'py, PySlice>;
    type Error = PyErr;

    fn into_pyobject(self, py: Python<'py>) -> PyResult<Self::Output> {
        Ok(PySlice::new(py, isize::try_from(self.0.start)?, isize::try_from(self.0.end)?, 1))
    }
}
