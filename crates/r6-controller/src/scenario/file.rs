//! Reads the entries of a scenario from its text.

use std::time::Duration;

use r6_program::form::{self, Fields, Found, Node, Table, Wrong};
use r6_program::{Mistake, Mistakes};
use r6_proto::alarm::AlarmCode;
use r6_proto::io_point::{IoPoint, PointKind};

use super::{Bounce, Entry, Happening, InputPoint, MAX_ENTRIES, MAX_TEXT_BYTES, Reaction, Scenario, Window};
use crate::fault;
use crate::io::OutputPoint;
use crate::mode::Key;
use crate::panel::{Button, PanelAction};
use crate::saved::MAX_COUNT;

/// The words of the happenings (`do`), in the order of `docs/SCENARIOS.md`.
pub const HAPPENINGS: [&str; 15] = [
    "input",
    "bounce",
    "output",
    "button",
    "key",
    "emergency-stop",
    "release-emergency-stop",
    "alarm",
    "clear-alarm",
    "program",
    "counter",
    "photo",
    "command",
    "request",
    "power-cut",
];

/// The longest time in a scenario, in seconds: a year.
const LONGEST: f64 = 31_536_000.0;

/// The shortest time between repetitions, in seconds. Nothing in a cell is faster, and a timeline that does
/// not advance would never end.
const SHORTEST: f64 = 0.001;

/// How many repeated events a scenario may have per second, all together. This matches the fastest thing in a
/// cell, and costs a controller no more than some hundredths of its time.
const MOST_OFTEN: f64 = 1000.0;

/// How often a contact bounces at most. Real ones come to rest after some dozen changes.
const MOST_BOUNCES: u32 = 1000;

const SECONDS: &str = "seconds, 0 to 31536000";

pub(super) fn read(text: &str) -> Result<Scenario, Mistakes> {
    if text.len() > MAX_TEXT_BYTES {
        let what = format!("its text is longer than {MAX_TEXT_BYTES} bytes");
        return Err(Mistake::of_the_file(what, None).into());
    }
    let (document, mut found) = form::parse(text);
    let top = Fields::of(&document, &[], "");
    let seed = top.whole("seed", i64::MAX).and_then(|seed| u64::try_from(seed).ok()).unwrap_or(0);
    let scenario = lists(&top, "", &mut found);
    top.finish(Ok(()), &mut found);
    found.finish(Some(Scenario { seed, ..scenario }))
}

/// Reads the three lists of a scenario from a table that may have other keys too. `label` is the prefix of
/// each mistake.
pub(super) fn lists(top: &Fields<'_>, label: &str, found: &mut Found<'_>) -> Scenario {
    let [at, react, faults] = ["at", "react", "fault"].map(|name| top.tables(name));
    let timeline = entries(label, "at", &at, "do", found, entry);
    let often: f64 = timeline.iter().filter_map(|entry| Some(entry.every?.as_secs_f64().recip())).sum();
    // A little more, to allow for rounding.
    if often > MOST_OFTEN + 1e-6 {
        let what = format!(
            "{label}the entries of [[at]] happen {often:.0} times a second in all; {MOST_OFTEN} are possible"
        );
        found.note(what.into());
    }
    let reactions = entries(label, "react", &react, "when", found, reaction);
    let faults = entries(label, "fault", &faults, "fault", found, windows);
    let begin: usize = faults.iter().map(|fault| fault.times).sum();
    if begin > MAX_ENTRIES {
        let what = format!("{label}the faults of [[fault]] begin {begin} times; {MAX_ENTRIES} are possible");
        found.note(what.into());
        return Scenario::default();
    }
    let faults = faults.iter().flat_map(Windows::each).collect();
    Scenario { seed: 0, timeline, reactions, faults }
}

