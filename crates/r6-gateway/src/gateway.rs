//! A running gateway.

mod begin;
mod front;
mod raw_ports;

use std::fmt;
use std::fs::File;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, UNIX_EPOCH};

use r6_api::gateway::{ActedBy, Deed, ManagedBy};
use r6_client::RobotSettings;
use r6_http::access::Site;
use tokio::net::TcpListener;
use tokio::task::JoinSet;

pub(crate) use self::begin::{Begun, all_robots, begin, close_open, record, started, take_over};
use self::begin::{hold_stops, open_store};
use self::front::Front;
use crate::accounts::Accounts;
use crate::auditor::{self, AuditSettings, Auditor, open_key};
use crate::backup;
use crate::certificate::{Certificate, CertificateError, TlsSettings};
use crate::clock;
use crate::core::hall::Hall;
use crate::core::head::Signer;
use crate::core::name::RobotName;
use crate::core::raw::policy::RawPolicy;
use crate::files;
use crate::fleet::Fleet;
use crate::fleet::config::RobotConfig;
use crate::fleet::roads::Roads;
use crate::fleet::roster::{self, Changes};
use crate::fleet::station::{Shared, by_itself};
use crate::folder;
use crate::history::{HistorySettings, Recorder};
use crate::http::{self, Cookie, State};
use crate::outage::Outage;
use crate::problem::Problem;
use crate::programs::bench::Bench;
use crate::raw_port::{self, RawPort, Switch};
use crate::reserve;
use crate::settings::Settings;
use crate::sharing::{self, Configured, Running, Sharing};
use crate::store::history::Place;
use crate::store::postgres::Database;
use crate::store::{FILE, HISTORY, Keeper, Store, StoreError};
use crate::tokens::{REFRESH, Tokens};

/// How long the last samples may take at the end.
const LAST_SAMPLES: Duration = Duration::from_secs(5);

/// How long the last records about users may take at the end.
const LAST_RECORDS: Duration = Duration::from_secs(5);

/// How long the store may take to close at the end: what its log has goes into its file.
const CLOSE_STORE: Duration = Duration::from_secs(5);

/// What a gateway needs.
#[derive(Clone, Debug)]
pub struct GatewaySettings {
    /// The address to listen on; port 0 takes any free port.
    pub listen: SocketAddr,
    /// The folder of the store, of the key of the audit log and of a certificate.
    pub data: PathBuf,
    /// The database of the store, if it is not in the folder. Gateways with the same database share it.
    pub store: Option<Database>,
    /// The robots of the file and the command line.
    pub robots: Vec<RobotConfig>,
    /// How to communicate with robots that are added through the API.
    pub robot_settings: RobotSettings,
    /// The raw ports: at most one for each robot.
    pub raw: Vec<RawPort>,
    /// Who may do what on them.
    pub raw_policy: RawPolicy,
    /// The time zone and the shifts, if the file has them.
    pub hall: Option<Hall>,
    /// What is kept of the audit log.
    pub audit: AuditSettings,
    /// What is kept of values.
    pub history: HistorySettings,
    /// Host names by which clients reach the gateway, besides the addresses of this machine.
    pub names: Vec<String>,
    /// The certificate for HTTP. The raw ports have no TLS.
    pub tls: TlsSettings,
}

