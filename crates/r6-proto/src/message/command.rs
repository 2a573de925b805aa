//! Commands: requests that act at once (manual 4.2); the answers to them are in `reply`.

mod reply;

use std::borrow::Cow;
use std::fmt;

use crate::address::{Ports, RegisterIndex};
use crate::encode::{Decimals, write_fixed, write_integer};
use crate::error::{EncodeError, FieldError};
use crate::grid::Grid;
use crate::message::fields::excerpt;
use crate::printable::printable;
use crate::spelling;
use crate::text;
use crate::value::{Value, Values};

pub use reply::{CommandReply, Outcome};

/// What a request can do to the machine. Whoever decides about requests (a lease, a firewall, an audit) decides by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Effect {
    /// Nothing: it reads.
    Reads,
    /// It changes a value or an output.
    Changes,
    /// It can set the arm in motion. A cell may start one by an output (a pulse on M011), by a register (800 to 805) or by
    /// another program, so what writes those counts as well.
    Moves,
    /// It can only end a motion.
    Stops,
}

impl Effect {
    /// Its word: `reads`, `changes`, `moves` or `stops`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Reads => "reads",
            Self::Changes => "changes",
            Self::Moves => "moves",
            Self::Stops => "stops",
        }
    }
}

impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// One row of the table of commands.
#[derive(Clone, Copy, Debug)]
pub struct CommandInfo {
    /// The word on the wire (`cmdData[0]`).
    pub word: &'static str,
    /// The arguments, in order.
    pub arguments: &'static [ArgumentInfo],
    /// What it does.
    pub meaning: &'static str,
    /// What it can do to the machine.
    pub effect: Effect,
    /// Which port has it.
    pub ports: Ports,
    /// The first manual or firmware that knows it.
    pub since: &'static str,
    /// Where it is written: the number in the manual's table 4.2.1, or the evidence for a later one.
    pub source: &'static str,
}

/// One argument of a command.
#[derive(Clone, Copy, Debug)]
pub struct ArgumentInfo {
    /// Its name in the CLI and the docs.
    pub name: &'static str,
    /// Its meaning and unit, as a person types it and as the wire has it.
    pub meaning: &'static str,
    /// Whether it can be left out. The optional arguments of a command are given all together, or not at all.
    pub optional: bool,
}

const fn argument(name: &'static str, meaning: &'static str) -> ArgumentInfo {
    ArgumentInfo { name, meaning, optional: false }
}

const fn optional(name: &'static str, meaning: &'static str) -> ArgumentInfo {
    ArgumentInfo { name, meaning, optional: true }
}

/// The name of a command: the 18 of manual 4.2.1 in its order, then `clearAlarm`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[expect(missing_docs, reason = "each variant is a row of COMMANDS, which says what it does")]
pub enum CommandName {
    ActionStop,
    ActionPause,
    ActionSingleCycle,
    StartButton,
    StopButton,
    SwitchMold,
    ModifyCounter,
    ModifyOutput,
    ClearAlarmRunNext,
    ClearAlarmContinue,
    ModifyStackData,
    ModifyGspd,
    RewriteData,
    RewriteDataList,
    ModifyAccDec,
    SwitchTool,
    ModifyTool,
    SwitchCoordinate,
    ClearAlarm,
}

