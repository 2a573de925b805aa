//! `r6 status`: the machine at a glance, and whether it takes motion.

use clap::Args;

use crate::exit::{Exit, Failure};
use crate::output::{self, status};
use crate::robot::RobotArgs;

/// Show the machine at a glance, and whether it takes motion
#[derive(Debug, Args)]
#[command(after_help = "\
The last line is READY, or NOT READY with each condition that is not met and below what to do \
about it. Firmware that does not tell the length of the list gets UNKNOWN instead of READY. The \
exit code is 1 for NOT READY, else 0.

Examples:
  r6 status
  r6 -r 192.168.1.10 status
  r6 status --json")]
pub struct StatusArgs {
    /// Print one JSON object, units in the names
    #[arg(long)]
    json: bool,
}

/// Reads and prints the state.
pub async fn run(args: StatusArgs, robot: RobotArgs) -> Result<Exit, Failure> {
    robot
        .with(async |robot| {
            let state = robot.status().await?;
            if args.json {
                output::json_pretty(&status::json(robot.address(), &state));
            } else {
                output::line(status::text(robot.address(), &state));
            }
            Ok(if state.is_ready() { Exit::Done } else { Exit::Refused })
        })
        .await
}
