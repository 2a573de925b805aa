//! Appends numbers and words, in the form that the wire requires, to the caller's buffer.

use crate::error::EncodeError;
use crate::text;

mod short;

pub(crate) use short::Short;
use short::{append_closed_few, append_fixed};

/// The largest magnitude that can be sent. No coordinate, speed or time of a robot is larger, and with six
/// decimals it still fits a 64-bit integer.
const LARGEST: f64 = 1e9;

/// Appends a whole number.
pub(crate) fn write_integer(out: &mut Vec<u8>, value: i64) {
    if let Some(short) = u32::try_from(value).ok().and_then(Short::of_integer) {
        short.append_to(out);
        return;
    }
    let mut digits = [0_u8; 20];
    let mut rest = value.unsigned_abs();
    let mut used = 0;
    for slot in digits.iter_mut().rev() {
        *slot = b'0' + u8::try_from(rest % 10).unwrap_or(0);
        rest /= 10;
        used += 1;
        if rest == 0 {
            break;
        }
    }
    if value < 0 {
        out.push(b'-');
    }
    out.extend_from_slice(digits.get(digits.len() - used..).unwrap_or_default());
}

/// Appends a whole number and a closing quote.
#[inline]
pub(crate) fn write_closed_integer(out: &mut Vec<u8>, value: i64) {
    match u32::try_from(value) {
        Ok(few @ 0..1_000) => append_closed_few(out, few),
        Ok(_) | Err(_) => {
            write_integer(out, value);
            out.push(b'"');
        }
    }
}

/// Appends a whole number in quotes.
pub(crate) fn write_quoted_integer(out: &mut Vec<u8>, value: i64) {
    out.push(b'"');
    write_closed_integer(out, value);
}

/// How many decimals a number gets: at least `least` (padded with zeros) and at most `most`, which is 3 or 6.
/// More decimals are rounded; [`crate::grid`] has already rejected values that must not be rounded.
#[derive(Clone, Copy)]
pub(crate) struct Decimals {
    pub least: usize,
    pub most: usize,
}

impl Decimals {
    /// A position: 3 decimals as in the manual, up to 6 as controllers answer.
    pub const POSITION: Self = Self { least: 3, most: 6 };
    /// A speed in percent or a time in seconds: 1 decimal as in the manual, up to 3.
    pub const TENTHS: Self = Self { least: 1, most: 3 };
    /// As few decimals as needed, up to 3.
    pub const FEW: Self = Self { least: 0, most: 3 };
    /// Exactly six decimals, as captured controllers answer.
    pub const SIX: Self = Self { least: 6, most: 6 };
}

/// Appends a decimal number, rounded half away from zero; `-0` is written as 0.
///
/// # Errors
/// If the value is not finite or is beyond ±1e9, nothing is written and the error names `field`.
pub(crate) fn write_fixed(
    out: &mut Vec<u8>,
    field: &'static str,
    value: f64,
    decimals: Decimals,
) -> Result<(), EncodeError> {
    write_fixed_behind(out, Short::EMPTY, field, value, decimals, false)
}

/// The same in quotes.
pub(crate) fn write_quoted_fixed(
    out: &mut Vec<u8>,
    field: &'static str,
    value: f64,
    decimals: Decimals,
) -> Result<(), EncodeError> {
    write_fixed_behind(out, const { Short::EMPTY.with(b'"') }, field, value, decimals, true)
}

/// The same after the text `before`, and with a closing quote if `closed` is set. It is inlined, so that the
/// compiler drops the unused half when the caller's `decimals` are constant.
#[inline(always)]
fn write_fixed_behind(
    out: &mut Vec<u8>,
    before: Short,
    field: &'static str,
    value: f64,
    decimals: Decimals,
    closed: bool,
) -> Result<(), EncodeError> {
    let scaled = scaled(field, value, decimals)?;
    if !append_fixed(out, before, scaled, decimals, closed) {
        before.append_to(out);
        write_long_fixed(out, scaled, decimals);
        if closed {
            out.push(b'"');
        }
    }
    Ok(())
}

