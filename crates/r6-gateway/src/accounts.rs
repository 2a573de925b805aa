//! Users: who they are, their passwords, sessions and one-time links.
//!
//! What is decided is in the core: which change of a user is allowed (`core/account.rs`), how long a session
//! is open (`core/session.rs`), how often passwords can be tried (`core/sign_in.rs`). Here are the store, the
//! clock, random numbers and threads. All users are held in memory and read again twice a second, as tokens
//! are, so that a request with a session needs no disk.

mod ledger;
mod passwords;

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex as SyncMutex, MutexGuard, PoisonError, RwLock};
use std::time::{Duration, UNIX_EPOCH};

use r6_api::Code;
use r6_api::gateway::{Deed, PasswordChange, Secret, Setup, SignIn};
use r6_proto::time::Instant;
use tokio::sync::Mutex;

use crate::clock;
use crate::core::account::{self, Decided, PASSWORD_LENGTH, PasswordHash, UserName, Wish};
use crate::core::rate::Rate;
use crate::core::session::{SessionId, Sessions};
use crate::core::sign_in::{Attempt, SignIns};
use crate::fleet::station::By;
use crate::outage::Outage;
use crate::problem::Problem;
use crate::secret;
use crate::store::{Author, Keeper, Link, StoreError, StoredUser, UserChange};

pub use ledger::Ledger;
use passwords::Passwords;

/// How often the users are read again.
const REFRESH: Duration = Duration::from_millis(500);

/// A request of a session.
#[derive(Clone)]
pub struct SignedIn {
    /// The session.
    pub id: SessionId,
    /// The user, as it was at this request.
    pub user: Arc<StoredUser>,
    /// What proves that the page that sends a request belongs to the session.
    pub csrf: Secret,
    /// When the session ends if no other request comes, and when it ends in any case.
    pub ends: (Instant, Instant),
}

impl std::fmt::Debug for SignedIn {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SignedIn").field("user", &self.user.account.name).finish_non_exhaustive()
    }
}

/// The users and their sessions.
#[derive(Debug)]
pub struct Accounts {
    keeper: Keeper,
    users: RwLock<BTreeMap<UserName, Arc<StoredUser>>>,
    /// Locked while the users are read, so that an older state never takes the place of a newer one.
    reading: Mutex<()>,
    sessions: SyncMutex<Sessions<UserName>>,
    rates: SyncMutex<BTreeMap<UserName, Rate>>,
    sign_ins: SyncMutex<SignIns>,
    passwords: Passwords,
    /// What the audit log tells of users.
    pub ledger: Ledger,
}

impl Accounts {
    /// The users of a store.
    ///
    /// # Errors
    /// The store cannot be read, or the system has no random numbers.
    pub async fn read(keeper: Keeper) -> Result<Self, StoreError> {
        let unavailable = |what: String| StoreError::Unavailable(what);
        let mut seed = [0; 32];
        secret::fill(&mut seed).map_err(|error| unavailable(format!("no random numbers: {error}")))?;
        let accounts = Self {
            ledger: Ledger::new(keeper.clone()),
            keeper,
            users: RwLock::default(),
            reading: Mutex::default(),
            sessions: SyncMutex::default(),
            rates: SyncMutex::default(),
            sign_ins: SyncMutex::new(SignIns::new(seed)),
            passwords: Passwords::new().map_err(|problem| unavailable(problem.message))?,
        };
        accounts.refresh().await?;
        Ok(accounts)
    }

    /// Reads the users again and again, for as long as it is polled.
    pub async fn keep_fresh(&self) {
        let mut outage = Outage::default();
        loop {
            tokio::time::sleep(REFRESH).await;
            outage.note("the users cannot be read", &self.refresh().await);
        }
    }

    async fn refresh(&self) -> Result<(), StoreError> {
        let _turn = self.reading.lock().await;
        let users = self.keeper.users().await?.into_iter();
        self.hold(users.map(|user| (user.account.name.clone(), Arc::new(user))).collect());
        Ok(())
    }

