//! The operator's actions at the machine: inputs, buttons, the mode key, the emergency stop, moving by hand.

use std::fmt;

use r6_proto::alarm::AlarmCode;
use r6_proto::{AxisIndex, OperationMode};

use crate::mode::Key;

/// An action of an operator at the machine. A machine in the cell can also set inputs.
#[derive(Clone, Debug, PartialEq)]
pub enum PanelAction {
    /// Sets an input X.
    SetInput {
        /// Board, 0 to 7.
        board: u8,
        /// Point on the board, 0 to 31.
        point: u8,
        /// Its new level.
        on: bool,
    },
    /// Sets an input of the EU board.
    SetEuInput {
        /// Point, 0 to 31.
        point: u8,
        /// Its new level.
        on: bool,
    },
    /// Presses a button.
    Press(Button),
    /// Turns the mode key.
    TurnKey(Key),
    /// Presses the emergency stop, which stays pressed.
    EmergencyStop,
    /// Releases the emergency stop; alarm 7 stays until it is cleared.
    ReleaseEmergencyStop,
    /// Clears the alarm. Nothing starts to run.
    ClearAlarm,
    /// Raises an alarm, 1 to [`AlarmCode::LAST`], for the fault of a part that is not simulated.
    RaiseAlarm(AlarmCode),
    /// Homes the machine, in manual: all axes move to 0, and the machine is then homed (`origin`).
    Home,
    /// Moves one axis by hand, in manual. The move ends at a soft limit, with the alarm of that limit.
    Jog {
        /// The axis.
        axis: AxisIndex,
        /// The distance, in degrees, or mm on a linear axis; negative for the other direction.
        by: f64,
        /// The speed, in percent of the axis's full speed, times the global speed: above 0, at most 100.
        percent: f64,
    },
    /// Moves one axis by hand, in manual, as long as a button is held: until [`Self::EndJog`], or until
    /// [`Self::KeepJog`] did not come for 200 ms. The move ends at a soft limit, with the alarm of that
    /// limit.
    HoldJog {
        /// The axis.
        axis: AxisIndex,
        /// Whether its position grows.
        up: bool,
        /// The speed, in percent of the axis's full speed, times the global speed: above 0, at most 100.
        percent: f64,
    },
    /// The button of [`Self::HoldJog`] is still held. This never begins a move.
    KeepJog,
    /// The button of [`Self::HoldJog`] is let go. Without such a move this does nothing.
    EndJog,
    /// Removes the points of cameras that no program has used yet.
    ClearPoints,
    /// Chooses another program (mold).
    SwitchProgram(String),
    /// Loads a program, and replaces one with the same name.
    LoadProgram {
        /// Its name (`moldList`).
        name: String,
        /// Its text, TOML or JSON (`docs/PROGRAMS.md`).
        text: String,
    },
}

impl PanelAction {
    /// Whether it works without mains: inputs of the cell, the mode key and the emergency stop.
    #[must_use]
    pub fn needs_no_power(&self) -> bool {
        match self {
            Self::SetInput { .. }
            | Self::SetEuInput { .. }
            | Self::TurnKey(_)
            | Self::EmergencyStop
            | Self::ReleaseEmergencyStop => true,
            Self::Press(_)
            | Self::ClearAlarm
            | Self::RaiseAlarm(_)
            | Self::Home
            | Self::Jog { .. }
            | Self::HoldJog { .. }
            | Self::KeepJog
            | Self::EndJog
            | Self::ClearPoints
            | Self::SwitchProgram(_)
            | Self::LoadProgram { .. } => false,
        }
    }
}

/// A button of the pendant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Button {
    /// Runs the program.
    Start,
    /// Ends the program with its cycle; a second press ends it at once (`Profile::stop_button`). Ends a move
    /// by hand.
    Stop,
    /// Brings the motion to rest; start resumes it. Ends a move by hand.
    Pause,
    /// Runs the program to the end of its pass (`curMode` 9).
    SingleCycle,
    /// Runs one step of the program (`curMode` 8 until that step has ended).
    SingleStep,
}

