//! What programs are told of a failure: one JSON object, the same for every command.

use serde_json::{Map, Value, json};

use crate::exit::Failure;

/// The problem object of a failure: `code` (a word that does not change), `message`, `advice` (`null` where there is none) and
/// `exit` (the exit code). Where the command has more to tell, its members stand beside these.
pub fn object(failure: &Failure) -> Value {
    let mut object = Map::new();
    object.extend(failure.members().clone());
    object.insert("code".to_owned(), json!(failure.code().word()));
    object.insert("message".to_owned(), json!(failure.what()));
    object.insert("advice".to_owned(), json!(failure.advice()));
    object.insert("exit".to_owned(), json!(failure.exit().number()));
    Value::Object(object)
}

/// What kind of failure it is: the `code` of a problem object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Code {
    /// The command line or a file is wrong.
    Usage,
    /// No connection could be made.
    Unreachable,
    /// There is no usable connection to the robot any more, or it does not say who it is.
    NoConnection,
    /// A question got no usable answer.
    NoReply,
    /// The request waited too long behind others.
    Busy,
    /// Another robot answers.
    AnotherRobot,
    /// The controller, or the panel, said no.
    Refused,
    /// It goes beyond the limits of `--guard` and its like.
    BeyondLimits,
    /// The machine does not take motion now.
    NotReady,
    /// Instructions are left in the list.
    LeftoverList,
    /// An alarm ended it.
    Alarm,
    /// Somebody stopped it.
    Stopped,
    /// The controller was switched off and on meanwhile.
    Restarted,
    /// Nothing went on.
    Stalled,
    /// The arm stands elsewhere.
    NotAtTarget,
    /// A signal ended it, or stdout could not be written.
    Interrupted,
    /// The time of `--timeout` was up.
    TimedOut,
    /// A request left and may have acted.
    OutcomeUnknown,
    /// A stop was not sent, or not seen to take effect.
    NotStopped,
    /// The controller has no such value.
    NoValue,
    /// A program does not get to its end.
    NotFinished,
    /// Captured traffic has problems.
    ProblemsFound,
}

impl Code {
    /// All of them, in the order of the documentation.
    #[cfg(test)]
    pub const ALL: [Self; 22] = [
        Self::Usage,
        Self::Unreachable,
        Self::NoConnection,
        Self::NoReply,
        Self::Busy,
        Self::AnotherRobot,
        Self::Refused,
        Self::BeyondLimits,
        Self::NotReady,
        Self::LeftoverList,
        Self::Alarm,
        Self::Stopped,
        Self::Restarted,
        Self::Stalled,
        Self::NotAtTarget,
        Self::Interrupted,
        Self::TimedOut,
        Self::OutcomeUnknown,
        Self::NotStopped,
        Self::NoValue,
        Self::NotFinished,
        Self::ProblemsFound,
    ];

    /// The word for programs.
    pub fn word(self) -> &'static str {
        match self {
            Self::Usage => "usage",
            Self::Unreachable => "unreachable",
            Self::NoConnection => "no_connection",
            Self::NoReply => "no_reply",
            Self::Busy => "busy",
            Self::AnotherRobot => "another_robot",
            Self::Refused => "refused",
            Self::BeyondLimits => "beyond_limits",
            Self::NotReady => "not_ready",
            Self::LeftoverList => "leftover_list",
            Self::Alarm => "alarm",
            Self::Stopped => "stopped",
            Self::Restarted => "restarted",
            Self::Stalled => "stalled",
            Self::NotAtTarget => "not_at_target",
            Self::Interrupted => "interrupted",
            Self::TimedOut => "timed_out",
            Self::OutcomeUnknown => "outcome_unknown",
            Self::NotStopped => "not_stopped",
            Self::NoValue => "no_value",
            Self::NotFinished => "not_finished",
            Self::ProblemsFound => "problems_found",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exit::Exit;

    #[test]
    fn a_problem_has_code_message_advice_and_exit() {
        let failure = Failure::refused("the controller said no").advise("ask again");
        let wanted = json!({
            "code": "refused", "message": "the controller said no", "advice": "ask again", "exit": 1,
        });
        assert_eq!(object(&failure), wanted);
        let failure = Failure::usage("no such file").member("event", "failed").with_exit(Exit::Unknown);
        assert_eq!(object(&failure)["event"], "failed");
        assert_eq!(object(&failure)["exit"], 4);
    }

    #[test]
    fn every_code_is_documented() {
        let page = include_str!("../../../../docs/COMMAND_LINE.md");
        for code in Code::ALL {
            assert!(page.contains(&format!("| `{}` |", code.word())), "{code:?}");
        }
    }
}
