//! Signs the heads of the audit log, and removes its oldest entries.
//!
//! Both run beside everything else. If they fail, the log is as it was, and they try again.

use std::path::Path;
use std::time::Duration;

use r6_api::gateway::{AuditRecord, Deed};
use tokio::sync::Mutex;
use tokio::time::MissedTickBehavior;

use crate::clock;
use crate::core::chain::{Broken, Hash, Verifier};
use crate::core::head::{Head, Kind, MAX_BYTES, PublicKey, Signer, Unfit};
use crate::core::retention;
use crate::files;
use crate::secret;
use crate::store::{Ends, Heads, Keeper, MAX_PAGE, Store, StoreError};

/// The file with the secret key, in the folder of the gateway. It is not in a backup: a folder that is
/// restored must not sign with the key of a gateway that may go on.
const KEY_FILE: &str = "audit.key";

/// How often to look for entries to remove.
const LOOK: Duration = Duration::from_secs(60);

/// How many looks pass from one signed head in the store to the next.
const LOOKS_PER_HEAD: u64 = 10;

/// How many batches a look removes. A million entries a minute is more than clients can make.
const MAX_BATCHES: u64 = 1_000;

/// How much of the audit log is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AuditSettings {
    /// The most entries to keep, 1000 at least. The oldest ones go first. An entry takes about 0.4 KiB.
    pub max_entries: u64,
}

impl Default for AuditSettings {
    /// Two million entries.
    fn default() -> Self {
        Self { max_entries: 2_000_000 }
    }
}

/// Signs heads and removes old entries.
#[derive(Debug)]
pub struct Auditor {
    keeper: Keeper,
    signer: Signer,
    settings: AuditSettings,
    /// The last entry that was signed, once that is known. Locked while a head is signed and while entries
    /// are removed.
    signed: Mutex<Option<(u64, Hash)>>,
}

impl Auditor {
    /// An auditor that signs with this key. [`begin`] has made it the key of the store.
    pub fn new(keeper: Keeper, signer: Signer, settings: AuditSettings) -> Self {
        Self { keeper, signer, settings, signed: Mutex::default() }
    }

    /// The public half of the key.
    pub fn key(&self) -> PublicKey {
        self.signer.key()
    }

    /// The present head of the log, and its signed text, which is in the store then.
    ///
    /// # Errors
    /// [`StoreError::Broken`] if the log does not have the entry that was signed last. Other [`StoreError`]s.
    pub async fn head(&self) -> Result<(Head, String), StoreError> {
        let mut signed = self.signed.lock().await;
        let (head, note) = self.sign(&mut signed).await?;
        // Before it is given out, so that the next start also knows what was signed.
        self.keeper.put_head(note.clone()).await?;
        Ok((head, note))
    }

    /// Signs the present head. A head that contradicts an earlier one is never signed: otherwise the newer
    /// one would hide that the log was cut off.
    async fn sign(&self, signed: &mut Option<(u64, Hash)>) -> Result<(Head, String), StoreError> {
        let before = match *signed {
            Some(before) => Some(before),
            None => match self.keeper.heads().await?.end {
                Some(note) => Some(of_end(self.key(), &note)?),
                None => None,
            },
        };
        let Ends { last, hash, .. } = self.keeper.ends().await?;
        if let Some((number, was)) = before.filter(|(number, _)| *number > 0) {
            let now = self.keeper.entries(number - 1, 1).await?.pop();
            if now.is_none_or(|entry| (entry.number, entry.hash) != (number, was)) {
                return Err(Broken::Head { number }.into());
            }
        }
        *signed = Some((last, hash));
        let head = Head { kind: Kind::End, number: last, hash, time: clock::time_of_day() };
        let note = self.signer.sign(&head);
        Ok((head, note))
    }

    /// Puts the present head into the store.
    ///
    /// # Errors
    /// As [`Self::head`].
    pub async fn put_head(&self) -> Result<(), StoreError> {
        let mut signed = self.signed.lock().await;
        let (_, note) = self.sign(&mut signed).await?;
        self.keeper.put_head(note).await
    }

    /// Signs heads and removes old entries from time to time, for as long as it is polled.
    pub async fn keep(&self) {
        let mut look = tokio::time::interval(LOOK);
        look.set_missed_tick_behavior(MissedTickBehavior::Delay);
        for number in 0_u64.. {
            look.tick().await;
            if let Err(error) = self.remove_old().await {
                tracing::error!(%error, "the oldest entries of the audit log could not be removed");
            }
            if number % LOOKS_PER_HEAD == 0
                && let Err(error) = self.put_head().await
            {
                tracing::error!(%error, "the head of the audit log could not be stored");
            }
        }
    }

    /// Removes the entries that are too many. Entries that do not fit their hashes stay: to remove them would
    /// hide that they were changed.
    ///
    /// # Errors
    /// [`StoreError`]. What was removed until then has its signed head.
    pub async fn remove_old(&self) -> Result<(), StoreError> {
        for _ in 0..MAX_BATCHES {
            let mut signed = self.signed.lock().await;
            let Ends { first, last, open, .. } = self.keeper.ends().await?;
            let Some(until) = retention::cut(self.settings.max_entries, first, last, open) else { break };
            let start = start_of(self.key(), &self.keeper.heads().await?)?;
            let mut verifier = Verifier::after(start.0, start.1);
            for entry in self.keeper.entries(0, MAX_PAGE).await? {
                if entry.number <= until {
                    verifier.check(entry.number, &entry.body, entry.hash)?;
                }
            }
            // The stored head must not be about an entry that goes.
            let (_, note) = self.sign(&mut signed).await?;
            self.keeper.put_head(note).await?;
            let ((number, hash), time) = (verifier.head(), clock::time_of_day());
            let note = self.signer.sign(&Head { kind: Kind::Cut, number, hash, time });
            self.keeper.cut(number, note).await?;
        }
        Ok(())
    }
}

