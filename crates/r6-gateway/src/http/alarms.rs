//! The alarms of robots: what they are, who acknowledged them, which are shelved. Nothing here changes
//! anything at a robot: to clear an alarm is a command.

use std::collections::BTreeMap;
use std::time::Duration;

use axum::Json;
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{Path, Query, State as Of};
use r6_api::gateway::{AcknowledgeRequest, RobotAlarm, RobotAlarmState, RobotAlarms, ShelveRequest};
use r6_api::{Code, Problem};
use r6_http::Refusal;
use serde::Deserialize;
use utoipa::IntoParams;

use super::State;
use super::body;
use super::caller::{AcknowledgeAlarm, Caller, Read, Robot, ShelveAlarm};
use super::described::{OfBody, OfChange, OfRight, OfToken};
use super::forward;
use super::range::check_limit;
use super::refusal::{self, bad_value, of_lost_work};
use crate::core::alarms::{LONGEST_SHELF_MS, MAX_WORDS, SHORTEST_SHELF_MS};
use crate::core::name::RobotName;
use crate::core::owner::Owned;
use crate::ownership::owners::Place;

/// The most alarms of one answer: half a megabyte of JSON.
const MAX_LIMIT: usize = 1_000;

/// Which alarms.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Which {
    /// `true`: without those that ended.
    #[serde(default)]
    active: bool,
    /// The largest number of alarms, 1 to 1000.
    #[serde(default = "usual_limit")]
    #[param(minimum = 1, maximum = 1000, default = 100)]
    limit: usize,
}

fn usual_limit() -> usize {
    100
}

/// What a path names: the robot and the alarm.
#[derive(Debug, Deserialize)]
pub struct Named {
    /// The number of the alarm, as the caller wrote it.
    id: String,
}

/// The alarms of all robots that the caller may see: the active ones first, then those that ended within a
/// day, the latest first. Robots whose alarms are not known now are named.
#[utoipa::path(
    get,
    path = "/v1/alarms",
    operation_id = "alarms",
    params(Which),
    responses(
        (status = 200, description = "The alarms", body = RobotAlarms),
        (status = 422, description = "`bad_value`", body = Problem),
        OfToken,
    )
)]
pub async fn all(
    caller: Caller,
    Of(state): Of<State>,
    which: Result<Query<Which>, QueryRejection>,
) -> Result<Json<RobotAlarms>, Refusal> {
    let Query(which) = which.map_err(refusal::of_query)?;
    check_limit(which.limit, MAX_LIMIT)?;
    let target = format!("/v1/alarms?limit={MAX_LIMIT}&active={}", which.active);
    let others: Vec<(u64, RobotAlarms)> = forward::gather(&caller, &state, &target).await;
    let stations = state.fleet.stations();
    let here = stations.iter().filter(|station| caller.grant().covers(station.name()));
    let mut tellers = Tellers::new(&state, here.clone().map(|station| station.name().to_owned()));
    for (number, other) in &others {
        tellers.add(*number, other.robots.iter().flatten());
    }
    let mut left_out = 0;
    let mut alarms: Vec<_> = here.flat_map(|station| station.alarms()).collect();
    for (number, other) in others {
        left_out += other.left_out;
        alarms.extend(other.alarms.into_iter().filter(|alarm| tellers.is_of(&alarm.robot, number)));
    }
    let mut told = chosen(alarms, &which)?;
    told.left_out += left_out;
    if caller.is_passed() {
        told.robots = Some(tellers.robots().cloned().collect());
    } else {
        let all = forward::robots(&caller, &state).into_iter().map(|robot| robot.to_string());
        told.not_known = all.filter(|robot| !tellers.has(robot)).collect();
    }
    Ok(Json(told))
}

/// Which gateway's answer counts for which robot: a robot that changes hands may be in two, or in none.
struct Tellers<'s> {
    state: &'s State,
    /// `None`: this gateway.
    by_robot: BTreeMap<String, Option<u64>>,
}

impl<'s> Tellers<'s> {
    /// Those of this gateway.
    fn new(state: &'s State, here: impl Iterator<Item = String>) -> Self {
        Self { state, by_robot: here.map(|robot| (robot, None)).collect() }
    }

    /// A gateway has answered for these robots.
    fn add<'r>(&mut self, number: u64, robots: impl Iterator<Item = &'r String>) {
        for robot in robots {
            let owned = RobotName::new(robot).map(Owned::Robot);
            let is_owner =
                || owned.is_some_and(|owned| self.state.shared.owners.place(&owned) == Place::There(number));
            match self.by_robot.get(robot) {
                Some(None) => {}
                Some(Some(_)) if !is_owner() => {}
                Some(Some(_)) | None => drop(self.by_robot.insert(robot.clone(), Some(number))),
            }
        }
    }

    fn is_of(&self, robot: &str, number: u64) -> bool {
        self.by_robot.get(robot) == Some(&Some(number))
    }

    fn has(&self, robot: &str) -> bool {
        self.by_robot.contains_key(robot)
    }

    fn robots(&self) -> impl Iterator<Item = &String> {
        self.by_robot.keys()
    }
}

/// The alarms of a robot: the active one, and those that ended within a day, 30 at most.
#[utoipa::path(
    get,
    path = "/v1/robots/{name}/alarms",
    operation_id = "robot_alarms",
    params(("name" = String, Path, description = "The name of the robot"), Which),
    responses(
        (status = 200, description = "The alarms", body = RobotAlarms),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        OfRight,
    )
)]
pub async fn show(
    robot: Robot<Read>,
    which: Result<Query<Which>, QueryRejection>,
) -> Result<Json<RobotAlarms>, Refusal> {
    let Query(which) = which.map_err(refusal::of_query)?;
    chosen(robot.station.alarms(), &which).map(Json)
}

