//! The store in a file: SQLite with a write-ahead log, synchronised to the disk at each commit.

mod commands;
mod heads;
mod programs;
mod runs;
mod tables;
mod users;

use std::path::{Path, PathBuf, absolute};
use std::time::Duration;

use r6_api::gateway::{ActedBy, AuditRecord, RobotIdentity, Run};
use rusqlite::{Connection, OpenFlags, OptionalExtension, Transaction, TransactionBehavior, params};

use self::tables::TABLES;
use super::commands::{KeptCommand, NewCommand, Noted};
use super::runs::{Begun, KeptRun, NewRun};
use super::{
    Author, Ends, Entry, Heads, Kept, LibraryError, Link, MAX_PAGE, MAX_TOKENS, NewToken, NewVersion, Store,
    StoreError, StoredRobot, StoredSettings, StoredUser, Token, UserChange, body, role, token_made,
    token_revoked,
};
use crate::core::account::Decided;
use crate::core::alarms;
use crate::core::chain::{Broken, Hash, link};
use crate::core::library::{Condition, ProgramName};
use crate::core::name::RobotName;
use crate::core::role::Grant;
use crate::core::seat::Saved;
use crate::files;

/// The name of the file in the folder.
pub const FILE: &str = "control.db";

/// The folder of the history, beside the store.
pub const HISTORY: &str = "history";

/// The folder, beside the store, in which a restore makes it, until a stop holds for each robot.
pub const HALF_RESTORED: &str = "restored";

/// The version from which on there are users.
const USERS_SINCE: usize = 3;

/// The version from which on there are signed heads.
const HEADS_SINCE: usize = 6;

/// How long a write waits for another process, such as `r6 gateway token`: its transactions take
/// milliseconds.
const BUSY: Duration = Duration::from_secs(5);

/// How much a restore adds to the numbers of leases, so that no number is given out twice: the gateway may
/// have given out more since the backup was made. A lease lasts 2 s at least, so a million of them take 23
/// days.
const LEASES_SINCE_BACKUP: u64 = 1_000_000;

/// A store in `control.db` of a folder.
#[derive(Debug)]
pub struct Sqlite {
    connection: Connection,
}

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
        let store = Self { connection };
        if store.version()? > TABLES.len() {
            return Err(newer(&path, store.version()?));
        }
        Ok(store)
    }

    /// How many of the versions of tables the file has.
    fn version(&self) -> Result<usize, StoreError> {
        Ok(self.connection.query_row("PRAGMA user_version", [], |row| row.get(0))?)
    }

    fn at(path: &Path) -> Result<Self, StoreError> {
        let connection = Connection::open(path)?;
        connection.busy_timeout(BUSY)?;
        connection.pragma_update(None, "journal_mode", "WAL")?;
        connection.pragma_update(None, "synchronous", "FULL")?;
        Self { connection }.with_tables(path)
    }

    /// A store that is in memory alone.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`].
    #[cfg(feature = "simulation")]
    pub fn in_memory() -> Result<Self, StoreError> {
        Self { connection: Connection::open_in_memory()? }.with_tables(Path::new(":memory:"))
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

    /// Makes the copy of a store the store of another gateway: lets a stop hold for each robot, raises the
    /// numbers of leases, forgets which alarms were acknowledged and shelved, removes the newest signed head,
    /// and says so in the audit log. Robots without a seat are meant too: those of the configuration that
    /// never answered, and those that come later.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn stop_all(&mut self, record: &AuditRecord) -> Result<(), StoreError> {
        let by = ActedBy { by: record.actor.clone(), at: record.time.clone() };
        let by = to_json(&by)?;
        let transaction = self.write()?;
        transaction.execute(
            "INSERT INTO seat (robot, lease_number, stopped) VALUES ('', 0, 0) ON CONFLICT DO NOTHING",
            [],
        )?;
        transaction.execute(
            "UPDATE seat SET stopped_by = CASE stopped WHEN 1 THEN stopped_by ELSE ?2 END, stopped = 1,
             lease_number = lease_number + ?1",
            params![LEASES_SINCE_BACKUP, by],
        )?;
        // Another gateway may go on from here. So this one gets a key of its own, and signs anew.
        transaction.execute("DELETE FROM audit_head WHERE what = 'end'", [])?;
        // Whether an alarm ended and came again since is not known, so nothing is acknowledged any more.
        transaction.execute("DELETE FROM alarm", [])?;
        append_in(&transaction, std::slice::from_ref(record))?;
        transaction.commit()?;
        Ok(())
    }

    /// How many entries the audit log has.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn count_entries(&self) -> Result<u64, StoreError> {
        Ok(self.connection.query_row("SELECT count(*) FROM audit", [], |row| row.get(0))?)
    }

    /// Makes everything that is read from now on of one moment, while others write.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn hold_still(&self) -> Result<(), StoreError> {
        Ok(self.connection.execute_batch("BEGIN")?)
    }

    /// Closes the file, with nothing beside it.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn close(self) -> Result<(), StoreError> {
        self.connection.pragma_update(None, "journal_mode", "DELETE")?;
        self.connection.close().map_err(|(_, error)| error.into())
    }

    /// A transaction that writes. It begins at once, so that what it reads is what it adds to.
    fn write(&mut self) -> Result<Transaction<'_>, StoreError> {
        Ok(self.connection.transaction_with_behavior(TransactionBehavior::Immediate)?)
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
    // Not read-only: after a crash, the first one to open the file has to recover its log.
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(from, flags)?;
    connection.busy_timeout(BUSY)?;
    connection.execute("VACUUM INTO ?1", [to_text])?;
    // SQLite does not synchronise what it makes like this.
    std::fs::File::open(to).and_then(|file| file.sync_all()).map_err(failed)
}