/// Every command, in the order of [`CommandName`].
pub const COMMANDS: [CommandInfo; 19] = {
    use Effect::{Changes, Moves, Stops};
    use Ports::{Both, Pendant};
    #[rustfmt::skip]
    const fn row(
        word: &'static str, arguments: &'static [ArgumentInfo], meaning: &'static str,
        effect: Effect, ports: Ports, since: &'static str, source: &'static str,
    ) -> CommandInfo {
        CommandInfo { word, arguments, meaning, effect, ports, since, source }
    }
    #[rustfmt::skip]
    let table = [
        row("actionStop", &[], "stops the motion at once; start begins from the first step", Stops, Both, "V6.0", "4.2.1 #1"),
        row("actionPause", &[], "pauses the motion; start goes on from the present step", Stops, Both, "V6.0", "4.2.1 #2"),
        row("actionSingleCycle", &[], "enters single cycle", Moves, Both, "V6.0", "4.2.1 #3"),
        row("startButton", &[], "the start button", Moves, Both, "V6.0", "4.2.1 #4"),
        row("stopButton", &[], "the stop button: first press ends with the cycle, second at once", Stops, Both, "V6.0", "4.2.1 #5"),
        row("switchMold", &[argument("mold", "name of the program")], "switches to another program (mold)", Moves, Pendant, "V6.0", "4.2.1 #6"),
        row("modifyCounter", &[argument("id", "counter"), argument("current", "its count, -1 to keep"), argument("target", "its target, -1 to keep; the mainboard's port of 2020 cannot change it")], "changes a counter", Changes, Both, "V6.0", "4.2.1 #7"),
        row("modifyOutput", &[argument("board", "0-3 output boards, 4-6 M (not on the pendant's port of 2020), 7 EU"), argument("point", "0-31"), argument("state", "0 off, 1 on")], "sets one output", Moves, Both, "V6.0", "4.2.1 #8"),
        row("clearAlarmRunNext", &[], "clears the alarm and runs the next step", Moves, Both, "V6.0", "4.2.1 #9"),
        row("clearAlarmContinue", &[], "clears the alarm and goes on automatically", Moves, Both, "V6.0", "4.2.1 #10"),
        row("modifyStackData", &[argument("stack", "stack"), argument("dx", "spacing in X, mm"), argument("dy", "spacing in Y, mm"), argument("dz", "spacing in Z, mm"), argument("nx", "count in X"), argument("ny", "count in Y"), argument("nz", "count in Z")], "changes a stack (palletising pattern)", Changes, Pendant, "V6.0", "4.2.1 #11"),
        row("modifyGSPD", &[argument("percent", "global speed in percent; the wire has percent x 10")], "changes the global speed", Changes, Both, "V6.0", "4.2.1 #12"),
        row("rewriteData", &[argument("register", "800-900"), argument("value", "a whole number"), argument("savable", "1 to keep it over a power cut")], "writes one register", Moves, Both, "V6.0", "4.2.1 #13"),
        row("rewriteDataList", &[argument("register", "the first, 800-900"), argument("length", "how many values follow"), argument("savable", "1 to keep them over a power cut"), argument("values", "whole numbers")], "writes several registers", Moves, Both, "V6.0", "4.2.1 #14"),
        row("modifyAccDec", &[argument("acceleration", "seconds; the wire has seconds x 1000"), argument("deceleration", "seconds; the wire has seconds x 1000")], "changes the acceleration and deceleration time of the path", Changes, Both, "V6.0", "4.2.1 #15"),
        row("switchTool", &[argument("tool", "number of the tool")], "switches to another tool", Changes, Both, "V6.0", "4.2.1 #16"),
        row("modifyTool", &[argument("tool", "number of the tool"), argument("x", "mm; the wire has mm x 1000"), argument("y", "mm"), argument("z", "mm"), argument("rx", "degrees; the wire has degrees x 1000"), argument("ry", "degrees"), argument("rz", "degrees")], "changes a tool", Changes, Both, "V6.0", "4.2.1 #17"),
        row("switchCoordinate", &[argument("workbench", "number of the workbench")], "switches to another workbench", Changes, Both, "V6.0", "4.2.1 #18"),
        row("clearAlarm", &[optional("first_line", "1: the program goes to its first line (newest manual)"), optional("only_alarm", "1: only the alarm is cleared (newest manual)")], "resets and clears the alarm", Changes, Both, "207beta57", "later manual"),
    ];
    table
};

impl CommandName {
    /// All of them, in the order of [`COMMANDS`].
    pub const ALL: [Self; 19] = [
        Self::ActionStop,
        Self::ActionPause,
        Self::ActionSingleCycle,
        Self::StartButton,
        Self::StopButton,
        Self::SwitchMold,
        Self::ModifyCounter,
        Self::ModifyOutput,
        Self::ClearAlarmRunNext,
        Self::ClearAlarmContinue,
        Self::ModifyStackData,
        Self::ModifyGspd,
        Self::RewriteData,
        Self::RewriteDataList,
        Self::ModifyAccDec,
        Self::SwitchTool,
        Self::ModifyTool,
        Self::SwitchCoordinate,
        Self::ClearAlarm,
    ];

