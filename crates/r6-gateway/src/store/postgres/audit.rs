//! The audit log, its ends and its signed heads.

use r6_api::gateway::AuditRecord;
use tokio_postgres::Client;

use super::{signed, unsigned};
use crate::core::chain::{Broken, Hash, link};
use crate::core::retention::BATCH;
use crate::store::{Ends, Entry, Heads, MAX_PAGE, StoreError, body};

/// Appends within a transaction. Returns the number of the first entry.
pub async fn append(client: &Client, records: &[AuditRecord]) -> Result<u64, StoreError> {
    let (last, mut head) = last(client).await?;
    let (mut numbers, mut bodies, mut hashes) = (Vec::new(), Vec::new(), Vec::new());
    let (mut whats, mut robots, mut intents) = (Vec::new(), Vec::new(), Vec::new());
    for (number, record) in (last + 1..).zip(records) {
        let body = body(record)?;
        head = link(head, number, &body);
        let told = Told::of(&body)?;
        numbers.push(signed(number));
        hashes.push(head.bytes().to_vec());
        bodies.push(body);
        whats.push(told.what);
        robots.push(told.robot);
        intents.push(told.intent);
    }
    if !numbers.is_empty() {
        client
            .execute(
                "INSERT INTO audit (number, body, hash, what, robot, intent) SELECT * FROM
                 unnest($1::bigint[], $2::text[], $3::bytea[], $4::text[], $5::text[], $6::bigint[])",
                &[&numbers, &bodies, &hashes, &whats, &robots, &intents],
            )
            .await?;
    }
    Ok(last + 1)
}

/// What is looked for in the log, as the text of an entry tells it.
struct Told {
    what: Option<String>,
    robot: Option<String>,
    intent: Option<i64>,
}

impl Told {
    fn of(body: &str) -> Result<Self, StoreError> {
        let body: serde_json::Value =
            serde_json::from_str(body).map_err(|error| StoreError::Unreadable(error.to_string()))?;
        let word = |key: &str| body.get(key).and_then(|value| value.as_str()).map(super::plain);
        let intent = body.get("intent").and_then(serde_json::Value::as_i64);
        Ok(Self { what: word("what"), robot: word("robot"), intent })
    }
}

/// The number and the hash of the newest entry; 0 without one.
pub async fn last(client: &Client) -> Result<(u64, Hash), StoreError> {
    let row = client.query_opt("SELECT number, hash FROM audit ORDER BY number DESC LIMIT 1", &[]).await?;
    let Some(row) = row else { return Ok((0, Hash::ORIGIN)) };
    let number = unsigned(row.try_get(0)?);
    Ok((number, hash(number, row.try_get(1)?)?))
}

fn hash(number: u64, bytes: &[u8]) -> Result<Hash, StoreError> {
    Hash::of_bytes(bytes).ok_or(StoreError::Broken(Broken::Changed { number }))
}

/// Entries after a number.
pub async fn entries(client: &Client, after: u64, most: usize) -> Result<Vec<Entry>, StoreError> {
    let most = i64::try_from(most.min(MAX_PAGE)).unwrap_or(i64::MAX);
    let rows = client
        .query(
            "SELECT number, body, hash FROM audit WHERE number > $1 ORDER BY number LIMIT $2",
            &[&signed(after), &most],
        )
        .await?;
    rows.iter()
        .map(|row| {
            let number = unsigned(row.try_get(0)?);
            Ok(Entry { number, body: row.try_get(1)?, hash: hash(number, row.try_get(2)?)? })
        })
        .collect()
}

/// The commands without an outcome.
pub async fn open_intents(client: &Client) -> Result<Vec<(u64, Option<String>)>, StoreError> {
    let rows = client
        .query(
            "SELECT number, robot FROM audit AS it WHERE what = 'command_intent'
             AND NOT EXISTS (SELECT 1 FROM audit WHERE intent = it.number) ORDER BY number",
            &[],
        )
        .await?;
    rows.iter().map(|row| Ok((unsigned(row.try_get(0)?), row.try_get(1)?))).collect()
}

/// The ends of the log.
pub async fn ends(client: &Client) -> Result<Ends, StoreError> {
    let (last, hash) = last(client).await?;
    let first: i64 = client.query_one("SELECT coalesce(min(number), 0) FROM audit", &[]).await?.try_get(0)?;
    let before = first.saturating_add(signed(BATCH));
    let open: Option<i64> = client
        .query_one(
            "SELECT min(number) FROM audit AS it WHERE what = 'command_intent' AND number < $1
             AND NOT EXISTS (SELECT 1 FROM audit WHERE intent = it.number)",
            &[&before],
        )
        .await?
        .try_get(0)?;
    Ok(Ends { first: unsigned(first), last, hash, open: open.map(unsigned) })
}

/// The signed heads.
pub async fn heads(client: &Client) -> Result<Heads, StoreError> {
    let mut heads = Heads::default();
    for row in client.query("SELECT what, text FROM audit_head", &[]).await? {
        let text = Some(row.try_get(1)?);
        match row.try_get(0)? {
            "key" => heads.key = text,
            "end" => heads.end = text,
            _ => heads.cut = text,
        }
    }
    Ok(heads)
}

/// Puts a signed head or the key in the place of the one before.
pub async fn put(client: &Client, what: &str, text: &str) -> Result<(), StoreError> {
    client
        .execute(
            "INSERT INTO audit_head (what, text) VALUES ($1, $2)
             ON CONFLICT (what) DO UPDATE SET text = excluded.text",
            &[&what, &text],
        )
        .await?;
    Ok(())
}

/// Puts another key and what it signed in the place of the one before.
pub async fn put_key(client: &Client, key: &str, cut: Option<&str>) -> Result<(), StoreError> {
    put(client, "key", key).await?;
    client.execute("DELETE FROM audit_head WHERE what = 'end'", &[]).await?;
    match cut {
        Some(note) => put(client, "cut", note).await,
        None => Ok(()),
    }
}

/// Removes the oldest entries and puts the head of the last one of them.
pub async fn cut(client: &Client, until: u64, note: &str) -> Result<(), StoreError> {
    if until < last(client).await?.0 {
        client.execute("DELETE FROM audit WHERE number <= $1", &[&signed(until)]).await?;
        put(client, "cut", note).await?;
    }
    Ok(())
}
