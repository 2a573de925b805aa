//! The bytes that keep the open blocks of a robot: groups of signals with the same times, then a checksum.
//!
//! A group has its times once, and for each signal its name and its values. Of a name that begins as the one
//! before, only the rest is written. A row of a quarter of a second has two or three samples of each signal,
//! so this is less than half of what a chunk for each signal would take.

use r6_proto::Address;

use super::bytes::{Reader, put, seal};
use super::codec::{self, BadChunk, Decoded, MAX_SAMPLES, Times};
use super::packed::integers;
use super::sample::{Interval, Sample};

/// The first byte, so that later versions can do it in another way.
const VERSION: u8 = 2;

/// The version before, which files of earlier gateways have: for each signal its name and a chunk.
const OF_CHUNKS: u8 = 1;

/// The longest name of an address, and more than any has.
const MAX_NAME: usize = 64;

/// The most signals of a row: eight times as many as a robot has, because those that are read no more stay
/// in open blocks for ten minutes. Few bytes can stand for many samples, and not for more than these.
const MAX_SIGNALS: usize = 8 * 1024;

/// Whether these bytes are whole, and of a later version.
#[must_use]
pub fn is_later(bytes: &[u8]) -> bool {
    Reader::of_sealed(bytes).and_then(|mut reader| reader.byte()).is_ok_and(|version| version > VERSION)
}

/// Signals with the same times.
struct Group<'s> {
    interval: Interval,
    times: &'s [Sample],
    signals: Vec<(Address, &'s [Sample])>,
}

impl Group<'_> {
    fn fits(&self, interval: Interval, samples: &[Sample]) -> bool {
        interval == self.interval
            && samples.len() == self.times.len()
            && samples.iter().zip(self.times).all(|(sample, other)| sample.time == other.time)
    }
}

/// Writes samples of several signals.
#[must_use]
pub fn encode<'s>(signals: impl IntoIterator<Item = (Address, Interval, &'s [Sample])>) -> Vec<u8> {
    let mut groups = Vec::<Group<'s>>::new();
    for (address, interval, samples) in signals {
        let (mut left, mut is_begin) = (samples, true);
        while !left.is_empty() {
            let (samples, later) = left.split_at(codec::fitting(left).clamp(1, left.len()));
            // What comes later stands in a later group.
            match groups.iter_mut().find(|group| is_begin && group.fits(interval, samples)) {
                Some(group) => group.signals.push((address, samples)),
                None => {
                    let signals = vec![(address, samples)];
                    groups.push(Group { interval, times: samples, signals });
                }
            }
            (left, is_begin) = (later, false);
        }
    }
    let mut out = vec![VERSION];
    let (mut before, mut name) = (Vec::new(), Vec::new());
    for Group { interval, times, signals } in groups {
        put(&mut out, times.len() as u64);
        put(&mut out, u64::from(interval.millis()));
        Times::default().put(&mut out, times);
        put(&mut out, signals.len() as u64);
        for (address, samples) in signals {
            name.clear();
            address.write_name(&mut name);
            let shared = name.iter().zip(&before).take_while(|(one, other)| one == other).count();
            put(&mut out, shared as u64);
            put(&mut out, (name.len() - shared) as u64);
            out.extend_from_slice(name.get(shared..).unwrap_or_default());
            std::mem::swap(&mut name, &mut before);
            codec::put_column(&mut out, samples);
        }
    }
    seal(&mut out);
    out
}

/// Reads what [`encode`] wrote, in this version or the one before.
///
/// # Errors
/// [`BadChunk`]: the bytes were changed, or are of a later version.
pub fn decode(bytes: &[u8]) -> Result<Vec<(Address, Decoded)>, BadChunk> {
    let mut reader = Reader::of_sealed(bytes)?;
    match reader.byte()? {
        VERSION => groups(&mut reader),
        OF_CHUNKS => chunks(&mut reader),
        version => Err(BadChunk::Codec(version)),
    }
}

fn groups(reader: &mut Reader<'_>) -> Result<Vec<(Address, Decoded)>, BadChunk> {
    let (mut decoded, mut name) = (Vec::new(), Vec::new());
    while !reader.is_empty() {
        let count = reader.up_to(MAX_SAMPLES)?;
        let interval = u32::try_from(reader.number()?).ok().and_then(Interval::of_millis);
        let interval = interval.ok_or(BadChunk::Number)?;
        let times = integers(reader, count)?;
        for _ in 0..reader.up_to(MAX_SIGNALS.saturating_sub(decoded.len()))? {
            name.truncate(reader.up_to(name.len())?);
            let rest = reader.up_to(MAX_NAME)?;
            name.extend_from_slice(reader.take(rest)?);
            let address = Address::exact(&name).ok_or(BadChunk::Text)?;
            let samples = codec::at(&times, codec::column(reader, count)?);
            decoded.push((address, Decoded { interval, samples }));
        }
    }
    Ok(decoded)
}

