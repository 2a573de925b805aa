//! Builds texts of at most sixteen bytes in one register and appends each with one copy.
//!
//! Numbers and keys are that short, and most of a frame consists of them. Appending byte by byte costs more
//! than computing the bytes. Appending sixteen bytes costs as much as appending one, so unused bytes at the
//! end do no harm.

use super::Decimals;

/// A text of at most [`Short::MOST`] bytes; its first byte is the lowest.
#[derive(Clone, Copy)]
pub(crate) struct Short {
    bytes: u128,
    length: usize,
}

impl Short {
    /// The maximum length of such a text, in bytes.
    pub const MOST: usize = 16;

    pub const EMPTY: Self = Self { bytes: 0, length: 0 };

    /// Its length in bytes.
    pub const fn len(self) -> usize {
        self.length
    }

    /// Appends one byte. There must be room for it.
    #[inline(always)]
    pub const fn with(self, byte: u8) -> Self {
        Self { bytes: self.bytes | (byte as u128) << (8 * self.length), length: self.length + 1 }
    }

    /// Appends bytes. There must be room for them.
    pub const fn and(self, bytes: &[u8]) -> Self {
        match bytes {
            [] => self,
            [first, rest @ ..] => self.with(*first).and(rest),
        }
    }

    /// The text, without its leading comma if it is the first item of its list.
    #[inline(always)]
    pub const fn behind_comma(self, first: bool) -> Self {
        if first { Self { bytes: self.bytes >> 8, length: self.length - 1 } } else { self }
    }

    /// The text without its last `count` bytes. It must be longer than that.
    #[inline]
    pub const fn without_last(self, count: usize) -> Self {
        Self {
            bytes: self.bytes & u128::MAX >> (8 * (Self::MOST + count - self.length)),
            length: self.length - count,
        }
    }

    /// A whole number of at most eight digits; `None` for more digits.
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

    /// Appends the text.
    #[inline(always)]
    pub fn append_to(self, out: &mut Vec<u8>) {
        let end = out.len() + self.length;
        out.extend_from_slice(&self.bytes.to_le_bytes());
        out.truncate(end);
    }
}

/// Appends `before`, the number `scaled` (in units of its last decimal), and a closing quote if `closed` is
/// set. If the number has more than seven digits before the point, it appends nothing and returns `false`.
#[inline(always)]
pub(crate) fn append_fixed(
    out: &mut Vec<u8>,
    before: Short,
    scaled: i64,
    decimals: Decimals,
    closed: bool,
) -> bool {
    let magnitude = scaled.unsigned_abs();
    // Each branch divides by constants, so the compiler turns the division into a multiplication.
    let (whole_part, behind, zeros) = if decimals.most == 3 {
        (magnitude / 1_000, three(magnitude % 1_000), ZEROS >> 40)
    } else {
        let behind = magnitude % 1_000_000;
        (magnitude / 1_000_000, three(behind / 1_000) | three(behind % 1_000) << 24, ZEROS >> 16)
    };
    let (digits, length) = match u32::try_from(whole_part) {
        Ok(value @ 0..1_000) => few(value),
        Ok(value @ ..=MOST_IN_SEVEN) => whole(value),
        Ok(_) | Err(_) => return false,
    };
    let negative = usize::from(scaled < 0);
    let head = digits << (8 * negative) | if scaled < 0 { u64::from(b'-') } else { 0 };
    let point = before.length + negative + length;
    let used = 8 - (behind ^ zeros).leading_zeros() as usize / 8;
    let kept = used.max(decimals.least);
    let tail = behind << 8 | u64::from(b'.');
    let tail_length = if kept > 0 { 1 + kept } else { 0 };
    // The parts are written from left to right and overwrite each other. The truncation below removes the
    // unused bytes at the end.
    let begin = out.len();
    out.extend_from_slice(&[0; ROOM]);
    if let Some(room) = out.last_chunk_mut::<ROOM>() {
        if let Some(text) = room.first_chunk_mut() {
            *text = before.bytes.to_le_bytes();
        }
        put(room, before.length, head);
        put(room, point, tail);
        put(room, point + tail_length, u64::from(b'"'));
    }
    out.truncate(begin + point + tail_length + usize::from(closed));
    true
}

/// Appends a number below a thousand and a closing quote.
#[inline(always)]
pub(crate) fn append_closed_few(out: &mut Vec<u8>, value: u32) {
    let (digits, length) = few(value);
    let end = out.len() + length + 1;
    out.extend_from_slice(&(digits | u64::from(b'"') << (8 * length)).to_le_bytes());
    out.truncate(end);
}

