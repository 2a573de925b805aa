//! The runs in the table.

use r6_api::gateway::{AuditRecord, Run};
use tokio_postgres::{Client, Row};

use super::audit::append;
use super::{signed, unsigned};
use crate::core::name::RobotName;
use crate::store::StoreError;
use crate::store::runs::{Begun, KEPT, KeptRun, MAX_RUNS, MAX_RUNS_OF_ONE, NewRun, of_text, to_text};

const COLUMNS: &str = "id, hash, run, answer, ended";

fn kept(row: &Row) -> Result<KeptRun, StoreError> {
    let id = unsigned(row.try_get(0)?);
    let hash = <[u8; 32]>::try_from(row.try_get::<_, &[u8]>(1)?);
    let hash = hash.map_err(|_| StoreError::Unreadable(format!("run {id}")))?;
    // The number of the row counts: the text was written before it was known.
    let run = Run { run_id: id, ..of_text(id, row.try_get(2)?)? };
    Ok(KeptRun { hash, run, answer: row.try_get(3)?, ended: row.try_get(4)? })
}

/// Adds a run and its record, if its key is new.
pub async fn begin(client: &Client, new: &NewRun) -> Result<Begun, StoreError> {
    let oldest = signed(new.now.saturating_sub(KEPT));
    client.execute("DELETE FROM run WHERE made < $1 AND ended AND NOT owed", &[&oldest]).await?;
    if let Some(known) = by_key(client, &new.caller, &new.key, 0).await? {
        return Ok(Begun::Known(Box::new(known)));
    }
    let robot = new.robot.as_str();
    let counts =
        client.query_one("SELECT count(*), count(*) FILTER (WHERE robot = $1) FROM run", &[&robot]).await?;
    let of = |at| counts.try_get::<_, i64>(at).map(|count| usize::try_from(count).unwrap_or(usize::MAX));
    if of(0)? >= MAX_RUNS || of(1)? >= MAX_RUNS_OF_ONE {
        return Ok(Begun::Full);
    }
    let row = client
        .query_one(
            "INSERT INTO run (robot, caller, key, hash, made, run, ended, owed)
             VALUES ($1, $2, $3, $4, $5, $6, false, true) RETURNING id",
            &[
                &robot,
                &super::plain(&new.caller),
                &super::plain(&new.key),
                &new.hash.as_slice(),
                &signed(new.now),
                &to_text(&new.run)?,
            ],
        )
        .await?;
    let id = unsigned(row.try_get(0)?);
    append(client, &[new.record(id)]).await?;
    Ok(Begun::New(id))
}

/// The run with this key of this caller, if it is not too old.
pub async fn by_key(
    client: &Client,
    caller: &str,
    key: &str,
    since: u64,
) -> Result<Option<KeptRun>, StoreError> {
    let text = format!(
        "SELECT {COLUMNS} FROM run WHERE caller = $1 AND key = $2 AND (made >= $3 OR NOT ended OR owed)"
    );
    let found = client.query_opt(&text, &[&super::plain(caller), &super::plain(key), &signed(since)]).await?;
    found.as_ref().map(kept).transpose()
}

/// The run with this number.
pub async fn one(client: &Client, robot: &RobotName, id: u64) -> Result<Option<KeptRun>, StoreError> {
    let text = format!("SELECT {COLUMNS} FROM run WHERE id = $1 AND robot = $2");
    let found = client.query_opt(&text, &[&signed(id), &robot.as_str()]).await?;
    found.as_ref().map(kept).transpose()
}

/// The runs of a robot before this number, the newest first.
pub async fn of_robot(
    client: &Client,
    robot: &RobotName,
    before: u64,
    most: usize,
) -> Result<Vec<Run>, StoreError> {
    let text = format!("SELECT {COLUMNS} FROM run WHERE robot = $1 AND id < $2 ORDER BY id DESC LIMIT $3");
    let most = i64::try_from(most).unwrap_or(i64::MAX);
    let rows = client.query(&text, &[&robot.as_str(), &signed(before), &most]).await?;
    rows.iter().map(|row| Ok(kept(row)?.run)).collect()
}

/// The runs that have not ended.
pub async fn open(client: &Client) -> Result<Vec<Run>, StoreError> {
    let text = format!("SELECT {COLUMNS} FROM run WHERE NOT ended ORDER BY id");
    client.query(&text, &[]).await?.iter().map(|row| Ok(kept(row)?.run)).collect()
}

/// Keeps the answer to the request for a run.
pub async fn answer(client: &Client, id: u64, answer: &str) -> Result<(), StoreError> {
    client.execute("UPDATE run SET answer = $2 WHERE id = $1", &[&signed(id), &answer]).await?;
    Ok(())
}

/// Keeps the end of a run, and appends its record.
pub async fn end(client: &Client, run: &Run, owed: bool, records: &[AuditRecord]) -> Result<(), StoreError> {
    client
        .execute(
            "UPDATE run SET run = $2, ended = true, owed = $3 WHERE id = $1",
            &[&signed(run.run_id), &to_text(run)?, &owed],
        )
        .await?;
    append(client, records).await?;
    Ok(())
}

/// The robots for which a stop is owed.
pub async fn owed(client: &Client) -> Result<Vec<RobotName>, StoreError> {
    let rows = client.query("SELECT DISTINCT robot FROM run WHERE owed ORDER BY robot", &[]).await?;
    rows.iter()
        .map(|row| {
            let name: &str = row.try_get(0)?;
            RobotName::new(name).ok_or_else(|| StoreError::Unreadable(format!("the robot `{name}`")))
        })
        .collect()
}

/// No stop is owed for this robot any more, except for a run under way.
pub async fn forget_owed_stop(client: &Client, robot: &RobotName) -> Result<(), StoreError> {
    client
        .execute("UPDATE run SET owed = false WHERE owed AND ended AND robot = $1", &[&robot.as_str()])
        .await?;
    Ok(())
}
