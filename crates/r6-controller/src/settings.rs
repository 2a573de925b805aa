//! The settings of a virtual controller when it is switched on, besides its profile.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::mode::StartState;
use crate::profile::Profile;
use crate::program::Library;
use crate::scenario::Scenario;
use r6_motion::RobotModel;

/// The program that waits for remote commands. A controller runs it by default.
pub const REMOTE_MOLD: &str = "remote";

/// How a virtual controller is built.
#[derive(Clone, Debug)]
pub struct ControllerSettings {
    /// The profile of its firmware.
    pub profile: Profile,
    /// The arm.
    pub model: RobotModel,
    /// Its state when it is switched on.
    pub start: StartState,
    /// Whether the machine is homed (`origin`). A machine that is not homed runs no program.
    pub homed: bool,
    /// The value of `machineName`. It says that the machine is virtual, in a field that clients only display.
    pub machine_name: String,
    /// The value of `curAccount`: the user.
    pub account: String,
    /// The programs.
    pub library: Library,
    /// The program in use. A program that is not in the library has no steps.
    pub mold: String,
    /// The counters: id, (target, current).
    pub counters: BTreeMap<u32, (i64, i64)>,
    /// The value of `boardIOnum`: how many IO boards there are.
    pub io_boards: u8,
    /// The global speed in percent.
    pub global_speed: f64,
    /// The seed of all random values: how long the reply to AddRCC takes, and what a scenario leaves open.
    pub seed: u64,
    /// Its scenario: the events and faults that happen to it.
    pub scenario: Option<Arc<Scenario>>,
}

impl ControllerSettings {
    /// The settings of a controller with this profile and arm: homed, waiting for remote commands, global
    /// speed 100 %.
    #[must_use]
    pub fn new(profile: Profile, model: RobotModel) -> Self {
        Self {
            machine_name: format!("r6 virtual {}", model.name),
            profile,
            model,
            start: StartState::Waiting,
            homed: true,
            account: "operator".to_owned(),
            library: Library::default(),
            mold: REMOTE_MOLD.to_owned(),
            counters: [(0, (0, 0)), (2, (0, 0)), (5, (0, 0))].into_iter().collect(),
            io_boards: 2,
            global_speed: 100.0,
            seed: 0,
            scenario: None,
        }
    }
}