/// Appends to the audit log within a transaction. Returns the number of the first entry.
fn append_in(transaction: &Transaction<'_>, records: &[AuditRecord]) -> Result<u64, StoreError> {
    let (last, mut head) = heads::last(transaction)?;
    let mut insert =
        transaction.prepare_cached("INSERT INTO audit (number, body, hash) VALUES (?1, ?2, ?3)")?;
    for (number, record) in (last + 1..).zip(records) {
        let body = body(record)?;
        head = link(head, number, &body);
        insert.execute(params![number, body, head.bytes()])?;
    }
    Ok(last + 1)
}

fn to_json(of: &impl serde::Serialize) -> Result<String, StoreError> {
    serde_json::to_string(of).map_err(|error| StoreError::Unreadable(error.to_string()))
}

fn grant(word: &str, only: Option<String>) -> Result<Grant, StoreError> {
    let only = only.map(|only| {
        RobotName::new(&only).ok_or_else(|| StoreError::Unreadable(format!("the robot `{only}`")))
    });
    Ok(Grant { role: role(word)?, only: only.transpose()? })
}

impl Store for Sqlite {
    fn append(&mut self, records: &[AuditRecord]) -> Result<u64, StoreError> {
        let transaction = self.write()?;
        if records.is_empty() {
            // To see whether the disk takes something, something has to be written.
            transaction.pragma_update(None, "user_version", TABLES.len())?;
        }
        let first = append_in(&transaction, records)?;
        transaction.commit()?;
        Ok(first)
    }

    fn entries(&mut self, after: u64, most: usize) -> Result<Vec<Entry>, StoreError> {
        // SQLite takes signed numbers only. No log gets that long.
        let after = after.min(u64::MAX >> 1);
        let mut select = self.connection.prepare_cached(
            "SELECT number, body, hash FROM audit WHERE number > ?1 ORDER BY number LIMIT ?2",
        )?;
        let rows = select.query_map(params![after, most.min(MAX_PAGE)], |row| {
            Ok((row.get(0)?, row.get(1)?, row.get::<_, Vec<u8>>(2)?))
        })?;
        rows.map(|row| {
            let (number, body, hash) = row?;
            let hash = Hash::of_bytes(&hash).ok_or(StoreError::Broken(Broken::Changed { number }))?;
            Ok(Entry { number, body, hash })
        })
        .collect()
    }

    fn ends(&mut self) -> Result<Ends, StoreError> {
        heads::ends(&self.connection)
    }

    fn heads(&mut self) -> Result<Heads, StoreError> {
        // A file that is only read can be older than heads.
        if self.version()? < HEADS_SINCE {
            return Ok(Heads::default());
        }
        heads::all(&self.connection)
    }

    fn put_key(&mut self, key: &str, cut: Option<&str>, record: &AuditRecord) -> Result<(), StoreError> {
        let transaction = self.write()?;
        heads::put_key(&transaction, key, cut)?;
        append_in(&transaction, std::slice::from_ref(record))?;
        transaction.commit()?;
        Ok(())
    }

