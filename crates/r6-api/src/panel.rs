//! The types of the HTTP panel of virtual controllers. Field names contain units; points and axes have their
//! names on the pendant.

use std::collections::BTreeMap;

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
    /// In manual: moves one axis by hand as long as its button is held. It ends with `end_jog`, when
    /// `keep_jog` did not come for 200 ms, and at a soft limit, with the alarm of that limit.
    HoldJog {
        /// `J1` to `J8`.
        #[cfg_attr(feature = "openapi", schema(example = "J1"))]
        axis: String,
        /// Whether its position grows.
        up: bool,
        /// How fast, in percent of the axis's full speed, times the global speed: above 0, at most 100; 10 if
        /// it is missing.
        #[serde(default = "usual_speed")]
        #[cfg_attr(feature = "openapi", schema(default = 10.0, maximum = 100.0))]
        speed_percent: f64,
    },
    /// The button of `hold_jog` is still held. This never begins a move.
    KeepJog {},
    /// The button of `hold_jog` is let go: the axis comes to rest.
    EndJog {},
    /// Gives the controller a fault, from now on.
    BeginFault {
        /// Its word: `GET …/faults` has all.
        #[cfg_attr(feature = "openapi", schema(example = "silence"))]
        fault: String,
        /// Its kind, for a fault that has kinds.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        kind: Option<String>,
        /// How likely it strikes each time it can, 0 to 1; 1 if it is missing.
        #[serde(default = "certain")]
        #[cfg_attr(feature = "openapi", schema(default = 1.0, minimum = 0.0, maximum = 1.0))]
        chance: f64,
        /// After how many seconds it ends by itself; until `end_fault` if it is missing.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        seconds: Option<f64>,
        /// Its numbers, by name, as in a scenario; the usual ones if they are missing.
        #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
        #[cfg_attr(feature = "openapi", schema(example = json!({"delay": 3.0})))]
        numbers: BTreeMap<String, f64>,
    },
    /// Ends a fault. If it has ended before, nothing changes.
    EndFault {
        /// Its number: `faults` of the state has those that are in force.
        number: usize,
    },
    /// Ends all faults that are in force.
    EndFaults {},
    /// The mains fail, and are back after this time.
    CutPower {
        /// For how many seconds, 0 to 3600; 10 if it is missing.
        #[serde(default = "usual_cut")]
        #[cfg_attr(feature = "openapi", schema(default = 10.0, minimum = 0.0, maximum = 3600.0))]
        seconds: f64,
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

impl Action {
    /// Whether it needs no lease at a gateway: a stop is done at once, and the end of a fault is the way back
    /// from a robot that does not answer, whose lease it may be impossible to acquire.
    #[must_use]
    pub fn needs_no_lease(&self) -> bool {
        matches!(
            self,
            Self::Press { button: Button::Stop | Button::Pause }
                | Self::EmergencyStop {}
                | Self::EndFault { .. }
                | Self::EndFaults {}
        )
    }
}

/// The default speed of a move by hand, in percent.
fn usual_speed() -> f64 {
    10.0
}

/// A fault strikes each time unless its chance is given.
fn certain() -> f64 {
    1.0
}

/// How long a power cut lasts by default, in seconds: as in a scenario.
fn usual_cut() -> f64 {
    10.0
}

/// The faults that a virtual controller can be given.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Faults {
    /// In the order of their classes.
    pub faults: Vec<FaultKind>,
}

/// A fault that a virtual controller can be given.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct FaultKind {
    /// Its word, as in a scenario.
    #[cfg_attr(feature = "openapi", schema(example = "silence"))]
    pub fault: String,
    /// Its class in the catalogue of faults.
    #[cfg_attr(feature = "openapi", schema(example = "T3"))]
    pub class: String,
    /// Its kinds, one of which has to be chosen; empty if it has none.
    pub kinds: Vec<String>,
    /// The names of its numbers, which may be left out.
    pub numbers: Vec<String>,
}

/// A fault that is in force.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct FaultInForce {
    /// Its number, for `end_fault`. No other fault of this controller has or gets it.
    pub number: usize,
    /// Its word.
    #[cfg_attr(feature = "openapi", schema(example = "silence"))]
    pub fault: String,
    /// Its kind; absent if it has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// How likely it strikes each time it can, 0 to 1.
    pub chance: f64,
    /// After how many seconds it ends by itself; absent if it does not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds_left: Option<f64>,
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
    /// The faults that are in force, of a scenario too.
    pub faults: Vec<FaultInForce>,
    /// Whether the mains have failed.
    pub power_off: bool,
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
