//! Closes and opens all raw ports at once.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use r6_api::Code;
use r6_api::gateway::{ActedBy, Deed};
use tokio::sync::Mutex as AsyncMutex;

use super::{RawPort, SharedPolicy};
use crate::accounts::Accounts;
use crate::clock;
use crate::core::raw::policy::RawPolicy;
use crate::files;
use crate::fleet::Fleet;
use crate::fleet::station::By;
use crate::problem::Problem;

/// The file in the folder of the gateway that is there while raw ports are closed.
const MARKER: &str = "raw-ports-closed.json";

/// The longest marker: a name and a time.
const LONGEST: u64 = 4096;

/// How long to wait until a disk that did not take the marker is tried again.
const TRY_AGAIN: Duration = Duration::from_secs(1);

/// The switch of all raw ports of a gateway. What it closed is closed after a restart, too.
#[derive(Debug)]
pub struct Switch {
    /// Who may do what.
    pub policy: SharedPolicy,
    marker: PathBuf,
    ports: Mutex<Vec<RawPort>>,
    /// The ports are closed, and the marker could not be written.
    unwritten: AtomicBool,
    /// Locked while it is turned, so that the file says what holds.
    turning: AsyncMutex<()>,
}

impl Switch {
    /// The switch as the folder says, for these rules. What cannot be read closes all the same.
    pub fn read(folder: &Path, policy: RawPolicy) -> Self {
        let marker = folder.join(MARKER);
        let closed = std::fs::symlink_metadata(&marker).ok().map(|there| {
            let read = files::read(&marker, LONGEST);
            let closed = read.and_then(|text| serde_json::from_slice(&text).map_err(io::Error::other));
            closed.unwrap_or_else(|error| {
                tracing::warn!(file = %marker.display(), %error, "it cannot be read: the raw ports are closed");
                let at = there.modified().map_or_else(|_| clock::time_of_day(), clock::text_of);
                ActedBy { by: format!("the file {MARKER}, which cannot be read"), at }
            })
        });
        Self::new(policy, marker, closed)
    }

    fn new(policy: RawPolicy, marker: PathBuf, closed: Option<ActedBy>) -> Self {
        let policy = SharedPolicy::new(policy, closed);
        let (ports, unwritten) = (Mutex::default(), AtomicBool::new(false));
        Self { policy, marker, ports, unwritten, turning: AsyncMutex::default() }
    }

    /// The switch of a gateway that can have no raw ports. It is never turned.
    pub fn without_ports(policy: RawPolicy) -> Self {
        Self::new(policy, PathBuf::new(), None)
    }

    /// Notes which raw ports there are.
    pub fn opened(&self, ports: &[RawPort]) {
        ports.clone_into(&mut self.held());
    }

    /// The raw ports.
    pub fn ports(&self) -> Vec<RawPort> {
        self.held().clone()
    }

    fn held(&self) -> std::sync::MutexGuard<'_, Vec<RawPort>> {
        self.ports.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Closes all raw ports: all clients are closed, none is let in, and their commands that have not left do
    /// not leave. It holds at once; the disk is told after, until it takes it.
    ///
    /// # Errors
    /// `store_unavailable`: they are closed, and would be open after a restart until [`Self::is_kept`].
    pub async fn close(self: &Arc<Self>, by: &By, fleet: &Fleet, accounts: &Accounts) -> Result<(), Problem> {
        let acted = ActedBy { by: by.actor.clone(), at: clock::time_of_day() };
        let (closed, is_new) = self.policy.close(acted);
        // What a camera has asked for under a rule does not leave.
        fleet.stations().iter().for_each(|station| station.seat(|seat, _| seat.grant_is_revoked()));
        if is_new {
            tracing::warn!(by = by.actor, "all raw ports are closed");
        }
        let written = async {
            let _turn = self.turning.lock().await;
            self.write(&closed).await
        };
        // The record of a slow disk must not keep the marker from it.
        let told = async {
            if is_new {
                accounts.ledger.tell(by, Deed::RawPorts { open: false }).await;
            }
        };
        let (written, ()) = tokio::join!(written, told);
        written.map_err(|error| {
            self.write_later();
            let message = format!(
                "all raw ports are closed, but the disk does not take it ({error}): they would be open after a restart. \
                 It is tried again until it does, which GET /v1/raw-ports tells as `kept`"
            );
            Problem::new(Code::StoreUnavailable, message)
        })
    }

