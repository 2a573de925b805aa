//! A gateway that shares its store with others: each robot is owned by one of them.
//!
//! [`run`] is one loop, which looks at the rows of the owners twice a second (`core/owner.rs` says what
//! follows from them). What the gateway takes begins as after the end of a gateway: commands without an
//! outcome are `unknown`, lists of runs are stopped, stops hold (`sharing/term.rs`). Beats go on in a task
//! beside it (`sharing/beats.rs`). When they fail, each robot is let go of in time, and taken again by the
//! gateway that is first.

mod beats;
mod far;
mod look;
mod term;

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use r6_api::gateway::LeaseEnd;
use r6_client::RobotSettings;
use r6_proto::time::Instant;
use sha2::{Digest, Sha256};
use tokio::sync::{Mutex as AsyncMutex, Notify, oneshot, watch};

use self::beats::Beats;
use self::look::Look;
use crate::auditor::AuditSettings;
use crate::certificate::Certificate;
use crate::clock;
use crate::core::hall::Hall;
use crate::core::name::RobotName;
use crate::core::owner::{Claim, Owned};
use crate::core::seat::Saved;
use crate::fleet::config::RobotConfig;
use crate::fleet::roads::Roads;
use crate::fleet::roster::{self, MAX_ROBOTS};
use crate::fleet::station::Shared;
use crate::gateway::{self, GatewayError};
use crate::history::{HistorySettings, Recorder};
use crate::http::State;
use crate::ownership::Ownership;
use crate::ownership::owners::Owners;
use crate::peers::{Door, Peers};
use crate::secret;
use crate::store::history::Place as HistoryPlace;
use crate::store::postgres::owner::OwnerRows;
use crate::store::postgres::session::Hand;
use crate::store::postgres::{Database, Postgres, look_at_server};
use crate::store::{Keeper, StoreError, StoredRobot};

/// The least time between two looks, however often others say that there is something to see: a look reads
/// all rows.
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);

/// How long a gateway that could not begin with something leaves it to others.
const AFTER_BAD_START: Duration = Duration::from_secs(3);

/// How long the first look, and beginning with what it took, may take.
const FIRST_LOOK: Duration = Duration::from_secs(10);

/// How long the ends of all terms may take, at the end: a stop takes 17 s, a run 21 s, and the records 5 s.
const LAST_TERMS: Duration = Duration::from_secs(50);

/// How long the last records may take then.
const LAST_RECORDS: Duration = Duration::from_secs(5);

/// How often to look whether everything was let go of, at the end.
const LAST_LOOK: Duration = Duration::from_millis(10);

/// What a gateway with a shared store needs.
#[derive(Debug)]
pub(crate) struct Sharing {
    pub database: Database,
    /// Where callers and the other gateways find it.
    pub url: String,
    pub certificate: Option<Certificate>,
    pub data: PathBuf,
    pub audit: AuditSettings,
    pub history: HistorySettings,
    pub robot_settings: RobotSettings,
    pub configured: Mutex<Configured>,
}

/// What the file says. It may be read again.
#[derive(Clone, Debug, Default)]
pub(crate) struct Configured {
    pub robots: Vec<RobotConfig>,
    pub hall: Option<Hall>,
}

/// A handle on the loop.
#[derive(Debug)]
pub(crate) struct Running {
    inner: Arc<Inner>,
    end: watch::Sender<bool>,
    task: tokio::task::JoinHandle<Result<(), StoreError>>,
}

/// What the loop and the terms work on.
#[derive(Debug)]
struct Inner {
    sharing: Sharing,
    /// The number of this gateway, of this start: drawn, so that no copy of the store gives it to another
    /// one.
    number: u64,
    door: Door,
    state: State,
    owners: Owners,
    /// For giving back.
    rows: AsyncMutex<OwnerRows>,
    /// What tells a term to end, and why its lease ends.
    leaving: Mutex<BTreeMap<Owned, watch::Sender<Option<LeaseEnd>>>>,
    /// What others are left for now, and until when.
    shunned: Mutex<BTreeMap<Owned, Instant>>,
    /// The robots that were taken at another address than before, until the audit log is told of it.
    moved: Mutex<BTreeSet<RobotName>>,
    /// The seats of robots at which a stop held in a term of this gateway and is not in the store, with the
    /// fence of that term.
    unsaved_stops: Mutex<BTreeMap<RobotName, (u64, Saved)>>,
    /// Asks for a look before its time.
    look_soon: Arc<Notify>,
    /// Whether the gateway ends.
    ends: watch::Receiver<bool>,
}

