//! A whole gateway whose time, random numbers, network and disk come from a simulation.
//!
//! It is the gateway of `r6 gateway`: its router, fleet, seats, store and tables. [`enter`] gives the thread
//! the time and the random numbers of a world. [`start`] starts a gateway on a [`Disk`] of that world, behind
//! a listener and [`Roads`] of its network. TLS, raw ports, users with passwords and the history need files
//! and threads of their own: they are off.

mod disk;

use std::cell::{Cell, RefCell};
use std::fmt;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use r6_client::{RequestError, Robot, RobotSettings};
use r6_http::Listener;
use tokio::task::JoinSet;

pub use disk::{Disk, Fullness};

use crate::fleet::config::RobotConfig;
use crate::fleet::station::Shared;
use crate::gateway::{self, GatewayError};
use crate::http;
use crate::store::Keeper;

/// How long after 1970 each world begins: on 2026-01-01.
const BEGINS: Duration = Duration::from_secs(1_767_225_600);

thread_local! {
    static CLOCK: Cell<Option<fn() -> Duration>> = const { Cell::new(None) };
    static BYTES: RefCell<u64> = const { RefCell::new(0) };
}

/// The thread has the time and the random numbers of a world until this is dropped.
#[derive(Debug)]
pub struct Entered(());

/// Gives this thread the time and the random numbers of a world. Two worlds of one seed draw the same bytes.
#[must_use = "it ends when this is dropped"]
pub fn enter(clock: fn() -> Duration, seed: u64) -> Entered {
    CLOCK.set(Some(clock));
    BYTES.with(|state| *state.borrow_mut() = seed);
    Entered(())
}

impl Drop for Entered {
    fn drop(&mut self) {
        CLOCK.set(None);
    }
}

/// The time of the world; `None` outside one.
pub(crate) fn time() -> Option<Duration> {
    CLOCK.get().map(|clock| clock())
}

/// The time of day of the world; `None` outside one.
pub(crate) fn today() -> Option<SystemTime> {
    time().and_then(|time| SystemTime::UNIX_EPOCH.checked_add(BEGINS + time))
}

/// Fills in random bytes of the world. `false` outside one.
pub(crate) fn fill(bytes: &mut [u8]) -> bool {
    if CLOCK.get().is_none() {
        return false;
    }
    BYTES.with(|state| {
        let mut state = state.borrow_mut();
        for byte in bytes {
            // SplitMix64: each call differs, and that is enough here.
            *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mixed = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            *byte = (mixed ^ (mixed >> 27)).to_le_bytes()[5];
        }
    });
    true
}

/// A connection that is being made.
pub type Connecting = Pin<Box<dyn Future<Output = Result<Robot, RequestError>> + Send>>;

/// The ways to the robots of a world.
#[derive(Clone)]
pub struct Roads(Arc<dyn Fn(&str, RobotSettings) -> Connecting + Send + Sync>);

impl Roads {
    /// This function connects to the robot at an address.
    #[must_use]
    pub fn new(connect: impl Fn(&str, RobotSettings) -> Connecting + Send + Sync + 'static) -> Self {
        Self(Arc::new(connect))
    }

    pub(crate) async fn connect(
        &self,
        address: &str,
        settings: RobotSettings,
    ) -> Result<Robot, RequestError> {
        (self.0)(address, settings).await
    }
}

impl fmt::Debug for Roads {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Roads")
    }
}

/// What a simulated gateway needs.
#[derive(Debug)]
pub struct Settings {
    /// The address that it is reached by.
    pub address: SocketAddr,
    /// Host names by which clients reach it.
    pub names: Vec<String>,
    /// The robots of its configuration.
    pub robots: Vec<RobotConfig>,
    /// How to communicate with robots that are added through the API.
    pub robot_settings: RobotSettings,
}

/// A running gateway. It ends without order when this is dropped: as a process that is killed.
#[derive(Debug)]
pub struct Running {
    _server: JoinSet<()>,
}

/// Starts a gateway on what the disk has. The gateway before, if there was one, can write nothing from now on.
///
/// # Errors
/// [`GatewayError`].
pub async fn start(
    disk: &Disk,
    listener: impl Listener + 'static,
    roads: Roads,
    settings: Settings,
) -> Result<Running, GatewayError> {
    let mut store = disk.mount();
    let robots = gateway::all_robots(&mut store, settings.robots, &settings.robot_settings)?;
    let saved = gateway::begin(&mut store, robots)?;
    let pace = disk.clone();
    let keeper = Keeper::in_task(store, move || pace.takes());
    let shared = Shared::new(keeper, crate::fleet::roads::Roads::Simulated(roads), None, gateway::epoch());
    let state = gateway::look_after(saved, shared, None, settings.robot_settings, None).await?;
    let mut server = JoinSet::new();
    let site = gateway::site(settings.address, settings.names, &state);
    server.spawn(r6_http::serve_plain(listener, http::router(state.clone(), site)));
    gateway::keep_fresh(&state, &mut server);
    Ok(Running { _server: server })
}
