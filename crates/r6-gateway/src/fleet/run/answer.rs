//! The answer to a request for a run, which the same request gets again.

use r6_api::gateway::Run;
use r6_api::{Code, Problem as ApiProblem};
use serde::{Deserialize, Serialize};

use super::Station;
use crate::clock;
use crate::problem::Problem;
use crate::store::runs::{KEPT, KeptRun};
use crate::store::{Keeper, StoreError};

/// The answer, as the store keeps it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Answer {
    /// The controller accepted the first list.
    Began(Box<Run>),
    /// It did not.
    Refused(ApiProblem),
}

impl Station {
    /// The answer to a request that came before; `None` if it did not.
    ///
    /// # Errors
    /// `key_taken`, `in_progress`, `outcome_unknown`, or the problem that was the answer;
    /// `store_unavailable`.
    pub async fn answered_before(
        &self,
        caller: &str,
        key: &str,
        hash: [u8; 32],
    ) -> Result<Option<Run>, Problem> {
        let since = clock::seconds().saturating_sub(KEPT);
        let known = self.term.keeper.run_of_key(caller.to_owned(), key.to_owned(), since).await?;
        known.map(|known| again(known, hash)).transpose()
    }
}

/// Keeps the answer: the run, or its number and the problem.
pub(super) async fn keep_answer(
    keeper: &Keeper,
    answer: &Result<Run, (u64, Problem)>,
) -> Result<(), StoreError> {
    let (run_id, answer) = match answer {
        Ok(run) => (run.run_id, Answer::Began(Box::new(run.clone()))),
        Err((run_id, Problem { code, message, .. })) => {
            (*run_id, Answer::Refused(ApiProblem::new(*code, message)))
        }
    };
    let text = serde_json::to_string(&answer).map_err(|error| StoreError::Unreadable(error.to_string()))?;
    keeper.answer_run(run_id, text).await
}

/// The answer to a request that came before.
pub(super) fn again(known: KeptRun, hash: [u8; 32]) -> Result<Run, Problem> {
    let run_id = known.run.run_id;
    if known.hash != hash {
        let message = "this Idempotency-Key belongs to another request: draw a new one for each run";
        return Err(Problem::new(Code::KeyTaken, message));
    }
    match known.answer.as_deref().map(serde_json::from_str::<Answer>) {
        Some(Ok(Answer::Began(run))) => Ok(*run),
        Some(Ok(Answer::Refused(ApiProblem { code, message, .. }))) => Err(Problem::new(code, message)),
        None if !known.ended => {
            Err(Problem::new(Code::InProgress, format!("run {run_id} of this request is just beginning")))
        }
        None | Some(Err(_)) => {
            let message =
                format!("what became of run {run_id} of this request is not known: look at the robot");
            Err(Problem::new(Code::OutcomeUnknown, message))
        }
    }
}
