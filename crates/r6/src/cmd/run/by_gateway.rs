//! `r6 -g URL run FILE` and `r6 -g URL run --kept NAME`: the gateway runs the program, and this follows it.

use std::path::Path;
use std::pin::pin;
use std::time::Duration;

use r6_api::gateway::{LeaseKey, Run, RunRequest, RunState};
use r6_proto::printable;
use serde_json::json;
use tokio::sync::Notify;
use tokio::time::{Instant, MissedTickBehavior, interval, timeout};

use super::{RunArgs, USUAL_ROOM, name, read_program, read_text, show_remarks};
use crate::by_gateway::{ByGateway, GatewayRobot};
use crate::cmd::job;
use crate::exit::{Exit, Failure};
use crate::output;
use crate::output::problem::Code;
use crate::signals::Ending;

/// How often to ask how the run stands.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// How often to renew the lease, which lasts 10 s.
const RENEW_EVERY: Duration = Duration::from_secs(3);

/// How long one answer about the run may take. A later look asks again.
const ANSWER_WITHIN: Duration = Duration::from_secs(3);

/// What to do if the run is not followed to its end.
const AFTER_THE_LEASE: &str = "look at the arm: a gateway that runs stops it when the lease ends, within 10 s; without the \
    gateway the arm finishes up to 10 steps, and only the emergency stop is left";

/// How long to wait until the lease is given back.
const RELEASE_WITHIN: Duration = Duration::from_secs(3);

/// How long the gateway may be silent. After that the lease has ended, and with it the run.
const SILENCE: Duration = Duration::from_secs(15);

/// Has a gateway run the program of the file, or a program that it keeps, and follows the run to its end.
pub async fn run(args: RunArgs, gateway: ByGateway) -> Result<Exit, Failure> {
    args.check()?;
    let own = [(args.room != USUAL_ROOM).then_some("--room"), args.once.then_some("--once")];
    if let Some(option) = args.job.not_for_gateways().or(own.into_iter().flatten().next()) {
        return Err(Failure::usage(format!("{option} does not go over a gateway"))
            .advise("the gateway feeds the steps itself, and its runs are followed to their end"));
    }
    let text = args.file.as_deref().map(checked).transpose()?;
    let mut ending = Ending::watch()?;
    let robot = before_the_run(gateway.robot(), &mut ending).await?;
    let lease = before_the_run(robot.acquire(), &mut ending).await?;
    let request = RunRequest {
        program: text,
        name: args.kept.as_ref().map(|kept| kept.name.clone()),
        version: args.kept.as_ref().and_then(|kept| kept.version),
        sha256: args.sha256,
        lease: lease.lease.clone(),
        repeat: None,
    };
    let ended = carry_out(&robot, &request, &mut ending, args.job.json()).await;
    // Who interrupts once more does not wait for this. The lease ends by itself.
    tokio::select! {
        _ = timeout(RELEASE_WITHIN, robot.release(&lease.lease)) => {}
        () = ending.signalled() => {}
    }
    match (ended, &args.kept) {
        (Err(failure), Some(kept)) => Err(kept.explain(failure, &robot).await),
        (ended, _) => ended,
    }
}

/// Does something before the run is asked for. A signal ends it: then nothing was sent to the robot.
async fn before_the_run<T>(
    work: impl Future<Output = Result<T, Failure>>,
    ending: &mut Ending,
) -> Result<T, Failure> {
    tokio::select! {
        biased;
        () = ending.signalled() => Err(Failure::refused("interrupted; nothing was sent to the robot")
            .with_code(Code::Interrupted)
            .advise("if the lease was taken, it ends within 10 s")),
        done = work => done,
    }
}

/// Begins the run, and follows it to its end.
async fn carry_out(
    robot: &GatewayRobot,
    request: &RunRequest,
    ending: &mut Ending,
    json: bool,
) -> Result<Exit, Failure> {
    // A signal may have come with the lease.
    before_the_run(std::future::ready(Ok(())), ending).await?;
    output::acts();
    let (begun, is_interrupted) = begin(robot, request, ending).await?;
    check(&begun, request, robot)?;
    show(&begun, json, "accepted");
    follow(robot, begun, &request.lease, (ending, is_interrupted), json).await
}

/// Refuses another run than asked for. Giving the lease back stops it.
fn check(begun: &Run, request: &RunRequest, robot: &GatewayRobot) -> Result<(), Failure> {
    let is_version = |version: u64| begun.version == Some(version);
    let is_it = begun.robot == robot.name()
        && begun.program == request.name
        && request.version.is_none_or(is_version)
        && request.sha256.as_ref().is_none_or(|sha256| *sha256 == begun.sha256);
    if is_it {
        return Ok(());
    }
    let what = "the gateway tells of another run than asked for: the lease is given back";
    Err(Failure::unknown(what).advise(AFTER_THE_LEASE))
}

/// The text of a file, whose program has an end and no mistakes.
fn checked(file: &Path) -> Result<String, Failure> {
    let text = read_text(file)?;
    let program = read_program(file, &text)?;
    show_remarks(&program, file);
    if job::repeats(&program.lists) {
        return Err(Failure::usage(format!("{} repeats until it is stopped", name(file)))
            .advise("leave out its `repeat` (in JSON `oneshot` of 0): over a gateway each run has an end"));
    }
    Ok(text)
}

