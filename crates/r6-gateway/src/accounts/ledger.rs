//! What the audit log tells of users besides changes: who signed in and out, and who failed to. The rules of
//! raw ports too: they change at once, and their record waits for the disk.
//!
//! No caller waits long for it: with a full disk, people must still be able to sign in and stop a robot.

use std::collections::VecDeque;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use r6_api::Code;
use r6_api::gateway::{AuditRecord, Deed};
use tokio::sync::{Mutex as AsyncMutex, Notify, watch};
use tokio::time::{Interval, MissedTickBehavior};

use crate::clock;
use crate::core::account::UserName;
use crate::core::refusals::Refusals;
use crate::core::sign_in::{Failed, Failures};
use crate::fleet::station::By;
use crate::store::{Keeper, StoreError};

/// How many records wait for a disk that fails. Beyond it the oldest is lost, and the log of the process says
/// so.
const MAX_WAITING: usize = 1_000;

/// How long a caller waits for its record.
const PATIENCE: Duration = Duration::from_secs(1);

/// How often to look for counts that are due, and to try a disk that failed again.
const LOOK: Duration = Duration::from_secs(1);

/// Records that wait to be written.
#[derive(Debug)]
pub struct Ledger {
    keeper: Keeper,
    waiting: Mutex<Waiting>,
    failures: Mutex<Failures>,
    refusals: Mutex<Refusals>,
    /// Which sign-ins and sign-outs with tokens stand in the audit log.
    sessions: Mutex<Refusals>,
    /// Locked while records are written, so that they keep their order.
    writing: AsyncMutex<()>,
    wake: Notify,
    /// How many records were written.
    done: watch::Sender<u64>,
}

#[derive(Debug, Default)]
struct Waiting {
    records: VecDeque<AuditRecord>,
    /// How many records there were in all.
    noted: u64,
}

impl Waiting {
    fn push(&mut self, record: AuditRecord) {
        self.records.push_back(record);
        if self.records.len() > MAX_WAITING {
            // Counts of failures say least.
            let failure = |record: &AuditRecord| matches!(record.deed, Deed::SignInFailed { .. });
            let at = self.records.iter().position(failure).unwrap_or(0);
            if let Some(lost) = self.records.remove(at) {
                tracing::error!(?lost, "the store does not take records: one is lost");
            }
        }
    }
}

impl Ledger {
    /// A ledger in which nothing waits.
    pub fn new(keeper: Keeper) -> Self {
        Self {
            keeper,
            waiting: Mutex::default(),
            failures: Mutex::default(),
            refusals: Mutex::default(),
            sessions: Mutex::default(),
            writing: AsyncMutex::default(),
            wake: Notify::new(),
            done: watch::Sender::new(0),
        }
    }

    /// Notes something, and waits a moment until it is on the disk.
    pub async fn tell(&self, by: &By, deed: Deed) {
        let number = self.note(by, deed);
        let mut done = self.done.subscribe();
        if tokio::time::timeout(PATIENCE, done.wait_for(|done| *done >= number)).await.is_err() {
            tracing::warn!(by = by.actor, "a record about a user waits for the disk");
        }
    }

    /// The same once a minute for each caller, address and deed: a script that signs in in a loop must not
    /// fill the disk.
    pub async fn tell_once_a_minute(&self, by: &By, source: IpAddr, deed: Deed) {
        let what = format!("{} {deed:?}", by.actor);
        if lock(&self.sessions).is_written(clock::now(), source, &what) {
            self.tell(by, deed).await;
        }
    }

    /// Notes that somebody failed to sign in as a user that there is.
    pub fn failed(&self, user: &UserName, source: SocketAddr) {
        let failed = lock(&self.failures).note(user, source.ip(), clock::now());
        if let Some(Failed { user, times, .. }) = failed {
            let by = By { actor: "gateway".to_owned(), source: Some(source.to_string()) };
            self.note(&by, Deed::SignInFailed { user: user.to_string(), times });
        }
    }

