//! Makes an exception of an error. `errors.rs` says which exception each error becomes.

use std::fmt::Display;

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyModule;

/// An error that becomes an exception.
pub trait Raise {
    /// The exception, or the error that prevents making it.
    fn exception(&self, py: Python<'_>) -> PyErr;
}

static ERRORS: PyOnceLock<Py<PyModule>> = PyOnceLock::new();

fn errors(py: Python<'_>) -> PyResult<&Bound<'_, PyModule>> {
    Ok(ERRORS.get_or_try_init(py, || PyModule::import(py, "r6._errors").map(Bound::unbind))?.bind(py))
}

/// A class of `r6._errors`.
pub fn error_class<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    errors(py)?.getattr(name)
}

/// Imports `r6._errors`, for the same reason as `record::load`.
pub fn load(py: Python<'_>) -> PyResult<()> {
    errors(py).map(drop)
}

/// Builds an exception with its text and its attributes.
pub struct Exception<'py>(PyResult<Bound<'py, PyAny>>);

impl<'py> Exception<'py> {
    /// An exception of this class of `r6._errors`.
    pub fn new(py: Python<'py>, class: &str, text: &dyn Display) -> Self {
        Self(errors(py).and_then(|errors| errors.getattr(class)?.call1((text.to_string(),))))
    }

    /// Sets an attribute.
    pub fn with(self, name: &str, value: impl IntoPyObject<'py>) -> Self {
        Self(self.0.and_then(|error| error.setattr(name, value).map(|()| error)))
    }

    /// Sets an attribute whose value may have failed.
    pub fn with_made(self, name: &str, value: PyResult<impl IntoPyObject<'py>>) -> Self {
        match value {
            Ok(value) => self.with(name, value),
            Err(why) => Self(Err(why)),
        }
    }

    /// Sets the exception that caused this one.
    pub fn from(self, cause: PyErr) -> Self {
        Self(self.0.and_then(|error| error.setattr("__cause__", cause).map(|()| error)))
    }

    /// The exception.
    pub fn build(self) -> PyErr {
        self.0.map_or_else(|why| why, PyErr::from_value)
    }
}

/// Converts the error of a result to an exception.
pub fn raise<T, E: Raise>(py: Python<'_>, result: Result<T, E>) -> PyResult<T> {
    result.map_err(|error| error.exception(py))
}
