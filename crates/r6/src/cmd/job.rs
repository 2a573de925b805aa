//! Sends instructions and follows them: what `r6 move` and `r6 run` have in common.

mod ended;
mod events;
mod guard;
mod progress;
mod streamed;
pub mod target;
mod whole;

use std::time::Duration;

use clap::Args;
use r6_client::{Envelope, Motion, Robot, RunOptions, Unmet};

use crate::cmd::job::ended::Ended;
use crate::cmd::job::guard::GuardArgs;
use crate::exit::{Exit, Failure};
use crate::hint;
use crate::output::{self, status};
use crate::robot::{self, RobotArgs};
use crate::units;
use r6::program_file::Batch;

/// What to do with instructions.
#[derive(Debug, Args)]
pub struct JobArgs {
    /// Append to the instruction list, which may be running; else the list is replaced
    #[arg(long)]
    pub append: bool,
    /// Wait until the arm stands, judged by its state, and print where it ended
    #[arg(long)]
    pub wait: bool,
    /// How long --wait waits at most; nothing more is sent then [default: to the end; with --append 60s]
    #[arg(long, value_name = "TIME", value_parser = units::duration, requires = "wait")]
    timeout: Option<Duration>,
    /// Stop the arm, verified, and clear its list on Ctrl-C, after --timeout, or if stdout cannot be written; else it
    /// finishes its list
    #[arg(long)]
    stop_on_interrupt: bool,
    #[command(flatten)]
    guard: GuardArgs,
    /// Print the frames that would be sent; no robot is asked
    #[arg(long, conflicts_with = "wait")]
    dry_run: bool,
    /// Print one JSON object for each thing that happens, the outcome last
    #[arg(long)]
    json: bool,
}

/// How instructions get to the controller.
#[derive(Debug)]
enum Job {
    /// Each runs once, in a list of its own: as the controller has room.
    Streamed(Motion),
    /// They repeat, or belong behind what is in the list: all at once.
    Whole(Vec<Batch>),
}

impl Job {
    fn of(batches: Vec<Batch>) -> Self {
        let replaces = batches.first().is_some_and(|batch| batch.replace);
        let is_empty = batches.iter().all(|batch| batch.instructions.is_empty());
        if replaces && !is_empty && !repeats(&batches) {
            Self::Streamed(batches.into_iter().flat_map(|batch| batch.instructions).collect())
        } else {
            Self::Whole(batches)
        }
    }
}

/// Checks the machine, sends the batches and, if so asked, waits until they are done.
pub async fn carry_out(
    args: &JobArgs,
    batches: Vec<Batch>,
    options: RunOptions,
    robot: &RobotArgs,
) -> Result<Exit, Failure> {
    attempt(args, batches, options, robot).await.map_err(events::failed)
}

async fn attempt(
    args: &JobArgs,
    batches: Vec<Batch>,
    options: RunOptions,
    robot: &RobotArgs,
) -> Result<Exit, Ended> {
    let envelope = args.guard.envelope()?;
    match Job::of(batches) {
        Job::Streamed(motion) => {
            if args.dry_run {
                return Ok(print_motion(&motion, envelope.as_ref(), options)?);
            }
            robot
                .with(async |robot| {
                    Ok(streamed::run(args, robot, &motion, envelope, options)
                        .await
                        .map_err(|ended| ended.told_of(robot)))
                })
                .await?
        }
        Job::Whole(batches) => {
            let batches = whole::prepare(batches, envelope.as_ref(), options.room)?;
            if args.dry_run {
                return Ok(whole::print_frames(&batches)?);
            }
            robot
                .with(async |robot| {
                    Ok(whole::run(args, robot, &batches, envelope)
                        .await
                        .map_err(|ended| ended.told_of(robot)))
                })
                .await?
        }
    }
}

/// Whether the list never ends: one of its instructions stays in it.
pub fn repeats(batches: &[Batch]) -> bool {
    batches.iter().flat_map(|batch| &batch.instructions).any(|instruction| !instruction.oneshot)
}

fn print_motion(motion: &Motion, envelope: Option<&Envelope>, options: RunOptions) -> Result<Exit, Failure> {
    let frames = motion.frames(&robot::settings(), options).map_err(Failure::usage)?;
    if let Some(envelope) = envelope {
        envelope.check_motion(motion).map_err(|violation| guard::beyond(&violation))?;
    }
    for frame in frames {
        output::line(String::from_utf8_lossy(&frame));
    }
    Ok(Exit::Done)
}

/// Says what is not met, and that nothing was sent.
fn not_ready(robot: &Robot, unmet: &[Unmet]) -> Ended {
    output::note(format_args!("r6: nothing was sent. {}", status::not_ready(unmet)));
    events::not_sent(robot.address(), unmet).into()
}

/// Waits until stdout cannot be written, where the arm has to be stopped then: for ever, where it has not.
async fn untold(args: &JobArgs) {
    if args.stop_on_interrupt { output::fails().await } else { std::future::pending().await }
}

/// Whether the arm has to be stopped because what was said last could not be written.
fn is_untold(args: &JobArgs) -> bool {
    args.stop_on_interrupt && !output::is_written()
}

/// How to go on from here.
fn say_how_to_follow() {
    let watch = "watch isMoving RemoteCmdLen axis-0 axis-1 axis-2 axis-3 axis-4 axis-5";
    output::line(format_args!("end it with:    {}", hint::r6("stop")));
    output::line(format_args!("follow it with: {}", hint::r6(watch)));
}
