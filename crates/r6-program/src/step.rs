//! One step of a program: its keys, and the action that it means. Sent programs and taught programs share
//! these steps.

mod signals;

use r6_proto::grid::Grid;
use r6_proto::message::Action;
use r6_proto::message::instruction::{
    BlendLevel, Coordinates, CurveMove, Manner, Move, PathSpeed, StopOnSignal, TIMES, TIMES_WANTED, Workbench,
};
use r6_proto::{AXES, AxisIndex, AxisMask};

use crate::form::{Fields, Node, Wrong};

pub use signals::{A_WATCHED_POINT, WATCHED, further_output, watched};

/// Where the steps of a program run. This decides how exact its numbers may be and which points exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProgramKind {
    /// A PC sends them, so numbers must fit the wire.
    Sent,
    /// They are part of a program on the controller itself.
    Taught,
}

/// What a step does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Axis move, action 4.
    AxisMove,
    /// Linear move, action 10.
    LinearMove,
    /// Curve move, action 17.
    CurveMove,
    /// Wait, action 100.
    Wait,
    /// Output, action 200.
    Output,
    /// Outputs of a board, action 204.
    BoardOutput,
    /// Stop on a signal, action 52.
    StopOnSignal,
    /// Path speed, action 51.
    PathSpeed,
    /// Workbench, action 800.
    Workbench,
}

/// The kinds of steps, by the words of `do`.
const KINDS: [(&str, Kind); 9] = [
    ("axis-move", Kind::AxisMove),
    ("linear-move", Kind::LinearMove),
    ("curve-move", Kind::CurveMove),
    ("wait", Kind::Wait),
    ("output", Kind::Output),
    ("board-output", Kind::BoardOutput),
    ("stop-on-signal", Kind::StopOnSignal),
    ("path-speed", Kind::PathSpeed),
    ("workbench", Kind::Workbench),
];

/// Every key that a step can have.
#[rustfmt::skip]
pub const KEYS: [&str; 23] = [
    "do", "to", "through", "speed", "blend", "delay", "mask", "tool", "work_frame", "seconds", "source", "board", "point", "until",
    "limit", "kind", "on", "pulse", "set", "clear", "watch", "mm_per_s", "number",
];

/// The kind of a step, from its `do`.
///
/// # Errors
/// `do` is missing, or names nothing that can be sent.
pub fn kind(fields: &Fields<'_>) -> Result<Kind, Wrong> {
    let missing = || Wrong::missing("do", "what it does").advise("such as do = \"axis-move\"");
    fields.word("do", &KINDS).ok_or_else(missing)
}

/// The word of `do` for an action; `None` if no step means it.
#[must_use]
pub fn word_of(action: &Action) -> Option<&'static str> {
    let kind = match action {
        Action::AxisMove(_) => Kind::AxisMove,
        Action::LinearMove(_) => Kind::LinearMove,
        Action::CurveMove(_) => Kind::CurveMove,
        Action::Wait(_) => Kind::Wait,
        Action::Output(_) => Kind::Output,
        Action::BoardOutput(_) => Kind::BoardOutput,
        Action::StopOnSignal(_) => Kind::StopOnSignal,
        Action::PathSpeed(_) => Kind::PathSpeed,
        Action::Workbench(_) => Kind::Workbench,
        Action::Unknown(_) => return None,
    };
    KINDS.iter().find(|(_, known)| *known == kind).map(|(word, _)| *word)
}

