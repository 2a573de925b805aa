//! From a program's text to its steps.

use std::collections::BTreeMap;

use r6_proto::io_point::{IoPoint, PairMask, PointKind};
use r6_proto::message::Action;
use r6_proto::message::instruction::{
    BlendLevel, BoardOutput, Coordinates, CurveMove, Manner, Move, Output, OutputBoard, OutputKind,
    PathSpeed, StopOnSignal, Wait, WaitCondition, WaitSource, Workbench,
};
use r6_proto::{AxisMask, RegisterIndex};
use toml::{Table, Value};

use super::{
    Change, Compare, Condition, MAX_NAME_BYTES, MAX_STEPS, MAX_TEXT_BYTES, Photo, Program, ProgramError, Step,
};
use crate::fields::{self, Fields};
use crate::io::OutputPoint;
use crate::machine::{CounterState, MAX_FRAMES, MAX_STACKS, Stack};

/// The kinds of steps, in the order in which the page tells them.
pub(super) const KINDS: [&str; 26] = [
    "axis-move",
    "linear-move",
    "curve-move",
    "move-to-registers",
    "move-to-point",
    "move-to-stack",
    "wait",
    "wait-for-registers",
    "output",
    "board-output",
    "stop-on-signal",
    "path-speed",
    "tool",
    "workbench",
    "photo",
    "take-point",
    "alarm",
    "counter",
    "register",
    "remote",
    "label",
    "jump",
    "if",
    "call",
    "return",
    "end",
];

/// A day: nobody waits longer for anything in a cell, seconds.
const LONGEST: f64 = 86_400.0;

/// The alarm of a photo that nobody answers: connect host fail. Chosen.
const PHOTO_ALARM: u32 = 9;

/// The kinds of points that a program can wait for or ask.
const WATCHED: [PointKind; 3] = [PointKind::X, PointKind::M, PointKind::Eux];

/// The kinds of points that a program can set.
const WRITTEN: [PointKind; 3] = [PointKind::Y, PointKind::M, PointKind::Euy];

pub(super) fn read(name: &str, text: &str) -> Result<Program, ProgramError> {
    let wrong = |reason: String| ProgramError { program: name.to_owned(), step: None, reason };
    if name.is_empty() || name.len() > MAX_NAME_BYTES || name.chars().any(char::is_control) {
        return Err(wrong(format!(
            "a program's name has 1 to {MAX_NAME_BYTES} bytes and no control characters"
        )));
    }
    if text.len() > MAX_TEXT_BYTES {
        return Err(wrong(format!("its text is longer than {MAX_TEXT_BYTES} bytes")));
    }
    let table = fields::table(text).map_err(wrong)?;
    let top = Fields::of(&table);
    let steps =
        top.optional("step", "a list of [[step]] tables", fields::tables).map_err(wrong)?.unwrap_or_default();
    let stacks = top
        .optional("stack", "a list of [[stack]] tables", fields::tables)
        .map_err(wrong)?
        .unwrap_or_default();
    let counters = top
        .optional("counter", "a list of [[counter]] tables", fields::tables)
        .map_err(wrong)?
        .unwrap_or_default();
    if top.has("instruction") || top.has("instructions") {
        return Err(wrong(
            "it is a list of instructions for a PC to send (`r6 run FILE`, `r6 plot FILE`), not a taught program: \
             that has [[step]] tables (docs/PROGRAMS.md)"
                .to_owned(),
        ));
    }
    top.nothing_else().map_err(wrong)?;
    if steps.len() > MAX_STEPS {
        return Err(wrong(format!("it has {} steps; {MAX_STEPS} are possible", steps.len())));
    }
    let labels = labels(name, &steps)?;
    let mut read = Vec::with_capacity(steps.len());
    for (number, table) in steps.iter().enumerate() {
        let step = step(table, &labels).map_err(|reason| at_step(name, number, table, reason))?;
        read.push(step);
    }
    let stacks = stacks.iter().map(|table| stack(table).map_err(wrong)).collect::<Result<_, _>>()?;
    let counters = counters.iter().map(|table| counter(table).map_err(wrong)).collect::<Result<_, _>>()?;
    Ok(Program { name: name.to_owned(), text: text.to_owned(), steps: read, stacks, counters })
}

