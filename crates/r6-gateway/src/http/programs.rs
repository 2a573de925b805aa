//! Programs: their check, their plan, and those that the gateway keeps.

use axum::Json;
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{Path, Query, State as Of};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use r6_api::gateway::{
    PlanRequest, ProgramChecked, ProgramPlan, ProgramText, ProgramVersion, ProgramVersions, ProgramWanted,
    Programs, StoredProgram,
};
use r6_api::{Code, Problem};
use r6_http::Refusal;
use r6_motion::RobotModel;
use serde::Deserialize;
use sha2::{Digest, Sha256};
use utoipa::IntoParams;

use super::State;
use super::body::WithProgram;
use super::caller::{Caller, Manager, StorePrograms};
use super::described::{OfBody, OfChange, OfToken};
use super::etag::{condition, with_etag};
use super::refusal::{self, bad_value};
use crate::core::library::ProgramName;
use crate::core::owner::Owned;
use crate::core::role::Right;
use crate::programs::plan::Wish;
use crate::programs::{check as checking, model, plan as planning};
use crate::store::{Kept, NewVersion};

/// The time between two samples of a plan: what a browser draws smoothly.
const USUAL_SAMPLE_MS: u32 = 20;

/// The shortest time between two samples, that of the player, and the longest.
const SAMPLE_MS: (u32, u32) = (2, 10_000);

/// The farthest position of an axis to begin at, degrees or mm: beyond all arms.
const FARTHEST: f64 = 1e6;

/// Checks the text of a program. Nothing is stored, and no robot is asked. Mistakes are told
/// together, the first 20 of them and how many more, and where each step can run.
#[utoipa::path(
    post,
    path = "/v1/programs/check",
    operation_id = "check_program",
    request_body = ProgramText,
    responses(
        (status = 200, description = "What was found; mistakes too are 200", body = ProgramChecked),
        (status = 422, description = "`bad_value`: the text is too long", body = Problem),
        (status = 503, description = "`overloaded`: other programs are being planned, or the robot is asked too much", body = Problem),
        (status = 504, description = "`no_reply`: the robot does not say where it stands", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn check(
    _caller: Caller,
    Of(state): Of<State>,
    WithProgram(ProgramText { program }): WithProgram<ProgramText>,
) -> Result<Json<ProgramChecked>, Refusal> {
    checking::check_length(&program).map_err(refusal::of)?;
    let report = state.bench.compute(move || checking::report(&program)).await;
    report.map(Json).map_err(refusal::of)
}

/// Plans a program: what an arm of a model would do, as `r6 plot` draws it. No robot moves. With the name of
/// a robot, the plan begins where that robot stands.
#[utoipa::path(
    post,
    path = "/v1/programs/plan",
    operation_id = "plan_program",
    request_body = PlanRequest,
    responses(
        (status = 200, description = "The plan, also of a program that an alarm ends", body = ProgramPlan),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (status = 409, description = "`not_ready`, `identity_changed`: its position is not known", body = Problem),
        (status = 422, description = "`bad_program`, `bad_value`", body = Problem),
        (status = 503, description = "`overloaded`: other programs are being checked or planned", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn plan(
    caller: Caller,
    Of(state): Of<State>,
    WithProgram(request): WithProgram<PlanRequest>,
) -> Result<Json<ProgramPlan>, Refusal> {
    let wish = wish(&caller, &state, request).await?;
    let plan = state.bench.compute(move || planning::plan(wish)).await;
    plan.and_then(|plan| plan).map(Json).map_err(refusal::of)
}

async fn wish(caller: &Caller, state: &State, request: PlanRequest) -> Result<Wish, Refusal> {
    let PlanRequest { program, model, robot, from, global_speed_percent, sample_ms } = request;
    checking::check_length(&program).map_err(refusal::of)?;
    let (model, stands) = arm(caller, state, model, robot, from.is_none()).await?;
    let from = from.or(stands).unwrap_or_default();
    if from.len() > model.axis_count() || from.iter().any(|axis| axis.abs() > FARTHEST) {
        let (name, count) = (&model.name, model.axis_count());
        return Err(bad_value(format!("from has at most {count} numbers, the axes of {name}")));
    }
    let global_speed = global_speed_percent.unwrap_or(100.0);
    if !(global_speed > 0.0 && global_speed <= 100.0) {
        return Err(bad_value("global_speed_percent is above 0 and at most 100"));
    }
    let sample_ms = sample_ms.unwrap_or(USUAL_SAMPLE_MS);
    let (shortest, longest) = SAMPLE_MS;
    if !(shortest..=longest).contains(&sample_ms) {
        return Err(bad_value(format!("sample_ms is from {shortest} to {longest}")));
    }
    Ok(Wish { text: program, model, from, global_speed, sample_ms: sample_ms.into() })
}

/// The model to plan with, and where the robot stands, if it is named and `reads` says so.
async fn arm(
    caller: &Caller,
    state: &State,
    model: Option<String>,
    robot: Option<String>,
    reads: bool,
) -> Result<(&'static RobotModel, Option<Vec<f64>>), Refusal> {
    match (model, robot) {
        (Some(name), None) => Ok((self::model(&name).map_err(bad_value)?, None)),
        (None, Some(name)) => {
            caller.must(Right::Read, &name)?;
            let owners = &state.shared.owners;
            let station = state.fleet.station(&name);
            let config = station.as_ref().map(|station| station.config()).or_else(|| owners.robot(&name));
            let config = config.ok_or_else(|| {
                let name: String = name.chars().take(40).collect();
                Refusal::not_found(Code::NoSuchRobot, format!("there is no robot `{name}`"))
            })?;
            let model = config.arm().ok_or_else(|| {
                bad_value(format!("`{name}` has no model: configure its `model`, or give one here"))
            })?;
            if !reads {
                return Ok((model, None));
            }
            // Where the arm stands, its owner alone knows.
            let station = station.ok_or_else(|| refusal::of(owners.no_owner(&Owned::Robot(config.name))))?;
            Ok((model, Some(station.position(model.axis_count()).await.map_err(refusal::of)?)))
        }
        (Some(_), Some(_)) | (None, None) => {
            let names: Vec<_> = RobotModel::names().collect();
            Err(bad_value(format!("either robot or model, which is one of {}", names.join(", "))))
        }
    }
}

/// The programs that the gateway keeps, each in its latest version.
#[utoipa::path(get, path = "/v1/programs", operation_id = "programs", responses(
    (status = 200, description = "All of them, without their texts", body = Programs),
    (status = 503, description = "`store_unavailable`", body = Problem),
    OfToken,
))]
pub async fn list(_caller: Caller, Of(state): Of<State>) -> Result<Json<Programs>, Refusal> {
    let programs = state.shared.keeper.programs().await.map_err(|error| refusal::of(error.into()))?;
    Ok(Json(Programs { programs: programs.into_iter().map(version).collect() }))
}

/// Which version.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Which {
    /// The number of the version; the latest if it is missing.
    pub version: Option<u64>,
}

