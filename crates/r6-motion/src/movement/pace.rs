//! How fast the time of a plan passes: evenly, ever slower until it stands still, or gaining again.
//!
//! Halting an arm by letting its plan run down keeps it on its path, through corners too, and going on is the same
//! the other way round.

use crate::profile::SmoothStep;

/// Halvings that find a time to the last digit of a double.
const HALVINGS: usize = 80;

/// The time of a plan as a function of real time, both in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pace {
    /// The plan's time when the change of pace began.
    began: f64,
    /// The pace before it.
    before: f64,
    /// The pace after it.
    after: f64,
    /// How it changes; `None`: at once.
    step: Option<SmoothStep>,
    /// How much of real time has passed since it began.
    passed: f64,
}

impl Pace {
    /// As fast as real time.
    pub(super) const EVEN: Self = Self { began: 0.0, before: 1.0, after: 1.0, step: None, passed: 0.0 };

    /// The same, told from `at` seconds later on.
    pub(super) fn from(self, at: f64) -> Self {
        Self { passed: self.passed + at, ..self }
    }

    /// From `at` on another pace, 0 or 1, reached by this step; without one, at once.
    pub(super) fn to(self, at: f64, after: f64, step: Option<SmoothStep>) -> Self {
        Self { began: self.time(at), before: self.rate(at), after, step, passed: 0.0 }
    }

    /// The plan's time at `t`.
    pub(super) fn time(&self, t: f64) -> f64 {
        let t = self.passed + t;
        let width = self.step.map_or(0.0, |step| step.width());
        let changing = t.min(width);
        let changed = self.step.map_or(0.0, |step| step.at(changing).area);
        let evenly = if t > width && !self.stops() { self.after * (t - width) } else { 0.0 };
        self.began + self.before * changing + (self.after - self.before) * changed + evenly
    }

    /// How fast the plan's time passes at `t`, 0 to 1.
    pub(super) fn rate(&self, t: f64) -> f64 {
        let share = self.step.map_or(1.0, |step| step.at(self.passed + t).height);
        self.before + (self.after - self.before) * share
    }

    /// Whether it comes to a stand.
    pub(super) fn stops(&self) -> bool {
        self.after <= 0.0
    }

    /// How long until it no longer changes.
    pub(super) fn settles(&self) -> f64 {
        (self.step.map_or(0.0, |step| step.width()) - self.passed).max(0.0)
    }

    /// When the plan's time is `time`; `None` when it stops before. In the past it is now.
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
                // Where time all but stands still, one instant is as good as the next.
                prop_assert!(pace.rate(t) < 1e-3 || (when - t).abs() < 1e-9, "{when} {t}");
                let rate = (pace.time(t + 1e-6) - time) / 1e-6;
                prop_assert!((rate - pace.rate(t)).abs() < 1e-3 + 1e-5 / halt.min(gain));
            }
        }
    }
}
