//! Why a store did not do what it was asked for.

use std::fmt;

use super::MAX_TOKENS;
use crate::core::account::Denied;
use crate::core::camera::MAX_GRANTS;
use crate::core::chain::Broken;
use crate::core::name::RobotName;

/// Why the store did not do what it was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The folder or the file cannot be used.
    Unavailable(String),
    /// The audit log is broken: nothing is appended to it.
    Broken(Broken),
    /// There is no room for another token.
    TooManyTokens,
    /// No valid token has this number.
    NoSuchToken(i64),
    /// The token with this number is for another robot.
    TokenOfAnother(i64),
    /// The robot has as many grants of cameras as it may have.
    TooManyGrants,
    /// The user stays as it is.
    Denied(Denied),
    /// The one-time link was used, is too old, or is of another user.
    LinkVoid,
    /// The user was changed meanwhile.
    UserChanged,
    /// A value in the store cannot be read.
    Unreadable(String),
    /// The store was closed.
    Closed,
    /// This robot has the address already.
    AddressTaken(RobotName),
    /// Another gateway owns the robot, and writes; or that is not known any more.
    NotOwner,
}

impl fmt::Display for StoreError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unavailable(detail) => write!(f, "the store cannot be used: {detail}"),
            Self::Broken(broken) => write!(f, "the audit log is broken: {broken}"),
            Self::TooManyTokens => write!(f, "there are {MAX_TOKENS} tokens: revoke some first"),
            Self::NoSuchToken(number) => write!(f, "there is no valid token {number}"),
            Self::TokenOfAnother(number) => write!(f, "token {number} is for another robot"),
            Self::TooManyGrants => {
                write!(f, "this robot has {MAX_GRANTS} grants of cameras: revoke some first")
            }
            Self::Denied(denied) => denied.fmt(f),
            Self::LinkVoid => f.write_str(
                "this link is not valid: it was used, it is older than an hour, a newer one took its place, \
                 or it is for another name",
            ),
            Self::UserChanged => f.write_str("the user was changed meanwhile: sign in again"),
            Self::Unreadable(what) => write!(f, "the store has a value that cannot be read: {what}"),
            Self::Closed => f.write_str("the store was closed"),
            Self::AddressTaken(robot) => write!(f, "`{robot}` has this address"),
            Self::NotOwner => f.write_str("this gateway does not own the robot: another one writes"),
        }
    }
}

impl std::error::Error for StoreError {}

impl From<Broken> for StoreError {
    fn from(broken: Broken) -> Self {
        Self::Broken(broken)
    }
}
