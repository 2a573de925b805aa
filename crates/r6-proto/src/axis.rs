//! Axes by number and by mask.

use std::fmt;

/// The number of axes that the protocol can address (`axis-0` … `axis-7`, `m0` … `m7`): manual 4.1.1, 6.1.1.
pub const AXES: usize = 8;

/// One axis, counted from 0 as on the wire, and displayed as J1 … J8.
///
/// In `world-n` the same index counts X, Y, Z, U, V, W, M7, M8 (manual 4.1.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AxisIndex(u8);

impl AxisIndex {
    /// All eight axes, in order.
    pub const ALL: [Self; AXES] = [Self(0), Self(1), Self(2), Self(3), Self(4), Self(5), Self(6), Self(7)];

    /// The axis with this number, 0 to 7; `None` beyond.
    #[must_use]
    pub const fn new(index: u8) -> Option<Self> {
        if index < 8 { Some(Self(index)) } else { None }
    }

    /// The number, 0 to 7.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0
    }

    /// The number as an array index, below [`AXES`].
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// The name of this component in `world-n`: X, Y, Z, U, V, W, M7 or M8.
    #[must_use]
    pub fn world_name(self) -> &'static str {
        ["X", "Y", "Z", "U", "V", "W", "M7", "M8"].get(self.index()).copied().unwrap_or("?")
    }
}

impl fmt::Display for AxisIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "J{}", self.0 + 1)
    }
}

/// Which axes (or pose components) an instruction moves: bit n is axis n (`ckStatus`, manual 6.1.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct AxisMask(u8);

impl AxisMask {
    /// No axis.
    pub const NONE: Self = Self(0);
    /// The first six axes, `0x3F`.
    pub const SIX: Self = Self(0x3F);
    /// X, Y and Z of a pose, `0x07`: the orientation is kept.
    pub const POSITION: Self = Self(0x07);
    /// All eight axes, `0xFF`.
    pub const ALL: Self = Self(0xFF);

    /// The mask with exactly these bits.
    #[must_use]
    pub const fn from_bits(bits: u8) -> Self {
        Self(bits)
    }

    /// The bits; bit n is axis n.
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// Whether the axis is in the mask.
    #[must_use]
    pub const fn contains(self, axis: AxisIndex) -> bool {
        self.0 & (1 << axis.0) != 0
    }

    /// The mask with the axis added.
    #[must_use]
    pub const fn with(self, axis: AxisIndex) -> Self {
        Self(self.0 | (1 << axis.0))
    }

    /// The axes that are in both masks.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// The axes in the mask, lowest first.
    pub fn axes(self) -> impl Iterator<Item = AxisIndex> {
        AxisIndex::ALL.into_iter().filter(move |axis| self.contains(*axis))
    }
}

impl fmt::Display for AxisMask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:02X}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_beyond_eight_does_not_exist() {
        assert_eq!(AxisIndex::new(7).map(|axis| axis.to_string()), Some("J8".to_owned()));
        assert_eq!(AxisIndex::new(8), None);
    }

    #[test]
    fn a_mask_lists_its_axes() {
        let mask = AxisMask::from_bits(0b101);
        assert_eq!(mask.axes().map(AxisIndex::number).collect::<Vec<_>>(), [0, 2]);
        assert_eq!(AxisMask::SIX.to_string(), "0x3F");
    }
}
