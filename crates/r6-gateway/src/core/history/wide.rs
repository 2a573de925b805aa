//! Buckets put together to wider ones.
//!
//! It gives what [`super::buckets`] gives for the same samples, up to the rounding of sums, if the edges of
//! the wide buckets are edges of the narrow ones. Otherwise a narrow bucket counts as a whole in the wide
//! bucket in which it begins.

use super::buckets::Bucket;
use super::sample::Micros;

/// Takes in narrow buckets in the order of time.
#[derive(Debug)]
pub struct Wide {
    begin: Micros,
    width: i64,
    done: Vec<Bucket>,
    /// The sum of numbers times µs in the last bucket of `done`.
    sum: f64,
    /// The end of the last narrow bucket.
    known: Micros,
}

impl Wide {
    /// Wide buckets of this width in µs, the first of which begins at `begin`.
    #[must_use]
    pub fn new(begin: Micros, width: i64) -> Self {
        Self { begin, width: width.max(1), done: Vec::new(), sum: 0.0, known: begin }
    }

    /// Takes in a narrow bucket of this width in µs. Those before the begin are left out.
    #[expect(clippy::cast_precision_loss, reason = "a span of years is below 2^53 µs")]
    pub fn add(&mut self, narrow: Bucket, width: i64) {
        if narrow.start < self.begin {
            return;
        }
        self.fill(narrow.start);
        let Some(wide) = self.done.last_mut() else { return };
        if let Some(mean) = narrow.mean {
            self.sum += mean * narrow.weight as f64;
        }
        wide.weight = wide.weight.saturating_add(narrow.weight);
        wide.mean = (wide.weight > 0).then(|| self.sum / wide.weight as f64);
        wide.good = wide.good.saturating_add(narrow.good);
        wide.samples = wide.samples.saturating_add(narrow.samples);
        wide.range = match (wide.range, narrow.range) {
            (Some(one), Some(other)) => Some((one.0.min(other.0), one.1.max(other.1))),
            (one, other) => one.or(other),
        };
        wide.last = narrow.last;
        self.known = Micros(narrow.start.0.saturating_add(width));
    }

    /// The buckets of the range up to this time. The last one may end behind it.
    #[must_use]
    pub fn finish(mut self, to: Micros) -> Vec<Bucket> {
        if to > self.begin {
            self.fill(Micros(to.0 - 1));
            self.forget_last(to);
        }
        self.done.retain(|bucket| bucket.start < to);
        self.done
    }

    /// Makes the bucket of this time the last one.
    fn fill(&mut self, time: Micros) {
        loop {
            let next = self.done.len() as u64;
            let next = i64::try_from(next).unwrap_or(i64::MAX).saturating_mul(self.width);
            let start = Micros(self.begin.0.saturating_add(next));
            if start > time {
                return;
            }
            self.forget_last(start);
            self.done.push(Bucket::empty(start));
            self.sum = 0.0;
        }
    }

    /// A bucket whose end no narrow bucket reaches has no value at its end.
    fn forget_last(&mut self, end: Micros) {
        if self.known < end
            && let Some(last) = self.done.last_mut()
        {
            last.last = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::buckets::Buckets;
    use super::super::sample::{Interval, Sample, State};
    use super::*;
    use proptest::prelude::*;
    use r6_api::gateway::Gap;

    fn of(samples: &[Sample], to: i64, width: i64) -> Vec<Bucket> {
        let mut buckets = Buckets::new(Micros(0), Micros(to), width, usize::MAX);
        samples.iter().for_each(|sample| buckets.sample(Interval::USUAL, sample.clone()));
        buckets.finish()
    }

    #[test]
    fn a_narrow_bucket_counts_where_it_begins() {
        let bucket = |start, mean: f64| Bucket {
            mean: Some(mean),
            range: Some((mean, mean)),
            last: Some(State::Decimal(mean)),
            good: 10,
            weight: 10,
            samples: 1,
            ..Bucket::empty(Micros(start))
        };
        let mut wide = Wide::new(Micros(5), 15);
        for (start, mean) in [(0, 9.0), (10, 1.0), (20, 3.0), (30, 4.0), (60, 5.0)] {
            wide.add(bucket(start, mean), 10);
        }
        let wide = wide.finish(Micros(80));
        let told: Vec<_> = wide.iter().map(|bucket| (bucket.start.0, bucket.mean, bucket.samples)).collect();
        assert_eq!(
            told,
            [(5, Some(1.0), 1), (20, Some(3.5), 2), (35, None, 0), (50, Some(5.0), 1), (65, None, 0)]
        );
        assert_eq!(wide[0].last, Some(State::Decimal(1.0)));
        assert!(wide[1].last.is_some() && wide[3].last.is_some());
        assert_eq!(Wide::new(Micros(5), 15).finish(Micros(5)), []);
    }

    proptest! {
        /// Narrow buckets together are what the samples give at once, also if empty ones are left out.
        #[test]
        fn buckets_of_buckets_are_buckets_of_samples(
            steps in prop::collection::vec((1_i64..200, 0_i64..6, -100_i64..100), 1..80),
            many in 1_i64..9,
        ) {
            let (mut time, mut samples) = (-30_000_000, Vec::new());
            for (step, kind, number) in steps {
                time += step * 1_000_000;
                let state = match kind {
                    0 => State::Gap(Gap::Stale),
                    1 => State::Text("text".into()),
                    2 => State::Decimal(0.1 * f64::from(i32::try_from(number).unwrap())),
                    _ => State::Integer(number),
                };
                samples.push(Sample { time: Micros(time), state });
            }
            let narrow_width = 20_000_000;
            let width = narrow_width * many;
            let to = (time.max(0) / width + 2) * width;
            let mut wide = Wide::new(Micros(0), width);
            for narrow in of(&samples, to, narrow_width) {
                if !narrow.is_empty() {
                    wide.add(narrow, narrow_width);
                }
            }
            let (wide, whole) = (wide.finish(Micros(to)), of(&samples, to, width));
            prop_assert_eq!(wide.len(), whole.len());
            for (wide, whole) in wide.into_iter().zip(whole) {
                let is_near = match (wide.mean, whole.mean) {
                    (Some(one), Some(other)) => (one - other).abs() < 1e-9,
                    (one, other) => one == other,
                };
                prop_assert!(is_near, "{:?} {:?}", wide, whole);
                prop_assert_eq!(Bucket { mean: whole.mean, ..wide }, whole);
            }
        }
    }
}
