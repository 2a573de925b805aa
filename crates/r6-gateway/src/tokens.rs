//! Tokens: who may use the gateway.
//!
//! A token is 256 random bits. The store has its SHA-256 only. All tokens are held in memory and read again
//! twice a second, so that a stop needs no disk, and a revoked token is refused within a second.
//!
//! A browser sends no token over a WebSocket, so it is given a session for its token, with the cookie, the
//! proof and the ends of a session of a user.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::{Arc, Mutex as SyncMutex, MutexGuard, PoisonError, RwLock};
use std::time::Duration;

use r6_api::gateway::Secret;
use r6_proto::time::Instant;
use tokio::sync::Mutex;

use crate::accounts;
use crate::clock;
use crate::core::rate::Rate;
use crate::core::role::Grant;
use crate::core::session::{SessionId, Sessions};
use crate::expiry::Expiry;
use crate::secret;
use crate::store::{Keeper, StoreError, Token};

/// How every token begins, so that people and scanners of leaks know it.
const PREFIX: &str = "r6_";

/// How often the tokens are read again.
pub const REFRESH: Duration = Duration::from_millis(500);

/// An unknown token makes the gateway read the tokens again, but not more often than this: strangers must not
/// keep the disk busy.
const AT_MOST_EVERY: Duration = Duration::from_millis(50);

/// Draws a token: its text, which is shown once, and its hash, which is stored.
///
/// # Errors
/// The system has no random numbers.
pub fn draw() -> Result<(String, [u8; 32]), getrandom::Error> {
    secret::draw(PREFIX)
}

/// A token that is valid, without its secret.
#[derive(Clone, Debug)]
pub struct Known {
    /// Its number.
    pub number: i64,
    /// What people call it; empty if it has no name.
    pub name: String,
    /// `token`, its number and name, for people: `token 3 (screen)`.
    pub label: String,
    /// What it allows.
    pub grant: Grant,
    /// When it ends; `None`: it holds until it is revoked.
    pub expires: Option<Expiry>,
}

impl Known {
    fn holds(&self) -> bool {
        self.expires.is_none_or(|expires| !expires.is_over())
    }
}

/// What people are told of a token: `token`, its number, and its name if it has one.
pub fn label(number: i64, name: &str) -> String {
    if name.is_empty() { format!("token {number}") } else { format!("token {number} ({name})") }
}

/// A browser that was given a session for a token.
#[derive(Clone)]
pub struct Page {
    /// The session.
    pub id: SessionId,
    /// What proves that the page that sends a request belongs to the session.
    pub csrf: Secret,
    /// When the session ends if no other request comes, and when it ends in any case.
    pub ends: (Instant, Instant),
}

impl fmt::Debug for Page {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Page").finish_non_exhaustive()
    }
}

/// The tokens that are valid now.
#[derive(Debug)]
pub struct Tokens {
    keeper: Keeper,
    known: RwLock<BTreeMap<[u8; 32], Arc<Known>>>,
    /// By the number of the token. They outlive a reading of the tokens.
    rates: SyncMutex<BTreeMap<i64, Rate>>,
    /// Those of browsers, by the number of the token.
    sessions: SyncMutex<Sessions<i64>>,
    /// The tokens that links stand for, by the hashes of their secrets. They end with the process.
    links: SyncMutex<BTreeMap<[u8; 32], i64>>,
    read_at: Mutex<Instant>,
}

