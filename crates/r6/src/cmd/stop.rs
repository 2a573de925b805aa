//! `r6 stop`: ends the motion and clears the list.

use std::time::Duration;

use clap::Args;
use r6_api::gateway::Lease;
use r6_client::{Invalid, NotSent, RequestError, StopReport};
use r6_proto::printable;

use crate::by_gateway::ByGateway;
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

/// What stderr says at the first signal during a stop.
const GOES_ON: &str =
    "the stop is under way and goes on to its end; once more ends this program without waiting for it";

/// The same while a gateway has not answered: it is not known whether it stops the robot.
const STILL_ASKING: &str =
    "the gateway has not answered, and this program goes on waiting; once more ends it without an answer";

/// When to say that a gateway does not answer. It answers within milliseconds if the arm stands.
const NO_ANSWER_AFTER: Duration = Duration::from_secs(2);

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

With --gateway-url the gateway stops the robot. The stop holds: after it, nothing that moves the robot is \
sent by the gateway, until `r6 stop --clear` or another holder of its lease clears it. If there are several \
gateways, each of them can stop each robot: ask another one if this one does not answer. Exit code 4 then also \
means that the arm was seen to stand, and that their database has not confirmed that the stop holds.

Examples:
  r6 stop
  r6 stop --json
  r6 -g http://127.0.0.1:9780 -r press-4 stop")]
