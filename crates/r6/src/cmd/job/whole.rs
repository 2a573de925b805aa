//! Lists that are sent all at once: those that repeat, and those that belong behind what runs.

use std::time::Duration;

use r6_client::{
    Done, EndProof, Envelope, Instruction, RequestError, Robot, Status, Unmet, WaitError, WaitOptions,
};
use r6_proto::message::Action;

use crate::cmd::job::ended::{Ended, GivenUp, elsewhere};
use crate::cmd::job::events::Accepted;
use crate::cmd::job::progress::show_progress;
use crate::cmd::job::streamed::stands;
use crate::cmd::job::target::{Course, End, Missed, Position, Target};
use crate::cmd::job::{JobArgs, guard, is_untold, not_ready, repeats, say_how_to_follow, untold};
use crate::exit::{Exit, Failure, after_a_part_left};
use crate::hint;
use crate::output;
use crate::output::problem::Code;
use crate::signals::Ending;
use r6::program_file::{Batch, cut};

/// How soon after the answer a motion without delay is seen: controllers answer within 26 ms and start at once.
const START_WITHIN: Duration = Duration::from_secs(1);

/// Checks a list, and cuts it into frames.
pub fn prepare(batches: Vec<Batch>, envelope: Option<&Envelope>, room: usize) -> Result<Vec<Batch>, Failure> {
    let steps: Vec<_> = batches.iter().flat_map(|batch| batch.instructions.iter().copied()).collect();
    let (count, repeats) = (steps.len(), repeats(&batches));
    if let Some(envelope) = envelope {
        guard::check(envelope, &steps, repeats).map_err(|violation| guard::beyond(&violation))?;
    }
    if repeats && count > room {
        return Err(Failure::usage(format!(
            "a list that repeats stays in the controller as a whole, and {count} instructions are more than the {room} \
             that are counted on to fit"
        ))
        .advise(format!(
            "run it once, as a stream, with --once; or, where this controller is known to take as many, say --room {count}"
        )));
    }
    if count > room {
        return Err(Failure::usage(format!(
            "--append sends all instructions at once, and {count} are more than the {room} that are counted on to fit"
        ))
        .advise(format!(
            "append fewer at a time; or, where this controller is known to take as many, say --room {count}"
        )));
    }
    cut(batches).map_err(Failure::usage)
}

/// Prints the frames that would be sent.
pub fn print_frames(batches: &[Batch]) -> Result<Exit, Failure> {
    if repeats(batches) {
        output::note(format_args!("this list repeats until stopped: {}", hint::r6("stop")));
    }
    for (number, batch) in batches.iter().enumerate() {
        let frame = batch.encode(&(number + 1).to_string()).map_err(Failure::usage)?;
        output::line(String::from_utf8_lossy(&frame));
    }
    Ok(Exit::Done)
}

/// Sends the frames and, with `--wait`, waits until they are done.
pub async fn run(
    args: &JobArgs,
    robot: &Robot,
    batches: &[Batch],
    envelope: Option<Envelope>,
) -> Result<Exit, Ended> {
    let appends = batches.first().is_some_and(|batch| !batch.replace);
    let state = robot.status().await.map_err(Failure::from)?;
    // Appending to a list that runs is what appending is for.
    let unmet: Vec<_> = state.unmet().into_iter().filter(|unmet| !(appends && is_running(unmet))).collect();
    if !unmet.is_empty() {
        return Err(not_ready(robot, &unmet));
    }
    // From here on the arm may move, and Ctrl-C has to say so.
    let mut ending = Ending::watch()?;
    tokio::select! {
        biased;
        sent = send(robot, batches, envelope, args.json) => sent?,
        () = ending.signalled() => return Err(interrupted(args, robot, "it is not known which lists were accepted").await),
    }
    if args.wait {
        let instructions: Vec<_> = batches.iter().flat_map(|batch| &batch.instructions).collect();
        let usual = WaitOptions::default();
        let options = WaitOptions {
            timeout: args.timeout.unwrap_or(usual.timeout),
            start_within: START_WITHIN + lead_time(&instructions),
            ..usual
        };
        return follow(args, robot, options, &Course::of(instructions), &state, ending).await;
    }
    if !args.json {
        if repeats(batches) {
            output::line(format_args!("this list repeats until stopped: {}", hint::r6("stop")));
        }
        say_how_to_follow();
    }
    if is_untold(args) {
        return Err(Ended::given_up(GivenUp::Untold, None, robot.stop().await));
    }
    Ok(Exit::Done)
}

/// Somebody pressed Ctrl-C after something left: stops the arm if that is wished.
async fn interrupted(args: &JobArgs, robot: &Robot, what: &str) -> Ended {
    if args.stop_on_interrupt {
        return Ended::given_up(GivenUp::Interrupted, None, robot.stop().await);
    }
    Failure::unknown(format!("{}; {what}, and the arm may go on moving", GivenUp::Interrupted))
        .with_code(GivenUp::Interrupted.code())
        .advise(format!("end the motion with `{}`", hint::r6("stop")))
        .into()
}

