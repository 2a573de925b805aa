//! Reads plain decimals with a few multiplications, without a loop over the digits.

use crate::sixteen_bytes::{CHUNK, Chunk};

/// A decimal number as written: up to 15 digits, with at most one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Decimal {
    negative: bool,
    /// All digits as one number, below 10^15.
    digits: u64,
    /// Position of the point in a chunk that ends with the number; 16 if there is no point.
    point: usize,
}

/// For one position of the point: which bytes of a chunk are digits, and the divisor.
#[derive(Clone, Copy)]
struct Place {
    /// The bytes before the point; no bytes if there is no point.
    before: u128,
    /// The bytes after the point; all bytes if there is no point.
    behind: u128,
    divisor: f64,
}

/// By position of the point; the last entry is for numbers without a point.
static PLACES: [Place; CHUNK + 1] = {
    let mut places = [Place { before: 0, behind: u128::MAX, divisor: 1.0 }; CHUNK + 1];
    let mut slots: &mut [Place] = &mut places;
    let (mut before, mut behind) = (0, u128::MAX << 8);
    let mut divisor = 1e15;
    while let [slot, _, ..] = slots {
        *slot = Place { before, behind, divisor };
        (before, behind) = (before << 8 | 0xFF, behind << 8);
        // Each power of ten is exact.
        divisor /= 10.0;
        let [_, later @ ..] = slots else { break };
        slots = later;
    }
    places
};

/// Masks for the last n bytes of a chunk.
static LAST: [u128; CHUNK + 1] = {
    let mut last = [0; CHUNK + 1];
    let mut slots: &mut [u128] = &mut last;
    let mut mask: u128 = 0;
    while let [slot, later @ ..] = slots {
        *slot = mask;
        mask = mask >> 8 | 0xFF << 120;
        slots = later;
    }
    last
};

/// The digit 0, sixteen times.
const ZEROS: u128 = 0x3030_3030_3030_3030_3030_3030_3030_3030;

impl Decimal {
    /// Reads the number from `start` to `end`; `None` for other forms, such as an exponent, or if fewer than
    /// sixteen bytes come before `end`.
    ///
    /// The digits are aligned to the end of a chunk, so each digit has a fixed place value.
    #[inline(always)]
    pub fn read(bytes: &[u8], start: usize, end: usize) -> Option<Self> {
        let chunk = Chunk::before(bytes, end)?;
        let negative = bytes.get(start) == Some(&b'-');
        let length = end.wrapping_sub(start + usize::from(negative));
        // Bytes before the number count as zeros.
        let text = (chunk.bits() ^ ZEROS) & LAST.get(length)?;
        let point = Chunk::of(text).place_of(b'.' ^ b'0');
        let place = PLACES.get(point)?;
        // Moves the digits before the point next to those after it.
        let text = (text & place.behind) | (text & place.before) << 8;
        let digits = length - usize::from(point < CHUNK);
        // A digit is at most 9. Any other byte reaches 16 or more when 6 is added, or already has a high bit
        // set.
        let wrong = (text | text.wrapping_add(SIXES)) & HIGH_HALVES;
        if wrong != 0 || digits == 0 || digits >= CHUNK {
            return None;
        }
        let [high, low] = Chunk::of(text).words();
        Some(Self { negative, digits: eight(high) * 100_000_000 + eight(low), point })
    }

    /// The number, rounded once, because the digits and the power of ten are exact.
    #[inline(always)]
    pub fn number(self) -> Option<f64> {
        let number = self.digits as f64 / PLACES.get(self.point)?.divisor;
        Some(f64::from_bits(number.to_bits() | u64::from(self.negative) << 63))
    }

    /// The number if it has no point.
    #[inline(always)]
    pub fn integer(self) -> Option<i64> {
        let digits = i64::try_from(self.digits).ok().filter(|_| self.point == CHUNK)?;
        Some(if self.negative { -digits } else { digits })
    }
}

const EACH: u128 = 0x0101_0101_0101_0101_0101_0101_0101_0101;
const SIXES: u128 = EACH * 6;
const HIGH_HALVES: u128 = EACH * 0xF0;

/// The number formed by eight digits, given as values from 0 to 9; the first digit is the lowest byte.
#[inline(always)]
fn eight(digits: u64) -> u64 {
    // Joins neighbours to pairs, pairs to fours, and fours to eight.
    let pairs = (digits.wrapping_mul(1 + (10 << 8)) >> 8) & 0x00FF_00FF_00FF_00FF;
    let fours = (pairs.wrapping_mul(1 + (100 << 16)) >> 16) & 0x0000_FFFF_0000_FFFF;
    fours.wrapping_mul(1 + (10_000 << 32)) >> 32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Option<f64> {
        let bytes = format!("{{\"queryData\": [\"{text}\"");
        let start = bytes.len() - 1 - text.len();
        Decimal::read(bytes.as_bytes(), start, start + text.len()).and_then(Decimal::number)
    }

    #[test]
    fn what_is_read_is_what_the_standard_library_reads() {
        let texts = [
            "0",
            "-0",
            "7",
            "-7",
            "007",
            "12.5",
            "-137.563782",
            "0.000001",
            ".5",
            "5.",
            "-.5",
            "999999999999999",
            "99999999.9999999",
            "-999999999999999",
            "1.00000000000000",
            "123456789012345",
        ];
        for text in texts {
            let expected: f64 = text.parse().unwrap();
            assert_eq!(read(text).map(f64::to_bits), Some(expected.to_bits()), "{text}");
        }
    }

    #[test]
    fn all_else_is_left_to_a_closer_look() {
        for text in [
            "",
            "-",
            ".",
            "-.",
            "+1",
            "1e5",
            "1.2.3",
            "1,5",
            " 1",
            "1 ",
            "0x3F",
            "--1",
            "1-",
            "1234567890123456",
            "12345678901234567890",
            "\u{e9}",
            "1:2",
            "1/2",
            "1n",
            "1.\u{1e}",
            "12>",
        ] {
            assert_eq!(read(text), None, "{text}");
        }
    }

    #[test]
    fn every_byte_but_digits_and_a_point_is_refused() {
        for byte in 0..=255_u8 {
            let bytes = [&[b'x'; 20][..], &[b'1', byte, b'2']].concat();
            let read = Decimal::read(&bytes, 20, 23);
            assert_eq!(read.is_some(), byte.is_ascii_digit() || byte == b'.', "{byte:02X}");
        }
    }
}