/// Why a gateway could not be started. Nothing is left running.
#[derive(Debug)]
pub enum GatewayError {
    /// Another gateway uses the folder.
    InUse(PathBuf),
    /// The folder is a backup.
    IsBackup(PathBuf),
    /// The folder is of a gateway whose store is in a database, and no database was given.
    OfDatabase(PathBuf),
    /// The folder has a store in it, and a database was given.
    HasStore(PathBuf),
    /// The store cannot be used.
    Store(StoreError),
    /// The robots cannot be looked after: a mistake in their configuration.
    Robots(Problem),
    /// A raw port is wrong.
    Raw(String),
    /// This cannot be used with a store that several gateways share: for people.
    Sharing(&'static str),
    /// The certificate cannot be used.
    Certificate(CertificateError),
    /// The system did not allow listening there.
    Listen {
        /// The option that says where to listen.
        option: &'static str,
        /// The address.
        address: SocketAddr,
        /// Why not.
        error: io::Error,
    },
    /// The system gives no thread or file.
    System(io::Error),
}

impl fmt::Display for GatewayError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InUse(folder) => write!(f, "another gateway uses {}", folder.display()),
            Self::IsBackup(folder) => write!(
                f,
                "{} is a backup: make the folder of a gateway of it with `r6 gateway restore`, after which stops hold",
                folder.display()
            ),
            Self::OfDatabase(folder) => write!(
                f,
                "{} is of a gateway with --store, and its users, leases and stops are in the database: give --store \
                 URL, or take another folder for --data",
                folder.display()
            ),
            Self::HasStore(folder) => write!(
                f,
                "{folder} has the users, leases and stops of a gateway without --store; none of them holds here: take \
                 another folder for --data, or move {folder}/{FILE} away if nothing in it is needed",
                folder = folder.display()
            ),
            Self::Store(error) => error.fmt(f),
            Self::Robots(problem) => f.write_str(&problem.message),
            Self::Raw(wrong) => f.write_str(wrong),
            Self::Sharing(wrong) => f.write_str(wrong),
            Self::Certificate(error) => write!(f, "TLS: {error}"),
            Self::Listen { option, address, error } if error.kind() == io::ErrorKind::AddrInUse => {
                write!(f, "{address} is taken by another program: choose another address with {option}")
            }
            Self::Listen { address, error, .. } => write!(f, "cannot listen on {address}: {error}"),
            Self::System(error) => write!(f, "the system gives no thread or file: {error}"),
        }
    }
}

impl std::error::Error for GatewayError {}

impl From<CertificateError> for GatewayError {
    fn from(error: CertificateError) -> Self {
        Self::Certificate(error)
    }
}

impl From<StoreError> for GatewayError {
    fn from(error: StoreError) -> Self {
        Self::Store(error)
    }
}

/// A running gateway. Dropping it ends it without order: use [`Self::shutdown`].
#[derive(Debug)]
pub struct Gateway {
    address: SocketAddr,
    state: State,
    /// The loop of a gateway that shares its store.
    sharing: Option<Running>,
    switch: Arc<Switch>,
    certificate: Option<Certificate>,
    server: JoinSet<()>,
    /// Where callers are served.
    _front: Front,
    /// Locked as long as the gateway runs.
    _lock: File,
}

