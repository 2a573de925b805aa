//! Values with units. A wrong unit is a `TypeError`.

use std::ops::Deref;

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::pyclass::CompareOp;
use pyo3::pyclass::boolean_struct::True;
use pyo3::types::{PyBool, PyList, PyTuple};
use pyo3::{Borrowed, IntoPyObjectExt, PyClass};
use r6_client::AxisIndex;
use r6_client::units;

use crate::numbers::{number, row, whole};
use crate::pickling::Reduced;
use crate::raising::raise;

/// An angle, degrees.
#[pyclass(frozen, module = "r6._r6")]
#[derive(Clone, Copy)]
pub struct Degrees(pub units::Degrees);

/// A length, millimetres.
#[pyclass(frozen, module = "r6._r6")]
#[derive(Clone, Copy)]
pub struct Millimetres(pub units::Millimetres);

/// A percentage of the maximum: the speed of a move, 0.1 to 100 in steps of 0.1; else ``OutOfRange``.
///
/// In an axis move at 100 % the axis that needs most time goes at its full speed. A linear move at 100 % goes
/// 2000 mm/s (reported). The global speed multiplies both.
#[pyclass(frozen, module = "r6._r6")]
#[derive(Clone, Copy)]
pub struct Percent(pub units::Percent);

/// The speed of the tool along its path, before the global speed: a whole number of mm/s, 1 to 10 000. A
/// ``float`` is a ``TypeError``, any other number ``OutOfRange``. A fraction raised alarm 219 (reported).
#[pyclass(frozen, module = "r6._r6")]
#[derive(Clone, Copy)]
pub struct MillimetresPerSecond(pub units::MillimetresPerSecond);

/// An argument that must have its unit.
pub struct Given<T> {
    value: T,
}

impl<T> Deref for Given<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<'py, T: Unit> FromPyObject<'_, 'py> for Given<T> {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        match given.cast::<T>() {
            Ok(value) => Ok(Self { value: *value.get() }),
            Err(_) => Err(no_unit(&format!("{} is wanted", T::NAME), &given, T::made_of)),
        }
    }
}

/// A class of values with units.
pub trait Unit: PyClass<Frozen = True> + Copy + Sync {
    /// The code to write in place of a plain number.
    fn made_of(number: &str) -> String {
        format!("r6.{}({number})", Self::NAME)
    }
}

impl Unit for Degrees {}
impl Unit for Millimetres {}
impl Unit for Percent {}
impl Unit for MillimetresPerSecond {}

impl Unit for AxisPosition {
    fn made_of(number: &str) -> String {
        format!("r6.AxisPosition.degrees([{number}])")
    }
}

impl Unit for Pose {
    fn made_of(_number: &str) -> String {
        "r6.Pose.mm_deg([x, y, z])".to_owned()
    }
}

/// The error for a value with no unit or another unit. For a plain number it says what to write instead.
fn no_unit(what: &str, given: &Bound<'_, PyAny>, instead: impl FnOnce(&str) -> String) -> PyErr {
    let class = given.get_type();
    let name = class.name().map_or_else(|_| "this".to_owned(), |name| name.to_string());
    PyTypeError::new_err(match (given.is_instance_of::<PyBool>(), given.extract::<f64>()) {
        (false, Ok(number)) => {
            format!(
                "{what}, not the plain number {number}, whose unit is unknown: write {}",
                instead(&number.to_string())
            )
        }
        (false, Err(_)) if given.is_instance_of::<PyList>() || given.is_instance_of::<PyTuple>() => {
            let text = given.str().map_or_else(|_| String::new(), |text| text.to_string());
            let numbers = text.trim_matches(['[', ']', '(', ')']);
            format!("{what}, not {name}: write {}", instead(if numbers.len() <= 60 { numbers } else { "…" }))
        }
        (true, _) | (false, Err(_)) => format!("{what}, not {name}"),
    })
}

