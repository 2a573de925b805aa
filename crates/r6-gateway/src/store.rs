//! What the gateway keeps: tokens, the audit log, the state of the seats, robots and programs.
//!
//! [`Store`] is the contract; every implementation passes the same tests (`contract.rs`). Nothing outside
//! this folder knows SQL. The gateway talks to its store through a [`Keeper`], a thread of its own, so that
//! no request waits for the disk in a task.

#[cfg(test)]
mod contract;
pub mod history;
mod keeper;
mod library;
#[cfg(test)]
mod memory;
mod sqlite;

use std::fmt;

use r6_api::gateway::{AuditRecord, Deed, Role};

use crate::core::chain::{Broken, Hash};
use crate::core::library::{Condition, ProgramName};
use crate::core::name::RobotName;
use crate::core::role::Grant;
use crate::core::seat::Saved;

pub use keeper::Keeper;
pub use library::{Author, Kept, LibraryError, NewVersion};
#[cfg(test)]
pub use memory::Memory;
pub use sqlite::{FILE, Sqlite, copy};

/// The most tokens of one store: they are all held in memory, and listed at once.
pub const MAX_TOKENS: usize = 10_000;

/// The most entries of one page of the audit log.
pub const MAX_PAGE: usize = 1_000;

/// A place that keeps what must outlive the process. When a method that writes returns, its data is durable.
pub trait Store: Send {
    /// Appends entries to the audit log, all or none. Returns the number of the first one.
    ///
    /// # Errors
    /// [`StoreError`]: nothing was appended, or that is unknown.
    fn append(&mut self, records: &[AuditRecord]) -> Result<u64, StoreError>;

    /// Entries of the audit log after a number, oldest first, at most [`MAX_PAGE`].
    ///
    /// # Errors
    /// [`StoreError`].
    fn entries(&mut self, after: u64, most: usize) -> Result<Vec<Entry>, StoreError>;

    /// The numbers and robots of commands whose outcome is not in the audit log.
    ///
    /// # Errors
    /// [`StoreError`].
    fn open_intents(&mut self) -> Result<Vec<(u64, Option<String>)>, StoreError>;

    /// Adds a token and tells the audit log of it, both or neither. Returns its number. Numbers are not used
    /// again.
    ///
    /// # Errors
    /// [`StoreError`].
    fn add_token(&mut self, token: &NewToken, time: &str) -> Result<i64, StoreError>;

    /// Revokes a token and tells the audit log of it, both or neither. `false` if no valid token has this
    /// number.
    ///
    /// # Errors
    /// [`StoreError`].
    fn revoke_token(&mut self, number: i64, time: &str) -> Result<bool, StoreError>;

    /// The tokens that are not revoked, in the order of their numbers.
    ///
    /// # Errors
    /// [`StoreError`].
    fn tokens(&mut self) -> Result<Vec<Token>, StoreError>;

    /// What was saved of a robot's seat; the default if nothing was.
    ///
    /// # Errors
    /// [`StoreError`].
    fn seat(&mut self, robot: &RobotName) -> Result<Saved, StoreError>;

    /// Saves what has to outlive the process of a robot's seat.
    ///
    /// # Errors
    /// [`StoreError`].
    fn save_seat(&mut self, robot: &RobotName, saved: &Saved) -> Result<(), StoreError>;

    /// The robots that were put, in the order of their names.
    ///
    /// # Errors
    /// [`StoreError`].
    fn robots(&mut self) -> Result<Vec<StoredRobot>, StoreError>;

    /// Adds a robot, or replaces the one of its name, and appends a record to the audit log, both or neither.
    ///
    /// # Errors
    /// [`StoreError`].
    fn put_robot(&mut self, robot: &StoredRobot, record: &AuditRecord) -> Result<(), StoreError>;

    /// Removes a robot, if it was put, and appends these records to the audit log, both or neither. Its seat
    /// stays.
    ///
    /// # Errors
    /// [`StoreError`].
    fn remove_robot(&mut self, name: &RobotName, records: &[AuditRecord]) -> Result<(), StoreError>;

    /// The latest version of each program, in the order of their names.
    ///
    /// # Errors
    /// [`StoreError`].
    fn programs(&mut self) -> Result<Vec<Kept>, StoreError>;

