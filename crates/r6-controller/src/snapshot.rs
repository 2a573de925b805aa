//! The state of the machine that an operator can see.

use std::collections::BTreeMap;

use r6_motion::robot_model::AxisMotion;
use r6_proto::AXES;
use r6_proto::alarm::AlarmCode;
use r6_proto::readiness::{ReadinessFacts, Unmet};

use crate::io::Io;
use crate::machine::Machine;
use r6_proto::OperationMode;

/// A virtual controller at one point in time.
#[derive(Clone, Debug, PartialEq)]
pub struct ControllerSnapshot {
    /// The value of `version`.
    pub version: String,
    /// The value of `machineName`.
    pub machine_name: String,
    /// The profile's name.
    pub profile: String,
    /// The robot model's name.
    pub model: String,
    /// The operation mode.
    pub mode: OperationMode,
    /// The alarm, 0 for none.
    pub alarm: AlarmCode,
    /// Whether the emergency stop is pressed.
    pub emergency_stop: bool,
    /// Whether the mains have failed.
    pub power_off: bool,
    /// Whether it is homed.
    pub homed: bool,
    /// Whether a move is under way.
    pub moving: bool,
    /// The program in use.
    pub program: String,
    /// The names of the programs.
    pub programs: Vec<String>,
    /// The step of the program whose turn it is; `None` where no step is left.
    pub step: Option<ProgramStep>,
    /// What keeps the machine from taking instructions, as a client judges it; empty where it takes them.
    pub unmet: Vec<Unmet>,
    /// Whether the program is in its step that waits for remote commands. No query address tells this.
    pub takes_remote: bool,
    /// The cameras whose points no program has used yet: camera, how many.
    pub points: Vec<(i64, usize)>,
    /// How many instructions are left in the list.
    pub list_length: usize,
    /// Axis positions in degrees, or mm on a linear axis: J1 is `axes[0]`.
    pub axes: [f64; AXES],
    /// Soft limits of the arm's axes, in the same units: lowest, highest.
    pub axis_limits: Vec<(f64, f64)>,
    /// The units of the arm's axes.
    pub axis_motions: Vec<AxisMotion>,
    /// X, Y, Z in mm, U, V, W in degrees, of the tool in use in the work frame in use.
    pub world: [f64; 6],
    /// Global speed in percent.
    pub global_speed_percent: f64,
    /// Time of the current cycle in seconds.
    pub cycle_seconds: f64,
    /// Time of the last finished cycle in seconds.
    pub last_cycle_seconds: f64,
    /// Inputs, outputs and M points, 32 to a word.
    pub io: Io,
    /// How many connections are served.
    pub connections: usize,
}

/// A step of a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProgramStep {
    /// The program it stands in: the program in use, or a program that it calls.
    pub program: String,
    /// Its number, from 1.
    pub number: usize,
    /// How many steps that program has.
    pub steps: usize,
    /// What it does, in English.
    pub text: String,
}

impl ControllerSnapshot {
    /// Whether the machine takes instructions now: every condition is met, and the program waits for remote
    /// commands.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.unmet.is_empty() && self.takes_remote
    }

    /// What keeps the machine from taking instructions, in English, in the order in which to deal with it.
    #[must_use]
    pub fn not_ready(&self) -> Vec<String> {
        let elsewhere = self.unmet.is_empty() && !self.takes_remote;
        let step =
            elsewhere.then(|| "the program is not in its step that waits for remote commands".to_owned());
        self.unmet.iter().map(ToString::to_string).chain(step).collect()
    }

    pub(crate) fn of(machine: &Machine, connections: usize) -> Self {
        let motion = machine.motion();
        Self {
            version: machine.profile.version.clone(),
            machine_name: machine.machine_name.clone(),
            profile: machine.profile.name.clone(),
            model: machine.model.name.to_string(),
            mode: machine.mode,
            alarm: machine.alarm,
            emergency_stop: machine.emergency_stop,
            power_off: false,
            homed: machine.homed,
            moving: machine.tells_moving(),
            program: machine.programs.mold.clone(),
            programs: machine.programs.library.names().map(str::to_owned).collect(),
            step: machine.present_step(),
            unmet: facts(machine).unmet(),
            takes_remote: machine.mode == OperationMode::Running && machine.is_remote(),
            points: points_of_cameras(machine),
            list_length: machine.list.len(),
            axes: *motion.axes.degrees(),
            axis_limits: machine.model.drives().map(|axis| (axis.soft.min, axis.soft.max)).collect(),
            axis_motions: machine.model.drives().map(|axis| axis.motion).collect(),
            world: machine.pose_of(&motion.axes).components(),
            global_speed_percent: machine.global_speed * 100.0,
            cycle_seconds: machine.cycle_time().as_secs_f64(),
            last_cycle_seconds: machine.cycle.last.as_secs_f64(),
            io: machine.io.clone(),
            connections,
        }
    }
}

/// The facts by which a client judges whether the machine takes instructions.
fn facts(machine: &Machine) -> ReadinessFacts<'_> {
    ReadinessFacts {
        program: Some(&machine.programs.mold),
        mode: Some(machine.mode),
        alarm: Some(i64::from(machine.alarm)),
        homed: Some(machine.homed),
        moving: Some(machine.tells_moving()),
        list_length: i64::try_from(machine.list.len()).ok(),
        list_is_unreadable: false,
    }
}

fn points_of_cameras(machine: &Machine) -> Vec<(i64, usize)> {
    let mut counts = BTreeMap::new();
    for (camera, _) in machine.points() {
        *counts.entry(*camera).or_default() += 1;
    }
    counts.into_iter().collect()
}