/// Why the machine refused an action. The text says why, and what to do.
#[derive(Clone, Debug, PartialEq)]
pub enum Refused {
    /// There is no such input.
    NoSuchInput {
        /// The board that was given.
        board: u8,
        /// The point that was given.
        point: u8,
    },
    /// The mains have failed.
    PowerOff,
    /// The emergency stop is pressed.
    EmergencyStop,
    /// An alarm is present.
    Alarm {
        /// Its number.
        alarm: AlarmCode,
    },
    /// The machine is not homed, so it runs no program.
    NotHomed,
    /// A program runs in automatic only.
    NotAuto {
        /// The mode it is in.
        mode: OperationMode,
    },
    /// Axes are moved by hand in manual only.
    NotManual {
        /// The mode it is in.
        mode: OperationMode,
    },
    /// The arm is still moving.
    Moving,
    /// The arm has no such axis.
    NoSuchAxis {
        /// The axis that was given.
        axis: AxisIndex,
        /// How many axes it has.
        axes: usize,
    },
    /// The distance of a move by hand is not a number, or 0.
    NoDistance,
    /// The speed of a move by hand is not above 0 and at most 100 percent.
    BadSpeed,
    /// No axis moves by hand whose button could still be held.
    NotHeld,
    /// The global speed is 0.
    NoGlobalSpeed,
    /// There is no such alarm.
    NoSuchAlarm {
        /// The number that was given.
        alarm: AlarmCode,
    },
    /// The program could not be chosen.
    Program {
        /// Why.
        reason: String,
    },
    /// The text is not a program.
    BadProgram {
        /// Where it is wrong, and why.
        reason: String,
    },
    /// The program runs, or the running one may call it.
    ProgramRuns {
        /// Its name.
        name: String,
    },
    /// There is no room for the program, or for another fault.
    NoRoom {
        /// Why.
        reason: String,
    },
    /// The move could not be planned.
    NoPath {
        /// Why.
        reason: String,
    },
}

impl Refused {
    /// Why, and what to do, without the numbers, for places that already know them.
    #[must_use]
    pub fn reason(&self) -> &'static str {
        match self {
            Self::NoSuchInput { .. } => "there is no such input: boards 0 to 7 have points 0 to 31",
            Self::PowerOff => "the mains have failed: wait until they are back",
            Self::EmergencyStop => {
                "the emergency stop is pressed: make the cell safe, release it, then clear the alarm"
            }
            Self::Alarm { .. } => "an alarm is present: clear it first",
            Self::NotHomed => "the machine is not homed",
            Self::NotAuto { mode: OperationMode::Manual } => {
                "the machine is in manual: turn the key to automatic"
            }
            Self::NotAuto { .. } => "the machine is in stop: turn the key to automatic",
            Self::NotManual { .. } => "axes are moved by hand in manual only: turn the key to manual",
            Self::Moving => "the arm is moving: stop it, or wait until it rests",
            Self::NoSuchAxis { .. } => "the arm has no such axis",
            Self::NoDistance => "the distance is a number of degrees or mm other than 0",
            Self::BadSpeed => "the speed is above 0 and at most 100 percent",
            Self::NotHeld => "no axis moves as long as a button is held: the move has ended",
            Self::NoGlobalSpeed => "the global speed is 0: raise it first (modifyGSPD)",
            Self::NoSuchAlarm { .. } => "there are alarms 1 to 10000",
            Self::Program { .. } => "the program could not be chosen",
            Self::BadProgram { .. } => "the text is no program",
            Self::ProgramRuns { .. } => {
                "the program runs: stop it first, or load the text under another name"
            }
            Self::NoRoom { .. } => "there is no room",
            Self::NoPath { .. } => "the move could not be planned",
        }
    }
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSuchInput { board, point } => {
                write!(f, "there is no point {point} on board {board}: boards 0 to 7 have points 0 to 31")
            }
            Self::NotManual { mode } => {
                write!(
                    f,
                    "the mode is {mode}, and axes are moved by hand in manual only: turn the key to manual"
                )
            }
            Self::NoSuchAxis { axis, axes } => write!(f, "the arm has no {axis}: it has J1 to J{axes}"),
            Self::NoSuchAlarm { alarm } => {
                write!(f, "there is no alarm {alarm}: there are 1 to {}", AlarmCode::LAST)
            }
            Self::ProgramRuns { name } => write!(
                f,
                "program `{name}` runs, or the running program may call it: stop it first, or load the text under another name"
            ),
            Self::Program { reason }
            | Self::BadProgram { reason }
            | Self::NoRoom { reason }
            | Self::NoPath { reason } => f.write_str(reason),
            Self::PowerOff
            | Self::EmergencyStop
            | Self::Alarm { .. }
            | Self::NotHomed
            | Self::NotAuto { .. }
            | Self::Moving
            | Self::NoDistance
            | Self::BadSpeed
            | Self::NotHeld
            | Self::NoGlobalSpeed => f.write_str(self.reason()),
        }
    }
}

impl std::error::Error for Refused {}

impl From<Refused> for String {
    /// The text that goes into a reply and the log.
    fn from(refused: Refused) -> Self {
        refused.to_string()
    }
}
