//! Backups of the folder of a gateway, and a folder made of one.
//!
//! A backup is a folder: a copy of `control.db`, of the files of the history and of a certificate that the
//! gateway made, and `backup.json`, which lists them with their checksums. The key that signs the heads of
//! the audit log is not in it: two gateways with one key could sign heads that contradict each other. Each
//! database is copied within one reading transaction, so the gateway may go on meanwhile. `control.db` is
//! copied last, so that the audit log of a backup knows everything that made the rest.

use std::collections::BTreeSet;
use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use r6_api::gateway::Deed;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::certificate;
use crate::clock;
use crate::files;
use crate::store::history::{file_names, is_file_name};
use crate::store::{self, Author, HALF_RESTORED, HISTORY, Sqlite, StoreError};
use crate::verify::{VerifyError, verify};

/// What lists the files of a backup.
pub const LIST: &str = "backup.json";

/// The version of the list.
const FORMAT: u32 = 1;

/// What an unfinished backup has, locked while it is made: a later one of the same name takes its place.
const UNFINISHED: &str = "unfinished";

/// The longest list: 10 years of history with a few files for each day.
const MAX_LIST_BYTES: u64 = 4 * 1024 * 1024;

/// A backup that was made or read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Backup {
    /// When it was made: RFC 3339, UTC.
    pub made: String,
    /// How many files are in it.
    pub files: usize,
    /// How many bytes these have.
    pub bytes: u64,
    /// How many entries its audit log has.
    pub entries: u64,
    /// What could not be copied, or is wrong in it: for people.
    pub problems: Vec<String>,
}

/// Why there is no backup, or nothing was made of it.
#[derive(Debug)]
pub enum BackupError {
    /// The folder has something in it already.
    NotEmpty(PathBuf),
    /// It is not the folder of a backup that this version can read.
    NoBackup(PathBuf, String),
    /// A file is not what it was when the backup was made.
    Changed(PathBuf),
    /// A file cannot be read or written.
    File(PathBuf, io::Error),
    /// The store cannot be read or written.
    Store(StoreError),
}

