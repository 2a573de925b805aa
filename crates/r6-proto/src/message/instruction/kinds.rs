//! How the values of an instruction's members are read and written. [`super::table`] assigns these kinds to
//! the members.

use std::ops::RangeInclusive;

use super::{BlendLevel, WaitSource};
use crate::axis::AxisMask;
use crate::encode::{Decimals, Key, ObjectWriter};
use crate::error::{EncodeError, FieldError, Wanted};
use crate::grid::Grid;
use crate::io_point::PairMask;
use crate::message::fields::FieldsView;
use crate::value::Value;

/// What a valid point of an input is.
pub(super) const POINT: Wanted = Wanted(&["a point from 0 to 31", "0 至 31 的点位"]);

/// The delays and limits that are read and sent, in seconds: at most one day. A longer time is probably a
/// mistake in the unit.
pub const TIMES: RangeInclusive<f64> = 0.0..=86_400.0;

/// What a valid delay or limit is.
pub const TIMES_WANTED: &str = "seconds from 0 to 86400";

/// Reads and writes a value that takes `MEMBERS` members.
pub(super) trait Kind<const MEMBERS: usize> {
    type Value;

    /// What a valid value is.
    fn wanted(&self) -> Wanted;

    /// Reads the value; `None` if the first member is absent.
    fn take(
        &self,
        fields: &mut FieldsView<'_>,
        slots: [usize; MEMBERS],
    ) -> Result<Option<Self::Value>, FieldError>;

    /// Appends the value.
    fn give(
        &self,
        object: &mut ObjectWriter<'_>,
        keys: [&'static Key; MEMBERS],
        value: Self::Value,
    ) -> Result<(), EncodeError>;

    /// The error for an absent value.
    fn missing(&self, fields: &FieldsView<'_>, slots: [usize; MEMBERS]) -> FieldError {
        fields.missing(slots.first().copied().unwrap_or_default(), self.wanted())
    }
}

/// A kind of value that takes one member.
pub(super) trait OfOne {
    type Value;

    /// What a valid value is.
    fn wanted(&self) -> Wanted;

    /// Reads the value; `None` if it is not valid.
    fn read(&self, value: Value<'_>) -> Option<Self::Value>;

    /// Appends the value.
    fn write(
        &self,
        object: &mut ObjectWriter<'_>,
        key: &'static Key,
        value: Self::Value,
    ) -> Result<(), EncodeError>;
}

impl<K: OfOne> Kind<1> for K {
    type Value = K::Value;

    fn wanted(&self) -> Wanted {
        OfOne::wanted(self)
    }

    fn take(&self, fields: &mut FieldsView<'_>, [slot]: [usize; 1]) -> Result<Option<K::Value>, FieldError> {
        fields.optional(slot, OfOne::wanted(self), |value| self.read(value))
    }

    fn give(
        &self,
        object: &mut ObjectWriter<'_>,
        [key]: [&'static Key; 1],
        value: K::Value,
    ) -> Result<(), EncodeError> {
        self.write(object, key, value)
    }
}

/// `1` or `0`.
pub(super) struct Flag;

impl OfOne for Flag {
    type Value = bool;

    fn wanted(&self) -> Wanted {
        Wanted(&["1 or 0", "1 或 0"])
    }

    fn read(&self, value: Value<'_>) -> Option<bool> {
        value.flag()
    }

    fn write(
        &self,
        object: &mut ObjectWriter<'_>,
        key: &'static Key,
        value: bool,
    ) -> Result<(), EncodeError> {
        object.quoted_flag(key, value);
        Ok(())
    }
}

/// A whole number from 0. The text says what a valid value is.
pub(super) struct Whole(pub Wanted);

impl OfOne for Whole {
    type Value = u32;

    fn wanted(&self) -> Wanted {
        self.0
    }

    fn read(&self, value: Value<'_>) -> Option<u32> {
        u32::try_from(value.integer()?).ok()
    }

    fn write(&self, object: &mut ObjectWriter<'_>, key: &'static Key, value: u32) -> Result<(), EncodeError> {
        object.quoted_integer(key, i64::from(value));
        Ok(())
    }
}

/// A whole number from 0 to this maximum. The text says what a valid value is.
pub(super) struct UpTo(pub u8, pub Wanted);

impl UpTo {
    fn sendable(&self, key: &'static Key, value: u8) -> Result<i64, EncodeError> {
        if value <= self.0 {
            Ok(i64::from(value))
        } else {
            Err(EncodeError::new(key.name(), self.1.english()))
        }
    }
}

impl OfOne for UpTo {
    type Value = u8;

    fn wanted(&self) -> Wanted {
        self.1
    }

    fn read(&self, value: Value<'_>) -> Option<u8> {
        u8::try_from(value.integer()?).ok().filter(|value| *value <= self.0)
    }

    fn write(&self, object: &mut ObjectWriter<'_>, key: &'static Key, value: u8) -> Result<(), EncodeError> {
        object.quoted_integer(key, self.sendable(key, value)?);
        Ok(())
    }
}

/// A level of blending.
pub(super) struct Blend;

impl OfOne for Blend {
    type Value = BlendLevel;

