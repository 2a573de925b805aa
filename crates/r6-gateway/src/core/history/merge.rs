//! Chunks that may overlap, as one series in the order of time.

use std::collections::BTreeMap;

use super::sample::{Interval, Micros, Sample};

/// Puts samples in the order of time. Of two samples of one time, the later added one wins.
#[derive(Debug, Default)]
pub struct Merge {
    waiting: BTreeMap<Micros, (Interval, Sample)>,
}

impl Merge {
    /// Adds the samples of a chunk.
    pub fn add(&mut self, interval: Interval, samples: Vec<Sample>) {
        self.waiting.extend(samples.into_iter().map(|sample| (sample.time, (interval, sample))));
    }

    /// The samples before this time, which no later chunk has any of.
    pub fn before(&mut self, time: Micros) -> impl Iterator<Item = (Interval, Sample)> {
        let later = self.waiting.split_off(&time);
        std::mem::replace(&mut self.waiting, later).into_values()
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample::State;
    use super::*;

    #[test]
    fn chunks_that_overlap_become_one_series() {
        let series = |times: &[i64], value| {
            let sample = |time: &i64| Sample { time: Micros(*time), state: State::Integer(value) };
            times.iter().map(sample).collect::<Vec<_>>()
        };
        let mut merge = Merge::default();
        merge.add(Interval::USUAL, series(&[1, 4, 9], 1));
        merge.add(Interval::USUAL, series(&[2, 4, 6], 2));
        let seen: Vec<_> = merge.before(Micros(5)).map(|(_, sample)| sample).collect();
        assert_eq!(seen, [series(&[1], 1), series(&[2, 4], 2)].concat());
        assert_eq!(merge.before(Micros(i64::MAX)).count(), 2);
        assert_eq!(merge.before(Micros(i64::MAX)).count(), 0);
    }
}
