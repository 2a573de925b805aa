//! The robots and their values.

use std::sync::Arc;
use std::time::Duration;

use axum::Json;
use axum::extract::State as Of;
use axum::http::StatusCode;
use r6_api::gateway::{ManagedBy, RobotState, RobotWanted, Robots};
use r6_api::{Code, Problem};
use r6_client::{Address, RobotSettings};
use r6_http::Refusal;
use r6_motion::RobotModel;

use super::body;
use super::caller::{Caller, Configure, Named, Read, Robot};
use super::described::{OfBody, OfChange, OfRight, OfToken};
use super::{State, refusal};
use crate::core::name::RobotName;
use crate::core::role::Right;
use crate::fleet::config::{self, RobotConfig, USUAL_PERIOD};
use crate::fleet::group::PollGroup;
use crate::fleet::guard::Guard;
use crate::fleet::roster::Put;
use crate::{problem, programs};

/// The robots that the token may see.
#[utoipa::path(get, path = "/v1/robots", operation_id = "robots", responses(
    (status = 200, description = "All of them, without their values", body = Robots),
    OfToken,
))]
pub async fn list(caller: Caller, Of(state): Of<State>) -> Json<Robots> {
    let (_, all) = state.fleet.shown_now(!caller.is_gateway());
    let seen = all.iter().filter(|robot| caller.grant().covers(robot.name()));
    Json(Robots { robots: seen.map(|robot| robot.summary()).collect() })
}

/// One robot with its values.
#[utoipa::path(
    get,
    path = "/v1/robots/{name}",
    operation_id = "robot",
    params(("name" = String, Path, description = "The name of the robot")),
    responses(
        (status = 200, description = "Now", body = RobotState),
        (status = 404, description = "`no_such_robot`", body = Problem),
        OfRight,
    )
)]
pub async fn show(robot: Robot<Read>) -> Json<RobotState> {
    Json(robot.station.state())
}

/// Adds a robot, or changes a robot that was added over this API. It is there again after a restart of the
/// gateway. A change makes a new connection to the robot and ends its lease; other robots go on.
#[utoipa::path(
    put,
    path = "/v1/robots/{name}",
    operation_id = "put_robot",
    params(("name" = String, Path, description = "The name: 1 to 32 characters of a to z, digits and -")),
    request_body = RobotWanted,
    responses(
        (status = 201, description = "It was added"),
        (status = 204, description = "It is as wanted"),
        (
            status = 409,
            description = "`managed_by_file`; `address_taken` by another robot; `not_ready`: the gateway ends, or a stop is owed to the arm; `stopped`: a stop holds, and the address would change",
            body = Problem
        ),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 503, description = "`store_unavailable`: nothing was changed", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn put(
    named: Named<Configure>,
    Of(state): Of<State>,
    body::Json(wanted): body::Json<RobotWanted>,
) -> Result<StatusCode, Refusal> {
    let robot = read(&named.name, wanted, state.robot_settings.clone()).map_err(refusal::of)?;
    let known = state.fleet.station(&named.name).map(|station| station.config().address);
    if known.as_ref() != Some(&robot.address) {
        // Behind a new address there may be the arm of any other robot.
        named.caller.must_for_all(Right::Configure)?;
    }
    let by = named.caller.by();
    let work = tokio::spawn(async move { state.fleet.put(&by, robot).await });
    let put = work.await.map_err(refusal::of_lost_work)?.map_err(refusal::of)?;
    Ok(match put {
        Put::Added => StatusCode::CREATED,
        Put::Changed => StatusCode::NO_CONTENT,
    })
}

/// Removes a robot that was added over this API. Its lease ends, and the arm goes on with what it does.
#[utoipa::path(
    delete,
    path = "/v1/robots/{name}",
    operation_id = "remove_robot",
    params(("name" = String, Path, description = "The name of the robot")),
    responses(
        (status = 204, description = "It was removed"),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (
            status = 409,
            description = "`managed_by_file`; `not_ready`: the gateway ends, or a stop is owed to the arm; `stopped`: clear the stop first",
            body = Problem
        ),
        (status = 503, description = "`store_unavailable`: nothing was changed", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
    )
)]
pub async fn remove(robot: Robot<Configure>, Of(state): Of<State>) -> Result<StatusCode, Refusal> {
    let (by, name) = (robot.caller.by(), robot.station.config().name);
    let work = tokio::spawn(async move { state.fleet.remove(&by, &name).await });
    let removed = work.await.map_err(refusal::of_lost_work)?;
    removed.map(|()| StatusCode::NO_CONTENT).map_err(refusal::of)
}

fn name_of(model: &RobotModel) -> String {
    model.name.to_string()
}

/// The robot that a caller wants.
fn read(name: &str, wanted: RobotWanted, settings: RobotSettings) -> Result<RobotConfig, problem::Problem> {
    let bad_value = |message: String| problem::Problem::new(Code::BadValue, message);
    let RobotWanted { address, period_ms, read, groups, model, parts, guard } = wanted;
    let name = RobotName::new(name).ok_or_else(|| bad_value(format!("a robot has {}", RobotName::WANTED)))?;
    let address_of = |text: &String| Address::parse(text).map_err(|unknown| bad_value(unknown.to_string()));
    Ok(RobotConfig {
        period: period_ms.map_or(USUAL_PERIOD, Duration::from_millis),
        addresses: read.iter().map(address_of).collect::<Result<_, _>>()?,
        groups: groups.iter().map(PollGroup::read).collect::<Result<_, _>>().map_err(bad_value)?,
        model: model.as_deref().map(programs::model).transpose().map_err(bad_value)?.map(name_of),
        parts: parts.as_deref().map(config::counter).transpose().map_err(bad_value)?,
        guard: guard.as_ref().map(Guard::read).transpose().map_err(bad_value)?.map(Arc::new),
        settings,
        managed_by: ManagedBy::Api,
        ..RobotConfig::new(name, address)
    })
}
