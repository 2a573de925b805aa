//! `r6 query`: reads values once.

use clap::Args;
use r6_proto::{ADDRESSES, Address};

use crate::by_gateway::ByGateway;
use crate::exit::{Exit, Failure};
use crate::output::readings::{self, Readings};
use crate::output::{self, table::Table};
use crate::robot::RobotArgs;
use crate::waiting;
use crate::words::AddressWord;

/// Read values once
#[derive(Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
A value that the controller does not have is shown as `-`, and the exit code is then 1.

Examples:
  r6 query axis-0 axis-1 axis-2
  r6 query version machineName curMode curAlarm
  r6 query world-0 world-1 world-2 --json
  r6 query Addr-800 RemoteCmdLen
  r6 query --list                     every address with its meaning"
)]
pub struct QueryArgs {
    /// Query addresses, such as axis-0, world-2, curMode
    #[arg(value_name = "ADDRESS", required_unless_present = "list", value_parser = AddressWord, hide_possible_values = true)]
    addresses: Vec<Address>,
    /// Print the table of addresses; no robot is asked
    #[arg(long, conflicts_with = "addresses")]
    list: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Reads and prints the values.
pub async fn run(args: QueryArgs, robot: RobotArgs) -> Result<Exit, Failure> {
    if args.list {
        list(args.json);
        return Ok(Exit::Done);
    }
    robot
        .ask(async |robot| {
            let result = robot.query(&args.addresses).await?;
            Ok(show(robot.address(), &Readings::from(&result), args.json))
        })
        .await
}

/// Reads the values through a gateway, and prints them.
pub async fn run_by_gateway(args: QueryArgs, gateway: ByGateway) -> Result<Exit, Failure> {
    if args.list {
        list(args.json);
        return Ok(Exit::Done);
    }
    let robot = gateway.robot().await?;
    let waiting = format!("waiting for an answer of {}", robot.name());
    let result = waiting::told(&waiting, robot.query(&args.addresses)).await?;
    Ok(show(robot.name(), &result, args.json))
}

fn show(robot: &str, result: &Readings, json: bool) -> Exit {
    if json {
        output::json(&readings::sample(robot, result));
    } else {
        output::line(readings::table(result));
    }
    report_missing(result, &[])
}

/// Says on stderr which addresses have no value and why, except those in `said`. Returns the exit code of a
/// run that only reads.
pub fn report_missing(result: &Readings, said: &[Address]) -> Exit {
    let mut exit = Exit::Done;
    for (address, why) in readings::problems(result) {
        exit = Exit::Refused;
        if !said.contains(&address) {
            output::note(format_args!("r6: {why}"));
        }
    }
    exit
}

fn list(json: bool) {
    if json {
        let rows: Vec<_> = ADDRESSES
            .iter()
            .map(|row| {
                serde_json::json!({
                    "name": row.name, "first_index": row.indices.map(|range| range.0),
                    "last_index": row.indices.map(|range| range.1), "type": row.value.to_string(),
                    "unit": row.unit, "meaning": row.meaning, "since": row.since,
                })
            })
            .collect();
        output::json_pretty(&rows);
        return;
    }
    let mut table = Table::new();
    table.row([&"ADDRESS", &"N", &"TYPE", &"UNIT", &"MEANING", &"SINCE"]);
    for row in &ADDRESSES {
        let range = match row.indices {
            Some((first, last)) => format!("{first}–{last}"),
            None => String::new(),
        };
        table.row([&row.name, &range, &row.value, &row.unit, &row.meaning, &row.since]);
    }
    output::line(table);
}
