//! numpy arrays of many arms, read and written in place.
//!
//! The crate `numpy` uses numpy's own interface, which works with the stable ABI of Python 3.10. Python's buffer protocol is
//! part of the stable ABI only from Python 3.11 on.

use numpy::{
    Element, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray2, PyReadonlyArrayDyn,
    PyReadwriteArray2, PyUntypedArray, PyUntypedArrayMethods, dtype,
};
use pyo3::exceptions::PyImportError;
use pyo3::prelude::*;

use crate::errors::{InvalidType, InvalidValue};
use crate::numbers::{elements, seed};

/// The rows and columns of an array.
pub(crate) type Shape = [usize; 2];

/// Imports numpy. Fails with the command that installs it.
pub(crate) fn numpy(py: Python<'_>) -> PyResult<Bound<'_, PyModule>> {
    let missing = |_| PyImportError::new_err("many arms need numpy: pip install sevenbot[numpy]");
    py.import("numpy").map_err(missing)
}

/// Is it an array of float32?
pub(crate) fn is_single(object: &Bound<'_, PyAny>) -> bool {
    let array = object.cast::<PyUntypedArray>();
    array.is_ok_and(|array| array.dtype().is_equiv_to(&dtype::<f32>(object.py())))
}

/// Numbers in rows, as an array without gaps: the object itself if it is one, or else a copy.
pub(crate) fn given<'py, T: Element>(
    object: &Bound<'py, PyAny>,
    shape: Shape,
    what: &str,
) -> PyResult<PyReadonlyArray2<'py, T>> {
    let py = object.py();
    let [rows, columns] = shape;
    let array = numpy(py)?.call_method1("ascontiguousarray", (object, dtype::<T>(py)));
    let no_numbers = |_| {
        InvalidType::raise(py, &format!("{what}: use an array of numbers of the shape ({rows}, {columns})"))
    };
    let array = array.map_err(no_numbers)?;
    let array =
        array.cast_into::<PyArray2<T>>().map_err(|error| wrong_shape(&error.into_inner(), shape, what))?;
    if array.shape() != shape {
        return Err(wrong_shape(&array, shape, what));
    }
    array.try_readonly().map_err(|_| in_use(py, what))
}

/// The array `out` of the caller, which is filled in place; a new array if there is none.
pub(crate) fn out<'py, T: Element>(
    py: Python<'py>,
    object: Option<&Bound<'py, PyAny>>,
    shape: Shape,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let Some(object) = object else { return Ok(PyArray2::zeros(py, shape, false)) };
    let array = object.cast::<PyArray2<T>>().ok().filter(|array| array.is_c_contiguous());
    let array = array.ok_or_else(|| {
        let text = "out: use an array of two dimensions, float32 or float64, without gaps";
        InvalidType::raise(py, text)
    })?;
    if array.shape() == shape { Ok(array.clone()) } else { Err(wrong_shape(array, shape, "out")) }
}

/// Borrows the array `out` for writing. Fails if it is read-only or in use.
pub(crate) fn writing<'py, T: Element>(
    array: &Bound<'py, PyArray2<T>>,
) -> PyResult<PyReadwriteArray2<'py, T>> {
    array.try_readwrite().map_err(|_| in_use(array.py(), "out"))
}

fn wrong_shape(object: &Bound<'_, PyAny>, [rows, columns]: Shape, what: &str) -> PyErr {
    let found = object.getattr("shape").map(|shape| shape.to_string()).unwrap_or_default();
    let text = format!("{what}: the shape is {found}: use ({rows}, {columns})");
    InvalidValue::raise(object.py(), &text)
}

fn in_use(py: Python<'_>, what: &str) -> PyErr {
    let reasons = "the array is read-only, is both argument and result, or is used by another thread";
    InvalidValue::raise(py, &format!("{what}: {reasons}: pass a copy, array.copy()"))
}

/// The exception for an array with gaps, which cannot be used as a slice.
pub(crate) fn gaps<E>(py: Python<'_>) -> impl Fn(E) -> PyErr {
    move |_| InvalidValue::raise(py, "an array has gaps: use numpy.ascontiguousarray")
}

/// A mask of all arms: `None`, or as many truth values as there are arms.
pub(crate) fn mask(object: Option<&Bound<'_, PyAny>>, count: usize) -> PyResult<Option<Vec<bool>>> {
    let Some(object) = object else { return Ok(None) };
    let py = object.py();
    let wrong = || InvalidType::raise(py, &format!("mask: use {count} truth values, or None for all arms"));
    let array = numpy(py)?.call_method1("asarray", (object,)).map_err(|_| wrong())?;
    let array = array.cast_into::<PyArray1<bool>>().map_err(|_| wrong())?;
    let chosen = array.try_readonly().map_err(|_| in_use(py, "mask"))?.as_array().to_vec();
    if chosen.len() == count { Ok(Some(chosen)) } else { Err(wrong()) }
}

/// One number for all arms, or one for each.
pub(crate) fn each_number(numbers: &Bound<'_, PyAny>, count: usize, what: &str) -> PyResult<Vec<f64>> {
    let py = numbers.py();
    let wrong = || InvalidType::raise(py, &format!("{what}: use a number, or {count} for the arms"));
    let array = numpy(py)?.call_method1("asarray", (numbers, "float64")).map_err(|_| wrong())?;
    let array: PyReadonlyArrayDyn<'_, f64> = array.extract().map_err(|_| wrong())?;
    let numbers = array.as_array();
    match (numbers.ndim(), numbers.first()) {
        (0, Some(&one)) => Ok(vec![one; count]),
        (1, _) if numbers.len() == count => Ok(numbers.iter().copied().collect()),
        _ => Err(wrong()),
    }
}

/// The seeds of `count` arms: those given, or the first one and the next numbers.
pub(crate) fn seeds(
    count: usize,
    first: Option<&Bound<'_, PyAny>>,
    each: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<u64>> {
    if let Some(each) = each {
        let wrong = || InvalidType::raise(each.py(), &format!("seeds: use {count} whole numbers"));
        let each = elements(each, count)?.filter(|each| each.len() == count).ok_or_else(wrong)?;
        return each.iter().map(seed).collect();
    }
    let first = first.map_or(Ok(1), seed)?;
    Ok((0..count).zip(0_u64..).map(|(_, number)| first.wrapping_add(number)).collect())
}

/// Converts a number to the nearest whole number of steps; a unit has `steps` of them. Fails if the number is out of range.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the range")]
pub(crate) fn steps(
    py: Python<'_>,
    name: &str,
    number: f64,
    range: std::ops::RangeInclusive<f64>,
    steps: f64,
) -> PyResult<u16> {
    if range.contains(&number) {
        return Ok((number * steps).round() as u16);
    }
    let (low, high) = range.into_inner();
    Err(InvalidValue::raise(py, &format!("{name}: {number} is out of range: use {low} to {high}")))
}