    fn wanted(&self) -> Wanted {
        Wanted(&["a blend level from 0 to 9", "0 至 9 的平滑等级"])
    }

    fn read(&self, value: Value<'_>) -> Option<BlendLevel> {
        BlendLevel::new(u8::try_from(value.integer()?).ok()?)
    }

    fn write(
        &self,
        object: &mut ObjectWriter<'_>,
        key: &'static Key,
        value: BlendLevel,
    ) -> Result<(), EncodeError> {
        object.quoted_integer(key, i64::from(value.level()));
        Ok(())
    }
}

/// A mask of axes.
pub(super) struct Mask;

impl OfOne for Mask {
    type Value = AxisMask;

    fn wanted(&self) -> Wanted {
        Wanted(&["a mask from 0 to 0xFF, such as \"0x3F\" or 63", "0 至 0xFF 的轴掩码，例如 \"0x3F\" 或 63"])
    }

    /// Reads all forms that clients send: `0x3F`, `0X3F`, `63` or a bare number.
    fn read(&self, value: Value<'_>) -> Option<AxisMask> {
        let word = value.word();
        let word = word.trim_ascii();
        let bits = match word.strip_prefix(b"0x").or_else(|| word.strip_prefix(b"0X")) {
            Some(digits) if value.is_text() => {
                let plain = !digits.is_empty() && digits.iter().all(u8::is_ascii_hexdigit);
                let digits = std::str::from_utf8(digits).ok().filter(|_| plain)?;
                i64::from(u32::from_str_radix(digits, 16).ok()?)
            }
            Some(_) | None => value.integer()?,
        };
        u8::try_from(bits).ok().map(AxisMask::from_bits)
    }

    fn write(
        &self,
        object: &mut ObjectWriter<'_>,
        key: &'static Key,
        value: AxisMask,
    ) -> Result<(), EncodeError> {
        let digit = |nibble| if nibble < 10 { b'0' + nibble } else { b'A' + nibble - 10 };
        let [high, low] = [value.bits() >> 4, value.bits() & 0xF].map(digit);
        object.key(key).extend_from_slice(&[b'"', b'0', b'x', high, low, b'"']);
        Ok(())
    }
}

/// Two bits for each of sixteen points.
pub(super) struct Pairs;

impl OfOne for Pairs {
    type Value = PairMask;

    fn wanted(&self) -> Wanted {
        Wanted(&["a number of 32 bits, two for each point", "32 位的数，每个点占两位"])
    }

    fn read(&self, value: Value<'_>) -> Option<PairMask> {
        u32::try_from(value.integer()?).ok().map(PairMask::from_bits)
    }

    fn write(
        &self,
        object: &mut ObjectWriter<'_>,
        key: &'static Key,
        value: PairMask,
    ) -> Result<(), EncodeError> {
        object.quoted_integer(key, i64::from(value.bits()));
        Ok(())
    }
}

/// A finite number. The text says what a valid value is.
pub(super) struct Number(pub Wanted);

impl OfOne for Number {
    type Value = f64;

    fn wanted(&self) -> Wanted {
        self.0
    }

    fn read(&self, value: Value<'_>) -> Option<f64> {
        value.number()
    }

    fn write(&self, object: &mut ObjectWriter<'_>, key: &'static Key, value: f64) -> Result<(), EncodeError> {
        object.quoted_fixed(key, value, Decimals::FEW)
    }
}

/// A finite number, written without quotes with these decimals. The text says what a valid value is.
pub(super) struct BareNumber(pub Wanted, pub Decimals);

impl OfOne for BareNumber {
    type Value = f64;

    fn wanted(&self) -> Wanted {
        self.0
    }

    fn read(&self, value: Value<'_>) -> Option<f64> {
        value.number()
    }

    fn write(&self, object: &mut ObjectWriter<'_>, key: &'static Key, value: f64) -> Result<(), EncodeError> {
        object.bare_fixed(key, value, self.1)
    }
}

/// A whole number, written without quotes.
pub(super) struct BareWhole;

impl OfOne for BareWhole {
    type Value = i64;

    fn wanted(&self) -> Wanted {
        Wanted(&["a whole number", "整数"])
    }

    fn read(&self, value: Value<'_>) -> Option<i64> {
        value.integer()
    }

    fn write(&self, object: &mut ObjectWriter<'_>, key: &'static Key, value: i64) -> Result<(), EncodeError> {
        object.bare_integer(key, value);
        Ok(())
    }
}

/// `1` or `0`, written without quotes.
pub(super) struct BareFlag;

impl OfOne for BareFlag {
    type Value = bool;

    fn wanted(&self) -> Wanted {
        OfOne::wanted(&Flag)
    }

    fn read(&self, value: Value<'_>) -> Option<bool> {
        value.flag()
    }

