//! A change of speed as the drive makes it: neither the speed nor the acceleration jumps.
//!
//! A change requested at one instant is averaged over three windows, one after the other: the straight part
//! of the ramp, the S-curve, and the filter. The result is a step with a bounded jerk. It takes the same time
//! whatever its size, and every value is a short polynomial.

use super::Ramps;

/// The fraction of a ramp that is bent, at either end (S-curve 30 %, reported, unit B).
pub const S_CURVE: f64 = 0.3;

/// The window of the filter after the ramps, in seconds (128 ms, reported, unit B).
pub const FILTER_SECONDS: f64 = 0.128;

/// A step from 0 to 1 in a fixed time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothStep {
    windows: [f64; 3],
}

/// A [`SmoothStep`] at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepState {
    /// The area under the step so far, in seconds.
    pub area: f64,
    /// The height, 0 to 1.
    pub height: f64,
    /// The slope, per second.
    pub slope: f64,
}

impl SmoothStep {
    /// The step for a ramp of this many seconds, which have to be above zero.
    #[must_use]
    pub fn of(ramp: f64) -> Self {
        Self { windows: [(1.0 - S_CURVE) * ramp, S_CURVE * ramp, FILTER_SECONDS] }
    }

    /// The step of the default ramp, scaled to take this many seconds, which have to be above zero.
    #[must_use]
    pub fn within(seconds: f64) -> Self {
        let model = Self::of(Ramps::default().acceleration());
        let scale = seconds / model.width();
        Self { windows: model.windows.map(|window| window * scale) }
    }

    /// The duration in seconds: the ramp and the filter.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.windows.iter().sum()
    }

    /// The mean delay behind a jump at its start, in seconds: half its width.
    #[must_use]
    pub fn lag(&self) -> f64 {
        self.width() / 2.0
    }

    /// The largest slope, per second, in the middle.
    ///
    /// The two longest windows make a slope that rises, stays at one over the longest, and falls. The
    /// shortest averages over its own length; if that is longer than the constant part, the result is a
    /// little less.
    #[must_use]
    pub fn steepest(&self) -> f64 {
        let [longest, next, shortest] = self.by_length();
        let beyond = ((shortest - (longest - next)) / 2.0).max(0.0);
        1.0 / longest - beyond * beyond / (longest * next * shortest)
    }

    /// The largest change of the slope, per second squared; only the two longest windows count.
    #[must_use]
    pub fn sharpest(&self) -> f64 {
        let [longest, next, _] = self.by_length();
        1.0 / (longest * next)
    }

    /// The change of the slope at `t`, per second squared. It is linear from each of the
    /// [`SmoothStep::knots`] to the next.
    #[must_use]
    pub fn jerk(&self, t: f64) -> f64 {
        let width = self.width();
        let (t, sign) = if t <= width / 2.0 { (t, 1.0) } else { (width - t, -1.0) };
        let [a, b, c] = self.windows;
        let rising: f64 =
            since(self.windows).into_iter().map(|(passed, sign)| sign * (t - passed).max(0.0)).sum();
        sign * rising / (a * b * c)
    }

    /// The eight instants between its polynomials, in seconds from its start, in time order.
    #[must_use]
    pub fn knots(&self) -> [f64; 8] {
        let [a, b, c] = self.windows;
        let mut knots = [0.0, a, b, c, a + b, a + c, b + c, a + b + c];
        knots.sort_by(f64::total_cmp);
        knots
    }

    fn by_length(&self) -> [f64; 3] {
        let mut windows = self.windows;
        windows.sort_by(|a, b| b.total_cmp(a));
        windows
    }

    /// The step `t` seconds after its start: 0 before it, 1 from its width on.
    #[must_use]
    pub fn at(&self, t: f64) -> StepState {
        let width = self.width();
        if t > 0.0 && t <= width / 2.0 {
            self.first_half(t)
        } else if t >= width {
            StepState { area: t - width / 2.0, height: 1.0, slope: 0.0 }
        } else if t > 0.0 {
            // The step is symmetric, so computing from the end loses nothing to rounding.
            let back = self.first_half(width - t);
            StepState { area: t - width / 2.0 + back.area, height: 1.0 - back.height, slope: back.slope }
        } else {
            StepState { area: 0.0, height: 0.0, slope: 0.0 }
        }
    }

    /// Three windows over a jump: a third power, minus the same for each window that has passed.
    fn first_half(&self, t: f64) -> StepState {
        let [a, b, c] = self.windows;
        let (mut square, mut cube, mut fourth) = (0.0, 0.0, 0.0);
        for (passed, sign) in since(self.windows) {
            let x = t - passed;
            if x > 0.0 {
                square += sign * x * x;
                cube += sign * x * x * x;
                fourth += sign * x * x * x * x;
            }
        }
        let volume = a * b * c;
        StepState {
            area: fourth / (24.0 * volume),
            height: cube / (6.0 * volume),
            slope: square / (2.0 * volume),
        }
    }
}

