//! The points in the table.

use tokio_postgres::{Client, Row};

use super::audit::append;
use super::{plain, signed, unsigned, versions};
use crate::core::library::{Condition, MAX_VERSIONS};
use crate::core::point::PointName;
use crate::store::points::check_room;
use crate::store::versions::Named;
use crate::store::{KeptPoint, LibraryError, NewPoint, StoreError};

const COLUMNS: &str = "name, version, hash, stored_at, stored_by, text";

fn kept(row: &Row) -> Result<KeptPoint, StoreError> {
    let name: &str = row.try_get(0)?;
    let unreadable = || StoreError::Unreadable(format!("the point `{name}`"));
    let name = PointName::new(name).ok_or_else(unreadable)?;
    Ok(KeptPoint {
        tag: Named::Point(&name).tag(unsigned(row.try_get(1)?), row.try_get(2)?)?,
        name,
        stored_at: row.try_get(3)?,
        stored_by: row.try_get(4)?,
        text: String::from_utf8(row.try_get(5)?).map_err(|_| unreadable())?,
    })
}

/// The latest version of each point.
pub async fn latest(client: &Client) -> Result<Vec<KeptPoint>, StoreError> {
    let text = format!(
        "SELECT {COLUMNS} FROM (SELECT name, max(version) AS version FROM point GROUP BY name) AS newest
         JOIN point USING (name, version) ORDER BY name"
    );
    client.query(&text, &[]).await?.iter().map(kept).collect()
}

/// The versions of a point, the latest first.
pub async fn versions(client: &Client, name: &PointName) -> Result<Vec<KeptPoint>, StoreError> {
    let text = format!("SELECT {COLUMNS} FROM point WHERE name = $1 ORDER BY version DESC");
    client.query(&text, &[&name.as_str()]).await?.iter().map(kept).collect()
}

/// Adds a version.
pub async fn put(client: &Client, new: &NewPoint, condition: &Condition) -> Result<KeptPoint, LibraryError> {
    let last = versions::last(client, Named::Point(&new.name)).await?;
    condition.check(last)?;
    if last.is_none() {
        let count = client.query_one("SELECT count(DISTINCT name) FROM point", &[]).await;
        let points = unsigned(count.and_then(|row| row.try_get(0)).map_err(StoreError::from)?);
        check_room(usize::try_from(points).unwrap_or(usize::MAX))?;
    }
    let kept = new.kept(last);
    let (name, oldest) = (new.name.as_str(), signed(kept.tag.version.saturating_sub(MAX_VERSIONS as u64)));
    client
        .execute("DELETE FROM point WHERE name = $1 AND version <= $2", &[&name, &oldest])
        .await
        .map_err(StoreError::from)?;
    client
        .execute(
            &format!("INSERT INTO point ({COLUMNS}) VALUES ($1, $2, $3, $4, $5, $6)"),
            &[
                &name,
                &signed(kept.tag.version),
                &kept.tag.hash.as_slice(),
                &kept.stored_at,
                &plain(&kept.stored_by),
                &kept.text.as_bytes(),
            ],
        )
        .await
        .map_err(StoreError::from)?;
    append(client, &[new.record(&kept)]).await?;
    Ok(kept)
}
