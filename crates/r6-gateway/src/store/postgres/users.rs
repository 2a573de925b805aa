//! Tokens and users, and the links by which users set their passwords.

use tokio_postgres::Client;

use super::audit::append;
use super::{plain, signed, unsigned};
use crate::core::account::{Account, Decided, PasswordHash, UserName};
use crate::core::role::GrantRobots;
use crate::expiry::Expiry;
use crate::store::{
    Author, Link, MAX_TOKENS, NewToken, StoreError, StoredUser, Token, UserChange, check_link, decide, grant,
    link_made, token_made, token_revoked, user_changed,
};

fn hash(bytes: &[u8], of: impl FnOnce() -> String) -> Result<[u8; 32], StoreError> {
    <[u8; 32]>::try_from(bytes).map_err(|_| StoreError::Unreadable(of()))
}

/// Adds a token and its record.
pub async fn add_token(client: &Client, token: &NewToken, author: &Author) -> Result<i64, StoreError> {
    let known: i64 =
        client.query_one("SELECT count(*) FROM token WHERE revoked IS NULL", &[]).await?.try_get(0)?;
    if usize::try_from(known).unwrap_or(usize::MAX) >= MAX_TOKENS {
        return Err(StoreError::TooManyTokens);
    }
    let only = token.grant.robots.as_ref().map(GrantRobots::to_string);
    let number = client
        .query_one(
            "INSERT INTO token (hash, role, robot, name, made, expires) VALUES ($1, $2, $3, $4, $5, $6)
             RETURNING number",
            &[
                &token.hash.as_slice(),
                &token.grant.role.word(),
                &only,
                &plain(&token.name),
                &author.time,
                &token.expires.map(|expires| signed(expires.0)),
            ],
        )
        .await?
        .try_get(0)?;
    append(client, &[token_made(number, token, author)]).await?;
    Ok(number)
}

/// Revokes a token, with its record.
pub async fn revoke_token(client: &Client, number: i64, author: &Author) -> Result<bool, StoreError> {
    let revoked = client
        .execute(
            "UPDATE token SET revoked = $2 WHERE number = $1 AND revoked IS NULL",
            &[&number, &author.time],
        )
        .await?;
    if revoked > 0 {
        client.execute("DELETE FROM camera WHERE token = $1", &[&number]).await?;
        append(client, &[token_revoked(number, author)]).await?;
    }
    Ok(revoked > 0)
}

/// The tokens that are not revoked. A database that is only read can be older than their ends.
pub async fn tokens(client: &Client) -> Result<Vec<Token>, StoreError> {
    let rows = client
        .query(
            "SELECT number, hash, role, robot, name, (to_jsonb(token) ->> 'expires')::bigint FROM token
             WHERE revoked IS NULL ORDER BY number",
            &[],
        )
        .await?;
    rows.iter()
        .map(|row| {
            let number = row.try_get(0)?;
            let hash = hash(row.try_get(1)?, || format!("token {number}"))?;
            let grant = grant(row.try_get(2)?, row.try_get(3)?)?;
            let expires = row.try_get::<_, Option<i64>>(5)?.map(|expires| Expiry(unsigned(expires)));
            Ok(Token { number, hash, grant, name: row.try_get(4)?, expires })
        })
        .collect()
}

/// The users.
pub async fn all(client: &Client) -> Result<Vec<StoredUser>, StoreError> {
    let rows = client
        .query(
            "SELECT name, role, robot, disabled, password, created, stamp FROM \"user\" ORDER BY name",
            &[],
        )
        .await?;
    rows.iter()
        .map(|row| {
            let account = Account {
                name: user_name(row.try_get(0)?)?,
                grant: grant(row.try_get(1)?, row.try_get(2)?)?,
                disabled: row.try_get(3)?,
                password: row.try_get::<_, Option<String>>(4)?.map(PasswordHash),
            };
            Ok(StoredUser { account, created: row.try_get(5)?, stamp: unsigned(row.try_get(6)?) })
        })
        .collect()
}

/// The link with this hash.
pub async fn link(client: &Client, hash: &[u8; 32]) -> Result<Option<Link>, StoreError> {
    let row =
        client.query_opt("SELECT \"user\", made FROM link WHERE hash = $1", &[&hash.as_slice()]).await?;
    let Some(row) = row else { return Ok(None) };
    let user: &str = row.try_get(0)?;
    let user = if user.is_empty() { None } else { Some(user_name(user)?) };
    Ok(Some(Link { hash: *hash, user, made: unsigned(row.try_get(1)?) }))
}

fn user_name(text: &str) -> Result<UserName, StoreError> {
    UserName::new(text).ok_or_else(|| StoreError::Unreadable(format!("the user `{text}`")))
}

/// Changes a user, if that is decided so. Returns the number of its entry too.
pub async fn change(
    client: &Client,
    change: &UserChange,
    author: &Author,
) -> Result<(Decided, u64), StoreError> {
    let link = match &change.link {
        Some((hash, _)) => self::link(client, hash).await?,
        None => None,
    };
    let users = all(client).await?;
    let decided = decide(&users, change, link.as_ref())?;
    let Some(record) = user_changed(change, &decided, author) else { return Ok((decided, 0)) };
    let stamp = append(client, &[record]).await?;
    let name = change.name.as_str();
    match &decided {
        Decided::Made(account) | Decided::Changed(account) => {
            let Account { grant, disabled, password, .. } = account;
            let only = grant.robots.as_ref().map(GrantRobots::to_string);
            let password = password.as_ref().map(|hash| hash.0.as_str());
            client
                .execute(
                    "INSERT INTO \"user\" (name, role, robot, disabled, password, created, stamp)
                     VALUES ($1, $2, $3, $4, $5, $6, $7)
                     ON CONFLICT (name) DO UPDATE SET role = excluded.role, robot = excluded.robot,
                     disabled = excluded.disabled, password = excluded.password, stamp = excluded.stamp",
                    &[&name, &grant.role.word(), &only, disabled, &password, &author.time, &signed(stamp)],
                )
                .await?;
        }
        Decided::Removed => {
            client.execute("DELETE FROM \"user\" WHERE name = $1", &[&name]).await?;
        }
        Decided::Same => {}
    }
    if decided == Decided::Removed || change.wish.sets_password() {
        client.execute("DELETE FROM link WHERE \"user\" = $1", &[&name]).await?;
    }
    if let Some((hash, _)) = &change.link {
        client.execute("DELETE FROM link WHERE hash = $1", &[&hash.as_slice()]).await?;
    }
    Ok((decided, stamp))
}

/// Keeps a link in place of the last link of its user.
pub async fn put_link(client: &Client, link: &Link, author: &Author) -> Result<(), StoreError> {
    check_link(&all(client).await?, link)?;
    append(client, &[link_made(link, author)]).await?;
    let user = link.user.as_ref().map_or("", UserName::as_str);
    client
        .execute(
            "INSERT INTO link (\"user\", hash, made) VALUES ($1, $2, $3)
             ON CONFLICT (\"user\") DO UPDATE SET hash = excluded.hash, made = excluded.made",
            &[&user, &link.hash.as_slice(), &signed(link.made)],
        )
        .await?;
    Ok(())
}
