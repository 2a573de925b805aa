//! Why something was refused, failed or is odd, and at which step: as data, so that it can be said in each
//! language.

use std::fmt;

use r6_motion::PlanError;
use r6_proto::address::UnknownAddress;
use r6_proto::error::{FieldError, JsonError};
use r6_proto::frame::FrameError;
use r6_proto::message::{Extra, ExtraKey, UnknownType, UnknownTypeWord};
use r6_proto::server::InputError;
use r6_proto::{CommandName, RequestType};
use serde::{Serialize, Serializer};

use super::{Detail, MAX_CHARS};
use crate::panel::Refused;

/// Why something was refused, failed or is odd. As data it is its English text.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// A field or an argument has a wrong value.
    Field(FieldError),
    /// There is no such query address.
    Address(UnknownAddress),
    /// A member of a frame is not one of its known fields.
    Extra(ExtraKey),
    /// There is no such type of request.
    Type(UnknownTypeWord),
    /// Bytes of the stream were thrown away.
    Frame(FrameError),
    /// A frame is not well-formed JSON.
    Json(JsonError),
    /// There is no such command.
    NoCommand {
        /// Its word.
        word: Detail,
        /// The nearest command.
        nearest: Option<&'static str>,
        /// The type of request that has this word.
        request: Option<RequestType>,
    },
    /// This firmware does not have the command.
    NotOfFirmware(CommandName),
    /// There is no such program.
    NoProgram {
        /// Its name.
        name: Detail,
        /// The nearest name.
        nearest: Option<Detail>,
    },
    /// There is no program of this name to call.
    NoProgramToCall(Detail),
    /// The machine is moving.
    Moving,
    /// There is no such counter.
    NoCounter(u32),
    /// There is no such board.
    NoBoard(u8),
    /// The target of a counter cannot be changed on this port.
    CounterTarget,
    /// M points cannot be set on this port.
    MPoints,
    /// Numbers of tools and workbenches are below this one.
    NumbersBelow(u32),
    /// The machine refuses it, as it would at the panel.
    Panel(Refused),
    /// The arm cannot move like this.
    Plan(PlanError),
    /// A camera has not answered a photo request in time.
    NoAnswerToPhoto {
        /// The camera.
        camera: i64,
        /// How long the program waited, in seconds.
        seconds: f64,
    },
    /// A camera could not take a photo.
    NoPhoto {
        /// The camera.
        camera: i64,
    },
    /// No point of a camera has come in time.
    NoPointInTime,
    /// The program has taken no point.
    NoPointTaken,
    /// The registers were not written in time.
    RegistersNotWritten,
    /// A step of the program raises the alarm.
    ByProgram,
    /// Another reason, in English.
    Text(Detail),
}

impl fmt::Display for Reason {
    /// In English.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Field(error) => error.fmt(f),
            Self::Address(error) => error.fmt(f),
            Self::Extra(extra) => extra.fmt(f),
            Self::Type(word) => word.fmt(f),
            Self::Frame(error) => error.fmt(f),
            Self::Json(error) => error.fmt(f),
            Self::NoCommand { word, nearest, request } => {
                write!(f, "unknown command `{word}`")?;
                if let Some(near) = nearest {
                    write!(f, "; nearest: `{near}`")?;
                }
                match request {
                    None => Ok(()),
                    Some(request) => write!(f, "; `{request}` is a request type: send it as `reqType`"),
                }
            }
            Self::NotOfFirmware(name) => write!(f, "this firmware does not know {name}"),
            Self::NoProgram { name, nearest } => {
                write!(f, "there is no program `{name}`")?;
                match nearest {
                    None => Ok(()),
                    Some(near) => write!(f, "; nearest: `{near}`"),
                }
            }
            Self::NoProgramToCall(name) => write!(f, "there is no program `{name}` to call"),
            Self::Moving => f.write_str("the machine is moving"),
            Self::NoCounter(id) => write!(f, "there is no counter {id}"),
            Self::NoBoard(board) => write!(f, "there is no board {board}"),
            Self::CounterTarget => {
                f.write_str("the target of a counter cannot be changed on this port: send -1")
            }
            Self::MPoints => f.write_str("M points cannot be set on this port"),
            Self::NumbersBelow(end) => write!(f, "there are numbers 0 to {}", end.saturating_sub(1)),
            Self::Panel(refused) => refused.fmt(f),
            Self::Plan(error) => error.fmt(f),
            Self::NoAnswerToPhoto { camera, seconds } => {
                write!(f, "camera {camera}: no answer to the photo request within {seconds} s")
            }
            Self::NoPhoto { camera } => write!(f, "camera {camera}: the camera could not take the photo"),
            Self::NoPointInTime => f.write_str("no point has come in time"),
            Self::NoPointTaken => f.write_str("no point was taken"),
            Self::RegistersNotWritten => f.write_str("the registers were not written in time"),
            Self::ByProgram => f.write_str("the program raises it"),
            Self::Text(text) => text.fmt(f),
        }
    }
}

impl Serialize for Reason {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        Detail::of(self).serialize(to)
    }
}

impl From<FieldError> for Reason {
    fn from(error: FieldError) -> Self {
        Self::Field(error)
    }
}

impl From<UnknownAddress> for Reason {
    fn from(error: UnknownAddress) -> Self {
        Self::Address(error)
    }
}

impl From<Extra<'_>> for Reason {
    /// The key is a peer's, and cut.
    fn from(extra: Extra<'_>) -> Self {
        let ExtraKey { place, key, kind } = extra.to_key();
        Self::Extra(ExtraKey { place, key: bounded(key), kind })
    }
}

impl From<UnknownType<'_>> for Reason {
    /// The word is a peer's, and cut.
    fn from(unknown: UnknownType<'_>) -> Self {
        Self::Type(UnknownTypeWord { word: unknown.to_word().word.map(bounded) })
    }
}

impl From<InputError> for Reason {
    fn from(error: InputError) -> Self {
        match error {
            InputError::Frame(error) => Self::Frame(error),
            InputError::Json(error) => Self::Json(error),
        }
    }
}

impl From<FrameError> for Reason {
    fn from(error: FrameError) -> Self {
        Self::Frame(error)
    }
}

impl From<Refused> for Reason {
    fn from(refused: Refused) -> Self {
        Self::Panel(refused)
    }
}

impl From<Detail> for Reason {
    fn from(text: Detail) -> Self {
        Self::Text(text)
    }
}

impl From<String> for Reason {
    fn from(text: String) -> Self {
        Self::Text(Detail::of(text))
    }
}

impl From<&str> for Reason {
    fn from(text: &str) -> Self {
        Self::Text(Detail::of(text))
    }
}

fn bounded(word: String) -> String {
    match word.char_indices().nth(MAX_CHARS) {
        Some((end, _)) => word.split_at(end).0.to_owned(),
        None => word,
    }
}

/// The step of a program or of a list that an event is about. As data it is its English text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AtStep {
    /// A step of a program.
    OfProgram {
        /// The name of the program.
        program: Detail,
        /// The number of the step, from 1.
        step: usize,
    },
    /// An instruction of the list that a PC sent.
    OfList {
        /// Its number, from 1.
        instruction: usize,
        /// Its `action`.
        action: i64,
    },
}

impl fmt::Display for AtStep {
    /// In English.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OfProgram { program, step } => write!(f, "program `{program}`, step {step}"),
            Self::OfList { instruction, action } => write!(f, "instruction {instruction} (action {action})"),
        }
    }
}

impl Serialize for AtStep {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}
