//! Input and output points by their names on the pendant, as the steps of a motion use them.

use std::collections::HashMap;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use r6_client::{BoardOutput, OutputBoard, OutputKind, WaitSource};
use r6_proto::io_point::{IoPoint, PairMask, PointKind};

/// The number of points in each of the two masks of action 204.
const HALF: u8 = 16;

/// Reads the name of a point on the pendant.
pub fn named(name: &str) -> PyResult<IoPoint> {
    name.parse::<IoPoint>().map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Reads an output of action 200, which only has the first board.
pub fn output(name: &str) -> PyResult<(OutputKind, u8)> {
    let IoPoint { kind, board, point } = named(name)?;
    let kind = match kind {
        PointKind::Y => OutputKind::Y,
        PointKind::M => OutputKind::M,
        PointKind::Euy => OutputKind::Euy,
        PointKind::X | PointKind::Eux => {
            return Err(PyValueError::new_err(format!("{name} is an input: outputs are Y, M and EUY")));
        }
    };
    if board != 0 {
        return Err(PyValueError::new_err(format!("a motion sets points of the first board, not {name}")));
    }
    Ok((kind, point))
}

/// Reads outputs of action 204: several outputs of one board, which is Y0, Y1, M0 or M1.
pub fn outputs(points: HashMap<String, bool>) -> PyResult<BoardOutput> {
    let mut found: Option<BoardOutput> = None;
    for (name, on) in points {
        let IoPoint { kind, board, point } = named(&name)?;
        let board = match (kind, board) {
            (PointKind::Y, 0 | 1) => OutputBoard::Y(board),
            (PointKind::M, 0 | 1) => OutputBoard::M(board),
            (PointKind::X | PointKind::Y | PointKind::M | PointKind::Eux | PointKind::Euy, _) => {
                return Err(PyValueError::new_err(format!(
                    "a motion sets boards of Y and M, the first two of each, not {name}"
                )));
            }
        };
        let none = PairMask::default();
        let output = found.get_or_insert(BoardOutput { board, low: none, high: none });
        if output.board != board {
            return Err(PyValueError::new_err(format!("all points have to be of one board: {name} is not")));
        }
        match point.checked_sub(HALF) {
            None => output.low = output.low.with(point, on),
            Some(point) => output.high = output.high.with(point, on),
        }
    }
    found.ok_or_else(|| PyValueError::new_err("no point was named"))
}

/// Reads a point that a wait can wait for.
pub fn source(name: &str) -> PyResult<WaitSource> {
    let IoPoint { kind, board, point } = named(name)?;
    match kind {
        PointKind::X => Ok(WaitSource::Input { board, point }),
        PointKind::M => Ok(WaitSource::M { board, point }),
        PointKind::Eux => Ok(WaitSource::Eu { point }),
        PointKind::Y | PointKind::Euy => {
            Err(PyValueError::new_err(format!("{name} is an output: a wait is for X, M or EUX")))
        }
    }
}
