//! Sends instructions and follows them: what `r6 move` and `r6 run` have in common.

mod events;
pub mod frames;
pub mod target;

use std::io::{IsTerminal, Write};
use std::time::Duration;

use clap::Args;
use r6_client::{Done, Robot, Unmet, WaitOptions};
use r6_proto::message::{Action, Instruction};
use r6_proto::{Address, AxisIndex};

use crate::cmd::job::frames::Batch;
use crate::cmd::job::target::{Missed, Target};
use crate::exit::{Exit, Failure};
use crate::output::{self, action, status};
use crate::robot::RobotArgs;
use crate::signals::Ending;
use crate::units;

/// How often the progress on the terminal is refreshed: as fast as eyes read, and few enough queries.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(100);

/// How soon after the answer a motion without delay is seen: controllers answer within 26 ms and start at once.
const START_WITHIN: Duration = Duration::from_secs(1);

/// What to do with instructions.
#[derive(Debug, Args)]
pub struct JobArgs {
    /// Append to the instruction list, which may be running; else the list is replaced
    #[arg(long)]
    pub append: bool,
    /// Wait until the arm stands, judged by its state, and print where it ended
    #[arg(long)]
    pub wait: bool,
    /// How long --wait waits
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = units::duration, requires = "wait")]
    timeout: Duration,
    /// Print the frames that would be sent; no robot is asked
    #[arg(long, conflicts_with = "wait")]
    dry_run: bool,
    /// Print one JSON object for each thing that happens, the outcome last
    #[arg(long)]
    json: bool,
}

/// Checks the machine, sends the batches and, if so asked, waits until they are done.
pub async fn carry_out(args: &JobArgs, batches: Vec<Batch>, robot: &RobotArgs) -> Result<Exit, Failure> {
    let result = attempt(args, batches, robot).await;
    if args.json
        && let Err(failure) = &result
    {
        output::json(&events::failed(failure));
    }
    result
}

async fn attempt(args: &JobArgs, batches: Vec<Batch>, robot: &RobotArgs) -> Result<Exit, Failure> {
    let batches = cut(batches)?;
    if args.dry_run {
        return print_frames(&batches);
    }
    let appends = batches.first().is_some_and(|batch| !batch.replace);
    robot
        .with(async |robot| {
            let ready = preflight(robot, appends, args.json).await?;
            if ready != Exit::Done {
                return Ok(ready);
            }
            // From here on the arm may move, and Ctrl-C has to say so.
            let ending = args.wait.then(Ending::watch).transpose()?;
            send(robot, &batches, args.json).await?;
            if let Some(ending) = ending {
                let instructions: Vec<_> = batches.iter().flat_map(|batch| &batch.instructions).collect();
                let options = WaitOptions {
                    timeout: args.timeout,
                    start_within: START_WITHIN + lead_time(&instructions),
                    ..WaitOptions::default()
                };
                follow(robot, options, Target::of(instructions), ending, args.json).await
            } else if args.json {
                Ok(Exit::Done)
            } else {
                if repeats(&batches) {
                    output::line("this list repeats until stopped: r6 stop");
                } else {
                    output::line("end it with:    r6 stop");
                }
                output::line("follow it with: r6 watch isMoving RemoteCmdLen axis-0 axis-1 axis-2 axis-3 axis-4 axis-5");
                Ok(Exit::Done)
            }
        })
        .await
}

/// Whether the list never ends: one of its instructions stays in it.
pub fn repeats(batches: &[Batch]) -> bool {
    batches.iter().flat_map(|batch| &batch.instructions).any(|instruction| !instruction.oneshot)
}

/// How long the arm stands before its first motion because the instructions say so.
fn lead_time(instructions: &[&Instruction]) -> Duration {
    let mut seconds = 0.0;
    for instruction in instructions {
        let manner = match &instruction.action {
            Action::AxisMove(motion) | Action::LinearMove(motion) => &motion.manner,
            Action::CurveMove(curve) => &curve.manner,
            Action::Wait(wait) => {
                seconds += wait.limit;
                continue;
            }
            Action::Output(output) => {
                seconds += output.delay;
                continue;
            }
            Action::PathSpeed(_)
            | Action::StopOnSignal(_)
            | Action::BoardOutput(_)
            | Action::Workbench(_)
            | Action::Unknown(_) => continue,
        };
        seconds += manner.delay.unwrap_or(0.0);
        break;
    }
    Duration::try_from_secs_f64(seconds).unwrap_or_default()
}

fn cut(batches: Vec<Batch>) -> Result<Vec<Batch>, Failure> {
    let mut parts = Vec::new();
    for batch in batches {
        parts.extend(batch.cut().map_err(Failure::usage)?);
    }
    Ok(parts)
}

