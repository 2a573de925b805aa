//! A command in the audit log: its intent is on the disk before it leaves, its outcome after.
//!
//! A request with an `Idempotency-Key` is sent once ([`Once`]). Its key is written with the intent, in one
//! transaction, and its answer with the outcome. So of two requests with one key, one finds the other there,
//! also if both come at the same time or the gateway was killed in between.

use r6_api::gateway::{AuditRecord, CommandDone, CommandOutcome, Deed, Happened};
use r6_api::{Code, Problem as ApiProblem};
use r6_client::Accepted;
use serde::{Deserialize, Serialize};

use super::Station;
use crate::fleet::station::By;
use crate::problem::Problem;
use crate::store::StoreError;
use crate::store::commands::{KEPT, KEPT_AT_LEAST, KeptCommand, MAX_KEYS, NewCommand, Noted};
use crate::{clock, traces};

/// A request that must not be carried out twice.
#[derive(Clone, Debug)]
pub struct Once {
    /// Who asks: a token or a user.
    pub caller: String,
    /// Its `Idempotency-Key`.
    pub key: String,
    /// SHA-256 of what it asks for.
    pub hash: [u8; 32],
}

/// The answer to a request, as the store keeps it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Answer {
    /// The controller accepted the command.
    Accepted(CommandDone),
    /// It did not, or that is not known.
    Failed(ApiProblem),
}

/// Whether a command stands in the audit log.
pub(in crate::fleet) enum Told {
    Yes,
    No,
}

/// What became of a command that was sent, or was not sent in the end.
type Carried<T> = Result<T, (CommandOutcome, Problem)>;

impl Station {
    /// The answer to a request for a command that came before; `None` if it did not.
    ///
    /// # Errors
    /// `key_taken`, `in_progress`, `outcome_unknown`, or the problem that was the answer;
    /// `store_unavailable`.
    pub async fn commanded_before(&self, once: &Once) -> Result<Option<CommandDone>, Problem> {
        let since = clock::seconds().saturating_sub(KEPT);
        let Once { caller, key, hash } = once.clone();
        let known = self.term.keeper.command_of_key(caller, key, since).await?;
        known.map(|known| again(known, hash)).transpose()
    }

    /// Sends something to the robot. Its intent is on the disk before `send` begins, its outcome after.
    /// Returns the number of the intent.
    pub(in crate::fleet) async fn recorded<T>(
        &self,
        by: &By,
        command: &str,
        lease: u64,
        send: impl Future<Output = Carried<T>>,
    ) -> Result<(u64, T), (Problem, Told)> {
        let intent = traces::part("write the intent", self.append(self.intent(by, command, lease))).await;
        let command_id = intent.map_err(|error| (error.into(), Told::No))?;
        let (answer, deed) = self.complete(by, command, command_id, send).await;
        let written = traces::part("write the outcome", self.append(self.record(by, deed.clone()))).await;
        let answer = match written {
            Ok(_) => answer,
            Err(_) => {
                // The robot has answered: the caller is told, and the log as soon as it can be written.
                self.note(by, deed);
                self.if_noted(command_id, answer).await
            }
        };
        let accepted = answer.map_err(|problem| (problem, Told::Yes))?;
        Ok((command_id, accepted))
    }

    /// The same for a request that must not be carried out twice. If it came before, `send` is not begun.
    pub(super) async fn recorded_once(
        &self,
        by: &By,
        command: String,
        lease: u64,
        once: &Once,
        send: impl Future<Output = Carried<Accepted>>,
    ) -> Result<CommandDone, (Problem, Told)> {
        let intent = self.begin_once(once, self.intent(by, &command, lease));
        let intent = traces::part("write the intent", intent).await;
        let command_id = match intent.map_err(|error| (error.into(), Told::No))? {
            Noted::New(number) => number,
            Noted::Known(known) => return again(known, once.hash).map_err(|problem| (problem, Told::Yes)),
            Noted::Full => {
                let message = format!(
                    "{MAX_KEYS} commands with an Idempotency-Key came in {KEPT_AT_LEAST} s: there is no room for more"
                );
                return Err((Problem::new(Code::Overloaded, message), Told::No));
            }
        };
        let (answer, deed) = self.complete(by, &command, command_id, send).await;
        let answer = answer.map(|Accepted { after, .. }| {
            let after_ms = clock::milliseconds(after);
            CommandDone { command_id: Some(command_id), sent: command, after_ms }
        });
        let kept = match &answer {
            Ok(done) => Answer::Accepted(done.clone()),
            Err(Problem { code, message, .. }) => Answer::Failed(ApiProblem::new(*code, message)),
        };
        let written = self.end_once(command_id, &kept, self.record(by, deed.clone()));
        let answer = match traces::part("write the outcome", written).await {
            Ok(()) => answer,
            Err(_) => {
                // As above. The same request is answered with `outcome_unknown` from then on.
                self.note(by, deed);
                self.if_noted(command_id, answer).await
            }
        };
        answer.map_err(|problem| (problem, Told::Yes))
    }

