//! Values with units: a unit error does not compile.
//!
//! ```
//! use r6_client::units::{AxisPosition, Degrees, Millimetres, Percent, Pose};
//!
//! let home = AxisPosition::degrees([0.0, -20.0, 30.0, 0.0, 45.0, 0.0]);
//! let rail = home.with(r6_client::AxisIndex::ALL[6], Millimetres(1200.0));
//! let above = Pose::new([500.0, 0.0, 400.0].map(Millimetres), [180.0, 0.0, 0.0].map(Degrees));
//! let speed = Percent::new(20.0)?;
//! assert_eq!(speed.to_string(), "20 %");
//! assert_eq!((Millimetres(400.0) + Millimetres(2.5)).to_string(), "402.5 mm");
//! assert_eq!(rail.at(r6_client::AxisIndex::ALL[6]).unwrap().to_string(), "1200 mm");
//! # let _ = above; Ok::<(), r6_client::units::OutOfRange>(())
//! ```
//!
//! Degrees and millimetres do not add up:
//!
//! ```compile_fail,E0308
//! use r6_client::units::{Degrees, Millimetres};
//! let sum = Degrees(1.0) + Millimetres(1.0);
//! ```
//!
//! A speed in mm/s is not a percentage, and a bare number is neither:
//!
//! ```compile_fail,E0308
//! use r6_client::Motion;
//! use r6_client::units::{AxisPosition, MillimetresPerSecond};
//! let speed = MillimetresPerSecond::new(20).unwrap();
//! Motion::new().axis_move(AxisPosition::degrees([0.0; 6]), speed);
//! ```
//!
//! ```compile_fail,E0308
//! use r6_client::Motion;
//! use r6_client::units::AxisPosition;
//! Motion::new().axis_move(AxisPosition::degrees([0.0; 6]), 20.0);
//! ```
//!
//! A linear move does not accept axis positions, nor an axis move a pose:
//!
//! ```compile_fail,E0308
//! use r6_client::Motion;
//! use r6_client::units::{AxisPosition, Percent};
//! let speed = Percent::new(20.0).unwrap();
//! Motion::new().linear_move(AxisPosition::degrees([0.0; 6]), speed);
//! ```
//!
//! There are no more than eight axes:
//!
//! ```compile_fail,E0080
//! let nine = r6_client::units::AxisPosition::degrees([0.0; 9]);
//! ```

mod nearest;
pub(crate) mod position;

use std::fmt;
use std::ops::{Add, Mul, Neg, Sub};

pub use crate::units::position::{AxisCoordinate, AxisPosition, Pose};
use r6_proto::grid::{Grid, Nearest};
use r6_proto::message::instruction::{Manner, PathSpeed};

/// An angle, degrees.
///
/// ```compile_fail,E0308
/// let angle: r6_client::units::Degrees = r6_client::units::Millimetres(3.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Degrees(pub f64);

/// A length, millimetres.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Millimetres(pub f64);

/// Implements arithmetic for a unit: sums and differences of two values, and multiples.
macro_rules! adds_up {
    ($unit:ident, $symbol:literal) => {
        impl $unit {
            /// The number without the unit.
            #[must_use]
            pub const fn value(self) -> f64 {
                self.0
            }

            /// The value without its sign.
            #[must_use]
            pub const fn abs(self) -> Self {
                Self(self.0.abs())
            }
        }

        impl Add for $unit {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                Self(self.0 + other.0)
            }
        }

        impl Sub for $unit {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self(self.0 - other.0)
            }
        }

        impl Neg for $unit {
            type Output = Self;
            fn neg(self) -> Self {
                Self(-self.0)
            }
        }

        impl Mul<f64> for $unit {
            type Output = Self;
            fn mul(self, times: f64) -> Self {
                Self(self.0 * times)
            }
        }

        impl fmt::Display for $unit {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.fmt(f)?;
                f.write_str(concat!(" ", $symbol))
            }
        }
    };
}

adds_up!(Degrees, "deg");
adds_up!(Millimetres, "mm");

/// A number outside the range of a unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfRange {
    /// The number.
    pub value: f64,
    /// What the number has to be.
    pub wanted: &'static str,
    /// The nearest allowed numbers, if it lies between two of them.
    pub nearest: Option<Nearest>,
}

