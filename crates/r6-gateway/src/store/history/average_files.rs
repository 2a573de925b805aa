//! Averages in files of SQLite, beside those of days: `minutes-2026-11-25.db` for a day,
//! `hours-2026-11.db` for a month.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use rusqlite::{Connection, OptionalExtension, TransactionBehavior, params};

use super::averages::{AskAverages, AverageFile, AverageRow, AverageStore, DayNote, DayState, day_of};
use super::file::{self, Form};
use super::table;
use crate::core::history::averages::Step;
use crate::store::StoreError;

/// What files of averages are made with. A page of 4 KB: the hours of a signal take some hundred bytes.
const FORM: Form = Form { tables: [table::SIGNALS, TABLES], version: 1, page: 4_096 };

/// The write-ahead log is written back when it has this many pages: a mebibyte.
const CHECKPOINT_PAGES: u64 = 256;

/// The files that are open at once: those of the minutes and of the hours of one day.
const MAX_OPEN: usize = 2;

/// `day` is used in files of hours alone: what became of a day.
const TABLES: &str = "
CREATE TABLE averages (
    signal INTEGER NOT NULL,
    day    INTEGER NOT NULL,
    bytes  BLOB NOT NULL
) STRICT;
CREATE UNIQUE INDEX averages_of_signal ON averages (signal, day);
CREATE TABLE day (
    day   INTEGER PRIMARY KEY,
    state INTEGER NOT NULL,
    lacks INTEGER NOT NULL
) STRICT;
";

/// The averages in a folder.
#[derive(Debug)]
pub(super) struct AverageFiles {
    folder: PathBuf,
    /// `false` for readers.
    writes: bool,
    open: BTreeMap<AverageFile, Connection>,
}

impl AverageFiles {
    pub fn new(folder: &Path, writes: bool) -> Self {
        Self { folder: folder.to_owned(), writes, open: BTreeMap::new() }
    }

    fn path(&self, file: AverageFile) -> PathBuf {
        self.folder.join(name_of(file))
    }

    /// The connection to a file. Others are closed if there are too many.
    fn connection(&mut self, file: AverageFile) -> Result<&mut Connection, StoreError> {
        if !self.open.contains_key(&file) {
            while self.open.len() >= MAX_OPEN {
                // Of one step there is rarely more than one: the older one is not needed any more.
                let same = self.open.keys().find(|open| open.step == file.step).copied();
                let Some(old) = same.or_else(|| self.open.keys().next().copied()) else { break };
                self.close(old);
            }
            let path = self.path(file);
            let connection = if self.writes {
                file::make(&path, FORM, CHECKPOINT_PAGES)?
            } else {
                file::look(&path, FORM)?
            };
            self.open.insert(file, connection);
        }
        self.open.get_mut(&file).ok_or(StoreError::Closed)
    }

    /// Closes a file, which needs no write-ahead log then. A reader may be in the way: then the log stays.
    fn close(&mut self, file: AverageFile) {
        let connection = self.open.remove(&file);
        if let Some(connection) = connection.filter(|_| self.writes) {
            let _ = connection.pragma_update(None, "journal_mode", "DELETE");
        }
    }

    /// Forgets a connection that failed: what it thinks of its file may be wrong.
    fn kept<T>(&mut self, file: AverageFile, done: Result<T, StoreError>) -> Result<T, StoreError> {
        if done.is_err() {
            self.open.remove(&file);
        }
        done
    }

    fn has(&self, file: AverageFile) -> bool {
        std::fs::metadata(self.path(file)).is_ok_and(|about| about.is_file())
    }
}

impl AverageStore for AverageFiles {
    fn write(&mut self, step: Step, day: i64, rows: &[AverageRow]) -> Result<(), StoreError> {
        let file = AverageFile::of(step, day);
        let written = self.connection(file).and_then(|connection| write(connection, day, rows));
        self.kept(file, written)
    }

    fn read(&mut self, file: AverageFile, ask: AskAverages<'_>) -> Result<Vec<(i64, Vec<u8>)>, StoreError> {
        if !self.has(file) {
            return Ok(Vec::new());
        }
        let rows = self.connection(file).and_then(|connection| read(connection, ask));
        match self.kept(file, rows) {
            // It may be removed at any time.
            Err(_) if !self.has(file) => Ok(Vec::new()),
            rows => rows,
        }
    }

    fn set_state(&mut self, day: i64, note: DayNote) -> Result<(), StoreError> {
        let minutes = AverageFile::of(Step::Minute, day);
        if let Some(connection) = self.open.get(&minutes) {
            checkpoint(connection)?;
            self.close(minutes);
        }
        let hours = AverageFile::of(Step::Hour, day);
        let set = self.connection(hours).and_then(|connection| {
            let text = "INSERT INTO day (day, state, lacks) VALUES (?1, ?2, ?3)
                        ON CONFLICT (day) DO UPDATE SET state = excluded.state, lacks = excluded.lacks";
            connection.execute(text, params![day, number_of(note.state), note.lacks])?;
            checkpoint(connection)
        });
        self.kept(hours, set)
    }

