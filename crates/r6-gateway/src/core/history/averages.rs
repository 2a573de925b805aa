//! Averages: buckets of a minute and of an hour, computed when a day is over. They are kept when its samples
//! are gone.
//!
//! The bytes of the buckets of one signal on one day, numbers as in `bytes.rs`: the number of the codec · the
//! number of the step · the number of blocks · the blocks · CRC32C over all of that. A block has up to 512
//! buckets whose last values are of one kind: their number · their starts in steps since 1970 · the means ·
//! the minima · the maxima · the last values · the good times in µs · what of these had no number · the
//! numbers of samples. Buckets in which nothing is known are left out.
//!
//! Whole numbers are runs of equal differences: signals that stay take few bytes. They are not packed like
//! those of chunks, which takes longer. Decimals are whole numbers of a power of ten if that gives each of
//! them back bit by bit; otherwise they are runs of 8 bytes.

use r6_api::gateway::Gap;

use super::buckets::Bucket;
use super::bytes::{Reader, put, put_signed, seal};
use super::codec::{BadChunk, Kind, MAX_DIGITS, MAX_SAMPLES, column, fitting, put_column, scale, unscale};
use super::sample::{Micros, Sample, State};
use super::wide::Wide;

/// A day in µs.
pub const DAY: i64 = 86_400_000_000;

/// The number of this codec.
const CODEC: u8 = 1;

/// How wide averages are. The narrower one comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// A minute.
    Minute,
    /// An hour.
    Hour,
}

impl Step {
    /// Its width in µs.
    #[must_use]
    pub fn micros(self) -> i64 {
        match self {
            Self::Minute => 60_000_000,
            Self::Hour => 3_600_000_000,
        }
    }

    /// How many there are in a day.
    #[must_use]
    pub fn in_a_day(self) -> usize {
        match self {
            Self::Minute => 1_440,
            Self::Hour => 24,
        }
    }

    /// Its number in the bytes, which never changes.
    fn number(self) -> u8 {
        match self {
            Self::Minute => 0,
            Self::Hour => 1,
        }
    }
}

/// The begin of a day, which is counted from 1970.
#[must_use]
pub fn begin_of(day: i64) -> Micros {
    Micros(day.saturating_mul(DAY))
}

/// The hours of a day, of its minutes.
#[must_use]
pub fn hours(day: i64, minutes: &[Bucket]) -> Vec<Bucket> {
    let mut hours = Wide::new(begin_of(day), Step::Hour.micros());
    minutes.iter().for_each(|minute| hours.add(minute.clone(), Step::Minute.micros()));
    let mut hours = hours.finish(begin_of(day.saturating_add(1)));
    hours.retain(|hour| !hour.is_empty());
    hours
}

/// Writes buckets of this step, in the order of time; `None` if nothing is known in any of them.
#[must_use]
pub fn pack(step: Step, buckets: &[Bucket]) -> Option<Vec<u8>> {
    let known: Vec<_> = buckets.iter().filter(|bucket| !bucket.is_empty()).collect();
    let none = || State::Gap(Gap::None);
    let last =
        |bucket: &&Bucket| Sample { time: bucket.start, state: bucket.last.clone().unwrap_or_else(none) };
    let last: Vec<_> = known.iter().map(last).collect();
    let (mut blocks, mut at) = (Vec::new(), 0);
    while let Some(rest) = last.get(at..)
        && !rest.is_empty()
    {
        let end = at + fitting(rest).max(1);
        blocks.push((known.get(at..end).unwrap_or_default(), last.get(at..end).unwrap_or_default()));
        at = end;
    }
    if blocks.is_empty() {
        return None;
    }
    let mut out = vec![CODEC, step.number()];
    put(&mut out, blocks.len() as u64);
    for (buckets, last) in blocks {
        put_block(&mut out, step, buckets, last);
    }
    seal(&mut out);
    Some(out)
}

fn put_block(out: &mut Vec<u8>, step: Step, buckets: &[&Bucket], last: &[Sample]) {
    let whole = |out: &mut Vec<u8>, of: &dyn Fn(&Bucket) -> i64| {
        put_whole(out, &buckets.iter().map(|bucket| of(bucket)).collect::<Vec<_>>());
    };
    let decimals = |out: &mut Vec<u8>, of: &dyn Fn(&Bucket) -> Option<f64>| {
        put_decimals(out, &buckets.iter().map(|bucket| of(bucket)).collect::<Vec<_>>());
    };
    put(out, buckets.len() as u64);
    whole(out, &|bucket| bucket.start.0.div_euclid(step.micros()));
    decimals(out, &|bucket| bucket.mean);
    decimals(out, &|bucket| bucket.range.map(|range| range.0));
    decimals(out, &|bucket| bucket.range.map(|range| range.1));
    put_last(out, last);
    whole(out, &|bucket| bucket.good);
    whole(out, &|bucket| bucket.good.saturating_sub(bucket.weight));
    whole(out, &|bucket| i64::try_from(bucket.samples).unwrap_or(i64::MAX));
}

