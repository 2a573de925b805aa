//! Serves an [`Arm`] over tokio streams. It uses tokio's time, so a paused clock works.

use std::io;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt, DuplexStream};
use tokio::net::TcpListener;
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until};

use super::{Arm, Character, Outgoing};

/// How many bytes an in-memory stream holds before a write has to wait.
const IN_MEMORY: usize = 64 * 1024;

/// A hostile controller that accepts connections. All its connections share it.
#[derive(Debug)]
pub struct HostileController {
    arm: Mutex<Arm>,
    start: Instant,
    /// A counter of changes to the arm, so that connections poll it again.
    changes: watch::Sender<u64>,
}

impl HostileController {
    /// Creates a controller whose time begins now.
    pub fn new(character: Character) -> Arc<Self> {
        let (changes, _) = watch::channel(0);
        Arc::new(Self { arm: Mutex::new(Arm::new(character)), start: Instant::now(), changes })
    }

    /// The time since its start.
    pub fn now(&self) -> Duration {
        self.start.elapsed()
    }

    /// Reads or changes the arm at the present time. All connections then poll it again.
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

    /// Opens an in-memory connection; a task serves its other end.
    ///
    /// # Errors
    /// Of kind `ConnectionRefused` while the controller restarts.
    pub fn dial(self: &Arc<Self>) -> io::Result<DuplexStream> {
        let number = self.quietly(Arm::open).ok_or(io::ErrorKind::ConnectionRefused)?;
        let (ours, theirs) = tokio::io::duplex(IN_MEMORY);
        let controller = Arc::clone(self);
        tokio::spawn(async move { controller.serve_as(number, theirs).await });
        Ok(ours)
    }

    /// Accepts connections until this future is dropped. A refused connection ends at once.
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
