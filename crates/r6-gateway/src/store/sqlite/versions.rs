//! The versions of programs and points in the tables.

use rusqlite::{OptionalExtension, Transaction};

use super::append_in;
use crate::core::library::{Condition, Tag};
use crate::store::versions::Named;
use crate::store::{Author, LibraryError, StoreError};

/// The latest version; `None` if the name is not in use.
pub fn last(transaction: &Transaction<'_>, of: Named<'_>) -> Result<Option<Tag>, StoreError> {
    let table = of.table();
    let mut select = transaction.prepare_cached(&format!(
        "SELECT version, hash FROM {table} WHERE name = ?1 ORDER BY version DESC LIMIT 1"
    ))?;
    let row = select.query_row([of.name()], |row| Ok((row.get(0)?, row.get::<_, Vec<u8>>(1)?)));
    row.optional()?.map(|(version, hash)| of.tag(version, &hash)).transpose()
}

/// Removes it with its versions.
pub fn remove(
    transaction: Transaction<'_>,
    of: Named<'_>,
    condition: &Condition,
    by: &Author,
) -> Result<(), LibraryError> {
    let last = last(&transaction, of)?.ok_or(of.missing())?;
    condition.check(Some(last))?;
    let delete = format!("DELETE FROM {} WHERE name = ?1", of.table());
    transaction.execute(&delete, [of.name()]).map_err(StoreError::from)?;
    append_in(&transaction, &[of.removed(last, by)])?;
    transaction.commit().map_err(StoreError::from)?;
    Ok(())
}
