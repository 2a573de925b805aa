//! The history as a table for spreadsheets.

use r6_api::AddressValue;
use r6_api::gateway::{History, HistoryBucket, HistoryEvents, HistorySample, Production};
use serde_json::Value;

/// The table: a line of names, then a line for each sample or bucket. Lines end as RFC 4180 says.
pub fn table(history: &History) -> String {
    let mut table = String::new();
    match &history.buckets {
        Some(buckets) => {
            line(&mut table, ["time", "mean", "min", "max", "last", "good_ms", "samples"].map(str::to_owned));
            for bucket in buckets {
                let HistoryBucket { time, mean, min, max, last, good_ms, samples } = bucket;
                let [mean, min, max] = [mean, min, max].map(|number| number.map_or(String::new(), decimal));
                let last = last.as_ref().map_or(String::new(), value);
                line(
                    &mut table,
                    [time.clone(), mean, min, max, last, decimal(*good_ms), samples.to_string()],
                );
            }
        }
        None => {
            line(&mut table, ["time", "value", "gap"].map(str::to_owned));
            for HistorySample { time, value: of, gap } in history.samples.iter().flatten() {
                let of = of.as_ref().map_or(String::new(), value);
                let gap = gap.map_or(String::new(), |gap| gap.word().to_owned());
                line(&mut table, [time.clone(), of, gap]);
            }
        }
    }
    table
}

/// The columns of a table of events. Each kind of event fills some of them.
const EVENT_COLUMNS: [&str; 18] = [
    "id",
    "time",
    "event",
    "code",
    "text",
    "remedy",
    "lasted_ms",
    "from",
    "to",
    "because",
    "count",
    "at_least",
    "ms",
    "at",
    "counter",
    "added",
    "total",
    "true_time",
];

/// A table of events.
pub fn event_table(page: &HistoryEvents) -> String {
    let mut table = String::new();
    line(&mut table, EVENT_COLUMNS.map(str::to_owned));
    for event in &page.events {
        // Our own types always become JSON.
        let fields = serde_json::to_value(event).unwrap_or_default();
        line(
            &mut table,
            EVENT_COLUMNS.map(|column| match fields.get(column) {
                None | Some(Value::Null) => String::new(),
                // These are words and times of ours.
                Some(Value::String(text))
                    if ["id", "time", "event", "because", "at", "counter", "true_time"].contains(&column) =>
                {
                    text.clone()
                }
                Some(Value::String(text)) => quoted(text),
                Some(number) => number.to_string(),
            }),
        );
    }
    table
}

/// The columns of a table of figures.
const PRODUCTION_COLUMNS: [&str; 26] = [
    "robot",
    "shift",
    "date",
    "from",
    "to",
    "under_way",
    "seen_ms",
    "unseen_ms",
    "running_ms",
    "waiting_ms",
    "alarm_ms",
    "manual_ms",
    "other_ms",
    "availability",
    "parts",
    "part_resets",
    "cycles",
    "cycles_at_least",
    "cycles_timed",
    "cycle_p50_ms",
    "cycle_p90_ms",
    "cycle_min_ms",
    "cycle_max_ms",
    "cycle_mean_ms",
    "alarm_codes",
    "unreadable",
];

/// A table of figures: a row for each range or shift.
pub fn production_table(all: &[Production]) -> String {
    let mut table = String::new();
    line(&mut table, PRODUCTION_COLUMNS.map(str::to_owned));
    for figures in all {
        let Production { shift, states, availability, cycles, parts, alarms, .. } = figures;
        let of_shift =
            |of: fn(&r6_api::gateway::ShiftSpan) -> String| shift.as_ref().map_or(String::new(), of);
        let whole = |number: Option<u64>| number.map_or(String::new(), |number| number.to_string());
        let cells = [
            name(&figures.robot),
            of_shift(|shift| name(&shift.name)),
            of_shift(|shift| shift.date.clone()),
            figures.from.clone(),
            figures.to.clone(),
            of_shift(|shift| shift.under_way.to_string()),
            decimal(figures.seen_ms),
            decimal(figures.unseen_ms),
            decimal(states.running_ms),
            decimal(states.waiting_ms),
            decimal(states.alarm_ms),
            decimal(states.manual_ms),
            decimal(states.other_ms),
            availability.value.map_or(String::new(), decimal),
            whole(parts.count),
            parts.resets.to_string(),
            cycles.count.to_string(),
            cycles.at_least.to_string(),
            cycles.timed.to_string(),
            whole(cycles.p50_ms),
            whole(cycles.p90_ms),
            whole(cycles.min_ms),
            whole(cycles.max_ms),
            cycles.mean_ms.map_or(String::new(), decimal),
            alarms.codes.to_string(),
            figures.unreadable.to_string(),
        ];
        line(&mut table, cells);
    }
    table
}

/// The name of a robot or a shift: small letters, digits and `-`. With `-` in front it could be a formula.
fn name(name: &str) -> String {
    if name.starts_with('-') { quoted(name) } else { name.to_owned() }
}

fn line<const N: usize>(table: &mut String, cells: [String; N]) {
    table.push_str(&cells.join(","));
    table.push_str("\r\n");
}

fn decimal(number: f64) -> String {
    number.to_string()
}

