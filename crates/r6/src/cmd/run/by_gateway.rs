//! `r6 -g URL run FILE`: the gateway runs the program, and this follows it.

use std::time::Duration;

use r6_api::gateway::{Lease, LeaseKey, Run, RunRequest, RunState};
use serde_json::json;
use tokio::time::{Instant, MissedTickBehavior, interval};

use super::{RunArgs, USUAL_ROOM, name, read_program, read_text, show_remarks};
use crate::by_gateway::{ByGateway, GatewayRobot};
use crate::cmd::job;
use crate::exit::{Exit, Failure};
use crate::hint;
use crate::output;
use crate::output::problem::Code;
use crate::signals::Ending;

/// How often to ask how the run stands.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// How often to renew the lease, which lasts 10 s.
const RENEW_EVERY: Duration = Duration::from_secs(3);

/// How long the gateway may be silent. After that the lease has ended, and with it the run.
const SILENCE: Duration = Duration::from_secs(15);

/// Has a gateway run the program of the file, and follows the run to its end.
pub async fn run(args: RunArgs, gateway: ByGateway) -> Result<Exit, Failure> {
    if let Some(option) = args.job.not_for_gateways().or((args.room != USUAL_ROOM).then_some("--room")) {
        return Err(Failure::usage(format!("{option} does not go over a gateway"))
            .advise("the gateway feeds the steps itself, and its runs are followed to their end"));
    }
    let text = read_text(&args.file)?;
    let program = read_program(&args.file, &text)?;
    show_remarks(&program, &args.file);
    if job::repeats(&program.lists) {
        return Err(Failure::usage(format!("{} repeats until it is stopped", name(&args.file)))
            .advise("leave out its `repeat` (in JSON `oneshot` of 0): over a gateway each run has an end"));
    }
    let mut ending = Ending::watch()?;
    let robot = gateway.robot().await?;
    let json = args.job.json();
    robot
        .with_lease(async |lease: &Lease| {
            let request = RunRequest {
                program: Some(text),
                name: None,
                version: None,
                lease: lease.lease.clone(),
                repeat: None,
            };
            output::acts();
            let begun = robot.run(&request).await?;
            show(&begun, json, "accepted");
            follow(&robot, begun, &lease.lease, &mut ending, json).await
        })
        .await
}

/// Follows a run to its end, and renews its lease. The first signal gives the lease back, which stops the arm.
async fn follow(
    robot: &GatewayRobot,
    begun: Run,
    lease: &LeaseKey,
    ending: &mut Ending,
    json: bool,
) -> Result<Exit, Failure> {
    let (mut heard, mut renewed, mut run) = (Instant::now(), Instant::now(), begun);
    let mut is_given_back = false;
    let mut looks = interval(LOOK_EVERY);
    looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    while run.state == RunState::Running {
        tokio::select! {
            biased;
            () = ending.signalled() => {
                if is_given_back {
                    return Err(left(&run, "interrupted twice"));
                }
                is_given_back = true;
                output::note("r6: the lease is given back, and the gateway stops the arm; once more ends this program without waiting for it");
                // If this fails, the lease ends by itself, and the arm is stopped then.
                let _ = robot.release(lease).await;
            }
            _ = looks.tick() => {
                if renewed.elapsed() >= RENEW_EVERY && !is_given_back {
                    renewed = Instant::now();
                    // If the lease has ended, the run says why.
                    let _ = robot.renew(lease).await;
                }
                match robot.run_of(run.run_id).await {
                    Ok(told) => {
                        heard = Instant::now();
                        if told.state == RunState::Running && told.done != run.done {
                            show(&told, json, "progress");
                        }
                        run = told;
                    }
                    Err(failure) if failure.exit() != Exit::NoReply => return Err(failure),
                    Err(_) if heard.elapsed() < SILENCE => {}
                    Err(failure) => return Err(left(&run, failure.what().as_ref())),
                }
            }
        }
    }
    show(&run, json, "ended");
    let (exit, code) = match run.state {
        RunState::Running | RunState::Unknown => (Exit::Unknown, Code::OutcomeUnknown),
        RunState::Done => return Ok(Exit::Done),
        RunState::Stopped => (Exit::Refused, Code::Stopped),
        RunState::Refused => (Exit::Refused, Code::NotReady),
        RunState::Failed => (Exit::Refused, Code::NotFinished),
    };
    let what = format!("run {}: {}", run.run_id, run.detail);
    let failure = Failure::refused(what).with_exit(exit).with_code(code);
    let failure = if json { failure.told() } else { failure };
    Err(match exit {
        Exit::Unknown => failure.advise("look at the arm before going on"),
        _ => failure,
    })
}

/// The failure when a run is not followed to its end.
fn left(run: &Run, why: &str) -> Failure {
    Failure::unknown(format!("run {} goes on, or is being stopped: {why}", run.run_id)).advise(format!(
        "the arm is stopped when the lease ends, within 10 s; look at it, and at `{}`",
        hint::r6("status")
    ))
}

fn show(run: &Run, json: bool, event: &str) {
    if json {
        output::json(&json!({ "event": event, "run": run }));
        return;
    }
    let steps = format!("{} of {} steps", run.done, run.steps);
    match event {
        "accepted" => output::line(format_args!("run {} on {}: {} steps", run.run_id, run.robot, run.steps)),
        "progress" => output::line(format_args!("{steps} done")),
        _ if run.state == RunState::Done => output::line(format_args!("done: {steps}. {}", run.detail)),
        _ => output::line(format_args!("ended: {steps} done")),
    }
}
