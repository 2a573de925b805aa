//! Why a request failed, sorted by what the caller must do.

use std::fmt;
use std::io::ErrorKind;
use std::time::Duration;

use r6_proto::CommandName;
use r6_proto::address::Address;
use r6_proto::client::SendError;
use r6_proto::error::FieldError;
use r6_proto::printable;

use crate::identity::Identity;
use crate::pushed::LostReason;

mod invalid;

pub use invalid::Invalid;
pub use r6_proto::Effect;

/// Why a request failed, sorted by what the caller must do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RequestError {
    /// The request cannot be sent as it is, and nothing was sent. The caller has to change it: the same
    /// request fails again.
    Invalid(Invalid),
    /// Nothing reached the controller: sending again is safe.
    NotSent(NotSent),
    /// The controller understood and said no.
    Refused(Refused),
    /// The request left, and no usable reply came back: the controller may have acted.
    OutcomeUnknown(OutcomeUnknown),
}

impl RequestError {
    /// Whether the same request may be sent again without knowing more. True if nothing left and the next
    /// attempt may succeed, or if the request does no harm twice (a query, a stop). False of a request that
    /// cannot be sent as it is ([`Self::Invalid`]).
    #[must_use]
    pub fn may_send_again(&self) -> bool {
        match self {
            Self::NotSent(_) => true,
            Self::Invalid(_) | Self::Refused(_) => false,
            Self::OutcomeUnknown(unknown) => match unknown.request().effect {
                Effect::Reads | Effect::Stops => true,
                Effect::Changes | Effect::Moves => false,
            },
        }
    }

    /// Whether no byte of the request was sent.
    pub(crate) fn nothing_left(&self) -> bool {
        matches!(self, Self::NotSent(_) | Self::Invalid(_))
    }

    /// The answer to a query lacks a value that is required.
    pub(crate) fn no_value(address: Address) -> Self {
        let answer = format!("no value for {address}");
        OutcomeUnknown::Unclear { request: Sent::QUERY, answer }.into()
    }
}

/// Why nothing reached the controller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotSent {
    /// No connection could be made.
    Unreachable {
        /// Host and port.
        address: String,
        /// The operating system's kind of error.
        kind: ErrorKind,
        /// The operating system's message.
        detail: String,
    },
    /// The connection was not made in time.
    ConnectTimedOut {
        /// Host and port.
        address: String,
        /// The time limit of the attempt.
        after: Duration,
    },
    /// There is no connection. Only a query or a stop makes a new one.
    Disconnected,
    /// The client reconnected, and the state or the identity of the machine has not been read since.
    StateNotRead,
    /// The client reconnected, and another controller is at the other end.
    AnotherRobot {
        /// The controller that this handle was used with so far.
        expected: Box<Identity>,
        /// The controller that is there now.
        found: Box<Identity>,
    },
    /// The client reconnected, and the connection ended before the controller had identified itself.
    Unidentified {
        /// Host and port.
        address: String,
        /// How it ended.
        reason: LostReason,
    },
    /// The request can move the arm, and a stop was asked for over this handle before it was sent.
    Overtaken,
    /// The permission to send it was withdrawn before it was sent ([`crate::Permission`]).
    Withdrawn,
    /// The request waited too long behind other requests.
    Busy {
        /// How long.
        waited: Duration,
    },
    /// The connection has no room for it: too many bytes wait to be written, or too many requests wait for
    /// their replies.
    NoRoom(SendError),
    /// The handle was closed.
    Closed,
    /// The system has no thread or file for the engine of a blocking handle.
    NoEngine {
        /// The operating system's message.
        detail: String,
    },
    /// A stop ([`crate::Robot::stop`]) was not sent: the arm may continue with its list.
    NotStopped(Box<NotSent>),
}

/// A request that the controller refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refused {
    /// A command.
    Command {
        /// The command.
        command: CommandName,
        /// The controller's reason, if it gives one.
        reason: Option<String>,
    },
    /// A change of the instruction list. Controllers have refused a list and run it all the same.
    InstructionList {
        /// The controller's reason, if it gives one.
        reason: Option<String>,
    },
    /// Points of a camera.
    Points {
        /// The controller's reason, if it gives one.
        reason: Option<String>,
    },
}