/// The numbers of the kinds of last values, which never change.
const DECIMALS: u8 = 0;
const INTEGERS: u8 = 1;
const OTHERS: u8 = 2;

fn put_last(out: &mut Vec<u8>, last: &[Sample]) {
    match last.iter().find_map(|sample| Kind::of(&sample.state)) {
        Some(Kind::Decimal) => {
            out.push(DECIMALS);
            put_decimals(out, &last.iter().map(|sample| sample.state.number()).collect::<Vec<_>>());
        }
        Some(Kind::Integer) => {
            out.push(INTEGERS);
            let number = |sample: &Sample| match sample.state {
                State::Integer(number) => Some(number),
                State::Decimal(_) | State::Text(_) | State::Gap(_) => None,
            };
            let numbers: Vec<_> = last.iter().map(number).collect();
            put_presence(out, &numbers);
            put_whole(out, &numbers.into_iter().flatten().collect::<Vec<_>>());
        }
        Some(Kind::Text) | None => {
            out.push(OTHERS);
            put_column(out, last);
        }
    }
}

fn last(reader: &mut Reader<'_>, count: usize) -> Result<Vec<State>, BadChunk> {
    let none = || State::Gap(Gap::None);
    match reader.byte()? {
        DECIMALS => {
            let numbers = decimals(reader, count)?;
            Ok(numbers.into_iter().map(|number| number.map_or_else(none, State::Decimal)).collect())
        }
        INTEGERS => {
            let present = presence(reader, count)?;
            let numbers = whole(reader, present.iter().filter(|is| **is).count())?;
            let numbers = spread(present, numbers);
            Ok(numbers.into_iter().map(|number| number.map_or_else(none, State::Integer)).collect())
        }
        OTHERS => column(reader, count),
        _ => Err(BadChunk::Number),
    }
}

/// Writes whole numbers: runs of equal differences, which wrap.
fn put_whole(out: &mut Vec<u8>, numbers: &[i64]) {
    let mut before = 0_i64;
    let difference = |number: &i64| number.wrapping_sub(std::mem::replace(&mut before, *number));
    let differences: Vec<_> = numbers.iter().map(difference).collect();
    for run in differences.chunk_by(|one, next| one == next) {
        put_signed(out, run.first().copied().unwrap_or_default());
        put(out, run.len() as u64);
    }
}

fn whole(reader: &mut Reader<'_>, count: usize) -> Result<Vec<i64>, BadChunk> {
    let (mut numbers, mut last) = (Vec::new(), 0_i64);
    while numbers.len() < count {
        let difference = reader.signed()?;
        for _ in 0..run(reader, count - numbers.len())? {
            last = last.wrapping_add(difference);
            numbers.push(last);
        }
    }
    Ok(numbers)
}

/// The length of a run, up to this one.
fn run(reader: &mut Reader<'_>, most: usize) -> Result<usize, BadChunk> {
    reader.up_to(most).and_then(|len| if len == 0 { Err(BadChunk::Number) } else { Ok(len) })
}

/// Writes which numbers are there: runs, the first of which are there.
fn put_presence<T>(out: &mut Vec<u8>, numbers: &[Option<T>]) {
    let mut is_present = true;
    let mut rest = numbers;
    while !rest.is_empty() {
        let len = rest.iter().take_while(|number| number.is_some() == is_present).count();
        put(out, len as u64);
        rest = rest.get(len..).unwrap_or_default();
        is_present = !is_present;
    }
}

fn presence(reader: &mut Reader<'_>, count: usize) -> Result<Vec<bool>, BadChunk> {
    let (mut all, mut is_present) = (Vec::new(), true);
    while all.len() < count {
        // Each run but the first one has something.
        let left = count - all.len();
        let len = if all.is_empty() && is_present { reader.up_to(left)? } else { run(reader, left)? };
        all.extend(std::iter::repeat_n(is_present, len));
        is_present = !is_present;
    }
    Ok(all)
}

fn spread<T>(present: Vec<bool>, numbers: Vec<T>) -> Vec<Option<T>> {
    let mut numbers = numbers.into_iter();
    present.into_iter().map(|is| if is { numbers.next() } else { None }).collect()
}