impl Tokens {
    /// The tokens of a store.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn read(keeper: Keeper) -> Result<Self, StoreError> {
        let (known, rates) = (RwLock::default(), SyncMutex::default());
        let (sessions, read_at) = (SyncMutex::default(), Mutex::new(Instant::ORIGIN));
        let links = SyncMutex::default();
        let tokens = Self { keeper, known, rates, sessions, links, read_at };
        tokens.refresh().await?;
        Ok(tokens)
    }

    /// The token with this text, if it is valid.
    pub async fn find(&self, text: &str) -> Option<Arc<Known>> {
        let hash = secret::hash(text);
        if let Some(known) = self.known(&hash) {
            return Some(known);
        }
        // It may have been made a moment ago.
        self.read_since(clock::now()).await.ok()?;
        self.known(&hash)
    }

    /// The token with this number, if it is valid.
    pub async fn find_number(&self, number: i64) -> Option<Arc<Known>> {
        if let Some(known) = self.with_number(number) {
            return Some(known);
        }
        // Another gateway may have read of it before.
        self.read_since(clock::now()).await.ok()?;
        self.with_number(number)
    }

    /// Makes a link with which browsers get sessions for the token with this number: its secret. It opens any
    /// number of sessions, so that a second browser can use it, or a browser whose session has ended. It ends
    /// with the process. A token that leaks can send requests from anywhere; this secret gives only sessions,
    /// which end, and whose pages are checked.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn make_link(&self, number: i64) -> Result<Secret, getrandom::Error> {
        let (text, hash) = secret::draw("")?;
        self.links.lock().unwrap_or_else(PoisonError::into_inner).insert(hash, number);
        Ok(Secret(text))
    }

    /// The token that the link with this secret stands for, if it is still valid.
    pub fn of_link(&self, text: &str) -> Option<Arc<Known>> {
        let links = self.links.lock().unwrap_or_else(PoisonError::into_inner);
        let number = links.get(&secret::hash(text)).copied()?;
        drop(links);
        self.with_number(number)
    }

    fn with_number(&self, number: i64) -> Option<Arc<Known>> {
        let known = self.known.read().unwrap_or_else(PoisonError::into_inner);
        known.values().find(|known| known.number == number && known.holds()).cloned()
    }

    /// Whether the token with this number is still valid.
    pub fn is_valid(&self, number: i64) -> bool {
        self.with_number(number).is_some()
    }

    /// Begins a session of a browser for this token. Returns its secret, which is nowhere else.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn begin_session(&self, token: &Known) -> Result<(Secret, Page), getrandom::Error> {
        let (text, id) = secret::draw("")?;
        let now = clock::now();
        let mut sessions = self.sessions();
        sessions.begin(id, token.number, 0, now);
        let ends = sessions.look(&id, now).map_or((now, now), |session| session.ends());
        let page = Page { id, csrf: accounts::csrf(&text), ends };
        Ok((Secret(text), page))
    }

    /// The token and the session of the browser with this secret, if the session is open. This is a request
    /// of the session.
    pub fn session(&self, text: &str) -> Option<(Arc<Known>, Page)> {
        let id = secret::hash(text);
        let session = self.sessions().request(&id, clock::now())?;
        let token = self.with_number(session.owner)?;
        Some((token, Page { id, csrf: accounts::csrf(text), ends: session.ends() }))
    }

    /// Whether the session of a browser is open. To look is no request.
    pub fn is_open(&self, id: &SessionId) -> bool {
        let number = self.sessions().look(id, clock::now()).map(|session| session.owner);
        number.is_some_and(|number| self.is_valid(number))
    }

    /// Ends the session of a browser.
    pub fn end_session(&self, id: &SessionId) {
        self.sessions().end(id, clock::now());
    }

    fn sessions(&self) -> MutexGuard<'_, Sessions<i64>> {
        self.sessions.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts a request of the token with this number.
    ///
    /// # Errors
    /// It made too many: how long to wait.
    pub fn request(&self, number: i64) -> Result<(), Duration> {
        let mut rates = self.rates.lock().unwrap_or_else(PoisonError::into_inner);
        rates.entry(number).or_default().request(clock::now())
    }

    /// Reads the tokens again.
    ///
    /// # Errors
    /// [`StoreError`]: the tokens stay as they were.
    pub async fn refresh(&self) -> Result<(), StoreError> {
        self.read_now(&mut *self.read_at.lock().await).await
    }

    /// Reads the tokens again, unless that was done after `asked`. Many strangers at once share one reading.
    async fn read_since(&self, asked: Instant) -> Result<(), StoreError> {
        let mut read_at = self.read_at.lock().await;
        if *read_at > asked {
            return Ok(());
        }
        let since = clock::now().since(*read_at);
        tokio::time::sleep(AT_MOST_EVERY.saturating_sub(since)).await;
        self.read_now(&mut read_at).await
    }

    async fn read_now(&self, read_at: &mut Instant) -> Result<(), StoreError> {
        let now = clock::now();
        let tokens = self.keeper.tokens().await?;
        *read_at = now;
        let known = tokens.into_iter().map(|Token { number, hash, grant, name, expires }| {
            let label = label(number, &name);
            (hash, Arc::new(Known { number, name, label, grant, expires }))
        });
        let known: BTreeMap<_, _> = known.filter(|(_, known)| known.holds()).collect();
        let valid: BTreeSet<_> = known.values().map(|known| known.number).collect();
        self.rates.lock().unwrap_or_else(PoisonError::into_inner).retain(|number, _| valid.contains(number));
        self.sessions().retain(now, |number| valid.contains(number).then_some(0));
        *self.known.write().unwrap_or_else(PoisonError::into_inner) = known;
        Ok(())
    }

    fn known(&self, hash: &[u8; 32]) -> Option<Arc<Known>> {
        let known = self.known.read().unwrap_or_else(PoisonError::into_inner);
        known.get(hash).filter(|known| known.holds()).cloned()
    }
}
