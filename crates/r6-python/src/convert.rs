//! Converts what the client reads to objects of `r6._types`. Times are seconds, positions are float64 arrays.

use std::collections::HashMap;
use std::time::Duration;

use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList, PyString, PyTuple};
use r6_client::{
    Accepted, Done, Followed, Found, Identity, LinkQuality, LinkState, NoReading, OperationMode, Pushed,
    Quality, QueryResult, SecondConnection, Snapshot, StandProof, Status, StopMeans, StopReport, Unmet,
};
use r6_program::{Mistake, Mistakes};
use r6_proto::Reading;
use r6_proto::axis::AXES;

use crate::raising::Raise;
use crate::record::{Record, array, class, query_result_class};

/// The number of axes and pose components that the client reads.
const READ_AXES: usize = 6;

/// The longest accepted time, seconds. No wait of a cell is longer than a month.
const LONGEST: f64 = 31.0 * 86_400.0;

/// Converts seconds to a duration.
pub fn seconds(what: &str, seconds: f64) -> PyResult<Duration> {
    if (0.0..=LONGEST).contains(&seconds) {
        Ok(Duration::from_secs_f64(seconds))
    } else {
        Err(PyValueError::new_err(format!("{what} has to be seconds, 0 or more: not {seconds}")))
    }
}

/// A position: six numbers, NaN for an unknown one.
fn position<'py>(py: Python<'py>, values: &[Option<f64>; AXES]) -> PyResult<Bound<'py, PyAny>> {
    array(py, values.iter().copied().take(READ_AXES))
}

fn mode_number(mode: Option<OperationMode>) -> Option<i64> {
    mode.map(OperationMode::number)
}

/// A reading as a Python object.
pub fn reading<'py>(py: Python<'py>, reading: Reading) -> PyResult<Bound<'py, PyAny>> {
    match reading {
        Reading::Text(text) => text.into_bound_py_any(py),
        Reading::Integer(number) => number.into_bound_py_any(py),
        Reading::Decimal(number) => number.into_bound_py_any(py),
        Reading::Word(word) => word.into_bound_py_any(py),
        Reading::Flag(flag) => flag.into_bound_py_any(py),
        Reading::Texts(texts) => texts.into_bound_py_any(py),
        Reading::Counter(counter) => Record::new(py, "Counter")?
            .with("id", counter.id)?
            .with("target", counter.target)?
            .with("current", counter.current)?
            .with("name", counter.name)?
            .build(),
    }
}

/// The values of a query, under the names that the caller used.
pub fn query_result<'py>(
    py: Python<'py>,
    names: Vec<Py<PyString>>,
    result: &QueryResult,
) -> PyResult<Bound<'py, PyAny>> {
    let values = PyDict::new(py);
    let missing = PyDict::new(py);
    for (name, (_, value)) in names.into_iter().zip(result.rows()) {
        match value {
            Ok(value) => values.set_item(name, reading(py, value.clone())?)?,
            Err(why @ (NoReading::Unsupported | NoReading::Unreadable(_))) => {
                missing.set_item(name, why.to_string())?;
            }
        }
    }
    query_result_class(py)?.call1((values, missing, result.took().as_secs_f64()))
}

/// A status of the robot at this address, with its unmet conditions.
pub fn status<'py>(py: Python<'py>, robot: &str, status: &Status) -> PyResult<Bound<'py, PyAny>> {
    let told =
        r6_api::Status::read(robot, None, status.list_is_unreadable, |address| status.reading(address));
    let told = serde_json::to_string(&told).map_err(|error| PyValueError::new_err(error.to_string()))?;
    Record::new(py, "Status")?
        .with("firmware", status.firmware.as_deref())?
        .with("machine_name", status.machine_name.as_deref())?
        .with("program", status.program.as_deref())?
        .with("mode", mode_number(status.mode))?
        .with("alarm", status.alarm)?
        .with("homed", status.homed)?
        .with("moving", status.moving)?
        .with("axis_count", status.axis_count)?
        .with("axes", position(py, &status.axes)?)?
        .with("pose", position(py, &status.pose)?)?
        .with("list_length", status.list_length)?
        .with("list_is_unreadable", status.list_is_unreadable)?
        .with("cycle", status.cycle)?
        .with("last_cycle", status.last_cycle)?
        .with("unmet", unmet(py, &status.unmet())?)?
        .with("unproved", unproved(py, status)?)?
        .with("_told", told)?
        .build()
}

/// The conditions that no value proves, in the words of `r6 status --json`.
fn unproved<'py>(py: Python<'py>, status: &Status) -> PyResult<Bound<'py, PyTuple>> {
    let unproved = status.unproved(None).into_iter().map(|unproved| r6_api::Unproved::of(unproved).word());
    PyTuple::new(py, unproved.collect::<Vec<_>>())
}

