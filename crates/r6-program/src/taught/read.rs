//! Reads the steps of a program from its text.

use std::collections::BTreeMap;

use r6_proto::RegisterIndex;
use r6_proto::alarm::AlarmCode;
use r6_proto::message::Action;
use r6_proto::message::instruction::{Coordinates, TIMES, TIMES_WANTED, WaitSource};

use super::{
    Change, Compare, Condition, CounterState, MAX_FRAMES, MAX_NAME_BYTES, MAX_STACKS, MAX_STEPS,
    MAX_TEXT_BYTES, Photo, Program, Stack, Step,
};
use crate::form::{self, Fields, Found, Node, Table, Wrong};
use crate::step::{self, ProgramKind};
use crate::{Mistake, Mistakes};

/// What a step does.
#[derive(Clone, Copy)]
enum Kind {
    /// A step that a PC can send too.
    Sent(step::Kind),
    MoveToRegisters,
    MoveToPoint,
    MoveToStack,
    WaitForRegisters,
    Tool,
    Photo,
    TakePoint,
    Alarm,
    Counter,
    Register,
    Remote,
    Label,
    Jump,
    If,
    Call,
    Return,
    End,
}

/// The kinds of steps by the words of `do`, in the order of `docs/PROGRAMS.md`.
const KINDS: [(&str, Kind); 26] = [
    ("axis-move", Kind::Sent(step::Kind::AxisMove)),
    ("linear-move", Kind::Sent(step::Kind::LinearMove)),
    ("curve-move", Kind::Sent(step::Kind::CurveMove)),
    ("move-to-registers", Kind::MoveToRegisters),
    ("move-to-point", Kind::MoveToPoint),
    ("move-to-stack", Kind::MoveToStack),
    ("wait", Kind::Sent(step::Kind::Wait)),
    ("wait-for-registers", Kind::WaitForRegisters),
    ("output", Kind::Sent(step::Kind::Output)),
    ("board-output", Kind::Sent(step::Kind::BoardOutput)),
    ("stop-on-signal", Kind::Sent(step::Kind::StopOnSignal)),
    ("path-speed", Kind::Sent(step::Kind::PathSpeed)),
    ("tool", Kind::Tool),
    ("workbench", Kind::Sent(step::Kind::Workbench)),
    ("photo", Kind::Photo),
    ("take-point", Kind::TakePoint),
    ("alarm", Kind::Alarm),
    ("counter", Kind::Counter),
    ("register", Kind::Register),
    ("remote", Kind::Remote),
    ("label", Kind::Label),
    ("jump", Kind::Jump),
    ("if", Kind::If),
    ("call", Kind::Call),
    ("return", Kind::Return),
    ("end", Kind::End),
];

/// The keys that only the steps of a taught program have.
const OWN_KEYS: [&str; 21] = [
    "first",
    "pose",
    "above",
    "stack",
    "counter",
    "skip_in_single_cycle",
    "else",
    "count",
    "camera",
    "model",
    "tries",
    "alarm",
    "by",
    "name",
    "program",
    "register",
    "points",
    "full",
    "reached",
    "at_least",
    "below",
];

/// One more key, for comparisons.
const EQUALS: &str = "equals";

/// The default alarm of an unanswered photo request. We chose it.
const PHOTO_ALARM: AlarmCode = AlarmCode::NO_HOST;

const A_LABEL: &str = "the name of a label";
const A_COUNTER: &str = "the number of a counter";

/// The step of each label.
type Labels<'d> = BTreeMap<&'d str, usize>;

/// The words of `do`, in the order of `docs/PROGRAMS.md`.
pub fn step_words() -> impl Iterator<Item = &'static str> {
    KINDS.into_iter().map(|(word, _)| word)
}

