//! Texts of at most sixteen bytes, put together in one register and appended with one copy.
//!
//! Numbers and keys are that short, and a frame is made of little else. Appending a byte at a time costs more than finding
//! out what the bytes are; sixteen bytes of which the last few do not count cost as much as one.

use super::Decimals;

/// A text of at most [`Short::MOST`] bytes; its first byte is the lowest.
#[derive(Clone, Copy)]
pub(crate) struct Short {
    bytes: u128,
    length: usize,
}

impl Short {
    /// How long such a text can be, bytes.
    pub const MOST: usize = 16;

    pub const EMPTY: Self = Self { bytes: 0, length: 0 };

    /// How long it is, bytes.
    pub const fn len(self) -> usize {
        self.length
    }

    /// The text and one byte more. There must be room for it.
    #[inline(always)]
    pub const fn with(self, byte: u8) -> Self {
        Self { bytes: self.bytes | (byte as u128) << (8 * self.length), length: self.length + 1 }
    }

    /// The text and others behind it. There must be room for them.
    pub const fn and(self, bytes: &[u8]) -> Self {
        match bytes {
            [] => self,
            [first, rest @ ..] => self.with(*first).and(rest),
        }
    }

    /// The text and another behind it; `None` if they are too long.
    #[inline(always)]
    pub fn joined(self, other: Self) -> Option<Self> {
        let length = self.length + other.length;
        (length <= Self::MOST)
            .then(|| Self { bytes: self.bytes | other.bytes << (8 * self.length % 128), length })
    }

    /// The text without the comma that it begins with, where it is the first of its list.
    #[inline(always)]
    pub const fn behind_comma(self, first: bool) -> Self {
        if first { Self { bytes: self.bytes >> 8, length: self.length - 1 } } else { self }
    }

    /// A whole number of at most eight digits; `None` if it has more.
    #[inline]
    pub fn of_integer(value: u32) -> Option<Self> {
        if value < 10 {
            return Some(Self::EMPTY.with(b'0' | value.to_le_bytes()[0]));
        }
        if value > MOST_IN_EIGHT {
            return None;
        }
        let (digits, length) = whole(value);
        Some(Self { bytes: u128::from(digits), length })
    }

    /// A number in steps of its last decimal; `None` if it has more than seven digits before the point.
    #[inline(always)]
    pub fn of_fixed(scaled: i64, decimals: Decimals) -> Option<Self> {
        let magnitude = scaled.unsigned_abs();
        // Two constants, for each of which the division becomes a multiplication.
        let (before, behind) = if decimals.most == 3 {
            (magnitude / 1_000, magnitude % 1_000 * 1_000)
        } else {
            (magnitude / 1_000_000, magnitude % 1_000_000)
        };
        let before = u32::try_from(before).ok().filter(|before| *before <= MOST_IN_SEVEN)?;
        let (digits, length) = whole(before);
        let negative = usize::from(scaled < 0);
        let sign = if scaled < 0 { u64::from(b'-') } else { 0 };
        let head = digits << (8 * negative) | sign;
        // Six digits: the first two of eight are 0.
        let behind = eight_digits(u32::try_from(behind).unwrap_or(0)) >> 16;
        let used = 8 - behind.leading_zeros() as usize / 8;
        let kept = used.max(decimals.least);
        let tail_length = if kept > 0 { 1 + kept } else { 0 };
        let tail = (behind | ZEROS) << 8 | u64::from(b'.');
        // Nothing may stand behind the last byte that counts: more is joined to it there. It is at most the seventh.
        let tail = tail & !(u64::MAX << (8 * tail_length));
        let point = negative + length;
        Some(Self { bytes: u128::from(head) | u128::from(tail) << (8 * point), length: point + tail_length })
    }

    /// Appends the text and a quote behind it.
    #[inline(always)]
    pub fn append_closed_to(self, out: &mut Vec<u8>) {
        if self.length < Self::MOST {
            self.with(b'"').append_to(out);
        } else {
            self.append_to(out);
            out.push(b'"');
        }
    }

    /// Appends the text.
    #[inline(always)]
    pub fn append_to(self, out: &mut Vec<u8>) {
        let end = out.len() + self.length;
        out.extend_from_slice(&self.bytes.to_le_bytes());
        out.truncate(end);
    }
}

const MOST_IN_EIGHT: u32 = 99_999_999;

/// With a sign before them, seven digits are eight bytes.
const MOST_IN_SEVEN: u32 = 9_999_999;

/// Eight times the digit 0.
const ZEROS: u64 = 0x3030_3030_3030_3030;

/// The digits of a number of at most eight, the first of them lowest, and how many there are.
#[inline(always)]
fn whole(value: u32) -> (u64, usize) {
    let digits = eight_digits(value);
    // The last digit stays, although it be 0.
    let leading = (digits | 1 << 56).trailing_zeros() / 8;
    ((digits | ZEROS) >> (8 * leading), 8 - leading as usize)
}

/// The eight digits of a number as values from 0 to 9, one in each byte, the first lowest.
#[inline(always)]
fn eight_digits(value: u32) -> u64 {
    let value = u64::from(value);
    // Halves of four digits, then quarters of two, then single digits, all at the same time; the factors divide
    // exactly for numbers as small as these.
    let halves = (value / 10_000) | ((value % 10_000) << 32);
    let hundreds = ((halves * 10_486) >> 20) & 0x0000_007F_0000_007F;
    let quarters = hundreds | (halves - hundreds * 100) << 16;
    let tens = ((quarters * 103) >> 10) & 0x000F_000F_000F_000F;
    tens | (quarters - tens * 10) << 8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(short: Short) -> String {
        let mut out = Vec::new();
        short.append_to(&mut out);
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn every_number_of_four_digits_has_its_own() {
        for high in 0..10_000_u32 {
            for value in [high, high * 10_000, high * 10_000 + 9_999 - high, high * 9_999] {
                assert_eq!(Short::of_integer(value).map(text), Some(value.to_string()));
            }
        }
        assert_eq!(Short::of_integer(MOST_IN_EIGHT).map(text), Some("99999999".to_owned()));
        assert!(Short::of_integer(MOST_IN_EIGHT + 1).is_none());
    }

    #[test]
    fn a_decimal_that_fills_the_register_is_whole() {
        let fixed = |scaled| Short::of_fixed(scaled, Decimals::SIX).map(text);
        assert_eq!(fixed(-9_999_999_999_999), Some("-9999999.999999".to_owned()));
        assert_eq!(fixed(-1), Some("-0.000001".to_owned()));
        assert_eq!(fixed(0), Some("0.000000".to_owned()));
        assert_eq!(fixed(10_000_000_000_000), None);
    }

    #[test]
    fn the_first_of_a_list_has_no_comma() {
        let short = Short::EMPTY.with(b',').and(b"\"m0\":");
        assert_eq!(
            (text(short), text(short.behind_comma(false))),
            (",\"m0\":".to_owned(), ",\"m0\":".to_owned())
        );
        assert_eq!(text(short.behind_comma(true)), "\"m0\":");
    }
}
