//! Outcomes of commands: written before the answer leaves, synchronised right after.
//!
//! An intent has to be on the disk before its command leaves, since nothing else tells that it left. An
//! outcome need not: if a power cut takes it, the next start finds the intent alone, and writes that the
//! outcome is unknown. So the caller does not wait for the disk a second time. What was written is in the
//! memory of the system, and survives the end of the process.

use std::fs::{File, OpenOptions};
use std::path::{Path, PathBuf};

use r6_api::gateway::{AuditRecord, Deed};
use rusqlite::{Connection, Transaction, TransactionBehavior};

use super::Sqlite;
use crate::store::StoreError;

/// What is known of the write-ahead log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Log {
    /// All of it is on the disk.
    #[default]
    Settled,
    /// It has outcomes that are not synchronised.
    Written,
    /// It could not be synchronised. The system tells that once, and may have lost a part of it since. What
    /// is written behind that part would not survive a power cut, even if it is synchronised.
    Doubtful,
}

/// What is in the write-ahead log of a file and is not synchronised.
#[derive(Debug, Default)]
pub(super) struct Unsettled {
    /// The path of the log; `None` for a store in memory.
    path: Option<PathBuf>,
    /// The log. It stays open, because the system tells of a failure only who had the file open before.
    file: Option<File>,
    log: Log,
    /// Whether commits may not be synchronised now.
    is_normal: bool,
}

impl Unsettled {
    /// Nothing yet of the file at this path.
    pub(super) fn of(path: &Path) -> Self {
        Self { path: Some(log_of(path)), ..Self::default() }
    }

    /// Opens the log. SQLite has no locks on this file, so it loses none when it is closed.
    fn open(&mut self) -> std::io::Result<()> {
        if let (Some(path), None) = (&self.path, &self.file) {
            self.file = Some(OpenOptions::new().write(true).open(path)?);
        }
        Ok(())
    }

    /// Synchronises the log.
    pub(super) fn settle(&mut self) -> Result<(), StoreError> {
        if self.log != Log::Written {
            return Ok(());
        }
        let done = self.open().and_then(|()| self.file.as_ref().map_or(Ok(()), File::sync_data));
        self.log = if done.is_ok() { Log::Settled } else { Log::Doubtful };
        done.map_err(|error| StoreError::Unavailable(format!("the log of the store: {error}")))
    }
}

/// The write-ahead log of a file.
pub(super) fn log_of(path: &Path) -> PathBuf {
    let mut log = path.as_os_str().to_owned();
    log.push("-wal");
    log.into()
}

/// Whether these are outcomes of commands, and nothing else.
pub(super) fn are_outcomes(records: &[AuditRecord]) -> bool {
    let is_outcome = |record: &AuditRecord| matches!(record.deed, Deed::CommandOutcome { .. });
    !records.is_empty() && records.iter().all(is_outcome)
}

