//! Steps about signals: waits and outputs.

use r6_proto::grid::Grid;
use r6_proto::io_point::{IoPoint, PairMask, PointKind};
use r6_proto::message::Action;
use r6_proto::message::instruction::{
    BoardOutput, Output, OutputBoard, OutputKind, Wait, WaitCondition, WaitSource,
};

use super::step::seconds;
use crate::form::{Fields, Wrong};

/// The last point of an output instruction: the first one of the next board.
const LAST_OUTPUT: u8 = 32;

/// A point as a number, or by its name on the pendant.
enum Point<'d> {
    Number(u8),
    Name(&'d str),
}

/// A wait for a time or for a signal.
pub fn wait(fields: &Fields<'_>) -> Result<Action, Wrong> {
    if fields.has("seconds") {
        let time = seconds(fields, "seconds", Grid::TENTHS_OF_A_SECOND)?;
        return Ok(Action::Wait(Wait {
            source: WaitSource::Time,
            condition: WaitCondition::Off,
            limit: fields.required("seconds", time)?,
            unlimited: false,
        }));
    }
    let source = source(fields);
    let words = [
        ("on", WaitCondition::On),
        ("off", WaitCondition::Off),
        ("rising", WaitCondition::RisingEdge),
        ("falling", WaitCondition::FallingEdge),
    ];
    let condition = fields.word("until", &words);
    let limit = seconds(fields, "limit", Grid::TENTHS_OF_A_SECOND);
    let (source, condition, limit) = (source?, fields.required("until", condition)?, limit?);
    Ok(Action::Wait(Wait { source, condition, limit: limit.unwrap_or(0.0), unlimited: limit.is_none() }))
}

/// What is waited for: `point` names it, or `source`, `board` and `point` count it.
fn source(fields: &Fields<'_>) -> Result<WaitSource, Wrong> {
    #[derive(Clone, Copy)]
    enum Source {
        Input,
        M,
        Eu,
    }
    let source = fields.word("source", &[("input", Source::Input), ("m", Source::M), ("eu", Source::Eu)]);
    let board = fields.whole("board", 4_u8);
    let given = point(fields);
    if let Some(named) = named(fields, given.as_ref(), &["source", "board"])? {
        return awaited(fields, named);
    }
    let source = source.ok_or("`seconds` is missing, or `source` with `point` and `until`")?;
    let point = counted(fields, given, 31)?;
    let board = board.unwrap_or(0);
    Ok(match source {
        Source::Input => WaitSource::Input { board, point },
        Source::M => WaitSource::M { board: up_to(fields, "board", board, 2)?, point },
        Source::Eu => WaitSource::Eu { point },
    })
}

/// What `point` says.
fn point<'d>(fields: &Fields<'d>) -> Option<Point<'d>> {
    let wanted = format!("a whole number from 0 to {LAST_OUTPUT}, or a name such as \"Y010\"");
    fields.optional("point", &wanted, |value| match value.text() {
        Some(name) => Some(Point::Name(name)),
        None => {
            let number = value.whole().and_then(|whole| u8::try_from(whole).ok());
            number.filter(|number| *number <= LAST_OUTPUT).map(Point::Number)
        }
    })
}

/// The signal, if `point` is its name. The name tells the rest, so these keys must not say it again.
fn named(fields: &Fields<'_>, point: Option<&Point<'_>>, told: &[&str]) -> Result<Option<IoPoint>, Wrong> {
    let Some(Point::Name(name)) = point else { return Ok(None) };
    let named: IoPoint = name.parse().map_err(|wrong| fields.wrong("point", format!("`point`: {wrong}")))?;
    match told.iter().find(|key| fields.has(key)) {
        Some(key) => {
            let what = format!("`{key}` goes with a point that is a number; {named} tells all of it");
            Err(fields.wrong(key, what))
        }
        None => Ok(Some(named)),
    }
}

/// The point, if it is a number up to `last`.
fn counted(fields: &Fields<'_>, point: Option<Point<'_>>, last: u8) -> Result<u8, Wrong> {
    match fields.required("point", point)? {
        Point::Number(number) => up_to(fields, "point", number, last),
        Point::Name(name) => {
            Err(fields.wrong("point", format!("`point` is \"{name}\", but has to be a number here")))
        }
    }
}

fn up_to(fields: &Fields<'_>, key: &'static str, value: u8, last: u8) -> Result<u8, Wrong> {
    if value <= last {
        return Ok(value);
    }
    Err(fields.wrong(key, format!("`{key}` is {value}, but has to be 0 to {last}")))
}