pub(super) fn program(name: &str, text: &str) -> Result<Program, Mistakes> {
    let wrong = |what: String| Err(Mistake::of_the_file(what, None).into());
    if name.is_empty() || name.len() > MAX_NAME_BYTES || name.chars().any(char::is_control) {
        return wrong(format!("a program's name has 1 to {MAX_NAME_BYTES} bytes and no control characters"));
    }
    if text.len() > MAX_TEXT_BYTES {
        return wrong(format!("its text is longer than {MAX_TEXT_BYTES} bytes"));
    }
    let (document, mut found) = form::parse(text);
    let fields = Fields::of(&document, &["step", "stack", "counter"], "");
    let [steps, stacks, counters] = ["step", "stack", "counter"].map(|name| fields.tables(name));
    fields.finish_with(Ok(()), &mut found, elsewhere);
    if steps.len() > MAX_STEPS {
        found.note(format!("it has {} steps; {MAX_STEPS} are possible", steps.len()).into());
        return found.finish(None);
    }
    let labels = labels(&steps);
    let mut all = Vec::with_capacity(steps.len());
    for (number, table) in steps.iter().enumerate() {
        all.extend(step(number, table, &labels, &mut found));
    }
    let stacks = tables(&stacks, "stack", &mut found, stack);
    let counters = tables(&counters, "counter", &mut found, counter);
    let hint = found.hint();
    found.finish(Some(Program {
        name: name.to_owned(),
        text: text.to_owned(),
        steps: all,
        stacks,
        counters,
        hint,
    }))
}

/// Whether each of these steps has no mistake.
pub(crate) fn each_reads(steps: &[&Table]) -> Vec<bool> {
    let labels = labels(steps);
    let reads =
        |(number, table): (usize, &&Table)| step(number, table, &labels, &mut Found::aside()).is_some();
    steps.iter().enumerate().map(reads).collect()
}

/// Advice for an unknown key of a program.
fn elsewhere(key: &str) -> Option<String> {
    let sent = "this is a list of instructions for a PC to send (`r6 run FILE`, `r6 plot FILE`); a taught program has [[step]] tables (docs/PROGRAMS.md)";
    let of_a_step = || step::KEYS.iter().chain(&OWN_KEYS).any(|known| *known == key);
    match key {
        "instruction" | "instructions" => Some(sent.to_owned()),
        _ if of_a_step() => Some("it belongs below a line [[step]]".to_owned()),
        _ => None,
    }
}

fn labels<'d>(steps: &[&'d Table]) -> Labels<'d> {
    let mut labels = BTreeMap::new();
    for (number, table) in steps.iter().enumerate() {
        if text_of(table, "do") == Some("label")
            && let Some(name) = text_of(table, "name")
        {
            labels.entry(name).or_insert(number);
        }
    }
    labels
}

fn text_of<'d>(table: &'d Table, key: &str) -> Option<&'d str> {
    table.value(key).and_then(Node::text)
}

