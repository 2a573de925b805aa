//! The peaks of a profile.

use super::{Change, Profile};

/// Halvings that find an instant to the last digit of a double.
const HALVINGS: usize = 60;

/// The largest absolute speed, acceleration and jerk of a profile: fractions of full speed, per second and
/// per second squared.
///
/// An axis on an axis path never exceeds its own full speed times these, and the slowest axis reaches them.
/// So another planner with these limits makes a comparable move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peaks {
    /// The highest speed; below the requested one on a short path.
    pub speed: f64,
    /// The largest acceleration or deceleration.
    pub acceleration: f64,
    /// The largest change of acceleration per second. If one change of speed has not ended when the next
    /// begins, both add up: up to twice that of one.
    pub jerk: f64,
}

impl Profile {
    /// The largest speed, acceleration and jerk of the profile, to the last digits. If its top was changed
    /// ([`Profile::with_top`]), only the rest of the path counts.
    ///
    /// Between two knots of its changes the acceleration is a parabola. So each peak is at a knot, or where
    /// the jerk is zero (for the acceleration), or where the acceleration is zero (for the speed).
    #[must_use]
    pub fn peaks(&self) -> Peaks {
        let mut times: Vec<f64> = self.all_changes().flat_map(Change::knots).collect();
        times.retain(|time| (0.0..=self.duration()).contains(time));
        times.sort_by(f64::total_cmp);
        let mut peaks = Peaks::default();
        for (from, to) in times.iter().zip(times.iter().skip(1)) {
            let level = zero_between(|t| self.jerk(t), *from, *to);
            self.raise(&mut peaks, *from);
            if let Some(level) = level {
                self.raise(&mut peaks, level);
            }
            let middle = level.unwrap_or(*to);
            for (from, to) in [(*from, middle), (middle, *to)] {
                if let Some(fastest) = zero_between(|t| self.at(t).acceleration, from, to) {
                    self.raise(&mut peaks, fastest);
                }
            }
        }
        peaks
    }

    fn raise(&self, peaks: &mut Peaks, time: f64) {
        let here = self.at(time);
        peaks.speed = peaks.speed.max(here.speed);
        peaks.acceleration = peaks.acceleration.max(here.acceleration.abs());
        peaks.jerk = peaks.jerk.max(self.jerk(time).abs());
    }

    fn jerk(&self, time: f64) -> f64 {
        self.all_changes().map(|change| change.by * change.step.jerk(time - change.at)).sum()
    }

    fn all_changes(&self) -> impl Iterator<Item = &Change> {
        self.changes.iter().chain([&self.last])
    }
}

impl Change {
    fn knots(&self) -> [f64; 8] {
        self.step.knots().map(|knot| self.at + knot)
    }
}

/// Where `f`, which is monotonic, is zero; `None` if it has the same sign at both ends.
fn zero_between(f: impl Fn(f64) -> f64, from: f64, to: f64) -> Option<f64> {
    let (first, last) = (f(from), f(to));
    if first * last >= 0.0 {
        return None;
    }
    let (mut low, mut high) = (from, to);
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(low, high);
        if f(middle) * first > 0.0 { low = middle } else { high = middle }
    }
    Some(high)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::speed_profile::{Ramps, SmoothStep};

    fn plan(end: f64, top: f64, up: f64, down: f64) -> Profile {
        Profile::plan(end, top, Ramps::new(up, down).unwrap()).unwrap()
    }

    #[test]
    fn a_long_way_has_the_peaks_of_one_change() {
        let step = SmoothStep::of(0.25);
        let peaks = plan(2.0, 0.5, 0.25, 0.25).peaks();
        assert!((peaks.speed - 0.5).abs() < 1e-12);
        assert!((peaks.acceleration - 0.5 * step.steepest()).abs() < 1e-9, "{peaks:?}");
        assert!((peaks.jerk - 0.5 * step.sharpest()).abs() < 1e-9, "{peaks:?}");
        assert_eq!(plan(0.0, 0.5, 0.25, 0.25).peaks(), Peaks::default());
    }

    #[test]
    fn a_short_way_is_gentler_but_bends_more_sharply() {
        // A little shorter than the ramp: the end of one bend meets the start of the other.
        let peaks = plan(0.2, 1.0, 0.25, 0.25).peaks();
        let step = SmoothStep::of(0.25);
        assert!(peaks.jerk > 1.5 * step.sharpest() && peaks.jerk <= 2.0 * step.sharpest(), "{peaks:?}");
        let shortest = plan(0.001, 1.0, 0.25, 0.25).peaks();
        assert!((shortest.speed / 0.001 / step.steepest() - 1.0).abs() < 1e-3, "{shortest:?}");
    }

    proptest! {
        /// None of many samples exceeds the peaks, and some come near.
        #[test]
        fn the_peaks_are_bounds_and_are_met(
            way in prop_oneof![1e-4..0.02, 0.02..0.6, 0.6..5.0], top in 0.01..1.0, up in 0.001..1.0, down in 0.001..1.0,
            changed in prop::option::of((0.0..0.8, 0.01..1.0)),
        ) {
            let mut profile = plan(way, top, up, down);
            let mut from = 0.0;
            if let Some((part, next)) = changed {
                from = part * profile.duration();
                profile = profile.with_top(from, next).unwrap();
            }
            let peaks = profile.peaks();
            let (mut speed, mut acceleration, mut jerk) = (0.0_f64, 0.0_f64, 0.0_f64);
            for n in 0..4000 {
                let t = from + (profile.duration() - from) * f64::from(n) / 4000.0;
                let h = 1e-6;
                let [here, next] = [t, t + h].map(|t| profile.at(t));
                speed = speed.max(here.speed);
                acceleration = acceleration.max(here.acceleration.abs());
                jerk = jerk.max((next.acceleration - here.acceleration).abs() / h);
            }
            for (seen, peak, slack) in [
                (speed, peaks.speed, 1e-9), (acceleration, peaks.acceleration, 1e-9), (jerk, peaks.jerk, 1e-4),
            ] {
                prop_assert!(seen <= peak * (1.0 + slack) + 1e-9, "{seen} {peak}: {peaks:?}");
            }
            // After a change an earlier part may count too.
            if changed.is_none() && up.min(down) > 0.05 && profile.duration() < 5.0 {
                prop_assert!(speed > 0.99 * peaks.speed && acceleration > 0.99 * peaks.acceleration && jerk > 0.9 * peaks.jerk, "{speed} {acceleration} {jerk}: {peaks:?}");
            }
        }
    }
}
