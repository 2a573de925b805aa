//! Gives up a peer that does not read.
//!
//! The protocols above wait for room in the system's buffer without an end. A peer that asks for a long
//! answer and does not read it would keep its connection and the answer in memory for as long as it likes.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep, sleep_until};

/// How long a peer may read nothing while there is something to send: longer than a network needs to come
/// back.
const PATIENCE: Duration = Duration::from_secs(30);

/// A stream that fails if its peer takes nothing for [`PATIENCE`] while something waits to be sent.
#[derive(Debug)]
pub(super) struct Stalled<S> {
    stream: S,
    /// When the peer is given up, if something waits.
    ends: Option<Pin<Box<Sleep>>>,
}

impl<S> Stalled<S> {
    pub fn new(stream: S) -> Self {
        Self { stream, ends: None }
    }

    /// What became of a write; an error if the peer took nothing for too long.
    fn judge<T>(&mut self, cx: &mut Context<'_>, wrote: Poll<io::Result<T>>) -> Poll<io::Result<T>> {
        if wrote.is_ready() {
            self.ends = None;
            return wrote;
        }
        let ends = self.ends.get_or_insert_with(|| Box::pin(sleep_until(Instant::now() + PATIENCE)));
        ends.as_mut()
            .poll(cx)
            .map(|()| Err(io::Error::new(io::ErrorKind::TimedOut, "the peer reads nothing")))
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Stalled<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buf: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(cx, buf)
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Stalled<S> {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let wrote = Pin::new(&mut self.stream).poll_write(cx, bytes);
        self.judge(cx, wrote)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let wrote = Pin::new(&mut self.stream).poll_write_vectored(cx, bytes);
        self.judge(cx, wrote)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let flushed = Pin::new(&mut self.stream).poll_flush(cx);
        self.judge(cx, flushed)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let shut = Pin::new(&mut self.stream).poll_shutdown(cx);
        self.judge(cx, shut)
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_peer_that_reads_nothing_is_given_up() {
        let (_peer, ours) = tokio::io::duplex(1024);
        let begun = Instant::now();
        let wrote = Stalled::new(ours).write_all(&[1; 4096]).await;
        assert_eq!(wrote.unwrap_err().kind(), io::ErrorKind::TimedOut);
        assert_eq!(begun.elapsed().as_secs(), PATIENCE.as_secs());
    }

    #[tokio::test(start_paused = true)]
    async fn a_peer_that_reads_slowly_gets_everything() {
        let (mut peer, ours) = tokio::io::duplex(1024);
        let reads = tokio::spawn(async move {
            let (mut part, mut all) = ([0; 1024], 0);
            while all < 8192 {
                tokio::time::sleep(PATIENCE - Duration::from_secs(1)).await;
                all += peer.read(&mut part).await.unwrap();
            }
            (peer, all)
        });
        let mut stalled = Stalled::new(ours);
        stalled.write_all(&[1; 8192]).await.unwrap();
        let (_peer, all) = reads.await.unwrap();
        assert_eq!(all, 8192);
        // With nothing to send there is no hurry.
        tokio::time::sleep(PATIENCE * 10).await;
        stalled.write_all(&[1; 512]).await.unwrap();
    }
}
