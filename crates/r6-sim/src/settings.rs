//! The settings of a simulation: how many controllers, where, and of what kind.

use std::fmt;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;

use r6_controller::settings::REMOTE_MOLD;
use r6_controller::{Library, Profile, RobotModel, Scenario, StartState};

use crate::camera::{Camera, MAX_CAMERAS};
use crate::clock::Clock;
use crate::disk::Disk;
use crate::state::StateError;

/// The most controllers in one process. Each has its own listening socket and port.
pub const MAX_CONTROLLERS: usize = 10_000;

/// What [`crate::Simulation::start`] starts.
#[derive(Clone, Debug)]
pub struct SimSettings {
    /// The addresses to listen on; port 0 takes any free port.
    pub listen: Vec<SocketAddr>,
    /// How many controllers to start per address, on consecutive ports.
    pub count: u16,
    /// The profile of their firmware.
    pub profile: Profile,
    /// The arm.
    pub model: RobotModel,
    /// Their state when they are switched on.
    pub start: StartState,
    /// Their programs.
    pub library: Library,
    /// The program in use.
    pub mold: String,
    /// The cameras that each controller dials, with one connection each: at most [`MAX_CAMERAS`], each
    /// `camID` once.
    pub cameras: Vec<Camera>,
    /// The scenario of each controller; each draws its own random values.
    pub scenario: Option<Arc<Scenario>>,
    /// The address of the panel over HTTP; `None` for no panel. Port 0 takes any free port.
    pub panel: Option<SocketAddr>,
    /// Whether the panel may listen where other machines can reach it, although it has no login.
    pub panel_open: bool,
    /// The speed of their time.
    pub clock: Clock,
    /// The seed; controller n has seed + n.
    pub seed: u64,
    /// The folder for the states that survive a power cut, one file per controller; `None` if nothing
    /// survives. `start` then counts only for a controller without a file.
    pub state: Option<PathBuf>,
    /// The disk of that folder; `None` for this computer's. On a simulated disk no folder is created or
    /// locked.
    pub disk: Option<Arc<dyn Disk>>,
}

impl Default for SimSettings {
    /// One `hc1` controller with a BRTIRUS0707A, waiting for remote commands, on a free port of 127.0.0.1.
    fn default() -> Self {
        Self {
            listen: vec![SocketAddr::from((Ipv4Addr::LOCALHOST, 0))],
            count: 1,
            profile: Profile::hc1(),
            model: RobotModel::default(),
            start: StartState::Waiting,
            library: Library::default(),
            mold: REMOTE_MOLD.to_owned(),
            cameras: Vec::new(),
            scenario: None,
            panel: None,
            panel_open: false,
            clock: Clock::Real,
            seed: 0,
            state: None,
            disk: None,
        }
    }
}

/// Why a simulation could not be started. Nothing is left running.
#[derive(Debug)]
pub enum SimError {
    /// There is no address to listen on, no controller, or too many.
    BadCount {
        /// How many controllers were requested.
        controllers: usize,
    },
    /// There are more cameras than one controller can dial.
    TooManyCameras {
        /// How many were given.
        cameras: usize,
    },
    /// Two cameras with the same `camID`, or two without.
    SameCamera {
        /// The `camID`.
        cam_id: Option<i64>,
    },
    /// The consecutive ports end before all controllers have one.
    NoSuchPort {
        /// The first address.
        first: SocketAddr,
        /// How many ports were needed.
        count: u16,
    },
    /// The system did not allow listening there.
    Listen {
        /// The address.
        address: SocketAddr,
        /// Why not.
        error: io::Error,
    },
    /// The system did not allow offering the panel there.
    ListenPanel {
        /// The address.
        address: SocketAddr,
        /// Why not.
        error: io::Error,
    },
    /// The panel would be reachable from other machines, and the settings do not allow that.
    PanelNotLocal {
        /// The address.
        address: SocketAddr,
    },
    /// A panel or a camera was requested, but there is no network.
    NeedsNetwork,
    /// The system provides no thread or runtime.
    System(io::Error),
    /// The folder of [`SimSettings::state`] cannot be used.
    State(StateError),
}

impl fmt::Display for SimError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BadCount { controllers } => {
                write!(
                    f,
                    "{controllers} controllers were asked for: from 1 to {MAX_CONTROLLERS} are possible"
                )
            }
            Self::TooManyCameras { cameras } => {
                write!(f, "{cameras} cameras were named: {MAX_CAMERAS} are possible")
            }
            Self::SameCamera { cam_id: Some(cam_id) } => {
                write!(f, "camera {cam_id} has two addresses: give each camera its own number, ID=ADDR:PORT")
            }
            Self::SameCamera { cam_id: None } => {
                write!(
                    f,
                    "two cameras have no number: write ID=ADDR:PORT, with the camID that programs ask for"
                )
            }
            Self::NoSuchPort { first, count } => {
                write!(f, "{count} ports from {first} on go beyond 65535: begin with a lower port")
            }
            Self::Listen { address, error } if error.kind() == io::ErrorKind::AddrInUse => {
                write!(f, "{address} is taken by another program: choose another address with --listen")
            }
            Self::Listen { error, .. } if is_out_of_files(error) => {
                write!(
                    f,
                    "too many open files: each controller listens on one; raise the limit with `ulimit -n`"
                )
            }
            Self::NeedsNetwork => f.write_str(
                "controllers in memory have no network for a panel or for cameras: start them with sockets, or without those",
            ),
            Self::State(error) => error.fmt(f),
            Self::System(error) => write!(f, "the system gives no thread to run on: {error}"),
            Self::Listen { address, error } => write!(f, "cannot listen on {address}: {error}"),
            Self::ListenPanel { address, error } if error.kind() == io::ErrorKind::AddrInUse => {
                write!(f, "{address} is taken by another program: choose another address with --panel")
            }
            Self::ListenPanel { address, error } => {
                write!(f, "cannot offer the panel on {address}: {error}")
            }
            Self::PanelNotLocal { address } => {
                write!(
                    f,
                    "the panel has no login, and {address} can be reached from other machines: use 127.0.0.1, or \
                     say --panel-open"
                )
            }
        }
    }
}

/// Whether the process cannot open more files (EMFILE, which is 24 on every Unix).
fn is_out_of_files(error: &io::Error) -> bool {
    cfg!(unix) && error.raw_os_error() == Some(24)
}

impl std::error::Error for SimError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Listen { error, .. } | Self::ListenPanel { error, .. } | Self::System(error) => Some(error),
            Self::State(error) => Some(error),
            Self::BadCount { .. }
            | Self::TooManyCameras { .. }
            | Self::SameCamera { .. }
            | Self::NoSuchPort { .. }
            | Self::PanelNotLocal { .. }
            | Self::NeedsNetwork => None,
        }
    }
}
