//! `r6 -g URL audit`: who did what at a gateway.

use clap::Args;
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::by_gateway::ByGateway;
use crate::exit::{Exit, Failure};
use crate::output;
use crate::output::table::Table;
use crate::waiting;

/// The entries that are shown without a wish.
const USUAL: u64 = 50;

/// Show the audit log of a gateway (with --gateway-url)
#[derive(Debug, Args)]
#[command(after_help = "\
The oldest entry comes first. With --robot NAME only the entries about this robot are shown. The token has to be one \
of an engineer; a token for some robots sees the entries about those of which it is an engineer.

The table names what happened and its details. --json prints each entry on a line, with its hash. `r6 gateway verify` \
checks the log itself.

Examples:
  r6 -g http://127.0.0.1:9780 audit
  r6 -g http://127.0.0.1:9780 -r press-4 audit --last 500
  r6 -g http://127.0.0.1:9780 audit --after 0 --json > audit.jsonl")]
pub struct AuditArgs {
    /// The last entries of the log, before --robot leaves some out
    #[arg(long, value_name = "ENTRIES", default_value_t = USUAL, value_parser = clap::value_parser!(u64).range(1..))]
    last: u64,
    /// All entries behind this number; 0 is the whole log
    #[arg(long, value_name = "NUMBER", conflicts_with = "last")]
    after: Option<u64>,
    /// Print each entry as a line of JSON
    #[arg(long)]
    json: bool,
}

/// An entry, as far as the table needs it.
#[derive(Debug, Deserialize)]
struct Entry {
    number: u64,
    time: String,
    actor: String,
    robot: Option<String>,
    what: String,
    #[serde(flatten)]
    details: Map<String, Value>,
}

/// Prints the entries.
pub async fn run_by_gateway(args: AuditArgs, by: ByGateway) -> Result<Exit, Failure> {
    let gateway = by.gateway()?;
    let waiting = format!("waiting for an answer of {}", by.url().unwrap_or_default());
    let mut after = match args.after {
        Some(after) => after,
        None => waiting::told(&waiting, gateway.audit_end()).await?.saturating_sub(args.last),
    };
    let (mut shown, mut is_first) = (0, true);
    loop {
        let page = waiting::told(&waiting, gateway.audit(after)).await?;
        let is_about = |entry: &&Value| by.robot_name().is_none_or(|name| entry["robot"] == name);
        let entries: Vec<_> = page.entries.iter().filter(is_about).collect();
        shown += entries.len();
        if args.json {
            entries.iter().for_each(output::json);
        } else if !entries.is_empty() {
            output::line(table(&entries, is_first));
            is_first = false;
        }
        match page.next_after {
            Some(next) => after = next,
            None => break,
        }
    }
    if shown == 0 {
        let about =
            by.robot_name().map_or_else(String::new, |name| format!(" about {}", r6_proto::printable(name)));
        let span = match args.after {
            Some(after) => format!("no entry behind {after}{about} is there that this token may read"),
            None => format!(
                "this token may read none of the last {} entries{about}: --after 0 looks at the whole log",
                args.last
            ),
        };
        output::note(format_args!("r6: {span}"));
    }
    Ok(Exit::Done)
}

/// A page as a table. `is_first`: with the names of the columns.
fn table(entries: &[&Value], is_first: bool) -> Table {
    let mut table = Table::with_right_columns(&[0]);
    if is_first {
        table.row([&"NUMBER", &"TIME", &"BY", &"ROBOT", &"WHAT", &"DETAILS"]);
    }
    for value in entries {
        match Entry::deserialize(*value) {
            Ok(entry) => {
                let time = output::to_the_second(&entry.time);
                let robot = entry.robot.as_deref().unwrap_or("-");
                let details = details(&entry.details);
                table.row([&entry.number, &time, &entry.actor, &robot, &entry.what, &details]);
            }
            // Nothing of a log is left out.
            Err(_) => table.row([&"?", &"", &"", &"", &"", value]),
        }
    }
    table
}

/// The members of an entry that have no column.
fn details(details: &Map<String, Value>) -> String {
    let is_told = |name: &str, value: &Value| name != "hash" && !value.is_null() && value != "";
    let told = details.iter().filter(|(name, value)| is_told(name, value));
    let told = told.map(|(name, value)| match value {
        Value::String(text) => format!("{name} {text}"),
        value => format!("{name} {value}"),
    });
    told.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn nothing_of_the_log_is_left_out_and_no_entry_steers_the_terminal() {
        let known = json!({
            "number": 7, "time": "2026-11-25T06:00:00.031250Z", "actor": "token 2", "source": null, "robot": "press",
            "what": "from_tomorrow", "name": "", "why": "a\u{1b}[2J", "count": 2, "hash": "00ff",
        });
        let strange = json!({ "number": "8" });
        let table = table(&[&known, &strange], true).to_string();
        let lines: Vec<_> = table.lines().collect();
        assert_eq!(lines[0], "NUMBER  TIME                  BY       ROBOT  WHAT           DETAILS");
        assert_eq!(
            lines[1],
            "     7  2026-11-25T06:00:00Z  token 2  press  from_tomorrow  count 2, why a\\u{1b}[2J"
        );
        assert!(lines[2].ends_with(r#"{"number":"8"}"#), "{table}");
    }
}