fn at_step(name: &str, number: usize, table: &Table, reason: String) -> ProgramError {
    let kind = table.get("do").and_then(Value::as_str).unwrap_or_default();
    let kind = if KINDS.contains(&kind) { kind.to_owned() } else { String::new() };
    ProgramError { program: name.to_owned(), step: Some((number + 1, kind)), reason }
}

/// Which step each label stands at.
fn labels<'t>(name: &str, steps: &[&'t Table]) -> Result<BTreeMap<&'t str, usize>, ProgramError> {
    let mut labels = BTreeMap::new();
    for (number, table) in steps.iter().enumerate() {
        if table.get("do").and_then(Value::as_str) != Some("label") {
            continue;
        }
        let Some(label) = table.get("name").and_then(Value::as_str) else { continue };
        if labels.insert(label, number).is_some() {
            return Err(at_step(name, number, table, format!("there is a label `{label}` already")));
        }
    }
    Ok(labels)
}

/// Where a jump goes that `field` names.
fn target(
    fields: &Fields<'_>,
    field: &'static str,
    labels: &BTreeMap<&str, usize>,
) -> Result<Option<usize>, String> {
    let Some(label) = fields.text(field, "the name of a label")? else { return Ok(None) };
    if let Some(place) = labels.get(label) {
        return Ok(Some(*place));
    }
    Err(match r6_proto::nearest(label, labels.keys().copied()) {
        Some(near) => format!("there is no label `{label}`; nearest: `{near}`"),
        None => format!("there is no label `{label}`"),
    })
}

fn step(table: &Table, labels: &BTreeMap<&str, usize>) -> Result<Step, String> {
    let fields = Fields::of(table);
    let kind = fields.required("do", "the kind of step", Value::as_str)?;
    let step = match kind {
        "axis-move" | "linear-move" | "curve-move" => Step::Instruction(motion(kind, &fields)?),
        "move-to-registers" => Step::MoveToRegisters {
            first: fields
                .register("first")?
                .map_or_else(|| six_from(RegisterIndex::FIRST), |first| six_from(first.number()))?,
            pose: fields.flag("pose")?.unwrap_or(false),
            manner: manner(&fields, None)?,
        },
        "move-to-point" => Step::MoveToPoint { above: above(&fields)?, manner: manner(&fields, None)? },
        "move-to-stack" => Step::MoveToStack {
            stack: stack_number(&fields)?,
            counter: counter_number(&fields)?.ok_or("`counter` is missing: the number of a counter")?,
            first: coordinates(&fields, "first", &[3, 6])?,
            above: above(&fields)?,
            manner: manner(&fields, None)?,
        },
        "wait" => wait(&fields, labels)?,
        "wait-for-registers" => wait_for_registers(&fields)?,
        "output" => output(&fields)?,
        "board-output" => Step::Instruction(board_output(&fields)?),
        "stop-on-signal" => Step::Instruction(stop_on_signal(&fields)?),
        "path-speed" => Step::Instruction(path_speed(&fields)?),
        "tool" => Step::Tool(frame_number(&fields)?),
        "workbench" => Step::Instruction(Action::Workbench(Workbench { id: frame_number(&fields)? })),
        "photo" => Step::Photo(Photo {
            camera: camera(&fields)?,
            limit: limit(&fields)?,
            tries: fields.whole("tries", "how often to ask, 1 to 100", 1..=100)?.unwrap_or(1),
            alarm: alarm_number(&fields, "alarm")?.unwrap_or(PHOTO_ALARM),
        }),
        "take-point" => Step::TakePoint {
            camera: camera(&fields)?,
            model: model(&fields)?,
            limit: limit(&fields)?,
            or_else: target(&fields, "else", labels)?,
        },
        "alarm" => Step::Alarm {
            number: alarm_number(&fields, "number")?.ok_or("`number` is missing: the alarm, 1 to 10000")?,
        },
        "counter" => Step::Counter {
            id: fields
                .whole("number", "the number of a counter", 0..=u32::MAX)?
                .ok_or("`number` is missing: the number of a counter")?,
            change: change(&fields)?,
        },
        "register" => Step::Register {
            register: fields.register("number")?.ok_or("`number` is missing: a register, 800 to 900")?,
            change: change(&fields)?,
        },
        "remote" => Step::Remote,
        "label" => {
            fields.required("name", "the label's name", Value::as_str)?;
            Step::Label
        }
        "jump" => Step::Jump(target(&fields, "to", labels)?.ok_or("`to` is missing: the name of a label")?),
        "if" => Step::If {
            condition: condition(&fields)?,
            to: target(&fields, "to", labels)?.ok_or("`to` is missing: the name of a label")?,
        },
        "call" => Step::Call(fields.required("program", "the name of a program", Value::as_str)?.to_owned()),
        "return" => Step::Return,
        "end" => Step::End,
        other => return Err(fields::unknown("do", other, &KINDS)),
    };
    fields.nothing_else()?;
    Ok(step)
}