fn chunks(reader: &mut Reader<'_>) -> Result<Vec<(Address, Decoded)>, BadChunk> {
    let mut signals = Vec::new();
    while !reader.is_empty() {
        let len = reader.up_to(MAX_NAME)?;
        let address = Address::exact(reader.take(len)?).ok_or(BadChunk::Text)?;
        let len = reader.up_to(usize::MAX)?;
        signals.push((address, codec::decode(reader.take(len)?)?));
    }
    Ok(signals)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use r6_api::gateway::Gap;

    use super::super::sample::{Micros, State};
    use super::*;

    fn bytes(signals: &[(Address, Interval, Vec<Sample>)]) -> Vec<u8> {
        encode(signals.iter().map(|(address, interval, samples)| (*address, *interval, &samples[..])))
    }

    const MODE: Address = Address::CurMode;
    const MOVING: Address = Address::IsMoving;

    fn series(times: std::ops::Range<i64>) -> Vec<Sample> {
        times.map(|at| Sample { time: Micros(at), state: State::Integer(at * at) }).collect()
    }

    #[test]
    fn blocks_of_several_signals_come_back() {
        let (short, long) = (series(0..3), series(0..600));
        let bytes =
            bytes(&[(MODE, Interval::USUAL, short.clone()), (MOVING, Interval::LONGEST, long.clone())]);
        let decoded = decode(&bytes).unwrap();
        assert_eq!((decoded[0].0, &decoded[0].1.samples), (MODE, &short));
        assert_eq!((decoded[1].0, decoded[1].1.interval), (MOVING, Interval::LONGEST));
        assert_eq!([&decoded[1].1.samples[..], &decoded[2].1.samples[..]].concat(), long);
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 0x10;
            assert!(decode(&changed).is_err(), "{at}");
            assert!(decode(&bytes[..at]).is_err(), "{at}");
        }
    }

    #[test]
    fn the_samples_of_a_signal_stay_in_their_order() {
        // The end of the long one has the times of the short one, whose group comes first.
        let (long, short) = (series(0..600), series(512..600));
        let signals = [(MODE, Interval::USUAL, short.clone()), (MOVING, Interval::USUAL, long.clone())];
        let decoded = decode(&bytes(&signals)).unwrap();
        let of = |address| {
            let own = decoded.iter().filter(|(of, _)| *of == address);
            own.flat_map(|(_, decoded)| decoded.samples.clone()).collect::<Vec<_>>()
        };
        assert_eq!((of(MODE), of(MOVING)), (short, long));
    }

    #[test]
    fn a_row_of_a_robot_that_moves_takes_few_bytes() {
        let signals: Vec<_> = (0..6)
            .flat_map(|at| [format!("axis-{at}"), format!("world-{at}")])
            .zip(1_i64..)
            .map(|(name, number)| {
                let sample = |poll: i64| Sample {
                    time: Micros(1_700_000_000_000_000 + poll * 100_000 + poll * poll * 100),
                    state: State::Decimal((number * 12_345 + poll * 217) as f64 / 1000.0),
                };
                (Address::parse(&name).unwrap(), Interval::USUAL, (0..3).map(sample).collect::<Vec<_>>())
            })
            .collect();
        let of_chunks: usize =
            signals.iter().map(|(_, interval, samples)| 8 + chunk(*interval, samples).len()).sum();
        let len = bytes(&signals).len();
        assert!(len * 2 < of_chunks, "{len} bytes, {of_chunks} in chunks");
    }

    fn chunk(interval: Interval, samples: &[Sample]) -> Vec<u8> {
        codec::encode(&mut Times::default(), interval, samples).0
    }

    #[test]
    fn rows_of_the_version_before_are_read() {
        let mut bytes = vec![OF_CHUNKS];
        for (address, samples) in [(MODE, series(0..3)), (MOVING, series(5..7))] {
            let (name, chunk) = (address.to_string(), chunk(Interval::USUAL, &samples));
            put(&mut bytes, name.len() as u64);
            bytes.extend_from_slice(name.as_bytes());
            put(&mut bytes, chunk.len() as u64);
            bytes.extend_from_slice(&chunk);
        }
        seal(&mut bytes);
        let decoded = decode(&bytes).unwrap();
        assert_eq!((decoded[0].0, &decoded[0].1.samples), (MODE, &series(0..3)));
        assert_eq!((decoded[1].0, &decoded[1].1.samples), (MOVING, &series(5..7)));
        let mut later = vec![VERSION + 1];
        seal(&mut later);
        assert!(is_later(&later) && !is_later(&bytes) && !is_later(&later[1..]));
    }

    #[test]
    fn few_bytes_are_not_millions_of_samples() {
        // Gaps of one signal, again and again.
        let gaps = |count: usize| {
            let mut bytes = vec![VERSION];
            put(&mut bytes, MAX_SAMPLES as u64);
            put(&mut bytes, 60_000);
            let times: Vec<_> = series(0..512);
            Times::default().put(&mut bytes, &times);
            put(&mut bytes, count as u64);
            let gap = Sample { time: Micros(0), state: State::Gap(Gap::Stale) };
            for number in 0..count {
                let rest = if number == 0 { "curMode" } else { "" };
                put(&mut bytes, 7 - rest.len() as u64);
                put(&mut bytes, rest.len() as u64);
                bytes.extend_from_slice(rest.as_bytes());
                codec::put_column(&mut bytes, &vec![gap.clone(); MAX_SAMPLES]);
            }
            seal(&mut bytes);
            decode(&bytes).map(|decoded| decoded.len())
        };
        assert_eq!(gaps(3), Ok(3));
        assert_eq!(gaps(MAX_SIGNALS + 1), Err(BadChunk::Number));
    }

    fn any_series() -> impl Strategy<Value = Vec<State>> {
        let text = prop::sample::select(vec!["a", "b", ""]).prop_map(|text| State::Text(text.into()));
        let of = |state: BoxedStrategy<State>, gaps: u32| {
            let gap = prop::sample::select(Gap::ALL.to_vec()).prop_map(State::Gap);
            let state = prop_oneof![9 => state, gaps => gap];
            prop::collection::vec(state, 3)
        };
        let decimal = prop_oneof![
            9 => (-400_000_i64..400_000).prop_map(|number| State::Decimal(number as f64 / 1e3)),
            1 => any::<u64>().prop_map(|bits| State::Decimal(f64::from_bits(bits))),
        ];
        prop_oneof![
            of(any::<i64>().prop_map(State::Integer).boxed(), 0),
            of(any::<i64>().prop_map(State::Integer).boxed(), 9),
            of(decimal.clone().boxed(), 0),
            of(decimal.boxed(), 3),
            of(text.boxed(), 3),
        ]
    }

    proptest! {
        #[test]
        fn every_row_comes_back_bit_by_bit(
            signals in prop::collection::vec((any_series(), 0..3_i64, any::<bool>()), 0..12),
        ) {
            let named = signals.into_iter().enumerate().map(|(number, (states, begin, is_long))| {
                let name = [format!("axis-{}", number / 2), format!("Addr-{}", 800 + number)];
                let at = |(time, state)| Sample { time: Micros(begin * 50 + time), state };
                let interval = if is_long { Interval::LONGEST } else { Interval::USUAL };
                (Address::parse(&name[number % 2]).unwrap(), interval, (0..).zip(states).map(at).collect())
            });
            let signals: Vec<(Address, Interval, Vec<Sample>)> = named.collect();
            let decoded = decode(&bytes(&signals)).unwrap();
            let mut back = decoded.into_iter().map(|(address, of)| (address, of.interval, of.samples)).collect::<Vec<_>>();
            let mut there = signals;
            back.sort_by_key(|(address, ..)| *address);
            there.sort_by_key(|(address, ..)| *address);
            prop_assert_eq!(back, there);
        }

        #[test]
        fn no_bytes_with_a_right_checksum_are_a_panic(
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
            cut in any::<prop::sample::Index>(),
        ) {
            let mut bytes = bytes(&[(MODE, Interval::USUAL, series(0..3)), (MOVING, Interval::USUAL, series(0..3))]);
            bytes.truncate(bytes.len() - 4);
            for (at, byte) in changes {
                let at = at.index(bytes.len());
                bytes[at] = byte;
            }
            for mut bytes in [bytes[..cut.index(bytes.len())].to_vec(), bytes] {
                seal(&mut bytes);
                if let Ok(decoded) = decode(&bytes) {
                    prop_assert!(decoded.len() <= bytes.len());
                }
            }
        }
    }
}
