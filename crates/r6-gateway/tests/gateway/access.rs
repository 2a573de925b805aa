//! Who may use the gateway: tokens, roles, and each route of the description.

use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use r6_sim::VirtualController;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::support::{Browser, Hall, PATIENCE, Stream, call, cookie_name, name, request};

/// Who may use a route.
#[derive(Clone, Copy)]
pub enum Needs {
    /// Everybody.
    Nothing,
    /// A token or a user with this role or a higher one.
    Role(Role),
    /// Any user, and no token.
    User,
    /// A grant that is not a role: without it, no role is enough.
    Grant,
}

/// What each route needs. A route that is not here fails the test.
const ROUTES: [(&str, &str, Needs); 77] = [
    ("GET", "/healthz", Needs::Nothing),
    ("GET", "/metrics", Needs::Role(Role::Viewer)),
    ("GET", "/readyz", Needs::Role(Role::Viewer)),
    ("GET", "/v1/audit", Needs::Role(Role::Engineer)),
    ("GET", "/v1/audit/head", Needs::Role(Role::Engineer)),
    ("GET", "/v1/events", Needs::Role(Role::Viewer)),
    ("GET", "/v1/live", Needs::Role(Role::Viewer)),
    ("GET", "/v1/openapi.json", Needs::Role(Role::Viewer)),
    ("GET", "/v1/robots", Needs::Role(Role::Viewer)),
    ("GET", "/v1/robots/{name}", Needs::Role(Role::Viewer)),
    ("PUT", "/v1/robots/{name}", Needs::Role(Role::Admin)),
    ("DELETE", "/v1/robots/{name}", Needs::Role(Role::Admin)),
    ("POST", "/v1/robots/{name}/accept-identity", Needs::Role(Role::Engineer)),
    ("POST", "/v1/robots/{name}/forget-owed-stop", Needs::Role(Role::Admin)),
    ("POST", "/v1/robots/{name}/clear-stopped", Needs::Role(Role::Operator)),
    ("POST", "/v1/robots/{name}/commands", Needs::Role(Role::Operator)),
    ("GET", "/v1/robots/{name}/history", Needs::Role(Role::Viewer)),
    ("DELETE", "/v1/robots/{name}/lease", Needs::Role(Role::Operator)),
    ("POST", "/v1/robots/{name}/lease", Needs::Role(Role::Operator)),
    ("POST", "/v1/robots/{name}/stop", Needs::Role(Role::Operator)),
    ("GET", "/v1/robots/{name}/cameras", Needs::Role(Role::Viewer)),
    ("POST", "/v1/robots/{name}/cameras/{camera}/points", Needs::Grant),
    ("POST", "/v1/robots/{name}/cameras/{camera}/photo", Needs::Grant),
    ("POST", "/v1/robots/{name}/cameras/{camera}/grants", Needs::Role(Role::Admin)),
    ("DELETE", "/v1/robots/{name}/cameras/{camera}/grants/{token}", Needs::Role(Role::Admin)),
    ("GET", "/v1/robots/{name}/panel", Needs::Role(Role::Viewer)),
    ("POST", "/v1/robots/{name}/panel", Needs::Role(Role::Operator)),
    ("GET", "/v1/robots/{name}/panel/faults", Needs::Role(Role::Viewer)),
    ("GET", "/", Needs::Nothing),
    ("GET", "/robots/{name}", Needs::Nothing),
    ("GET", "/robots/{name}/teach", Needs::Nothing),
    ("GET", "/robots/{name}/teach/{program}", Needs::Nothing),
    ("GET", "/{page}", Needs::Nothing),
    ("GET", "/v1/models", Needs::Role(Role::Viewer)),
    ("GET", "/assets/{file}", Needs::Nothing),
    ("GET", "/setup", Needs::Nothing),
    ("GET", "/setup.js", Needs::Nothing),
    ("POST", "/v1/setup", Needs::Nothing),
    ("POST", "/v1/session", Needs::Nothing),
    ("POST", "/v1/session/token", Needs::Nothing),
    ("POST", "/v1/session/link", Needs::Nothing),
    ("GET", "/v1/session", Needs::Role(Role::Viewer)),
    ("DELETE", "/v1/session", Needs::User),
    ("PUT", "/v1/session/password", Needs::User),
    ("GET", "/v1/tokens", Needs::Role(Role::Admin)),
    ("POST", "/v1/tokens", Needs::Role(Role::Admin)),
    ("DELETE", "/v1/tokens/{number}", Needs::Role(Role::Admin)),
    ("GET", "/v1/users", Needs::Role(Role::Admin)),
    ("PUT", "/v1/users/{name}", Needs::Role(Role::Admin)),
    ("DELETE", "/v1/users/{name}", Needs::Role(Role::Admin)),
    ("GET", "/v1/points", Needs::Role(Role::Viewer)),
    ("GET", "/v1/points/{point}", Needs::Role(Role::Viewer)),
    ("PUT", "/v1/points/{point}", Needs::Role(Role::Engineer)),
    ("DELETE", "/v1/points/{point}", Needs::Role(Role::Engineer)),
    ("GET", "/v1/points/{point}/versions", Needs::Role(Role::Viewer)),
    ("GET", "/v1/programs", Needs::Role(Role::Viewer)),
    ("POST", "/v1/programs/check", Needs::Role(Role::Viewer)),
    ("POST", "/v1/programs/plan", Needs::Role(Role::Viewer)),
    ("GET", "/v1/programs/{program}", Needs::Role(Role::Viewer)),
    ("PUT", "/v1/programs/{program}", Needs::Role(Role::Engineer)),
    ("DELETE", "/v1/programs/{program}", Needs::Role(Role::Engineer)),
    ("GET", "/v1/programs/{program}/versions", Needs::Role(Role::Viewer)),
    ("POST", "/v1/robots/{name}/programs/run", Needs::Role(Role::Operator)),
    ("GET", "/v1/robots/{name}/runs", Needs::Role(Role::Viewer)),
    ("GET", "/v1/robots/{name}/runs/{run}", Needs::Role(Role::Viewer)),
    ("GET", "/v1/robots/{name}/query", Needs::Role(Role::Viewer)),
    ("GET", "/v1/robots/{name}/history/events", Needs::Role(Role::Viewer)),
    ("GET", "/v1/robots/{name}/production", Needs::Role(Role::Viewer)),
    ("GET", "/v1/settings", Needs::Role(Role::Viewer)),
    ("PUT", "/v1/settings", Needs::Role(Role::Admin)),
    ("GET", "/v1/raw-ports", Needs::Role(Role::Viewer)),
    ("PUT", "/v1/raw-ports", Needs::Role(Role::Engineer)),
    ("GET", "/v1/alarms", Needs::Role(Role::Viewer)),
    ("GET", "/v1/robots/{name}/alarms", Needs::Role(Role::Viewer)),
    ("POST", "/v1/robots/{name}/alarms/{id}/acknowledge", Needs::Role(Role::Operator)),
    ("POST", "/v1/robots/{name}/alarms/{id}/shelve", Needs::Role(Role::Engineer)),
    ("DELETE", "/v1/robots/{name}/alarms/{id}/shelve", Needs::Role(Role::Engineer)),
];

