//! The history in a folder: SQLite with a write-ahead log, a file or more for each day.
//!
//! `2026-11-25.db` is the first part of a day, `2026-11-25-2.db` the second. Averages have files of their own
//! beside them (`average_files.rs`). A process that writes has one [`Days`], readers have others.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use r6_proto::Address;
use rusqlite::Connection;

use super::average_files::{AverageFiles, is_average_file_name};
use super::averages::AverageStore;
use super::file::{self, Form, failed};
use super::table::{self, SIGNALS, TABLES, VERSION};
use super::{Ask, AskEvents, Entry, HistoryStore, KeptEvent, Part, Tail};
use crate::core::history::block::Write;
use crate::core::history::sample::Micros;
use crate::core::name::RobotName;
use crate::files::{free_bytes, make_folder};
use crate::store::StoreError;

/// The files that are open at once: today, and a day to which something comes late.
const MAX_OPEN: usize = 2;

/// The files that are open at once to compute averages: all parts of a day, and those of the day before, of
/// which the end is read. A day has few parts in general; if there are more files than that, they are opened
/// again and again.
const MAX_OPEN_TO_AVERAGE: usize = 10;

/// The size of a page in bytes. A chunk of 2 KB would leave half of a page of 4 KB empty.
const PAGE: u64 = 16 * 1024;

/// What the files of days are made with.
const FORM: Form = Form { tables: [SIGNALS, TABLES], version: VERSION, page: PAGE };

/// The smallest and the largest number of pages after which the write-ahead log is written back.
const CHECKPOINT_PAGES: (u64, u64) = (8, 256);

/// The history in a folder.
#[derive(Debug)]
pub struct Days {
    folder: PathBuf,
    /// `false` for readers.
    writes: bool,
    checkpoint_pages: u64,
    most_open: usize,
    open: BTreeMap<Part, Connection>,
    /// The parts that writes go to, by day, if they are not the newest that is there.
    begun: BTreeMap<i64, u32>,
    averages: AverageFiles,
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
        Self {
            folder: folder.to_owned(),
            writes: true,
            checkpoint_pages,
            most_open: MAX_OPEN,
            open: BTreeMap::new(),
            begun: BTreeMap::new(),
            averages: AverageFiles::new(folder, true),
            #[cfg(test)]
            max_pages: None,
        }
    }

    /// The history of a folder for a reader, which never writes.
    #[must_use]
    pub fn to_read(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            writes: false,
            checkpoint_pages: 0,
            most_open: MAX_OPEN,
            open: BTreeMap::new(),
            begun: BTreeMap::new(),
            averages: AverageFiles::new(folder, false),
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
            while self.open.len() >= self.most_open {
                let Some((_, oldest)) = self.open.pop_first() else { break };
                // The file needs no write-ahead log any more. A reader may be in the way; then it stays.
                if self.writes {
                    let _ = oldest.pragma_update(None, "journal_mode", "DELETE");
                }
            }
            let path = self.path(part);
            let connection = if self.writes {
                file::make(&path, FORM, self.checkpoint_pages)?
            } else {
                file::look(&path, FORM)?
            };
            self.open.insert(part, connection);
        }
        self.open.get_mut(&part).ok_or(StoreError::Closed)
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
        let parts = names(&self.folder)?.into_iter().filter(|(_, is_file)| *is_file);
        let parts = parts.map(|(part, _)| (part, file::size(&self.path(part))));
        Ok(parts.collect())
    }

    fn free_bytes(&mut self) -> Option<u64> {
        free_bytes(&self.folder)
    }

    fn remove(&mut self, part: Part) -> Result<(), StoreError> {
        self.open.remove(&part);
        file::remove(&self.path(part))
    }

    fn signals(&mut self, part: Part) -> Result<Vec<(RobotName, Address)>, StoreError> {
        table::signals(self.connection(part)?)
    }

    fn averages(&mut self) -> Option<&mut dyn AverageStore> {
        Some(&mut self.averages)
    }

    fn to_average(&self) -> Option<Box<dyn HistoryStore>> {
        let reader = Self { most_open: MAX_OPEN_TO_AVERAGE, ..Self::to_read(&self.folder) };
        Some(Box::new(reader))
    }
}

/// The parts by the names in a folder, oldest first, and whether each is a file.
fn names(folder: &Path) -> Result<Vec<(Part, bool)>, StoreError> {
    let names = file::names(folder)?.into_iter();
    let mut parts: Vec<_> = names.filter_map(|(name, is_file)| Some((part_of(&name)?, is_file))).collect();
    parts.sort_unstable();
    Ok(parts)
}

/// The names of the files of a folder: those of days, oldest first, and then those of averages. There are
/// none without the folder.
///
/// # Errors
/// [`StoreError`].
pub fn file_names(folder: &Path) -> Result<Vec<String>, StoreError> {
    let files = names(folder)?.into_iter().filter(|(_, is_file)| *is_file);
    let days = files.map(|(part, _)| file_name(part));
    let averages =
        file::names(folder)?.into_iter().filter(|(name, is_file)| *is_file && is_average_file_name(name));
    let mut averages: Vec<_> = averages.map(|(name, _)| name).collect();
    averages.sort_unstable();
    Ok(days.chain(averages).collect())
}

/// Whether this is the name of a file of the history.
pub fn is_file_name(name: &str) -> bool {
    part_of(name).is_some() || is_average_file_name(name)
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
