//! Commands, stops, and what lets a robot be used again.

use axum::extract::State as Of;
use axum::http::{HeaderMap, StatusCode};
use r6_api::gateway::{ClearRequest, CommandDone, CommandRequest, RobotIdentity, Stopped, WithReason};
use r6_api::{Code, Problem};
use r6_http::Refusal;
use r6_proto::{Command, CommandName, Effect};

use super::body::{Json, check_reason, key};
use super::caller::{self, AcceptIdentity, Caller, Configure, Robot, Stop};
use super::described::{OfBody, OfChange};
use super::{State, deadline, idempotency, refusal};
use crate::core::role::Right;
use crate::core::seat::Denied;
use crate::fleet::command::Once;
use crate::{problem, traces};

/// What is told of a stop that the shared store did not confirm.
const STANDS_UNCONFIRMED: &str = "the robot was stopped and the arm stands, but the database did not confirm in time that the stop holds: at \
     another gateway it may not hold. Use the emergency stop if the arm moves, or stop it again";

/// Sends one command. What changes or moves needs the lease. What stops needs none, and holds until it is
/// cleared. The audit log has the intent before the command leaves, and the outcome after. A request with the
/// same `Idempotency-Key` that asks for the same gets the same answer within 24 h, and nothing is sent again;
/// commands that stop are sent each time.
#[utoipa::path(
    post,
    path = "/v1/robots/{name}/commands",
    params(
        ("name" = String, Path, description = "The name of the robot"),
        (
            "Idempotency-Key" = Option<String>,
            Header,
            description = "1 to 128 visible characters, drawn anew for each command, such as a UUID"
        ),
        deadline::Deadline
    ),
    request_body = CommandRequest,
    responses(
        (status = 200, description = "The controller accepted it", body = CommandDone),
        (
            status = 400,
            description = "`needs_idempotency_key`: the header is there and is no key; `bad_json`, `bad_body`",
            body = Problem
        ),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (
            status = 409,
            description = "`no_lease`, `stopped`, `not_ready`, `identity_changed`, `leftover_list`, `refused` (by the \
                           controller), `in_progress`, `too_late`",
            body = Problem
        ),
        (status = 422, description = "`bad_command`, `bad_value`, `key_taken`", body = Problem),
        (status = 503, description = "`store_unavailable`, `overloaded`: nothing was sent", body = Problem),
        (status = 504, description = "`outcome_unknown`: it may have acted", body = Problem),
        (status = 408, description = "`too_slow`", body = Problem),
        (status = 413, description = "`too_long`", body = Problem),
        (status = 415, description = "`not_json`", body = Problem),
        OfChange,
    )
)]
pub async fn command(
    robot: Robot<Stop>,
    Of(state): Of<State>,
    headers: HeaderMap,
    body: Result<Json<CommandRequest>, Refusal>,
) -> Result<axum::Json<CommandDone>, Refusal> {
    let Robot { caller, station, .. } = robot;
    let request = caller.of_body(&state, body)?;
    let command = read(&request.command, &request.arguments);
    let stops = command.as_ref().is_ok_and(|command| command.name().effect() == Effect::Stops);
    if !stops {
        caller.count(&state)?;
    }
    let command = command.map_err(refusal::of)?;
    let effect = command.name().effect();
    caller.must(Right::for_effect(effect), station.name())?;
    let by = caller.by();
    let work = match effect {
        Effect::Stops => traces::spawn(async move {
            let written = station.is_stop_written(&by, command.name().word());
            let done = station.stop_command(&by, command, written).await;
            let written = station.written_for_others().await;
            done.and_then(|done| written.map(|()| done))
        }),
        Effect::Reads | Effect::Changes | Effect::Moves => {
            let once = once(&caller, station.name(), &headers, &request)?;
            if let Some(once) = &once
                && let Some(done) = station.commanded_before(once).await.map_err(refusal::of)?
            {
                return Ok(axum::Json(done));
            }
            deadline::check(&headers)?;
            let held = request.lease.as_ref().ok_or_else(|| Denied::NoLease.into()).and_then(key);
            let key = held.map_err(|problem: problem::Problem| {
                station.note_refused(&by, &command.to_string(), problem.code);
                refusal::of(problem)
            })?;
            let run_leftover = request.run_leftover;
            traces::spawn(async move {
                station.command(&by, key, command.into(), run_leftover, once.as_ref(), None).await
            })
        }
    };
    work.await.map_err(refusal::of_lost_work)?.map(axum::Json).map_err(refusal::of)
}

/// What keeps a request from being carried out twice; `None` without an `Idempotency-Key`.
fn once(
    caller: &Caller,
    robot: &str,
    headers: &HeaderMap,
    request: &CommandRequest,
) -> Result<Option<Once>, Refusal> {
    let CommandRequest { command, arguments, lease: _, run_leftover } = request;
    let Some(key) = idempotency::key(headers)? else { return Ok(None) };
    let hash = idempotency::hash(&(robot, command, arguments, run_leftover))?;
    Ok(Some(Once { caller: idempotency::owner(caller), key, hash }))
}

