//! Fuzzes the panel over HTTP. Every request gets JSON in the documented form. Pages of other sites have no
//! access, and a refused request changes nothing.
//!
//! An input is up to four requests of lines: method, path, header lines up to an empty line, and a body with
//! its length in the two bytes before it.

use std::cell::RefCell;
use std::net::IpAddr;

use axum::body::Body;
use axum::http::{HeaderName, HeaderValue, Method, Request, StatusCode, Uri};
use http_body_util::BodyExt;
use hyper::service::Service;
use hyper_util::service::TowerToHyperService;
use r6_api::{Code, Problem};
use r6_controller::ControllerSnapshot;
use r6_sim::panel::router;
use r6_sim::{SimSettings, Simulation};
use serde_json::Value;
use tokio::runtime::{Builder, Runtime};

use crate::input::Input;

/// The maximum number of requests of an input.
const MOST_REQUESTS: usize = 4;

/// The address on which the panel believes to listen.
const ADDRESS: &str = "127.0.0.1:9770";

/// Every status in the description, and the two of any HTTP server.
const STATUSES: [u16; 11] = [200, 204, 400, 403, 404, 405, 408, 409, 413, 415, 422];

thread_local! {
    /// One runtime for all inputs of a thread, because creating one takes longer than running one input.
    static RUNTIME: RefCell<Option<Runtime>> = const { RefCell::new(None) };
}

/// Runs one input.
pub fn run(bytes: &[u8]) {
    RUNTIME.with_borrow_mut(|runtime| {
        let made = || {
            let built = Builder::new_current_thread().enable_time().start_paused(true).build();
            built.expect("a runtime of this thread")
        };
        runtime.get_or_insert_with(made).block_on(converse(bytes));
    });
}

async fn converse(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let settings = SimSettings { count: 2, ..SimSettings::default() };
    let simulation = Simulation::start_in_memory(settings).await.expect("controllers in memory");
    let address = ADDRESS.parse().expect("an address");
    let service = TowerToHyperService::new(router(simulation.controllers(), address));
    for _ in 0..MOST_REQUESTS {
        if input.is_empty() {
            break;
        }
        let Some((request, foreign)) = request(&mut input) else { continue };
        let told = format!("{} {} {:?}", request.method(), request.uri(), request.headers());
        let reads = !matches!(*request.method(), Method::POST | Method::PUT);
        let before = snapshots(&simulation);
        let Ok(response) = service.call(request).await;
        let status = response.status();
        assert!(STATUSES.contains(&status.as_u16()), "{status} for {told}");
        assert!(!foreign || status == StatusCode::FORBIDDEN, "{status} for a foreign request: {told}");
        let body = response.into_body().collect().await.expect("a body in memory").to_bytes();
        if !told.starts_with("HEAD ") {
            check_body(status, &body, &told);
        }
        if reads || !status.is_success() {
            assert_eq!(before, snapshots(&simulation), "{status}, and something has changed: {told}");
        }
    }
    simulation.shutdown().await.unwrap();
}

fn snapshots(simulation: &Simulation) -> Vec<ControllerSnapshot> {
    simulation.controllers().iter().map(r6_sim::ControllerHandle::snapshot).collect()
}

fn check_body(status: StatusCode, body: &[u8], told: &str) {
    let text = String::from_utf8_lossy(body);
    let json: Value =
        serde_json::from_slice(body).unwrap_or_else(|error| panic!("{error}: {text} to {told}"));
    if status.is_success() {
        assert!(json.is_object());
    } else {
        let problem: Problem = serde_json::from_value(json).unwrap_or_else(|error| panic!("{error}: {text}"));
        assert!(!problem.message.is_empty());
        assert!(problem.code != Code::Unknown, "{text}");
        assert!(problem.message.len() < 4096, "the problem is longer than the request may be: {text}");
    }
}

/// Reads the next request, and whether the panel must treat it as foreign; `None` if HTTP itself refuses it.
fn request(input: &mut Input<'_>) -> Option<(Request<Body>, bool)> {
    let method = Method::from_bytes(input.line());
    let uri = Uri::try_from(input.line());
    let mut headers = Vec::new();
    loop {
        let line = input.line();
        if line.is_empty() {
            break;
        }
        headers.push(line);
    }
    let length = usize::from(input.number());
    let body = input.bytes(length).to_vec();
    let mut request = Request::new(Body::from(body));
    *request.method_mut() = method.ok()?;
    *request.uri_mut() = uri.ok()?;
    for line in headers.into_iter().take(16) {
        let colon = line.iter().position(|byte| *byte == b':')?;
        let name = HeaderName::from_bytes(&line[..colon]).ok()?;
        let value = line[colon + 1..].trim_ascii();
        request.headers_mut().append(name, HeaderValue::from_bytes(value).ok()?);
    }
    let foreign = is_foreign(&request);
    Some((request, foreign))
}

/// Whether the panel must refuse a request: it names no host or several, or a host that is not this machine,
/// or it comes from a browser page of another site.
fn is_foreign(request: &Request<Body>) -> bool {
    let told =
        |name: &str| request.headers().get_all(name).iter().map(HeaderValue::as_bytes).collect::<Vec<_>>();
    let [host] = told("host")[..] else { return true };
    let own_origin = [b"http://", host].concat();
    !is_this_machine(host)
        || request.uri().authority().is_some_and(|host| !is_this_machine(host.as_str().as_bytes()))
        || told("origin").iter().any(|origin| !origin.eq_ignore_ascii_case(&own_origin))
        || told("sec-fetch-site").iter().any(|site| *site != b"none" && *site != b"same-origin")
}

/// Whether a host, with or without a port, is `localhost` or a loopback address. Any other name may be made
/// to point here.
fn is_this_machine(host: &[u8]) -> bool {
    let Ok(host) = std::str::from_utf8(host) else { return false };
    let (name, port) = match host.strip_prefix('[').and_then(|host| host.split_once(']')) {
        Some((address, port)) => (address, port),
        None => host.split_at(host.find(':').unwrap_or(host.len())),
    };
    let is_port = port.is_empty() || port.strip_prefix(':').is_some_and(|port| !port.contains('@'));
    let is_loopback = |address: IpAddr| address.to_canonical().is_loopback();
    is_port && (name.eq_ignore_ascii_case("localhost") || name.parse().is_ok_and(is_loopback))
}
