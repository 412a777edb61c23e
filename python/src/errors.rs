//! The exceptions of the module, and which failure of the library raises which one.

use std::ffi::CString;
use std::fmt::Display;

use pyo3::exceptions::{PyException, PyKeyError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::type_object::PyTypeInfo;
use pyo3::types::PyTuple;
use sevenbot::cartesian::{StraightLineError, StraightLineFault, TipRefusal};
use sevenbot::checked_write::WriteError;
use sevenbot::health::{remedies, sentences};
use sevenbot::hold::HoldError;
use sevenbot::moves::{GuardedMoveError, LineStartError, MoveError, ParkError};
use sevenbot::names::NameError;
use sevenbot::recording::RecordingError;
use sevenbot::register_values::ValueError;
use sevenbot::stream::StreamError;
use sevenbot::{Joint, OpenError, advice};

use crate::health::Problem;

macro_rules! exceptions {
    ($($name:ident($base:ty): $doc:literal;)*) => {
        $(pyo3::create_exception!(sevenbot, $name, $base, $doc);)*

        /// Adds the exceptions to the module.
        pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
            let py = module.py();
            py.get_type::<Error>().setattr("hints", PyTuple::empty(py))?;
            py.get_type::<ArmProblem>().setattr("problems", PyTuple::empty(py))?;
            py.get_type::<ArmProblem>().setattr("joints", PyTuple::empty(py))?;
            $(module.add(stringify!($name), py.get_type::<$name>())?;)*
            Ok(())
        }
    };
}

exceptions! {
    Error(PyException): "A failure of this package. `hints` is a tuple of texts: what to try, the most likely cause first.";
    PortError(Error): "The port cannot be opened, has no arm, or failed.";
    NoAnswer(PortError): "The arm does not answer.";
    NotTaken(Error): "The arm did not take a value. The message tells why.";
    NotReached(Error): "Joints did not reach their targets, or still move.";
    ArmProblem(NotReached): "The arm does not carry out a move: a joint is blocked, let go or silent, the servos have no supply, or the controller restarted. `problems` is a tuple of `Problem`, `joints` the numbers of their joints, `hints` what to do.";
    NotDriven(Error): "The motors do not drive the joints: `arm.set('motor-state', 1)` switches them on.";
    MayMove(Error): "It is unknown whether the arm took a command, so it may be moving.";
    OutOfReach(Error): "No joint angles reach the position.";
    TooFar(Error): "The first point of a stream or a recording is far from where the arm stands.";
    OutsideGuard(Error): "The move would take the arm below the table or into its base.";
    NotServed(Error): "The arm's firmware does not have this function.";
    BadRecording(Error): "A text is not a recording, or the arm cannot play it.";
    Interrupted(Error): "Another thread stopped the arm during this call.";
    Closed(Error): "The arm is closed, or the stream is.";
    GuardWarning(PyUserWarning): "Joints were sent below the table or into the base of the arm.";
}

/// How to go on where the guard does not allow a move.
const GUARD_HINTS: [&str; 2] = [
    "table=Z sets the height of the table in mm: -60 is the foot of the base",
    "guard=False switches the guard off: nothing then keeps the arm from its base and the table",
];

/// Warns of joints that the guard would not allow.
pub(crate) fn warn_of(py: Python<'_>, breach: &dyn Display) -> PyResult<()> {
    let text = CString::new(format!(
        "{breach}; table=Z sets the height of the table, guard=False ends this warning"
    ))?;
    PyErr::warn(py, py.get_type::<GuardWarning>().as_any(), &text, 1)
}

impl Closed {
    /// The exception of a call after `close()`.
    pub(crate) fn raise_closed(py: Python<'_>) -> PyErr {
        error::<Self>(py, "the arm is closed, or no stream is open", &[])
    }
}

/// An exception with its hints.
pub(crate) fn error<E: PyTypeInfo>(py: Python<'_>, message: &str, hints: &[String]) -> PyErr {
    let lines = hints.iter().fold(message.to_owned(), |text, hint| format!("{text}\n  - {hint}"));
    let error = PyErr::from_type(E::type_object(py), (lines,));
    match PyTuple::new(py, hints).and_then(|hints| error.value(py).setattr("hints", hints)) {
        Ok(()) => error,
        Err(other) => other,
    }
}

/// A failure of the library as an exception.
pub(crate) trait Raise {
    /// The exception.
    fn raise(&self, py: Python<'_>) -> PyErr;
}

impl Raise for sevenbot::Error {
    fn raise(&self, py: Python<'_>) -> PyErr {
        let hints: Vec<String> = advice::exchange(self).iter().map(|&hint| hint.to_owned()).collect();
        match self {
            Self::OutsideMap { .. } => PyValueError::new_err(self.to_string()),
            Self::NoAnswer { .. } => error::<NoAnswer>(py, &self.to_string(), &hints),
            Self::Port(_) => error::<PortError>(py, &self.to_string(), &hints),
        }
    }
}

/// A port that does not open, with its name.
pub(crate) fn not_opened(py: Python<'_>, port: &str, why: &OpenError) -> PyErr {
    let (message, hints) = (format!("{port}: {why}"), advice::opening(why));
    match why {
        OpenError::Silent(sevenbot::Error::NoAnswer { .. }) => error::<NoAnswer>(py, &message, &hints),
        _ => error::<PortError>(py, &message, &hints),
    }
}

impl Raise for sevenbot::checked_write::NotTaken {
    fn raise(&self, py: Python<'_>) -> PyErr {
        let hint =
            "settings are protected by the EEPROM lock, register 28: `unlock=True` opens it for this write";
        let hints = if self.is_locked() { vec![hint.to_owned()] } else { Vec::new() };
        error::<NotTaken>(py, &self.to_string(), &hints)
    }
}

impl Raise for WriteError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::NotTaken(not_taken) => not_taken.raise(py),
            Self::Exchange(error) => error.raise(py),
        }
    }
}

