//! The types of the HTTP panel of virtual controllers. Field names contain units; points and axes have their
//! names on the pendant.

use serde::{Deserialize, Serialize};

use crate::position::{Pose, Unit};

/// What a person does at the machine; `do` says what.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Action {
    /// Sets an input.
    SetInput {
        /// `X010`, on board 1 `X1.010`, on the EU board `EUX010`: octal, from 010 to 047.
        #[cfg_attr(feature = "openapi", schema(example = "X010"))]
        point: String,
        /// Its level from now on.
        on: bool,
    },
    /// Presses a button.
    Press {
        /// Which.
        button: Button,
    },
    /// Turns the mode key.
    TurnKey {
        /// To where.
        key: Key,
    },
    /// Presses the emergency stop, which stays pressed: alarm 7.
    EmergencyStop {},
    /// Releases the emergency stop; alarm 7 stays until it is cleared.
    ReleaseEmergencyStop {},
    /// Clears the alarm; nothing runs by itself.
    ClearAlarm {},
    /// Raises an alarm.
    RaiseAlarm {
        /// Its number, 1 to 10000.
        #[cfg_attr(feature = "openapi", schema(minimum = 1, maximum = 10_000, example = 130))]
        alarm: u32,
    },
    /// In manual: moves all axes to 0, where the machine is homed.
    Home {},
    /// In manual: moves one axis by hand. It ends at a soft limit, with the alarm of that limit.
    Jog {
        /// `J1` to `J8`.
        #[cfg_attr(feature = "openapi", schema(example = "J1"))]
        axis: String,
        /// How far, degrees, or mm where the axis slides; below 0 the other way.
        #[cfg_attr(feature = "openapi", schema(example = 10.0))]
        by: f64,
        /// How fast, in percent of the axis's full speed, times the global speed: above 0, at most 100; 10 if
        /// it is missing.
        #[serde(default = "usual_speed")]
        #[cfg_attr(feature = "openapi", schema(default = 10.0, maximum = 100.0))]
        speed_percent: f64,
    },
    /// Removes the points of cameras that no program has used yet.
    ClearPoints {},
    /// Chooses another program.
    SwitchProgram {
        /// Its name.
        #[cfg_attr(feature = "openapi", schema(example = "remote"))]
        program: String,
    },
}

/// The default speed of a move by hand, in percent.
fn usual_speed() -> f64 {
    10.0
}

/// A button of the pendant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Button {
    /// Runs the program.
    Start,
    /// Ends the program with its cycle; a second press ends it at once. Ends a move by hand.
    Stop,
    /// Brings the motion to rest; start resumes it. Ends a move by hand.
    Pause,
    /// Runs the program to the end of its pass.
    SingleCycle,
    /// Runs one step of the program.
    SingleStep,
}

/// A position of the mode key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Key {
    /// Moves by hand.
    Manual,
    /// Programs, once start is pressed.
    Auto,
    /// Neither.
    Stop,
}

/// The controllers of this process.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Controllers {
    /// In the order of their numbers.
    pub controllers: Vec<Controller>,
}

/// One of the controllers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Controller {
    /// Its number in paths, from 1.
    pub number: usize,
    /// Where it speaks the remote protocol.
    #[cfg_attr(feature = "openapi", schema(example = "127.0.0.1:9760"))]
    pub address: String,
    /// What `machineName` answers.
    pub machine_name: String,
}

/// What a person would see at the machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Snapshot {
    /// Its number in paths, from 1.
    pub number: usize,
    /// Where it speaks the remote protocol.
    pub address: String,
    /// Always true: no real machine has this panel.
    pub r#virtual: bool,
    /// What `machineName` answers.
    pub machine_name: String,
    /// What `version` answers.
    pub firmware: String,
    /// The profile's name.
    pub profile: String,
    /// The robot model's name.
    pub model: String,
    /// The operation mode (`curMode`).
    pub mode: i64,
    /// The operation mode in words.
    #[cfg_attr(feature = "openapi", schema(example = "running (7)"))]
    pub mode_name: String,
    /// The alarm, 0 for none (`curAlarm`).
    pub alarm: u32,
    /// What the alarm means; absent without an alarm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alarm_text: Option<String>,
    /// Whether the emergency stop is pressed.
    pub emergency_stop: bool,
    /// Whether it is homed (`origin`).
    pub homed: bool,
    /// Whether a move is under way (`isMoving`).
    pub moving: bool,
    /// The program in use.
    pub program: String,
    /// The programs there are.
    pub programs: Vec<String>,
    /// The step of the program whose turn it is; absent where no step is left.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step: Option<Step>,
    /// Whether the machine takes instructions: every condition of `status` is met, and the program is in its
    /// step that waits for remote commands.
    pub ready: bool,
    /// What keeps it from taking instructions, in the order in which to deal with it.
    pub not_ready: Vec<String>,
    /// The points of cameras that no program has used yet.
    pub camera_points: Vec<CameraPoints>,
    /// How many instructions are left in the list.
    pub list_length: usize,
    /// The arm's axes, J1 first.
    pub axes: Vec<Axis>,
    /// The pose of the tool in use, in the work frame in use.
    pub pose: Pose,
    /// Global speed, percent.
    pub global_speed_percent: f64,
    /// Time of the present cycle.
    pub cycle_seconds: f64,
    /// Time of the last cycle that ended.
    pub last_cycle_seconds: f64,
    /// The inputs that are on, by name.
    #[cfg_attr(feature = "openapi", schema(example = json!(["X010", "EUX012"])))]
    pub inputs_on: Vec<String>,
    /// The outputs that are on, by name.
    #[cfg_attr(feature = "openapi", schema(example = json!(["Y010", "EUY012"])))]
    pub outputs_on: Vec<String>,
    /// The M points that are on, by name.
    #[cfg_attr(feature = "openapi", schema(example = json!(["M011"])))]
    pub m_on: Vec<String>,
    /// How many connections of the remote protocol are served.
    pub connections: usize,
}

/// A step of a program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Step {
    /// The program it stands in: the program in use, or a program that it calls.
    pub program: String,
    /// Its number, from 1.
    pub number: usize,
    /// How many steps that program has.
    pub steps: usize,
    /// What it does, in English.
    #[cfg_attr(feature = "openapi", schema(example = "wait until X010 is on"))]
    pub text: String,
}

/// The points of one camera that no program has used yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CameraPoints {
    /// The camera's number (`camID`).
    pub camera: i64,
    /// How many points wait.
    pub points: usize,
}

/// One axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Axis {
    /// `J1` to `J8`.
    pub name: String,
    /// Where it stands, in its unit.
    pub position: f64,
    /// `deg`, or `mm` where it slides.
    pub unit: Unit,
    /// Its lower soft limit, in its unit.
    pub lowest: f64,
    /// Its upper soft limit, in its unit.
    pub highest: f64,
}
