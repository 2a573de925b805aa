//! From a scenario's text to its entries.

use std::time::Duration;

use r6_proto::io_point::{IoPoint, PointKind};
use toml::{Table, Value};

use super::{
    Bounce, Entry, Happening, InputPoint, MAX_ENTRIES, MAX_TEXT_BYTES, Reaction, Scenario, ScenarioError,
    Window,
};
use crate::fault;
use crate::fields::{self, Fields};
use crate::io::OutputPoint;
use crate::mode::Key;
use crate::panel::{Button, LAST_ALARM, PanelAction};
use crate::saved::MAX_COUNT;

/// The words of what can happen (`do`), in the order in which `docs/SCENARIOS.md` tells them.
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

/// A year: no scenario is longer, seconds.
const LONGEST: f64 = 31_536_000.0;

/// What happens again does so a millisecond later at the earliest: nothing in a cell is faster, and a timeline that stands still
/// would never end.
const SHORTEST: f64 = 0.001;

/// How often a contact bounces at most: real ones come to rest after some dozen.
const MOST_BOUNCES: u32 = 1000;

const SECONDS: &str = "seconds, 0 to 31536000";

pub(super) fn read(text: &str) -> Result<Scenario, ScenarioError> {
    let wrong = |reason: String| ScenarioError { entry: None, reason };
    if text.len() > MAX_TEXT_BYTES {
        return Err(wrong(format!("its text is longer than {MAX_TEXT_BYTES} bytes")));
    }
    let table = fields::table(text).map_err(wrong)?;
    let top = Fields::of(&table);
    let seed = top.whole("seed", "a whole number from 0", 0_u64..=u64::MAX).map_err(wrong)?.unwrap_or(0);
    let [at, react, faults] = ["at", "react", "fault"].map(|name| {
        let wanted = format!("a list of [[{name}]] tables");
        top.optional(name, &wanted, fields::tables).map_err(wrong).map(Option::unwrap_or_default)
    });
    let (at, react, faults) = (at?, react?, faults?);
    top.nothing_else().map_err(wrong)?;
    Ok(Scenario {
        seed,
        timeline: entries("at", &at, "do", entry)?,
        reactions: entries("react", &react, "when", reaction)?,
        faults: entries("fault", &faults, "fault", window)?,
    })
}

