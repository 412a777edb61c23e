//! Registers by their names, with the numbers of the register table.

use std::ffi::CString;
use std::sync::Arc;

use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use sevenbot::map::{FINE_TARGET, MOTOR_STATE, TARGET_POSITION};
use sevenbot::moves::MoveError;
use sevenbot::names::{name_of, parse};
use sevenbot::register_text::{RegisterEntry, entries};
use sevenbot::register_values::bytes;
use sevenbot::table::{access, range, rows};
use sevenbot::{Register, Span};

use crate::errors::{NotServed, UnknownRegister, error, raised};
use crate::numbers::Values;
use crate::worker::Worker;

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
    let read = move |arm: &mut sevenbot::Arm| check_served(arm, span).map(|()| arm.read_span(span));
    let snapshot = worker.read(py, read)?.map_err(|address| not_served(py, address))?;
    let snapshot = raised(py, snapshot)?;
    match entries(&snapshot).as_slice() {
        [only] => Ok(only.into()),
        several => Ok(Shown::Each(several.iter().map(Shown::from).collect())),
    }
}

/// Writes the registers of a name, and verifies them. A write of targets first ends a stream that a program has left; a write
/// that switches the motors off warns of silent servos.
pub(crate) fn set(
    py: Python<'_>,
    worker: &Worker,
    name: &str,
    values: &Values,
    unlock: bool,
) -> PyResult<()> {
    let span = raised(py, parse(name))?;
    let bytes = raised(py, bytes(span, values.as_slice()))?;
    let served = worker.call(py, move |arm, _| check_served(arm, span))?;
    served.map_err(|address| not_served(py, address))?;
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

/// Fails with the first register that the arm does not have.
fn check_served(arm: &sevenbot::Arm, span: Span) -> Result<(), u8> {
    span.addresses().find(|&address| !arm.serves(address)).map_or(Ok(()), Err)
}

fn not_served(py: Python<'_>, address: u8) -> PyErr {
    let message = format!("this arm does not have {}", sevenbot::names::name_of_register(address));
    error::<NotServed>(py, &message, &[])
}

/// Warns of servos that did not answer when the motors were switched off: it is unknown whether theirs are off.
fn warn_of_silent(py: Python<'_>, silent: u8) -> PyResult<()> {
    if silent == 0 {
        return Ok(());
    }
    let joints = sevenbot::register_text::joints(silent);
    let text = format!("no answer from the servos of {joints}: it is unknown whether they still hold");
    PyErr::warn(py, py.get_type::<PyUserWarning>().as_any(), &CString::new(text)?, 1)
}

/// The text that [`access()`] returns for a register that must not be used.
const RESERVED: &str = "reserved";

/// The names of the registers that this arm has, each once.
pub(crate) fn readable_names(arm: &sevenbot::Arm) -> Vec<String> {
    let mut names = Vec::new();
    for row in rows().filter(|row| access(row.access) != RESERVED) {
        let name = name_of(row);
        let is_served =
            span_of(&name).is_some_and(|span| span.addresses().all(|address| arm.serves(address)));
        if is_served && !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

fn span_of(name: &str) -> Option<Span> {
    parse(name).ok().filter(|span| span.count() > 0)
}

fn row(name: &str) -> Option<&'static Register> {
    let span: Span = parse(name).ok()?;
    rows().find(|row| row.holds(span.address()))
}

/// The registers of an arm as a mapping from names to numbers: `arm.registers["speed.1"]`.
///
/// Names are those of docs/registers.md, in any case, shortened while they are unique, with `.3` for joint 3; or numbers
/// and ranges, `"54..60"`. Numbers are in the units of the table. Each access asks the arm, and each assignment is read
/// back. `keys()` has the full names that this arm has, and `dict(arm.registers)` all their values.
#[pyclass(frozen, mapping, module = "sevenbot")]
pub(crate) struct Registers {
    worker: Arc<Worker>,
    names: Arc<[String]>,
}

impl Registers {
    pub(crate) const fn of(worker: Arc<Worker>, names: Arc<[String]>) -> Self {
        Self { worker, names }
    }
}

#[pymethods]
impl Registers {
    fn __getitem__(&self, py: Python<'_>, name: &str) -> PyResult<Shown> {
        get(py, &self.worker, name)
    }

    fn __setitem__(&self, py: Python<'_>, name: &str, value: Values) -> PyResult<()> {
        set(py, &self.worker, name, &value, false)
    }

    fn __contains__(&self, name: &str) -> bool {
        row(name).is_some_and(|row| self.names.contains(&name_of(row)))
    }

    fn __len__(&self) -> usize {
        self.names.len()
    }

    fn __iter__(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(self.keys().into_pyobject(py)?.call_method0("__iter__")?.unbind())
    }

    /// The names of the registers that this arm has.
    fn keys(&self) -> Vec<String> {
        self.names.to_vec()
    }

    /// The values of all registers, in the order of `keys()`.
    fn values(&self, py: Python<'_>) -> PyResult<Vec<Shown>> {
        self.names.iter().map(|name| get(py, &self.worker, name)).collect()
    }

    /// The names and the values of all registers.
    fn items(&self, py: Python<'_>) -> PyResult<Vec<(String, Shown)>> {
        Ok(self.keys().into_iter().zip(self.values(py)?).collect())
    }

    /// The value of a register, or `default` if there is none of this name.
    #[pyo3(signature = (name, default = None))]
    fn get(&self, py: Python<'_>, name: &str, default: Option<Py<PyAny>>) -> PyResult<Py<PyAny>> {
        match (self.__contains__(name), default) {
            (true, _) => Ok(get(py, &self.worker, name)?.into_pyobject(py)?.unbind()),
            (false, default) => Ok(default.unwrap_or_else(|| py.None())),
        }
    }

    fn _ipython_key_completions_(&self) -> Vec<String> {
        self.keys()
    }

    /// What the register table says about a name: meaning, access, range and unit.
    fn describe(&self, py: Python<'_>, name: &str) -> PyResult<String> {
        raised(py, parse(name))?;
        let row = row(name).ok_or_else(|| {
            let text = format!("{name} is not in the register table: `list(arm.registers)` has the names");
            UnknownRegister::raise(py, &text)
        })?;
        let meaning = sevenbot::table::description(row);
        let range = range(row).map_or_else(String::new, |(low, high)| format!(", {low} to {high}"));
        Ok(format!("{}: {meaning} ({}{range}{})", name_of(row), access(row.access), unit(row)))
    }

    fn __repr__(&self) -> String {
        format!("<Registers: {} names; `arm.registers['speed.1']`>", self.names.len())
    }
}

fn unit(row: &Register) -> String {
    match row.unit.symbol() {
        "" => String::new(),
        symbol => format!(", {symbol}"),
    }
}