/// Unmet conditions, in the words of `r6 status --json`.
pub fn unmet<'py>(py: Python<'py>, unmet: &[Unmet]) -> PyResult<Bound<'py, PyTuple>> {
    let one = |unmet: &Unmet| {
        let r6_api::Unmet { condition, value, address, advice, .. } = r6_api::Unmet::of(unmet);
        Record::new(py, "Unmet")?
            .with("kind", condition.word())?
            .with("value", value)?
            .with("address", address)?
            .with("text", advice)?
            .build()
    };
    PyTuple::new(py, unmet.iter().map(one).collect::<PyResult<Vec<_>>>()?)
}

/// The end of a motion.
pub fn done<'py>(py: Python<'py>, done: &Done) -> PyResult<Bound<'py, PyAny>> {
    Record::new(py, "Done")?
        .with("axes", position(py, &done.axes)?)?
        .with("pose", position(py, &done.pose)?)?
        .with("mode", mode_number(done.mode))?
        .with("moved", done.moved)?
        .with("motion", done.motion)?
        .with("proof", done.proof.word())?
        .with("cut_short", done.proof.cut_short().map(ToString::to_string))?
        .with("took", done.took.as_secs_f64())?
        .build()
}

/// The end of following.
pub fn followed<'py>(py: Python<'py>, followed: &Followed) -> PyResult<Bound<'py, PyAny>> {
    Record::new(py, "Followed")?
        .with("steps", followed.steps)?
        .with("axes", position(py, &followed.axes)?)?
        .with("behind", followed.behind.map(r6_client::units::Degrees::value))?
        .build()
}

/// The controller accepted the request.
pub fn accepted(py: Python<'_>, accepted: Accepted) -> PyResult<Bound<'_, PyAny>> {
    Record::new(py, "Accepted")?
        .with("after", accepted.after.as_secs_f64())?
        .with("points", accepted.points)?
        .build()
}

/// The result of a stop.
pub fn stop_report<'py>(py: Python<'py>, report: &StopReport) -> PyResult<Bound<'py, PyAny>> {
    Record::new(py, "StopReport")?
        .with("confirmed", report.confirmed)?
        .with("proof", report.proof.map(StandProof::word))?
        .with("means", report.means.map(StopMeans::word))?
        .with("second_connection", report.second.as_ref().map(SecondConnection::word))?
        .with("in_doubt", report.doubt.as_ref().map(|doubt| doubt.still_open))?
        .with("attempts", report.attempts)?
        .with("took", report.took.as_secs_f64())?
        .with("robot", report.robot.as_ref().map(|robot| identity(py, robot)).transpose()?)?
        .with("connection", report.connection)?
        .with("moving", report.moving)?
        .with("mode", mode_number(report.mode))?
        .with("alarm", report.alarm)?
        .with("list_length", report.list_length)?
        .with("list", report.list.word())?
        .with("text", report.to_string())?
        .build()
}

/// The quality of the connection.
pub fn link_quality<'py>(py: Python<'py>, quality: &LinkQuality) -> PyResult<Bound<'py, PyAny>> {
    let state = match quality.state {
        LinkState::Alive => "alive",
        LinkState::Unknown => "unknown",
        LinkState::Suspect => "suspect",
        LinkState::Dead => "dead",
    };
    let latency = quality.latency.map(|latency| {
        Record::new(py, "Latency")?
            .with("count", latency.count)?
            .with("p50", latency.p50.as_secs_f64())?
            .with("p90", latency.p90.as_secs_f64())?
            .with("p99", latency.p99.as_secs_f64())?
            .with("max", latency.max.as_secs_f64())?
            .build()
    });
    Record::new(py, "LinkQuality")?
        .with("state", state)?
        .with("latency", latency.transpose()?)?
        .with("requests", quality.requests)?
        .with("replies", quality.replies)?
        .with("timeouts", quality.timeouts)?
        .with("lost", quality.lost)?
        .with("strays", quality.strays)?
        .with("garbled", quality.garbled)?
        .with("reconnects", quality.reconnects)?
        .with("last_reply", quality.last_reply.map(|age| age.as_secs_f64()))?
        .with("silent_for", quality.silent_for.map(|age| age.as_secs_f64()))?
        .build()
}

