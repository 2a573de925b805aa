//! The history in a folder: SQLite with a write-ahead log, a file or more for each day.
//!
//! `2026-11-25.db` is the first part of a day, `2026-11-25-2.db` the second. A process that writes has one
//! [`Days`], readers have others.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use rusqlite::{Connection, OpenFlags};

use super::table::{self, TABLES, VERSION};
use super::{Ask, AskEvents, Entry, HistoryStore, KeptEvent, Part, Tail};
use crate::core::history::block::Write;
use crate::core::history::sample::Micros;
use crate::core::name::RobotName;
use crate::files::{free_bytes, make_file, make_folder};
use crate::store::StoreError;

/// The files that are open at once: today, and a day to which something comes late.
const MAX_OPEN: usize = 2;

/// How long a write waits for a reader that recovers or ends a file: milliseconds.
const BUSY: Duration = Duration::from_millis(500);

/// The size of a page in bytes.
const PAGE: u64 = 16 * 1024;

/// The smallest and the largest number of pages after which the write-ahead log is written back.
const CHECKPOINT_PAGES: (u64, u64) = (8, 256);

/// The ends of the names of files that SQLite puts beside one of ours.
const BESIDE: [&str; 3] = ["-wal", "-shm", "-journal"];

/// The history in a folder.
#[derive(Debug)]
pub struct Days {
    folder: PathBuf,
    /// `false` for readers.
    writes: bool,
    checkpoint_pages: u64,
    open: BTreeMap<Part, Connection>,
    /// The parts that writes go to, by day, if they are not the newest that is there.
    begun: BTreeMap<i64, u32>,
    /// The most pages of a file, as if the disk were full then.
    #[cfg(test)]
    pub max_pages: Option<u32>,
}

impl Days {
    /// The history of a folder to write. `max_bytes` is what all files may take together. It opens nothing
    /// yet: a disk that fails at the start may work later.
    #[must_use]
    pub fn to_write(folder: &Path, max_bytes: u64) -> Self {
        let (least, most) = CHECKPOINT_PAGES;
        let checkpoint_pages = (max_bytes / 64 / PAGE).clamp(least, most);
        let (folder, open, begun) = (folder.to_owned(), BTreeMap::new(), BTreeMap::new());
        Self {
            folder,
            writes: true,
            checkpoint_pages,
            open,
            begun,
            #[cfg(test)]
            max_pages: None,
        }
    }

    /// The history of a folder for a reader, which never writes.
    #[must_use]
    pub fn to_read(folder: &Path) -> Self {
        let (folder, open, begun) = (folder.to_owned(), BTreeMap::new(), BTreeMap::new());
        Self {
            folder,
            writes: false,
            checkpoint_pages: 0,
            open,
            begun,
            #[cfg(test)]
            max_pages: None,
        }
    }

    fn path(&self, part: Part) -> PathBuf {
        self.folder.join(file_name(part))
    }

    fn newest(&self, day: i64) -> Result<u32, StoreError> {
        if let Some(begun) = self.begun.get(&day) {
            return Ok(*begun);
        }
        let parts = names(&self.folder)?.into_iter().filter(|(part, _)| part.day == day);
        // What has the name of a part and is no file is left alone.
        let next = |(part, is_file): (Part, bool)| if is_file { part.number } else { part.number + 1 };
        Ok(parts.map(next).max().unwrap_or(1))
    }

    /// The connection to a part. Others are closed if there are too many.
    fn connection(&mut self, part: Part) -> Result<&mut Connection, StoreError> {
        if !self.open.contains_key(&part) {
            while self.open.len() >= MAX_OPEN {
                let Some((_, oldest)) = self.open.pop_first() else { break };
                // The file needs no write-ahead log any more. A reader may be in the way; then it stays.
                if self.writes {
                    let _ = oldest.pragma_update(None, "journal_mode", "DELETE");
                }
            }
            let connection = if self.writes { self.make(part)? } else { self.look(part)? };
            self.open.insert(part, connection);
        }
        self.open.get_mut(&part).ok_or(StoreError::Closed)
    }

