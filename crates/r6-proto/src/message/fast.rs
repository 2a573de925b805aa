//! The fast path of the decoder: what flows all day, read in few steps.
//!
//! Peers write the same members in the same order again and again, without blanks, in short plain texts. So each key is
//! first compared with the one that came in its place the last time, in one comparison of sixteen bytes; and a short text
//! or number is found to its end in one look ([`crate::chunk`]). Nothing is decided here: where anything is out of
//! the ordinary (a blank, an escape, a byte beyond ASCII, an unknown or repeated key, a long text) the fast path stops
//! before it and [`crate::json::Cursor`] reads on from there. Both give the same nodes for the same bytes, which
//! `tests/fast_path.rs` checks: there every frame is also read in a form that the fast path leaves alone.

mod list;
mod object;

pub(super) use list::read_texts;
pub(super) use object::Habit;

use crate::chunk::{CHUNK, Chunk};
use crate::text::plain_end;
use crate::value::{Kind, Node, Span};

/// A key as it stands on the wire, quotes and colon included, ready to be compared.
#[derive(Clone, Copy)]
pub(super) struct Pattern {
    bytes: u128,
    /// The bits that are compared.
    mask: u128,
    length: usize,
}

impl Pattern {
    /// Matches nothing.
    const NONE: Self = Self { bytes: 1, mask: 0, length: 0 };

    /// The pattern of a key of at most 13 bytes, which need no escape. To be called in constants: there a longer one is an error.
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

/// The plain text whose first byte behind the quote is at `start`, if it is that short.
#[inline(always)]
fn short_text(bytes: &[u8], start: usize) -> Option<Node> {
    let chunk = Chunk::at(bytes, start);
    let length = chunk.plain();
    (length < CHUNK && chunk.byte(length) == b'"').then(|| text(start, start + length))
}

/// The plain text whose opening quote stands here, however long it is.
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
    // A zero at the beginning stands alone.
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
