//! The state of the machine that an operator can see.

use r6_motion::robot_model::AxisMotion;
use r6_proto::AXES;

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
    pub alarm: u32,
    /// Whether the emergency stop is pressed.
    pub emergency_stop: bool,
    /// Whether it is homed.
    pub homed: bool,
    /// Whether a move is under way.
    pub moving: bool,
    /// The program in use.
    pub program: String,
    /// The names of the programs.
    pub programs: Vec<String>,
    /// How many instructions are left in the list.
    pub list_length: usize,
    /// Axis positions in degrees, or mm on a linear axis.
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

impl ControllerSnapshot {
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
            homed: machine.homed,
            moving: machine.tells_moving(),
            program: machine.programs.mold.clone(),
            programs: machine.programs.library.names().map(str::to_owned).collect(),
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
