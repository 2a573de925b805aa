//! The file of the store: where it is, how it is opened, read beside a running gateway, copied and closed.

use std::path::{Path, PathBuf, absolute};
use std::time::Duration;

use rusqlite::{Connection, OpenFlags};

use super::Sqlite;
use super::settle::{Unsettled, log_of};
use super::tables::TABLES;
use crate::files;
use crate::store::StoreError;

/// The name of the file in the folder.
pub const FILE: &str = "control.db";

/// The folder of the history, beside the store.
pub const HISTORY: &str = "history";

/// The folder, beside the store, in which a restore makes it, until a stop holds for each robot.
pub const HALF_RESTORED: &str = "restored";

/// How long a write waits for another process, such as `r6 gateway token`: its transactions take
/// milliseconds.
const BUSY: Duration = Duration::from_secs(5);

impl Sqlite {
    /// Opens the store of a folder, and makes both if there are none. Only their owner may read them.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`]; also if the store of the folder is missing: no new one is made in its
    /// place, because it would not know of the stops that hold.
    pub fn open(folder: &Path) -> Result<Self, StoreError> {
        let failed =
            |error: std::io::Error| StoreError::Unavailable(format!("{}: {error}", folder.display()));
        files::make_folder(folder).map_err(failed)?;
        let path = folder.join(FILE);
        let is_left = |name: &&&str| folder.join(**name).is_dir();
        if !path.try_exists().map_err(failed)?
            && let Some(left) = [HALF_RESTORED, HISTORY].iter().find(is_left)
        {
            return Err(StoreError::Unavailable(format!(
                "{} has `{left}` and no `{FILE}`: a `restore` was broken off there, or the file was removed. A gateway \
                 that began anew would not know which robots are stopped. Remove the folder and restore it again, or \
                 use another folder",
                folder.display()
            )));
        }
        files::make_file(&path).map_err(failed)?;
        Self::at(&path)
    }

    /// Opens the store of a folder that has one.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`] without a file.
    pub fn open_existing(folder: &Path) -> Result<Self, StoreError> {
        Self::at(&existing(folder)?)
    }

    /// Opens the store of a folder to read it, and changes nothing in it: no tables of this version are made.
    /// A file that `is_still` is written by no other process: with it, nothing is made beside it either, and
    /// the folder can be on a medium that cannot be written.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`] without a file, or if it is of a newer r6.
    pub fn open_to_read(folder: &Path, is_still: bool) -> Result<Self, StoreError> {
        let path = existing(folder)?;
        let flags =
            OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX | OpenFlags::SQLITE_OPEN_URI;
        let connection = Connection::open_with_flags(uri(&path, is_still)?, flags)?;
        connection.busy_timeout(BUSY)?;
        let store = Self { connection, unsettled: Unsettled::default() };
        if store.version()? > TABLES.len() {
            return Err(newer(&path, store.version()?));
        }
        Ok(store)
    }

    /// How many of the versions of tables the file has.
    pub(super) fn version(&self) -> Result<usize, StoreError> {
        Ok(self.connection.query_row("PRAGMA user_version", [], |row| row.get(0))?)
    }

    fn at(path: &Path) -> Result<Self, StoreError> {
        let connection = Connection::open(path)?;
        connection.busy_timeout(BUSY)?;
        connection.pragma_update(None, "journal_mode", "WAL")?;
        connection.pragma_update(None, "synchronous", "FULL")?;
        Self { connection, unsettled: Unsettled::of(path) }.with_tables(path)
    }

    /// A store that is in memory alone.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`].
    #[cfg(feature = "simulation")]
    pub fn in_memory() -> Result<Self, StoreError> {
        let connection = Connection::open_in_memory()?;
        Self { connection, unsettled: Unsettled::default() }.with_tables(Path::new(":memory:"))
    }

    /// Whether the file takes no more pages, as on a full disk.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`].
    #[cfg(feature = "simulation")]
    pub fn set_full(&mut self, is_full: bool) -> Result<(), StoreError> {
        let pages: i64 = if is_full {
            self.connection.query_row("PRAGMA page_count", [], |row| row.get(0))?
        } else {
            // The default of SQLite.
            0xffff_fffe
        };
        self.connection.query_row(&format!("PRAGMA max_page_count = {pages}"), [], |_| Ok(()))?;
        Ok(())
    }

    /// Makes the tables that are missing.
    fn with_tables(self, path: &Path) -> Result<Self, StoreError> {
        let mut store = self;
        let transaction = store.write()?;
        let version: usize = transaction.query_row("PRAGMA user_version", [], |row| row.get(0))?;
        let Some(missing) = TABLES.get(version..) else {
            return Err(newer(path, version));
        };
        for tables in missing {
            transaction.execute_batch(tables)?;
        }
        if !missing.is_empty() {
            transaction.pragma_update(None, "user_version", TABLES.len())?;
        }
        transaction.commit()?;
        Ok(store)
    }

    /// Closes the file, with nothing beside it.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn close(self) -> Result<(), StoreError> {
        self.connection.pragma_update(None, "journal_mode", "DELETE")?;
        self.connection.close().map_err(|(_, error)| error.into())
    }
}

/// The file of a folder.
fn existing(folder: &Path) -> Result<PathBuf, StoreError> {
    let path = folder.join(FILE);
    if path.is_file() {
        return Ok(path);
    }
    Err(StoreError::Unavailable(format!("there is no {}", path.display())))
}

fn newer(path: &Path, version: usize) -> StoreError {
    StoreError::Unavailable(format!("{} is of a newer r6 (tables {version})", path.display()))
}

/// A path as SQLite reads it with options.
fn uri(path: &Path, is_still: bool) -> Result<String, StoreError> {
    let failed = |why: String| StoreError::Unavailable(format!("{}: {why}", path.display()));
    let whole = absolute(path).map_err(|error| failed(error.to_string()))?;
    let text = whole.to_str().ok_or_else(|| failed("its name is not in UTF-8".to_owned()))?;
    let escaped = text.replace('\\', "/").replace('%', "%25").replace('?', "%3f").replace('#', "%23");
    let options = if is_still { "?immutable=1" } else { "" };
    Ok(format!("file:///{}{options}", escaped.trim_start_matches('/')))
}

/// Copies a file of SQLite that others may write meanwhile. `to` is an empty file, or is not there.
///
/// # Errors
/// [`StoreError::Unreadable`] if `from` is not such a file or is broken.
pub fn copy(from: &Path, to: &Path) -> Result<(), StoreError> {
    let failed = |error: std::io::Error| StoreError::Unavailable(format!("{}: {error}", to.display()));
    let to_text = to.to_str().ok_or_else(|| failed(std::io::Error::other("its name is not in UTF-8")))?;
    files::make_file(to).map_err(failed)?;
    // What is in the copy must not be lost by a power cut where it came from.
    if let Ok(log) = std::fs::File::open(log_of(from)) {
        log.sync_data().map_err(|error| StoreError::Unavailable(format!("{}: {error}", from.display())))?;
    }
    // Not read-only: after a crash, the first one to open the file has to recover its log.
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(from, flags)?;
    connection.busy_timeout(BUSY)?;
    connection.execute("VACUUM INTO ?1", [to_text])?;
    // SQLite does not synchronise what it makes like this.
    std::fs::File::open(to).and_then(|file| file.sync_all()).map_err(failed)
}
