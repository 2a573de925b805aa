//! Messages in both directions, decoded tolerantly from frames.
//!
//! A [`Message`] is a view of the frame's bytes and of the [`Decoder`]'s reused buffers. A frame that is
//! valid JSON but not a valid message also becomes a message ([`Body::Rejected`]), because its header is
//! still needed for the answer.

pub mod action;
pub mod command;
mod decoder;
mod extra;
mod fast;
pub(crate) mod fields;
pub mod instruction;
pub mod query;
pub mod reading;
mod top;
pub mod vision;

use std::fmt;

pub use command::{Command, CommandName, CommandReply, CommandWords, Effect};
pub use decoder::Decoder;
pub use extra::{Extra, ExtraKey, ExtraKind, Place};
pub use instruction::{Action, Instruction};
pub use query::{LengthMismatch, Query, QueryReply};
pub use reading::Reading;
pub use vision::{Point, PointSet};

use crate::encode::{Key, key};
use crate::error::FieldError;
use crate::printable::printable;
use crate::value::{Node, Value};

/// The six request types of manual 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum RequestType {
    /// `query`: reads values.
    Query,
    /// `command`: acts at once.
    Command,
    /// `heartbreak`: feeds the controller's watchdog.
    Heartbreak,
    /// `photo`: the controller asks a camera for a photo, and the camera answers.
    Photo,
    /// `AddPoints`: a camera sends points.
    AddPoints,
    /// `AddRCC`: instructions for the instruction list.
    AddRcc,
}

impl RequestType {
    /// All six, in the manual's order.
    pub const ALL: [Self; 6] =
        [Self::Query, Self::Command, Self::Heartbreak, Self::Photo, Self::AddPoints, Self::AddRcc];

    /// The word on the wire.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Query => "query",
            Self::Command => "command",
            Self::Heartbreak => "heartbreak",
            Self::Photo => "photo",
            Self::AddPoints => "AddPoints",
            Self::AddRcc => "AddRCC",
        }
    }

    /// The type that a word means: one of the six, a reply type of older firmware, or the misprint `AddrCC`.
    pub(crate) fn from_word(word: &[u8]) -> Option<Self> {
        Some(match word {
            b"query" | b"queryEcho" => Self::Query,
            b"command" | b"cmdEcho" => Self::Command,
            b"heartbreak" => Self::Heartbreak,
            b"photo" => Self::Photo,
            b"AddPoints" => Self::AddPoints,
            b"AddRCC" | b"AddrCC" => Self::AddRcc,
            _ => return None,
        })
    }
}

impl fmt::Display for RequestType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// The key under which a frame states its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TypeKey {
    /// `reqType`, since manual V2.0.
    ReqType,
    /// `cmdType`, before; still accepted (manual 2.1, note 2).
    CmdType,
    /// No key. Such a frame gets no reply (manual 5.2, 6).
    Absent,
}

impl TypeKey {
    /// The key to write.
    pub(crate) fn key(self) -> &'static Key {
        match self {
            Self::ReqType | Self::Absent => key!("reqType"),
            Self::CmdType => key!("cmdType"),
        }
    }

    /// The key on the wire; `reqType` if the frame had no key.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::ReqType | Self::Absent => "reqType",
            Self::CmdType => "cmdType",
        }
    }
}

/// The fields that every frame can have (manual 3; `packID` from later manuals).
#[derive(Clone, Copy, Debug)]
pub struct Header<'a> {
    /// `dsID`, as sent: long or short form.
    pub ds_id: Option<Value<'a>>,
    /// The key that carries the type.
    pub type_key: TypeKey,
    /// The type, as sent.
    pub type_word: Option<Value<'a>>,
    /// `packID`, the correlation id, as sent: quoted or not.
    pub pack_id: Option<Value<'a>>,
}

/// One decoded frame.
#[derive(Clone, Copy, Debug)]
pub struct Message<'a> {
    /// The fields that every frame can have.
    pub header: Header<'a>,
    /// The content.
    pub body: Body<'a>,
    bytes: &'a [u8],
    extras: &'a [extra::ExtraNode],
}

impl<'a> Message<'a> {
    /// Unknown, repeated, misspelt and misplaced members of the frame.
    pub fn extras(&self) -> impl ExactSizeIterator<Item = Extra<'a>> + use<'a> {
        let bytes = self.bytes;
        self.extras.iter().map(move |node| Extra {
            place: node.place,
            key: Value::new(bytes, node.key),
            value: Value::new(bytes, node.value),
            kind: node.kind,
        })
    }

    /// The whole frame.
    #[must_use]
    pub fn frame(&self) -> &'a [u8] {
        self.bytes
    }
}

