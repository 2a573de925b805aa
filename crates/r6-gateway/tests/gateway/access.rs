//! Who may use the gateway: tokens, roles, and each route of the description.

use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use r6_sim::VirtualController;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::support::{Hall, PATIENCE, call, name};

/// The lowest role of each route; `None` needs no token. A route that is not here fails the test.
const ROUTES: [(&str, &str, Option<Role>); 26] = [
    ("GET", "/healthz", None),
    ("GET", "/metrics", Some(Role::Viewer)),
    ("GET", "/readyz", Some(Role::Viewer)),
    ("GET", "/v1/audit", Some(Role::Engineer)),
    ("GET", "/v1/events", Some(Role::Viewer)),
    ("GET", "/v1/live", Some(Role::Viewer)),
    ("GET", "/v1/openapi.json", Some(Role::Viewer)),
    ("GET", "/v1/programs", Some(Role::Viewer)),
    ("POST", "/v1/programs/check", Some(Role::Viewer)),
    ("POST", "/v1/programs/plan", Some(Role::Viewer)),
    ("GET", "/v1/programs/{program}", Some(Role::Viewer)),
    ("PUT", "/v1/programs/{program}", Some(Role::Engineer)),
    ("DELETE", "/v1/programs/{program}", Some(Role::Engineer)),
    ("GET", "/v1/programs/{program}/versions", Some(Role::Viewer)),
    ("GET", "/v1/robots", Some(Role::Viewer)),
    ("GET", "/v1/robots/{name}", Some(Role::Viewer)),
    ("PUT", "/v1/robots/{name}", Some(Role::Admin)),
    ("DELETE", "/v1/robots/{name}", Some(Role::Admin)),
    ("POST", "/v1/robots/{name}/accept-identity", Some(Role::Engineer)),
    ("POST", "/v1/robots/{name}/clear-stopped", Some(Role::Operator)),
    ("POST", "/v1/robots/{name}/commands", Some(Role::Operator)),
    ("GET", "/v1/robots/{name}/history", Some(Role::Viewer)),
    ("DELETE", "/v1/robots/{name}/lease", Some(Role::Operator)),
    ("POST", "/v1/robots/{name}/lease", Some(Role::Operator)),
    ("GET", "/v1/robots/{name}/query", Some(Role::Viewer)),
    ("POST", "/v1/robots/{name}/stop", Some(Role::Operator)),
];

/// The routes of the description, methods in upper case.
fn described() -> Vec<(String, String)> {
    let api: Value = serde_json::from_str(&r6_gateway::openapi()).unwrap();
    let paths = api["paths"].as_object().unwrap();
    let routes = paths.iter().flat_map(|(path, methods)| {
        let methods = methods.as_object().unwrap().keys();
        methods.map(|method| (method.to_uppercase(), path.clone()))
    });
    routes.collect()
}

#[tokio::test]
async fn every_route_refuses_strangers_and_lower_roles() {
    let hall = Hall::start().await;
    let tokens = [&hall.viewer, &hall.operator, &hall.engineer, &hall.admin];
    let of_another = r6_gateway::make_token(hall.data.path(), Role::Admin, Some(name("saw")), String::new());
    let of_another = of_another.unwrap().1;
    assert_eq!(described().len(), ROUTES.len());
    for (method, path) in described() {
        let row = ROUTES.iter().find(|(m, p, _)| *m == method && *p == path);
        let Some((_, _, lowest)) = row else { panic!("{method} {path} has no row in this test") };
        let Some(lowest) = lowest else { continue };
        let concrete = path.replace("{name}", "press").replace("{program}", "pick");
        // No route has such a field, so nothing is carried out.
        let body = (method != "GET").then(|| json!({ "no": "such field" }));
        for stranger in ["", "r6_0000", "Bearer", &"x".repeat(5000)] {
            let (status, problem) = hall.call(stranger, &method, &concrete, body.as_ref()).await;
            assert_eq!((status, &problem["code"]), (401, &json!("no_token")), "{method} {path}");
        }
        for (role, token) in Role::ALL.into_iter().zip(tokens) {
            if role < *lowest {
                let (status, problem) = hall.call(token, &method, &concrete, body.as_ref()).await;
                let told = (status, &problem["code"]);
                assert_eq!(told, (403, &json!("not_allowed")), "{method} {path} {role:?}");
            } else if method != "GET" && !path.ends_with("/stop") {
                let (status, problem) = hall.call(token, &method, &concrete, body.as_ref()).await;
                let wanted = match (method.as_str(), path.as_str()) {
                    // The robot is in the configuration, so it is not removed. There is no such program.
                    ("DELETE", "/v1/robots/{name}") => 409,
                    ("DELETE", "/v1/programs/{program}") => 404,
                    _ => 422,
                };
                assert_eq!(status, wanted, "{method} {path} {role:?}: {problem}");
            }
        }
        if path.contains("{name}") {
            let (status, problem) = hall.call(&of_another, &method, &concrete, body.as_ref()).await;
            assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")), "{method} {path}");
        }
    }
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["stopped"], false, "it was not stopped");
}

#[tokio::test]
async fn health_needs_no_token_and_an_unknown_path_does() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    assert_eq!(call(address, "", "GET", "/healthz", None).await.0, 204);
    assert_eq!(call(address, "", "GET", "/v2", None).await.0, 401);
    let (status, problem) = hall.call(&hall.viewer, "GET", "/v2", None).await;
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
    let only = r6_gateway::make_token(hall.data.path(), Role::Engineer, Some(name("saw")), String::new());
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
        format!("GET /v2 HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {token}\r\n{end}\r\n")
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