fn put_decimals(out: &mut Vec<u8>, all: &[Option<f64>]) {
    put_presence(out, all);
    let numbers: Vec<f64> = all.iter().flatten().copied().collect();
    let scaled = |digits: u8| numbers.iter().map(|number| scale(*number, digits)).collect::<Option<Vec<_>>>();
    if let Some((digits, scaled)) = (0..=MAX_DIGITS).find_map(|digits| Some((digits, scaled(digits)?))) {
        out.push(digits);
        put_whole(out, &scaled);
        return;
    }
    out.push(u8::MAX);
    for run in numbers.chunk_by(|one, next| one.to_bits() == next.to_bits()) {
        let bits = run.first().map_or(0, |number| number.to_bits());
        out.extend_from_slice(&bits.to_le_bytes());
        put(out, run.len() as u64);
    }
}

fn decimals(reader: &mut Reader<'_>, count: usize) -> Result<Vec<Option<f64>>, BadChunk> {
    let present = presence(reader, count)?;
    let count = present.iter().filter(|is| **is).count();
    let mut numbers = Vec::new();
    match reader.byte()? {
        digits @ 0..=MAX_DIGITS => {
            numbers.extend(whole(reader, count)?.into_iter().map(|number| unscale(number, digits)));
        }
        u8::MAX => {
            while numbers.len() < count {
                let bytes = reader.take(8)?.try_into().map_err(|_| BadChunk::Short)?;
                let number = f64::from_bits(u64::from_le_bytes(bytes));
                let len = run(reader, count - numbers.len())?;
                numbers.extend(std::iter::repeat_n(number, len));
            }
        }
        _ => return Err(BadChunk::Number),
    }
    Ok(spread(present, numbers))
}

/// Reads the buckets of a day, as [`pack`] wrote them.
///
/// # Errors
/// [`BadChunk`]: the bytes are no such buckets, or they were changed.
pub fn unpack(step: Step, day: i64, bytes: &[u8]) -> Result<Vec<Bucket>, BadChunk> {
    let mut reader = Reader::of_sealed(bytes)?;
    match reader.byte()? {
        CODEC => {}
        codec => return Err(BadChunk::Codec(codec)),
    }
    if reader.byte()? != step.number() {
        return Err(BadChunk::Number);
    }
    let mut all: Vec<Bucket> = Vec::new();
    for _ in 0..reader.up_to(step.in_a_day())? {
        let block = block(&mut reader, step)?;
        // A day has no more, each once and in the order of time.
        let is_behind =
            block.first().is_some_and(|first| all.last().is_none_or(|last| last.start < first.start));
        let is_in_order = block.windows(2).all(|pair| matches!(pair, [one, next] if one.start < next.start));
        if !is_behind || !is_in_order || block.iter().any(|bucket| bucket.start.day() != day) {
            return Err(BadChunk::Number);
        }
        all.extend(block);
    }
    reader.end()?;
    Ok(all)
}

fn block(reader: &mut Reader<'_>, step: Step) -> Result<Vec<Bucket>, BadChunk> {
    let count = reader.up_to(MAX_SAMPLES)?;
    let starts = whole(reader, count)?;
    let [mean, min, max] = [(); 3].map(|()| decimals(reader, count));
    let (mean, min, max) = (mean?, min?, max?);
    let last = last(reader, count)?;
    let good = whole(reader, count)?;
    let other = whole(reader, count)?;
    let samples = whole(reader, count)?;
    let columns = mean.into_iter().zip(min).zip(max).zip(last);
    let numbers = starts.into_iter().zip(good).zip(other).zip(samples);
    let bucket = |((((mean, min), max), last), (((start, good), other), samples))| {
        let weight = i64::checked_sub(good, other).filter(|weight| good >= 0 && *weight >= 0);
        Ok(Bucket {
            start: Micros(i64::checked_mul(start, step.micros()).ok_or(BadChunk::Number)?),
            mean,
            range: Option::zip(min, max),
            last: Some(last).filter(|last: &State| last.gap().is_none()),
            good,
            weight: weight.ok_or(BadChunk::Number)?,
            samples: u64::try_from(samples).map_err(|_| BadChunk::Number)?,
        })
    };
    columns.zip(numbers).map(bucket).collect()
}

#[cfg(test)]
mod tests {
    use super::super::buckets::Buckets;
    use super::super::sample::Interval;
    use super::*;
    use proptest::prelude::*;

    const TODAY: i64 = 20_782;

    /// The minutes of a day that has these samples: seconds of the day, and what is known from there on.
    fn minutes(samples: &[(i64, State)]) -> Vec<Bucket> {
        let (from, to) = (begin_of(TODAY), begin_of(TODAY + 1));
        let mut buckets = Buckets::new(from, to, Step::Minute.micros(), usize::MAX);
        for (second, state) in samples {
            let time = Micros(from.0 + second * 1_000_000);
            buckets.sample(Interval::USUAL, Sample { time, state: state.clone() });
        }
        buckets.finish()
    }

