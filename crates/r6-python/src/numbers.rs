//! Reads bare numbers, as degrees and millimetres are given: numbers and arrays of numbers, and nothing that
//! only looks like a number.
//!
//! numpy converts texts, dates and flags to numbers, and ignores which elements of an array are masked. An
//! arm must not go to such a target.

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{
    PyBool, PyByteArray, PyBytes, PyDate, PyDelta, PyList, PyMemoryView, PyString, PyTime, PyTuple,
};

use crate::record::numpy;

/// How deep nested lists are checked. A path is a list of rows; numpy reports the error in deeper lists.
const DEPTH: usize = 3;

/// One number: an `int`, a `float`, or numpy's versions of these.
pub fn number(value: &Bound<'_, PyAny>) -> PyResult<f64> {
    all_numbers(value, 0)?;
    value.extract().map_err(|_| wanted("a number", value))
}

/// A whole number: an `int`, or numpy's versions of it.
pub fn whole(value: &Bound<'_, PyAny>) -> PyResult<u32> {
    all_numbers(value, 0)?;
    value.extract()
}

/// A row of numbers: everything that numpy can make an array of shape (n,) from.
pub fn row(values: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let (numbers, shape) = array(values)?;
    match shape.as_slice() {
        [_] => Ok(numbers),
        _ => Err(PyValueError::new_err(format!("the shape has to be (n,), not {shape:?}"))),
    }
}

/// Rows of numbers: everything that numpy can make an array of shape (n, k) from.
pub fn rows(values: &Bound<'_, PyAny>) -> PyResult<Vec<Vec<f64>>> {
    let (numbers, shape) = array(values)?;
    match shape.as_slice() {
        [_, columns] if *columns > 0 => Ok(numbers.chunks(*columns).map(<[f64]>::to_vec).collect()),
        _ => Err(PyValueError::new_err(format!("the shape has to be (n, k), not {shape:?}"))),
    }
}

/// The numbers of an array in order, and its shape. Values with units are not accepted.
fn array(values: &Bound<'_, PyAny>) -> PyResult<(Vec<f64>, Vec<usize>)> {
    all_numbers(values, DEPTH)?;
    let numpy = numpy(values.py())?;
    // The first conversion keeps the type, which separates numbers from texts, dates and flags. The second
    // makes floats.
    let seen = numpy.call_method1("asarray", (values,))?;
    is_of_numbers(&seen)?;
    let array = numpy.call_method1("ascontiguousarray", (&seen, "float64"))?;
    let shape = array.getattr("shape")?.extract()?;
    let bytes: Vec<u8> = array.call_method0("tobytes")?.extract()?;
    let (numbers, _rest) = bytes.as_chunks();
    Ok((numbers.iter().map(|bytes| f64::from_ne_bytes(*bytes)).collect(), shape))
}

/// Refuses values that are no numbers but that numpy would convert to numbers.
fn all_numbers(value: &Bound<'_, PyAny>, depth: usize) -> PyResult<()> {
    if value.is_instance_of::<PyBool>()
        || value.is_instance_of::<PyString>()
        || value.is_instance_of::<PyBytes>()
        || value.is_instance_of::<PyByteArray>()
        || value.is_instance_of::<PyMemoryView>()
        || value.is_instance_of::<PyDate>()
        || value.is_instance_of::<PyTime>()
        || value.is_instance_of::<PyDelta>()
    {
        return Err(wanted("numbers", value));
    }
    let numpy = numpy(value.py())?;
    if value.is_instance(&numpy.getattr("ndarray")?)? {
        let masked = numpy.getattr("ma")?.call_method1("is_masked", (value,))?;
        if masked.is_truthy()? {
            return Err(PyTypeError::new_err(
                "masked elements are no numbers: fill them, or leave their rows out, before this",
            ));
        }
        return is_of_numbers(value);
    }
    if value.is_instance(&numpy.getattr("generic")?)? {
        return is_of_numbers(value);
    }
    match depth.checked_sub(1) {
        Some(depth) if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() => {
            value.try_iter()?.try_for_each(|value| all_numbers(&value?, depth))
        }
        Some(_) | None => Ok(()),
    }
}

/// Refuses an array or a numpy value that does not hold numbers. An empty array passes.
fn is_of_numbers(array: &Bound<'_, PyAny>) -> PyResult<()> {
    let dtype = array.getattr("dtype")?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    let empty = array.getattr("size")?.extract::<usize>()? == 0;
    if empty || matches!(kind.as_str(), "i" | "u" | "f") {
        return Ok(());
    }
    if kind == "O" {
        // Other kinds of numbers, such as fractions. Each must have a float.
        return array.call_method0("ravel")?.try_iter()?.try_for_each(|value| {
            let value = value?;
            all_numbers(&value, 0)?;
            value.extract::<f64>().map(drop).map_err(|_| wanted("numbers", &value))
        });
    }
    Err(PyTypeError::new_err(format!("degrees and millimetres are given as bare numbers, not as {dtype}")))
}

fn wanted(what: &str, value: &Bound<'_, PyAny>) -> PyErr {
    let kind = value.get_type();
    let kind = kind.name().map_or_else(|_| "this".to_owned(), |name| name.to_string());
    PyTypeError::new_err(format!("degrees and millimetres are given as {what}, int or float, not as {kind}"))
}
