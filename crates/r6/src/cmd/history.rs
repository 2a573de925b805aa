//! `r6 -g URL history`: the values that a gateway kept.

use std::collections::BTreeSet;
use std::time::{Duration, SystemTime};

use clap::Args;
use r6_api::AddressValue;
use r6_api::gateway::{AveragesUsed, History, HistoryAverages, ManagedBy, PollGroup, RobotState};
use r6_gateway::history_table;
use r6_proto::Address;
use serde_json::json;
use tokio::time::timeout;

use crate::by_gateway::{ByGateway, GatewayRobot};
use crate::exit::{Exit, Failure};
use crate::hint;
use crate::output::problem::Code;
use crate::output::table::Table;
use crate::output::{self, problem, readings};
use crate::waiting;
use crate::words::AddressWord;

/// The rows of a page. A text has 1 KiB at most, so that a page has at most half of the longest answer.
const OF_A_PAGE: usize = 2_000;

/// The rows that a person looks at.
const SHOWN: usize = 1_000;

/// A gateway takes 200 requests of a token at once, and then one each 10 ms. Other programs use the token
/// too.
const AT_ONCE: usize = 100;
const APART: Duration = Duration::from_millis(20);

/// How long to ask which values are read. The answer about the history is there already.
const ANSWER_WITHIN: Duration = Duration::from_secs(3);

/// The most addresses that are proposed in place of one that the gateway does not read.
const NEAREST: usize = 3;

/// Show the values that a gateway kept (with --gateway-url)
#[derive(Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
A value counts until the next one. The first row is the last value before the range, if it counts there. Where there \
is no value, the row says why: `stale`, `none`, `lost`, `ended`, `clock_stepped`, `no_data`. Times are in UTC, \
those of the gateway's clock.

With --bucket each row has the average of a span of time, weighted by time, with its lowest, its highest and its \
last value, for how many ms there was a value, and how many samples were kept.

The table has 1000 rows at most. --csv and --json have all: --csv as the gateway gives it to spreadsheets, --json as \
one object a page, each on its line.

A gateway keeps the values that it reads: the usual ones, and those of `read` and of the poll groups of a robot in its \
settings. If there is no value because it does not read this one, a line on stderr says so. `r6 query` asks for any value.

Where the values are gone because they are too old, averages may be left: then a line on stderr says where, and \
`averages` of --json, too.

The exit code is 1 if values are missing because the disk of the gateway cannot be read.

Examples:
  r6 -g http://127.0.0.1:9780 -r press-4 history axis-0 --last 10m
  r6 -g http://127.0.0.1:9780 -r press-4 history axis-0 --last 8h --bucket 1m
  r6 -g http://127.0.0.1:9780 -r press-4 history curMode --from 2026-11-25T06:00:00Z --csv > mode.csv"
)]
pub struct HistoryArgs {
    /// The query address, such as axis-0, world-2, curMode
    #[arg(value_name = "ADDRESS", value_parser = AddressWord, hide_possible_values = true)]
    address: Address,
    /// The last stretch of time, such as 10m, 8h, 2d; with --bucket from a full one of these on [default: 1h]
    #[arg(long, value_name = "TIME", value_parser = stretch, conflicts_with_all = ["from", "to"])]
    last: Option<Duration>,
    /// From this time on: UTC, such as 2026-11-25T06:00:00Z [default: an hour before the end]
    #[arg(long, value_name = "TIME", value_parser = moment)]
    from: Option<String>,
    /// Before this time: UTC [default: now]
    #[arg(long, value_name = "TIME", value_parser = moment)]
    to: Option<String>,
    /// Averages of spans of this width, such as 500ms, 10s, 1m, 1h
    #[arg(long, value_name = "WIDTH")]
    bucket: Option<String>,
    /// Print all rows as CSV
    #[arg(long, conflicts_with = "json")]
    csv: bool,
    /// Print all rows as JSON, one object a page
    #[arg(long)]
    json: bool,
}

