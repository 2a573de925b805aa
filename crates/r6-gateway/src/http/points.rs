//! The points that the gateway keeps: places of arms, by name and with their versions.

use axum::Json;
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{Path, Query, State as Of};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use r6_api::gateway::{PointValue, PointVersions, PointWanted, StoredPoint, StoredPoints};
use r6_api::{Code, Problem};
use r6_http::Refusal;
use sha2::{Digest, Sha256};

use super::State;
use super::body;
use super::caller::{Caller, Manager, StorePrograms};
use super::described::{OfBody, OfChange, OfToken};
use super::etag::{condition, with_etag};
use super::programs::Which;
use super::refusal::{self, bad_value};
use crate::core::name::RobotName;
use crate::core::owner::Owned;
use crate::core::point::{PointName, check};
use crate::core::role::Right;
use crate::store::{KeptPoint, LibraryError, NewPoint, Store, StoreError};

/// The points that the gateway keeps, each in its latest version.
#[utoipa::path(get, path = "/v1/points", operation_id = "kept_points", responses(
    (status = 200, description = "All of them", body = StoredPoints),
    (status = 503, description = "`store_unavailable`", body = Problem),
    OfToken,
))]
pub async fn list(_caller: Caller, Of(state): Of<State>) -> Result<Json<StoredPoints>, Refusal> {
    let found = state.shared.keeper.work(|store| store.points()).await;
    let points = found.map_err(|error: StoreError| refusal::of(error.into()))?;
    Ok(Json(StoredPoints { points: points.into_iter().map(stored).collect::<Result<_, _>>()? }))
}

/// A point that the gateway keeps. The header `ETag` is what `If-Match` takes to change it, if this is its
/// latest version. That of an earlier one is refused there.
#[utoipa::path(
    get,
    path = "/v1/points/{point}",
    operation_id = "kept_point",
    params(("point" = String, Path, description = "The name of the point"), Which),
    responses(
        (
            status = 200,
            description = "The version",
            body = StoredPoint,
            headers(("ETag" = String, description = "Its version"))
        ),
        (status = 404, description = "`no_such_point`", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        OfToken,
    )
)]
pub async fn show(
    _caller: Caller,
    Of(state): Of<State>,
    path: Result<Path<String>, PathRejection>,
    which: Result<Query<Which>, QueryRejection>,
) -> Result<Response, Refusal> {
    let Query(Which { version }) = which.map_err(refusal::of_query)?;
    let name = known(path)?;
    let versions = all_versions(&state, &name).await?;
    let mut versions = versions.into_iter();
    let found = versions.find(|kept| version.is_none_or(|version| version == kept.tag.version));
    let point = stored(found.ok_or_else(|| no_such(&name))?)?;
    Ok(with_etag(StatusCode::OK, point.etag.clone(), &point))
}

/// The versions of a point that the gateway keeps.
#[utoipa::path(
    get,
    path = "/v1/points/{point}/versions",
    operation_id = "point_versions",
    params(("point" = String, Path, description = "The name of the point")),
    responses(
        (status = 200, description = "The last 50, the latest first", body = PointVersions),
        (status = 404, description = "`no_such_point`", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        OfToken,
    )
)]
pub async fn versions(
    _caller: Caller,
    Of(state): Of<State>,
    path: Result<Path<String>, PathRejection>,
) -> Result<Json<PointVersions>, Refusal> {
    let name = known(path)?;
    let versions = all_versions(&state, &name).await?;
    if versions.is_empty() {
        return Err(no_such(&name));
    }
    Ok(Json(PointVersions { versions: versions.into_iter().map(stored).collect::<Result<_, _>>()? }))
}

