//! A motion under way: streamed as the controller has room, or sent as a whole. Nothing is sent twice.

use std::time::Duration;

use r6_client::{Cause, Done, EndProof, Envelope, MotionError, MotionHandle, Progress, Robot, WaitOptions};
use tokio::time::{sleep, timeout};

use crate::cmd::job::ended::{Ended, GivenUp};
use crate::cmd::job::progress::{TOLD_EVERY, Teller, show_progress};
use crate::cmd::job::{
    Job, JobArgs, events, is_untold, not_ready, repeats_until_stopped, say_how_to_follow, untold,
};
use crate::cmd::stop;
use crate::exit::{Exit, Failure};
use crate::hint;
use crate::output::problem::Code;
use crate::output::{self, status};
use crate::robot;
use crate::signals::Ending;
use crate::waiting;

/// Runs a motion: to its end with `--wait`, else until its last list is accepted.
pub async fn run(
    args: &JobArgs,
    robot: &Robot,
    envelope: Option<Envelope>,
    job: &Job,
) -> Result<Exit, Ended> {
    let Job { motion, options } = job;
    let lists = motion.lists(&robot::settings(), *options).map_err(Failure::usage)?;
    let guarded = envelope.map_or_else(|| robot.clone(), |envelope| robot.with_guard(envelope));
    // From here on the arm may move, so Ctrl-C must report that.
    let mut ending = Ending::watch()?;
    let looking = format!("waiting for an answer of {}", robot.address());
    let begun = tokio::select! {
        biased;
        () = ending.signalled() => {
            return Err(Failure::refused("interrupted; nothing was sent").with_code(Code::Interrupted).into());
        }
        begun = waiting::told(&looking, guarded.run(motion, *options)) => begun,
    };
    let handle = match begun {
        Ok(handle) => handle,
        Err(MotionError { cause: Cause::NotReady(unmet), .. }) => {
            return Err(not_ready(robot, &unmet));
        }
        Err(error) => {
            if !error.nothing_left() {
                output::acts();
            }
            return Err(error.into());
        }
    };
    output::acts();
    let is_long = motion.len() > options.room;
    if is_long && !args.json {
        output::line(format_args!(
            "streaming {}, at most {} of them in the controller's list; Ctrl-C sends no more",
            output::instructions(motion.len()),
            options.room
        ));
    }
    let mut teller = Teller::new(robot.address(), args.json, !is_long, job, lists);
    // A motion that is sent as a whole shows no progress, so r6 cannot see that it has stalled. It gets a
    // default timeout.
    let time = args.timeout.or_else(|| (args.wait && job.is_whole()).then(|| WaitOptions::default().timeout));
    let steps = (!job.is_whole()).then(|| handle.watch());
    let given_up = tokio::select! {
        biased;
        () = follow(&mut teller, &handle, args.wait) => None,
        () = ending.signalled() => Some(GivenUp::Interrupted),
        () = untold(args) => Some(GivenUp::Untold),
        after = time_is_up(time) => Some(GivenUp::TimedOut(after)),
        never = show_progress(robot, steps) => match never {},
    };
    output::clear_line();
    if let Some(why) = given_up {
        return Err(give_up(robot, handle, why, args.stop_on_interrupt).await);
    }
    if is_long && !args.json && !args.wait && !handle.progress().ended {
        say_lists(&teller, &handle.progress());
    }
    if args.wait || handle.progress().ended {
        // If the motion failed, the client is stopping the arm now.
        let done = waiting::told(stop::UNDER_WAY, handle.finished()).await?;
        if args.wait {
            stands(robot, &done, args.json);
            return Ok(Exit::Done);
        }
        if !args.json {
            say_how_to_follow();
        }
        return Ok(Exit::Done);
    }
    if !args.json {
        if motion.repeats() {
            output::line(repeats_until_stopped());
        }
        say_how_to_follow();
    }
    if is_untold(args) {
        return Err(give_up(robot, handle, GivenUp::Untold, true).await);
    }
    // The arm finishes what is in its list.
    handle.release().await;
    Ok(Exit::Done)
}

/// Reports progress until the motion has ended or, if `to_the_end` is false, until everything was accepted.
async fn follow(teller: &mut Teller<'_>, handle: &MotionHandle, to_the_end: bool) {
    let mut watch = handle.watch();
    loop {
        let progress = *watch.borrow_and_update();
        teller.see(progress);
        if progress.ended || !to_the_end && progress.accepted == progress.total {
            return;
        }
        // A change too soon after the last line is reported after this timeout.
        match timeout(TOLD_EVERY, watch.changed()).await {
            Ok(Ok(())) | Err(_) => {}
            // The task has ended; its handle knows why.
            Ok(Err(_)) => return,
        }
    }
}