    /// The command with exactly this word.
    #[must_use]
    pub fn exact(word: &[u8]) -> Option<Self> {
        Self::ALL.into_iter().find(|name| name.word().as_bytes() == word)
    }

    /// The word on the wire.
    #[must_use]
    pub fn word(self) -> &'static str {
        self.info().word
    }

    /// The row of the table.
    #[must_use]
    pub fn info(self) -> &'static CommandInfo {
        // A discriminant counts from 0 in the table's order and is always inside it.
        #[expect(clippy::indexing_slicing, reason = "a discriminant is below the number of variants")]
        &COMMANDS[self as usize]
    }

    /// What it can do to the machine.
    #[must_use]
    pub fn effect(self) -> Effect {
        self.info().effect
    }

    /// The word of the table that comes nearest to one that is none.
    #[must_use]
    pub fn nearest(word: &str) -> Option<&'static str> {
        spelling::nearest(word, COMMANDS.iter().map(|row| row.word))
    }
}

impl fmt::Display for CommandName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// A command as it was sent: its name and its arguments, not yet read.
#[derive(Clone, Copy, Debug)]
pub struct CommandWords<'a> {
    pub(crate) words: Values<'a>,
}

impl<'a> CommandWords<'a> {
    /// The word that names the command, as sent.
    #[must_use]
    pub fn word(&self) -> Cow<'a, str> {
        self.words.at(0).map(|word| word.text()).unwrap_or_default()
    }

    /// The command it names.
    #[must_use]
    pub fn name(&self) -> Option<CommandName> {
        self.words.at(0).and_then(|word| CommandName::exact(&word.word()))
    }

    /// The arguments, as sent.
    #[must_use]
    pub fn arguments(&self) -> Values<'a> {
        self.words.skip(1)
    }

    /// The command, with its arguments read and checked.
    ///
    /// # Errors
    /// [`CommandError`] for an unknown name (with the nearest one) and for an argument that is missing or wrong.
    pub fn read(&self) -> Result<Command<'a>, CommandError> {
        let Some(name) = self.name() else {
            let word = self.word();
            return Err(CommandError::UnknownCommand {
                word: word.chars().take(48).collect(),
                nearest: CommandName::nearest(&word),
            });
        };
        Command::read(name, self.arguments()).map_err(CommandError::Argument)
    }
}

