//! What became of the arm, told to the exception that took its owner away.

use pyo3::exceptions::PyBaseException;
use pyo3::prelude::*;

use crate::errors::error_class;
use crate::record::class;

/// What became of a stop: a `StopReport`, or the exception of a stop that failed.
pub type Report<'py> = PyResult<Bound<'py, PyAny>>;

/// Tells the exception that ended the block of this motion what became of its arm.
///
/// A `MotionError` of this motion carries it. In the place of any other exception, that of another arm included, a stop that failed is
/// raised: nobody else would tell.
#[pyfunction]
#[pyo3(signature = (core, error, report))]
pub fn told(
    core: Option<&Bound<'_, PyAny>>,
    error: &Bound<'_, PyBaseException>,
    report: &Bound<'_, PyAny>,
) -> PyResult<()> {
    let py = error.py();
    let failed = report.is_instance_of::<PyBaseException>();
    let own = match core {
        Some(core) => {
            error.is_instance(&error_class(py, "MotionError")?)? && error.getattr("_core")?.is(core)
        }
        None => false,
    };
    if own {
        let before = error.getattr("stop")?;
        if before.is_none() {
            error.setattr("stop", report)?;
        } else if stands(&before)? && stands(report)? {
            // It stood already, and knows.
            return Ok(());
        }
    } else if failed {
        let failed = PyErr::from_value(report.clone());
        in_the_course_of(py, &failed, error)?;
        return Err(failed);
    }
    // Without a line of Python, where a signal could come through.
    let text = if failed { report.str()? } else { report.getattr("text")?.str()? };
    note(error, &text.to_cow()?);
    Ok(())
}

/// The same, with a stop that has just come to its end.
pub fn tell(
    core: Option<&Bound<'_, PyAny>>,
    error: &Bound<'_, PyBaseException>,
    report: Report<'_>,
) -> PyResult<()> {
    let py = error.py();
    match report {
        Ok(report) => told(core, error, &report),
        Err(failed) if failed.get_type(py).is_subclass(&error_class(py, "RequestError")?)? => {
            told(core, error, failed.value(py))
        }
        // It was no stop that failed: the process has forked.
        Err(other) => Err(other),
    }
}

/// Whether this is the error of a motion that ended because a stop was sent from here, and whose arm was seen to stand.
pub fn is_end_by_stop(py: Python<'_>, error: &Bound<'_, PyBaseException>) -> PyResult<bool> {
    Ok(error.is_instance(&error_class(py, "MotionError")?)?
        && error.getattr("cause")?.eq("stopped_here")?
        && stands(&error.getattr("stop")?)?)
}

/// Whether the owner of this motion asked for the stop that ended it so: nobody has to be told then.
#[pyfunction]
#[pyo3(signature = (core, error))]
pub fn ended_as_asked(core: &Bound<'_, PyAny>, error: &Bound<'_, PyBaseException>) -> PyResult<bool> {
    Ok(core.getattr("stop_asked")?.is_truthy()? && is_end_by_stop(core.py(), error)?)
}

/// Whether the arm was seen to stand.
fn stands(report: &Bound<'_, PyAny>) -> PyResult<bool> {
    Ok(report.is_instance(&class(report.py(), "StopReport")?)? && report.getattr("confirmed")?.is_truthy()?)
}

/// A line below the error where Python shows it, which it does from 3.11 on.
pub fn note(error: &Bound<'_, PyBaseException>, text: &str) {
    // An older Python has no such lines.
    drop(error.call_method1("add_note", (text,)));
}

/// What was raised while another exception was dealt with names that one, as Python does by itself where it raises.
pub fn in_the_course_of(py: Python<'_>, raised: &PyErr, of: &Bound<'_, PyBaseException>) -> PyResult<()> {
    let raised = raised.value(py);
    if !raised.is(of) && raised.getattr("__context__")?.is_none() {
        raised.setattr("__context__", of)?;
    }
    Ok(())
}
