//! An [`Arm`] behind streams of tokio. Its time is that of tokio, so a paused clock works.

use std::io;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt, DuplexStream};
use tokio::net::TcpListener;
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until};

use super::{Arm, Character, Outgoing};

/// Bytes that a stream in memory holds before writing waits.
const IN_MEMORY: usize = 64 * 1024;

/// A hostile controller that others connect to. It is shared by all its connections.
#[derive(Debug)]
pub struct HostileController {
    arm: Mutex<Arm>,
    start: Instant,
    /// How often the arm was changed, so that connections look at it again.
    changes: watch::Sender<u64>,
}

impl HostileController {
    /// One whose time begins now.
    pub fn new(character: Character) -> Arc<Self> {
        let (changes, _) = watch::channel(0);
        Arc::new(Self { arm: Mutex::new(Arm::new(character)), start: Instant::now(), changes })
    }

    /// The time since its start.
    pub fn now(&self) -> Duration {
        self.start.elapsed()
    }

    /// Looks at the arm as it is now, or changes it; connections learn of it.
    pub fn arm<R>(&self, look: impl FnOnce(&mut Arm, Duration) -> R) -> R {
        let result = self.quietly(look);
        self.changes.send_modify(|changes| *changes = changes.wrapping_add(1));
        result
    }

    fn quietly<R>(&self, look: impl FnOnce(&mut Arm, Duration) -> R) -> R {
        let mut arm = self.arm.lock().unwrap_or_else(PoisonError::into_inner);
        let now = self.now();
        arm.advance(now);
        look(&mut arm, now)
    }

    /// A connection in memory; a task serves its other end.
    ///
    /// # Errors
    /// Of kind `ConnectionRefused` while the controller starts anew.
    pub fn dial(self: &Arc<Self>) -> io::Result<DuplexStream> {
        let number = self.quietly(Arm::open).ok_or(io::ErrorKind::ConnectionRefused)?;
        let (ours, theirs) = tokio::io::duplex(IN_MEMORY);
        let controller = Arc::clone(self);
        tokio::spawn(async move { controller.serve_as(number, theirs).await });
        Ok(ours)
    }

    /// Accepts connections until this future is dropped; one that is refused ends at once.
    ///
    /// # Errors
    /// Those of [`TcpListener::accept`].
    pub async fn listen(self: Arc<Self>, listener: TcpListener) -> io::Result<()> {
        loop {
            let (stream, _) = listener.accept().await?;
            stream.set_nodelay(true)?;
            let controller = Arc::clone(&self);
            tokio::spawn(async move { controller.serve(stream).await });
        }
    }

    /// Serves one connection until it ends.
    pub async fn serve<S: AsyncRead + AsyncWrite + Unpin>(&self, stream: S) {
        if let Some(number) = self.quietly(Arm::open) {
            self.serve_as(number, stream).await;
        }
    }

    async fn serve_as<S: AsyncRead + AsyncWrite + Unpin>(&self, number: u32, mut stream: S) {
        let mut changes = self.changes.subscribe();
        let mut bytes = vec![0; 4096];
        loop {
            let Outgoing { frames, ended, next } = self.quietly(|arm, now| arm.poll(now, number));
            for frame in frames {
                if stream.write_all(&frame).await.is_err() {
                    return self.quietly(|arm, now| arm.close(now, number));
                }
            }
            if ended {
                return;
            }
            let wake = next.map(|next| self.start + next);
            tokio::select! {
                read = stream.read(&mut bytes) => match read {
                    Ok(0) | Err(_) => return self.quietly(|arm, now| arm.close(now, number)),
                    Ok(count) => {
                        let taken = bytes.get(..count).unwrap_or_default();
                        self.quietly(|arm, now| arm.receive(now, number, taken));
                    }
                },
                () = async { sleep_until(wake.unwrap_or_else(Instant::now)).await }, if wake.is_some() => {}
                _ = changes.changed() => {}
            }
        }
    }
}
