//! The bytes of a chunk: samples of one signal, one after the other, so that small differences take few
//! bytes.
//!
//! Codec 1, numbers as in `bytes.rs`: the number of the codec · the number of samples · the interval in ms ·
//! the kind · times as integers · runs of quality (0 a value, else a gap) · the values · CRC32C over all of
//! that. Integers are differences (`packed.rs`). Decimals are integers of a power of ten if that gives each
//! of them back bit by bit; otherwise they are 8 bytes each. Texts are a list of the different ones, and the
//! place of each in it.

use std::collections::BTreeMap;
use std::fmt;

use r6_api::gateway::Gap;

use super::bytes::{Reader, put, seal};
use super::packed::{integers, put_integers};
use super::sample::{Interval, MAX_TEXT, Micros, Sample, State, Text, gap_code, gap_of_code};

/// The most samples of a chunk: 1.5 KB, so that a chunk fits into a page of the disk.
pub const MAX_SAMPLES: usize = 512;

/// The number of this codec.
pub const CODEC: u8 = 1;

/// The digits behind the point that are tried. Controllers print six.
pub(super) const MAX_DIGITS: u8 = 9;

/// Decimals beyond are kept as 8 bytes: below, a whole number of the same size is exact.
const MAX_WHOLE: f64 = 9_007_199_254_740_992.0;

/// Why bytes are no chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadChunk {
    /// They end too early.
    Short,
    /// Something follows the last value.
    Long,
    /// The checksum does not fit.
    Checksum,
    /// They are of a codec that this version does not know.
    Codec(u8),
    /// A number is out of its range.
    Number,
    /// A text is not UTF-8.
    Text,
}

impl fmt::Display for BadChunk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Short => f.write_str("it ends too early"),
            Self::Long => f.write_str("something follows its last value"),
            Self::Checksum => f.write_str("its checksum does not fit"),
            Self::Codec(codec) => write!(f, "it is of codec {codec}, which this version does not know"),
            Self::Number => f.write_str("a number is out of its range"),
            Self::Text => f.write_str("a text is not UTF-8"),
        }
    }
}

impl std::error::Error for BadChunk {}

/// What a chunk has.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoded {
    /// The interval of its signal.
    pub interval: Interval,
    /// Its samples.
    pub samples: Vec<Sample>,
}

/// The values of a chunk are of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Decimal numbers.
    Decimal,
    /// Whole numbers.
    Integer,
    /// Texts.
    Text,
}

impl Kind {
    /// Of a value; `None` for a gap.
    #[must_use]
    pub fn of(state: &State) -> Option<Self> {
        match state {
            State::Decimal(_) => Some(Self::Decimal),
            State::Integer(_) => Some(Self::Integer),
            State::Text(_) => Some(Self::Text),
            State::Gap(_) => None,
        }
    }

    /// Of these samples, which are of one kind.
    fn of_all(samples: &[Sample]) -> Self {
        samples.iter().find_map(|sample| Self::of(&sample.state)).unwrap_or(Self::Integer)
    }

    /// Its number, which never changes.
    fn number(self) -> u8 {
        match self {
            Self::Decimal => 0,
            Self::Integer => 1,
            Self::Text => 2,
        }
    }

    fn of_number(number: u8) -> Result<Self, BadChunk> {
        [Self::Decimal, Self::Integer, Self::Text]
            .into_iter()
            .find(|kind| kind.number() == number)
            .ok_or(BadChunk::Number)
    }
}

/// The bytes of the times that were written last: signals that are read together have the same ones.
#[derive(Debug, Default)]
pub struct Times {
    of: Vec<i64>,
    bytes: Vec<u8>,
}

impl Times {
    pub(super) fn put(&mut self, out: &mut Vec<u8>, samples: &[Sample]) {
        let is_known = self.of.len() == samples.len()
            && self.of.iter().zip(samples).all(|(time, sample)| *time == sample.time.0);
        if !is_known || self.bytes.is_empty() {
            self.of = samples.iter().map(|sample| sample.time.0).collect();
            self.bytes.clear();
            put_integers(&mut self.bytes, &self.of);
        }
        out.extend_from_slice(&self.bytes);
    }
}

/// How many of these samples fit into one chunk: at most [`MAX_SAMPLES`], and values of one kind.
#[must_use]
pub fn fitting(samples: &[Sample]) -> usize {
    let mut kind = None;
    let fits = |sample: &Sample| match (Kind::of(&sample.state), kind) {
        (None, _) => true,
        (Some(of), None) => {
            kind = Some(of);
            true
        }
        (Some(of), Some(kind)) => of == kind,
    };
    samples.iter().map(fits).take(MAX_SAMPLES).take_while(|fits| *fits).count()
}

