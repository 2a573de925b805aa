//! A JSON reader over one frame. It checks the grammar and stores positions; it copies nothing.

use crate::error::{JsonError, JsonFault};
use crate::text::{self, StringFaultKind};
use crate::value::{Kind, Node, Span};

/// The deepest nesting that is read. The deepest frame of the manual has five levels (AddPoints). Only an
/// attacker needs more depth, and a fixed limit keeps the reader's own state fixed.
pub const MAX_DEPTH: usize = 32;

/// A position in a frame, with the steps of the JSON grammar from there.
pub(crate) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    pub fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at }
    }

    pub fn at(&self) -> usize {
        self.at
    }

    /// Moves to this offset.
    pub fn go_to(&mut self, at: usize) {
        self.at = at;
    }

    /// Whether the next byte is this one.
    pub fn stands_at(&self, byte: u8) -> bool {
        self.peek() == Some(byte)
    }

    #[inline]
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    #[inline]
    pub fn skip_blank(&mut self) {
        while let Some(b' ' | b'\n' | b'\r' | b'\t') = self.peek() {
            self.at += 1;
        }
    }

    fn fault(&self, fault: JsonFault) -> JsonError {
        JsonError { at: self.at, found: self.peek(), fault }
    }

    #[inline]
    fn expect(&mut self, byte: u8, wanted: &'static str) -> Result<(), JsonError> {
        if self.peek() == Some(byte) {
            self.at += 1;
            Ok(())
        } else {
            Err(self.fault(JsonFault::Expected(wanted)))
        }
    }

    /// Enters an object by reading its `{`.
    pub fn open_object(&mut self) -> Result<(), JsonError> {
        self.skip_blank();
        self.expect(b'{', "an object, beginning with `{`")
    }

    /// Enters a list by reading its `[`.
    pub fn open_list(&mut self) -> Result<(), JsonError> {
        self.skip_blank();
        self.expect(b'[', "a list, beginning with `[`")
    }

    /// Reads the next key of an open object and stops at its value. Reads the `}` and returns `None` at the
    /// end.
    ///
    /// `first` says that no member was read yet.
    pub fn next_key(&mut self, first: bool) -> Result<Option<Node>, JsonError> {
        self.skip_blank();
        if self.peek() == Some(b'}') {
            self.at += 1;
            return Ok(None);
        }
        if !first {
            self.expect(b',', "`,` or `}`")?;
            self.skip_blank();
        }
        if self.peek() != Some(b'"') {
            return Err(self.fault(JsonFault::Expected("a key in double quotes")));
        }
        let key = self.string()?;
        self.skip_blank();
        if self.peek() != Some(b':') {
            let key = String::from_utf8_lossy(key.span.of(self.bytes)).chars().take(32).collect();
            return Err(self.fault(JsonFault::KeyWithoutValue(key)));
        }
        self.at += 1;
        self.skip_blank();
        Ok(Some(key))
    }

    /// Whether an open list has another item; stops at that item. Reads the `]` and returns `false` at the
    /// end.
    pub fn next_element(&mut self, first: bool) -> Result<bool, JsonError> {
        self.skip_blank();
        if self.peek() == Some(b']') {
            self.at += 1;
            return Ok(false);
        }
        if !first {
            self.expect(b',', "`,` or `]`")?;
            self.skip_blank();
        }
        Ok(true)
    }

    /// Returns the next item of a list that was checked before, wherever in the list the cursor stands.
    pub fn next_item(&mut self) -> Result<Option<Node>, JsonError> {
        self.skip_blank();
        if self.peek() == Some(b',') {
            self.at += 1;
            self.skip_blank();
        }
        if matches!(self.peek(), Some(b']') | None) {
            return Ok(None);
        }
        self.value().map(Some)
    }

    /// Checks that only blanks follow.
    pub fn end(&mut self) -> Result<(), JsonError> {
        self.skip_blank();
        if self.at == self.bytes.len() {
            Ok(())
        } else {
            Err(self.fault(JsonFault::Expected("nothing more")))
        }
    }

    /// Reads one value of any kind, checks it completely and stops after it.
    #[inline]
    pub fn value(&mut self) -> Result<Node, JsonError> {
        let start = self.at;
        match self.peek() {
            Some(b'"') => self.string(),
            Some(b'-' | b'0'..=b'9') => self.number(),
            Some(b'{') => self.skip_nested().map(|()| self.node(start, Kind::Object)),
            Some(b'[') => self.skip_nested().map(|()| self.node(start, Kind::List)),
            _ => self.literal(),
        }
    }

    fn node(&self, start: usize, kind: Kind) -> Node {
        Node { span: Span::new(start, self.at), kind }
    }

    #[inline]
    fn string(&mut self) -> Result<Node, JsonError> {
        let start = self.at + 1;
        match text::scan_string(self.bytes, start) {
            Ok(end) => {
                self.at = end.end + 1;
                Ok(Node {
                    span: Span::new(start, end.end),
                    kind: Kind::Text { has_escape: end.has_escape, utf8: end.utf8 },
                })
            }
            Err(fault) => {
                self.at = fault.at;
                Err(self.fault(match fault.kind {
                    StringFaultKind::Unterminated => JsonFault::StringNotClosed,
                    StringFaultKind::ControlByte(_) => JsonFault::ControlByteInString,
                    StringFaultKind::BadEscape => JsonFault::BadEscape,
                }))
            }
        }
    }

    #[inline]
    fn digits(&mut self) -> Result<(), JsonError> {
        let start = self.at;
        while let Some(b'0'..=b'9') = self.peek() {
            self.at += 1;
        }
        if self.at == start { Err(self.fault(JsonFault::Expected("a digit"))) } else { Ok(()) }
    }

    fn number(&mut self) -> Result<Node, JsonError> {
        let start = self.at;
        if self.peek() == Some(b'-') {
            self.at += 1;
        }
        if self.peek() == Some(b'0') {
            self.at += 1;
        } else {
            self.digits()?;
        }
        if self.peek() == Some(b'.') {
            self.at += 1;
            self.digits()?;
        }
        let has_exponent = matches!(self.peek(), Some(b'e' | b'E'));
        if has_exponent {
            self.at += 1;
            if let Some(b'+' | b'-') = self.peek() {
                self.at += 1;
            }
            self.digits()?;
        }
        // No reader accepts a number that does not fit in a double. Without an exponent such a number has
        // over 300 digits.
        if has_exponent || self.at - start > 300 {
            let text = self.bytes.get(start..self.at).and_then(|text| std::str::from_utf8(text).ok());
            let finite = text.and_then(|text| text.parse::<f64>().ok()).is_some_and(f64::is_finite);
            if !finite {
                self.at = start;
                return Err(self.fault(JsonFault::NumberOutOfRange));
            }
        }
        Ok(self.node(start, Kind::Number))
    }

    fn literal(&mut self) -> Result<Node, JsonError> {
        let start = self.at;
        let rest = self.bytes.get(start..).unwrap_or_default();
        let known: [(&[u8], Kind); 3] =
            [(b"true", Kind::True), (b"false", Kind::False), (b"null", Kind::Null)];
        for (word, kind) in known {
            if rest.starts_with(word) {
                self.at = start + word.len();
                return Ok(self.node(start, kind));
            }
        }
        Err(self.fault(JsonFault::Expected("a value")))
    }

    /// Checks an object or a list and everything in it, without recursion.
    fn skip_nested(&mut self) -> Result<(), JsonError> {
        // One bit for each level; a set bit means an object.
        let mut objects: u64 = 0;
        let mut depth = 0_usize;
        // Whether no member of the current level was read yet.
        let mut first;
        loop {
            // At this point the cursor stands at a value.
            match self.peek() {
                Some(open @ (b'{' | b'[')) => {
                    depth += 1;
                    if depth > MAX_DEPTH {
                        return Err(self.fault(JsonFault::TooDeep));
                    }
                    objects = objects << 1 | u64::from(open == b'{');
                    self.at += 1;
                    first = true;
                }
                _ => {
                    self.value()?;
                    first = false;
                }
            }
            // Closes every level that ends here, then stops at the next value.
            loop {
                let more = if objects & 1 == 1 {
                    self.next_key(first)?.is_some()
                } else {
                    self.next_element(first)?
                };
                if more {
                    break;
                }
                depth -= 1;
                objects >>= 1;
                first = false;
                if depth == 0 {
                    return Ok(());
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn accepts(json: &str) -> bool {
        let mut cursor = Cursor::new(json.as_bytes(), 0);
        cursor.skip_blank();
        cursor.value().and_then(|_| cursor.end()).is_ok()
    }

    #[test]
    fn the_grammar_is_that_of_json() {
        let good = [
            "{}",
            "[]",
            "[[]]",
            "{\"a\":{}}",
            " [ 1 , -0.5e+3 , null ] ",
            "{\"a\":1,\"b\":[true,false]}",
            "\"\"",
        ];
        let bad = [
            "{",
            "[1,]",
            "{\"a\":1,}",
            "{a:1}",
            "{\"a\"}",
            "{\"a\",}",
            "01",
            "1.",
            "-",
            "+1",
            "1e",
            "nul",
            "[1 2]",
            "{\"a\":1]",
            "[}",
            "1e999",
            "{,}",
            "[,]",
            "{\"a\"::1}",
            "\u{feff}{}",
        ];
        for json in good {
            assert!(accepts(json), "{json}");
            assert!(serde_json::from_str::<serde_json::Value>(json).is_ok(), "{json}");
        }
        for json in bad {
            assert!(!accepts(json), "{json}");
            assert!(serde_json::from_str::<serde_json::Value>(json).is_err(), "{json}");
        }
    }

    #[test]
    fn depth_ends_at_the_limit() {
        let nested = |depth: usize| format!("{}{}", "[".repeat(depth), "]".repeat(depth));
        assert!(accepts(&nested(MAX_DEPTH)));
        let too_deep = nested(MAX_DEPTH + 1);
        let error = Cursor::new(too_deep.as_bytes(), 0).value().unwrap_err();
        assert_eq!((error.at, error.fault), (MAX_DEPTH, JsonFault::TooDeep));
    }

    #[test]
    fn an_error_says_where_and_what_was_due() {
        let json = "{\"ckStatus\", \"speed\":\"80.0\"}";
        let error = Cursor::new(json.as_bytes(), 0).value().unwrap_err();
        assert_eq!(error.to_string(), "key `ckStatus` has no value: `:` was due at byte 11, found `,`");
    }
}
