//! What kept programs and kept points have in common: each has a name, and versions with hashes.

use std::fmt;

use r6_api::gateway::AuditRecord;

use super::{Author, LibraryError, StoreError, library, points};
use crate::core::library::{ProgramName, Tag};
use crate::core::point::PointName;

/// The name of something that is kept with its versions.
#[derive(Clone, Copy, Debug)]
pub(super) enum Named<'n> {
    /// A program.
    Program(&'n ProgramName),
    /// A point.
    Point(&'n PointName),
}

impl<'n> Named<'n> {
    /// The table of its versions.
    pub fn table(self) -> &'static str {
        match self {
            Self::Program(_) => "program",
            Self::Point(_) => "point",
        }
    }

    /// Its name.
    pub fn name(self) -> &'n str {
        match self {
            Self::Program(name) => name.as_str(),
            Self::Point(name) => name.as_str(),
        }
    }

    /// The version with this hash, as it was read.
    pub fn tag(self, version: u64, hash: &[u8]) -> Result<Tag, StoreError> {
        let hash = <[u8; 32]>::try_from(hash).map_err(|_| StoreError::Unreadable(format!("the {self}")))?;
        Ok(Tag { version, hash })
    }

    /// The name is not in use.
    pub fn missing(self) -> LibraryError {
        match self {
            Self::Program(_) => LibraryError::NoSuchProgram,
            Self::Point(_) => LibraryError::NoSuchPoint,
        }
    }

    /// The record about its removal.
    pub fn removed(self, last: Tag, by: &Author) -> AuditRecord {
        match self {
            Self::Program(name) => library::removed(name, last, by),
            Self::Point(name) => points::removed(name, last, by),
        }
    }
}

impl fmt::Display for Named<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} `{}`", self.table(), self.name())
    }
}