impl Running {
    /// Starts the loop. When this returns, the rows were looked at, and the gateway has begun with what it
    /// took.
    ///
    /// # Errors
    /// [`GatewayError`]: the store cannot be used.
    pub async fn start(sharing: Sharing, port: u16) -> Result<(Self, State), GatewayError> {
        let database = sharing.database.clone();
        let mut bytes = [0; 8];
        secret::fill(&mut bytes)
            .map_err(|error| StoreError::Unavailable(format!("no random numbers: {error}")))?;
        // The store has signed numbers.
        let number = u64::from_ne_bytes(bytes) >> 1;
        let told = {
            let database = database.clone();
            blocking(move || {
                let told = look_at_server(&database)?;
                Postgres::open(&database, Hand::Shell)?;
                Ok(told)
            })
        };
        for told in told.await? {
            tracing::warn!("{told}");
        }
        let peers = Peers::new(sharing.certificate.as_ref().map(Certificate::tls))
            .map_err(StoreError::Unavailable)?;
        let door = Door {
            url: sharing.url.clone(),
            key: peers.public_key(),
            certificate: sharing.certificate.as_ref().map(Certificate::fingerprint_now),
        };
        let mut rows = OwnerRows::new(database.clone());
        rows.register(number, &door, &sharing.file()).await?;
        let (keeper, history) = {
            let settings = sharing.history.clone();
            blocking(move || {
                let store = Postgres::of_gateway(&database, number)?;
                let keeper = Keeper::start(store).map_err(GatewayError::System)?;
                let place = HistoryPlace::Database { database, hand: Hand::Gateway(number) };
                let history = settings.on.then(|| Recorder::start(place, settings)).transpose()?;
                Ok((keeper, history))
            })
            .await?
        };
        keeper.append(vec![gateway::started(Some(door.url.clone()))]).await?;
        let owners = Owners::shared(peers);
        owners.set_number(number, &door.url);
        let shared =
            Shared::new(keeper, Roads::TcpOfTerm, history, gateway::epoch()).with_owners(owners.clone());
        let hall = sharing.configured().hall.clone();
        let begun = (Vec::new(), BTreeSet::new());
        let robot_settings = sharing.robot_settings.clone();
        let doors = (port, sharing.certificate.clone());
        let state = gateway::look_after(begun, shared, doors, robot_settings, hall, None).await?;
        let (end, ends) = watch::channel(false);
        let inner = Arc::new(Inner {
            sharing,
            number,
            door,
            state: state.clone(),
            owners,
            rows: AsyncMutex::new(rows),
            leaving: Mutex::default(),
            shunned: Mutex::default(),
            moved: Mutex::default(),
            unsaved_stops: Mutex::default(),
            look_soon: Arc::default(),
            ends,
        });
        let (looked, first) = oneshot::channel();
        let task = tokio::spawn(run(Arc::clone(&inner), looked));
        let _ = tokio::time::timeout(FIRST_LOOK, first).await;
        Ok((Self { inner, end, task }, state))
    }

    /// What the file says now.
    pub fn configure(&self, change: impl FnOnce(&mut Configured)) {
        change(&mut self.inner.sharing.configured());
        self.inner.look_soon.notify_one();
    }

    /// Lets go of robots that this gateway took before it had read how they are now. They are taken anew.
    pub fn leave_changed(&self) {
        for station in self.inner.state.fleet.stations() {
            self.inner.leave_if_changed(&station.config());
        }
    }

    /// Ends it in order, and gives the robots back.
    ///
    /// # Errors
    /// The last record could not be written.
    pub async fn end(mut self) -> Result<(), StoreError> {
        self.end.send_replace(true);
        (&mut self.task).await.unwrap_or(Err(StoreError::Closed))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.task.abort();
    }
}

