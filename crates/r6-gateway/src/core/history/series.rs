//! The samples of an open block in little memory: a gateway of a thousand robots holds millions of them.
//!
//! Most signals are numbers with few digits. Such a sample takes 8 bytes: its time since the first sample of
//! the block, and its number times a power of ten, or its gap. A block with anything else keeps its samples
//! as they are, 24 bytes each.

use r6_api::gateway::Gap;

use super::codec::{Kind, MAX_DIGITS, scale, unscale};
use super::sample::{Micros, Sample, State, gap_code, gap_of_code};

/// How much room is taken at once: for half as many samples as there are, within these bounds. Most signals
/// have few samples, and a full block has little room that is unused.
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
    /// Numbers and gaps.
    Short {
        first: Micros,
        unit: Unit,
        /// The µs since the first sample; the number in its unit, or a gap ([`GAPS`]).
        numbers: Vec<(u32, i32)>,
    },
    /// Anything.
    Long(Vec<Sample>),
}

/// What the numbers of a block count.
#[derive(Clone, Copy, Debug)]
enum Unit {
    /// There are only gaps so far.
    Unknown,
    /// Whole numbers.
    Whole,
    /// Decimals, times this power of ten.
    Digits(u8),
}

/// Numbers up to this one stand for gaps: the lowest number and the code of the gap.
const GAPS: i32 = i32::MIN + u8::MAX as i32;

impl Series {
    /// Without a sample: the first one will be of this time.
    pub fn new(first: Micros) -> Self {
        let column = Column::Short { first, unit: Unit::Unknown, numbers: Vec::new() };
        Self { column, last: first, texts: 0 }
    }

    /// Adds a sample.
    pub fn push(&mut self, sample: Sample) {
        self.last = sample.time;
        if let Column::Short { first, unit, numbers } = &mut self.column {
            room(numbers);
            if let Some(short) = shorten(*first, unit, numbers, &sample) {
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
        let mut samples = Vec::with_capacity(self.len().saturating_sub(begin));
        self.append_to(&mut samples, begin);
        samples
    }

    /// Appends the samples from this number on.
    pub fn append_to(&self, out: &mut Vec<Sample>, begin: usize) {
        match &self.column {
            Column::Short { first, unit, numbers } => {
                let numbers = numbers.get(begin..).unwrap_or_default();
                out.extend(numbers.iter().map(|short| lengthened(*first, *unit, *short)));
            }
            Column::Long(samples) => out.extend_from_slice(samples.get(begin..).unwrap_or_default()),
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
            Column::Short { unit: Unit::Unknown, .. } => None,
            Column::Short { unit: Unit::Whole, .. } => Some(Kind::Integer),
            Column::Short { unit: Unit::Digits(_), .. } => Some(Kind::Decimal),
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
    unit: &mut Unit,
    numbers: &mut [(u32, i32)],
    sample: &Sample,
) -> Option<(u32, i32)> {
    let since = u32::try_from(sample.time.0.checked_sub(first.0)?).ok()?;
    let number = match (&sample.state, *unit) {
        (State::Gap(gap), _) => i32::MIN + i32::from(gap_code(*gap)),
        (State::Integer(number), Unit::Unknown | Unit::Whole) => {
            let short = short(*number)?;
            *unit = Unit::Whole;
            short
        }
        (State::Decimal(number), Unit::Unknown) => {
            let (digits, scaled) = scaled(*number, 0)?;
            *unit = Unit::Digits(digits);
            scaled
        }
        (State::Decimal(number), Unit::Digits(few)) => {
            let (more, scaled) = scaled(*number, few)?;
            if more > few {
                let factor = 10_i32.checked_pow(u32::from(more - few))?;
                let is_gap = |number: i32| number <= GAPS;
                let fits =
                    |number: i32| is_gap(number) || number.checked_mul(factor).is_some_and(|n| !is_gap(n));
                if !numbers.iter().all(|(_, number)| fits(*number)) {
                    return None;
                }
                let values = numbers.iter_mut().filter(|(_, number)| !is_gap(*number));
                values.for_each(|(_, number)| *number = number.wrapping_mul(factor));
                *unit = Unit::Digits(more);
            }
            scaled
        }
        (State::Integer(_), Unit::Digits(_)) | (State::Decimal(_), Unit::Whole) | (State::Text(_), _) => {
            return None;
        }
    };
    Some((since, number))
}

/// A number that stands for no gap.
fn short(number: i64) -> Option<i32> {
    i32::try_from(number).ok().filter(|number| *number > GAPS)
}

/// A decimal with so few digits, or with as many more as it needs.
fn scaled(number: f64, few: u8) -> Option<(u8, i32)> {
    (few..=MAX_DIGITS).find_map(|digits| Some((digits, short(scale(number, digits)?)?)))
}

/// What was shortened.
fn lengthened(first: Micros, unit: Unit, (since, number): (u32, i32)) -> Sample {
    let time = Micros(first.0.saturating_add(i64::from(since)));
    let state = match unit {
        _ if number <= GAPS => {
            let gap = u8::try_from(number.wrapping_sub(i32::MIN)).ok().and_then(gap_of_code);
            State::Gap(gap.unwrap_or(Gap::None))
        }
        Unit::Unknown | Unit::Whole => State::Integer(i64::from(number)),
        Unit::Digits(digits) => State::Decimal(unscale(i64::from(number), digits)),
    };
    Sample { time, state }
}

#[cfg(test)]
mod tests {
    use super::super::codec::power;
    use super::*;
    use proptest::prelude::*;

    fn of(samples: &[Sample]) -> Series {
        let mut series = Series::new(samples[0].time);
        samples.iter().for_each(|sample| series.push(sample.clone()));
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
    fn a_lost_link_costs_no_more_memory() {
        let sample = |at: i64, state| Sample { time: Micros(at), state };
        let mut samples = decimals(&[1.5, 2.25]);
        samples.push(sample(2, State::Gap(Gap::Stale)));
        samples.push(sample(3, State::Decimal(0.125)));
        samples.insert(0, sample(0, State::Gap(Gap::Lost)));
        let series = of(&samples);
        assert_eq!((series.from(0), series.size()), (samples, 8 * 8));
        assert_eq!(of(&[sample(0, State::Gap(Gap::Ended))]).kind(), None);
        let lowest = [sample(0, State::Integer(i64::from(i32::MIN) + 1)), sample(1, State::Integer(-1))];
        assert_eq!(of(&lowest).from(0), lowest);
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
            4 => prop::sample::select(Gap::ALL.to_vec()).prop_map(State::Gap),
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
