//! The paths of the panel.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::rejection::{BytesRejection, PathRejection};
use axum::extract::{DefaultBodyLimit, Path, Request, State};
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::{Json, Router};
use r6_controller::program::MAX_TEXT_BYTES;
use r6_controller::{PanelAction, Refused};
use utoipa::OpenApi;
use utoipa_axum::router::{OpenApiRouter, UtoipaMethodRouterExt};
use utoipa_axum::routes;

use super::dto::{ActionDto, ControllerDto, ControllersDto, SnapshotDto};
use super::guard::guard;
use super::problem::{Problem, ProblemDto};
use crate::handle::ControllerHandle;

/// The longest body: the longest action has about a hundred bytes, and a program's name.
const MAX_BODY_BYTES: usize = 4096;

/// How long a request may take, its body included: the controller itself takes microseconds.
const REQUEST_TIME: Duration = Duration::from_secs(10);

/// The controllers of this process, in the order of their numbers.
pub(super) type Controllers = Arc<[ControllerHandle]>;

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
pub(super) fn routes() -> OpenApiRouter<Controllers> {
    OpenApiRouter::with_openapi(Api::openapi())
        .routes(routes!(list))
        .routes(routes!(show))
        .routes(routes!(act))
        .routes(routes!(load).layer(DefaultBodyLimit::max(MAX_TEXT_BYTES)))
        .routes(routes!(describe))
}

/// The panel of these controllers, which listens at this address.
pub(super) fn router(controllers: Controllers, address: SocketAddr) -> Router {
    let (router, _) = routes().split_for_parts();
    router
        .fallback(no_such_path)
        .method_not_allowed_fallback(no_such_method)
        .layer(DefaultBodyLimit::max(MAX_BODY_BYTES))
        .layer(middleware::from_fn(in_time))
        .layer(middleware::from_fn_with_state(address, guard))
        .with_state(controllers)
}

async fn in_time(request: Request, next: Next) -> Response {
    tokio::time::timeout(REQUEST_TIME, next.run(request)).await.unwrap_or_else(|_| {
        Problem::new(StatusCode::REQUEST_TIMEOUT, "too_slow", "the request did not come to its end in time")
            .into_response()
    })
}

/// The controllers of this process.
#[utoipa::path(get, path = "/v1/controllers", responses((status = 200, description = "All of them", body = ControllersDto)))]
async fn list(State(controllers): State<Controllers>) -> Json<ControllersDto> {
    let numbered = (1..).zip(controllers.iter());
    let controllers = numbered.map(|(number, controller)| ControllerDto::of(number, controller)).collect();
    Json(ControllersDto { controllers })
}

/// What a person would see at the machine.
#[utoipa::path(
    get,
    path = "/v1/controllers/{n}",
    params(("n" = usize, Path, description = "The number of the controller, from 1")),
    responses(
        (status = 200, description = "Now", body = SnapshotDto),
        (status = 404, description = "`no_such_controller`, `no_such_path`", body = ProblemDto),
    )
)]
async fn show(
    State(controllers): State<Controllers>,
    number: Result<Path<String>, PathRejection>,
) -> Result<Json<SnapshotDto>, Problem> {
    let (number, controller) = find(&controllers, &named(number)?)?;
    Ok(Json(SnapshotDto::of(number, controller)))
}

/// Does what a person does at the machine; the answer is what he would then see.
#[utoipa::path(
    post,
    path = "/v1/controllers/{n}/actions",
    params(("n" = usize, Path, description = "The number of the controller, from 1")),
    request_body = ActionDto,
    responses(
        (status = 200, description = "Done; a move has begun", body = SnapshotDto),
        (status = 400, description = "`bad_json`", body = ProblemDto),
        (status = 403, description = "`foreign_host`, `foreign_origin`", body = ProblemDto),
        (status = 404, description = "`no_such_controller`, `no_such_path`", body = ProblemDto),
        (status = 408, description = "`too_slow`", body = ProblemDto),
        (
            status = 409,
            description = "The machine refuses it now: `power_off`, `emergency_stop`, `alarm`, `not_homed`, `not_auto`, \
                           `not_manual`, `moving`, `no_global_speed`, `program`, `no_path`",
            body = ProblemDto
        ),
        (status = 413, description = "`too_long`", body = ProblemDto),
        (status = 415, description = "`not_json`", body = ProblemDto),
        (
            status = 422,
            description = "No such action, or one that is never possible: `bad_action`, `no_such_input`, \
                           `no_such_axis`, `no_distance`, `bad_speed`, `no_such_alarm`",
            body = ProblemDto
        ),
    )
)]
async fn act(
    State(controllers): State<Controllers>,
    number: Result<Path<String>, PathRejection>,
    headers: HeaderMap,
    body: Result<Bytes, BytesRejection>,
) -> Result<Json<SnapshotDto>, Problem> {
    let (number, controller) = find(&controllers, &named(number)?)?;
    if !is_json(&headers) {
        return Err(Problem::new(
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            "not_json",
            "send JSON, with `Content-Type: application/json`",
        ));
    }
    let body = whole(body, MAX_BODY_BYTES)?;
    let action: ActionDto = serde_json::from_slice(&body).map_err(|error| Problem::of_json(&error))?;
    let action = PanelAction::try_from(action).map_err(Problem::bad_action)?;
    controller.operate(&action)?;
    Ok(Json(SnapshotDto::of(number, controller)))
}

