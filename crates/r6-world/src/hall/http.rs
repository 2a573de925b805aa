//! A small client of HTTP/1.1: one request at a time, never sent again.

use std::io;
use std::time::Duration;

use serde_json::Value;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWriteExt};
use tokio::time::{Instant, timeout};
use turmoil::net::TcpStream;

use super::gate::{GATEWAY, HTTP_PORT};

/// The longest answer that is read, in bytes. A page of the audit log has some hundred kilobytes.
const MOST_BYTES: usize = 4 << 20;

/// How long to wait for a connection.
const CONNECTS_WITHIN: Duration = Duration::from_secs(3);

/// How long a connection is kept for the next request. The gateway closes it after 2 s.
const KEPT: Duration = Duration::from_secs(1);

/// An answer.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Its status.
    pub status: u16,
    /// Its body.
    pub body: Vec<u8>,
}

impl Answer {
    /// Its body as JSON; null if it is not JSON.
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_default()
    }
}

/// A connection to the gateway that is kept between requests.
#[derive(Debug, Default)]
pub struct Session {
    stream: Option<(TcpStream, Instant)>,
}

/// Opens a connection to the gateway.
pub async fn connect() -> io::Result<TcpStream> {
    timeout(CONNECTS_WITHIN, TcpStream::connect((GATEWAY, HTTP_PORT))).await?
}

/// The head and the body of a request.
pub fn request(method: &str, path: &str, token: &str, body: Option<&Value>) -> Vec<u8> {
    let body = body.map(Value::to_string);
    let about = body.as_ref().map_or(String::new(), |body| {
        format!("content-type: application/json\r\ncontent-length: {}\r\n", body.len())
    });
    let head = format!(
        "{method} {path} HTTP/1.1\r\nhost: {GATEWAY}:{HTTP_PORT}\r\nauthorization: Bearer {token}\r\n{about}\r\n"
    );
    (head + &body.unwrap_or_default()).into_bytes()
}

impl Session {
    /// Sends a request and waits for its answer.
    ///
    /// # Errors
    /// The outcome is unknown, unless no connection could be made.
    pub async fn ask(&mut self, request: &[u8], within: Duration) -> io::Result<Answer> {
        let mut stream = match self.stream.take() {
            Some((stream, used)) if used.elapsed() < KEPT => stream,
            Some(_) | None => connect().await?,
        };
        let answer = timeout(within, async {
            stream.write_all(request).await?;
            read_answer(&mut stream).await
        });
        let answer = answer.await??;
        self.stream = Some((stream, Instant::now()));
        Ok(answer)
    }
}

/// Reads an answer that has a length.
pub async fn read_answer(stream: &mut (impl AsyncRead + Unpin)) -> io::Result<Answer> {
    let mut read = Vec::new();
    let ended = || io::Error::from(io::ErrorKind::UnexpectedEof);
    let (status, from, length) = loop {
        if let Some(head) = head_of(&read) {
            break head;
        }
        if read.len() > MOST_BYTES || stream.read_buf(&mut read).await? == 0 {
            return Err(ended());
        }
    };
    while read.len() < from + length {
        if read.len() > MOST_BYTES || stream.read_buf(&mut read).await? == 0 {
            return Err(ended());
        }
    }
    Ok(Answer { status, body: read.get(from..from + length).unwrap_or_default().to_vec() })
}

/// The status, where the body begins, and its length.
fn head_of(read: &[u8]) -> Option<(u16, usize, usize)> {
    let end = read.windows(4).position(|four| four == b"\r\n\r\n")?;
    let head = String::from_utf8_lossy(read.get(..end)?).to_ascii_lowercase();
    let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
    let length = head.lines().find_map(|line| line.strip_prefix("content-length:"));
    Some((status, end + 4, length.and_then(|length| length.trim().parse().ok()).unwrap_or(0)))
}