/// The action of a step.
///
/// # Errors
/// The mistake that ended the reading. The fields have noted all other mistakes.
pub fn action(kind: Kind, fields: &Fields<'_>, program: ProgramKind) -> Result<Action, Wrong> {
    match kind {
        Kind::AxisMove => {
            let to = coordinates(fields, "to", &[1, 2, 3, 4, 5, 6, 7, 8]);
            let manner = masked_manner(fields, to.as_ref(), program);
            Ok(Action::AxisMove(Move { target: eight(&to?), manner: manner? }))
        }
        Kind::LinearMove => {
            let to = coordinates(fields, "to", &[3, 6]);
            let manner = masked_manner(fields, to.as_ref(), program);
            Ok(Action::LinearMove(Move { target: eight(&to?), manner: manner? }))
        }
        Kind::CurveMove => {
            let middle = coordinates(fields, "through", &[3, 6]);
            let counts = middle.as_ref().map_or(vec![3, 6], |middle| vec![middle.len()]);
            let end = coordinates(fields, "to", &counts);
            let manner = masked_manner(fields, end.as_ref(), program);
            Ok(Action::CurveMove(CurveMove { middle: eight(&middle?), end: eight(&end?), manner: manner? }))
        }
        Kind::Wait => signals::wait(fields, program),
        Kind::Output => signals::output(fields, program),
        Kind::BoardOutput => signals::board_output(fields, program),
        Kind::StopOnSignal => stop_on_signal(fields, program),
        Kind::PathSpeed => {
            let speed = fields.optional("mm_per_s", PathSpeed::WANTED, |value| {
                value.number().filter(|speed| PathSpeed::is_possible(*speed))
            });
            Ok(Action::PathSpeed(PathSpeed { in_use: speed.is_some(), speed }))
        }
        Kind::Workbench => Ok(Action::Workbench(Workbench {
            id: fields.required("number", frame(fields, "number", program))?,
        })),
    }
}

fn stop_on_signal(fields: &Fields<'_>, program: ProgramKind) -> Result<Action, Wrong> {
    let watch = fields.flag("watch");
    let on = fields.flag("on");
    let off = StopOnSignal { in_use: false, input: 0, on: false };
    if !fields.has("point") && watch == Some(false) {
        return Ok(Action::StopOnSignal(off));
    }
    if !fields.has("point") && watch.is_none() && program == ProgramKind::Taught {
        fields.older("do", "no signal stops a move from here on with `watch = false`");
        return Ok(Action::StopOnSignal(off));
    }
    let input = signals::watched_input(fields)?;
    Ok(Action::StopOnSignal(StopOnSignal { in_use: watch.unwrap_or(true), input, on: on.unwrap_or(true) }))
}

/// The number of a tool or workbench. A controller of another make may have any number of them; a virtual
/// controller has 32.
pub fn frame(fields: &Fields<'_>, key: &'static str, program: ProgramKind) -> Option<u32> {
    match program {
        ProgramKind::Sent => fields.whole(key, u32::MAX),
        ProgramKind::Taught => fields.whole(key, crate::taught::MAX_FRAMES - 1),
    }
}

/// The manner of a move, with the mask of its axes. `given` are the coordinates that the mask can select
/// from, if they could be read.
fn masked_manner(
    fields: &Fields<'_>,
    given: Result<&Vec<f64>, &Wrong>,
    program: ProgramKind,
) -> Result<Manner, Wrong> {
    let mask =
        fields.optional("mask", "a mask such as 0x3F or \"0x3F\"", |value: &Node| match value.text() {
            Some(text) => Some(axis_mask(text)),
            None => value
                .whole()
                .and_then(|bits| u8::try_from(bits).ok())
                .filter(|bits| *bits != 0)
                .map(|bits| Ok(AxisMask::from_bits(bits))),
        });
    let manner = manner(fields, program);
    let count = given.map_or(AXES, Vec::len);
    let mask = match mask {
        None => Ok(first_axes(count)),
        Some(Err(wrong)) => Err(fields.wrong("mask", format!("`mask`: {wrong}"))),
        Some(Ok(mask)) => match mask.axes().find(|axis| axis.index() >= count) {
            None => Ok(mask),
            Some(axis) => {
                let what = format!("mask {mask} names {axis}, for which there is no number");
                Err(fields.wrong("mask", what))
            }
        },
    };
    Ok(Manner { mask: Some(mask?), ..manner? })
}