impl fmt::Display for BackupError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotEmpty(path) => {
                write!(f, "{} is there already and not empty: choose another folder", path.display())
            }
            Self::NoBackup(path, why) => write!(f, "{} is no backup that can be read: {why}", path.display()),
            Self::Changed(path) => {
                write!(f, "{} has changed since the backup was made: use another backup", path.display())
            }
            Self::File(path, error) => write!(f, "{}: {error}", path.display()),
            Self::Store(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for BackupError {}

impl From<StoreError> for BackupError {
    fn from(error: StoreError) -> Self {
        Self::Store(error)
    }
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    format: u32,
    made: String,
    entries: u64,
    files: Vec<Listed>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Listed {
    /// Relative to the folder, with `/`.
    name: String,
    bytes: u64,
    sha256: String,
}

/// Copies the folder of a gateway, which may run, into a new folder. `progress` gets the name of each file
/// before it is copied.
///
/// # Errors
/// [`BackupError`]. What was copied by then stays in a folder beside it, whose name ends with `.part`. The
/// next backup with this name removes it.
pub fn backup(
    data: &Path,
    to: &Path,
    with_history: bool,
    mut progress: impl FnMut(&str),
) -> Result<Backup, BackupError> {
    // It has to be one, before anything is made.
    drop(Sqlite::open_to_read(data, false)?);
    if to.exists() {
        return Err(BackupError::NotEmpty(to.to_owned()));
    }
    let mut name = to.file_name().unwrap_or_default().to_owned();
    name.push(".part");
    let part = to.with_file_name(name);
    let unfinished = begin(&part)?;
    let (mut listed, mut problems) = (Vec::new(), Vec::new());
    for name in certificate::FILES {
        let name = format!("{}/{name}", certificate::FOLDER);
        if data.join(&name).exists() {
            progress(&name);
            copy(&data.join(&name), &part.join(&name))?;
            listed.push(name);
        }
    }
    let history = if with_history { file_names(&data.join(HISTORY))? } else { Vec::new() };
    for name in history {
        let name = format!("{HISTORY}/{name}");
        let (from, copied) = (data.join(&name), part.join(&name));
        progress(&name);
        parent(&copied)?;
        match store::copy(&from, &copied) {
            Ok(()) => listed.push(name),
            // Its days are over.
            Err(_) if !from.exists() => remove(&copied)?,
            Err(StoreError::Unreadable(why)) => {
                remove(&copied)?;
                problems.push(format!("{name} is not in the backup, it cannot be read: {why}"));
            }
            Err(error) => return Err(error.into()),
        }
    }
    progress(store::FILE);
    store::copy(&data.join(store::FILE), &part.join(store::FILE))?;
    listed.push(store::FILE.to_owned());
    let entries = entries(&part, &mut problems)?;

    let listed = listed.into_iter().map(|name| list(&part, name)).collect::<Result<Vec<_>, _>>()?;
    let list = List { format: FORMAT, made: clock::time_of_day(), entries, files: listed };
    let path = part.join(LIST);
    let text = serde_json::to_vec_pretty(&list)
        .map_err(|error| BackupError::File(path.clone(), io::Error::other(error)))?;
    files::write(&path, &text).map_err(|error| BackupError::File(path, error))?;
    drop(unfinished);
    remove(&part.join(UNFINISHED))?;
    std::fs::rename(&part, to).map_err(|error| BackupError::File(to.to_owned(), error))?;
    Ok(told(list, problems))
}

/// Makes the folder of a gateway of a backup. A stop holds for each robot then, also for those that the
/// backup does not name: what happened to them since is not known. Numbers of leases go on a million higher.
///
/// # Errors
/// [`BackupError`]. `control.db` is made last: without it, the folder is not that of a gateway.
pub fn restore(data: &Path, from: &Path, mut progress: impl FnMut(&str)) -> Result<Backup, BackupError> {
    let list = read_list(from)?;
    // Everything is looked at before anything is made.
    for file in &list.files {
        progress(&file.name);
        let path = from.join(&file.name);
        let found = self::list(from, file.name.clone())?;
        if (found.bytes, &found.sha256) != (file.bytes, &file.sha256) {
            return Err(BackupError::Changed(path));
        }
    }
    empty(data)?;
    // As long as this is there and no store, no gateway starts: it would not know of the stops.
    let half = data.join(HALF_RESTORED);
    parent(&half.join(store::FILE))?;
    for file in list.files.iter().filter(|file| file.name != store::FILE) {
        copy(&from.join(&file.name), &data.join(&file.name))?;
    }
    // Under another name, until a stop holds for every robot.
    copy(&from.join(store::FILE), &half.join(store::FILE))?;
    let mut problems = Vec::new();
    entries(&half, &mut problems)?;
    let deed = Deed::Restored { made: list.made.clone(), entries: list.entries };
    let record = Author::shell(clock::time_of_day()).record(deed);
    let mut store = Sqlite::open_existing(&half)?;
    store.stop_all(&record)?;
    store.close()?;
    let last = data.join(store::FILE);
    std::fs::rename(half.join(store::FILE), &last).map_err(|error| BackupError::File(last, error))?;
    std::fs::remove_dir(&half).map_err(|error| BackupError::File(half, error))?;
    Ok(told(list, problems))
}

fn told(list: List, problems: Vec<String>) -> Backup {
    let bytes = list.files.iter().map(|file| file.bytes).sum();
    Backup { made: list.made, files: list.files.len(), bytes, entries: list.entries, problems }
}

fn read_list(from: &Path) -> Result<List, BackupError> {
    let no = |why: String| BackupError::NoBackup(from.to_owned(), why);
    let text =
        files::read(&from.join(LIST), MAX_LIST_BYTES).map_err(|error| no(format!("{LIST}: {error}")))?;
    let list: List = serde_json::from_slice(&text).map_err(|error| no(format!("{LIST}: {error}")))?;
    if list.format != FORMAT {
        return Err(no(format!("it has format {}, and this version reads {FORMAT}", list.format)));
    }
    // A list from elsewhere must not make files outside of the folder, nor the log of a database, which would
    // be played over it. `told` adds up the sizes.
    let mut names = BTreeSet::new();
    let mut bytes = 0_u64;
    for file in &list.files {
        if !is_of_a_backup(&file.name) {
            return Err(no(format!("{LIST} names `{}`, which a backup does not have", file.name)));
        }
        if !names.insert(&file.name) {
            return Err(no(format!("{LIST} names `{}` twice", file.name)));
        }
        let sum = bytes.checked_add(file.bytes);
        bytes = sum.ok_or_else(|| no(format!("{LIST}: no disk has files of these sizes")))?;
    }
    if !list.files.iter().any(|file| file.name == store::FILE) {
        return Err(no(format!("{} is not in it", store::FILE)));
    }
    Ok(list)
}

/// Whether this is the name of a file that [`backup`] writes.
fn is_of_a_backup(name: &str) -> bool {
    match name.split_once('/') {
        None => name == store::FILE,
        Some((certificate::FOLDER, name)) => certificate::FILES.contains(&name),
        Some((HISTORY, name)) => is_file_name(name),
        Some(_) => false,
    }
}

/// How many entries the audit log of a folder has. A log that is not whole is a problem, but is kept.
fn entries(folder: &Path, problems: &mut Vec<String>) -> Result<u64, BackupError> {
    let problem = match verify(folder, &[], None) {
        Ok(verified) => return Ok(verified.entries),
        Err(VerifyError::Store(StoreError::Broken(broken))) => {
            format!("the audit log is NOT whole: {broken}")
        }
        Err(VerifyError::Store(error)) => return Err(error.into()),
        Err(error) => format!("the audit log is NOT whole: {error}"),
    };
    problems.push(problem);
    Ok(Sqlite::open_to_read(folder, false)?.count_entries()?)
}

/// Makes the folder of an unfinished backup, in place of the last unfinished one. The file is locked until it
/// is dropped.
fn begin(part: &Path) -> Result<File, BackupError> {
    let path = part.join(UNFINISHED);
    let failed = |error| BackupError::File(path.clone(), error);
    if path.is_file() {
        // Without the lock, another process makes this backup now.
        let left = File::open(&path).map_err(failed)?;
        left.try_lock().map_err(|_| BackupError::NotEmpty(part.to_owned()))?;
        std::fs::remove_dir_all(part).map_err(|error| BackupError::File(part.to_owned(), error))?;
    }
    empty(part)?;
    files::make_file(&path).map_err(failed)?;
    let file = File::open(&path).map_err(failed)?;
    file.try_lock().map_err(|_| BackupError::NotEmpty(part.to_owned()))?;
    Ok(file)
}

/// Makes a folder, unless it is there and empty.
fn empty(folder: &Path) -> Result<(), BackupError> {
    let failed = |error| BackupError::File(folder.to_owned(), error);
    let mut entries = match std::fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return files::make_folder(folder).map_err(failed);
        }
        entries => entries.map_err(failed)?,
    };
    if entries.next().is_some() { Err(BackupError::NotEmpty(folder.to_owned())) } else { Ok(()) }
}

