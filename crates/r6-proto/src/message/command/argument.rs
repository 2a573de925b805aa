//! The arguments of commands: their kinds, the units of people, and their form on the wire.

use std::borrow::Cow;

use crate::address::RegisterIndex;
use crate::encode::{Decimals, write_fixed, write_integer};
use crate::error::{EncodeError, Wanted};
use crate::grid::{Grid, Nearest};
use crate::text;
use crate::value::Value;

/// One argument of a command.
#[derive(Clone, Copy, Debug)]
pub struct ArgumentInfo {
    /// Its name in the CLI and the documentation.
    pub name: &'static str,
    /// Its possible values, and their form on the wire.
    pub kind: ArgumentKind,
    /// Its meaning and unit, both as a person types it and as it is on the wire.
    pub meaning: &'static str,
    /// Whether it can be left out. A command takes either all of its optional arguments or none.
    pub optional: bool,
}

/// The possible values of an argument, and their form on the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ArgumentKind {
    /// A text, unchanged.
    Text,
    /// A whole number.
    Whole {
        /// The lowest.
        first: i64,
        /// The highest.
        last: i64,
        /// What a valid number is.
        wanted: Wanted,
    },
    /// A whole number of 32 bits with sign, because a register's Modbus twin is two registers of 16 bits.
    /// Larger numbers are read, but refused before they are sent.
    Integer,
    /// A count from 0; −1 keeps the present value.
    Count,
    /// 1 or 0; a person may say `on` and `off`.
    Flag,
    /// A register, 800 to 900.
    Register,
    /// A number in steps.
    Number {
        /// Its unit.
        unit: &'static str,
        /// The lowest.
        first: f64,
        /// The highest.
        last: f64,
        /// The steps in which it can be sent.
        grid: Grid,
        /// Whether the wire carries the number of steps instead of the number: percent × 10, seconds × 1000.
        in_steps: bool,
        /// What a valid number is, in the units of people.
        wanted: Wanted,
        /// The same, in the units of the wire.
        wanted_on_the_wire: Wanted,
    },
}

impl ArgumentKind {
    /// What a valid argument of this kind is, in the units of people.
    #[must_use]
    pub const fn wanted(self) -> Wanted {
        match self {
            Self::Text => Wanted(&["a text", "文本"]),
            Self::Integer => Wanted(&["a whole number of 32 bits", "32 位整数"]),
            Self::Count => Wanted(&["a count from 0, or -1 to keep it", "不小于 0 的计数；-1 为不修改"]),
            Self::Flag => Wanted(&["1 (on) or 0 (off)", "1（通）或 0（断）"]),
            Self::Register => Wanted(&["a register from 800 to 900", "800 至 900 的寄存器"]),
            Self::Whole { wanted, .. } | Self::Number { wanted, .. } => wanted,
        }
    }

    /// What a valid argument is on the wire.
    #[must_use]
    pub const fn wanted_on_the_wire(self) -> Wanted {
        match self {
            Self::Number { wanted_on_the_wire, .. } => wanted_on_the_wire,
            Self::Flag => Wanted(&["1 or 0", "1 或 0"]),
            Self::Text | Self::Whole { .. } | Self::Integer | Self::Count | Self::Register => self.wanted(),
        }
    }

