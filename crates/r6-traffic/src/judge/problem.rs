//! The problems of a frame, and useful facts about it.

use std::fmt;

use r6_proto::address::UnknownAddress;
use r6_proto::error::{FieldError, JsonError};
use r6_proto::message::command::CommandError;
use r6_proto::message::{ExtraKey, LengthMismatch, UnknownTypeWord};
use r6_proto::request::LONGEST_ADD_RCC;
use r6_proto::{Address, CommandName};

use super::excerpt;
use crate::recording::BrokenFrame;

/// A problem of a frame. Its text is one English sentence.
///
/// Texts of a peer are stored as sent: show them with [`r6_proto::printable`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Problem {
    /// Bytes that begin like a frame but are not one.
    Broken(BrokenFrame),
    /// A complete frame that is not JSON.
    NoJson(JsonError),
    /// There is no `dsID`.
    NoDsId,
    /// The `dsID` is not one of the protocol's.
    UnknownDsId {
        /// The complete `dsID`, as sent.
        ds_id: String,
        /// The nearest known one.
        nearest: Option<&'static str>,
    },
    /// There is no `reqType`. A controller does not answer such a request.
    NoType,
    /// The `reqType` is `AddrCC`, a misprint of the manual.
    MisprintedAddRcc,
    /// The `reqType` is not a request type, or it is missing and no member shows the type.
    UnknownType(UnknownTypeWord),
    /// An unknown, repeated, misspelt or misplaced key.
    Key(ExtraKey),
    /// An invalid field of a known type.
    WrongField(FieldError),
    /// A query asks for an address that does not exist.
    UnknownAddress(UnknownAddress),
    /// A query without addresses.
    NothingAsked,
    /// A reply has more or fewer values than the query has addresses.
    WrongNumberOfValues(LengthMismatch),
    /// An unknown command, or a command with missing or wrong arguments.
    WrongCommand(CommandError),
    /// The reply to a command is neither ok nor err.
    UnclearAnswer {
        /// The reply, cut at 48 characters.
        answer: String,
    },
    /// An instruction with an unknown action.
    UnknownAction {
        /// The number of the instruction in the frame, counted from 0.
        instruction: usize,
        /// The number of the action.
        action: i64,
    },
    /// An AddRCC longer than [`LONGEST_ADD_RCC`]: controllers neither answer nor execute it.
    TooLongAddRcc {
        /// Its length in bytes.
        bytes: usize,
    },
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Broken(error) => error.fmt(f),
            Self::NoJson(error) => error.fmt(f),
            Self::NoDsId => f.write_str("`dsID` is missing"),
            Self::UnknownDsId { ds_id, nearest } => {
                write!(f, "`dsID` is `{}`, which is not known", excerpt(ds_id))?;
                nearest.map_or(Ok(()), |near| write!(f, "; nearest: `{near}`"))
            }
            Self::NoType => f.write_str("`reqType` is missing: such a frame gets no reply"),
            Self::MisprintedAddRcc => f.write_str("`AddrCC` is a misprint of the manual; nearest: `AddRCC`"),
            Self::UnknownType(word) => word.fmt(f),
            Self::Key(key) => key.fmt(f),
            Self::WrongField(error) => error.fmt(f),
            Self::UnknownAddress(error) => error.fmt(f),
            Self::NothingAsked => f.write_str("`queryAddr` is empty: nothing is asked for"),
            Self::WrongNumberOfValues(mismatch) => mismatch.fmt(f),
            Self::WrongCommand(error) => error.fmt(f),
            Self::UnclearAnswer { answer } => write!(f, "`{answer}` is neither ok nor err"),
            Self::UnknownAction { instruction, action } => {
                write!(f, "instructions[{instruction}]: action {action} is not known")
            }
            Self::TooLongAddRcc { bytes } => {
                write!(f, "{bytes} bytes: controllers neither answer nor execute more than {LONGEST_ADD_RCC}")
            }
        }
    }
}

/// A useful fact about a frame that is not a problem. Its text is one English sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Note {
    /// The type is under `cmdType`, the key of older firmware.
    OldTypeKey,
    /// A heartbreak arms the controller's watchdog.
    ArmsWatchdog,
    /// A query asks for an address under another spelling.
    OtherSpelling {
        /// As sent.
        sent: String,
        /// The address.
        address: Address,
    },
    /// A command has more arguments than it needs.
    SpareArguments {
        /// The command.
        command: CommandName,
        /// How many arguments it takes.
        takes: usize,
        /// How many are given.
        given: usize,
    },
    /// The controller refused a command.
    Refused {
        /// Its reason, if it gives one.
        reason: Option<String>,
    },
    /// An instruction has `oneshot` 0, so the list repeats for ever.
    Repeats,
    /// The instructions have the shape of 2020 (`dsData`, `xpos` …).
    Shape2020,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OldTypeKey => f.write_str("`cmdType` is the key of older firmware"),
            Self::ArmsWatchdog => f.write_str(
                "arms the controller's watchdog: from now on one is due every 10 s, or an alarm is raised",
            ),
            Self::OtherSpelling { sent, address } => write!(f, "`{sent}` is also spelt `{address}`"),
            Self::SpareArguments { command, takes, given } => {
                write!(f, "{command} takes {}, {given} given", counted(*takes, "argument"))
            }
            Self::Refused { reason: None } => f.write_str("refused, without a reason"),
            Self::Refused { reason: Some(reason) } => write!(f, "refused: {reason}"),
            Self::Repeats => f.write_str("`oneshot` is 0: the list starts over, for ever"),
            Self::Shape2020 => f.write_str("the shape of 2020 (`dsData`, `xpos` …)"),
        }
    }
}

/// `1 argument`, `2 arguments`.
pub fn counted(count: usize, word: &str) -> String {
    if count == 1 { format!("1 {word}") } else { format!("{count} {word}s") }
}
