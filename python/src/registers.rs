//! Registers by their names, with the numbers of the register table.

use std::ffi::CString;
use std::sync::Arc;

use pyo3::exceptions::{PyKeyError, PyUserWarning};
use pyo3::prelude::*;
use sevenbot::map::{FINE_TARGET, MOTOR_STATE, TARGET_POSITION};
use sevenbot::moves::MoveError;
use sevenbot::names::{name_of, parse};
use sevenbot::register_text::{RegisterEntry, entries};
use sevenbot::register_values::bytes;
use sevenbot::table::{access, range, rows};
use sevenbot::{Register, Span};

use crate::errors::{NotServed, error, raised};
use crate::worker::Worker;

/// A number, or one for each register.
#[derive(FromPyObject)]
pub(crate) enum Values {
    One(i32),
    Each(Vec<i32>),
}

impl Values {
    fn as_slice(&self) -> &[i32] {
        match self {
            Self::One(value) => std::slice::from_ref(value),
            Self::Each(values) => values,
        }
    }
}

/// A number, a text (chip id), or a list of them.
#[derive(IntoPyObject)]
pub(crate) enum Shown {
    Number(i64),
    Text(String),
    Each(Vec<Shown>),
}

impl From<&RegisterEntry> for Shown {
    fn from(entry: &RegisterEntry) -> Self {
        entry.value.parse().map_or_else(|_| Self::Text(entry.value.clone()), Self::Number)
    }
}

/// Reads the registers of a name.
pub(crate) fn get(py: Python<'_>, worker: &Worker, name: &str) -> PyResult<Shown> {
    let span = raised(py, parse(name))?;
    let snapshot = raised(py, worker.call(py, move |arm, _| arm.read_span(span))?)?;
    match entries(&snapshot).as_slice() {
        [only] => Ok(only.into()),
        several => Ok(Shown::Each(several.iter().map(Shown::from).collect())),
    }
}

/// Writes the registers of a name, and verifies them.
pub(crate) fn set(
    py: Python<'_>,
    worker: &Worker,
    name: &str,
    values: &Values,
    unlock: bool,
) -> PyResult<()> {
    let span = raised(py, parse(name))?;
    let bytes = raised(py, bytes(span, values.as_slice()))?;
    let unserved = worker.call(py, move |arm, _| span.addresses().find(|&address| !arm.serves(address)))?;
    if let Some(address) = unserved {
        let message = format!("this arm does not have {}", sevenbot::names::name_of_register(address));
        return Err(error::<NotServed>(py, &message, &[]));
    }
    let written = worker.call(py, move |arm, _| {
        if span.addresses().any(|address| TARGET_POSITION.holds(address) || FINE_TARGET.holds(address)) {
            arm.end_abandoned_stream()?;
        }
        arm.set_registers(span.address(), &bytes, unlock)?;
        let is_state = span.addresses().any(|address| MOTOR_STATE.holds(address));
        let joints = is_state.then(|| arm.joints()).transpose()?;
        Ok(joints.filter(|joints| !joints.is_driven()).map_or(0, |joints| joints.missing()))
    })?;
    warn_of_silent(py, raised::<_, MoveError>(py, written)?)
}

/// Without an answer it is unknown whether a motor is off.
fn warn_of_silent(py: Python<'_>, silent: u8) -> PyResult<()> {
    if silent == 0 {
        return Ok(());
    }
    let joints = sevenbot::register_text::joints(silent);
    let text = format!("no answer from the servos of {joints}: it is unknown whether they still hold");
    PyErr::warn(py, py.get_type::<PyUserWarning>().as_any(), &CString::new(text)?, 1)
}

/// The registers of an arm as a mapping from names to numbers: `arm.registers["speed.1"]`.
///
/// Names are those of docs/registers.md, in any case, shortened while they are unique, with `.3` for joint 3; or numbers
/// and ranges, `"54..60"`. Numbers are in the units of the table. Each access asks the arm, and each assignment is read
/// back.
#[pyclass(frozen, mapping, module = "sevenbot")]
pub(crate) struct Registers(Arc<Worker>);

impl Registers {
    pub(crate) const fn of(worker: Arc<Worker>) -> Self {
        Self(worker)
    }
}

/// What [`access()`] calls a register that must not be used.
const RESERVED: &str = "reserved";

fn names() -> Vec<String> {
    rows().filter(|row| access(row.access) != RESERVED).map(name_of).collect()
}

fn row(name: &str) -> Option<&'static Register> {
    let span: Span = parse(name).ok()?;
    rows().find(|row| row.holds(span.address()))
}

#[pymethods]
impl Registers {
    fn __getitem__(&self, py: Python<'_>, name: &str) -> PyResult<Shown> {
        get(py, &self.0, name)
    }

    fn __setitem__(&self, py: Python<'_>, name: &str, value: Values) -> PyResult<()> {
        set(py, &self.0, name, &value, false)
    }

    fn __contains__(&self, name: &str) -> bool {
        parse(name).is_ok()
    }

    fn __len__(&self) -> usize {
        names().len()
    }

    fn __iter__(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(self.keys().into_pyobject(py)?.call_method0("__iter__")?.unbind())
    }

    /// The names of all registers.
    fn keys(&self) -> Vec<String> {
        names()
    }

    /// What the register table says about a name: meaning, access, range and unit.
    fn describe(&self, py: Python<'_>, name: &str) -> PyResult<String> {
        raised(py, parse(name))?;
        let row = row(name).ok_or_else(|| PyKeyError::new_err(name.to_owned()))?;
        let meaning = sevenbot::table::description(row);
        let range = range(row).map_or_else(String::new, |(low, high)| format!(", {low} to {high}"));
        Ok(format!("{}: {meaning} ({}{range}{})", name_of(row), access(row.access), unit(row)))
    }

    fn __repr__(&self) -> String {
        format!("<Registers: {} names; `arm.registers['speed.1']`>", names().len())
    }
}

fn unit(row: &Register) -> String {
    match row.unit.symbol() {
        "" => String::new(),
        symbol => format!(", {symbol}"),
    }
}