    /// Its unit, if it has one.
    #[must_use]
    pub const fn unit(self) -> Option<&'static str> {
        match self {
            Self::Number { unit, .. } => Some(unit),
            Self::Text | Self::Whole { .. } | Self::Integer | Self::Count | Self::Flag | Self::Register => {
                None
            }
        }
    }

    /// The lowest and the highest number that can be sent, in the units of people, if there are such limits.
    #[must_use]
    pub fn range(self) -> Option<(f64, f64)> {
        #[expect(clippy::cast_precision_loss, reason = "numbers of 32 bits")]
        match self {
            Self::Text | Self::Number { first: f64::MIN, .. } => None,
            Self::Whole { first, last, .. } => Some((first as f64, last as f64)),
            Self::Integer => Some((f64::from(i32::MIN), f64::from(i32::MAX))),
            Self::Count => Some((-1.0, f64::from(u32::MAX))),
            Self::Flag => Some((0.0, 1.0)),
            Self::Register => Some((f64::from(RegisterIndex::FIRST), f64::from(RegisterIndex::LAST))),
            Self::Number { first, last, .. } => Some((first, last)),
        }
    }

    /// Whether the number on the wire differs from the number that people use.
    #[must_use]
    pub const fn is_scaled(self) -> bool {
        matches!(self, Self::Number { in_steps: true, .. })
    }

    /// Reads the value that a peer sent.
    pub(super) fn read<'a>(self, value: Value<'a>) -> Option<Argument<'a>> {
        match self {
            Self::Text => Some(Argument::Text(value.text())),
            Self::Flag => value.flag().map(Argument::Flag),
            Self::Number { first, last, grid, in_steps, .. } => {
                let number = value.number()? / if in_steps { grid.steps_in_unit() } else { 1.0 };
                (first..=last).contains(&number).then_some(Argument::Number(number))
            }
            Self::Whole { .. } | Self::Integer | Self::Count | Self::Register => self.whole(value.integer()?),
        }
    }

    /// Reads the word that a person typed.
    ///
    /// # Errors
    /// If the value lies between two steps: the nearest values that can be sent, and the steps. Otherwise
    /// `None`.
    pub(super) fn read_word(self, word: &str) -> Result<Argument<'static>, Option<(Nearest, &'static str)>> {
        match self {
            Self::Text => Ok(Argument::Text(Cow::Owned(word.to_owned()))),
            Self::Flag => match word {
                "1" | "on" => Ok(Argument::Flag(true)),
                "0" | "off" => Ok(Argument::Flag(false)),
                _ => Err(None),
            },
            Self::Number { first, last, grid, .. } => {
                let number: f64 = word.parse().map_err(|_| None)?;
                if !(first..=last).contains(&number) {
                    return Err(None);
                }
                match grid.step(number) {
                    Ok(_) => Ok(Argument::Number(number)),
                    Err(nearest) => Err(nearest.map(|nearest| (nearest, grid.wanted()))),
                }
            }
            Self::Whole { .. } | Self::Integer | Self::Count | Self::Register => {
                word.parse().ok().and_then(|whole| self.whole(whole)).ok_or(None)
            }
        }
    }

    /// Returns the argument for a whole number, if this kind accepts it.
    fn whole(self, whole: i64) -> Option<Argument<'static>> {
        let fits = match self {
            Self::Whole { first, last, .. } => (first..=last).contains(&whole),
            Self::Count if whole == -1 => return Some(Argument::Kept),
            Self::Count => u32::try_from(whole).is_ok(),
            Self::Register => u16::try_from(whole).is_ok_and(|number| RegisterIndex::new(number).is_some()),
            Self::Integer => true,
            Self::Text | Self::Flag | Self::Number { .. } => false,
        };
        fits.then_some(Argument::Whole(whole))
    }

    /// Appends a comma and the argument in quotes.
    pub(super) fn write(
        self,
        name: &'static str,
        argument: &Argument<'_>,
        out: &mut Vec<u8>,
    ) -> Result<(), EncodeError> {
        let wrong = EncodeError::new(name, self.wanted().english());
        let whole = match (self, argument) {
            (Self::Text, Argument::Text(text)) => {
                out.push(b',');
                text::write_escaped(out, text);
                return Ok(());
            }
            (Self::Flag, Argument::Flag(flag)) => i64::from(*flag),
            (Self::Count, Argument::Kept) => -1,
            (Self::Integer, Argument::Whole(whole)) => i64::from(i32::try_from(*whole).map_err(|_| wrong)?),
            (Self::Whole { .. } | Self::Count | Self::Register, Argument::Whole(whole)) => {
                self.whole(*whole).ok_or(wrong)?;
                *whole
            }
            (Self::Number { first, last, grid, in_steps, .. }, Argument::Number(number)) => {
                if !(first..=last).contains(number) {
                    return Err(wrong);
                }
                let step = grid.sendable(name, *number)?;
                if !in_steps {
                    out.extend_from_slice(b",\"");
                    write_fixed(out, name, *number, Decimals::FEW)?;
                    out.push(b'"');
                    return Ok(());
                }
                step
            }
            // Unreachable: no row of the table combines a kind with such a field.
            // `every_command_is_written_and_read_again` writes all rows.
            (
                _,
                Argument::Text(_)
                | Argument::Whole(_)
                | Argument::Kept
                | Argument::Flag(_)
                | Argument::Number(_),
            ) => {
                return Err(wrong);
            }
        };
        out.extend_from_slice(b",\"");
        write_integer(out, whole);
        out.push(b'"');
        Ok(())
    }
}

/// The value of one argument, in the units of people.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Argument<'a> {
    Text(Cow<'a, str>),
    Whole(i64),
    /// A count that keeps its present value.
    Kept,
    Flag(bool),
    Number(f64),
}