    /// The answer to a command whose outcome could not be written at once. With a store that others share,
    /// the next owner of the robot calls it unknown unless it is written in time: then the caller is told
    /// nothing else.
    async fn if_noted<T>(&self, command_id: u64, answer: Result<T, Problem>) -> Result<T, Problem> {
        if answer.is_err() || self.term.ownership.is_alone() || self.written_for_others().await.is_ok() {
            return answer;
        }
        let message = format!(
            "the robot accepted command {command_id}, and the database did not confirm in time that it has this: \
             the audit log may call the outcome unknown. Look at the robot"
        );
        Err(of_command(command_id, Problem::new(Code::OutcomeUnknown, message)))
    }

    fn intent(&self, by: &By, command: &str, lease: u64) -> AuditRecord {
        self.record(by, Deed::CommandIntent { command: command.to_owned(), lease })
    }

    /// Sends it, and tells what became of it, also for the audit log.
    async fn complete<T>(
        &self,
        by: &By,
        command: &str,
        command_id: u64,
        send: impl Future<Output = Carried<T>>,
    ) -> (Result<T, Problem>, Deed) {
        self.publish(Happened::CommandBegan { command_id, command: command.to_owned() });
        let answer = traces::part("send and wait for the reply", send).await;
        let (outcome, detail) = match &answer {
            Ok(_) => (CommandOutcome::Accepted, String::new()),
            Err((outcome, problem)) => (*outcome, problem.message.clone()),
        };
        tracing::info!(robot = self.name(), command_id, %command, ?outcome, by = %by.actor, "a command");
        self.counts.count_command(outcome);
        traces::note_outcome(Some(command_id), outcome.word(), outcome != CommandOutcome::Accepted);
        self.publish(Happened::CommandEnded { command_id, outcome });
        let deed = Deed::CommandOutcome { intent: command_id, outcome, detail };
        (answer.map_err(|(_, problem)| of_command(command_id, problem)), deed)
    }

    /// Writes key and intent, behind the records that wait.
    async fn begin_once(&self, once: &Once, intent: AuditRecord) -> Result<Noted, StoreError> {
        self.write_pending().await?;
        let Once { caller, key, hash } = once.clone();
        self.term.keeper.begin_command(NewCommand { caller, key, hash, now: clock::seconds(), intent }).await
    }

    /// Writes answer and outcome, behind the records that wait.
    async fn end_once(&self, intent: u64, answer: &Answer, outcome: AuditRecord) -> Result<(), StoreError> {
        let text =
            serde_json::to_string(answer).map_err(|error| StoreError::Unreadable(error.to_string()))?;
        self.write_pending().await?;
        self.term.keeper.end_command(intent, text, outcome).await
    }
}

/// The answer to a request that came before.
fn again(known: KeptCommand, hash: [u8; 32]) -> Result<CommandDone, Problem> {
    let KeptCommand { intent, hash: asked, answer, ended } = known;
    if asked != hash {
        let message = "this Idempotency-Key belongs to another request: draw a new one for each command";
        return Err(Problem::new(Code::KeyTaken, message));
    }
    match answer.as_deref().map(serde_json::from_str::<Answer>) {
        Some(Ok(Answer::Accepted(done))) => Ok(done),
        Some(Ok(Answer::Failed(ApiProblem { code, message, .. }))) => {
            Err(of_command(intent, Problem::new(code, message)))
        }
        None if !ended => {
            let message = format!("command {intent} of this request is under way");
            Err(of_command(intent, Problem::new(Code::InProgress, message)))
        }
        None | Some(Err(_)) => {
            let message =
                format!("what became of command {intent} of this request is not known: look at the robot");
            Err(of_command(intent, Problem::new(Code::OutcomeUnknown, message)))
        }
    }
}

/// The problem of the command with this number.
fn of_command(command_id: u64, problem: Problem) -> Problem {
    Problem { command_id: Some(command_id), ..problem }
}
