//! `r6 alarm`: what alarm codes mean.

use clap::Args;
use r6_proto::alarm::AlarmCode;

use crate::exit::{Exit, Failure};
use crate::output;
use crate::output::problem::{self, Code};

/// Say what alarm codes mean, which axis they name, and what to do
#[derive(Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
No robot is asked. The exit code is 1 if a code is not in the table.

Examples:
  r6 alarm 135
  r6 alarm 42 200 219 --json"
)]
pub struct AlarmArgs {
    /// Alarm codes, as `curAlarm` and the pendant show them
    #[arg(value_name = "CODE", required = true, allow_negative_numbers = true, value_parser = code)]
    codes: Vec<u32>,
    /// Print a JSON list
    #[arg(long)]
    json: bool,
}

fn code(text: &str) -> Result<u32, String> {
    text.parse().map_err(|_| format!("an alarm code is a whole number from 0 to {}", u32::MAX))
}

/// Prints what the codes mean.
pub fn run(args: &AlarmArgs) -> Result<Exit, Failure> {
    let alarms: Vec<_> = args.codes.iter().map(|code| AlarmCode(*code).decode()).collect();
    if args.json {
        let list = alarms.iter().map(|alarm| {
            let unknown = (!alarm.known).then(|| {
                let what = format!("alarm {} is not in the table", alarm.code);
                problem::of(&Failure::refused(what).with_code(Code::NoValue))
            });
            r6_api::Alarm { problem: unknown, ..r6_api::Alarm::of(alarm.code) }
        });
        let list: Vec<_> = list.collect();
        output::json_pretty(&list);
    } else {
        for alarm in &alarms {
            output::line(alarm);
            output::line(format_args!("  what to do: {}", alarm.remedy));
            if alarm.seen_live && alarm.code.0 != 0 {
                output::line("  real controllers were seen to raise it");
            }
        }
    }
    Ok(if alarms.iter().all(|alarm| alarm.known) { Exit::Done } else { Exit::Refused })
}