    fn known(buckets: &[Bucket]) -> Vec<Bucket> {
        buckets.iter().filter(|bucket| !bucket.is_empty()).cloned().collect()
    }

    fn state() -> impl Strategy<Value = State> {
        prop_oneof![
            4 => (-1e12..1e12).prop_map(State::Decimal),
            2 => (-100_i64..100).prop_map(State::Integer),
            1 => prop::sample::select(vec!["a", "b", ""]).prop_map(|text| State::Text(text.into())),
            1 => prop::sample::select(Gap::ALL.to_vec()).prop_map(State::Gap),
        ]
    }

    #[test]
    fn a_value_that_stays_takes_few_bytes_and_an_empty_day_none() {
        let samples: Vec<_> = (0..1_440).map(|minute| (minute * 60, State::Decimal(12.5))).collect();
        let all = minutes(&samples);
        let bytes = pack(Step::Minute, &all).unwrap();
        assert!(bytes.len() < 250, "{}", bytes.len());
        assert_eq!(unpack(Step::Minute, TODAY, &bytes).unwrap(), all);
        let hours = hours(TODAY, &all);
        assert_eq!((hours.len(), hours[3].mean, hours[3].samples), (24, Some(12.5), 60));
        assert!(pack(Step::Hour, &hours).unwrap().len() < 90);
        assert_eq!(pack(Step::Minute, &minutes(&[])), None);
        assert_eq!(
            pack(Step::Minute, &minutes(&[(3, State::Gap(Gap::Stale))])).map(|bytes| bytes.len() < 60),
            Some(true)
        );
    }

    #[test]
    fn bytes_of_another_step_day_or_codec_are_refused() {
        let bytes = pack(Step::Minute, &minutes(&[(0, State::Integer(1))])).unwrap();
        assert!(unpack(Step::Minute, TODAY, &bytes).is_ok());
        assert_eq!(unpack(Step::Hour, TODAY, &bytes), Err(BadChunk::Number));
        assert_eq!(unpack(Step::Minute, TODAY + 1, &bytes), Err(BadChunk::Number));
        let resealed = |at: usize, byte: u8| {
            let mut bytes = bytes.clone();
            bytes.truncate(bytes.len() - 4);
            bytes[at] = byte;
            seal(&mut bytes);
            unpack(Step::Minute, TODAY, &bytes)
        };
        assert_eq!(resealed(0, 2), Err(BadChunk::Codec(2)));
        assert_eq!(resealed(2, 2), Err(BadChunk::Short), "a block too many");
        let mut twice = bytes[..bytes.len() - 4].to_vec();
        twice.extend_from_within(3..);
        twice[2] = 2;
        seal(&mut twice);
        assert_eq!(unpack(Step::Minute, TODAY, &twice), Err(BadChunk::Number), "each minute is there once");
    }

    proptest! {
        #[test]
        fn all_buckets_come_back(samples in prop::collection::vec((1_i64..900, state()), 0..200)) {
            let mut second = 0;
            let in_day = |(step, state)| {
                second += step;
                (second % 86_400, state)
            };
            let mut samples: Vec<_> = samples.into_iter().map(in_day).collect();
            samples.sort_by_key(|(second, _)| *second);
            let all = minutes(&samples);
            let read = pack(Step::Minute, &all).map(|bytes| unpack(Step::Minute, TODAY, &bytes).unwrap());
            prop_assert_eq!(read.unwrap_or_default(), known(&all));
            let hours = hours(TODAY, &all);
            let read = pack(Step::Hour, &hours).map(|bytes| unpack(Step::Hour, TODAY, &bytes).unwrap());
            prop_assert_eq!(read.unwrap_or_default(), hours);
        }

        /// Bytes that were changed and sealed again are refused, or read without a panic.
        #[test]
        fn hostile_bytes_do_no_harm(
            samples in prop::collection::vec((0_i64..86_400, state()), 1..40),
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
            cut in any::<prop::sample::Index>(),
        ) {
            let mut samples = samples;
            samples.sort_by_key(|(second, _)| *second);
            let mut bytes = pack(Step::Minute, &minutes(&samples)).unwrap();
            prop_assert!(unpack(Step::Minute, TODAY, &bytes[..cut.index(bytes.len())]).is_err());
            bytes.truncate(bytes.len() - 4);
            for (at, byte) in changes {
                let at = at.index(bytes.len());
                bytes[at] = byte;
            }
            seal(&mut bytes);
            if let Ok(read) = unpack(Step::Minute, TODAY, &bytes) {
                prop_assert!(read.len() <= 1_440);
            }
        }
    }
}