/// Reads a length of time.
fn stretch(text: &str) -> Result<Duration, String> {
    let stretch = humantime::parse_duration(text).ok().filter(|stretch| !stretch.is_zero());
    stretch.ok_or_else(|| "write a length of time as 30s, 10m, 8h or 2d".to_owned())
}

/// Checks a time. The gateway reads it.
fn moment(text: &str) -> Result<String, String> {
    match humantime::parse_rfc3339(text) {
        Ok(_) => Ok(text.to_owned()),
        Err(_) => Err("write a time in UTC, as 2026-11-25T06:00:00Z".to_owned()),
    }
}

/// Prints the values.
pub async fn run_by_gateway(args: HistoryArgs, gateway: ByGateway) -> Result<Exit, Failure> {
    let robot = gateway.robot().await?;
    let waiting = format!("waiting for an answer of {}", robot.name());
    let signal = args.address.to_string();
    let from = match args.last {
        Some(last) => Some(ago(last, args.bucket.as_deref())?),
        None => args.from.clone(),
    };
    let rows = if args.csv || args.json { OF_A_PAGE } else { SHOWN }.to_string();
    let mut asked = vec![("signal", signal), ("limit", rows)];
    let given = [("from", from), ("to", args.to.clone()), ("bucket", args.bucket.clone())];
    asked.extend(given.into_iter().filter_map(|(name, value)| Some((name, value?))));
    let mut page = waiting::told(&waiting, page(&robot, &asked)).await?;
    if !args.csv && !args.json {
        let exit = show(&page);
        tell_unread(&page, &robot).await;
        return Ok(exit);
    }
    tell_unread(&page, &robot).await;
    // The range of the first page stays.
    asked.retain(|(name, _)| !["from", "to"].contains(name));
    asked.extend([("from", page.from.clone()), ("to", page.to.clone())]);
    let (mut exit, mut passed, mut is_first) = (Exit::Done, BTreeSet::new(), true);
    loop {
        if page.unreadable_chunks > 0 {
            exit = Exit::Refused;
        }
        print(&page, args.csv, is_first);
        let Some(cursor) = page.next_cursor.clone() else { return Ok(exit) };
        if !passed.insert(cursor.clone()) {
            return Err(robot.leads_back());
        }
        if passed.len() >= AT_ONCE {
            tokio::time::sleep(APART).await;
        }
        let next = [&asked[..], &[("cursor", cursor)]].concat();
        page = self::page(&robot, &next).await?;
        is_first = false;
    }
}

async fn page(robot: &GatewayRobot, asked: &[(&str, String)]) -> Result<History, Failure> {
    let asked: Vec<_> = asked.iter().map(|(name, value)| (*name, value.as_str())).collect();
    robot.history(&asked).await
}

/// The time this long ago. With averages it is a full multiple of their width, such as a full minute.
fn ago(last: Duration, bucket: Option<&str>) -> Result<String, Failure> {
    let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).ok();
    let before = since_1970.and_then(|now| now.checked_sub(last));
    let before = before.ok_or_else(|| Failure::usage("--last reaches back before 1970"))?;
    // What is no width, the gateway refuses.
    let width = bucket.and_then(|bucket| stretch(bucket).ok());
    let time = SystemTime::UNIX_EPOCH + width.map_or(before, |width| rounded_down(before, width));
    Ok(humantime::format_rfc3339_millis(time).to_string())
}

fn rounded_down(time: Duration, width: Duration) -> Duration {
    let over = time.as_nanos() % width.as_nanos().max(1);
    time.saturating_sub(Duration::from_nanos(u64::try_from(over).unwrap_or(0)))
}

