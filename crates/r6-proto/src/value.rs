//! Views of JSON values inside a frame. Nothing is copied before a caller asks for it.

use std::borrow::Cow;
use std::fmt;

use crate::address::Address;
use crate::text::{self, StringEnd};

mod decimal;

use decimal::Decimal;

/// A stretch of a frame, as byte offsets.
///
/// Offsets are 32 bits: a frame is at most [`crate::frame::Limits`] long, far below 4 GiB.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    pub start: u32,
    pub end: u32,
}

impl Span {
    pub fn new(start: usize, end: usize) -> Self {
        Self { start: clamp(start), end: clamp(end) }
    }

    pub fn of(self, bytes: &[u8]) -> &[u8] {
        bytes.get(self.start as usize..self.end as usize).unwrap_or_default()
    }

    /// The same stretch with its distance behind `from` turned into its distance behind `to`.
    #[inline]
    pub fn moved(self, from: usize, to: usize) -> Self {
        let moved = |place: u32| (place as usize + to).saturating_sub(from);
        Self::new(moved(self.start), moved(self.end))
    }
}

fn clamp(offset: usize) -> u32 {
    u32::try_from(offset).unwrap_or(u32::MAX)
}

/// The kind of the value at a span.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A string; the span is its body without the quotes.
    Text {
        has_escape: bool,
        utf8: bool,
    },
    Number,
    True,
    False,
    Null,
    /// A list; the span includes the brackets.
    List,
    /// An object; the span includes the braces.
    Object,
}

/// One JSON value of a frame, by position: it lives in the decoder's reused buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Node {
    pub span: Span,
    pub kind: Kind,
}

impl Node {
    /// A null value at the beginning of a frame.
    pub const NULL: Self = Self { span: Span { start: 0, end: 0 }, kind: Kind::Null };
}

/// One JSON value of a frame, borrowed from the frame's bytes.
///
/// Numbers and texts are distinct kinds, but every reading method accepts both, because controllers quote
/// values that clients do not quote, and the reverse.
#[derive(Clone, Copy)]
pub struct Value<'a> {
    pub(crate) bytes: &'a [u8],
    pub(crate) node: Node,
}

impl<'a> Value<'a> {
    pub(crate) fn new(bytes: &'a [u8], node: Node) -> Self {
        Self { bytes, node }
    }