    fn make(&self, part: Part) -> Result<Connection, StoreError> {
        let path = self.path(part);
        if !path.exists() {
            // Left by a process that ended while it removed a file of this name. They must not be taken for
            // those of the new one.
            BESIDE.iter().for_each(|end| drop(fs::remove_file(self.folder.join(file_name(part) + end))));
        }
        make_folder(&self.folder).map_err(|error| failed(&self.folder, &error))?;
        make_file(&path).map_err(|error| failed(&path, &error))?;
        let mut connection = Connection::open(&path)?;
        connection.busy_timeout(BUSY)?;
        // Only while the file is empty. A chunk of 2 KB would leave half of a page of 4 KB empty.
        connection.pragma_update(None, "page_size", PAGE)?;
        connection.pragma_update(None, "journal_mode", "WAL")?;
        // The log is not synchronised at each commit. What the system has taken survives the process.
        connection.pragma_update(None, "synchronous", "NORMAL")?;
        connection.pragma_update(None, "wal_autocheckpoint", self.checkpoint_pages)?;
        connection.pragma_update(None, "journal_size_limit", self.checkpoint_pages * PAGE)?;
        let transaction = connection.transaction()?;
        match transaction.query_row("PRAGMA user_version", [], |row| row.get::<_, i64>(0))? {
            0 => {
                transaction.execute_batch(TABLES)?;
                transaction.pragma_update(None, "user_version", VERSION)?;
            }
            VERSION => {}
            newer => return Err(too_new(&path, newer)),
        }
        transaction.commit()?;
        Ok(connection)
    }

    fn look(&self, part: Part) -> Result<Connection, StoreError> {
        let path = self.path(part);
        // Not read-only: after a crash, the first one to open the file has to recover its log.
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let connection = Connection::open_with_flags(&path, flags)?;
        connection.busy_timeout(BUSY)?;
        connection.pragma_update(None, "query_only", true)?;
        match connection.query_row("PRAGMA user_version", [], |row| row.get::<_, i64>(0))? {
            VERSION => Ok(connection),
            version => Err(too_new(&path, version)),
        }
    }
}

impl HistoryStore for Days {
    fn write(&mut self, day: i64, writes: &[(RobotName, Write)]) -> Result<(), StoreError> {
        let number = self.newest(day)?;
        // From now on this day is not looked for in the folder again.
        self.begun.retain(|begun, _| *begun >= day - 1);
        self.begun.insert(day, number);
        self.write_part(Part { day, number }, writes)
    }

    fn write_part(&mut self, part: Part, writes: &[(RobotName, Write)]) -> Result<(), StoreError> {
        #[cfg(test)]
        if let Some(most) = self.max_pages {
            self.connection(part)?.pragma_update(None, "max_page_count", most)?;
        }
        let written = table::write(self.connection(part)?, writes);
        if written.is_err() {
            // What a failed connection thinks of its file may be wrong.
            self.open.remove(&part);
        }
        written
    }

    fn begin_part(&mut self, day: i64) -> Result<(), StoreError> {
        let number = self.newest(day)? + 1;
        self.begun.insert(day, number);
        Ok(())
    }

    fn tails(&mut self, part: Part) -> Result<Vec<Tail>, StoreError> {
        table::tails(self.connection(part)?, part)
    }

    fn entries(&mut self, part: Part, ask: Ask<'_>, most: usize) -> Result<Vec<Entry>, StoreError> {
        table::entries(self.connection(part)?, part, ask, most)
    }

    fn last_entry(&mut self, part: Part, ask: Ask<'_>) -> Result<Option<Entry>, StoreError> {
        table::last_entry(self.connection(part)?, part, ask)
    }

    fn bytes(&mut self, part: Part, rows: &[i64]) -> Result<Vec<Option<Vec<u8>>>, StoreError> {
        table::bytes(self.connection(part)?, rows)
    }

    fn events(&mut self, part: Part, ask: AskEvents<'_>, most: usize) -> Result<Vec<KeptEvent>, StoreError> {
        table::events(self.connection(part)?, part, ask, most)
    }

    fn last_seen(&mut self, part: Part) -> Result<Vec<(RobotName, Micros)>, StoreError> {
        table::last_seen(self.connection(part)?)
    }

