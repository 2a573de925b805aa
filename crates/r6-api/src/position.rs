//! Positions of an arm, each value with its unit.

use r6_proto::{Address, AxisIndex};
use serde::{Deserialize, Serialize};

/// How many axes and pose components are read and shown. The arms of this protocol have six at most, not
/// counting external axes.
pub const SHOWN_AXES: usize = 6;

/// The unit of a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum Unit {
    /// Degrees.
    #[serde(rename = "deg")]
    Degrees,
    /// Millimetres.
    #[serde(rename = "mm")]
    Millimetres,
}

impl Unit {
    /// The unit of a position that is read over the wire: degrees or millimetres for the components of a
    /// pose.
    ///
    /// `None` for an axis, because no address says whether an axis turns or slides, and for everything that
    /// is not a position.
    #[must_use]
    pub fn of(address: Address) -> Option<Self> {
        let Address::World(component) = address else { return None };
        Some(if component.number() < 3 { Self::Millimetres } else { Self::Degrees })
    }

    /// The word for the unit of any address. `None` if the value has no unit; for an axis, see [`Self::of`].
    #[must_use]
    pub fn word_of(address: Address) -> Option<&'static str> {
        match (address, Self::of(address)) {
            (_, Some(unit)) => Some(unit.word()),
            (Address::Axis(_) | Address::Faxis(_), None) => None,
            (_, None) => Some(address.info().unit).filter(|unit| !unit.is_empty()),
        }
    }

    /// Its word: `deg` or `mm`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Degrees => "deg",
            Self::Millimetres => "mm",
        }
    }
}

/// Where one axis stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct AxisPosition {
    /// `J1` to `J8`.
    #[cfg_attr(feature = "openapi", schema(example = "J1"))]
    pub name: String,
    /// Where it stands, in its unit; `null` where it could not be read.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub position: Option<f64>,
    /// `deg` for a turning axis, `mm` for a linear axis; `null` if unknown, because the protocol does not
    /// say.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub unit: Option<Unit>,
}

impl AxisPosition {
    /// Positions that were read over the wire, J1 first. Their units are unknown.
    pub fn read(positions: &[Option<f64>]) -> Vec<Self> {
        let axes = AxisIndex::ALL.into_iter().zip(positions);
        axes.map(|(axis, position)| Self { name: axis.to_string(), position: *position, unit: None })
            .collect()
    }
}

/// A pose; `null` for a component that could not be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[expect(missing_docs, reason = "the names say it")]
pub struct Pose {
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub x_mm: Option<f64>,
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub y_mm: Option<f64>,
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub z_mm: Option<f64>,
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub u_deg: Option<f64>,
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub v_deg: Option<f64>,
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub w_deg: Option<f64>,
}

impl Pose {
    /// A pose from X, Y, Z in mm and U, V, W in degrees. Missing components are unknown; components after the
    /// sixth are ignored.
    #[must_use]
    pub fn of(components: &[Option<f64>]) -> Self {
        let at = |index: usize| components.get(index).copied().flatten();
        Self { x_mm: at(0), y_mm: at(1), z_mm: at(2), u_deg: at(3), v_deg: at(4), w_deg: at(5) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_has_mm_and_degrees_and_an_axis_has_no_unit_that_the_wire_tells() {
        let units = AxisIndex::ALL.map(|component| Unit::of(Address::World(component)));
        assert_eq!(units[..4], [[Some(Unit::Millimetres); 3].as_slice(), &[Some(Unit::Degrees)]].concat());
        assert_eq!(AxisIndex::ALL.map(|axis| Unit::of(Address::Axis(axis))), [None; 8]);
        for unit in [Unit::Degrees, Unit::Millimetres] {
            assert_eq!(serde_json::to_value(unit).unwrap(), unit.word());
        }
    }
}
