//! The HTTP status of each problem of the gateway.

use axum::extract::rejection::QueryRejection;
use axum::http::StatusCode;
use r6_api::Code;
use r6_http::Refusal;

use crate::problem::Problem;

/// A problem as an answer.
pub fn of(problem: Problem) -> Refusal {
    match problem.retry_after {
        Some(after) => Refusal::too_many(after),
        None => {
            let refusal = Refusal::new(status(problem.code), problem.code, problem.message);
            refusal.of_command(problem.command_id)
        }
    }
}

/// `bad_value`: a value of the request is wrong.
pub fn bad_value(message: impl Into<String>) -> Refusal {
    of(Problem::new(Code::BadValue, message))
}

/// A parameter behind the `?` of an address that is wrong.
pub fn of_query(rejection: QueryRejection) -> Refusal {
    bad_value(told_of(&rejection))
}

/// The same, where the header `Accept` says the form of the answer.
pub fn of_query_for_forms(rejection: QueryRejection) -> Refusal {
    let mut told = told_of(&rejection);
    if told.contains("unknown field `format`") {
        told.push_str("; the header `Accept` says the form, such as `Accept: text/csv`");
    }
    bad_value(told)
}

/// What is wrong, without how it was found out.
fn told_of(rejection: &QueryRejection) -> String {
    let text = rejection.body_text();
    text.strip_prefix("Failed to deserialize query string: ").unwrap_or(&text).to_owned()
}

/// Work that was given up, because the process ends.
pub fn of_lost_work(_: tokio::task::JoinError) -> Refusal {
    let message = "the gateway ended before the answer: whether it was done is not known";
    Refusal::new(StatusCode::GATEWAY_TIMEOUT, Code::OutcomeUnknown, message)
}

/// A file for the answer that could not be made.
pub fn of_file(error: impl std::fmt::Display) -> Refusal {
    of(Problem::new(Code::StoreUnavailable, format!("the file cannot be made: {error}")))
}

fn status(code: Code) -> StatusCode {
    match code {
        Code::NoToken | Code::NoSession | Code::WrongPassword => StatusCode::UNAUTHORIZED,
        Code::NotAllowed | Code::BadCsrf => StatusCode::FORBIDDEN,
        Code::NoSuchRobot
        | Code::NoSuchProgram
        | Code::NoSuchPoint
        | Code::NoSuchUser
        | Code::NoSuchToken
        | Code::NoSuchAlarm
        | Code::NoSuchRun
        | Code::NoPanel => StatusCode::NOT_FOUND,
        Code::LinkVoid => StatusCode::GONE,
        Code::NeedsIfMatch => StatusCode::PRECONDITION_REQUIRED,
        Code::NotThisVersion => StatusCode::PRECONDITION_FAILED,
        Code::NeedsIdempotencyKey => StatusCode::BAD_REQUEST,
        Code::BadCommand
        | Code::BadValue
        | Code::BadProgram
        | Code::BeyondLimits
        | Code::KeyTaken
        | Code::BadAction
        | Code::NoSuchInput
        | Code::NoSuchAxis
        | Code::NoDistance
        | Code::BadFault
        | Code::BadSpeed => StatusCode::UNPROCESSABLE_ENTITY,
        Code::StoreUnavailable | Code::Overloaded | Code::NoOwner => StatusCode::SERVICE_UNAVAILABLE,
        Code::OutcomeUnknown | Code::NotStopped | Code::NoReply => StatusCode::GATEWAY_TIMEOUT,
        // The state of the robot, of its lease or of its configuration does not allow it now.
        _ => StatusCode::CONFLICT,
    }
}