fn motion(kind: &str, fields: &Fields<'_>) -> Result<Action, String> {
    Ok(match kind {
        "axis-move" => {
            let target = coordinates(fields, "to", &[1, 2, 3, 4, 5, 6, 7, 8])?;
            Action::AxisMove(Move { target, manner: manner(fields, Some(&target))? })
        }
        "linear-move" => {
            let target = coordinates(fields, "to", &[3, 6])?;
            Action::LinearMove(Move { target, manner: manner(fields, Some(&target))? })
        }
        _ => {
            let (middle, end) =
                (coordinates(fields, "through", &[3, 6])?, coordinates(fields, "to", &[3, 6])?);
            if middle.given() != end.given() {
                return Err("`through` and `to` need as many numbers as each other".to_owned());
            }
            Action::CurveMove(CurveMove { middle, end, manner: manner(fields, Some(&end))? })
        }
    })
}

fn coordinates(fields: &Fields<'_>, name: &'static str, counts: &[usize]) -> Result<Coordinates, String> {
    let wanted = counts.iter().map(ToString::to_string).collect::<Vec<_>>().join(" or ");
    let numbers = fields.numbers(name, counts)?;
    Ok(Coordinates::from_slice(&numbers.ok_or_else(|| format!("`{name}` is missing: {wanted} numbers"))?))
}

/// How a move goes; `target` is what a mask may pick from.
fn manner(fields: &Fields<'_>, target: Option<&Coordinates>) -> Result<Manner, String> {
    let speed = fields.number("speed", "percent, from 0.1 to 100", 0.1..=100.0)?;
    let mask = match target {
        Some(target) => {
            let mask = fields.whole::<u8>("mask", "a mask, 1 to 0xFF", 1..=u8::MAX)?.map(AxisMask::from_bits);
            let stray = mask.and_then(|mask| mask.axes().find(|axis| !target.given().contains(*axis)));
            if let Some(axis) = stray {
                return Err(format!("`mask` names {axis}, for which there is no number"));
            }
            mask
        }
        None => None,
    };
    let blend = fields.whole("blend", "a blend level, 0 to 9", 0_u8..=9)?.unwrap_or(0);
    Ok(Manner {
        mask,
        speed: Some(speed.ok_or("`speed` is missing: percent, from 0.1 to 100")?),
        delay: fields.number("delay", "seconds, 0 to 86400", 0.0..=LONGEST)?,
        smooth: BlendLevel::new(blend),
        tool: fields.whole("tool", "the number of a tool, 0 to 31", 0..=MAX_FRAMES - 1)?,
        coord: fields.whole("work_frame", "the number of a workbench, 0 to 31", 0..=MAX_FRAMES - 1)?,
    })
}

fn six_from(first: u16) -> Result<RegisterIndex, String> {
    match (RegisterIndex::new(first), RegisterIndex::new(first + 5)) {
        (Some(first), Some(_)) => Ok(first),
        _ => Err("`first` has to be a register with five more behind it, 800 to 895".to_owned()),
    }
}

