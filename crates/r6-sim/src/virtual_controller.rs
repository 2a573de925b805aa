//! A virtual controller for use in tests.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc;
use std::thread;

use r6_controller::{LibraryError, Profile, Program, RobotModel, Scenario, StartState};
use tokio::sync::oneshot;

use crate::camera::Camera;
use crate::clock::Clock;
use crate::disk::Disk;
use crate::handle::ControllerHandle;
use crate::settings::{SimError, SimSettings};
use crate::simulation::Simulation;
use crate::state::StateError;

/// One virtual controller on a free port of 127.0.0.1. It listens as soon as it is started, and ends when it
/// is dropped.
///
/// ```
/// # #[tokio::main(flavor = "current_thread")]
/// # async fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let robot = r6_sim::VirtualController::start().await?;
/// let stream = tokio::net::TcpStream::connect(robot.address()).await?;
/// # drop(stream); Ok(()) }
/// ```
///
/// A test without a runtime can run it on its own thread:
///
/// ```
/// use r6_controller::Profile;
/// use r6_sim::{Clock, VirtualController};
///
/// let legacy = Profile::named("legacy").unwrap();
/// let builder = VirtualController::builder().profile(legacy).clock(Clock::AsFastAsPossible).seed(7);
/// let robot = builder.start_blocking()?;
/// let stream = std::net::TcpStream::connect(robot.address()).unwrap();
/// # drop(stream); Ok::<(), r6_sim::SimError>(())
/// ```
///
/// With a taught program, and an operator at the machine: a part comes (X010), and the gripper closes (Y010).
///
/// ```
/// use r6_controller::io::OutputPoint;
/// use r6_controller::{PanelAction, Program};
/// use r6_sim::{Clock, VirtualController};
///
/// let text = r#"
///     [[step]]
///     do = "wait"
///     point = "X010"
///     [[step]]
///     do = "output"
///     point = "Y010"
///     on = true
/// "#;
/// let gripper = Program::read("gripper", text)?;
/// let robot =
///     VirtualController::builder().program(gripper)?.clock(Clock::AsFastAsPossible).start_blocking()?;
/// let closed = || robot.handle().snapshot().io.is_set(OutputPoint::Y(0, 0));
/// assert!(!closed());
/// robot.handle().operate(&PanelAction::SetInput { board: 0, point: 0, on: true })?;
/// assert!(closed());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct VirtualController {
    handle: ControllerHandle,
    running: Running,
}

/// What runs the controller.
#[derive(Debug)]
enum Running {
    /// Tasks of the caller's runtime.
    Here(Simulation),
    /// A thread with its own runtime, which ends when its sender is dropped.
    Apart { end: Option<oneshot::Sender<()>>, thread: Option<thread::JoinHandle<Result<(), StateError>>> },
}

impl VirtualController {
    /// Starts a controller on the current runtime: `hc1` with a BRTIRUS0707A, waiting for remote commands.
    ///
    /// # Errors
    /// [`SimError`]: nothing is left running.
    pub async fn start() -> Result<Self, SimError> {
        Self::builder().start().await
    }

    /// Starts a controller on its own thread, for a test without a runtime.
    ///
    /// # Errors
    /// [`SimError`]: nothing is left running.
    pub fn start_blocking() -> Result<Self, SimError> {
        Self::builder().start_blocking()
    }

    /// A builder for a controller with other settings.
    pub fn builder() -> Builder {
        Builder { settings: SimSettings::default() }
    }

    /// The address that it listens on.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.handle.address()
    }

    /// The handle for everything that an operator at the machine can do and see.
    #[must_use]
    pub fn handle(&self) -> &ControllerHandle {
        &self.handle
    }

    /// Ends the controller and its connections. When this returns, nothing listens, and the state that
    /// survives a power cut is on the disk.
    ///
    /// # Errors
    /// The state could not be written.
    pub async fn shutdown(mut self) -> Result<(), StateError> {
        let gone = Running::Apart { end: None, thread: None };
        match std::mem::replace(&mut self.running, gone) {
            Running::Here(simulation) => simulation.shutdown().await,
            mut apart @ Running::Apart { .. } => {
                // It fails only if the runtime ends.
                tokio::task::spawn_blocking(move || apart.end()).await.unwrap_or(Ok(()))
            }
        }
    }

    /// The same for a controller that [`Self::start_blocking`] or [`Builder::start_blocking`] started. On any
    /// other controller it only drops it, without writing its state.
    ///
    /// # Errors
    /// The state could not be written.
    pub fn shutdown_blocking(mut self) -> Result<(), StateError> {
        self.running.end()
    }
}

impl Running {
    fn end(&mut self) -> Result<(), StateError> {
        let Self::Apart { end, thread } = self else { return Ok(()) };
        drop(end.take());
        // That thread has already reported its panic.
        thread.take().map_or(Ok(()), |thread| thread.join().unwrap_or(Ok(())))
    }
}

