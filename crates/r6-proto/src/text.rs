//! Strings inside a frame: where a string ends, and its text, in UTF-8 or in GBK.
//!
//! Old firmware sends names in GBK. The second byte of a GBK character may be `\` (0x5C), `[`, `]`, `{` or
//! `}`. Nothing announces the encoding, so one rule decides it for each string. The bytes are UTF-8 as long
//! as they are valid UTF-8. At the first invalid byte the whole string becomes GBK, and its escapes are read
//! again as GBK. A quote before that byte stays inside the string: in a GBK frame only ASCII can stand
//! between a closing quote and the next opening quote, so such a quote cannot have closed the string. With
//! this rule every search takes one pass, whatever the bytes are.

use std::borrow::Cow;

use encoding_rs::GB18030;

use crate::sixteen_bytes::{CHUNK, Chunk};

mod state;

pub use state::{Progress, StringState};
use state::{is_gbk_lead, is_gbk_trail};

/// What is known about a string after its closing quote was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StringEnd {
    /// Offset of the closing quote in the scanned bytes.
    pub end: usize,
    /// Whether the string contains an escape.
    pub has_escape: bool,
    /// Whether every byte is ASCII.
    pub ascii: bool,
    /// Whether the bytes are UTF-8; otherwise they are GBK.
    pub utf8: bool,
}

/// Why bytes are not a JSON string.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StringFault {
    /// Offset of the wrong byte in the scanned bytes; their length if the closing quote is missing.
    pub at: usize,
    /// What is wrong there.
    pub kind: StringFaultKind,
}

/// The faults inside a string.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StringFaultKind {
    /// The bytes end before the closing quote.
    Unterminated,
    /// A raw byte below 0x20, which JSON allows only escaped.
    ControlByte(u8),
    /// A `\` that does not begin a JSON escape, or half of a surrogate pair.
    BadEscape,
}

/// Finds the end of the string whose first byte after the opening quote is at `start`, and checks its
/// escapes.
///
/// For UTF-8 it accepts exactly what `serde_json` accepts.
///
/// # Errors
/// The first fault of the string, in the encoding that the rule gives it.
#[inline]
pub fn scan_string(bytes: &[u8], start: usize) -> Result<StringEnd, StringFault> {
    let mut at = start;
    let mut has_escape = false;
    loop {
        at = plain_end(bytes, at);
        match bytes.get(at) {
            Some(b'"') => return Ok(StringEnd { end: at, has_escape, ascii: true, utf8: true }),
            Some(b'\\') => {
                at += escape_length(bytes, at)?;
                has_escape = true;
            }
            Some(0x80..) => return scan_beyond_ascii(bytes, start),
            Some(&byte) => return Err(StringFault { at, kind: StringFaultKind::ControlByte(byte) }),
            None => return Err(StringFault { at: bytes.len(), kind: StringFaultKind::Unterminated }),
        }
    }
}

/// The same for a string with a non-ASCII byte: first the end and the encoding, then the escapes.
fn scan_beyond_ascii(bytes: &[u8], start: usize) -> Result<StringEnd, StringFault> {
    let mut state = StringState::default();
    let end = match state.advance(bytes, start) {
        Progress::Closed(quote) => quote,
        Progress::ControlByte(at, byte) => {
            return Err(StringFault { at, kind: StringFaultKind::ControlByte(byte) });
        }
        Progress::Open => return Err(StringFault { at: bytes.len(), kind: StringFaultKind::Unterminated }),
    };
    let utf8 = state.is_utf8();
    let body = bytes.get(..end).unwrap_or_default();
    let mut has_escape = false;
    let mut at = start;
    while let Some(escape) = next_escape(body, at, utf8) {
        has_escape = true;
        at = escape + escape_length(body, escape)?;
    }
    Ok(StringEnd { end, has_escape, ascii: false, utf8 })
}

