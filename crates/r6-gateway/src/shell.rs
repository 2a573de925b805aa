//! What the command line does with the store of a gateway, whether the gateway runs or not.

use std::path::{Path, PathBuf};

use r6_api::gateway::Role;

use crate::accounts;
use crate::certificate;
use crate::clock;
use crate::core::account::{Account, UserName, Wish};
use crate::core::camera::{Camera, CameraGrant};
use crate::core::name::RobotName;
use crate::core::role::{Grant, GrantRobots};
use crate::core::seat::Saved;
use crate::expiry::Expiry;
use crate::store::postgres::session::Hand;
use crate::store::postgres::{Database, Postgres};
use crate::store::{Author, NewGrant, NewToken, Sqlite, Store, StoreError, Token, UserChange};
use crate::tokens;
use crate::verify::to_read;

/// Where a store is.
#[derive(Clone, Debug)]
pub enum At {
    /// In the folder of a gateway.
    Folder(PathBuf),
    /// In a database that gateways share.
    Database(Database),
}

impl From<&Path> for At {
    fn from(folder: &Path) -> Self {
        Self::Folder(folder.to_owned())
    }
}

impl From<&PathBuf> for At {
    fn from(folder: &PathBuf) -> Self {
        Self::Folder(folder.clone())
    }
}

impl At {
    fn open(&self) -> Result<Box<dyn Store>, StoreError> {
        Ok(match self {
            Self::Folder(folder) => Box::new(Sqlite::open(folder)?),
            Self::Database(database) => Box::new(Postgres::open(database, Hand::Shell)?),
        })
    }

    fn open_existing(&self) -> Result<Box<dyn Store>, StoreError> {
        Ok(match self {
            Self::Folder(folder) => Box::new(Sqlite::open_existing(folder)?),
            Self::Database(database) => {
                drop(Postgres::open_to_read(database)?);
                Box::new(Postgres::open(database, Hand::Shell)?)
            }
        })
    }

    fn open_to_read(&self) -> Result<Box<dyn Store>, StoreError> {
        Ok(match self {
            Self::Folder(folder) => Box::new(to_read(folder)?),
            Self::Database(database) => Box::new(Postgres::open_to_read(database)?),
        })
    }
}

/// Makes a token that holds until it is revoked. Returns its number and its text, which is nowhere else. No
/// robot gets a higher role than `role`.
///
/// # Errors
/// [`StoreError`].
pub fn make_token(
    at: impl Into<At>,
    role: Role,
    robots: Option<GrantRobots>,
    name: String,
) -> Result<(i64, String), StoreError> {
    make_token_until(at, Grant { role, robots: robots.map(|robots| robots.up_to(role)) }, name, None)
}

/// Makes a token that ends then; `None`: it holds until it is revoked. Returns its number and its text, which
/// is nowhere else.
///
/// # Errors
/// [`StoreError`].
pub fn make_token_until(
    at: impl Into<At>,
    grant: Grant,
    name: String,
    expires: Option<Expiry>,
) -> Result<(i64, String), StoreError> {
    let mut store = at.into().open()?;
    let drawn = tokens::draw();
    let (text, hash) =
        drawn.map_err(|error| StoreError::Unavailable(format!("no random numbers: {error}")))?;
    let token = NewToken { hash, grant, name, expires };
    let number = store.add_token(&token, &Author::shell(clock::time_of_day()))?;
    Ok((number, text))
}

/// Gives a token the grant to feed a camera of a robot: it counts at once, also for a running gateway.
/// `false` if it has the grant.
///
/// # Errors
/// [`StoreError`]: there is no such token, or it is for another robot.
pub fn grant_camera(
    at: impl Into<At>,
    token: i64,
    robot: RobotName,
    camera: Camera,
) -> Result<bool, StoreError> {
    let new = NewGrant { robot, camera, token };
    at.into().open_existing()?.grant_camera(&new, &Author::shell(clock::time_of_day()))
}

/// Whether the store knows a robot of this name: it was added over HTTP, or a gateway has looked after it.
/// A robot that only the file of a gateway names is not known before its first connection.
///
/// # Errors
/// [`StoreError`].
pub fn is_robot_known(at: impl Into<At>, robot: &RobotName) -> Result<bool, StoreError> {
    let mut store = at.into().open_to_read()?;
    let was_added = store.robots()?.iter().any(|known| known.name == *robot);
    Ok(was_added || store.seat(robot)? != Saved::default())
}

/// The grants of cameras of all robots, by robot, camera and token.
///
/// # Errors
/// [`StoreError`].
pub fn list_cameras(at: impl Into<At>) -> Result<Vec<(RobotName, CameraGrant)>, StoreError> {
    at.into().open_to_read()?.cameras(None)
}

/// Revokes a token: a running gateway refuses it within a second. `false` if no valid token has this number.
///
/// # Errors
/// [`StoreError`].
pub fn revoke_token(at: impl Into<At>, number: i64) -> Result<bool, StoreError> {
    at.into().open_existing()?.revoke_token(number, &Author::shell(clock::time_of_day()))
}

/// The tokens that are not revoked.
///
/// # Errors
/// [`StoreError`].
pub fn list_tokens(at: impl Into<At>) -> Result<Vec<Token>, StoreError> {
    at.into().open_to_read()?.tokens()
}

/// Makes a user without a password: [`make_link`] lets the user set one.
///
/// # Errors
/// [`StoreError`].
pub fn add_user(at: impl Into<At>, name: UserName, grant: Grant) -> Result<(), StoreError> {
    change_user(&mut *at.into().open()?, name, Wish::Add(grant))
}

/// Disables a user: a running gateway ends the user's sessions within a second.
///
/// # Errors
/// [`StoreError`].
pub fn disable_user(at: impl Into<At>, name: UserName) -> Result<(), StoreError> {
    change_user(&mut *at.into().open_existing()?, name, Wish::Disable)
}

fn change_user(store: &mut dyn Store, name: UserName, wish: Wish) -> Result<(), StoreError> {
    let change = UserChange { name, wish, link: None, if_stamp: None };
    store.change_user(&change, &Author::shell(clock::time_of_day())).map(drop)
}

/// Makes a one-time link with which a user can set a password, once and within an hour. Returns the part of
/// its address behind `/setup`, which has a secret.
///
/// # Errors
/// [`StoreError`].
pub fn make_link(at: impl Into<At>, name: UserName) -> Result<String, StoreError> {
    let mut store = at.into().open_existing()?;
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
pub fn list_users(at: impl Into<At>) -> Result<Vec<Account>, StoreError> {
    let users = at.into().open_to_read()?.users()?;
    Ok(users.into_iter().map(|user| user.account).collect())
}
