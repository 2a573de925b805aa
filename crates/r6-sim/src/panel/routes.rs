//! The paths of the panel.

use std::net::SocketAddr;
use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::rejection::{BytesRejection, PathRejection};
use axum::extract::{DefaultBodyLimit, Path, State};
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::middleware;
use axum::response::IntoResponse;
use axum::{Json, Router};
use r6_api::panel::{Action, Controllers, Faults, Snapshot};
use r6_api::{Code, Problem, Status};
use r6_controller::program::MAX_TEXT_BYTES;
use r6_controller::{PanelAction, Refused};
use r6_http::access::{Site, guard};
use r6_http::body::{in_time, keep_when_read, require_json, whole};
use r6_http::{Refusal, read_json};
use utoipa::OpenApi;
use utoipa_axum::router::{OpenApiRouter, UtoipaMethodRouterExt};
use utoipa_axum::routes;

use super::convert;
use crate::handle::ControllerHandle;

/// The longest body. The longest action has about a hundred bytes, plus a program's name.
const MAX_BODY_BYTES: usize = 4096;

/// The controllers of this process, in the order of their numbers.
pub(super) type Handles = Arc<[ControllerHandle]>;

#[derive(OpenApi)]
#[openapi(info(
    title = "r6 panel",
    description = "What a person does at a virtual controller: inputs, buttons, the mode key, the emergency stop, \
                   moving by hand. No login: it listens on this machine alone unless told otherwise, and pages of a \
                   browser cannot use it.",
    license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0")
))]
struct Api;

/// The paths with their description.
pub(super) fn routes() -> OpenApiRouter<Handles> {
    OpenApiRouter::with_openapi(Api::openapi())
        .routes(routes!(list))
        .routes(routes!(show))
        .routes(routes!(status))
        .routes(routes!(act))
        .routes(routes!(faults))
        .routes(routes!(load).layer(DefaultBodyLimit::max(MAX_TEXT_BYTES)))
        .routes(routes!(describe))
}

/// The panel of these controllers, which listens at this address.
pub(super) fn router(controllers: Handles, address: SocketAddr) -> Router {
    let (router, _) = routes().split_for_parts();
    router
        .fallback(no_such_path)
        .method_not_allowed_fallback(no_such_method)
        .layer(DefaultBodyLimit::max(MAX_BODY_BYTES))
        .layer(middleware::from_fn(keep_when_read))
        .layer(middleware::from_fn(in_time))
        .layer(middleware::from_fn_with_state(Site::new(address), guard))
        .with_state(controllers)
}

/// The controllers of this process.
#[utoipa::path(get, path = "/v1/controllers", responses(
    (status = 200, description = "All of them", body = Controllers),
    (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
    (status = 408, description = "`too_slow`", body = Problem),
))]
async fn list(State(controllers): State<Handles>) -> Json<Controllers> {
    let numbered = (1..).zip(controllers.iter());
    let controllers = numbered.map(|(number, controller)| convert::controller(number, controller)).collect();
    Json(Controllers { controllers })
}

/// What a person would see at the machine.
#[utoipa::path(
    get,
    path = "/v1/controllers/{n}",
    params(("n" = usize, Path, description = "The number of the controller, from 1")),
    responses(
        (status = 200, description = "Now", body = Snapshot),
        (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
        (status = 408, description = "`too_slow`", body = Problem),
        (status = 404, description = "`no_such_controller`, `no_such_path`", body = Problem),
    )
)]
async fn show(
    State(controllers): State<Handles>,
    number: Result<Path<String>, PathRejection>,
) -> Result<Json<Snapshot>, Refusal> {
    let (number, controller) = find(&controllers, &named(number)?)?;
    Ok(Json(convert::snapshot(number, controller)))
}

/// The state as the controller tells it over its port: the same JSON as `r6 status --json` prints.
#[utoipa::path(
    get,
    path = "/v1/controllers/{n}/status",
    params(("n" = usize, Path, description = "The number of the controller, from 1")),
    responses(
        (status = 200, description = "Now", body = Status),
        (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
        (status = 408, description = "`too_slow`", body = Problem),
        (status = 404, description = "`no_such_controller`, `no_such_path`", body = Problem),
    )
)]
async fn status(
    State(controllers): State<Handles>,
    number: Result<Path<String>, PathRejection>,
) -> Result<Json<Status>, Refusal> {
    let (_, controller) = find(&controllers, &named(number)?)?;
    Ok(Json(convert::status(controller)))
}

/// Does what an operator does at the machine, and returns the new state.
#[utoipa::path(
    post,
    path = "/v1/controllers/{n}/actions",
    params(("n" = usize, Path, description = "The number of the controller, from 1")),
    request_body = Action,
    responses(
        (status = 200, description = "Done; a move has begun", body = Snapshot),
        (status = 400, description = "`bad_json`", body = Problem),
        (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
        (status = 404, description = "`no_such_controller`, `no_such_path`", body = Problem),
        (status = 408, description = "`too_slow`", body = Problem),
        (
            status = 409,
            description = "The machine refuses it now: `power_off`, `emergency_stop`, `alarm`, `not_homed`, `not_auto`, \
                           `not_manual`, `moving`, `not_held`, `no_global_speed`, `program`, `no_path`, `no_room`",
            body = Problem
        ),
        (status = 413, description = "`too_long`", body = Problem),
        (status = 415, description = "`not_json`", body = Problem),
        (
            status = 422,
            description = "No such action, or an action that is never possible: `bad_action`, `no_such_input`, \
                           `no_such_axis`, `no_distance`, `bad_speed`, `no_such_alarm`, `bad_fault`",
            body = Problem
        ),
    )
)]
async fn act(
    State(controllers): State<Handles>,
    number: Result<Path<String>, PathRejection>,
    headers: HeaderMap,
    body: Result<Bytes, BytesRejection>,
) -> Result<Json<Snapshot>, Refusal> {
    let (number, controller) = find(&controllers, &named(number)?)?;
    require_json(&headers)?;
    let body = whole(body, MAX_BODY_BYTES)?;
    let action: Action = read_json(&body, Code::BadAction)?;
    convert::deed(action)?.to(controller).map_err(convert::refused)?;
    Ok(Json(convert::snapshot(number, controller)))
}

