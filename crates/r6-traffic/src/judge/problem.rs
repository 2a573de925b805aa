//! What can be wrong with a frame, and what is worth knowing of it.

use std::fmt;

use r6_proto::address::UnknownAddress;
use r6_proto::error::{FieldError, JsonError};
use r6_proto::message::command::CommandError;
use r6_proto::message::{ExtraKey, LengthMismatch, UnknownTypeWord};
use r6_proto::request::LONGEST_ADD_RCC;
use r6_proto::{Address, CommandName};

use super::excerpt;
use crate::recording::BrokenFrame;

/// What is wrong with a frame; shown as one English sentence.
///
/// Texts of a peer are as they were sent: show them with [`r6_proto::printable`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Problem {
    /// What began as a frame and is none.
    Broken(BrokenFrame),
    /// A whole frame that is no JSON.
    NoJson(JsonError),
    /// There is no `dsID`.
    NoDsId,
    /// The `dsID` is none of the protocol.
    UnknownDsId {
        /// As sent, as long as the frame has it.
        ds_id: String,
        /// The one that comes nearest.
        nearest: Option<&'static str>,
    },
    /// There is no `reqType`; a controller does not answer such a request.
    NoType,
    /// The `reqType` is `AddrCC`, a misprint of the manual.
    MisprintedAddRcc,
    /// The `reqType` is no request type, or there is nothing to tell the type by.
    UnknownType(UnknownTypeWord),
    /// An unknown, repeated, misspelt or misplaced key.
    Key(ExtraKey),
    /// A field of a known type that cannot be right.
    WrongField(FieldError),
    /// A query asks for an address that does not exist.
    UnknownAddress(UnknownAddress),
    /// A query asks for nothing.
    NothingAsked,
    /// A reply has more or fewer values than addresses were asked for.
    WrongNumberOfValues(LengthMismatch),
    /// A command that does not exist, or whose arguments are missing or wrong.
    WrongCommand(CommandError),
    /// The answer to a command is neither ok nor err.
    UnclearAnswer {
        /// The answer, cut at 48 characters.
        answer: String,
    },
    /// An instruction with an action that does not exist.
    UnknownAction {
        /// Which instruction of the frame, counted from 0.
        instruction: usize,
        /// The number of the action.
        action: i64,
    },
    /// An AddRCC longer than [`LONGEST_ADD_RCC`]: controllers neither answer nor execute it.
    TooLongAddRcc {
        /// How many bytes it has.
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

/// What is worth knowing of a frame, but not wrong; shown as one English sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Note {
    /// The type stands under `cmdType`, the key of older firmware.
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
    /// A command has more arguments than it takes.
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
    /// An instruction has `oneshot` 0: the list starts over, for ever.
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