/// A program that the gateway keeps. The header `ETag` is what `If-Match` takes to change it, if this is its
/// latest version. That of an earlier one is refused there.
#[utoipa::path(
    get,
    path = "/v1/programs/{program}",
    operation_id = "program",
    params(("program" = String, Path, description = "The name of the program"), Which),
    responses(
        (
            status = 200,
            description = "The version with its text",
            body = StoredProgram,
            headers(("ETag" = String, description = "Its version"))
        ),
        (status = 404, description = "`no_such_program`", body = Problem),
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
    let Query(Which { version: number }) = which.map_err(refusal::of_query)?;
    let name = known(path)?;
    let found = state.shared.keeper.program(name.clone(), number).await;
    let (kept, program) = found.map_err(|error| refusal::of(error.into()))?.ok_or_else(|| no_such(&name))?;
    let version = version(kept);
    Ok(with_etag(StatusCode::OK, version.etag.clone(), &StoredProgram { version, program }))
}

/// The versions of a program that the gateway keeps.
#[utoipa::path(
    get,
    path = "/v1/programs/{program}/versions",
    operation_id = "program_versions",
    params(("program" = String, Path, description = "The name of the program")),
    responses(
        (status = 200, description = "The last 50, the latest first, without their texts", body = ProgramVersions),
        (status = 404, description = "`no_such_program`", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        OfToken,
    )
)]
pub async fn versions(
    _caller: Caller,
    Of(state): Of<State>,
    path: Result<Path<String>, PathRejection>,
) -> Result<Json<ProgramVersions>, Refusal> {
    let name = known(path)?;
    let found = state.shared.keeper.program_versions(name.clone()).await;
    let versions = found.map_err(|error| refusal::of(error.into()))?;
    if versions.is_empty() {
        return Err(no_such(&name));
    }
    Ok(Json(ProgramVersions { versions: versions.into_iter().map(version).collect() }))
}

