//! The commands with a key in the table.

use r6_api::gateway::AuditRecord;
use rusqlite::{Connection, OptionalExtension, Row, Transaction, params};

use super::append_in;
use crate::store::StoreError;
use crate::store::commands::{KEPT, KEPT_AT_LEAST, KeptCommand, MAX_KEYS, NewCommand, Noted};

/// A row as it was read.
type Raw = (u64, Vec<u8>, Option<String>, bool);

fn raw(row: &Row<'_>) -> rusqlite::Result<Raw> {
    Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?))
}

fn kept((intent, hash, answer, ended): Raw) -> Result<KeptCommand, StoreError> {
    let hash = <[u8; 32]>::try_from(hash.as_slice());
    let hash = hash.map_err(|_| StoreError::Unreadable(format!("the key of command {intent}")))?;
    Ok(KeptCommand { intent, hash, answer, ended })
}

/// Adds a command and its intent, if its key is new.
pub fn begin(transaction: Transaction<'_>, new: &NewCommand) -> Result<Noted, StoreError> {
    transaction.execute("DELETE FROM command WHERE made < ?1", [new.now.saturating_sub(KEPT)])?;
    if let Some(known) = by_key(&transaction, &new.caller, &new.key, 0)? {
        return Ok(Noted::Known(known));
    }
    let last: u64 =
        transaction.query_row("SELECT coalesce(max(id), 0) FROM command", [], |row| row.get(0))?;
    // With the new one there are as many as may be kept.
    let beyond = last.saturating_sub(MAX_KEYS - 1);
    let young: bool = transaction.query_row(
        "SELECT EXISTS (SELECT 1 FROM command WHERE id <= ?1 AND made > ?2)",
        params![beyond, new.now.saturating_sub(KEPT_AT_LEAST)],
        |row| row.get(0),
    )?;
    let noted = if young {
        Noted::Full
    } else {
        transaction.execute("DELETE FROM command WHERE id <= ?1", [beyond])?;
        let intent = append_in(&transaction, std::slice::from_ref(&new.intent))?;
        transaction.execute(
            "INSERT INTO command (intent, caller, key, hash, made) VALUES (?1, ?2, ?3, ?4, ?5)",
            params![intent, new.caller, new.key, new.hash, new.now],
        )?;
        Noted::New(intent)
    };
    transaction.commit()?;
    Ok(noted)
}

/// The command with this key of this caller, if it is not too old.
pub fn by_key(
    connection: &Connection,
    caller: &str,
    key: &str,
    since: u64,
) -> Result<Option<KeptCommand>, StoreError> {
    let mut select = connection.prepare_cached(
        "SELECT intent, hash, answer,
         EXISTS (SELECT 1 FROM audit WHERE audit.intent = it.intent)
         OR NOT EXISTS (SELECT 1 FROM audit WHERE number = it.intent)
         FROM command AS it WHERE caller = ?1 AND key = ?2 AND made >= ?3",
    )?;
    select.query_row(params![caller, key, since], raw).optional()?.map(kept).transpose()
}

/// Keeps the answer to the request for a command, and appends its record.
pub fn end(
    transaction: Transaction<'_>,
    intent: u64,
    answer: &str,
    record: &AuditRecord,
) -> Result<(), StoreError> {
    transaction.execute("UPDATE command SET answer = ?2 WHERE intent = ?1", params![intent, answer])?;
    append_in(&transaction, std::slice::from_ref(record))?;
    transaction.commit()?;
    Ok(())
}
