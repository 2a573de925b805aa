//! The points of a store: what all implementations have in common.

use r6_api::gateway::{AuditRecord, Deed};

use super::{Author, LibraryError};
use crate::core::library::Tag;
use crate::core::point::{MAX_KEPT, PointName};

/// A version of a point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeptPoint {
    /// The name of the point.
    pub name: PointName,
    /// Its number, and the hash of its text.
    pub tag: Tag,
    /// When it was stored.
    pub stored_at: String,
    /// Who stored it.
    pub stored_by: String,
    /// Its value, JSON.
    pub text: String,
}

/// A version to add.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewPoint {
    /// The name of the point.
    pub name: PointName,
    /// Its value, JSON.
    pub text: String,
    /// SHA-256 of the text.
    pub hash: [u8; 32],
    /// Who stores it.
    pub by: Author,
}

impl NewPoint {
    /// The version behind this one; the first one without a version before.
    pub(super) fn kept(&self, last: Option<Tag>) -> KeptPoint {
        let version = last.map_or(0, |last| last.version) + 1;
        KeptPoint {
            name: self.name.clone(),
            tag: Tag { version, hash: self.hash },
            stored_at: self.by.time.clone(),
            stored_by: self.by.actor.clone(),
            text: self.text.clone(),
        }
    }

    /// The record about it.
    pub(super) fn record(&self, kept: &KeptPoint) -> AuditRecord {
        let (version, sha256) = (kept.tag.version, kept.tag.sha256());
        self.by.record(Deed::PointStored { point: self.name.to_string(), version, sha256 })
    }
}

/// Refuses a new point if the store has [`MAX_KEPT`] points.
pub(super) fn check_room(points: usize) -> Result<(), LibraryError> {
    if points >= MAX_KEPT { Err(LibraryError::TooManyPoints) } else { Ok(()) }
}

/// The record about a point that was removed.
pub(super) fn removed(name: &PointName, last: Tag, by: &Author) -> AuditRecord {
    by.record(Deed::PointRemoved { point: name.to_string(), version: last.version })
}