/// Room for a text, a sign and seven digits, a point and six more digits, a quote, and the seven unused bytes
/// of the last word.
const ROOM: usize = Short::MOST + 24;

/// Writes eight bytes; the first byte is the lowest.
#[inline(always)]
fn put(room: &mut [u8; ROOM], at: usize, bytes: u64) {
    if let Some(place) = room.get_mut(at..at + 8) {
        place.copy_from_slice(&bytes.to_le_bytes());
    }
}

/// The three digits of each number below a thousand; the first digit is the lowest byte.
static THREES: [u32; 1_000] = {
    let mut threes = [0; 1_000];
    let mut slots = threes.as_mut_slice();
    let mut value: u32 = 0;
    while let [slot, later @ ..] = slots {
        let [hundreds, tens, ones] = [value / 100, value / 10 % 10, value % 10];
        *slot = (hundreds | (tens << 8) | (ones << 16)) | 0x0030_3030;
        value += 1;
        slots = later;
    }
    threes
};

#[inline(always)]
fn three(value: u64) -> u64 {
    usize::try_from(value).ok().and_then(|at| THREES.get(at)).copied().map_or(0, u64::from)
}

/// The digits of a number below a thousand without leading zeros, and how many there are. The first digit is
/// the lowest byte.
#[inline(always)]
fn few(value: u32) -> (u64, usize) {
    let leading = usize::from(value < 100) + usize::from(value < 10);
    (three(u64::from(value)) >> (8 * leading), 3 - leading)
}

const MOST_IN_EIGHT: u32 = 99_999_999;

/// Seven digits and a sign fit in eight bytes.
const MOST_IN_SEVEN: u32 = 9_999_999;

/// The digit 0, eight times.
const ZEROS: u64 = 0x3030_3030_3030_3030;

/// The digits of a number of at most eight digits, and how many there are. The first digit is the lowest
/// byte.
#[inline(always)]
fn whole(value: u32) -> (u64, usize) {
    let digits = eight_digits(value);
    // The last digit always stays, even if it is 0.
    let leading = (digits | 1 << 56).trailing_zeros() / 8;
    ((digits | ZEROS) >> (8 * leading), 8 - leading as usize)
}

/// The eight digits of a number as values from 0 to 9, one in each byte; the first digit is the lowest byte.
#[inline(always)]
fn eight_digits(value: u32) -> u64 {
    let value = u64::from(value);
    // Splits into two halves of four digits, then four pairs, then single digits, all in parallel. The
    // factors divide exactly for numbers this small.
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
    fn a_decimal_that_fills_its_room_is_whole() {
        let behind = |before, scaled| {
            let mut out = b"[".to_vec();
            let appended = append_fixed(&mut out, before, scaled, Decimals::SIX, true);
            (appended, String::from_utf8(out).unwrap())
        };
        let fixed = |scaled| behind(Short::EMPTY, scaled);
        assert_eq!(fixed(-9_999_999_999_999), (true, "[-9999999.999999\"".to_owned()));
        assert_eq!(fixed(-1), (true, "[-0.000001\"".to_owned()));
        assert_eq!(fixed(0), (true, "[0.000000\"".to_owned()));
        assert_eq!(fixed(10_000_000_000_000), (false, "[".to_owned()));
        let longest = Short::EMPTY.and(b",\"abcdefghijk\":\"");
        assert_eq!(longest.len(), Short::MOST);
        assert_eq!(
            behind(longest, -9_999_999_999_999),
            (true, "[,\"abcdefghijk\":\"-9999999.999999\"".to_owned())
        );
        assert_eq!(behind(longest, 10_000_000_000_000), (false, "[".to_owned()));
    }

    #[test]
    fn every_thousandth_is_written_as_the_standard_library_does() {
        let decimals = Decimals { least: 3, most: 3 };
        for thousandths in (0..1_000_000_i64).chain((1_000_000..9_999_999_999).step_by(9_999_991)) {
            for scaled in [thousandths, -thousandths] {
                let mut out = Vec::new();
                assert!(append_fixed(&mut out, Short::EMPTY, scaled, decimals, false));
                let sign = if scaled < 0 { "-" } else { "" };
                let expected = format!("{sign}{}.{:03}", thousandths / 1_000, thousandths % 1_000);
                assert_eq!(String::from_utf8(out).unwrap(), expected);
            }
        }
    }

    #[test]
    fn every_number_below_a_thousand_is_closed() {
        for value in 0..1_000 {
            let mut out = Vec::new();
            append_closed_few(&mut out, value);
            assert_eq!(String::from_utf8(out).unwrap(), format!("{value}\""));
        }
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
