//! A whole gateway whose time, random numbers, network and disk come from a simulation.
//!
//! It is the gateway of `r6 gateway`: its router, fleet, seats, store and tables. [`enter`] gives the
//! thread the time and the random numbers of a world. [`start`] starts a gateway on a [`Disk`] of that
//! world, behind a listener and [`Roads`] of its network. TLS, raw ports and users with passwords need
//! files and threads of their own: they are off. The history is on if it is given a folder: its files are
//! real, and a task on the time of the world writes them.

mod disk;
mod history;

use std::net::SocketAddr;
use std::path::PathBuf;

use r6_client::RobotSettings;
use r6_http::Listener;
use tokio::task::JoinSet;

pub use disk::{Disk, Fullness};
pub use history::write_history;

use crate::auditor::{self, AuditSettings};
use crate::core::head::Signer;
use crate::fleet::config::RobotConfig;
use crate::fleet::station::Shared;
use crate::gateway::{self, GatewayError};
use crate::history::{HistorySettings, Recorder};
use crate::http;
pub use crate::simulated::{Connecting, Entered, Roads, enter};
use crate::store::{Keeper, StoreError};

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
    /// What is kept of the audit log; `None` for all of it, without signed heads on the disk.
    pub audit: Option<AuditSettings>,
    /// The folder of the history, and what is kept; `None` for no history.
    pub history: Option<(PathBuf, HistorySettings)>,
}

/// A running gateway. It ends without order when this is dropped: as a process that is killed.
#[derive(Debug)]
pub struct Running {
    _server: JoinSet<()>,
}

/// Starts a gateway on what the disk has. The gateway before, if there was one, can write nothing from now
/// on.
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
    // It has no folder for a key.
    let signer = Signer::of_seed([0; 32]).ok_or_else(|| StoreError::Unavailable("no key".to_owned()))?;
    if settings.audit.is_some() {
        auditor::begin(&mut store, &signer)?;
    }
    let saved = gateway::begin(&mut store, robots)?;
    let pace = disk.clone();
    let keeper = Keeper::in_task(store, move || pace.takes());
    let history = settings.history.map(|(folder, kept)| Recorder::in_task(&folder, kept));
    let shared = Shared::new(keeper, crate::fleet::roads::Roads::Simulated(roads), history, gateway::epoch());
    let audit = (signer, settings.audit.unwrap_or_default());
    let state = gateway::look_after(
        saved,
        shared,
        (settings.address.port(), None),
        settings.robot_settings,
        None,
        Some(audit),
    )
    .await?;
    let mut server = JoinSet::new();
    let site = gateway::site(settings.address, settings.names, &state);
    server.spawn(r6_http::serve_plain(listener, http::router(state.clone(), site)));
    gateway::keep_fresh(&state, &mut server);
    if let Some(auditor) = state.auditor.clone().filter(|_| settings.audit.is_some()) {
        server.spawn(async move { auditor.keep().await });
    }
    Ok(Running { _server: server })
}