/// Prints a page for programs. `is_first`: with the names of the columns.
fn print(page: &History, csv: bool, is_first: bool) {
    let missing = missing(page);
    if !csv {
        let mut object = json!(page);
        if let Some(failure) = &missing {
            object["problem"] = json!(problem::of(failure));
        }
        output::json(&object);
    } else {
        let table = history_table(page);
        let table =
            if is_first { table.as_str() } else { table.split_once("\r\n").map_or("", |(_, rows)| rows) };
        // A text of a robot must not steer a terminal.
        if output::is_terminal() {
            let lines = table.replace("\r\n", "\n");
            output::bytes(output::clean(&lines).as_bytes());
        } else {
            output::bytes(table.as_bytes());
        }
    }
    tell_averages(page);
    if let Some(failure) = missing {
        output::note(failure);
    }
}

/// Says where only averages are left.
fn tell_averages(page: &History) {
    for part in &page.averages {
        output::note(format_args!("r6: {}", left(part)));
    }
}

/// What is left of a part of the range.
fn left(part: &HistoryAverages) -> String {
    let (from, to) = (output::to_the_second(&part.from), output::to_the_second(&part.to));
    let (from, to) = (r6_proto::printable(&from).to_string(), r6_proto::printable(&to).to_string());
    let width = humantime::format_duration(Duration::from_millis(part.width_ms)).to_string().replace(' ', "");
    let gone = format!("from {from} to {to} the values are gone, and averages of {width} are left");
    match part.used {
        AveragesUsed::Exact => format!("{gone}: these rows are made of them, as exact as of the values"),
        AveragesUsed::ByBegin => {
            format!(
                "{gone}: these rows are made of them, and each average counts in the row in which it begins: averages from before the range are missing"
            )
        }
        AveragesUsed::Incomplete => {
            format!("{gone}: these rows are made of them, and they lack some values of that time")
        }
        AveragesUsed::NotUsed => format!("{gone}: ask with `--bucket {width}` or a wider one"),
    }
}

/// If a page has no value, says whether that is because the gateway does not read or keep this one.
async fn tell_unread(page: &History, robot: &GatewayRobot) {
    let mut samples = page.samples.iter().flatten();
    let mut buckets = page.buckets.iter().flatten();
    if samples.any(|sample| sample.value.is_some()) || buckets.any(|bucket| bucket.good_ms > 0.0) {
        return;
    }
    // Without an answer there is nothing to add to the page.
    if let Ok(Ok(state)) = timeout(ANSWER_WITHIN, robot.state()).await
        && let Some(failure) = unread(&page.signal, &state)
    {
        output::note(failure);
    }
}

/// Why a robot with these settings has no history of a value; `None` if it should have one.
fn unread(signal: &str, state: &RobotState) -> Option<Failure> {
    let name = &state.summary.name;
    let read: Vec<_> = state.signals.iter().map(|signal| signal.address.as_str()).collect();
    let is_in = |group: &&PollGroup| group.read.iter().any(|address| address == signal);
    let settings = match state.summary.managed_by {
        ManagedBy::File => "in the --config file of the gateway".to_owned(),
        ManagedBy::Api => format!("with `PUT /v1/robots/{name}`"),
    };
    if !read.contains(&signal) {
        let near = match &nearest(signal, &read)[..] {
            [] => format!("; `{}` shows those that it reads", hint::r6("status")),
            near => format!("; nearest that are read: {}", near.join(", ")),
        };
        let what = format!("the gateway does not read {signal} of {name}, so it keeps no value of it{near}");
        return Some(Failure::refused(what).advise(format!(
            "to have it read and kept, add it to `read` of the robot or of one of its poll groups, {settings}; `{}` asks the robot \
             now",
            hint::r6(&format!("query {signal}"))
        )));
    }
    // The counter of parts is kept in any case.
    let is_parts = state.summary.parts.as_deref() == Some(signal);
    let group = state.groups.iter().find(is_in).filter(|group| !group.keep && !is_parts)?;
    let what = format!(
        "the gateway reads {signal} of {name} each {} ms and keeps no value of it: its poll group has `keep = false`",
        group.period_ms
    );
    Some(
        Failure::refused(what).advise(format!("to have it kept, leave `keep` out of this group, {settings}")),
    )
}

