//! The programs of a store: what all implementations have in common.

use std::fmt;

use r6_api::gateway::{AuditRecord, Deed, ProgramType};

use super::{Author, StoreError};
use crate::core::library::{MAX_PROGRAMS, MAX_TOTAL, ProgramName, Tag, Unfit};
use crate::core::point::MAX_KEPT;

/// A version of a program, without its text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Kept {
    /// The name of the program.
    pub name: ProgramName,
    /// Its number, and the hash of its text.
    pub tag: Tag,
    /// How many bytes its text has.
    pub bytes: u64,
    /// When it was stored.
    pub stored_at: String,
    /// Who stored it.
    pub stored_by: String,
    /// Which kind of program it is.
    pub kind: ProgramType,
    /// Whether it has no mistake.
    pub ok: bool,
    /// How many steps it has.
    pub steps: u64,
}

/// A version to add.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewVersion {
    /// The name of the program.
    pub name: ProgramName,
    /// Its text.
    pub text: String,
    /// SHA-256 of the text.
    pub hash: [u8; 32],
    /// Who stores it.
    pub by: Author,
    /// Which kind of program it is.
    pub kind: ProgramType,
    /// Whether it has no mistake.
    pub ok: bool,
    /// How many steps it has.
    pub steps: u64,
}

impl NewVersion {
    /// The version behind this one; the first one without a version before.
    pub(super) fn kept(&self, last: Option<Tag>) -> Kept {
        let version = last.map_or(0, |last| last.version) + 1;
        Kept {
            name: self.name.clone(),
            tag: Tag { version, hash: self.hash },
            bytes: self.text.len() as u64,
            stored_at: self.by.time.clone(),
            stored_by: self.by.actor.clone(),
            kind: self.kind,
            ok: self.ok,
            steps: self.steps,
        }
    }

    /// Refuses a version for which there is no room. `programs`: how many there are, if it begins another
    /// one. `bytes`: how many the other versions have that stay.
    pub(super) fn check_room(&self, programs: Option<usize>, bytes: u64) -> Result<(), LibraryError> {
        if programs.is_some_and(|programs| programs >= MAX_PROGRAMS) {
            return Err(LibraryError::TooManyPrograms);
        }
        if bytes + self.text.len() as u64 > MAX_TOTAL {
            return Err(LibraryError::TooManyBytes);
        }
        Ok(())
    }

    /// The record about it.
    pub(super) fn record(&self, kept: &Kept) -> AuditRecord {
        let (version, sha256) = (kept.tag.version, kept.tag.sha256());
        self.by.record(Deed::ProgramStored { program: self.name.to_string(), version, sha256 })
    }
}

/// The record about a program that was removed.
pub(super) fn removed(name: &ProgramName, last: Tag, by: &Author) -> AuditRecord {
    by.record(Deed::ProgramRemoved { program: name.to_string(), version: last.version })
}

/// Why a program or a point was not stored or removed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LibraryError {
    /// There is no such program.
    NoSuchProgram,
    /// There is no such point.
    NoSuchPoint,
    /// The change is not for it as it is.
    Unfit(Unfit),
    /// There is no room for another program.
    TooManyPrograms,
    /// There is no room for another point.
    TooManyPoints,
    /// There is no room for as many bytes.
    TooManyBytes,
    /// The store failed.
    Store(StoreError),
}

impl fmt::Display for LibraryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSuchProgram => f.write_str("there is no such program"),
            Self::NoSuchPoint => f.write_str("there is no such point"),
            Self::Unfit(Unfit::NeedsIfMatch) => f.write_str(
                "this name is in use: send `If-Match` with the `ETag` of the version that this is for",
            ),
            Self::Unfit(Unfit::NotThisVersion) => {
                f.write_str("it is not in this version: read it again, and look at what changed")
            }
            Self::TooManyPrograms => write!(f, "there are {MAX_PROGRAMS} programs: remove some first"),
            Self::TooManyPoints => write!(f, "there are {MAX_KEPT} points: remove some first"),
            Self::TooManyBytes => {
                write!(f, "all programs have {} MiB at most: remove some first", MAX_TOTAL >> 20)
            }
            Self::Store(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for LibraryError {}

impl From<StoreError> for LibraryError {
    fn from(error: StoreError) -> Self {
        Self::Store(error)
    }
}

impl From<Unfit> for LibraryError {
    fn from(unfit: Unfit) -> Self {
        Self::Unfit(unfit)
    }
}
