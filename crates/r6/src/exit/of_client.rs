//! How a run ends after a failure of the client: a request that failed, or a motion that could not be waited
//! for.

use r6_client::{Effect, Identity, Invalid, NotSent, OutcomeUnknown, RequestError, WaitError};
use r6_proto::printable;

use super::{Exit, Failure};
use crate::hint;
use crate::output::alarm;
use crate::output::problem::Code;

impl From<RequestError> for Failure {
    fn from(error: RequestError) -> Self {
        let exit = match &error {
            RequestError::Invalid(invalid) => of_invalid(invalid),
            RequestError::NotSent(
                NotSent::NotStopped(_)
                | NotSent::Unreachable { .. }
                | NotSent::ConnectTimedOut { .. }
                | NotSent::Disconnected
                | NotSent::StateNotRead
                | NotSent::Unidentified { .. }
                | NotSent::Overtaken
                | NotSent::Withdrawn
                | NotSent::Busy { .. }
                | NotSent::NoRoom(_)
                | NotSent::Closed
                | NotSent::NoEngine { .. },
            ) => Exit::NoReply,
            RequestError::NotSent(NotSent::AnotherRobot { .. }) | RequestError::Refused(_) => Exit::Refused,
            RequestError::OutcomeUnknown(unknown) => match unknown.request().effect {
                Effect::Reads => match unknown {
                    OutcomeUnknown::AnotherRobot { .. } => Exit::Refused,
                    OutcomeUnknown::TimedOut { .. }
                    | OutcomeUnknown::ConnectionLost { .. }
                    | OutcomeUnknown::Unreadable { .. }
                    | OutcomeUnknown::Unclear { .. } => Exit::NoReply,
                },
                Effect::Changes | Effect::Moves | Effect::Stops => Exit::Unknown,
            },
        };
        let failure = match &error {
            RequestError::OutcomeUnknown(unknown) if error.may_send_again() => {
                Self { again: unknown.advice(), ..Self::new(exit, code_of(&error), unknown.what()) }
            }
            error => Self::new(exit, code_of(error), error),
        };
        match &error {
            RequestError::NotSent(NotSent::Unreachable { address, .. }) if is_local(address) => {
                failure.advise("for a virtual controller, start `r6 up` in another shell")
            }
            error if is_another_robot(error) => failure.advise(who_answers()),
            RequestError::Invalid(_)
            | RequestError::NotSent(_)
            | RequestError::Refused(_)
            | RequestError::OutcomeUnknown(_) => failure,
        }
    }
}

/// Whether the error says that another robot answered.
pub fn is_another_robot(error: &RequestError) -> bool {
    match error {
        RequestError::NotSent(NotSent::NotStopped(why)) => matches!(**why, NotSent::AnotherRobot { .. }),
        RequestError::NotSent(NotSent::AnotherRobot { .. })
        | RequestError::OutcomeUnknown(OutcomeUnknown::AnotherRobot { .. }) => true,
        RequestError::Invalid(_)
        | RequestError::NotSent(_)
        | RequestError::Refused(_)
        | RequestError::OutcomeUnknown(_) => false,
    }
}

/// Advice for the case that another robot answers.
fn who_answers() -> String {
    format!(
        "`{}` shows who answers now; run the command again only if that robot is meant, and look at the other one, which may \
         still move",
        hint::r6("status")
    )
}

/// The failure when a part of a motion was sent, and then the state could not be read or the rest could not
/// be sent. The text of the error is not used, because it is about one request. It may say that nothing was
/// sent, or that sending again is safe, and neither is true of the motion.
pub fn after_a_part_left(doing: &str, error: &RequestError) -> Failure {
    let failure = Failure::unknown(format!("{doing}: {}", why_not(error)));
    if is_another_robot(error) {
        return failure.with_code(Code::AnotherRobot).advise(who_answers());
    }
    failure.advise(format!(
        "look at the arm, then at `{}`; do not send the list again before",
        hint::r6("status")
    ))
}

