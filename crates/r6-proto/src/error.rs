//! Errors in bytes that a peer sent: the place, what was found, what was expected, and the nearest valid
//! word.

use std::fmt;

use crate::grid::Nearest;
use crate::language::Language;
use crate::printable::printable;

/// A frame that is not a JSON object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JsonError {
    /// Position of the error, in bytes from the start of the frame.
    pub at: usize,
    /// The byte found there; `None` at the end of the frame.
    pub found: Option<u8>,
    /// What is wrong.
    pub fault: JsonFault,
}

/// Why the bytes are not JSON.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum JsonFault {
    /// The reader expected something else here.
    Expected(&'static str),
    /// A key is not followed by `:` and a value. Contains the key, cut at 32 characters.
    KeyWithoutValue(String),
    /// A string has no closing quote.
    StringNotClosed,
    /// A raw control byte stands inside a string.
    ControlByteInString,
    /// An escape that JSON does not have.
    BadEscape,
    /// A number that does not fit in a double.
    NumberOutOfRange,
    /// More nested levels than [`crate::MAX_DEPTH`].
    TooDeep,
}

impl fmt::Display for JsonError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = self.at;
        match &self.fault {
            JsonFault::Expected(wanted) => write!(f, "{wanted} was due at byte {at}")?,
            JsonFault::KeyWithoutValue(key) => {
                write!(f, "key `{}` has no value: `:` was due at byte {at}", printable(key))?
            }
            JsonFault::StringNotClosed => write!(f, "a string is not closed at byte {at}")?,
            JsonFault::ControlByteInString => {
                write!(f, "a raw control byte stands in a string at byte {at}")?
            }
            JsonFault::BadEscape => write!(f, "an escape that JSON does not have stands at byte {at}")?,
            JsonFault::NumberOutOfRange => write!(f, "a number out of range stands at byte {at}")?,
            JsonFault::TooDeep => {
                write!(f, "more than {} nested levels at byte {at}", crate::json::MAX_DEPTH)?;
            }
        }
        match self.found {
            None => f.write_str(", where the frame ends"),
            Some(byte @ 0x20..=0x7E) => write!(f, ", found `{}`", char::from(byte)),
            Some(byte) => write!(f, ", found byte 0x{byte:02X}"),
        }
    }
}

impl std::error::Error for JsonError {}

/// What a valid value is, in each [`Language`]. The English text completes a sentence after "has to be", the
/// Chinese one after “应为”.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wanted(pub &'static [&'static str; 2]);

impl Wanted {
    /// Nothing is known of a valid value.
    pub(crate) const UNKNOWN: Self = Self(&["?", "?"]);

    /// In English.
    #[must_use]
    pub const fn english(self) -> &'static str {
        let [english, _] = *self.0;
        english
    }

    /// In this language.
    #[must_use]
    pub const fn text(self, language: Language) -> &'static str {
        let [english, chinese] = *self.0;
        match language {
            Language::English => english,
            Language::Chinese => chinese,
        }
    }
}

impl fmt::Display for Wanted {
    /// In English.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.english())
    }
}

/// Where a wrong value stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FieldPath {
    /// In a member of the frame, as a path from its top, for example `instructions[2].m3`; or in the value of
    /// this query address.
    Member(String),
    /// In an argument of a command.
    Argument {
        /// The word of the command.
        command: &'static str,
        /// The number of the argument, from 1.
        number: usize,
        /// Its name in the table of commands.
        name: &'static str,
    },
}

impl fmt::Display for FieldPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Member(path) => f.write_str(path),
            Self::Argument { command, number, name } => write!(f, "{command} argument {number} ({name})"),
        }
    }
}

/// A field of a well-formed frame has an invalid value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FieldError {
    /// The field.
    pub path: FieldPath,
    /// The value as on the wire, cut at 48 characters; `None` if the field is missing.
    pub found: Option<String>,
    /// What a valid value is.
    pub wanted: Wanted,
    /// The nearest valid word.
    pub nearest: Option<&'static str>,
}

impl fmt::Display for FieldError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.found {
            None => {
                write!(f, "`{}` is missing: it has to be {}", printable(&self.path.to_string()), self.wanted)?
            }
            Some(found) => {
                let (path, found) = (self.path.to_string(), printable(found));
                let path = printable(&path);
                write!(f, "`{path}` is {found}, but has to be {}", self.wanted)?;
            }
        }
        match self.nearest {
            None => Ok(()),
            Some(word) => write!(f, "; nearest: `{word}`"),
        }
    }
}

impl std::error::Error for FieldError {}

/// A value that the wire cannot carry. Nothing was encoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EncodeError {
    /// The field.
    pub field: &'static str,
    /// What a valid value is.
    pub wanted: &'static str,
    /// The values that can be sent, if the value lies between two of them.
    pub nearest: Option<Nearest>,
}

impl EncodeError {
    /// An error without nearest values.
    pub(crate) const fn new(field: &'static str, wanted: &'static str) -> Self {
        Self { field, wanted, nearest: None }
    }
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` cannot be sent: it has to be {}", self.field, self.wanted)?;
        match self.nearest {
            Some(nearest) => write!(f, "; nearest: {nearest}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for EncodeError {}