    fn body(&self) -> &'a [u8] {
        self.node.span.of(self.bytes)
    }

    /// The value as text. A string is unescaped, and decoded from GBK if it is not UTF-8. Any other value is
    /// returned as written.
    #[must_use]
    pub fn text(&self) -> Cow<'a, str> {
        match self.node.kind {
            Kind::Text { has_escape, utf8 } => {
                let body = self.body();
                text::unescape(body, &StringEnd { end: body.len(), has_escape, ascii: false, utf8 })
            }
            Kind::Number | Kind::True | Kind::False | Kind::Null | Kind::List | Kind::Object => {
                String::from_utf8_lossy(self.body())
            }
        }
    }

    /// The bytes of a string with its escapes resolved, or of a number. Words of the protocol are compared by
    /// these bytes.
    pub(crate) fn word(&self) -> Cow<'a, [u8]> {
        match self.node.kind {
            Kind::Text { has_escape: true, .. } => Cow::Owned(self.text().into_owned().into_bytes()),
            Kind::Text { has_escape: false, .. }
            | Kind::Number
            | Kind::True
            | Kind::False
            | Kind::Null
            | Kind::List
            | Kind::Object => Cow::Borrowed(self.body()),
        }
    }

    /// The address with exactly this name, for a text without escapes.
    #[inline]
    pub(crate) fn address(&self) -> Option<Address> {
        match self.node.kind {
            Kind::Text { has_escape: false, .. } => Address::exact(self.node.span.of(self.bytes)),
            Kind::Text { has_escape: true, .. }
            | Kind::Number
            | Kind::True
            | Kind::False
            | Kind::Null
            | Kind::List
            | Kind::Object => None,
        }
    }

    /// Whether this is a JSON string.
    #[must_use]
    pub fn is_text(&self) -> bool {
        matches!(self.node.kind, Kind::Text { .. })
    }

    /// Whether this is a JSON number.
    #[must_use]
    pub fn is_number(&self) -> bool {
        self.node.kind == Kind::Number
    }

    /// Whether this is a JSON list.
    #[must_use]
    pub fn is_list(&self) -> bool {
        self.node.kind == Kind::List
    }

    /// The text or number as a plain decimal. Nearly every number is one.
    #[inline]
    fn decimal(&self) -> Option<Decimal> {
        Decimal::read(self.bytes, self.node.span.start as usize, self.node.span.end as usize)
    }

    /// A finite decimal number, quoted or not; `None` for anything else (`NaN`, `1,5`, an empty text, a
    /// list).
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self.node.kind {
            Kind::Text { .. } | Kind::Number => match self.decimal().and_then(Decimal::number) {
                Some(number) => Some(number),
                None => parse_number(&self.word()),
            },
            Kind::True | Kind::False | Kind::Null | Kind::List | Kind::Object => None,
        }
    }

    /// A whole number, quoted or not; `1.000` counts as whole, `1.5` does not.
    #[must_use]
    pub fn integer(&self) -> Option<i64> {
        match self.node.kind {
            Kind::Text { .. } | Kind::Number => match self.decimal().and_then(Decimal::integer) {
                Some(integer) => Some(integer),
                None => parse_integer(&self.word()),
            },
            Kind::True | Kind::False | Kind::Null | Kind::List | Kind::Object => None,
        }
    }

    /// A flag: 1 or 0, quoted or not, or a JSON true or false.
    #[must_use]
    pub fn flag(&self) -> Option<bool> {
        match self.node.kind {
            Kind::True => Some(true),
            Kind::False => Some(false),
            Kind::Text { .. } | Kind::Number => match self.integer() {
                Some(1) => Some(true),
                Some(0) => Some(false),
                Some(_) | None => None,
            },
            Kind::Null | Kind::List | Kind::Object => None,
        }
    }

    /// The members of a list; empty for any other value.
    #[must_use]
    pub fn items(&self) -> Items<'a> {
        let at = if self.is_list() { self.node.span.start as usize + 1 } else { usize::MAX };
        Items { bytes: self.bytes, at }
    }

    /// The value exactly as on the wire, including quotes.
    #[must_use]
    pub fn wire(&self) -> &'a [u8] {
        match self.node.kind {
            Kind::Text { .. } => {
                let (start, end) = (self.node.span.start as usize, self.node.span.end as usize);
                self.bytes.get(start.wrapping_sub(1)..end + 1).unwrap_or_default()
            }
            Kind::Number | Kind::True | Kind::False | Kind::Null | Kind::List | Kind::Object => self.body(),
        }
    }

    /// Position of the value, in bytes from the start of its frame.
    #[must_use]
    pub fn offset(&self) -> usize {
        self.node.span.start as usize
    }
}

impl fmt::Debug for Value<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&String::from_utf8_lossy(self.wire()))
    }
}

/// The longest number text that is read. A longer text is not a measurement, and parsing it costs time.
const LONGEST_NUMBER: usize = 64;

fn parse_number(body: &[u8]) -> Option<f64> {
    let body = body.trim_ascii();
    if let Some(number) = parse_plain_decimal(body) {
        return Some(number);
    }
    if body.is_empty() || body.len() > LONGEST_NUMBER {
        return None;
    }
    let shaped = body.iter().all(|byte| matches!(byte, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E'));
    let text = std::str::from_utf8(body).ok().filter(|_| shaped)?;
    text.parse().ok().filter(|number: &f64| number.is_finite())
}

/// Reads at most 15 digits with at most one point, the form that controllers and clients write; `None` for
/// anything else.
///
/// The result is exact: such digits and their power of ten are whole numbers that fit in a double, and one
/// division rounds once.
fn parse_plain_decimal(body: &[u8]) -> Option<f64> {
    const POWERS: [f64; 16] =
        [1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
    const MOST_DIGITS: usize = 15;
    let unsigned = body.strip_prefix(b"-").unwrap_or(body);
    if unsigned.len() > MOST_DIGITS + 1 {
        return None;
    }
    let (mut mantissa, mut digits, mut decimals) = (0_u64, 0, None);
    for byte in unsigned {
        match (byte, decimals) {
            (b'0'..=b'9', _) => {
                mantissa = mantissa * 10 + u64::from(byte - b'0');
                digits += 1;
                decimals = decimals.map(|count| count + 1);
            }
            (b'.', None) => decimals = Some(0),
            (_, _) => return None,
        }
    }
    let number = mantissa as f64 / POWERS.get(decimals.unwrap_or(0))?;
    (1..=MOST_DIGITS).contains(&digits).then_some(if unsigned.len() < body.len() { -number } else { number })
}

fn parse_integer(body: &[u8]) -> Option<i64> {
    let body = body.trim_ascii();
    if let Some(integer) = std::str::from_utf8(body).ok().and_then(|text| text.parse().ok()) {
        return Some(integer);
    }
    // 2^53. Up to here a double represents every whole number exactly.
    const EXACT: f64 = 9_007_199_254_740_992.0;
    let number = parse_number(body)?;
    #[expect(clippy::cast_possible_truncation, reason = "whole and within ±2^53: the cast is exact")]
    let integer = (number.fract() == 0.0 && number.abs() <= EXACT).then_some(number as i64);
    integer
}

/// The members of a list, in order. The list was checked when its frame was decoded.
#[derive(Clone)]
pub struct Items<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Iterator for Items<'a> {
    type Item = Value<'a>;

    fn next(&mut self) -> Option<Value<'a>> {
        let mut cursor = crate::json::Cursor::new(self.bytes.get(self.at..).map(|_| self.bytes)?, self.at);
        let node = cursor.next_item().ok().flatten();
        self.at = if node.is_some() { cursor.at() } else { usize::MAX };
        node.map(|node| Value::new(self.bytes, node))
    }
}

/// Several consecutive values, stored by position in the decoder: a query's addresses, a command's words, a
/// reply's data.
#[derive(Clone, Copy)]
pub struct Values<'a> {
    pub(crate) bytes: &'a [u8],
    pub(crate) nodes: &'a [Node],
}