fn parent(path: &Path) -> Result<(), BackupError> {
    let folder = path.parent().unwrap_or(path);
    files::make_folder(folder).map_err(|error| BackupError::File(folder.to_owned(), error))
}

fn copy(from: &Path, to: &Path) -> Result<(), BackupError> {
    parent(to)?;
    files::make_file(to).map_err(|error| BackupError::File(to.to_owned(), error))?;
    let mut read = File::open(from).map_err(|error| BackupError::File(from.to_owned(), error))?;
    let written = File::options().write(true).open(to).and_then(|mut file| {
        io::copy(&mut read, &mut file)?;
        file.sync_all()
    });
    written.map_err(|error| BackupError::File(to.to_owned(), error))
}

fn remove(path: &Path) -> Result<(), BackupError> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(BackupError::File(path.to_owned(), error))
        }
        Ok(()) | Err(_) => Ok(()),
    }
}

/// A file with its length and checksum.
fn list(folder: &Path, name: String) -> Result<Listed, BackupError> {
    let path = folder.join(&name);
    let failed = |error| BackupError::File(path.clone(), error);
    // To open a pipe could wait for ever.
    if !std::fs::metadata(&path).map_err(failed)?.is_file() {
        return Err(failed(io::Error::other("it is not a file")));
    }
    let mut file = File::open(&path).map_err(failed)?;
    let (mut hash, mut bytes, mut block) = (Sha256::new(), 0, vec![0; 64 * 1024]);
    loop {
        let read = file.read(&mut block).map_err(failed)?;
        let Some(read @ [_, ..]) = block.get(..read) else { break };
        hash.update(read);
        bytes += read.len() as u64;
    }
    let sha256 = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    Ok(Listed { name, bytes, sha256 })
}