    fn put_head(&mut self, note: &str) -> Result<(), StoreError> {
        heads::put(&self.connection, "end", note)
    }

    fn cut(&mut self, until: u64, note: &str) -> Result<(), StoreError> {
        heads::cut(self.write()?, until, note)
    }

    fn open_intents(&mut self) -> Result<Vec<(u64, Option<String>)>, StoreError> {
        let mut select = self.connection.prepare_cached(
            "SELECT number, robot FROM audit AS it WHERE what = 'command_intent'
             AND NOT EXISTS (SELECT 1 FROM audit WHERE intent = it.number) ORDER BY number",
        )?;
        let rows = select.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
        Ok(rows.collect::<Result<_, _>>()?)
    }

    fn add_token(&mut self, token: &NewToken, author: &Author) -> Result<i64, StoreError> {
        let transaction = self.write()?;
        let known: usize =
            transaction
                .query_row("SELECT count(*) FROM token WHERE revoked IS NULL", [], |row| row.get(0))?;
        if known >= MAX_TOKENS {
            return Err(StoreError::TooManyTokens);
        }
        let only = token.grant.only.as_ref().map(RobotName::as_str);
        transaction.execute(
            "INSERT INTO token (hash, role, only, name, made) VALUES (?1, ?2, ?3, ?4, ?5)",
            params![token.hash, token.grant.role.word(), only, token.name, author.time],
        )?;
        let number = transaction.last_insert_rowid();
        append_in(&transaction, &[token_made(number, token, author)])?;
        transaction.commit()?;
        Ok(number)
    }

    fn revoke_token(&mut self, number: i64, author: &Author) -> Result<bool, StoreError> {
        let transaction = self.write()?;
        let revoked = transaction.execute(
            "UPDATE token SET revoked = ?2 WHERE number = ?1 AND revoked IS NULL",
            params![number, author.time],
        )?;
        if revoked == 0 {
            return Ok(false);
        }
        append_in(&transaction, &[token_revoked(number, author)])?;
        transaction.commit()?;
        Ok(true)
    }

    fn tokens(&mut self) -> Result<Vec<Token>, StoreError> {
        let mut select = self.connection.prepare_cached(
            "SELECT number, hash, role, only, name FROM token WHERE revoked IS NULL ORDER BY number",
        )?;
        let rows = select.query_map([], |row| {
            let only: Option<String> = row.get(3)?;
            Ok((row.get(0)?, row.get(1)?, row.get::<_, String>(2)?, only, row.get(4)?))
        })?;
        rows.map(|row| {
            let (number, hash, word, only, name) = row?;
            Ok(Token { number, hash, grant: grant(&word, only)?, name })
        })
        .collect()
    }

    fn users(&mut self) -> Result<Vec<StoredUser>, StoreError> {
        // A file that is only read can be older than users.
        if self.version()? < USERS_SINCE {
            return Ok(Vec::new());
        }
        users::all(&self.connection)
    }

    fn change_user(&mut self, change: &UserChange, author: &Author) -> Result<(Decided, u64), StoreError> {
        users::change(self.write()?, change, author)
    }

    fn put_link(&mut self, link: &Link, author: &Author) -> Result<(), StoreError> {
        users::put_link(self.write()?, link, author)
    }

    fn link(&mut self, hash: &[u8; 32], now: u64) -> Result<Option<Link>, StoreError> {
        Ok(users::link(&self.connection, hash)?.filter(|link| link.is_valid(now)))
    }

    fn remove_setup_link(&mut self) -> Result<(), StoreError> {
        self.connection.execute("DELETE FROM link WHERE user = ''", [])?;
        Ok(())
    }

    fn seat(&mut self, robot: &RobotName) -> Result<Saved, StoreError> {
        let row = self
            .connection
            .prepare_cached(
                "SELECT lease_number, stopped, identity, stopped_by FROM seat WHERE robot IN (?1, '')
                 ORDER BY robot = '' LIMIT 1",
            )?
            .query_row([robot.as_str()], |row| {
                let (identity, by): (Option<String>, Option<String>) = (row.get(2)?, row.get(3)?);
                Ok((row.get(0)?, row.get(1)?, identity, by))
            })
            .optional()?;
        let Some((number, stopped, identity, by)) = row else { return Ok(Saved::default()) };
        let unreadable = |error: serde_json::Error| StoreError::Unreadable(format!("{robot}: {error}"));
        let identity = identity.map(|text| serde_json::from_str::<RobotIdentity>(&text)).transpose();
        let by = by.map(|text| serde_json::from_str::<ActedBy>(&text)).transpose();
        let stopped_by = by.map_err(unreadable)?;
        Ok(Saved { number, stopped, stopped_by, identity: identity.map_err(unreadable)? })
    }