    /// Notes that a known caller was refused: once a minute for each address and request.
    pub fn refused(&self, by: &By, source: IpAddr, request: String, code: Code) {
        if lock(&self.refusals).is_written(clock::now(), source, &request) {
            self.note(by, Deed::Refused { request, code });
        }
    }

    /// Notes something, to be written soon. Returns how many records were noted until now.
    pub fn note(&self, by: &By, deed: Deed) -> u64 {
        let record = record(by, deed);
        let mut waiting = lock(&self.waiting);
        waiting.push(record);
        waiting.noted += 1;
        let noted = waiting.noted;
        drop(waiting);
        self.wake.notify_one();
        noted
    }

    /// Writes something behind what waits. If it is not written, it is not told later either.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn write_at_once(&self, by: &By, deed: Deed) -> Result<(), StoreError> {
        self.write().await?;
        let _turn = self.writing.lock().await;
        self.keeper.append(vec![record(by, deed)]).await.map(drop)
    }

    /// Writes records as they come, for as long as it is polled.
    pub async fn keep(&self) {
        let mut store_failed = false;
        let mut look = tokio::time::interval(LOOK);
        look.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            if self.is_due(&mut look, store_failed).await {
                self.count(lock(&self.failures).due(clock::now()));
            }
            let written = self.write().await;
            if let Err(error) = &written
                && !store_failed
            {
                tracing::error!(%error, "the store failed: records about users wait");
            }
            store_failed = written.is_err();
        }
    }

    /// Waits for a record or for the time to look for counts: whether it is this time. Records that come
    /// without end do not delay it.
    async fn is_due(&self, look: &mut Interval, store_failed: bool) -> bool {
        tokio::select! {
            biased;
            _ = look.tick() => true,
            () = self.wake.notified(), if !store_failed => false,
        }
    }

    /// Writes what is left at the end.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn end(&self) -> Result<(), StoreError> {
        self.count(lock(&self.failures).rest());
        self.write().await
    }

    fn count(&self, failures: Vec<Failed>) {
        for Failed { user, times, source } in failures {
            let by = By { actor: "gateway".to_owned(), source: Some(source.to_string()) };
            self.note(&by, Deed::SignInFailed { user: user.to_string(), times });
        }
    }

    async fn write(&self) -> Result<(), StoreError> {
        let _turn = self.writing.lock().await;
        let (records, noted) = {
            let mut waiting = lock(&self.waiting);
            (Vec::from(std::mem::take(&mut waiting.records)), waiting.noted)
        };
        if records.is_empty() {
            return Ok(());
        }
        if let Err(error) = self.keeper.append(records.clone()).await {
            let mut waiting = lock(&self.waiting);
            let later = std::mem::replace(&mut waiting.records, records.into());
            later.into_iter().for_each(|record| waiting.push(record));
            return Err(error);
        }
        self.done.send_replace(noted);
        Ok(())
    }
}

fn record(by: &By, deed: Deed) -> AuditRecord {
    let By { actor, source } = by.clone();
    AuditRecord { time: clock::time_of_day(), actor, source, robot: None, deed }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::Sqlite;

    #[tokio::test]
    async fn records_that_come_without_end_do_not_delay_the_counts() {
        let folder = tempfile::tempdir().unwrap();
        let ledger = Ledger::new(Keeper::start(Sqlite::open(folder.path()).unwrap()).unwrap());
        let mut look = tokio::time::interval(Duration::from_millis(100));
        let begun = std::time::Instant::now();
        let mut due = 0;
        // A record is always there: a wait that begins anew after each would never end.
        while due < 3 {
            ledger.wake.notify_one();
            due += u32::from(ledger.is_due(&mut look, false).await);
            assert!(begun.elapsed() < Duration::from_secs(20), "{due}");
            tokio::task::yield_now().await;
        }
        assert!(begun.elapsed() >= Duration::from_millis(150));
    }
}
