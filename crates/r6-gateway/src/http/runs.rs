//! Runs of programs.

use axum::Json;
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{Path, Query, State as Of};
use axum::http::header::LOCATION;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use r6_api::gateway::{Run, RunRequest, Runs};
use r6_api::{Code, Problem};
use r6_http::Refusal;
use serde::Deserialize;
use sha2::{Digest, Sha256};
use utoipa::IntoParams;

use super::body::{WithProgram, key};
use super::caller::{Command, Read, Robot};
use super::described::{OfChange, OfRight};
use super::range::check_limit;
use super::{State, deadline, idempotency, refusal};
use crate::core::library::ProgramName;
use crate::fleet::run::Wish;
use crate::programs::check::check_length;
use crate::programs::run::{MAX_REPEAT, steps};
use crate::store::MAX_PAGE;
use crate::{problem, traces};

/// Runs a program on a robot, with the lease. The gateway feeds its steps, at most 10 ahead of the arm, and
/// stops the arm if the lease ends. The answer comes once the controller accepted the first list:
/// `GET /v1/robots/{name}/runs/{run}` tells the rest. A request with the same `Idempotency-Key` that asks
/// for the same gets the same answer within 24 h, and runs nothing again.
#[utoipa::path(
    post,
    path = "/v1/robots/{name}/programs/run",
    operation_id = "run_program",
    params(
        ("name" = String, Path, description = "The name of the robot"),
        (
            "Idempotency-Key" = String,
            Header,
            description = "1 to 128 visible characters, drawn anew for each run, such as a UUID"
        ),
        deadline::Deadline
    ),
    request_body = RunRequest,
    responses(
        (
            status = 202,
            description = "The controller accepted the first list",
            body = Run,
            headers(("Location" = String, description = "The run"))
        ),
        (
            status = 400,
            description = "`needs_idempotency_key`; `bad_json`, `bad_body`",
            body = Problem
        ),
        (status = 404, description = "`no_such_robot`, `no_such_program`", body = Problem),
        (
            status = 409,
            description = "`run_under_way`, `no_lease`, `stopped`, `not_ready`, `identity_changed`, `leftover_list`, \
                           `refused` (by the controller), `in_progress`, `no_room`, `other_text`, `too_late`",
            body = Problem
        ),
        (status = 422, description = "`bad_program`, `beyond_limits` of the guard, `bad_value`, `key_taken`", body = Problem),
        (status = 503, description = "`store_unavailable`, `overloaded`: nothing was sent", body = Problem),
        (status = 504, description = "`outcome_unknown`: the arm may have moved", body = Problem),
        (status = 408, description = "`too_slow`", body = Problem),
        (status = 413, description = "`too_long`", body = Problem),
        (status = 415, description = "`not_json`", body = Problem),
        OfChange,
    )
)]
pub async fn run(
    robot: Robot<Command>,
    Of(state): Of<State>,
    headers: HeaderMap,
    WithProgram(request): WithProgram<RunRequest>,
) -> Result<Response, Refusal> {
    let Robot { caller, station, .. } = robot;
    let idempotency_key = idempotency::required(&headers)?;
    let RunRequest { program, name, version, sha256, lease: _, repeat } = &request;
    let asked = (station.name(), program, name, version, repeat);
    // Without it as before, so that keys outlive a new version of the gateway.
    let hash = match sha256 {
        None => idempotency::hash(&asked)?,
        Some(sha256) => idempotency::hash(&(asked, sha256))?,
    };
    let owner = idempotency::owner(&caller);
    let before = station.answered_before(&owner, &idempotency_key, hash).await.map_err(refusal::of)?;
    let run = match before {
        Some(run) => run,
        None => {
            deadline::check(&headers)?;
            let held = key(&request.lease).map_err(|problem| {
                station.note_refused(&caller.by(), "run a program", problem.code);
                refusal::of(problem)
            })?;
            let repeat = request.repeat.unwrap_or(1);
            if !(1..=MAX_REPEAT).contains(&repeat) {
                return Err(bad_value(format!("repeat is from 1 to {MAX_REPEAT}")));
            }
            let wanted = request.sha256.clone();
            let is_hash =
                |text: &String| text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
            if wanted.as_ref().is_some_and(|wanted| !is_hash(wanted)) {
                return Err(bad_value("sha256 has 64 hexadecimal digits".to_owned()));
            }
            let (program, text) = text(&state, request).await?;
            let read = move || (Sha256::digest(&text), steps(&text, repeat));
            let (sha256, motion) = state.bench.compute_to_run(read).await.map_err(refusal::of)?;
            let sha256: String = sha256.iter().map(|byte| format!("{byte:02x}")).collect();
            if let Some(wanted) = wanted.filter(|wanted| !wanted.eq_ignore_ascii_case(&sha256)) {
                let message = format!(
                    "nothing was sent: the SHA-256 of the text is {sha256}, not {wanted}: read it and check it again"
                );
                return Err(refusal::of(problem::Problem::new(Code::OtherText, message)));
            }
            let wish = Wish {
                key: held,
                caller: owner,
                idempotency_key,
                hash,
                motion: motion.map_err(refusal::of)?,
                program,
                sha256,
                repeat,
            };
            let by = caller.by();
            let work = traces::spawn(station.run(by, wish));
            work.await.map_err(refusal::of_lost_work)?.map_err(refusal::of)?
        }
    };
    let location = format!("/v1/robots/{}/runs/{}", run.robot, run.run_id);
    Ok((StatusCode::ACCEPTED, [(LOCATION, location)], Json(run)).into_response())
}