    fn save_seat(&mut self, robot: &RobotName, saved: &Saved) -> Result<(), StoreError> {
        let identity = saved.identity.as_ref().map(to_json).transpose()?;
        let by = saved.stopped_by.as_ref().map(to_json).transpose()?;
        let transaction = self.write()?;
        // A number that was given out once is never given out again.
        transaction.execute(
            "INSERT INTO seat (robot, lease_number, stopped, identity, stopped_by) VALUES (?1, ?2, ?3, ?4, ?5)
             ON CONFLICT (robot) DO UPDATE SET lease_number = max(lease_number, excluded.lease_number),
             stopped = excluded.stopped, identity = excluded.identity, stopped_by = excluded.stopped_by",
            params![robot.as_str(), saved.number, saved.stopped, identity, by],
        )?;
        transaction.commit()?;
        Ok(())
    }

    fn alarms(&mut self, robot: &RobotName) -> Result<alarms::Saved, StoreError> {
        let state: Option<String> = self
            .connection
            .prepare_cached("SELECT state FROM alarm WHERE robot = ?1")?
            .query_row([robot.as_str()], |row| row.get(0))
            .optional()?;
        let saved = state.map(|text| serde_json::from_str(&text)).transpose();
        let saved =
            saved.map_err(|error| StoreError::Unreadable(format!("the alarms of {robot}: {error}")))?;
        Ok(saved.unwrap_or_default())
    }

    fn save_alarms(
        &mut self,
        robot: &RobotName,
        saved: &alarms::Saved,
        records: &[AuditRecord],
    ) -> Result<(), StoreError> {
        let state = serde_json::to_string(saved);
        let state = state.map_err(|error| StoreError::Unreadable(error.to_string()))?;
        let transaction = self.write()?;
        transaction.execute(
            "INSERT INTO alarm (robot, state) VALUES (?1, ?2)
             ON CONFLICT (robot) DO UPDATE SET state = excluded.state",
            params![robot.as_str(), state],
        )?;
        append_in(&transaction, records)?;
        transaction.commit()?;
        Ok(())
    }

    fn settings(&mut self) -> Result<Option<StoredSettings>, StoreError> {
        let mut select = self.connection.prepare_cached("SELECT version, settings FROM hall")?;
        let row = select.query_row([], |row| Ok(StoredSettings { version: row.get(0)?, text: row.get(1)? }));
        Ok(row.optional()?)
    }

    fn put_settings(&mut self, settings: &StoredSettings, record: &AuditRecord) -> Result<(), StoreError> {
        let transaction = self.write()?;
        transaction.execute(
            "INSERT INTO hall (one, version, settings) VALUES (1, ?1, ?2)
             ON CONFLICT (one) DO UPDATE SET version = excluded.version, settings = excluded.settings",
            params![settings.version, settings.text],
        )?;
        append_in(&transaction, std::slice::from_ref(record))?;
        transaction.commit()?;
        Ok(())
    }

    fn robots(&mut self) -> Result<Vec<StoredRobot>, StoreError> {
        let mut select = self
            .connection
            .prepare_cached("SELECT name, address, period_ms, read, model FROM robot ORDER BY name")?;
        let rows = select.query_map([], |row| {
            Ok((row.get::<_, String>(0)?, row.get(1)?, row.get(2)?, row.get::<_, String>(3)?, row.get(4)?))
        })?;
        rows.map(|row| {
            let (name, address, period_ms, read, model) = row?;
            let unreadable = || StoreError::Unreadable(format!("the robot `{name}`"));
            let read = serde_json::from_str(&read).map_err(|_| unreadable())?;
            let name = RobotName::new(&name).ok_or_else(unreadable)?;
            Ok(StoredRobot { name, address, period_ms, read, model })
        })
        .collect()
    }

