//! Several virtual controllers that start and end together.

use std::net::SocketAddr;
use std::sync::Arc;

use r6_controller::{Controller, ControllerSettings};
use r6_proto::alarm::AlarmCode;
use r6_proto::time::Instant;
use tokio::net::TcpListener;
use tokio::sync::{Semaphore, mpsc};
use tokio::task::JoinSet;
use tracing::warn;

use crate::camera::{self, MAX_CAMERAS};
use crate::clock::Pace;
use crate::door;
use crate::handle::ControllerHandle;
use crate::keeper::Keeper;
use crate::memory::MemoryStream;
use crate::panel;
use crate::settings::{MAX_CONTROLLERS, SimError, SimSettings};
use crate::state::{Found, StateError, StateFile, StateFolder};

/// How many in-memory connections wait to be served; further ones are refused. The same number as in systems.
const MAX_ARRIVALS: usize = 1024;

/// Running virtual controllers. They end when this is dropped.
#[derive(Debug)]
pub struct Simulation {
    controllers: Vec<ControllerHandle>,
    panel: Option<SocketAddr>,
    tasks: JoinSet<()>,
}

impl Simulation {
    /// Starts the controllers. When this returns, all of them listen.
    ///
    /// # Errors
    /// [`SimError`]: nothing is left running.
    pub async fn start(settings: SimSettings) -> Result<Self, SimError> {
        check_cameras(&settings)?;
        let mut cabinets = Cabinets::new(&settings)?;
        let panel = listen_for_panel(&settings).await?;
        let mut simulation = Self { controllers: Vec::new(), panel: None, tasks: JoinSet::new() };
        for address in addresses(&settings)? {
            let failed = |error| SimError::Listen { address, error };
            let listener = TcpListener::bind(address).await.map_err(failed)?;
            let bound = listener.local_addr().map_err(failed)?;
            let seed = cabinets.next_seed();
            let handle = cabinets.switch_on(bound, None, &mut simulation.tasks)?;
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
            simulation.tasks.spawn(r6_http::serve(
                listener,
                panel::router(&simulation.controllers, address),
                None,
            ));
        }
        Ok(simulation)
    }

    /// Starts controllers that are reached without a network, by [`ControllerHandle::dial`]. Their addresses
    /// are only names, and port 0 becomes the number of the controller. Time is tokio's. With a paused clock
    /// and a runtime with one thread, the same settings and peers give the same bytes and log, whatever else
    /// the machine does.
    ///
    /// # Errors
    /// [`SimError`]: nothing is left running. Panel and cameras need a network.
    pub async fn start_in_memory(settings: SimSettings) -> Result<Self, SimError> {
        if settings.panel.is_some() || !settings.cameras.is_empty() {
            return Err(SimError::NeedsNetwork);
        }
        let mut cabinets = Cabinets::new(&settings)?;
        let mut simulation = Self { controllers: Vec::new(), panel: None, tasks: JoinSet::new() };
        for (number, mut address) in (1..).zip(addresses(&settings)?) {
            if address.port() == 0 {
                address.set_port(number);
            }
            let (entrance, arrivals) = mpsc::channel(MAX_ARRIVALS);
            let handle = cabinets.switch_on(address, Some(entrance), &mut simulation.tasks)?;
            simulation.tasks.spawn(door::attend_in_memory(arrivals, handle.clone()));
            simulation.controllers.push(handle);
        }
        Ok(simulation)
    }

    /// The controllers, in the order of their addresses.
    #[must_use]
    pub fn controllers(&self) -> &[ControllerHandle] {
        &self.controllers
    }

    /// The address of the panel over HTTP.
    #[must_use]
    pub fn panel(&self) -> Option<SocketAddr> {
        self.panel
    }

