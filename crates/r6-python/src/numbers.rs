//! Bare numbers, as degrees and millimetres are given: numbers and arrays of numbers, and nothing that only looks like one.
//!
//! numpy makes numbers of texts, dates and flags, and forgets which elements of an array are masked. An arm must not go there.

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{
    PyBool, PyByteArray, PyBytes, PyDate, PyDelta, PyList, PyMemoryView, PyString, PyTime, PyTuple,
};

use crate::record::numpy;

/// How deep lists of lists are looked through: a path is a list of rows, and numpy says what is wrong with more.
const DEPTH: usize = 3;

/// One number: an `int`, a `float`, or what numpy has of both.
pub fn number(value: &Bound<'_, PyAny>) -> PyResult<f64> {
    all_numbers(value, 0)?;
    value.extract().map_err(|_| wanted("a number", value))
}

/// A whole number: an `int`, or what numpy has of it.
pub fn whole(value: &Bound<'_, PyAny>) -> PyResult<u32> {
    all_numbers(value, 0)?;
    value.extract()
}

/// A row of numbers, whatever numpy makes an array of shape (n,) from.
pub fn row(values: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let (numbers, shape) = array(values)?;
    match shape.as_slice() {
        [_] => Ok(numbers),
        _ => Err(PyValueError::new_err(format!("the shape has to be (n,), not {shape:?}"))),
    }
}

/// Rows of numbers: whatever numpy makes an array of shape (n, k) from.
pub fn rows(values: &Bound<'_, PyAny>) -> PyResult<Vec<Vec<f64>>> {
    let (numbers, shape) = array(values)?;
    match shape.as_slice() {
        [_, columns] if *columns > 0 => Ok(numbers.chunks(*columns).map(<[f64]>::to_vec).collect()),
        _ => Err(PyValueError::new_err(format!("the shape has to be (n, k), not {shape:?}"))),
    }
}

/// The numbers of an array in their order, and its shape. Values with units are no bare numbers.
fn array(values: &Bound<'_, PyAny>) -> PyResult<(Vec<f64>, Vec<usize>)> {
    all_numbers(values, DEPTH)?;
    let numpy = numpy(values.py())?;
    // Once as numpy sees it, which tells texts, dates and flags from numbers; then as degrees or millimetres.
    let seen = numpy.call_method1("asarray", (values,))?;
    is_of_numbers(&seen)?;
    let array = numpy.call_method1("ascontiguousarray", (&seen, "float64"))?;
    let shape = array.getattr("shape")?.extract()?;
    let bytes: Vec<u8> = array.call_method0("tobytes")?.extract()?;
    let (numbers, _rest) = bytes.as_chunks();
    Ok((numbers.iter().map(|bytes| f64::from_ne_bytes(*bytes)).collect(), shape))
}

/// Refuses what numpy would make a number of, and what is none.
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

/// Refuses an array, or one of numpy's own values, that does not hold numbers. An array without an element holds nothing wrong.
fn is_of_numbers(array: &Bound<'_, PyAny>) -> PyResult<()> {
    let dtype = array.getattr("dtype")?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    let empty = array.getattr("size")?.extract::<usize>()? == 0;
    if empty || matches!(kind.as_str(), "i" | "u" | "f") {
        return Ok(());
    }
    if kind == "O" {
        // Numbers of other kinds, such as fractions: each is looked at, and numpy asks each for its float.
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