/// Says why there was no answer, without statements about one request.
pub fn why_not(error: &RequestError) -> String {
    match error {
        RequestError::NotSent(why) => why_not_sent(why),
        RequestError::OutcomeUnknown(OutcomeUnknown::TimedOut { after, .. }) => {
            format!("no usable reply within {after:?}")
        }
        RequestError::OutcomeUnknown(OutcomeUnknown::ConnectionLost { reason, .. }) => {
            format!("the connection was lost ({reason})")
        }
        RequestError::OutcomeUnknown(OutcomeUnknown::AnotherRobot { expected, found, .. }) => {
            another_robot(expected, found)
        }
        RequestError::OutcomeUnknown(OutcomeUnknown::Unreadable { error, .. }) => {
            format!("the reply cannot be understood: {error}")
        }
        RequestError::OutcomeUnknown(OutcomeUnknown::Unclear { answer, .. }) => {
            format!("the reply is neither ok nor err: `{}`", printable(answer))
        }
        RequestError::Invalid(_) | RequestError::Refused(_) => error.to_string(),
    }
}

fn why_not_sent(why: &NotSent) -> String {
    match why {
        NotSent::Unreachable { address, detail, .. } => {
            format!("{address} cannot be reached any more ({detail})")
        }
        NotSent::ConnectTimedOut { address, after } => {
            format!("{address} did not take a new connection within {after:?}")
        }
        NotSent::Disconnected | NotSent::StateNotRead => "the connection was lost".to_owned(),
        NotSent::AnotherRobot { expected, found } => another_robot(expected, found),
        NotSent::Unidentified { address, reason } => {
            format!("{address} took a new connection but did not say who it is ({reason})")
        }
        NotSent::Overtaken => "a stop was asked for before it left".to_owned(),
        NotSent::Withdrawn => "the permission to send it was withdrawn before it left".to_owned(),
        NotSent::Busy { waited } => format!("the request waited {waited:?} behind others"),
        NotSent::NoRoom(error) => error.to_string(),
        NotSent::Closed => "the connection was closed".to_owned(),
        NotSent::NoEngine { detail } => format!("the system has no thread for the connection ({detail})"),
        NotSent::NotStopped(why) => why_not_sent(why),
    }
}

fn another_robot(expected: &Identity, found: &Identity) -> String {
    format!(
        "another robot answers at this address: {found}; the motion was sent to {expected}; check the cabling and the address"
    )
}

/// Only an envelope violation is a refusal. All other errors are in the command line or in a file.
fn of_invalid(invalid: &Invalid) -> Exit {
    match invalid {
        Invalid::OutsideEnvelope(_) => Exit::Refused,
        Invalid::BadAddress { .. } | Invalid::Value(_) | Invalid::TooLong { .. } | Invalid::Step(_) => {
            Exit::Usage
        }
        Invalid::NotStopped(why) => of_invalid(why),
    }
}

/// The code for programs.
fn code_of(error: &RequestError) -> Code {
    match error {
        RequestError::Invalid(invalid) => code_of_invalid(invalid),
        RequestError::NotSent(not_sent) => match not_sent {
            NotSent::Unreachable { .. } | NotSent::ConnectTimedOut { .. } | NotSent::NoEngine { .. } => {
                Code::Unreachable
            }
            NotSent::Disconnected
            | NotSent::StateNotRead
            | NotSent::Unidentified { .. }
            | NotSent::Closed => Code::NoConnection,
            NotSent::Overtaken | NotSent::Withdrawn => Code::Stopped,
            NotSent::Busy { .. } | NotSent::NoRoom(_) => Code::Busy,
            NotSent::AnotherRobot { .. } => Code::AnotherRobot,
            NotSent::NotStopped(_) => Code::NotStopped,
        },
        RequestError::Refused(_) => Code::Refused,
        RequestError::OutcomeUnknown(OutcomeUnknown::AnotherRobot { .. }) => Code::AnotherRobot,
        RequestError::OutcomeUnknown(unknown) => match unknown.request().effect {
            Effect::Reads => Code::NoReply,
            Effect::Changes | Effect::Moves => Code::OutcomeUnknown,
            Effect::Stops => Code::NotStopped,
        },
    }
}

