//! The time scale of a plan: its time runs at full rate, slows down to a halt, or speeds up again.
//!
//! Slowing down the time of a plan keeps the arm on its path while it halts, through corners too. Resuming
//! speeds it up again.

use crate::speed_profile::SmoothStep;

/// Halvings that find a time to the last digit of a double.
const HALVINGS: usize = 80;

/// How long the rest of a change of pace may last when another change begins, in seconds: as short as a stop
/// of the arm.
const LONGEST_EASING: f64 = 0.1;

/// The time of a plan as a function of real time, both in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pace {
    /// The plan's time when the change of pace began.
    began: f64,
    /// The pace before it.
    before: f64,
    /// The pace after it.
    after: f64,
    /// How it changes; `None` for at once.
    step: Option<SmoothStep>,
    /// The rest of the change before it.
    easing: Easing,
    /// How much real time has passed since it began.
    passed: f64,
}

/// A slope of the pace that ends smoothly. Ending it at once would make the acceleration jump.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Easing {
    /// The slope at its beginning, per second.
    slope: f64,
    /// How long it takes to reach 0, in seconds; 0 without a slope.
    seconds: f64,
}

impl Easing {
    const NONE: Self = Self { slope: 0.0, seconds: 0.0 };

    /// Ends the slope of a pace smoothly. It is short enough to use at most half of the room up to full pace,
    /// or down to a halt. It is also at most half as long as the new change, which takes `change` seconds.
    fn of(slope: f64, pace: f64, change: f64) -> Self {
        /// The maximum of an easing with slope 1 and length 1, at a third of it.
        const HIGHEST: f64 = 4.0 / 27.0;
        let room = if slope > 0.0 { 1.0 - pace } else { pace };
        let seconds = (room / 2.0 / (HIGHEST * slope.abs())).min(change / 2.0).min(LONGEST_EASING);
        if seconds > 0.0 && slope != 0.0 { Self { slope, seconds } } else { Self::NONE }
    }

    /// What it adds at `t` to the time, to the pace, and to the slope of the pace.
    fn at(&self, t: f64) -> [f64; 3] {
        if self.seconds <= 0.0 {
            return [0.0; 3];
        }
        let x = (t / self.seconds).clamp(0.0, 1.0);
        let rest = 1.0 - x;
        let area = x * x * (0.5 - 2.0 / 3.0 * x + 0.25 * x * x);
        [
            self.slope * self.seconds * self.seconds * area,
            self.slope * self.seconds * x * rest * rest,
            self.slope * rest * (1.0 - 3.0 * x),
        ]
    }
}

impl Pace {
    /// The pace of real time.
    pub(super) const EVEN: Self =
        Self { began: 0.0, before: 1.0, after: 1.0, step: None, easing: Easing::NONE, passed: 0.0 };

    /// The same pace, with its time counted from `at` seconds later.
    pub(super) fn from(self, at: f64) -> Self {
        Self { passed: self.passed + at, ..self }
    }

    /// Changes to another pace, 0 or 1, from `at` on; with this step, or at once without one.
    ///
    /// The remaining slope of an earlier change is eased out, so that the acceleration does not jump.
    pub(super) fn to(self, at: f64, after: f64, step: Option<SmoothStep>) -> Self {
        let before = self.rate(at);
        let easing = step.map_or(Easing::NONE, |step| Easing::of(self.slope(at), before, step.width()));
        Self { began: self.time(at), before, after, step, easing, passed: 0.0 }
    }

    /// The time of the plan at `t`.
    pub(super) fn time(&self, t: f64) -> f64 {
        let t = self.passed + t;
        let width = self.step.map_or(0.0, |step| step.width());
        let changing = t.min(width);
        let changed = self.step.map_or(0.0, |step| step.at(changing).area);
        let evenly = if t > width && !self.stops() { self.after * (t - width) } else { 0.0 };
        let [eased, ..] = self.easing.at(t);
        self.began + self.before * changing + (self.after - self.before) * changed + evenly + eased
    }

