//! Spans of requests, commands and stops, for traces.
//!
//! They have the level TRACE and the target [`TARGET`], so that they are made only for a subscriber that
//! asks for them; `r6-traces` does. They name methods, routes, robots, commands and outcomes, and never a
//! token, a user or the body of a request. Polls have no spans: a hall has thousands of them each second.

use std::sync::OnceLock;

use axum::extract::{MatchedPath, Request};
use axum::http::HeaderMap;
use axum::middleware::Next;
use axum::response::Response;
use tokio::task::JoinHandle;
use tracing::field::Empty;
use tracing::{Instrument, Span, trace_span};

/// The target of all spans of this crate.
pub const TARGET: &str = "r6_gateway::traces";

/// Makes the span of a request a part of the trace that its headers name.
pub type JoinCaller = fn(&Span, &HeaderMap);

static JOIN_CALLER: OnceLock<JoinCaller> = OnceLock::new();

/// From now on, requests join the traces of their callers by this function. The first call counts: a
/// process has one subscriber, too.
pub fn join_callers(join: JoinCaller) {
    let _ = JOIN_CALLER.set(join);
}

/// Serves a request in a span of its own. Requests that no route takes have the name of their method alone,
/// because their paths are texts of strangers.
pub(crate) async fn of_request(request: Request, next: Next) -> Response {
    let route = request.extensions().get::<MatchedPath>().map_or("", MatchedPath::as_str);
    let span = trace_span!(
        target: TARGET,
        "request",
        otel.name = %format_args!("{} {route}", request.method()).to_string().trim_end(),
        otel.kind = "server",
        otel.status_code = Empty,
        http.request.method = %request.method(),
        http.route = route,
        http.response.status_code = Empty,
    );
    if span.is_disabled() {
        return next.run(request).await;
    }
    if let Some(join) = JOIN_CALLER.get() {
        join(&span, request.headers());
    }
    let response = next.run(request).instrument(span.clone()).await;
    let status = response.status();
    span.record("http.response.status_code", i64::from(status.as_u16()));
    if status.is_server_error() {
        span.record("otel.status_code", "ERROR");
    }
    response
}

/// The span of a command of a robot, or of a stop.
pub(crate) fn of_command(robot: &str, command: &str) -> Span {
    trace_span!(
        target: TARGET,
        "command",
        otel.name = command_name(command),
        otel.status_code = Empty,
        r6.robot = robot,
        r6.command_id = Empty,
        r6.outcome = Empty,
    )
}

/// Notes in the present span of a command what became of it.
pub(crate) fn note_outcome(command_id: Option<u64>, outcome: &str, is_error: bool) {
    let span = Span::current();
    if let Some(id) = command_id {
        span.record("r6.command_id", id);
    }
    span.record("r6.outcome", outcome);
    if is_error {
        span.record("otel.status_code", "ERROR");
    }
}

/// Does something in a task of its own, in the present span: it runs to its end even if its caller goes
/// away.
pub(crate) fn spawn<T: Send + 'static>(work: impl Future<Output = T> + Send + 'static) -> JoinHandle<T> {
    tokio::spawn(work.in_current_span())
}

/// A part of a command in its span: what is waited for.
pub(crate) async fn part<T>(name: &'static str, work: impl Future<Output = T>) -> T {
    let span = trace_span!(target: TARGET, "part", otel.name = name);
    work.instrument(span).await
}

/// The first word of a command, so that traces of one command have one name whatever its arguments are.
fn command_name(command: &str) -> &str {
    command.split_whitespace().next().unwrap_or(command)
}
