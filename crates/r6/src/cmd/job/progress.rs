//! Shows the progress of a running motion: lines for programs, one line that is overwritten for people.

use std::convert::Infallible;
use std::io::IsTerminal;
use std::ops::Range;
use std::time::Duration;

use r6_client::{Progress, Robot};
use r6_proto::{Address, AxisIndex};
use tokio::sync::watch;
use tokio::time::Instant;

use crate::cmd::job::Job;
use crate::cmd::job::events::{self, Accepted};
use crate::output;

/// How often the progress on the terminal is refreshed: fast enough for eyes, with few queries.
const REFRESH_EVERY: Duration = Duration::from_millis(100);

/// A motion shorter than this shows no progress on the terminal.
const SHOWN_AFTER: Duration = Duration::from_secs(1);

/// The least time between two lines of progress for programs. Two lines a second are enough, and hours of
/// them are a few megabytes.
pub const TOLD_EVERY: Duration = Duration::from_millis(500);

/// Reports the progress of a motion.
#[derive(Debug)]
pub struct Teller<'r> {
    robot: &'r str,
    json: bool,
    /// Whether people get a line for each list.
    each_list: bool,
    job: &'r Job,
    /// The lists of the motion, and how many of them the controller accepted.
    lists: Vec<Range<usize>>,
    accepted: usize,
    seen: Progress,
    /// When something was last sent or answered.
    since: Instant,
    /// When the progress was last reported, and the number of steps done at that time.
    told: (Instant, usize),
}

impl<'r> Teller<'r> {
    /// A teller for a motion that has just begun.
    pub fn new(robot: &'r str, json: bool, each_list: bool, job: &'r Job, lists: Vec<Range<usize>>) -> Self {
        let now = Instant::now();
        let seen = Progress::default();
        Self { robot, json, each_list, job, lists, accepted: 0, seen, since: now, told: (now, 0) }
    }

    /// How many lists were accepted.
    pub fn accepted(&self) -> usize {
        self.accepted
    }

    /// Records the present progress of the motion and reports what changed.
    pub fn see(&mut self, progress: Progress) {
        let after = self.since.elapsed();
        if progress.left > self.seen.left || progress.accepted > self.seen.accepted {
            self.since = Instant::now();
        }
        while let Some(list) = self.lists.get(self.accepted).filter(|list| list.end <= progress.accepted) {
            self.tell_accepted(list, &progress, after);
            self.accepted += 1;
        }
        let (told_at, told) = self.told;
        if self.json && progress.done > told && told_at.elapsed() >= TOLD_EVERY {
            self.told = (Instant::now(), progress.done);
            output::passing_json(&events::progress(self.robot, &progress));
        }
        self.seen = progress;
    }

    fn tell_accepted(&self, list: &Range<usize>, progress: &Progress, after: Duration) {
        let steps = self.job.motion.instructions().unwrap_or_default();
        let listed = steps.get(list.clone()).unwrap_or_default();
        let accepted = Accepted {
            instructions: list.len(),
            replaced_list: list.start == 0 && !self.job.options.append,
            repeats: listed.iter().any(|step| !step.oneshot),
            after,
        };
        if self.json && self.job.is_whole() {
            output::json(&accepted.whole(self.robot));
        } else if self.json {
            output::passing_json(&accepted.streamed(self.robot, list.end, progress));
        } else if self.each_list {
            output::clear_line();
            accepted.say();
        }
    }
}

impl Accepted {
    /// Prints a line for people.
    pub fn say(&self) {
        let instructions = output::instructions(self.instructions);
        let how = if self.replaced_list { "the list replaced" } else { "appended to the list" };
        let milliseconds = self.after.as_secs_f64() * 1e3;
        output::line(format_args!("{instructions} accepted after {milliseconds:.1} ms, {how}"));
    }
}

/// Shows the axes on the terminal until it is dropped, and the number of steps done if that is known.
pub async fn show_progress(robot: &Robot, progress: Option<watch::Receiver<Progress>>) -> Infallible {
    if !std::io::stderr().is_terminal() {
        std::future::pending::<()>().await;
    }
    let axes: Vec<_> = AxisIndex::ALL.into_iter().take(6).map(Address::Axis).collect();
    let mut ticks = tokio::time::interval_at(Instant::now() + SHOWN_AFTER, REFRESH_EVERY);
    loop {
        ticks.tick().await;
        // The wait itself finds and reports errors.
        let Ok(result) = robot.query(&axes).await else { continue };
        let steps = progress.as_ref().map(|progress| {
            let Progress { done, total, .. } = *progress.borrow();
            format!("{done}/{total} steps")
        });
        let axes = AxisIndex::ALL
            .into_iter()
            .filter_map(|axis| Some(format!("{axis} {:9.3}", result.decimal(Address::Axis(axis))?)));
        let cells: Vec<_> = steps.into_iter().chain(axes).collect();
        output::rewrite_line(cells.join("  "));
    }
}