impl Gateway {
    /// Starts a gateway. When this returns, it listens; the robots may still be connecting.
    ///
    /// # Errors
    /// [`GatewayError`]: nothing is left running.
    pub async fn start(settings: GatewaySettings) -> Result<Self, GatewayError> {
        // What reads a backup relies on it that nothing writes there.
        if settings.data.join(backup::LIST).is_file() {
            return Err(GatewayError::IsBackup(settings.data));
        }
        if let Some(database) = settings.store.clone() {
            return Self::share(settings, database).await;
        }
        if folder::is_of_database(&settings.data) {
            return Err(GatewayError::OfDatabase(settings.data));
        }
        let (mut store, lock, start) = open_store(&settings.data)?;
        let raw_rules = settings.raw_policy.deed();
        let switch = Arc::new(Switch::read(&settings.data, settings.raw_policy));
        let robots = all_robots(&mut store, settings.robots, &settings.robot_settings)?;
        raw_ports::check(&settings.raw, &robots)?;
        let listen = settings.listen;
        let (tls, names) = (&settings.tls, &settings.names);
        let certificate = Certificate::open(tls, &settings.data, listen.ip(), names)?;
        let failed = |error| GatewayError::Listen { option: "--listen", address: listen, error };
        let listener = TcpListener::bind(listen).await.map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let front = Front::start().map_err(GatewayError::System)?;
        let listener = front.hear(listener).map_err(failed)?;

        let audit = (open_key(&settings.data)?, settings.audit);
        auditor::begin(&mut store, &audit.0)?;
        let mut begun = begin(&mut store, robots)?;
        if start.may_lack_stops {
            hold_stops(&mut store, &mut begun)?;
        }
        if !settings.raw.is_empty() {
            let open = Deed::RawPorts { open: switch.policy.closed().is_none() };
            store.append(&[record(None, raw_rules), record(None, open)])?;
        }
        let keeper = Keeper::start(store).map_err(GatewayError::System)?;
        let history = settings.history;
        let min_free = history.min_free;
        let history = history
            .on
            .then(|| Recorder::start(Place::Folder(settings.data.join(HISTORY)), history))
            .transpose()?;
        let shared = Shared::new(keeper, Roads::Tcp, history, epoch());
        let (robots, hall) = (settings.robot_settings, settings.hall);
        let doors = (address.port(), certificate.clone());
        let mut state = look_after(begun, shared, doors, robots, hall, Some(audit)).await?;
        state.raw_ports = Some(Arc::clone(&switch));
        let doors = match raw_ports::open(settings.raw, &state.fleet, &switch.policy, &front) {
            Ok(doors) => doors,
            Err(error) => {
                state.fleet.end().await;
                return Err(error);
            }
        };
        let mut server = JoinSet::new();
        let site = site(address, settings.names, &state);
        let tls = certificate.as_ref().map(Certificate::tls);
        let serve = r6_http::serve(listener, http::router(state.clone(), site), tls);
        server.spawn_on(serve, front.handle());
        server.spawn(follow(certificate.clone()));
        keep_fresh(&state, &mut server);
        if let Some(auditor) = state.auditor.clone() {
            server.spawn(async move { auditor.keep().await });
        }
        let mut raw_ports = Vec::new();
        for (port, door, listener) in doors {
            raw_ports.push(port);
            server.spawn_on(raw_port::attend(door, listener), front.handle());
        }
        switch.opened(raw_ports);
        server.spawn(reserve::keep(settings.data, min_free));
        if !switch.ports().is_empty() {
            let keeping = Arc::clone(&switch);
            server.spawn(async move { keeping.keep().await });
        }
        start.succeeded();
        let (sharing, _front, _lock) = (None, front, lock);
        Ok(Self { address, state, sharing, switch, certificate, server, _front, _lock })
    }

    /// Starts a gateway whose store others share.
    async fn share(settings: GatewaySettings, database: Database) -> Result<Self, GatewayError> {
        raw_ports::check_shared(&settings.raw)?;
        if settings.robots.iter().any(|robot| robot.twin_of.is_some()) {
            return Err(GatewayError::Sharing(
                "twins cannot be used with --store yet: they live in one process",
            ));
        }
        roster::check_shared(&settings.robots).map_err(GatewayError::Robots)?;
        if folder::has_store(&settings.data) {
            return Err(GatewayError::HasStore(settings.data));
        }
        files::make_folder(&settings.data).map_err(GatewayError::System)?;
        let lock = folder::lock(&settings.data)?;
        let data = settings.data.clone();
        let listen = settings.listen;
        let certificate = Certificate::open(&settings.tls, &settings.data, listen.ip(), &settings.names)?;
        let failed = |error| GatewayError::Listen { option: "--listen", address: listen, error };
        let listener = TcpListener::bind(listen).await.map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let front = Front::start().map_err(GatewayError::System)?;
        let listener = front.hear(listener).map_err(failed)?;
        let switch = Arc::new(Switch::without_ports(settings.raw_policy));
        let sharing = Sharing {
            database,
            url: sharing::url(address, certificate.is_some(), &settings.names),
            certificate: certificate.clone(),
            data: settings.data,
            audit: settings.audit,
            history: settings.history,
            robot_settings: settings.robot_settings,
            configured: Mutex::new(Configured { robots: settings.robots, hall: settings.hall }),
        };
        let (running, state) = Running::start(sharing, address.port()).await?;
        // Only now: with a wrong URL nothing of this folder is in a database.
        folder::mark(&data).map_err(GatewayError::System)?;
        let mut server = JoinSet::new();
        let site = site(address, settings.names, &state);
        let tls = certificate.as_ref().map(Certificate::tls);
        let serve = r6_http::serve(listener, http::router(state.clone(), site), tls);
        server.spawn_on(serve, front.handle());
        server.spawn(follow(certificate.clone()));
        keep_fresh(&state, &mut server);
        let (sharing, _front, _lock) = (Some(running), front, lock);
        Ok(Self { address, state, sharing, switch, certificate, server, _front, _lock })
    }

