//! What each gateway tells of its own robots, for an answer about the robots of all.

use std::collections::BTreeSet;
use std::time::Duration;

use futures_util::future::join_all;
use serde::de::DeserializeOwned;
use tokio::time::timeout;

use super::super::State;
use super::super::caller::Caller;
use super::PLACES;
use crate::core::name::RobotName;
use crate::core::owner::Owned;
use crate::live::far::Shown as _;
use crate::ownership::owners::Place;
use crate::peers::{asks_for, read};

/// How long an answer may take. A reader waits for the slowest gateway.
const ANSWER_WITHIN: Duration = Duration::from_secs(2);

/// What the other gateways that own robots of this caller answer to this, each for its own robots, with the
/// number of the gateway. Those that do not answer are left out, and those to which too many requests are
/// under way. A request that another gateway passes on gets nothing: that one asks the others itself.
pub async fn gather<T: DeserializeOwned>(caller: &Caller, state: &State, target: &str) -> Vec<(u64, T)> {
    let owners = &state.shared.owners;
    if caller.is_passed() {
        return Vec::new();
    }
    let gateways: BTreeSet<_> = robots(caller, state)
        .into_iter()
        .filter_map(|robot| match owners.place(&Owned::Robot(robot)) {
            Place::There(number) => Some(number),
            Place::Here | Place::Nowhere => None,
        })
        .collect();
    let answers = join_all(gateways.into_iter().map(|number| one(caller, state, number, target))).await;
    answers.into_iter().flatten().collect()
}

/// All robots of the hall that this caller may see, as far as this gateway knows.
pub fn robots(caller: &Caller, state: &State) -> BTreeSet<RobotName> {
    let configured = state.shared.owners.robots().into_iter().map(|config| config.name);
    // Another gateway may have more in its file.
    let told = state.shared.far.all().into_iter().filter_map(|far| RobotName::new(far.name()));
    let here = state.fleet.stations().into_iter().map(|station| station.robot_name().clone());
    let all = configured.chain(told).chain(here);
    all.filter(|robot| caller.grant().covers(robot.as_str())).collect()
}

async fn one<T: DeserializeOwned>(
    caller: &Caller,
    state: &State,
    number: u64,
    target: &str,
) -> Option<(u64, T)> {
    let asked = async {
        let _place =
            PLACES.request(&caller.bearer(), number).ok_or("too many requests are passed on to it")?;
        let onward = asks_for(target, (caller.bearer(), caller.source()));
        let answer = state.shared.owners.send(number, onward).await;
        read(answer.map_err(|failed| format!("{failed:?}"))?).await
    };
    let answer = timeout(ANSWER_WITHIN, asked).await;
    let answer = answer.unwrap_or_else(|_| Err(format!("no answer within {ANSWER_WITHIN:?}")));
    let told = answer.inspect_err(|why| tracing::debug!(gateway = number, why, path = target, "no answer"));
    told.ok().map(|answer| (number, answer))
}
