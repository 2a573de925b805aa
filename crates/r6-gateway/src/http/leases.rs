//! The lease of a robot.

use std::time::Duration;

use axum::http::StatusCode;
use r6_api::gateway::{Lease, LeaseRequest, WithLease};
use r6_api::{Code, Problem};
use r6_http::Refusal;

use super::body::{Json, check_reason, key};
use super::caller::{Command, Robot};
use super::described::{OfBody, OfChange};
use super::refusal::{self, bad_value};
use crate::core::role::Right;
use crate::core::seat::{LONGEST_LEASE, SHORTEST_LEASE, USUAL_LEASE};
use crate::traces;

/// Acquires, renews or takes the lease. Only its holder can send commands that change or move. It ends unless
/// it is renewed in time.
#[utoipa::path(
    post,
    path = "/v1/robots/{name}/lease",
    operation_id = "acquire_lease",
    params(("name" = String, Path, description = "The name of the robot")),
    request_body = LeaseRequest,
    responses(
        (status = 200, description = "The caller holds the lease", body = Lease),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (
            status = 409,
            description = "`leased`, `no_lease` (to renew, or it has ended meanwhile), `identity_changed`",
            body = Problem
        ),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn acquire(
    robot: Robot<Command>,
    Json(request): Json<LeaseRequest>,
) -> Result<axum::Json<Lease>, Refusal> {
    let LeaseRequest { duration_ms, renew, take_because } = request;
    let lasts = duration_ms.map_or(USUAL_LEASE, Duration::from_millis);
    if !(SHORTEST_LEASE..=LONGEST_LEASE).contains(&lasts) {
        let [shortest, longest] = [SHORTEST_LEASE, LONGEST_LEASE].map(|lasts| lasts.as_millis());
        return Err(bad_value(format!("duration_ms is from {shortest} to {longest}")));
    }
    let (station, by) = (robot.station, robot.caller.by());
    let lease = match (renew, take_because) {
        (Some(_), Some(_)) => return Err(bad_value("either renew or take_because, not both")),
        (Some(held), None) => key(&held).and_then(|key| station.renew(key, lasts)).map_err(refusal::of)?,
        (None, Some(because)) => {
            check_reason("take_because", &because)?;
            if let Err(refused) = robot.caller.must(Right::TakeLease, station.name()) {
                station.note_refused(&by, "take the lease", Code::NotAllowed);
                return Err(refused);
            }
            let work = traces::spawn(async move { station.take(&by, lasts, because).await });
            work.await.map_err(refusal::of_lost_work)?.map_err(refusal::of)?
        }
        (None, None) => {
            let work = traces::spawn(async move { station.acquire(&by, lasts).await });
            work.await.map_err(refusal::of_lost_work)?.map_err(refusal::of)?
        }
    };
    Ok(axum::Json(lease))
}

/// Gives the lease back. A program that runs with it is stopped first: then the answer comes once the arm
/// stands.
#[utoipa::path(
    delete,
    path = "/v1/robots/{name}/lease",
    operation_id = "release_lease",
    params(("name" = String, Path, description = "The name of the robot")),
    request_body = WithLease,
    responses(
        (status = 204, description = "The lease is free"),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (status = 409, description = "`no_lease`", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (
            status = 503,
            description = "`store_unavailable`: the lease has ended, and a database that gateways share did not \
                           confirm that it has that",
            body = Problem
        ),
        (
            status = 504,
            description = "`not_stopped`: it is NOT proved that the arm stands; `outcome_unknown`: the gateway ends",
            body = Problem
        ),
        OfChange,
        OfBody,
    )
)]
pub async fn release(robot: Robot<Command>, Json(held): Json<WithLease>) -> Result<StatusCode, Refusal> {
    let key = key(&held.lease).map_err(refusal::of)?;
    let work = traces::spawn(async move {
        let released = robot.station.give_back(&robot.caller.by(), key).await;
        let written = robot.station.written_for_others().await;
        released.and(written)
    });
    let released = work.await.map_err(refusal::of_lost_work)?;
    released.map(|()| StatusCode::NO_CONTENT).map_err(refusal::of)
}