/// Returns the text of a string. `body` is the part between its quotes; `end` is the result of
/// [`scan_string`].
///
/// It never fails: bytes that are not a character become U+FFFD. Plain UTF-8 is not copied. Of `end`, only
/// the encoding and the presence of escapes are used.
#[must_use]
pub fn unescape<'a>(body: &'a [u8], end: &StringEnd) -> Cow<'a, str> {
    if !end.has_escape {
        return decode(body, end.utf8);
    }
    let mut text = String::with_capacity(body.len());
    let mut at = 0;
    while let Some(escape) = next_escape(body, at, end.utf8) {
        text.push_str(&decode(body.get(at..escape).unwrap_or_default(), end.utf8));
        let (character, length) = escape_at(body, escape).unwrap_or((char::REPLACEMENT_CHARACTER, 1));
        text.push(character);
        at = escape + length;
    }
    text.push_str(&decode(body.get(at..).unwrap_or_default(), end.utf8));
    Cow::Owned(text)
}

/// Appends the text as a compact JSON string in quotes, in UTF-8, with only the escapes that JSON requires.
pub fn write_escaped(out: &mut Vec<u8>, text: &str) {
    out.push(b'"');
    let mut rest = text.as_bytes();
    let first = Chunk::at(rest, 0);
    if first.plain() == rest.len() {
        // Numbers of frames and most words take this path: one copy of known length.
        let end = out.len() + rest.len();
        out.extend_from_slice(&first.bits().to_le_bytes());
        out.truncate(end);
        out.push(b'"');
        return;
    }
    if plain_end(rest, 0) == rest.len() {
        out.extend_from_slice(rest);
        out.push(b'"');
        return;
    }
    while let Some(special) = rest.iter().position(|byte| matches!(byte, 0..0x20 | b'"' | b'\\')) {
        let (plain, from_special) = rest.split_at(special);
        out.extend_from_slice(plain);
        let Some((&byte, behind)) = from_special.split_first() else { break };
        match byte {
            b'"' | b'\\' => out.extend_from_slice(&[b'\\', byte]),
            0x08 => out.extend_from_slice(b"\\b"),
            0x0C => out.extend_from_slice(b"\\f"),
            b'\n' => out.extend_from_slice(b"\\n"),
            b'\r' => out.extend_from_slice(b"\\r"),
            b'\t' => out.extend_from_slice(b"\\t"),
            _ => {
                out.extend_from_slice(b"\\u00");
                out.extend(
                    [byte >> 4, byte & 0x0F].map(|digit| digit + if digit < 10 { b'0' } else { b'a' - 10 }),
                );
            }
        }
        rest = behind;
    }
    out.extend_from_slice(rest);
    out.push(b'"');
}

/// The offset of the first byte from `from` on that is not plain: a quote, a `\`, a control byte or a
/// non-ASCII byte.
#[inline]
pub(crate) fn plain_end(bytes: &[u8], from: usize) -> usize {
    let mut at = from;
    while at < bytes.len() {
        // The bytes after the end read as zeros, which are not plain.
        let plain = Chunk::at(bytes, at).plain();
        at += plain;
        if plain < CHUNK {
            return at;
        }
    }
    at
}

/// The next `\` from `from` on that begins an escape. In GBK, a `\` that is a second byte does not count.
fn next_escape(body: &[u8], from: usize, utf8: bool) -> Option<usize> {
    let mut lead = false;
    body.iter().enumerate().skip(from).find_map(|(at, &byte)| {
        let trail = std::mem::replace(&mut lead, false) && is_gbk_trail(byte);
        lead = !utf8 && !trail && is_gbk_lead(byte);
        (byte == b'\\' && !trail).then_some(at)
    })
}

/// Length in bytes of the escape at `at`. A surrogate pair counts as one escape.
fn escape_length(bytes: &[u8], at: usize) -> Result<usize, StringFault> {
    match escape_at(bytes, at) {
        Some((_, length)) => Ok(length),
        None if at + 1 >= bytes.len() => {
            Err(StringFault { at: bytes.len(), kind: StringFaultKind::Unterminated })
        }
        None => Err(StringFault { at, kind: StringFaultKind::BadEscape }),
    }
}