/// Why it is unknown whether the controller acted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OutcomeUnknown {
    /// No reply came in time.
    TimedOut {
        /// What was sent.
        request: Sent,
        /// The time limit of the reply.
        after: Duration,
        /// The last thing received in that time that answered nothing; `None` if nothing was received.
        heard: Option<String>,
    },
    /// The connection ended before the reply.
    ConnectionLost {
        /// What was sent, in whole or in part.
        request: Sent,
        /// How it ended.
        reason: LostReason,
    },
    /// A reply came that cannot be understood.
    Unreadable {
        /// What was sent.
        request: Sent,
        /// What is wrong with the reply.
        error: FieldError,
    },
    /// A reply came that says neither yes nor no.
    Unclear {
        /// What was sent.
        request: Sent,
        /// What it says, cut at 48 characters.
        answer: String,
    },
    /// A controller other than the one used before answered a query: its values are not handed out.
    /// [`crate::Robot::accept_identity`] accepts it as the expected one.
    AnotherRobot {
        /// What was sent.
        request: Sent,
        /// The controller that this handle was used with so far.
        expected: Box<Identity>,
        /// The controller that answered.
        found: Box<Identity>,
    },
}

impl OutcomeUnknown {
    /// What was sent.
    #[must_use]
    pub fn request(&self) -> Sent {
        match self {
            Self::TimedOut { request, .. }
            | Self::ConnectionLost { request, .. }
            | Self::Unreadable { request, .. }
            | Self::Unclear { request, .. }
            | Self::AnotherRobot { request, .. } => *request,
        }
    }
}

/// A request that left: its word on the wire and what it can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sent {
    /// The command's word, or the type of any other request.
    pub word: &'static str,
    /// What it can do.
    pub effect: Effect,
}

impl Sent {
    pub(crate) const QUERY: Self = Self { word: "query", effect: Effect::Reads };
}

impl From<NotSent> for RequestError {
    fn from(error: NotSent) -> Self {
        Self::NotSent(error)
    }
}

impl From<Refused> for RequestError {
    fn from(error: Refused) -> Self {
        Self::Refused(error)
    }
}

impl From<OutcomeUnknown> for RequestError {
    fn from(error: OutcomeUnknown) -> Self {
        Self::OutcomeUnknown(error)
    }
}

impl fmt::Display for RequestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Invalid(error) => error.fmt(f),
            Self::NotSent(error) => error.fmt(f),
            Self::Refused(error) => error.fmt(f),
            Self::OutcomeUnknown(error) => error.fmt(f),
        }
    }
}

impl NotSent {
    /// What a person has to know first if a stop could not be sent ([`Self::NotStopped`]).
    pub const NOT_STOPPED: &str =
        "the arm was NOT stopped: it may go on with what is in its list; use the emergency stop";
}

impl fmt::Display for NotSent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Self::NotStopped(why) = self {
            return write!(f, "{}; {why}", Self::NOT_STOPPED);
        }
        f.write_str("nothing was sent: ")?;
        match self {
            Self::Unreachable { address, detail, .. } => write!(
                f,
                "{address} cannot be reached ({detail}); check the address, the cable, and on the pendant that its \
                 network page is set to server mode and this port"
            ),
            Self::ConnectTimedOut { address, after } => write!(
                f,
                "{address} did not take a connection within {after:?}; check the address and the cable, and close \
                 other programs that are connected: controllers take very few connections"
            ),
            Self::Disconnected => {
                f.write_str("the connection is lost; read the status, which connects anew, then decide whether to send it")
            }
            Self::StateNotRead => f.write_str(
                "the connection was lost and made anew, and the state of the machine was not read since, or could not be read \
                 of who it is; read the status first, then decide whether to send it",
            ),
            Self::AnotherRobot { expected, found } => write!(
                f,
                "another robot answers at this address: {found}; before the connection was lost it was {expected}. Check \
                 the cabling and the address. If the new one is meant, accept it or connect anew"
            ),
            Self::Unidentified { address, reason } => write!(
                f,
                "{address} took a connection but did not say who it is ({reason}); close other programs that are \
                 connected, look at the pendant, then try again"
            ),
            Self::Overtaken => f.write_str("a stop was asked for before it left; decide whether it is still wanted"),
            Self::Withdrawn => f.write_str("the permission to send it was withdrawn before it left"),
            Self::Busy { waited } => {
                write!(f, "it waited {waited:?} behind other requests; send less, then send it again")
            }
            Self::NoRoom(error) => write!(f, "{error}; wait for replies, then send it again"),
            Self::Closed => f.write_str("the handle is closed; connect again"),
            Self::NoEngine { detail } => {
                write!(f, "the system has no thread for this connection ({detail}); share one engine between robots")
            }
            Self::NotStopped(why) => why.fmt(f),
        }
    }
}

