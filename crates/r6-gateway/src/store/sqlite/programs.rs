//! The programs in the tables.

use r6_api::gateway::ProgramType;
use rusqlite::{Connection, OptionalExtension, Row, Transaction, params};

use super::{append_in, versions};
use crate::core::library::{Condition, MAX_VERSIONS, ProgramName};
use crate::store::versions::Named;
use crate::store::{Kept, LibraryError, NewVersion, StoreError};

/// All columns but the text.
const COLUMNS: &str = "name, version, hash, bytes, stored_at, stored_by, kind, ok, steps";

/// A row as it was read: some of its values may be wrong.
struct Raw {
    name: String,
    version: u64,
    hash: Vec<u8>,
    bytes: u64,
    stored_at: String,
    stored_by: String,
    kind: String,
    ok: bool,
    steps: u64,
}

impl Raw {
    fn of(row: &Row<'_>) -> rusqlite::Result<Self> {
        Ok(Self {
            name: row.get(0)?,
            version: row.get(1)?,
            hash: row.get(2)?,
            bytes: row.get(3)?,
            stored_at: row.get(4)?,
            stored_by: row.get(5)?,
            kind: row.get(6)?,
            ok: row.get(7)?,
            steps: row.get(8)?,
        })
    }

    fn kept(self) -> Result<Kept, StoreError> {
        let unreadable = || StoreError::Unreadable(format!("the program `{}`", self.name));
        let name = ProgramName::new(&self.name).ok_or_else(unreadable)?;
        Ok(Kept {
            tag: Named::Program(&name).tag(self.version, &self.hash)?,
            name,
            bytes: self.bytes,
            kind: ProgramType::of_word(&self.kind).ok_or_else(unreadable)?,
            stored_at: self.stored_at,
            stored_by: self.stored_by,
            ok: self.ok,
            steps: self.steps,
        })
    }
}

/// The latest version of each program. The inner select reads the index alone.
pub fn latest(connection: &Connection) -> Result<Vec<Kept>, StoreError> {
    let mut select = connection.prepare_cached(&format!(
        "SELECT {COLUMNS} FROM (SELECT name, max(version) AS version FROM program GROUP BY name)
         JOIN program USING (name, version) ORDER BY name"
    ))?;
    let rows = select.query_map([], Raw::of)?;
    rows.map(|row| row?.kept()).collect()
}

/// The versions of a program, the latest first.
pub fn versions(connection: &Connection, name: &ProgramName) -> Result<Vec<Kept>, StoreError> {
    let mut select = connection
        .prepare_cached(&format!("SELECT {COLUMNS} FROM program WHERE name = ?1 ORDER BY version DESC"))?;
    let rows = select.query_map([name.as_str()], Raw::of)?;
    rows.map(|row| row?.kept()).collect()
}

/// A version of a program with its text.
pub fn one(
    connection: &Connection,
    name: &ProgramName,
    version: Option<u64>,
) -> Result<Option<(Kept, String)>, StoreError> {
    // SQLite takes signed numbers only. No program has a version above that.
    let version = version.map(|version| version.min(u64::MAX >> 1));
    let mut select = connection.prepare_cached(&format!(
        "SELECT {COLUMNS}, text FROM program WHERE name = ?1 AND (?2 IS NULL OR version = ?2)
         ORDER BY version DESC LIMIT 1"
    ))?;
    let row = select.query_row(params![name.as_str(), version], |row| Ok((Raw::of(row)?, row.get(9)?)));
    row.optional()?.map(|(raw, text)| Ok((raw.kept()?, text))).transpose()
}

/// Adds a version.
pub fn put(
    transaction: Transaction<'_>,
    new: &NewVersion,
    condition: &Condition,
) -> Result<Kept, LibraryError> {
    let last = versions::last(&transaction, Named::Program(&new.name))?;
    condition.check(last)?;
    let kept = new.kept(last);
    transaction
        .execute(
            "DELETE FROM program WHERE name = ?1 AND version <= ?2",
            params![new.name.as_str(), kept.tag.version.saturating_sub(MAX_VERSIONS as u64)],
        )
        .map_err(StoreError::from)?;
    let count = |sql| transaction.query_row(sql, [], |row| row.get::<_, u64>(0)).map_err(StoreError::from);
    let programs = match last {
        None => Some(count("SELECT count(DISTINCT name) FROM program")?),
        Some(_) => None,
    };
    let programs = programs.map(|programs| usize::try_from(programs).unwrap_or(usize::MAX));
    new.check_room(programs, count("SELECT coalesce(sum(bytes), 0) FROM program")?)?;
    transaction
        .execute(
            &format!(
                "INSERT INTO program ({COLUMNS}, text) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10)"
            ),
            params![
                kept.name.as_str(),
                kept.tag.version,
                kept.tag.hash,
                kept.bytes,
                kept.stored_at,
                kept.stored_by,
                kept.kind.word(),
                kept.ok,
                kept.steps,
                new.text
            ],
        )
        .map_err(StoreError::from)?;
    append_in(&transaction, &[new.record(&kept)])?;
    transaction.commit().map_err(StoreError::from)?;
    Ok(kept)
}