/// Why a command cannot be carried out as sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CommandError {
    /// Nobody knows this command.
    UnknownCommand {
        /// The word, cut at 48 characters.
        word: String,
        /// The command that comes nearest.
        nearest: Option<&'static str>,
    },
    /// An argument is missing or wrong.
    Argument(FieldError),
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownCommand { word, nearest } => {
                write!(f, "unknown command `{}`", printable(word))?;
                match nearest {
                    None => Ok(()),
                    Some(near) => write!(f, "; nearest: `{near}`"),
                }
            }
            Self::Argument(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for CommandError {}

/// A command with its arguments, in the units of people (manual 4.2.1).
#[derive(Clone, Debug, PartialEq)]
pub enum Command<'a> {
    /// Stops the motion at once; start begins from the first step. It is no emergency stop.
    ActionStop,
    /// Pauses the motion; start goes on from the present step.
    ActionPause,
    /// Enters single cycle.
    ActionSingleCycle,
    /// The start button.
    StartButton,
    /// The stop button.
    StopButton,
    /// Switches to another program.
    SwitchMold {
        /// Its name.
        mold: Cow<'a, str>,
    },
    /// Changes a counter; `None` keeps what it has (−1 on the wire).
    ModifyCounter {
        /// The counter.
        id: u32,
        /// Its count.
        current: Option<u32>,
        /// Its target.
        target: Option<u32>,
    },
    /// Sets one output.
    ModifyOutput {
        /// 0–3 output boards, 4–6 M, 7 EU.
        board: u8,
        /// 0–31.
        point: u8,
        /// On or off.
        on: bool,
    },
    /// Clears the alarm and runs the next step.
    ClearAlarmRunNext,
    /// Clears the alarm and goes on automatically.
    ClearAlarmContinue,
    /// Changes a stack.
    ModifyStackData {
        /// The stack.
        stack: u32,
        /// Spacing in X, Y, Z, in steps of 0.001, others are not sent; the manual gives no unit, mm is our reading.
        spacing: [f64; 3],
        /// Count in X, Y, Z.
        count: [u32; 3],
    },
    /// Changes the global speed; on the wire percent × 10.
    ModifyGspd {
        /// Percent, 0 to 100, in steps of 0.1; others are not sent.
        percent: f64,
    },
    /// Writes one register.
    RewriteData {
        /// The register.
        register: RegisterIndex,
        /// Its value, 32 bits with sign.
        value: i64,
        /// Whether it survives a power cut.
        savable: bool,
    },
    /// Writes registers in a row.
    RewriteDataList {
        /// The first register.
        first: RegisterIndex,
        /// Whether they survive a power cut.
        savable: bool,
        /// Their values, 1 to 101 of them, 32 bits with sign each.
        values: Vec<i64>,
    },
    /// Changes the acceleration and deceleration time of the path; on the wire seconds × 1000.
    ModifyAccDec {
        /// Seconds, in steps of 0.001; others are not sent.
        acceleration: f64,
        /// Seconds, in steps of 0.001.
        deceleration: f64,
    },
    /// Switches to another tool.
    SwitchTool {
        /// Its number; 0 is none.
        tool: u32,
    },
    /// Changes a tool; on the wire × 1000.
    ModifyTool {
        /// Its number.
        tool: u32,
        /// X, Y, Z in mm and RX, RY, RZ in degrees, from the flange, in steps of 0.001; others are not sent.
        offset: [f64; 6],
    },
    /// Switches to another workbench.
    SwitchCoordinate {
        /// Its number; 0 is the world.
        workbench: u32,
    },
    /// Resets and clears the alarm.
    ClearAlarm,
    /// Clears the alarm with the two arguments of the newest manual (V1.4; reported, unit B). Older firmware has no arguments.
    ClearAlarmWith {
        /// Whether the program goes to its first line.
        first_line: bool,
        /// Whether only the alarm is cleared. What else the controller resets without it is not known.
        only_alarm: bool,
    },
}

const NUMBER: &str = "a number from 0";
const COUNT: &str = "a count from 0, or -1 to keep it";
const REGISTER: &str = "a register from 800 to 900";
const WHOLE: &str = "a whole number";

/// The arguments of a command, being read.
struct Arguments<'a> {
    name: CommandName,
    values: Values<'a>,
}