/// What a person has to know first if the outcome of a stop is unknown.
const STOP_UNKNOWN: &str =
    "the arm was NOT seen to stop: it may go on with what is in its list; use the emergency stop";

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, reason) = match self {
            Self::Command { command, reason } => (command.word(), reason),
            Self::InstructionList { reason } => ("the instruction list", reason),
            Self::Points { reason } => ("the points", reason),
        };
        write!(f, "the controller refused {what}")?;
        match reason {
            Some(reason) => write!(f, ": {}", printable(reason))?,
            None => f.write_str(" and gave no reason")?,
        }
        match self {
            Self::Command { command, .. } => write!(f, "; {}", command.info().if_refused),
            Self::InstructionList { .. } => f.write_str(
                "; look at the arm before anything else, because controllers have run lists that they refused; the list \
                 is taken in mode 7, without alarm, and only while the pendant's program sits in its step that waits for \
                 remote commands",
            ),
            Self::Points { .. } => {
                f.write_str("; check that the running program waits for points of this camera")
            }
        }
    }
}

impl OutcomeUnknown {
    /// What happened, without [`Self::advice`].
    #[must_use]
    pub fn what(&self) -> String {
        let Sent { word, effect } = self.request();
        let first = if effect == Effect::Stops { format!("{STOP_UNKNOWN}; {word}") } else { word.to_owned() };
        match self {
            Self::TimedOut { after, heard: None, .. } => format!("{first}: no reply within {after:?}"),
            Self::TimedOut { after, heard: Some(heard), .. } => {
                let heard = printable(heard);
                format!("{first}: no usable reply within {after:?}; what came last was {heard}")
            }
            Self::ConnectionLost { reason, .. } => {
                format!("{first}: the connection was lost before the reply ({reason})")
            }
            Self::Unreadable { error, .. } => format!("{first}: the reply cannot be understood: {error}"),
            Self::Unclear { answer, .. } => {
                format!("{first}: the reply is neither ok nor err: `{}`", printable(answer))
            }
            Self::AnotherRobot { expected, found, .. } => format!(
                "{first}: another robot answered at this address: {found}; before the connection was lost it was {expected}. \
                 Check the cabling and the address. If the new one is meant, accept it or connect anew"
            ),
        }
    }

    /// What to do next about this request. `None` if another robot answered, where it is about the robot.
    #[must_use]
    pub fn advice(&self) -> Option<&'static str> {
        if let Self::AnotherRobot { .. } = self {
            return None;
        }
        Some(match self.request().effect {
            Effect::Reads => "it only reads, so ask again",
            Effect::Changes => "it may have acted: read the value back before sending it again",
            Effect::Moves => {
                "the arm may move, now or at the next start. Do not send it again: look at the arm, stop it, clear the \
                 list, and begin anew"
            }
            Effect::Stops => "send it again until the arm is seen to stand",
        })
    }
}