fn print_frames(batches: &[Batch]) -> Result<Exit, Failure> {
    if repeats(batches) {
        output::note("this list repeats until stopped: r6 stop");
    }
    for (number, batch) in batches.iter().enumerate() {
        let frame = batch.encode(&(number + 1).to_string()).map_err(Failure::usage)?;
        output::line(String::from_utf8_lossy(&frame));
    }
    Ok(Exit::Done)
}

/// Looks at the machine before anything is sent. Appending to a list that runs is what appending is for.
async fn preflight(robot: &Robot, append: bool, json: bool) -> Result<Exit, Failure> {
    let state = robot.status().await?;
    let unmet: Vec<_> = state.unmet().into_iter().filter(|unmet| !(append && is_running(unmet))).collect();
    if unmet.is_empty() {
        return Ok(Exit::Done);
    }
    if json {
        output::json(&events::not_sent(robot.address(), &unmet));
    }
    output::note(format_args!("r6: nothing was sent. {}", status::not_ready(&unmet)));
    Ok(Exit::Refused)
}

fn is_running(unmet: &Unmet) -> bool {
    match unmet {
        Unmet::Moving | Unmet::LeftoverList { .. } => true,
        Unmet::Mode { .. } | Unmet::Alarm { .. } | Unmet::NotHomed | Unmet::Unknown { .. } => false,
    }
}

async fn send(robot: &Robot, batches: &[Batch], json: bool) -> Result<(), Failure> {
    for (number, batch) in batches.iter().enumerate() {
        let count = batch.instructions.len();
        let accepted = robot.add_rcc(batch.replace, batch.instructions.clone()).await.map_err(|error| {
            let failure = Failure::from(error);
            match number {
                0 => failure,
                _ => failure
                    .while_doing(format!(
                        "after {number} of {} frames had been accepted and run",
                        batches.len()
                    ))
                    .with_exit(Exit::Unknown),
            }
        })?;
        if json {
            output::json(&events::accepted(robot.address(), batch, accepted.after));
            continue;
        }
        let instructions = action::instructions(count);
        let how = if batch.replace { "the list replaced" } else { "appended to the list" };
        let milliseconds = accepted.after.as_secs_f64() * 1e3;
        output::line(format_args!("{instructions} accepted after {milliseconds:.1} ms, {how}"));
    }
    Ok(())
}

/// Waits until the arm stands and tells where it ended.
async fn follow(
    robot: &Robot,
    options: WaitOptions,
    target: Option<Target>,
    mut ending: Ending,
    json: bool,
) -> Result<Exit, Failure> {
    let done = tokio::select! {
        done = robot.wait_until_done(options) => done.map_err(Failure::from),
        never = show_progress(robot) => match never {},
        () = ending.signalled() => Err(
            Failure::unknown("no longer waiting; the arm goes on").advise("end the motion with `r6 stop`")
        ),
    };
    clear_progress();
    let done = done?;
    if json {
        output::json(&events::stands(robot.address(), &done));
    } else {
        report(&done);
    }
    match target.and_then(|target| target.missed(&done)) {
        None => Ok(Exit::Done),
        Some(missed @ Missed::Unread { .. }) => {
            Err(Failure::unknown(format!("the list was accepted and the arm stands, but {missed}"))
                .advise("look at the arm and at `r6 status`"))
        }
        Some(missed @ Missed::Elsewhere { .. }) => Err(Failure::refused(format!(
            "the list was accepted, but {missed}"
        ))
        .advise(
            "look at the arm and at `r6 status`; a curve wants a move before it, and masks leave axes out",
        )),
    }
}

fn report(done: &Done) {
    let seconds = done.took.as_secs_f64();
    let moved = if done.moved { "" } else { "; no motion was seen" };
    output::line(format_args!("done after {seconds:.2} s{moved}"));
    output::line(status::position_table(&done.axes, &done.pose));
}

/// Shows the axes on the terminal, over and over, until it is dropped.
async fn show_progress(robot: &Robot) -> std::convert::Infallible {
    let axes: Vec<_> = AxisIndex::ALL.into_iter().take(6).map(Address::Axis).collect();
    let mut ticks = tokio::time::interval(PROGRESS_INTERVAL);
    loop {
        ticks.tick().await;
        if !std::io::stderr().is_terminal() {
            std::future::pending::<()>().await;
        }
        // Whatever is wrong, the wait itself finds and reports it.
        let Ok(result) = robot.query(&axes).await else { continue };
        let cells: Vec<_> = AxisIndex::ALL
            .into_iter()
            .filter_map(|axis| Some(format!("{axis} {:9.3}", result.decimal(Address::Axis(axis))?)))
            .collect();
        eprint!("\r{}", cells.join("  "));
        let _ = std::io::stderr().flush();
    }
}

/// Takes what was shown on the present line of the terminal away.
pub fn clear_progress() {
    if std::io::stderr().is_terminal() {
        let line = crossterm::terminal::Clear(crossterm::terminal::ClearType::CurrentLine);
        let _ = crossterm::execute!(std::io::stderr(), line, crossterm::cursor::MoveToColumn(0));
    }
}