impl Drop for VirtualController {
    fn drop(&mut self) {
        // The log says what was not saved.
        let _ = self.running.end();
    }
}

/// The settings of a new [`VirtualController`].
#[derive(Clone, Debug)]
#[must_use]
pub struct Builder {
    settings: SimSettings,
}

impl Builder {
    /// The profile of its firmware.
    pub fn profile(mut self, profile: Profile) -> Self {
        self.settings.profile = profile;
        self
    }

    /// The arm.
    pub fn model(mut self, model: RobotModel) -> Self {
        self.settings.model = model;
        self
    }

    /// Adds a taught program to those of every controller, and runs it. If there are several, the last one
    /// runs.
    ///
    /// # Errors
    /// [`LibraryError`] if there are too many programs.
    pub fn program(mut self, program: Program) -> Result<Self, LibraryError> {
        program.name().clone_into(&mut self.settings.mold);
        self.settings.library.insert(program)?;
        Ok(self)
    }

    /// Its state when it is switched on.
    pub fn stands(mut self, start: StartState) -> Self {
        self.settings.start = start;
        self
    }

    /// The speed of its time.
    pub fn clock(mut self, clock: Clock) -> Self {
        self.settings.clock = clock;
        self
    }

    /// The seed of all random values.
    pub fn seed(mut self, seed: u64) -> Self {
        self.settings.seed = seed;
        self
    }

    /// Adds a camera that it dials.
    pub fn camera(mut self, camera: Camera) -> Self {
        self.settings.cameras.push(camera);
        self
    }

    /// Its scenario: the events and faults that happen to it.
    pub fn scenario(mut self, scenario: Scenario) -> Self {
        self.settings.scenario = Some(Arc::new(scenario));
        self
    }

    /// The folder for the state that survives a power cut.
    pub fn state(mut self, folder: impl Into<PathBuf>) -> Self {
        self.settings.state = Some(folder.into());
        self
    }

    /// The disk of this folder, if it is not this computer's.
    pub fn disk(mut self, disk: Arc<dyn Disk>) -> Self {
        self.settings.disk = Some(disk);
        self
    }

    /// Starts it on the current runtime.
    ///
    /// # Errors
    /// [`SimError`]: nothing is left running.
    pub async fn start(self) -> Result<VirtualController, SimError> {
        let simulation = Simulation::start(self.settings).await?;
        let handle = only(&simulation)?;
        Ok(VirtualController { handle, running: Running::Here(simulation) })
    }

    /// Starts it on the current runtime, without a network: [`ControllerHandle::dial`] reaches it.
    ///
    /// # Errors
    /// [`SimError`]: nothing is left running.
    pub async fn start_in_memory(self) -> Result<VirtualController, SimError> {
        let simulation = Simulation::start_in_memory(self.settings).await?;
        let handle = only(&simulation)?;
        Ok(VirtualController { handle, running: Running::Here(simulation) })
    }

    /// Starts it on its own thread.
    ///
    /// # Errors
    /// [`SimError`]: nothing is left running.
    pub fn start_blocking(self) -> Result<VirtualController, SimError> {
        let (started, starting) = mpsc::sync_channel(1);
        let (end, ended) = oneshot::channel();
        let thread = thread::Builder::new()
            .name("virtual controller".to_owned())
            .spawn(move || run(self.settings, &started, ended))
            .map_err(SimError::System)?;
        let handle = starting.recv().map_err(|gone| SimError::System(std::io::Error::other(gone)))??;
        Ok(VirtualController { handle, running: Running::Apart { end: Some(end), thread: Some(thread) } })
    }
}

/// Runs a controller until the other end of `ended` is dropped.
fn run(
    settings: SimSettings,
    started: &mpsc::SyncSender<Result<ControllerHandle, SimError>>,
    ended: oneshot::Receiver<()>,
) -> Result<(), StateError> {
    let tell = |result| {
        // The caller that started this waits for it.
        let _ = started.send(result);
        Ok(())
    };
    let runtime = match tokio::runtime::Builder::new_current_thread().enable_all().build() {
        Ok(runtime) => runtime,
        Err(error) => return tell(Err(SimError::System(error))),
    };
    runtime.block_on(async {
        let simulation = match Simulation::start(settings).await {
            Ok(simulation) => simulation,
            Err(error) => return tell(Err(error)),
        };
        tell(only(&simulation))?;
        // The sender sends nothing; it is dropped.
        let _ = ended.await;
        simulation.shutdown().await
    })
}

fn only(simulation: &Simulation) -> Result<ControllerHandle, SimError> {
    simulation.controllers().first().cloned().ok_or(SimError::BadCount { controllers: 0 })
}
