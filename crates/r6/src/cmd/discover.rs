//! `r6 discover`: asks named addresses which controller answers.

use clap::Args;
use r6_client::{Discovered, Identity, OutcomeUnknown, RequestError, check_address, discover};
use r6_proto::printable;
use serde_json::{Value, json};

use crate::exit::{Exit, Failure};
use crate::output::{self, problem};
use crate::robot;

/// The most addresses in one call: more than a cell has. There is no scan of a network.
const MOST_ADDRESSES: usize = 64;

/// Ask the named addresses which controller answers; nothing moves
#[derive(Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
It reads version, machineName and axisNum, over one connection to each address that is closed in \
order. There is no scan of a network, on purpose: controllers have very few connections, and one \
that is left half open can block their port. The port is 9760 where none is given; others were \
seen on 9700, 502, 503, 3388 and 8888.

The exit code is 0 if a controller answers at each address, else 3; it is 2 if one of them is no \
address, and no controller was asked.

Examples:
  r6 discover 192.168.1.10 192.168.1.11
  r6 discover 192.168.1.10:9760 192.168.1.10:9700 --json"
)]
pub struct DiscoverArgs {
    /// Where controllers may be
    #[arg(value_name = "HOST[:PORT]", required = true, num_args = 1..=MOST_ADDRESSES)]
    addresses: Vec<String>,
    /// Print one JSON array
    #[arg(long)]
    json: bool,
}

/// Asks all addresses and prints what answered.
pub async fn run(args: DiscoverArgs) -> Result<Exit, Failure> {
    let addresses: Vec<_> = args.addresses.iter().map(String::as_str).collect();
    for address in &addresses {
        check_address(address).map_err(RequestError::from)?;
    }
    let found = discover(&addresses, &robot::settings()).await;
    let silent = found.iter().filter(|found| found.who.is_err()).count();
    if args.json {
        output::json_pretty(&found.iter().map(as_json).collect::<Vec<_>>());
    } else {
        for Discovered { address, who } in &found {
            match who {
                Ok(identity) => output::line(format_args!("{}: {identity}", printable(address))),
                Err(error) => {
                    let failure = failure(error);
                    output::line(format_args!("{}: {}", printable(address), failure.what()));
                    if let Some(advice) = failure.advice().filter(|_| is_silence(error)) {
                        output::line(format_args!("    {advice}"));
                    }
                }
            }
        }
    }
    if silent > 0 {
        let asked = found.len();
        // The array already has the problem of each silent address.
        return Err(Failure::no_reply(format!("no controller answered at {silent} of {asked}")).told());
    }
    Ok(Exit::Done)
}

/// Why an address did not answer. Each address is asked over its own connection.
fn failure(error: &RequestError) -> Failure {
    let failure = Failure::from(error.clone());
    if is_silence(error) { failure.unanswered() } else { failure }
}

/// Whether the connection was made, and nothing came back over it.
fn is_silence(error: &RequestError) -> bool {
    matches!(error, RequestError::OutcomeUnknown(OutcomeUnknown::TimedOut { heard: None, .. }))
}

fn as_json(Discovered { address, who }: &Discovered) -> Value {
    match who {
        Ok(Identity { firmware, machine_name, axis_count }) => json!({
            "robot": address, "firmware": firmware, "machine_name": machine_name, "axis_count": axis_count,
        }),
        Err(error) => {
            let failure = failure(error);
            json!({ "robot": address, "error": failure.what(), "problem": problem::object(&failure) })
        }
    }
}
