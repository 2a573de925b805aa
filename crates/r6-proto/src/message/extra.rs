//! What a frame held besides its known fields: kept and reported, never lost.

use std::fmt;

use crate::printable::printable;
use crate::value::{Node, Value};

/// Where in a frame something stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// At the top of the frame.
    Top,
    /// In the instruction with this number, counted from 0.
    Instruction(u32),
    /// In the camera's set with this number, counted from 0.
    Set(u32),
    /// In the point with this number, counted from 0 over all sets.
    Point(u32),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Top => f.write_str("frame"),
            Self::Instruction(n) => write!(f, "instructions[{n}]"),
            Self::Set(n) => write!(f, "dsData[{n}]"),
            Self::Point(n) => write!(f, "point[{n}]"),
        }
    }
}

/// Why something is an extra.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExtraKind {
    /// A key that nobody knows.
    UnknownKey,
    /// An earlier value of a key that came again; the last one counts.
    DuplicateKey,
    /// A key known under another spelling; it was taken as the known one.
    OtherSpelling,
    /// A known key where it has no meaning.
    OutOfPlace,
}

impl fmt::Display for ExtraKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::UnknownKey => "unknown key",
            Self::DuplicateKey => "duplicate key, this earlier value is overridden",
            Self::OtherSpelling => "accepted, but spelt otherwise in the manual",
            Self::OutOfPlace => "known key without a meaning here",
        })
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct ExtraNode {
    pub place: Place,
    pub key: Node,
    pub value: Node,
    pub kind: ExtraKind,
}

/// One member of a frame that is none of its known fields.
#[derive(Clone, Copy, Debug)]
pub struct Extra<'a> {
    /// Where it stands.
    pub place: Place,
    /// Its key.
    pub key: Value<'a>,
    /// Its value.
    pub value: Value<'a>,
    /// Why it is none of the known fields.
    pub kind: ExtraKind,
}

impl Extra<'_> {
    /// Its place, key and kind, to be kept beyond the frame.
    #[must_use]
    pub fn to_key(&self) -> ExtraKey {
        ExtraKey { place: self.place, key: self.key.text().into_owned(), kind: self.kind }
    }

    /// As [`ExtraKey::nearest`].
    #[must_use]
    pub fn nearest(&self) -> Option<&'static str> {
        self.to_key().nearest()
    }
}

impl fmt::Display for Extra<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.to_key().fmt(f)
    }
}

/// An [`Extra`] without its value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExtraKey {
    /// Where it stands.
    pub place: Place,
    /// Its key, as long as the frame has it.
    pub key: String,
    /// Why it is none of the known fields.
    pub kind: ExtraKind,
}

impl ExtraKey {
    /// The key of the protocol that comes nearest to an unknown one.
    #[must_use]
    pub fn nearest(&self) -> Option<&'static str> {
        let known = super::top::Top::KEYS.into_iter().chain(super::fields::Fields::names());
        match self.kind {
            ExtraKind::UnknownKey => crate::spelling::nearest(&self.key, known),
            ExtraKind::OtherSpelling => Some("Angel"),
            ExtraKind::DuplicateKey | ExtraKind::OutOfPlace => None,
        }
    }
}

impl fmt::Display for ExtraKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: `{}`: {}", self.place, printable(&self.key), self.kind)?;
        match self.nearest() {
            None => Ok(()),
            Some(near) => write!(f, "; nearest: `{near}`"),
        }
    }
}
