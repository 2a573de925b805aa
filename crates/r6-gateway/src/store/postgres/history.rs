//! The history in the database: a partition of each table for each part of a day.
//!
//! What is written comes by binary COPY into tables of the session, and from there into the partitions, so
//! that a chunk or an event that is there already stays once. A part is removed as a whole: its partitions
//! are detached and dropped.

use std::collections::{BTreeMap, BTreeSet};
use std::pin::pin;

use r6_proto::Address;
use sha2::{Digest, Sha256};
use tokio_postgres::binary_copy::BinaryCopyInWriter;
use tokio_postgres::types::{ToSql, Type};
use tokio_postgres::{Client, Row};

use super::Database;
use super::session::{Durable, Hand, Lock, Session};
use crate::core::history::block::{Summary, Write};
use crate::core::history::event::Event;
use crate::core::history::sample::{Interval, Micros};
use crate::core::name::RobotName;
use crate::core::owner::{Claim, Owned};
use crate::store::StoreError;
use crate::store::history::{Ask, AskEvents, Entry, HistoryStore, KeptEvent, Part, Tail};

/// The tables with partitions.
const TABLES: [&str; 3] = ["chunk", "tail", "event"];

/// Where the rows of one write come first. They are empty again at the end of the transaction.
const STAGES: &str = "
CREATE TEMPORARY TABLE IF NOT EXISTS new_chunk (
    n bigint, robot text, address text, first bigint, last bigint, count bigint, interval_ms bigint,
    min double precision, max double precision, last_number double precision, sum double precision,
    good bigint, bytes bytea, crc bytea
) ON COMMIT DELETE ROWS;
CREATE TEMPORARY TABLE IF NOT EXISTS new_tail (n bigint, robot text, bytes bytea) ON COMMIT DELETE ROWS;
CREATE TEMPORARY TABLE IF NOT EXISTS new_event (
    n bigint, robot text, time bigint, text text, crc bigint, hash bytea
) ON COMMIT DELETE ROWS;
";

const CHUNK: [Type; 14] = [
    Type::INT8,
    Type::TEXT,
    Type::TEXT,
    Type::INT8,
    Type::INT8,
    Type::INT8,
    Type::INT8,
    Type::FLOAT8,
    Type::FLOAT8,
    Type::FLOAT8,
    Type::FLOAT8,
    Type::INT8,
    Type::BYTEA,
    Type::BYTEA,
];
const TAIL: [Type; 3] = [Type::INT8, Type::TEXT, Type::BYTEA];
const EVENT: [Type; 6] = [Type::INT8, Type::TEXT, Type::INT8, Type::TEXT, Type::INT8, Type::BYTEA];

const COLUMNS: &str = "id, first, last, count, interval_ms, min, max, last_number, sum, good";

/// The history in a database.
#[derive(Debug)]
pub struct PostgresDays {
    session: Session,
    hand: Hand,
    /// What this gateway owns.
    claims: BTreeMap<Owned, u64>,
    /// The parts that writes go to, by day, if they are not the newest that is there.
    begun: BTreeMap<i64, u32>,
    /// The parts that this session knows to be there.
    known: BTreeSet<Part>,
}

impl PostgresDays {
    /// The history of a database. It connects when it is used: a server that is away may come back.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn new(database: &Database, hand: Hand) -> Result<Self, StoreError> {
        let session = Session::new(database.clone(), hand, Durable::Soon)?;
        let (claims, begun, known) = (BTreeMap::new(), BTreeMap::new(), BTreeSet::new());
        Ok(Self { session, hand, claims, begun, known })
    }

    /// The claims of these robots, and the part of the writes that is about robots which this gateway owns:
    /// what it still has of others is theirs to write.
    fn owned(&self, writes: &[(RobotName, Write)]) -> (Vec<Claim>, Vec<(RobotName, Write)>) {
        if !matches!(self.hand, Hand::Gateway(_)) {
            return (Vec::new(), writes.to_vec());
        }
        let (mut claims, mut owned) = (Vec::new(), Vec::new());
        for (robot, write) in writes {
            let of = Owned::Robot(robot.clone());
            if let Some(fence) = self.claims.get(&of) {
                claims.push(Claim { of, fence: *fence });
                owned.push((robot.clone(), write.clone()));
            }
        }
        (claims, owned)
    }

    /// Forgets claims that hold no more.
    fn check_claims(&mut self) -> Result<(), StoreError> {
        let held = self.session.read(async |client| {
            let rows = client.query("SELECT robot, fence FROM owner", &[]).await?;
            let mut held = BTreeMap::new();
            for row in &rows {
                held.extend(Owned::of_text(row.try_get(0)?).zip(Some(super::unsigned(row.try_get(1)?))));
            }
            Ok(held)
        })?;
        self.claims.retain(|owned, fence| held.get(owned) == Some(fence));
        Ok(())
    }

    /// Makes a part, if it is not known to be there.
    fn make_part(&mut self, part: Part, claims: &[Claim]) -> Result<(), StoreError> {
        if self.known.contains(&part) {
            return Ok(());
        }
        self.session.write(claims, Lock::Partitions, async |client| make(client, part).await)?;
        self.known.insert(part);
        Ok(())
    }

    fn newest(&mut self, day: i64) -> Result<u32, StoreError> {
        if let Some(begun) = self.begun.get(&day) {
            return Ok(*begun);
        }
        let parts = self.parts()?;
        Ok(parts.iter().filter(|(part, _)| part.day == day).map(|(part, _)| part.number).max().unwrap_or(1))
    }
}