    /// How many robots this gateway owns; `None` if no other gateway shares its store.
    #[must_use]
    pub fn owned(&self) -> Option<usize> {
        self.sharing.as_ref().map(|_| self.state.shared.owners.counts().0)
    }

    /// The address that it listens on.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The certificate, if the gateway speaks TLS.
    #[must_use]
    pub fn certificate(&self) -> Option<&Certificate> {
        self.certificate.as_ref()
    }

    /// The raw ports, with the addresses that they listen on.
    #[must_use]
    pub fn raw_ports(&self) -> &[RawPort] {
        self.switch.ports()
    }

    /// Who has closed all raw ports, and when.
    #[must_use]
    pub fn raw_ports_closed(&self) -> Option<ActedBy> {
        self.switch.policy.closed()
    }

    /// Makes a one-time link for the first admin, which takes the place of the one before: its address, with
    /// a secret. It is valid for an hour, until it is used and until the gateway ends. `None` if there is an
    /// admin who can sign in.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn setup_link(&self) -> Result<Option<String>, StoreError> {
        let state = &self.state;
        // One gateway does this for all.
        if state.shared.owners.check_hall().is_err() {
            return Ok(None);
        }
        let secret = state.accounts.setup_link().await?;
        // A gateway that listens on all addresses is also reached on this machine.
        let host = match self.address {
            all if all.ip().is_unspecified() => SocketAddr::from((Ipv4Addr::LOCALHOST, all.port())),
            one => one,
        };
        let scheme = if state.is_secure { "https" } else { "http" };
        Ok(secret.map(|secret| format!("{scheme}://{host}/setup#{}", secret.0)))
    }

    /// Makes a link to the dashboard that signs browsers in with the rights of the token with this number:
    /// its secret. It is no token, works any number of times, and ends with the gateway.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn sign_in_secret(&self, token: i64) -> io::Result<String> {
        let secret = self.state.tokens.make_link(token).map_err(io::Error::other)?;
        Ok(secret.0)
    }

    /// Makes these rules those of all raw ports, at once: clients that may do nothing any more are closed,
    /// and what waits under another rule does not leave. The audit log tells of it, as soon as the disk takes
    /// it.
    pub fn set_raw_policy(&self, policy: RawPolicy) {
        if let Some(changed) = self.switch.policy.set(policy).filter(|_| self.sharing.is_none()) {
            // What a camera has asked for under a rule that is gone does not leave.
            for station in self.state.fleet.stations() {
                station.seat(|seat, _| seat.grant_is_revoked());
            }
            self.state.accounts.ledger.note(&by_itself(), changed.deed());
        }
    }

    /// Whether there is a robot of this name.
    #[must_use]
    pub fn has(&self, robot: &RobotName) -> bool {
        let (fleet, owners) = (&self.state.fleet, &self.state.shared.owners);
        fleet.station(robot.as_str()).is_some() || owners.robot(robot.as_str()).is_some()
    }

    /// Checks that a gateway with these raw ports, these configured robots and the robots that were added
    /// over the API would start.
    ///
    /// # Errors
    /// What the start would say.
    pub fn check_raw(&self, ports: &[RawPort], configured: &[RobotConfig]) -> Result<(), GatewayError> {
        if self.sharing.is_some() {
            return raw_ports::check_shared(ports);
        }
        let configs = self.state.fleet.stations().into_iter().map(|station| station.config());
        let added = configs.filter(|robot| robot.managed_by == ManagedBy::Api);
        raw_ports::check(ports, &added.chain(configured.iter().cloned()).collect::<Vec<_>>())
    }

    /// The present rules of all raw ports.
    #[must_use]
    pub fn raw_policy(&self) -> RawPolicy {
        self.switch.policy.now()
    }

    /// Makes the time zone and the shifts of the file these. Without, those that were stored over the API
    /// hold.
    pub fn set_hall(&self, hall: Option<Hall>) {
        if let Some(sharing) = &self.sharing {
            sharing.configure(|configured| configured.hall.clone_from(&hall));
        }
        self.state.settings.set_file(hall);
    }

    /// How many robots there are, twins included, and with a shared store those of other gateways too.
    #[must_use]
    pub fn robots(&self) -> usize {
        match &self.sharing {
            Some(_) => self.state.shared.owners.counts().1,
            None => self.state.fleet.stations().len(),
        }
    }

    /// Makes the robots of the file and the command line these. Robots that do not change go on. Those that
    /// change get a new connection, and their leases end.
    ///
    /// # Errors
    /// The robots cannot be looked after (nothing was changed), or the store failed.
    pub async fn reload(&self, robots: Vec<RobotConfig>) -> Result<Changes, Problem> {
        let state = &self.state;
        let Some(sharing) = &self.sharing else { return state.fleet.reload(robots).await };
        roster::check_shared(&robots)?;
        self.check_elsewhere(&robots).await?;
        // The changes of the robots that this gateway has.
        state.fleet.reload(robots.clone()).await?;
        state.shared.owners.reconfigured(&robots);
        let mut before = Vec::new();
        sharing.configure(|configured| before = std::mem::replace(&mut configured.robots, robots.clone()));
        sharing.leave_changed();
        Ok(roster::changes(&before, &robots))
    }

    /// Refuses to take from its arm the name of a robot that is not here, while a stop holds at it or is
    /// owed.
    async fn check_elsewhere(&self, robots: &[RobotConfig]) -> Result<(), Problem> {
        let (fleet, shared) = (&self.state.fleet, &self.state.shared);
        let goes = |known: &RobotConfig| match robots.iter().find(|robot| robot.name == known.name) {
            Some(robot) => robot.place() != known.place(),
            None => known.managed_by == ManagedBy::File,
        };
        let known = shared.owners.robots().into_iter();
        let known = known.filter(|known| fleet.station(known.name.as_str()).is_none() && goes(known));
        let gone: Vec<_> = known.map(|known| known.name).collect();
        let look = move |store: &mut dyn Store| {
            let owed = store.owed_stops()?;
            let stopped = store.kept(&gone)?.into_iter().map(|(seat, _)| seat.stopped);
            let tied =
                gone.iter().zip(stopped).map(|(name, stopped)| (name.clone(), stopped, owed.contains(name)));
            Ok(tied.collect::<Vec<_>>())
        };
        let tied = shared.keeper.work(look).await?;
        tied.iter().try_for_each(|(name, stopped, owed)| roster::refuse_tied(name.as_str(), *stopped, *owed))
    }

    /// Ends the gateway in order: no new requests, then the outcomes of commands and stops that are under
    /// way, the connections, the last records and, within 5 s, the files of its folder. All leases end. Arms
    /// that a run moves are stopped; the others go on with what they do.
    ///
    /// # Errors
    /// The last record could not be written.
    pub async fn shutdown(mut self) -> Result<(), StoreError> {
        tracing::info!("the gateway ends");
        self.server.shutdown().await;
        match self.sharing.take() {
            Some(sharing) => sharing.end().await,
            None => finish(&self.state, None).await,
        }
    }
}

