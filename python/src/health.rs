//! `JointStatus` and `Problem`: what a joint does, what is wrong, and what to do.

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sevenbot::health::{Health, JointHealth, ProblemKind};
use sevenbot::{FineAngle, Joint, Snapshot};

use crate::errors::InvalidValue;

/// The arguments of [`Problem::_of`].
type PickledProblem = (&'static str, Option<u8>);

/// Something that is wrong with the arm or one of its joints.
#[pyclass(frozen, module = "sevenbot")]
pub(crate) struct Problem(sevenbot::Problem);

impl From<sevenbot::Problem> for Problem {
    fn from(problem: sevenbot::Problem) -> Self {
        Self(problem)
    }
}

#[pymethods]
impl Problem {
    /// A word or two, such as `"blocked"`.
    #[getter]
    fn kind(&self) -> &'static str {
        self.0.kind.name()
    }

    /// The joint, 1 to 7; `None` if the problem is that of the whole arm.
    #[getter]
    fn joint(&self) -> Option<u8> {
        self.0.joint.map(Joint::number)
    }

    /// What to do.
    #[getter]
    fn remedy(&self) -> &'static str {
        self.0.kind.remedy()
    }

    /// From the kind and the joint: what `pickle` calls.
    #[staticmethod]
    fn _of(py: Python<'_>, kind: &str, joint: Option<u8>) -> PyResult<Self> {
        let kind = ProblemKind::ALL.into_iter().find(|each| each.name() == kind);
        let kind = kind.ok_or_else(|| InvalidValue::raise(py, "there is no problem of this kind"))?;
        Ok(Self(sevenbot::Problem { kind, joint: joint.and_then(Joint::new) }))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, PickledProblem)> {
        Ok((py.get_type::<Self>().getattr("_of")?, (self.kind(), self.joint())))
    }

    fn __str__(&self) -> String {
        self.0.to_string()
    }

    fn __repr__(&self) -> String {
        format!("<Problem {}>", self.0)
    }
}

/// One joint at one instant. A value is `None` if the firmware does not tell it.
#[pyclass(frozen, module = "sevenbot")]
pub(crate) struct JointStatus {
    health: JointHealth,
    is_driven: bool,
    /// Registers 0 to 255, from which the other fields are computed.
    registers: Vec<u8>,
}

impl JointStatus {
    pub(crate) const fn of(health: JointHealth, is_driven: bool, registers: Vec<u8>) -> Self {
        Self { health, is_driven, registers }
    }
}

/// The arguments of [`JointStatus::_of_registers`].
type PickledJoint<'py> = (Bound<'py, PyBytes>, u8);

#[pymethods]
impl JointStatus {
    /// 1 to 7.
    #[getter]
    fn joint(&self) -> u8 {
        self.health.joint.number()
    }

    /// The measured position in degrees; `None` if it was never measured.
    #[getter]
    fn position(&self) -> Option<f64> {
        self.health.position.map(FineAngle::degrees)
    }

    /// The target in degrees.
    #[getter]
    fn target(&self) -> f64 {
        self.health.target.degrees()
    }

    /// The velocity in degrees per second.
    #[getter]
    fn velocity(&self) -> Option<f64> {
        self.health.velocity
    }

    /// The load in percent of the stall torque, positive if the motor pushes towards greater angles.
    #[getter]
    fn load(&self) -> Option<f64> {
        self.health.load_percent
    }

    /// Does the set-point move?
    #[getter]
    fn is_moving(&self) -> Option<bool> {
        self.health.is_moving
    }

    /// Does the servo not answer?
    #[getter]
    fn is_silent(&self) -> Option<bool> {
        self.health.is_silent
    }

    /// Does an obstacle keep the joint from its target?
    #[getter]
    fn is_blocked(&self) -> Option<bool> {
        self.health.is_blocked
    }

    /// Does the servo hold no torque although it should?
    #[getter]
    fn has_let_go(&self) -> Option<bool> {
        self.health.has_let_go
    }

    /// Is the joint driven, at rest, and within 3 degrees of its target?
    #[getter]
    fn is_at_target(&self) -> bool {
        self.health.is_at_target
    }

    /// What the joint does, in a word or two; empty if it has no problem and the motors are off.
    #[getter]
    fn state(&self) -> String {
        self.health.word(self.is_driven)
    }

    /// From registers 0 to 255 and the joint: what `pickle` calls.
    #[staticmethod]
    fn _of_registers(py: Python<'_>, registers: Vec<u8>, joint: u8) -> PyResult<Self> {
        let health = Health::new(&Snapshot { address: 0, values: registers.clone() });
        let found = health.joints.iter().find(|each| each.joint.number() == joint);
        let found = found.ok_or_else(|| InvalidValue::raise(py, "a joint is 1 to 7"))?;
        Ok(Self::of(*found, health.is_driven(), registers))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, PickledJoint<'py>)> {
        let arguments = (PyBytes::new(py, &self.registers), self.joint());
        Ok((py.get_type::<Self>().getattr("_of_registers")?, arguments))
    }

    fn __repr__(&self) -> String {
        let position =
            self.position().map_or_else(|| "unknown".to_owned(), |degrees| format!("{degrees:.2}°"));
        format!("<JointStatus {} at {position}: {}>", self.joint(), self.state())
    }
}