impl fmt::Display for OutcomeUnknown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what())?;
        match self.advice() {
            Some(advice) => write!(f, "; {advice}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for RequestError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Invalid(error) => Some(error),
            Self::NotSent(error) => Some(error),
            Self::Refused(error) => Some(error),
            Self::OutcomeUnknown(error) => Some(error),
        }
    }
}
impl std::error::Error for NotSent {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::NoRoom(error) => Some(error),
            Self::NotStopped(why) => Some(&**why),
            Self::Unreachable { .. }
            | Self::ConnectTimedOut { .. }
            | Self::Disconnected
            | Self::StateNotRead
            | Self::AnotherRobot { .. }
            | Self::Unidentified { .. }
            | Self::Overtaken
            | Self::Withdrawn
            | Self::Busy { .. }
            | Self::Closed
            | Self::NoEngine { .. } => None,
        }
    }
}
impl std::error::Error for Refused {}
impl std::error::Error for OutcomeUnknown {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Unreadable { error, .. } => Some(error),
            Self::TimedOut { .. }
            | Self::ConnectionLost { .. }
            | Self::Unclear { .. }
            | Self::AnotherRobot { .. } => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(command: CommandName, reason: &str) -> String {
        Refused::Command { command, reason: Some(reason.to_owned()) }.to_string()
    }

    #[test]
    fn the_advice_is_about_the_command_that_was_refused() {
        for (command, words) in [
            (CommandName::ActionStop, "use the emergency stop"),
            (CommandName::StartButton, "in auto"),
            (CommandName::ClearAlarm, "remove the cause of the alarm"),
            (CommandName::ModifyGspd, "0 to 100 percent"),
            (CommandName::SwitchMold, "moldList"),
            (CommandName::ModifyCounter, "counterList"),
            (CommandName::RewriteData, "800 to 900"),
        ] {
            let told = told(command, "no");
            assert!(told.starts_with(&format!("the controller refused {command}: no; ")), "{told}");
            assert!(told.contains(words), "{told}");
        }
        // Only the advice on commands that start the machine mentions its mode.
        for command in [CommandName::ModifyGspd, CommandName::SwitchMold, CommandName::ModifyOutput] {
            assert!(!told(command, "no").contains("mode"), "{command}");
        }
    }

    #[test]
    fn an_error_leads_to_the_error_that_it_holds() {
        use std::error::Error;

        let stop = NotSent::NotStopped(Box::new(NotSent::NoRoom(SendError::TooManyInFlight { limit: 16 })));
        let error = crate::WaitError::Request(stop.into());
        let mut chain: Vec<&(dyn Error + 'static)> = vec![&error];
        while let Some(held) = chain[chain.len() - 1].source() {
            chain.push(held);
        }
        assert!(chain[1].is::<RequestError>(), "{chain:?}");
        assert!(chain[2].is::<NotSent>() && chain[3].is::<NotSent>(), "{chain:?}");
        assert!(chain[4].is::<SendError>() && chain.len() == 5, "{chain:?}");
        // Each text includes the text of the error that it holds.
        for pair in chain.windows(2) {
            assert!(pair[0].to_string().contains(&pair[1].to_string()), "{chain:?}");
        }
    }

    /// What a program sees that walks down the chain of an error, as error reporters do.
    #[test]
    fn each_error_of_the_crate_leads_to_its_cause() {
        use std::error::Error;

        use r6_proto::error::{EncodeError, FieldPath, Wanted};

        let wrong = || Invalid::Value(EncodeError { field: "speed", wanted: "a number", nearest: None });
        assert!(wrong().source().is_some_and(|held| held.is::<EncodeError>()));
        let path = FieldPath::Member("cmdReply".to_owned());
        let error = FieldError { path, found: None, wanted: Wanted(&["a list", "列表"]), nearest: None };
        let unknown = OutcomeUnknown::Unreadable { request: Sent::QUERY, error };
        assert!(unknown.source().is_some_and(|held| held.is::<FieldError>()));
        let unread = crate::RegisterError::Request(wrong().into());
        assert!(unread.source().is_some_and(|held| held.is::<RequestError>()));
        let cause = crate::Cause::Unreadable(wrong().into());
        assert!(cause.source().is_some_and(|held| held.is::<RequestError>()));
        let ended = crate::MotionError { cause, progress: crate::Progress::default(), stop: None };
        assert!(ended.source().is_some_and(|held| held.is::<crate::Cause>()));
    }

    #[test]
    fn a_reason_cannot_forge_a_line() {
        let told = told(CommandName::ModifyGspd, "no\r\nREADY\u{1b}[2J");
        assert!(told.contains(r"no\r\nREADY\u{1b}[2J"), "{told}");
        assert!(!told.chars().any(char::is_control), "{told:?}");
    }
}
