//! The answer to a request that was not carried out.

use std::time::Duration;

use axum::Json;
use axum::http::StatusCode;
use axum::http::header::RETRY_AFTER;
use axum::response::{IntoResponse, Response};
use r6_api::{Code, Problem};

/// A problem and its HTTP status.
#[derive(Debug)]
pub struct Refusal {
    status: StatusCode,
    problem: Problem,
    retry_after: Option<Duration>,
}

impl Refusal {
    /// The problem without its status, for a protocol that has none.
    #[must_use]
    pub fn into_problem(self) -> Problem {
        self.problem
    }

    /// A refusal with this problem.
    pub fn new(status: StatusCode, code: Code, message: impl Into<String>) -> Self {
        Self { status, problem: Problem { code, message: message.into() }, retry_after: None }
    }

    /// A refusal with 429: the caller may try again after this time.
    #[must_use]
    pub fn too_many(after: Duration) -> Self {
        let message = format!("too many requests: try again in {} ms", after.as_millis() + 1);
        let refusal = Self::new(StatusCode::TOO_MANY_REQUESTS, Code::TooManyRequests, message);
        Self { retry_after: Some(after), ..refusal }
    }

    /// A refusal with 404.
    pub fn not_found(code: Code, message: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, code, message)
    }

    /// A refusal with 403, for a request that a web page may have sent.
    pub fn foreign(code: Code, message: impl Into<String>) -> Self {
        Self::new(StatusCode::FORBIDDEN, code, message)
    }

    /// A refusal of a body with this JSON error: 400 if it is not JSON at all; 422 with `other` if it is the
    /// wrong JSON. For an unknown word the message names the nearest known one.
    #[must_use]
    pub fn of_json(error: &serde_json::Error, other: Code) -> Self {
        let text = error.to_string();
        if error.is_data() {
            Self::new(StatusCode::UNPROCESSABLE_ENTITY, other, with_nearest(&text))
        } else {
            Self::new(StatusCode::BAD_REQUEST, Code::BadJson, format!("the body is no JSON: {text}"))
        }
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        // The header counts whole seconds.
        let seconds = self.retry_after.map(|after| (after.as_secs() + 1).to_string());
        match seconds {
            Some(seconds) => (self.status, [(RETRY_AFTER, seconds)], Json(self.problem)).into_response(),
            None => (self.status, Json(self.problem)).into_response(),
        }
    }
}

/// Serde's message, and for an unknown word the nearest of the known words in it.
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
    use r6_api::panel::Action;

    use super::*;

    fn told(body: &str) -> String {
        let error = serde_json::from_str::<Action>(body).unwrap_err();
        Refusal::of_json(&error, Code::BadAction).problem.message
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
