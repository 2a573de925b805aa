//! Why something was not done, for programs and for people.

use serde::{Deserialize, Serialize};

/// Why a request was not carried out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Problem {
    /// A word that does not change: for programs.
    #[cfg_attr(feature = "openapi", schema(example = "not_manual"))]
    pub code: Code,
    /// What is wrong and what to do, in a sentence: for people.
    pub message: String,
    /// The number of the command in the audit log of the gateway: its intent was written, and its outcome
    /// stands there too, as far as it is known. Missing for everything else.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command_id: Option<u64>,
    /// When it can be tried again. Missing if that is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub retry_after_ms: Option<u64>,
}

impl Problem {
    /// A problem with this code and this sentence.
    pub fn new(code: Code, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), command_id: None, retry_after_ms: None }
    }
}

/// Why a command of `r6` failed, or would fail for the state that it is a part of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CommandProblem {
    /// A word that does not change: for programs.
    pub code: Code,
    /// What is wrong, in one line: for people.
    pub message: String,
    /// What to do; `null` where there is nothing to say.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub advice: Option<String>,
    /// The exit code of `r6`, 1 to 4 (`docs/COMMAND_LINE.md`).
    pub exit: u8,
}

/// A mistake of a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Mistake {
    /// The file.
    pub file: String,
    /// Its line, from 1; `null` for the whole file.
    pub line: Option<usize>,
    /// Its column in characters, from 1; `null` for the whole file.
    pub column: Option<usize>,
    /// What is wrong.
    pub text: String,
    /// How to correct it.
    pub advice: Option<String>,
}