pub struct StopArgs {
    /// Let the robot of a gateway move again after a stop, in place of a stop (with --gateway-url)
    #[arg(long)]
    clear: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Stops and prints what was seen.
pub async fn run(args: StopArgs, robot: RobotArgs) -> Result<Exit, Failure> {
    if args.clear {
        return Err(Failure::usage(
            "--clear is for the robots of a gateway, where a stop holds until it is cleared",
        )
        .advise("name the gateway with --gateway-url URL; a controller itself does not hold a stop"));
    }
    let connected = robot.connect().await.map_err(|error| match error {
        RequestError::Invalid(why) => Invalid::NotStopped(Box::new(why)).into(),
        RequestError::NotSent(why) => NotSent::NotStopped(Box::new(why)).into(),
        RequestError::Refused(_) | RequestError::OutcomeUnknown(_) => error,
    })?;
    output::acts();
    let stop = waiting::told(UNDER_WAY, connected.stop());
    let result = to_its_end(stop, GOES_ON, given_up).await?;
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

/// Stops a robot of a gateway, or clears its stop, and prints what the gateway answers.
pub async fn run_by_gateway(args: StopArgs, gateway: ByGateway) -> Result<Exit, Failure> {
    let url = gateway.url().unwrap_or_default();
    let no_answer = format!(
        "no answer of {url} yet: use the emergency stop if the arm moves; if gateways share its store, another of them may \
         answer"
    );
    let robot = waiting::told_after(NO_ANSWER_AFTER, &no_answer, gateway.robot());
    let robot = robot.await.map_err(|failure| not_sent(failure, "the robot"))?;
    output::acts();
    let name = printable(robot.name()).to_string();
    if args.clear {
        let clear = async |lease: &Lease| {
            let cleared = robot.clear_stopped(&lease.lease).await;
            cleared.map_err(|failure| match failure.code() {
                // Of a clearing, the gateway says this only after it has cleared the stop.
                Code::StoreUnavailable => cleared_and_not_confirmed(&name),
                _ => failure,
            })
        };
        robot.with_lease(clear).await?;
        if args.json {
            output::json(&serde_json::json!({ "robot": name, "cleared": true }));
        } else {
            output::line(format_args!("{name}: the stop is cleared; commands and programs are sent again"));
            output::line(format_args!(
                "if a program of the controller ended with the stop, `{}` starts it again",
                hint::r6("command startButton")
            ));
        }
        return Ok(Exit::Done);
    }
    let stop = waiting::told_after(NO_ANSWER_AFTER, &no_answer, robot.stop());
    let stopped = to_its_end(stop, STILL_ASKING, no_answer_at_all).await?;
    let stopped = stopped.map_err(|failure| not_confirmed(failure, &name))?;
    if args.json {
        output::json(&serde_json::json!({
            "robot": name, "confirmed": stopped.confirmed, "took_ms": stopped.took_ms,
        }));
    } else {
        output::line(format_args!("{name} stands, seen after {:.1} ms", stopped.took_ms));
        output::line(format_args!("nothing moves until the stop is cleared: `{}`", hint::r6("stop --clear")));
        output::line(NO_EMERGENCY_STOP);
    }
    Ok(if stopped.confirmed { Exit::Done } else { Exit::Unknown })
}

/// The failure of a stop over a gateway that did not leave. `name`: the robot, for people.
fn not_sent(failure: Failure, name: &str) -> Failure {
    let is_not_allowed = failure.code() == Code::NotAllowed;
    let failure = failure.lead("the stop was not sent").with_code(Code::NotStopped);
    match failure.exit() {
        // A name or a token was typed wrong: the advice says what to type.
        Exit::Usage => failure,
        // With this token, no gateway stops the robot.
        _ if is_not_allowed => failure.advise(format!(
            "use the emergency stop if the arm moves; a token with at least the role operator for {name} can stop it, and \
             `{}` says what this token may do",
            hint::r6("whoami")
        )),
        Exit::Done | Exit::Refused | Exit::NoReply | Exit::Unknown => failure.advise(stop_otherwise()),
    }
}

/// What is known of a stop after the gateway gave no good answer to it.
fn not_confirmed(failure: Failure, name: &str) -> Failure {
    match (failure.code(), failure.exit()) {
        // The gateway gives this answer only after the arm was seen to stand.
        (Code::StoreUnavailable, _) => Failure::unknown(format!(
            "the stop was carried out and {name} was seen to stand, but the database has not confirmed that the \
             stop holds: another gateway may let the arm move again"
        ))
        .with_code(Code::StoreUnavailable)
        .advise(stop_otherwise()),
        // The text says already that it is not proved that the arm stands.
        (Code::NotStopped, Exit::Unknown) => failure.advise(stop_otherwise()),
        (_, Exit::Unknown) => failure
            .lead("it is not known whether the robot was stopped")
            .with_code(Code::NotStopped)
            .advise(stop_otherwise()),
        (_, Exit::Done | Exit::Refused | Exit::Usage | Exit::NoReply) => not_sent(failure, name),
    }
}

/// The failure of a clearing that the database of several gateways did not confirm.
fn cleared_and_not_confirmed(name: &str) -> Failure {
    Failure::unknown(format!(
        "the stop of {name} was cleared, but the database has not confirmed it: the stop may hold again"
    ))
    .with_code(Code::StoreUnavailable)
    .advise(format!("look with `{}` before you go on", hint::r6("status")))
}

/// What to do if a stop over a gateway failed.
fn stop_otherwise() -> String {
    format!(
        "use the emergency stop if the arm moves; `{}` stops again, and if there are several gateways, another one \
         can stop the robot too",
        hint::r6("stop")
    )
}

/// Waits for a stop. The first signal does not interrupt it, and `goes_on` is said; the second ends this
/// program.
async fn to_its_end<T>(
    stop: impl Future<Output = T>,
    goes_on: &str,
    given_up: fn() -> Failure,
) -> Result<T, Failure> {
    let mut ending = Ending::watch()?;
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
        output::note(goes_on);
    }
}

/// The failure when the user interrupts a stop twice.
fn given_up() -> Failure {
    Failure::unknown("interrupted twice; the stop was under way, and it is not known whether the arm stands")
        .with_code(Code::NotStopped)
        .advise(format!("use the emergency stop if the arm moves; `{}` stops again", hint::r6("stop")))
}

/// The same before the gateway answered.
fn no_answer_at_all() -> Failure {
    let what = "interrupted twice before the gateway answered: it is not known whether it stops the robot";
    Failure::unknown(what).with_code(Code::NotStopped).advise(stop_otherwise())
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