impl OutOfRange {
    /// A number without nearest allowed ones.
    pub(crate) const fn new(value: f64, wanted: &'static str) -> Self {
        Self { value, wanted, nearest: None }
    }
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} is not allowed: it has to be {}", self.value, self.wanted)?;
        match self.nearest {
            Some(nearest) => write!(f, "; nearest: {nearest}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for OutOfRange {}

/// A share of the maximum: the `speed` of a move, from 0.1 to 100 in steps of 0.1 (manual 6.1.1).
///
/// An axis move at 100 % drives its slowest axis as fast as it goes; a linear move at 100 % goes 2000 mm/s
/// (reported, unit B). The global speed multiplies both.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Percent(f64);

impl Percent {
    /// The whole maximum: 100 %.
    pub const MAX: Self = Self(*Manner::SPEEDS.end());

    /// What a valid percentage is.
    pub const WANTED: &str = "percent, from 0.1 to 100 in steps of 0.1";

    /// Creates a percentage.
    ///
    /// # Errors
    /// [`OutOfRange`] below 0.1, above 100, and for NaN. Between two steps the error has both. A deviation
    /// from a step by floating point passes ([`r6_proto::grid::ON_GRID_WITHIN`]).
    pub const fn new(percent: f64) -> Result<Self, OutOfRange> {
        // A comparison with NaN is never true.
        let is_within = percent >= *Manner::SPEEDS.start() && percent <= *Manner::SPEEDS.end();
        match Grid::PERCENT.step(percent) {
            Ok(_) if is_within => Ok(Self(percent)),
            Err(nearest) if is_within => Err(OutOfRange { value: percent, wanted: Self::WANTED, nearest }),
            Ok(_) | Err(_) => Err(OutOfRange::new(percent, Self::WANTED)),
        }
    }

    /// The number without the unit.
    #[must_use]
    pub const fn value(self) -> f64 {
        self.0
    }
}

impl fmt::Display for Percent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)?;
        f.write_str(" %")
    }
}

/// The speed of the tool along its path, before the global speed is applied: a whole number of mm/s from 1. A
/// fraction raised alarm 219 (reported, unit B).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct MillimetresPerSecond(u32);

impl MillimetresPerSecond {
    /// Creates a speed.
    ///
    /// # Errors
    /// [`OutOfRange`] for 0 and above [`PathSpeed::FASTEST`].
    pub fn new(speed: u32) -> Result<Self, OutOfRange> {
        if (1..=PathSpeed::FASTEST).contains(&speed) {
            Ok(Self(speed))
        } else {
            Err(OutOfRange::new(f64::from(speed), PathSpeed::WANTED))
        }
    }

    /// The number without the unit.
    #[must_use]
    pub fn value(self) -> f64 {
        f64::from(self.0)
    }
}

impl fmt::Display for MillimetresPerSecond {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} mm/s", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_percentage_is_above_zero_and_at_most_all() {
        for good in [0.1, 0.1 + 0.2, 5.5, 99.9, 100.0] {
            assert_eq!(Percent::new(good).map(Percent::value), Ok(good));
        }
        for bad in [0.0, 0.001, 0.09, 100.1, 100.04, -1.0, f64::INFINITY, f64::NAN] {
            let error = Percent::new(bad).unwrap_err();
            assert!(error.to_string().contains("from 0.1 to 100"), "{error}");
            assert_eq!(error.nearest, None, "{bad}");
        }
        let error = Percent::new(5.55).unwrap_err();
        let text =
            "5.55 is not allowed: it has to be percent, from 0.1 to 100 in steps of 0.1; nearest: 5.5 or 5.6";
        assert_eq!(error.to_string(), text);
    }

    #[test]
    fn a_path_speed_is_a_whole_number_from_one() {
        assert_eq!(MillimetresPerSecond::new(250).unwrap().to_string(), "250 mm/s");
        assert!(MillimetresPerSecond::new(0).is_err());
        assert!(MillimetresPerSecond::new(100_001).is_err());
    }

    #[test]
    fn a_number_shows_with_its_unit() {
        assert_eq!(Percent::new(12.5).unwrap().to_string(), "12.5 %");
        assert_eq!(AxisCoordinate::from(Degrees(90.0)).to_string(), "90 deg");
        assert_eq!(AxisCoordinate::from(Millimetres(250.5)).to_string(), "250.5 mm");
    }

    #[test]
    fn units_show_as_wide_as_told() {
        assert_eq!(format!("{:.1}", Degrees(12.345)), "12.3 deg");
        assert_eq!((Degrees(90.0) - Degrees(100.0)).abs() * 2.0, Degrees(20.0));
        assert_eq!(-Millimetres(4.0), Millimetres(-4.0));
    }
}
