//! The fast path of the decoder, for the frames that arrive all the time.
//!
//! Peers write the same members in the same order again and again, without blanks, as short plain texts. So
//! the fast path first compares each key with the key that came at this place last time, in one comparison of
//! sixteen bytes. It finds the end of a short text or number in one step ([`crate::chunk`]). The fast path
//! decides nothing. At anything unusual (a blank, an escape, a non-ASCII byte, an unknown or repeated key, a
//! long text) it stops, and [`crate::json::Cursor`] continues from there. Both give the same nodes for the
//! same bytes. `tests/fast_path.rs` checks this: it also reads every frame in a form that the fast path does
//! not take.

mod list;
mod object;

pub(super) use list::read_texts;
pub(super) use object::Habit;

use crate::sixteen_bytes::{CHUNK, Chunk};
use crate::text::plain_end;
use crate::value::{Kind, Node, Span};

/// A key as on the wire, including quotes and colon, prepared for comparison.
#[derive(Clone, Copy)]
pub(super) struct Pattern {
    bytes: u128,
    /// The bits to compare.
    mask: u128,
    length: usize,
}

impl Pattern {
    /// Matches nothing.
    const NONE: Self = Self { bytes: 1, mask: 0, length: 0 };

    /// The pattern of a key of at most 13 bytes, without escapes. Call this only in constants, where a longer
    /// key is a compile error.
    pub const fn of(key: &str) -> Self {
        let (mut bytes, mut length) = (b'"' as u128, 1);
        let mut rest = key.as_bytes();
        while let [first, others @ ..] = rest {
            bytes |= (*first as u128) << (8 * length);
            length += 1;
            rest = others;
        }
        bytes |= (b'"' as u128 | (b':' as u128) << 8) << (8 * length);
        length += 2;
        Self { bytes, mask: u128::MAX >> (8 * (CHUNK - length)), length }
    }

    /// The patterns of many keys.
    pub const fn all<const COUNT: usize>(keys: [&str; COUNT]) -> [Self; COUNT] {
        let mut patterns = [Self::NONE; COUNT];
        let (mut slots, mut names) = (patterns.as_mut_slice(), keys.as_slice());
        while let ([slot, later_slots @ ..], [name, later_names @ ..]) = (slots, names) {
            *slot = Self::of(name);
            (slots, names) = (later_slots, later_names);
        }
        patterns
    }

    #[inline(always)]
    fn matches(&self, chunk: Chunk) -> bool {
        (chunk.bits() ^ self.bytes) & self.mask == 0
    }
}

/// The plain text whose first byte (after the quote) is at `start`, if it is short enough.
#[inline(always)]
fn short_text(bytes: &[u8], start: usize) -> Option<Node> {
    let chunk = Chunk::at(bytes, start);
    let length = chunk.plain();
    (length < CHUNK && chunk.byte(length) == b'"').then(|| text(start, start + length))
}

/// The plain text whose opening quote is at `quote`, of any length.
#[inline]
pub(super) fn plain_text(bytes: &[u8], quote: usize) -> Option<Node> {
    if bytes.get(quote) != Some(&b'"') {
        return None;
    }
    let end = plain_end(bytes, quote + 1);
    (bytes.get(end) == Some(&b'"')).then(|| text(quote + 1, end))
}

/// A plain text: the bytes between its quotes.
#[inline(always)]
fn text(start: usize, end: usize) -> Node {
    Node { span: Span::new(start, end), kind: Kind::Text { has_escape: false, utf8: true } }
}

/// The number that begins at `start`, if it is short and has no exponent.
#[inline(always)]
fn short_number(bytes: &[u8], start: usize) -> Option<Node> {
    let chunk = Chunk::at(bytes, start);
    let sign = usize::from(chunk.byte(0) == b'-');
    let whole = chunk.digits_from(sign);
    // JSON does not allow leading zeros.
    if whole == 0 || (whole > 1 && chunk.byte(sign) == b'0') {
        return None;
    }
    let mut end = sign + whole;
    if end < CHUNK && chunk.byte(end) == b'.' {
        let decimals = chunk.digits_from(end + 1);
        if decimals == 0 {
            return None;
        }
        end += 1 + decimals;
    }
    let ends = end < CHUNK && matches!(chunk.byte(end), b',' | b'}' | b']');
    ends.then(|| Node { span: Span::new(start, start + end), kind: Kind::Number })
}
