//! The store in a file: SQLite with a write-ahead log, synchronised to the disk at each commit. Only outcomes
//! of commands are synchronised right after it (`settle.rs`).

mod cameras;
mod commands;
mod file;
mod heads;
mod points;
mod programs;
mod runs;
mod seats;
mod settle;
mod tables;
mod users;
mod versions;

use r6_api::gateway::{ActedBy, AuditRecord, RobotIdentity, Run};
use rusqlite::{Connection, OptionalExtension, Transaction, TransactionBehavior, params};

pub use self::file::{FILE, HALF_RESTORED, HISTORY, copy};
use self::settle::Unsettled;
use self::tables::{SINCE_GROUPS, SINCE_MORE, TABLES};
use super::commands::{KeptCommand, NewCommand, Noted};
use super::robots::More;
use super::runs::{Begun, KeptRun, NewRun};
use super::versions::Named;
use super::{
    Author, Ends, Entry, Heads, Kept, KeptPoint, LibraryError, Link, MAX_PAGE, MAX_TOKENS, NewGrant,
    NewPoint, NewToken, NewVersion, Store, StoreError, StoredRobot, StoredSettings, StoredUser, Token,
    UserChange, body, grant, token_made, token_revoked,
};
use crate::core::account::Decided;
use crate::core::alarms;
use crate::core::camera::CameraGrant;
use crate::core::chain::{Broken, Hash, link};
use crate::core::library::{Condition, ProgramName};
use crate::core::name::RobotName;
use crate::core::point::PointName;
use crate::core::role::GrantRobots;
use crate::core::seat::Saved;
use crate::expiry::Expiry;

/// The version from which on there are users.
const USERS_SINCE: usize = 3;

/// The version from which on there are grants of cameras.
const CAMERAS_SINCE: usize = 9;

/// The version from which on there are signed heads.
const HEADS_SINCE: usize = 6;

/// How much a restore adds to the numbers of leases, so that no number is given out twice: the gateway may
/// have given out more since the backup was made. A lease lasts 2 s at least, so a million of them take 23
/// days.
const LEASES_SINCE_BACKUP: u64 = 1_000_000;

/// A store in `control.db` of a folder.
#[derive(Debug)]
pub struct Sqlite {
    connection: Connection,
    /// Outcomes that were written and not synchronised.
    unsettled: Unsettled,
}

impl Sqlite {
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

    /// Saves these seats with their records, and lets a stop hold for each other robot that has a seat, all
    /// or nothing.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn hold_stops(
        &mut self,
        stops: &[(RobotName, Saved, AuditRecord)],
        by: &ActedBy,
    ) -> Result<(), StoreError> {
        seats::hold_stops(self, stops, by)
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

    /// A transaction that writes. It begins at once, so that what it reads is what it adds to.
    fn write(&mut self) -> Result<Transaction<'_>, StoreError> {
        Ok(self.durable()?.transaction_with_behavior(TransactionBehavior::Immediate)?)
    }
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

/// The tokens that are not revoked. `version`: that of the file, which may be older than ends of tokens.
fn tokens(connection: &Connection, version: usize) -> Result<Vec<Token>, StoreError> {
    let expires =
        if version >= SINCE_MORE { "(SELECT expires FROM token_end WHERE token = number)" } else { "NULL" };
    let mut select = connection.prepare_cached(&format!(
        "SELECT number, hash, role, only, name, {expires} FROM token WHERE revoked IS NULL ORDER BY number"
    ))?;
    let rows = select.query_map([], |row| {
        let only: Option<String> = row.get(3)?;
        Ok((row.get(0)?, row.get(1)?, row.get::<_, String>(2)?, only, row.get(4)?, row.get(5)?))
    })?;
    rows.map(|row| {
        let (number, hash, word, only, name, expires): (_, _, String, _, _, Option<u64>) = row?;
        Ok(Token { number, hash, grant: grant(&word, only.as_deref())?, name, expires: expires.map(Expiry) })
    })
    .collect()
}