impl<'a> Arguments<'a> {
    fn read<T>(
        &self,
        index: usize,
        wanted: &'static str,
        read: impl FnOnce(Value<'a>) -> Option<T>,
    ) -> Result<T, FieldError> {
        let value = self.values.at(index);
        value.and_then(read).ok_or_else(|| {
            let name = self.name.info().arguments.get(index).map_or("?", |argument| argument.name);
            FieldError {
                path: format!("{} argument {} ({name})", self.name, index + 1),
                found: value.map(excerpt),
                wanted,
                nearest: None,
            }
        })
    }

    fn number(&self, index: usize) -> Result<u32, FieldError> {
        self.read(index, NUMBER, |value| u32::try_from(value.integer()?).ok())
    }

    fn count(&self, index: usize) -> Result<Option<u32>, FieldError> {
        self.read(index, COUNT, |value| match value.integer()? {
            -1 => Some(None),
            count => u32::try_from(count).ok().map(Some),
        })
    }

    fn register(&self, index: usize) -> Result<RegisterIndex, FieldError> {
        self.read(index, REGISTER, |value| RegisterIndex::new(u16::try_from(value.integer()?).ok()?))
    }

    fn flag(&self, index: usize) -> Result<bool, FieldError> {
        self.read(index, "1 or 0", |value| value.flag())
    }

    /// A number that the wire carries multiplied by `scale`.
    fn scaled(
        &self,
        index: usize,
        scale: f64,
        range: std::ops::RangeInclusive<f64>,
        wanted: &'static str,
    ) -> Result<f64, FieldError> {
        self.read(index, wanted, |value| value.number().map(|v| v / scale).filter(|v| range.contains(v)))
    }
}

impl<'a> Command<'a> {
    /// Reads the arguments of a command.
    fn read(name: CommandName, values: Values<'a>) -> Result<Self, FieldError> {
        let arguments = Arguments { name, values };
        Ok(match name {
            CommandName::ActionStop => Self::ActionStop,
            CommandName::ActionPause => Self::ActionPause,
            CommandName::ActionSingleCycle => Self::ActionSingleCycle,
            CommandName::StartButton => Self::StartButton,
            CommandName::StopButton => Self::StopButton,
            CommandName::SwitchMold => {
                Self::SwitchMold { mold: arguments.read(0, "the name of a program", |v| Some(v.text()))? }
            }
            CommandName::ModifyCounter => Self::ModifyCounter {
                id: arguments.number(0)?,
                current: arguments.count(1)?,
                target: arguments.count(2)?,
            },
            CommandName::ModifyOutput => Self::ModifyOutput {
                board: arguments.read(0, "0-3 (boards), 4-6 (M) or 7 (EU)", |v| up_to(v.integer(), 7))?,
                point: arguments.read(1, "a point from 0 to 31", |v| up_to(v.integer(), 31))?,
                on: arguments.flag(2)?,
            },
            CommandName::ClearAlarmRunNext => Self::ClearAlarmRunNext,
            CommandName::ClearAlarmContinue => Self::ClearAlarmContinue,
            CommandName::ModifyStackData => {
                let mm = |index| arguments.read(index, "a spacing in mm", |v| v.number());
                Self::ModifyStackData {
                    stack: arguments.number(0)?,
                    spacing: [mm(1)?, mm(2)?, mm(3)?],
                    count: [arguments.number(4)?, arguments.number(5)?, arguments.number(6)?],
                }
            }
            CommandName::ModifyGspd => Self::ModifyGspd {
                percent: arguments.scaled(0, 10.0, 0.0..=100.0, "percent x 10, from 0 to 1000")?,
            },
            CommandName::RewriteData => Self::RewriteData {
                register: arguments.register(0)?,
                value: arguments.read(1, WHOLE, |v| v.integer())?,
                savable: arguments.flag(2)?,
            },
            CommandName::RewriteDataList => Self::read_registers(&arguments)?,
            CommandName::ModifyAccDec => {
                let seconds =
                    |index| arguments.scaled(index, 1000.0, 0.001..=60.0, "milliseconds, 1 to 60000");
                Self::ModifyAccDec { acceleration: seconds(0)?, deceleration: seconds(1)? }
            }
            CommandName::SwitchTool => Self::SwitchTool { tool: arguments.number(0)? },
            CommandName::ModifyTool => {
                let scaled =
                    |index| arguments.scaled(index, 1000.0, -1e6..=1e6, "mm or degrees, multiplied by 1000");
                Self::ModifyTool {
                    tool: arguments.number(0)?,
                    offset: [scaled(1)?, scaled(2)?, scaled(3)?, scaled(4)?, scaled(5)?, scaled(6)?],
                }
            }
            CommandName::SwitchCoordinate => Self::SwitchCoordinate { workbench: arguments.number(0)? },
            CommandName::ClearAlarm => Self::read_clear_alarm(&arguments),
        })
    }

    fn read_registers(arguments: &Arguments<'a>) -> Result<Self, FieldError> {
        let first = arguments.register(0)?;
        let rest = arguments.values.skip(3);
        let room = i64::from(RegisterIndex::LAST - first.number()) + 1;
        arguments.read(1, "how many values follow, all within registers 800 to 900", |value| {
            let length = value.integer()?;
            (length == i64::try_from(rest.len()).ok()? && (1..=room).contains(&length)).then_some(())
        })?;
        let savable = arguments.flag(2)?;
        let values = (0..rest.len())
            .map(|n| arguments.read(n + 3, WHOLE, |value| value.integer()))
            .collect::<Result<_, _>>()?;
        Ok(Self::RewriteDataList { first, savable, values })
    }

    /// The two arguments of the newest manual; any others are ignored, because clients send some that no manual has (unit H
    /// sends `"0"`).
    fn read_clear_alarm(arguments: &Arguments<'a>) -> Self {
        let flag = |index| arguments.values.at(index).and_then(|value| value.flag());
        match (arguments.values.len(), flag(0), flag(1)) {
            (2, Some(first_line), Some(only_alarm)) => Self::ClearAlarmWith { first_line, only_alarm },
            _ => Self::ClearAlarm,
        }
    }