/// One row per code: its meaning, its name here, its word.
macro_rules! codes {
    ($($(#[$meaning:meta])* $code:ident $word:literal,)*) => {
        /// What kind of problem it is. The words do not change; new ones may come.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        #[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
        #[serde(rename_all = "snake_case")]
        pub enum Code {
            $($(#[$meaning])* $code,)*
            /// A word that this version does not know. It is never sent.
            #[serde(other)]
            Unknown,
        }

        impl Code {
            /// All codes that r6 uses, in the order of the documentation.
            pub const ALL: &[Self] = &[$(Self::$code),*];

            /// The word for programs.
            #[must_use]
            pub fn word(self) -> &'static str {
                match self {
                    $(Self::$code => $word,)*
                    Self::Unknown => "unknown",
                }
            }
        }
    };
}

codes! {
    // The command line.
    /// The command line or a file is wrong.
    Usage "usage",
    /// No connection could be made.
    Unreachable "unreachable",
    /// The connection to the robot is no longer usable, or the robot does not identify itself.
    NoConnection "no_connection",
    /// A query got no usable answer.
    NoReply "no_reply",
    /// The request waited too long behind others.
    Busy "busy",
    /// Another robot answers.
    AnotherRobot "another_robot",
    /// The controller or the panel refused.
    Refused "refused",
    /// It exceeds the limits of `--guard` and similar options.
    BeyondLimits "beyond_limits",
    /// The machine does not take motion now.
    NotReady "not_ready",
    /// Instructions are left in the list from before.
    LeftoverList "leftover_list",
    /// An alarm ended it, or has to be cleared first.
    Alarm "alarm",
    /// It was stopped.
    Stopped "stopped",
    /// The controller was restarted meanwhile.
    Restarted "restarted",
    /// There was no progress.
    Stalled "stalled",
    /// The arm is not at its target.
    NotAtTarget "not_at_target",
    /// A signal ended it, or stdout could not be written.
    Interrupted "interrupted",
    /// The time of `--timeout` has passed.
    TimedOut "timed_out",
    /// A request was sent and may have been carried out.
    OutcomeUnknown "outcome_unknown",
    /// A stop was not sent, or not seen to take effect.
    NotStopped "not_stopped",
    /// The controller has no such value.
    NoValue "no_value",
    /// A program does not reach its end.
    NotFinished "not_finished",
    /// Captured traffic has problems.
    ProblemsFound "problems_found",

    // Requests over HTTP.
    /// The bytes are not a readable HTTP request.
    BadRequest "bad_request",
    /// The server speaks TLS, and the request came without.
    NeedsTls "needs_tls",
    /// The body is not JSON.
    BadJson "bad_json",
    /// The body could not be read.
    BadBody "bad_body",
    /// The `Content-Type` is not JSON.
    NotJson "not_json",
    /// The head or the body is too long.
    TooLong "too_long",
    /// The request was not complete in time.
    TooSlow "too_slow",
    /// The request names a host that is not this machine.
    ForeignHost "foreign_host",
    /// A web page in a browser sent the request.
    ForeignOrigin "foreign_origin",
    /// There is no such path.
    NoSuchPath "no_such_path",
    /// The path has no such method.
    NoSuchMethod "no_such_method",

    // The panel.
    /// There is no controller with this number.
    NoSuchController "no_such_controller",
    /// There is no such action.
    BadAction "bad_action",
    /// The mains have failed.
    PowerOff "power_off",
    /// The emergency stop is pressed.
    EmergencyStop "emergency_stop",
    /// The machine is not homed.
    NotHomed "not_homed",
    /// The mode key is not at auto.
    NotAuto "not_auto",
    /// The mode key is not at manual.
    NotManual "not_manual",
    /// The machine moves.
    Moving "moving",
    /// No axis moves as long as a button is held.
    NotHeld "not_held",
    /// The global speed is 0.
    NoGlobalSpeed "no_global_speed",
    /// The program cannot be used.
    Program "program",
    /// The program runs.
    ProgramRunning "program_running",
    /// There is no room for another one: a program, a run, a fault.
    NoRoom "no_room",
    /// There is no path for the arm to its target.
    NoPath "no_path",
    /// There is no such input.
    NoSuchInput "no_such_input",
    /// There is no such axis.
    NoSuchAxis "no_such_axis",
    /// A move by hand without a distance.
    NoDistance "no_distance",
    /// The speed is not above 0 and at most 100 percent.
    BadSpeed "bad_speed",
    /// There is no such alarm.
    NoSuchAlarm "no_such_alarm",
    /// There is no such fault, or its kind or a number of it is wrong.
    BadFault "bad_fault",
    /// The text is not a program.
    BadProgram "bad_program",

    // The gateway.
    /// The request has no valid token.
    NoToken "no_token",
    /// The session has ended, or the cookie is of no session.
    NoSession "no_session",
    /// The name or the password is wrong.
    WrongPassword "wrong_password",
    /// The one-time link is not valid any more.
    LinkVoid "link_void",
    /// A request with a session changes something and does not prove that its page belongs to the session.
    BadCsrf "bad_csrf",
    /// The caller made too many requests, or tried too many passwords.
    TooManyRequests "too_many_requests",
    /// The role of the caller does not allow it.
    NotAllowed "not_allowed",
    /// There is no user with this name.
    NoSuchUser "no_such_user",
    /// There is no token with this number.
    NoSuchToken "no_such_token",
    /// There is a user with this name already.
    NameTaken "name_taken",
    /// No admin who can sign in would be left.
    LastAdmin "last_admin",
    /// There is no robot with this name.
    NoSuchRobot "no_such_robot",
    /// The robot has no panel at the gateway: it is not a virtual robot of the gateway's own process.
    NoPanel "no_panel",
    /// The caller does not hold the lease.
    NoLease "no_lease",
    /// Another holds the lease.
    Leased "leased",
    /// The order came after the time until which it held.
    TooLate "too_late",
    /// A program runs on the robot.
    RunUnderWay "run_under_way",
    /// There is no run with this number.
    NoSuchRun "no_such_run",
    /// The request has no `Idempotency-Key`.
    NeedsIdempotencyKey "needs_idempotency_key",
    /// The request with this `Idempotency-Key` has no answer yet.
    InProgress "in_progress",
    /// This `Idempotency-Key` belongs to another request.
    KeyTaken "key_taken",
    /// Another robot than before answers.
    IdentityChanged "identity_changed",
    /// There is no such command, or its arguments are wrong.
    BadCommand "bad_command",
    /// A value of the request is wrong.
    BadValue "bad_value",
    /// The file or the command line of the gateway has this robot, or the settings of the hall, so the API
    /// cannot change it.
    ManagedByFile "managed_by_file",
    /// Another robot has this address.
    AddressTaken "address_taken",
    /// Too many requests wait for this robot.
    Overloaded "overloaded",
    /// There is no program with this name, or no such version of it.
    NoSuchProgram "no_such_program",
    /// There is no kept point with this name, or no such version of it.
    NoSuchPoint "no_such_point",
    /// A change of a program or a kept point has to say which version it is for.
    NeedsIfMatch "needs_if_match",
    /// The program or the kept point is not in the version that the change is for.
    NotThisVersion "not_this_version",
    /// The program has another text than the caller checked.
    OtherText "other_text",
    /// The store cannot be written.
    StoreUnavailable "store_unavailable",
    /// Another gateway owns the robots, or none does at the moment.
    NoOwner "no_owner",
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_has_one_word_and_is_documented() {
        let of_commands = include_str!("../../../docs/COMMAND_LINE.md");
        let of_http =
            concat!(include_str!("../../../docs/PANEL.md"), include_str!("../../../docs/GATEWAY.md"));
        let last_of_commands = Code::ALL.iter().position(|code| *code == Code::ProblemsFound).unwrap();
        for (number, code) in Code::ALL.iter().enumerate() {
            let word = code.word();
            assert_eq!(serde_json::to_value(code).unwrap(), word);
            let has_row = if number <= last_of_commands {
                of_commands.contains(&format!("\n| `{word}` | "))
            } else {
                // Status, codes, meaning.
                let codes = of_http.lines().filter_map(|line| line.strip_prefix("| ")?.split(" | ").nth(1));
                codes.flat_map(|codes| codes.split(", ")).any(|code| code == format!("`{word}`"))
            };
            assert!(has_row, "{code:?} is documented");
            assert_eq!(Code::ALL.iter().filter(|other| other.word() == word).count(), 1, "{word}");
        }
    }

    #[test]
    fn a_code_of_a_newer_version_can_be_read() {
        let problem: Problem = serde_json::from_str(r#"{"code":"of_tomorrow","message":"no"}"#).unwrap();
        assert_eq!(problem, Problem::new(Code::Unknown, "no"));
    }
}
