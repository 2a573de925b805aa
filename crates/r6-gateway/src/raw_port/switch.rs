//! Closes and opens all raw ports at once.

use std::fs::Metadata;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use r6_api::Code;
use r6_api::gateway::{ActedBy, Deed};
use tokio::sync::Mutex;

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
    ports: OnceLock<Vec<RawPort>>,
    /// Locked while the marker is written or removed, so that it says what holds.
    turning: Mutex<()>,
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
        Self { policy, marker, ports: OnceLock::new(), turning: Mutex::default() }
    }

    /// The switch of a gateway that can have no raw ports. It is never turned.
    pub fn without_ports(policy: RawPolicy) -> Self {
        Self::new(policy, PathBuf::new(), None)
    }

    /// Notes which raw ports there are, once.
    pub fn opened(&self, ports: Vec<RawPort>) {
        self.ports.get_or_init(|| ports);
    }

    /// The raw ports.
    pub fn ports(&self) -> &[RawPort] {
        self.ports.get().map_or(&[], Vec::as_slice)
    }

    /// Closes all raw ports: all clients are closed, none is let in, and their commands that have not left do
    /// not leave. It holds at once; the disk is told after, until it takes it.
    ///
    /// # Errors
    /// `store_unavailable`: they are closed, and would be open after a restart as long as the policy is not
    /// kept.
    pub async fn close(self: &Arc<Self>, by: &By, fleet: &Fleet, accounts: &Accounts) -> Result<(), Problem> {
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
            let message = format!(
                "all raw ports are closed, but the disk does not take it ({error}): they would be open after a restart. \
                 It is tried again until it does, which GET /v1/raw-ports tells as `kept`"
            );
            Problem::new(Code::StoreUnavailable, message)
        })
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

    /// Writes the marker, unless the disk has how the ports are.
    async fn write(&self) -> io::Result<()> {
        let _turn = self.turning.lock().await;
        let closings = self.policy.closings();
        if let Some(closed) = self.policy.closed().filter(|_| !self.policy.is_kept()) {
            let (marker, text) = (self.marker.clone(), serde_json::to_vec(&closed).unwrap_or_default());
            self.on_disk(move || files::write(&marker, &text)).await?;
            self.policy.kept(closings);
        }
        Ok(())
    }

    /// Writes the marker as soon as a disk takes it that did not before, for as long as this is polled.
    pub async fn keep(&self) {
        loop {
            tokio::time::sleep(TRY_AGAIN).await;
            if !self.policy.is_kept() && self.write().await.is_ok() {
                tracing::info!("the disk has it now that the raw ports are closed");
            }
        }
    }

    /// Opens all raw ports for the clients that the rules let in. The audit log has it before.
    ///
    /// # Errors
    /// `store_unavailable`: they are closed as before; `not_ready`: they were closed again meanwhile.
    pub async fn open(&self, by: &By, accounts: &Accounts) -> Result<(), Problem> {
        // Counted before it is the turn of this one: a closing meanwhile wins.
        let closings = self.policy.closings();
        let _turn = self.turning.lock().await;
        let Some(before) = self.policy.closed() else { return Ok(()) };
        let again = || Problem::new(Code::NotReady, "the raw ports were closed again meanwhile");
        if self.policy.closings() != closings {
            return Err(again());
        }
        let failed = |error: String| {
            let message =
                format!("the raw ports are closed as before: the disk does not take the change ({error})");
            Problem::new(Code::StoreUnavailable, message)
        };
        let written = accounts.ledger.write_at_once(by, Deed::RawPorts { open: true }).await;
        written.map_err(|error| failed(error.to_string()))?;
        let marker = self.marker.clone();
        if let Err(error) = self.on_disk(move || files::remove(&marker)).await {
            accounts.ledger.note(by, Deed::RawPorts { open: false });
            // The marker may be gone all the same: it is written again.
            self.policy.doubt();
            return Err(failed(format!("{}: {error}", self.marker.display())));
        }
        if !self.policy.open(closings) {
            // The closing waits to write the marker again. Its record may stand before that of this opening.
            let closed = self.policy.closed().unwrap_or(before);
            let closer = By { actor: closed.by, source: None };
            accounts.ledger.note(&closer, Deed::RawPorts { open: false });
            return Err(again());
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
    #![allow(clippy::unwrap_used, reason = "tests")]

    use futures_util::FutureExt as _;

    use super::*;
    use crate::core::raw::policy::{RawAllow, RawRule, RawSource};
    use crate::fleet::roads::Roads;
    use crate::fleet::station::Shared;
    use crate::store::{FILE, Keeper, Sqlite, Store as _};

    fn by(actor: &str) -> By {
        By { actor: actor.to_owned(), source: None }
    }

    #[tokio::test]
    async fn a_closing_does_not_wait_for_openings_and_wins() {
        let folder = tempfile::tempdir().unwrap();
        let keeper = Keeper::start(Sqlite::open(folder.path()).unwrap()).unwrap();
        let accounts = Accounts::read(keeper.clone()).await.unwrap();
        let shared = Arc::new(Shared::new(keeper, Roads::Tcp, None, 0));
        let fleet = Fleet::start(Vec::new(), &Default::default(), shared);
        let rule = RawRule::new(RawSource::parse("127.0.0.1").unwrap(), RawAllow::Command);
        let switch = Arc::new(Switch::read(folder.path(), RawPolicy::new(vec![rule])));
        let (anna, ben) = (by("anna"), by("ben"));
        switch.close(&anna, &fleet, &accounts).await.unwrap();
        assert!(switch.policy.is_kept());

        // While the store takes nothing, one opening waits for it and another one for the first.
        let other = rusqlite::Connection::open(folder.path().join(FILE)).unwrap();
        other.execute_batch("BEGIN IMMEDIATE").unwrap();
        let [mut first, mut second] = [(); 2].map(|()| Box::pin(switch.open(&ben, &accounts)));
        assert!((&mut first).now_or_never().is_none() && (&mut second).now_or_never().is_none());
        let mut closing = Box::pin(switch.close(&anna, &fleet, &accounts));
        assert!((&mut closing).now_or_never().is_none());
        assert!(!switch.policy.is_kept(), "the disk does not have the last closing");
        other.execute_batch("COMMIT").unwrap();
        let (first, second, closing) = tokio::join!(first, second, closing);
        let codes = [first, second].map(|refused| refused.unwrap_err().code);
        assert_eq!(codes, [Code::NotReady, Code::NotReady]);
        closing.unwrap();
        assert_eq!(switch.policy.closed().unwrap().by, "anna");
        assert!(switch.policy.is_kept() && folder.path().join(MARKER).is_file());

        // The last record says how they are, in the name of who closed them.
        accounts.ledger.end().await.unwrap();
        let mut store = Sqlite::open_existing(folder.path()).unwrap();
        let told = store.entries(0, 100).unwrap();
        let told: Vec<serde_json::Value> =
            told.iter().map(|entry| serde_json::from_str(&entry.body).unwrap()).collect();
        let told: Vec<_> = told.iter().filter(|entry| entry["what"] == "raw_ports").collect();
        let opened = told.iter().position(|entry| entry["open"] == true).unwrap();
        assert_eq!((&told[opened]["actor"], opened < told.len() - 1), (&"ben".into(), true), "{told:?}");
        let last = told.last().unwrap();
        assert_eq!((&last["open"], &last["actor"]), (&false.into(), &"anna".into()), "{told:?}");
    }

    #[tokio::test]
    async fn a_client_of_before_a_closing_may_do_nothing_after_it() {
        let rule = RawRule::new(RawSource::parse("127.0.0.1").unwrap(), RawAllow::Command);
        let policy = SharedPolicy::new(RawPolicy::new(vec![rule]), None);
        let source = "127.0.0.1:5000".parse().unwrap();
        let before = policy.client(source);
        assert!(policy.rule(before, "press").is_some());
        assert!(policy.close(ActedBy { by: "anna".to_owned(), at: "then".to_owned() }));
        assert!(
            policy.rule(before, "press").is_none() && policy.rule(policy.client(source), "press").is_none()
        );
        assert!(policy.open(policy.closings()));
        assert!(policy.rule(before, "press").is_none(), "also if they are open again");
        assert!(policy.rule(policy.client(source), "press").is_some());
    }

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