    /// Writes a change. It holds in memory before this returns, also if the disk fails right after it: then
    /// sessions of the state before have ended, except `going_on`, which is a session of the user.
    async fn write(
        &self,
        change: UserChange,
        author: Author,
        going_on: Option<&SessionId>,
    ) -> Result<Decided, StoreError> {
        let name = change.name.clone();
        let time = author.time.clone();
        // An older state that is read meanwhile must not take its place.
        let _turn = self.reading.lock().await;
        let (decided, stamp) = self.keeper.change_user(change, author).await?;
        let mut users = self.users.read().unwrap_or_else(PoisonError::into_inner).clone();
        match &decided {
            Decided::Same => return Ok(decided),
            Decided::Removed => drop(users.remove(&name)),
            Decided::Made(account) | Decided::Changed(account) => {
                let created = users.get(&name).map_or(time, |user| user.created.clone());
                let user = StoredUser { account: account.clone(), created, stamp };
                users.insert(name, Arc::new(user));
            }
        }
        if let Some(id) = going_on {
            self.sessions().renew(id, stamp);
        }
        self.hold(users);
        Ok(decided)
    }

    /// Makes these the users, and ends the sessions of those that changed.
    fn hold(&self, users: BTreeMap<UserName, Arc<StoredUser>>) {
        self.sessions().retain(clock::now(), |name| {
            users.get(name).filter(|user| is_enabled(user)).map(|user| user.stamp)
        });
        lock(&self.rates).retain(|name, _| users.contains_key(name));
        *self.users.write().unwrap_or_else(PoisonError::into_inner) = users;
    }

    /// All users, in the order of their names.
    pub fn users(&self) -> Vec<Arc<StoredUser>> {
        self.users.read().unwrap_or_else(PoisonError::into_inner).values().cloned().collect()
    }

    fn user(&self, name: &UserName) -> Option<Arc<StoredUser>> {
        self.users.read().unwrap_or_else(PoisonError::into_inner).get(name).cloned()
    }

    /// Signs a user in. Returns the secret of the session, which is nowhere else, and the session.
    ///
    /// # Errors
    /// `wrong_password`, also if there is no such user or it is disabled; `too_many_requests`, `overloaded`.
    pub async fn sign_in(&self, asked: SignIn, source: SocketAddr) -> Result<(Secret, SignedIn), Problem> {
        let SignIn { name, password } = asked;
        let user = UserName::new(&name).and_then(|name| self.user(&name));
        let attempt = self.begin(&name, source)?;
        let hash =
            user.as_deref().filter(|user| is_enabled(user)).and_then(|user| user.account.password.as_ref());
        let is_right = self.check(&attempt, password, hash).await?;
        let Some(user) = user.filter(|_| is_right) else {
            return Err(self.failed(&name, source));
        };
        let (text, id) = secret::draw("").map_err(|error| no_random(&error))?;
        let name = user.account.name.clone();
        let now = clock::now();
        lock(&self.sign_ins).succeeded(&attempt, &name, now);
        self.sessions().begin(id, name.clone(), user.stamp, now);
        tracing::info!(user = %name, %source, "a user signed in");
        let by = By { actor: name.to_string(), source: Some(source.to_string()) };
        self.ledger.tell(&by, Deed::SignedIn {}).await;
        // The user may have been changed meanwhile.
        let signed_in = self
            .session(&text)
            .ok_or_else(|| Problem::new(Code::NoSession, "the user was changed meanwhile: sign in again"))?;
        Ok((Secret(text), signed_in))
    }

    /// The session with this secret, if it is open. This is a request of the session.
    pub fn session(&self, text: &str) -> Option<SignedIn> {
        let id = secret::hash(text);
        let session = self.sessions().request(&id, clock::now())?;
        let user =
            self.user(&session.owner).filter(|user| is_enabled(user) && user.stamp <= session.stamp)?;
        Some(SignedIn { id, user, csrf: csrf(text), ends: session.ends() })
    }