/// The routes of the description, methods in upper case.
pub fn described() -> Vec<(String, String)> {
    let api: Value = serde_json::from_str(&r6_gateway::openapi()).unwrap();
    let paths = api["paths"].as_object().unwrap();
    let routes = paths.iter().flat_map(|(path, methods)| {
        let methods = methods.as_object().unwrap().keys();
        methods.map(|method| (method.to_uppercase(), path.clone()))
    });
    routes.collect()
}

/// What a route needs, and a path of it.
pub fn needs(method: &str, path: &str) -> (Needs, String) {
    let row = ROUTES.iter().find(|(m, p, _)| *m == method && *p == path);
    let Some((_, _, needs)) = row else { panic!("{method} {path} has no row in this test") };
    let path = path.replace("{name}", "press").replace("{number}", "press").replace("{id}", "7");
    let path = path.replace("{program}", "pick").replace("{point}", "pick").replace("{run}", "1");
    (*needs, path.replace("{camera}", "0").replace("{token}", "7"))
}

/// The status of a request that is allowed, and that has a body with no field of the route.
pub fn of_nonsense(method: &str, path: &str) -> u16 {
    match (method, path) {
        // The robot is in the configuration, so it is not removed.
        ("DELETE", "/v1/robots/{name}") => 409,
        // There is no such user, token, program or alarm.
        (
            "DELETE",
            "/v1/users/{name}" | "/v1/tokens/{number}" | "/v1/programs/{program}" | "/v1/points/{point}",
        ) => 404,
        ("DELETE", "/v1/robots/{name}/alarms/{id}/shelve") => 404,
        // No token has this grant.
        ("DELETE", "/v1/robots/{name}/cameras/{camera}/grants/{token}") => 404,
        _ => 422,
    }
}

