//! The tables of one file of the history.

use r6_proto::Address;
use rusqlite::{Connection, OptionalExtension, Row, Transaction, TransactionBehavior, params};

use super::{Ask, AskEvents, Entry, KeptEvent, Part, Tail};
use crate::core::history::block::{Summary, Write};
use crate::core::history::event::Event;
use crate::core::history::sample::{Interval, Micros};
use crate::core::name::RobotName;
use crate::store::StoreError;

/// The version of the tables, in `PRAGMA user_version`.
pub(super) const VERSION: i64 = 1;

/// The signals of a file, of days and of averages: other tables have the number of a signal.
pub(super) const SIGNALS: &str = "
CREATE TABLE signal (
    id      INTEGER PRIMARY KEY,
    robot   TEXT NOT NULL,
    address TEXT NOT NULL,
    UNIQUE (robot, address)
) STRICT;
";

/// A chunk is the same as one with its signal, times, count and checksum: so it can be written again after a
/// failure.
pub(super) const TABLES: &str = "
CREATE TABLE chunk (
    id          INTEGER PRIMARY KEY,
    signal      INTEGER NOT NULL,
    first       INTEGER NOT NULL,
    last        INTEGER NOT NULL,
    count       INTEGER NOT NULL,
    interval_ms INTEGER NOT NULL,
    min         REAL,
    max         REAL,
    last_number REAL,
    sum         REAL,
    good        INTEGER NOT NULL,
    bytes       BLOB NOT NULL,
    crc         BLOB NOT NULL
) STRICT;
CREATE UNIQUE INDEX chunk_of_signal ON chunk (signal, first, last, count, crc);
CREATE TABLE tail (
    id    INTEGER PRIMARY KEY,
    robot TEXT NOT NULL,
    bytes BLOB NOT NULL
) STRICT;
CREATE INDEX tail_of_robot ON tail (robot);
";

/// Made with the first event of a file: files of earlier versions of r6 do not have it, and need no pages for
/// it. An event is the same as one with its robot, time and text.
const EVENT_TABLE: &str = "
CREATE TABLE IF NOT EXISTS event (
    id    INTEGER PRIMARY KEY,
    robot TEXT NOT NULL,
    time  INTEGER NOT NULL,
    text  TEXT NOT NULL,
    crc   INTEGER NOT NULL
) STRICT;
CREATE UNIQUE INDEX IF NOT EXISTS event_of_robot ON event (robot, time, text);
";

const COLUMNS: &str = "id, first, last, count, interval_ms, min, max, last_number, sum, good";

pub(super) fn write(connection: &mut Connection, writes: &[(RobotName, Write)]) -> Result<(), StoreError> {
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
    for (robot, write) in writes {
        if write.replace_tail {
            transaction.prepare_cached("DELETE FROM tail WHERE robot = ?1")?.execute([robot.as_str()])?;
        }
        for (address, chunk) in &write.chunks {
            let signal = signal(&transaction, robot, *address)?;
            let Summary { first, last, count, interval, range, last_number, sum, good } = &chunk.summary;
            let crc = chunk.bytes.last_chunk::<4>().copied().unwrap_or_default();
            transaction
                .prepare_cached(
                    "INSERT OR IGNORE INTO chunk (signal, first, last, count, interval_ms, min, max,
                     last_number, sum, good, bytes, crc)
                     VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12)",
                )?
                .execute(params![
                    signal,
                    first.0,
                    last.0,
                    count,
                    interval.millis(),
                    range.map(|range| range.0),
                    range.map(|range| range.1),
                    last_number,
                    sum,
                    good,
                    chunk.bytes,
                    crc
                ])?;
        }
        if let Some(tail) = &write.tail {
            transaction
                .prepare_cached("INSERT INTO tail (robot, bytes) VALUES (?1, ?2)")?
                .execute(params![robot.as_str(), tail])?;
        }
        if !write.events.is_empty() {
            transaction.execute_batch(EVENT_TABLE)?;
        }
        for event in &write.events {
            let (text, crc) = event.encode();
            transaction
                .prepare_cached(
                    "INSERT OR IGNORE INTO event (robot, time, text, crc) VALUES (?1, ?2, ?3, ?4)",
                )?
                .execute(params![robot.as_str(), event.time.0, text, crc])?;
        }
    }
    transaction.commit()?;
    Ok(())
}

pub(super) fn signal(
    transaction: &Transaction<'_>,
    robot: &RobotName,
    address: Address,
) -> Result<i64, StoreError> {
    if let Some(id) = find(transaction, robot, address)? {
        return Ok(id);
    }
    transaction.execute(
        "INSERT INTO signal (robot, address) VALUES (?1, ?2)",
        params![robot.as_str(), address.to_string()],
    )?;
    Ok(transaction.last_insert_rowid())
}

pub(super) fn find(
    connection: &Connection,
    robot: &RobotName,
    address: Address,
) -> Result<Option<i64>, StoreError> {
    let mut select = connection.prepare_cached("SELECT id FROM signal WHERE robot = ?1 AND address = ?2")?;
    let id = select.query_row(params![robot.as_str(), address.to_string()], |row| row.get(0));
    Ok(id.optional()?)
}

/// The signals of which a file has chunks or had some. A name that no robot can have is left out.
pub(super) fn signals(connection: &Connection) -> Result<Vec<(RobotName, Address)>, StoreError> {
    let mut select = connection.prepare_cached("SELECT robot, address FROM signal ORDER BY robot, id")?;
    let rows = select.query_map([], |row| Ok((row.get::<_, String>(0)?, row.get::<_, String>(1)?)))?;
    let mut signals = Vec::new();
    for row in rows {
        let (robot, address) = row?;
        signals.extend(RobotName::new(&robot).zip(Address::parse(&address).ok()));
    }
    Ok(signals)
}