fn above(fields: &Fields<'_>) -> Result<f64, String> {
    Ok(fields.number("above", "mm", -1e5..=1e5)?.unwrap_or(0.0))
}

fn limit(fields: &Fields<'_>) -> Result<Option<f64>, String> {
    fields.number("limit", "seconds, 0 to 86400", 0.0..=LONGEST)
}

fn camera(fields: &Fields<'_>) -> Result<i64, String> {
    Ok(fields.whole("camera", "the number of a camera, 0 to 999", 0..=999)?.unwrap_or(0))
}

fn model(fields: &Fields<'_>) -> Result<Option<i64>, String> {
    fields.whole("model", "the number of a template, 0 to 9999", 0..=9999)
}

fn alarm_number(fields: &Fields<'_>, name: &'static str) -> Result<Option<u32>, String> {
    fields.whole(name, "an alarm, 1 to 10000; those of users begin at 5000", 1..=10_000)
}

fn frame_number(fields: &Fields<'_>) -> Result<u32, String> {
    let wanted = "a number, 0 to 31";
    fields
        .whole("number", wanted, 0..=MAX_FRAMES - 1)?
        .ok_or_else(|| format!("`number` is missing: {wanted}"))
}

fn stack_number(fields: &Fields<'_>) -> Result<u32, String> {
    Ok(fields.whole("stack", "the number of a stack, 0 to 31", 0..=MAX_STACKS - 1)?.unwrap_or(0))
}

fn counter_number(fields: &Fields<'_>) -> Result<Option<u32>, String> {
    fields.whole("counter", "the number of a counter", 0..=u32::MAX)
}

/// A wait for a time, or for a point.
fn wait(fields: &Fields<'_>, labels: &BTreeMap<&str, usize>) -> Result<Step, String> {
    if let Some(time) = fields.number("seconds", "seconds, 0 to 86400", 0.0..=LONGEST)? {
        return Ok(Step::Instruction(Action::Wait(Wait {
            source: WaitSource::Time,
            condition: WaitCondition::Off,
            limit: time,
            unlimited: false,
        })));
    }
    let point = fields.point("point", &WATCHED)?.ok_or("`seconds` is missing, or `point` with `until`")?;
    let words = [
        ("on", WaitCondition::On),
        ("off", WaitCondition::Off),
        ("rising", WaitCondition::RisingEdge),
        ("falling", WaitCondition::FallingEdge),
    ];
    let word = fields.text("until", "on, off, rising or falling")?.unwrap_or("on");
    let condition = words.into_iter().find(|(name, _)| *name == word).map(|(_, condition)| condition);
    let condition =
        condition.ok_or_else(|| format!("`until` has to be on, off, rising or falling, not \"{word}\""))?;
    let limit = limit(fields)?;
    Ok(Step::Wait {
        wait: Wait {
            source: watched(point),
            condition,
            limit: limit.unwrap_or(0.0),
            unlimited: limit.is_none(),
        },
        skip_in_single_cycle: fields.flag("skip_in_single_cycle")?.unwrap_or(false),
        or_else: target(fields, "else", labels)?,
    })
}

fn watched(point: IoPoint) -> WaitSource {
    let IoPoint { board, point: number, .. } = point;
    match point.kind {
        PointKind::M => WaitSource::M { board, point: number },
        PointKind::Eux => WaitSource::Eu { point: number },
        PointKind::X | PointKind::Y | PointKind::Euy => WaitSource::Input { board, point: number },
    }
}

fn wait_for_registers(fields: &Fields<'_>) -> Result<Step, String> {
    let first = fields.register("first")?.ok_or("`first` is missing: a register, 800 to 900")?;
    let count = fields.whole("count", "how many registers, from 1", 1_u16..=101)?.unwrap_or(1);
    RegisterIndex::new(first.number() + count - 1).ok_or("`count` goes beyond register 900")?;
    Ok(Step::WaitForRegisters { first, count, limit: limit(fields)? })
}