/// Stops the robot, and answers when it is proved that the arm stands, within 20 s. It needs no lease. After
/// it, no command that can move the robot is sent until the holder of the lease clears the stop. It is not an
/// emergency stop.
#[utoipa::path(
    post,
    path = "/v1/robots/{name}/stop",
    params(("name" = String, Path, description = "The name of the robot")),
    responses(
        (status = 200, description = "The arm stands", body = Stopped),
        (status = 401, description = "`no_token`, `no_session`", body = Problem),
        (status = 403, description = "`not_allowed`, `bad_csrf`, `foreign_host`, `foreign_origin`", body = Problem),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (
            status = 503,
            description = "`store_unavailable`: the arm stands, and a database that gateways share did not confirm that \
                           it has the stop: at another gateway it may not hold",
            body = Problem
        ),
        (status = 504, description = "`not_stopped`: it is NOT proved that the arm stands", body = Problem),
    )
)]
pub async fn stop(robot: Robot<Stop>) -> Result<axum::Json<Stopped>, Refusal> {
    let Robot { caller, station, .. } = robot;
    let work = traces::spawn(async move {
        let stopped = station.stop(&caller.by()).await;
        let written = station.written_for_others().await;
        stopped.and_then(|stopped| match written {
            Ok(()) => Ok(stopped),
            Err(unwritten) => Err(problem::Problem { message: STANDS_UNCONFIRMED.to_owned(), ..unwritten }),
        })
    });
    work.await.map_err(refusal::of_lost_work)?.map(axum::Json).map_err(refusal::of)
}

/// Lets the robot move again after a stop. The holder of the lease does that, after a look at the robot.
#[utoipa::path(
    post,
    path = "/v1/robots/{name}/clear-stopped",
    params(
        ("name" = String, Path, description = "The name of the robot"),
        deadline::Deadline
    ),
    request_body = ClearRequest,
    responses(
        (status = 204, description = "Commands that move are sent again"),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (status = 409, description = "`no_lease`; `stopped`: a stop is still under way, or has begun since; `too_late`", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (
            status = 503,
            description = "`store_unavailable`: the stop is cleared, and a database that gateways share did not \
                           confirm that it has that",
            body = Problem
        ),
        OfChange,
        OfBody,
    )
)]
pub async fn clear_stopped(
    robot: Robot<caller::Command>,
    headers: HeaderMap,
    Json(ClearRequest { lease, stop_number }): Json<ClearRequest>,
) -> Result<StatusCode, Refusal> {
    deadline::check(&headers)?;
    let cleared = key(&lease).and_then(|key| robot.station.clear(&robot.caller.by(), key, stop_number));
    cleared.map_err(refusal::of)?;
    robot.station.written_for_others().await.map_err(refusal::of)?;
    Ok(StatusCode::NO_CONTENT)
}

/// Forgets that a list of a run has to be stopped as soon as the robot answers, because the arm is gone: only
/// then the robot can be removed, or get another address. An admin of all robots can do that while a stop
/// holds and no robot answers.
#[utoipa::path(
    post,
    path = "/v1/robots/{name}/forget-owed-stop",
    params(("name" = String, Path, description = "The name of the robot")),
    request_body = WithReason,
    responses(
        (status = 204, description = "No stop is owed any more. The stop that holds has to be cleared"),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (
            status = 409,
            description = "`not_ready`: nothing is owed, no stop holds, or a robot answers",
            body = Problem
        ),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn forget_owed_stop(
    robot: Robot<Configure>,
    Json(WithReason { because }): Json<WithReason>,
) -> Result<StatusCode, Refusal> {
    let Robot { caller, station, .. } = robot;
    // Where the arm is, an admin of this robot alone does not know.
    caller.must_for_all(Right::Configure)?;
    check_reason("because", &because)?;
    let work = traces::spawn(async move { station.forget_owed_stop(&caller.by(), because).await });
    let done = work.await.map_err(refusal::of_lost_work)?;
    done.map(|()| StatusCode::NO_CONTENT).map_err(refusal::of)
}

/// Accepts the robot that answers in place of another one: `identity_changed.found` of
/// `GET /v1/robots/{name}`.
#[utoipa::path(
    post,
    path = "/v1/robots/{name}/accept-identity",
    params(("name" = String, Path, description = "The name of the robot")),
    request_body = RobotIdentity,
    responses(
        (status = 204, description = "The name stands for this robot from now on"),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (status = 409, description = "`identity_changed`: this is not the robot that answers", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn accept_identity(
    robot: Robot<AcceptIdentity>,
    Json(accepted): Json<RobotIdentity>,
) -> Result<StatusCode, Refusal> {
    let Robot { caller, station, .. } = robot;
    let work = traces::spawn(async move { station.accept_identity(&caller.by(), accepted).await });
    let done = work.await.map_err(refusal::of_lost_work)?;
    done.map(|()| StatusCode::NO_CONTENT).map_err(refusal::of)
}

/// The command with these arguments, in the units of the table.
fn read(word: &str, arguments: &[String]) -> Result<Command<'static>, problem::Problem> {
    let bad = |message: String| problem::Problem::new(Code::BadCommand, message);
    let name = CommandName::exact(word.as_bytes()).ok_or_else(|| {
        let word: String = word.chars().take(48).collect();
        let word = r6_proto::printable(&word).to_string();
        match CommandName::nearest(&word) {
            Some(near) => bad(format!("there is no command `{word}`; nearest: `{near}`")),
            None => bad(format!("there is no command `{word}`; `r6 command --list` prints all")),
        }
    })?;
    Command::typed(name, arguments).map_err(|error| bad(format!("{name}: {error}")))
}
