//! A connection without a network: two ends in one process, which behave like those of TCP.
//!
//! It replaces the sockets, with the same door and the same links, on tokio's paused clock.
//! `r6-client/tests/faults` runs a complete client and a complete controller this way (`docs/FAULTS.md`).

use std::collections::VecDeque;
use std::io;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker, ready};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

use crate::wire::Wire;

/// How many bytes are under way in one direction at most, as in the buffers of a system. After that the
/// writer waits.
pub const MEMORY_BYTES: usize = 64 * 1024;

/// One end of a connection in memory. It uses no random numbers and no clock: bytes arrive as soon as the
/// other end reads.
///
/// Dropping an end closes the connection in good order, or resets it if unread bytes are left, as systems do.
/// Data written to a dropped end is lost, and the writer gets a reset.
#[derive(Debug)]
pub struct MemoryStream {
    inbound: Arc<Pipe>,
    outbound: Arc<Pipe>,
    reset_on_drop: bool,
}

/// One direction.
#[derive(Debug, Default)]
struct Pipe(Mutex<Way>);

#[derive(Debug, Default)]
struct Way {
    bytes: VecDeque<u8>,
    /// The writer has closed: the reader gets the end after the remaining bytes.
    closed: bool,
    /// The reader is gone.
    unread: bool,
    /// The connection was reset: reader and writer get an error.
    reset: bool,
    reader: Option<Waker>,
    writer: Option<Waker>,
}

impl Pipe {
    fn way(&self) -> MutexGuard<'_, Way> {
        // No code that holds the lock can panic halfway.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Way)) {
        let wakers = {
            let mut way = self.way();
            change(&mut way);
            [way.reader.take(), way.writer.take()]
        };
        wakers.into_iter().flatten().for_each(Waker::wake);
    }
}

impl MemoryStream {
    /// The two ends of a new connection.
    #[must_use]
    pub fn pair() -> (Self, Self) {
        let ways = [Arc::<Pipe>::default(), Arc::<Pipe>::default()];
        let [one, other] = &ways;
        let end = |inbound: &Arc<Pipe>, outbound: &Arc<Pipe>| Self {
            inbound: Arc::clone(inbound),
            outbound: Arc::clone(outbound),
            reset_on_drop: false,
        };
        (end(one, other), end(other, one))
    }
}

impl Wire for MemoryStream {
    fn reset(&mut self) {
        self.reset_on_drop = true;
    }
}

impl AsyncRead for MemoryStream {
    fn poll_read(
        self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let mut way = self.inbound.way();
        if way.bytes.is_empty() {
            if way.reset {
                return Poll::Ready(Err(io::ErrorKind::ConnectionReset.into()));
            }
            if way.closed {
                return Poll::Ready(Ok(()));
            }
            way.reader = Some(cx.waker().clone());
            return Poll::Pending;
        }
        let count = buffer.remaining().min(way.bytes.len());
        // The bytes may be in two parts, because the buffer is a ring.
        let (first, second) = way.bytes.as_slices();
        let from_first = count.min(first.len());
        buffer.put_slice(first.get(..from_first).unwrap_or_default());
        buffer.put_slice(second.get(..count - from_first).unwrap_or_default());
        way.bytes.drain(..count);
        let writer = way.writer.take();
        drop(way);
        if let Some(writer) = writer {
            writer.wake();
        }
        Poll::Ready(Ok(()))
    }
}