fn is_running(unmet: &Unmet) -> bool {
    match unmet {
        Unmet::Moving | Unmet::LeftoverList { .. } => true,
        Unmet::Mode { .. } | Unmet::Alarm { .. } | Unmet::NotHomed | Unmet::Unknown { .. } => false,
    }
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

async fn send(
    robot: &Robot,
    batches: &[Batch],
    envelope: Option<Envelope>,
    json: bool,
) -> Result<(), Failure> {
    // The way to the first target is held against the envelope here; what follows was, before anything left.
    let guarded = envelope.map_or_else(|| robot.clone(), |envelope| robot.with_guard(envelope));
    for (number, batch) in batches.iter().enumerate() {
        let robot = if number == 0 { &guarded } else { robot };
        let accepted = robot.add_rcc(batch.replace, batch.instructions.clone()).await.map_err(|error| {
            let some = format!("after {number} of {} frames had been accepted and run", batches.len());
            match (number, &error) {
                (0, _) => Failure::from(error),
                (_, RequestError::NotSent(_)) => after_a_part_left(&some, &error),
                (
                    _,
                    RequestError::Invalid(_) | RequestError::Refused(_) | RequestError::OutcomeUnknown(_),
                ) => Failure::from(error)
                    .while_doing(some)
                    .with_exit(Exit::Unknown)
                    .with_code(Code::OutcomeUnknown),
            }
        })?;
        output::acts();
        let accepted = Accepted {
            instructions: batch.instructions.len(),
            replaced_list: batch.replace,
            repeats: repeats(std::slice::from_ref(batch)),
            after: accepted.after,
        };
        if json {
            output::json(&accepted.whole(robot.address()));
        } else {
            accepted.say();
        }
    }
    Ok(())
}

/// Waits until the arm stands and tells where it ended.
async fn follow(
    args: &JobArgs,
    robot: &Robot,
    options: WaitOptions,
    course: &Course,
    before: &Status,
    mut ending: Ending,
) -> Result<Exit, Ended> {
    let waited = tokio::select! {
        waited = robot.wait_until_done(options) => Ok(waited),
        never = show_progress(robot, None) => match never {},
        () = ending.signalled() => Err(GivenUp::Interrupted),
        () = untold(args) => Err(GivenUp::Untold),
    };
    output::clear_line();
    let (why, failure) = match waited {
        Ok(Ok(done)) => {
            let done = Done { proof: proof(course, before, &done)?, ..done };
            stands(robot, &done, args.json);
            return Ok(Exit::Done);
        }
        Ok(Err(error @ WaitError::TimedOut { after, .. })) => {
            (GivenUp::TimedOut(after), Failure::from(error))
        }
        Ok(Err(error)) => return Err(Failure::from(error).into()),
        Err(why) => (
            why,
            Failure::unknown("no longer waiting; the arm may go on")
                .with_code(why.code())
                .advise(format!("end the motion with `{}`", hint::r6("stop"))),
        ),
    };
    if args.stop_on_interrupt {
        return Err(Ended::given_up(why, None, robot.stop().await));
    }
    Err(failure.into())
}

/// What proves that the list was carried out. That it was accepted does not, and an empty list does not either: controllers drop
/// instructions that they answered with ok, and somebody else may have cleared the list. What is in the list besides is not known
/// here, so that nobody can tell by its length how far this one is.
fn proof(course: &Course, before: &Status, done: &Done) -> Result<EndProof, Failure> {
    let place = Position::from(done);
    match course.end() {
        None => Ok(EndProof::AtRest),
        Some(End::Unknown) => {
            Err(unproved("where its last move ends cannot be compared with where the arm stands"))
        }
        Some(End::At(target)) => match target.missed(&place) {
            None if was_gone(course, &target, before, done) => Ok(EndProof::Reached),
            None => Err(unproved(
                "the arm stands at its end, where it was before, and nothing shows that this list moved it",
            )),
            Some(missed @ Missed::Unread { .. }) => {
                Err(Failure::unknown(format!("the list was accepted and the arm stands, but {missed}"))
                    .advise(format!("look at the arm and at `{}`", hint::r6("status"))))
            }
            Some(missed @ Missed::Elsewhere { .. }) if course.is_watched() => {
                Err(unproved(format!("{missed}; the input that it watches may have cut the move short")))
            }
            Some(missed @ Missed::Elsewhere { .. }) => {
                Err(Failure::refused(format!("the list was accepted, but {missed}"))
                    .with_code(Code::NotAtTarget)
                    .advise(elsewhere()))
            }
        },
    }
}

/// Whether an arm at the end of the list must have gone there: it was elsewhere before, or was seen to move, or no step leads away.
fn was_gone(course: &Course, target: &Target, before: &Status, done: &Done) -> bool {
    // What moves an arm that was moving may be what was in the list before.
    let stood = before.moving == Some(false) && before.list_length.is_none_or(|length| length == 0);
    let was_elsewhere = matches!(target.missed(&Position::from(before)), Some(Missed::Elsewhere { .. }));
    was_elsewhere || stood && done.moved || !course.leads_away_from(&Position::from(done))
}

fn unproved(why: impl std::fmt::Display) -> Failure {
    Failure::unknown(format!("the list was accepted, but nothing proves that it was carried out: {why}"))
        .advise(format!(
            "look at the arm and at `{}`; without --append it is seen how far a list is",
            hint::r6("status")
        ))
}