impl Store for Sqlite {
    fn append(&mut self, records: &[AuditRecord]) -> Result<u64, StoreError> {
        if settle::are_outcomes(records) {
            return self.write_unsettled(|transaction| {
                let first = append_in(&transaction, records)?;
                transaction.commit()?;
                Ok(first)
            });
        }
        let transaction = self.write()?;
        if records.is_empty() {
            // To see whether the disk takes an intent, as many pages have to be written.
            transaction.pragma_update(None, "user_version", TABLES.len())?;
            let (last, hash) = heads::last(&transaction)?;
            transaction.execute(
                "INSERT INTO audit (number, body, hash) VALUES (?1, ?2, ?3)",
                params![last + 1, "{}", hash.bytes()],
            )?;
            transaction.execute("DELETE FROM audit WHERE number = ?1", [last + 1])?;
        }
        let first = append_in(&transaction, records)?;
        transaction.commit()?;
        Ok(first)
    }

    fn settle(&mut self) -> Result<(), StoreError> {
        self.unsettled.settle()
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
        heads::put(self.durable()?, "end", note)
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
        let only = token.grant.robots.as_ref().map(GrantRobots::to_string);
        transaction.execute(
            "INSERT INTO token (hash, role, only, name, made) VALUES (?1, ?2, ?3, ?4, ?5)",
            params![token.hash, token.grant.role.word(), only, token.name, author.time],
        )?;
        let number = transaction.last_insert_rowid();
        if let Some(expires) = token.expires {
            transaction.execute(
                "INSERT INTO token_end (token, expires) VALUES (?1, ?2)",
                params![number, expires.0],
            )?;
        }
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
        transaction.execute("DELETE FROM camera WHERE token = ?1", [number])?;
        append_in(&transaction, &[token_revoked(number, author)])?;
        transaction.commit()?;
        Ok(true)
    }

    fn tokens(&mut self) -> Result<Vec<Token>, StoreError> {
        tokens(&self.connection, self.version()?)
    }

    fn cameras(&mut self, of: Option<&RobotName>) -> Result<Vec<(RobotName, CameraGrant)>, StoreError> {
        // A file that is only read can be older than grants.
        if self.version()? < CAMERAS_SINCE {
            return Ok(Vec::new());
        }
        cameras::all(&self.connection, of)
    }

    fn grant_camera(&mut self, new: &NewGrant, author: &Author) -> Result<bool, StoreError> {
        let transaction = self.write()?;
        let tokens = tokens(&transaction, TABLES.len())?;
        cameras::give(transaction, new, &tokens, author)
    }

    fn revoke_camera(&mut self, grant: &NewGrant, author: &Author) -> Result<bool, StoreError> {
        cameras::revoke(self.write()?, grant, author)
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
        self.durable()?.execute("DELETE FROM link WHERE user = ''", [])?;
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
        seats::save(self, robot, saved)
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
        // A file that is only read can be older than these tables.
        let version = self.version()?;
        let since = |first, part: &'static str| if version >= first { part } else { "NULL" };
        let groups = since(SINCE_GROUPS, "(SELECT groups FROM poll_groups WHERE robot = name)");
        let more = since(SINCE_MORE, "(SELECT more FROM robot_more WHERE robot = name)");
        let select = format!(
            "SELECT name, address, period_ms, read, model, COALESCE({groups}, '[]'), COALESCE({more}, '{{}}')
             FROM robot ORDER BY name"
        );
        let mut select = self.connection.prepare_cached(&select)?;
        let rows = select.query_map([], |row| {
            let (name, read, groups) = (row.get::<_, String>(0)?, row.get::<_, String>(3)?, row.get(5)?);
            Ok((name, row.get(1)?, row.get(2)?, read, row.get(4)?, groups, row.get(6)?))
        })?;
        rows.map(|row| {
            let (name, address, period_ms, read, model, groups, more): (_, _, _, _, _, String, String) = row?;
            let unreadable = || StoreError::Unreadable(format!("the robot `{name}`"));
            let read = serde_json::from_str(&read).map_err(|_| unreadable())?;
            let groups = serde_json::from_str(&groups).map_err(|_| unreadable())?;
            let More { parts, guard } = serde_json::from_str(&more).map_err(|_| unreadable())?;
            let name = RobotName::new(&name).ok_or_else(unreadable)?;
            Ok(StoredRobot { name, address, period_ms, read, groups, model, parts, guard })
        })
        .collect()
    }

