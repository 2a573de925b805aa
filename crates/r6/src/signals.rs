//! Ctrl-C, and the signals that end a service.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::exit::Failure;

/// Whether a signal that ends the run was received.
static ASKED: AtomicBool = AtomicBool::new(false);

/// Whether a signal has asked this run to end.
pub fn asked_to_end() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// The signals that end a program: interrupt, terminate and hangup (the terminal is gone). Hangup is left
/// alone if the program was started to survive it (`nohup`).
///
/// Once the value exists, the signals no longer kill the process. Create it before anything that has to end
/// in order, and before telling users how to end the program.
#[derive(Debug)]
pub struct Ending {
    #[cfg(unix)]
    interrupt: tokio::signal::unix::Signal,
    #[cfg(unix)]
    terminate: tokio::signal::unix::Signal,
    #[cfg(unix)]
    hangup: Option<tokio::signal::unix::Signal>,
}

impl Ending {
    /// Takes over the signals.
    #[cfg(unix)]
    pub fn watch() -> Result<Self, Failure> {
        use tokio::signal::unix::{SignalKind, signal};
        let failed = |error: std::io::Error| Failure::usage(format!("the system gives no signals: {error}"));
        let hangup = if hangup_is_ignored() { None } else { Some(SignalKind::hangup()) };
        Ok(Self {
            interrupt: signal(SignalKind::interrupt()).map_err(failed)?,
            terminate: signal(SignalKind::terminate()).map_err(failed)?,
            hangup: hangup.map(signal).transpose().map_err(failed)?,
        })
    }

    /// Takes over the signals.
    #[cfg(not(unix))]
    pub fn watch() -> Result<Self, Failure> {
        Ok(Self {})
    }

    /// Waits for one of the signals.
    #[cfg(unix)]
    pub async fn signalled(&mut self) {
        let hangup = async {
            match &mut self.hangup {
                Some(hangup) => hangup.recv().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
            _ = hangup => {}
        }
        ASKED.store(true, Ordering::Relaxed);
    }

    /// Waits for Ctrl-C.
    #[cfg(not(unix))]
    pub async fn signalled(&mut self) {
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
        ASKED.store(true, Ordering::Relaxed);
    }
}

/// Hangups that ask a service to read its configuration again.
#[derive(Debug)]
pub struct Rereading {
    #[cfg(unix)]
    hangup: tokio::signal::unix::Signal,
}

impl Rereading {
    /// Takes hangups over from `ending`, which no longer ends with one.
    #[cfg(unix)]
    pub fn watch(ending: &mut Ending) -> Result<Self, Failure> {
        use tokio::signal::unix::{SignalKind, signal};
        ending.hangup = None;
        let hangup = signal(SignalKind::hangup());
        let hangup =
            hangup.map_err(|error| Failure::usage(format!("the system gives no signals: {error}")))?;
        Ok(Self { hangup })
    }

    /// This system has no hangups.
    #[cfg(not(unix))]
    pub fn watch(_ending: &mut Ending) -> Result<Self, Failure> {
        Ok(Self {})
    }

    /// Waits for one.
    #[cfg(unix)]
    pub async fn asked(&mut self) {
        if self.hangup.recv().await.is_none() {
            std::future::pending::<()>().await;
        }
    }

    /// Waits forever.
    #[cfg(not(unix))]
    pub async fn asked(&mut self) {
        std::future::pending::<()>().await;
    }
}

/// Whether the process was started with hangups ignored. Known on Linux only; elsewhere `false`.
#[cfg(unix)]
fn hangup_is_ignored() -> bool {
    std::fs::read_to_string("/proc/self/status").is_ok_and(|status| ignores_hangup(&status))
}

/// Whether bit 0 of `SigIgn` (signal 1, SIGHUP) is set in the text of `/proc/self/status`.
#[cfg(unix)]
fn ignores_hangup(status: &str) -> bool {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 1 == 1)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_hangup_that_the_caller_ignores_stays_ignored() {
        assert!(ignores_hangup("Name:\tr6\nSigIgn:\t0000000000001001\nSigCgt:\t0000000000000000\n"));
        assert!(!ignores_hangup("Name:\tr6\nSigIgn:\t0000000000001000\nSigCgt:\t0000000000000001\n"));
        assert!(!ignores_hangup(""));
    }
}
