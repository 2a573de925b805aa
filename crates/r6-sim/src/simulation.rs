//! A number of virtual controllers, started and ended together.

use std::net::SocketAddr;

use r6_controller::{Controller, ControllerSettings};
use r6_proto::time::Instant;
use tokio::net::TcpListener;
use tokio::task::JoinSet;
use tracing::warn;

use crate::camera::{self, MAX_CAMERAS};
use crate::clock::Pace;
use crate::door;
use crate::handle::ControllerHandle;
use crate::keeper::Keeper;
use crate::panel;
use crate::settings::{MAX_CONTROLLERS, SimError, SimSettings};
use crate::state::{Found, StateFile, StateFolder};

/// What a controller shows whose state could not be read: "storage cannot be read".
const STORAGE_ALARM: u32 = 14;

/// Running virtual controllers; they end when this is dropped.
#[derive(Debug)]
pub struct Simulation {
    controllers: Vec<ControllerHandle>,
    panel: Option<SocketAddr>,
    tasks: JoinSet<()>,
}

impl Simulation {
    /// Starts the controllers; when this returns, all of them listen.
    ///
    /// # Errors
    /// [`SimError`]: nothing is left running.
    pub async fn start(settings: SimSettings) -> Result<Self, SimError> {
        let addresses = addresses(&settings)?;
        check_cameras(&settings)?;
        let folder = settings.state.as_deref().map(StateFolder::open).transpose().map_err(SimError::State)?;
        let writes = Keeper::writes();
        let started = tokio::time::Instant::now();
        let panel = listen_for_panel(&settings).await?;
        let mut simulation =
            Self { controllers: Vec::with_capacity(addresses.len()), panel: None, tasks: JoinSet::new() };
        for (number, address) in (0_u64..).zip(addresses) {
            let failed = |error| SimError::Listen { address, error };
            let listener = TcpListener::bind(address).await.map_err(failed)?;
            let bound = listener.local_addr().map_err(failed)?;
            let file = folder.as_ref().map(|folder| folder.file(number + 1));
            let mut controller = switch_on(&settings, number, file.as_ref())?;
            settings.cameras.iter().for_each(|camera| controller.expect_camera(camera.cam_id));
            let keeper = file.map(|file| Keeper::new(file, writes.clone()));
            let pace = Pace::new(settings.clock, started);
            let seed = settings.seed.wrapping_add(number);
            let handle = ControllerHandle::new(bound, controller, pace, keeper, seed);
            simulation.tasks.spawn(handle.clone().run_timers());
            if folder.is_some() {
                simulation.tasks.spawn(handle.clone().run_keeper());
            }
            simulation.tasks.spawn(door::attend(listener, handle.clone()));
            for (nth, camera) in (0_u64..).zip(&settings.cameras) {
                // Each link draws its own waits.
                let seed = seed.rotate_left(32).wrapping_add(nth);
                simulation.tasks.spawn(camera::dial(handle.clone(), *camera, seed));
            }
            simulation.controllers.push(handle);
        }
        if let Some((address, listener)) = panel {
            simulation.panel = Some(address);
            simulation.tasks.spawn(panel::serve(listener, simulation.controllers.clone()));
        }
        Ok(simulation)
    }

    /// The controllers, in the order of their addresses.
    #[must_use]
    pub fn controllers(&self) -> &[ControllerHandle] {
        &self.controllers
    }

    /// Where the panel is offered over HTTP.
    #[must_use]
    pub fn panel(&self) -> Option<SocketAddr> {
        self.panel
    }

    /// Ends all controllers and their connections, and writes what they have to keep.
    pub async fn shutdown(mut self) {
        self.tasks.shutdown().await;
        let controllers = std::mem::take(&mut self.controllers);
        let finish = move || controllers.iter().for_each(ControllerHandle::finish);
        // It fails only where the runtime ends, and then nobody waits for it.
        let _ = tokio::task::spawn_blocking(finish).await;
    }
}

/// The panel's listener, where one is wanted.
async fn listen_for_panel(settings: &SimSettings) -> Result<Option<(SocketAddr, TcpListener)>, SimError> {
    let Some(address) = settings.panel else { return Ok(None) };
    if !address.ip().is_loopback() && !settings.panel_open {
        return Err(SimError::PanelNotLocal { address });
    }
    let failed = |error| SimError::ListenPanel { address, error };
    let listener = TcpListener::bind(address).await.map_err(failed)?;
    Ok(Some((listener.local_addr().map_err(failed)?, listener)))
}

/// The controller of this number from 0, as it was left by the last power cut.
fn switch_on(settings: &SimSettings, number: u64, file: Option<&StateFile>) -> Result<Controller, SimError> {
    let own = ControllerSettings {
        start: settings.start,
        library: settings.library.clone(),
        mold: settings.mold.clone(),
        seed: settings.seed.wrapping_add(number),
        scenario: settings.scenario.clone(),
        ..ControllerSettings::new(settings.profile.clone(), settings.model.clone())
    };
    Ok(match file.map(StateFile::read).transpose().map_err(SimError::State)? {
        None | Some(Found::Nothing) => Controller::new(own, Instant::ORIGIN),
        Some(Found::Saved(saved)) => Controller::restored(own, &saved, Instant::ORIGIN),
        Some(Found::Damaged { why }) => {
            warn!("{why}");
            let mut controller = Controller::new(own, Instant::ORIGIN);
            controller.raise(Instant::ORIGIN, STORAGE_ALARM, why);
            controller
        }
    })
}

fn check_cameras(settings: &SimSettings) -> Result<(), SimError> {
    let cameras = &settings.cameras;
    if cameras.len() > MAX_CAMERAS {
        return Err(SimError::TooManyCameras { cameras: cameras.len() });
    }
    let mut ids: Vec<_> = cameras.iter().map(|camera| camera.cam_id).collect();
    ids.sort_unstable();
    match ids.windows(2).find(|pair| pair.first() == pair.last()) {
        Some(pair) => Err(SimError::SameCamera { cam_id: pair.first().copied().flatten() }),
        None => Ok(()),
    }
}

/// Every address that a controller listens on.
fn addresses(settings: &SimSettings) -> Result<Vec<SocketAddr>, SimError> {
    let controllers = settings.listen.len() * usize::from(settings.count);
    if controllers == 0 || controllers > MAX_CONTROLLERS {
        return Err(SimError::BadCount { controllers });
    }
    let mut addresses = Vec::with_capacity(controllers);
    for first in &settings.listen {
        for offset in 0..settings.count {
            let port = match first.port() {
                0 => 0,
                port => port
                    .checked_add(offset)
                    .ok_or(SimError::NoSuchPort { first: *first, count: settings.count })?,
            };
            addresses.push(SocketAddr::new(first.ip(), port));
        }
    }
    Ok(addresses)
}
