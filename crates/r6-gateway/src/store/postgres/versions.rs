//! The versions of programs and points in the tables.

use tokio_postgres::Client;

use super::audit::append;
use super::unsigned;
use crate::core::library::{Condition, Tag};
use crate::store::versions::Named;
use crate::store::{Author, LibraryError, StoreError};

/// The latest version; `None` if the name is not in use.
pub async fn last(client: &Client, of: Named<'_>) -> Result<Option<Tag>, StoreError> {
    let table = of.table();
    let select = format!("SELECT version, hash FROM {table} WHERE name = $1 ORDER BY version DESC LIMIT 1");
    let row = client.query_opt(&select, &[&of.name()]).await?;
    row.map(|row| of.tag(unsigned(row.try_get(0)?), row.try_get(1)?)).transpose()
}

/// Removes it with its versions.
pub async fn remove(
    client: &Client,
    of: Named<'_>,
    condition: &Condition,
    by: &Author,
) -> Result<(), LibraryError> {
    let last = last(client, of).await?.ok_or(of.missing())?;
    condition.check(Some(last))?;
    let delete = format!("DELETE FROM {} WHERE name = $1", of.table());
    client.execute(&delete, &[&of.name()]).await.map_err(StoreError::from)?;
    append(client, &[of.removed(last, by)]).await?;
    Ok(())
}
