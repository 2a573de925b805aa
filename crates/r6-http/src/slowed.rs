//! Reads no more of a peer than a person or a script sends.
//!
//! The protocols above handle many tiny frames for each read. Without a limit a few peers could keep all
//! threads busy with them, and others would wait.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep, sleep_until};

/// How much a peer may send at once: some requests with the longest body, or two of the longest messages.
const AT_ONCE: u32 = 256 * 1024;

/// How much it may send in a second after that.
const A_SECOND: u32 = 128 * 1024;

/// How much is read in one go, so that the limit is looked at before much has been handled.
const MOST_READ: usize = 16 * 1024;

/// A stream that is read slowly if its peer sends much.
#[derive(Debug)]
pub(super) struct Slowed<S> {
    stream: S,
    /// How much may be read now, and since when that holds.
    left: u32,
    since: Instant,
    waits: Option<Pin<Box<Sleep>>>,
}

impl<S> Slowed<S> {
    pub fn new(stream: S) -> Self {
        Self { stream, left: AT_ONCE, since: Instant::now(), waits: None }
    }

    /// Adds what the time since the last look allows.
    fn refill(&mut self) {
        let now = Instant::now();
        let millis = now.duration_since(self.since).as_millis().min(u128::from(AT_ONCE));
        let more = u32::try_from(millis).unwrap_or(AT_ONCE).saturating_mul(A_SECOND / 1000);
        if more > 0 {
            (self.left, self.since) = (self.left.saturating_add(more).min(AT_ONCE), now);
        }
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Slowed<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buf: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let this = &mut *self;
        loop {
            if let Some(waits) = &mut this.waits {
                ready!(waits.as_mut().poll(cx));
                this.waits = None;
            }
            this.refill();
            if this.left > 0 {
                break;
            }
            // Time for some kilobytes, so that this wakes ten times a second at most.
            this.waits = Some(Box::pin(sleep_until(Instant::now() + Duration::from_millis(100))));
        }
        let most = usize::try_from(this.left).unwrap_or(MOST_READ).min(MOST_READ).min(buf.remaining());
        let mut part = ReadBuf::new(buf.initialize_unfilled_to(most));
        ready!(Pin::new(&mut this.stream).poll_read(cx, &mut part))?;
        let read = part.filled().len();
        buf.advance(read);
        this.left = this.left.saturating_sub(u32::try_from(read).unwrap_or(u32::MAX));
        Poll::Ready(Ok(()))
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Slowed<S> {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(cx, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_peer_that_sends_much_is_read_slowly_and_completely() {
        let (mut peer, ours) = tokio::io::duplex(64 * 1024);
        let begun = Instant::now();
        let sent: Vec<u8> = (0..1024 * 1024_u32).map(|at| (at % 251) as u8).collect();
        let expected = sent.clone();
        let write = tokio::spawn(async move { peer.write_all(&sent).await.unwrap() });
        let mut slowed = Slowed::new(ours);
        let mut read = vec![0; 256 * 1024];
        slowed.read_exact(&mut read).await.unwrap();
        assert!(begun.elapsed() < Duration::from_millis(1), "what is allowed at once: {:?}", begun.elapsed());
        let mut rest = vec![0; 768 * 1024];
        slowed.read_exact(&mut rest).await.unwrap();
        write.await.unwrap();
        assert!((5.8..6.5).contains(&begun.elapsed().as_secs_f64()), "{:?}", begun.elapsed());
        read.append(&mut rest);
        assert!(read == expected, "nothing is lost or exchanged");
    }

    #[tokio::test(start_paused = true)]
    async fn a_peer_that_rests_may_send_at_once_again() {
        let (mut peer, ours) = tokio::io::duplex(1024 * 1024);
        peer.write_all(&vec![1; 512 * 1024]).await.unwrap();
        let mut slowed = Slowed::new(ours);
        let mut read = vec![0; 256 * 1024];
        slowed.read_exact(&mut read).await.unwrap();
        tokio::time::sleep(Duration::from_secs(10)).await;
        let begun = Instant::now();
        slowed.read_exact(&mut read).await.unwrap();
        assert!(begun.elapsed() < Duration::from_millis(1), "{:?}", begun.elapsed());
    }
}
