//! What each gateway tells of its own robots, for an answer about the robots of all.

use std::collections::BTreeSet;
use std::time::Duration;

use futures_util::future::try_join_all;
use r6_api::Code;
use r6_http::Refusal;
use serde::de::DeserializeOwned;
use tokio::time::timeout;

use super::super::caller::Caller;
use super::super::{State, refusal};
use super::PLACES;
use crate::core::owner::Owned;
use crate::ownership::owners::Place;
use crate::peers::{asks, read};
use crate::problem::Problem;

/// How long an answer may take. A reader waits for the slowest gateway.
const ANSWER_WITHIN: Duration = Duration::from_secs(2);

/// What the other gateways that own robots of this caller answer to this, each for its own robots. A gateway
/// that asks gets nothing: it asks the others itself.
///
/// # Errors
/// `no_owner`: one of them does not answer. `overloaded`.
pub async fn gather<T: DeserializeOwned>(
    caller: &Caller,
    state: &State,
    target: &str,
) -> Result<Vec<T>, Refusal> {
    let owners = &state.shared.owners;
    if caller.is_gateway() {
        return Ok(Vec::new());
    }
    let seen = owners.robots().into_iter().filter(|robot| caller.grant().covers(robot.name.as_str()));
    let gateways: BTreeSet<_> = seen
        .filter_map(|robot| match owners.place(&Owned::Robot(robot.name)) {
            Place::There(number) => Some(number),
            Place::Here | Place::Nowhere => None,
        })
        .collect();
    try_join_all(gateways.into_iter().map(|number| one(caller, state, number, target))).await
}

async fn one<T: DeserializeOwned>(
    caller: &Caller,
    state: &State,
    number: u64,
    target: &str,
) -> Result<T, Refusal> {
    let _place = PLACES.request(&caller.bearer(), number).ok_or_else(|| {
        let message = "too many requests are passed on to another gateway: ask again";
        refusal::of(Problem::new(Code::Overloaded, message))
    })?;
    let asked = async {
        let answer = state.shared.owners.send(number, asks(target)).await;
        read(answer.map_err(|failed| format!("{failed:?}"))?).await
    };
    let answer = timeout(ANSWER_WITHIN, asked).await;
    answer.unwrap_or_else(|_| Err(format!("no answer within {ANSWER_WITHIN:?}"))).map_err(|why| {
        let message = format!("a gateway that owns some of the robots does not answer: {why}. Ask again");
        refusal::of(Problem::new(Code::NoOwner, message))
    })
}