/// The manner of a move: speed, blend level, delay, tool and work frame.
///
/// # Errors
/// The speed is missing, or a value is invalid.
pub fn manner(fields: &Fields<'_>, program: ProgramKind) -> Result<Manner, Wrong> {
    let speed = fields.number("speed");
    let blend = fields.whole("blend", 9_u8).unwrap_or(0);
    let delay = seconds(fields, "delay", Grid::TENTHS_OF_A_SECOND, program);
    let (tool, coord) = (frame(fields, "tool", program), frame(fields, "work_frame", program));
    let speed = fields.required("speed", speed)?;
    if !Manner::SPEEDS.contains(&speed) {
        let what = format!("`speed` is {speed}: it has to be {}", Manner::SPEEDS_WANTED);
        return Err(fields.wrong("speed", what));
    }
    on_grid(fields, "speed", speed, Grid::PERCENT, program)?;
    let (delay, smooth) = (Some(delay?.unwrap_or(0.0)), BlendLevel::new(blend));
    Ok(Manner { speed: Some(speed), delay, smooth, tool, coord, ..Manner::default() })
}

/// `1 number`, `2 numbers`.
fn counted(count: usize) -> String {
    if count == 1 { "1 number".to_owned() } else { format!("{count} numbers") }
}

/// Reads coordinates. Their number must be one of `counts`.
///
/// # Errors
/// The coordinates are missing, their number is wrong, or a value is out of range.
pub fn coordinates(fields: &Fields<'_>, key: &'static str, counts: &[usize]) -> Result<Vec<f64>, Wrong> {
    let values = fields.required(key, fields.numbers(key))?;
    if !counts.contains(&values.len()) {
        let counts: Vec<_> = counts.iter().map(ToString::to_string).collect();
        let what = format!("`{key}` has {}, but needs {}", self::counted(values.len()), counts.join(" or "));
        return Err(fields.wrong(key, what));
    }
    if let Some(wrong) = values.iter().find(|value| !(-1e6..=1e6).contains(*value)) {
        return Err(fields.wrong(key, format!("`{key}` has {wrong}, which is no coordinate")));
    }
    Ok(values)
}

/// The mask of the first `count` axes, from J1 (or X).
#[must_use]
pub fn first_axes(count: usize) -> AxisMask {
    AxisIndex::ALL.into_iter().take(count).fold(AxisMask::NONE, AxisMask::with)
}

/// All eight coordinates, 0 for absent ones. One controller was reported to require all eight (unit A), and
/// the mask keeps the other axes where they are.
#[must_use]
pub fn eight(given: &[f64]) -> Coordinates {
    let mut values = [0.0; AXES];
    for (slot, value) in values.iter_mut().zip(given) {
        *slot = *value;
    }
    Coordinates::from_slice(&values)
}

/// Reads an axis mask, hexadecimal (`0x3F`) or decimal (`63`).
///
/// # Errors
/// The text is not a number from 1 to 255.
pub fn axis_mask(text: &str) -> Result<AxisMask, String> {
    let bits = match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u8::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    };
    bits.filter(|bits| *bits != 0).map(AxisMask::from_bits).ok_or_else(|| {
        "a mask is a number from 0x01 to 0xFF: bit 0 is J1 (or X), bit 5 is J6 (or W)".to_owned()
    })
}

/// Reads optional seconds from 0 to one day. In a sent program they must fit the wire.
///
/// # Errors
/// The value is out of range or does not fit the wire.
pub fn seconds(
    fields: &Fields<'_>,
    key: &'static str,
    grid: Grid,
    program: ProgramKind,
) -> Result<Option<f64>, Wrong> {
    let Some(value) = fields.number(key) else { return Ok(None) };
    if !TIMES.contains(&value) {
        return Err(fields.wrong(key, format!("`{key}` has to be {TIMES_WANTED}")));
    }
    on_grid(fields, key, value, grid, program).map(Some)
}

/// Returns the value if it fits the wire, or if the program is not sent.
fn on_grid(
    fields: &Fields<'_>,
    key: &'static str,
    value: f64,
    grid: Grid,
    program: ProgramKind,
) -> Result<f64, Wrong> {
    if program == ProgramKind::Taught {
        return Ok(value);
    }
    match grid.step(value) {
        Ok(_) => Ok(value),
        Err(Some(nearest)) => {
            let what = format!("`{key}` is {value}: it has to be {}; nearest: {nearest}", grid.wanted());
            Err(fields.wrong(key, what))
        }
        Err(None) => Err(fields.wrong(key, format!("`{key}` has to be a finite number"))),
    }
}

