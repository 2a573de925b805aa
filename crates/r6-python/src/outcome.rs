//! Adds what became of the arm to an exception that ended the block of a motion.

use pyo3::exceptions::PyBaseException;
use pyo3::prelude::*;

use crate::raising::error_class;
use crate::record::class;

/// The result of a stop: a `StopReport`, or the exception of a stop that failed.
pub type Report<'py> = PyResult<Bound<'py, PyAny>>;

/// Adds what became of the arm to the exception that ended the block of its motion. A ``MotionError`` of
/// this motion carries the report. Any other exception gets a note. In its place this raises the error of
/// a stop that failed, because nothing else would report it.
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
            // The exception already says that the arm stands.
            return Ok(());
        }
    } else if failed {
        let failed = PyErr::from_value(report.clone());
        in_the_course_of(py, &failed, error)?;
        return Err(failed);
    }
    // This runs no line of Python, where a signal handler could run.
    let text = if failed { report.str()? } else { report.getattr("text")?.str()? };
    note(error, &text.to_cow()?);
    Ok(())
}

/// The same, for a stop that has just ended.
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
        // The stop did not fail: the process has forked.
        Err(other) => Err(other),
    }
}

/// Whether the error says that the motion ended because this program sent a stop, and that the arm was seen
/// to stand.
pub fn is_end_by_stop(py: Python<'_>, error: &Bound<'_, PyBaseException>) -> PyResult<bool> {
    Ok(error.is_instance(&error_class(py, "MotionError")?)?
        && error.getattr("cause")?.eq("stopped_here")?
        && stands(&error.getattr("stop")?)?)
}

/// Whether the owner of this motion asked for the stop that ended it, and the arm was seen to stand.
#[pyfunction]
#[pyo3(signature = (core, error))]
pub fn ended_as_asked(core: &Bound<'_, PyAny>, error: &Bound<'_, PyBaseException>) -> PyResult<bool> {
    Ok(core.getattr("stop_asked")?.is_truthy()? && is_end_by_stop(core.py(), error)?)
}

/// Whether the arm was seen to stand.
fn stands(report: &Bound<'_, PyAny>) -> PyResult<bool> {
    Ok(report.is_instance(&class(report.py(), "StopReport")?)? && report.getattr("confirmed")?.is_truthy()?)
}

/// Adds a line below the error. Python shows it from 3.11 on.
pub fn note(error: &Bound<'_, PyBaseException>, text: &str) {
    // Older Python versions have no `add_note`.
    drop(error.call_method1("add_note", (text,)));
}

/// Sets the context of an exception that was raised while another one was handled. Python does the same for
/// `raise`.
pub fn in_the_course_of(py: Python<'_>, raised: &PyErr, of: &Bound<'_, PyBaseException>) -> PyResult<()> {
    let raised = raised.value(py);
    if !raised.is(of) && raised.getattr("__context__")?.is_none() {
        raised.setattr("__context__", of)?;
    }
    Ok(())
}