#[pymethods]
impl Degrees {
    #[new]
    fn new(value: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(units::Degrees(number(value)?)))
    }

    /// The number alone.
    #[getter]
    fn value(&self) -> f64 {
        self.0.value()
    }

    /// The same angle, with full turns added or subtracted, that is nearest to another: at most half a
    /// turn from it. For U, V and W, and for an axis that may turn further. It is not for an axis whose
    /// limits leave no choice.
    fn nearest_to(&self, present: &Self) -> Self {
        Self(self.0.nearest_to(present.0))
    }

    fn __add__(&self, other: &Self) -> Self {
        Self(self.0 + other.0)
    }

    fn __sub__(&self, other: &Self) -> Self {
        Self(self.0 - other.0)
    }

    fn __mul__(&self, times: f64) -> Self {
        Self(self.0 * times)
    }

    fn __rmul__(&self, times: f64) -> Self {
        Self(self.0 * times)
    }

    fn __neg__(&self) -> Self {
        Self(-self.0)
    }

    fn __abs__(&self) -> Self {
        Self(self.0.abs())
    }

    fn __richcmp__(&self, other: &Self, op: CompareOp) -> bool {
        compare(self.value(), other.value(), op)
    }

    fn __hash__(&self) -> u64 {
        hash(self.value())
    }

    fn __getnewargs__(&self) -> (f64,) {
        (self.value(),)
    }

    fn __repr__(&self) -> String {
        format!("Degrees({:?})", self.value())
    }

    fn __str__(&self) -> String {
        self.0.to_string()
    }
}

#[pymethods]
impl Millimetres {
    #[new]
    fn new(value: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(units::Millimetres(number(value)?)))
    }

    /// The number alone.
    #[getter]
    fn value(&self) -> f64 {
        self.0.value()
    }

    fn __add__(&self, other: &Self) -> Self {
        Self(self.0 + other.0)
    }

    fn __sub__(&self, other: &Self) -> Self {
        Self(self.0 - other.0)
    }

    fn __mul__(&self, times: f64) -> Self {
        Self(self.0 * times)
    }

    fn __rmul__(&self, times: f64) -> Self {
        Self(self.0 * times)
    }

    fn __neg__(&self) -> Self {
        Self(-self.0)
    }

    fn __abs__(&self) -> Self {
        Self(self.0.abs())
    }

    fn __richcmp__(&self, other: &Self, op: CompareOp) -> bool {
        compare(self.value(), other.value(), op)
    }

    fn __hash__(&self) -> u64 {
        hash(self.value())
    }

    fn __getnewargs__(&self) -> (f64,) {
        (self.value(),)
    }

    fn __repr__(&self) -> String {
        format!("Millimetres({:?})", self.value())
    }

    fn __str__(&self) -> String {
        self.0.to_string()
    }
}

impl Percent {
    /// A percentage of this number.
    pub fn made(py: Python<'_>, value: f64) -> PyResult<Self> {
        raise(py, units::Percent::new(value)).map(Self)
    }
}

#[pymethods]
impl Percent {
    #[new]
    fn new(py: Python<'_>, value: &Bound<'_, PyAny>) -> PyResult<Self> {
        Self::made(py, number(value)?)
    }

    /// The number alone.
    #[getter]
    fn value(&self) -> f64 {
        self.0.value()
    }

    fn __richcmp__(&self, other: &Self, op: CompareOp) -> bool {
        compare(self.value(), other.value(), op)
    }

    fn __hash__(&self) -> u64 {
        hash(self.value())
    }

    fn __getnewargs__(&self) -> (f64,) {
        (self.value(),)
    }

    fn __repr__(&self) -> String {
        format!("Percent({:?})", self.value())
    }

    fn __str__(&self) -> String {
        self.0.to_string()
    }
}

#[pymethods]
impl MillimetresPerSecond {
    #[new]
    fn new(py: Python<'_>, value: &Bound<'_, PyAny>) -> PyResult<Self> {
        raise(py, units::MillimetresPerSecond::new(whole(value)?)).map(Self)
    }

    /// The number alone.
    #[getter]
    fn value(&self) -> f64 {
        self.0.value()
    }

    fn __richcmp__(&self, other: &Self, op: CompareOp) -> bool {
        compare(self.value(), other.value(), op)
    }

    fn __hash__(&self) -> u64 {
        hash(self.value())
    }

    fn __getnewargs__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        // A whole number, as the caller gave it.
        PyTuple::new(py, [self.value().into_bound_py_any(py)?.call_method0("__int__")?])
    }

    fn __repr__(&self) -> String {
        format!("MillimetresPerSecond({})", self.value())
    }

    fn __str__(&self) -> String {
        self.0.to_string()
    }
}

