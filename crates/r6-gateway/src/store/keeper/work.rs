//! What the thread of the store does. Appends that wait at the same time share one commit.

use tokio::sync::mpsc::Receiver;

use super::append::{Append, append};
use super::{Answer, Asked, Job};
use crate::store::{Store, StoreError};

/// Does the jobs until the last handle is gone, or [`Job::End`].
pub(super) fn keep(mut store: impl Store, mut waiting: Receiver<Asked>) {
    let mut next = None;
    loop {
        let job = next.take().or_else(|| waiting.try_recv().ok());
        let job = job.or_else(|| {
            // The callers have their answers: only the next job waits for this.
            settle(&mut store);
            waiting.blocking_recv()
        });
        let Some(job) = job else { return };
        match job {
            (_, Job::End(answer)) => return end(store, answer),
            job => next = carry_out(&mut store, job, &mut waiting),
        }
    }
}

/// As [`keep`], in a task. Each job takes `takes` before it is done at once.
#[cfg(feature = "simulation")]
pub(super) async fn keep_in_task(
    mut store: impl Store,
    takes: impl Fn() -> std::time::Duration,
    mut waiting: Receiver<Asked>,
) {
    let mut next = None;
    loop {
        let mut job = next.take().or_else(|| waiting.try_recv().ok());
        if job.is_none() {
            settle(&mut store);
            job = waiting.recv().await;
        }
        match job {
            None => return,
            Some((_, Job::End(answer))) => return end(store, answer),
            Some(job) => {
                tokio::time::sleep(takes()).await;
                next = carry_out(&mut store, job, &mut waiting);
            }
        }
    }
}

/// Makes outcomes durable. After a failure the next write finds a way or fails, so this fills no log.
fn settle(store: &mut impl Store) {
    if let Err(error) = store.settle() {
        tracing::error!(%error, "after a power cut, the outcomes of the last commands may be missing");
    }
}

/// Closes the store before the caller goes on, who may end the process.
fn end(mut store: impl Store, answer: Answer<()>) {
    settle(&mut store);
    drop(store);
    drop(answer.send(Ok(())));
}