async fn time_is_up(after: Option<Duration>) -> Duration {
    match after {
        Some(after) => {
            sleep(after).await;
            after
        }
        None => std::future::pending().await,
    }
}

/// Ends the streaming, stops the arm if `stop` is set, and says what the arm still does.
async fn give_up(robot: &Robot, handle: MotionHandle, why: GivenUp, stop: bool) -> Ended {
    if stop {
        let watch = handle.watch();
        let stop = waiting::told(stop::UNDER_WAY, handle.stop()).await;
        let progress = *watch.borrow();
        return Ended::given_up(why, Some(progress), stop);
    }
    let progress = handle.release().await;
    let length = robot.status().await.ok().and_then(|status| status.list_length);
    let advice = match why {
        GivenUp::Interrupted | GivenUp::Untold => {
            format!("the arm may finish its list: end the motion with `{}`", hint::r6("stop"))
        }
        GivenUp::TimedOut(_) => format!(
            "look with `{}`, end it with `{}`; --timeout waits longer",
            hint::r6("status"),
            hint::r6("stop")
        ),
    };
    let what = format!("{why}; the arm may go on moving: {}", what_goes_on(&progress, length));
    let failure = Failure::unknown(what).with_code(why.code()).advise(advice);
    Ended { progress: Some(progress), ..failure.into() }
}

/// What the arm still does when nothing more is sent. `length`: the length of the controller's list, if the
/// controller has it.
fn what_goes_on(progress: &Progress, length: Option<i64>) -> String {
    let Progress { total, left, accepted, done, .. } = *progress;
    let in_list = match length {
        Some(length) => format!("{length} in its list"),
        None => format!("at most {} in its list", progress.under_way()),
    };
    // A list that is shorter than before may have been cleared. So a step counts as done only if the motion
    // saw it.
    let mut text = format!("{done} of {total} steps seen to be done, {in_list}");
    if left > accepted {
        text += &format!(", {} sent and not answered", left - accepted);
    }
    if total > left {
        text += &format!(", {} never sent", total - left);
    }
    text
}

/// Says how much of a long motion the controller accepted.
fn say_lists(teller: &Teller<'_>, progress: &Progress) {
    let lists = output::counted(teller.accepted(), "list");
    let instructions = output::instructions(progress.accepted);
    let in_list = progress.under_way();
    output::line(format_args!("{instructions} accepted in {lists}; the arm finishes the last {in_list}"));
}

/// Says that the motion has ended, and what proves it.
fn ending(done: &Done) -> String {
    let seconds = done.took.as_secs_f64();
    match done.proof {
        EndProof::Reached => format!("done after {seconds:.2} s: the arm stands where the last move ends"),
        EndProof::Consumed => format!(
            "done after {seconds:.2} s: the controller worked through its list; where the last move ends cannot be compared"
        ),
        EndProof::CutShort(missed) => format!(
            "the last move was CUT SHORT after {seconds:.2} s: {missed}; an input that the program watches ends a move"
        ),
        EndProof::AtRest => {
            format!(
                "done after {seconds:.2} s: the arm stands and its list is empty, as far as the controller tells"
            )
        }
    }
}

/// Prints where the arm ended.
pub fn stands(robot: &Robot, done: &Done, json: bool) {
    if json {
        output::json(&events::stands(robot.address(), done));
        return;
    }
    let moved = if done.moved { "" } else { "; no motion was seen" };
    output::line(format_args!("{}{moved}", ending(done)));
    output::line(status::position_table(&done.axes, &done.pose));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_goes_on_is_told_by_the_length_of_the_list_where_there_is_one() {
        let progress = Progress { total: 500, left: 48, accepted: 40, done: 20, ended: true };
        assert_eq!(
            what_goes_on(&progress, Some(17)),
            "20 of 500 steps seen to be done, 17 in its list, 8 sent and not answered, 452 never sent"
        );
        assert_eq!(
            what_goes_on(&progress, None),
            "20 of 500 steps seen to be done, at most 28 in its list, 8 sent and not answered, 452 never sent"
        );
        // After a power cut, or when another client cleared it, the list is empty. That proves nothing.
        assert!(
            what_goes_on(&progress, Some(0)).starts_with("20 of 500 steps seen to be done, 0 in its list, ")
        );
        let last = Progress { total: 1, left: 1, accepted: 1, done: 0, ended: true };
        assert_eq!(what_goes_on(&last, Some(1)), "0 of 1 steps seen to be done, 1 in its list");
    }
}
