//! Closes and opens all raw ports at once.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

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

/// The switch of all raw ports of a gateway. What it closed is closed after a restart, too.
#[derive(Debug)]
pub struct Switch {
    /// Who may do what.
    pub policy: SharedPolicy,
    marker: PathBuf,
    ports: Mutex<Vec<RawPort>>,
    /// Locked while it is turned, so that the file says what holds.
    turning: AsyncMutex<()>,
}

impl Switch {
    /// The switch as the folder says, for these rules.
    ///
    /// # Errors
    /// What the system says of the folder.
    pub fn read(folder: &Path, policy: RawPolicy) -> io::Result<Self> {
        let marker = folder.join(MARKER);
        let closed = match files::read(&marker, LONGEST) {
            // A marker that cannot be read closes all the same.
            Ok(text) => Some(serde_json::from_slice(&text).unwrap_or_else(|_| unnamed())),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(error),
        };
        Ok(Self::new(policy, marker, closed))
    }

    fn new(policy: RawPolicy, marker: PathBuf, closed: Option<ActedBy>) -> Self {
        let policy = SharedPolicy::new(policy, closed);
        Self { policy, marker, ports: Mutex::default(), turning: AsyncMutex::default() }
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
    /// not leave. It holds at once; the disk is told after.
    ///
    /// # Errors
    /// `store_unavailable`: they are closed, and would be open after a restart.
    pub async fn close(&self, by: &By, fleet: &Fleet, accounts: &Accounts) -> Result<(), Problem> {
        let _turn = self.turning.lock().await;
        // If they are closed already, the disk may not have taken it.
        let before = self.policy.closed();
        let is_new = before.is_none();
        let acted = before.unwrap_or_else(|| ActedBy { by: by.actor.clone(), at: clock::time_of_day() });
        if is_new {
            self.policy.set_closed(Some(acted.clone()));
            // What a camera has asked for under a rule does not leave.
            fleet.stations().iter().for_each(|station| station.seat(|seat, _| seat.grant_is_revoked()));
            tracing::warn!(by = by.actor, "all raw ports are closed");
        }
        let (marker, text) = (self.marker.clone(), serde_json::to_vec(&acted).unwrap_or_default());
        let written = self.on_disk(move || files::write(&marker, &text));
        // The record of a slow disk must not keep the marker from it.
        let told = async {
            if is_new {
                accounts.ledger.tell(by, Deed::RawPorts { open: false }).await;
            }
        };
        let (written, ()) = tokio::join!(written, told);
        written.map_err(|error| {
            let message = format!(
                "all raw ports are closed, but the disk does not take it ({error}): they would be open after a restart"
            );
            Problem::new(Code::StoreUnavailable, message)
        })
    }

    /// Opens all raw ports for the clients that the rules let in.
    ///
    /// # Errors
    /// `store_unavailable`: they are closed as before.
    pub async fn open(&self, by: &By, accounts: &Accounts) -> Result<(), Problem> {
        let _turn = self.turning.lock().await;
        if self.policy.closed().is_none() {
            return Ok(());
        }
        let marker = self.marker.clone();
        let removed = self.on_disk(move || match std::fs::remove_file(marker) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            other => other,
        });
        removed.await.map_err(|error| {
            let message =
                format!("the raw ports are closed as before: the disk does not take the change ({error})");
            Problem::new(Code::StoreUnavailable, message)
        })?;
        self.policy.set_closed(None);
        tracing::warn!(by = by.actor, "the raw ports are open");
        accounts.ledger.tell(by, Deed::RawPorts { open: true }).await;
        Ok(())
    }

    async fn on_disk(&self, work: impl FnOnce() -> io::Result<()> + Send + 'static) -> io::Result<()> {
        tokio::task::spawn_blocking(work).await.map_err(io::Error::other)?
    }
}

fn unnamed() -> ActedBy {
    ActedBy { by: "gateway".to_owned(), at: clock::time_of_day() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_marker_that_cannot_be_read_keeps_the_ports_closed() {
        let folder = tempfile::tempdir().unwrap();
        let read = || Switch::read(folder.path(), RawPolicy::default()).unwrap().policy.closed();
        assert_eq!(read(), None);
        for text in ["", "{", "{\"by\": 1}", &"x".repeat(100)] {
            std::fs::write(folder.path().join(MARKER), text).unwrap();
            assert_eq!(read().unwrap().by, "gateway", "{text}");
        }
        std::fs::write(folder.path().join(MARKER), "{\"by\": \"anna\", \"at\": \"then\"}").unwrap();
        assert_eq!(read(), Some(ActedBy { by: "anna".to_owned(), at: "then".to_owned() }));
    }
}
