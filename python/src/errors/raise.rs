//! Which failure of the library raises which exception.

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use recording_formats::ReadError;
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

use super::{
    ArmProblem, BadRecording, Interrupted, InvalidValue, MayMove, NoAnswer, NotDriven, NotReached, NotServed,
    NotTaken, OutOfReach, OutsideGuard, PortError, TooFar, UnknownRegister, error,
};
use crate::health::Problem;

/// How to go on where the guard does not allow a move.
const GUARD_HINTS: [&str; 2] = [
    "table=Z sets the height of the table in mm: -60 is the foot of the base",
    "guard=False switches the guard off: nothing then keeps the arm from its base and the table",
];

/// A failure of the library as an exception.
pub(crate) trait Raise {
    fn raise(&self, py: Python<'_>) -> PyErr;
}

impl Raise for sevenbot::Error {
    fn raise(&self, py: Python<'_>) -> PyErr {
        let hints: Vec<String> = advice::exchange(self).iter().map(|hint| in_python(hint)).collect();
        match self {
            Self::OutsideMap { .. } => InvalidValue::raise(py, &self.to_string()),
            Self::NoAnswer { .. } => error::<NoAnswer>(py, &self.to_string(), &hints),
            Self::Port(_) => error::<PortError>(py, &self.to_string(), &hints),
        }
    }
}

/// Replaces the options of the command line in a hint with the arguments of this package.
fn in_python(hint: &str) -> String {
    hint.replace("(--baud)", "(baud=)").replace("SEVENBOT_TOKEN set", "SEVENBOT_TOKEN or token= set")
}

/// The exception for a port that does not open. Its message begins with the name of the port.
pub(crate) fn not_opened(py: Python<'_>, port: &str, why: &OpenError) -> PyErr {
    let hints: Vec<String> = advice::opening(port, why).iter().map(|hint| in_python(hint)).collect();
    let message = format!("{port}: {why}");
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

/// The exception for problems that end a move, with their joints and what to do.
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
            Self::MayMove(_) | Self::OtherTargets | Self::NotHeld { .. } => {
                let hint = "`arm.stop()`, or switch off the supply of the servos".to_owned();
                error::<MayMove>(py, &message, &[hint])
            }
            Self::StillMoving { .. }
            | Self::NotReached { .. }
            | Self::Paused { .. }
            | Self::StoppedByAnother => error::<NotReached>(py, &message, &[]),
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

impl Raise for ReadError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Text(error) => error.raise(py),
            other => {
                let hint = "`sevenbot convert` writes what can be read to a new file".to_owned();
                let hints = if matches!(other, Self::Damaged { .. }) { vec![hint] } else { Vec::new() };
                error::<BadRecording>(py, &other.to_string(), &hints)
            }
        }
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
    #[error(
        "a line of {length:.0} mm in {seconds} s: the tip can be led at 1 to 500 mm/s; nothing was moved"
    )]
    Pace { length: f64, seconds: f64 },
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
            Self::Pace { .. } => InvalidValue::raise(py, &self.to_string()),
            Self::Line(_) => error::<OutOfReach>(py, &self.to_string(), &[]),
        }
    }
}

impl Raise for NameError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        UnknownRegister::raise(py, &self.to_string())
    }
}

impl Raise for ValueError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        InvalidValue::raise(py, &format!("{self}; nothing was written"))
    }
}

/// The value of a result, or its error as an exception.
pub(crate) fn raised<T, E: Raise>(py: Python<'_>, result: Result<T, E>) -> PyResult<T> {
    result.map_err(|error| error.raise(py))
}
