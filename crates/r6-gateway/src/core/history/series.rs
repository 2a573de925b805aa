//! The samples of an open block in little memory: a gateway of a thousand robots holds millions of them.
//!
//! Most signals are numbers with few digits. Such a sample takes 8 bytes: its time since the first sample of
//! the block, and its number times a power of ten. A block with anything else keeps its samples as they are.

use super::codec::{Kind, MAX_DIGITS, scale, unscale};
use super::sample::{Micros, Sample, State};

/// How much room is taken at once: for half as many samples as there are, within these bounds. Most signals have
/// few samples, and a full block has little room that is unused.
const ROOM: std::ops::RangeInclusive<usize> = 4..=64;

fn room<T>(samples: &mut Vec<T>) {
    if samples.len() == samples.capacity() {
        samples.reserve_exact((samples.len() / 2).clamp(*ROOM.start(), *ROOM.end()));
    }
}

/// Samples of one signal, none earlier than the first one.
#[derive(Debug)]
pub struct Series {
    column: Column,
    last: Micros,
    /// The memory of texts, in bytes.
    texts: usize,
}

#[derive(Debug)]
enum Column {
    /// Numbers without gaps.
    Short {
        first: Micros,
        /// The digits behind the point; `None` for whole numbers.
        digits: Option<u8>,
        /// The µs since the first sample, and the number times this power of ten.
        numbers: Vec<(u32, i32)>,
    },
    /// Anything.
    Long(Vec<Sample>),
}

impl Series {
    /// With its first sample.
    pub fn new(sample: Sample) -> Self {
        let digits = if let State::Decimal(_) = sample.state { Some(0) } else { None };
        let column = Column::Short { first: sample.time, digits, numbers: Vec::new() };
        let mut series = Self { column, last: sample.time, texts: 0 };
        series.push(sample);
        series
    }

    /// Adds a sample.
    pub fn push(&mut self, sample: Sample) {
        self.last = sample.time;
        if let Column::Short { first, digits, numbers } = &mut self.column {
            room(numbers);
            if let Some(short) = shorten(*first, digits, numbers, &sample) {
                numbers.push(short);
                return;
            }
        }
        if let Column::Short { .. } = self.column {
            self.column = Column::Long(self.from(0));
        }
        if let Column::Long(samples) = &mut self.column {
            room(samples);
            self.texts += sample.size() - size_of::<Sample>();
            samples.push(sample);
        }
    }

    /// The samples from this number on.
    pub fn from(&self, begin: usize) -> Vec<Sample> {
        match &self.column {
            Column::Short { first, digits, numbers } => {
                let numbers = numbers.get(begin..).unwrap_or_default();
                numbers.iter().map(|short| lengthened(*first, *digits, *short)).collect()
            }
            Column::Long(samples) => samples.get(begin..).unwrap_or_default().to_vec(),
        }
    }

    /// How many samples there are.
    pub fn len(&self) -> usize {
        match &self.column {
            Column::Short { numbers, .. } => numbers.len(),
            Column::Long(samples) => samples.len(),
        }
    }

    /// The time of the first sample.
    pub fn first(&self) -> Micros {
        match &self.column {
            Column::Short { first, .. } => *first,
            Column::Long(samples) => samples.first().map_or(self.last, |sample| sample.time),
        }
    }

    /// The time of the last sample.
    pub fn last(&self) -> Micros {
        self.last
    }

    /// What its values are; `None` if there are only gaps.
    pub fn kind(&self) -> Option<Kind> {
        match &self.column {
            Column::Short { digits, .. } => Some(digits.map_or(Kind::Integer, |_| Kind::Decimal)),
            Column::Long(samples) => samples.iter().rev().find_map(|sample| Kind::of(&sample.state)),
        }
    }

    /// The memory that it takes, in bytes.
    pub fn size(&self) -> usize {
        self.texts
            + match &self.column {
                Column::Short { numbers, .. } => numbers.capacity() * size_of::<(u32, i32)>(),
                Column::Long(samples) => samples.capacity() * size_of::<Sample>(),
            }
    }
}

/// A sample in 8 bytes, if it fits. Numbers before it get more digits where it needs them.
fn shorten(
    first: Micros,
    digits: &mut Option<u8>,
    numbers: &mut [(u32, i32)],
    sample: &Sample,
) -> Option<(u32, i32)> {
    let since = u32::try_from(sample.time.0.checked_sub(first.0)?).ok()?;
    let number = match (&sample.state, *digits) {
        (State::Integer(number), None) => i32::try_from(*number).ok()?,
        (State::Decimal(number), Some(few)) => {
            let fit = |digits| Some((digits, i32::try_from(scale(*number, digits)?).ok()?));
            let (more, scaled) = (few..=MAX_DIGITS).find_map(fit)?;
            if more > few {
                let factor = 10_i32.checked_pow(u32::from(more - few))?;
                if numbers.iter().any(|(_, before)| before.checked_mul(factor).is_none()) {
                    return None;
                }
                numbers.iter_mut().for_each(|(_, before)| *before = before.wrapping_mul(factor));
                *digits = Some(more);
            }
            scaled
        }
        (State::Decimal(_) | State::Integer(_) | State::Text(_) | State::Gap(_), _) => return None,
    };
    Some((since, number))
}

