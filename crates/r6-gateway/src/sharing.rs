//! A gateway that shares its store with others: one of them owns the robots, the others wait.
//!
//! [`run`] is one loop. While another gateway owns the robots, it looks at the row of the owner twice a
//! second and answers what the store alone can answer. When it takes the robots, it starts as a gateway does
//! after the end of the last one: commands without an outcome are `unknown`, lists of runs are stopped, stops
//! hold. Its beats go on in a task beside it. When they fail, it lets go in time (`core/owner.rs`), and waits
//! again.

use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use r6_client::RobotSettings;
use tokio::net::TcpListener;
use tokio::sync::{oneshot, watch};
use tokio::task::{AbortHandle, JoinSet};

use crate::auditor::{self, AuditSettings, open_key};
use crate::certificate::Certificate;
use crate::clock;
use crate::core::hall::Hall;
use crate::core::owner::{BEAT, LOOK, Phase, Reign, Verdict, Watch};
use crate::fleet::config::RobotConfig;
use crate::fleet::roads::Roads;
use crate::fleet::station::Shared;
use crate::gateway::{self, GatewayError, Present};
use crate::history::{HistorySettings, Recorder};
use crate::http::{self, State};
use crate::ownership::Ownership;
use crate::store::history::Place as HistoryPlace;
use crate::store::postgres::owner::OwnerRow;
use crate::store::postgres::session::Hand;
use crate::store::postgres::{Database, Postgres, look_at_server};
use crate::store::{Keeper, StoreError};

/// After a beat that failed, the next one comes so soon.
const AFTER_FAILURE: Duration = Duration::from_millis(100);

/// How long a gateway that could not start its robots leaves them to others.
const AFTER_BAD_START: Duration = Duration::from_secs(3);

/// How long requests that are under way have to get their answers when another state takes the place of
/// theirs.
const HAND_OVER: Duration = Duration::from_millis(500);

/// How long the first look may take.
const FIRST_LOOK: Duration = Duration::from_secs(10);

/// What a gateway with a shared store needs, from one term to the next.
#[derive(Debug)]
pub(crate) struct Sharing {
    pub database: Database,
    /// How the others call it.
    pub name: String,
    pub address: SocketAddr,
    pub listener: std::net::TcpListener,
    pub data: PathBuf,
    pub certificate: Option<Certificate>,
    pub names: Vec<String>,
    pub audit: AuditSettings,
    pub history: HistorySettings,
    pub robot_settings: RobotSettings,
    pub configured: Mutex<Configured>,
}

/// What the file says. It may be read again while another gateway owns the robots.
#[derive(Clone, Debug, Default)]
pub(crate) struct Configured {
    pub robots: Vec<RobotConfig>,
    pub hall: Option<Hall>,
}

/// A handle on the loop.
#[derive(Debug)]
pub(crate) struct Running {
    sharing: Arc<Sharing>,
    end: watch::Sender<bool>,
    task: tokio::task::JoinHandle<Result<(), StoreError>>,
}

impl Running {
    /// Starts the loop. When this returns, it is known whether this gateway owns the robots, or that it has
    /// to wait and look.
    ///
    /// # Errors
    /// [`GatewayError`]: the store cannot be used.
    pub async fn start(sharing: Sharing) -> Result<(Self, Present), GatewayError> {
        let sharing = Arc::new(sharing);
        let of_server = {
            let database = sharing.database.clone();
            blocking(move || {
                let told = look_at_server(&database)?;
                Postgres::open(&database, Hand::Shell)?;
                Ok(told)
            })
        };
        for told in of_server.await? {
            tracing::warn!("{told}");
        }
        let state = waiting(&sharing, String::new()).await?;
        let present = Present::new(state);
        let (end, ends) = watch::channel(false);
        let (looked, first) = oneshot::channel();
        let task = tokio::spawn(run(Arc::clone(&sharing), present.clone(), ends, looked));
        let _ = tokio::time::timeout(FIRST_LOOK, first).await;
        Ok((Self { sharing, end, task }, present))
    }

    /// What the file says now.
    pub fn configure(&self, change: impl FnOnce(&mut Configured)) {
        change(&mut self.sharing.configured());
    }

    /// How many robots the file has.
    pub fn configured_robots(&self) -> usize {
        self.sharing.configured().robots.len()
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

    /// Serves this state, until what is returned is dropped.
    fn serve(&self, state: &State) -> Result<Served, std::io::Error> {
        let listener = TcpListener::from_std(self.listener.try_clone()?)?;
        let site = gateway::site(self.address, self.names.clone(), state);
        let tls = self.certificate.as_ref().map(Certificate::tls);
        let (end, ends) = oneshot::channel::<()>();
        let over = async { drop(ends.await) };
        let router = http::router(state.clone(), site);
        let http = tokio::spawn(r6_http::serve_until(listener, router, tls, over, HAND_OVER)).abort_handle();
        let mut tasks = JoinSet::new();
        gateway::keep_fresh(state, &mut tasks);
        Ok(Served { tasks, http: Some((http, end)), is_old: false })
    }
}

/// Does something that waits for the store, beside the tasks.
async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, GatewayError> + Send + 'static,
) -> Result<T, GatewayError> {
    tokio::task::spawn_blocking(work).await.unwrap_or(Err(StoreError::Closed.into()))
}

