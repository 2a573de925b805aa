//! A stop that is passed on: to the owner of the robot, again and again until one has taken it. A second stop
//! does no harm.

use std::time::Duration;

use tokio::time::{Instant, sleep, timeout};

use super::super::{State, refusal};
use super::{Kind, LOOK, Outcome, PLACES, Response, is_another, outcome, place, told};
use crate::core::owner::Owned;
use crate::ownership::owners::Place;
use crate::peers::{Failed, Onward};
use crate::problem::Problem;
use r6_api::Code;
use r6_http::Refusal;

/// How long a stop tries while no owner can be reached: a takeover takes 5 s.
const NOBODY_FOR: Duration = Duration::from_secs(6);

/// How long it tries at most, as long as a stop at the owner itself.
const IN_ALL: Duration = Duration::from_secs(20);

/// After an owner that did nothing, it is tried again so soon: it may just be about to have the robot.
const AGAIN: Duration = Duration::from_millis(150);

/// Passes a stop on. `None`: this gateway owns the robot.
pub async fn stop(state: &State, owned: &Owned, onward: &Onward) -> Result<Option<Response>, Refusal> {
    let not_stopped = |why: &str| {
        let message =
            format!("it is NOT known that the arm of {} stands: {why}; use the emergency stop", told(owned));
        refusal::of(Problem::new(Code::NotStopped, message))
    };
    let begun = Instant::now();
    let Some(_place) = PLACES.stop(&onward.bearer.0, owned) else {
        return Err(not_stopped("too many stops of this robot are under way"));
    };
    let owners = &state.shared.owners;
    // When an owner had the stop last.
    let mut reached = begun;
    let mut why = "no gateway owns it".to_owned();
    // Whether an owner may have had the stop and gave no answer: then no refusal says that it was not sent.
    let mut may_be_sent = false;
    while reached.elapsed() < NOBODY_FOR && begun.elapsed() < IN_ALL {
        let number = match place(state, owned) {
            Place::Here => return Ok(None),
            Place::There(number) => number,
            Place::Nowhere => {
                sleep(LOOK).await;
                continue;
            }
        };
        let Some(_place) = PLACES.stop_to(number) else {
            "too many stops are on their way to its owner".clone_into(&mut why);
            sleep(LOOK).await;
            continue;
        };
        let sent = async {
            match owners.send(number, onward.clone()).await {
                Ok(answer) => outcome(answer, Kind { is_stop: true, is_head: false }).await,
                Err(Failed::NotSent(why)) => Outcome::Nothing(why),
                Err(Failed::Unknown(why)) => Outcome::Unknown(why),
            }
        };
        let sent = tokio::select! {
            biased;
            sent = timeout(IN_ALL.saturating_sub(begun.elapsed()), sent) => {
                sent.unwrap_or_else(|_| Outcome::Unknown(format!("its owner gave no answer within {IN_ALL:?}")))
            }
            changed = is_another(state, owned, number) => Outcome::Unknown(changed.to_owned()),
        };
        match sent {
            Outcome::Answer(answer) if may_be_sent && !answer.status().is_success() => {
                let why =
                    format!("one gateway gave no answer, and the next one refused: {}", answer.status());
                return Err(not_stopped(&why));
            }
            Outcome::Answer(answer) => return Ok(Some(answer)),
            Outcome::Nothing(failed) => why = failed,
            Outcome::Unknown(failed) => {
                (why, may_be_sent) = (failed, true);
                reached = Instant::now();
            }
        }
        sleep(AGAIN).await;
    }
    Err(not_stopped(&why))
}