    /// Whether a restart leaves the ports as they are.
    pub fn is_kept(&self) -> bool {
        !self.unwritten.load(Ordering::SeqCst)
    }

    async fn write(&self, closed: &ActedBy) -> io::Result<()> {
        let (marker, text) = (self.marker.clone(), serde_json::to_vec(closed).unwrap_or_default());
        self.on_disk(move || files::write(&marker, &text)).await
    }

    /// Writes the marker as soon as the disk takes it, unless the ports are opened.
    fn write_later(self: &Arc<Self>) {
        if self.unwritten.swap(true, Ordering::SeqCst) {
            return;
        }
        let switch = Arc::clone(self);
        tokio::spawn(async move {
            loop {
                tokio::time::sleep(TRY_AGAIN).await;
                let _turn = switch.turning.lock().await;
                let is_done = match switch.policy.closed() {
                    None => true,
                    Some(closed) => switch.write(&closed).await.is_ok(),
                };
                if is_done {
                    switch.unwritten.store(false, Ordering::SeqCst);
                    return;
                }
            }
        });
    }

    /// Opens all raw ports for the clients that the rules let in. The audit log has it before.
    ///
    /// # Errors
    /// `store_unavailable`: they are closed as before; `not_ready`: they were closed again meanwhile.
    pub async fn open(&self, by: &By, accounts: &Accounts) -> Result<(), Problem> {
        let _turn = self.turning.lock().await;
        let closings = self.policy.closings();
        if self.policy.closed().is_none() {
            return Ok(());
        }
        let failed = |error: &dyn std::fmt::Display| {
            let message =
                format!("the raw ports are closed as before: the disk does not take the change ({error})");
            Problem::new(Code::StoreUnavailable, message)
        };
        let written = accounts.ledger.write_at_once(by, Deed::RawPorts { open: true }).await;
        written.map_err(|error| failed(&error))?;
        let marker = self.marker.clone();
        let removed = self.on_disk(move || match std::fs::remove_file(marker) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            other => other,
        });
        if let Err(error) = removed.await {
            accounts.ledger.note(by, Deed::RawPorts { open: false });
            return Err(failed(&format!("{}: {error}", self.marker.display())));
        }
        if !self.policy.open(closings) {
            // Whoever has closed them waits to write the marker.
            accounts.ledger.note(by, Deed::RawPorts { open: false });
            return Err(Problem::new(Code::NotReady, "the raw ports were closed again meanwhile"));
        }
        tracing::warn!(by = by.actor, "the raw ports are open");
        Ok(())
    }

    async fn on_disk(&self, work: impl FnOnce() -> io::Result<()> + Send + 'static) -> io::Result<()> {
        tokio::task::spawn_blocking(work).await.map_err(io::Error::other)?
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_marker_that_cannot_be_read_keeps_the_ports_closed() {
        let folder = tempfile::tempdir().unwrap();
        let marker = folder.path().join(MARKER);
        let read = || Switch::read(folder.path(), RawPolicy::default()).policy.closed();
        assert_eq!(read(), None);
        for text in ["", "{", "{\"by\": 1}", &"x".repeat(5_000)] {
            std::fs::write(&marker, text).unwrap();
            assert_eq!(read().unwrap().by, "the file raw-ports-closed.json, which cannot be read", "{text}");
        }
        std::fs::write(&marker, "{\"by\": \"anna\", \"at\": \"then\"}").unwrap();
        assert_eq!(read(), Some(ActedBy { by: "anna".to_owned(), at: "then".to_owned() }));
        std::fs::remove_file(&marker).unwrap();
        std::fs::create_dir(&marker).unwrap();
        assert!(read().is_some(), "a folder of this name");
        std::fs::remove_dir(&marker).unwrap();
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(folder.path().join("gone"), &marker).unwrap();
            assert!(read().is_some(), "a link to nothing");
        }
    }
}