/// The character of the escape at `at`, and the length of the escape in bytes.
fn escape_at(bytes: &[u8], at: usize) -> Option<(char, usize)> {
    let character = match bytes.get(at + 1)? {
        b'"' => '"',
        b'\\' => '\\',
        b'/' => '/',
        b'b' => '\u{8}',
        b'f' => '\u{c}',
        b'n' => '\n',
        b'r' => '\r',
        b't' => '\t',
        b'u' => {
            let unit = hex_unit(bytes, at)?;
            let high = u32::from(unit);
            if !(0xD800..0xDC00).contains(&high) {
                return char::from_u32(high).map(|character| (character, 6));
            }
            let low = u32::from(hex_unit(bytes, at + 6)?).checked_sub(0xDC00).filter(|low| *low < 0x400)?;
            return char::from_u32(0x1_0000 + ((high - 0xD800) << 10) + low).map(|character| (character, 12));
        }
        _ => return None,
    };
    Some((character, 2))
}

/// The number in `\uXXXX` at `at`.
fn hex_unit(bytes: &[u8], at: usize) -> Option<u16> {
    let digits = bytes.get(at..at + 6)?.strip_prefix(b"\\u")?;
    digits.iter().try_fold(0, |unit, &digit| {
        let digit = char::from(digit).to_digit(16)?;
        Some(unit << 4 | u16::try_from(digit).ok()?)
    })
}