/// NaN equals nothing, as everywhere in Python.
fn compare(a: f64, b: f64, op: CompareOp) -> bool {
    match (a.partial_cmp(&b), op) {
        (Some(ordering), op) => op.matches(ordering),
        (None, op) => matches!(op, CompareOp::Ne),
    }
}

fn hash(value: f64) -> u64 {
    // 0.0 and -0.0 are equal, so they must have the same hash.
    (value + 0.0).to_bits()
}

/// A set of axes, by their numbers: 0 (J1) to 7 (J8).
#[pyclass(frozen, module = "r6._r6", eq, hash)]
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct AxisMask(u8);

#[pymethods]
impl AxisMask {
    #[new]
    #[pyo3(signature = (*axes))]
    fn new(axes: Vec<u8>) -> PyResult<Self> {
        let mut mask = r6_client::AxisMask::NONE;
        for number in axes {
            mask = mask.with(axis(number)?);
        }
        Ok(Self(mask.bits()))
    }

    /// Bit n is axis n, as in ``ckStatus``.
    #[getter]
    fn bits(&self) -> u8 {
        self.0
    }

    /// The numbers of its axes.
    #[getter]
    fn axes(&self) -> Vec<usize> {
        // `usize`, because a list of `u8` becomes `bytes` in Python.
        r6_client::AxisMask::from_bits(self.0).axes().map(AxisIndex::index).collect()
    }

    fn __contains__(&self, number: u8) -> bool {
        AxisIndex::new(number).is_some_and(|axis| r6_client::AxisMask::from_bits(self.0).contains(axis))
    }

    fn __getnewargs__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.axes())
    }

    fn __repr__(&self) -> String {
        let axes: Vec<_> = self.axes().iter().map(usize::to_string).collect();
        format!("AxisMask({})", axes.join(", "))
    }
}

/// An axis by its number, 0 for J1.
pub fn axis(number: u8) -> PyResult<AxisIndex> {
    AxisIndex::new(number).ok_or_else(|| {
        PyValueError::new_err(format!("an axis is a number from 0 (J1) to 7 (J8), not {number}"))
    })
}

/// Positions of one to eight axes. An axis that is not named does not move.
#[pyclass(frozen, module = "r6._r6", eq)]
#[derive(Clone, Copy, PartialEq)]
pub struct AxisPosition(pub units::AxisPosition);

#[pymethods]
impl AxisPosition {
    #[new]
    fn new() -> Self {
        Self(units::AxisPosition::none())
    }

    /// Positions of J1 and the next axes: 1 to 8 bare numbers, shape (n,), degrees.
    #[staticmethod]
    fn degrees(angles: &Bound<'_, PyAny>) -> PyResult<Self> {
        of_degrees(&row(angles)?).map(Self)
    }

    /// A copy with another position of one axis, 0 for J1; ``Millimetres`` for a linear axis.
    fn with_axis(&self, axis: u8, to: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(self.0.with(self::axis(axis)?, coordinate(to)?)))
    }

    /// The position of this axis, 0 for J1; ``None`` if it is not named.
    fn at<'py>(&self, py: Python<'py>, axis: u8) -> PyResult<Option<Bound<'py, PyAny>>> {
        let coordinate = |to| match to {
            units::AxisCoordinate::Degrees(angle) => Ok(Bound::new(py, Degrees(angle))?.into_any()),
            units::AxisCoordinate::Millimetres(length) => Ok(Bound::new(py, Millimetres(length))?.into_any()),
        };
        self.0.at(self::axis(axis)?).map(coordinate).transpose()
    }

    /// The named axes.
    #[getter]
    fn mask(&self) -> AxisMask {
        AxisMask(self.0.mask().bits())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> Reduced<'py> {
        self.reduced(py)
    }

    fn __repr__(&self) -> String {
        let named =
            AxisIndex::ALL.into_iter().filter_map(|axis| Some(format!("{axis}: {}", self.0.at(axis)?)));
        format!("AxisPosition({})", named.collect::<Vec<_>>().join(", "))
    }
}