pub(super) fn tails(connection: &Connection, part: Part) -> Result<Vec<Tail>, StoreError> {
    let mut select = connection.prepare_cached("SELECT robot, bytes FROM tail ORDER BY robot, id")?;
    let rows = select.query_map([], |row| Ok((row.get::<_, String>(0)?, row.get::<_, Vec<u8>>(1)?)))?;
    let mut tails: Vec<Tail> = Vec::new();
    for row in rows {
        let (robot, bytes) = row?;
        let robot = RobotName::new(&robot)
            .ok_or_else(|| StoreError::Unreadable(format!("the robot `{robot}` of a tail")))?;
        match tails.last_mut() {
            Some(tail) if tail.robot == robot => tail.rows.push(bytes),
            _ => tails.push(Tail { part, robot, rows: vec![bytes] }),
        }
    }
    Ok(tails)
}

pub(super) fn entries(
    connection: &Connection,
    part: Part,
    ask: Ask<'_>,
    most: usize,
) -> Result<Vec<Entry>, StoreError> {
    let Some(signal) = find(connection, ask.robot, ask.address)? else { return Ok(Vec::new()) };
    let mut select = connection.prepare_cached(&format!(
        "SELECT {COLUMNS} FROM chunk WHERE signal = ?1 AND first >= ?2 AND first < ?3
         ORDER BY first, id LIMIT ?4"
    ))?;
    let rows = select.query_map(params![signal, ask.from.0, ask.to.0, most], |row| entry(part, row))?;
    Ok(rows.collect::<Result<_, _>>()?)
}

pub(super) fn last_entry(
    connection: &Connection,
    part: Part,
    ask: Ask<'_>,
) -> Result<Option<Entry>, StoreError> {
    let Some(signal) = find(connection, ask.robot, ask.address)? else { return Ok(None) };
    let mut select = connection.prepare_cached(&format!(
        "SELECT {COLUMNS} FROM chunk WHERE signal = ?1 AND first >= ?2 AND first < ?3
         ORDER BY last DESC LIMIT 1"
    ))?;
    Ok(select.query_row(params![signal, ask.from.0, ask.to.0], |row| entry(part, row)).optional()?)
}

fn entry(part: Part, row: &Row<'_>) -> rusqlite::Result<Entry> {
    let interval: u32 = row.get(4)?;
    let min: Option<f64> = row.get(5)?;
    let summary = Summary {
        first: Micros(row.get(1)?),
        last: Micros(row.get(2)?),
        count: row.get(3)?,
        interval: Interval::of_millis(interval).unwrap_or(Interval::USUAL),
        range: min.zip(row.get(6)?),
        last_number: row.get(7)?,
        // Not a number is kept as NULL.
        sum: row.get::<_, Option<f64>>(8)?.unwrap_or(f64::NAN),
        good: row.get(9)?,
    };
    Ok(Entry { part, row: row.get(0)?, summary })
}

pub(super) fn events(
    connection: &Connection,
    part: Part,
    ask: AskEvents<'_>,
    most: usize,
) -> Result<Vec<KeptEvent>, StoreError> {
    let mut table = connection.prepare_cached("SELECT 1 FROM sqlite_schema WHERE name = 'event'")?;
    if !table.exists([])? {
        return Ok(Vec::new());
    }
    let AskEvents { robot, after: (time, row), to } = ask;
    // The first comparison lets the index find the begin.
    let mut select = connection.prepare_cached(
        "SELECT id, time, text, crc FROM event
         WHERE robot = ?1 AND time >= ?2 AND (time > ?2 OR id > ?3) AND time < ?4 ORDER BY time, id LIMIT ?5",
    )?;
    let rows = select.query_map(params![robot.as_str(), time.0, row, to.0, most], |row| {
        let (time, text, crc) = (Micros(row.get(1)?), row.get::<_, String>(2)?, row.get(3)?);
        Ok(KeptEvent { part, row: row.get(0)?, time, event: Event::decode(time, &text, crc) })
    })?;
    Ok(rows.collect::<Result<_, _>>()?)
}

pub(super) fn last_seen(connection: &Connection) -> Result<Vec<(RobotName, Micros)>, StoreError> {
    // The index gives the newest chunk of each signal.
    let mut select = connection.prepare_cached(
        "SELECT robot, MAX((SELECT last FROM chunk WHERE signal = signal.id ORDER BY first DESC LIMIT 1))
         FROM signal GROUP BY robot",
    )?;
    let rows = select.query_map([], |row| Ok((row.get::<_, String>(0)?, row.get::<_, Option<i64>>(1)?)))?;
    let mut seen = Vec::new();
    for row in rows {
        let (robot, last) = row?;
        seen.extend(RobotName::new(&robot).zip(last.map(Micros)));
    }
    Ok(seen)
}

pub(super) fn bytes(connection: &Connection, rows: &[i64]) -> Result<Vec<Option<Vec<u8>>>, StoreError> {
    let mut select = connection.prepare_cached("SELECT bytes FROM chunk WHERE id = ?1")?;
    let bytes = rows.iter().map(|row| -> Result<Option<Vec<u8>>, StoreError> {
        Ok(select.query_row([row], |row| row.get(0)).optional()?)
    });
    bytes.collect()
}
