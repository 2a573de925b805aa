//! What waits for the disk at a robot: records for the audit log, and the state of the seat.

use std::collections::{BTreeSet, VecDeque};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use r6_api::Code;
use r6_api::gateway::{AuditRecord, Deed};
use tokio::sync::Mutex as AsyncMutex;

use super::{By, Station};
use crate::clock;
use crate::core::owner::Phase;
use crate::core::refusals::Refusals;
use crate::core::seat::Saved;
use crate::outage::Outage;
use crate::problem::Problem;
use crate::store::{Keeper, MAX_PAGE, Store, StoreError, body};

/// How many records wait to be written. If the store fails for long, refusals are lost first, then the oldest
/// records, and the log of the process says so.
const MAX_PENDING: usize = 1_000;

/// How long an answer waits until the disk has what it tells: a write takes milliseconds, and a person who
/// stops a robot must not wait for a disk that is full.
const ANSWERS_WITHIN: Duration = Duration::from_millis(250);

/// How long an answer waits until a database that gateways share has what it tells. An owner without a
/// database ends by then.
const SHARED_WITHIN: Duration = Duration::from_secs(2);

/// For how long the records are written that a term has left, and how often.
const WRITES_ON: Duration = Duration::from_secs(600);
const WRITES_AGAIN: Duration = Duration::from_millis(500);

/// How often to look whether it has.
const LOOK_AT_STORE: Duration = Duration::from_millis(10);

impl Station {
    /// Notes something for the audit log, to be written soon.
    pub(in crate::fleet) fn note(&self, by: &By, deed: Deed) {
        let record = self.record(by, deed);
        self.pending.push(record);
        self.to_write.notify_one();
    }

    /// A record about this robot.
    pub(in crate::fleet) fn record(&self, by: &By, deed: Deed) -> AuditRecord {
        AuditRecord {
            time: clock::time_of_day(),
            actor: by.actor.clone(),
            source: by.source.clone(),
            robot: Some(self.name().to_owned()),
            deed,
        }
    }

    /// Whether this caller did not do this at this robot from the same address within the last minute.
    pub(in crate::fleet) fn is_first_in_a_minute(&self, by: &By, request: &str) -> bool {
        is_first(&self.refusals, by, request)
    }

    /// Whether this caller has had no stop of this robot from the same address within the last minute that
    /// was not confirmed.
    pub(in crate::fleet) fn is_first_unconfirmed(&self, by: &By, request: &str) -> bool {
        is_first(&self.unconfirmed, by, request)
    }

    /// Writes a record now, behind the records that wait. Returns its number.
    pub(in crate::fleet) async fn append(&self, record: AuditRecord) -> Result<u64, StoreError> {
        Ok(self.pending.write(&self.term.keeper, Some(record), |_| true).await?.unwrap_or_default())
    }

    /// Writes the state of the seat to the store, if it changed.
    pub(in crate::fleet) async fn save(&self) -> Result<(), StoreError> {
        let _turn = self.saving.lock().await;
        let saved = {
            let held = self.held();
            if held.seat.saved() == &held.stored {
                return Ok(());
            }
            held.seat.saved().clone()
        };
        self.term.keeper.save_seat(self.name.clone(), saved.clone()).await?;
        self.held().stored = saved;
        Ok(())
    }

    /// Writes the records that wait. When this returns, they are in the store, as durable as that makes them.
    pub(in crate::fleet) async fn write_pending(&self) -> Result<(), StoreError> {
        self.pending.write(&self.term.keeper, None, |_| true).await.map(drop)
    }

    /// Writes the records that are left after the term, for [`WRITES_ON`] at most: what happened belongs in
    /// the audit log, whichever gateway has the robot by now. Only outcomes are left to the next owner, which
    /// writes that they are unknown: a command has one.
    pub(in crate::fleet) async fn write_last(&self) {
        let _counted = self.shared.begin_writing_last();
        let (begun, mut outage) = (clock::now(), Outage::default());
        loop {
            // Looked at first: what is under way may still tell of its end.
            let is_over = self.is_idle();
            let written = self.pending.write(&self.shared.keeper, None, |record| !is_outcome(record)).await;
            outage.note(&format!("the last records of {} cannot be written", self.name()), &written);
            let passed = clock::now().since(begun);
            if written.is_err() && passed >= WRITES_ON {
                let records = self.records_waiting();
                tracing::error!(robot = self.name(), records, "the audit log does not get its last records");
                return;
            }
            if written.is_ok() && is_over {
                return;
            }
            tokio::time::sleep(WRITES_AGAIN).await;
        }
    }