    fn write(
        &self,
        object: &mut ObjectWriter<'_>,
        key: &'static Key,
        value: bool,
    ) -> Result<(), EncodeError> {
        object.bare_integer(key, i64::from(value));
        Ok(())
    }
}

/// A number in equal steps, with one decimal. Any number is read, but only numbers within these bounds are
/// sent.
pub(super) struct OnGrid {
    pub range: RangeInclusive<f64>,
    pub grid: Grid,
    pub read: Wanted,
    pub sent: &'static str,
}

impl OfOne for OnGrid {
    type Value = f64;

    fn wanted(&self) -> Wanted {
        self.read
    }

    fn read(&self, value: Value<'_>) -> Option<f64> {
        value.number()
    }

    fn write(&self, object: &mut ObjectWriter<'_>, key: &'static Key, value: f64) -> Result<(), EncodeError> {
        if !self.range.contains(&value) {
            return Err(EncodeError::new(key.name(), self.sent));
        }
        self.grid.sendable(key.name(), value)?;
        object.quoted_fixed(key, value, Decimals::TENTHS)
    }
}

/// Seconds in equal steps, with this many decimals.
pub(super) struct Seconds(pub Grid, pub Decimals);

impl OfOne for Seconds {
    type Value = f64;

    fn wanted(&self) -> Wanted {
        Wanted(&[TIMES_WANTED, "0 至 86400 的秒数"])
    }

    fn read(&self, value: Value<'_>) -> Option<f64> {
        value.number().filter(|time| TIMES.contains(time))
    }

    fn write(&self, object: &mut ObjectWriter<'_>, key: &'static Key, value: f64) -> Result<(), EncodeError> {
        if !TIMES.contains(&value) {
            return Err(EncodeError::new(key.name(), TIMES_WANTED));
        }
        self.0.sendable(key.name(), value)?;
        object.quoted_fixed(key, value, self.1)
    }
}

/// One of the listed values, by its number.
pub(super) struct Listed<T: 'static>(pub Wanted, pub &'static [(i64, T)]);

impl<T: Copy + PartialEq> OfOne for Listed<T> {
    type Value = T;

    fn wanted(&self) -> Wanted {
        self.0
    }

    fn read(&self, value: Value<'_>) -> Option<T> {
        let number = value.integer()?;
        self.1.iter().find(|(its, _)| *its == number).map(|(_, value)| *value)
    }

    fn write(&self, object: &mut ObjectWriter<'_>, key: &'static Key, value: T) -> Result<(), EncodeError> {
        let row = self.1.iter().find(|(_, its)| *its == value);
        let (number, _) = row.ok_or_else(|| EncodeError::new(key.name(), self.0.english()))?;
        object.quoted_integer(key, *number);
        Ok(())
    }
}

/// What a wait watches: a board and a point of it. Time has no point.
pub(super) struct Watched;

impl Watched {
    /// The `type` number of time.
    const TIME: u8 = 100;
}

impl Kind<2> for Watched {
    type Value = WaitSource;

    fn wanted(&self) -> Wanted {
        Wanted(&["0–4 (X), 5–7 (M), 8 (EU) or 100 (time)", "0 至 4（X）、5 至 7（M）、8（EU）或 100（延时）"])
    }

    fn take(
        &self,
        fields: &mut FieldsView<'_>,
        [kind, point]: [usize; 2],
    ) -> Result<Option<WaitSource>, FieldError> {
        let kind = fields.required(kind, self.wanted(), |value| {
            let kind = u8::try_from(value.integer()?).ok()?;
            matches!(kind, 0..=8 | Self::TIME).then_some(kind)
        })?;
        let found = fields.optional(point, POINT, |value| UpTo(31, POINT).read(value))?;
        if kind == Self::TIME {
            return Ok(Some(WaitSource::Time));
        }
        let point = found.ok_or_else(|| fields.missing(point, POINT))?;
        Ok(Some(match kind {
            board @ 0..=4 => WaitSource::Input { board, point },
            board @ 5..=7 => WaitSource::M { board: board - 5, point },
            _ => WaitSource::Eu { point },
        }))
    }

    fn give(
        &self,
        object: &mut ObjectWriter<'_>,
        [kind_key, point_key]: [&'static Key; 2],
        source: WaitSource,
    ) -> Result<(), EncodeError> {
        let (kind, point) = match source {
            WaitSource::Input { board, point } => (
                UpTo(4, Wanted(&["input board 0 to 4", "0 至 4 的输入板"])).sendable(kind_key, board)?,
                point,
            ),
            WaitSource::M { board, point } => {
                (UpTo(2, Wanted(&["M board 0 to 2", "0 至 2 的 M 板"])).sendable(kind_key, board)? + 5, point)
            }
            WaitSource::Eu { point } => (8, point),
            WaitSource::Time => (i64::from(Self::TIME), 0),
        };
        object.quoted_integer(kind_key, kind);
        object.quoted_integer(point_key, UpTo(31, POINT).sendable(point_key, point)?);
        Ok(())
    }
}