/// The state of a gateway that does not own the robots.
async fn waiting(sharing: &Sharing, owner: String) -> Result<State, GatewayError> {
    let (database, data) = (sharing.database.clone(), sharing.data.clone());
    let (keeper, signer) = blocking(move || {
        let store = Postgres::open_to_read(&database)?;
        Ok((Keeper::start(store).map_err(GatewayError::System)?, open_key(&data)?))
    })
    .await?;
    let ownership = Ownership::other(owner);
    let shared = Shared::new(keeper, Roads::Tcp, None, gateway::epoch()).owned(ownership);
    let hall = sharing.configured().hall.clone();
    let begun = (Vec::new(), BTreeSet::new());
    let audit = (signer, sharing.audit);
    let doors = (sharing.address.port(), sharing.certificate.clone());
    let state =
        gateway::look_after(begun, shared, doors, sharing.robot_settings.clone(), hall, audit).await?;
    Ok(state)
}

/// The state of the owner.
async fn owning(sharing: &Sharing, fence: u64, ownership: Ownership) -> Result<State, GatewayError> {
    let (database, data) = (sharing.database.clone(), sharing.data.clone());
    let Configured { robots, hall } = sharing.configured().clone();
    let robot_settings = sharing.robot_settings.clone();
    let history = sharing.history.clone();
    let (begun, keeper, history, signer) = blocking(move || {
        let mut store = Postgres::open(&database, Hand::Owner(fence))?;
        let robots = gateway::all_robots(&mut store, robots, &robot_settings)?;
        let signer = open_key(&data)?;
        auditor::begin(&mut store, &signer)?;
        let begun = gateway::begin(&mut store, robots)?;
        let keeper = Keeper::start(store).map_err(GatewayError::System)?;
        let place = HistoryPlace::Database { database, hand: Hand::Owner(fence) };
        let history = history.on.then(|| Recorder::start(place, history)).transpose()?;
        Ok((begun, keeper, history, signer))
    })
    .await?;
    // The store took its time: another gateway may have the robots by now.
    if !ownership.may_move() {
        return Err(
            StoreError::Unavailable("the robots were lost before they were begun with".to_owned()).into()
        );
    }
    let shared = Shared::new(keeper, Roads::Tcp, history, gateway::epoch()).owned(ownership);
    let audit = (signer, sharing.audit);
    let doors = (sharing.address.port(), sharing.certificate.clone());
    let state =
        gateway::look_after(begun, shared, doors, sharing.robot_settings.clone(), hall, audit).await?;
    Ok(state)
}

/// Waits and owns in turn, until `end` is true.
async fn run(
    sharing: Arc<Sharing>,
    present: Present,
    mut end: watch::Receiver<bool>,
    looked: oneshot::Sender<()>,
) -> Result<(), StoreError> {
    let mut row = OwnerRow::new(sharing.database.clone());
    let mut watch = Watch::default();
    let mut looked = Some(looked);
    let mut served = serve(&sharing, &present);
    loop {
        let taken = tokio::select! {
            biased;
            () = ended(&mut end) => None,
            taken = take(&sharing, &present, &mut row, &mut watch, &mut served, &mut looked) => Some(taken),
        };
        let Some((fence, asked)) = taken else { return Ok(()) };
        tracing::info!(fence, "this gateway owns the robots from now on");
        watch.had(fence);
        let ownership = Ownership::owns(Reign::begin(asked));
        let beats = tokio::spawn(beat(row, fence, ownership.clone()));
        let begun = owning(&sharing, fence, ownership.clone()).await;
        let mut pause = Duration::ZERO;
        let mut done = None;
        match begun {
            Ok(state) => {
                present.set(state.clone());
                // The streams of those who waited end here.
                served = serve(&sharing, &present);
                let auditor = Arc::clone(&state.auditor);
                served.tasks.spawn(async move { auditor.keep().await });
                looked.take().map(|looked| looked.send(()));
                tokio::select! {
                    biased;
                    () = ended(&mut end) => {
                        served.shutdown().await;
                        // The store may be lost meanwhile, and another gateway may take the robots.
                        state.fleet.end_until(over(&ownership)).await;
                        done = Some(gateway::finish(&state).await);
                    }
                    () = ownership.until_lost() => {
                        tracing::error!(fence, "this gateway does not own the robots any more: it lets go of them");
                        state.fleet.end_until(over(&ownership)).await;
                        ownership.set_other(String::new());
                        // Streams end, and those who come again are told that there is no owner. What it has
                        // in memory is of its own time: it reads the store anew as soon as that answers.
                        served = serve(&sharing, &present);
                        served.is_old = true;
                        if let Some(history) = state.shared.history.clone() {
                            // It fails, but the thread ends.
                            tokio::spawn(async move { history.end().await });
                        }
                    }
                }
            }
            Err(error) => {
                tracing::error!(%error, "this gateway cannot look after the robots, and gives them back");
                ownership.set_other(String::new());
                pause = AFTER_BAD_START;
            }
        }
        looked.take().map(|looked| looked.send(()));
        // The beats end with the ownership. An end in order leaves them on until all is written.
        ownership.set_other(String::new());
        row = match beats.await {
            Ok(row) => row,
            Err(_) => OwnerRow::new(sharing.database.clone()),
        };
        if let Err(error) = row.release(fence).await {
            tracing::warn!(%error, "the robots were not given back: others wait until the last beat is old");
        }
        if let Some(done) = done {
            return done;
        }
        tokio::time::sleep(pause).await;
    }
}