fn output(fields: &Fields<'_>) -> Result<Step, String> {
    let at = fields
        .point("point", &WRITTEN)?
        .ok_or("`point` is missing: an output such as Y010, M010 or EUY010")?;
    let on = fields.flag("on")?;
    let delay = fields.number("delay", "seconds, 0 to 86400", 0.0..=LONGEST)?;
    let pulse = fields.number("pulse", "seconds, 0 to 86400", 0.0..=LONGEST)?;
    let IoPoint { kind, board, point } = at;
    if board > 0 {
        if delay.or(pulse).is_some() {
            return Err("`delay` and `pulse` are for points of board 0".to_owned());
        }
        let point =
            if kind == PointKind::M { OutputPoint::M(board, point) } else { OutputPoint::Y(board, point) };
        return Ok(Step::Set { point, on: on.ok_or("`on` is missing: true or false")? });
    }
    let (kind, on, delay) = match (kind, pulse, delay) {
        (PointKind::Y, Some(pulse), None) => (OutputKind::TimedY, on.unwrap_or(true), pulse),
        (_, Some(_), _) => return Err("`pulse` is for Y and goes without `delay`".to_owned()),
        (kind, None, delay) => {
            let kind = match kind {
                PointKind::M => OutputKind::M,
                PointKind::Euy => OutputKind::Euy,
                PointKind::X | PointKind::Y | PointKind::Eux => OutputKind::Y,
            };
            (kind, on.ok_or("`on` is missing: true or false")?, delay.unwrap_or(0.0))
        }
    };
    Ok(Step::Instruction(Action::Output(Output { kind, point, on, delay })))
}

fn board_output(fields: &Fields<'_>) -> Result<Action, String> {
    let kinds = [PointKind::Y, PointKind::M];
    let (set, clear) = (fields.points("set", &kinds)?, fields.points("clear", &kinds)?);
    let first = set.first().or(clear.first()).ok_or("`set` or `clear` has to name points")?;
    let board = match first.kind {
        PointKind::M => OutputBoard::M(first.board),
        PointKind::X | PointKind::Y | PointKind::Eux | PointKind::Euy => OutputBoard::Y(first.board),
    };
    let mut halves = [PairMask::default(); 2];
    let mut named = 0_u32;
    for (point, on) in set.iter().map(|point| (point, true)).chain(clear.iter().map(|point| (point, false))) {
        if (point.kind, point.board) != (first.kind, first.board) {
            return Err(format!("{point} is on another board than {first}"));
        }
        let bit = 1_u32 << (point.point % 32);
        if named & bit != 0 {
            return Err(format!("{point} is named twice"));
        }
        named |= bit;
        let [low, high] = halves;
        halves = if point.point < 16 {
            [low.with(point.point, on), high]
        } else {
            [low, high.with(point.point - 16, on)]
        };
    }
    let [low, high] = halves;
    Ok(Action::BoardOutput(BoardOutput { board, low, high }))
}

fn stop_on_signal(fields: &Fields<'_>) -> Result<Action, String> {
    let Some(point) = fields.point("point", &[PointKind::X])? else {
        // Without a point it watches nothing any longer.
        return Ok(Action::StopOnSignal(StopOnSignal { in_use: false, input: 0, on: false }));
    };
    if point.board > 0 {
        return Err("`point` has to be one of board 0, X010 to X047".to_owned());
    }
    let on = fields.flag("on")?.unwrap_or(true);
    Ok(Action::StopOnSignal(StopOnSignal { in_use: true, input: point.point, on }))
}

fn path_speed(fields: &Fields<'_>) -> Result<Action, String> {
    let speed = fields.whole("mm_per_s", PathSpeed::WANTED, 1..=PathSpeed::FASTEST)?;
    Ok(Action::PathSpeed(PathSpeed { in_use: speed.is_some(), speed: speed.map(f64::from) }))
}

fn change(fields: &Fields<'_>) -> Result<Change, String> {
    let range = i64::from(i32::MIN)..=i64::from(i32::MAX);
    let to = fields.whole("to", "a whole number of 32 bits", range.clone())?;
    let by = fields.whole("by", "a whole number of 32 bits", range)?;
    match (to, by) {
        (Some(to), None) => Ok(Change::To(to)),
        (None, Some(by)) => Ok(Change::By(by)),
        _ => Err("either `to` or `by` has to say how it changes".to_owned()),
    }
}

