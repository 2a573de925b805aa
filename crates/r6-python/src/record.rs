//! Makes Python objects of the classes that `python/r6` defines.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyModule};
use pyo3::{IntoPyObjectExt, intern};

static TYPES: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
static NUMPY: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
static QUERY_RESULT: PyOnceLock<Py<PyAny>> = PyOnceLock::new();

fn module<'py>(
    py: Python<'py>,
    cell: &'static PyOnceLock<Py<PyModule>>,
    name: &str,
) -> PyResult<&'py Bound<'py, PyModule>> {
    Ok(cell.get_or_try_init(py, || PyModule::import(py, name).map(Bound::unbind))?.bind(py))
}

/// Imports the modules. Later lookups need no lock, which a child of a fork might find held.
pub fn load(py: Python<'_>) -> PyResult<()> {
    module(py, &TYPES, "r6._types")?;
    query_result_class(py)?;
    numpy(py).map(drop)
}

/// `r6._types.QueryResult`. It is used most often, so it is looked up once.
pub fn query_result_class(py: Python<'_>) -> PyResult<&Bound<'_, PyAny>> {
    Ok(QUERY_RESULT.get_or_try_init(py, || class(py, "QueryResult").map(Bound::unbind))?.bind(py))
}

/// A class of `r6._types`.
pub fn class<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    module(py, &TYPES, "r6._types")?.getattr(name)
}

/// numpy.
pub fn numpy<'py>(py: Python<'py>) -> PyResult<&'py Bound<'py, PyModule>> {
    module(py, &NUMPY, "numpy")
}

/// A float64 array of numbers, NaN for a missing one.
pub fn array<'py>(
    py: Python<'py>,
    numbers: impl IntoIterator<Item = Option<f64>>,
) -> PyResult<Bound<'py, PyAny>> {
    let numbers: Vec<f64> = numbers.into_iter().map(|number| number.unwrap_or(f64::NAN)).collect();
    numpy(py)?.getattr(intern!(py, "array"))?.call1((numbers, intern!(py, "float64")))
}

/// Builds an object of a data class, field by field.
pub struct Record<'py> {
    class: Bound<'py, PyAny>,
    fields: Bound<'py, PyDict>,
}

impl<'py> Record<'py> {
    /// Begins an object of this class of `r6._types`.
    pub fn new(py: Python<'py>, name: &str) -> PyResult<Self> {
        Ok(Self { class: class(py, name)?, fields: PyDict::new(py) })
    }

    /// Sets a field.
    pub fn with(self, name: &str, value: impl IntoPyObject<'py>) -> PyResult<Self> {
        let value = value.into_bound_py_any(self.fields.py())?;
        self.fields.set_item(name, value)?;
        Ok(self)
    }

    /// The object.
    pub fn build(self) -> PyResult<Bound<'py, PyAny>> {
        self.class.call((), Some(&self.fields))
    }
}