/// Reads the entries of one list; `named_by` is the field that identifies an entry in messages.
fn entries<T>(
    label: &str,
    list: &'static str,
    tables: &[&Table],
    named_by: &str,
    found: &mut Found<'_>,
    read: impl Fn(&Fields<'_>) -> Result<T, Wrong>,
) -> Vec<T> {
    if tables.len() > MAX_ENTRIES {
        let what =
            format!("{label}there are {} entries in [[{list}]]; {MAX_ENTRIES} are possible", tables.len());
        found.note(what.into());
        return Vec::new();
    }
    let mut all = Vec::with_capacity(tables.len());
    for (number, table) in tables.iter().enumerate() {
        let name = table.value(named_by).and_then(Node::text).filter(|name| name.len() <= 40);
        let name = name.map(|name| format!(" ({name})")).unwrap_or_default();
        let fields = Fields::of(table, &[], format!("{label}[[{list}]] {}{name}: ", number + 1));
        let one = read(&fields);
        all.extend(fields.finish(one, found));
    }
    all
}

fn entry(fields: &Fields<'_>) -> Result<Entry, Wrong> {
    let at =
        fields.due("time", SECONDS, |value| value.number().filter(|time| (0.0..=LONGEST).contains(time)));
    let spread = seconds(fields, "spread").unwrap_or_default();
    let every = fields.number_in("every", "seconds, 0.001 to 31536000", SHORTEST..=LONGEST);
    let times = fields.whole_in("times", "how often, from 1", 1..=u32::MAX);
    if !fields.has("every") && times.is_some_and(|times| times > 1) {
        fields.wrong("times", "`every` is missing: how long until it happens again, seconds");
    }
    let every = every.map(Duration::from_secs_f64);
    let times = if every.is_none() { Some(1) } else { times };
    let what = happening(fields)?;
    Ok(Entry { at: Duration::from_secs_f64(at?), spread, every, times, what })
}

fn happening(fields: &Fields<'_>) -> Result<Happening, Wrong> {
    let words = HAPPENINGS.map(|word| (word, word));
    let word = fields.word("do", &words).ok_or_else(|| Wrong::missing("do", "what happens"))?;
    Ok(match word {
        "input" => {
            let on = fields.due_flag("on");
            Happening::Panel(input(fields, "point")?.set(on?))
        }
        "bounce" => {
            let times = fields.whole_in("changes", "how often, 1 to 1000", 1..=MOST_BOUNCES).unwrap_or(5);
            let within = seconds(fields, "within").unwrap_or(Duration::from_millis(20));
            let on = fields.due_flag("on");
            Happening::Bounce(Bounce { input: input(fields, "point")?, times, within, on: on? })
        }
        "output" => {
            let on = fields.due_flag("on");
            Happening::Output(output(fields, "point")?, on?)
        }
        "button" => Happening::Panel(PanelAction::Press(fields.due_word(
            "button",
            &[
                ("start", Button::Start),
                ("stop", Button::Stop),
                ("pause", Button::Pause),
                ("single-cycle", Button::SingleCycle),
                ("single-step", Button::SingleStep),
            ],
        )?)),
        "key" => Happening::Panel(PanelAction::TurnKey(
            fields.due_word("to", &[("manual", Key::Manual), ("stop", Key::Stop), ("auto", Key::Auto)])?,
        )),
        "emergency-stop" => Happening::Panel(PanelAction::EmergencyStop),
        "release-emergency-stop" => Happening::Panel(PanelAction::ReleaseEmergencyStop),
        "clear-alarm" => Happening::Panel(PanelAction::ClearAlarm),
        "alarm" => Happening::Panel(PanelAction::RaiseAlarm(AlarmCode(fields.due_in(
            "number",
            "an alarm, 1 to 10000",
            1..=AlarmCode::LAST.0,
        )?))),
        "program" => program(fields)?,
        "counter" => {
            let count = "a count, -9007199254740992 to 9007199254740992";
            let counts = -MAX_COUNT..=MAX_COUNT;
            let id = fields.due_in("number", "the number of a counter", 0..=u32::MAX);
            let current = fields.due_in("current", count, counts.clone());
            let target = fields.whole_in("target", count, counts);
            Happening::Counter { id: id?, current: current?, target }
        }
        "photo" => Happening::Photo(
            fields.whole_in("camera", "the number of a camera, 0 to 999", 0..=999).unwrap_or(0),
        ),
        "command" => command(fields)?,
        "request" => {
            let frame = fields.due("frame", "one frame, a JSON object as text", Node::text)?;
            Happening::Request(frame.as_bytes().to_vec())
        }
        "power-cut" => Happening::PowerCut {
            off: seconds(fields, "for").unwrap_or(Duration::from_secs(10)),
            program: fields.text("program", "the name of a program").map(str::to_owned),
        },
        other => return Err(format!("nothing is known of `{other}`").into()),
    })
}

/// Reads the choice of a program, or with `text` the loading of one.
fn program(fields: &Fields<'_>) -> Result<Happening, Wrong> {
    let text = fields.text("text", "the text of a program");
    let name = fields.due("name", "the name of a program", Node::text)?.to_owned();
    Ok(Happening::Panel(match text {
        None => PanelAction::SwitchProgram(name),
        Some(text) => {
            crate::program::Program::read(&name, text)
                .map_err(|mistakes| fields.wrong("text", format!("program `{name}`: {mistakes}")))?;
            PanelAction::LoadProgram { name, text: text.to_owned() }
        }
    }))
}

fn command(fields: &Fields<'_>) -> Result<Happening, Wrong> {
    let wanted = "a list of texts: the command and its arguments";
    let words = fields.due("words", wanted, |value| {
        let words: Option<Vec<_>> = value.list()?.iter().map(Node::text).collect();
        words.filter(|words| !words.is_empty())
    })?;
    let frame = serde_json::json!({
        "dsID": "www.hc-system.com.RemoteMonitor", "reqType": "command", "cmdData": words,
    });
    Ok(Happening::Request(frame.to_string().into_bytes()))
}

fn reaction(fields: &Fields<'_>) -> Result<Reaction, Wrong> {
    let levels = [("on", true), ("off", false)];
    let (is, set) = (fields.word("is", &levels), fields.word("set", &levels));
    let (after, spread) = (seconds(fields, "after"), seconds(fields, "spread"));
    let (when, then) = (output(fields, "when"), input(fields, "then"));
    Ok(Reaction {
        when: when?,
        is,
        then: then?,
        set,
        after: after.unwrap_or_default(),
        spread: spread.unwrap_or_default(),
    })
}

/// Reads a fault and the times in which it is in force: one, or with `every` as many as `times` says.
fn windows(fields: &Fields<'_>) -> Result<Windows, Wrong> {
    let (from, lasts) = (seconds(fields, "from").unwrap_or_default(), seconds(fields, "for"));
    let every = fields.number_in("every", "seconds, 0.001 to 31536000", SHORTEST..=LONGEST);
    let every = every.map(Duration::from_secs_f64);
    let times = fields.whole_in("times", "how often, 1 to 1000", 1..=MAX_ENTRIES);
    match (every, times, lasts) {
        (None, Some(2..), _) if !fields.has("every") => {
            fields.wrong("times", "`every` is missing: how long until it begins again, seconds");
        }
        (Some(_), None, _) if !fields.has("times") => {
            fields.wrong("every", "`times` is missing: how often the fault begins, 1 to 1000");
        }
        (Some(every), Some(_), lasts) if lasts.is_none_or(|lasts| lasts >= every) => {
            fields.wrong("every", "the fault has to end before it begins again: `for` is less than `every`");
        }
        _ => {}
    }
    let chance = fields.number_in("chance", "a part, 0 to 1", 0.0..=1.0).unwrap_or(1.0);
    let first = Window { fault: fault::file::read(fields)?, from, lasts, chance };
    Ok(Windows { first, every: every.unwrap_or_default(), times: times.unwrap_or(1) })
}

/// A fault that begins again and again.
struct Windows {
    first: Window,
    /// From one begin to the next.
    every: Duration,
    times: usize,
}

impl Windows {
    /// Each of its times.
    fn each(&self) -> impl Iterator<Item = Window> {
        (0..self.times).scan(self.first.from, |next, _| {
            let from = *next;
            *next = from.saturating_add(self.every);
            Some(Window { from, ..self.first.clone() })
        })
    }
}

fn seconds(fields: &Fields<'_>, name: &'static str) -> Option<Duration> {
    fields.number_in(name, SECONDS, 0.0..=LONGEST).map(Duration::from_secs_f64)
}

fn input(fields: &Fields<'_>, name: &'static str) -> Result<InputPoint, Wrong> {
    let kinds = [PointKind::X, PointKind::Eux];
    let IoPoint { kind, board, point } = fields.due_point(name, "an input X010 or EUX010", &kinds)?;
    Ok(if kind == PointKind::Eux { InputPoint::Eu(point) } else { InputPoint::X(board, point) })
}

fn output(fields: &Fields<'_>, name: &'static str) -> Result<OutputPoint, Wrong> {
    let kinds = [PointKind::Y, PointKind::M, PointKind::Euy];
    let point = fields.due_point(name, "an output Y010, M010 or EUY010", &kinds)?;
    OutputPoint::named(point).ok_or_else(|| fields.wrong(name, format!("{point} is an input")))
}