/// The mistakes of a file, in the order of their places.
pub fn mistakes<'py>(py: Python<'py>, mistakes: &Mistakes) -> PyResult<Bound<'py, PyTuple>> {
    let one = |mistake: &Mistake| {
        let (line, column) = mistake.at.unzip();
        Record::new(py, "Mistake")?
            .with("line", line)?
            .with("column", column)?
            .with("what", mistake.what.as_str())?
            .with("advice", mistake.advice.as_deref())?
            .build()
    };
    PyTuple::new(py, mistakes.iter().map(one).collect::<PyResult<Vec<_>>>()?)
}

/// The identity that a controller reports.
pub fn identity<'py>(py: Python<'py>, identity: &Identity) -> PyResult<Bound<'py, PyAny>> {
    Record::new(py, "Identity")?
        .with("firmware", identity.firmware.as_deref())?
        .with("machine_name", identity.machine_name.as_deref())?
        .with("axis_count", identity.axis_count)?
        .build()
}

/// Converts an object of `r6._types.Identity` back.
pub fn identity_from(object: &Bound<'_, PyAny>) -> PyResult<Identity> {
    if !object.is_instance(&class(object.py(), "Identity")?)? {
        return Err(pyo3::exceptions::PyTypeError::new_err("found has to be an r6.Identity"));
    }
    Ok(Identity {
        firmware: object.getattr("firmware")?.extract()?,
        machine_name: object.getattr("machine_name")?.extract()?,
        axis_count: object.getattr("axis_count")?.extract()?,
    })
}

fn found<'py>(py: Python<'py>, found: &Found) -> PyResult<Bound<'py, PyAny>> {
    Record::new(py, "Reconnected")?
        .with("identity", identity(py, &found.identity)?)?
        .with("another", found.another)?
        .with("mode", mode_number(found.mode))?
        .with("alarm", found.alarm)?
        .with("list_length", found.list_length)?
        .build()
}

/// An event on the connection.
pub fn pushed(py: Python<'_>, pushed: Pushed) -> PyResult<Bound<'_, PyAny>> {
    match pushed {
        Pushed::Photo { cam_id } => Record::new(py, "Photo")?.with("cam_id", cam_id)?.build(),
        Pushed::Stray { reason, frame } => Record::new(py, "Stray")?
            .with("text", reason.to_string())?
            .with("frame", PyBytes::new(py, &frame))?
            .build(),
        Pushed::BadFrame(error) => Record::new(py, "Garbled")?.with("text", error.to_string())?.build(),
        Pushed::NotJson(error) => Record::new(py, "Garbled")?.with("text", error.to_string())?.build(),
        Pushed::ConnectionLost(reason) => {
            Record::new(py, "ConnectionLost")?.with("text", reason.to_string())?.build()
        }
        Pushed::Reconnected(new) => found(py, &new),
    }
}

/// The values of a subscription, under the names that were subscribed to.
pub fn snapshot<'py>(
    py: Python<'py>,
    names: &[Py<PyString>],
    snapshot: &Snapshot,
) -> PyResult<Bound<'py, PyAny>> {
    let values = PyList::empty(py);
    for (name, value) in names.iter().zip(snapshot.values()) {
        let (quality, problem) = match &value.quality {
            Quality::Fresh => ("fresh", None),
            Quality::Stale => ("stale", None),
            Quality::Dead => ("dead", None),
            Quality::NotRead => ("not_read", None),
            Quality::Unsupported => ("unsupported", None),
            Quality::Unreadable(error) => ("unreadable", Some(error.to_string())),
        };
        let read = value.reading.clone().map(|value| reading(py, value)).transpose()?;
        let value = Record::new(py, "Value")?
            .with("address", name)?
            .with("reading", read)?
            .with("age", value.age.map(|age| age.as_secs_f64()))?
            .with("quality", quality)?
            .with("problem", problem)?
            .build()?;
        values.append(value)?;
    }
    let failure = snapshot.failure().map(|failure| failure.exception(py));
    class(py, "Snapshot")?.call1((PyTuple::new(py, values)?, failure))
}

/// Text for `repr`: a class and its fields.
pub fn repr(class: &str, fields: &[(&str, String)]) -> String {
    let fields: Vec<_> = fields.iter().map(|(name, value)| format!("{name}={value}")).collect();
    format!("{class}({})", fields.join(", "))
}

/// Finds a word in a closed set. The error names all words.
pub fn word<T: Copy>(what: &str, given: &str, words: &[(&str, T)]) -> PyResult<T> {
    let known: HashMap<_, _> = words.iter().copied().collect();
    known.get(given).copied().ok_or_else(|| {
        let all: Vec<_> = words.iter().map(|(word, _)| format!("`{word}`")).collect();
        PyValueError::new_err(format!("{what} has to be one of {}, not `{given}`", all.join(", ")))
    })
}
