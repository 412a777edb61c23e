//! `Observation`: positions, velocities and loads of one exchange.

use std::time::Instant;

use pyo3::prelude::*;
use sevenbot::fine::FineState;
use sevenbot::{Arm, Error, FineAngle};

use crate::bulk;
use crate::numbers::PoseDegrees;

/// What one read of the arm tells: positions, velocities and loads of all joints, measured in the same cycle of the controller.
///
/// The controller asks its servos once in a cycle of 10 ms, so a position is up to 10 ms old when the arm answers, and `age`
/// adds the time that the answer took.
#[pyclass(frozen, module = "sevenbot")]
pub(crate) struct Observation {
    positions: [f64; 7],
    velocities: [f64; 7],
    loads: [f64; 7],
    time: f64,
    age: f64,
    monotonic: f64,
}

/// The arguments of [`Observation::_of`]: positions, velocities, loads, time, age and `monotonic`.
type PickledObservation = (PoseDegrees, PoseDegrees, PoseDegrees, f64, f64, f64);

/// A cycle of the controller, in seconds.
const CYCLE: f64 = 0.01;

/// The answer of the arm, read without the interpreter.
pub(crate) struct JointReadings {
    state: FineState,
    time: f64,
    age: f64,
    came: Instant,
}

impl JointReadings {
    /// Reads positions, velocities and loads; `None` with the maker's firmware or map 2.1.
    pub(crate) fn read(arm: &mut Arm) -> Result<Option<Self>, Error> {
        let before = arm.elapsed();
        let Some(state) = arm.fine_state_if_served()? else { return Ok(None) };
        let time = arm.elapsed();
        let waited = time.saturating_sub(before).as_secs_f64();
        Ok(Some(Self { state, time: time.as_secs_f64(), age: CYCLE + waited, came: Instant::now() }))
    }

    /// The observation. `asked` is a time before the request, on Python's clock, which has steps of 16 ms on some systems.
    pub(crate) fn observation(self, py: Python<'_>, asked: f64) -> PyResult<Observation> {
        let tenths = |values: [i16; 7]| values.map(|value| f64::from(value) / 10.0);
        // Read this before Python's clock. If the thread waits between the two, the result is later than the answer, but not
        // later than now.
        let since = self.came.elapsed().as_secs_f64();
        let now = monotonic(py)?;
        Ok(Observation {
            positions: self.state.positions.map(|angle| angle.map_or(f64::NAN, FineAngle::degrees)),
            velocities: tenths(self.state.velocities),
            loads: tenths(self.state.loads),
            time: self.time,
            age: self.age,
            monotonic: asked.max(now - since),
        })
    }
}

pub(crate) fn monotonic(py: Python<'_>) -> PyResult<f64> {
    py.import("time")?.call_method0("monotonic")?.extract()
}

#[pymethods]
impl Observation {
    /// The measured positions in degrees; NaN for a joint that was not measured since power-up. With numpy an array.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        bulk::numbers(py, &self.positions)
    }

    /// The velocities in degrees per second, in steps of 0.1: as `positions`.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        bulk::numbers(py, &self.velocities)
    }

    /// The loads in percent of the stall torque, positive if the motor pushes towards greater angles: as `positions`.
    #[getter]
    fn loads<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        bulk::numbers(py, &self.loads)
    }

    /// When the answer came: seconds since the arm was opened, on the clock of its line. It never goes back.
    #[getter]
    const fn time(&self) -> f64 {
        self.time
    }

    /// The longest time between the measurement and `time`, in seconds: a cycle of the controller, and that of the exchange. While
    /// the servo of a joint does not answer, its values are older: those of before. `arm.status()` tells it.
    #[getter]
    const fn age(&self) -> f64 {
        self.age
    }

    /// When the answer came, on the clock of `time.monotonic()`.
    #[getter]
    const fn monotonic(&self) -> f64 {
        self.monotonic
    }

    /// From its numbers: what `pickle` calls.
    #[staticmethod]
    const fn _of(
        positions: [f64; 7],
        velocities: [f64; 7],
        loads: [f64; 7],
        time: f64,
        age: f64,
        monotonic: f64,
    ) -> Self {
        Self { positions, velocities, loads, time, age, monotonic }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, PickledObservation)> {
        let (positions, velocities, loads) =
            (self.positions.into(), self.velocities.into(), self.loads.into());
        let arguments = (positions, velocities, loads, self.time, self.age, self.monotonic);
        Ok((py.get_type::<Self>().getattr("_of")?, arguments))
    }

    fn __repr__(&self) -> String {
        let angles: PoseDegrees = self.positions.into();
        format!("<Observation at {:.3} s: {angles:?}>", self.time)
    }
}
