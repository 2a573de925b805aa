//! The API over HTTP. Each file has the routes of one thing.
//!
//! Everything needs a token or a session (`caller.rs`), except `/healthz`, the dashboard's own files, signing
//! in and one-time links.
//! What a route does runs to its end even if its caller hangs up.

mod alarms;
mod audit;
mod body;
mod caller;
mod cameras;
mod commands;
mod cookie;
mod csv;
mod deadline;
mod described;
mod etag;
mod forward;
mod health;
mod history;
mod idempotency;
mod leases;
mod metrics;
mod models;
mod page;
mod panel;
mod parquet;
mod points;
mod production;
mod programs;
mod query;
mod range;
mod raw_ports;
mod refusal;
mod refused;
mod robots;
mod runs;
mod sessions;
mod settings;
mod setup;
mod streams;
mod tokens;
mod users;

use std::sync::Arc;

use axum::extract::DefaultBodyLimit;
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, Method, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use axum::{Router, middleware};
use r6_api::Code;
use r6_client::RobotSettings;
use r6_http::Refusal;
use r6_http::access::{Site, guard};
use utoipa::openapi::security::{ApiKey, ApiKeyValue, Http, HttpAuthScheme, SecurityScheme};
use utoipa::{Modify, OpenApi};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use crate::DEFAULT_PORT;
use crate::accounts::Accounts;
use crate::auditor::Auditor;
use crate::certificate::Certificate;
use crate::fleet::Fleet;
use crate::fleet::station::Shared;
use crate::http::caller::Caller;
pub use crate::http::cookie::Cookie;
pub use crate::http::csv::table as history_table;
use crate::http::described::OfToken;
use crate::http::refused::Refused;
use crate::problem::Problem;
use crate::programs::bench::Bench;
use crate::raw_port::Switch;
use crate::settings::Settings;
use crate::tokens::Tokens;
use crate::traces;

/// What the routes work on.
#[derive(Clone, Debug)]
pub struct State {
    /// The robots.
    pub fleet: Arc<Fleet>,
    /// Who may use them.
    pub tokens: Arc<Tokens>,
    /// The users and their sessions.
    pub accounts: Arc<Accounts>,
    /// What signs the heads of the audit log; `None` if gateways share it, of which one does.
    pub auditor: Option<Arc<Auditor>>,
    /// What they share.
    pub shared: Arc<Shared>,
    /// Whether clients speak TLS with the gateway.
    pub is_secure: bool,
    /// The cookie of its sessions.
    pub cookie: Cookie,
    /// The certificate for that.
    pub certificate: Option<Certificate>,
    /// How to communicate with robots that are added.
    pub robot_settings: RobotSettings,
    /// The settings of the hall.
    pub settings: Arc<Settings>,
    /// Where programs are checked and planned.
    pub bench: Bench,
    /// The switch of the raw ports; `None` for a gateway that can have none.
    pub raw_ports: Option<Arc<Switch>>,
    /// The requests that were refused.
    pub refused: Arc<Refused>,
}

impl State {
    /// What signs the heads of the audit log.
    ///
    /// # Errors
    /// `no_owner`: another gateway does it.
    pub fn auditor(&self) -> Result<Arc<Auditor>, Problem> {
        let owners = &self.shared.owners;
        if let Some(auditor) = self.auditor.clone().or_else(|| owners.auditor()) {
            return Ok(auditor);
        }
        owners.check_hall()?;
        Err(Problem::new(Code::NoOwner, "the audit log has just come to this gateway: ask again"))
    }
}

#[derive(OpenApi)]
#[openapi(
    info(
        title = "r6 gateway",
        description = "Every robot of a hall behind one door: values, leases, commands, stops, events, the audit log. \
                       A stop over this API is an ordinary command on a network. It is not an emergency stop.",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0")
    ),
    security(("token" = []), ("session" = [])),
    components(schemas(r6_api::gateway::LiveRequest, r6_api::gateway::LiveMessage)),
    modifiers(&Schemes)
)]
struct Api;

/// Describes how a request names its token or its session.
struct Schemes;

impl Modify for Schemes {
    fn modify(&self, api: &mut utoipa::openapi::OpenApi) {
        let scheme = SecurityScheme::Http(Http::new(HttpAuthScheme::Bearer));
        let components = api.components.get_or_insert_default();
        components.add_security_scheme("token", scheme);
        let about = "Set by POST /v1/session. The number is the port that the gateway listens on. With TLS the name \
                     is __Host-r6_session_9780. A request that is no GET also needs the header X-CSRF-Token with the \
                     `csrf` of the session.";
        let usual = Cookie::new(DEFAULT_PORT, false);
        let cookie = ApiKey::Cookie(ApiKeyValue::with_description(usual.name(), about));
        components.add_security_scheme("session", SecurityScheme::ApiKey(cookie));
    }
}

