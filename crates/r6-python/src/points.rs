//! Input and output points by their names on the pendant, as the steps of a motion use them.

use std::collections::HashMap;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use r6_client::{BoardOutput, IoPoint, OutputKind, PointKind, WaitSource, WrongPoint};

/// Reads the name of a point on the pendant.
pub fn named(name: &str) -> PyResult<IoPoint> {
    name.parse::<IoPoint>().map_err(|error| PyValueError::new_err(error.to_string()))
}

/// A point that was checked by the instruction it is for.
fn checked<T>(name: &str, check: impl FnOnce(IoPoint) -> Result<T, WrongPoint>) -> PyResult<IoPoint> {
    let point = named(name)?;
    check(point).map(|_| point).map_err(wrong)
}

fn wrong(why: WrongPoint) -> PyErr {
    PyValueError::new_err(why.to_string())
}

/// An output of action 200, which reaches the first board.
pub fn output(name: &str) -> PyResult<IoPoint> {
    checked(name, OutputKind::of)
}

/// An output that has pulses.
pub fn pulsed(name: &str) -> PyResult<IoPoint> {
    let point = output(name)?;
    if point.kind == PointKind::Y { Ok(point) } else { Err(wrong(WrongPoint::HasNoPulse(point))) }
}

/// Outputs of action 204: many of one board, which is Y0, Y1, M0 or M1.
pub fn outputs(points: HashMap<String, bool>) -> PyResult<Vec<(IoPoint, bool)>> {
    let points =
        points.into_iter().map(|(name, on)| Ok((named(&name)?, on))).collect::<PyResult<Vec<_>>>()?;
    BoardOutput::of(points.iter().copied()).map(|_| points).map_err(wrong)
}

/// What a wait can wait for.
pub fn awaited(name: &str) -> PyResult<IoPoint> {
    checked(name, WaitSource::of)
}

/// An input that can stop a move.
pub fn stopping(name: &str) -> PyResult<IoPoint> {
    let point = named(name)?;
    if point.kind == PointKind::X && point.board == 0 {
        Ok(point)
    } else {
        Err(wrong(WrongPoint::StopsNoMove(point)))
    }
}

/// Board and point of `modifyOutput`.
pub fn for_command(name: &str) -> PyResult<(u8, u8)> {
    let point = named(name)?;
    point.for_command().ok_or_else(|| match point.kind {
        PointKind::X | PointKind::Eux => wrong(WrongPoint::IsInput(point)),
        PointKind::Y => wrong(WrongPoint::BeyondBoard { point, last: 3 }),
        PointKind::M => wrong(WrongPoint::BeyondBoard { point, last: 2 }),
        PointKind::Euy => wrong(WrongPoint::NotTogether(point)),
    })
}

/// The query address of the word that a point is a bit of, and which bit: ``("input-0", 2)`` for X012.
#[pyfunction]
pub fn word_of(name: &str) -> PyResult<(String, u8)> {
    let point = named(name)?;
    let none = || PyValueError::new_err(format!("no query address tells EU points such as {point}"));
    Ok((point.address().ok_or_else(none)?.to_string(), point.point))
}