impl HistoryStore for PostgresDays {
    fn write(&mut self, day: i64, writes: &[(RobotName, Write)]) -> Result<(), StoreError> {
        let number = self.newest(day)?;
        self.begun.retain(|begun, _| *begun >= day - 1);
        self.begun.insert(day, number);
        self.write_part(Part { day, number }, writes)
    }

    fn write_part(&mut self, part: Part, writes: &[(RobotName, Write)]) -> Result<(), StoreError> {
        loop {
            let (claims, owned) = self.owned(writes);
            if owned.is_empty() {
                return Ok(());
            }
            let made = self.make_part(part, &claims);
            let written = made.and_then(|()| {
                self.session.write(&claims, Lock::History, async |client| write(client, part, &owned).await)
            });
            match written {
                Err(StoreError::NotOwner) => {
                    // Another gateway has one of them by now. The others are written all the same.
                    let before = self.claims.len();
                    self.check_claims()?;
                    if self.claims.len() == before {
                        return written;
                    }
                }
                // Somebody may have dropped it.
                Err(_) => {
                    self.known.remove(&part);
                    return written;
                }
                Ok(()) => return written,
            }
        }
    }

    fn begin_part(&mut self, day: i64) -> Result<(), StoreError> {
        let number = self.newest(day)? + 1;
        self.begun.insert(day, number);
        Ok(())
    }

    fn hold(&mut self, claims: &[Claim]) {
        self.claims.extend(claims.iter().map(|claim| (claim.of.clone(), claim.fence)));
    }

    fn may_remove(&self) -> bool {
        !matches!(self.hand, Hand::Gateway(_)) || self.claims.contains_key(&Owned::Hall)
    }

    fn is_behind(&self, newest: Part) -> bool {
        self.begun.get(&newest.day).is_some_and(|begun| *begun < newest.number)
    }

    fn tails(&mut self, part: Part) -> Result<Vec<Tail>, StoreError> {
        self.session.read(async |client| {
            let rows = client
                .query(
                    "SELECT robot, bytes FROM tail WHERE day = $1 AND part = $2 ORDER BY robot, id",
                    &[&part.day, &i64::from(part.number)],
                )
                .await?;
            let mut tails: Vec<Tail> = Vec::new();
            for row in &rows {
                let (robot, bytes): (&str, Vec<u8>) = (row.try_get(0)?, row.try_get(1)?);
                let robot = RobotName::new(robot)
                    .ok_or_else(|| StoreError::Unreadable(format!("the robot `{robot}` of a tail")))?;
                match tails.last_mut() {
                    Some(tail) if tail.robot == robot => tail.rows.push(bytes),
                    _ => tails.push(Tail { part, robot, rows: vec![bytes] }),
                }
            }
            Ok(tails)
        })
    }

    fn entries(&mut self, part: Part, ask: Ask<'_>, most: usize) -> Result<Vec<Entry>, StoreError> {
        let most = i64::try_from(most).unwrap_or(i64::MAX);
        self.session.read(async |client| {
            let Some(signal) = find(client, ask.robot, ask.address).await? else { return Ok(Vec::new()) };
            let text = format!(
                "SELECT {COLUMNS} FROM chunk WHERE day = $1 AND part = $2 AND signal = $3 AND first >= $4
                 AND first < $5 ORDER BY first, id LIMIT $6"
            );
            let number = i64::from(part.number);
            let rows =
                client.query(&text, &[&part.day, &number, &signal, &ask.from.0, &ask.to.0, &most]).await?;
            rows.iter().map(|row| entry(part, row)).collect()
        })
    }

