//! Axis positions, axis numbers, and the mask of the axes that a move changes.

use std::fmt;

use super::error::NotFinite;

/// How many axes the protocol can address, J1 to J8 (manual 4.1.1).
pub const AXES: usize = 8;

/// How many axes a six-axis arm drives, J1 to J6.
pub const ARM_AXES: usize = 6;

/// The largest axis position in either direction, degrees or mm. No arm goes this far; beyond it a double no
/// longer resolves a ten-millionth.
pub(crate) const FARTHEST: f64 = 1e6;

/// The positions of the eight axes J1 … J8, in degrees, or in mm on a linear axis.
///
/// Always finite and below a million in either direction. Axes that the arm lacks, such as J7 and J8 on a
/// six-axis arm, have no drive: they have no limits, and no move changes them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes([f64; AXES]);

impl Axes {
    /// All axes at 0. On a six-axis arm the upper arm is then upright, and the forearm level along +X.
    pub const ZERO: Self = Self([0.0; AXES]);

    /// Axes at these degrees; an error if one is not finite or beyond a million degrees.
    pub fn new(degrees: [f64; AXES]) -> Result<Self, NotFinite> {
        if degrees.iter().all(|d| d.abs() <= FARTHEST) { Ok(Self(degrees)) } else { Err(NotFinite) }
    }

    /// The arm's six axes at these degrees, J7 and J8 at 0; errors as in [`Axes::new`].
    pub fn of_arm(degrees: [f64; ARM_AXES]) -> Result<Self, NotFinite> {
        let [j1, j2, j3, j4, j5, j6] = degrees;
        Self::new([j1, j2, j3, j4, j5, j6, 0.0, 0.0])
    }

    /// All eight axes in degrees.
    #[must_use]
    pub const fn degrees(&self) -> &[f64; AXES] {
        &self.0
    }

    /// The arm's six axes in degrees.
    #[must_use]
    pub const fn arm(&self) -> [f64; ARM_AXES] {
        let [j1, j2, j3, j4, j5, j6, _, _] = self.0;
        [j1, j2, j3, j4, j5, j6]
    }

    /// The same with the arm's six axes replaced. Only for values that planning has bounded.
    pub(super) const fn with_arm(&self, arm: [f64; ARM_AXES]) -> Self {
        let [_, _, _, _, _, _, j7, j8] = self.0;
        let [j1, j2, j3, j4, j5, j6] = arm;
        Self([j1, j2, j3, j4, j5, j6, j7, j8])
    }
}

/// One axis of the arm, counted from 0; shown as J1 … J6.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AxisNumber(u8);

impl AxisNumber {
    /// The arm's axes in order.
    pub const ARM: [Self; ARM_AXES] = [Self(0), Self(1), Self(2), Self(3), Self(4), Self(5)];

    /// The number, 0 to 5.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0
    }

    /// The number as an array index, below [`ARM_AXES`].
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

impl fmt::Display for AxisNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "J{}", self.0 + 1)
    }
}

/// Which axes, or which components X, Y, Z, U, V, W of a pose, a move changes: bit n is number n (`ckStatus`,
/// manual 6.1.1).
///
/// Masked-out components keep the value they have at the start of the move. Bits 6 and 7 name J7 and J8,
/// which a six-axis arm lacks: they change nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MoveMask(pub u8);

impl MoveMask {
    /// The six axes, or the whole pose: `0x3F`.
    pub const SIX: Self = Self(0x3F);
    /// X, Y and Z only, so the move keeps the orientation: `0x07`.
    pub const POSITION: Self = Self(0x07);
    /// U, V and W: `0x38`.
    pub const ORIENTATION: Self = Self(0x38);

    /// Whether bit `n` is set; false from 8 on.
    #[must_use]
    pub const fn has(self, n: usize) -> bool {
        n < AXES && (self.0 >> n) & 1 == 1
    }

    /// Whether any bit of `other` is set here.
    #[must_use]
    pub const fn touches(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// Picks each of six numbers from the target if the mask has it, else from the start.
    #[must_use]
    pub fn pick(self, start: [f64; 6], target: [f64; 6]) -> [f64; 6] {
        let mut picked = start;
        for (n, (slot, wanted)) in picked.iter_mut().zip(target).enumerate() {
            if self.has(n) {
                *slot = wanted;
            }
        }
        picked
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_refuse_what_is_no_number() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e7] {
            let mut degrees = [0.0; AXES];
            degrees[7] = bad;
            assert_eq!(Axes::new(degrees), Err(NotFinite), "{bad}");
        }
    }

    #[test]
    fn mask_picks_by_bit() {
        let picked = MoveMask(0b10_0101).pick([1.0; 6], [2.0; 6]);
        assert_eq!(picked, [2.0, 1.0, 2.0, 1.0, 1.0, 2.0]);
        assert!(!MoveMask(0xFF).has(8));
        assert!(!MoveMask::POSITION.touches(MoveMask::ORIENTATION));
    }

    #[test]
    fn axis_number_reads_as_people_say_it() {
        assert_eq!(AxisNumber::ARM.map(|a| a.to_string()).join(" "), "J1 J2 J3 J4 J5 J6");
    }
}