fn value(value: &AddressValue) -> String {
    match value {
        AddressValue::Decimal(number) => decimal(*number),
        AddressValue::Integer(number) => number.to_string(),
        AddressValue::Word(word) => word.to_string(),
        AddressValue::Flag(flag) => flag.to_string(),
        AddressValue::Text(text) => quoted(text),
        AddressValue::Texts(_) | AddressValue::Counter { .. } => {
            quoted(&serde_json::to_string(value).unwrap_or_default())
        }
    }
}

/// A text as a cell. A spreadsheet takes a text that begins with `=` and the like as a formula and runs it:
/// an apostrophe before it says that it is text. Some take it also behind blanks, and with the wide signs
/// that East Asian keyboards write.
fn quoted(text: &str) -> String {
    let is_blank = |of: char| of.is_whitespace() || of.is_control() || matches!(of, '\u{200b}' | '\u{feff}');
    let sign = text.trim_start_matches(is_blank);
    let is_formula = text.starts_with(['\t', '\r', '\n'])
        || sign.starts_with(['=', '+', '-', '@', '\u{ff1d}', '\u{ff0b}', '\u{ff0d}', '\u{ff20}']);
    let mark = if is_formula { "'" } else { "" };
    format!("\"{mark}{}\"", text.replace('"', "\"\""))
}

#[cfg(test)]
mod tests {
    use super::*;
    use r6_api::gateway::{Gap, Happened, HistoryEvent};

    fn history(samples: Option<Vec<HistorySample>>, buckets: Option<Vec<HistoryBucket>>) -> History {
        History {
            robot: "press".to_owned(),
            signal: "curMold".to_owned(),
            unit: None,
            from: String::new(),
            to: String::new(),
            bucket_ms: None,
            samples,
            buckets,
            kept_until: None,
            unreadable_chunks: 0,
            averages: Vec::new(),
            next_cursor: None,
        }
    }

    #[test]
    fn no_cell_is_a_formula_or_breaks_the_table() {
        let wide = "\u{ff1d}1";
        let texts =
            ["=1+1", "@a", "-1", "+1", "\t=1", wide, " =1", "\u{feff}\u{3000}@a", "a \"b\", c\r\nd", "plain"];
        let sample = |text: &&str| HistorySample {
            time: "2026-11-25T06:00:00.000000Z".to_owned(),
            value: Some(AddressValue::Text((*text).to_owned())),
            gap: None,
        };
        let table = table(&history(Some(texts.iter().map(sample).collect()), None));
        let time = "2026-11-25T06:00:00.000000Z";
        let marked = ["'\u{ff1d}1", "' =1", "'\u{feff}\u{3000}@a"];
        let [wide, behind, after] = marked;
        let cells =
            ["'=1+1", "'@a", "'-1", "'+1", "'\t=1", wide, behind, after, "a \"\"b\"\", c\r\nd", "plain"];
        let lines = cells.map(|cell| format!("{time},\"{cell}\",\r\n"));
        assert_eq!(table, format!("time,value,gap\r\n{}", lines.concat()));
    }

    #[test]
    fn each_event_fills_its_columns_and_none_is_a_formula() {
        let of = |happened| HistoryEvent {
            id: "1-1-1".to_owned(),
            time: "T".to_owned(),
            true_time: None,
            happened,
        };
        let (text, remedy) = ("emergency stop".to_owned(), "release".to_owned());
        let events = vec![
            of(Happened::AlarmBegan { code: 7, text, remedy }),
            of(Happened::ProgramChanged { from: "=1+1".to_owned(), to: "a,b".to_owned() }),
            HistoryEvent {
                true_time: Some("O".to_owned()),
                ..of(Happened::CycleDone { count: 1, at_least: true, ms: None, at: "A".to_owned() })
            },
        ];
        let page = HistoryEvents {
            robot: "press".to_owned(),
            from: String::new(),
            to: String::new(),
            events,
            kept_until: None,
            unreadable: 0,
            next_cursor: None,
        };
        let table = event_table(&page);
        let lines: Vec<_> = table.lines().collect();
        assert_eq!(lines[0], EVENT_COLUMNS.join(","));
        assert_eq!(lines[1], "1-1-1,T,alarm_began,7,\"emergency stop\",\"release\",,,,,,,,,,,,");
        assert_eq!(lines[2], "1-1-1,T,program_changed,,,,,\"'=1+1\",\"a,b\",,,,,,,,,");
        assert_eq!(lines[3], "1-1-1,T,cycle_done,,,,,,,,1,true,,A,,,,O");
        assert_eq!(lines.len(), 4);
    }

    #[test]
    fn a_name_is_no_formula() {
        assert_eq!(["press-4", "-a1"].map(name), ["press-4", "\"'-a1\""]);
    }

    #[test]
    fn numbers_and_gaps_have_their_columns() {
        let time = || "T".to_owned();
        let samples = vec![
            HistorySample { time: time(), value: Some(AddressValue::Decimal(-1.25)), gap: None },
            HistorySample { time: time(), value: None, gap: Some(Gap::NoData) },
        ];
        let shown = table(&history(Some(samples), None));
        assert_eq!(shown, "time,value,gap\r\nT,-1.25,\r\nT,,no_data\r\n");
        let bucket = HistoryBucket {
            time: time(),
            mean: Some(0.5),
            min: Some(0.0),
            max: None,
            last: Some(AddressValue::Flag(true)),
            good_ms: 10.5,
            samples: 3,
        };
        let shown = table(&history(None, Some(vec![bucket])));
        assert_eq!(shown, "time,mean,min,max,last,good_ms,samples\r\nT,0.5,0,,true,10.5,3\r\n");
    }
}
