//! A file of the history: how it is opened, what lies beside it, and how it is removed.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::{Connection, OpenFlags};

use crate::files::{make_file, make_folder};
use crate::store::StoreError;

/// How long a write waits for a reader that recovers or ends a file: milliseconds.
const BUSY: Duration = Duration::from_millis(500);

/// The ends of the names of files that SQLite puts beside one of ours.
const BESIDE: [&str; 3] = ["-wal", "-shm", "-journal"];

/// What a file is made with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Form {
    /// The tables of a new file.
    pub tables: [&'static str; 2],
    /// Their version, in `PRAGMA user_version`.
    pub version: i64,
    /// The size of a page in bytes.
    pub page: u64,
}

/// Refuses pipes, links and folders with the name of a file: to open a pipe could wait for ever, and what
/// lies behind a link is not in the folder.
fn check_kind(path: &Path) -> Result<(), StoreError> {
    let is_other = fs::symlink_metadata(path).is_ok_and(|about| !about.is_file());
    if is_other { Err(StoreError::Unreadable(format!("{} is no file", path.display()))) } else { Ok(()) }
}

/// Opens a file to write, and makes it if it is not there. The write-ahead log is written back when it has
/// `checkpoint_pages`.
pub(super) fn make(path: &Path, form: Form, checkpoint_pages: u64) -> Result<Connection, StoreError> {
    check_kind(path)?;
    if !path.exists() {
        // Left by a process that ended while it removed a file of this name. They must not be taken for
        // those of the new one.
        BESIDE.iter().for_each(|end| drop(fs::remove_file(beside(path, end))));
    }
    let folder = path.parent().unwrap_or(path);
    make_folder(folder).map_err(|error| failed(folder, &error))?;
    make_file(path).map_err(|error| failed(path, &error))?;
    let mut connection = Connection::open(path)?;
    connection.busy_timeout(BUSY)?;
    // Only while the file is empty.
    connection.pragma_update(None, "page_size", form.page)?;
    connection.pragma_update(None, "journal_mode", "WAL")?;
    // The log is not synchronised at each commit. What the system has taken survives the process.
    connection.pragma_update(None, "synchronous", "NORMAL")?;
    connection.pragma_update(None, "wal_autocheckpoint", checkpoint_pages)?;
    connection.pragma_update(None, "journal_size_limit", checkpoint_pages.saturating_mul(form.page))?;
    let transaction = connection.transaction()?;
    match transaction.query_row("PRAGMA user_version", [], |row| row.get::<_, i64>(0))? {
        0 => {
            form.tables.iter().try_for_each(|tables| transaction.execute_batch(tables))?;
            transaction.pragma_update(None, "user_version", form.version)?;
        }
        version if version == form.version => {}
        newer => return Err(too_new(path, newer)),
    }
    transaction.commit()?;
    Ok(connection)
}

/// Opens a file that is there for a reader, which never writes.
pub(super) fn look(path: &Path, form: Form) -> Result<Connection, StoreError> {
    check_kind(path)?;
    // Not read-only: after a crash, the first one to open the file has to recover its log.
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(path, flags)?;
    connection.busy_timeout(BUSY)?;
    connection.pragma_update(None, "query_only", true)?;
    match connection.query_row("PRAGMA user_version", [], |row| row.get::<_, i64>(0))? {
        version if version == form.version => Ok(connection),
        version => Err(too_new(path, version)),
    }
}

/// What a file takes on the disk with what lies beside it, in bytes.
pub(super) fn size(path: &Path) -> u64 {
    let of = |path: &Path| fs::metadata(path).map_or(0, |file| file.len());
    of(path) + BESIDE.iter().map(|end| of(&beside(path, end))).sum::<u64>()
}

/// Removes a file with what lies beside it.
pub(super) fn remove(path: &Path) -> Result<(), StoreError> {
    // The file first: its log alone is nothing, and a file without its log could be wrong.
    for path in [path.to_owned()].into_iter().chain(BESIDE.map(|end| beside(path, end))) {
        match fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(failed(&path, &error)),
            Ok(()) | Err(_) => {}
        }
    }
    Ok(())
}

/// The names in a folder, and whether each is of a file. Opening something else, such as a pipe, could wait
/// for ever. There are none without the folder.
pub(super) fn names(folder: &Path) -> Result<Vec<(String, bool)>, StoreError> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(|error| failed(folder, &error))?,
    };
    let names = entries.filter_map(|entry| {
        let entry = entry.ok()?;
        Some((entry.file_name().into_string().ok()?, entry.file_type().is_ok_and(|kind| kind.is_file())))
    });
    Ok(names.collect())
}

pub(super) fn failed(path: &Path, error: &std::io::Error) -> StoreError {
    StoreError::Unavailable(format!("{}: {error}", path.display()))
}

fn beside(path: &Path, end: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(end);
    PathBuf::from(name)
}

fn too_new(path: &Path, version: i64) -> StoreError {
    StoreError::Unreadable(format!("{} has tables {version}, which this r6 does not know", path.display()))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_file_is_not_opened() {
        let folder = tempfile::tempdir().unwrap();
        let form = Form { tables: [""; 2], version: 1, page: 4096 };
        let (real, link, other) =
            (folder.path().join("a.db"), folder.path().join("b.db"), folder.path().join("c.db"));
        drop(make(&real, form, 100).unwrap());
        assert!(look(&real, form).is_ok());
        std::os::unix::fs::symlink(&real, &link).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(&other).unwrap();
        for path in [&link, &other, &folder.path().to_owned()] {
            assert!(matches!(make(path, form, 100), Err(StoreError::Unreadable(_))), "{}", path.display());
            assert!(matches!(look(path, form), Err(StoreError::Unreadable(_))), "{}", path.display());
        }
    }
}