/// Waits until the gateway may have no connection to a robot any more.
async fn over(ownership: &Ownership) {
    ownership.until_lost().await;
    let left = ownership.left(clock::now()).filter(|_| ownership.phase() < Phase::Over);
    tokio::time::sleep(left.unwrap_or_default()).await;
}

/// What a gateway serves now. Once it is dropped, it accepts no connection any more, and requests that are
/// under way have [`HAND_OVER`] to get their answers.
struct Served {
    tasks: JoinSet<()>,
    /// The server, and what ends it when it is dropped; `None` if it could not be started.
    http: Option<(AbortHandle, oneshot::Sender<()>)>,
    /// Whether it serves what it knew as an owner.
    is_old: bool,
}

impl Served {
    /// Ends it at once.
    async fn shutdown(&mut self) {
        if let Some((http, _)) = self.http.take() {
            http.abort();
        }
        self.tasks.shutdown().await;
    }
}

fn serve(sharing: &Sharing, present: &Present) -> Served {
    sharing.serve(&present.state()).unwrap_or_else(|error| {
        tracing::error!(%error, "the gateway cannot listen any more");
        Served { tasks: JoinSet::new(), http: None, is_old: false }
    })
}

async fn ended(end: &mut watch::Receiver<bool>) {
    let _ = end.wait_for(|end| *end).await;
}

/// Looks until this gateway has the robots. Returns its fence, and when it asked for it.
async fn take(
    sharing: &Sharing,
    present: &Present,
    row: &mut OwnerRow,
    watch: &mut Watch,
    served: &mut Served,
    looked: &mut Option<oneshot::Sender<()>>,
) -> (u64, r6_proto::time::Instant) {
    let mut has_failed = false;
    let mut pause = Duration::ZERO;
    loop {
        tokio::time::sleep(pause).await;
        pause = LOOK;
        let (seen, name) = match row.look().await {
            Ok(looked) => looked,
            Err(error) => {
                if !has_failed {
                    tracing::error!(%error, "it is not known which gateway owns the robots");
                }
                has_failed = true;
                present.state().shared.ownership.set_other(String::new());
                continue;
            }
        };
        has_failed = false;
        if served.is_old
            && let Ok(state) = waiting(sharing, String::new()).await
        {
            present.set(state);
            *served = serve(sharing, present);
        }
        let now = clock::now();
        let verdict = watch.look(now, seen);
        pause = watch.pause(now);
        match verdict {
            Verdict::Wait => {
                let is_alive = seen.state == crate::core::owner::RowState::Alive;
                present.state().shared.ownership.set_other(if is_alive { name } else { String::new() });
            }
            Verdict::Behind { highest } => {
                tracing::error!(
                    fence = seen.fence,
                    highest,
                    "the store is older than what it said before: nothing is taken from it"
                );
            }
            Verdict::Take => {
                let asked = clock::now();
                match row.take(seen, &sharing.name).await {
                    Ok(Some(fence)) => return (fence, asked),
                    // Another gateway was faster.
                    Ok(None) => {}
                    Err(error) => tracing::warn!(%error, "the robots could not be taken"),
                }
                continue;
            }
        }
        looked.take().map(|looked| looked.send(()));
    }
}

/// Says again and again that this gateway lives, until it owns nothing any more.
async fn beat(mut row: OwnerRow, fence: u64, ownership: Ownership) -> OwnerRow {
    let mut wait = BEAT;
    loop {
        tokio::time::sleep(wait).await;
        if ownership.phase() == Phase::Over {
            return row;
        }
        let sent = clock::now();
        match row.beat(fence).await {
            Ok(true) => {
                ownership.beaten(sent);
                wait = BEAT.saturating_sub(clock::now().since(sent));
            }
            Ok(false) => {
                ownership.refused();
                return row;
            }
            Err(error) => {
                tracing::warn!(%error, "a beat of the owner failed");
                wait = AFTER_FAILURE;
            }
        }
    }
}

/// How the others call this gateway: where callers find it.
pub(crate) fn name(address: SocketAddr, is_secure: bool, names: &[String]) -> String {
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