impl<'a> Values<'a> {
    /// No values.
    pub const EMPTY: Self = Self { bytes: &[], nodes: &[] };

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether it is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// The value at this position.
    #[must_use]
    pub fn at(&self, index: usize) -> Option<Value<'a>> {
        self.nodes.get(index).map(|node| Value::new(self.bytes, *node))
    }

    /// All of them, in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Value<'a>> + use<'a> {
        let bytes = self.bytes;
        self.nodes.iter().map(move |node| Value::new(bytes, *node))
    }

    /// The bytes on the wire from the beginning of the first value to the end of the last, without the outer
    /// quotes if these values are texts.
    pub(crate) fn span(&self) -> &'a [u8] {
        let (Some(first), Some(last)) = (self.nodes.first(), self.nodes.last()) else { return &[] };
        self.bytes.get(first.span.start as usize..last.span.end as usize).unwrap_or_default()
    }

    /// All values except the first `n`.
    #[must_use]
    pub fn skip(&self, n: usize) -> Self {
        Self { bytes: self.bytes, nodes: self.nodes.get(n..).unwrap_or_default() }
    }
}

impl fmt::Debug for Values<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::json::Cursor;

    fn value(json: &str) -> Value<'_> {
        let node = Cursor::new(json.as_bytes(), 0).value().unwrap();
        Value::new(json.as_bytes(), node)
    }

    #[test]
    fn numbers_are_read_quoted_or_not() {
        for json in ["1.5", "\"1.5\"", "\" 1.5 \"", "\"+1.5\"", "15e-1"] {
            assert_eq!(value(json).number(), Some(1.5), "{json}");
        }
        for json in ["\"\"", "\"nan\"", "\"inf\"", "\"1,5\"", "\"1e999\"", "[1]", "null", "\"0x3F\""] {
            assert_eq!(value(json).number(), None, "{json}");
        }
    }

    #[test]
    fn whole_numbers_may_have_zero_decimals() {
        assert_eq!(value("\"10.000\"").integer(), Some(10));
        assert_eq!(value("-300000").integer(), Some(-300_000));
        assert_eq!(value("\"10.5\"").integer(), None);
        assert_eq!(value("1e300").integer(), None);
    }

    #[test]
    fn flags_are_one_and_zero() {
        assert_eq!(value("\"1\"").flag(), Some(true));
        assert_eq!(value("0").flag(), Some(false));
        assert_eq!(value("true").flag(), Some(true));
        assert_eq!(value("2").flag(), None);
    }

    #[test]
    fn a_list_is_walked() {
        let list = value("[4, \"a\\\"b\" ,[1,2], {\"x\":[]}]");
        let wires: Vec<_> =
            list.items().map(|item| String::from_utf8_lossy(item.wire()).into_owned()).collect();
        assert_eq!(wires, ["4", "\"a\\\"b\"", "[1,2]", "{\"x\":[]}"]);
        assert_eq!(list.items().nth(1).unwrap().text(), "a\"b");
        assert_eq!(value("[]").items().count(), 0);
        assert_eq!(value("4").items().count(), 0);
    }
}
