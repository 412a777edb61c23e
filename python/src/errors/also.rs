//! Exceptions of this package that are one of Python's own, too: `except ValueError` and `except sevenbot.Error` both work.

use std::io;

use pyo3::exceptions::{PyAttributeError, PyKeyError, PyOSError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::type_object::PyTypeInfo;
use pyo3::types::{PyDict, PyTuple, PyType};

use super::{Closed, Error};

type Class = PyOnceLock<Py<PyType>>;

macro_rules! also {
    ($($name:ident($other:ty) = $class:ident: $doc:literal;)*) => {
        $(
            #[doc = $doc]
            pub(crate) struct $name;
            static $class: Class = Class::new();

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
            Ok(())
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

/// The exception of a file: a [`FileError`] that is also what Python raises for this reason.
pub(crate) fn file_error(py: Python<'_>, path: &std::path::Path, why: &io::Error) -> PyErr {
    let code = why.raw_os_error();
    let text = why.to_string();
    let text = text.split(" (os error").next().unwrap_or_default().to_owned();
    let raise = || -> PyResult<PyErr> {
        // Python chooses the class by the code.
        let theirs = py.get_type::<PyOSError>().call1((code, &text))?.get_type();
        let ours = FileError::class(py)?;
        let is_plain = ours.is_subclass(&theirs)?;
        let class =
            if is_plain { ours } else { made(py, "FileError", (ours, theirs), "A file.")?.into_bound(py) };
        Ok(PyErr::from_type(class, (code, text, path.to_owned())))
    };
    raise().unwrap_or_else(|error| error)
}

/// Turns `Closed` into an error that is an `AttributeError` too, so that `hasattr` is false for attributes of a closed arm.
pub(crate) fn without_attribute(py: Python<'_>, error: PyErr) -> PyErr {
    static CLASS: Class = Class::new();
    if !error.is_instance_of::<Closed>(py) {
        return error;
    }
    let made = || made(py, "Closed", (Closed::type_object(py), PyAttributeError::type_object(py)), "Closed.");
    let message = error.value(py).to_string();
    raised(CLASS.get_or_try_init(py, made).map(|class| class.bind(py).clone()), (message,))
}
