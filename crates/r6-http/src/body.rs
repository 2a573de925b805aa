//! Reads the bodies of requests: within limits of time and length, and of the right type.

use std::time::Duration;

use axum::body::Bytes;
use axum::extract::Request;
use axum::extract::rejection::BytesRejection;
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use r6_api::Code;

use crate::refusal::Refusal;

/// How long a request may take, its body included. Requests themselves take microseconds, and a disk that
/// saves a state takes some seconds.
pub(crate) const REQUEST_TIME: Duration = Duration::from_secs(10);

/// Refuses a request with 408 if it takes longer than 10 s: a layer for `axum::middleware::from_fn`.
pub async fn in_time(request: Request, next: Next) -> Response {
    tokio::time::timeout(REQUEST_TIME, next.run(request)).await.unwrap_or_else(|_| {
        let message = "the request did not come to its end in time";
        Refusal::new(StatusCode::REQUEST_TIMEOUT, Code::TooSlow, message).into_response()
    })
}

/// The body, after it was read to its end.
///
/// # Errors
/// 413 if it is longer than `most` bytes (the limit itself is set by `axum::extract::DefaultBodyLimit`). 400
/// if it broke off.
pub fn whole(body: Result<Bytes, BytesRejection>, most: usize) -> Result<Bytes, Refusal> {
    body.map_err(|rejection| match rejection.status() {
        StatusCode::PAYLOAD_TOO_LARGE => {
            let most = format!("the body is longer than {most} bytes");
            Refusal::new(StatusCode::PAYLOAD_TOO_LARGE, Code::TooLong, most)
        }
        _ => Refusal::new(StatusCode::BAD_REQUEST, Code::BadBody, rejection.body_text()),
    })
}

/// Refuses a request whose `Content-Type` is not JSON. A web page can send forms and plain text without
/// asking, but no JSON.
///
/// # Errors
/// 415, `not_json`.
pub fn require_json(headers: &HeaderMap) -> Result<(), Refusal> {
    let kind = headers.get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default();
    let kind = kind.split(';').next().unwrap_or_default().trim();
    if kind.eq_ignore_ascii_case("application/json") {
        return Ok(());
    }
    let message = "send JSON, with `Content-Type: application/json`";
    Err(Refusal::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, Code::NotJson, message))
}