    /// The user with this name who may sign in, if there is one.
    pub async fn find(&self, name: &str) -> Option<Arc<StoredUser>> {
        let name = UserName::new(name)?;
        let known = || self.user(&name).filter(|user| is_enabled(user));
        if let Some(user) = known() {
            return Some(user);
        }
        // Another gateway may have read of it before.
        self.refresh().await.ok()?;
        known()
    }

    /// Whether the user with this name may sign in.
    pub fn has(&self, name: &UserName) -> bool {
        self.user(name).is_some_and(|user| is_enabled(&user))
    }

    /// Whether a session is open. To look is no request.
    pub fn is_open(&self, id: &SessionId) -> bool {
        let of = self.sessions().look(id, clock::now()).map(|session| (session.owner.clone(), session.stamp));
        of.is_some_and(|(name, stamp)| {
            self.user(&name).is_some_and(|user| is_enabled(&user) && user.stamp <= stamp)
        })
    }

    /// Counts a request of a user.
    ///
    /// # Errors
    /// It made too many: how long to wait.
    pub fn request(&self, name: &UserName) -> Result<(), Duration> {
        lock(&self.rates).entry(name.clone()).or_default().request(clock::now())
    }

    /// Ends a session.
    pub async fn sign_out(&self, id: &SessionId, by: &By) {
        if self.sessions().end(id, clock::now()).is_some() {
            tracing::info!(user = by.actor, "a user signed out");
            self.ledger.tell(by, Deed::SignedOut {}).await;
        }
    }

    /// Makes a user, changes or removes it. When this returns, sessions of the state before have ended. After
    /// an error nothing was changed; if the disk failed at the very end of the write, the change may hold,
    /// and the sessions end within a second after the disk can be read.
    ///
    /// # Errors
    /// `last_admin`, `no_such_user`, `no_room`, `bad_value`, `overloaded`, `store_unavailable`.
    pub async fn change(&self, name: UserName, wish: Wish, author: Author) -> Result<Decided, Problem> {
        let change = UserChange { name, wish, link: None, if_stamp: None };
        Ok(self.write(change, author, None).await?)
    }

    /// The hash of a new password.
    ///
    /// # Errors
    /// `bad_value`: it is too short or too long. `overloaded`.
    pub async fn hash(&self, password: Secret) -> Result<PasswordHash, Problem> {
        must_be_password(&password)?;
        self.passwords.hash(password).await
    }

    /// Gives the caller another password, and ends its other sessions.
    ///
    /// # Errors
    /// `wrong_password`: the old one is wrong. `bad_value`, `no_session`, `too_many_requests`, `overloaded`,
    /// `store_unavailable`: the old one stays.
    pub async fn change_password(
        &self,
        signed_in: &SignedIn,
        asked: PasswordChange,
        author: Author,
        source: SocketAddr,
    ) -> Result<(), Problem> {
        let PasswordChange { old, new } = asked;
        must_be_password(&new)?;
        let StoredUser { account, stamp, .. } = &*signed_in.user;
        let attempt = self.begin(account.name.as_str(), source)?;
        if !self.check(&attempt, old, account.password.as_ref()).await? {
            return Err(self.failed(account.name.as_str(), source));
        }
        lock(&self.sign_ins).was_right(&attempt, &account.name, clock::now());
        let hash = self.hash(new).await?;
        let change = UserChange {
            name: account.name.clone(),
            wish: Wish::Password(hash),
            link: None,
            if_stamp: Some(*stamp),
        };
        self.write(change, author, Some(&signed_in.id)).await?;
        Ok(())
    }