/// Whether a sample can stand behind values of this kind, or behind gaps.
#[must_use]
pub fn is_of_one_kind(kind: Option<Kind>, next: &Sample) -> bool {
    kind.zip(Kind::of(&next.state)).is_none_or(|(kind, next)| kind == next)
}

/// Writes samples: the first ones that fit. Returns the bytes and how many samples they have.
#[must_use]
pub fn encode(times: &mut Times, interval: Interval, samples: &[Sample]) -> (Vec<u8>, usize) {
    let count = fitting(samples);
    let samples = samples.get(..count).unwrap_or_default();
    let mut out = vec![CODEC];
    put(&mut out, count as u64);
    put(&mut out, u64::from(interval.millis()));
    let kind = Kind::of_all(samples);
    out.push(kind.number());
    times.put(&mut out, samples);
    put_quality(&mut out, samples);
    put_values(&mut out, kind, samples);
    seal(&mut out);
    (out, count)
}

/// The number of a kind without gaps has this bit in a column.
const WHOLE: u8 = 0x80;

/// Writes the values of samples that fit into one chunk, without their times.
pub(super) fn put_column(out: &mut Vec<u8>, samples: &[Sample]) {
    let kind = Kind::of_all(samples);
    if samples.iter().all(|sample| sample.state.gap().is_none()) {
        out.push(kind.number() | WHOLE);
    } else {
        out.push(kind.number());
        put_quality(out, samples);
    }
    put_values(out, kind, samples);
}

/// Reads a column of `count` samples, as [`put_column`] wrote it.
pub(super) fn column(reader: &mut Reader<'_>, count: usize) -> Result<Vec<State>, BadChunk> {
    let kind = reader.byte()?;
    let gaps = if kind & WHOLE == 0 { quality(reader, count)? } else { vec![None; count] };
    states(reader, Kind::of_number(kind & !WHOLE)?, gaps)
}

/// Reads a chunk.
///
/// # Errors
/// [`BadChunk`]: the bytes are no chunk, or they were changed.
pub fn decode(bytes: &[u8]) -> Result<Decoded, BadChunk> {
    let mut reader = Reader::of_sealed(bytes)?;
    match reader.byte()? {
        CODEC => {}
        codec => return Err(BadChunk::Codec(codec)),
    }
    let count = reader.up_to(MAX_SAMPLES)?;
    let interval = u32::try_from(reader.number()?).ok().and_then(Interval::of_millis);
    let interval = interval.ok_or(BadChunk::Number)?;
    let kind = Kind::of_number(reader.byte()?)?;
    let times = integers(&mut reader, count)?;
    let gaps = quality(&mut reader, count)?;
    let states = states(&mut reader, kind, gaps)?;
    reader.end()?;
    Ok(Decoded { interval, samples: at(&times, states) })
}

/// Values with their times.
pub(super) fn at(times: &[i64], states: Vec<State>) -> Vec<Sample> {
    times.iter().zip(states).map(|(time, state)| Sample { time: Micros(*time), state }).collect()
}

/// Reads the values where there are no gaps.
fn states(reader: &mut Reader<'_>, kind: Kind, gaps: Vec<Option<Gap>>) -> Result<Vec<State>, BadChunk> {
    let present = gaps.iter().filter(|gap| gap.is_none()).count();
    let values = match kind {
        Kind::Decimal => decimals(reader, present)?,
        Kind::Integer => integers(reader, present)?.into_iter().map(State::Integer).collect(),
        Kind::Text => texts(reader, present)?,
    };
    let mut values = values.into_iter();
    let state = |gap: Option<Gap>| gap.map(State::Gap).or_else(|| values.next()).ok_or(BadChunk::Short);
    gaps.into_iter().map(state).collect()
}

fn put_values(out: &mut Vec<u8>, kind: Kind, samples: &[Sample]) {
    match kind {
        Kind::Decimal => put_decimals(out, samples),
        Kind::Integer => {
            let numbers = samples.iter().filter_map(|sample| match sample.state {
                State::Integer(number) => Some(number),
                State::Decimal(_) | State::Text(_) | State::Gap(_) => None,
            });
            put_integers(out, &numbers.collect::<Vec<_>>());
        }
        Kind::Text => put_texts(out, samples),
    }
}