#[cfg(test)]
mod tests {
    use r6_api::gateway::Role;

    use super::*;
    use crate::core::name::RobotName;
    use crate::core::seat::Saved;
    use crate::store::Store;

    /// A folder with a token, a robot and a file of the history, and its parent.
    fn folder() -> (tempfile::TempDir, PathBuf) {
        let parent = tempfile::tempdir().unwrap();
        let data = parent.path().join("data");
        crate::make_token(&data, Role::Admin, None, "mine".to_owned()).unwrap();
        let mut store = Sqlite::open(&data).unwrap();
        let press = RobotName::new("press").unwrap();
        let saved = Saved { number: 7, ..Saved::default() };
        store.save_seat(&press, &saved).unwrap();
        std::fs::create_dir_all(data.join("tls")).unwrap();
        std::fs::write(data.join("tls/key.pem"), "key").unwrap();
        let mut days = store::history::Days::to_write(&data.join(HISTORY), 1 << 30);
        store::history::HistoryStore::write(&mut days, 20_782, &[]).unwrap();
        let averages = store::history::HistoryStore::averages(&mut days).unwrap();
        averages.set_state(20_781, store::history::DayState::Finished.whole()).unwrap();
        (parent, data)
    }

    #[test]
    fn what_was_backed_up_is_restored_and_robots_stay_stopped() {
        let (parent, data) = folder();
        let (to, new) = (parent.path().join("backup"), parent.path().join("new"));
        let mut told = Vec::new();
        let made = backup(&data, &to, true, |name| told.push(name.to_owned())).unwrap();
        let history = ["history/2026-11-25.db", "history/hours-2026-11.db"];
        assert_eq!(told, ["tls/key.pem", history[0], history[1], "control.db"]);
        assert_eq!((made.files, made.entries, made.problems.len()), (4, 1, 0));
        // What happens afterwards is not in it.
        crate::revoke_token(&data, 1).unwrap();

        let restored = restore(&new, &to, |_| ()).unwrap();
        assert_eq!(restored, made);
        assert_eq!(std::fs::read_to_string(new.join("tls/key.pem")).unwrap(), "key");
        assert_eq!(crate::list_tokens(&new).unwrap().len(), 1);
        assert_eq!(verify(&new, &[], None).unwrap().entries, 2, "and the entry that says so");
        let last = Sqlite::open_existing(&new).unwrap().entries(1, 1).unwrap().remove(0);
        assert!(last.body.contains("restored") && last.body.contains("\"actor\":\"shell\""), "{}", last.body);
        let mut store = Sqlite::open_existing(&new).unwrap();
        let seat = store.seat(&RobotName::new("press").unwrap()).unwrap();
        assert_eq!((seat.number, seat.stopped), (1_000_007, true), "no number is given out twice");
        assert_eq!(seat.stopped_by.unwrap().by, "shell");
        // It was added to the configuration and never answered, or it comes later.
        let silent = RobotName::new("silent").unwrap();
        let seat = store.seat(&silent).unwrap();
        assert_eq!((seat.number, seat.stopped, seat.identity), (1_000_000, true, None));
        // Its own seat holds once there is one.
        store.save_seat(&silent, &Saved { number: 1_000_001, ..Saved::default() }).unwrap();
        let seat = store.seat(&silent).unwrap();
        assert_eq!((seat.number, seat.stopped), (1_000_001, false));
        store.close().unwrap();
        // A backup of the restored folder, restored: the same again.
        let (second, newest) = (parent.path().join("second"), parent.path().join("newest"));
        backup(&new, &second, false, |_| ()).unwrap();
        restore(&newest, &second, |_| ()).unwrap();
        let mut store = Sqlite::open_existing(&newest).unwrap();
        let seats =
            ["press", "silent", "new"].map(|name| store.seat(&RobotName::new(name).unwrap()).unwrap());
        assert!(seats.iter().all(|seat| seat.stopped), "{seats:?}");
        assert_eq!(seats.map(|seat| seat.number), [2_000_007, 2_000_001, 2_000_000]);
        let names: Vec<_> =
            std::fs::read_dir(&new).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert!(!names.iter().any(|name| name == "restored"), "{names:?}");
        #[cfg(unix)]
        for name in ["backup/control.db", "backup/tls/key.pem", "new/control.db", "new/tls/key.pem"] {
            use std::os::unix::fs::PermissionsExt;
            let file = std::fs::metadata(parent.path().join(name)).unwrap();
            assert_eq!(file.permissions().mode() & 0o077, 0, "{name}");
        }
    }

