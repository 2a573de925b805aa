//! `Envelope`: the limits of a list.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use r6_client::units::AxisCoordinate;

use crate::motion::Motion;
use crate::pickling::not_pickled;
use crate::raising::raise;
use crate::units::{Degrees, Given, Millimetres, MillimetresPerSecond, Percent, axis, coordinate};

/// The limits of a list. A limit that is not set is not checked. Each method returns a new envelope.
///
/// Speeds are those of the list, before the global speed. Axis limits apply to the targets of axis moves,
/// the workspace to those of linear and curve moves, because the client cannot convert between them
/// without a model of the arm. A value that cannot be determined counts as a violation. The envelope
/// compares numbers with numbers and is no safety function.
#[pyclass(frozen, module = "r6._r6", eq)]
#[derive(Clone, Default, PartialEq)]
pub struct Envelope(pub r6_client::Envelope);

type Corner<'a> = (PyRef<'a, Millimetres>, PyRef<'a, Millimetres>, PyRef<'a, Millimetres>);

#[pymethods]
impl Envelope {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    fn __and__(&self, other: &Self) -> Self {
        Self(self.0.clone().and(other.0.clone()))
    }

    /// No move is faster than this.
    fn speed_cap(&self, cap: Given<Percent>) -> Self {
        Self(self.0.clone().speed_cap(cap.0))
    }

    /// No path speed is higher than this.
    fn path_speed_cap(&self, cap: Given<MillimetresPerSecond>) -> Self {
        Self(self.0.clone().path_speed_cap(cap.0))
    }

    /// No axis move takes this axis, 0 for J1, beyond these limits.
    fn axis_limits(&self, axis: u8, lowest: &Bound<'_, PyAny>, highest: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (lowest, highest) = (coordinate(lowest)?, coordinate(highest)?);
        let turns = |to: AxisCoordinate| matches!(to, AxisCoordinate::Degrees(_));
        if turns(lowest) != turns(highest) {
            return Err(PyTypeError::new_err("both limits of an axis have one unit"));
        }
        Ok(Self(self.0.clone().axis_limits(self::axis(axis)?, lowest, highest)))
    }

    /// No linear or curve move leaves this box: X, Y, Z, in the work frame in use.
    fn workspace(&self, lowest: Corner<'_>, highest: Corner<'_>) -> Self {
        let corner = |corner: Corner<'_>| [corner.0.0, corner.1.0, corner.2.0];
        Self(self.0.clone().workspace(corner(lowest), corner(highest)))
    }

    /// No axis move turns an axis by more than this, from the present position and from target to
    /// target.
    fn largest_axis_step(&self, largest: Given<Degrees>) -> Self {
        Self(self.0.clone().largest_axis_step(largest.0))
    }

    /// No linear or curve move ends further than this from its start.
    fn largest_distance(&self, largest: Given<Millimetres>) -> Self {
        Self(self.0.clone().largest_distance(largest.0))
    }

    /// Only these actions: 4 axis move, 10 linear move, 17 curve move, 51 path speed, 52 stop on a signal,
    /// 100 wait, 200 output, 204 outputs of a board, 800 workbench.
    #[pyo3(signature = (*actions))]
    fn only(&self, actions: Vec<i64>) -> Self {
        Self(self.0.clone().only(actions))
    }

    /// Raises ``OutsideEnvelope`` for the first step that violates a limit. The way from the present
    /// position is not checked.
    fn check_motion(&self, py: Python<'_>, motion: PyRef<'_, Motion>) -> PyResult<()> {
        raise(py, motion.0.instructions().map(drop))?;
        raise(py, self.0.check_motion(&motion.0))
    }

    fn __copy__(&self) -> Self {
        self.clone()
    }

    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(not_pickled("Envelope"))
    }

    fn __repr__(&self) -> String {
        format!("<{:?}>", self.0)
    }
}