    /// Ends all controllers and their connections, and writes their states.
    ///
    /// # Errors
    /// The first state that could not be written within 10 s; the log of its controller says so, too.
    /// Everything has ended nevertheless.
    pub async fn shutdown(mut self) -> Result<(), StateError> {
        self.tasks.shutdown().await;
        let mut finishing: JoinSet<_> =
            std::mem::take(&mut self.controllers).into_iter().map(ControllerHandle::finish).collect();
        let mut kept = Ok(());
        while let Some(finished) = finishing.join_next().await {
            // A task fails only if its runtime ends.
            kept = kept.and(finished.unwrap_or(Ok(())));
        }
        kept
    }
}

/// Switches the controllers on, one after another.
struct Cabinets<'s> {
    settings: &'s SimSettings,
    folder: Option<StateFolder>,
    writes: Arc<Semaphore>,
    started: tokio::time::Instant,
    /// The number of the next controller, from 0.
    next: u64,
}

impl<'s> Cabinets<'s> {
    fn new(settings: &'s SimSettings) -> Result<Self, SimError> {
        let on_disk = |path| StateFolder::on(settings.disk.as_ref(), path);
        let folder = settings.state.as_deref().map(on_disk).transpose().map_err(SimError::State)?;
        let (writes, started) = (Keeper::writes(), tokio::time::Instant::now());
        Ok(Self { settings, folder, writes, started, next: 0 })
    }

    /// The seed of the next controller.
    fn next_seed(&self) -> u64 {
        self.settings.seed.wrapping_add(self.next)
    }

    /// Switches the next controller on, with the tasks for its time and its state.
    fn switch_on(
        &mut self,
        address: SocketAddr,
        entrance: Option<mpsc::Sender<MemoryStream>>,
        tasks: &mut JoinSet<()>,
    ) -> Result<ControllerHandle, SimError> {
        let (settings, seed) = (self.settings, self.next_seed());
        let file = self.folder.as_ref().map(|folder| folder.file(self.next + 1));
        let mut controller = switch_on(settings, seed, file.as_ref())?;
        settings.cameras.iter().for_each(|camera| controller.expect_camera(camera.cam_id));
        let keeper = file.map(|file| Keeper::new(file, self.writes.clone()));
        let keeps = keeper.is_some();
        let pace = Pace::new(settings.clock, self.started);
        let handle = ControllerHandle::new(address, controller, pace, keeper, entrance, seed);
        tasks.spawn(handle.clone().run_timers());
        if keeps {
            tasks.spawn(handle.clone().run_keeper());
        }
        self.next += 1;
        Ok(handle)
    }
}

/// The listener of the panel, if one is requested.
async fn listen_for_panel(settings: &SimSettings) -> Result<Option<(SocketAddr, TcpListener)>, SimError> {
    let Some(address) = settings.panel else { return Ok(None) };
    if !address.ip().is_loopback() && !settings.panel_open {
        return Err(SimError::PanelNotLocal { address });
    }
    let failed = |error| SimError::ListenPanel { address, error };
    let listener = TcpListener::bind(address).await.map_err(failed)?;
    Ok(Some((listener.local_addr().map_err(failed)?, listener)))
}

/// A controller with the state that the last power cut left.
fn switch_on(settings: &SimSettings, seed: u64, file: Option<&StateFile>) -> Result<Controller, SimError> {
    let own = ControllerSettings {
        start: settings.start,
        library: settings.library.clone(),
        mold: settings.mold.clone(),
        seed,
        scenario: settings.scenario.clone(),
        ..ControllerSettings::new(settings.profile.clone(), settings.model.clone())
    };
    Ok(match file.map(StateFile::read).transpose().map_err(SimError::State)? {
        None | Some(Found::Nothing) => Controller::new(own, Instant::ORIGIN),
        Some(Found::Saved(saved)) => Controller::restored(own, &saved, Instant::ORIGIN),
        Some(Found::Damaged { why }) => {
            warn!("{why}");
            let mut controller = Controller::new(own, Instant::ORIGIN);
            controller.raise(Instant::ORIGIN, AlarmCode::STORAGE, why);
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
