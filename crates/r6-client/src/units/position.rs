//! Positions of axes and tool.

use std::fmt;

use r6_proto::axis::{AXES, AxisIndex, AxisMask};
use r6_proto::message::instruction::Coordinates;

use crate::units::{Degrees, Millimetres};

/// The position of one axis: an angle, or a length for a sliding axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisCoordinate {
    /// The axis turns.
    Degrees(Degrees),
    /// The axis slides.
    Millimetres(Millimetres),
}

/// The unit of each axis of a step. Axes in neither mask were given as bare numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct AxisUnits {
    /// Degrees.
    pub turning: AxisMask,
    /// Millimetres.
    pub sliding: AxisMask,
}

impl AxisCoordinate {
    /// The number alone, as in `axis-n` and `m0` to `m7`.
    #[must_use]
    pub const fn value(self) -> f64 {
        match self {
            Self::Degrees(Degrees(value)) | Self::Millimetres(Millimetres(value)) => value,
        }
    }
}

impl From<Degrees> for AxisCoordinate {
    fn from(angle: Degrees) -> Self {
        Self::Degrees(angle)
    }
}

impl From<Millimetres> for AxisCoordinate {
    fn from(length: Millimetres) -> Self {
        Self::Millimetres(length)
    }
}

impl fmt::Display for AxisCoordinate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Degrees(angle) => angle.fmt(f),
            Self::Millimetres(length) => length.fmt(f),
        }
    }
}

/// The position of one to eight axes. An axis that is not named does not move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisPosition {
    coordinates: [Option<AxisCoordinate>; AXES],
}

impl AxisPosition {
    /// A position of no axis, to be extended by [`Self::with`].
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// The position of J1 and the axes that follow it, in degrees. More than eight values do not compile.
    #[must_use]
    pub fn degrees<const N: usize>(angles: [f64; N]) -> Self {
        const { assert!(N >= 1 && N <= AXES, "an arm has one to eight axes") };
        let mut position = Self::none();
        for (slot, angle) in position.coordinates.iter_mut().zip(angles) {
            *slot = Some(Degrees(angle).into());
        }
        position
    }

    /// Returns the position with one axis changed: [`Degrees`], or [`Millimetres`] for a sliding axis.
    #[must_use]
    pub fn with(mut self, axis: AxisIndex, to: impl Into<AxisCoordinate>) -> Self {
        if let Some(slot) = self.coordinates.get_mut(axis.index()) {
            *slot = Some(to.into());
        }
        self
    }

    /// The position of this axis, if it is named.
    #[must_use]
    pub fn at(&self, axis: AxisIndex) -> Option<AxisCoordinate> {
        self.coordinates.get(axis.index()).copied().flatten()
    }

    /// The axes that are named.
    #[must_use]
    pub fn mask(&self) -> AxisMask {
        let named = AxisIndex::ALL.into_iter().filter(|axis| self.at(*axis).is_some());
        named.fold(AxisMask::NONE, AxisMask::with)
    }

    pub(crate) fn coordinates(&self) -> Coordinates {
        all_eight(|axis| self.at(axis).map(AxisCoordinate::value))
    }

    /// The unit of each axis.
    pub(crate) fn units(&self) -> AxisUnits {
        let mut units = AxisUnits::default();
        for axis in AxisIndex::ALL {
            match self.at(axis) {
                Some(AxisCoordinate::Degrees(_)) => units.turning = units.turning.with(axis),
                Some(AxisCoordinate::Millimetres(_)) => units.sliding = units.sliding.with(axis),
                None => {}
            }
        }
        units
    }
}

/// The position of the tool in the work frame, with or without its orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    place: [Millimetres; 3],
    turn: Option<[Degrees; 3]>,
}

impl Pose {
    /// A pose with X, Y, Z and U, V, W.
    ///
    /// +180° and −180° are the same orientation, but a full turn of the wrist apart. Give the value that is
    /// nearer to the present one, or use [`Self::position`].
    #[must_use]
    pub const fn new(place: [Millimetres; 3], turn: [Degrees; 3]) -> Self {
        Self { place, turn: Some(turn) }
    }

    /// A pose with X, Y, Z only. The tool keeps its orientation.
    #[must_use]
    pub const fn position(place: [Millimetres; 3]) -> Self {
        Self { place, turn: None }
    }

    /// X, Y, Z.
    #[must_use]
    pub const fn place(&self) -> [Millimetres; 3] {
        self.place
    }

    /// U, V, W, if they are given.
    #[must_use]
    pub const fn turn(&self) -> Option<[Degrees; 3]> {
        self.turn
    }

    /// The components that are given.
    #[must_use]
    pub const fn mask(&self) -> AxisMask {
        match self.turn {
            Some(_) => AxisMask::SIX,
            None => AxisMask::POSITION,
        }
    }

    pub(crate) fn coordinates(&self) -> Coordinates {
        let turn = self.turn.unwrap_or_default();
        let values: Vec<f64> =
            self.place.iter().map(|mm| mm.0).chain(turn.iter().map(|degrees| degrees.0)).collect();
        all_eight(|axis| values.get(axis.index()).copied())
    }
}

impl fmt::Display for Pose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.place;
        write!(f, "X {x}, Y {y}, Z {z}")?;
        match self.turn {
            Some([u, v, w]) => write!(f, ", U {u}, V {v}, W {w}"),
            None => Ok(()),
        }
    }
}

/// All eight coordinates, with 0 for those that are not given. A controller that requires all of them was
/// reported (unit A). The mask keeps the others unchanged.
fn all_eight(at: impl Fn(AxisIndex) -> Option<f64>) -> Coordinates {
    Coordinates::from_slice(&AxisIndex::ALL.map(|axis| at(axis).unwrap_or(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_axes_that_are_named_move() {
        let second = AxisIndex::ALL[1];
        let position = AxisPosition::none().with(second, Degrees(5.0));
        assert_eq!(position.mask().bits(), 0b10);
        assert_eq!(position.coordinates().given(), AxisMask::ALL, "unit A wants all eight");
        assert_eq!(position.coordinates().at(second), Some(5.0));
        assert_eq!(AxisPosition::degrees([1.0; 6]).mask(), AxisMask::SIX);
    }

    #[test]
    fn a_pose_without_a_turn_keeps_the_orientation() {
        let place = [1.0, 2.0, 3.0].map(Millimetres);
        assert_eq!(Pose::position(place).mask(), AxisMask::POSITION);
        assert_eq!(Pose::new(place, [Degrees(180.0); 3]).mask(), AxisMask::SIX);
        assert_eq!(Pose::position(place).to_string(), "X 1 mm, Y 2 mm, Z 3 mm");
    }
}