/// Problems that end a move, with the joints and what to do.
fn arm_problem(py: Python<'_>, problems: &[sevenbot::Problem]) -> PyErr {
    let hints: Vec<String> = remedies(problems).into_iter().map(str::to_owned).collect();
    let raised = error::<ArmProblem>(py, &sentences(problems), &hints);
    let joints = problems.iter().filter_map(|problem| problem.joint.map(Joint::number));
    let set = || -> PyResult<()> {
        let value = raised.value(py);
        value.setattr("joints", PyTuple::new(py, joints.collect::<Vec<_>>())?)?;
        let problems: Vec<Problem> = problems.iter().copied().map(Problem::from).collect();
        let told: PyResult<Vec<_>> = problems.into_iter().map(|problem| Py::new(py, problem)).collect();
        value.setattr("problems", PyTuple::new(py, told?)?)
    };
    match set() {
        Ok(()) => raised,
        Err(other) => other,
    }
}

impl Raise for ParkError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Move(error) => error.raise(py),
            Self::Sinks { .. } => error::<NotReached>(py, &self.to_string(), &[]),
        }
    }
}

impl Raise for MoveError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        let message = self.to_string();
        let driven = ["`arm.set('motor-state', 1)` switches the motors on".to_owned()];
        match self {
            Self::Exchange(error) => error.raise(py),
            Self::Problems(problems) => arm_problem(py, problems),
            Self::NotTaken(not_taken) => not_taken.raise(py),
            Self::Stream(error) => error.raise(py),
            Self::Interrupted => error::<Interrupted>(py, &message, &[]),
            Self::NotDriven { .. } => error::<NotDriven>(py, &message, &driven),
            Self::MayMove(_) | Self::OtherTargets => {
                let hint = "`arm.stop()`, or switch off the supply of the servos".to_owned();
                error::<MayMove>(py, &message, &[hint])
            }
            Self::StillMoving { .. } | Self::NotReached { .. } | Self::Paused { .. } => {
                error::<NotReached>(py, &message, &[])
            }
            Self::StartTooFar(_) => {
                let hint = "approach=SECONDS goes there smoothly first: look that the way is free".to_owned();
                error::<TooFar>(py, &message, &[hint])
            }
            Self::ReportsStopped => error::<NoAnswer>(py, &message, &[]),
        }
    }
}

impl Raise for HoldError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        MoveError::from(self.clone()).raise(py)
    }
}

impl Raise for StreamError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::NoExtendedBlock => error::<NotServed>(py, &self.to_string(), &[]),
            Self::NotTaken(not_taken) => not_taken.raise(py),
            Self::Exchange(error) => error.raise(py),
        }
    }
}

impl Raise for RecordingError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        error::<BadRecording>(py, &self.to_string(), &[])
    }
}

impl Raise for TipRefusal {
    fn raise(&self, py: Python<'_>) -> PyErr {
        let hint = self
            .other_tool()
            .map(|tool| format!("with tool=({}, {}, {}) the tip may go there", tool.x, tool.y, tool.z));
        match self {
            Self::Unreachable(_) => {
                error::<OutOfReach>(py, &self.to_string(), &hint.into_iter().collect::<Vec<_>>())
            }
            Self::Guarded(_) => outside_guard(py, &self.to_string(), hint),
        }
    }
}

fn outside_guard(py: Python<'_>, message: &str, first: Option<String>) -> PyErr {
    let hints: Vec<String> = first.into_iter().chain(GUARD_HINTS.map(str::to_owned)).collect();
    error::<OutsideGuard>(py, message, &hints)
}

impl Raise for GuardedMoveError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Exchange(error) => error.raise(py),
            Self::Guarded(breach) => {
                let hint = "go to a point above first; or use straight=True, where the tip takes no curve";
                let message = format!("the way there is not allowed: {breach}; nothing was moved");
                outside_guard(py, &message, Some(hint.to_owned()))
            }
        }
    }
}

/// Why a straight line does not begin.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StraightMoveError {
    #[error(transparent)]
    Move(#[from] MoveError),
    #[error(transparent)]
    Start(#[from] LineStartError),
    #[error(transparent)]
    Line(#[from] StraightLineError),
}

impl Raise for StraightMoveError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Move(error) => error.raise(py),
            Self::Start(LineStartError::Exchange(error)) => error.raise(py),
            Self::Start(LineStartError::Unknown { .. }) => {
                let hint = "`arm.stop()` sets the targets to the positions".to_owned();
                error::<NotReached>(py, &self.to_string(), &[hint])
            }
            Self::Line(StraightLineError { fault: StraightLineFault::Guarded(_), .. }) => {
                outside_guard(py, &self.to_string(), None)
            }
            Self::Line(_) => error::<OutOfReach>(py, &self.to_string(), &[]),
        }
    }
}

impl Raise for NameError {
    fn raise(&self, _: Python<'_>) -> PyErr {
        PyKeyError::new_err(self.to_string())
    }
}

impl Raise for ValueError {
    fn raise(&self, _: Python<'_>) -> PyErr {
        PyValueError::new_err(format!("{self}; nothing was written"))
    }
}

/// Raises the error of a result.
pub(crate) fn raised<T, E: Raise>(py: Python<'_>, result: Result<T, E>) -> PyResult<T> {
    result.map_err(|error| error.raise(py))
}
