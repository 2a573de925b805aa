//! The JSON object for programs that describes a failure. It is the same for every command.

pub use r6_api::Code;
use r6_api::CommandProblem;
use serde_json::{Value, json};

use crate::exit::Failure;

/// The problem of a failure, without the members that a command adds.
pub fn of(failure: &Failure) -> CommandProblem {
    CommandProblem {
        code: failure.code(),
        message: failure.what().into_owned(),
        advice: failure.advice().map(str::to_owned),
        exit: failure.exit().number(),
    }
}

/// The object of a failure: its problem, and the members that a command adds.
pub fn object(failure: &Failure) -> Value {
    let mut object = json!(of(failure));
    for (name, value) in failure.members() {
        if object.get(name).is_none() {
            object[name] = value.clone();
        }
    }
    object
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
        assert_eq!(object(&failure.member("code", "mine"))["code"], "usage");
    }
}
