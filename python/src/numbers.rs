//! Numbers of Python, single or in lists, tuples, arrays and other ordered collections. Texts and bytes are not numbers.

use std::time::Duration;

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyDict, PyFrozenSet, PySet, PyString};

use crate::errors::{InvalidType, InvalidValue};

pub(crate) type PoseDegrees = (f64, f64, f64, f64, f64, f64, f64);

/// The most rows that are read: many more than a recording has.
const MOST_ROWS: usize = 10_000_000;

/// The elements of a list, a tuple, an array or another ordered collection, at most one more than `most`. `None` for
/// something else. Fails with what the user's own iterator raises.
pub(crate) fn elements<'py>(
    object: &Bound<'py, PyAny>,
    most: usize,
) -> PyResult<Option<Vec<Bound<'py, PyAny>>>> {
    let is_text = object.is_instance_of::<PyString>()
        || object.is_instance_of::<PyBytes>()
        || object.is_instance_of::<PyByteArray>();
    let has_no_order = object.is_instance_of::<PyDict>()
        || object.is_instance_of::<PySet>()
        || object.is_instance_of::<PyFrozenSet>();
    if is_text || has_no_order {
        return Ok(None);
    }
    match object.try_iter() {
        Ok(elements) => elements.take(most.saturating_add(1)).collect::<PyResult<_>>().map(Some),
        Err(error) if error.is_instance_of::<PyTypeError>(object.py()) => Ok(None),
        Err(error) => Err(error),
    }
}

/// A number, also of numpy and of torch. Not a text.
pub(crate) fn real(number: &Bound<'_, PyAny>) -> Option<f64> {
    number.extract().ok()
}

/// A number, or one for each register.
pub(crate) enum Values {
    One(i32),
    Each(Vec<i32>),
}

impl Values {
    pub(crate) fn as_slice(&self) -> &[i32] {
        match self {
            Self::One(value) => std::slice::from_ref(value),
            Self::Each(values) => values,
        }
    }
}

impl<'py> FromPyObject<'_, 'py> for Values {
    type Error = PyErr;

    fn extract(values: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let wrong = || {
            InvalidType::raise(
                values.py(),
                "a register takes a whole number, several a list of whole numbers",
            )
        };
        match elements(&values, 256)? {
            Some(each) => each
                .iter()
                .map(|value| whole(value).ok_or_else(wrong))
                .collect::<PyResult<_>>()
                .map(Self::Each),
            None => whole(&values).map(Self::One).ok_or_else(wrong),
        }
    }
}

/// A whole number. One outside the range of `i32` becomes `i32::MAX`, which no register takes.
fn whole(number: &Bound<'_, PyAny>) -> Option<i32> {
    let index = number.call_method0("__index__").ok()?;
    Some(index.extract().unwrap_or(i32::MAX))
}

/// Numbers, of any length.
pub(crate) struct Numbers(pub(crate) Vec<f64>);

impl<'py> FromPyObject<'_, 'py> for Numbers {
    type Error = PyErr;

    fn extract(numbers: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let found = elements(&numbers, MOST_ROWS)?.and_then(|each| each.iter().map(real).collect());
        found
            .map(Self)
            .ok_or_else(|| InvalidType::raise(numbers.py(), "times are a list or an array of numbers"))
    }
}

pub(crate) struct Rows(pub(crate) Vec<[f64; 7]>);

impl<'py> FromPyObject<'_, 'py> for Rows {
    type Error = PyErr;

    fn extract(rows: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let wrong = || InvalidType::raise(rows.py(), "angles are rows of seven numbers");
        let rows = elements(&rows, MOST_ROWS)?.ok_or_else(wrong)?;
        let row = |row: &Bound<'py, PyAny>| {
            let numbers: Option<Vec<f64>> =
                elements(row, 7)?.and_then(|each| each.iter().map(real).collect());
            numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(wrong)
        };
        rows.iter().map(row).collect::<PyResult<_>>().map(Self)
    }
}

/// A seed: any number of 64 bits.
pub(crate) fn seed(number: &Bound<'_, PyAny>) -> PyResult<u64> {
    let wrong = |_| InvalidValue::raise(number.py(), "a seed is a whole number, 0 to 2**64 - 1");
    number.extract().map_err(wrong)
}

/// A time in seconds, at most a day.
pub(crate) fn duration(py: Python<'_>, seconds: f64) -> PyResult<Duration> {
    const LONGEST: Duration = Duration::from_secs(86_400);
    let time = Duration::try_from_secs_f64(seconds).ok().filter(|time| *time <= LONGEST);
    time.ok_or_else(|| InvalidValue::raise(py, &format!("{seconds} s: use 0 to 86400 seconds")))
}
