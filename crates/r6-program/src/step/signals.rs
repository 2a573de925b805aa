//! Steps that wait for signals or set outputs.

use r6_proto::grid::Grid;
use r6_proto::io_point::{IoPoint, PairMask, PointKind};
use r6_proto::message::Action;
use r6_proto::message::instruction::{
    BoardOutput, Output, OutputBoard, OutputKind, Wait, WaitCondition, WaitSource, WrongPoint,
};

use super::{ProgramKind, seconds};
use crate::form::{Fields, Node, Wrong};

/// The last point of an output instruction: the first point of the next board.
const LAST_OUTPUT: u8 = 32;

/// A point as a number, or by its name on the pendant.
enum Point<'d> {
    Number(u8),
    Name(&'d str),
}

/// The kinds of points that a program can wait for or test.
pub const WATCHED: [PointKind; 3] = [PointKind::X, PointKind::M, PointKind::Eux];

/// What a valid point of these kinds is.
pub const A_WATCHED_POINT: &str = "a point X010, M010 or EUX010";

/// The conditions of a wait, by the words of `until`.
const A_CONDITION: [(&str, WaitCondition); 4] = [
    ("on", WaitCondition::On),
    ("off", WaitCondition::Off),
    ("rising", WaitCondition::RisingEdge),
    ("falling", WaitCondition::FallingEdge),
];

/// A wait for a time or for a signal.
pub fn wait(fields: &Fields<'_>, program: ProgramKind) -> Result<Action, Wrong> {
    if fields.has("seconds") {
        let time = seconds(fields, "seconds", Grid::TENTHS_OF_A_SECOND, program)?;
        return Ok(Action::Wait(Wait {
            source: WaitSource::Time,
            condition: WaitCondition::Off,
            limit: fields.required("seconds", time)?,
            unlimited: false,
        }));
    }
    let source = source(fields, program);
    let condition = fields.word("until", &A_CONDITION).unwrap_or(WaitCondition::On);
    let limit = seconds(fields, "limit", Grid::TENTHS_OF_A_SECOND, program);
    let (source, limit) = (source?, limit?);
    Ok(Action::Wait(Wait { source, condition, limit: limit.unwrap_or(0.0), unlimited: limit.is_none() }))
}

/// The signal of a wait, named by `point`. The old form numbers it with `source`, `board` and `point`.
fn source(fields: &Fields<'_>, program: ProgramKind) -> Result<WaitSource, Wrong> {
    let sources = [("input", PointKind::X), ("m", PointKind::M), ("eu", PointKind::Eux)];
    let source = fields.word("source", &sources);
    let board = fields.whole("board", 4_u8);
    let given = point(fields);
    if let Some(named) = named(fields, given.as_ref(), &["source", "board"])? {
        return awaited(fields, named, program);
    }
    let kind = source.ok_or("`seconds` is missing, or `point` with `until`")?;
    let point = counted(fields, given, 31)?;
    let board = match (kind, board.unwrap_or(0)) {
        (PointKind::M, board) => up_to(fields, "board", board, 2)?,
        (PointKind::Eux, _) => 0,
        (_, board) => board,
    };
    let named = IoPoint { kind, board, point };
    fields.older("point", format!("point = \"{named}\""));
    Ok(watched(named))
}

/// The value of `point`.
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

/// The signal, if `point` is its name. The name includes kind and board, so the keys in `told` must be
/// absent.
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

/// The number of the point, at most `last`.
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

/// The input of a stop on a signal, which must be on the first board.
pub fn watched_input(fields: &Fields<'_>) -> Result<u8, Wrong> {
    let given = point(fields);
    match named(fields, given.as_ref(), &[])? {
        Some(IoPoint { kind: PointKind::X, board: 0, point }) => Ok(point),
        Some(other) => Err(fields.wrong("point", WrongPoint::StopsNoMove(other).to_string())),
        None => {
            let point = counted(fields, given, 31)?;
            fields.older("point", format!("point = \"{}\"", IoPoint { kind: PointKind::X, board: 0, point }));
            Ok(point)
        }
    }
}

/// The kinds of outputs, by the words of `kind`.
const OUTPUTS: [(&str, PointKind); 3] = [("y", PointKind::Y), ("m", PointKind::M), ("euy", PointKind::Euy)];

/// The output of a further board, if an `output` step names one. An output instruction reaches only the first
/// point of board 1.
pub fn further_output(fields: &Fields<'_>) -> Option<IoPoint> {
    let named: IoPoint = fields.value("point")?.text()?.parse().ok()?;
    (named.board > 0 && OUTPUTS.iter().any(|(_, kind)| *kind == named.kind)).then_some(named)
}

