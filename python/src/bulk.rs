//! Many numbers at once: numpy arrays if numpy is installed, or else tuples and lists.

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};

/// Rows of seven angles: an array of shape (n, 7), or a tuple of lists.
pub(crate) fn angles<'py>(py: Python<'py>, rows: &[[f64; 7]]) -> PyResult<Bound<'py, PyAny>> {
    match py.import("numpy") {
        Ok(numpy) => array(py, &numpy, rows.as_flattened())?.call_method1("reshape", ((rows.len(), 7),)),
        Err(_) => Ok(PyTuple::new(py, rows.iter().copied())?.into_any()),
    }
}

/// Numbers: an array of one dimension, or a tuple.
pub(crate) fn numbers<'py>(py: Python<'py>, numbers: &[f64]) -> PyResult<Bound<'py, PyAny>> {
    match py.import("numpy") {
        Ok(numpy) => array(py, &numpy, numbers),
        Err(_) => Ok(PyTuple::new(py, numbers)?.into_any()),
    }
}

fn array<'py>(py: Python<'py>, numpy: &Bound<'py, PyModule>, numbers: &[f64]) -> PyResult<Bound<'py, PyAny>> {
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_ne_bytes()).collect();
    // The array of `frombuffer` is read-only.
    numpy.call_method1("frombuffer", (PyBytes::new(py, &bytes),))?.call_method0("copy")
}