fn condition(fields: &Fields<'_>) -> Result<Condition, String> {
    let asked = ["point", "stack", "counter", "register", "points"];
    let mut given = asked.into_iter().filter(|name| fields.has(name));
    match (given.next(), given.next()) {
        (Some("point"), None) => {
            let point = fields.point("point", &WATCHED)?.ok_or("`point` is missing")?;
            Ok(Condition::Point(watched(point), fields.flag("on")?.unwrap_or(true)))
        }
        (Some("stack"), Some("counter")) => {
            let counter = counter_number(fields)?.ok_or("`counter` is missing")?;
            if fields.flag("full")? != Some(true) {
                return Err("a stack can be asked whether it is `full = true`".to_owned());
            }
            Ok(Condition::StackFull { stack: stack_number(fields)?, counter })
        }
        (Some("counter"), None) => {
            let counter = counter_number(fields)?.ok_or("`counter` is missing")?;
            if fields.flag("reached")? == Some(true) {
                return Ok(Condition::CounterReached(counter));
            }
            Ok(Condition::Counter(counter, compare(fields)?))
        }
        (Some("register"), None) => {
            let register = fields.register("register")?.ok_or("`register` is missing")?;
            Ok(Condition::Register(register, compare(fields)?))
        }
        (Some("points"), None) => {
            let camera = fields.whole("points", "the number of a camera, 0 to 999", 0..=999)?.unwrap_or(0);
            Ok(Condition::Points(camera, model(fields)?))
        }
        _ => Err("it asks one thing: `point`, `counter`, `register`, `points`, or `stack` with `counter`"
            .to_owned()),
    }
}

fn compare(fields: &Fields<'_>) -> Result<Compare, String> {
    let range = i64::MIN..=i64::MAX;
    let found = [
        fields.whole("at_least", "a whole number", range.clone())?.map(Compare::AtLeast),
        fields.whole("below", "a whole number", range.clone())?.map(Compare::Below),
        fields.whole("equals", "a whole number", range)?.map(Compare::Equals),
    ];
    let mut found = found.into_iter().flatten();
    match (found.next(), found.next()) {
        (Some(compare), None) => Ok(compare),
        _ => Err("one of `at_least`, `below` and `equals` has to say what to compare with".to_owned()),
    }
}

fn counter(table: &Table) -> Result<(u32, CounterState), String> {
    let fields = Fields::of(table);
    let whole = |name| fields.whole(name, "a whole number", i64::MIN..=i64::MAX);
    let number = fields.whole("number", "the number of a counter", 0..=u32::MAX)?;
    let number = number.ok_or("[[counter]]: `number` is missing: the number of a counter")?;
    let state = CounterState {
        target: whole("target")?.unwrap_or_default(),
        current: whole("current")?.unwrap_or_default(),
    };
    fields.nothing_else().map_err(|reason| format!("counter {number}: {reason}"))?;
    Ok((number, state))
}

fn stack(table: &Table) -> Result<(u32, Stack), String> {
    let fields = Fields::of(table);
    let number = fields.whole("number", "the number of a stack, 0 to 31", 0..=MAX_STACKS - 1)?.unwrap_or(0);
    let three = |name: &'static str| {
        let found = fields.numbers(name, &[3])?;
        found.ok_or_else(|| format!("stack {number}: `{name}` is missing: three numbers, for X, Y and Z"))
    };
    let (spacing, count) = (three("spacing")?, three("count")?);
    fields.nothing_else().map_err(|reason| format!("stack {number}: {reason}"))?;
    let mut stack = Stack::default();
    for (slot, given) in stack.spacing.iter_mut().zip(spacing) {
        *slot = given;
    }
    for (slot, given) in stack.count.iter_mut().zip(count) {
        if !(1.0..=10_000.0).contains(&given) || given.fract() != 0.0 {
            return Err(format!("stack {number}: `count` has to be three whole numbers, 1 to 10000"));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number, 1 to 10000"
        )]
        let whole = given as u32;
        *slot = whole;
    }
    Ok((number, stack))
}