impl Argument<'_> {
    /// The same without the frame that it came from.
    pub fn into_owned(self) -> Argument<'static> {
        match self {
            Self::Text(text) => Argument::Text(Cow::Owned(text.into_owned())),
            Self::Whole(number) => Argument::Whole(number),
            Self::Kept => Argument::Kept,
            Self::Flag(flag) => Argument::Flag(flag),
            Self::Number(number) => Argument::Number(number),
        }
    }
}

/// Supplies the arguments of a command one after the other.
pub(super) trait Source<'a> {
    type Error;

    /// Whether to ignore unexpected arguments, because old clients send some.
    const FORGIVES: bool;

    /// The number of the next argument, counted from 0.
    fn number(&self) -> usize;

    /// How many arguments are left.
    fn left(&self) -> usize;

    /// Returns the next argument. After the last argument of the table, further arguments have the kind of
    /// the last.
    fn next(&mut self) -> Result<Argument<'a>, Self::Error>;

    /// The error for an invalid argument with this number.
    fn wrong(&self, number: usize) -> Self::Error;
}

/// A field of a [`super::Command`]: one argument, or several of the same kind.
pub(super) trait Field<'a>: Sized {
    fn take<S: Source<'a>>(from: &mut S) -> Result<Self, S::Error>;

    fn give(&self, to: &mut Writer<'_>) -> Result<(), EncodeError>;
}

/// Writes the arguments of a command one after the other.
pub(super) struct Writer<'o> {
    pub arguments: &'static [ArgumentInfo],
    pub number: usize,
    pub out: &'o mut Vec<u8>,
}

impl Writer<'_> {
    fn write(&mut self, argument: &Argument<'_>) -> Result<(), EncodeError> {
        let info = info(self.arguments, self.number);
        self.number += 1;
        match info {
            Some(info) => info.kind.write(info.name, argument, self.out),
            None => Err(EncodeError::new("argument", "an argument of this command")),
        }
    }
}

/// The argument with this number; after the last, the last one.
pub(super) fn info(arguments: &'static [ArgumentInfo], number: usize) -> Option<&'static ArgumentInfo> {
    arguments.get(number).or(arguments.last())
}

/// Implements [`Field`] for a type that is one argument.
macro_rules! field {
    ($type:ty, $taken:pat => $value:expr, $field:ident => $given:expr) => {
        impl<'a> Field<'a> for $type {
            fn take<S: Source<'a>>(from: &mut S) -> Result<Self, S::Error> {
                let number = from.number();
                let value = match from.next()? {
                    $taken => $value,
                    #[allow(unreachable_patterns, reason = "a pattern may take every argument")]
                    _ => None,
                };
                value.ok_or_else(|| from.wrong(number))
            }

            fn give(&self, to: &mut Writer<'_>) -> Result<(), EncodeError> {
                let $field = self;
                to.write(&$given)
            }
        }
    };
}

field!(Cow<'a, str>, Argument::Text(text) => Some(text), text => Argument::Text(Cow::Borrowed(text)));
field!(bool, Argument::Flag(flag) => Some(flag), flag => Argument::Flag(*flag));
field!(f64, Argument::Number(number) => Some(number), number => Argument::Number(*number));
field!(i64, Argument::Whole(whole) => Some(whole), whole => Argument::Whole(*whole));
field!(u8, Argument::Whole(whole) => u8::try_from(whole).ok(), whole => Argument::Whole(i64::from(*whole)));
field!(u32, Argument::Whole(whole) => u32::try_from(whole).ok(), whole => Argument::Whole(i64::from(*whole)));
field!(
    RegisterIndex,
    Argument::Whole(whole) => u16::try_from(whole).ok().and_then(RegisterIndex::new),
    register => Argument::Whole(i64::from(register.number()))
);
field!(
    Option<u32>,
    argument => match argument {
        Argument::Kept => Some(None),
        Argument::Whole(whole) => u32::try_from(whole).ok().map(Some),
        Argument::Text(_) | Argument::Flag(_) | Argument::Number(_) => None,
    },
    count => count.map_or(Argument::Kept, |count| Argument::Whole(i64::from(count)))
);

impl<'a, T: Field<'a> + Copy + Default, const COUNT: usize> Field<'a> for [T; COUNT] {
    fn take<S: Source<'a>>(from: &mut S) -> Result<Self, S::Error> {
        let mut values = [T::default(); COUNT];
        for value in &mut values {
            *value = T::take(from)?;
        }
        Ok(values)
    }

    fn give(&self, to: &mut Writer<'_>) -> Result<(), EncodeError> {
        self.iter().try_for_each(|value| value.give(to))
    }
}