    /// Waits until all that has happened so far is on the disk, [`ANSWERS_WITHIN`] at most. So what a
    /// caller is told survives the gateway, and a disk that is full or slow holds no answer up.
    pub async fn written(&self) {
        let written = async {
            loop {
                let wrote = self.wrote.notified();
                if self.is_written() {
                    return;
                }
                wrote.await;
            }
        };
        if tokio::time::timeout(ANSWERS_WITHIN, written).await.is_err() {
            tracing::warn!(robot = self.name(), "an answer is given before the disk has what it tells");
        }
    }

    /// The same, and with a store that others share [`SHARED_WITHIN`] at most: another gateway may go on from
    /// that store at any time.
    ///
    /// # Errors
    /// `store_unavailable`: it holds here, and the shared store did not confirm that it has it.
    pub async fn written_for_others(&self) -> Result<(), Problem> {
        self.written().await;
        let ownership = &self.term.ownership;
        if ownership.is_alone() {
            return Ok(());
        }
        let begun = clock::now();
        loop {
            // In this order: what a gateway that lost the robots did not write any more does not count.
            if self.is_written() && ownership.may_move() {
                return Ok(());
            }
            if clock::now().since(begun) >= SHARED_WITHIN || ownership.phase() >= Phase::StopLists {
                let message = "it was done here, but the database did not confirm it in time: read the robot again \
                               before you go on";
                return Err(Problem::new(Code::StoreUnavailable, message));
            }
            tokio::time::sleep(LOOK_AT_STORE).await;
        }
    }

    /// The seat, if a stop holds here that is not in the store.
    pub(crate) fn unsaved_stop(&self) -> Option<Saved> {
        let held = self.held();
        let saved = held.seat.saved();
        (saved.stopped && !held.stored.stopped).then(|| saved.clone())
    }

    pub(super) fn is_written(&self) -> bool {
        // Records on their way count as not written.
        let (Ok(_writing), Ok(_saving)) = (self.pending.writing.try_lock(), self.saving.try_lock()) else {
            return false;
        };
        let held = self.held();
        self.pending.is_empty() && held.seat.saved() == &held.stored
    }

    /// How many records wait to be written.
    pub fn records_waiting(&self) -> usize {
        self.pending.records().len()
    }
}

/// The records of a robot that wait for the audit log.
#[derive(Debug, Default)]
pub(super) struct Pending {
    records: Mutex<VecDeque<AuditRecord>>,
    /// Locked while records are written, so that they stand in their order, and none counts as written that
    /// is still on its way.
    writing: Arc<AsyncMutex<()>>,
    /// Whether what waits may be in the audit log already: the store did not answer when it was written.
    is_in_doubt: AtomicBool,
}

impl Pending {
    /// Lets a record wait.
    pub fn push(&self, record: AuditRecord) {
        push(&mut self.records(), record);
    }

    fn is_empty(&self) -> bool {
        self.records().is_empty()
    }

    /// Writes what waits and is wanted, and then this one, whose number it returns. What is not wanted goes.
    /// Once it is on its way it goes on if the caller is gone: otherwise it would not be known whether it has
    /// to be written again. If it fails, what waited waits again, before what came since.
    async fn write(
        self: &Arc<Self>,
        keeper: &Keeper,
        last: Option<AuditRecord>,
        is_wanted: impl Fn(&AuditRecord) -> bool,
    ) -> Result<Option<u64>, StoreError> {
        let turn = Arc::clone(&self.writing).lock_owned().await;
        let waiting: Vec<_> = self.records().drain(..).filter(is_wanted).collect();
        if waiting.is_empty() && last.is_none() {
            return Ok(None);
        }
        let (pending, keeper) = (Arc::clone(self), keeper.clone());
        let write = async move {
            let _turn = turn;
            let written = pending.append(&keeper, waiting.clone(), last).await;
            if written.is_err() {
                let mut records = pending.records();
                let later = std::mem::replace(&mut *records, waiting.into());
                later.into_iter().for_each(|record| push(&mut records, record));
            }
            written.map(Some)
        };
        tokio::spawn(write).await.unwrap_or(Err(StoreError::Closed))
    }

