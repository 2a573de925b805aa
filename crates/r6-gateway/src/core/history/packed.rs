//! Whole numbers of a column as few bytes.
//!
//! Few numbers are written one by one (`bytes.rs`), as differences. Many are packed by `pco`. The shortest
//! way is taken; the first byte says which.

use pco::standalone::{simple_compress, simple_decompress_into};
use pco::{ChunkConfig, DEFAULT_COMPRESSION_LEVEL};

use super::bytes::{Reader, put, put_signed, signed_len};
use super::codec::BadChunk;

/// Differences between one number and the next.
const STEPS: u8 = 0;

/// Differences between one difference and the next: short where numbers grow evenly.
const BENDS: u8 = 1;

/// The bytes of `pco`, with their number before them.
const PACKED: u8 = 2;

/// From how many numbers on packing may be shorter: its own head takes some twenty bytes.
const MANY: usize = 32;

/// The most bytes of packed numbers: they are shorter than 512 numbers of ten bytes.
const MAX_PACKED: usize = 5_120;

/// Appends numbers. Differences wrap, so every number comes back.
pub(super) fn put_integers(out: &mut Vec<u8>, numbers: &[i64]) {
    let len = |way| differences(numbers, way).map(signed_len).sum::<usize>();
    let (steps, bends) = (len(STEPS), len(BENDS));
    let packed = (numbers.len() >= MANY).then(|| {
        let config = ChunkConfig::default().with_compression_level(DEFAULT_COMPRESSION_LEVEL);
        simple_compress(numbers, &config)
    });
    match packed {
        Some(Ok(packed)) if packed.len() < steps.min(bends) => {
            out.push(PACKED);
            put(out, packed.len() as u64);
            out.extend_from_slice(&packed);
        }
        // Without packing the numbers come back too.
        Some(Ok(_) | Err(_)) | None => {
            let way = if bends < steps { BENDS } else { STEPS };
            out.push(way);
            differences(numbers, way).for_each(|number| put_signed(out, number));
        }
    }
}

/// Reads `count` numbers.
pub(super) fn integers(reader: &mut Reader<'_>, count: usize) -> Result<Vec<i64>, BadChunk> {
    let way = reader.byte()?;
    match way {
        STEPS | BENDS => {
            let (mut last, mut slope) = (0_i64, 0_i64);
            let number = |at: usize| {
                let step = reader.signed()?.wrapping_add(slope);
                last = last.wrapping_add(step);
                slope = if way == BENDS && at > 0 { step } else { 0 };
                Ok(last)
            };
            (0..count).map(number).collect()
        }
        PACKED => {
            let len = reader.up_to(MAX_PACKED)?;
            let mut numbers = vec![0; count];
            let read =
                simple_decompress_into(reader.take(len)?, &mut numbers).map_err(|_| BadChunk::Number)?;
            if read.finished && read.n_processed == count { Ok(numbers) } else { Err(BadChunk::Short) }
        }
        _ => Err(BadChunk::Number),
    }
}

fn differences(numbers: &[i64], way: u8) -> impl Iterator<Item = i64> {
    let (mut last, mut slope) = (0_i64, 0_i64);
    numbers.iter().enumerate().map(move |(at, number)| {
        let step = number.wrapping_sub(last);
        let difference = step.wrapping_sub(slope);
        last = *number;
        // The first step is the number itself, and no slope.
        slope = if way == BENDS && at > 0 { step } else { 0 };
        difference
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bytes(numbers: &[i64]) -> Vec<u8> {
        let mut out = Vec::new();
        put_integers(&mut out, numbers);
        out
    }

    #[test]
    fn the_shortest_way_is_taken() {
        let (way, len) = (|numbers: &[i64]| bytes(numbers)[0], |numbers: &[i64]| bytes(numbers).len());
        let line: Vec<_> = (0..512).map(|at| 1_700_000_000_000_000 + at * 100_000).collect();
        assert!((way(&line), len(&line) < 60) == (PACKED, true), "{}", len(&line));
        let jitter: Vec<_> = line.iter().map(|time| time + (time / 100_000 * 7919) % 2_000).collect();
        assert!((way(&jitter), len(&jitter) < 512 * 14 / 8 + 60) == (PACKED, true), "{}", len(&jitter));
        assert_eq!((way(&[-7; 12]), len(&[-7; 12])), (STEPS, 13));
        assert_eq!((way(&line[..9]), len(&line[..9])), (BENDS, 19));
    }

    #[test]
    fn bytes_that_are_no_packed_numbers_are_refused() {
        let numbers: Vec<i64> = (0..512).map(|at| at * at * 7919 % 10_007).collect();
        let packed = bytes(&numbers);
        assert_eq!(packed[0], PACKED);
        for count in [0, 1, 511, 513] {
            assert!(integers(&mut Reader::new(&packed), count).is_err(), "{count}");
        }
        for end in 0..packed.len() {
            assert!(integers(&mut Reader::new(&packed[..end]), 512).is_err(), "{end}");
        }
        assert!(integers(&mut Reader::new(&[3, 1, 1]), 1).is_err());
    }

    proptest! {
        #[test]
        fn all_numbers_come_back(
            numbers in prop::collection::vec(
                prop_oneof![4 => -1000_i64..1000, 1 => any::<i64>(), 1 => Just(i64::MIN), 1 => Just(i64::MAX)],
                0..200,
            ),
            steps in prop::collection::vec(-100_i64..100, 0..600),
        ) {
            let walk: Vec<_> = steps.iter().scan(0_i64, |at, step| { *at += step; Some(*at) }).collect();
            for numbers in [numbers, walk] {
                let bytes = bytes(&numbers);
                let mut reader = Reader::new(&bytes);
                prop_assert_eq!(integers(&mut reader, numbers.len()).unwrap(), numbers);
                prop_assert!(reader.is_empty());
            }
        }
    }
}
