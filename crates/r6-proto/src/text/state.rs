//! Finds the end of a string that arrives in pieces, in both encodings at the same time.

use super::plain_end;

/// The state of a string that arrives piece by piece. It finds the closing quote without looking back.
///
/// It skips escapes without checking them. [`super::scan_string`] checks them and finds the same end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StringState {
    reading: Reading,
    /// The last byte, read as UTF-8, was a `\`.
    escape: bool,
    /// The state as GBK, kept in parallel from the first non-ASCII byte on.
    gbk: GbkState,
}

/// The possible readings of the bytes seen so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Reading {
    #[default]
    Ascii,
    Utf8(Utf8Sequence),
    Gbk,
}

/// Result of one step of [`StringState::advance`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// All bytes are used, and the string is still open.
    Open,
    /// The closing quote is at this offset.
    Closed(usize),
    /// A raw control byte, which a string cannot contain, is at this offset.
    ControlByte(usize, u8),
}

impl StringState {
    /// Reads the bytes from the offset `from` on. They follow the bytes of the previous call.
    #[inline]
    pub fn advance(&mut self, bytes: &[u8], from: usize) -> Progress {
        if self.reading != Reading::Ascii {
            return self.advance_beyond_ascii(bytes, from);
        }
        let mut at = from;
        loop {
            if self.escape {
                match bytes.get(at) {
                    None => return Progress::Open,
                    Some(0x20..0x80) => at += 1,
                    // Any other byte is handled below.
                    Some(_) => {}
                }
                self.escape = false;
            }
            at = plain_end(bytes, at);
            match bytes.get(at) {
                None => return Progress::Open,
                Some(b'"') => return Progress::Closed(at),
                Some(b'\\') => {
                    self.escape = true;
                    at += 1;
                }
                Some(0x80..) => {
                    self.reading = Reading::Utf8(Utf8Sequence::DONE);
                    return self.advance_beyond_ascii(bytes, at);
                }
                Some(&byte) => return Progress::ControlByte(at, byte),
            }
        }
    }

    /// Whether the bytes seen so far are UTF-8; otherwise they are GBK.
    #[must_use]
    pub fn is_utf8(&self) -> bool {
        self.reading != Reading::Gbk
    }

    fn advance_beyond_ascii(&mut self, bytes: &[u8], from: usize) -> Progress {
        for (at, &byte) in bytes.iter().enumerate().skip(from) {
            if byte < 0x20 {
                return Progress::ControlByte(at, byte);
            }
            if self.closes(byte) {
                return Progress::Closed(at);
            }
        }
        Progress::Open
    }

    /// Takes one byte. Returns whether it closes the string.
    fn closes(&mut self, byte: u8) -> bool {
        let closes_gbk = self.gbk.closes(byte);
        let Reading::Utf8(sequence) = self.reading else { return closes_gbk };
        match sequence.then(byte) {
            Some(next) => {
                self.reading = Reading::Utf8(next);
                takes_quote(&mut self.escape, byte)
            }
            None => {
                self.reading = Reading::Gbk;
                closes_gbk
            }
        }
    }
}

/// Takes one byte that is not the second byte of a pair. Returns whether it is a quote that closes the
/// string.
fn takes_quote(escape: &mut bool, byte: u8) -> bool {
    let escaped = std::mem::replace(escape, byte == b'\\' && !*escape);
    byte == b'"' && !escaped
}

/// The state of a reading as GBK.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct GbkState {
    /// The last byte was the first byte of a pair.
    lead: bool,
    /// The last byte was a `\`.
    escape: bool,
}

impl GbkState {
    fn closes(&mut self, byte: u8) -> bool {
        if std::mem::take(&mut self.lead) && is_gbk_trail(byte) {
            return false;
        }
        self.lead = is_gbk_lead(byte);
        takes_quote(&mut self.escape, byte)
    }
}

pub(super) fn is_gbk_lead(byte: u8) -> bool {
    matches!(byte, 0x81..=0xFE)
}

pub(super) fn is_gbk_trail(byte: u8) -> bool {
    matches!(byte, 0x40..=0x7E | 0x80..=0xFE)
}

/// The rest of a UTF-8 sequence that is still expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Utf8Sequence {
    /// Number of bytes.
    due: u8,
    /// The range of the next byte.
    low: u8,
    high: u8,
}

impl Utf8Sequence {
    const DONE: Self = Self { due: 0, low: 0x80, high: 0xBF };

    /// The state after this byte; `None` if it is not UTF-8 (RFC 3629: no overlong forms, no surrogates).
    fn then(self, byte: u8) -> Option<Self> {
        if self.due > 0 {
            let due = self.due - 1;
            return (self.low..=self.high).contains(&byte).then_some(Self { due, ..Self::DONE });
        }
        let (due, low, high) = match byte {
            0x00..=0x7F => (0, 0x80, 0xBF),
            0xC2..=0xDF => (1, 0x80, 0xBF),
            0xE0 => (2, 0xA0, 0xBF),
            0xED => (2, 0x80, 0x9F),
            0xE1..=0xEF => (2, 0x80, 0xBF),
            0xF0 => (3, 0x90, 0xBF),
            0xF1..=0xF3 => (3, 0x80, 0xBF),
            0xF4 => (3, 0x80, 0x8F),
            0x80..=0xC1 | 0xF5..=0xFF => return None,
        };
        Some(Self { due, low, high })
    }
}