/// Loads a program, in place of one with the same name; `switch_program` chooses it. The answer is what a person would then see; the program
/// then survives a power cut, where the controllers keep their state.
#[utoipa::path(
    put,
    path = "/v1/controllers/{n}/programs/{name}",
    params(
        ("n" = usize, Path, description = "The number of the controller, from 1"),
        ("name" = String, Path, description = "How the program is called: 1 to 64 bytes"),
    ),
    request_body(content = String, content_type = "application/toml", description = "Its text, TOML or JSON"),
    responses(
        (status = 200, description = "Loaded", body = SnapshotDto),
        (status = 400, description = "`bad_body`", body = ProblemDto),
        (status = 403, description = "`foreign_host`, `foreign_origin`", body = ProblemDto),
        (status = 404, description = "`no_such_controller`, `no_such_path`", body = ProblemDto),
        (status = 408, description = "`too_slow`: the body, or the disk that keeps it", body = ProblemDto),
        (status = 409, description = "`power_off`, `program_running`, `moving`, `no_room`", body = ProblemDto),
        (status = 413, description = "`too_long`", body = ProblemDto),
        (status = 422, description = "`bad_program`, with the step that is wrong", body = ProblemDto),
    )
)]
async fn load(
    State(controllers): State<Controllers>,
    names: Result<Path<(String, String)>, PathRejection>,
    body: Result<Bytes, BytesRejection>,
) -> Result<Json<SnapshotDto>, Problem> {
    let (number, name) = named(names)?;
    let (number, controller) = find(&controllers, &number)?;
    let body = whole(body, MAX_TEXT_BYTES)?;
    let text = String::from_utf8(body.into()).map_err(|error| {
        let reason = format!("program `{name}`: the text is no UTF-8: {}", error.utf8_error());
        Problem::from(Refused::BadProgram { reason })
    })?;
    controller.operate_and_keep(&PanelAction::LoadProgram { name, text }).await?;
    Ok(Json(SnapshotDto::of(number, controller)))
}

/// What a path names, where it is text.
fn named<T>(path: Result<Path<T>, PathRejection>) -> Result<T, Problem> {
    let Path(names) = path.map_err(|_| {
        Problem::not_found(
            "no_such_path",
            "the path is no text: behind each `%` stand two digits of a byte of UTF-8",
        )
    })?;
    Ok(names)
}

/// A body that was read to its end.
fn whole(body: Result<Bytes, BytesRejection>, most: usize) -> Result<Bytes, Problem> {
    body.map_err(|rejection| match rejection.status() {
        StatusCode::PAYLOAD_TOO_LARGE => {
            let most = format!("the body is longer than {most} bytes");
            Problem::new(StatusCode::PAYLOAD_TOO_LARGE, "too_long", most)
        }
        _ => Problem::new(StatusCode::BAD_REQUEST, "bad_body", rejection.body_text()),
    })
}

/// This description.
#[utoipa::path(get, path = "/v1/openapi.json", responses((status = 200, description = "OpenAPI 3")))]
async fn describe() -> impl IntoResponse {
    ([(CONTENT_TYPE, "application/json")], super::openapi())
}

async fn no_such_path(uri: Uri) -> Problem {
    let path = uri.path();
    let known = [
        "/v1/controllers",
        "/v1/controllers/1",
        "/v1/controllers/1/actions",
        "/v1/controllers/1/programs/cell",
        "/v1/openapi.json",
    ];
    let message = match r6_proto::nearest(path, known) {
        Some(near) => format!("there is no `{path}`; nearest: `{near}`"),
        None => format!("there is no such path; there are: {}", known.join(", ")),
    };
    Problem::not_found("no_such_path", message)
}

async fn no_such_method() -> Problem {
    let message = "an action is a POST, a program is loaded with PUT, everything else is a GET";
    Problem::new(StatusCode::METHOD_NOT_ALLOWED, "no_such_method", message)
}

fn find<'c>(controllers: &'c Controllers, number: &str) -> Result<(usize, &'c ControllerHandle), Problem> {
    let told = number.parse::<usize>().ok();
    told.and_then(|told| Some((told, controllers.get(told.checked_sub(1)?)?))).ok_or_else(|| {
        let last = controllers.len();
        let there_are = if last == 1 { "there is 1".to_owned() } else { format!("there are 1 to {last}") };
        let number: String = number.chars().take(20).collect();
        Problem::not_found("no_such_controller", format!("there is no controller `{number}`: {there_are}"))
    })
}

/// A page of a browser can send forms and plain text without asking, but no JSON.
fn is_json(headers: &HeaderMap) -> bool {
    let kind = headers.get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default();
    kind.split(';').next().is_some_and(|kind| kind.trim().eq_ignore_ascii_case("application/json"))
}
