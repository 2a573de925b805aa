//! The members of a frame besides its known fields. The decoder keeps and reports all of them.

use std::fmt;

use crate::printable::printable;
use crate::value::{Node, Value};

/// A place in a frame.
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

/// Why a member is an extra.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExtraKind {
    /// An unknown key.
    UnknownKey,
    /// An earlier value of a repeated key. The last value counts.
    DuplicateKey,
    /// Another spelling of a known key. It was read as the known key.
    OtherSpelling,
    /// A known key that has no meaning at this place.
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

/// One member of a frame that is not one of its known fields.
#[derive(Clone, Copy, Debug)]
pub struct Extra<'a> {
    /// Where it stands.
    pub place: Place,
    /// Its key.
    pub key: Value<'a>,
    /// Its value.
    pub value: Value<'a>,
    /// Why it is not one of the known fields.
    pub kind: ExtraKind,
}

impl Extra<'_> {
    /// Copies its place, key and kind, so that they outlive the frame.
    #[must_use]
    pub fn to_key(&self) -> ExtraKey {
        ExtraKey { place: self.place, key: self.key.text().into_owned(), kind: self.kind }
    }

    /// See [`ExtraKey::nearest`].
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
    /// Its complete key, as in the frame.
    pub key: String,
    /// Why it is not one of the known fields.
    pub kind: ExtraKind,
}

impl ExtraKey {
    /// The key of the protocol nearest to an unknown key.
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
