//! Outcomes of commands: written before the answer leaves, synchronised right after.
//!
//! An intent has to be on the disk before its command leaves, since nothing else tells that it left. An
//! outcome need not: if a power cut takes it, the next start finds the intent alone, and writes that the
//! outcome is unknown. So the caller does not wait for the disk a second time. What was written is in the
//! memory of the system, and survives the end of the process.

use std::fs::OpenOptions;
use std::path::{Path, PathBuf};

use r6_api::gateway::{AuditRecord, Deed};
use rusqlite::Transaction;

use super::Sqlite;
use crate::store::StoreError;

/// What is in the write-ahead log of a file and is not synchronised.
#[derive(Debug, Default)]
pub(super) struct Unsettled {
    /// The log; `None` for a store in memory.
    log: Option<PathBuf>,
    is_there: bool,
}

impl Unsettled {
    /// Nothing yet of the file at this path.
    pub(super) fn of(path: &Path) -> Self {
        let mut log = path.as_os_str().to_owned();
        log.push("-wal");
        Self { log: Some(log.into()), is_there: false }
    }

    /// Synchronises the log.
    pub(super) fn settle(&mut self) -> Result<(), StoreError> {
        if !std::mem::take(&mut self.is_there) {
            return Ok(());
        }
        let Some(log) = &self.log else { return Ok(()) };
        // SQLite has no locks on this file, so it loses none when this handle is closed.
        let synchronised = OpenOptions::new().write(true).open(log).and_then(|log| log.sync_data());
        synchronised.map_err(|error| StoreError::Unavailable(format!("{}: {error}", log.display())))
    }
}

/// Whether these are outcomes of commands, and nothing else.
pub(super) fn are_outcomes(records: &[AuditRecord]) -> bool {
    let is_outcome = |record: &AuditRecord| matches!(record.deed, Deed::CommandOutcome { .. });
    !records.is_empty() && records.iter().all(is_outcome)
}

impl Sqlite {
    /// Does one transaction that is not synchronised.
    pub(super) fn write_unsettled<T>(
        &mut self,
        write: impl FnOnce(Transaction<'_>) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        self.connection.pragma_update(None, "synchronous", "NORMAL")?;
        let written = self.write().and_then(write);
        // It may be there also if SQLite says that it is not.
        self.unsettled.is_there = true;
        self.connection.pragma_update(None, "synchronous", "FULL")?;
        written
    }
}

#[cfg(test)]
mod tests {
    use r6_api::gateway::CommandOutcome;

    use super::*;
    use crate::store::Store;

    fn record(deed: Deed) -> AuditRecord {
        let time = "2026-11-20T00:00:00Z".to_owned();
        AuditRecord { time, actor: "token 1".to_owned(), source: None, robot: None, deed }
    }

    fn outcome() -> AuditRecord {
        record(Deed::CommandOutcome { intent: 1, outcome: CommandOutcome::Accepted, detail: String::new() })
    }

    fn synchronous(store: &Sqlite) -> i64 {
        store.connection.query_row("PRAGMA synchronous", [], |row| row.get(0)).unwrap()
    }

    #[test]
    fn only_outcomes_wait_to_be_synchronised_and_everything_after_them_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = Sqlite::open(folder.path()).unwrap();
        let intent = || record(Deed::CommandIntent { command: "clearAlarm".to_owned(), lease: 1 });
        for records in [vec![], vec![intent()], vec![outcome(), intent()]] {
            store.append(&records).unwrap();
            assert!(!store.unsettled.is_there, "{records:?}");
        }
        store.append(&[outcome(), outcome()]).unwrap();
        assert!(store.unsettled.is_there);
        assert_eq!(synchronous(&store), 2, "what comes next is synchronised");
        // Another reader has them, as the next start would.
        let mut other = Sqlite::open_to_read(folder.path(), false).unwrap();
        assert_eq!(other.ends().unwrap().last, 5);
        store.settle().unwrap();
        assert!(!store.unsettled.is_there);
        store.end_command(1, "{}", &outcome()).unwrap();
        assert!(store.unsettled.is_there);
        let log = folder.path().join("control.db-wal");
        std::fs::rename(&log, folder.path().join("gone")).unwrap();
        assert!(
            matches!(store.settle(), Err(StoreError::Unavailable(why)) if why.contains("control.db-wal"))
        );
        std::fs::rename(folder.path().join("gone"), &log).unwrap();
    }

    #[test]
    fn a_transaction_that_fails_leaves_the_next_one_synchronised() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = Sqlite::open(folder.path()).unwrap();
        let failed: Result<(), _> =
            store.write_unsettled(|_| Err(StoreError::Unavailable("no room".to_owned())));
        assert!(failed.is_err());
        assert_eq!(synchronous(&store), 2);
    }
}