#[cfg(test)]
mod tests {
    use r6_proto::message::instruction::WaitSource;

    use super::*;

    /// The action of a step, or its first mistake.
    fn action(toml: &str) -> Result<Action, String> {
        let program = crate::MotionProgram::from_toml(&format!("[[instruction]]\n{toml}"));
        program.map(|program| program.lists[0].instructions[0].action).map_err(|mistakes| {
            mistakes.first().what.strip_prefix("instruction 1: ").expect("the step").to_owned()
        })
    }

    #[test]
    fn a_line_of_three_numbers_keeps_the_orientation() {
        let Action::LinearMove(motion) = action("do=\"linear-move\"\nto=[1,2,3]\nspeed=5").unwrap() else {
            panic!()
        };
        assert_eq!(motion.manner.mask, Some(AxisMask::POSITION));
    }

    #[test]
    fn a_mask_never_moves_an_axis_without_a_number() {
        let text = "do=\"axis-move\"\nto=[1,2,3]\nspeed=5\nmask=";
        assert_eq!(
            action(&format!("{text}0x3F")).unwrap_err(),
            "mask 0x3F names J4, for which there is no number"
        );
        assert_eq!(action(&format!("{text}\"0x05\"")).map(|action| action.number()), Ok(4));
        // A move of no axis is not a move.
        assert_eq!(
            action(&format!("{text}0")).unwrap_err(),
            "`mask` is 0, but has to be a mask such as 0x3F or \"0x3F\""
        );
    }

    #[test]
    fn the_board_example_of_the_manual() {
        let named = "set=[\"Y010\",\"Y012\",\"Y020\",\"Y025\",\"Y030\",\"Y040\"]\nclear=[\"Y013\",\"Y021\",\"Y024\",\"Y031\",\"Y041\"]";
        for points in ["set=[0,2,8,13,16,24]\nclear=[3,9,12,17,25]", named] {
            let text = format!("do=\"board-output\"\n{points}");
            let Action::BoardOutput(output) = action(&text).unwrap() else { panic!() };
            assert_eq!((output.low.bits(), output.high.bits()), (151_388_258, 393_222));
        }
        for (points, wrong) in [
            ("set=[1]\nclear=[1]", "Y011 is named twice"),
            ("set=[\"Y010\", \"M010\"]", "M010 is on another board than Y010"),
            ("kind=\"m\"\nset=[\"M010\"]", "`kind` goes with points that are numbers; the names tell it"),
            ("set=[\"Y2.010\"]", "Y2.010 is not set this way: Y and M points of board 0 and 1 are"),
            ("set=[\"X010\"]", "X010 is not set this way: Y and M points of board 0 and 1 are"),
            ("", "`set` or `clear` has to name points"),
        ] {
            assert_eq!(action(&format!("do=\"board-output\"\n{points}")).unwrap_err(), wrong);
        }
    }

    #[test]
    fn a_point_goes_by_its_name_too() {
        for (named, counted) in [
            ("do=\"output\"\npoint=\"Y022\"\non=true", "do=\"output\"\npoint=10\non=true"),
            ("do=\"output\"\npoint=\"M010\"\non=true", "do=\"output\"\nkind=\"m\"\npoint=0\non=true"),
            ("do=\"output\"\npoint=\"Y1.010\"\npulse=1", "do=\"output\"\npoint=32\npulse=1"),
            (
                "do=\"wait\"\npoint=\"X1.011\"\nuntil=\"on\"",
                "do=\"wait\"\nsource=\"input\"\nboard=1\npoint=1\nuntil=\"on\"",
            ),
            ("do=\"stop-on-signal\"\npoint=\"X011\"\non=true", "do=\"stop-on-signal\"\npoint=1\non=true"),
        ] {
            assert_eq!(action(named).unwrap(), action(counted).unwrap(), "{named}");
        }
        for (wrong, says) in [
            ("do=\"output\"\npoint=\"X010\"\non=true", "X010 is an input"),
            ("do=\"output\"\npoint=\"Y1.011\"\non=true", "beyond this instruction"),
            (
                "do=\"output\"\nkind=\"y\"\npoint=\"Y010\"\non=true",
                "`kind` goes with a point that is a number",
            ),
            ("do=\"output\"\npoint=\"Y10\"\non=true", "names no point"),
            ("do=\"wait\"\npoint=\"Y010\"\nuntil=\"on\"", "Y010 is an output"),
            ("do=\"stop-on-signal\"\npoint=\"X1.010\"\non=true", "cannot stop a move"),
        ] {
            let error = action(wrong).unwrap_err();
            assert!(error.contains(says), "{wrong}: {error}");
        }
    }