    /// Appends what waited, as far as it is not in the log, and then this one, whose number it returns.
    async fn append(
        &self,
        keeper: &Keeper,
        mut waiting: Vec<AuditRecord>,
        last: Option<AuditRecord>,
    ) -> Result<u64, StoreError> {
        if self.is_in_doubt.load(Ordering::SeqCst) {
            waiting = not_in_log(keeper, waiting).await?;
        }
        let behind = waiting.len() as u64;
        let written = keeper.append(waiting.into_iter().chain(last).collect()).await;
        match written {
            Ok(_) => self.is_in_doubt.store(false, Ordering::SeqCst),
            // Nothing was written then.
            Err(StoreError::NotOwner) => {}
            Err(_) => self.is_in_doubt.store(true, Ordering::SeqCst),
        }
        Ok(written? + behind)
    }

    fn records(&self) -> MutexGuard<'_, VecDeque<AuditRecord>> {
        self.records.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Those of these records that are not among the last entries of the audit log.
async fn not_in_log(keeper: &Keeper, records: Vec<AuditRecord>) -> Result<Vec<AuditRecord>, StoreError> {
    let newest = |store: &mut dyn Store| {
        let last = store.ends()?.last;
        store.entries(last.saturating_sub(MAX_PAGE as u64), MAX_PAGE)
    };
    let entries = keeper.work(newest).await?;
    let known: BTreeSet<_> = entries.iter().map(|entry| entry.body.as_str()).collect();
    let is_new = |record: &AuditRecord| body(record).map_or(true, |body| !known.contains(body.as_str()));
    Ok(records.into_iter().filter(is_new).collect())
}

/// Whether it says how something ended whose begin is in the audit log.
fn is_outcome(record: &AuditRecord) -> bool {
    matches!(record.deed, Deed::CommandOutcome { .. } | Deed::RunOutcome { .. })
}

fn push(pending: &mut VecDeque<AuditRecord>, record: AuditRecord) {
    pending.push_back(record);
    if pending.len() <= MAX_PENDING {
        return;
    }
    // A client in a loop must not push out what was done.
    let refusal = pending.iter().position(|record| matches!(record.deed, Deed::Refused { .. }));
    if let Some(lost) = pending.remove(refusal.unwrap_or(0)) {
        tracing::error!(?lost, "the store does not take records: one is lost");
    }
}

fn is_first(remembered: &Mutex<Refusals>, by: &By, request: &str) -> bool {
    let source = by.source.as_deref().and_then(|source| source.parse::<SocketAddr>().ok());
    let Some(source) = source else { return true };
    let mut remembered = remembered.lock().unwrap_or_else(PoisonError::into_inner);
    remembered.is_written(clock::now(), source.ip(), &format!("{} {request}", by.actor))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::Memory;

    fn record(request: &str) -> AuditRecord {
        let deed = Deed::Refused { request: request.to_owned(), code: Code::NoLease };
        AuditRecord { time: request.to_owned(), actor: "token 1".to_owned(), source: None, robot: None, deed }
    }

    /// A server that commits and dies before it answers: the records wait again, and are in the log.
    #[tokio::test]
    async fn a_record_that_may_be_in_the_log_is_written_once() {
        let keeper = Keeper::start(Memory::default()).unwrap();
        keeper.append(vec![record("one")]).await.unwrap();
        let pending = Arc::<Pending>::default();
        pending.push(record("one"));
        pending.push(record("two"));
        pending.is_in_doubt.store(true, Ordering::SeqCst);
        assert_eq!(pending.write(&keeper, Some(record("three")), |_| true).await, Ok(Some(3)));
        assert!(pending.is_empty() && !pending.is_in_doubt.load(Ordering::SeqCst));
        let bodies: Vec<_> =
            keeper.entries(0, 10).await.unwrap().into_iter().map(|entry| entry.body).collect();
        assert_eq!(bodies, ["one", "two", "three"].map(|request| body(&record(request)).unwrap()));
    }

    #[tokio::test]
    async fn what_a_closed_store_does_not_take_waits_again_in_its_order() {
        let keeper = Keeper::start(Memory::default()).unwrap();
        keeper.end().await.unwrap();
        let pending = Arc::<Pending>::default();
        pending.push(record("one"));
        pending.push(record("two"));
        assert!(pending.write(&keeper, Some(record("three")), |_| true).await.is_err());
        assert_eq!(*pending.records(), [record("one"), record("two")]);
        assert!(pending.is_in_doubt.load(Ordering::SeqCst), "it is not known what was written");
    }
}