    /// The command's name.
    #[must_use]
    pub fn name(&self) -> CommandName {
        match self {
            Self::ActionStop => CommandName::ActionStop,
            Self::ActionPause => CommandName::ActionPause,
            Self::ActionSingleCycle => CommandName::ActionSingleCycle,
            Self::StartButton => CommandName::StartButton,
            Self::StopButton => CommandName::StopButton,
            Self::SwitchMold { .. } => CommandName::SwitchMold,
            Self::ModifyCounter { .. } => CommandName::ModifyCounter,
            Self::ModifyOutput { .. } => CommandName::ModifyOutput,
            Self::ClearAlarmRunNext => CommandName::ClearAlarmRunNext,
            Self::ClearAlarmContinue => CommandName::ClearAlarmContinue,
            Self::ModifyStackData { .. } => CommandName::ModifyStackData,
            Self::ModifyGspd { .. } => CommandName::ModifyGspd,
            Self::RewriteData { .. } => CommandName::RewriteData,
            Self::RewriteDataList { .. } => CommandName::RewriteDataList,
            Self::ModifyAccDec { .. } => CommandName::ModifyAccDec,
            Self::SwitchTool { .. } => CommandName::SwitchTool,
            Self::ModifyTool { .. } => CommandName::ModifyTool,
            Self::SwitchCoordinate { .. } => CommandName::SwitchCoordinate,
            Self::ClearAlarm | Self::ClearAlarmWith { .. } => CommandName::ClearAlarm,
        }
    }

    /// Appends `cmdData`: the name and the arguments as texts.
    pub(crate) fn encode_data(&self, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        out.extend_from_slice(b"[\"");
        out.extend_from_slice(self.name().word().as_bytes());
        out.push(b'"');
        self.encode_arguments(out)?;
        out.push(b']');
        Ok(())
    }

    fn encode_arguments(&self, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        let flag = |on: &bool| i64::from(*on);
        match self {
            Self::ActionStop
            | Self::ActionPause
            | Self::ActionSingleCycle
            | Self::StartButton
            | Self::StopButton
            | Self::ClearAlarmRunNext
            | Self::ClearAlarmContinue
            | Self::ClearAlarm => {}
            Self::SwitchMold { mold } => {
                out.push(b',');
                text::write_escaped(out, mold);
            }
            Self::ModifyCounter { id, current, target } => {
                let keep = |count: &Option<u32>| count.map_or(-1, i64::from);
                integers(out, [i64::from(*id), keep(current), keep(target)]);
            }
            Self::ModifyOutput { board, point, on } => {
                let checked = |field, value: u8, last, wanted| {
                    if value <= last { Ok(i64::from(value)) } else { Err(EncodeError::new(field, wanted)) }
                };
                let board = checked("board", *board, 7, "0 to 7")?;
                integers(out, [board, checked("point", *point, 31, "0 to 31")?, flag(on)]);
            }
            Self::ModifyStackData { stack, spacing, count } => {
                integers(out, [i64::from(*stack)]);
                for spacing in spacing {
                    fixed(out, "spacing", *spacing)?;
                }
                integers(out, count.map(i64::from));
            }
            Self::ModifyGspd { percent } => {
                if !(0.0..=100.0).contains(percent) {
                    return Err(EncodeError::new("percent", "from 0 to 100"));
                }
                integers(out, [Grid::PERCENT.sendable("percent", *percent)?]);
            }
            Self::RewriteData { register, value, savable } => {
                integers(out, [i64::from(register.number()), register_value(*value)?, flag(savable)]);
            }
            Self::RewriteDataList { first, savable, values } => {
                let room = usize::from(RegisterIndex::LAST - first.number()) + 1;
                if values.is_empty() || values.len() > room {
                    return Err(EncodeError::new(
                        "values",
                        "1 or more values, all within registers 800 to 900",
                    ));
                }
                let length = i64::try_from(values.len()).unwrap_or(i64::MAX);
                integers(out, [i64::from(first.number()), length, flag(savable)]);
                for value in values {
                    integers(out, [register_value(*value)?]);
                }
            }
            Self::ModifyAccDec { acceleration, deceleration } => {
                for (field, seconds) in [("acceleration", acceleration), ("deceleration", deceleration)] {
                    if !(0.001..=60.0).contains(seconds) {
                        return Err(EncodeError::new(field, "from 0.001 to 60 seconds"));
                    }
                    integers(out, [Grid::MILLISECONDS.sendable(field, *seconds)?]);
                }
            }
            Self::SwitchTool { tool } => integers(out, [i64::from(*tool)]),
            Self::ModifyTool { tool, offset } => {
                integers(out, [i64::from(*tool)]);
                for offset in offset {
                    if offset.is_nan() || offset.abs() > 1e6 {
                        return Err(EncodeError::new("offset", "within ±1e6 mm or degrees"));
                    }
                    integers(out, [Grid::THOUSANDTHS.sendable("offset", *offset)?]);
                }
            }
            Self::SwitchCoordinate { workbench } => integers(out, [i64::from(*workbench)]),
            Self::ClearAlarmWith { first_line, only_alarm } => {
                integers(out, [flag(first_line), flag(only_alarm)]);
            }
        }
        Ok(())
    }
}

impl fmt::Display for Command<'_> {
    /// The word and the arguments as the wire has them, such as `modifyOutput "0","5","1"`. Arguments that cannot be sent are left
    /// out.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name().word())?;
        let mut arguments = Vec::new();
        match self.encode_arguments(&mut arguments) {
            Ok(()) => match String::from_utf8_lossy(&arguments).strip_prefix(',') {
                Some(arguments) => write!(f, " {}", printable(arguments)),
                None => Ok(()),
            },
            Err(_) => Ok(()),
        }
    }
}

