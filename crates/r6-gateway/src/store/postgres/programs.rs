//! The programs in the table.

use r6_api::gateway::ProgramType;
use tokio_postgres::{Client, Row};

use super::audit::append;
use super::{plain, signed, unsigned, versions};
use crate::core::library::{Condition, MAX_VERSIONS, ProgramName};
use crate::store::versions::Named;
use crate::store::{Kept, LibraryError, NewVersion, StoreError};

/// All columns but the text.
const COLUMNS: &str = "name, version, hash, bytes, stored_at, stored_by, kind, ok, steps";

fn kept(row: &Row) -> Result<Kept, StoreError> {
    let name: &str = row.try_get(0)?;
    let unreadable = || StoreError::Unreadable(format!("the program `{name}`"));
    let name = ProgramName::new(name).ok_or_else(unreadable)?;
    Ok(Kept {
        tag: Named::Program(&name).tag(unsigned(row.try_get(1)?), row.try_get(2)?)?,
        name,
        bytes: unsigned(row.try_get(3)?),
        stored_at: row.try_get(4)?,
        stored_by: row.try_get(5)?,
        kind: ProgramType::of_word(row.try_get(6)?).ok_or_else(unreadable)?,
        ok: row.try_get(7)?,
        steps: unsigned(row.try_get(8)?),
    })
}

/// The latest version of each program.
pub async fn latest(client: &Client) -> Result<Vec<Kept>, StoreError> {
    let text = format!(
        "SELECT {COLUMNS} FROM (SELECT name, max(version) AS version FROM program GROUP BY name) AS newest
         JOIN program USING (name, version) ORDER BY name"
    );
    client.query(&text, &[]).await?.iter().map(kept).collect()
}

/// The versions of a program, the latest first.
pub async fn versions(client: &Client, name: &ProgramName) -> Result<Vec<Kept>, StoreError> {
    let text = format!("SELECT {COLUMNS} FROM program WHERE name = $1 ORDER BY version DESC");
    client.query(&text, &[&name.as_str()]).await?.iter().map(kept).collect()
}

/// A version of a program with its text.
pub async fn one(
    client: &Client,
    name: &ProgramName,
    version: Option<u64>,
) -> Result<Option<(Kept, String)>, StoreError> {
    let text = format!(
        "SELECT {COLUMNS}, text FROM program WHERE name = $1 AND ($2::bigint IS NULL OR version = $2)
         ORDER BY version DESC LIMIT 1"
    );
    let row = client.query_opt(&text, &[&name.as_str(), &version.map(signed)]).await?;
    let Some(row) = row else { return Ok(None) };
    let text = String::from_utf8(row.try_get(9)?)
        .map_err(|_| StoreError::Unreadable(format!("the program `{name}`")))?;
    Ok(Some((kept(&row)?, text)))
}

/// Adds a version.
pub async fn put(client: &Client, new: &NewVersion, condition: &Condition) -> Result<Kept, LibraryError> {
    let last = versions::last(client, Named::Program(&new.name)).await?;
    condition.check(last)?;
    let kept = new.kept(last);
    insert(client, new, &kept, last.is_none()).await
}

async fn insert(client: &Client, new: &NewVersion, kept: &Kept, is_new: bool) -> Result<Kept, LibraryError> {
    let name = new.name.as_str();
    let oldest = signed(kept.tag.version.saturating_sub(MAX_VERSIONS as u64));
    let counted = async |text: &str| -> Result<u64, StoreError> {
        Ok(unsigned(client.query_one(text, &[]).await?.try_get(0)?))
    };
    client
        .execute("DELETE FROM program WHERE name = $1 AND version <= $2", &[&name, &oldest])
        .await
        .map_err(StoreError::from)?;
    let programs = match is_new {
        true => Some(counted("SELECT count(DISTINCT name) FROM program").await?),
        false => None,
    };
    let bytes = counted("SELECT coalesce(sum(bytes), 0)::bigint FROM program").await?;
    new.check_room(programs.map(|programs| usize::try_from(programs).unwrap_or(usize::MAX)), bytes)?;
    client
        .execute(
            "INSERT INTO program (name, version, hash, bytes, stored_at, stored_by, kind, ok, steps, text)
             VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10)",
            &[
                &name,
                &signed(kept.tag.version),
                &kept.tag.hash.as_slice(),
                &signed(kept.bytes),
                &kept.stored_at,
                &plain(&kept.stored_by),
                &kept.kind.word(),
                &kept.ok,
                &signed(kept.steps),
                &new.text.as_bytes(),
            ],
        )
        .await
        .map_err(StoreError::from)?;
    append(client, &[new.record(kept)]).await?;
    Ok(kept.clone())
}
