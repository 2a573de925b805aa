//! Adds JSON bodies to answers of the HTTP library itself.
//!
//! If the bytes are not an HTTP request, the library answers with a status and no body, and no handler sees
//! the request. Clients expect JSON, so such an answer gets a body on its way out.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::http::StatusCode;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::Sleep;

use r6_api::{Code, Problem};

use crate::server::MAX_HEAD_BYTES;

/// How long a peer has to close its half after we have closed ours behind a refusal.
const HANG_UP_TIME: Duration = Duration::from_secs(2);

/// A stream that adds a body to bare refusals.
///
/// Behind such a refusal it reads what the peer still sends before it is closed; otherwise the peer would
/// lose the refusal. `r6-sim` does the same for the robots' own protocol; neither crate uses the other's
/// sockets.
#[derive(Debug)]
pub(super) struct InJson<S> {
    stream: S,
    /// A refusal, and how much of it has been written.
    refusal: Vec<u8>,
    written: usize,
    /// How long to wait for the peer, once our half is closed.
    hangs_up: Option<Pin<Box<Sleep>>>,
}

impl<S: AsyncRead + AsyncWrite + Unpin> InJson<S> {
    pub fn new(stream: S) -> Self {
        Self { stream, refusal: Vec::new(), written: 0, hangs_up: None }
    }

    /// Whether a refusal got a body. Nothing else is sent on this connection then.
    fn has_refused(&self) -> bool {
        !self.refusal.is_empty()
    }

    /// Reads until the peer has closed its half, or too much time has passed.
    fn poll_end(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let Some(time) = &mut self.hangs_up else { return Poll::Ready(Ok(())) };
        loop {
            if time.as_mut().poll(cx).is_ready() {
                return Poll::Ready(Ok(()));
            }
            let mut read = [0; 1024];
            let mut buf = ReadBuf::new(&mut read);
            let result = ready!(Pin::new(&mut self.stream).poll_read(cx, &mut buf));
            if result.is_err() || buf.filled().is_empty() {
                return Poll::Ready(Ok(()));
            }
        }
    }

    fn poll_refusal(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        while let Some(rest @ [_, ..]) = self.refusal.get(self.written..) {
            let written = ready!(Pin::new(&mut self.stream).poll_write(cx, rest))?;
            if written == 0 {
                return Poll::Ready(Err(io::ErrorKind::WriteZero.into()));
            }
            self.written += written;
        }
        Poll::Ready(Ok(()))
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for InJson<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buf: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(cx, buf)
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin> AsyncWrite for InJson<S> {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &[u8]) -> Poll<io::Result<usize>> {
        if !self.has_refused()
            && let Some(refusal) = with_body(buf)
        {
            self.refusal = refusal;
            return Poll::Ready(Ok(buf.len()));
        }
        ready!(self.poll_refusal(cx))?;
        Pin::new(&mut self.stream).poll_write(cx, buf)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        ready!(self.poll_refusal(cx))?;
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        ready!(self.poll_refusal(cx))?;
        if self.hangs_up.is_none() {
            ready!(Pin::new(&mut self.stream).poll_shutdown(cx))?;
            if !self.has_refused() {
                return Poll::Ready(Ok(()));
            }
            self.hangs_up = Some(Box::pin(tokio::time::sleep(HANG_UP_TIME)));
        }
        self.poll_end(cx)
    }
}

/// The same refusal with a body, if it has none. Every refusal of a handler has its own body.
fn with_body(written: &[u8]) -> Option<Vec<u8>> {
    let head = std::str::from_utf8(written).ok()?.strip_suffix("\r\n\r\n")?;
    let status = head.strip_prefix("HTTP/1.1 ").or_else(|| head.strip_prefix("HTTP/1.0 "))?.get(..3)?;
    let status = StatusCode::from_bytes(status.as_bytes()).ok().filter(StatusCode::is_client_error)?;
    if !head.lines().any(|line| line.eq_ignore_ascii_case("content-length: 0")) {
        return None;
    }
    let (code, message) = match status {
        StatusCode::URI_TOO_LONG | StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE => {
            (Code::TooLong, format!("the head of the request is longer than {MAX_HEAD_BYTES} bytes"))
        }
        _ => (Code::BadRequest, "this is no HTTP request that can be read".to_owned()),
    };
    bare_answer(status, &Problem::new(code, message))
}

/// The bytes of an answer with a problem, behind which the connection is closed.
pub(crate) fn bare_answer(status: StatusCode, problem: &Problem) -> Option<Vec<u8>> {
    let body = serde_json::to_string(problem).ok()?;
    let length = body.len();
    Some(
        format!(
            "HTTP/1.1 {status}\r\ncontent-type: application/json\r\ncontent-length: {length}\r\nconnection: close\r\n\r\n{body}"
        )
        .into_bytes(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_bare_refusal_gets_a_body() {
        let bare = b"HTTP/1.1 400 Bad Request\r\nconnection: close\r\ncontent-length: 0\r\n\r\n";
        let text = String::from_utf8(with_body(bare).unwrap()).unwrap();
        assert!(
            text.starts_with("HTTP/1.1 400 Bad Request\r\n") && text.contains("\"bad_request\""),
            "{text}"
        );
        for other in [
            "HTTP/1.1 200 OK\r\ncontent-length: 0\r\n\r\n",
            "HTTP/1.1 500 Internal Server Error\r\ncontent-length: 0\r\n\r\n",
            "HTTP/1.1 404 Not Found\r\ncontent-length: 2\r\n\r\n{}",
            "HTTP/1.1 404 Not Found\r\ncontent-length: 2\r\n\r\n",
            "HTTP/1.1 4",
            "{\"do\":\"home\"}",
        ] {
            assert_eq!(with_body(other.as_bytes()), None, "{other}");
        }
    }
}
