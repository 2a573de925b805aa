//! The points in the tables.

use rusqlite::{Connection, Row, Transaction, params};

use super::{append_in, versions};
use crate::core::library::{Condition, MAX_VERSIONS};
use crate::core::point::PointName;
use crate::store::points::check_room;
use crate::store::versions::Named;
use crate::store::{KeptPoint, LibraryError, NewPoint, StoreError};

const COLUMNS: &str = "name, version, hash, stored_at, stored_by, text";

/// A row as it was read: some of its values may be wrong.
type Raw = (String, u64, Vec<u8>, String, String, String);

fn raw(row: &Row<'_>) -> rusqlite::Result<Raw> {
    Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?, row.get(4)?, row.get(5)?))
}

fn kept((name, version, hash, stored_at, stored_by, text): Raw) -> Result<KeptPoint, StoreError> {
    let known = PointName::new(&name);
    let name = known.ok_or_else(|| StoreError::Unreadable(format!("the point `{name}`")))?;
    let tag = Named::Point(&name).tag(version, &hash)?;
    Ok(KeptPoint { name, tag, stored_at, stored_by, text })
}

/// The latest version of each point. The inner select reads the index alone.
pub fn latest(connection: &Connection) -> Result<Vec<KeptPoint>, StoreError> {
    let mut select = connection.prepare_cached(&format!(
        "SELECT {COLUMNS} FROM (SELECT name, max(version) AS version FROM point GROUP BY name)
         JOIN point USING (name, version) ORDER BY name"
    ))?;
    let rows = select.query_map([], raw)?;
    rows.map(|row| kept(row?)).collect()
}

/// The versions of a point, the latest first.
pub fn versions(connection: &Connection, name: &PointName) -> Result<Vec<KeptPoint>, StoreError> {
    let mut select = connection
        .prepare_cached(&format!("SELECT {COLUMNS} FROM point WHERE name = ?1 ORDER BY version DESC"))?;
    let rows = select.query_map([name.as_str()], raw)?;
    rows.map(|row| kept(row?)).collect()
}

/// Adds a version.
pub fn put(
    transaction: Transaction<'_>,
    new: &NewPoint,
    condition: &Condition,
) -> Result<KeptPoint, LibraryError> {
    let last = versions::last(&transaction, Named::Point(&new.name))?;
    condition.check(last)?;
    if last.is_none() {
        let count = "SELECT count(DISTINCT name) FROM point";
        let points = transaction.query_row(count, [], |row| row.get(0)).map_err(StoreError::from)?;
        check_room(points)?;
    }
    let kept = new.kept(last);
    let oldest = kept.tag.version.saturating_sub(MAX_VERSIONS as u64);
    transaction
        .execute("DELETE FROM point WHERE name = ?1 AND version <= ?2", params![new.name.as_str(), oldest])
        .map_err(StoreError::from)?;
    transaction
        .execute(
            &format!("INSERT INTO point ({COLUMNS}) VALUES (?1, ?2, ?3, ?4, ?5, ?6)"),
            params![
                kept.name.as_str(),
                kept.tag.version,
                kept.tag.hash,
                kept.stored_at,
                kept.stored_by,
                kept.text
            ],
        )
        .map_err(StoreError::from)?;
    append_in(&transaction, &[new.record(&kept)])?;
    transaction.commit().map_err(StoreError::from)?;
    Ok(kept)
}
