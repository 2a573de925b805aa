//! Averages weighted by time: what a signal was in each span of a range.
//!
//! A value counts from its time until the next sample, and for 2.5 intervals at most. The value before the
//! range counts at its begin.

use super::block::Summary;
use super::sample::{Interval, Micros, Sample, State};

/// One span of time.
#[derive(Clone, Debug, PartialEq)]
pub struct Bucket {
    /// Its begin.
    pub start: Micros,
    /// The average of the numbers, weighted by time.
    pub mean: Option<f64>,
    /// The smallest and the largest number.
    pub range: Option<(f64, f64)>,
    /// The value at its end.
    pub last: Option<State>,
    /// For how many µs there was a value.
    pub good: i64,
    /// For how many µs there was a number: what [`Self::mean`] weighs if buckets are put together.
    pub weight: i64,
    /// How many samples were in it.
    pub samples: u64,
}

impl Bucket {
    /// A span in which nothing is known.
    #[must_use]
    pub fn empty(start: Micros) -> Self {
        Self { start, mean: None, range: None, last: None, good: 0, weight: 0, samples: 0 }
    }

    /// Whether nothing is known in it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.good == 0 && self.samples == 0 && self.range.is_none() && self.last.is_none()
    }
}

/// Sorts samples into buckets. They come in the order of time.
#[derive(Debug)]
pub struct Buckets {
    width: i64,
    to: Micros,
    most: usize,
    done: Vec<Bucket>,
    start: Micros,
    /// Everything before is in a bucket.
    at: Micros,
    held: Option<(State, Micros)>,
    sum: f64,
    /// For how many µs there was a number.
    weight: i64,
    good: i64,
    range: Option<(f64, f64)>,
    samples: u64,
}

impl Buckets {
    /// Buckets of this width in µs, from one time to another, and no more than `most`.
    #[must_use]
    pub fn new(from: Micros, to: Micros, width: i64, most: usize) -> Self {
        Self {
            width: width.max(1),
            to,
            most,
            done: Vec::new(),
            start: from,
            at: from,
            held: None,
            sum: 0.0,
            weight: 0,
            good: 0,
            range: None,
            samples: 0,
        }
    }

    /// Takes in a sample.
    pub fn sample(&mut self, interval: Interval, sample: Sample) {
        let Sample { time, state } = sample;
        self.advance(time);
        if self.is_full() || time >= self.to {
            return;
        }
        if time >= self.start {
            self.samples += 1;
            self.widen(state.number());
        }
        self.held = Some((state, interval.held_until(time)));
    }

    /// Takes in a chunk of numbers without its samples. All of it is in one bucket, and so is the sample that
    /// follows.
    pub fn summary(&mut self, chunk: &Summary) {
        self.advance(chunk.first);
        if self.is_full() || chunk.last >= self.to {
            return;
        }
        self.samples += u64::from(chunk.count);
        self.sum += chunk.sum;
        self.good = self.good.saturating_add(chunk.good);
        self.weight = self.weight.saturating_add(chunk.good);
        if let Some((min, max)) = chunk.range {
            self.widen(Some(min));
            self.widen(Some(max));
        }
        self.at = self.at.max(chunk.last);
        let until = chunk.interval.held_until(chunk.last);
        self.held = chunk.last_number.map(|number| (State::Decimal(number), until));
    }

    /// The buckets, the last one too if the range ends within it.
    #[must_use]
    pub fn finish(mut self) -> Vec<Bucket> {
        self.advance(self.to);
        if !self.is_full() && self.at > self.start {
            self.close();
        }
        self.done
    }