/// Ends the robots and the store in order, when no request comes any more.
pub(crate) async fn finish(state: &State, url: Option<String>) -> Result<(), StoreError> {
    state.fleet.end().await;
    let shared = &state.shared;
    if !matches!(tokio::time::timeout(LAST_RECORDS, state.accounts.ledger.end()).await, Ok(Ok(()))) {
        tracing::error!("the last records about users were not written");
    }
    let ended = shared.keeper.append(vec![record(None, Deed::GatewayEnded { url })]).await.map(drop);
    if let Some(auditor) = &state.auditor
        && let Err(error) = auditor.put_head().await
    {
        tracing::error!(%error, "the last head of the audit log was not stored");
    }
    if let Some(history) = &shared.history
        && !matches!(tokio::time::timeout(LAST_SAMPLES, history.end()).await, Ok(Ok(())))
    {
        tracing::error!("the last samples of the history were not written");
    }
    if !matches!(tokio::time::timeout(CLOSE_STORE, shared.keeper.end()).await, Ok(Ok(()))) {
        tracing::error!("the store was not closed in time: its log stays beside it, for the next start");
    }
    ended
}

/// Starts to look after these robots, for the routes.
pub(crate) async fn look_after(
    (robots, owed): Begun,
    shared: Shared,
    (port, certificate): (u16, Option<Certificate>),
    robot_settings: RobotSettings,
    hall: Option<Hall>,
    audit: Option<(Signer, AuditSettings)>,
) -> Result<State, StoreError> {
    let shared = Arc::new(shared);
    let tokens = Arc::new(Tokens::read(shared.keeper.clone()).await?);
    let accounts = Arc::new(Accounts::read(shared.keeper.clone()).await?);
    let settings = Arc::new(Settings::read(shared.keeper.clone(), hall).await?);
    let fleet = Arc::new(Fleet::start(robots, &owed, Arc::clone(&shared)));
    let auditor = audit.map(|(signer, audit)| Arc::new(Auditor::new(shared.keeper.clone(), signer, audit)));
    let (is_secure, bench) = (certificate.is_some(), Bench::new());
    let cookie = Cookie::new(port, is_secure);
    Ok(State {
        fleet,
        tokens,
        accounts,
        auditor,
        shared,
        is_secure,
        cookie,
        certificate,
        robot_settings,
        settings,
        bench,
        raw_ports: None,
        refused: Arc::default(),
    })
}

