//! `JointStatus` and `Problem`: what a joint does, what is wrong, and what to do.

use pyo3::prelude::*;
use sevenbot::health::JointHealth;
use sevenbot::{FineAngle, Joint};

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
}

impl JointStatus {
    pub(crate) const fn of(health: JointHealth, is_driven: bool) -> Self {
        Self { health, is_driven }
    }
}

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

    /// What the joint does, in a word or two; empty if the motors are off.
    #[getter]
    fn state(&self) -> String {
        self.health.word(self.is_driven)
    }

    fn __repr__(&self) -> String {
        let position =
            self.position().map_or_else(|| "unknown".to_owned(), |degrees| format!("{degrees:.2}°"));
        format!("<JointStatus {} at {position}: {}>", self.joint(), self.state())
    }
}
