//! The users in the table, and the links by which they set their passwords.

use rusqlite::{Connection, OptionalExtension, Transaction, params};

use super::append_in;
use crate::core::account::{Account, Decided, PasswordHash, UserName};
use crate::core::role::GrantRobots;
use crate::store::{
    Author, Link, StoreError, StoredUser, UserChange, check_link, decide, grant, link_made, user_changed,
};

/// The users. A transaction is a connection, too.
pub fn all(connection: &Connection) -> Result<Vec<StoredUser>, StoreError> {
    let mut select = connection.prepare_cached(
        "SELECT name, role, only, disabled, password, created, stamp FROM user ORDER BY name",
    )?;
    let rows = select.query_map([], |row| {
        let name: String = row.get(0)?;
        let (only, password): (Option<String>, Option<String>) = (row.get(2)?, row.get(4)?);
        Ok((name, row.get::<_, String>(1)?, only, row.get(3)?, password, row.get(5)?, row.get(6)?))
    })?;
    rows.map(|row| {
        let (name, role, only, disabled, password, created, stamp) = row?;
        let name = user_name(&name)?;
        let password = password.map(PasswordHash);
        let account = Account { name, grant: grant(&role, only.as_deref())?, disabled, password };
        Ok(StoredUser { account, created, stamp })
    })
    .collect()
}

/// The link with this hash.
pub fn link(connection: &Connection, hash: &[u8; 32]) -> Result<Option<Link>, StoreError> {
    let mut select = connection.prepare_cached("SELECT user, made FROM link WHERE hash = ?1")?;
    let row =
        select.query_row([hash.as_slice()], |row| Ok((row.get::<_, String>(0)?, row.get(1)?))).optional()?;
    let Some((user, made)) = row else { return Ok(None) };
    let user = if user.is_empty() { None } else { Some(user_name(&user)?) };
    Ok(Some(Link { hash: *hash, user, made }))
}

fn user_name(text: &str) -> Result<UserName, StoreError> {
    UserName::new(text).ok_or_else(|| StoreError::Unreadable(format!("the user `{text}`")))
}

/// Changes a user, if that is decided so. Returns the number of its entry too.
pub fn change(
    transaction: Transaction<'_>,
    change: &UserChange,
    author: &Author,
) -> Result<(Decided, u64), StoreError> {
    let link = match &change.link {
        Some((hash, _)) => self::link(&transaction, hash)?,
        None => None,
    };
    let users = all(&transaction)?;
    let decided = decide(&users, change, link.as_ref())?;
    let Some(record) = user_changed(change, &decided, author) else { return Ok((decided, 0)) };
    let stamp = append_in(&transaction, &[record])?;
    let name = change.name.as_str();
    match &decided {
        Decided::Made(account) | Decided::Changed(account) => {
            let Account { grant, disabled, password, .. } = account;
            let only = grant.robots.as_ref().map(GrantRobots::to_string);
            let password = password.as_ref().map(|hash| hash.0.as_str());
            transaction.execute(
                "INSERT INTO user (name, role, only, disabled, password, created, stamp)
                 VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)
                 ON CONFLICT (name) DO UPDATE SET role = excluded.role, only = excluded.only,
                 disabled = excluded.disabled, password = excluded.password, stamp = excluded.stamp",
                params![name, grant.role.word(), only, disabled, password, author.time, stamp],
            )?;
        }
        Decided::Removed => drop(transaction.execute("DELETE FROM user WHERE name = ?1", [name])?),
        Decided::Same => {}
    }
    if decided == Decided::Removed || change.wish.sets_password() {
        transaction.execute("DELETE FROM link WHERE user = ?1", [name])?;
    }
    if let Some((hash, _)) = &change.link {
        transaction.execute("DELETE FROM link WHERE hash = ?1", [hash.as_slice()])?;
    }
    transaction.commit()?;
    Ok((decided, stamp))
}

/// Keeps a link in place of the last link of its user.
pub fn put_link(transaction: Transaction<'_>, link: &Link, author: &Author) -> Result<(), StoreError> {
    check_link(&all(&transaction)?, link)?;
    append_in(&transaction, &[link_made(link, author)])?;
    let user = link.user.as_ref().map_or("", UserName::as_str);
    transaction.execute(
        "INSERT INTO link (user, hash, made) VALUES (?1, ?2, ?3)
         ON CONFLICT (user) DO UPDATE SET hash = excluded.hash, made = excluded.made",
        params![user, link.hash, link.made],
    )?;
    transaction.commit()?;
    Ok(())
}