/// The faults that the controller can be given. Those that are in force are in its state.
#[utoipa::path(
    get,
    path = "/v1/controllers/{n}/faults",
    params(("n" = usize, Path, description = "The number of the controller, from 1")),
    responses(
        (status = 200, description = "All of them", body = Faults),
        (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
        (status = 404, description = "`no_such_controller`, `no_such_path`", body = Problem),
        (status = 408, description = "`too_slow`", body = Problem),
    )
)]
async fn faults(
    State(controllers): State<Handles>,
    number: Result<Path<String>, PathRejection>,
) -> Result<Json<Faults>, Refusal> {
    find(&controllers, &named(number)?)?;
    Ok(Json(convert::faults()))
}

/// Loads a program, and replaces one with the same name; `switch_program` chooses it.
/// The answer is the new state. If the controllers save their state, the program then survives a power cut.
#[utoipa::path(
    put,
    path = "/v1/controllers/{n}/programs/{name}",
    params(
        ("n" = usize, Path, description = "The number of the controller, from 1"),
        ("name" = String, Path, description = "How the program is called: 1 to 64 bytes"),
    ),
    request_body(content = String, content_type = "application/toml", description = "Its text, TOML or JSON"),
    responses(
        (status = 200, description = "Loaded", body = Snapshot),
        (status = 400, description = "`bad_body`", body = Problem),
        (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
        (status = 404, description = "`no_such_controller`, `no_such_path`", body = Problem),
        (status = 408, description = "`too_slow`: the body, or the disk that keeps it", body = Problem),
        (status = 409, description = "`power_off`, `program_running`, `moving`, `no_room`", body = Problem),
        (status = 413, description = "`too_long`", body = Problem),
        (status = 422, description = "`bad_program`, with the step that is wrong", body = Problem),
    )
)]
async fn load(
    State(controllers): State<Handles>,
    names: Result<Path<(String, String)>, PathRejection>,
    body: Result<Bytes, BytesRejection>,
) -> Result<Json<Snapshot>, Refusal> {
    let (number, name) = named(names)?;
    let (number, controller) = find(&controllers, &number)?;
    let body = whole(body, MAX_TEXT_BYTES)?;
    let text = String::from_utf8(body.into()).map_err(|error| {
        let reason = format!("program `{name}`: the text is no UTF-8: {}", error.utf8_error());
        convert::refused(Refused::BadProgram { reason })
    })?;
    controller.operate_and_keep(&PanelAction::LoadProgram { name, text }).await.map_err(convert::refused)?;
    Ok(Json(convert::snapshot(number, controller)))
}

/// The names in a path, if they are text.
fn named<T>(path: Result<Path<T>, PathRejection>) -> Result<T, Refusal> {
    let Path(names) = path.map_err(|_| {
        Refusal::not_found(
            Code::NoSuchPath,
            "the path is no text: behind each `%` stand two digits of a byte of UTF-8",
        )
    })?;
    Ok(names)
}

/// This description.
#[utoipa::path(get, path = "/v1/openapi.json", responses((status = 200, description = "OpenAPI 3")))]
async fn describe() -> impl IntoResponse {
    ([(CONTENT_TYPE, "application/json")], super::openapi())
}

async fn no_such_path(uri: Uri) -> Refusal {
    let path = uri.path();
    let known = [
        "/v1/controllers",
        "/v1/controllers/1",
        "/v1/controllers/1/status",
        "/v1/controllers/1/actions",
        "/v1/controllers/1/faults",
        "/v1/controllers/1/programs/cell",
        "/v1/openapi.json",
    ];
    let message = match r6_proto::nearest(path, known) {
        Some(near) => format!("there is no `{path}`; nearest: `{near}`"),
        None => format!("there is no such path; there are: {}", known.join(", ")),
    };
    Refusal::not_found(Code::NoSuchPath, message)
}

async fn no_such_method() -> Refusal {
    let message = "an action is a POST, a program is loaded with PUT, everything else is a GET";
    Refusal::new(StatusCode::METHOD_NOT_ALLOWED, Code::NoSuchMethod, message)
}

fn find<'c>(controllers: &'c Handles, number: &str) -> Result<(usize, &'c ControllerHandle), Refusal> {
    let told = number.parse::<usize>().ok();
    told.and_then(|told| Some((told, controllers.get(told.checked_sub(1)?)?))).ok_or_else(|| {
        let last = controllers.len();
        let there_are = if last == 1 { "there is 1".to_owned() } else { format!("there are 1 to {last}") };
        let number: String = number.chars().take(20).collect();
        Refusal::not_found(Code::NoSuchController, format!("there is no controller `{number}`: {there_are}"))
    })
}
