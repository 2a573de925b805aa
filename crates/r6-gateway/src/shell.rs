//! What the command line does with the folder of a gateway, whether the gateway runs or not.

use std::path::Path;

use r6_api::gateway::Role;

use crate::accounts;
use crate::certificate;
use crate::clock;
use crate::core::account::{Account, UserName, Wish};
use crate::core::name::RobotName;
use crate::core::role::Grant;
use crate::store::{Author, NewToken, Sqlite, Store, StoreError, Token, UserChange};
use crate::tokens;
use crate::verify::to_read;

/// Makes a token. Returns its number and its text, which is nowhere else.
///
/// # Errors
/// [`StoreError`].
pub fn make_token(
    folder: &Path,
    role: Role,
    only: Option<RobotName>,
    name: String,
) -> Result<(i64, String), StoreError> {
    let mut store = Sqlite::open(folder)?;
    let drawn = tokens::draw();
    let (text, hash) =
        drawn.map_err(|error| StoreError::Unavailable(format!("no random numbers: {error}")))?;
    let token = NewToken { hash, grant: Grant { role, only }, name };
    let number = store.add_token(&token, &Author::shell(clock::time_of_day()))?;
    Ok((number, text))
}

/// Revokes a token: a running gateway refuses it within a second. `false` if no valid token has this number.
///
/// # Errors
/// [`StoreError`].
pub fn revoke_token(folder: &Path, number: i64) -> Result<bool, StoreError> {
    Sqlite::open_existing(folder)?.revoke_token(number, &Author::shell(clock::time_of_day()))
}

/// The tokens that are not revoked.
///
/// # Errors
/// [`StoreError`].
pub fn list_tokens(folder: &Path) -> Result<Vec<Token>, StoreError> {
    to_read(folder)?.tokens()
}

/// Makes a user without a password: [`make_link`] lets the user set one.
///
/// # Errors
/// [`StoreError`].
pub fn add_user(folder: &Path, name: UserName, grant: Grant) -> Result<(), StoreError> {
    change_user(&mut Sqlite::open(folder)?, name, Wish::Add(grant))
}

/// Disables a user: a running gateway ends the user's sessions within a second.
///
/// # Errors
/// [`StoreError`].
pub fn disable_user(folder: &Path, name: UserName) -> Result<(), StoreError> {
    change_user(&mut Sqlite::open_existing(folder)?, name, Wish::Disable)
}

fn change_user(store: &mut Sqlite, name: UserName, wish: Wish) -> Result<(), StoreError> {
    let change = UserChange { name, wish, link: None, if_stamp: None };
    store.change_user(&change, &Author::shell(clock::time_of_day())).map(drop)
}

/// Makes a one-time link with which a user can set a password, once and within an hour. Returns the part of
/// its address behind `/setup`, which has a secret.
///
/// # Errors
/// [`StoreError`].
pub fn make_link(folder: &Path, name: UserName) -> Result<String, StoreError> {
    let mut store = Sqlite::open_existing(folder)?;
    let (secret, link) = accounts::draw_link(Some(name.clone()))?;
    store.put_link(&link, &Author::shell(clock::time_of_day()))?;
    Ok(format!("#{}&{name}", secret.0))
}

/// Whether the folder has a certificate that the gateway made: then it speaks TLS, unless its settings
/// changed.
#[must_use]
pub fn has_certificate(folder: &Path) -> bool {
    folder.join(certificate::FOLDER).join(certificate::FILES[0]).is_file()
}

/// The users, in the order of their names.
///
/// # Errors
/// [`StoreError`].
pub fn list_users(folder: &Path) -> Result<Vec<Account>, StoreError> {
    let users = to_read(folder)?.users()?;
    Ok(users.into_iter().map(|user| user.account).collect())
}
