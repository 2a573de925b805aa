//! Cameras: their standing grants, and what they send.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::extract::rejection::PathRejection;
use axum::extract::{Path, State as Of};
use axum::http::{HeaderMap, StatusCode};
use r6_api::gateway::{
    CameraGrant, CameraGrantWanted, CameraGrants, CameraPoint, PhotoRequest, PointsDone, PointsRequest,
};
use r6_api::{Code, Problem};
use r6_client::Point;
use r6_http::Refusal;
use serde::Deserialize;

use super::body::Json;
use super::caller::{Caller, GrantCamera, Read, Robot};
use super::described::{OfBody, OfChange, OfRight};
use super::refusal::{self, bad_value, of_lost_work};
use super::{State, deadline};
use crate::core::camera::{Camera, MAX_POINTS};
use crate::fleet::camera::Granted;
use crate::fleet::station::Station;
use crate::{problem, traces};

/// What a path names besides the robot.
#[derive(Debug, Deserialize)]
pub struct Named {
    /// The camera, as the caller wrote it.
    camera: String,
    /// The number of the token, as the caller wrote it.
    #[serde(default)]
    token: String,
}

/// Who may send points to the robot as which camera.
#[utoipa::path(
    get,
    path = "/v1/robots/{name}/cameras",
    operation_id = "cameras",
    params(("name" = String, Path, description = "The name of the robot")),
    responses(
        (status = 200, description = "The grants", body = CameraGrants),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        OfRight,
    )
)]
pub async fn list(robot: Robot<Read>, Of(state): Of<State>) -> Result<axum::Json<CameraGrants>, Refusal> {
    let grants = robot.station.camera_grants().await.map_err(refusal::of)?;
    let mut names = BTreeMap::new();
    for grant in &grants {
        let token = state.tokens.find_number(grant.token).await;
        names.extend(token.map(|token| (grant.token, token.name.clone())));
    }
    if grants.iter().any(|grant| !names.contains_key(&grant.token)) {
        // Those of tokens that have ended, too: they take the room of others until they are revoked.
        let tokens = state.shared.keeper.tokens().await.map_err(|error| refusal::of(error.into()))?;
        names.extend(tokens.into_iter().map(|token| (token.number, token.name)));
    }
    let told = grants.into_iter().filter_map(|grant| {
        // A token that was revoked a moment ago has no grants any more.
        let token_name = names.get(&grant.token)?.clone();
        Some(CameraGrant {
            camera: grant.camera.number(),
            token: grant.token,
            token_name,
            by: grant.by,
            at: grant.at,
        })
    });
    Ok(axum::Json(CameraGrants { grants: told.collect() }))
}