    fn parts(&mut self) -> Result<Vec<(Part, u64)>, StoreError> {
        if self.writes {
            make_folder(&self.folder).map_err(|error| failed(&self.folder, &error))?;
        }
        let size = |path: &Path| fs::metadata(path).map_or(0, |file| file.len());
        let parts = names(&self.folder)?.into_iter().filter(|(_, is_file)| *is_file).map(|(part, _)| {
            let beside = BESIDE.iter().map(|end| size(&self.folder.join(file_name(part) + end)));
            (part, size(&self.path(part)) + beside.sum::<u64>())
        });
        Ok(parts.collect())
    }

    fn free_bytes(&mut self) -> Option<u64> {
        free_bytes(&self.folder)
    }

    fn remove(&mut self, part: Part) -> Result<(), StoreError> {
        self.open.remove(&part);
        let path = self.path(part);
        // The file first: its log alone is nothing, and a file without its log could be wrong.
        for path in
            [path.clone()].into_iter().chain(BESIDE.map(|end| self.folder.join(file_name(part) + end)))
        {
            match fs::remove_file(&path) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                    return Err(failed(&path, &error));
                }
                Ok(()) | Err(_) => {}
            }
        }
        Ok(())
    }
}

fn failed(path: &Path, error: &std::io::Error) -> StoreError {
    StoreError::Unavailable(format!("{}: {error}", path.display()))
}

fn too_new(path: &Path, version: i64) -> StoreError {
    StoreError::Unreadable(format!("{} has tables {version}, which this r6 does not know", path.display()))
}

/// The parts of which there are names, oldest first, and whether each is a file. Opening something else, such
/// as a pipe, could wait for ever.
fn names(folder: &Path) -> Result<Vec<(Part, bool)>, StoreError> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(|error| failed(folder, &error))?,
    };
    let names = entries.filter_map(|entry| {
        let entry = entry.ok()?;
        Some((part_of(entry.file_name().to_str()?)?, entry.file_type().is_ok_and(|kind| kind.is_file())))
    });
    let mut parts: Vec<_> = names.collect();
    parts.sort_unstable();
    Ok(parts)
}

/// The names of the files of a folder, oldest first. There are none without the folder.
///
/// # Errors
/// [`StoreError`].
pub fn file_names(folder: &Path) -> Result<Vec<String>, StoreError> {
    let files = names(folder)?.into_iter().filter(|(_, is_file)| *is_file);
    Ok(files.map(|(part, _)| file_name(part)).collect())
}

/// Whether this is the name of a file of the history.
pub fn is_file_name(name: &str) -> bool {
    part_of(name).is_some()
}

fn file_name(part: Part) -> String {
    let seconds = u64::try_from(part.day).unwrap_or(0).saturating_mul(86_400);
    let time = UNIX_EPOCH.checked_add(Duration::from_secs(seconds)).unwrap_or(SystemTime::UNIX_EPOCH);
    let time = humantime::format_rfc3339_seconds(time).to_string();
    let date = time.split('T').next().unwrap_or_default();
    if part.number == 1 { format!("{date}.db") } else { format!("{date}-{}.db", part.number) }
}

fn part_of(name: &str) -> Option<Part> {
    let stem = name.strip_suffix(".db")?;
    let (date, number) = stem.split_at_checked(10)?;
    let number = match number.strip_prefix('-') {
        None if number.is_empty() => 1,
        None => return None,
        Some(number) => number.parse().ok().filter(|number| *number > 1)?,
    };
    let time = humantime::parse_rfc3339(&format!("{date}T00:00:00Z")).ok()?;
    let seconds = time.duration_since(UNIX_EPOCH).ok()?.as_secs();
    Some(Part { day: i64::try_from(seconds / 86_400).ok()?, number })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_tell_their_part() {
        let part = |day, number| Part { day, number };
        assert_eq!(file_name(part(20_782, 1)), "2026-11-25.db");
        assert_eq!(file_name(part(20_782, 12)), "2026-11-25-12.db");
        for part in [part(0, 1), part(20_782, 12), part(11_016, 1), part(24_855, 2)] {
            assert_eq!(part_of(&file_name(part)), Some(part));
        }
        for other in ["2026-11-25.db-wal", "control.db", "2026-13-25.db", "2026-11-25-1.db", "2026-11-25x.db"]
        {
            assert_eq!(part_of(other), None, "{other}");
        }
    }
}