/// Stores a version of a point: the numbers of the body, or where the robot of the body stands now. A point
/// that is there is changed with `If-Match` and the `ETag` of the version that the change began from.
/// `If-None-Match: *` stores a new point only. Nothing moves.
#[utoipa::path(
    put,
    path = "/v1/points/{point}",
    operation_id = "put_point",
    params(
        ("point" = String, Path, description = "Its name: 1 to 64 characters of a to z, digits, - and _"),
        ("If-Match" = Option<String>, Header, description = "The `ETag` of the version that is changed"),
        ("If-None-Match" = Option<String>, Header, description = "`*`: only if there is no such point")
    ),
    request_body = PointWanted,
    responses(
        (
            status = 200,
            description = "A version was added",
            body = StoredPoint,
            headers(("ETag" = String, description = "The new version"))
        ),
        (
            status = 201,
            description = "It is a new point",
            body = StoredPoint,
            headers(("ETag" = String, description = "The new version"))
        ),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (
            status = 409,
            description = "`no_room`; `not_ready`: the robot does not answer, or moves; `identity_changed`",
            body = Problem
        ),
        (status = 412, description = "`not_this_version`: it was changed, or it is not there", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 428, description = "`needs_if_match`", body = Problem),
        (status = 503, description = "`store_unavailable`, `overloaded`: nothing was stored", body = Problem),
        (status = 504, description = "`no_reply` of the robot; `outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn put(
    manager: Manager<StorePrograms>,
    Of(state): Of<State>,
    path: Result<Path<String>, PathRejection>,
    headers: HeaderMap,
    body::Json(wanted): body::Json<PointWanted>,
) -> Result<Response, Refusal> {
    let name = path.ok().and_then(|Path(name)| PointName::new(&name));
    let name = name.ok_or_else(|| bad_value(format!("a point has {}", PointName::WANTED)))?;
    let condition = condition(&headers)?;
    let value = value(&manager.caller, &state, wanted).await?;
    let text = serde_json::to_string(&value).map_err(refusal::of_file)?;
    let hash = Sha256::digest(&text).into();
    let new = NewPoint { name, text, hash, by: manager.caller.author() };
    let kept = change(&state, move |store| store.put_point(&new, &condition)).await?;
    let status = if kept.tag.version == 1 { StatusCode::CREATED } else { StatusCode::OK };
    let point = stored(kept)?;
    Ok(with_etag(status, point.etag.clone(), &point))
}

/// Removes a point with all of its versions.
#[utoipa::path(
    delete,
    path = "/v1/points/{point}",
    operation_id = "remove_point",
    params(
        ("point" = String, Path, description = "The name of the point"),
        ("If-Match" = Option<String>, Header, description = "The `ETag` of its latest version")
    ),
    responses(
        (status = 204, description = "It was removed"),
        (status = 404, description = "`no_such_point`", body = Problem),
        (status = 412, description = "`not_this_version`: it was changed", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 428, description = "`needs_if_match`", body = Problem),
        (status = 503, description = "`store_unavailable`: it is still there", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
    )
)]
pub async fn remove(
    manager: Manager<StorePrograms>,
    Of(state): Of<State>,
    path: Result<Path<String>, PathRejection>,
    headers: HeaderMap,
) -> Result<StatusCode, Refusal> {
    let (name, condition, by) = (known(path)?, condition(&headers)?, manager.caller.author());
    change(&state, move |store| store.remove_point(&name, &condition, &by)).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Makes a change in the store, to its end even if the caller leaves.
async fn change<T: Send + 'static>(
    state: &State,
    make: impl FnOnce(&mut dyn Store) -> Result<T, LibraryError> + Send + 'static,
) -> Result<T, Refusal> {
    let keeper = state.shared.keeper.clone();
    let work = tokio::spawn(async move { keeper.work(|store| Ok(make(store))).await });
    let made = work.await.map_err(refusal::of_lost_work)?;
    made.map_err(LibraryError::from).flatten().map_err(|error| refusal::of(error.into()))
}

/// The value that a caller wants to store.
async fn value(caller: &Caller, state: &State, wanted: PointWanted) -> Result<PointValue, Refusal> {
    let PointWanted { robot, axes, pose, tool, work_frame, note } = wanted;
    let mut value = PointValue { robot, axes, pose, tool, work_frame, note };
    if let Some(name) = &value.robot {
        let no_such = || {
            let name: String = name.chars().take(40).collect();
            Refusal::not_found(Code::NoSuchRobot, format!("there is no robot `{name}`"))
        };
        let known = RobotName::new(name).ok_or_else(no_such)?;
        caller.must(Right::Read, name)?;
        let owners = &state.shared.owners;
        let station = state.fleet.station(name);
        if station.is_none() && owners.robot(name).is_none() {
            return Err(no_such());
        }
        if value.axes.is_none() && value.pose.is_none() {
            // Where the arm stands, its owner alone knows.
            let station = station.ok_or_else(|| refusal::of(owners.no_owner(&Owned::Robot(known))))?;
            let (axes, pose) = station.stands().await.map_err(refusal::of)?;
            (value.axes, value.pose) = (Some(axes), pose);
        }
    }
    check(&value).map_err(bad_value)?;
    Ok(value)
}

async fn all_versions(state: &State, name: &PointName) -> Result<Vec<KeptPoint>, Refusal> {
    let name = name.clone();
    let found = state.shared.keeper.work(move |store| store.point_versions(&name)).await;
    found.map_err(|error: StoreError| refusal::of(error.into()))
}

fn no_such(name: &PointName) -> Refusal {
    Refusal::not_found(Code::NoSuchPoint, format!("there is no point `{name}`, or not this version"))
}

/// The name in a path. A text that cannot be a name is the name of no point.
fn known(path: Result<Path<String>, PathRejection>) -> Result<PointName, Refusal> {
    let name = path.ok().and_then(|Path(name)| PointName::new(&name));
    name.ok_or_else(|| Refusal::not_found(Code::NoSuchPoint, "there is no point of this name"))
}

/// A version as the contract has it.
fn stored(kept: KeptPoint) -> Result<StoredPoint, Refusal> {
    let KeptPoint { name, tag, stored_at, stored_by, text } = kept;
    let (name, etag, sha256) = (name.to_string(), tag.etag(), tag.sha256());
    let unreadable = |_| refusal::of(StoreError::Unreadable(format!("the point `{name}`")).into());
    let value = serde_json::from_str(&text).map_err(unreadable)?;
    Ok(StoredPoint { name, version: tag.version, etag, sha256, stored_at, stored_by, value })
}
