//! Which readings of a signal are kept: those that differ, and one for each interval.

use std::time::Duration;

use r6_api::gateway::Gap;

use super::sample::{Interval, Micros, Sample, State};

/// Whole numbers below are exact as decimals.
const MAX_WHOLE: f64 = 9_007_199_254_740_992.0;

/// Decides for the readings of one signal.
#[derive(Clone, Debug)]
pub struct ChangeOnly {
    interval: Interval,
    /// A number is kept if it differs from the last kept one by more than this.
    deadband: f64,
    /// The power of ten by which a decimal is multiplied to be rounded: 1000 keeps thousandths. `None` if all
    /// of its digits are kept.
    power: Option<f64>,
    last: Option<Sample>,
}

impl ChangeOnly {
    /// Nothing was kept yet.
    #[must_use]
    pub fn new(interval: Interval, deadband: f64) -> Self {
        // The power of ten whose inverse is a tenth of the deadband, or less.
        let digits = 1.0 - deadband.log10().floor();
        let is_rounded = deadband != 0.0 && (0.0..=9.0).contains(&digits);
        let power = is_rounded.then(|| 10_f64.powf(digits));
        Self { interval, deadband, power, last: None }
    }

    /// Takes in what was read. Returns it if it is to be kept. A decimal with a deadband is kept to a tenth
    /// of it: the history cannot be more exact than that.
    pub fn take(&mut self, time: Micros, state: State) -> Option<Sample> {
        let state = self.rounded(state);
        let keep = match &self.last {
            None => true,
            Some(last) => {
                let gone = time.0.saturating_sub(last.time.0);
                let interval = Micros(0).after(Duration::from_millis(self.interval.millis().into()));
                // A clock that was set back begins anew.
                gone < 0 || gone >= interval.0 || self.differs(&last.state, &state)
            }
        };
        if !keep {
            return None;
        }
        let sample = Sample { time, state };
        // A late reply is older than the gap that was told meanwhile, so the gap stands behind it: the next
        // reading ends the gap, whatever it is.
        let is_before_gap =
            self.last.as_ref().is_some_and(|last| last.state.gap().is_some() && time <= last.time);
        self.last = (!is_before_gap).then(|| sample.clone());
        Some(sample)
    }

    /// From now on there is no value, for this reason. Returns the sample that says so, once.
    pub fn gap(&mut self, time: Micros, gap: Gap) -> Option<Sample> {
        let known = self.last.as_ref()?;
        if known.state.gap().is_some() {
            return None;
        }
        let sample = Sample { time: time.max(known.time), state: State::Gap(gap) };
        self.last = Some(sample.clone());
        Some(sample)
    }

    /// What was kept last was lost: the next reading is kept, whatever it is.
    pub fn forget(&mut self) {
        self.last = None;
    }

    fn rounded(&self, state: State) -> State {
        let (State::Decimal(number), Some(power)) = (&state, self.power) else { return state };
        let whole = (number * power).round();
        // Numbers too large to have such digits stay as they are.
        if whole.abs() < MAX_WHOLE { State::Decimal(whole / power + 0.0) } else { state }
    }

    fn differs(&self, last: &State, next: &State) -> bool {
        match (last, next) {
            (State::Gap(_), State::Gap(_)) => false,
            (State::Decimal(_) | State::Integer(_), State::Decimal(_) | State::Integer(_)) => {
                let (Some(last_number), Some(number)) = (last.number(), next.number()) else { return true };
                // Large whole numbers may be one number as decimals.
                let differs = (number - last_number).abs();
                last != next && (self.deadband == 0.0 || differs > self.deadband || differs.is_nan())
            }
            (last, next) => last != next,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SECOND: i64 = 1_000_000;

    fn kept(deadband: f64, readings: &[(i64, State)]) -> Vec<Sample> {
        let mut filter = ChangeOnly::new(Interval::USUAL, deadband);
        readings.iter().filter_map(|(time, state)| filter.take(Micros(*time), state.clone())).collect()
    }

    #[test]
    fn only_changes_and_one_sample_a_minute_are_kept() {
        let readings: Vec<_> =
            (0..1300).map(|tenth| (tenth * SECOND / 10, State::Integer(i64::from(tenth >= 650)))).collect();
        let times: Vec<_> = kept(0.0, &readings).iter().map(|sample| sample.time.0 / 100_000).collect();
        assert_eq!(times, [0, 600, 650, 1250]);
    }

    #[test]
    fn a_slow_drift_is_kept_though_each_step_is_within_the_deadband() {
        let readings: Vec<_> = (0..100).map(|step| (step, State::Decimal(step as f64 * 0.1))).collect();
        let kept = kept(0.5, &readings);
        assert!(kept.len() > 15, "{kept:?}");
    }

    #[test]
    fn a_decimal_is_kept_to_a_tenth_of_its_deadband() {
        let kept = |deadband, number| kept(deadband, &[(0, State::Decimal(number))]).remove(0).state;
        assert_eq!(kept(0.001, 12.345_678), State::Decimal(12.3457));
        assert_eq!(kept(0.005, -0.000_049), State::Decimal(0.0));
        assert_eq!(kept(0.5, 12.345_678), State::Decimal(12.35));
        assert_eq!(kept(0.0, 12.345_678), State::Decimal(12.345_678));
        assert_eq!(kept(1e3, 12.345_678), State::Decimal(12.345_678));
        assert_eq!(kept(0.001, 1e300), State::Decimal(1e300));
    }

    #[test]
    fn a_gap_is_told_once_and_the_next_value_is_kept() {
        let mut filter = ChangeOnly::new(Interval::USUAL, 0.0);
        assert_eq!(filter.gap(Micros(1), Gap::Stale), None, "there was no value");
        assert!(filter.take(Micros(2), State::Integer(1)).is_some());
        let gap = filter.gap(Micros(1), Gap::Stale).unwrap();
        assert_eq!(gap, Sample { time: Micros(2), state: State::Gap(Gap::Stale) }, "time does not go back");
        assert_eq!(filter.gap(Micros(4), Gap::Stale), None);
        let late = filter.take(Micros(1), State::Integer(1));
        assert!(late.is_some(), "a late reply");
        assert!(filter.take(Micros(3), State::Integer(1)).is_some(), "the gap is behind the late reply");
        assert_eq!(filter.take(Micros(4), State::Integer(1)), None);
        assert!(filter.gap(Micros(4), Gap::Stale).is_some());
        assert!(filter.take(Micros(5), State::Integer(1)).is_some(), "the same value after a gap");
        filter.forget();
        assert!(filter.take(Micros(6), State::Integer(1)).is_some());
        assert!(filter.take(Micros(3), State::Integer(1)).is_some(), "the clock was set back");
    }

    proptest! {
        /// Whatever comes: at each reading, the last kept value is within the deadband and not too old.
        #[test]
        fn what_is_kept_tells_every_reading(
            readings in prop::collection::vec((0_i64..90_000_000, -50_i64..50), 1..200),
            deadband in 0_u8..20,
        ) {
            let deadband = f64::from(deadband);
            let mut filter = ChangeOnly::new(Interval::USUAL, deadband);
            let (mut time, mut last): (i64, Option<Sample>) = (0, None);
            for (step, number) in readings {
                time += step;
                let kept = filter.take(Micros(time), State::Integer(number));
                last = kept.or(last);
                let last = last.as_ref().unwrap();
                prop_assert!((last.state.number().unwrap() - number as f64).abs() <= deadband);
                prop_assert!(time - last.time.0 < 60 * SECOND);
            }
        }
    }
}
