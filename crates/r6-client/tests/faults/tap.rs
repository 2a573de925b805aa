//! A client's connections in memory, and a record of their traffic: all that the client sent, and how its
//! input arrived. The test can rewrite the input on the way, for faults that the controller cannot produce
//! itself.

use std::fmt;
use std::io;
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use r6_client::Connect;
use r6_sim::{ControllerHandle, MemoryStream};
use serde_json::Value;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::Instant;

/// The traffic over the connections of one client.
#[derive(Clone, Debug, Default)]
pub struct Line {
    /// The bytes that were sent over each connection.
    pub sent: Vec<Vec<u8>>,
    /// Attempts to connect that were refused, and attempts that the client gave up.
    pub refused: u32,
    pub unanswered: u32,
    /// Reads that ended within a frame, and reads with more than one frame.
    pub parts: u32,
    pub together: u32,
    /// How the connections ended.
    pub resets: u32,
    pub ends: u32,
}

impl Line {
    /// The complete frames that were sent over each connection, in order.
    pub fn conversations(&self) -> Vec<Vec<Value>> {
        let frames = |bytes: &Vec<u8>| {
            serde_json::Deserializer::from_slice(bytes).into_iter().map_while(Result::ok).collect::<Vec<_>>()
        };
        self.sent.iter().map(frames).collect()
    }

    /// The complete frames of all connections.
    pub fn frames(&self) -> Vec<Value> {
        self.conversations().concat()
    }

    /// Checks that on a new connection the client asked for the identity before it sent anything that moves
    /// or changes something.
    pub fn assert_introduced(&self) {
        const WHO: [&str; 5] = ["version", "machineName", "axisNum", "curMode", "curAlarm"];
        for conversation in self.conversations().iter().skip(1) {
            let asks_who = |frame: &Value| frame["queryAddr"] == serde_json::json!(WHO);
            let acts = |frame: &Value| {
                frame["reqType"] == "AddRCC"
                    || (frame["reqType"] == "command" && frame["cmdData"][0] != "actionStop")
            };
            let before = conversation.iter().take_while(|frame| !asks_who(frame)).find(|frame| acts(frame));
            assert_eq!(before, None, "sent to an unknown robot");
        }
    }

    /// Everything sent, as text.
    pub fn text(&self) -> String {
        self.sent
            .iter()
            .map(|bytes| String::from_utf8_lossy(bytes).into_owned())
            .collect::<Vec<_>>()
            .join("\n")
    }
}

/// The record, while it is in use.
pub type Tap = Arc<Mutex<Line>>;

/// Bytes to the client that the test replaces during a period of time.
#[derive(Clone, Copy, Debug)]
pub struct Rewrite {
    pub these: &'static [u8],
    pub those: &'static [u8],
    /// The time since the client was created.
    pub from: Duration,
    pub until: Duration,
}

/// Opens the connections of a client.
pub struct Dialler {
    pub controller: ControllerHandle,
    pub tap: Tap,
    pub rewrite: Option<Rewrite>,
    pub begun: Instant,
}

impl fmt::Display for Dialler {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "controller {}", self.controller.address().port())
    }
}

impl Connect for Dialler {
    type Stream = Tapped;

    fn connect(&mut self) -> impl Future<Output = io::Result<Tapped>> + Send {
        let (controller, tap) = (self.controller.clone(), Arc::clone(&self.tap));
        let (rewrite, begun) = (self.rewrite, self.begun);
        async move {
            let mut attempt = Attempt(Some(Arc::clone(&tap)));
            let dialled = controller.dial().await;
            attempt.0 = None;
            let mut line = tap.lock().unwrap();
            line.refused += u32::from(dialled.is_err());
            let stream = dialled?;
            line.sent.push(Vec::new());
            let number = line.sent.len() - 1;
            drop(line);
            Ok(Tapped { stream, number, tap, rewrite, begun, rest: Vec::new() })
        }
    }
}

/// An attempt to connect. If it is dropped, it got no answer.
struct Attempt(Option<Tap>);

impl Drop for Attempt {
    fn drop(&mut self) {
        if let Some(tap) = &self.0 {
            tap.lock().unwrap().unanswered += 1;
        }
    }
}

/// One connection.
pub struct Tapped {
    stream: MemoryStream,
    number: usize,
    tap: Tap,
    rewrite: Option<Rewrite>,
    begun: Instant,
    /// The rewritten bytes that were not read yet.
    rest: Vec<u8>,
}

impl AsyncRead for Tapped {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let since = self.begun.elapsed();
        let rewrite = self.rewrite.filter(|rewrite| (rewrite.from..rewrite.until).contains(&since));
        let read = if self.rest.is_empty() && rewrite.is_none() {
            ready!(Pin::new(&mut self.stream).poll_read(cx, buffer))
        } else {
            ready!(self.as_mut().poll_rewritten(cx, rewrite))?;
            let count = buffer.remaining().min(self.rest.len());
            buffer.put_slice(&self.rest[..count]);
            self.rest.drain(..count);
            Ok(())
        };
        let bytes = &buffer.filled()[before..];
        let mut line = self.tap.lock().unwrap();
        match &read {
            Err(_) => line.resets += 1,
            Ok(()) if bytes.is_empty() => line.ends += 1,
            Ok(()) => {
                line.parts += u32::from(bytes.last() != Some(&b'}'));
                line.together += u32::from(bytes.windows(2).any(|pair| pair == b"}{"));
            }
        }
        Poll::Ready(read)
    }
}

impl Tapped {
    /// Reads the stream and rewrites the bytes. Whole frames come in one piece.
    fn poll_rewritten(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        rewrite: Option<Rewrite>,
    ) -> Poll<io::Result<()>> {
        if !self.rest.is_empty() {
            return Poll::Ready(Ok(()));
        }
        let mut bytes = [0; 4096];
        let mut buffer = ReadBuf::new(&mut bytes);
        ready!(Pin::new(&mut self.stream).poll_read(cx, &mut buffer))?;
        let mut rest = buffer.filled();
        while let Some(first) = rest.first() {
            match rewrite.and_then(|rewrite| Some((rest.strip_prefix(rewrite.these)?, rewrite.those))) {
                Some((after, those)) => {
                    self.rest.extend_from_slice(those);
                    rest = after;
                }
                None => {
                    self.rest.push(*first);
                    rest = &rest[1..];
                }
            }
        }
        Poll::Ready(Ok(()))
    }
}

impl AsyncWrite for Tapped {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let written = ready!(Pin::new(&mut self.stream).poll_write(cx, bytes));
        if let Ok(count) = written {
            self.tap.lock().unwrap().sent[self.number].extend_from_slice(&bytes[..count]);
        }
        Poll::Ready(written)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}