/// The addresses most like this one: those of the same kind with the nearest numbers, or else one with a
/// similar name.
fn nearest<'a>(signal: &str, read: &[&'a str]) -> Vec<&'a str> {
    let parts = |address: &str| {
        let kind = address.trim_end_matches(|letter: char| letter.is_ascii_digit());
        let number = address.strip_prefix(kind).and_then(|number| number.parse::<u32>().ok());
        (kind.to_owned(), number)
    };
    let (kind, number) = parts(signal);
    let of_kind = read.iter().filter_map(|address| match parts(address) {
        (other, Some(other_number)) if other == kind => Some((other_number.abs_diff(number?), *address)),
        _ => None,
    });
    let mut of_kind: Vec<_> = of_kind.collect();
    of_kind.sort_by_key(|(distance, _)| *distance);
    if of_kind.is_empty() {
        return r6_proto::nearest(signal, read.iter().copied()).into_iter().collect();
    }
    of_kind.into_iter().take(NEAREST).map(|(_, address)| address).collect()
}

/// Shows a page to people.
fn show(page: &History) -> Exit {
    let told = |value: &AddressValue| readings::told(&page.signal, value.clone());
    let unit = page.unit.as_deref().unwrap_or_default();
    let mut table = Table::with_right_columns(&[1, 2, 3, 4, 5, 6]);
    if let Some(buckets) = &page.buckets {
        table.row([&"TIME", &"MEAN", &"MIN", &"MAX", &"LAST", &"GOOD MS", &"SAMPLES"]);
        for bucket in buckets {
            let [mean, min, max] = [bucket.mean, bucket.min, bucket.max]
                .map(|number| number.map_or_else(|| "-".to_owned(), |number| format!("{number:.4}")));
            let last = bucket.last.as_ref().map_or_else(|| "-".to_owned(), told);
            let good = format!("{:.0}", bucket.good_ms);
            table.row([&bucket.time, &mean, &min, &max, &last, &good, &bucket.samples]);
        }
    } else {
        table.row([&"TIME", &"VALUE"]);
        for sample in page.samples.iter().flatten() {
            let value = match (&sample.value, sample.gap) {
                (Some(value), _) => told(value),
                (None, Some(gap)) => format!("- ({})", gap.word()),
                (None, None) => "-".to_owned(),
            };
            table.row([&sample.time, &value]);
        }
    }
    if table.height() == 1 {
        let (from, to) = (output::to_the_second(&page.from), output::to_the_second(&page.to));
        let word = if page.averages.is_empty() { "was kept" } else { "is left" };
        output::line(format_args!("no value of {} {word} from {from} to {to}", page.signal));
    } else {
        output::line(table);
        if !unit.is_empty() {
            output::line(format_args!("in {}", r6_proto::printable(unit)));
        }
    }
    tell_averages(page);
    if page.next_cursor.is_some() {
        output::note(format_args!(
            "r6: more follow: the table has {SHOWN} rows at most. Ask for less time or for averages (--bucket), or for all \
             rows (--csv, --json)"
        ));
    }
    match missing(page) {
        Some(failure) => {
            output::note(failure);
            Exit::Refused
        }
        None => Exit::Done,
    }
}

