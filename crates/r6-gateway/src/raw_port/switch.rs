//! Closes and opens all raw ports at once.

use std::fs::Metadata;
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

/// How long the one who closes the ports waits for the disk.
const PATIENCE: Duration = Duration::from_secs(5);

/// How long to wait until a disk that did not take the marker is tried again.
const TRY_AGAIN: Duration = Duration::from_secs(1);

/// The switch of all raw ports of a gateway. What it closed is closed after a restart, too.
#[derive(Debug)]
pub struct Switch {
    /// Who may do what.
    pub policy: SharedPolicy,
    marker: PathBuf,
    ports: Mutex<Vec<RawPort>>,
    /// The ports are closed, and the marker is not written yet.
    unwritten: AtomicBool,
    /// A task tries to write it again and again.
    retrying: AtomicBool,
    /// Locked while it is turned, so that the file says what holds.
    turning: AsyncMutex<()>,
}

impl Switch {
    /// The switch as the folder says, for these rules. What cannot be read closes all the same.
    pub fn read(folder: &Path, policy: RawPolicy) -> Self {
        let marker = folder.join(MARKER);
        let there = std::fs::symlink_metadata(&marker);
        let closed = match &there {
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            there => Some(Self::of_marker(&marker, there.as_ref().ok())),
        };
        Self::new(policy, marker, closed)
    }

    /// Who has closed the ports, as the marker says.
    fn of_marker(marker: &Path, there: Option<&Metadata>) -> ActedBy {
        let read = files::read(marker, LONGEST);
        let closed = read.and_then(|text| serde_json::from_slice(&text).map_err(io::Error::other));
        closed.unwrap_or_else(|error| {
            tracing::warn!(file = %marker.display(), %error, "it cannot be read: the raw ports are closed");
            let changed = there.and_then(|there| there.modified().ok());
            let at = changed.map_or_else(clock::time_of_day, clock::text_of);
            ActedBy { by: format!("the file {MARKER}, which cannot be read"), at }
        })
    }

    fn new(policy: RawPolicy, marker: PathBuf, closed: Option<ActedBy>) -> Self {
        let policy = SharedPolicy::new(policy, closed);
        let (unwritten, retrying) = (AtomicBool::new(false), AtomicBool::new(false));
        let (ports, turning) = (Mutex::default(), AsyncMutex::default());
        Self { policy, marker, ports, unwritten, retrying, turning }
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
        self.unwritten.store(true, Ordering::SeqCst);
        let acted = ActedBy { by: by.actor.clone(), at: clock::time_of_day() };
        let is_new = self.policy.close(acted);
        // What a camera has asked for under a rule does not leave.
        fleet.stations().iter().for_each(|station| station.seat(|seat, _| seat.grant_is_revoked()));
        if is_new {
            tracing::warn!(by = by.actor, "all raw ports are closed");
        }
        let deed = Deed::RawPorts { open: false };
        // The record of a slow disk must not keep the marker from it. An opening may be under way: so it is
        // told each time.
        let (written, ()) = tokio::join!(self.write_in_time(), accounts.ledger.tell(by, deed));
        written.map_err(|error| {
            tracing::error!(%error, "the disk does not take that the raw ports are closed: it is tried again");
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

    /// Writes the marker, and waits for it no longer than a caller can.
    async fn write_in_time(self: &Arc<Self>) -> io::Result<()> {
        let switch = Arc::clone(self);
        let work = tokio::spawn(async move { switch.write().await });
        match tokio::time::timeout(PATIENCE, work).await {
            Ok(written) => written.map_err(io::Error::other)?,
            Err(_) => Err(io::Error::other("it takes longer than usual")),
        }
    }

    /// Writes the marker, if the ports are still closed.
    async fn write(&self) -> io::Result<()> {
        let _turn = self.turning.lock().await;
        if let Some(closed) = self.policy.closed() {
            let (marker, text) = (self.marker.clone(), serde_json::to_vec(&closed).unwrap_or_default());
            self.on_disk(move || files::write(&marker, &text)).await?;
        }
        self.unwritten.store(false, Ordering::SeqCst);
        Ok(())
    }

    /// Writes the marker as soon as the disk takes it, unless the ports are opened.
    fn write_later(self: &Arc<Self>) {
        if self.retrying.swap(true, Ordering::SeqCst) {
            return;
        }
        let switch = Arc::clone(self);
        tokio::spawn(async move {
            while !switch.is_kept() {
                tokio::time::sleep(TRY_AGAIN).await;
                if !switch.is_kept() && switch.write().await.is_ok() {
                    tracing::info!("the disk has it now how the raw ports are");
                }
            }
            switch.retrying.store(false, Ordering::SeqCst);
        });
    }

    /// Opens all raw ports for the clients that the rules let in. The audit log has it before.
    ///
    /// # Errors
    /// `store_unavailable`: they are closed as before; `not_ready`: they were closed again meanwhile.
    pub async fn open(&self, by: &By, accounts: &Accounts) -> Result<(), Problem> {
        // Before it is the turn of this one: who closes them meanwhile wins.
        let closings = self.policy.closings();
        let _turn = self.turning.lock().await;
        let Some(before) = self.policy.closed() else { return Ok(()) };
        let failed = |error: &dyn std::fmt::Display| {
            let message =
                format!("the raw ports are closed as before: the disk does not take the change ({error})");
            Problem::new(Code::StoreUnavailable, message)
        };
        let again = || Problem::new(Code::NotReady, "the raw ports were closed again meanwhile");
        if self.policy.closings() != closings {
            return Err(again());
        }
        let written = accounts.ledger.write_at_once(by, Deed::RawPorts { open: true }).await;
        written.map_err(|error| failed(&error))?;
        let marker = self.marker.clone();
        if let Err(error) = self.on_disk(move || files::remove(&marker)).await {
            accounts.ledger.note(by, Deed::RawPorts { open: false });
            return Err(failed(&format!("{}: {error}", self.marker.display())));
        }
        if !self.policy.open(closings) {
            // The one who has closed them waits to write the marker, and is told in the audit log.
            let closed = self.policy.closed().unwrap_or(before);
            let closer = By { actor: closed.by, source: None };
            accounts.ledger.note(&closer, Deed::RawPorts { open: false });
            return Err(again());
        }
        self.unwritten.store(false, Ordering::SeqCst);
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