    /// Uses a one-time link: makes the first admin, or gives the user of the link another password.
    ///
    /// # Errors
    /// `link_void`, `bad_value`, `name_taken`, `too_many_requests`, `overloaded`, `store_unavailable`.
    pub async fn set_up(&self, asked: Setup, source: SocketAddr) -> Result<(), Problem> {
        let Setup { secret, name, password } = asked;
        let attempt = lock(&self.sign_ins).begin_with_secret(source.ip(), clock::now());
        let attempt = attempt.map_err(Problem::too_many)?;
        let hash = secret::hash(&secret.0);
        let link = self.keeper.link(hash, seconds()).await;
        if link.is_err() {
            // The secret was not looked at.
            lock(&self.sign_ins).give_back(&attempt);
        }
        let link = link?.ok_or(StoreError::LinkVoid)?;
        // The caller has the secret: the try was no guess.
        lock(&self.sign_ins).give_back(&attempt);
        let name = UserName::new(&name)
            .ok_or_else(|| Problem::new(Code::BadValue, format!("name: a user has {}", UserName::WANTED)))?;
        if link.user.as_ref().is_some_and(|user| *user != name) {
            return Err(StoreError::LinkVoid.into());
        }
        let password = self.hash(password).await?;
        let wish = match link.user {
            None => Wish::FirstAdmin(password),
            Some(_) => Wish::Password(password),
        };
        let change = UserChange { name, wish, link: Some((hash, seconds())), if_stamp: None };
        let source = Some(source.to_string());
        let author = Author { time: clock::time_of_day(), actor: "link".to_owned(), source };
        self.write(change, author, None).await?;
        Ok(())
    }

    /// Makes the one-time link for the first admin: its secret. `None` if there is an admin already.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn setup_link(&self) -> Result<Option<Secret>, StoreError> {
        let (text, link) = draw_link(None)?;
        let author = Author { time: clock::time_of_day(), actor: "gateway".to_owned(), source: None };
        match self.keeper.put_link(link, author).await {
            Ok(()) => Ok(Some(text)),
            Err(StoreError::Denied(account::Denied::HasAdmin)) => Ok(None),
            Err(error) => Err(error),
        }
    }

    fn begin(&self, name: &str, source: SocketAddr) -> Result<Attempt, Problem> {
        lock(&self.sign_ins).begin(name, source.ip(), clock::now()).map_err(Problem::too_many)
    }

    /// Whether the password fits. A password that was not looked at is no failure.
    async fn check(
        &self,
        attempt: &Attempt,
        password: Secret,
        hash: Option<&PasswordHash>,
    ) -> Result<bool, Problem> {
        let is_right = self.passwords.is(password, hash).await;
        if is_right.is_err() {
            lock(&self.sign_ins).give_back(attempt);
        }
        is_right
    }

    /// Notes that somebody did not have the password of this user. What the caller gets to know of it.
    fn failed(&self, name: &str, source: SocketAddr) -> Problem {
        if let Some(user) = UserName::new(name).and_then(|name| self.user(&name)) {
            self.ledger.failed(&user.account.name, source);
        }
        Problem::new(Code::WrongPassword, "the name or the password is wrong, or the user is disabled")
    }

    fn sessions(&self) -> MutexGuard<'_, Sessions<UserName>> {
        lock(&self.sessions)
    }
}

/// What proves that a page belongs to the session with this secret.
pub fn csrf(text: &str) -> Secret {
    Secret(secret::derived("r6 csrf 1", text))
}

/// Draws a one-time link: its secret, and what is kept of it.
///
/// # Errors
/// The system has no random numbers.
pub fn draw_link(user: Option<UserName>) -> Result<(Secret, Link), StoreError> {
    let drawn = secret::draw("");
    let (text, hash) =
        drawn.map_err(|error| StoreError::Unavailable(format!("no random numbers: {error}")))?;
    Ok((Secret(text), Link { hash, user, made: seconds() }))
}

fn must_be_password(password: &Secret) -> Result<(), Problem> {
    if account::is_password(&password.0) {
        return Ok(());
    }
    let (least, most) = PASSWORD_LENGTH;
    Err(Problem::new(Code::BadValue, format!("a password has {least} to {most} characters")))
}

fn is_enabled(user: &StoredUser) -> bool {
    !user.account.disabled
}

/// The time of day, in seconds since 1970.
fn seconds() -> u64 {
    clock::today().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs()
}

fn no_random(error: &getrandom::Error) -> Problem {
    Problem::new(Code::StoreUnavailable, format!("no random numbers: {error}"))
}

fn lock<T>(mutex: &SyncMutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
