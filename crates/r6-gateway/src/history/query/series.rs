//! The samples of a range, with what a reader would not see in them: the value at the begin, and where there
//! is no data.

use r6_api::gateway::Gap;

use crate::core::history::sample::{Interval, Micros, Sample, State};

/// Takes in samples in the order of time.
#[derive(Debug)]
pub(super) struct Series {
    begin: Micros,
    to: Micros,
    limit: usize,
    /// The sample before the begin, which is told if it counts at the begin.
    before: Option<Sample>,
    tells_before: bool,
    /// Until when the last sample counts; `None` if it has no value.
    held_until: Option<Micros>,
    out: Vec<Sample>,
    next: Option<Micros>,
}

impl Series {
    pub fn new(begin: Micros, to: Micros, limit: usize, tells_before: bool) -> Self {
        let out = Vec::new();
        Self { begin, to, limit, before: None, tells_before, held_until: None, out, next: None }
    }

    pub fn push(&mut self, interval: Interval, sample: Sample) {
        if sample.time >= self.to || self.is_full() {
            return;
        }
        self.no_data_before(sample.time);
        let is_value = sample.state.gap().is_none();
        self.held_until = is_value.then(|| interval.held_until(sample.time));
        if sample.time < self.begin {
            self.before = Some(sample);
        } else {
            self.tell(sample);
        }
    }

    pub fn is_full(&self) -> bool {
        self.next.is_some()
    }

    /// The samples, and where to read on.
    pub fn finish(mut self) -> (Vec<Sample>, Option<Micros>) {
        self.no_data_before(self.to);
        self.tell_before();
        (self.out, self.next)
    }

    /// If the last value does not count until this time, the reader has to see that.
    fn no_data_before(&mut self, time: Micros) {
        let Some(until) = self.held_until.filter(|until| *until < time) else { return };
        self.held_until = None;
        if until < self.begin {
            self.before = None;
        } else {
            self.tell(Sample { time: until, state: State::Gap(Gap::NoData) });
        }
    }

    fn tell(&mut self, sample: Sample) {
        self.tell_before();
        if self.is_full() {
            return;
        }
        if self.out.len() >= self.limit {
            self.next = Some(sample.time);
        } else {
            self.out.push(sample);
        }
    }

    fn tell_before(&mut self) {
        let before = self.before.take().filter(|_| self.tells_before);
        self.tells_before = false;
        self.out.extend(before);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000;

    fn at(second: i64, state: State) -> Sample {
        Sample { time: Micros(second * SECOND), state }
    }

    fn no_data(second: i64) -> Sample {
        at(second, State::Gap(Gap::NoData))
    }

    fn one() -> State {
        State::Integer(1)
    }

    fn series(range: (i64, i64), limit: usize, samples: &[Sample]) -> (Vec<Sample>, Option<Micros>) {
        let mut series = Series::new(Micros(range.0 * SECOND), Micros(range.1 * SECOND), limit, true);
        samples.iter().for_each(|sample| series.push(Interval::USUAL, sample.clone()));
        series.finish()
    }

    #[test]
    fn the_value_at_the_begin_is_told_and_silence_is_no_data() {
        let samples = [at(-200, one()), at(-20, one()), at(10, one()), at(500, one()), at(1000, one())];
        let told = series((0, 900), 100, &samples).0;
        assert_eq!(
            told,
            [samples[1].clone(), samples[2].clone(), no_data(160), samples[3].clone(), no_data(650)]
        );
        // The value before ended within the range, or before it.
        assert_eq!(series((0, 900), 100, &samples[1..2]).0, [samples[1].clone(), no_data(130)]);
        assert_eq!(series((0, 900), 100, &samples[..1]).0, []);
        let gap = at(-1, State::Gap(Gap::Stale));
        assert_eq!(series((0, 900), 100, std::slice::from_ref(&gap)).0, [gap]);
    }

    #[test]
    fn pages_together_are_the_whole() {
        let samples: Vec<_> = (0..50).map(|n| at(n * 40 + (n / 10) * 300, one())).collect();
        let whole = series((5, 5000), 1000, &samples).0;
        for limit in 1..10 {
            let (mut pages, mut cursor) = (Vec::new(), None);
            loop {
                let begin = cursor.unwrap_or(Micros(5 * SECOND));
                let mut page = Series::new(begin, Micros(5000 * SECOND), limit, cursor.is_none());
                samples.iter().for_each(|sample| page.push(Interval::USUAL, sample.clone()));
                let (told, next) = page.finish();
                assert!(told.len() <= limit + 1);
                pages.extend(told);
                cursor = next;
                if next.is_none() {
                    break;
                }
            }
            assert_eq!(pages, whole, "{limit}");
        }
    }
}
