//! Ctrl-C, and the signal that ends a service.

use crate::exit::Failure;

/// The signals that end a program. From the moment it is made they no longer kill it: make it before anything that has
/// to be ended in order, and before telling anybody that it can be ended.
#[derive(Debug)]
pub struct Ending {
    #[cfg(unix)]
    interrupt: tokio::signal::unix::Signal,
    #[cfg(unix)]
    terminate: tokio::signal::unix::Signal,
}

impl Ending {
    /// Takes over the signals.
    #[cfg(unix)]
    pub fn watch() -> Result<Self, Failure> {
        use tokio::signal::unix::{SignalKind, signal};
        let failed = |error: std::io::Error| Failure::usage(format!("the system gives no signals: {error}"));
        Ok(Self {
            interrupt: signal(SignalKind::interrupt()).map_err(failed)?,
            terminate: signal(SignalKind::terminate()).map_err(failed)?,
        })
    }

    /// Takes over the signals.
    #[cfg(not(unix))]
    pub fn watch() -> Result<Self, Failure> {
        Ok(Self {})
    }

    /// Waits for one of them.
    #[cfg(unix)]
    pub async fn signalled(&mut self) {
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
        }
    }

    /// Waits for one of them.
    #[cfg(not(unix))]
    pub async fn signalled(&mut self) {
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    }
}