/// The value in units of its last decimal.
#[inline(always)]
fn scaled(field: &'static str, value: f64, decimals: Decimals) -> Result<i64, EncodeError> {
    // NaN fails this test too.
    if value.abs() <= LARGEST {
        Ok(rounded(value * if decimals.most == 3 { 1e3 } else { 1e6 }))
    } else {
        Err(EncodeError::new(field, "a finite number within ±1e9"))
    }
}

/// Writes a number that is too long for [`append_fixed`], digit by digit.
#[cold]
fn write_long_fixed(out: &mut Vec<u8>, scaled: i64, decimals: Decimals) {
    let magnitude = scaled.unsigned_abs();
    let mut digits = [b'0'; 24];
    let mut rest = magnitude;
    let mut used = 0;
    for slot in digits.iter_mut().rev() {
        if rest == 0 && used > decimals.most {
            break;
        }
        *slot = b'0' + u8::try_from(rest % 10).unwrap_or(0);
        rest /= 10;
        used += 1;
    }
    let (whole, fraction) = digits.split_at(digits.len() - decimals.most);
    let whole = whole.get(whole.len() + decimals.most - used..).unwrap_or_default();
    let mut kept = decimals.most;
    while kept > decimals.least && fraction.get(kept - 1) == Some(&b'0') {
        kept -= 1;
    }
    if scaled < 0 {
        out.push(b'-');
    }
    out.extend_from_slice(whole);
    if kept > 0 {
        out.push(b'.');
        out.extend_from_slice(fraction.get(..kept).unwrap_or_default());
    }
}

/// Rounds a number within ±1e15 to the nearest whole number, halves away from zero. It replaces `round`,
/// which is a function call on most processors.
#[inline]
fn rounded(number: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "at most 1e15, well within 64 bits")]
    let whole = number as i64;
    // Exact: both are below 2^53.
    let rest = number - whole as f64;
    whole + i64::from(rest >= 0.5) - i64::from(rest <= -0.5)
}

/// The key of a member, stored with the punctuation around it.
#[derive(Clone, Copy)]
pub(crate) struct Key {
    name: &'static str,
    /// `,"name":`
    bare: Short,
    /// `,"name":"`
    quoted: Short,
}

impl Key {
    /// A key of at most 11 letters, or 12 if its value has no quotes. Call this only in constants, where a
    /// longer key is a compile error.
    pub const fn of(name: &'static str) -> Self {
        let bare = Short::EMPTY.with(b',').with(b'"').and(name.as_bytes()).with(b'"').with(b':');
        let quoted = if bare.len() < Short::MOST { bare.with(b'"') } else { bare };
        Self { name, bare, quoted }
    }

    /// The name alone.
    pub fn name(&self) -> &'static str {
        self.name
    }
}

/// Builds the [`Key`] of this name at compile time.
macro_rules! key {
    ($name:literal) => {
        const { &$crate::encode::Key::of($name) }
    };
}
pub(crate) use key;

/// Writes one compact JSON object, member by member.
pub(crate) struct ObjectWriter<'o> {
    out: &'o mut Vec<u8>,
    first: bool,
}

impl<'o> ObjectWriter<'o> {
    pub fn begin(out: &'o mut Vec<u8>) -> Self {
        out.push(b'{');
        Self { out, first: true }
    }

    /// Continues an object that already has members.
    pub fn go_on(out: &'o mut Vec<u8>) -> Self {
        Self { out, first: false }
    }

    /// Writes the key and returns the buffer for the value.
    #[inline(always)]
    pub fn key(&mut self, key: &Key) -> &mut Vec<u8> {
        key.bare.behind_comma(self.first).append_to(self.out);
        self.first = false;
        self.out
    }

    /// Writes the key and the opening quote of its value.
    #[inline(always)]
    fn quoted(&mut self, key: &Key) -> &mut Vec<u8> {
        key.quoted.behind_comma(self.first).append_to(self.out);
        self.first = false;
        self.out
    }

    pub fn text(&mut self, key: &Key, value: &str) {
        text::write_escaped(self.key(key), value);
    }

    /// Writes a whole number in quotes.
    pub fn quoted_integer(&mut self, key: &Key, value: i64) {
        write_closed_integer(self.quoted(key), value);
    }

