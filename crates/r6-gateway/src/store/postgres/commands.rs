//! The commands with a key in the table.

use r6_api::gateway::AuditRecord;
use tokio_postgres::{Client, Row};

use super::audit::append;
use super::{plain, signed, unsigned};
use crate::store::StoreError;
use crate::store::commands::{KEPT, KEPT_AT_LEAST, KeptCommand, MAX_KEYS, NewCommand, Noted};

fn kept(row: &Row) -> Result<KeptCommand, StoreError> {
    let intent = unsigned(row.try_get(0)?);
    let hash = <[u8; 32]>::try_from(row.try_get::<_, &[u8]>(1)?);
    let hash = hash.map_err(|_| StoreError::Unreadable(format!("the key of command {intent}")))?;
    Ok(KeptCommand { intent, hash, answer: row.try_get(2)?, ended: row.try_get(3)? })
}

/// Adds a command and its intent, if its key is new.
pub async fn begin(client: &Client, new: &NewCommand) -> Result<Noted, StoreError> {
    let oldest = signed(new.now.saturating_sub(KEPT));
    client.execute("DELETE FROM command WHERE made < $1", &[&oldest]).await?;
    if let Some(known) = by_key(client, &new.caller, &new.key, 0).await? {
        return Ok(Noted::Known(known));
    }
    let last: i64 = client.query_one("SELECT coalesce(max(id), 0) FROM command", &[]).await?.try_get(0)?;
    // With the new one there are as many as may be kept.
    let beyond = last.saturating_sub(signed(MAX_KEYS - 1));
    let certain = signed(new.now.saturating_sub(KEPT_AT_LEAST));
    let young = client
        .query_one("SELECT EXISTS (SELECT 1 FROM command WHERE id <= $1 AND made > $2)", &[&beyond, &certain])
        .await?;
    if young.try_get(0)? {
        return Ok(Noted::Full);
    }
    client.execute("DELETE FROM command WHERE id <= $1", &[&beyond]).await?;
    let intent = append(client, std::slice::from_ref(&new.intent)).await?;
    client
        .execute(
            "INSERT INTO command (intent, caller, key, hash, made) VALUES ($1, $2, $3, $4, $5)",
            &[&signed(intent), &plain(&new.caller), &plain(&new.key), &new.hash.as_slice(), &signed(new.now)],
        )
        .await?;
    Ok(Noted::New(intent))
}

/// The command with this key of this caller, if it is not too old.
pub async fn by_key(
    client: &Client,
    caller: &str,
    key: &str,
    since: u64,
) -> Result<Option<KeptCommand>, StoreError> {
    let found = client
        .query_opt(
            "SELECT intent, hash, answer,
             EXISTS (SELECT 1 FROM audit WHERE audit.intent = it.intent)
             OR NOT EXISTS (SELECT 1 FROM audit WHERE number = it.intent)
             FROM command AS it WHERE caller = $1 AND key = $2 AND made >= $3",
            &[&plain(caller), &plain(key), &signed(since)],
        )
        .await?;
    found.as_ref().map(kept).transpose()
}

/// Keeps the answer to the request for a command, and appends its record.
pub async fn end(client: &Client, intent: u64, answer: &str, record: &AuditRecord) -> Result<(), StoreError> {
    client
        .execute("UPDATE command SET answer = $2 WHERE intent = $1", &[&signed(intent), &plain(answer)])
        .await?;
    append(client, std::slice::from_ref(record)).await?;
    Ok(())
}