/// Gives a token the grant to feed a camera: it may send points and answers to photos as this camera of this
/// robot, without the lease and also while another caller holds it, until the grant or the token is revoked.
#[utoipa::path(
    post,
    path = "/v1/robots/{name}/cameras/{camera}/grants",
    operation_id = "grant_camera",
    params(
        ("name" = String, Path, description = "The name of the robot"),
        ("camera" = u16, Path, description = "The camera (`camID`), 0 to 999")
    ),
    request_body = CameraGrantWanted,
    responses(
        (status = 201, description = "The token has the grant"),
        (status = 204, description = "It had the grant before"),
        (status = 404, description = "`no_such_robot`, `no_such_token`", body = Problem),
        (status = 409, description = "`no_room`: the robot has 64 grants", body = Problem),
        (status = 422, description = "`bad_value`: also if the token is for another robot", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn grant(
    robot: Robot<GrantCamera>,
    named: Result<Path<Named>, PathRejection>,
    Json(CameraGrantWanted { token }): Json<CameraGrantWanted>,
) -> Result<StatusCode, Refusal> {
    let Robot { caller, station, .. } = robot;
    let (camera, _) = read(named)?;
    let work = traces::spawn(async move { station.grant_camera(caller.author(), camera, token).await });
    let is_new = work.await.map_err(of_lost_work)?.map_err(refusal::of)?;
    Ok(if is_new { StatusCode::CREATED } else { StatusCode::NO_CONTENT })
}

/// Takes the grant for a camera from a token. From the answer on, nothing of the token leaves for this
/// camera, not even what it has asked for before, but an answer to a photo that waits for the robot to read.
#[utoipa::path(
    delete,
    path = "/v1/robots/{name}/cameras/{camera}/grants/{token}",
    operation_id = "revoke_camera",
    params(
        ("name" = String, Path, description = "The name of the robot"),
        ("camera" = u16, Path, description = "The camera (`camID`), 0 to 999"),
        ("token" = i64, Path, description = "The number of the token")
    ),
    responses(
        (status = 204, description = "The grant is revoked"),
        (status = 404, description = "`no_such_robot`; `no_such_token` has this grant", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
    )
)]
pub async fn revoke(
    robot: Robot<GrantCamera>,
    named: Result<Path<Named>, PathRejection>,
) -> Result<StatusCode, Refusal> {
    let Robot { caller, station, .. } = robot;
    let (camera, token) = read(named)?;
    let no_such = || {
        let message = format!("no token with this number has a grant for camera {camera}");
        refusal::of(problem::Problem::new(Code::NoSuchToken, message))
    };
    let token = token.parse().map_err(|_| no_such())?;
    let work = traces::spawn(async move { station.revoke_camera(caller.author(), camera, token).await });
    match work.await.map_err(of_lost_work)?.map_err(refusal::of)? {
        true => Ok(StatusCode::NO_CONTENT),
        false => Err(no_such()),
    }
}

/// Sends the parts that a camera found (`AddPoints`). The caller needs a grant for this camera, of any role,
/// and no lease. The audit log has the intent before they leave, and the outcome after. They are never sent
/// again.
#[utoipa::path(
    post,
    path = "/v1/robots/{name}/cameras/{camera}/points",
    operation_id = "add_points",
    params(
        ("name" = String, Path, description = "The name of the robot"),
        ("camera" = u16, Path, description = "The camera (`camID`), 0 to 999"),
        deadline::Deadline
    ),
    request_body = PointsRequest,
    responses(
        (
            status = 200,
            description = "The controller accepted them. It does not say whether a program uses them",
            body = PointsDone
        ),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (
            status = 409,
            description = "`stopped`, `not_ready`, `identity_changed`, `run_under_way`, `refused` (by the \
                           controller), `too_late`",
            body = Problem
        ),
        (status = 422, description = "`bad_value`: also if they do not fit into a frame", body = Problem),
        (status = 503, description = "`store_unavailable`, `overloaded`: nothing was sent", body = Problem),
        (status = 504, description = "`outcome_unknown`: the controller may have them", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn points(
    robot: Robot<Read>,
    named: Result<Path<Named>, PathRejection>,
    headers: HeaderMap,
    body: Result<Json<PointsRequest>, Refusal>,
) -> Result<axum::Json<PointsDone>, Refusal> {
    let Robot { caller, station, .. } = robot;
    let (camera, _) = read(named)?;
    let granted = granted(&caller, &station, camera).await?;
    let Json(PointsRequest { points }) = body?;
    deadline::check(&headers)?;
    if !(1..=MAX_POINTS).contains(&points.len()) {
        return Err(bad_value(format!("points has 1 to {MAX_POINTS} points, and here {}", points.len())));
    }
    let points = points.into_iter().map(point).collect();
    let by = caller.by();
    let work = traces::spawn(async move { station.add_points(&by, granted, points).await });
    work.await.map_err(of_lost_work)?.map(axum::Json).map_err(refusal::of)
}

/// Answers a photo that the controller asks for: the event `photo_requested` says so. The caller needs a
/// grant for this camera, and no lease. Controllers do not reply to this: 204 says that the answer left, and
/// not that it arrived. Points of the picture are sent on their own.
#[utoipa::path(
    post,
    path = "/v1/robots/{name}/cameras/{camera}/photo",
    operation_id = "answer_photo",
    params(
        ("name" = String, Path, description = "The name of the robot"),
        ("camera" = u16, Path, description = "The camera (`camID`), 0 to 999"),
        deadline::Deadline
    ),
    request_body = PhotoRequest,
    responses(
        (status = 204, description = "The answer left"),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (
            status = 409,
            description = "`not_ready`: also if the controller waits for no photo of this camera; `stopped`, \
                           `identity_changed`, `run_under_way`, `too_late`",
            body = Problem
        ),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 503, description = "`store_unavailable`, `overloaded`: nothing was sent", body = Problem),
        (status = 504, description = "`outcome_unknown`: it may have left", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn photo(
    robot: Robot<Read>,
    named: Result<Path<Named>, PathRejection>,
    headers: HeaderMap,
    body: Result<Json<PhotoRequest>, Refusal>,
) -> Result<StatusCode, Refusal> {
    let Robot { caller, station, .. } = robot;
    let (camera, _) = read(named)?;
    let granted = granted(&caller, &station, camera).await?;
    let Json(PhotoRequest { taken }) = body?;
    deadline::check(&headers)?;
    let by = caller.by();
    let work = traces::spawn(async move { station.answer_photo(&by, granted, taken).await });
    work.await.map_err(of_lost_work)?.map(|()| StatusCode::NO_CONTENT).map_err(refusal::of)
}

/// The grant of a caller. It is looked at before the body: who has none learns no more.
async fn granted(caller: &Caller, station: &Arc<Station>, camera: Camera) -> Result<Granted, Refusal> {
    station.granted(&caller.by(), camera, caller.token()).await.map_err(refusal::of)
}

/// The camera and the token in a path. The token is as the caller wrote it.
fn read(named: Result<Path<Named>, PathRejection>) -> Result<(Camera, String), Refusal> {
    let named = named.ok().and_then(|Path(Named { camera, token })| Some((Camera::read(&camera)?, token)));
    named.ok_or_else(|| bad_value(format!("the camera in the path is {}", Camera::WANTED)))
}

/// A point as the client has it.
fn point(of: CameraPoint) -> Point {
    let CameraPoint { model_id, x, y, z, u, v, angle, similarity, color, relative } = of;
    Point { model_id, x, y, z, u, v, angle, similarity, color, relative }
}