    /// Writes a flag in quotes: "1" or "0".
    pub fn quoted_flag(&mut self, key: &Key, value: bool) {
        self.quoted(key).extend_from_slice(if value { b"1\"" } else { b"0\"" });
    }

    /// Writes a decimal number in quotes.
    #[inline]
    pub fn quoted_fixed(&mut self, key: &Key, value: f64, decimals: Decimals) -> Result<(), EncodeError> {
        let before = key.quoted.behind_comma(self.first);
        self.first = false;
        write_fixed_behind(self.out, before, key.name, value, decimals, true)
    }

    /// Writes a decimal number without quotes.
    pub fn bare_fixed(&mut self, key: &Key, value: f64, decimals: Decimals) -> Result<(), EncodeError> {
        let before = key.bare.behind_comma(self.first);
        self.first = false;
        write_fixed_behind(self.out, before, key.name, value, decimals, false)
    }

    pub fn bare_integer(&mut self, key: &Key, value: i64) {
        write_integer(self.key(key), value);
    }

    pub fn end(self) {
        self.out.push(b'}');
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fixed(value: f64, decimals: Decimals) -> String {
        let mut out = Vec::new();
        write_fixed(&mut out, "test", value, decimals).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn decimals_are_kept_between_least_and_most() {
        assert_eq!(fixed(0.0, Decimals::POSITION), "0.000");
        assert_eq!(fixed(-90.0, Decimals::POSITION), "-90.000");
        assert_eq!(fixed(10.123_456_7, Decimals::POSITION), "10.123457");
        assert_eq!(fixed(-0.000_001, Decimals::POSITION), "-0.000001");
        assert_eq!(fixed(-0.000_000_1, Decimals::POSITION), "0.000");
        assert_eq!(fixed(0.000_5, Decimals::POSITION), "0.0005");
        assert_eq!(fixed(80.0, Decimals::TENTHS), "80.0");
        assert_eq!(fixed(0.05, Decimals::TENTHS), "0.05");
        assert_eq!(fixed(10.0, Decimals::FEW), "10");
        assert_eq!(fixed(999_999_999.5, Decimals::SIX), "999999999.500000");
        assert_eq!(fixed(-137.563_782, Decimals::SIX), "-137.563782");
    }

    #[test]
    fn what_is_no_number_is_refused() {
        for value in [f64::NAN, f64::INFINITY, -1.1e9] {
            let mut out = Vec::new();
            assert_eq!(
                write_fixed(&mut out, "m0", value, Decimals::POSITION).unwrap_err().to_string(),
                "`m0` cannot be sent: it has to be a finite number within ±1e9"
            );
            assert!(out.is_empty());
        }
    }

    #[test]
    fn numbers_of_any_length_stand_behind_their_keys() {
        let mut out = Vec::new();
        let mut object = ObjectWriter::begin(&mut out);
        object.quoted_fixed(key!("a"), 12_345_678.5, Decimals::POSITION).unwrap();
        object.quoted_fixed(key!("b"), -1e9, Decimals::POSITION).unwrap();
        object.bare_fixed(key!("c"), -12_345_678.5, Decimals::POSITION).unwrap();
        object.bare_fixed(key!("d"), 1.5, Decimals::POSITION).unwrap();
        object.end();
        let wanted = r#"{"a":"12345678.500","b":"-1000000000.000","c":-12345678.500,"d":1.500}"#;
        assert_eq!(String::from_utf8(out).unwrap(), wanted);

        let mut out = b"before".to_vec();
        write_quoted_fixed(&mut out, "a", 1e9, Decimals::SIX).unwrap();
        assert!(write_quoted_fixed(&mut out, "a", f64::NAN, Decimals::SIX).is_err());
        assert_eq!(String::from_utf8(out).unwrap(), "before\"1000000000.000000\"");
    }

    #[test]
    fn whole_numbers_of_all_sizes() {
        for value in [0, 7, -7, 10, i64::MAX, i64::MIN] {
            let mut out = Vec::new();
            write_integer(&mut out, value);
            assert_eq!(String::from_utf8(out).unwrap(), value.to_string());
        }
    }
}
