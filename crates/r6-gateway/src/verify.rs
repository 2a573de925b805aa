//! Checks the audit log of a folder or a database, and the heads that were signed of it.

use std::fmt;
use std::path::Path;

use serde::Deserialize;

use crate::backup;
use crate::core::chain::{Broken, Hash, Verifier};
use crate::core::head::{Head, Kind, PublicKey, Unfit};
use crate::core::retention::LEAST_ENTRIES;
use crate::shell::At;
use crate::store::postgres::Postgres;
use crate::store::{Entry, MAX_PAGE, Sqlite, Store, StoreError};

/// How messages call the head that was given.
const KEPT: &str = "the kept head";

/// An audit log that is whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verified {
    /// How many entries it has.
    pub entries: u64,
    /// How many older entries retention removed.
    pub removed: u64,
    /// The hash of the last entry.
    pub head: String,
    /// The public key of the log; `None` if it has none yet.
    pub key: Option<String>,
    /// The newest head that the gateway stored, if it did.
    pub stored: Option<Signed>,
    /// The head that was kept elsewhere, if it was given.
    pub kept: Option<Signed>,
}

/// A head that the log has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Signed {
    /// The number of its entry.
    pub number: u64,
    /// When it was signed: RFC 3339, UTC.
    pub time: String,
}

/// Why a log was not found to be whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum VerifyError {
    /// The store cannot be read, or its chain is broken.
    Store(StoreError),
    /// The log is not what a head says, or a head is not what a key signed: for people.
    Changed(String),
    /// None of the keys signed this head.
    OtherKey {
        /// Which head: for people.
        what: &'static str,
    },
    /// The entry of the kept head was removed because the log was too long, so nothing is known about it.
    Removed {
        /// The number of the entry.
        number: u64,
        /// The number of the last entry that was removed.
        removed: u64,
    },
    /// There is a head, and no key to check it with.
    NoKey,
    /// What was given as a head is not one.
    NoHead,
}

impl fmt::Display for VerifyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Store(error) => error.fmt(f),
            Self::Changed(why) => f.write_str(why),
            Self::OtherKey { what } => write!(f, "{what}: another key signed it"),
            Self::Removed { number, removed } => write!(
                f,
                "the kept head is about entry {number}, and the entries up to {removed} were removed: use a \
                 newer head"
            ),
            Self::NoKey => f.write_str("the log has no key to check the head with"),
            Self::NoHead => f.write_str("this is not a head of an audit log"),
        }
    }
}

impl std::error::Error for VerifyError {}

impl From<StoreError> for VerifyError {
    fn from(error: StoreError) -> Self {
        Self::Store(error)
    }
}

/// The store of a folder that is only read. A backup is written by no other process.
pub fn to_read(folder: &Path) -> Result<Sqlite, StoreError> {
    Sqlite::open_to_read(folder, folder.join(backup::LIST).is_file())
}

/// Checks the audit log from its first entry to its last, and that it has the entry of each head. Nothing is
/// changed, also if an older r6 made the file.
///
/// `kept` is a head that was kept elsewhere: its text, or the answer of `GET /v1/audit/head`. `keys` are the
/// public keys that may have signed heads. Without any, the log's own is used, which a person who can write
/// to the folder can replace.
///
/// # Errors
/// [`VerifyError`].
pub fn verify(at: impl Into<At>, keys: &[PublicKey], kept: Option<&str>) -> Result<Verified, VerifyError> {
    match at.into() {
        At::Folder(folder) => {
            let mut store = to_read(&folder)?;
            store.hold_still()?;
            of_store(&mut store, keys, kept)
        }
        At::Database(database) => {
            let mut store = Postgres::open_to_read(&database)?;
            store.hold_still()?;
            of_store(&mut store, keys, kept)
        }
    }
}

