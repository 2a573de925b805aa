//! The table of commands. To add a command, add a row here, a row in `docs/PROTOCOL.md`, and what the virtual
//! controller does.

use std::borrow::Cow;

use ArgumentKind::{Count, Flag, Integer, Register, Text};

use super::argument::{ArgumentInfo, ArgumentKind, Field, Source, Writer};
use super::{CommandInfo, Effect};
use crate::address::{Ports, RegisterIndex};
use crate::error::{EncodeError, Wanted};
use crate::grid::Grid;

/// Defines the table. Each row has: the name, the word on the wire, the effect on the machine (`+ Frame`:
/// poses refer to another tool or workbench after it; `+ Start`: the instruction list runs after it), the
/// ports that offer it, the first manual or firmware that knows it, the source, what it does, and what to do
/// if it is refused. The fields follow, each with its arguments. If fields and arguments differ, the
/// arguments stand alone, with the functions that take and give them.
macro_rules! commands {
    (
        $life:lifetime
        rows { $(
            $(#[$doc:meta])*
            $name:ident $word:literal $effect:ident $(+ $also:ident)? $ports:ident $since:literal $source:literal $meaning:literal
            $if_refused:tt
            $({ $( $(#[$field_doc:meta])* $field:ident: $type:ty = [$($argument:expr),+], )+ })?
            $(= [$($other:expr),+] $take:ident $give:ident $({ $( $(#[$own_doc:meta])* $own:ident: $own_type:ty, )+ })?)?
        )+ }
        also { $(
            $(#[$form_doc:meta])*
            $form:ident of $of:ident { $( $(#[$form_field_doc:meta])* $form_field:ident: $form_type:ty, )+ }
        )+ }
    ) => {
        /// The name of a command: the 18 of manual 4.2.1 in its order, then those of later manuals.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum CommandName {
            $( #[doc = concat!("`", $word, "`: ", $meaning, ".")] $name, )+
        }

        /// Every command, in the order of [`CommandName`].
        pub const COMMANDS: [CommandInfo; CommandName::ALL.len()] = [$( CommandInfo {
            word: $word,
            arguments: &[$($($($argument),+),+)? $($($other),+)?],
            meaning: $meaning,
            if_refused: $if_refused,
            effect: Effect::$effect,
            changes_frame: commands!(frame $($also)?),
            starts: commands!(start $($also)?),
            ports: Ports::$ports,
            since: $since,
            source: $source,
        }, )+];

        impl CommandName {
            /// All of them, in the order of [`COMMANDS`].
            pub const ALL: [Self; [$( $word ),+].len()] = [$( Self::$name, )+];
        }

        /// A command with its arguments, in the units of people (manual 4.2.1).
        #[derive(Clone, Debug, PartialEq)]
        pub enum Command<$life> {
            $(
                $(#[$doc])*
                $name $({ $( $(#[$field_doc])* $field: $type, )+ })? $($({ $( $(#[$own_doc])* $own: $own_type, )+ })?)?,
            )+
            $( $(#[$form_doc])* $form { $( $(#[$form_field_doc])* $form_field: $form_type, )+ }, )+
        }

        impl<$life> Command<$life> {
            /// Takes the arguments of a command from `from`.
            pub(super) fn take<S: Source<$life>>(name: CommandName, from: &mut S) -> Result<Self, S::Error> {
                match name {$(
                    CommandName::$name => commands!(take from $name $({ $( $field )+ })? $( $take )?),
                )+}
            }

            /// The command's name.
            #[must_use]
            pub fn name(&self) -> CommandName {
                match self {
                    $( Self::$name { .. } => CommandName::$name, )+
                    $( Self::$form { .. } => CommandName::$of, )+
                }
            }

            /// Passes its arguments to `to`.
            pub(super) fn give(&self, to: &mut Writer<'_>) -> Result<(), EncodeError> {
                match self {
                    $( Self::$name $({ $( $field, )+ })? $($({ $( $own, )+ })?)? => {
                        $($( $field.give(to)?; )+)?
                        $( $give($($( $own, )+)? to)?; )?
                    } )+
                    $( Self::$form { $( $form_field, )+ } => { $( $form_field.give(to)?; )+ } )+
                }
                Ok(())
            }
        }
    };
    (frame Frame) => { true };
    (frame $($other:ident)?) => { false };
    (start Start) => { true };
    (start $($other:ident)?) => { false };
    (take $from:ident $name:ident) => { Ok(Self::$name) };
    (take $from:ident $name:ident { $( $field:ident )+ }) => { Ok(Self::$name { $( $field: Field::take($from)?, )+ }) };
    (take $from:ident $name:ident $take:ident) => { Self::$take($from) };
}

const fn argument(name: &'static str, kind: ArgumentKind, meaning: &'static str) -> ArgumentInfo {
    ArgumentInfo { name, kind, meaning, optional: false }
}

const fn optional(name: &'static str, kind: ArgumentKind, meaning: &'static str) -> ArgumentInfo {
    ArgumentInfo { name, kind, meaning, optional: true }
}

const fn whole(first: i64, last: i64, wanted: Wanted) -> ArgumentKind {
    ArgumentKind::Whole { first, last, wanted }
}

const NUMBER: ArgumentKind = whole(0, 0xFFFF_FFFF, Wanted(&["a number from 0", "不小于 0 的整数"]));
const BOARD: ArgumentKind =
    whole(0, 7, Wanted(&["0-3 (boards), 4-6 (M) or 7 (EU)", "0 至 3（IO 板）、4 至 6（M 值）或 7（EUIO）"]));
const POINT: ArgumentKind = whole(0, 31, Wanted(&["a point from 0 to 31", "0 至 31 的点位"]));
const LENGTH: ArgumentKind = whole(
    1,
    101,
    Wanted(&[
        "how many values follow, all within registers 800 to 900",
        "后面值的个数，寄存器都在 800 至 900 以内",
    ]),
);
const PERCENT: ArgumentKind = ArgumentKind::Number {
    unit: "%",
    first: 0.0,
    last: 100.0,
    grid: Grid::PERCENT,
    in_steps: true,
    wanted: Wanted(&["percent from 0 to 100", "0 至 100 的百分比"]),
    wanted_on_the_wire: Wanted(&["percent x 10, from 0 to 1000", "百分比 × 10，0 至 1000"]),
};
const SECONDS: ArgumentKind = ArgumentKind::Number {
    unit: "s",
    first: 0.001,
    last: 60.0,
    grid: Grid::MILLISECONDS,
    in_steps: true,
    wanted: Wanted(&["seconds from 0.001 to 60", "0.001 至 60 的秒数"]),
    wanted_on_the_wire: Wanted(&["milliseconds, 1 to 60000", "1 至 60000 的毫秒数"]),
};
const MM: ArgumentKind = thousandths("mm");
const DEGREES: ArgumentKind = thousandths("deg");
const fn thousandths(unit: &'static str) -> ArgumentKind {
    ArgumentKind::Number {
        unit,
        first: -1e6,
        last: 1e6,
        grid: Grid::THOUSANDTHS,
        in_steps: true,
        wanted: Wanted(&["a number of mm or degrees within ±1e6", "毫米数或角度，不超过 ±1e6"]),
        wanted_on_the_wire: Wanted(&["mm or degrees, multiplied by 1000", "毫米数或角度 × 1000"]),
    }
}
/// The manual gives neither unit nor limit; mm is our reading.
const SPACING: ArgumentKind = ArgumentKind::Number {
    unit: "mm",
    first: f64::MIN,
    last: f64::MAX,
    grid: Grid::THOUSANDTHS,
    in_steps: false,
    wanted: Wanted(&["a spacing in mm", "间隔，单位 mm"]),
    wanted_on_the_wire: Wanted(&["a spacing in mm", "间隔，单位 mm"]),
};

// Advice for a refused command, where several commands share it.
const GO_ON: &str = "the arm may go on: use the emergency stop, then look at the arm";
const STARTS: &str = "a program starts in auto, without an alarm, and with the emergency stop released: look at the mode, the alarm and the key, then send it again";
const CLEARS: &str = "it clears the alarm and starts the program: remove the cause of the alarm, release the emergency stop, turn the key to auto, then send it again";
const REGISTERS: &str = "check the registers (800 to 900) and the values, and read them back";
const TOOLS: &str = "check the number of the tool and its values against the tools on the pendant";

#[rustfmt::skip]
commands! {
    'a
    rows {
    /// Stops the motion at once; start begins from the first step. It is not an emergency stop.
    ActionStop "actionStop" Stops Both "V6.0" "4.2.1 #1" "stops the motion at once; start begins from the first step"
        GO_ON
    /// Pauses the motion; start continues from the present step.
    ActionPause "actionPause" Stops Both "V6.0" "4.2.1 #2" "pauses the motion; start goes on from the present step"
        GO_ON
    /// Enters single cycle.
    ActionSingleCycle "actionSingleCycle" Moves + Start Both "V6.0" "4.2.1 #3" "enters single cycle"
        STARTS
    /// The start button.
    StartButton "startButton" Moves + Start Both "V6.0" "4.2.1 #4" "the start button"
        STARTS
    /// The stop button.
    StopButton "stopButton" Stops Both "V6.0" "4.2.1 #5" "the stop button: first press ends with the cycle, second at once"
        GO_ON
    /// Switches to another program.
    SwitchMold "switchMold" Moves Pendant "V6.0" "4.2.1 #6" "switches to another program (mold)"
        "compare the name with the programs of the controller (moldList); it changes only while the arm stands" {
        /// Name of the program.
        mold: Cow<'a, str> = [argument("mold", Text, "name of the program")],
    }
    /// Changes a counter; `None` keeps the present value (−1 on the wire).
    ModifyCounter "modifyCounter" Changes Both "V6.0" "4.2.1 #7" "changes a counter"
        "compare the number with the counters of the controller (counterList)" {
        /// The counter.
        id: u32 = [argument("id", NUMBER, "counter")],
        /// Its count.
        current: Option<u32> = [argument("current", Count, "its count, -1 to keep")],
        /// Its target.
        target: Option<u32> = [argument("target", Count, "its target, -1 to keep; the mainboard's port of 2020 cannot change it")],
    }
    /// Sets one output.
    ModifyOutput "modifyOutput" Moves Both "V6.0" "4.2.1 #8" "sets one output"
        "check that the controller has this board and this point" {
        /// 0–3 output boards, 4–6 M, 7 EU.
        board: u8 = [argument("board", BOARD, "0-3 output boards, 4-6 M (not on the pendant's port of 2020), 7 EU")],
        /// 0–31.
        point: u8 = [argument("point", POINT, "0-31")],
        /// On or off.
        on: bool = [argument("state", Flag, "0 off, 1 on")],
    }
    /// Clears the alarm and runs the next step.
    ClearAlarmRunNext "clearAlarmRunNext" Moves + Start Both "V6.0" "4.2.1 #9" "clears the alarm and runs the next step"
        CLEARS
    /// Clears the alarm and continues automatically.
    ClearAlarmContinue "clearAlarmContinue" Moves + Start Both "V6.0" "4.2.1 #10" "clears the alarm and goes on automatically"
        CLEARS
    /// Changes a stack.
    ModifyStackData "modifyStackData" Changes Pendant "V6.0" "4.2.1 #11" "changes a stack (palletising pattern)"
        "check the number of the stack, the spacing and the counts; not every firmware changes stacks over the network" {
        /// The stack.
        stack: u32 = [argument("stack", NUMBER, "stack")],
        /// Spacing in X, Y, Z, in steps of 0.001; other values are not sent. The manual gives no unit; mm is
        /// our reading.
        spacing: [f64; 3] = [argument("dx", SPACING, "spacing in X, mm"), argument("dy", SPACING, "spacing in Y, mm"), argument("dz", SPACING, "spacing in Z, mm")],
        /// Count in X, Y, Z.
        count: [u32; 3] = [argument("nx", NUMBER, "count in X"), argument("ny", NUMBER, "count in Y"), argument("nz", NUMBER, "count in Z")],
    }
    /// Changes the global speed; on the wire percent × 10.
    ModifyGspd "modifyGSPD" Changes Both "V6.0" "4.2.1 #12" "changes the global speed"
        "check the value: the global speed is 0 to 100 percent" {
        /// Percent, 0 to 100, in steps of 0.1; other values are not sent.
        percent: f64 = [argument("percent", PERCENT, "global speed in percent; the wire has percent x 10")],
    }
    /// Writes one register.
    RewriteData "rewriteData" Moves Both "V6.0" "4.2.1 #13" "writes one register"
        REGISTERS {
        /// The register.
        register: RegisterIndex = [argument("register", Register, "800-900")],
        /// Its value: 32 bits with sign.
        value: i64 = [argument("value", Integer, "a whole number")],
        /// Whether the value survives a power cut.
        savable: bool = [argument("savable", Flag, "1 to keep it over a power cut")],
    }
    /// Writes consecutive registers.
    RewriteDataList "rewriteDataList" Moves Both "V6.0" "4.2.1 #14" "writes several registers"
        REGISTERS
        = [argument("register", Register, "the first, 800-900"), argument("length", LENGTH, "how many values follow"), argument("savable", Flag, "1 to keep them over a power cut"), argument("values", Integer, "whole numbers")]
        take_registers give_registers {
            /// The first register.
            first: RegisterIndex,
            /// Whether the values survive a power cut.
            savable: bool,
            /// The values: 1 to 101 of them, 32 bits with sign each.
            values: Vec<i64>,
        }
    /// Changes the acceleration and deceleration time of the path; on the wire seconds × 1000.
    ModifyAccDec "modifyAccDec" Changes Both "V6.0" "4.2.1 #15" "changes the acceleration and deceleration time of the path"
        "check both times: seconds from 0.001 to 60" {
        /// Seconds, in steps of 0.001; other values are not sent.
        acceleration: f64 = [argument("acceleration", SECONDS, "seconds; the wire has seconds x 1000")],
        /// Seconds, in steps of 0.001.
        deceleration: f64 = [argument("deceleration", SECONDS, "seconds; the wire has seconds x 1000")],
    }
    /// Switches to another tool.
    SwitchTool "switchTool" Changes + Frame Both "V6.0" "4.2.1 #16" "switches to another tool"
        TOOLS {
        /// Its number; 0 means no tool.
        tool: u32 = [argument("tool", NUMBER, "number of the tool")],
    }
    /// Changes a tool; on the wire × 1000.
    ModifyTool "modifyTool" Changes + Frame Both "V6.0" "4.2.1 #17" "changes a tool"
        TOOLS {
        /// Its number.
        tool: u32 = [argument("tool", NUMBER, "number of the tool")],
        /// X, Y, Z in mm and RX, RY, RZ in degrees, from the flange, in steps of 0.001; other values are not
        /// sent.
        offset: [f64; 6] = [argument("x", MM, "mm; the wire has mm x 1000"), argument("y", MM, "mm"), argument("z", MM, "mm"), argument("rx", DEGREES, "degrees; the wire has degrees x 1000"), argument("ry", DEGREES, "degrees"), argument("rz", DEGREES, "degrees")],
    }
    /// Switches to another workbench.
    SwitchCoordinate "switchCoordinate" Changes + Frame Both "V6.0" "4.2.1 #18" "switches to another workbench"
        "check the number of the workbench against the workbenches on the pendant" {
        /// Its number; 0 is the world.
        workbench: u32 = [argument("workbench", NUMBER, "number of the workbench")],
    }
    /// Resets and clears the alarm.
    ClearAlarm "clearAlarm" Changes Both "207beta57" "later manual" "resets and clears the alarm"
        "remove the cause of the alarm and release the emergency stop, then send it again; where the firmware does not know the command, clear the alarm on the pendant"
        = [optional("first_line", Flag, "1: the program goes to its first line (newest manual)"), optional("only_alarm", Flag, "1: only the alarm is cleared (newest manual)")]
        take_clear_alarm give_nothing
    }
    also {
    /// Clears the alarm with the two arguments of the newest manual (V1.4; reported, unit B). Older firmware
    /// has no arguments.
    ClearAlarmWith of ClearAlarm {
        /// Whether the program goes to its first line.
        first_line: bool,
        /// Whether only the alarm is cleared. It is not known what else the controller resets otherwise.
        only_alarm: bool,
    }
    }
}

impl<'a> Command<'a> {
    fn take_registers<S: Source<'a>>(from: &mut S) -> Result<Self, S::Error> {
        let first: RegisterIndex = Field::take(from)?;
        let at = from.number();
        let length: u32 = Field::take(from)?;
        let savable = Field::take(from)?;
        let left = from.left();
        if usize::try_from(length) != Ok(left) || left > room_behind(first) {
            return Err(from.wrong(at));
        }
        let values = (0..left).map(|_| Field::take(from)).collect::<Result<_, _>>()?;
        Ok(Self::RewriteDataList { first, savable, values })
    }

    /// Takes the two arguments of the newest manual. A controller ignores any other number of arguments,
    /// because clients send some that no manual has (unit H sends `"0"`).
    fn take_clear_alarm<S: Source<'a>>(from: &mut S) -> Result<Self, S::Error> {
        if from.left() != 2 {
            return Ok(Self::ClearAlarm);
        }
        let mut flags =
            || Ok(Self::ClearAlarmWith { first_line: Field::take(from)?, only_alarm: Field::take(from)? });
        match flags() {
            Err(_) if S::FORGIVES => Ok(Self::ClearAlarm),
            taken => taken,
        }
    }
}

/// Number of registers from this one to the last.
fn room_behind(first: RegisterIndex) -> usize {
    usize::from(RegisterIndex::LAST - first.number()) + 1
}

fn give_nothing(_: &mut Writer<'_>) -> Result<(), EncodeError> {
    Ok(())
}

fn give_registers(
    first: &RegisterIndex,
    savable: &bool,
    values: &[i64],
    to: &mut Writer<'_>,
) -> Result<(), EncodeError> {
    if values.is_empty() || values.len() > room_behind(*first) {
        return Err(EncodeError::new("values", "1 or more values, all within registers 800 to 900"));
    }
    first.give(to)?;
    u32::try_from(values.len()).unwrap_or(u32::MAX).give(to)?;
    savable.give(to)?;
    values.iter().try_for_each(|value| value.give(to))
}