/// Begins the run. A signal does not take the request back: whether one came is told with the run.
async fn begin(
    robot: &GatewayRobot,
    request: &RunRequest,
    ending: &mut Ending,
) -> Result<(Run, bool), Failure> {
    let mut begun = pin!(robot.run(request));
    let mut is_interrupted = false;
    loop {
        tokio::select! {
            biased;
            begun = &mut begun => return Ok((begun?, is_interrupted)),
            () = ending.signalled() => {
                if is_interrupted {
                    return Err(Failure::unknown("interrupted twice; the run may have begun").advise(AFTER_THE_LEASE));
                }
                is_interrupted = true;
                output::note("r6: the request is under way: the arm is stopped as soon as it is answered");
            }
        }
    }
}

/// Follows a run to its end, and renews its lease. The first signal gives the lease back, which stops the
/// arm.
async fn follow(
    robot: &GatewayRobot,
    begun: Run,
    lease: &LeaseKey,
    (ending, is_interrupted): (&mut Ending, bool),
    json: bool,
) -> Result<Exit, Failure> {
    let (mut heard, mut renewed, mut run) = (Instant::now(), Instant::now(), begun);
    // The answer to this comes when the arm stands, so it is waited for beside the rest.
    let stop = Notify::new();
    let mut given_back = pin!(async {
        stop.notified().await;
        // If this fails, the lease ends by itself, and the arm is stopped then.
        let _ = robot.release(lease).await;
        std::future::pending::<()>().await;
    });
    let (mut is_stopping, mut is_silent) = (is_interrupted, false);
    if is_stopping {
        stop.notify_one();
    }
    let mut looks = interval(LOOK_EVERY);
    looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    while run.state == RunState::Running {
        let look = async {
            looks.tick().await;
            if renewed.elapsed() >= RENEW_EVERY && !is_stopping {
                renewed = Instant::now();
                // If the lease has ended, the run says why.
                let _ = timeout(ANSWER_WITHIN, robot.renew(lease)).await;
            }
            timeout(ANSWER_WITHIN, robot.run_of(run.run_id)).await.ok()
        };
        tokio::select! {
            biased;
            () = ending.signalled() => {
                if is_stopping {
                    return Err(left(&run, "interrupted twice"));
                }
                is_stopping = true;
                output::note("r6: the lease is given back, and the gateway stops the arm; once more ends this program without waiting for it");
                stop.notify_one();
            }
            () = &mut given_back => {}
            told = look => match told {
                Some(Ok(told)) if told.run_id != run.run_id || told.robot != run.robot => {
                    return Err(left(&run, "the gateway tells of another run"));
                }
                Some(Ok(told)) => {
                    (heard, is_silent) = (Instant::now(), false);
                    if told.state == RunState::Running && told.done != run.done {
                        show(&told, json, "progress");
                    }
                    run = told;
                }
                Some(Err(failure)) if !may_pass(&failure) => return Err(left(&run, failure.what().as_ref())),
                _ if heard.elapsed() < SILENCE => {
                    if !is_silent {
                        output::note("r6: the gateway does not answer; asking again");
                    }
                    is_silent = true;
                }
                Some(Err(failure)) => return Err(left(&run, failure.what().as_ref())),
                None => return Err(left(&run, "the gateway does not answer")),
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
    let what = format!("run {}: {}", run.run_id, printable(&run.detail));
    let failure = Failure::refused(what).with_exit(exit).with_code(code);
    let failure = if json { failure.told() } else { failure };
    Err(match exit {
        Exit::Unknown => failure.advise("look at the arm before going on"),
        _ => failure,
    })
}

/// Whether the next look can have an answer.
fn may_pass(failure: &Failure) -> bool {
    let busy = [Code::TooManyRequests, Code::Overloaded, Code::StoreUnavailable, Code::NoOwner];
    failure.exit() == Exit::NoReply || busy.contains(&failure.code())
}

/// The failure when a run is not followed to its end.
fn left(run: &Run, why: &str) -> Failure {
    Failure::unknown(format!("run {} goes on, or is being stopped: {why}", run.run_id))
        .advise(AFTER_THE_LEASE)
}

fn show(run: &Run, json: bool, event: &str) {
    if json {
        output::json(&json!({ "event": event, "run": run }));
        return;
    }
    let steps = format!("{} of {} steps", run.done, run.steps);
    let (robot, detail) = (printable(&run.robot), printable(&run.detail));
    match event {
        "accepted" => {
            let of = run.program.as_ref().zip(run.version);
            let of = of.map(|(name, version)| format!(" of {}, version {version}", printable(name)));
            output::line(format_args!(
                "run {} on {robot}: {} steps{}",
                run.run_id,
                run.steps,
                of.unwrap_or_default()
            ));
        }
        "progress" => output::line(format_args!("{steps} done")),
        _ if run.state == RunState::Done => output::line(format_args!("done: {steps}; {detail}")),
        _ => output::line(format_args!("ended: {steps} done")),
    }
}