impl Sharing {
    fn configured(&self) -> MutexGuard<'_, Configured> {
        self.configured.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What the file says of the robots, as a hash: their names and where they are. Twins are on the machine
    /// of each gateway, so they are left out.
    fn file(&self) -> String {
        let mut lines: Vec<_> = {
            let configured = self.configured();
            let robots = configured.robots.iter().filter(|robot| robot.twin_of.is_none());
            robots.map(|robot| format!("{}={}\n", robot.name, robot.place())).collect()
        };
        lines.sort();
        let hash = Sha256::digest(lines.concat());
        hash.iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// All robots: those of the file, and those that were added over the API and fit to them. Returns those
    /// that do not fit, too.
    fn robots(&self, stored: &[StoredRobot]) -> (BTreeMap<RobotName, RobotConfig>, BTreeSet<RobotName>) {
        let configured = self.configured().robots.clone();
        let mut addresses: BTreeSet<_> = configured.iter().map(RobotConfig::place).collect();
        let mut robots: BTreeMap<_, _> =
            configured.into_iter().map(|robot| (robot.name.clone(), robot)).collect();
        let mut unfit = BTreeSet::new();
        for added in stored {
            let robot = roster::of_store(added, self.robot_settings.clone()).ok();
            let robot = robot.filter(|robot| {
                robot.check().is_ok() && !robot.dials_in() && !robots.contains_key(&robot.name)
            });
            // One pass over all: this is done with each look.
            match robot {
                Some(robot) if robots.len() < MAX_ROBOTS && addresses.insert(robot.place()) => {
                    robots.insert(robot.name.clone(), robot);
                }
                _ => drop(unfit.insert(added.name.clone())),
            }
        }
        (robots, unfit)
    }
}

/// Does something that waits for the store, beside the tasks.
async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, GatewayError> + Send + 'static,
) -> Result<T, GatewayError> {
    tokio::task::spawn_blocking(work).await.unwrap_or(Err(StoreError::Closed.into()))
}

/// Looks and takes again and again, until the gateway ends.
async fn run(inner: Arc<Inner>, looked: oneshot::Sender<()>) -> Result<(), StoreError> {
    let beats = Beats::start(&inner);
    let mut rows = OwnerRows::hearing(inner.sharing.database.clone(), Arc::clone(&inner.look_soon));
    let mut look = Look::default();
    let mut looked = Some(looked);
    let mut ends = inner.ends.clone();
    let mut pause = Duration::ZERO;
    loop {
        tokio::select! {
            biased;
            () = ended(&mut ends) => break,
            () = tokio::time::sleep(pause) => {}
            () = soon(&inner), if !pause.is_zero() => {}
        }
        let (next, begun) = look.once(&inner, &mut rows).await;
        pause = next;
        if let Some(looked) = looked.take() {
            tokio::spawn(async move {
                begun.await;
                let _ = looked.send(());
            });
        }
    }
    // The store may be lost meanwhile: then each term ends in time.
    let all_ended = async {
        while !inner.owners.held().is_empty() {
            tokio::time::sleep(LAST_LOOK).await;
        }
    };
    if tokio::time::timeout(LAST_TERMS, all_ended).await.is_err() {
        tracing::error!("some robots were not let go of in time");
    }
    // What happened in the last terms belongs in the audit log.
    let shared = &inner.state.shared;
    let begun = clock::now();
    while shared.writes_last() > 0 && clock::now().since(begun) < LAST_RECORDS {
        tokio::time::sleep(LAST_LOOK).await;
    }
    if shared.writes_last() > 0 {
        let robots = shared.writes_last();
        tracing::error!(robots, "the audit log does not have the last records of some robots: they are lost");
    }
    let done = gateway::finish(&inner.state, Some(inner.door.url.clone())).await;
    drop(beats);
    if let Err(error) = rows.end(inner.number).await {
        tracing::warn!(%error, "the store does not know that this gateway ended");
    }
    done
}