fn code_of_invalid(invalid: &Invalid) -> Code {
    match invalid {
        Invalid::BadAddress { .. } | Invalid::Value(_) | Invalid::TooLong { .. } | Invalid::Step(_) => {
            Code::Usage
        }
        Invalid::OutsideEnvelope(_) => Code::BeyondLimits,
        Invalid::NotStopped(_) => Code::NotStopped,
    }
}

fn is_local(address: &str) -> bool {
    ["127.", "localhost", "[::1]"].iter().any(|start| address.starts_with(start))
}

/// The controller was switched off and on during a motion.
pub fn restarted(restart: &r6_client::Restart) -> Failure {
    Failure::refused(restart).with_code(Code::Restarted).advise(format!(
        "look at the machine first, then at `{}`: it has to be started, and perhaps homed, before it moves again",
        hint::r6("status")
    ))
}

impl From<WaitError> for Failure {
    fn from(error: WaitError) -> Self {
        match error {
            WaitError::AlarmRaised { code } => {
                Self::refused(format!("the motion ended with alarm {}", alarm::short(code)))
                    .advise(format!(
                        "{}; `{}` clears the rest of the list",
                        alarm::advice(code),
                        hint::r6("stop")
                    ))
                    .with_code(Code::Alarm)
            }
            WaitError::Stopped { mode } => {
                Self::refused(format!("the motion was stopped: the operation mode is now {mode}"))
                    .with_code(Code::Stopped)
                    .advise(format!(
                        "the rest of the list may start again later: `{}` clears it",
                        hint::r6("stop")
                    ))
            }
            WaitError::Restarted(restart) => restarted(&restart),
            WaitError::TimedOut { after, list_length } => {
                let left = match list_length {
                    Some(1) => ", with 1 instruction left in the list".to_owned(),
                    Some(length) => format!(", with {length} instructions left in the list"),
                    None => String::new(),
                };
                let what = format!("not done within {after:?}{left}; the arm may go on moving");
                Self::unknown(what).with_code(Code::TimedOut).advise(format!(
                    "look with `{}`, end it with `{}`; --timeout waits longer",
                    hint::r6("status"),
                    hint::r6("stop")
                ))
            }
            WaitError::AnotherConnection => {
                Self::unknown(&error).advise(format!("look with `{}`, then decide", hint::r6("status")))
            }
            WaitError::Motion(error) => Self::unknown(error),
            WaitError::Request(error) => {
                after_a_part_left("the list was sent, then the state could not be read", &error)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::ErrorKind;
    use std::time::Duration;

    use r6_client::{LostReason, Sent};

    use super::*;

    #[test]
    fn what_is_said_after_a_part_left_is_not_about_one_request() {
        let request = Sent { word: "query", effect: Effect::Reads };
        let address = "127.0.0.1:9760".to_owned();
        let (after, robot) = (Duration::from_secs(2), Box::<Identity>::default());
        for (error, words) in [
            (NotSent::Disconnected.into(), "the connection was lost"),
            (NotSent::StateNotRead.into(), "the connection was lost"),
            (
                NotSent::Unreachable { address, kind: ErrorKind::Other, detail: "no".to_owned() }.into(),
                "cannot be reached any more (no)",
            ),
            (NotSent::Busy { waited: after }.into(), "waited 2s"),
            (OutcomeUnknown::TimedOut { request, after, heard: None }.into(), "within 2s"),
            (
                OutcomeUnknown::ConnectionLost { request, reason: LostReason::ClosedByPeer }.into(),
                "was lost (",
            ),
            (
                OutcomeUnknown::AnotherRobot { request, expected: robot.clone(), found: robot }.into(),
                "another robot answers",
            ),
        ] {
            let error: RequestError = error;
            let failure = after_a_part_left("the list was sent", &error);
            let text = failure.to_string();
            assert!(text.starts_with("r6: the list was sent: ") && text.contains(words), "{text}");
            for wrong in ["nothing was sent", "ask again", "send it again", "r6 up", "accept_identity"] {
                assert!(!text.contains(wrong), "{wrong}: {text}");
            }
            assert_eq!(failure.exit(), Exit::Unknown);
        }
    }
}