    /// The versions of a program that are kept, the latest first; none without such a program.
    ///
    /// # Errors
    /// [`StoreError`].
    fn program_versions(&mut self, name: &ProgramName) -> Result<Vec<Kept>, StoreError>;

    /// A version of a program, or the latest, with its text; `None` if it is not kept.
    ///
    /// # Errors
    /// [`StoreError`].
    fn program(
        &mut self,
        name: &ProgramName,
        version: Option<u64>,
    ) -> Result<Option<(Kept, String)>, StoreError>;

    /// Adds a version of a program and tells the audit log of it, both or neither. The oldest version goes,
    /// if there are [`MAX_VERSIONS`](crate::core::library::MAX_VERSIONS).
    ///
    /// # Errors
    /// [`LibraryError`].
    fn put_program(&mut self, new: &NewVersion, condition: &Condition) -> Result<Kept, LibraryError>;

    /// Removes a program with its versions and tells the audit log of it, both or neither.
    ///
    /// # Errors
    /// [`LibraryError`].
    fn remove_program(
        &mut self,
        name: &ProgramName,
        condition: &Condition,
        by: &Author,
    ) -> Result<(), LibraryError>;
}

/// A robot that was added through the API.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredRobot {
    /// Its name.
    pub name: RobotName,
    /// Host and port.
    pub address: String,
    /// How often its values are read.
    pub period_ms: u64,
    /// The addresses to read, besides the usual ones.
    pub read: Vec<String>,
    /// The model of its arm.
    pub model: Option<String>,
}

/// An entry of the audit log as it is stored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Its number, from 1 without a gap.
    pub number: u64,
    /// Its text, JSON: what the hash is over.
    pub body: String,
    /// Its hash.
    pub hash: Hash,
}

/// A token to add.
#[derive(Clone, Debug)]
pub struct NewToken {
    /// SHA-256 of the token.
    pub hash: [u8; 32],
    /// What it allows.
    pub grant: Grant,
    /// What people call it.
    pub name: String,
}

/// A token that is not revoked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Token {
    /// Its number.
    pub number: i64,
    /// SHA-256 of the token.
    pub hash: [u8; 32],
    /// What it allows.
    pub grant: Grant,
    /// What people call it.
    pub name: String,
}

/// Why the store did not do what it was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The folder or the file cannot be used.
    Unavailable(String),
    /// The audit log is broken: nothing is appended to it.
    Broken(Broken),
    /// There is no room for another token.
    TooManyTokens,
    /// A value in the store cannot be read.
    Unreadable(String),
    /// The store was closed.
    Closed,
}

impl fmt::Display for StoreError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unavailable(detail) => write!(f, "the store cannot be used: {detail}"),
            Self::Broken(broken) => write!(f, "the audit log is broken: {broken}"),
            Self::TooManyTokens => write!(f, "there are {MAX_TOKENS} tokens: revoke some first"),
            Self::Unreadable(what) => write!(f, "the store has a value that cannot be read: {what}"),
            Self::Closed => f.write_str("the store was closed"),
        }
    }
}

impl std::error::Error for StoreError {}

/// The text of a record in the audit log.
fn body(record: &AuditRecord) -> Result<String, StoreError> {
    serde_json::to_string(record).map_err(|error| StoreError::Unreadable(error.to_string()))
}

/// The record about a new token.
fn token_made(number: i64, token: &NewToken, time: &str) -> AuditRecord {
    of_shell(
        time,
        Deed::TokenMade {
            token: number,
            role: token.grant.role,
            only: token.grant.only.as_ref().map(ToString::to_string),
            name: token.name.clone(),
        },
    )
}

/// The record about a revoked token.
fn token_revoked(number: i64, time: &str) -> AuditRecord {
    of_shell(time, Deed::TokenRevoked { token: number })
}

fn of_shell(time: &str, deed: Deed) -> AuditRecord {
    AuditRecord { time: time.to_owned(), actor: "shell".to_owned(), source: None, robot: None, deed }
}

/// The role with this word.
fn role(word: &str) -> Result<Role, StoreError> {
    Role::of_word(word).ok_or_else(|| StoreError::Unreadable(format!("the role `{word}`")))
}
