//! The steps in which the wire carries settings, speeds and times.
//!
//! A value between two steps is refused, and the error names the two nearest values that can be sent. It is
//! not rounded, because a rounded setting is not the setting that the caller meant. Positions have no grid.
//! They are computed, and the wire rounds them to their last decimal (a millionth of a millimetre or degree).
//! This is far below the repeatability of an arm.

use std::fmt;

use crate::error::EncodeError;

/// How far a value may lie from a step, in steps. This accepts floating-point noise (0.1 + 0.2), also for
/// numbers with nine digits. It is far below any difference that a caller means.
pub const ON_GRID_WITHIN: f64 = 1e-6;

/// Values beyond this are not looked up on a grid. No setting of a robot is that large, and doubles still
/// distinguish steps there.
const LARGEST: f64 = 1e9;

/// Equal steps from 0 on, `per_unit` of them in one unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    per_unit: u32,
    /// What a value on the grid is, for error messages.
    wanted: &'static str,
}

impl Grid {
    /// `speed` of a move and `modifyGSPD`: steps of 0.1 % (manual 6.1.1, "precision 0.1%"; × 10 on the wire
    /// of `modifyGSPD`).
    pub const PERCENT: Self = Self { per_unit: 10, wanted: "in steps of 0.1 percent" };
    /// `delay` of a move and `limit` of a wait: steps of 0.1 s (manual 6.1.1, 6.1.3).
    pub const TENTHS_OF_A_SECOND: Self = Self { per_unit: 10, wanted: "in steps of 0.1 seconds" };
    /// `modifyAccDec` (seconds × 1000 on the wire, manual 4.2.1), and `delay` of an output, whose steps no
    /// manual names.
    pub const MILLISECONDS: Self = Self { per_unit: 1000, wanted: "in steps of 0.001 seconds" };
    /// `modifyTool` (× 1000 on the wire, manual 4.2.1), and the spacing of a stack, whose steps no manual
    /// names.
    pub const THOUSANDTHS: Self = Self { per_unit: 1000, wanted: "in steps of 0.001" };

    /// Returns the step of a value, counted from 0.
    ///
    /// # Errors
    /// The two nearest values, if the value lies further than [`ON_GRID_WITHIN`] from each. `None` if it is
    /// NaN or beyond ±1e9.
    pub const fn step(self, value: f64) -> Result<i64, Option<Nearest>> {
        let steps = value * self.per_unit as f64;
        if steps.is_nan() || steps.abs() > LARGEST * 1e3 {
            return Err(None);
        }
        #[expect(clippy::cast_possible_truncation, reason = "a whole number within ±1e12")]
        let nearest = steps.round() as i64;
        if (steps - steps.round()).abs() <= ON_GRID_WITHIN {
            return Ok(nearest);
        }
        #[expect(clippy::cast_possible_truncation, reason = "a whole number within ±1e12")]
        let below = steps.floor() as i64;
        Err(Some(Nearest { below, per_unit: self.per_unit }))
    }

    /// What a value on the grid is: `in steps of …`.
    #[must_use]
    pub const fn wanted(self) -> &'static str {
        self.wanted
    }

    /// How many steps a unit has.
    pub(crate) fn steps_in_unit(self) -> f64 {
        f64::from(self.per_unit)
    }

    /// Returns the step of a value that is about to be sent.
    pub(crate) fn sendable(self, field: &'static str, value: f64) -> Result<i64, EncodeError> {
        self.step(value).map_err(|nearest| match nearest {
            Some(_) => EncodeError { field, wanted: self.wanted, nearest },
            None => EncodeError::new(field, "a finite number within ±1e9"),
        })
    }
}

/// The two values on a grid that enclose another value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Nearest {
    /// The step below.
    below: i64,
    per_unit: u32,
}

impl Nearest {
    /// The nearest value below, in the unit of the refused value.
    #[must_use]
    pub fn below(self) -> f64 {
        self.of_step(self.below)
    }

    /// The nearest value above, in the same unit.
    #[must_use]
    pub fn above(self) -> f64 {
        self.of_step(self.below + 1)
    }

    fn of_step(self, step: i64) -> f64 {
        // Exact: steps lie within ±1e12.
        step as f64 / f64::from(self.per_unit)
    }
}

impl fmt::Display for Nearest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} or {}", self.below(), self.above())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_between_two_steps_is_told_with_both() {
        for (grid, value, nearest) in [
            (Grid::PERCENT, 5.55, "5.5 or 5.6"),
            (Grid::PERCENT, 0.04, "0 or 0.1"),
            (Grid::THOUSANDTHS, 0.0004, "0 or 0.001"),
            (Grid::THOUSANDTHS, -0.0004, "-0.001 or 0"),
            (Grid::THOUSANDTHS, 999_999.999_5, "999999.999 or 1000000"),
            (Grid::TENTHS_OF_A_SECOND, 1.250_01, "1.2 or 1.3"),
        ] {
            let told = grid.step(value).unwrap_err().unwrap();
            assert_eq!(told.to_string(), nearest, "{value}");
            assert!(told.below() < value && value < told.above());
        }
    }

    #[test]
    fn the_noise_of_floating_point_passes() {
        assert_eq!(Grid::PERCENT.step(0.1 + 0.2), Ok(3));
        assert_eq!(Grid::THOUSANDTHS.step(-0.001 * 3.0), Ok(-3));
        for step in (-1_000_000_000_i64..=1_000_000_000).step_by(999_983) {
            let value = step as f64 * 0.001;
            assert_eq!(Grid::THOUSANDTHS.step(value), Ok(step), "{value}");
            assert_eq!(Grid::THOUSANDTHS.step(step as f64 / 1000.0), Ok(step));
        }
    }

    #[test]
    fn what_is_no_number_has_no_step() {
        for value in [f64::NAN, f64::INFINITY, -1e300] {
            assert_eq!(Grid::PERCENT.step(value), Err(None));
        }
    }
}