    fn last_entry(&mut self, part: Part, ask: Ask<'_>) -> Result<Option<Entry>, StoreError> {
        self.session.read(async |client| {
            let Some(signal) = find(client, ask.robot, ask.address).await? else { return Ok(None) };
            let text = format!(
                "SELECT {COLUMNS} FROM chunk WHERE day = $1 AND part = $2 AND signal = $3 AND first >= $4
                 AND first < $5 ORDER BY last DESC LIMIT 1"
            );
            let number = i64::from(part.number);
            let row = client.query_opt(&text, &[&part.day, &number, &signal, &ask.from.0, &ask.to.0]).await?;
            row.as_ref().map(|row| entry(part, row)).transpose()
        })
    }

    fn bytes(&mut self, part: Part, rows: &[i64]) -> Result<Vec<Option<Vec<u8>>>, StoreError> {
        self.session.read(async |client| {
            let found = client
                .query(
                    "SELECT id, bytes FROM chunk WHERE day = $1 AND part = $2 AND id = ANY($3)",
                    &[&part.day, &i64::from(part.number), &rows],
                )
                .await?;
            let mut bytes = BTreeMap::new();
            for row in &found {
                bytes.insert(row.try_get::<_, i64>(0)?, row.try_get::<_, Vec<u8>>(1)?);
            }
            Ok(rows.iter().map(|row| bytes.get(row).cloned()).collect())
        })
    }

    fn events(&mut self, part: Part, ask: AskEvents<'_>, most: usize) -> Result<Vec<KeptEvent>, StoreError> {
        let AskEvents { robot, after: (time, row), to } = ask;
        let most = i64::try_from(most).unwrap_or(i64::MAX);
        self.session.read(async |client| {
            // The first comparison lets the index find the begin.
            let rows = client
                .query(
                    "SELECT id, time, text, crc FROM event WHERE day = $1 AND part = $2 AND robot = $3
                     AND time >= $4 AND (time > $4 OR id > $5) AND time < $6 ORDER BY time, id LIMIT $7",
                    &[&part.day, &i64::from(part.number), &robot.as_str(), &time.0, &row, &to.0, &most],
                )
                .await?;
            rows.iter()
                .map(|row| {
                    let (time, text) = (Micros(row.try_get(1)?), row.try_get(2)?);
                    let crc = u32::try_from(row.try_get::<_, i64>(3)?).ok();
                    let event = crc.and_then(|crc| Event::decode(time, text, crc));
                    Ok(KeptEvent { part, row: row.try_get(0)?, time, event })
                })
                .collect()
        })
    }

    fn last_seen(&mut self, part: Part) -> Result<Vec<(RobotName, Micros)>, StoreError> {
        self.session.read(async |client| {
            // The index gives the newest chunk of each signal.
            let rows = client
                .query(
                    "SELECT robot, max((SELECT last FROM chunk WHERE day = $1 AND part = $2
                     AND signal = signal.id ORDER BY first DESC LIMIT 1)) FROM signal GROUP BY robot",
                    &[&part.day, &i64::from(part.number)],
                )
                .await?;
            let mut seen = Vec::new();
            for row in &rows {
                let last: Option<i64> = row.try_get(1)?;
                seen.extend(RobotName::new(row.try_get(0)?).zip(last.map(Micros)));
            }
            Ok(seen)
        })
    }

    fn parts(&mut self) -> Result<Vec<(Part, u64)>, StoreError> {
        self.session.read(async |client| {
            // A reader that has no right to see the schema is told so, and not that there is nothing.
            let rows = client
                .query(
                    "SELECT child.relname, (SELECT sum(pg_total_relation_size(same.oid))::bigint
                     FROM unnest($1::text[]) AS name
                     JOIN pg_class AS same ON same.relname = name || substr(child.relname, 6)
                     AND same.relnamespace = child.relnamespace)
                     FROM pg_inherits JOIN pg_class AS child ON child.oid = inhrelid
                     WHERE inhparent = 'chunk'::regclass",
                    &[&TABLES.as_slice()],
                )
                .await?;
            let mut parts = Vec::new();
            for row in &rows {
                let size: Option<i64> = row.try_get(1)?;
                parts.extend(part_of(row.try_get(0)?).map(|part| (part, super::unsigned(size.unwrap_or(0)))));
            }
            parts.sort_unstable();
            Ok(parts)
        })
    }

    /// A gateway does not see the disk of the server.
    fn free_bytes(&mut self) -> Option<u64> {
        None
    }

    fn remove(&mut self, part: Part) -> Result<(), StoreError> {
        self.known.remove(&part);
        let hall = self.claims.get(&Owned::Hall).map(|fence| Claim { of: Owned::Hall, fence: *fence });
        let claims: Vec<_> = hall.into_iter().collect();
        self.session.write(&claims, Lock::Partitions, async |client| {
            for table in TABLES {
                let name = partition(table, part);
                let is_attached = client
                    .query_one(
                        "SELECT EXISTS (SELECT 1 FROM pg_inherits WHERE inhrelid = to_regclass($1))",
                        &[&name],
                    )
                    .await?;
                if is_attached.try_get(0)? {
                    client.batch_execute(&format!("ALTER TABLE {table} DETACH PARTITION {name}")).await?;
                }
                client.batch_execute(&format!("DROP TABLE IF EXISTS {name}")).await?;
            }
            Ok(())
        })
    }
}

