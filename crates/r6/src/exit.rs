//! How a run of r6 ends: an exit code, and for a failure one or two lines. They say what failed, where, and
//! what to do.

mod of_client;

use std::borrow::Cow;
use std::fmt;
use std::process::ExitCode;

use r6_program::Mistakes;
use r6_proto::printable;
use serde_json::{Map, Value, json};

pub use self::of_client::{after_a_part_left, is_another_robot, restarted, why_not};
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

#[cfg(test)]
mod tests {
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
}