fn up_to(value: Option<i64>, last: u8) -> Option<u8> {
    value.and_then(|value| u8::try_from(value).ok()).filter(|value| *value <= last)
}

/// A register has 32 bits: its Modbus twin is two registers of 16.
fn register_value(value: i64) -> Result<i64, EncodeError> {
    match i32::try_from(value) {
        Ok(value) => Ok(i64::from(value)),
        Err(_) => Err(EncodeError::new("value", "a whole number of 32 bits")),
    }
}

fn integers(out: &mut Vec<u8>, values: impl IntoIterator<Item = i64>) {
    for value in values {
        out.extend_from_slice(b",\"");
        write_integer(out, value);
        out.push(b'"');
    }
}

fn fixed(out: &mut Vec<u8>, field: &'static str, value: f64) -> Result<(), EncodeError> {
    out.extend_from_slice(b",\"");
    Grid::THOUSANDTHS.sendable(field, value)?;
    write_fixed(out, field, value, Decimals::FEW)?;
    out.push(b'"');
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_shown_as_the_wire_has_it() {
        for (command, shown) in [
            (Command::ActionStop, "actionStop"),
            (Command::ModifyGspd { percent: 5.0 }, r#"modifyGSPD "50""#),
            (Command::ModifyGspd { percent: 500.0 }, "modifyGSPD"),
            (Command::ModifyOutput { board: 0, point: 5, on: true }, r#"modifyOutput "0","5","1""#),
            (Command::ClearAlarmWith { first_line: true, only_alarm: false }, r#"clearAlarm "1","0""#),
            (Command::SwitchMold { mold: "a\nb\u{9b}".into() }, r#"switchMold "a\nb\u{9b}""#),
        ] {
            assert_eq!(command.to_string(), shown);
        }
    }

    #[test]
    fn what_can_start_a_register_driven_cell_counts_as_motion() {
        use CommandName::{ModifyGspd, ModifyOutput, RewriteData, RewriteDataList, SwitchMold};
        for command in [ModifyOutput, RewriteData, RewriteDataList, SwitchMold] {
            assert_eq!(command.effect(), Effect::Moves, "{command}");
        }
        assert_eq!(ModifyGspd.effect(), Effect::Changes);
    }

    #[test]
    fn every_name_has_its_own_row() {
        for (name, row) in CommandName::ALL.into_iter().zip(&COMMANDS) {
            assert_eq!(name.word(), row.word);
            assert_eq!(CommandName::exact(row.word.as_bytes()), Some(name));
            let camel = format!("{name:?}");
            assert_eq!(camel.to_lowercase(), row.word.to_lowercase());
        }
    }
}
