//! The ends of the audit log, its signed heads, and the removal of its oldest entries.

use rusqlite::{Connection, OptionalExtension, Transaction, params};

use crate::core::chain::{Broken, Hash};
use crate::core::retention::BATCH;
use crate::store::{Ends, Heads, StoreError};

/// The number and the hash of the newest entry; 0 without one.
pub fn last(connection: &Connection) -> Result<(u64, Hash), StoreError> {
    let last = connection
        .prepare_cached("SELECT number, hash FROM audit ORDER BY number DESC LIMIT 1")?
        .query_row([], |row| Ok((row.get::<_, u64>(0)?, row.get::<_, Vec<u8>>(1)?)))
        .optional()?;
    let Some((number, hash)) = last else { return Ok((0, Hash::ORIGIN)) };
    Ok((number, Hash::of_bytes(&hash).ok_or(StoreError::Broken(Broken::Changed { number }))?))
}

/// The ends of the log.
pub fn ends(connection: &Connection) -> Result<Ends, StoreError> {
    let (last, hash) = last(connection)?;
    let first: u64 =
        connection.query_row("SELECT coalesce(min(number), 0) FROM audit", [], |row| row.get(0))?;
    let open = connection
        .prepare_cached(
            "SELECT min(number) FROM audit AS it WHERE what = 'command_intent' AND number < ?1
             AND NOT EXISTS (SELECT 1 FROM audit WHERE intent = it.number)",
        )?
        .query_row([first.saturating_add(BATCH)], |row| row.get(0))?;
    Ok(Ends { first, last, hash, open })
}

/// The signed heads.
pub fn all(connection: &Connection) -> Result<Heads, StoreError> {
    let one = |what: &str| -> Result<Option<String>, StoreError> {
        let mut select = connection.prepare_cached("SELECT text FROM audit_head WHERE what = ?1")?;
        Ok(select.query_row([what], |row| row.get(0)).optional()?)
    };
    Ok(Heads { key: one("key")?, end: one("end")?, cut: one("cut")? })
}

/// Puts a signed head or the key in the place of the one before.
pub fn put(connection: &Connection, what: &str, text: &str) -> Result<(), StoreError> {
    connection.execute(
        "INSERT INTO audit_head (what, text) VALUES (?1, ?2)
         ON CONFLICT (what) DO UPDATE SET text = excluded.text",
        params![what, text],
    )?;
    Ok(())
}

/// Puts another key and what it signed in the place of the one before.
pub fn put_key(transaction: &Transaction<'_>, key: &str, cut: Option<&str>) -> Result<(), StoreError> {
    put(transaction, "key", key)?;
    transaction.execute("DELETE FROM audit_head WHERE what = 'end'", [])?;
    cut.map_or(Ok(()), |note| put(transaction, "cut", note))
}

/// Removes the oldest entries and puts the head of the last one of them.
pub fn cut(transaction: Transaction<'_>, until: u64, note: &str) -> Result<(), StoreError> {
    if until < last(&transaction)?.0 {
        transaction.execute("DELETE FROM audit WHERE number <= ?1", [until])?;
        put(&transaction, "cut", note)?;
    }
    transaction.commit()?;
    Ok(())
}
