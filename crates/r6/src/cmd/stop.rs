//! `r6 stop`: ends the motion and clears the list.

use clap::Args;
use r6_client::{Invalid, NotSent, RequestError, Robot, StopReport};
use r6_proto::printable;

use crate::exit::{Exit, Failure};
use crate::hint;
use crate::output;
use crate::output::problem::{self, Code};
use crate::robot::{self, RobotArgs};
use crate::signals::Ending;
use crate::waiting;

const NO_EMERGENCY_STOP: &str = "This is an ordinary command over a network, not an emergency stop: only the wired button protects people.";

/// What stderr says during a stop.
pub const UNDER_WAY: &str = "the stop is under way: waiting until the arm is seen to stand";

/// End the motion and clear the instruction list (not an emergency stop)
#[derive(Debug, Args)]
#[command(after_help = "\
Sends actionStop. While the machine is not seen to stand, stopButton, actionPause and an empty list \
follow in turn, half a second each, and then actionStop again; where the first answer is late, a \
second connection is opened for the same. Once the machine stands, what is left in the instruction \
list is cleared, so that it does not start again later. It ends within 15 s. The program on the \
pendant has to be started again before the next motion.

This is an ordinary command over a network, not an emergency stop: only the wired button protects \
people.

The exit code is 0 once the machine was seen to stand, 3 if it cannot be reached, else 4. It is 4, too, \
if stdout cannot be written: the stop was sent, and its result could not be told.

Ctrl-C and a closed terminal do not end a stop that is under way; Ctrl-C twice does, with exit code 4.

Examples:
  r6 stop
  r6 stop --json")]
pub struct StopArgs {
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Stops and prints what was seen.
pub async fn run(args: StopArgs, robot: RobotArgs) -> Result<Exit, Failure> {
    let connected = robot.connect().await.map_err(|error| match error {
        RequestError::Invalid(why) => Invalid::NotStopped(Box::new(why)).into(),
        RequestError::NotSent(why) => NotSent::NotStopped(Box::new(why)).into(),
        RequestError::Refused(_) | RequestError::OutcomeUnknown(_) => error,
    })?;
    output::acts();
    let result = stop(&connected).await?;
    let result = result.map_err(|error| robot::told_of(&connected, error.into()));
    let address = connected.address().to_owned();
    connected.close().await;
    let report = result?;
    if args.json {
        output::json_pretty(&as_json(&address, &report));
    } else {
        output::line(printable(&report.to_string()));
        if let Some(advice) = start_again(&report) {
            output::line(advice);
        }
        output::line(NO_EMERGENCY_STOP);
    }
    Ok(if report.confirmed { Exit::Done } else { Exit::Unknown })
}

/// Stops the arm. The first signal does not interrupt the stop; the second ends this program.
async fn stop(robot: &Robot) -> Result<Result<StopReport, RequestError>, Failure> {
    let mut ending = Ending::watch()?;
    let stop = waiting::told(UNDER_WAY, robot.stop());
    tokio::pin!(stop);
    let mut is_signalled = false;
    loop {
        tokio::select! {
            biased;
            result = &mut stop => return Ok(result),
            () = ending.signalled() => {}
        }
        if is_signalled {
            return Err(given_up());
        }
        is_signalled = true;
        output::note(
            "the stop is under way and goes on to its end; once more ends this program without waiting for it",
        );
    }
}

/// The failure when the user interrupts a stop twice.
fn given_up() -> Failure {
    Failure::unknown("interrupted twice; the stop was under way, and it is not known whether the arm stands")
        .with_code(Code::NotStopped)
        .advise(format!("use the emergency stop if the arm moves; `{}` stops again", hint::r6("stop")))
}

/// What to do before the next motion, if the mode shows that the program no longer runs.
pub fn start_again(report: &StopReport) -> Option<String> {
    let ended = report.confirmed && report.mode.is_some_and(|mode| !mode.may_run());
    ended.then(|| {
        let status = hint::r6("status");
        format!("the program does not run any more: start the program again before the next motion (`{status}` says how)")
    })
}

fn as_json(address: &str, report: &StopReport) -> r6_api::StopReport {
    let unproved = || problem::of(&Failure::unknown(report).with_code(Code::NotStopped));
    let problem = (!report.confirmed).then(unproved);
    r6_api::StopReport { robot: Some(address.to_owned()), problem, ..seen(report) }
}

/// What became of a stop, for programs.
pub fn seen(report: &StopReport) -> r6_api::StopReport {
    r6_api::StopReport {
        robot: None,
        confirmed: report.confirmed,
        proof: report.proof.map(|proof| proof.word().to_owned()),
        means: report.means.map(|means| means.word().to_owned()),
        second_connection: report.second.as_ref().map(|second| second.word().to_owned()),
        in_doubt: report.doubt.as_ref().map(|doubt| doubt.still_open),
        attempts: report.attempts,
        took_ms: output::readings::milliseconds(report.took),
        moving: report.moving,
        mode: report.mode.map(r6_client::OperationMode::number),
        alarm: report.alarm,
        list_length: report.list_length,
        list: report.list.word().to_owned(),
        problem: None,
    }
}