impl AsyncWrite for MemoryStream {
    fn poll_write(self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let written = {
            let mut way = self.outbound.way();
            if way.reset {
                return Poll::Ready(Err(io::ErrorKind::ConnectionReset.into()));
            }
            if way.closed {
                return Poll::Ready(Err(io::ErrorKind::BrokenPipe.into()));
            }
            if way.unread {
                way.reset = true;
                None
            } else {
                let room = MEMORY_BYTES - way.bytes.len();
                if room == 0 && !bytes.is_empty() {
                    way.writer = Some(cx.waker().clone());
                    return Poll::Pending;
                }
                let taken = bytes.get(..room).unwrap_or(bytes);
                way.bytes.extend(taken);
                Some((taken.len(), way.reader.take()))
            }
        };
        match written {
            Some((count, reader)) => {
                if let Some(reader) = reader {
                    reader.wake();
                }
                Poll::Ready(Ok(count))
            }
            // The answer to bytes for an end that is gone.
            None => {
                self.inbound.change(|way| way.reset = true);
                Poll::Ready(Ok(bytes.len()))
            }
        }
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        ready!(self.as_mut().poll_flush(cx))?;
        self.outbound.change(|way| way.closed = true);
        Poll::Ready(Ok(()))
    }
}

impl Drop for MemoryStream {
    fn drop(&mut self) {
        let mut reset = self.reset_on_drop;
        self.inbound.change(|way| {
            reset |= !way.bytes.is_empty();
            way.unread = true;
            way.bytes.clear();
            way.reset |= reset;
        });
        self.outbound.change(|way| {
            way.closed = true;
            way.reset |= reset;
            if reset {
                // A reset overtakes bytes that are still under way.
                way.bytes.clear();
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    use super::*;

    #[tokio::test]
    async fn bytes_arrive_in_order_and_wait_for_room() {
        let (mut near, mut far) = MemoryStream::pair();
        let sent: Vec<u8> = (0..3 * MEMORY_BYTES).map(|n| u8::try_from(n % 251).unwrap()).collect();
        let received = {
            let sent = sent.clone();
            let writes = tokio::spawn(async move {
                near.write_all(&sent).await.unwrap();
                near.shutdown().await.unwrap();
                near
            });
            let mut received = Vec::new();
            far.read_to_end(&mut received).await.unwrap();
            writes.await.unwrap();
            received
        };
        assert!(received == sent);
    }

    #[tokio::test]
    async fn an_end_that_is_closed_still_reads() {
        let (mut near, mut far) = MemoryStream::pair();
        near.shutdown().await.unwrap();
        assert_eq!(near.write(b"x").await.unwrap_err().kind(), io::ErrorKind::BrokenPipe);
        assert_eq!(far.read(&mut [0; 4]).await.unwrap(), 0);
        far.write_all(b"late").await.unwrap();
        drop(far);
        let mut text = String::new();
        near.read_to_string(&mut text).await.unwrap();
        assert_eq!(text, "late");
    }

    #[tokio::test]
    async fn a_reset_is_an_error_and_no_end() {
        let (mut near, mut far) = MemoryStream::pair();
        far.write_all(b"lost").await.unwrap();
        far.reset();
        drop(far);
        for _ in 0..2 {
            assert_eq!(near.read(&mut [0; 4]).await.unwrap_err().kind(), io::ErrorKind::ConnectionReset);
            assert_eq!(near.write(b"x").await.unwrap_err().kind(), io::ErrorKind::ConnectionReset);
        }
    }

    #[tokio::test]
    async fn who_leaves_bytes_unread_or_gets_some_later_resets() {
        let (mut near, far) = MemoryStream::pair();
        near.write_all(b"unread").await.unwrap();
        drop(far);
        assert_eq!(near.read(&mut [0; 4]).await.unwrap_err().kind(), io::ErrorKind::ConnectionReset);
        let (mut near, far) = MemoryStream::pair();
        drop(far);
        assert_eq!(near.write(b"to nobody").await.unwrap(), 9);
        assert_eq!(near.read(&mut [0; 4]).await.unwrap_err().kind(), io::ErrorKind::ConnectionReset);
    }

    #[tokio::test]
    async fn who_waits_is_woken_by_the_end() {
        let (mut near, far) = MemoryStream::pair();
        let reads = tokio::spawn(async move { near.read(&mut [0; 4]).await.unwrap() });
        tokio::task::yield_now().await;
        drop(far);
        assert_eq!(reads.await.unwrap(), 0);
    }
}