/// What was shortened.
fn lengthened(first: Micros, digits: Option<u8>, (since, number): (u32, i32)) -> Sample {
    let time = Micros(first.0.saturating_add(i64::from(since)));
    let state = match digits {
        None => State::Integer(i64::from(number)),
        Some(digits) => State::Decimal(unscale(i64::from(number), digits)),
    };
    Sample { time, state }
}

#[cfg(test)]
mod tests {
    use super::super::codec::power;
    use super::*;
    use proptest::prelude::*;
    use r6_api::gateway::Gap;

    fn of(samples: &[Sample]) -> Series {
        let mut series = Series::new(samples[0].clone());
        samples[1..].iter().for_each(|sample| series.push(sample.clone()));
        series
    }

    fn decimals(numbers: &[f64]) -> Vec<Sample> {
        let sample = |(at, number): (i64, &f64)| Sample { time: Micros(at), state: State::Decimal(*number) };
        (0..).zip(numbers).map(sample).collect()
    }

    #[test]
    fn numbers_with_few_digits_take_8_bytes_each() {
        let axis: Vec<_> = (0..512).map(|at| f64::from(at * 351 - 90_000) / 1000.0).collect();
        assert_eq!(of(&decimals(&axis)).size() / 512, 8);
        let whole = |at: i64| Sample { time: Micros(at), state: State::Integer(at * 4_000_000) };
        assert_eq!(of(&(0..512).map(whole).collect::<Vec<_>>()).size() / 512, 8);
    }

    #[test]
    fn a_number_with_more_digits_changes_none_before_it() {
        for numbers in [
            &[1.0, 0.5, -0.125, 180.0, 1e-9][..],
            &[2e9, 0.1],
            &[3e9],
            &[0.0, -0.0],
            &[1.5, f64::NAN, 2.5],
            &[0.1 + 0.2, 0.3],
        ] {
            let samples = decimals(numbers);
            assert_eq!(of(&samples).from(0), samples);
        }
    }

    fn any_sample() -> impl Strategy<Value = State> {
        let printed = (-4_000_000_i64..4_000_000, 0_u8..=7);
        prop_oneof![
            40 => printed.prop_map(|(number, digits)| State::Decimal(number as f64 / power(digits))),
            10 => any::<i16>().prop_map(|number| State::Integer(number.into())),
            1 => any::<i64>().prop_map(State::Integer),
            1 => any::<u64>().prop_map(|bits| State::Decimal(f64::from_bits(bits))),
            1 => Just(State::Gap(Gap::Stale)),
            1 => "[a-c]{0,4}".prop_map(|text| State::Text(text.into())),
        ]
    }

    proptest! {
        #[test]
        fn every_sample_comes_back_bit_by_bit(
            states in prop::collection::vec(any_sample(), 1..40),
            kind in 0..4_usize,
            step in prop_oneof![Just(100_000_i64), Just(1 << 30)],
        ) {
            // Of one kind, in general, as blocks are.
            let mut samples: Vec<_> = (0..).zip(states).map(|(at, state)| {
                Sample { time: Micros(1_700_000_000_000_000 + at * step), state }
            }).collect();
            let is = |sample: &Sample| match kind {
                0 => matches!(sample.state, State::Decimal(_)),
                1 => matches!(sample.state, State::Integer(_)),
                2 => !matches!(sample.state, State::Integer(_) | State::Text(_)),
                _ => true,
            };
            samples.retain(is);
            prop_assume!(!samples.is_empty());
            let series = of(&samples);
            prop_assert_eq!(series.len(), samples.len());
            prop_assert_eq!((series.first(), series.last()), (samples[0].time, samples.last().unwrap().time));
            let last = samples.iter().rev().find_map(|sample| Kind::of(&sample.state));
            prop_assert_eq!(series.kind(), last);
            for begin in [0, 1, samples.len() - 1, samples.len(), samples.len() + 1] {
                prop_assert_eq!(&series.from(begin)[..], samples.get(begin..).unwrap_or_default());
            }
            let texts: usize = samples.iter().map(|sample| sample.size() - size_of::<Sample>()).sum();
            prop_assert!(series.size() >= texts + 8 * samples.len());
            prop_assert!(series.size() <= texts + 24 * (samples.len() + *ROOM.end()));
        }
    }
}