/// The terms of the first half of a step: since when each counts, and its sign.
fn since([a, b, c]: [f64; 3]) -> [(f64, f64); 7] {
    [(0.0, 1.0), (a, -1.0), (b, -1.0), (c, -1.0), (a + b, 1.0), (a + c, 1.0), (b + c, 1.0)]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn it_takes_the_ramp_and_the_filter() {
        let step = SmoothStep::of(0.25);
        assert!((step.width() - 0.378).abs() < 1e-12);
        let middle = step.at(0.189);
        assert!((step.steepest() - middle.slope).abs() < 1e-12 && middle.slope < 1.0 / 0.175);
        assert!((middle.height - 0.5).abs() < 1e-12);
        assert_eq!(step.at(-1.0), StepState { area: 0.0, height: 0.0, slope: 0.0 });
        let over = step.at(1.0);
        assert_eq!((over.height, over.slope), (1.0, 0.0));
        assert!((over.area - (1.0 - 0.189)).abs() < 1e-12);
    }

    #[test]
    fn a_step_within_a_time_takes_that_time() {
        for seconds in [1e-6, 0.078, 0.5, 60.0] {
            let step = SmoothStep::within(seconds);
            assert!((step.width() - seconds).abs() < 1e-12 * seconds.max(1.0));
            assert!((step.at(seconds / 2.0).height - 0.5).abs() < 1e-9);
        }
        assert_eq!(
            SmoothStep::within(0.378).at(0.1).height.to_bits() >> 12,
            SmoothStep::of(0.25).at(0.1).height.to_bits() >> 12
        );
    }

    proptest! {
        #[test]
        fn height_is_the_rate_of_area_and_slope_that_of_height(ramp in 0.001..2.0, part in -0.1..1.2) {
            let step = SmoothStep::of(ramp);
            let (t, h) = (part * step.width(), 1e-6 * step.width());
            let [before, here, after] = [t - h, t, t + h].map(|t| step.at(t));
            let height = (after.area - before.area) / (2.0 * h);
            let slope = (after.height - before.height) / (2.0 * h);
            prop_assert!((height - here.height).abs() < 1e-6, "{height} {}", here.height);
            prop_assert!((slope - here.slope).abs() < 1e-5 * step.steepest(), "{slope} {}", here.slope);
            prop_assert!((0.0..=1.0).contains(&here.height) && here.area >= 0.0);
            prop_assert!(here.slope >= -1e-9 && here.slope <= step.steepest() * (1.0 + 1e-9));
            let bend = (after.slope - before.slope) / (2.0 * h);
            prop_assert!(bend.abs() <= step.sharpest() * (1.0 + 1e-4), "{bend} {}", step.sharpest());
            prop_assert!((bend - step.jerk(t)).abs() < 1e-3 * step.sharpest(), "{bend} {}", step.jerk(t));
        }

        /// The bounds are also reached by the slope and its change.
        #[test]
        fn steepest_and_sharpest_are_met(ramp in 0.001..2.0) {
            let step = SmoothStep::of(ramp);
            let middle = step.at(step.width() / 2.0).slope;
            prop_assert!((middle / step.steepest() - 1.0).abs() < 1e-9, "{middle} {}", step.steepest());
            let sharpest = step.knots().map(|knot| step.jerk(knot)).into_iter().fold(0.0, f64::max);
            prop_assert!((sharpest / step.sharpest() - 1.0).abs() < 1e-6, "{sharpest} {}", step.sharpest());
        }
    }
}