    #[test]
    fn nothing_is_overwritten_and_nothing_else_is_taken_for_a_backup() {
        let (parent, data) = folder();
        let path = |name: &str| parent.path().join(name);
        let failed = |made: Result<Backup, BackupError>| made.unwrap_err().to_string();
        assert!(failed(backup(&path("none"), &path("b"), true, |_| ())).contains("there is no"));
        assert!(!path("b").exists());
        assert!(failed(backup(&data, &data, true, |_| ())).contains("choose another folder"));
        backup(&data, &path("b"), false, |_| ()).unwrap();
        assert!(!path("b/history").exists());
        assert!(failed(backup(&data, &path("b"), true, |_| ())).contains("choose another folder"));
        assert!(failed(restore(&data, &path("b"), |_| ())).contains("choose another folder"));
        assert!(failed(restore(&path("n"), &data, |_| ())).contains("no backup that can be read"));

        let list = std::fs::read_to_string(path("b/backup.json")).unwrap();
        for (from, to, part) in [
            ("\"format\": 1", "\"format\": 2", "format 2"),
            ("tls/key.pem", "../data/tls/key.pem", "which a backup does not have"),
            ("tls/key.pem", "/etc/passwd", "which a backup does not have"),
            ("tls/key.pem", "history/../../key.db", "which a backup does not have"),
            ("tls/key.pem", "control.db-wal", "which a backup does not have"),
            ("tls/key.pem", "history/2026-11-25.db-wal", "which a backup does not have"),
            ("tls/key.pem", "control.db", "names `control.db` twice"),
            ("\"bytes\": 3", "\"bytes\": 18446744073709551615", "these sizes"),
            ("\"bytes\": 3", "\"bytes\": 4", "has changed"),
            ("\"control.db\"", "\"tls/certificate.pem\"", "control.db is not in it"),
            ("{", "", "backup.json: "),
        ] {
            std::fs::write(path("b/backup.json"), list.replacen(from, to, 1)).unwrap();
            let error = failed(restore(&path("n"), &path("b"), |_| ()));
            assert!(error.contains(part), "{error}");
        }
        std::fs::write(path("b/backup.json"), &list).unwrap();
        std::fs::write(path("b/tls/key.pem"), "yek").unwrap();
        assert!(failed(restore(&path("n"), &path("b"), |_| ())).contains("has changed"));
        std::fs::remove_file(path("b/tls/key.pem")).unwrap();
        std::fs::create_dir(path("b/tls/key.pem")).unwrap();
        assert!(failed(restore(&path("n"), &path("b"), |_| ())).contains("it is not a file"));
        assert!(!path("n").exists());
    }

    #[test]
    fn a_backup_is_only_read_afterwards() {
        let (parent, data) = folder();
        let to = parent.path().join("a backup 100% #1?");
        backup(&data, &to, false, |_| ()).unwrap();
        // An older r6 made it: without users and programs. Its log was verified by it, which left this
        // journal.
        let control = to.join("control.db");
        let old = rusqlite::Connection::open(&control).unwrap();
        old.execute_batch(
            "DROP TABLE camera; DROP TABLE command; DROP TABLE audit_head; ALTER TABLE seat DROP COLUMN stopped_by; DROP TABLE run; DROP TABLE user; DROP TABLE link; DROP TABLE program; DROP TABLE alarm; DROP TABLE hall;
             ALTER TABLE robot DROP COLUMN model;
             PRAGMA user_version = 1; PRAGMA journal_mode = WAL;",
        )
        .unwrap();
        drop(old);
        let files = || {
            let files = std::fs::read_dir(&to).unwrap().map(|entry| entry.unwrap().file_name());
            files.collect::<std::collections::BTreeSet<_>>()
        };
        let (bytes, names) = (std::fs::read(&control).unwrap(), files());
        assert_eq!(verify(&to, &[], None).unwrap().entries, 1);
        assert_eq!(crate::list_tokens(&to).unwrap().len(), 1);
        assert!(crate::list_users(&to).unwrap().is_empty());
        assert!(crate::list_cameras(&to).unwrap().is_empty());
        assert!(std::fs::read(&control).unwrap() == bytes, "the tables are those of the older r6");
        assert_eq!(files(), names, "nothing is made beside it");
        // The same for a folder that is no backup.
        std::fs::remove_file(to.join(LIST)).unwrap();
        assert_eq!(verify(&to, &[], None).unwrap().entries, 1);
        assert!(std::fs::read(&control).unwrap() == bytes);
        let newer = rusqlite::Connection::open(&control).unwrap();
        newer.execute_batch("PRAGMA user_version = 99").unwrap();
        drop(newer);
        assert!(verify(&to, &[], None).unwrap_err().to_string().contains("of a newer r6 (tables 99)"));
    }