/// Which runs.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Page {
    /// Only runs with smaller numbers: `next_before` of the last answer, to read on.
    before: Option<u64>,
    /// The largest number of runs, 1 to 1000.
    #[serde(default = "usual_limit")]
    #[param(minimum = 1, maximum = 1000, default = 100)]
    limit: usize,
}

fn usual_limit() -> usize {
    100
}

/// The runs of a robot, the newest first. Runs are kept for 24 h.
#[utoipa::path(
    get,
    path = "/v1/robots/{name}/runs",
    operation_id = "runs",
    params(("name" = String, Path, description = "The name of the robot"), Page),
    responses(
        (status = 200, description = "The runs as they stand", body = Runs),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (status = 422, description = "`bad_value`: a parameter is wrong", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        OfRight,
    )
)]
pub async fn list(
    robot: Robot<Read>,
    page: Result<Query<Page>, QueryRejection>,
) -> Result<Json<Runs>, Refusal> {
    let Query(Page { before, limit }) = page.map_err(refusal::of_query)?;
    check_limit(limit, MAX_PAGE)?;
    let runs = robot.station.runs_before(before.unwrap_or(u64::MAX), limit).await.map_err(refusal::of)?;
    let next_before = runs.last().filter(|_| runs.len() == limit).map(|run| run.run_id);
    Ok(Json(Runs { runs, next_before }))
}

/// A run of a program: how it stands, how far it is, and why it ended. Runs are kept for 24 h.
#[utoipa::path(
    get,
    path = "/v1/robots/{name}/runs/{run}",
    operation_id = "run",
    params(
        ("name" = String, Path, description = "The name of the robot"),
        ("run" = u64, Path, description = "The number of the run")
    ),
    responses(
        (status = 200, description = "The run as it stands", body = Run),
        (status = 404, description = "`no_such_robot`, `no_such_run`", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        OfRight,
    )
)]
pub async fn show(
    robot: Robot<Read>,
    path: Result<Path<(String, u64)>, PathRejection>,
) -> Result<Json<Run>, Refusal> {
    let none =
        || Refusal::not_found(Code::NoSuchRun, "this robot has no run with this number, or it is too old");
    let Path((_, number)) = path.map_err(|_| none())?;
    let run = robot.station.run_of(number).await.map_err(refusal::of)?;
    run.map(Json).ok_or_else(none)
}

/// The text of the program, and its name and version if the gateway keeps it.
async fn text(state: &State, request: RunRequest) -> Result<(Option<(ProgramName, u64)>, String), Refusal> {
    match request {
        RunRequest { program: Some(text), name: None, version: None, .. } => {
            check_length(&text).map_err(refusal::of)?;
            Ok((None, text))
        }
        RunRequest { program: None, name: Some(name), version, .. } => {
            let shown: String = name.chars().take(64).collect();
            let none = || {
                let message = format!("there is no program `{shown}`, or not this version");
                Refusal::not_found(Code::NoSuchProgram, message)
            };
            let name = ProgramName::new(&name).ok_or_else(none)?;
            let found = state.shared.keeper.program(name.clone(), version).await;
            let (kept, text) = found.map_err(|error| refusal::of(error.into()))?.ok_or_else(none)?;
            Ok((Some((name, kept.tag.version)), text))
        }
        _ => Err(bad_value("either program, or name with or without version".to_owned())),
    }
}

fn bad_value(message: String) -> Refusal {
    refusal::of(problem::Problem::new(Code::BadValue, message))
}