#[tokio::test]
async fn every_route_refuses_strangers_and_lower_roles() {
    let hall = Hall::start().await;
    let tokens = [&hall.viewer, &hall.operator, &hall.engineer, &hall.admin];
    let of_another =
        r6_gateway::make_token(hall.data.path(), Role::Admin, Some(name("saw").into()), String::new());
    let of_another = of_another.unwrap().1;
    assert_eq!(described().len(), ROUTES.len());
    for (method, path) in described() {
        let (needs, concrete) = needs(&method, &path);
        if matches!(needs, Needs::Nothing) {
            continue;
        }
        // No route has such a field, so nothing is carried out.
        let body = (method != "GET").then(|| json!({ "no": "such field" }));
        for stranger in ["", "r6_0000", "Bearer", &"x".repeat(5000)] {
            let (status, problem) = hall.call(stranger, &method, &concrete, body.as_ref()).await;
            assert_eq!((status, &problem["code"]), (401, &json!("no_token")), "{method} {path}");
        }
        for (role, token) in Role::ALL.into_iter().zip(tokens) {
            let is_allowed = matches!(needs, Needs::Role(lowest) if role >= lowest);
            if !is_allowed {
                let (status, problem) = hall.call(token, &method, &concrete, body.as_ref()).await;
                let told = (status, &problem["code"]);
                assert_eq!(told, (403, &json!("not_allowed")), "{method} {path} {role:?}");
            } else if method != "GET" && !path.ends_with("/stop") {
                let (status, problem) = hall.call(token, &method, &concrete, body.as_ref()).await;
                assert_eq!(status, of_nonsense(&method, &path), "{method} {path} {role:?}: {problem}");
            }
        }
        // Users and tokens are for no single robot.
        let is_for_all = ["/users", "/tokens"].iter().any(|part| path.contains(part));
        if path.contains("{name}") || is_for_all || (method == "PUT" && path == "/v1/raw-ports") {
            let (status, problem) = hall.call(&of_another, &method, &concrete, body.as_ref()).await;
            assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")), "{method} {path}");
        }
    }
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["stopped"], false, "it was not stopped");
}

#[tokio::test]
async fn every_route_refuses_pages_without_proof_and_lower_roles_of_users() {
    let hall = Hall::start().await;
    let mut browsers = Vec::new();
    for role in Role::ALL {
        hall.user(role.word(), role).await;
        browsers.push((role, hall.browser(role.word()).await));
    }
    let address = hall.gateway.address();
    let named = cookie_name(address);
    let cookie = |text: &str| format!("Cookie: {named}={text}\r\n");
    for (method, path) in described() {
        let (needs, concrete) = needs(&method, &path);
        if matches!(needs, Needs::Nothing) {
            continue;
        }
        let body = (method != "GET").then(|| json!({ "no": "such field" }));
        let two = cookie(&format!("0000; {named}=1111"));
        for stranger in [cookie(""), cookie("0000"), cookie(&"0".repeat(64)), two] {
            let answer = request(address, &stranger, &method, &concrete, body.as_ref()).await;
            assert_eq!((answer.status, &answer.body["code"]), (401, &json!("no_session")), "{method} {path}");
        }
        for (role, browser) in &browsers {
            let told = |(status, problem): (u16, Value)| (status, problem["code"].clone());
            if method != "GET" {
                let bare = told(browser.bare(&method, &concrete, body.as_ref()).await);
                assert_eq!(bare, (403, json!("bad_csrf")), "{method} {path} {role:?}");
                for proof in ["", "0", &"0".repeat(64), &browsers[0].1.csrf[..63]] {
                    let headers = format!("{}X-CSRF-Token: {proof}\r\n", browser.headers());
                    let answer = request(address, &headers, &method, &concrete, body.as_ref()).await;
                    assert_eq!(answer.body["code"], "bad_csrf", "{method} {path} {role:?} {proof}");
                }
            }
            let is_allowed = match needs {
                Needs::Nothing | Needs::User => true,
                Needs::Grant => false,
                Needs::Role(lowest) => *role >= lowest,
            };
            if !is_allowed {
                let refused = told(browser.call(&method, &concrete, body.as_ref()).await);
                assert_eq!(refused, (403, json!("not_allowed")), "{method} {path} {role:?}");
            } else if method != "GET" && !path.ends_with("/stop") && path != "/v1/session" {
                let (status, problem) = browser.call(&method, &concrete, body.as_ref()).await;
                assert_eq!(status, of_nonsense(&method, &path), "{method} {path} {role:?}: {problem}");
            }
        }
    }
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["stopped"], false, "it was not stopped");
}