/// Stores a version of a program, with mistakes too. A program that is there is changed with `If-Match` and
/// the `ETag` of the version that the change began from. `If-None-Match: *` stores a new program only.
#[utoipa::path(
    put,
    path = "/v1/programs/{program}",
    operation_id = "put_program",
    params(
        ("program" = String, Path, description = "Its name: 1 to 64 characters of a to z, digits, - and _"),
        ("If-Match" = Option<String>, Header, description = "The `ETag` of the version that is changed"),
        ("If-None-Match" = Option<String>, Header, description = "`*`: only if there is no such program")
    ),
    request_body = ProgramWanted,
    responses(
        (
            status = 200,
            description = "A version was added",
            body = ProgramVersion,
            headers(("ETag" = String, description = "The new version"))
        ),
        (
            status = 201,
            description = "It is a new program",
            body = ProgramVersion,
            headers(("ETag" = String, description = "The new version"))
        ),
        (status = 409, description = "`no_room`", body = Problem),
        (status = 412, description = "`not_this_version`: it was changed, or it is not there", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 428, description = "`needs_if_match`", body = Problem),
        (status = 503, description = "`store_unavailable`, `overloaded`: nothing was stored", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn put(
    manager: Manager<StorePrograms>,
    Of(state): Of<State>,
    path: Result<Path<String>, PathRejection>,
    headers: HeaderMap,
    WithProgram(ProgramWanted { program: text }): WithProgram<ProgramWanted>,
) -> Result<Response, Refusal> {
    let name = path.ok().and_then(|Path(name)| ProgramName::new(&name));
    let name = name.ok_or_else(|| bad_value(format!("a program has {}", ProgramName::WANTED)))?;
    checking::check_length(&text).map_err(refusal::of)?;
    let condition = condition(&headers)?;
    let by = manager.caller.author();
    let read = move || {
        let checked = checking::read(&text);
        NewVersion {
            name,
            hash: Sha256::digest(&text).into(),
            text,
            by,
            kind: checking::kind(checked.kind),
            ok: checked.program.is_ok(),
            steps: checked.steps.len() as u64,
        }
    };
    let new = state.bench.compute_to_store(read).await.map_err(refusal::of)?;
    let work = tokio::spawn(async move { state.shared.keeper.put_program(new, condition).await });
    let kept = work.await.map_err(refusal::of_lost_work)?.map_err(|error| refusal::of(error.into()))?;
    let status = if kept.tag.version == 1 { StatusCode::CREATED } else { StatusCode::OK };
    let version = version(kept);
    Ok(with_etag(status, version.etag.clone(), &version))
}

/// Removes a program with all of its versions.
#[utoipa::path(
    delete,
    path = "/v1/programs/{program}",
    operation_id = "remove_program",
    params(
        ("program" = String, Path, description = "The name of the program"),
        ("If-Match" = Option<String>, Header, description = "The `ETag` of its latest version")
    ),
    responses(
        (status = 204, description = "It was removed"),
        (status = 404, description = "`no_such_program`", body = Problem),
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
    let work = tokio::spawn(async move { state.shared.keeper.remove_program(name, condition, by).await });
    let removed = work.await.map_err(refusal::of_lost_work)?;
    removed.map(|()| StatusCode::NO_CONTENT).map_err(|error| refusal::of(error.into()))
}

fn no_such(name: &ProgramName) -> Refusal {
    Refusal::not_found(Code::NoSuchProgram, format!("there is no program `{name}`, or not this version"))
}

/// The name in a path. A text that cannot be a name is the name of no program.
fn known(path: Result<Path<String>, PathRejection>) -> Result<ProgramName, Refusal> {
    let name = path.ok().and_then(|Path(name)| ProgramName::new(&name));
    name.ok_or_else(|| Refusal::not_found(Code::NoSuchProgram, "there is no program of this name"))
}

/// A version as the contract has it.
fn version(kept: Kept) -> ProgramVersion {
    let Kept { name, tag, bytes, stored_at, stored_by, kind, ok, steps } = kept;
    let (name, etag, sha256) = (name.to_string(), tag.etag(), tag.sha256());
    ProgramVersion { name, version: tag.version, etag, sha256, stored_at, stored_by, bytes, kind, ok, steps }
}