/// Waits until there is word that a look shows something new, and [`BETWEEN_LOOKS`] at least.
async fn soon(inner: &Inner) {
    tokio::time::sleep(BETWEEN_LOOKS).await;
    inner.look_soon.notified().await;
}

async fn ended(end: &mut watch::Receiver<bool>) {
    let _ = end.wait_for(|end| *end).await;
}

impl Inner {
    fn leaving(&self) -> MutexGuard<'_, BTreeMap<Owned, watch::Sender<Option<LeaseEnd>>>> {
        self.leaving.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells a term to end, and why its lease ends.
    fn leave(&self, owned: &Owned, why: LeaseEnd) {
        if let Some(leaves) = self.leaving().get(owned) {
            leaves.send_replace(Some(why));
        }
    }

    /// Lets go of a robot if the file says something else of it than what it has begun with.
    fn leave_if_changed(&self, begun: &RobotConfig) {
        let configured = self.sharing.configured();
        if configured.robots.iter().any(|robot| robot.name == begun.name && !robot.is_as(begun)) {
            self.leave(&Owned::Robot(begun.name.clone()), LeaseEnd::Reconfigured);
        }
    }

    /// Lets go of robots at rest, so that others take them.
    fn give(&self, count: usize) {
        if count == 0 {
            return;
        }
        let stations = self.state.fleet.stations();
        let given = stations.iter().filter(|station| station.leave_if_idle()).take(count);
        for station in given {
            tracing::info!(robot = station.name(), "another gateway has fewer robots: it gets this one");
            self.leave(&Owned::Robot(station.robot_name().clone()), LeaseEnd::OwnerChanged);
        }
    }

    fn unsaved_stops(&self) -> MutexGuard<'_, BTreeMap<RobotName, (u64, Saved)>> {
        self.unsaved_stops.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The seat with the stop that held in the term of this gateway before this one, and is not in the store.
    /// After a term of another gateway in between, it does not count any more.
    fn unsaved_stop(&self, claims: &[Claim], robot: &RobotName) -> Option<Saved> {
        let claim = claims.iter().find(|claim| claim.of.robot() == Some(robot))?;
        let (fence, saved) = self.unsaved_stops().get(robot)?.clone();
        (fence + 1 == claim.fence).then_some(saved)
    }

    /// Tells the audit log of a robot that was taken at another address than before.
    fn tell_if_moved(&self, robot: &RobotName) {
        let is_moved = self.moved.lock().unwrap_or_else(PoisonError::into_inner).remove(robot);
        if let Some(station) = self.state.fleet.station(robot.as_str()).filter(|_| is_moved) {
            station.note_configured();
        }
    }

    /// Leaves something to others for a while.
    fn shun(&self, owned: &Owned) {
        let until = clock::now() + AFTER_BAD_START;
        self.shunned.lock().unwrap_or_else(PoisonError::into_inner).insert(owned.clone(), until);
    }

    fn shunned(&self, now: Instant) -> BTreeSet<Owned> {
        let mut shunned = self.shunned.lock().unwrap_or_else(PoisonError::into_inner);
        shunned.retain(|_, until| *until > now);
        shunned.keys().cloned().collect()
    }

    /// Ends a term: everything was let go of.
    async fn end_term(&self, claim: &Claim, ownership: &Ownership) {
        // What another gateway may have by now is not ours to give back.
        let is_ours = ownership.may_move();
        ownership.end();
        if is_ours && let Err(error) = self.rows.lock().await.release(self.number, claim).await {
            tracing::warn!(of = %claim.of, %error, "it was not given back: others wait until the last beat is old");
        }
        self.leaving().remove(&claim.of);
        self.owners.end(claim);
    }
}

/// Where callers and the other gateways find this one.
pub(crate) fn url(address: std::net::SocketAddr, is_secure: bool, names: &[String]) -> String {
    let scheme = if is_secure { "https" } else { "http" };
    let of_system = || {
        let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
        Some(name.trim().to_owned()).filter(|name| !name.is_empty())
    };
    match names.first().cloned().or_else(|| of_system().filter(|_| address.ip().is_unspecified())) {
        Some(host) => format!("{scheme}://{host}:{}", address.port()),
        None => format!("{scheme}://{address}"),
    }
}