/// The name of a partition, such as `chunk_20782_1`: the days since 1970, and the number of the part.
fn partition(table: &str, part: Part) -> String {
    // Days before 1970 come of a wrong clock alone.
    let day = if part.day < 0 { format!("m{}", part.day.unsigned_abs()) } else { part.day.to_string() };
    format!("{table}_{day}_{}", part.number)
}

fn part_of(name: &str) -> Option<Part> {
    let (day, number) = name.strip_prefix("chunk_")?.split_once('_')?;
    let day = match day.strip_prefix('m') {
        Some(before) => before.parse::<i64>().ok()?.checked_neg()?,
        None => day.parse().ok()?,
    };
    Some(Part { day, number: number.parse().ok()? })
}

/// Makes the partitions of a part that are missing.
async fn make(client: &Client, part: Part) -> Result<(), StoreError> {
    let Part { day, number } = part;
    let next = u64::from(number) + 1;
    for table in TABLES {
        let name = partition(table, part);
        client
            .batch_execute(&format!(
                "CREATE TABLE IF NOT EXISTS {name} PARTITION OF {table}
                 FOR VALUES FROM ({day}, {number}) TO ({day}, {next})"
            ))
            .await?;
    }
    Ok(())
}

async fn write(client: &Client, part: Part, writes: &[(RobotName, Write)]) -> Result<(), StoreError> {
    let (day, number) = (part.day, i64::from(part.number));
    let replaced = writes.iter().filter(|(_, write)| write.replace_tail);
    let replaced: Vec<_> = replaced.map(|(robot, _)| robot.as_str()).collect();
    if !replaced.is_empty() {
        client
            .execute(
                "DELETE FROM tail WHERE day = $1 AND part = $2 AND robot = ANY($3)",
                &[&day, &number, &replaced],
            )
            .await?;
    }
    client.batch_execute(STAGES).await?;
    if writes.iter().any(|(_, write)| !write.chunks.is_empty()) {
        copy_chunks(client, writes).await?;
        client
            .batch_execute(&format!(
                "INSERT INTO signal (robot, address) SELECT DISTINCT robot, address FROM new_chunk
                 ON CONFLICT DO NOTHING;
                 INSERT INTO chunk (day, part, signal, first, last, count, interval_ms, min, max,
                 last_number, sum, good, bytes, crc)
                 SELECT {day}, {number}, signal.id, first, last, count, interval_ms, min, max, last_number,
                 sum, good, bytes, crc FROM new_chunk JOIN signal USING (robot, address) ORDER BY n
                 ON CONFLICT DO NOTHING"
            ))
            .await?;
    }
    if writes.iter().any(|(_, write)| write.tail.is_some()) {
        copy_tails(client, writes).await?;
        client
            .batch_execute(&format!(
                "INSERT INTO tail (day, part, robot, bytes)
                 SELECT {day}, {number}, robot, bytes FROM new_tail ORDER BY n"
            ))
            .await?;
    }
    if writes.iter().any(|(_, write)| !write.events.is_empty()) {
        copy_events(client, writes).await?;
        client
            .batch_execute(&format!(
                "INSERT INTO event (day, part, robot, time, text, crc, hash)
                 SELECT {day}, {number}, robot, time, text, crc, hash FROM new_event ORDER BY n
                 ON CONFLICT DO NOTHING"
            ))
            .await?;
    }
    Ok(())
}