fn put_quality(out: &mut Vec<u8>, samples: &[Sample]) {
    let code = |sample: &Sample| sample.state.gap().map_or(0, gap_code);
    let runs = || samples.chunk_by(|one, next| code(one) == code(next));
    put(out, runs().count() as u64);
    for run in runs() {
        out.push(run.first().map_or(0, code));
        put(out, run.len() as u64);
    }
}

fn quality(reader: &mut Reader<'_>, count: usize) -> Result<Vec<Option<Gap>>, BadChunk> {
    let mut gaps = Vec::new();
    for _ in 0..reader.up_to(count)? {
        let gap = match reader.byte()? {
            0 => None,
            code => Some(gap_of_code(code).ok_or(BadChunk::Number)?),
        };
        let run = reader.up_to(count - gaps.len())?;
        gaps.extend(std::iter::repeat_n(gap, run));
    }
    if gaps.len() == count { Ok(gaps) } else { Err(BadChunk::Short) }
}

fn put_decimals(out: &mut Vec<u8>, samples: &[Sample]) {
    let numbers = samples.iter().filter_map(|sample| match sample.state {
        State::Decimal(number) => Some(number),
        State::Integer(_) | State::Text(_) | State::Gap(_) => None,
    });
    let mut scaled = Vec::with_capacity(samples.len());
    let digits = (0..=MAX_DIGITS).find(|digits| {
        scaled.clear();
        numbers.clone().all(|number| scale(number, *digits).map(|number| scaled.push(number)).is_some())
    });
    match digits {
        Some(digits) => {
            out.push(digits);
            put_integers(out, &scaled);
        }
        None => {
            out.push(u8::MAX);
            numbers.for_each(|number| out.extend_from_slice(&number.to_bits().to_le_bytes()));
        }
    }
}

/// The number times a power of ten, if that is a whole number that gives it back bit by bit.
#[expect(clippy::cast_possible_truncation, reason = "the number is whole and below 2^53")]
pub(super) fn scale(number: f64, digits: u8) -> Option<i64> {
    let whole = (number * power(digits)).round();
    let fits = whole.abs() < MAX_WHOLE && unscale(whole as i64, digits).to_bits() == number.to_bits();
    fits.then_some(whole as i64)
}

#[expect(clippy::cast_precision_loss, reason = "numbers that were scaled are below 2^53")]
pub(super) fn unscale(number: i64, digits: u8) -> f64 {
    number as f64 / power(digits)
}

pub(super) fn power(digits: u8) -> f64 {
    [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9].get(usize::from(digits)).copied().unwrap_or(1e9)
}

fn decimals(reader: &mut Reader<'_>, count: usize) -> Result<Vec<State>, BadChunk> {
    match reader.byte()? {
        digits @ 0..=MAX_DIGITS => {
            let numbers = integers(reader, count)?;
            Ok(numbers.into_iter().map(|number| State::Decimal(unscale(number, digits))).collect())
        }
        u8::MAX => (0..count)
            .map(|_| {
                let bytes = reader.take(8)?.try_into().map_err(|_| BadChunk::Short)?;
                Ok(State::Decimal(f64::from_bits(u64::from_le_bytes(bytes))))
            })
            .collect(),
        _ => Err(BadChunk::Number),
    }
}

fn put_texts(out: &mut Vec<u8>, samples: &[Sample]) {
    let texts = samples.iter().filter_map(|sample| match &sample.state {
        State::Text(text) => Some(text),
        State::Decimal(_) | State::Integer(_) | State::Gap(_) => None,
    });
    let (mut places, mut known) = (BTreeMap::new(), Vec::new());
    let of_each: Vec<usize> = texts
        .map(|text| {
            *places.entry(text).or_insert_with(|| {
                known.push(text);
                known.len() - 1
            })
        })
        .collect();
    put(out, known.len() as u64);
    for text in known {
        put(out, text.len() as u64);
        out.extend_from_slice(text.as_bytes());
    }
    of_each.into_iter().for_each(|place| put(out, place as u64));
}

fn texts(reader: &mut Reader<'_>, count: usize) -> Result<Vec<State>, BadChunk> {
    let known = (0..reader.up_to(count)?).map(|_| {
        let len = reader.up_to(MAX_TEXT)?;
        let text = str::from_utf8(reader.take(len)?).map_err(|_| BadChunk::Text)?;
        Ok(Text::from(text))
    });
    let known = known.collect::<Result<Vec<_>, BadChunk>>()?;
    let place = |_| {
        let place = reader.up_to(MAX_SAMPLES)?;
        known.get(place).cloned().map(State::Text).ok_or(BadChunk::Number)
    };
    (0..count).map(place).collect()
}

#[cfg(test)]
mod tests;