/// Says that the caller saw an alarm. It changes nothing at the robot and needs no lease. An alarm that was
/// acknowledged stays as it is.
#[utoipa::path(
    post,
    path = "/v1/robots/{name}/alarms/{id}/acknowledge",
    operation_id = "acknowledge_alarm",
    params(
        ("name" = String, Path, description = "The name of the robot"),
        ("id" = u64, Path, description = "The number of the alarm")
    ),
    request_body = AcknowledgeRequest,
    responses(
        (status = 200, description = "It is acknowledged", body = RobotAlarm),
        (status = 404, description = "`no_such_robot`, `no_such_alarm`", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 503, description = "`store_unavailable`: nothing was changed", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn acknowledge(
    robot: Robot<AcknowledgeAlarm>,
    named: Result<Path<Named>, PathRejection>,
    body::Json(AcknowledgeRequest { comment }): body::Json<AcknowledgeRequest>,
) -> Result<Json<RobotAlarm>, Refusal> {
    comment.as_deref().map_or(Ok(()), |comment| check_words("comment", comment))?;
    let (id, by) = (id(named)?, robot.caller.by());
    let work = tokio::spawn(async move { robot.station.acknowledge(&by, id, comment).await });
    work.await.map_err(of_lost_work)?.map(Json).map_err(refusal::of)
}

/// Shelves the alarms of the code of this one at this robot, those that come later too, until the time ends:
/// they need no answer. It changes nothing at the robot and needs no lease. Shelved alarms stay in the lists.
#[utoipa::path(
    post,
    path = "/v1/robots/{name}/alarms/{id}/shelve",
    operation_id = "shelve_alarm",
    params(
        ("name" = String, Path, description = "The name of the robot"),
        ("id" = u64, Path, description = "The number of an alarm of this code")
    ),
    request_body = ShelveRequest,
    responses(
        (status = 200, description = "Its code is shelved", body = RobotAlarm),
        (status = 404, description = "`no_such_robot`, `no_such_alarm`", body = Problem),
        (status = 409, description = "`no_room`: 10 codes of this robot are shelved", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 503, description = "`store_unavailable`: nothing was changed", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn shelve(
    robot: Robot<ShelveAlarm>,
    named: Result<Path<Named>, PathRejection>,
    body::Json(ShelveRequest { for_ms, reason }): body::Json<ShelveRequest>,
) -> Result<Json<RobotAlarm>, Refusal> {
    if !(SHORTEST_SHELF_MS..=LONGEST_SHELF_MS).contains(&for_ms) {
        return Err(bad_value(format!("for_ms is from {SHORTEST_SHELF_MS} to {LONGEST_SHELF_MS}")));
    }
    check_words("reason", &reason)?;
    let (id, by, lasts) = (id(named)?, robot.caller.by(), Duration::from_millis(for_ms));
    let work = tokio::spawn(async move { robot.station.shelve(&by, id, lasts, reason).await });
    work.await.map_err(of_lost_work)?.map(Json).map_err(refusal::of)
}

/// Takes the alarms of the code of this one from the shelf.
#[utoipa::path(
    delete,
    path = "/v1/robots/{name}/alarms/{id}/shelve",
    operation_id = "unshelve_alarm",
    params(
        ("name" = String, Path, description = "The name of the robot"),
        ("id" = u64, Path, description = "The number of an alarm of this code")
    ),
    responses(
        (status = 200, description = "Its code is not shelved", body = RobotAlarm),
        (status = 404, description = "`no_such_robot`, `no_such_alarm`", body = Problem),
        (status = 503, description = "`store_unavailable`: nothing was changed", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
    )
)]
pub async fn unshelve(
    robot: Robot<ShelveAlarm>,
    named: Result<Path<Named>, PathRejection>,
) -> Result<Json<RobotAlarm>, Refusal> {
    let (id, by) = (id(named)?, robot.caller.by());
    let work = tokio::spawn(async move { robot.station.unshelve(&by, id).await });
    work.await.map_err(of_lost_work)?.map(Json).map_err(refusal::of)
}

/// These alarms as they were asked for.
fn chosen(mut alarms: Vec<RobotAlarm>, which: &Which) -> Result<RobotAlarms, Refusal> {
    check_limit(which.limit, MAX_LIMIT)?;
    let has_ended = |alarm: &RobotAlarm| alarm.state == RobotAlarmState::Ended;
    alarms.retain(|alarm| !which.active || !has_ended(alarm));
    // Times as text are in the order of time.
    alarms.sort_by(|one, other| {
        let order = has_ended(one).cmp(&has_ended(other)).then_with(|| other.since.cmp(&one.since));
        order.then_with(|| one.robot.cmp(&other.robot))
    });
    let left_out = alarms.len().saturating_sub(which.limit) as u64;
    alarms.truncate(which.limit);
    Ok(RobotAlarms { alarms, left_out, not_known: Vec::new(), robots: None })
}

/// The number in a path. A text that is no number is that of no alarm.
fn id(named: Result<Path<Named>, PathRejection>) -> Result<u64, Refusal> {
    let id = named.ok().and_then(|Path(named)| named.id.parse().ok());
    id.ok_or_else(|| Refusal::not_found(Code::NoSuchAlarm, "there is no alarm with this number"))
}

/// Refuses a text that is empty or too long, or would break the lines in which others read it.
fn check_words(field: &str, text: &str) -> Result<(), Refusal> {
    if text.trim().is_empty() || text.len() > MAX_WORDS || text.chars().any(char::is_control) {
        return Err(bad_value(format!(
            "{field} is a text of 1 to {MAX_WORDS} bytes without control characters"
        )));
    }
    Ok(())
}
