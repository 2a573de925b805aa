//! The runs in the table.

use r6_api::gateway::{AuditRecord, Run};
use rusqlite::{Connection, OptionalExtension, Row, Transaction, params};

use super::append_in;
use crate::core::name::RobotName;
use crate::store::StoreError;
use crate::store::runs::{Begun, KEPT, KeptRun, MAX_RUNS, MAX_RUNS_OF_ONE, NewRun, of_text, to_text};

const COLUMNS: &str = "id, hash, run, answer, ended";

/// A row as it was read.
type Raw = (u64, Vec<u8>, String, Option<String>, bool);

fn raw(row: &Row<'_>) -> rusqlite::Result<Raw> {
    Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?, row.get(4)?))
}

fn kept((id, hash, run, answer, ended): Raw) -> Result<KeptRun, StoreError> {
    let hash = <[u8; 32]>::try_from(hash.as_slice());
    let hash = hash.map_err(|_| StoreError::Unreadable(format!("run {id}")))?;
    // The number of the row counts: the text was written before it was known.
    Ok(KeptRun { hash, run: Run { run_id: id, ..of_text(id, &run)? }, answer, ended })
}

/// Adds a run and its record, if its key is new.
pub fn begin(transaction: Transaction<'_>, new: &NewRun) -> Result<Begun, StoreError> {
    transaction.execute(
        "DELETE FROM run WHERE made < ?1 AND ended = 1 AND owed = 0",
        [new.now.saturating_sub(KEPT)],
    )?;
    let known = by_key(&transaction, &new.caller, &new.key, 0)?;
    let begun = match known {
        Some(known) => Begun::Known(Box::new(known)),
        None if count(&transaction, None)? >= MAX_RUNS => Begun::Full,
        None if count(&transaction, Some(&new.robot))? >= MAX_RUNS_OF_ONE => Begun::Full,
        None => {
            transaction.execute(
                "INSERT INTO run (robot, caller, key, hash, made, run, ended, owed)
                 VALUES (?1, ?2, ?3, ?4, ?5, ?6, 0, 1)",
                params![new.robot.as_str(), new.caller, new.key, new.hash, new.now, to_text(&new.run)?],
            )?;
            let id = u64::try_from(transaction.last_insert_rowid()).unwrap_or(0);
            append_in(&transaction, &[new.record(id)])?;
            Begun::New(id)
        }
    };
    transaction.commit()?;
    Ok(begun)
}

/// How many runs there are, of one robot or of all.
fn count(connection: &Connection, robot: Option<&RobotName>) -> Result<usize, StoreError> {
    let mut select = connection.prepare_cached("SELECT count(*) FROM run WHERE ?1 IS NULL OR robot = ?1")?;
    Ok(select.query_row([robot.map(RobotName::as_str)], |row| row.get(0))?)
}

/// The run with this key of this caller, if it is not too old.
pub fn by_key(
    connection: &Connection,
    caller: &str,
    key: &str,
    since: u64,
) -> Result<Option<KeptRun>, StoreError> {
    let mut select = connection.prepare_cached(&format!(
        "SELECT {COLUMNS} FROM run WHERE caller = ?1 AND key = ?2 AND (made >= ?3 OR ended = 0 OR owed = 1)"
    ))?;
    select.query_row(params![caller, key, since], raw).optional()?.map(kept).transpose()
}

/// The run with this number.
pub fn one(connection: &Connection, robot: &RobotName, id: u64) -> Result<Option<KeptRun>, StoreError> {
    let Ok(id) = i64::try_from(id) else { return Ok(None) };
    let mut select =
        connection.prepare_cached(&format!("SELECT {COLUMNS} FROM run WHERE id = ?1 AND robot = ?2"))?;
    select.query_row(params![id, robot.as_str()], raw).optional()?.map(kept).transpose()
}

/// The runs of a robot before this number, the newest first.
pub fn of_robot(
    connection: &Connection,
    robot: &RobotName,
    before: u64,
    most: usize,
) -> Result<Vec<Run>, StoreError> {
    let before = i64::try_from(before).unwrap_or(i64::MAX);
    let mut select = connection.prepare_cached(&format!(
        "SELECT {COLUMNS} FROM run WHERE robot = ?1 AND id < ?2 ORDER BY id DESC LIMIT ?3"
    ))?;
    let rows = select.query_map(params![robot.as_str(), before, most], raw)?;
    rows.map(|row| Ok(kept(row?)?.run)).collect()
}

/// The runs that have not ended.
pub fn open(connection: &Connection) -> Result<Vec<Run>, StoreError> {
    let mut select =
        connection.prepare_cached(&format!("SELECT {COLUMNS} FROM run WHERE ended = 0 ORDER BY id"))?;
    let rows = select.query_map([], raw)?;
    rows.map(|row| Ok(kept(row?)?.run)).collect()
}

/// Keeps the answer to the request for a run.
pub fn answer(connection: &Connection, id: u64, answer: &str) -> Result<(), StoreError> {
    connection.execute("UPDATE run SET answer = ?2 WHERE id = ?1", params![id, answer])?;
    Ok(())
}

/// Keeps the end of a run, and appends its record.
pub fn end(
    transaction: Transaction<'_>,
    run: &Run,
    owed: bool,
    records: &[AuditRecord],
) -> Result<(), StoreError> {
    transaction.execute(
        "UPDATE run SET run = ?2, ended = 1, owed = ?3 WHERE id = ?1",
        params![run.run_id, to_text(run)?, owed],
    )?;
    append_in(&transaction, records)?;
    transaction.commit()?;
    Ok(())
}

/// The robots for which a stop is owed.
pub fn owed(connection: &Connection) -> Result<Vec<RobotName>, StoreError> {
    let mut select =
        connection.prepare_cached("SELECT DISTINCT robot FROM run WHERE owed = 1 ORDER BY robot")?;
    let rows = select.query_map([], |row| row.get::<_, String>(0))?;
    rows.map(|row| {
        let name = row?;
        RobotName::new(&name).ok_or_else(|| StoreError::Unreadable(format!("the robot `{name}`")))
    })
    .collect()
}

/// No stop is owed for this robot any more, except for a run under way.
pub fn forget_owed_stop(connection: &Connection, robot: &RobotName) -> Result<(), StoreError> {
    connection
        .execute("UPDATE run SET owed = 0 WHERE owed = 1 AND ended = 1 AND robot = ?1", [robot.as_str()])?;
    Ok(())
}