    fn states(&mut self, days: RangeInclusive<i64>) -> Result<BTreeMap<i64, DayNote>, StoreError> {
        let mut all = BTreeMap::new();
        for (file, _) in self.files()? {
            let of = file.days();
            if file.step != Step::Hour || of.end() < days.start() || of.start() > days.end() {
                continue;
            }
            let states = self.connection(file).and_then(|connection| states(connection));
            match self.kept(file, states) {
                Ok(states) => all.extend(states.into_iter().filter(|(day, _)| days.contains(day))),
                // It may be removed at any time.
                Err(_) if !self.has(file) => {}
                Err(error @ StoreError::Unreadable(_)) => {
                    tracing::error!(%error, ?file, "a file of averages cannot be read");
                }
                Err(error) => return Err(error),
            }
        }
        Ok(all)
    }

    fn files(&mut self) -> Result<Vec<(AverageFile, u64)>, StoreError> {
        let names = file::names(&self.folder)?.into_iter().filter(|(_, is_file)| *is_file);
        let files = names.filter_map(|(name, _)| file_of(&name));
        let mut files: Vec<_> = files.map(|file| (file, file::size(&self.path(file)))).collect();
        files.sort_unstable();
        Ok(files)
    }

    fn remove(&mut self, file: AverageFile) -> Result<(), StoreError> {
        self.open.remove(&file);
        file::remove(&self.path(file))
    }
}

fn write(connection: &mut Connection, day: i64, rows: &[AverageRow]) -> Result<(), StoreError> {
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
    for AverageRow { robot, address, bytes } in rows {
        let signal = table::signal(&transaction, robot, *address)?;
        transaction
            .prepare_cached(
                "INSERT INTO averages (signal, day, bytes) VALUES (?1, ?2, ?3)
                 ON CONFLICT (signal, day) DO UPDATE SET bytes = excluded.bytes",
            )?
            .execute(params![signal, day, bytes])?;
    }
    transaction.commit()?;
    Ok(())
}

fn read(connection: &Connection, ask: AskAverages<'_>) -> Result<Vec<(i64, Vec<u8>)>, StoreError> {
    let Some(signal) = table::find(connection, ask.robot, ask.address)? else { return Ok(Vec::new()) };
    let mut select = connection.prepare_cached(
        "SELECT day, bytes FROM averages WHERE signal = ?1 AND day BETWEEN ?2 AND ?3 ORDER BY day",
    )?;
    let rows = select.query_map(params![signal, ask.from, ask.to], |row| Ok((row.get(0)?, row.get(1)?)))?;
    Ok(rows.collect::<Result<_, _>>()?)
}

fn states(connection: &Connection) -> Result<Vec<(i64, DayNote)>, StoreError> {
    let mut select = connection.prepare_cached("SELECT day, state, lacks FROM day")?;
    let rows = select.query_map([], |row| Ok((row.get(0)?, row.get::<_, i64>(1)?, row.get(2)?)))?;
    let mut all = Vec::new();
    for row in rows {
        let (day, number, lacks) = row?;
        all.extend(state_of(number).map(|state| (day, DayNote { state, lacks })));
    }
    Ok(all)
}

/// Writes the log back as far as no reader is in the way. All of it survives a power cut then.
fn checkpoint(connection: &Connection) -> Result<(), StoreError> {
    connection.query_row("PRAGMA wal_checkpoint(PASSIVE)", [], |_| Ok(())).optional()?;
    Ok(())
}

/// The number of a state in a file, which never changes.
fn number_of(state: DayState) -> i64 {
    match state {
        DayState::Finished => 0,
        DayState::Cut => 1,
        DayState::Reopened => 2,
        DayState::Pending => 3,
    }
}

fn state_of(number: i64) -> Option<DayState> {
    [DayState::Finished, DayState::Cut, DayState::Reopened, DayState::Pending]
        .into_iter()
        .find(|state| number_of(*state) == number)
}

fn name_of(file: AverageFile) -> String {
    let date = file.date();
    match file.step {
        Step::Minute => format!("minutes-{date}.db"),
        Step::Hour => format!("hours-{}.db", date.strftime("%Y-%m")),
    }
}

fn file_of(name: &str) -> Option<AverageFile> {
    let stem = name.strip_suffix(".db")?;
    let (step, date) = match stem.strip_prefix("minutes-") {
        Some(date) => (Step::Minute, date.to_owned()),
        None => (Step::Hour, format!("{}-01", stem.strip_prefix("hours-")?)),
    };
    let file = AverageFile { step, first: day_of(date.parse().ok()?) };
    // Only the way in which we write a name is one.
    (name_of(file) == name).then_some(file)
}

/// Whether this is the name of a file of averages.
pub(super) fn is_average_file_name(name: &str) -> bool {
    file_of(name).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_tell_their_days() {
        let minutes = AverageFile::of(Step::Minute, 20_782);
        let hours = AverageFile::of(Step::Hour, 20_782);
        assert_eq!(name_of(minutes), "minutes-2026-11-25.db");
        assert_eq!(name_of(hours), "hours-2026-11.db");
        for file in [minutes, hours, AverageFile::of(Step::Minute, 0), AverageFile::of(Step::Hour, 24_855)] {
            assert_eq!(file_of(&name_of(file)), Some(file));
        }
        for other in [
            "minutes-2026-11.db",
            "hours-2026-11-25.db",
            "2026-11-25.db",
            "hours-2026-13.db",
            "minutes-2026-11-25.db-wal",
        ] {
            assert_eq!(file_of(other), None, "{other}");
        }
    }
}