#[tokio::test]
async fn health_needs_no_token_and_an_unknown_path_does() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    assert_eq!(call(address, "", "GET", "/healthz", None).await.0, 204);
    assert_eq!(call(address, "", "GET", "/v1/no-such-path", None).await.0, 401);
    let (status, problem) = hall.call(&hall.viewer, "GET", "/v1/no-such-path", None).await;
    assert_eq!((status, &problem["code"]), (404, &json!("no_such_path")));
    let (status, problem) = hall.call(&hall.viewer, "PUT", "/v1/robots", None).await;
    assert_eq!((status, &problem["code"]), (405, &json!("no_such_method")));
    let ready = hall.get(&hall.viewer, "/readyz").await;
    assert_eq!(ready, json!({ "store": true, "robots": 1, "robots_up": 1, "history": "kept" }));
}

#[tokio::test]
async fn a_token_works_at_once_and_is_refused_soon_after_it_is_revoked() {
    let hall = Hall::start().await;
    let made = r6_gateway::make_token(hall.data.path(), Role::Viewer, None, "screen".to_owned());
    let (number, token) = made.unwrap();
    assert!(token.len() == 67 && token.starts_with("r6_"), "{token}");
    hall.get(&token, "/v1/robots").await;
    assert_eq!(r6_gateway::revoke_token(hall.data.path(), number), Ok(true));
    let revoked = Instant::now();
    while hall.call(&token, "GET", "/v1/robots", None).await.0 != 401 {
        assert!(revoked.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let listed = r6_gateway::list_tokens(hall.data.path()).unwrap();
    assert!(listed.iter().all(|known| known.number != number));
    // No file has the token.
    for entry in std::fs::read_dir(hall.data.path()).unwrap() {
        let path = entry.unwrap().path();
        // The folder of the history has values alone.
        if path.is_dir() {
            continue;
        }
        let bytes = std::fs::read(path).unwrap();
        let secret = token.strip_prefix("r6_").unwrap().as_bytes();
        assert!(!bytes.windows(secret.len()).any(|window| window == secret));
    }
}

#[tokio::test]
async fn a_token_for_one_robot_sees_no_other() {
    let robots = [VirtualController::start().await, VirtualController::start().await];
    let hall = Hall::with(robots.map(Result::unwrap).into()).await;
    let only =
        r6_gateway::make_token(hall.data.path(), Role::Engineer, Some(name("saw").into()), String::new());
    let only = only.unwrap().1;
    let names = |robots: Value| -> Vec<String> {
        let robots = robots["robots"].as_array().unwrap().clone();
        robots.iter().map(|robot| robot["name"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(names(hall.get(&hall.viewer, "/v1/robots").await), ["press", "saw"]);
    assert_eq!(names(hall.get(&only, "/v1/robots").await), ["saw"]);
    // It cannot even tell which robots there are.
    for robot in ["press", "no-such-robot", "%FF", "..%2f"] {
        assert_eq!(hall.call(&only, "GET", &format!("/v1/robots/{robot}"), None).await.0, 403, "{robot}");
    }
    assert_eq!(hall.call(&only, "GET", "/v1/live?robot=press", None).await.0, 403);
    assert_eq!(hall.get(&hall.viewer, "/readyz").await["robots"], 2);
    assert_eq!(hall.get(&only, "/readyz").await["robots"], 1);
    hall.lease(&hall.operator, "press").await;
    hall.lease(&only, "saw").await;
    let seen = hall.get(&only, "/v1/audit").await;
    let entries = seen["entries"].as_array().unwrap();
    assert!(!entries.is_empty() && entries.iter().all(|entry| entry["robot"] == "saw"), "{entries:#?}");
}

#[tokio::test]
async fn a_token_that_asks_too_often_is_told_and_can_still_stop() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    let request = |end: &str| {
        let token = &hall.operator;
        format!(
            "GET /v1/no-such-path HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {token}\r\n{end}\r\n"
        )
    };
    // One connection and no wait for the answers, so that the machine is fast enough for the limit.
    let mut stream = TcpStream::connect(address).await.unwrap();
    let all = request("").repeat(599) + &request("Connection: close\r\n");
    let (mut reads, mut writes) = stream.split();
    let mut answers = String::new();
    let (written, read) = tokio::join!(writes.write_all(all.as_bytes()), reads.read_to_string(&mut answers));
    written.unwrap();
    read.unwrap();
    let count = |status: &str| answers.matches(&format!("HTTP/1.1 {status} ")).count();
    assert!(count("404") >= 200 && count("429") > 0, "{} {}", count("404"), count("429"));
    assert_eq!(count("404") + count("429"), 600);
    assert!(answers.contains("\"too_many_requests\"") && answers.contains("retry-after: 1\r\n"));
    assert!(answers.contains("\"retry_after_ms\":"), "{answers}");

    assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    let (status, done) = hall.command(&hall.operator, "press", &Value::Null, "actionStop").await;
    assert_eq!(status, 200, "{done}");
    assert_eq!(
        hall.call(&hall.viewer, "GET", "/v1/robots", None).await.0,
        200,
        "another token is not limited"
    );
}

#[tokio::test]
async fn pages_of_a_browser_are_refused() {
    let hall = Hall::start().await;
    for header in ["Origin: http://evil.example", "Sec-Fetch-Site: cross-site"] {
        // `call` puts the token at the end of a line of the head.
        let token = format!("{}\r\n{header}", hall.viewer);
        let (status, problem) = hall.call(&token, "GET", "/v1/robots", None).await;
        assert_eq!((status, &problem["code"]), (403, &json!("foreign_origin")));
    }
}

#[tokio::test]
async fn a_caller_who_is_refused_in_a_loop_does_not_fill_the_audit_log() {
    let hall = Hall::start().await;
    let long = format!("/v1/robots/press/alarms/{}/acknowledge", "9".repeat(2_000));
    for _ in 0..20 {
        assert_eq!(hall.stop(&hall.viewer, "press").await.0, 403);
        assert_eq!(hall.post(&hall.viewer, &long, &json!({})).await.0, 403);
        // An operator without the lease is refused and written as seldom.
        let (status, _) = hall.command(&hall.operator, "press", &json!(null), "clearAlarm").await;
        assert_eq!(status, 409);
    }
    // The last of them is on the disk once a later record is.
    assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    hall.until_audited(|entry| entry["what"] == "stop").await;
    let audit = hall.audit().await;
    let refused: Vec<_> = audit.iter().filter(|entry| entry["what"] == "refused").collect();
    assert_eq!(refused.len(), 3, "{refused:#?}");
    assert!(refused.iter().all(|entry| entry["request"].as_str().unwrap().len() <= 100), "{refused:#?}");
    // What is refused is no stop: it counts as any request.
    let (address, token) = (hall.gateway.address(), &hall.viewer);
    let request = |end: &str| {
        let head = format!("POST /v1/robots/press/stop HTTP/1.1\r\nHost: {address}\r\nContent-Length: 0\r\n");
        format!("{head}Authorization: Bearer {token}\r\n{end}\r\n")
    };
    let mut stream = TcpStream::connect(address).await.unwrap();
    let all = request("").repeat(599) + &request("Connection: close\r\n");
    let (mut reads, mut writes) = stream.split();
    let mut answers = String::new();
    let (written, read) = tokio::join!(writes.write_all(all.as_bytes()), reads.read_to_string(&mut answers));
    written.and(read).unwrap();
    let count = |status: &str| answers.matches(&format!("HTTP/1.1 {status} ")).count();
    assert!(count("429") > 0, "{} {}", count("403"), count("429"));
    assert_eq!(count("403") + count("429"), 600);
}

/// A connection that has sent this and sends no more.
async fn silent(address: SocketAddr, said: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(said.as_bytes()).await.unwrap();
    stream
}

/// Requests whose bodies never end, and answers that need no token, once held all places but one: each new
/// connection was pushed out by the next.
#[tokio::test]
async fn strangers_who_hold_their_places_push_no_stop_out() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    let slow = format!(
        "POST /v1/session HTTP/1.1\r\nHost: {address}\r\nContent-Type: application/json\r\n\
         Content-Length: 100\r\n\r\n{{"
    );
    let healthy = format!("GET /healthz HTTP/1.1\r\nHost: {address}\r\n\r\n");
    for held in [slow, healthy] {
        let mut crowd = Vec::new();
        for _ in 0..127 {
            crowd.push(silent(address, &held).await);
        }
        // The server handles connections in turn: it has read those of before by now.
        assert_eq!(call(address, "", "GET", "/healthz", None).await.0, 204);
        for _ in 0..3 {
            let stop = format!(
                "POST /v1/robots/press/stop HTTP/1.1\r\nHost: {address}\r\nContent-Length: 0\r\n\
                 Authorization: Bearer {}\r\nConnection: close\r\n\r\n",
                hall.operator
            );
            let (first, rest) = stop.split_at(40);
            let mut stream = silent(address, first).await;
            for _ in 0..5 {
                crowd.push(silent(address, "").await);
            }
            assert_eq!(call(address, "", "GET", "/healthz", None).await.0, 204);
            stream.write_all(rest.as_bytes()).await.unwrap();
            let mut answer = String::new();
            stream.read_to_string(&mut answer).await.expect("the stop is pushed out");
            assert!(answer.starts_with("HTTP/1.1 200 "), "{answer:?}");
        }
    }
}

#[tokio::test]
async fn bodies_that_cannot_be_read_are_no_stops_and_count() {
    let hall = Hall::start().await;
    let (address, token) = (hall.gateway.address(), &hall.operator);
    for path in ["commands", "panel"] {
        let request = |end: &str| {
            let head =
                format!("POST /v1/robots/press/{path} HTTP/1.1\r\nHost: {address}\r\nContent-Length: 1\r\n");
            let kind = "Content-Type: application/json\r\n";
            format!("{head}{kind}Authorization: Bearer {token}\r\n{end}\r\n{{")
        };
        let mut stream = TcpStream::connect(address).await.unwrap();
        let all = request("").repeat(599) + &request("Connection: close\r\n");
        let (mut reads, mut writes) = stream.split();
        let mut answers = String::new();
        let (written, read) =
            tokio::join!(writes.write_all(all.as_bytes()), reads.read_to_string(&mut answers));
        written.and(read).unwrap();
        let count = |status: &str| answers.matches(&format!("HTTP/1.1 {status} ")).count();
        assert!(count("429") > 0, "{path}: {} {}", count("400"), count("429"));
        assert_eq!(count("400") + count("429"), 600, "{path}");
    }
    assert_eq!(hall.stop(token, "press").await.0, 200);
}

#[tokio::test]
async fn a_part_of_a_path_that_is_no_text_is_named_by_its_own_problem() {
    let hall = Hall::start().await;
    let only =
        r6_gateway::make_token(hall.data.path(), Role::Engineer, Some(name("press").into()), String::new());
    let only = only.unwrap().1;
    for token in [&hall.engineer, &only] {
        for (path, code) in [
            ("press/alarms/%ff/acknowledge", "no_such_alarm"),
            ("press/alarms/%FF%FE/acknowledge", "no_such_alarm"),
        ] {
            let (status, problem) = hall.post(token, &format!("/v1/robots/{path}"), &json!({})).await;
            assert_eq!((status, &problem["code"]), (404, &json!(code)), "{path}");
        }
    }
    let path = "/v1/robots/%ff/alarms/7/acknowledge";
    let (status, problem) = hall.post(&hall.engineer, path, &json!({})).await;
    assert_eq!((status, &problem["code"]), (404, &json!("no_such_robot")));
    assert_eq!(hall.post(&only, path, &json!({})).await.0, 403);
}

#[tokio::test]
async fn a_robot_that_is_not_there_is_told_with_the_nearest_name_that_the_caller_may_see() {
    let robots = [VirtualController::start().await, VirtualController::start().await];
    let hall = Hall::with(robots.map(Result::unwrap).into()).await;
    let (status, problem) = hall.call(&hall.viewer, "GET", "/v1/robots/pres", None).await;
    assert_eq!((status, &problem["message"]), (404, &json!("there is no robot `pres`; nearest: `press`")));
    let of_misspelt =
        r6_gateway::make_token(hall.data.path(), Role::Viewer, Some(name("pres").into()), String::new());
    let (status, problem) = hall.call(&of_misspelt.unwrap().1, "GET", "/v1/robots/pres", None).await;
    assert_eq!(
        (status, &problem["message"]),
        (404, &json!("there is no robot `pres`")),
        "it may not see press"
    );
    for path in ["query?address=Adr-800", "history?signal=Adr-800"] {
        let (status, problem) =
            hall.call(&hall.viewer, "GET", &format!("/v1/robots/press/{path}"), None).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")));
        let message = problem["message"].as_str().unwrap();
        assert!(message.starts_with("`Adr-800` is no query address; nearest: `Addr-n`"), "{path}: {message}");
    }
}

#[tokio::test]
async fn a_token_and_a_user_for_some_robots_see_and_use_these_alone() {
    let robots = [(); 3].map(|()| VirtualController::start());
    let robots = futures_util::future::join_all(robots).await.into_iter().map(Result::unwrap).collect();
    let hall = Hall::with(robots).await;
    let wanted = json!({ "role": "engineer", "robot": "saw,press" });
    let (status, made) = hall.post(&hall.admin, "/v1/tokens", &wanted).await;
    assert_eq!(status, 201, "{made}");
    let token = made["token"].as_str().unwrap();
    let listed = hall.get(&hall.admin, "/v1/tokens").await;
    assert_eq!(listed["tokens"].as_array().unwrap().last().unwrap()["robot"], "press,saw");
    let seen = hall.get(token, "/v1/robots").await;
    let names: Vec<_> = seen["robots"].as_array().unwrap().iter().map(|robot| &robot["name"]).collect();
    assert_eq!(names, ["press", "saw"]);
    for robot in ["press", "saw", "lathe"] {
        let mine = robot != "lathe";
        let path = format!("/v1/robots/{robot}");
        let (status, _) = hall.call(token, "GET", &path, None).await;
        assert_eq!(status, if mine { 200 } else { 403 }, "{robot}");
        let (status, _) = hall.stop(token, robot).await;
        assert_eq!(status, if mine { 200 } else { 403 }, "{robot}");
        let (status, _) = hall.post(token, &format!("{path}/lease"), &json!({})).await;
        assert_eq!(status, if mine { 200 } else { 403 }, "{robot}");
    }
    // The audit log of these robots, and of nothing else.
    let stopped = |entry: &Value| entry["what"] == "stop" && entry["robot"] == "saw";
    hall.until_audited(stopped).await;
    assert_eq!(hall.stop(&hall.operator, "lathe").await.0, 200);
    hall.until_audited(|entry| entry["what"] == "stop" && entry["robot"] == "lathe").await;
    let entries = hall.get(token, "/v1/audit?limit=1000").await;
    let robots: BTreeSet<_> =
        entries["entries"].as_array().unwrap().iter().map(|entry| entry["robot"].as_str()).collect();
    assert_eq!(robots, [Some("press"), Some("saw")].into());

    let wrong = json!({ "role": "engineer", "robot": "saw," });
    let (status, problem) = hall.post(&hall.admin, "/v1/tokens", &wrong).await;
    assert_eq!((status, &problem["code"]), (422, &json!("bad_value")));
    assert!(problem["message"].as_str().unwrap().contains("commas between them"), "{problem}");

    // A user likewise. A change takes a robot away at once.
    hall.user("ben", Role::Operator).await;
    let put = |robots: &'static str| {
        let body = json!({ "role": "operator", "robot": robots });
        let hall = &hall;
        async move { hall.call(&hall.admin, "PUT", "/v1/users/ben", Some(&body)).await.0 }
    };
    assert_eq!(put("press,lathe").await, 204);
    let ben = hall.browser("ben").await;
    let status = |robot: &'static str| {
        let ben = ben.clone();
        async move { ben.call("GET", &format!("/v1/robots/{robot}"), None).await.0 }
    };
    assert_eq!([status("press").await, status("saw").await, status("lathe").await], [200, 403, 200]);
    assert_eq!(put("press").await, 204);
    let ben = hall.browser("ben").await;
    let lathe = ben.call("GET", "/v1/robots/lathe", None).await;
    assert_eq!(lathe.0, 403);
}

#[tokio::test]
async fn a_token_with_an_end_is_refused_from_then_on_and_its_streams_end() {
    let hall = Hall::start().await;
    let ends = |seconds: u64| {
        let at = std::time::SystemTime::now() + Duration::from_secs(seconds);
        humantime::format_rfc3339_seconds(at).to_string()
    };
    for (wrong, shown) in [("tomorrow", "`tomorrow`"), ("2020-01-01T00:00:00Z", "`2020-01-01T00:00:00Z`")] {
        let wanted = json!({ "role": "viewer", "expires_at": wrong });
        let (status, problem) = hall.post(&hall.admin, "/v1/tokens", &wanted).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")));
        let message = problem["message"].as_str().unwrap();
        assert!(message.contains(shown) && message.contains("a time to come"), "{message}");
    }
    let at = ends(6);
    let wanted = json!({ "role": "viewer", "name": "for a moment", "expires_at": at });
    let (status, made) = hall.post(&hall.admin, "/v1/tokens", &wanted).await;
    assert_eq!(status, 201, "{made}");
    let token = made["token"].as_str().unwrap();
    let session = hall.get(token, "/v1/session").await;
    assert!(session["ends_in_ms"].as_u64().is_some_and(|left| left <= 6_000), "when it ends: {session}");
    assert_eq!(session["idle_ends_in_ms"], json!(null), "it does not end by waiting");
    assert_eq!(hall.get(&hall.admin, "/v1/session").await["ends_in_ms"], json!(null), "it has no end");
    let page = Browser::with_token(hall.gateway.address(), token).await;
    let session = page.call("GET", "/v1/session", None).await.1;
    assert!(session["idle_ends_in_ms"].as_u64().unwrap() <= 6_000, "it ends with its token: {session}");
    let mut live = Stream::open(hall.gateway.address(), token, "/v1/live", "").await;
    assert_eq!(live.next().await.unwrap().kind, "snapshot");
    let begun = Instant::now();
    while hall.call(token, "GET", "/v1/robots", None).await.0 == 200 {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert!(std::time::SystemTime::now() >= humantime::parse_rfc3339(&at).unwrap(), "not before its time");
    let (status, problem) = hall.call(token, "GET", "/v1/robots", None).await;
    assert_eq!((status, &problem["code"]), (401, &json!("no_token")));
    while live.next().await.is_some() {
        assert!(begun.elapsed() < PATIENCE);
    }
    // An admin still sees that it has ended.
    let listed = hall.get(&hall.admin, "/v1/tokens").await;
    let last = listed["tokens"].as_array().unwrap().last().unwrap().clone();
    assert_eq!(
        (&last["name"], &last["expires_at"]),
        (&json!("for a moment"), &json!(at.replace('Z', ".000000Z")))
    );
}
