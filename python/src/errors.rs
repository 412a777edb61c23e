//! The exceptions of the module.

use std::ffi::CString;
use std::fmt::Display;

use pyo3::exceptions::{PyException, PyUserWarning};
use pyo3::prelude::*;
use pyo3::type_object::PyTypeInfo;
use pyo3::types::PyTuple;

mod also;
mod raise;

pub(crate) use also::{
    InvalidType, InvalidValue, UnknownRegister, file_error, register as register_also, without_attribute,
};
pub(crate) use raise::{Raise, StraightMoveError, not_opened, raised};

macro_rules! exceptions {
    ($($name:ident($base:ty): $doc:literal;)*) => {
        $(pyo3::create_exception!(sevenbot, $name, $base, $doc);)*

        /// Adds the exceptions to the module.
        pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
            let py = module.py();
            py.get_type::<Error>().setattr("hints", PyTuple::empty(py))?;
            py.get_type::<Error>().setattr("recording", py.None())?;
            py.get_type::<ArmProblem>().setattr("problems", PyTuple::empty(py))?;
            py.get_type::<ArmProblem>().setattr("joints", PyTuple::empty(py))?;
            $(module.add(stringify!($name), py.get_type::<$name>())?;)*
            Ok(())
        }
    };
}

exceptions! {
    Error(PyException): "A failure of this package. `hints` is a tuple of texts: what to try, the most likely cause first. `recording` is what `Arm.record` had recorded before it, or `None`.";
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

/// Warns of joints that the guard would not allow.
pub(crate) fn warn_of(py: Python<'_>, breach: &dyn Display) -> PyResult<()> {
    let text = CString::new(format!(
        "{breach}; table=Z sets the height of the table, guard=False ends this warning"
    ))?;
    PyErr::warn(py, py.get_type::<GuardWarning>().as_any(), &text, 1)
}

impl NotServed {
    /// The exception of an arm whose firmware does not have `what`.
    pub(crate) fn of_arm(py: Python<'_>, what: &str) -> PyErr {
        error::<Self>(py, &format!("the arm's firmware does not have {what}"), &[])
    }
}

impl Closed {
    /// The exception of a call after `close()`.
    pub(crate) fn raise_closed(py: Python<'_>) -> PyErr {
        error::<Self>(py, "the arm is closed: open it again", &[])
    }

    /// The exception of a call for a stream that is not open.
    pub(crate) fn raise_no_stream(py: Python<'_>) -> PyErr {
        error::<Self>(py, "this stream is not open: use `with arm.stream() as stream:`", &[])
    }

    /// The exception of a stream that does not begin: the arm has another one.
    pub(crate) fn raise_other_stream(py: Python<'_>) -> PyErr {
        error::<Self>(py, "this arm has an open stream already: a second one can begin after its end", &[])
    }

    /// The exception in a process that was forked off.
    pub(crate) fn raise_forked(py: Python<'_>) -> PyErr {
        let hint =
            "open an arm in this process, or start it with multiprocessing's method \"spawn\"".to_owned();
        error::<Self>(py, "the arm is closed here: this process was forked off after it was opened", &[hint])
    }

    /// As [`Self::raise_forked`], of arms that step together.
    pub(crate) fn raise_arms_forked(py: Python<'_>) -> PyErr {
        let hint =
            "make them in this process, or start it with multiprocessing's method \"spawn\"".to_owned();
        error::<Self>(
            py,
            "the arms are not usable here: this process was forked off after they were made",
            &[hint],
        )
    }
}

/// An exception with the hints below its message, and in its attribute `hints`.
pub(crate) fn error<E: PyTypeInfo>(py: Python<'_>, message: &str, hints: &[String]) -> PyErr {
    let lines = hints.iter().fold(message.to_owned(), |text, hint| format!("{text}\n  - {hint}"));
    let error = PyErr::from_type(E::type_object(py), (lines,));
    match PyTuple::new(py, hints).and_then(|hints| error.value(py).setattr("hints", hints)) {
        Ok(()) => error,
        Err(other) => other,
    }
}