    fn put_robot(&mut self, robot: &StoredRobot, record: &AuditRecord) -> Result<(), StoreError> {
        let (read, groups, more) = (to_json(&robot.read)?, to_json(&robot.groups)?, More::of(robot)?);
        let transaction = self.write()?;
        transaction.execute(
            "INSERT INTO robot (name, address, period_ms, read, model) VALUES (?1, ?2, ?3, ?4, ?5)
             ON CONFLICT (name) DO UPDATE SET address = excluded.address, period_ms = excluded.period_ms,
             read = excluded.read, model = excluded.model",
            params![robot.name.as_str(), robot.address, robot.period_ms, read, robot.model],
        )?;
        transaction.execute(
            "INSERT OR REPLACE INTO poll_groups (robot, groups) VALUES (?1, ?2)",
            params![robot.name.as_str(), groups],
        )?;
        transaction.execute(
            "INSERT OR REPLACE INTO robot_more (robot, more) VALUES (?1, ?2)",
            params![robot.name.as_str(), more],
        )?;
        append_in(&transaction, std::slice::from_ref(record))?;
        transaction.commit()?;
        Ok(())
    }

    fn remove_robot(&mut self, name: &RobotName, records: &[AuditRecord]) -> Result<(), StoreError> {
        let transaction = self.write()?;
        transaction.execute("DELETE FROM robot WHERE name = ?1", [name.as_str()])?;
        transaction.execute("DELETE FROM poll_groups WHERE robot = ?1", [name.as_str()])?;
        transaction.execute("DELETE FROM robot_more WHERE robot = ?1", [name.as_str()])?;
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
        versions::remove(self.write()?, Named::Program(name), condition, by)
    }

    fn points(&mut self) -> Result<Vec<KeptPoint>, StoreError> {
        points::latest(&self.connection)
    }

    fn point_versions(&mut self, name: &PointName) -> Result<Vec<KeptPoint>, StoreError> {
        points::versions(&self.connection, name)
    }

    fn put_point(&mut self, new: &NewPoint, condition: &Condition) -> Result<KeptPoint, LibraryError> {
        points::put(self.write()?, new, condition)
    }

    fn remove_point(
        &mut self,
        name: &PointName,
        condition: &Condition,
        by: &Author,
    ) -> Result<(), LibraryError> {
        versions::remove(self.write()?, Named::Point(name), condition, by)
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

    fn runs(&mut self, robot: &RobotName, before: u64, most: usize) -> Result<Vec<Run>, StoreError> {
        runs::of_robot(&self.connection, robot, before, most)
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
        self.write_unsettled(|transaction| commands::end(transaction, intent, answer, outcome))
    }
}

impl From<rusqlite::Error> for StoreError {
    fn from(error: rusqlite::Error) -> Self {
        use rusqlite::Error::{FromSqlConversionFailure, IntegralValueOutOfRange, InvalidColumnType};
        use rusqlite::ErrorCode::{DatabaseCorrupt, NotADatabase, Unknown};
        // A value of another type than its column: to read it again changes nothing.
        if matches!(error, InvalidColumnType(..) | FromSqlConversionFailure(..) | IntegralValueOutOfRange(..))
        {
            return Self::Unreadable(error.to_string());
        }
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