/// The same for a store that is open.
pub fn of_store(
    store: &mut dyn Store,
    keys: &[PublicKey],
    kept: Option<&str>,
) -> Result<Verified, VerifyError> {
    let heads = store.heads()?;
    let own = heads.key.as_deref().and_then(PublicKey::parse);
    let keys = if keys.is_empty() { own.as_slice() } else { keys };
    let cut = heads.cut.map(|note| open(keys, "the head of the removed entries", Kind::Cut, &note));
    let stored = heads.end.map(|note| open(keys, "the stored head", Kind::End, &note));
    let (cut, stored) = (cut.transpose()?, stored.transpose()?);
    let given = |note: &str| {
        let note = note_of(note).ok_or(VerifyError::NoHead)?;
        if keys.first().is_some_and(|key| key.open_as(Kind::End, &note) == Err(Unfit::Malformed)) {
            return Err(VerifyError::NoHead);
        }
        open(keys, KEPT, Kind::End, &note)
    };
    let kept = kept.map(given).transpose()?;
    let wanted = [("the stored head", &stored), (KEPT, &kept)];
    let mut wanted: Vec<_> = wanted
        .into_iter()
        .filter_map(|(what, head)| Some(Wanted { what, head: head.as_ref()?, found: None }))
        .collect();
    let start = cut.as_ref().map_or((0, Hash::ORIGIN), |cut| (cut.number, cut.hash));
    if start.0 == 0 {
        // The head of an empty log.
        look(&mut wanted, start);
    }
    let mut restored = None;
    let end = walk(store, start, |entry| {
        look(&mut wanted, (entry.number, entry.hash));
        // A text of a user cannot have this: its quotes are escaped.
        if entry.body.contains(r#""what":"restored""#) {
            restored = Some(entry.number);
        }
    })?;
    for wanted in &wanted {
        wanted.judge(start.0, end.0, restored)?;
    }
    if start.0 > 0 && end == start {
        // The newest entries are never removed.
        return Err(VerifyError::Store(Broken::Head { number: start.0 }.into()));
    }
    let left = end.0 - start.0;
    if start.0 > 0 && left < u64::from(LEAST_ENTRIES) {
        let why = format!(
            "entries up to {} were removed, and {left} entries are left: the gateway never leaves fewer than \
             {LEAST_ENTRIES}",
            start.0
        );
        return Err(VerifyError::Changed(why));
    }
    let signed = |head: Option<Head>| head.map(|Head { number, time, .. }| Signed { number, time });
    Ok(Verified {
        entries: left,
        removed: start.0,
        head: end.1.to_string(),
        key: own.map(|key| key.to_string()),
        stored: signed(stored),
        kept: signed(kept),
    })
}

/// Reads a head that one of these keys signed.
fn open(keys: &[PublicKey], what: &'static str, kind: Kind, note: &str) -> Result<Head, VerifyError> {
    let mut wrong = VerifyError::NoKey;
    for key in keys {
        match key.open_as(kind, note) {
            Ok(head) => return Ok(head),
            Err(Unfit::OtherKey) => wrong = VerifyError::OtherKey { what },
            Err(unfit) => return Err(VerifyError::Changed(format!("{what}: {unfit}"))),
        }
    }
    Err(wrong)
}

/// Checks each entry behind this one. Returns the number and the hash of the last one.
fn walk(
    store: &mut dyn Store,
    (number, hash): (u64, Hash),
    mut each: impl FnMut(&Entry),
) -> Result<(u64, Hash), StoreError> {
    let mut verifier = Verifier::after(number, hash);
    // From the first entry on, so that entries before the cut are noticed.
    let mut after = 0;
    loop {
        let page = store.entries(after, MAX_PAGE)?;
        for entry in &page {
            verifier.check(entry.number, &entry.body, entry.hash).map_err(StoreError::Broken)?;
            each(entry);
            after = entry.number;
        }
        if page.is_empty() {
            return Ok(verifier.head());
        }
    }
}

/// A head whose entry the log should have.
struct Wanted<'h> {
    what: &'static str,
    head: &'h Head,
    found: Option<Hash>,
}

/// Notes the hash of an entry for the heads of its number.
fn look(wanted: &mut [Wanted<'_>], (number, hash): (u64, Hash)) {
    for wanted in wanted {
        if wanted.head.number == number {
            wanted.found = Some(hash);
        }
    }
}

impl Wanted<'_> {
    fn judge(&self, removed: u64, last: u64, restored: Option<u64>) -> Result<(), VerifyError> {
        let Self { what, head: Head { number, hash, time, .. }, found } = self;
        let what = format!("{what} of {time}");
        let since = restored.map_or_else(String::new, |entry| {
            format!("; entry {entry} says that the folder was restored from a backup")
        });
        let why = match found {
            Some(found) if found == hash => return Ok(()),
            Some(_) => format!("entry {number} is not that of {what}: the log was rewritten{since}"),
            None if *number > last => {
                format!(
                    "{what} is about entry {number}, and the log ends with {last}: its end was cut off{since}"
                )
            }
            None if self.what == KEPT => {
                return Err(VerifyError::Removed { number: *number, removed });
            }
            None => format!("{what} is about entry {number}, and those up to {removed} were removed"),
        };
        Err(VerifyError::Changed(why))
    }
}

/// The note of what was kept: the note itself, or the answer of the API.
fn note_of(text: &str) -> Option<String> {
    #[derive(Deserialize)]
    struct Answer {
        note: String,
    }
    if text.trim_start().starts_with('{') {
        return serde_json::from_str(text).ok().map(|Answer { note }| note);
    }
    // An editor may have added or removed line feeds at the end.
    Some(text.trim_end().replace("\r\n", "\n") + "\n")
}

#[cfg(test)]
mod tests;