/// The paths with their description.
fn routes() -> OpenApiRouter<State> {
    // The limit of a route counts before that of all routes.
    let with_programs = OpenApiRouter::new()
        .routes(routes!(programs::check))
        .routes(routes!(programs::plan))
        .routes(routes!(programs::show, programs::put, programs::remove))
        .routes(routes!(runs::run))
        .layer(DefaultBodyLimit::max(body::MAX_PROGRAM_BYTES));
    OpenApiRouter::with_openapi(Api::openapi())
        .merge(with_programs)
        .routes(routes!(points::list))
        .routes(routes!(points::show, points::put, points::remove))
        .routes(routes!(points::versions))
        .routes(routes!(programs::list))
        .routes(routes!(programs::versions))
        .routes(routes!(models::list))
        .routes(routes!(query::show))
        .routes(routes!(runs::list))
        .routes(routes!(runs::show))
        .routes(routes!(raw_ports::show, raw_ports::put))
        .routes(routes!(robots::list))
        .routes(routes!(robots::show, robots::put, robots::remove))
        .routes(routes!(leases::acquire, leases::release))
        .routes(routes!(commands::command))
        .routes(routes!(commands::stop))
        .routes(routes!(commands::clear_stopped))
        .routes(routes!(commands::forget_owed_stop))
        .routes(routes!(commands::accept_identity))
        .routes(routes!(cameras::list))
        .routes(routes!(cameras::points))
        .routes(routes!(cameras::photo))
        .routes(routes!(cameras::grant))
        .routes(routes!(cameras::revoke))
        .routes(routes!(panel::show, panel::act))
        .routes(routes!(panel::faults))
        .routes(routes!(streams::events))
        .routes(routes!(streams::live))
        .routes(routes!(alarms::all))
        .routes(routes!(alarms::show))
        .routes(routes!(alarms::acknowledge))
        .routes(routes!(alarms::shelve, alarms::unshelve))
        .routes(routes!(audit::page))
        .routes(routes!(audit::head))
        .routes(routes!(history::show))
        .routes(routes!(history::events::show))
        .routes(routes!(production::show))
        .routes(routes!(sessions::sign_in, sessions::show, sessions::sign_out))
        .routes(routes!(sessions::sign_in_with_token))
        .routes(routes!(sessions::sign_in_with_link))
        .routes(routes!(sessions::change_password))
        .routes(routes!(settings::show, settings::put))
        .routes(routes!(page::hall))
        .routes(routes!(page::robot))
        .routes(routes!(page::teach))
        .routes(routes!(page::teach_program))
        .routes(routes!(page::of_hall))
        .routes(routes!(page::asset))
        .routes(routes!(setup::page))
        .routes(routes!(setup::script))
        .routes(routes!(setup::set_up))
        .routes(routes!(users::list))
        .routes(routes!(users::put, users::remove))
        .routes(routes!(tokens::list, tokens::make))
        .routes(routes!(tokens::revoke))
        .routes(routes!(describe))
        .routes(routes!(health::healthz))
        .routes(routes!(health::readyz))
        .routes(routes!(metrics::metrics))
}

/// The API of a gateway that is reached like this.
pub fn router(state: State, site: Site) -> Router {
    let (router, _) = routes().split_for_parts();
    router
        .fallback(no_such_path)
        .method_not_allowed_fallback(no_such_method)
        .layer(DefaultBodyLimit::max(body::MAX_BYTES))
        .layer(middleware::from_fn_with_state(state.clone(), forward::pass_on))
        .layer(middleware::from_fn(traces::of_request))
        .layer(middleware::from_fn_with_state(site, guard))
        .layer(middleware::from_fn_with_state(Arc::clone(&state.refused), refused::count))
        .with_state(state)
}

/// The OpenAPI description of the gateway, as `GET /v1/openapi.json` returns it.
#[must_use]
pub fn openapi() -> String {
    let (_, mut api) = routes().split_for_parts();
    described::add_no_owner(&mut api);
    // A description that serde cannot write would be a fault of its derive; the test of the committed file
    // would fail.
    let mut text = api.to_pretty_json().unwrap_or_default();
    text.push('\n');
    text
}

/// This description.
#[utoipa::path(get, path = "/v1/openapi.json", responses(
    (status = 200, description = "OpenAPI 3"),
    OfToken,
))]
async fn describe(_caller: Caller) -> impl IntoResponse {
    ([(CONTENT_TYPE, "application/json")], openapi())
}

/// A browser at an address of no page gets the dashboard, which says so; paths of the API are told to a known
/// caller alone.
async fn no_such_path(
    caller: Result<Caller, Refusal>,
    method: Method,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    // A path that begins with two slashes is another host for scripts of the page.
    let is_no_page = uri.path().starts_with("/v1/") || uri.path().starts_with("//");
    if method == Method::GET && !is_no_page && page::wants_page(&headers) {
        return Ok(page::none());
    }
    caller?;
    let path: String = uri.path().chars().take(100).collect();
    Err(Refusal::not_found(
        Code::NoSuchPath,
        format!("there is no `{path}`; GET /v1/openapi.json names all paths"),
    ))
}

async fn no_such_method(_caller: Caller) -> Refusal {
    let message = "this path has no such method; GET /v1/openapi.json names all";
    Refusal::new(StatusCode::METHOD_NOT_ALLOWED, Code::NoSuchMethod, message)
}
