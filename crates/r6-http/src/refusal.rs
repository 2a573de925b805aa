//! The answer to a request that was not carried out.

use std::time::Duration;

use axum::Json;
use axum::http::StatusCode;
use axum::http::header::RETRY_AFTER;
use axum::response::{IntoResponse, Response};
use r6_api::{Code, Problem};
use serde::de::{DeserializeOwned, IgnoredAny};

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
        Self { status, problem: Problem::new(code, message), retry_after: None }
    }

    /// A refusal with 429: the caller may try again after this time.
    #[must_use]
    pub fn too_many(after: Duration) -> Self {
        let message = format!("too many requests: try again in {} ms", after.as_millis() + 1);
        let mut refusal = Self::new(StatusCode::TOO_MANY_REQUESTS, Code::TooManyRequests, message);
        refusal.problem.retry_after_ms = u64::try_from(after.as_millis() + 1).ok();
        Self { retry_after: Some(after), ..refusal }
    }

    /// The same about the command with this number in the audit log.
    #[must_use]
    pub fn of_command(mut self, command_id: Option<u64>) -> Self {
        self.problem.command_id = command_id;
        self
    }

    /// A refusal with 404.
    pub fn not_found(code: Code, message: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, code, message)
    }

    /// A refusal with 403, for a request that a web page may have sent.
    pub fn foreign(code: Code, message: impl Into<String>) -> Self {
        Self::new(StatusCode::FORBIDDEN, code, message)
    }
}

/// Reads a body that is JSON.
///
/// # Errors
/// 400 if it is not JSON at all; 422 with `other` if it is the wrong JSON. The message says where the mistake
/// is, such as `points[1].color`, and for an unknown word which known one is the nearest.
pub fn read_json<T: DeserializeOwned>(body: &[u8], other: Code) -> Result<T, Refusal> {
    // Types that are read take a list in the order of their fields, too, and a list names nothing.
    if body.trim_ascii_start().first() == Some(&b'[') {
        let message = "the body is a list: it has to be an object";
        let list = || Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, other, message);
        let read = serde_json::from_slice::<IgnoredAny>(body);
        return Err(read.map_or_else(|error| of_json(WHOLE, &error, other), |_| list()));
    }
    let mut reader = serde_json::Deserializer::from_slice(body);
    let read = serde_path_to_error::deserialize(&mut reader);
    let read = read.map_err(|error| of_json(&error.path().to_string(), error.inner(), other))?;
    reader.end().map_err(|error| of_json(WHOLE, &error, other))?;
    Ok(read)
}

/// The path of the whole body.
const WHOLE: &str = ".";

/// What serde calls numbers, and what people call them.
const NUMBERS: [(&str, &str); 7] = [
    ("expected f64", "expected a number"),
    ("expected i64", "expected a whole number"),
    ("expected u64", "expected a whole number from 0 on"),
    ("expected u32", "expected a whole number from 0 to 4294967295"),
    ("expected u16", "expected a whole number from 0 to 65535"),
    ("expected u8", "expected a whole number from 0 to 255"),
    ("expected usize", "expected a whole number from 0 on"),
];

fn of_json(path: &str, error: &serde_json::Error, other: Code) -> Refusal {
    let text = error.to_string();
    if !error.is_data() {
        return Refusal::new(StatusCode::BAD_REQUEST, Code::BadJson, format!("the body is no JSON: {text}"));
    }
    let text = NUMBERS.iter().fold(with_nearest(&text), |text, (theirs, ours)| text.replace(theirs, ours));
    let text = if path == WHOLE { text } else { format!("{path}: {text}") };
    Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, other, text)
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
    use std::collections::BTreeMap;

    use r6_api::panel::Action;

    use super::*;

    fn told(body: &str) -> String {
        read_json::<Action>(body.as_bytes(), Code::BadAction).unwrap_err().problem.message
    }

    #[test]
    fn a_mistake_says_where_it_is_in_words_of_no_programming_language() {
        let read = |body: &str| {
            let read = read_json::<BTreeMap<String, Vec<(f64, i64, u32)>>>(body.as_bytes(), Code::BadValue);
            let problem = read.unwrap_err().problem;
            (problem.code, problem.message)
        };
        for (body, at, wanted) in [
            (r#"{"a":[[1,2,3],["x",2,3]]}"#, "a[1][0]: ", "expected a number"),
            (r#"{"a":[[1,1.5,3]]}"#, "a[0][1]: ", "expected a whole number at"),
            (r#"{"a":[[1,2,-3]]}"#, "a[0][2]: ", "expected a whole number from 0 to 4294967295"),
            (r#"{"a":[[1,2,5000000000]]}"#, "a[0][2]: ", "expected a whole number from 0 to 4294967295"),
            ("3", "invalid type", "expected a map"),
            ("[]", "the body is a list", "it has to be an object"),
            (" [1]", "the body is a list", "it has to be an object"),
        ] {
            let (code, told) = read(body);
            assert!(told.starts_with(at) && told.contains(wanted), "{told}");
            assert_eq!(code, Code::BadValue);
        }
        for body in ["{} {}", r#"{"a":"#, "", "[", "[1,"] {
            assert_eq!(read(body).0, Code::BadJson, "{body}");
        }
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
