//! The bytes that keep the open blocks of a robot: for each signal its name and a chunk, then a checksum.

use r6_proto::Address;

use super::bytes::{Reader, put, seal};
use super::codec::{self, BadChunk, Decoded};
use super::sample::{Interval, Sample};

/// The first byte, so that later versions can do it in another way.
const VERSION: u8 = 1;

/// The longest name of an address, and more than any has.
const MAX_NAME: usize = 64;

/// Writes samples of several signals.
#[must_use]
pub fn encode<'s>(signals: impl IntoIterator<Item = (Address, Interval, &'s [Sample])>) -> Vec<u8> {
    let mut out = vec![VERSION];
    for (address, interval, mut samples) in signals {
        let mut name = Vec::new();
        address.write_name(&mut name);
        while !samples.is_empty() {
            let (chunk, count) = codec::encode(interval, samples);
            put(&mut out, name.len() as u64);
            out.extend_from_slice(&name);
            put(&mut out, chunk.len() as u64);
            out.extend_from_slice(&chunk);
            samples = samples.get(count.max(1)..).unwrap_or_default();
        }
    }
    seal(&mut out);
    out
}

/// Reads what [`encode`] wrote.
///
/// # Errors
/// [`BadChunk`]: the bytes were changed.
pub fn decode(bytes: &[u8]) -> Result<Vec<(Address, Decoded)>, BadChunk> {
    let mut reader = Reader::of_sealed(bytes)?;
    match reader.byte()? {
        VERSION => {}
        version => return Err(BadChunk::Codec(version)),
    }
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
    use super::super::sample::{Micros, State};
    use super::*;

    #[test]
    fn blocks_of_several_signals_come_back() {
        let series = |count: i64| -> Vec<_> {
            (0..count).map(|at| Sample { time: Micros(at), state: State::Integer(at * at) }).collect()
        };
        let (short, long) = (series(3), series(600));
        let (mode, moving) = (Address::CurMode, Address::IsMoving);
        let bytes = encode([(mode, Interval::USUAL, &short[..]), (moving, Interval::LONGEST, &long[..])]);
        let decoded = decode(&bytes).unwrap();
        assert_eq!((decoded[0].0, &decoded[0].1.samples), (mode, &short));
        assert_eq!((decoded[1].0, decoded[1].1.interval), (moving, Interval::LONGEST));
        assert_eq!([&decoded[1].1.samples[..], &decoded[2].1.samples[..]].concat(), long);
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 0x10;
            assert!(decode(&changed).is_err(), "{at}");
            assert!(decode(&bytes[..at]).is_err(), "{at}");
        }
    }
}
