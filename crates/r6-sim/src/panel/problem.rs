//! What a request is told that was not carried out.

use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use r6_controller::Refused;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Why a request was not carried out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[schema(as = Problem)]
pub struct ProblemDto {
    /// A word that does not change: for programs.
    #[schema(example = "not_manual")]
    pub code: String,
    /// What is wrong and what to do, in a sentence: for people.
    pub message: String,
}

/// A problem and its status.
#[derive(Debug)]
pub(super) struct Problem {
    status: StatusCode,
    body: ProblemDto,
}

impl Problem {
    pub fn new(status: StatusCode, code: &str, message: impl Into<String>) -> Self {
        Self { status, body: ProblemDto { code: code.to_owned(), message: message.into() } }
    }

    /// 404.
    pub fn not_found(code: &str, message: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, code, message)
    }

    /// 403: a request that a page of a browser may have sent.
    pub fn foreign(code: &str, message: impl Into<String>) -> Self {
        Self::new(StatusCode::FORBIDDEN, code, message)
    }

    /// 422: JSON that is no action.
    pub fn bad_action(message: impl Into<String>) -> Self {
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, "bad_action", message)
    }

    /// 400, or 422 where it is JSON but no action.
    pub fn of_json(error: &serde_json::Error) -> Self {
        let text = error.to_string();
        if error.is_data() {
            Self::bad_action(with_nearest(&text))
        } else {
            Self::new(StatusCode::BAD_REQUEST, "bad_json", format!("the body is no JSON: {text}"))
        }
    }
}

impl From<Refused> for Problem {
    /// 409: the machine could do it, but not now; 422: never.
    fn from(refused: Refused) -> Self {
        let status = match &refused {
            Refused::PowerOff
            | Refused::EmergencyStop
            | Refused::Alarm { .. }
            | Refused::NotHomed
            | Refused::NotAuto { .. }
            | Refused::NotManual { .. }
            | Refused::Moving
            | Refused::NoGlobalSpeed
            | Refused::Program { .. }
            | Refused::ProgramRuns { .. }
            | Refused::NoRoom { .. }
            | Refused::NoPath { .. } => StatusCode::CONFLICT,
            Refused::BadProgram { .. }
            | Refused::NoSuchInput { .. }
            | Refused::NoSuchAxis { .. }
            | Refused::NoDistance
            | Refused::BadSpeed
            | Refused::NoSuchAlarm { .. } => StatusCode::UNPROCESSABLE_ENTITY,
        };
        Self::new(status, refused.code(), refused.to_string())
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        (self.status, Json(self.body)).into_response()
    }
}

/// Serde's words about an unknown one, which lists those there are, with the nearest of them.
fn with_nearest(text: &str) -> String {
    let words: Vec<_> = text.split('`').skip(1).step_by(2).collect();
    match words.split_first() {
        Some((word, known)) if text.starts_with("unknown ") => {
            match r6_proto::nearest(word, known.iter().copied()) {
                Some(near) => format!("{text}; nearest: `{near}`"),
                None => text.to_owned(),
            }
        }
        Some(_) | None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::panel::ActionDto;

    fn told(body: &str) -> String {
        let error = serde_json::from_str::<ActionDto>(body).unwrap_err();
        Problem::of_json(&error).body.message
    }

    #[test]
    fn an_unknown_word_gets_the_nearest() {
        for (body, near) in [
            (r#"{"do":"emergncy_stop"}"#, "emergency_stop"),
            (r#"{"do":"emergencyStop"}"#, "emergency_stop"),
            (r#"{"do":"press","button":"singlecycle"}"#, "single_cycle"),
            (r#"{"do":"turn_key","key":"automatic"}"#, "auto"),
            (r#"{"do":"jog","axis":"J1","by":1,"speed":5}"#, "speed_percent"),
        ] {
            let told = told(body);
            assert!(told.contains(&format!("nearest: `{near}`")) || near == "auto", "{told}");
            assert!(told.contains(near), "{told}");
        }
        assert!(told(r#"{"do":"home","x":1}"#).starts_with("unknown field `x`"));
        assert!(told(r#"{"do":"press"}"#).contains("`button`"));
        assert!(told("{}").contains("`do`"));
    }
}