/// How the gateway is reached.
pub(crate) fn site(address: SocketAddr, names: Vec<String>, state: &State) -> Site {
    Site::new(address).with_names(names).with_tls(state.is_secure).with_page("/setup")
}

/// Reads tokens and users, and settings that others may change, again and again, and writes what is told of
/// users.
pub(crate) fn keep_fresh(state: &State, server: &mut JoinSet<()>) {
    server.spawn(refresh(Arc::clone(&state.tokens)));
    let accounts = Arc::clone(&state.accounts);
    server.spawn(async move { accounts.keep_fresh().await });
    let accounts = Arc::clone(&state.accounts);
    server.spawn(async move { accounts.ledger.keep().await });
    let refused = Arc::clone(&state.refused);
    server.spawn(async move { refused.keep_log().await });
    if !state.shared.owners.is_alone() {
        let settings = Arc::clone(&state.settings);
        server.spawn(async move { settings.keep_fresh().await });
    }
}

/// Uses another certificate when its files change.
async fn follow(certificate: Option<Certificate>) {
    if let Some(certificate) = certificate {
        certificate.follow().await;
    }
}

/// The time of the start, in microseconds since 1970.
pub(crate) fn epoch() -> u64 {
    let epoch = clock::today().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(epoch.as_micros()).unwrap_or(u64::MAX)
}

/// Reads the tokens again and again.
async fn refresh(tokens: Arc<Tokens>) {
    let mut outage = Outage::default();
    loop {
        tokio::time::sleep(REFRESH).await;
        outage.note("the tokens cannot be read", &tokens.refresh().await);
    }
}
