//! What waits for the disk at a robot: records for the audit log, and the state of the seat.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use r6_api::Code;
use r6_api::gateway::{AuditRecord, Deed};

use super::{By, Station};
use crate::clock;
use crate::core::owner::Phase;
use crate::core::refusals::Refusals;
use crate::problem::Problem;
use crate::store::StoreError;

/// How many records wait to be written. If the store fails for long, refusals are lost first, then the oldest
/// records, and the log of the process says so.
const MAX_PENDING: usize = 1_000;

/// How long an answer waits until the disk has what it tells: a write takes milliseconds, and a person who
/// stops a robot must not wait for a disk that is full.
const ANSWERS_WITHIN: Duration = Duration::from_millis(250);

/// How long an answer waits until a database that gateways share has what it tells. An owner without a
/// database ends by then.
const SHARED_WITHIN: Duration = Duration::from_secs(2);

/// How often to look whether it has.
const LOOK_AT_STORE: Duration = Duration::from_millis(10);

impl Station {
    /// Notes something for the audit log, to be written soon.
    pub(in crate::fleet) fn note(&self, by: &By, deed: Deed) {
        let record = self.record(by, deed);
        push(&mut self.held().pending, record);
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
        let _turn = self.writing.lock().await;
        let waiting = self.take_pending();
        let records = waiting.iter().cloned().chain([record]).collect();
        let first = self.term.keeper.append(records).await;
        let behind = waiting.len() as u64;
        if first.is_err() {
            self.put_back(waiting);
        }
        first.map(|first| first + behind)
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

    /// Writes the records that wait. When this returns, they are on the disk.
    pub(in crate::fleet) async fn write_pending(&self) -> Result<(), StoreError> {
        let _turn = self.writing.lock().await;
        let pending = self.take_pending();
        if pending.is_empty() {
            return Ok(());
        }
        let written = self.term.keeper.append(pending.clone()).await;
        if written.is_err() {
            self.put_back(pending);
        }
        written.map(drop)
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

    pub(super) fn is_written(&self) -> bool {
        // Records on their way count as not written.
        let (Ok(_writing), Ok(_saving)) = (self.writing.try_lock(), self.saving.try_lock()) else {
            return false;
        };
        let held = self.held();
        held.pending.is_empty() && held.seat.saved() == &held.stored
    }

    /// How many records wait to be written.
    pub fn records_waiting(&self) -> usize {
        self.held().pending.len()
    }

    fn take_pending(&self) -> Vec<AuditRecord> {
        self.held().pending.drain(..).collect()
    }

    /// Puts records back before those that were noted meanwhile.
    fn put_back(&self, records: Vec<AuditRecord>) {
        let mut held = self.held();
        let later = std::mem::replace(&mut held.pending, records.into());
        later.into_iter().for_each(|record| push(&mut held.pending, record));
        drop(held);
        self.to_write.notify_one();
    }
}

pub(super) fn push(pending: &mut VecDeque<AuditRecord>, record: AuditRecord) {
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