impl Sqlite {
    /// The connection, for commits that are synchronised. A log that is in doubt is written into the file
    /// first, which SQLite synchronises, and begins anew.
    pub(super) fn durable(&mut self) -> Result<&mut Connection, StoreError> {
        if self.unsettled.is_normal {
            self.connection.pragma_update(None, "synchronous", "FULL")?;
            self.unsettled.is_normal = false;
        }
        if self.unsettled.log == Log::Doubtful {
            let is_busy: bool =
                self.connection.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |row| row.get(0))?;
            if is_busy {
                let told =
                    "its log could not be synchronised, and another program reads it: nothing is written";
                return Err(StoreError::Unavailable(told.to_owned()));
            }
            self.unsettled.log = Log::Settled;
        }
        Ok(&mut self.connection)
    }

    /// Does one transaction that is not synchronised.
    pub(super) fn write_unsettled<T>(
        &mut self,
        write: impl FnOnce(Transaction<'_>) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        self.durable()?;
        // Without the log, settling says why.
        let _ = self.unsettled.open();
        self.connection.pragma_update(None, "synchronous", "NORMAL")?;
        self.unsettled.is_normal = true;
        let begun = self.connection.transaction_with_behavior(TransactionBehavior::Immediate);
        let written = begun.map_err(StoreError::from).and_then(write);
        // It may be there also if SQLite says that it is not.
        self.unsettled.log = Log::Written;
        // If this fails, the next transaction sets it.
        if self.connection.pragma_update(None, "synchronous", "FULL").is_ok() {
            self.unsettled.is_normal = false;
        }
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

    fn intent() -> AuditRecord {
        record(Deed::CommandIntent { command: "clearAlarm".to_owned(), lease: 1 })
    }

    #[test]
    fn only_outcomes_wait_to_be_synchronised_and_everything_after_them_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = Sqlite::open(folder.path()).unwrap();
        for records in [vec![], vec![intent()], vec![outcome(), intent()]] {
            store.append(&records).unwrap();
            assert_eq!(store.unsettled.log, Log::Settled, "{records:?}");
        }
        store.append(&[outcome(), outcome()]).unwrap();
        assert_eq!((store.unsettled.log, synchronous(&store)), (Log::Written, 2));
        // Another reader has them, as the next start would.
        let mut other = Sqlite::open_to_read(folder.path(), false).unwrap();
        assert_eq!(other.ends().unwrap().last, 5);
        store.settle().unwrap();
        assert_eq!(store.unsettled.log, Log::Settled);
        store.end_command(1, "{}", &outcome()).unwrap();
        assert_eq!(store.unsettled.log, Log::Written);
    }

    /// `/dev/full` cannot be synchronised: the system says so, as it does of a disk that fails.
    #[cfg(target_os = "linux")]
    fn with_doubtful_log(folder: &Path) -> Sqlite {
        let mut store = Sqlite::open(folder).unwrap();
        store.append(&[intent()]).unwrap();
        store.append(&[outcome()]).unwrap();
        store.unsettled.file = Some(OpenOptions::new().write(true).open("/dev/full").unwrap());
        assert!(matches!(store.settle(), Err(StoreError::Unavailable(_))));
        store.unsettled.file = None;
        assert_eq!(store.unsettled.log, Log::Doubtful);
        store
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn no_intent_is_written_behind_a_log_that_is_in_doubt() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = with_doubtful_log(folder.path());
        store.connection.busy_timeout(std::time::Duration::from_millis(10)).unwrap();
        let other = Sqlite::open_to_read(folder.path(), false).unwrap();
        other.hold_still().unwrap();
        other.count_entries().unwrap();
        for _ in 0..2 {
            let refused = store.append(&[intent()]);
            assert!(
                matches!(refused, Err(StoreError::Unavailable(why)) if why.contains("nothing is written"))
            );
        }
        assert!(store.put_head("x").is_err() && store.append(&[outcome()]).is_err());
        drop(other);
        let size = || std::fs::metadata(log_of(&folder.path().join("control.db"))).unwrap().len();
        let before = size();
        store.append(&[intent()]).unwrap();
        assert!(size() < before, "the log began anew");
        assert_eq!((store.unsettled.log, store.count_entries()), (Log::Settled, Ok(3)));
    }

    #[test]
    fn a_connection_that_stayed_unsynchronised_is_set_back_before_the_next_intent() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = Sqlite::open(folder.path()).unwrap();
        store.connection.pragma_update(None, "synchronous", "NORMAL").unwrap();
        store.unsettled.is_normal = true;
        store.connection.execute_batch("BEGIN").unwrap();
        assert!(store.append(&[intent()]).is_err(), "within a transaction it cannot be set");
        store.connection.execute_batch("ROLLBACK").unwrap();
        store.append(&[intent()]).unwrap();
        assert_eq!((synchronous(&store), store.unsettled.is_normal), (2, false));
        let failed: Result<(), _> =
            store.write_unsettled(|_| Err(StoreError::Unavailable("no room".to_owned())));
        assert!(failed.is_err());
        assert_eq!(synchronous(&store), 2);
    }
}