/// The input of a stop on a signal: one of the first board.
pub fn watched_input(fields: &Fields<'_>) -> Result<u8, Wrong> {
    let given = point(fields);
    match named(fields, given.as_ref(), &[])? {
        Some(IoPoint { kind: PointKind::X, board: 0, point }) => Ok(point),
        Some(other) => Err(fields.wrong("point", format!("{other} cannot stop a move: X010 to X047 can"))),
        None => counted(fields, given, 31),
    }
}

/// The kinds of outputs, by the words of `kind`.
const OUTPUTS: [(&str, OutputKind); 3] =
    [("y", OutputKind::Y), ("m", OutputKind::M), ("euy", OutputKind::Euy)];

/// One output, or a pulse on it.
pub fn output(fields: &Fields<'_>) -> Result<Action, Wrong> {
    let given = point(fields);
    let kind = fields.word("kind", &OUTPUTS).unwrap_or(OutputKind::Y);
    let on = fields.flag("on");
    let delay = seconds(fields, "delay", Grid::MILLISECONDS);
    let pulse = seconds(fields, "pulse", Grid::MILLISECONDS);
    let (kind, point) = match named(fields, given.as_ref(), &["kind"])? {
        Some(named) => set_by_name(fields, named)?,
        None => (kind, counted(fields, given, LAST_OUTPUT)?),
    };
    if !fields.has("pulse") {
        let (on, delay) = (fields.required("on", on)?, delay?.unwrap_or(0.0));
        return Ok(Action::Output(Output { kind, point, on, delay }));
    }
    if kind != OutputKind::Y || fields.has("delay") {
        return Err(fields.wrong("pulse", "`pulse` is for kind \"y\" and goes without `delay`"));
    }
    let delay = fields.required("pulse", pulse?)?;
    Ok(Action::Output(Output { kind: OutputKind::TimedY, point, on: on.unwrap_or(true), delay }))
}

/// Many outputs of one board.
pub fn board_output(fields: &Fields<'_>) -> Result<Action, Wrong> {
    let board = fields.whole("board", 1_u8).unwrap_or(0);
    let kind = fields.word("kind", &OUTPUTS).unwrap_or(OutputKind::Y);
    let set = fields.wholes("set", 31).unwrap_or_default();
    let clear = fields.wholes("clear", 31).unwrap_or_default();
    let board = match kind {
        OutputKind::Y => OutputBoard::Y(board),
        OutputKind::M => OutputBoard::M(board),
        OutputKind::Euy | OutputKind::TimedY => {
            return Err(fields.wrong("kind", "`kind` has to be \"y\" or \"m\" for a whole board"));
        }
    };
    let mut named = 0_u32;
    let [mut low, mut high] = [PairMask::default(); 2];
    for (key, points, on) in [("set", set, true), ("clear", clear, false)] {
        for point in points {
            if named & (1 << point) != 0 {
                return Err(fields.wrong(key, format!("point {point} is named twice")));
            }
            named |= 1 << point;
            match point.checked_sub(16) {
                None => low = low.with(point, on),
                Some(point) => high = high.with(point, on),
            }
        }
    }
    Ok(Action::BoardOutput(BoardOutput { board, low, high }))
}

/// What is waited for, by its name.
fn awaited(fields: &Fields<'_>, named: IoPoint) -> Result<WaitSource, Wrong> {
    let IoPoint { kind, board, point } = named;
    let beyond = |last: u8| {
        let what = format!("{named} is on board {board}, but has to be on board 0 to {last}");
        if board <= last { Ok(board) } else { Err(fields.wrong("point", what)) }
    };
    match kind {
        PointKind::X => Ok(WaitSource::Input { board: beyond(4)?, point }),
        PointKind::M => Ok(WaitSource::M { board: beyond(2)?, point }),
        PointKind::Eux => Ok(WaitSource::Eu { point }),
        PointKind::Y | PointKind::Euy => {
            Err(fields.wrong("point", format!("{named} is an output, and is not waited for")))
        }
    }
}

/// What is set, by its name: kind and point.
fn set_by_name(fields: &Fields<'_>, named: IoPoint) -> Result<(OutputKind, u8), Wrong> {
    let IoPoint { kind, board, point } = named;
    let kind = match kind {
        PointKind::Y => OutputKind::Y,
        PointKind::M => OutputKind::M,
        PointKind::Euy => OutputKind::Euy,
        PointKind::X | PointKind::Eux => {
            return Err(fields.wrong("point", format!("{named} is an input, and is not set")));
        }
    };
    let point = u16::from(board) * 32 + u16::from(point);
    match u8::try_from(point).ok().filter(|point| *point <= LAST_OUTPUT) {
        Some(point) => Ok((kind, point)),
        None => {
            let what = format!("{named} is beyond this instruction, which ends with the first of board 1");
            Err(fields.wrong("point", what))
        }
    }
}
