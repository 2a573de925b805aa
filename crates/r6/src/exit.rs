//! How a run of r6 ends: an exit code, and for a failure one or two lines. They say what failed, where, and
//! what to do.

use std::borrow::Cow;
use std::fmt;
use std::process::ExitCode;

use r6_client::{Effect, Identity, Invalid, NotSent, OutcomeUnknown, RequestError, WaitError};
use r6_program::Mistakes;
use r6_proto::printable;
use serde_json::{Map, Value, json};

use crate::hint;
use crate::output::alarm;
use crate::output::problem::Code;

/// Expands to the exit codes, because `concat!` takes no constants.
macro_rules! codes {
    () => {
        "\
Exit codes:
  0  done
  1  refused by the controller or by a guard, or a condition is not met; a motion that ended early, and the
     arm was seen to stand; `inspect`: something is wrong; `plot`: the program does not get to its end;
     the answer to a query could not be written
  2  usage: the command line or a file is wrong, nothing was sent; `sim`, `up`: a port is taken
  3  unreachable, or no reply
  4  outcome unknown: the request left and may have acted, or what came of it could not be written;
     look at the machine before going on"
    };
}

/// The exit codes, for the help.
pub const CODES: &str = codes!();

/// Examples and exit codes, for the long help.
pub const EXAMPLES_AND_CODES: &str = concat!(
    "\
Examples:
  r6 up                                             a whole cell on this machine; then, in a second shell:
  r6 status                                         what it does, and whether it takes motion
  r6 move axes 10 0 0 0 30 0 --speed 50 --wait      the first motion
  r6 watch axis-0 axis-1 isMoving --every 100ms
  r6 panel estop                                    what a person does at a virtual machine
  r6 stop
  r6 -r 192.168.1.10 status                         the same for a real controller

",
    codes!()
);

/// How a run ends, as the shell sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Exit {
    /// 0: done.
    #[default]
    Done,
    /// 1: the controller refused, or a condition was not met.
    Refused,
    /// 2: the command line or a file is wrong; nothing was sent.
    Usage,
    /// 3: no connection, or no reply to a query.
    NoReply,
    /// 4: a request left and may have acted.
    Unknown,
}

impl Exit {
    /// The code for the shell.
    pub fn code(self) -> ExitCode {
        ExitCode::from(self.number())
    }

    /// The code as a number.
    pub fn number(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Refused => 1,
            Self::Usage => 2,
            Self::NoReply => 3,
            Self::Unknown => 4,
        }
    }
}

/// Why a run failed, with the text that is printed.
#[derive(Debug, PartialEq, Eq)]
pub struct Failure {
    exit: Exit,
    code: Code,
    what: String,
    /// The end of the first line: send this request again.
    again: Option<&'static str>,
    advice: Option<String>,
    /// The lines for people, if a file is wrong.
    mistakes: Option<String>,
    /// Further members of the JSON object for programs.
    members: Map<String, Value>,
    /// Whether stdout already reported the failure to programs.
    told: bool,
    /// Whether stderr already reported the failure to people.
    said: bool,
}

impl Failure {
    /// The controller or a guard refused, or a condition is not met.
    pub fn refused(what: impl fmt::Display) -> Self {
        Self::new(Exit::Refused, Code::Refused, what)
    }

    /// The command line or a file is wrong.
    pub fn usage(what: impl fmt::Display) -> Self {
        Self::new(Exit::Usage, Code::Usage, what)
    }

    /// A file is wrong. Each mistake has a line `FILE:LINE:COLUMN: …`, which editors can parse, and below it
    /// the advice.
    pub fn in_file(file: &str, mistakes: &Mistakes) -> Self {
        let lines: Vec<_> = mistakes.lines(file).map(|line| printable(&line).to_string()).collect();
        let listed: Vec<_> = mistakes
            .iter()
            .map(|mistake| {
                let (line, column) = mistake.at.unzip();
                let (text, advice) = (mistake.what.clone(), mistake.advice.clone());
                r6_api::Mistake { file: file.to_owned(), line, column, text, advice }
            })
            .collect();
        let first = mistakes.first();
        let failure = Self::usage(first.line(file)).member("mistakes", json!(listed));
        Self { advice: first.advice.clone(), mistakes: Some(lines.join("\n")), ..failure }
    }

    /// The same about a program with this name. A gateway tells each mistake as a line `LINE:COLUMN: …`. Here
    /// it has the name before it, as the mistakes of a file have.
    pub fn in_program(self, name: &str) -> Self {
        let (mut lines, mut listed) = (Vec::new(), Vec::new());
        for line in self.what.lines() {
            let place = place(line);
            let is_last = || line.starts_with("and ") && line.ends_with(" more");
            lines.push(match place {
                Some(_) => format!("{name}:{line}"),
                None if lines.is_empty() => format!("{name}: {line}"),
                None if is_last() => format!("{line} mistakes in {name}"),
                None => format!("    {line}"),
            });
            if place.is_some() || listed.is_empty() {
                let (line, column) = place.map(|(line, column, _)| (line, column)).unzip();
                let text = place.map_or(self.what.as_str(), |(.., text)| text).to_owned();
                listed.push(r6_api::Mistake { file: name.to_owned(), line, column, text, advice: None });
            }
        }
        let what = lines.first().cloned().unwrap_or_default();
        let lines: Vec<_> = lines.iter().map(|line| printable(line).to_string()).collect();
        Self { what, mistakes: Some(lines.join("\n")), ..self }.member("mistakes", json!(listed))
    }

