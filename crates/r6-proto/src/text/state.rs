//! The end of a string whose bytes come in pieces, in both encodings at once.

use super::plain_end;

/// Where a string stands whose bytes arrive piece by piece: it finds the closing quote without looking back.
///
/// Escapes are stepped over, not checked: that is [`super::scan_string`]'s part, which finds the same end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StringState {
    reading: Reading,
    /// The reading as UTF-8 stands behind a `\`.
    escape: bool,
    /// The reading as GBK, kept up beside the other from the first byte beyond ASCII on.
    gbk: GbkState,
}

/// How the bytes seen so far can be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Reading {
    #[default]
    Ascii,
    Utf8(Utf8Sequence),
    Gbk,
}

/// What one step of [`StringState::advance`] came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// All bytes are used up and the string goes on.
    Open,
    /// The closing quote stands at this offset.
    Closed(usize),
    /// A raw control byte stands at this offset: a string cannot hold it.
    ControlByte(usize, u8),
}

impl StringState {
    /// Looks at the bytes from the offset `from` on, which follow those of the call before.
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
                    // Anything else ends the string or speaks for itself below.
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

    /// Whether the bytes seen so far are UTF-8; they are GBK if not.
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

    /// Takes one byte; tells whether it closes the string.
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

/// Takes one byte that is no second byte of a pair; tells whether it is a quote that closes the string.
fn takes_quote(escape: &mut bool, byte: u8) -> bool {
    let escaped = std::mem::replace(escape, byte == b'\\' && !*escape);
    byte == b'"' && !escaped
}

/// Where a reading as GBK stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct GbkState {
    /// The first byte of a pair was the last.
    lead: bool,
    /// A `\` was the last.
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

/// What is still due of a UTF-8 sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Utf8Sequence {
    /// How many bytes.
    due: u8,
    /// The range of the next one.
    low: u8,
    high: u8,
}

impl Utf8Sequence {
    const DONE: Self = Self { due: 0, low: 0x80, high: 0xBF };

    /// The state behind this byte; `None` where it is no UTF-8 (RFC 3629: nothing overlong, no surrogates).
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