    /// How fast the time of the plan runs at `t`, 0 to 1.
    pub(super) fn rate(&self, t: f64) -> f64 {
        let t = self.passed + t;
        let share = self.step.map_or(1.0, |step| step.at(t).height);
        let [_, eased, _] = self.easing.at(t);
        self.before + (self.after - self.before) * share + eased
    }

    /// The rate of change of the pace at `t`, per second.
    fn slope(&self, t: f64) -> f64 {
        let t = self.passed + t;
        let [_, _, eased] = self.easing.at(t);
        (self.after - self.before) * self.step.map_or(0.0, |step| step.at(t).slope) + eased
    }

    /// Whether the pace ends at 0.
    pub(super) fn stops(&self) -> bool {
        self.after <= 0.0
    }

    /// How long until the pace no longer changes.
    pub(super) fn settles(&self) -> f64 {
        (self.step.map_or(0.0, |step| step.width()) - self.passed).max(0.0)
    }

    /// When the plan reaches `time`; `None` if it stops before. A time in the past gives 0.
    pub(super) fn when(&self, time: f64) -> Option<f64> {
        let settles = self.settles();
        let by_then = self.time(settles);
        if time > by_then {
            return (!self.stops()).then(|| settles + (time - by_then) / self.after);
        }
        let (mut low, mut high) = (0.0, settles);
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            if self.time(middle) < time { low = middle } else { high = middle }
        }
        Some(high)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_stand_takes_half_the_way() {
        let pace = Pace::EVEN.to(2.0, 0.0, Some(SmoothStep::within(0.5)));
        assert_eq!((pace.time(0.0), pace.rate(0.0)), (2.0, 1.0));
        assert!((pace.time(0.5) - 2.25).abs() < 1e-12 && (pace.time(9.0) - 2.25).abs() < 1e-12);
        assert_eq!((pace.rate(0.5), pace.settles(), pace.when(2.3)), (0.0, 0.5, None));
    }

    proptest! {
        #[test]
        fn time_and_when_are_inverse(at in 0.0..3.0, halt in 0.0..1.0, again in 0.0..2.0, gain in 0.0..1.0, t in 0.0..3.0) {
            let step = |seconds| (seconds > 0.0).then(|| SmoothStep::within(seconds));
            let halting = Pace::EVEN.to(at, 0.0, step(halt));
            let going_on = halting.to(again, 1.0, step(gain)).from(t / 2.0);
            for pace in [halting, going_on] {
                let time = pace.time(t);
                let when = pace.when(time).unwrap();
                prop_assert!((pace.time(when) - time).abs() < 1e-9, "{when} {t}");
                // Where time almost stands still, nearby instants cannot be told apart.
                prop_assert!(pace.rate(t) < 1e-3 || (when - t).abs() < 1e-9, "{when} {t}");
                let rate = (pace.time(t + 1e-6) - time) / 1e-6;
                prop_assert!((rate - pace.rate(t)).abs() < 1e-3 + 1e-5 / halt.min(gain));
            }
        }

        /// After any number of changes, the pace stays between 0 and 1, and its slope does not jump.
        #[test]
        fn changes_upon_changes_are_smooth(
            changes in prop::collection::vec((0.0..0.6_f64, prop::bool::ANY, 0.05..0.6_f64), 1..8), t in 0.0..1.0_f64,
        ) {
            let mut pace = Pace::EVEN;
            for (at, go, seconds) in changes {
                let after = if go { 1.0 } else { 0.0 };
                let next = pace.to(at, after, Some(SmoothStep::within(seconds)));
                prop_assert!((next.slope(0.0) - pace.slope(at)).abs() < 1e-9, "{} {}", next.slope(0.0), pace.slope(at));
                prop_assert!((next.rate(0.0) - pace.rate(at)).abs() < 1e-12);
                pace = next;
                let rate = pace.rate(t);
                prop_assert!((-1e-12..=1.0 + 1e-12).contains(&rate), "{rate}");
                let h = 1e-6;
                let slope = (pace.rate(t + h) - pace.rate(t)) / h;
                prop_assert!((slope - pace.slope(t)).abs() < 0.1, "{slope} {}", pace.slope(t));
                prop_assert!(((pace.time(t + h) - pace.time(t)) / h - rate).abs() < 1e-4);
            }
        }
    }
}
