//! Reads the bodies of requests: within limits of time and length, and of the right type.

use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::Request;
use axum::extract::rejection::BytesRejection;
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use hyper::body::{Frame, SizeHint};
use r6_api::Code;

use crate::refusal::Refusal;
use crate::server::Guest;

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

/// Keeps the connection of a request from the end of its body on ([`Guest::keep`]): a layer for
/// `axum::middleware::from_fn`, for servers that know no callers.
pub async fn keep_when_read(request: Request, next: Next) -> Response {
    let Some(guest) = request.extensions().get::<Guest>().cloned() else { return next.run(request).await };
    let request = request.map(|body| {
        if body.is_end_stream() {
            guest.keep();
            return body;
        }
        Body::new(KeptAtEnd { body, guest })
    });
    next.run(request).await
}

/// A body at whose end the connection is kept.
struct KeptAtEnd {
    body: Body,
    guest: Guest,
}

impl HttpBody for KeptAtEnd {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(cx));
        if frame.is_none() {
            self.guest.keep();
        }
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
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
