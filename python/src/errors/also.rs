//! Exceptions of this package that are also exceptions of Python: `except ValueError` and `except sevenbot.Error` both work.

use std::io;

use pyo3::exceptions::{PyAttributeError, PyKeyError, PyOSError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::type_object::PyTypeInfo;
use pyo3::types::{PyDict, PyTuple, PyType};

use super::{Closed, Error};

type ExceptionClass = PyOnceLock<Py<PyType>>;

macro_rules! also {
    ($($name:ident($other:ty) = $class:ident: $doc:literal;)*) => {
        $(
            #[doc = $doc]
            pub(crate) struct $name;
            static $class: ExceptionClass = ExceptionClass::new();

            impl $name {
                pub(crate) fn class(py: Python<'_>) -> PyResult<Bound<'_, PyType>> {
                    let made = || {
                        let bases = (Error::type_object(py), <$other>::type_object(py));
                        made(py, stringify!($name), bases, $doc)
                    };
                    $class.get_or_try_init(py, made).map(|class| class.bind(py).clone())
                }

                #[doc = "The exception, with this message."]
                #[allow(dead_code, reason = "the exceptions of files have more than a message")]
                pub(crate) fn raise(py: Python<'_>, message: &str) -> PyErr {
                    raised(Self::class(py), (message.to_owned(),))
                }
            }
        )*

        /// Adds the exceptions to the module.
        pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
            $(module.add(stringify!($name), $name::class(module.py())?)?;)*
            // Not one of the public names.
            module.setattr("_of_both", wrap_pyfunction!(_of_both, module)?)
        }
    };
}

also! {
    InvalidValue(PyValueError) = INVALID_VALUE: "A value is out of range, or does not fit the others. Also a `ValueError`.";
    InvalidType(PyTypeError) = INVALID_TYPE: "An argument is of the wrong kind, or does not go with another one. Also a `TypeError`.";
    UnknownRegister(PyKeyError) = UNKNOWN_REGISTER: "There is no register of this name. Also a `KeyError`.";
    FileError(PyOSError) = FILE_ERROR: "A file cannot be read or written. Also the `OSError` of Python for the reason, such as `FileNotFoundError`.";
}

fn raised<'py>(class: PyResult<Bound<'py, PyType>>, arguments: impl pyo3::PyErrArguments + 'static) -> PyErr {
    match class {
        Ok(class) => PyErr::from_type(class, arguments),
        Err(error) => error,
    }
}

fn made<'py>(
    py: Python<'py>,
    name: &str,
    bases: (Bound<'py, PyType>, Bound<'py, PyType>),
    doc: &str,
) -> PyResult<Py<PyType>> {
    let contents = PyDict::new(py);
    contents.set_item("__module__", "sevenbot")?;
    contents.set_item("__doc__", doc)?;
    let class = py.get_type::<PyType>().call1((name, PyTuple::new(py, [bases.0, bases.1])?, contents))?;
    Ok(class.cast_into::<PyType>()?.unbind())
}

/// Makes a class with both base classes and the name of the first. It is not in the module, so it tells `pickle` how to make
/// it again.
fn both<'py>(ours: Bound<'py, PyType>, theirs: Bound<'py, PyType>) -> PyResult<Py<PyType>> {
    let py = ours.py();
    let (name, doc): (String, String) = (ours.name()?.extract()?, ours.getattr("__doc__")?.extract()?);
    let class = made(py, &name, (ours, theirs), &doc)?;
    // Python does not bind a Rust function to an instance, so `partialmethod` wraps it.
    let method = py.import("functools")?.call_method1("partialmethod", (wrap_pyfunction!(reduce, py)?,))?;
    class.bind(py).setattr("__reduce__", method)?;
    Ok(class)
}

/// `__reduce__` of a class that is both. Python's own class knows the arguments of the exception.
#[pyfunction]
fn reduce<'py>(error: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyTuple>> {
    let py = error.py();
    let (ours, theirs): (Bound<'py, PyAny>, Bound<'py, PyAny>) =
        error.get_type().getattr("__bases__")?.extract()?;
    let reduced = theirs.call_method1("__reduce__", (error,))?.cast_into::<PyTuple>()?.to_list();
    reduced.set_item(1, (ours, theirs, reduced.get_item(1)?))?;
    reduced.set_item(0, py.import("sevenbot._sevenbot")?.getattr("_of_both")?)?;
    Ok(reduced.to_tuple())
}

/// An exception that is both: what `pickle` calls.
#[pyfunction]
fn _of_both<'py>(
    ours: Bound<'py, PyType>,
    theirs: Bound<'py, PyType>,
    arguments: Bound<'py, PyTuple>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = ours.py();
    both(ours, theirs)?.bind(py).call1(arguments)
}

/// The exception of a file: a [`FileError`] that is also what Python raises for this reason.
pub(crate) fn file_error(py: Python<'_>, path: &std::path::Path, why: &io::Error) -> PyErr {
    let code = why.raw_os_error();
    let text = why.to_string();
    let text = text.split(" (os error").next().unwrap_or_default().to_owned();
    let raise = || -> PyResult<PyErr> {
        // `OSError` chooses its subclass by the error code.
        let theirs = py.get_type::<PyOSError>().call1((code, &text))?.get_type();
        let ours = FileError::class(py)?;
        let is_plain = ours.is_subclass(&theirs)?;
        let class = if is_plain { ours } else { both(ours, theirs)?.into_bound(py) };
        Ok(PyErr::from_type(class, (code, text, path.to_owned())))
    };
    raise().unwrap_or_else(|error| error)
}

/// Turns `Closed` into an error that is an `AttributeError` too, so that `hasattr` is false for attributes of a closed arm.
pub(crate) fn without_attribute(py: Python<'_>, error: PyErr) -> PyErr {
    static CLASS: ExceptionClass = ExceptionClass::new();
    if !error.is_instance_of::<Closed>(py) {
        return error;
    }
    let both = || both(Closed::type_object(py), PyAttributeError::type_object(py));
    let message = error.value(py).to_string();
    raised(CLASS.get_or_try_init(py, both).map(|class| class.bind(py).clone()), (message,))
}
