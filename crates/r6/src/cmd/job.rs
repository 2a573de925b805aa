//! Sends instructions and follows them: the common part of `r6 move` and `r6 run`.
//!
//! `job/under_way.rs` runs the motion. `job/progress.rs` shows how far it is. `job/ended.rs` turns what ended
//! it into words and an exit code.
//!
//! Output goes through queues with a thread each (`output/queue.rs`), so a reader that does not read delays
//! nothing. The first failed write is a value: `job/under_way.rs` waits for it where a stop was promised, and
//! `output/ending.rs` turns it into an exit code. Failures become JSON in `output/problem.rs`.

mod empty;
mod ended;
mod events;
pub mod guard;
mod progress;
mod under_way;

use std::time::Duration;

use clap::Args;
use r6_client::{Motion, Robot, RunOptions, Unmet};

use crate::cmd::job::ended::Ended;
use crate::cmd::job::guard::GuardArgs;
use crate::exit::{Exit, Failure};
use crate::hint;
use crate::output::{self, status};
use crate::robot::{self, RobotArgs};
use crate::units;
use r6_program::MotionList;

/// What to do with instructions.
#[derive(Debug, Args)]
pub struct JobArgs {
    /// Append to the instruction list, which may be running; else the list is replaced
    #[arg(long)]
    pub append: bool,
    /// Wait until the state shows that the arm stands, then print where it ended
    #[arg(long)]
    pub wait: bool,
    /// How long --wait waits at most; after that nothing more is sent [default: to the end; with --append
    /// 60s]
    #[arg(long, value_name = "TIME", value_parser = units::duration, requires = "wait")]
    timeout: Option<Duration>,
    /// On Ctrl-C, after --timeout, or if stdout cannot be written: stop the arm, verify that it stands, and
    /// clear its list; else the arm finishes its list
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

impl JobArgs {
    /// Whether each thing that happens is printed as JSON.
    pub fn json(&self) -> bool {
        self.json
    }

    /// An option that was given and means nothing for a program that a gateway runs.
    pub fn not_for_gateways(&self) -> Option<&'static str> {
        match self {
            Self { append: true, .. } => Some("--append"),
            Self { timeout: Some(_), .. } => Some("--timeout"),
            Self { stop_on_interrupt: true, .. } => Some("--stop-on-interrupt"),
            Self { dry_run: true, .. } => Some("--dry-run"),
            Self { guard, .. } if guard.is_given() => Some("a limit (--guard, --max-speed, --max-axis-step)"),
            _ => None,
        }
    }
}

/// A motion and how it is sent.
#[derive(Debug)]
pub struct Job {
    /// The steps.
    pub motion: Motion,
    /// How the client sends them.
    pub options: RunOptions,
}

impl Job {
    /// A program that replaces the list and runs once is streamed. A program that is appended or repeats is
    /// sent at once, in the frames of its file or shorter ones.
    pub fn of(lists: Vec<MotionList>, options: RunOptions) -> Self {
        let append = lists.first().is_some_and(|list| !list.replace);
        if !append && !repeats(&lists) {
            let steps = lists.into_iter().flat_map(|list| list.instructions);
            return Self { motion: steps.collect(), options };
        }
        let motion = in_frames(lists);
        // The progress of such a list cannot be observed, so the client cannot decide whether the arm has to
        // be stopped.
        let options =
            RunOptions { append, frame_instructions: usize::MAX, stop_on_failure: false, ..options };
        Self { motion, options }
    }

    /// Whether all steps are sent at once, without waiting for the arm.
    fn is_whole(&self) -> bool {
        self.options.append || self.motion.repeats()
    }

    /// Checks that a motion that is sent at once fits into the list.
    fn has_room(&self) -> Result<(), Failure> {
        let (count, room) = (self.motion.len(), self.options.room);
        if !self.is_whole() || count <= room {
            return Ok(());
        }
        Err(if self.motion.repeats() {
            Failure::usage(format!(
                "a list that repeats stays in the controller as a whole, and {count} instructions are more than the {room} \
                 that are counted on to fit"
            ))
            .advise(format!(
                "run it once, as a stream, with --once; or, where this controller is known to take as many, say --room {count}"
            ))
        } else {
            Failure::usage(format!(
                "--append sends all instructions at once, and {count} are more than the {room} that are counted on to fit"
            ))
            .advise(format!(
                "append fewer at a time; or, where this controller is known to take as many, say --room {count}"
            ))
        })
    }
}

/// Checks the machine, sends the lists and, with `--wait`, waits until they are done.
pub async fn carry_out(
    args: &JobArgs,
    lists: Vec<MotionList>,
    options: RunOptions,
    robot: &RobotArgs,
) -> Result<Exit, Failure> {
    attempt(args, lists, options, robot).await.map_err(events::failed)
}

async fn attempt(
    args: &JobArgs,
    lists: Vec<MotionList>,
    options: RunOptions,
    robot: &RobotArgs,
) -> Result<Exit, Ended> {
    let envelope = args.guard.envelope()?;
    let job = Job::of(lists, options);
    if job.motion.is_empty() {
        let replace = !job.options.append;
        if args.dry_run {
            return Ok(empty::print(replace)?);
        }
        return robot.with(async |robot| Ok(empty::send(args, robot, replace).await)).await?;
    }
    job.has_room()?;
    let frames = job.motion.frames(&robot::settings(), job.options).map_err(Failure::usage)?;
    if let Some(envelope) = &envelope {
        envelope.check_motion(&job.motion).map_err(|violation| guard::beyond(&violation))?;
    }
    if args.dry_run {
        if job.motion.repeats() {
            output::note(repeats_until_stopped());
        }
        for frame in frames {
            output::line(String::from_utf8_lossy(&frame));
        }
        return Ok(Exit::Done);
    }
    let run = async |robot: &Robot| {
        Ok(under_way::run(args, robot, envelope, &job).await.map_err(|ended| ended.told_of(robot)))
    };
    robot.with(run).await?
}

/// The steps; each list begins a new frame.
pub fn in_frames(lists: Vec<MotionList>) -> Motion {
    lists
        .into_iter()
        .fold(Motion::new(), |motion, list| motion.begin_frame().extend(&Motion::of_list(list.instructions)))
}

/// Whether the list repeats without end: one of its instructions stays in it.
pub fn repeats(lists: &[MotionList]) -> bool {
    lists.iter().flat_map(|list| &list.instructions).any(|instruction| !instruction.oneshot)
}

/// Says that the list repeats until stopped, and how to stop it.
fn repeats_until_stopped() -> String {
    format!("this list repeats until stopped: {}", hint::r6("stop"))
}

/// Says which conditions are not met, and that nothing was sent.
fn not_ready(robot: &Robot, unmet: &[Unmet]) -> Ended {
    output::note(format_args!("r6: nothing was sent. {}", status::not_ready(unmet)));
    events::not_sent(robot.address(), unmet).into()
}

/// With `--stop-on-interrupt`, waits until stdout cannot be written. Without it, never returns.
async fn untold(args: &JobArgs) {
    if args.stop_on_interrupt { output::fails().await } else { std::future::pending().await }
}

/// Whether the arm has to be stopped because the last output could not be written.
fn is_untold(args: &JobArgs) -> bool {
    args.stop_on_interrupt && !output::is_written()
}

/// Prints the commands that end and follow the motion.
fn say_how_to_follow() {
    let watch = "watch isMoving RemoteCmdLen axis-0 axis-1 axis-2 axis-3 axis-4 axis-5";
    output::line(format_args!("end it with:    {}", hint::r6("stop")));
    output::line(format_args!("follow it with: {}", hint::r6(watch)));
}