    /// The outcome of a request is unknown.
    pub fn unknown(what: impl fmt::Display) -> Self {
        Self::new(Exit::Unknown, Code::OutcomeUnknown, what)
    }

    /// There is no connection, or no reply to a query.
    pub fn no_reply(what: impl fmt::Display) -> Self {
        Self::new(Exit::NoReply, Code::NoReply, what)
    }

    fn new(exit: Exit, code: Code, what: impl fmt::Display) -> Self {
        Self {
            exit,
            code,
            what: what.to_string(),
            again: None,
            advice: None,
            mistakes: None,
            members: Map::new(),
            told: false,
            said: false,
        }
    }

    /// Replaces the code for programs.
    pub fn with_code(mut self, code: Code) -> Self {
        self.code = code;
        self
    }

    /// Adds a member to the JSON object for programs.
    pub fn member(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.members.insert(name.to_owned(), value.into());
        self
    }

    /// Marks the failure as already reported to people on stderr.
    pub fn said(mut self) -> Self {
        self.said = true;
        self
    }

    /// Marks the failure as already reported to programs on stdout.
    pub fn told(mut self) -> Self {
        self.told = true;
        self
    }

    /// Sets the second line: what to do.
    pub fn advise(mut self, advice: impl Into<String>) -> Self {
        self.advice = Some(advice.into());
        self
    }

    /// Puts the action that failed before the message.
    pub fn while_doing(mut self, what: impl fmt::Display) -> Self {
        self.what = format!("{what}: {}", self.what);
        self
    }

    /// Puts more important text before the message.
    pub fn lead(mut self, first: impl fmt::Display) -> Self {
        self.what = format!("{first}; {}", self.what);
        self
    }

    /// Appends text to the first line.
    pub fn add(mut self, more: impl fmt::Display) -> Self {
        self.what = format!("{}; {more}", self.what());
        self.again = None;
        self
    }

    /// Replaces the exit code.
    pub fn with_exit(mut self, exit: Exit) -> Self {
        self.exit = exit;
        self
    }

    /// Changes the advice for a controller that accepted the connection and never answered on it: sending
    /// again does not help.
    pub fn unanswered(self) -> Self {
        Self { again: None, ..self }.advise(
            "the connection was made and nothing came back over it: other programs may hold all the connections of the \
             controller: close them (`r6 watch`, a panel, a PLC), then try again",
        )
    }

    /// Removes the second line.
    pub fn without_advice(self) -> Self {
        Self { advice: None, ..self }
    }

    /// How the run ends.
    pub fn exit(&self) -> Exit {
        self.exit
    }

    /// What is wrong, in one line.
    pub fn what(&self) -> Cow<'_, str> {
        match self.again {
            None => Cow::Borrowed(&self.what),
            Some(again) => Cow::Owned(format!("{}; {again}", self.what)),
        }
    }

    /// What to do about it.
    pub fn advice(&self) -> Option<&str> {
        self.advice.as_deref()
    }

    /// The kind of failure, for programs.
    pub fn code(&self) -> Code {
        self.code
    }

    /// Further members of the JSON object for programs.
    pub fn members(&self) -> &Map<String, Value> {
        &self.members
    }

    /// Whether stderr already reported the failure to people.
    pub fn is_said(&self) -> bool {
        self.said
    }

    /// Whether stdout already reported the failure to programs.
    pub fn is_told(&self) -> bool {
        self.told
    }
}

/// Line, column and text of a line `LINE:COLUMN: text`.
fn place(line: &str) -> Option<(usize, usize, &str)> {
    let (number, rest) = line.split_once(':')?;
    let (column, text) = rest.split_once(": ")?;
    Some((number.parse().ok()?, column.parse().ok()?, text))
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(mistakes) = &self.mistakes {
            return f.write_str(mistakes);
        }
        // The text may quote the peer. Escaping control characters keeps the output at these two lines.
        write!(f, "r6: {}", printable(&self.what()))?;
        match &self.advice {
            Some(advice) => write!(f, "\n    {}", printable(advice)),
            None => Ok(()),
        }
    }
}

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
    fn each_mistake_of_a_program_that_a_gateway_keeps_has_its_name() {
        let told = |message: &str| Failure::usage(message).with_code(Code::BadProgram).in_program("pick@3");
        let failure = told("2:1: no `spead`; nearest: `speed`\n5:7: a\u{1b}[2J\nand 4 more");
        let wanted = "pick@3:2:1: no `spead`; nearest: `speed`\npick@3:5:7: a\\u{1b}[2J\nand 4 more mistakes in pick@3";
        assert_eq!(failure.to_string(), wanted);
        assert_eq!((failure.exit(), failure.code()), (Exit::Usage, Code::BadProgram));
        assert_eq!(failure.what(), "pick@3:2:1: no `spead`; nearest: `speed`");
        let listed = &failure.members()["mistakes"];
        assert_eq!(listed.as_array().map(Vec::len), Some(2), "{listed}");
        let wanted =
            json!({ "file": "pick@3", "line": 5, "column": 7, "text": "a\u{1b}[2J", "advice": null });
        assert_eq!(listed[1], wanted);

        let whole = told("it has no steps");
        assert_eq!(whole.to_string(), "pick@3: it has no steps");
        assert_eq!(whole.members()["mistakes"][0]["line"], Value::Null);
    }

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
