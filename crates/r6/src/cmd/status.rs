//! `r6 status`: the machine at a glance, and whether it takes motion.

use clap::Args;
use r6_api::gateway::{RobotLink, RobotSummary};
use r6_client::Readiness;

use crate::by_gateway::ByGateway;
use crate::exit::{Exit, Failure};
use crate::output::{self, hall, status};
use crate::robot::RobotArgs;
use crate::waiting;

/// Show the machine at a glance, and whether it takes motion
#[derive(Debug, Args)]
#[command(after_help = "\
The verdict comes last. NOT READY names each condition that is not met, and below what to do about \
it. UNKNOWN means that every value that can be read is fine, and lists what cannot be read: no firmware \
reports whether the program is at its step that waits for remote commands, and older firmware does not \
report the length of the list. READY means that values prove every condition: the controller reports the \
length of its list and its program (the pendant's port does), and --remote-program names that program. If \
another program runs, that is NOT READY. The exit code is 1 for NOT READY, \
and 0 for UNKNOWN and READY; with --json, `ready` is true, false, or null for UNKNOWN.

With --gateway-url it shows what the gateway knows: its robots with mode and alarm, or with --robot NAME one robot \
with its values and how old they are. The exit code is 1 if a robot cannot be reached, is stopped, or was exchanged, \
and 3 if no gateway answers for a robot at the moment: its row says so, and with --json it has the member `problem`.

Examples:
  r6 status
  r6 status --remote-program wait-for-pc
  r6 -r 192.168.1.10 status
  r6 status --json
  r6 -g http://127.0.0.1:9780 status             all robots of a gateway
  r6 -g http://127.0.0.1:9780 -r press-4 status")]
pub struct StatusArgs {
    /// Print one JSON object, units in the names
    #[arg(long)]
    json: bool,
    /// A program that only waits for remote commands: if it runs, the controller takes instructions
    #[arg(long, value_name = "NAME")]
    remote_program: Option<String>,
}

/// Reads and prints the state.
pub async fn run(args: StatusArgs, robot: RobotArgs) -> Result<Exit, Failure> {
    robot
        .ask(async |robot| {
            let state = robot.status().await?;
            let remote_program = args.remote_program.as_deref();
            if args.json {
                output::json_pretty(&status::told(robot.address(), &state, remote_program));
            } else {
                output::line(status::text(robot.address(), &state, remote_program));
            }
            Ok(match state.readiness(remote_program) {
                Readiness::Ready | Readiness::Unknown(_) => Exit::Done,
                Readiness::NotReady(_) => Exit::Refused,
            })
        })
        .await
}

/// Prints what a gateway knows: all its robots, or the robot that was typed with its values.
pub async fn run_by_gateway(args: StatusArgs, gateway: ByGateway) -> Result<Exit, Failure> {
    if args.remote_program.is_some() {
        return Err(Failure::usage(
            "--remote-program asks the controller itself, so it does not go with --gateway-url",
        ));
    }
    let waiting = format!("waiting for an answer of {}", gateway.url().unwrap_or_default());
    if !gateway.has_robot() {
        let gateway = gateway.gateway()?;
        let robots = waiting::told(&waiting, gateway.robots()).await?;
        // The list says of such a robot that its link is down.
        let is_read = |robot: &&RobotSummary| !args.json || robot.link == RobotLink::Down;
        let read = gateway.states(robots.robots.iter().filter(is_read));
        let read = waiting::told(&waiting, read).await?;
        if args.json {
            output::json_pretty(&hall::object(&robots, &read));
        } else {
            output::line(hall::robots(&read));
        }
        return Ok(hall::exit_of_all(&robots, &read));
    }
    let robot = gateway.robot().await?;
    let state = waiting::told(&waiting, robot.state()).await?;
    if args.json {
        output::json_pretty(&state);
    } else {
        output::line(hall::robot(&state));
    }
    Ok(hall::exit([&state.summary].into_iter()))
}