    #[test]
    fn what_a_failed_backup_left_is_replaced_and_nothing_else() {
        let (parent, data) = folder();
        let (to, part) = (parent.path().join("b"), parent.path().join("b.part"));
        // The disk was full, or the power failed.
        let under_way = begin(&part).unwrap();
        std::fs::write(part.join("control.db"), "half").unwrap();
        let failed = backup(&data, &to, false, |_| ()).unwrap_err();
        assert!(matches!(failed, BackupError::NotEmpty(_)), "another process makes it now: {failed}");
        drop(under_way);
        let made = backup(&data, &to, false, |_| ()).unwrap();
        assert_eq!((made.files, part.exists(), to.join(UNFINISHED).exists()), (2, false, false));
        // A folder of somebody else.
        std::fs::remove_dir_all(&to).unwrap();
        std::fs::create_dir(&part).unwrap();
        std::fs::write(part.join("letter"), "mine").unwrap();
        assert!(matches!(backup(&data, &to, false, |_| ()), Err(BackupError::NotEmpty(_))));
        assert!(part.join("letter").exists());
    }

    #[test]
    fn a_restore_that_fails_half_way_leaves_no_gateway() {
        let (parent, data) = folder();
        let (to, new) = (parent.path().join("b"), parent.path().join("new"));
        backup(&data, &to, false, |_| ()).unwrap();
        // The checksums fit, and the file is no store: the backup was made by a broken program.
        std::fs::write(to.join("control.db"), [7; 4096]).unwrap();
        let mut listed: List = serde_json::from_slice(&std::fs::read(to.join(LIST)).unwrap()).unwrap();
        listed.files = listed.files.into_iter().map(|file| list(&to, file.name).unwrap()).collect();
        std::fs::write(to.join(LIST), serde_json::to_vec(&listed).unwrap()).unwrap();
        let failed = restore(&new, &to, |_| ()).unwrap_err();
        assert!(matches!(failed, BackupError::Store(StoreError::Unreadable(_))), "{failed}");
        assert!(!new.join("control.db").exists(), "no robot could be moved with it");
        assert!(verify(&new, &[], None).unwrap_err().to_string().contains("there is no"));
        assert!(matches!(restore(&new, &to, |_| ()), Err(BackupError::NotEmpty(_))));
    }

    #[test]
    fn what_is_broken_is_told_and_the_rest_is_kept() {
        let (parent, data) = folder();
        std::fs::write(data.join("history/2026-11-24.db"), [7; 4096]).unwrap();
        let control = rusqlite::Connection::open(data.join("control.db")).unwrap();
        control.execute("UPDATE audit SET hash = zeroblob(32)", []).unwrap();
        drop(control);
        let to = parent.path().join("backup");
        let made = backup(&data, &to, true, |_| ()).unwrap();
        assert_eq!((made.files, made.entries), (4, 1));
        let [file, log] = &made.problems[..] else { panic!("{:?}", made.problems) };
        assert!(file.contains("history/2026-11-24.db is not in the backup") && log.contains("NOT whole"));
        let restored = restore(&parent.path().join("new"), &to, |_| ()).unwrap();
        assert!(restored.problems[0].contains("NOT whole"), "{:?}", restored.problems);
    }
}
