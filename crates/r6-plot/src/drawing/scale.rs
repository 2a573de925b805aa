//! Converts values to pixels, and finds round values for the labels of an axis.

/// Maps a range of values to a range of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    values: (f64, f64),
    pixels: (f64, f64),
}

impl Scale {
    /// Maps the values from `values.0` to `values.1` to the pixels from `pixels.0` to `pixels.1`. The two
    /// values must differ.
    pub fn new(values: (f64, f64), pixels: (f64, f64)) -> Self {
        Self { values, pixels }
    }

    /// The pixel of a value.
    pub fn at(&self, value: f64) -> f64 {
        let share = (value - self.values.0) / (self.values.1 - self.values.0);
        self.pixels.0 + share * (self.pixels.1 - self.pixels.0)
    }

    /// The range of values.
    pub fn values(&self) -> (f64, f64) {
        self.values
    }
}

/// Round values within a range, and how many decimals they need.
#[derive(Clone, Debug, PartialEq)]
pub struct Ticks {
    /// The values, ascending.
    pub values: Vec<f64>,
    step: f64,
    decimals: usize,
}

impl Ticks {
    /// Round values in the range, about `wanted` of them.
    pub fn within((low, high): (f64, f64), wanted: u32) -> Self {
        let rough = ((high - low) / f64::from(wanted.max(1))).max(1e-6);
        let power = 10_f64.powf(rough.log10().floor());
        let factor = [1.0, 2.0, 5.0, 10.0].into_iter().find(|factor| factor * power >= rough * 0.999);
        let step = factor.unwrap_or(10.0) * power;
        let decimals = (0..6).find(|decimals| {
            let shifted = step * 10_f64.powi(*decimals);
            (shifted - shifted.round()).abs() < 1e-6
        });
        let first = (low / step - 1e-9).ceil();
        let values = (0..100).map(|n| (first + f64::from(n)) * step);
        Self {
            values: values.take_while(|value| *value <= high + step * 1e-9).collect(),
            step,
            decimals: decimals.and_then(|decimals| usize::try_from(decimals).ok()).unwrap_or(6),
        }
    }

    /// A value as text, with the decimals of these ticks.
    pub fn label(&self, value: f64) -> String {
        let value = if value.abs() < self.step * 1e-6 { 0.0 } else { value };
        format!("{value:.*}", self.decimals)
    }
}

/// Widens a range to round values, so that a line does not run along the frame. The result is at least
/// `smallest` wide.
pub fn round_range((low, high): (f64, f64), smallest: f64, wanted: u32) -> (f64, f64) {
    let middle = f64::midpoint(low, high);
    let half = (smallest / 2.0).max((high - low) * 0.52);
    let (low, high) = (middle - half, middle + half);
    let step = Ticks::within((low, high), wanted).step;
    ((low / step).floor() * step, (high / step).ceil() * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within() {
        let ticks = Ticks::within((-13.0, 47.0), 6);
        assert_eq!(ticks.values, [-10.0, 0.0, 10.0, 20.0, 30.0, 40.0]);
        assert_eq!(ticks.label(-10.0), "-10");
        let ticks = Ticks::within((0.0, 0.9), 5);
        assert_eq!(
            ticks.values.iter().map(|value| ticks.label(*value)).collect::<Vec<_>>(),
            ["0.0", "0.2", "0.4", "0.6", "0.8"]
        );
        assert_eq!(ticks.label(-1e-18), "0.0");
    }

    #[test]
    fn a_range_is_never_empty() {
        assert_eq!(round_range((5.0, 5.0), 10.0, 5), (0.0, 10.0));
        let (low, high) = round_range((-90.0, 0.0), 10.0, 6);
        assert!(low < -90.0 && high > 0.0, "{low} {high}");
    }

    #[test]
    fn a_scale_may_run_downwards() {
        let scale = Scale::new((0.0, 10.0), (100.0, 0.0));
        assert_eq!([scale.at(0.0), scale.at(2.5), scale.at(10.0)], [100.0, 75.0, 0.0]);
    }
}