    /// Whether there are as many as were asked for.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.done.len() >= self.most
    }

    /// Everything before this time is known.
    #[expect(clippy::cast_precision_loss, reason = "a span of years is below 2^53 µs")]
    fn advance(&mut self, time: Micros) {
        let time = time.min(self.to);
        while self.at < time && !self.is_full() {
            let end = Micros(self.start.0.saturating_add(self.width));
            let stop = time.min(end);
            if let Some((state, until)) = &self.held
                && state.gap().is_none()
            {
                let held = stop.min(*until).0.saturating_sub(self.at.0).max(0);
                let number = state.number().filter(|_| held > 0);
                self.good = self.good.saturating_add(held);
                if let Some(number) = number {
                    self.sum += number * held as f64;
                    self.weight = self.weight.saturating_add(held);
                }
                self.widen(number);
            }
            self.at = stop;
            if stop == end {
                self.close();
            }
        }
    }

    fn widen(&mut self, number: Option<f64>) {
        let Some(number) = number else { return };
        let (min, max) = self.range.unwrap_or((number, number));
        self.range = Some((min.min(number), max.max(number)));
    }

    #[expect(clippy::cast_precision_loss, reason = "a span of years is below 2^53 µs")]
    fn close(&mut self) {
        let held = self.held.as_ref().filter(|(state, until)| state.gap().is_none() && *until >= self.at);
        self.done.push(Bucket {
            start: self.start,
            mean: (self.weight > 0).then(|| std::mem::take(&mut self.sum) / self.weight as f64),
            range: self.range.take(),
            last: held.map(|(state, _)| state.clone()),
            good: std::mem::take(&mut self.good),
            weight: self.weight,
            samples: std::mem::take(&mut self.samples),
        });
        (self.sum, self.weight) = (0.0, 0);
        self.start = self.at;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use r6_api::gateway::Gap;

    const SECOND: i64 = 1_000_000;

    fn at(second: i64, state: State) -> Sample {
        Sample { time: Micros(second * SECOND), state }
    }

    fn of(samples: &[Sample], from: i64, to: i64, width: i64) -> Vec<Bucket> {
        let mut buckets = Buckets::new(Micros(from * SECOND), Micros(to * SECOND), width * SECOND, 1000);
        samples.iter().for_each(|sample| buckets.sample(Interval::USUAL, sample.clone()));
        buckets.finish()
    }

    #[test]
    fn averages_are_weighted_by_time_and_count_the_value_before() {
        let series = [at(-5, State::Integer(10)), at(7, State::Integer(20)), at(12, State::Gap(Gap::Stale))];
        let buckets = of(&series, 0, 25, 10);
        assert_eq!(buckets.len(), 3);
        assert_eq!((buckets[0].mean, buckets[0].range), (Some(13.0), Some((10.0, 20.0))));
        assert_eq!((buckets[0].good, buckets[0].samples), (10 * SECOND, 1));
        assert_eq!(buckets[0].last, Some(State::Integer(20)));
        assert_eq!((buckets[1].mean, buckets[1].good, buckets[1].samples), (Some(20.0), 2 * SECOND, 1));
        assert_eq!(buckets[1].last, None);
        assert_eq!((buckets[2].mean, buckets[2].range, buckets[2].good), (None, None, 0));
        assert_eq!(buckets[2].start, Micros(20 * SECOND));
    }

    #[test]
    fn a_value_does_not_count_for_ever() {
        let buckets = of(&[at(0, State::Decimal(4.0))], 0, 400, 200);
        assert_eq!((buckets[0].good, buckets[1].good), (150 * SECOND, 0));
        assert_eq!((buckets[0].mean, buckets[0].last.clone()), (Some(4.0), None));
        assert!(of(&[at(-151, State::Decimal(4.0))], 0, 1, 1)[0].mean.is_none());
    }

    #[test]
    fn texts_have_a_last_value_and_no_average() {
        let buckets = of(&[at(1, State::Text("a".into()))], 0, 2, 2);
        assert_eq!((buckets[0].mean, buckets[0].good), (None, SECOND));
        assert_eq!(buckets[0].last, Some(State::Text("a".into())));
    }

    proptest! {
        /// A chunk as a whole says the same as its samples.
        #[test]
        fn a_summary_is_as_good_as_its_samples(
            numbers in prop::collection::vec((1_i64..100_000_000, -100_i64..100, any::<bool>()), 1..40),
            before in -100_i64..100,
        ) {
            let mut time = 0;
            let mut samples = Vec::new();
            for (step, number, is_gap) in numbers {
                time += step;
                let state = if is_gap { State::Gap(Gap::None) } else { State::Integer(number) };
                samples.push(Sample { time: Micros(time), state });
            }
            let to = Micros(time + 1_000_000);
            let next = Sample { time: Micros(time + 1), state: State::Integer(0) };
            let before = Sample { time: Micros(-1), state: State::Integer(before) };
            let mut one = Buckets::new(Micros(0), to, to.0 * 2, 10);
            let mut other = Buckets::new(Micros(0), to, to.0 * 2, 10);
            one.sample(Interval::USUAL, before.clone());
            other.sample(Interval::USUAL, before);
            one.summary(&Summary::of(Interval::USUAL, &samples).unwrap());
            samples.into_iter().for_each(|sample| other.sample(Interval::USUAL, sample));
            one.sample(Interval::USUAL, next.clone());
            other.sample(Interval::USUAL, next);
            let (one, other) = (one.finish().remove(0), other.finish().remove(0));
            prop_assert_eq!((one.good, one.samples, one.range), (other.good, other.samples, other.range));
            let same = match (one.mean, other.mean) {
                (Some(one), Some(other)) => (one - other).abs() < 1e-6,
                (one, other) => one == other,
            };
            prop_assert!(same, "{:?} {:?}", one.mean, other.mean);
        }

        /// The good time of all buckets is that of one bucket, whatever their width.
        #[test]
        fn no_time_is_lost_between_buckets(
            numbers in prop::collection::vec((1_i64..100_000_000, -100_i64..100), 1..40),
            width in 1_000_000_i64..500_000_000,
        ) {
            let mut time = 0;
            let series: Vec<_> = numbers.into_iter().map(|(step, number)| {
                time += step;
                Sample { time: Micros(time), state: State::Integer(number) }
            }).collect();
            let to = Micros(time + 5);
            let of = |width| {
                let mut buckets = Buckets::new(Micros(0), to, width, 1_000_000);
                series.iter().for_each(|sample| buckets.sample(Interval::USUAL, sample.clone()));
                buckets.finish()
            };
            let (narrow, wide) = (of(width), of(i64::MAX));
            prop_assert_eq!(narrow.iter().map(|bucket| bucket.good).sum::<i64>(), wide[0].good);
            prop_assert_eq!(narrow.iter().map(|bucket| bucket.samples).sum::<u64>(), series.len() as u64);
        }
    }
}