/// One output, or a pulse on it.
pub fn output(fields: &Fields<'_>, program: ProgramKind) -> Result<Action, Wrong> {
    let given = point(fields);
    let kind = fields.word("kind", &OUTPUTS).unwrap_or(PointKind::Y);
    let on = fields.flag("on");
    let delay = seconds(fields, "delay", Grid::MILLISECONDS, program);
    let pulse = seconds(fields, "pulse", Grid::MILLISECONDS, program);
    let (kind, point) = match named(fields, given.as_ref(), &["kind"])? {
        Some(named) => set_by_name(fields, named)?,
        None => {
            let point = counted(fields, given, LAST_OUTPUT)?;
            let named = IoPoint { kind, board: point / 32, point: point % 32 };
            if (named.kind, named.board) != (PointKind::Euy, 1) {
                fields.older("point", format!("point = \"{named}\""));
            }
            (output_kind(kind), point)
        }
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

/// Sets many outputs of one board: `set` and `clear` name them. In the old form, `kind` and `board` give the
/// board, and `set` and `clear` have numbers.
pub fn board_output(fields: &Fields<'_>, program: ProgramKind) -> Result<Action, Wrong> {
    let board = fields.whole("board", 1_u8).unwrap_or(0);
    let kind = fields.word("kind", &OUTPUTS).unwrap_or(PointKind::Y);
    let mut points = Vec::new();
    let mut are_named = false;
    for (key, on) in [("set", true), ("clear", false)] {
        let wanted = "names of points in brackets, such as [\"Y010\", \"Y011\"]";
        let list = fields.optional(key, wanted, |value| {
            value.list()?.iter().map(|value| of_a_board(value, kind, board)).collect::<Option<Vec<_>>>()
        });
        let names =
            |value: &Node| value.list().and_then(<[Node]>::first).is_some_and(|first| first.text().is_some());
        are_named |= fields.value(key).is_some_and(names);
        points.extend(list.unwrap_or_default().into_iter().map(|point| (key, point, on)));
    }
    let Some((_, first, _)) = points.first().copied() else {
        return Err(Wrong::from("`set` or `clear` has to name points"));
    };
    if are_named {
        let told = ["kind", "board"].into_iter().find(|key| fields.has(key));
        if let Some(key) = told {
            return Err(
                fields.wrong(key, format!("`{key}` goes with points that are numbers; the names tell it"))
            );
        }
    } else {
        fields.older(
            if fields.has("set") { "set" } else { "clear" },
            format!("points by their names, [\"{first}\", …]"),
        );
    }
    let on_wire = program == ProgramKind::Taught || first.board < 2;
    let board = match first.kind {
        PointKind::Y if on_wire => OutputBoard::Y(first.board),
        PointKind::M if on_wire => OutputBoard::M(first.board),
        _ => {
            let key = if fields.has("kind") { "kind" } else { "set" };
            return Err(fields
                .wrong(key, format!("{first} is not set this way: Y and M points of board 0 and 1 are")));
        }
    };
    let mut seen = 0_u32;
    let [mut low, mut high] = [PairMask::default(); 2];
    for (key, point, on) in points {
        if (point.kind, point.board) != (first.kind, first.board) {
            return Err(fields.wrong(key, format!("{point} is on another board than {first}")));
        }
        let bit = 1 << (point.point % 32);
        if seen & bit != 0 {
            return Err(fields.wrong(key, format!("{point} is named twice")));
        }
        seen |= bit;
        match point.point.checked_sub(16) {
            None => low = low.with(point.point, on),
            Some(point) => high = high.with(point, on),
        }
    }
    Ok(Action::BoardOutput(BoardOutput { board, low, high }))
}

/// A point of a list, by its name or by its number on a board.
fn of_a_board(value: &Node, kind: PointKind, board: u8) -> Option<IoPoint> {
    match value.text() {
        Some(name) => name.parse().ok(),
        None => {
            let point =
                value.whole().and_then(|whole| u8::try_from(whole).ok()).filter(|point| *point < 32)?;
            Some(IoPoint { kind, board, point })
        }
    }
}

/// The source of a wait for a named point. A taught program may wait for points that no instruction reaches.
fn awaited(fields: &Fields<'_>, named: IoPoint, program: ProgramKind) -> Result<WaitSource, Wrong> {
    match WaitSource::of(named) {
        Err(WrongPoint::BeyondBoard { .. }) if program == ProgramKind::Taught => Ok(watched(named)),
        source => source.map_err(|wrong| fields.wrong("point", wrong.to_string())),
    }
}

/// The source of a wait for this point.
#[must_use]
pub fn watched(named: IoPoint) -> WaitSource {
    let IoPoint { kind, board, point } = named;
    match kind {
        PointKind::M => WaitSource::M { board, point },
        PointKind::Eux => WaitSource::Eu { point },
        PointKind::X | PointKind::Y | PointKind::Euy => WaitSource::Input { board, point },
    }
}

fn output_kind(kind: PointKind) -> OutputKind {
    match kind {
        PointKind::M => OutputKind::M,
        PointKind::Euy => OutputKind::Euy,
        PointKind::Y | PointKind::X | PointKind::Eux => OutputKind::Y,
    }
}

/// The kind and the point of a named output.
fn set_by_name(fields: &Fields<'_>, named: IoPoint) -> Result<(OutputKind, u8), Wrong> {
    let IoPoint { kind, board, point } = named;
    if matches!(kind, PointKind::X | PointKind::Eux) {
        return Err(fields.wrong("point", format!("{named} is an input, and is not set")));
    }
    let kind = output_kind(kind);
    let point = u16::from(board) * 32 + u16::from(point);
    match u8::try_from(point).ok().filter(|point| *point <= LAST_OUTPUT) {
        Some(point) => Ok((kind, point)),
        None => {
            let what = format!("{named} is beyond this instruction, which ends with the first of board 1");
            Err(fields.wrong("point", what))
        }
    }
}