    fn put_robot(&mut self, robot: &StoredRobot, record: &AuditRecord) -> Result<(), StoreError> {
        let read = serde_json::to_string(&robot.read);
        let read = read.map_err(|error| StoreError::Unreadable(error.to_string()))?;
        let transaction = self.write()?;
        transaction.execute(
            "INSERT INTO robot (name, address, period_ms, read, model) VALUES (?1, ?2, ?3, ?4, ?5)
             ON CONFLICT (name) DO UPDATE SET address = excluded.address, period_ms = excluded.period_ms,
             read = excluded.read, model = excluded.model",
            params![robot.name.as_str(), robot.address, robot.period_ms, read, robot.model],
        )?;
        append_in(&transaction, std::slice::from_ref(record))?;
        transaction.commit()?;
        Ok(())
    }

    fn remove_robot(&mut self, name: &RobotName, records: &[AuditRecord]) -> Result<(), StoreError> {
        let transaction = self.write()?;
        transaction.execute("DELETE FROM robot WHERE name = ?1", [name.as_str()])?;
        append_in(&transaction, records)?;
        transaction.commit()?;
        Ok(())
    }

    fn programs(&mut self) -> Result<Vec<Kept>, StoreError> {
        programs::latest(&self.connection)
    }

    fn program_versions(&mut self, name: &ProgramName) -> Result<Vec<Kept>, StoreError> {
        programs::versions(&self.connection, name)
    }

    fn program(
        &mut self,
        name: &ProgramName,
        version: Option<u64>,
    ) -> Result<Option<(Kept, String)>, StoreError> {
        programs::one(&self.connection, name, version)
    }

    fn put_program(&mut self, new: &NewVersion, condition: &Condition) -> Result<Kept, LibraryError> {
        programs::put(self.write()?, new, condition)
    }

    fn remove_program(
        &mut self,
        name: &ProgramName,
        condition: &Condition,
        by: &Author,
    ) -> Result<(), LibraryError> {
        programs::remove(self.write()?, name, condition, by)
    }

    fn begin_run(&mut self, new: &NewRun) -> Result<Begun, StoreError> {
        runs::begin(self.write()?, new)
    }

    fn run_of_key(&mut self, caller: &str, key: &str, since: u64) -> Result<Option<KeptRun>, StoreError> {
        runs::by_key(&self.connection, caller, key, since)
    }

    fn run(&mut self, robot: &RobotName, id: u64) -> Result<Option<KeptRun>, StoreError> {
        runs::one(&self.connection, robot, id)
    }

    fn open_runs(&mut self) -> Result<Vec<Run>, StoreError> {
        runs::open(&self.connection)
    }

    fn answer_run(&mut self, id: u64, answer: &str) -> Result<(), StoreError> {
        runs::answer(&self.connection, id, answer)
    }

    fn end_run(&mut self, run: &Run, owed: bool, records: &[AuditRecord]) -> Result<(), StoreError> {
        runs::end(self.write()?, run, owed, records)
    }

    fn owed_stops(&mut self) -> Result<Vec<RobotName>, StoreError> {
        runs::owed(&self.connection)
    }

    fn forget_owed_stop(&mut self, robot: &RobotName) -> Result<(), StoreError> {
        runs::forget_owed_stop(&self.connection, robot)
    }

    fn begin_command(&mut self, new: &NewCommand) -> Result<Noted, StoreError> {
        commands::begin(self.write()?, new)
    }

    fn command_of_key(
        &mut self,
        caller: &str,
        key: &str,
        since: u64,
    ) -> Result<Option<KeptCommand>, StoreError> {
        commands::by_key(&self.connection, caller, key, since)
    }

    fn end_command(&mut self, intent: u64, answer: &str, outcome: &AuditRecord) -> Result<(), StoreError> {
        commands::end(self.write()?, intent, answer, outcome)
    }
}

impl From<rusqlite::Error> for StoreError {
    fn from(error: rusqlite::Error) -> Self {
        use rusqlite::ErrorCode::{DatabaseCorrupt, NotADatabase, Unknown};
        match error.sqlite_error_code() {
            Some(DatabaseCorrupt | NotADatabase) => Self::Unreadable(error.to_string()),
            // Another program's tables.
            Some(Unknown) if error.to_string().contains("no such table") => {
                Self::Unreadable(error.to_string())
            }
            _ => Self::Unavailable(error.to_string()),
        }
    }
}