/// The entries of one list; `named_by` is the field that tells them apart for a person.
fn entries<T>(
    list: &'static str,
    tables: &[&Table],
    named_by: &str,
    read: impl Fn(&Fields<'_>) -> Result<T, String>,
) -> Result<Vec<T>, ScenarioError> {
    if tables.len() > MAX_ENTRIES {
        let reason = format!("there are {} entries in [[{list}]]; {MAX_ENTRIES} are possible", tables.len());
        return Err(ScenarioError { entry: None, reason });
    }
    let mut all = Vec::with_capacity(tables.len());
    for (number, table) in tables.iter().enumerate() {
        let fields = Fields::of(table);
        let one = read(&fields).and_then(|one| fields.nothing_else().map(|()| one));
        all.push(one.map_err(|reason| {
            let name = table.get(named_by).and_then(Value::as_str).unwrap_or_default();
            let name = if name.len() <= 40 { name.to_owned() } else { String::new() };
            ScenarioError { entry: Some((list, number + 1, name)), reason }
        })?);
    }
    Ok(all)
}

fn entry(fields: &Fields<'_>) -> Result<Entry, String> {
    let word = fields.required("do", "what happens", Value::as_str)?;
    let at = seconds(fields, "time")?.ok_or(format!("`time` is missing: {SECONDS}"))?;
    let spread = seconds(fields, "spread")?.unwrap_or_default();
    let every = fields.number("every", "seconds, 0.001 to 31536000", SHORTEST..=LONGEST)?;
    let times = fields.whole("times", "how often, from 1", 1..=u32::MAX)?;
    if every.is_none() && times.is_some_and(|times| times > 1) {
        return Err("`every` is missing: how long until it happens again, seconds".to_owned());
    }
    let every = every.map(Duration::from_secs_f64);
    let times = if every.is_none() { Some(1) } else { times };
    Ok(Entry { at, spread, every, times, what: happening(word, fields)? })
}

fn happening(word: &str, fields: &Fields<'_>) -> Result<Happening, String> {
    Ok(match word {
        "input" => Happening::Panel(input(fields, "point")?.set(on(fields)?)),
        "bounce" => Happening::Bounce(Bounce {
            input: input(fields, "point")?,
            times: fields.whole("changes", "how often, 1 to 1000", 1..=MOST_BOUNCES)?.unwrap_or(5),
            within: seconds(fields, "within")?.unwrap_or(Duration::from_millis(20)),
            on: on(fields)?,
        }),
        "output" => Happening::Output(output(fields, "point")?, on(fields)?),
        "button" => Happening::Panel(PanelAction::Press(fields.one_of(
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
            fields.one_of("to", &[("manual", Key::Manual), ("stop", Key::Stop), ("auto", Key::Auto)])?,
        )),
        "emergency-stop" => Happening::Panel(PanelAction::EmergencyStop),
        "release-emergency-stop" => Happening::Panel(PanelAction::ReleaseEmergencyStop),
        "clear-alarm" => Happening::Panel(PanelAction::ClearAlarm),
        "alarm" => {
            let wanted = "an alarm, 1 to 10000";
            let number = fields.whole("number", wanted, 1..=LAST_ALARM)?;
            let number = number.ok_or_else(|| format!("`number` is missing: {wanted}"))?;
            Happening::Panel(PanelAction::RaiseAlarm(number))
        }
        "program" => program(fields)?,
        "counter" => {
            let wanted = "a count, -9007199254740992 to 9007199254740992";
            let number = |name| fields.whole(name, wanted, -MAX_COUNT..=MAX_COUNT);
            Happening::Counter {
                id: fields
                    .whole("number", "the number of a counter", 0..=u32::MAX)?
                    .ok_or("`number` is missing: the number of a counter")?,
                current: number("current")?.ok_or("`current` is missing: the count it has from now on")?,
                target: number("target")?,
            }
        }
        "photo" => Happening::Photo(
            fields.whole("camera", "the number of a camera, 0 to 999", 0..=999)?.unwrap_or(0),
        ),
        "command" => command(fields)?,
        "request" => {
            let frame = fields.required("frame", "one frame, a JSON object as text", Value::as_str)?;
            Happening::Request(frame.as_bytes().to_vec())
        }
        "power-cut" => Happening::PowerCut {
            off: seconds(fields, "for")?.unwrap_or(Duration::from_secs(10)),
            program: fields.text("program", "the name of a program")?.map(str::to_owned),
        },
        other => return Err(fields::unknown("do", other, &HAPPENINGS)),
    })
}

/// A program is chosen, or, with a text, loaded.
fn program(fields: &Fields<'_>) -> Result<Happening, String> {
    let name = fields.required("name", "the name of a program", Value::as_str)?.to_owned();
    Ok(Happening::Panel(match fields.text("text", "the text of a program")? {
        None => PanelAction::SwitchProgram(name),
        Some(text) => {
            crate::program::Program::read(&name, text).map_err(|error| error.to_string())?;
            PanelAction::LoadProgram { name, text: text.to_owned() }
        }
    }))
}

fn command(fields: &Fields<'_>) -> Result<Happening, String> {
    let wanted = "a list of texts: the command and its arguments";
    let words = fields.required("words", wanted, |value| {
        let words: Option<Vec<_>> = value.as_array()?.iter().map(Value::as_str).collect();
        words.filter(|words| !words.is_empty())
    })?;
    let frame = serde_json::json!({
        "dsID": "www.hc-system.com.RemoteMonitor", "reqType": "command", "cmdData": words,
    });
    Ok(Happening::Request(frame.to_string().into_bytes()))
}

fn reaction(fields: &Fields<'_>) -> Result<Reaction, String> {
    let levels = [("on", true), ("off", false)];
    Ok(Reaction {
        when: output(fields, "when")?,
        is: fields.word("is", &levels)?,
        then: input(fields, "then")?,
        set: fields.word("set", &levels)?,
        after: seconds(fields, "after")?.unwrap_or_default(),
        spread: seconds(fields, "spread")?.unwrap_or_default(),
    })
}

fn window(fields: &Fields<'_>) -> Result<Window, String> {
    let word = fields.required("fault", "the word of a fault", Value::as_str)?;
    Ok(Window {
        fault: fault::file::read(word, fields)?,
        from: seconds(fields, "from")?.unwrap_or_default(),
        lasts: seconds(fields, "for")?,
        chance: fields.number("chance", "a part, 0 to 1", 0.0..=1.0)?.unwrap_or(1.0),
    })
}

fn seconds(fields: &Fields<'_>, name: &'static str) -> Result<Option<Duration>, String> {
    Ok(fields.number(name, SECONDS, 0.0..=LONGEST)?.map(Duration::from_secs_f64))
}

fn on(fields: &Fields<'_>) -> Result<bool, String> {
    fields.flag("on")?.ok_or_else(|| "`on` is missing: true or false".to_owned())
}

fn input(fields: &Fields<'_>, name: &'static str) -> Result<InputPoint, String> {
    let IoPoint { kind, board, point } = fields
        .point(name, &[PointKind::X, PointKind::Eux])?
        .ok_or_else(|| format!("`{name}` is missing: an input such as X010 or EUX010"))?;
    Ok(if kind == PointKind::Eux { InputPoint::Eu(point) } else { InputPoint::X(board, point) })
}

fn output(fields: &Fields<'_>, name: &'static str) -> Result<OutputPoint, String> {
    let IoPoint { kind, board, point } =
        fields
            .point(name, &[PointKind::Y, PointKind::M, PointKind::Euy])?
            .ok_or_else(|| format!("`{name}` is missing: an output such as Y010, M010 or EUY010"))?;
    Ok(match kind {
        PointKind::M => OutputPoint::M(board, point),
        PointKind::Euy => OutputPoint::Eu(point),
        PointKind::X | PointKind::Y | PointKind::Eux => OutputPoint::Y(board, point),
    })
}