async fn copy_chunks(client: &Client, writes: &[(RobotName, Write)]) -> Result<(), StoreError> {
    let sink = client.copy_in("COPY new_chunk FROM STDIN (FORMAT binary)").await?;
    let mut copy = pin!(BinaryCopyInWriter::new(sink, &CHUNK));
    let mut n = 0_i64;
    for (robot, write) in writes {
        for (address, chunk) in &write.chunks {
            let Summary { first, last, count, interval, range, last_number, sum, good } = &chunk.summary;
            let crc = chunk.bytes.last_chunk::<4>().copied().unwrap_or_default();
            let row: [&(dyn ToSql + Sync); 14] = [
                &n,
                &robot.as_str(),
                &address.to_string(),
                &first.0,
                &last.0,
                &i64::from(*count),
                &i64::from(interval.millis()),
                &range.map(|range| range.0),
                &range.map(|range| range.1),
                last_number,
                sum,
                good,
                &chunk.bytes,
                &crc.as_slice(),
            ];
            copy.as_mut().write(&row).await?;
            n += 1;
        }
    }
    copy.finish().await?;
    Ok(())
}

async fn copy_tails(client: &Client, writes: &[(RobotName, Write)]) -> Result<(), StoreError> {
    let sink = client.copy_in("COPY new_tail FROM STDIN (FORMAT binary)").await?;
    let mut copy = pin!(BinaryCopyInWriter::new(sink, &TAIL));
    for (n, (robot, write)) in (0_i64..).zip(writes) {
        if let Some(tail) = &write.tail {
            copy.as_mut().write(&[&n, &robot.as_str(), tail]).await?;
        }
    }
    copy.finish().await?;
    Ok(())
}

async fn copy_events(client: &Client, writes: &[(RobotName, Write)]) -> Result<(), StoreError> {
    let sink = client.copy_in("COPY new_event FROM STDIN (FORMAT binary)").await?;
    let mut copy = pin!(BinaryCopyInWriter::new(sink, &EVENT));
    let events =
        writes.iter().flat_map(|(robot, write)| write.events.iter().map(move |event| (robot, event)));
    for (n, (robot, event)) in (0_i64..).zip(events) {
        let (text, crc) = event.encode();
        let hash = Sha256::digest(text.as_bytes()).to_vec();
        let row: [&(dyn ToSql + Sync); 6] =
            [&n, &robot.as_str(), &event.time.0, &text, &i64::from(crc), &hash];
        copy.as_mut().write(&row).await?;
    }
    copy.finish().await?;
    Ok(())
}

async fn find(client: &Client, robot: &RobotName, address: Address) -> Result<Option<i64>, StoreError> {
    let row = client
        .query_opt(
            "SELECT id FROM signal WHERE robot = $1 AND address = $2",
            &[&robot.as_str(), &address.to_string()],
        )
        .await?;
    Ok(row.map(|row| row.try_get(0)).transpose()?)
}

fn entry(part: Part, row: &Row) -> Result<Entry, StoreError> {
    let interval = u32::try_from(row.try_get::<_, i64>(4)?).ok();
    let (min, max): (Option<f64>, Option<f64>) = (row.try_get(5)?, row.try_get(6)?);
    let summary = Summary {
        first: Micros(row.try_get(1)?),
        last: Micros(row.try_get(2)?),
        count: u32::try_from(row.try_get::<_, i64>(3)?).unwrap_or(u32::MAX),
        interval: interval.and_then(Interval::of_millis).unwrap_or(Interval::USUAL),
        range: min.zip(max),
        last_number: row.try_get(7)?,
        sum: row.try_get(8)?,
        good: row.try_get(9)?,
    };
    Ok(Entry { part, row: row.try_get(0)?, summary })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_partitions_tell_their_part() {
        for part in [(0, 1), (20_782, 12), (-3, 2)].map(|(day, number)| Part { day, number }) {
            assert_eq!(part_of(&partition("chunk", part)), Some(part));
        }
        for other in ["chunk", "chunk_x_1", "chunk_1", "tail_1_1", "chunk_1_1_key"] {
            assert_eq!(part_of(other), None, "{other}");
        }
    }
}