    #[test]
    fn a_wait_without_a_limit_waits_for_ever() {
        let Action::Wait(wait) =
            action("do=\"wait\"\nsource=\"m\"\nboard=1\npoint=3\nuntil=\"rising\"").unwrap()
        else {
            panic!()
        };
        assert_eq!(wait.source, WaitSource::M { board: 1, point: 3 });
        assert!(wait.unlimited);
        let Action::Wait(wait) = action("do=\"wait\"\nseconds=2.5").unwrap() else { panic!() };
        assert_eq!((wait.source, wait.limit, wait.unlimited), (WaitSource::Time, 2.5, false));
    }

    #[test]
    fn wrong_steps_say_what_is_wrong() {
        for (text, wrong) in [
            (
                "do=\"workbench\"\nnumber=1\nspeed=5",
                "`speed` has no meaning here; the keys that are used here: number",
            ),
            (
                "do=\"axis-move\"\nto=[1]\nspeed=5.55",
                "`speed` is 5.55: it has to be in steps of 0.1 percent; nearest: 5.5 or 5.6",
            ),
            (
                "do=\"axis-move\"\nto=[1]\nspeed=5\ndelay=0.25",
                "`delay` is 0.25: it has to be in steps of 0.1 seconds; nearest: 0.2 or 0.3",
            ),
            (
                "do=\"wait\"\nseconds=0.01",
                "`seconds` is 0.01: it has to be in steps of 0.1 seconds; nearest: 0 or 0.1",
            ),
            ("do=\"axis-move\"\nto=[1]\nspeed=0", "`speed` is 0: it has to be percent from 0.1 to 100"),
            ("do=\"axis-move\"\nto=[1]", "`speed` is missing"),
            (
                "do=\"axis-move\"\nto=[nan]\nspeed=1",
                "`to` is a list, but has to be numbers in brackets, such as [10, -20.5]",
            ),
            ("do=\"axis-move\"\nto=[2e6]\nspeed=1", "`to` has 2000000, which is no coordinate"),
            ("do=\"linear-move\"\nto=[1,2]\nspeed=1", "`to` has 2 numbers, but needs 3 or 6"),
            ("do=\"linear-move\"\nto=[1]\nspeed=1", "`to` has 1 number, but needs 3 or 6"),
            (
                "do=\"path-speed\"\nmm_per_s=0.05",
                "`mm_per_s` is 0.05, but has to be a whole number of mm/s, from 1 to 10000",
            ),
            (
                "do=\"output\"\npoint=33\non=true",
                "`point` is 33, but has to be a whole number from 0 to 32, or a name such as \"Y010\"",
            ),
            (
                "do=\"output\"\nkind=\"m\"\npoint=3\npulse=1",
                "`pulse` is for kind \"y\" and goes without `delay`",
            ),
        ] {
            assert_eq!(action(text).unwrap_err(), wrong, "{text}");
        }
    }

    #[test]
    fn every_key_is_one_that_some_kind_asks_for() {
        let source = concat!(include_str!("step.rs"), include_str!("step/signals.rs"));
        for key in KEYS {
            assert!(source.matches(&format!("\"{key}\"")).count() > 1, "nothing reads `{key}`");
        }
    }
}