/// The failure if values are missing.
fn missing(page: &History) -> Option<Failure> {
    let chunks = page.unreadable_chunks;
    (chunks > 0).then(|| {
        let what = format!(
            "values are missing: the gateway cannot read {chunks} parts of its history of {}",
            page.signal
        );
        Failure::refused(what).with_code(Code::NoValue).advise("the log of the gateway says which file it is")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_says_what_to_ask_for() {
        let part = |width_ms, used| HistoryAverages {
            from: "2026-09-01T00:00:00.000000Z".to_owned(),
            to: "2026-09-02T00:00:00.000000Z".to_owned(),
            width_ms,
            used,
        };
        assert_eq!(
            left(&part(60_000, AveragesUsed::NotUsed)),
            "from 2026-09-01T00:00:00Z to 2026-09-02T00:00:00Z the values are gone, and averages of 1m are left: ask with \
             `--bucket 1m` or a wider one"
        );
        assert!(left(&part(3_600_000, AveragesUsed::ByBegin)).ends_with(
            "each average counts in the row in which it begins: averages from before the range are missing"
        ));
        assert!(
            left(&part(3_600_000, AveragesUsed::Incomplete)).ends_with("they lack some values of that time")
        );
        assert!(left(&part(3_600_000, AveragesUsed::Exact)).ends_with("as exact as of the values"));
    }

    /// A robot of which these are read, and in a group these.
    fn state(managed_by: &str, read: &[&str], group: &[&str], keep: bool) -> RobotState {
        let signal = |address| json!({ "address": address, "value": null, "unit": null, "quality": "none", "age_ms": null });
        let signals: Vec<_> = read.iter().chain(group).map(signal).collect();
        let state = json!({
            "name": "press-4", "address": "192.168.1.10:9760", "managed_by": managed_by, "link": "up", "identity": null,
            "identity_changed": null, "virtual": null, "lease": null, "stopped": false, "stops_under_way": 0,
            "stop_number": 0, "period_ms": 100, "epoch": 1, "number": 1, "signals": signals,
            "groups": [{ "period_ms": 5000, "read": group, "keep": keep }],
        });
        serde_json::from_value(state).unwrap()
    }

    #[test]
    fn a_value_without_a_history_says_whether_it_is_read() {
        let told = |signal: &str, state| unread(signal, &state).map(|failure| failure.to_string());
        let file =
            || state("file", &["axis-0", "axis-1", "axis-2", "axis-5", "Addr-801"], &["counter-0"], true);
        assert_eq!(
            told("axis-7", file()).unwrap(),
            "r6: the gateway does not read axis-7 of press-4, so it keeps no value of it; nearest that are read: axis-5, axis-2, \
             axis-1\n    to have it read and kept, add it to `read` of the robot or of one of its poll groups, in the --config file of \
             the gateway; `r6 query axis-7` asks the robot now"
        );
        let api = told("curTorque-0", state("api", &["curMode"], &["counter-0"], true)).unwrap();
        assert!(api.starts_with("r6: the gateway does not read curTorque-0 of press-4, so it keeps no value of it; `r6 status` shows those that it reads\n"), "{api}");
        assert!(api.contains("groups, with `PUT /v1/robots/press-4`;"), "{api}");
        let near = told("curMold", state("file", &["curMode", "axis-0"], &[], true)).unwrap();
        assert!(near.contains("; nearest that are read: curMode\n"), "{near}");

        assert_eq!((told("axis-0", file()), told("counter-0", file())), (None, None));
        let unkept = || state("file", &["axis-0"], &["counter-0"], false);
        let mut of_parts = unkept();
        of_parts.summary.parts = Some("counter-0".to_owned());
        assert_eq!(told("counter-0", of_parts), None, "the counter of parts is always kept");
        let unkept = told("counter-0", unkept()).unwrap();
        assert_eq!(
            unkept,
            "r6: the gateway reads counter-0 of press-4 each 5000 ms and keeps no value of it: its poll group has `keep = false`\n    \
             to have it kept, leave `keep` out of this group, in the --config file of the gateway"
        );
    }

    #[test]
    fn averages_of_the_last_hours_begin_with_full_minutes() {
        let seconds = |seconds| Duration::from_secs(seconds);
        assert_eq!(rounded_down(Duration::from_millis(119_999), seconds(60)), seconds(60));
        assert_eq!(rounded_down(seconds(120), seconds(60)), seconds(120));
        assert_eq!(rounded_down(seconds(7), seconds(60)), seconds(0));
    }
}
