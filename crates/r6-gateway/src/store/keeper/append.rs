//! Appends that share one commit.

use std::collections::BTreeSet;

use r6_api::gateway::AuditRecord;
use tokio::sync::mpsc::Receiver;

use super::{Answer, Asked, Job};
use crate::core::owner::Claim;
use crate::store::{Store, StoreError};

/// How many appends share one commit.
const MAX_TOGETHER: usize = 64;

/// Records to append, what they are about, and who waits for that.
pub(super) struct Append {
    pub(super) claim: Option<Claim>,
    pub(super) records: Vec<AuditRecord>,
    pub(super) answer: Answer<u64>,
}

/// Appends these records, and those of the jobs right behind, in one commit. Returns the first other job.
pub(super) fn append(store: &mut impl Store, first: Append, waiting: &mut Receiver<Asked>) -> Option<Asked> {
    let mut all = vec![first];
    let mut other = None;
    while all.len() < MAX_TOGETHER
        && let Ok(job) = waiting.try_recv()
    {
        match job {
            (claim, Job::Append(records, answer)) => all.push(Append { claim, records, answer }),
            job => {
                other = Some(job);
                break;
            }
        }
    }
    append_all(store, all);
    other
}

fn append_all(store: &mut impl Store, all: Vec<Append>) {
    let claims: BTreeSet<_> = all.iter().filter_map(|append| append.claim.clone()).collect();
    store.hold(&claims.into_iter().collect::<Vec<_>>());
    let records: Vec<_> = all.iter().flat_map(|append| append.records.iter().cloned()).collect();
    let first = store.append(&records);
    if first == Err(StoreError::NotOwner) && all.len() > 1 {
        // One of the robots is another gateway's by now: the records of the others do not wait for that.
        return all.into_iter().for_each(|append| append_all(store, vec![append]));
    }
    let mut behind = 0;
    for Append { records, answer, .. } in all {
        drop(answer.send(first.clone().map(|first| first + behind)));
        behind += records.len() as u64;
    }
}