/// The rows of the tables `[[name]]`.
fn tables<T>(
    tables: &[&Table],
    name: &str,
    found: &mut Found<'_>,
    read: impl Fn(&Fields<'_>) -> Result<T, Wrong>,
) -> Vec<T> {
    let mut rows = Vec::with_capacity(tables.len());
    for (number, table) in tables.iter().enumerate() {
        let fields = Fields::of(table, &[], format!("[[{name}]] {}: ", number + 1));
        let row = read(&fields);
        rows.extend(fields.finish(row, found));
    }
    rows
}

fn step(number: usize, table: &Table, labels: &Labels<'_>, found: &mut Found<'_>) -> Option<Step> {
    let kind = text_of(table, "do").filter(|word| step_words().any(|known| known == *word));
    let label = match kind {
        Some(kind) => format!("step {} ({kind}): ", number + 1),
        None => format!("step {}: ", number + 1),
    };
    let known: Vec<_> = step::KEYS.into_iter().chain(OWN_KEYS).chain([EQUALS]).collect();
    let fields = Fields::of(table, &known, label);
    let step = read(number, &fields, labels);
    fields.finish(step, found)
}

fn read(number: usize, fields: &Fields<'_>, labels: &Labels<'_>) -> Result<Step, Wrong> {
    let missing = || Wrong::missing("do", "the kind of step").advise("such as do = \"axis-move\"");
    Ok(match fields.word("do", &KINDS).ok_or_else(missing)? {
        Kind::Sent(step::Kind::Wait) => wait(fields, labels)?,
        Kind::Sent(step::Kind::Output) => output(fields)?,
        Kind::Sent(kind) => Step::Instruction(step::action(kind, fields, ProgramKind::Taught)?),
        Kind::MoveToRegisters => Step::MoveToRegisters {
            first: six_from(fields)?,
            pose: fields.flag("pose").unwrap_or(false),
            manner: step::manner(fields, ProgramKind::Taught)?,
        },
        Kind::MoveToPoint => {
            let above = above(fields);
            Step::MoveToPoint { above, manner: step::manner(fields, ProgramKind::Taught)? }
        }
        Kind::MoveToStack => {
            let (stack, above, counter) = (stack_number(fields), above(fields), counter_number(fields));
            let first = step::coordinates(fields, "first", &[3, 6]);
            let manner = step::manner(fields, ProgramKind::Taught);
            let first = Coordinates::from_slice(&first?);
            Step::MoveToStack { stack, counter: counter?, first, above, manner: manner? }
        }
        Kind::WaitForRegisters => {
            let count = fields.whole_in("count", "how many registers, 1 to 101", 1_u16..=101).unwrap_or(1);
            let limit = limit(fields);
            let first = fields.due_register("first")?;
            if RegisterIndex::new(first.number() + count - 1).is_none() {
                return Err(fields.wrong("count", "`count` goes beyond register 900"));
            }
            Step::WaitForRegisters { first, count, limit }
        }
        Kind::Tool => {
            Step::Tool(fields.due_in("number", "a whole number from 0 to 31", 0..=MAX_FRAMES - 1)?)
        }
        Kind::Photo => Step::Photo(Photo {
            camera: camera(fields, "camera"),
            limit: limit(fields),
            tries: fields.whole_in("tries", "how often to ask, 1 to 100", 1..=100).unwrap_or(1),
            alarm: fields.whole_in("alarm", AN_ALARM, ALARMS).map_or(PHOTO_ALARM, AlarmCode),
        }),
        Kind::TakePoint => Step::TakePoint {
            camera: camera(fields, "camera"),
            model: model(fields),
            limit: limit(fields),
            or_else: target(fields, "else", labels),
        },
        Kind::Alarm => Step::Alarm { number: AlarmCode(fields.due_in("number", AN_ALARM, ALARMS)?) },
        Kind::Counter => {
            let change = change(fields);
            let id = fields.due_in("number", A_COUNTER, 0..=u32::MAX)?;
            Step::Counter { id, change: change? }
        }
        Kind::Register => {
            let change = change(fields);
            let register = fields.due_register("number")?;
            Step::Register { register, change: change? }
        }
        Kind::Remote => Step::Remote,
        Kind::Label => {
            let name = fields.due("name", "the label's name", Node::text)?;
            if labels.get(name).is_some_and(|first| *first != number) {
                return Err(fields.wrong("name", format!("there is a label `{name}` already")));
            }
            Step::Label
        }
        Kind::Jump => Step::Jump(due_target(fields, labels)?),
        Kind::If => {
            let condition = condition(fields);
            let to = due_target(fields, labels)?;
            Step::If { condition: condition?, to }
        }
        Kind::Call => Step::Call(fields.due("program", "the name of a program", Node::text)?.to_owned()),
        Kind::Return => Step::Return,
        Kind::End => Step::End,
    })
}

const AN_ALARM: &str = "an alarm, 1 to 10000; those of users begin at 5000";
const ALARMS: std::ops::RangeInclusive<u32> = 1..=AlarmCode::LAST.0;

/// The step that a key's label refers to.
fn target(fields: &Fields<'_>, key: &'static str, labels: &Labels<'_>) -> Option<usize> {
    let label = fields.text(key, A_LABEL)?;
    let place = labels.get(label).copied();
    if place.is_none() {
        let near = r6_proto::nearest(label, labels.keys().copied());
        let near = near.map(|near| format!("; nearest: `{near}`")).unwrap_or_default();
        let label: String = label.chars().take(40).collect();
        fields.wrong(key, format!("there is no label `{label}`{near}"));
    }
    place
}

fn due_target(fields: &Fields<'_>, labels: &Labels<'_>) -> Result<usize, Wrong> {
    let target = target(fields, "to", labels);
    if fields.has("to") { fields.required("to", target) } else { fields.due("to", A_LABEL, |_| None) }
}

/// The first of six registers.
fn six_from(fields: &Fields<'_>) -> Result<RegisterIndex, Wrong> {
    let first = fields.register("first").map_or(RegisterIndex::FIRST, RegisterIndex::number);
    match (RegisterIndex::new(first), RegisterIndex::new(first + 5)) {
        (Some(first), Some(_)) => Ok(first),
        _ => Err(fields.wrong("first", "`first` has to be a register with five more behind it, 800 to 895")),
    }
}

fn above(fields: &Fields<'_>) -> f64 {
    fields.number_in("above", "mm, -100000 to 100000", -1e5..=1e5).unwrap_or(0.0)
}

fn limit(fields: &Fields<'_>) -> Option<f64> {
    fields.number_in("limit", TIMES_WANTED, TIMES)
}

fn camera(fields: &Fields<'_>, key: &'static str) -> i64 {
    fields.whole_in(key, "the number of a camera, 0 to 999", 0..=999).unwrap_or(0)
}

fn model(fields: &Fields<'_>) -> Option<i64> {
    fields.whole_in("model", "the number of a template, 0 to 9999", 0..=9999)
}

fn stack_number(fields: &Fields<'_>) -> u32 {
    fields.whole_in("stack", "the number of a stack, 0 to 31", 0..=MAX_STACKS - 1).unwrap_or(0)
}

fn counter_number(fields: &Fields<'_>) -> Result<u32, Wrong> {
    fields.due_in("counter", A_COUNTER, 0..=u32::MAX)
}

/// A wait for a time or for a point.
fn wait(fields: &Fields<'_>, labels: &Labels<'_>) -> Result<Step, Wrong> {
    let action = step::action(step::Kind::Wait, fields, ProgramKind::Taught)?;
    match action {
        Action::Wait(wait) if wait.source != WaitSource::Time => Ok(Step::Wait {
            wait,
            skip_in_single_cycle: fields.flag("skip_in_single_cycle").unwrap_or(false),
            or_else: target(fields, "else", labels),
        }),
        other => Ok(Step::Instruction(other)),
    }
}

/// An output. It may be on a further board, which an instruction cannot set.
fn output(fields: &Fields<'_>) -> Result<Step, Wrong> {
    let Some(point) = step::further_output(fields) else {
        return step::action(step::Kind::Output, fields, ProgramKind::Taught).map(Step::Instruction);
    };
    if let Some(key) = ["delay", "pulse"].into_iter().find(|key| fields.has(key)) {
        return Err(fields.wrong(key, "`delay` and `pulse` are for points of board 0"));
    }
    Ok(Step::Set { point, on: fields.due_flag("on")? })
}

fn change(fields: &Fields<'_>) -> Result<Change, Wrong> {
    let range = i64::from(i32::MIN)..=i64::from(i32::MAX);
    let to = fields.whole_in("to", "a whole number of 32 bits", range.clone());
    let by = fields.whole_in("by", "a whole number of 32 bits", range);
    match (fields.has("to"), fields.has("by")) {
        (true, false) => fields.required("to", to).map(Change::To),
        (false, true) => fields.required("by", by).map(Change::By),
        _ => Err("either `to` or `by` has to say how it changes".into()),
    }
}

fn condition(fields: &Fields<'_>) -> Result<Condition, Wrong> {
    let asked = ["point", "stack", "counter", "register", "points"];
    let mut given = asked.into_iter().filter(|name| fields.has(name));
    match (given.next(), given.next(), given.next()) {
        (Some("point"), None, _) => {
            let on = fields.flag("on").unwrap_or(true);
            let point = fields.due_point("point", step::A_WATCHED_POINT, &step::WATCHED)?;
            Ok(Condition::Point(step::watched(point), on))
        }
        (Some("stack"), Some("counter"), None) => {
            let (stack, counter) = (stack_number(fields), counter_number(fields)?);
            if fields.flag("full") != Some(true) {
                return Err("a stack can be asked whether it is `full = true`".into());
            }
            Ok(Condition::StackFull { stack, counter })
        }
        (Some("counter"), None, _) => {
            let counter = counter_number(fields)?;
            if fields.flag("reached") == Some(true) {
                return Ok(Condition::CounterReached(counter));
            }
            Ok(Condition::Counter(counter, compare(fields)?))
        }
        (Some("register"), None, _) => {
            let compare = compare(fields);
            Ok(Condition::Register(fields.due_register("register")?, compare?))
        }
        (Some("points"), None, _) => Ok(Condition::Points(camera(fields, "points"), model(fields))),
        _ => {
            // Ask for all of them, so that none is reported as out of place.
            for name in asked {
                fields.value(name);
            }
            Err("it asks one thing: `point`, `counter`, `register`, `points`, or `stack` with `counter`"
                .into())
        }
    }
}

fn compare(fields: &Fields<'_>) -> Result<Compare, Wrong> {
    let range = i64::MIN..=i64::MAX;
    let found = [
        fields.whole_in("at_least", "a whole number", range.clone()).map(Compare::AtLeast),
        fields.whole_in("below", "a whole number", range.clone()).map(Compare::Below),
        fields.whole_in(EQUALS, "a whole number", range).map(Compare::Equals),
    ];
    let mut found = found.into_iter().flatten();
    match (found.next(), found.next()) {
        (Some(compare), None) => Ok(compare),
        _ => Err("one of `at_least`, `below` and `equals` has to say what to compare with".into()),
    }
}

fn counter(fields: &Fields<'_>) -> Result<(u32, CounterState), Wrong> {
    let whole = |name| fields.whole_in(name, "a whole number", i64::MIN..=i64::MAX).unwrap_or_default();
    let state = CounterState { target: whole("target"), current: whole("current") };
    Ok((fields.due_in("number", A_COUNTER, 0..=u32::MAX)?, state))
}

fn stack(fields: &Fields<'_>) -> Result<(u32, Stack), Wrong> {
    let number = fields.whole_in("number", "the number of a stack, 0 to 31", 0..=MAX_STACKS - 1).unwrap_or(0);
    let spacing = fields.due("spacing", "mm along X, Y and Z, such as [40, 40, 30]", |value| {
        three(value, |value| value.number().filter(|mm| (-1e6..=1e6).contains(mm)))
    });
    let count = fields.due("count", "three whole numbers, 1 to 10000, for X, Y and Z", |value| {
        three(value, |value| u32::try_from(value.whole()?).ok().filter(|count| (1..=10_000).contains(count)))
    });
    Ok((number, Stack { spacing: spacing?, count: count? }))
}

fn three<T>(value: &Node, read: impl Fn(&Node) -> Option<T>) -> Option<[T; 3]> {
    match value.list()? {
        [x, y, z] => Some([read(x)?, read(y)?, read(z)?]),
        _ => None,
    }
}