/// Reads `Degrees` or `Millimetres`.
pub fn coordinate(to: &Bound<'_, PyAny>) -> PyResult<units::AxisCoordinate> {
    if let Ok(angle) = to.cast::<Degrees>() {
        Ok(angle.get().0.into())
    } else if let Ok(length) = to.cast::<Millimetres>() {
        Ok(length.get().0.into())
    } else {
        let what = "an axis goes to Degrees or Millimetres";
        let instead = |value: &str| format!("r6.Degrees({value}) or r6.Millimetres({value})");
        Err(no_unit(what, to, instead))
    }
}

/// Positions of J1 and the next axes, degrees.
pub fn of_degrees(angles: &[f64]) -> PyResult<units::AxisPosition> {
    if angles.is_empty() || angles.len() > AxisIndex::ALL.len() {
        let many = angles.len();
        return Err(PyValueError::new_err(format!("an arm has one to eight axes, not {many}")));
    }
    let axes = AxisIndex::ALL.into_iter().zip(angles);
    Ok(axes.fold(units::AxisPosition::none(), |position, (axis, angle)| {
        position.with(axis, units::Degrees(*angle))
    }))
}

/// U, V, W.
type Turn<'a> = (PyRef<'a, Degrees>, PyRef<'a, Degrees>, PyRef<'a, Degrees>);

/// Position and orientation of the tool, in the work frame; or only its position.
///
/// +180° and −180° are the same orientation and a full turn of the wrist apart. Give the value nearer to
/// the present one (``nearest_to``), or use ``position``.
#[pyclass(frozen, module = "r6._r6", eq)]
#[derive(Clone, Copy, PartialEq)]
pub struct Pose(pub units::Pose);

#[pymethods]
impl Pose {
    #[new]
    fn new(
        x: Given<Millimetres>,
        y: Given<Millimetres>,
        z: Given<Millimetres>,
        u: Given<Degrees>,
        v: Given<Degrees>,
        w: Given<Degrees>,
    ) -> Self {
        Self(units::Pose::new([x.0, y.0, z.0], [u.0, v.0, w.0]))
    }

    /// X, Y, Z, each a ``Millimetres``; the tool keeps its orientation. ``mm_deg`` takes bare numbers.
    #[staticmethod]
    fn position(x: Given<Millimetres>, y: Given<Millimetres>, z: Given<Millimetres>) -> Self {
        Self(units::Pose::position([x.0, y.0, z.0]))
    }

    /// X, Y, Z in mm, shape (3,), or X, Y, Z, U, V, W in mm and degrees, shape (6,): bare numbers.
    #[staticmethod]
    fn mm_deg(values: &Bound<'_, PyAny>) -> PyResult<Self> {
        of_mm_deg(&row(values)?).map(Self)
    }

    /// X, Y, Z.
    #[getter]
    fn place(&self) -> (Millimetres, Millimetres, Millimetres) {
        self.0.place().map(Millimetres).into()
    }

    /// U, V, W, if they are given.
    #[getter]
    fn turn(&self) -> Option<(Degrees, Degrees, Degrees)> {
        self.0.turn().map(|turn| turn.map(Degrees).into())
    }

    /// The components that are given.
    #[getter]
    fn mask(&self) -> AxisMask {
        AxisMask(self.0.mask().bits())
    }

    /// The same pose with each of U, V and W as near as possible to the present values (``world-3`` to
    /// ``world-5``). A real arm that read U −180 and was sent to +180 turned its wrist the long way round
    /// (reported). A pose without an orientation does not change.
    fn nearest_to(&self, present: Turn<'_>) -> Self {
        Self(self.0.nearest_to([present.0.0, present.1.0, present.2.0]))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> Reduced<'py> {
        self.reduced(py)
    }

    fn __repr__(&self) -> String {
        format!("Pose({})", self.0)
    }
}

/// A pose of three or six numbers.
pub fn of_mm_deg(values: &[f64]) -> PyResult<units::Pose> {
    match *values {
        [x, y, z] => Ok(units::Pose::position([x, y, z].map(units::Millimetres))),
        [x, y, z, u, v, w] => {
            Ok(units::Pose::new([x, y, z].map(units::Millimetres), [u, v, w].map(units::Degrees)))
        }
        _ => {
            let many = values.len();
            Err(PyValueError::new_err(format!("a pose has 3 or 6 components, not {many}")))
        }
    }
}