/// The content of a frame.
#[derive(Clone, Copy, Debug)]
pub enum Body<'a> {
    /// PC → controller: read these addresses.
    Query(Query<'a>),
    /// Controller → PC: the values.
    QueryReply(QueryReply<'a>),
    /// PC → controller: act.
    Command(CommandWords<'a>),
    /// Controller → PC: the reply to a command, AddPoints or AddRCC.
    CommandReply(CommandReply<'a>),
    /// PC → controller: the PC is alive.
    Heartbreak,
    /// Controller → camera: take a photo.
    Photo(Photo),
    /// Camera → controller: whether the photo was taken.
    PhotoAnswer(PhotoAnswer),
    /// Camera → controller: points.
    AddPoints(AddPoints<'a>),
    /// PC → controller: instructions.
    AddRcc(AddRcc<'a>),
    /// An unknown type, or no type and no member that shows it.
    Unknown(UnknownType<'a>),
    /// A known type with an invalid field.
    Rejected(Rejection<'a>),
}

/// A photo request (manual 5.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Photo {
    /// `camID`.
    pub cam_id: i64,
}

/// The answer to a photo request (manual 5.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PhotoAnswer {
    /// `camID`.
    pub cam_id: i64,
    /// `ret`: 1 if the photo was taken.
    pub ret: i64,
}

/// The points of one or more cameras (manual 5.2).
#[derive(Clone, Copy, Debug)]
pub struct AddPoints<'a> {
    sets: &'a [PointSet],
    points: &'a [Point],
}

impl<'a> AddPoints<'a> {
    /// Returns each camera with its points, in the frame's order.
    pub fn sets(&self) -> impl ExactSizeIterator<Item = (i64, &'a [Point])> + use<'a> {
        let points = self.points;
        self.sets.iter().map(move |set| (set.cam_id, points.get(set.first..set.end).unwrap_or_default()))
    }

    /// Total number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is no point at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

/// Instructions for the instruction list (manual 6).
#[derive(Clone, Copy, Debug)]
pub struct AddRcc<'a> {
    /// `emptyList`: `true` replaces the list, `false` appends to it; `None` if the frame has no such member.
    pub empty_list: Option<bool>,
    /// The instructions, in order.
    pub instructions: &'a [Instruction],
    /// Whether the frame had the shape of 2020 (`dsData`, `xpos` …).
    pub shape_2020: bool,
    /// Which instructions have no `oneshot`, counted from 0, in order. They are read as with `oneshot` 0.
    /// Instructions with unknown actions are not listed.
    pub without_oneshot: &'a [u32],
    bytes: &'a [u8],
    fields: &'a [(Node, Node)],
}

impl<'a> AddRcc<'a> {
    /// The members of an unknown action, as (name, value) in the frame's order.
    pub fn unknown_fields(
        &self,
        unknown: &instruction::UnknownAction,
    ) -> impl ExactSizeIterator<Item = (Value<'a>, Value<'a>)> + use<'a> {
        let (bytes, (first, end)) = (self.bytes, unknown.fields);
        self.fields
            .get(first as usize..end as usize)
            .unwrap_or_default()
            .iter()
            .map(move |(name, value)| (Value::new(bytes, *name), Value::new(bytes, *value)))
    }
}

/// A frame of an unknown type.
#[derive(Clone, Copy, Debug)]
pub struct UnknownType<'a> {
    /// The type, as sent; `None` if the frame has no type and no member that shows it.
    pub word: Option<Value<'a>>,
}

impl UnknownType<'_> {
    /// Copies the type, so that it outlives the frame.
    #[must_use]
    pub fn to_word(&self) -> UnknownTypeWord {
        UnknownTypeWord { word: self.word.map(|word| word.text().into_owned()) }
    }

    /// See [`UnknownTypeWord::nearest`].
    #[must_use]
    pub fn nearest(&self) -> Option<&'static str> {
        self.to_word().nearest()
    }
}

impl fmt::Display for UnknownType<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.to_word().fmt(f)
    }
}

/// The type of an [`UnknownType`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownTypeWord {
    /// The complete type as in the frame; `None` if the frame has no type and no member that shows it.
    pub word: Option<String>,
}

impl UnknownTypeWord {
    /// The nearest known type.
    #[must_use]
    pub fn nearest(&self) -> Option<&'static str> {
        crate::spelling::nearest(self.word.as_ref()?, RequestType::ALL.map(RequestType::word))
    }

    /// The command of this name, if the sender used a command's name as the type.
    #[must_use]
    pub fn command(&self) -> Option<CommandName> {
        CommandName::exact(self.word.as_ref()?.as_bytes())
    }
}

impl fmt::Display for UnknownTypeWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(word) = &self.word else {
            return f.write_str("the frame has neither `reqType` nor anything to tell its type by");
        };
        write!(f, "`reqType` is `{}`, which is no request type", printable(&excerpt(word)))?;
        if self.command().is_some() {
            return f.write_str("; it is a command: send it as `reqType` \"command\" with `cmdData`");
        }
        match self.nearest() {
            None => Ok(()),
            Some(near) => write!(f, "; nearest: `{near}`"),
        }
    }
}

/// A frame of a known type that cannot be read, with the first wrong field.
#[derive(Clone, Copy, Debug)]
pub struct Rejection<'a> {
    /// The type of the frame.
    pub request: RequestType,
    /// The error.
    pub error: &'a FieldError,
}

fn excerpt(text: &str) -> String {
    text.chars().take(48).collect()
}
