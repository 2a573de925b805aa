//! An in-memory connection, so that measurements contain no system calls.

use std::fmt;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, Waker};

use r6_client::Connect;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

use super::echo;

/// A connection whose other end answers as soon as a query is written.
#[derive(Default)]
pub struct Answering {
    input: Vec<u8>,
    output: Vec<u8>,
    read: usize,
    reader: Option<Waker>,
}

impl AsyncWrite for Answering {
    fn poll_write(self: Pin<&mut Self>, _: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let this = self.get_mut();
        this.input.extend_from_slice(bytes);
        if this.read == this.output.len() {
            this.output.clear();
            this.read = 0;
        }
        let taken = echo::answer(&this.input, &mut this.output);
        this.input.drain(..taken);
        if let Some(reader) = this.reader.take() {
            reader.wake();
        }
        Poll::Ready(Ok(bytes.len()))
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

impl AsyncRead for Answering {
    fn poll_read(
        self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let this = self.get_mut();
        let rest = &this.output[this.read..];
        if rest.is_empty() {
            this.reader = Some(cx.waker().clone());
            return Poll::Pending;
        }
        let count = rest.len().min(buffer.remaining());
        buffer.put_slice(&rest[..count]);
        this.read += count;
        Poll::Ready(Ok(()))
    }
}

/// Connects to an [`Answering`] connection.
pub struct Memory;

impl fmt::Display for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("memory")
    }
}

impl Connect for Memory {
    type Stream = Answering;

    async fn connect(&mut self) -> io::Result<Answering> {
        Ok(Answering::default())
    }
}