/// Does a job, and for appends those right behind it. Returns the first job that was taken and is not done.
fn carry_out(store: &mut impl Store, (claim, job): Asked, waiting: &mut Receiver<Asked>) -> Option<Asked> {
    store.hold(claim.as_slice());
    // An outcome is on the disk before others can read it, and before other jobs go on. An intent that
    // follows is synchronised together with what stands before it.
    if !matches!(job, Job::Append(..) | Job::BeginCommand(..) | Job::EndCommand(..)) {
        settle(store);
    }
    // A caller that has gone needs no answer.
    match job {
        Job::Append(records, answer) => {
            return append(store, Append { claim, records, answer }, waiting);
        }
        Job::Entries(after, most, answer) => drop(answer.send(store.entries(after, most))),
        Job::Ends(answer) => drop(answer.send(store.ends())),
        Job::Heads(answer) => drop(answer.send(store.heads())),
        Job::PutHead(note, answer) => drop(answer.send(store.put_head(&note))),
        Job::Cut(until, note, answer) => drop(answer.send(store.cut(until, &note))),
        Job::Tokens(answer) => drop(answer.send(store.tokens())),
        Job::AddToken(token, author, answer) => drop(answer.send(store.add_token(&token, &author))),
        Job::RevokeToken(number, by, answer) => drop(answer.send(store.revoke_token(number, &by))),
        Job::Users(answer) => drop(answer.send(store.users())),
        Job::ChangeUser(change, by, answer) => drop(answer.send(store.change_user(&change, &by))),
        Job::PutLink(link, author, answer) => drop(answer.send(store.put_link(&link, &author))),
        Job::Link(hash, now, answer) => drop(answer.send(store.link(&hash, now))),
        Job::Seat(robot, answer) => drop(answer.send(store.seat(&robot))),
        Job::Alarms(robot, answer) => drop(answer.send(store.alarms(&robot))),
        Job::SaveAlarms(robot, saved, records, answer) => {
            drop(answer.send(store.save_alarms(&robot, &saved, &records)));
        }
        Job::Settings(answer) => drop(answer.send(store.settings())),
        Job::PutSettings(new, record, answer) => drop(answer.send(store.put_settings(&new, &record))),
        Job::PutRobot(robot, record, answer) => drop(answer.send(store.put_robot(&robot, &record))),
        Job::RemoveRobot(name, records, answer) => {
            drop(answer.send(store.remove_robot(&name, &records)));
        }
        Job::SaveSeat(robot, saved, answer) => drop(answer.send(store.save_seat(&robot, &saved))),
        Job::Programs(answer) => drop(answer.send(store.programs())),
        Job::ProgramVersions(name, answer) => drop(answer.send(store.program_versions(&name))),
        Job::Program(name, version, answer) => drop(answer.send(store.program(&name, version))),
        Job::PutProgram(new, condition, answer) => {
            drop(answer.send(store.put_program(&new, &condition)));
        }
        Job::RemoveProgram(name, condition, by, answer) => {
            drop(answer.send(store.remove_program(&name, &condition, &by)));
        }
        Job::BeginRun(new, answer) => drop(answer.send(store.begin_run(&new))),
        Job::RunOfKey(caller, key, since, answer) => {
            drop(answer.send(store.run_of_key(&caller, &key, since)));
        }
        Job::Run(robot, id, answer) => drop(answer.send(store.run(&robot, id))),
        Job::AnswerRun(id, text, answer) => drop(answer.send(store.answer_run(id, &text))),
        Job::EndRun(run, owed, records, answer) => {
            drop(answer.send(store.end_run(&run, owed, &records)));
        }
        Job::OwedStops(answer) => drop(answer.send(store.owed_stops())),
        Job::ForgetOwedStop(robot, answer) => drop(answer.send(store.forget_owed_stop(&robot))),
        Job::BeginCommand(new, answer) => drop(answer.send(store.begin_command(&new))),
        Job::CommandOfKey(caller, key, since, answer) => {
            drop(answer.send(store.command_of_key(&caller, &key, since)));
        }
        Job::EndCommand(intent, text, record, answer) => {
            drop(answer.send(store.end_command(intent, &text, &record)));
        }
        Job::Work(work) => work(store),
        // The callers of this function end with this job.
        Job::End(answer) => drop(answer.send(Err(StoreError::Closed))),
    }
    None
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;
    use std::time::Duration;

    use r6_api::gateway::{AuditRecord, Deed};

    use crate::store::{Keeper, Memory};

    #[tokio::test]
    async fn a_write_is_answered_first_and_then_settled_before_it_is_read() {
        let ((began, begins), (ends, may_end)) = (mpsc::channel(), mpsc::channel());
        let keeper = Keeper::start(Memory::with_gate((began, may_end))).unwrap();
        let settled = |what: &str| {
            begins.recv_timeout(Duration::from_secs(5)).unwrap_or_else(|_| panic!("{what}"));
        };
        settled("at the start nothing waits");
        ends.send(()).unwrap();
        let record = AuditRecord {
            time: "2026-01-01T00:00:00.000000Z".to_owned(),
            actor: "token 1".to_owned(),
            source: None,
            robot: None,
            deed: Deed::GatewayStarted { url: None },
        };
        // The answer is here, and the store is still being settled.
        let patience = Duration::from_secs(5);
        let answer = tokio::time::timeout(patience, keeper.append(vec![record])).await;
        assert_eq!(answer.expect("it does not wait for that"), Ok(1));
        settled("nothing waits");
        // A reader waits for that.
        let reader = keeper.entries(0, 10);
        let early = tokio::time::timeout(Duration::from_millis(50), reader).await;
        assert!(early.is_err());
        // Once for the idle turn, and once for each reader.
        (0..4).for_each(|_| ends.send(()).unwrap());
        assert_eq!(keeper.entries(0, 10).await.unwrap().len(), 1);
        settled("the first reader");
        settled("the second reader, or an idle turn");
    }
}