/// Makes this key the one of the store, before anything is appended to its log. The first start, a lost
/// `audit.key` and a restored backup make another key: the log tells of it, and the head of the removed
/// entries is signed anew.
///
/// # Errors
/// [`StoreError::Broken`]: the log does not fit the signed heads beside it. Other [`StoreError`]s.
pub fn begin(store: &mut dyn Store, signer: &Signer) -> Result<(), StoreError> {
    let heads = store.heads()?;
    let before = heads.key.as_deref().map(|text| {
        let unreadable = || StoreError::Unreadable("the public key of the audit log".to_owned());
        PublicKey::parse(text).ok_or_else(unreadable)
    });
    let before = before.transpose()?;
    let mut start = (0, Hash::ORIGIN);
    if let Some(key) = before {
        start = start_of(key, &heads)?;
        check(store, start, heads.end.as_deref().map(|note| of_end(key, note)).transpose()?)?;
    } else if heads.end.is_some() || heads.cut.is_some() {
        return Err(Broken::Signature(Unfit::OtherKey).into());
    }
    let key = signer.key();
    if before == Some(key) {
        return Ok(());
    }
    if before.is_some() {
        tracing::warn!(%key, "the heads of the audit log are signed with another key from now on");
    }
    let time = clock::time_of_day();
    let (number, hash) = start;
    let cut = Head { kind: Kind::Cut, number, hash, time: time.clone() };
    let cut = heads.cut.is_some().then(|| signer.sign(&cut));
    let deed = Deed::AuditKey { key: key.to_string() };
    let record = AuditRecord { time, actor: "gateway".to_owned(), source: None, robot: None, deed };
    store.put_key(&key.to_string(), cut.as_deref(), &record)
}

/// Checks what can be checked at once: the first entry, and the entry of the newest head.
fn check(store: &mut dyn Store, start: (u64, Hash), end: Option<(u64, Hash)>) -> Result<(), StoreError> {
    let mut verifier = Verifier::after(start.0, start.1);
    match store.entries(0, 1)?.pop() {
        Some(first) => {
            verifier.check(first.number, &first.body, first.hash)?;
        }
        None if start.0 > 0 => return Err(Broken::Head { number: start.0 }.into()),
        None => {}
    }
    let Some((number, hash)) = end.filter(|end| *end != start) else { return Ok(()) };
    let there = store.entries(number.saturating_sub(1), 1)?.pop();
    match there {
        Some(entry) if (entry.number, entry.hash) == (number, hash) => Ok(()),
        _ => Err(Broken::Head { number }.into()),
    }
}

/// What the first entry of the log follows: the newest removed entry.
///
/// # Errors
/// [`StoreError::Broken`]: the head of the removed entries is wrong.
pub fn start_of(key: PublicKey, heads: &Heads) -> Result<(u64, Hash), StoreError> {
    let Some(note) = &heads.cut else { return Ok((0, Hash::ORIGIN)) };
    let cut = key.open_as(Kind::Cut, note).map_err(Broken::Signature)?;
    Ok((cut.number, cut.hash))
}

fn of_end(key: PublicKey, note: &str) -> Result<(u64, Hash), StoreError> {
    let end = key.open_as(Kind::End, note).map_err(Broken::Signature)?;
    Ok((end.number, end.hash))
}

/// The key of a folder. It is made if it is missing.
///
/// # Errors
/// [`StoreError`]: the file cannot be read or written, or is not a key.
pub fn open_key(folder: &Path) -> Result<Signer, StoreError> {
    if let Some(signer) = read_key(folder)? {
        return Ok(signer);
    }
    let failed = |why: String| StoreError::Unavailable(format!("{KEY_FILE}: {why}"));
    let mut seed = [0; 32];
    secret::fill(&mut seed).map_err(|error| failed(format!("no random numbers: {error}")))?;
    let signer = Signer::of_seed(seed).ok_or_else(|| failed("no key could be made".to_owned()))?;
    files::write(&folder.join(KEY_FILE), signer.secret().as_bytes())
        .map_err(|error| failed(error.to_string()))?;
    Ok(signer)
}

/// The key of a folder; `None` if it is missing.
///
/// # Errors
/// [`StoreError`]: the file cannot be read, or is not a key.
fn read_key(folder: &Path) -> Result<Option<Signer>, StoreError> {
    let path = folder.join(KEY_FILE);
    let text = match files::read(&path, MAX_BYTES as u64) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        text => text.map_err(|error| StoreError::Unavailable(format!("{}: {error}", path.display())))?,
    };
    let signer = String::from_utf8(text).ok().and_then(|text| Signer::parse(&text));
    let wrong = || StoreError::Unreadable(format!("{} is not the key of an audit log", path.display()));
    signer.map(Some).ok_or_else(wrong)
}