fn decode(bytes: &[u8], utf8: bool) -> Cow<'_, str> {
    if utf8 { String::from_utf8_lossy(bytes) } else { GB18030.decode_without_bom_handling(bytes).0 }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The text of the string literal at the beginning of the bytes.
    fn text_of(literal: &[u8]) -> Result<String, StringFault> {
        let end = scan_string(literal, 1)?;
        Ok(unescape(&literal[1..end.end], &end).into_owned())
    }

    /// Implements the module's rule literally: the encoding by the standard library's UTF-8 check, then one
    /// walk.
    fn end_by_the_rule(body: &[u8]) -> Option<(usize, bool)> {
        let end = |gbk: bool, not_before: usize| {
            let mut at = 0;
            while at < body.len() {
                let pair =
                    gbk && is_gbk_lead(body[at]) && body.get(at + 1).is_some_and(|next| is_gbk_trail(*next));
                match body[at] {
                    b'"' if at >= not_before => return Some(at),
                    b'\\' if body.get(at + 1).is_some_and(u8::is_ascii) => at += 2,
                    _ => at += if pair { 2 } else { 1 },
                }
            }
            None
        };
        let valid = std::str::from_utf8(body).map_or_else(|error| error.valid_up_to(), |_| body.len());
        match end(false, 0) {
            Some(quote) if quote < valid => Some((quote, true)),
            _ => end(true, valid).map(|quote| (quote, false)),
        }
    }

    #[test]
    fn texts_of_any_length_are_escaped_as_serde_json_does() {
        let written = |text: &str| {
            let mut out = b"before".to_vec();
            write_escaped(&mut out, text);
            String::from_utf8(out).unwrap()
        };
        for length in 0..=33 {
            let plain: String = ('a'..='z').cycle().take(length).collect();
            assert_eq!(written(&plain), format!("before\"{plain}\""));
            for special in ["\"", "\\", "\0", "\u{1f}", "é"] {
                for at in 0..=length {
                    let mut text = plain.clone();
                    text.insert_str(at, special);
                    assert_eq!(written(&text), format!("before{}", serde_json::to_string(&text).unwrap()));
                }
            }
        }
    }

    #[test]
    fn a_gbk_character_may_end_in_a_backslash_or_a_brace() {
        // 乗 is 81 5C and 亄 is 81 7B, but 亇 is not 81 7D, so the pairs are given as bytes.
        for (trail, known) in [(0x5C, Some('乗')), (0x5B, None), (0x5D, None), (0x7B, None), (0x7D, None)] {
            let literal = [b'"', b'a', 0x81, trail, b'"', b',', b'"'];
            let end = scan_string(&literal, 1).unwrap();
            assert_eq!(
                end,
                StringEnd { end: 4, has_escape: false, ascii: false, utf8: false },
                "{trail:02X}"
            );
            let text = text_of(&literal).unwrap();
            assert_eq!(text.chars().count(), 2, "{text}");
            assert!(!text.contains('\u{FFFD}'), "{text}");
            if let Some(known) = known {
                assert_eq!(text, format!("a{known}"));
            }
        }
    }

    #[test]
    fn an_escape_in_gbk_is_resolved_beside_a_trail_that_looks_like_one() {
        assert_eq!(text_of(b"\"\x81\x5C\\\"\\u4e58\xD6\xD0\"").unwrap(), "乗\"乘中");
        assert_eq!(text_of(b"\"\xBC\xC6\xCA\xFD\xC6\xF7[0]\"").unwrap(), "计数器[0]");
    }

    #[test]
    fn a_lone_lead_byte_stands_alone() {
        // 0xFF is not a lead byte, and 0x81 does not take a quote as its second byte.
        assert_eq!(text_of(b"\"\xFF\\n\"").unwrap(), "\u{FFFD}\n");
        assert_eq!(text_of(b"\"\x81\"").unwrap(), "\u{FFFD}");
    }

    #[test]
    fn a_quote_passed_before_the_first_byte_of_gbk_stays_inside() {
        // Up to 0xFF this is UTF-8 with escaped quotes. In GBK the `\\` are second bytes.
        let literal = "\"中\\\"中\\\"".as_bytes();
        let literal = [literal, b"\xFF\""].concat();
        assert_eq!(scan_string(&literal, 1).unwrap().end, literal.len() - 1);
    }

    #[test]
    fn utf8_is_told_from_gbk_as_the_standard_library_tells_it() {
        for first in 0x80..=0xFF {
            for second in 0x80..=0xFF {
                for length in 1..=4 {
                    let literal = [&[first, second, 0x80, 0x80][..length], b"\""].concat();
                    let end = scan_string(&literal, 0).unwrap();
                    let body = &literal[..length];
                    assert_eq!(end.utf8, std::str::from_utf8(body).is_ok(), "{}", body.escape_ascii());
                    assert_eq!(end.end, length);
                }
            }
        }
    }

    #[test]
    fn faults_are_named_where_they_stand() {
        let cases: [(&[u8], usize, StringFaultKind); 8] = [
            (b"\"abc", 4, StringFaultKind::Unterminated),
            (b"\"abc\\", 5, StringFaultKind::Unterminated),
            (b"\"a\nb\"", 2, StringFaultKind::ControlByte(b'\n')),
            (b"\"a\xFFb\0c\"", 4, StringFaultKind::ControlByte(0)),
            (b"\"a\\x\"", 2, StringFaultKind::BadEscape),
            (b"\"a\\u12G4\"", 2, StringFaultKind::BadEscape),
            (b"\"\\ud83d\"", 1, StringFaultKind::BadEscape),
            (b"\"\\ud83d\\u0041\"", 1, StringFaultKind::BadEscape),
        ];
        for (literal, at, kind) in cases {
            assert_eq!(scan_string(literal, 1), Err(StringFault { at, kind }), "{}", literal.escape_ascii());
        }
    }

    #[test]
    fn plain_text_is_borrowed() {
        for literal in ["\"curMode\"", "\"计数器\""] {
            let end = scan_string(literal.as_bytes(), 1).unwrap();
            let body = &literal.as_bytes()[1..end.end];
            assert!(matches!(unescape(body, &end), Cow::Borrowed(text) if text.as_bytes() == body));
        }
    }

    /// Bytes that often matter inside a string.
    fn hostile() -> impl Strategy<Value = Vec<u8>> {
        const TEXTS: [&str; 10] = [
            "中",
            "é",
            "😀",
            r"\ud83d",
            r"\ude00",
            r"\udbff\udfff",
            r"\udc00",
            r"\u00e9",
            r#"\""#,
            "plain text",
        ];
        // Each of these ends or breaks a sequence at a border of valid UTF-8.
        const SPOILED: [&[u8]; 8] =
            [b"\xC1", b"\xE0\x9F", b"\xED\xA0", b"\xF0\x8F", b"\xF4\x90", b"\xF5", b"\xE4\xB8", b"\x81\x5C"];
        let piece = prop_oneof![
            4 => prop::sample::select(b"\"\\unb/dD8c0a {}[]".to_vec()).prop_map(|byte| vec![byte]),
            2 => prop::sample::select(b"\x81\xFE\xFF\x80\xBF\xAD\x7F".to_vec()).prop_map(|byte| vec![byte]),
            2 => prop::sample::select(TEXTS.to_vec()).prop_map(|text| text.as_bytes().to_vec()),
            1 => prop::sample::select(SPOILED.to_vec()).prop_map(<[u8]>::to_vec),
            1 => any::<u8>().prop_map(|byte| vec![byte]),
        ];
        prop::collection::vec(piece, 0..24).prop_map(|pieces| pieces.concat())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn utf8_is_accepted_and_read_as_serde_json_does(body in hostile()) {
            let body: String = String::from_utf8_lossy(&body).into_owned();
            let literal = format!("\"{body}");
            let mut values = serde_json::Deserializer::from_str(&literal).into_iter::<serde_json::Value>();
            match (text_of(literal.as_bytes()), values.next()) {
                (Ok(ours), Some(Ok(serde_json::Value::String(theirs)))) => {
                    prop_assert_eq!(ours, theirs);
                    prop_assert_eq!(scan_string(literal.as_bytes(), 1).map(|end| end.end + 1), Ok(values.byte_offset()));
                }
                (Err(_), Some(Err(_))) => {}
                (ours, theirs) => prop_assert!(false, "{ours:?} but {theirs:?}"),
            }
        }

        #[test]
        fn any_split_finds_the_same_end(body in hostile(), cuts in prop::collection::vec(0_usize..64, 0..6)) {
            let mut whole = StringState::default();
            let expected = whole.advance(&body, 0);
            let mut cuts: Vec<usize> = cuts.into_iter().map(|cut| cut.min(body.len())).collect();
            cuts.push(body.len());
            cuts.sort_unstable();
            let mut pieces = StringState::default();
            let mut from = 0;
            let mut found = Progress::Open;
            for cut in cuts {
                found = pieces.advance(&body[..cut], from);
                from = cut;
                if found != Progress::Open {
                    break;
                }
            }
            prop_assert_eq!(found, expected);
            prop_assert_eq!(pieces, whole);
        }

        #[test]
        fn the_end_is_that_of_the_rule(body in hostile()) {
            let body: Vec<u8> = body.into_iter().map(|byte| byte.max(0x20)).collect();
            let mut state = StringState::default();
            let found = match state.advance(&body, 0) {
                Progress::Closed(quote) => Some((quote, state.is_utf8())),
                Progress::Open => None,
                Progress::ControlByte(..) => return Err(TestCaseError::fail("there is no control byte")),
            };
            prop_assert_eq!(found, end_by_the_rule(&body));
            if let Ok(end) = scan_string(&body, 0) {
                prop_assert_eq!(Some((end.end, end.utf8)), found);
                prop_assert_eq!(end.ascii, body[..end.end].is_ascii());
            }
        }

        #[test]
        fn texts_are_written_as_serde_json_writes_them(text in any::<String>()) {
            let mut out = Vec::new();
            write_escaped(&mut out, &text);
            prop_assert_eq!(String::from_utf8(out.clone()).ok(), serde_json::to_string(&text).ok());
            prop_assert_eq!(text_of(&out), Ok(text));
        }

        #[test]
        fn no_bytes_are_beyond_reading(body in hostile(), has_escape: bool, ascii: bool, utf8: bool) {
            let end = StringEnd { end: body.len(), has_escape, ascii, utf8 };
            prop_assert!(unescape(&body, &end).len() <= body.len() * 3);
        }
    }
}
