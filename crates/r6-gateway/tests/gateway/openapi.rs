//! The description of the API.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::support::Hall;

#[test]
fn the_committed_description_is_what_the_gateway_is() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../openapi/gateway.json");
    let described = r6_gateway::openapi();
    if std::env::var_os("UPDATE_OPENAPI").is_some() {
        std::fs::write(&path, &described).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == described,
        "openapi/gateway.json is not what the gateway is: UPDATE_OPENAPI=1 writes it anew"
    );
}

/// The routes that need neither a token nor a session.
const OPEN: [(&str, &str); 13] = [
    ("get", "/"),
    ("get", "/robots/{name}"),
    ("get", "/robots/{name}/teach"),
    ("get", "/robots/{name}/teach/{program}"),
    ("get", "/{page}"),
    ("get", "/assets/{file}"),
    ("get", "/healthz"),
    ("get", "/setup"),
    ("get", "/setup.js"),
    ("post", "/v1/setup"),
    ("post", "/v1/session"),
    ("post", "/v1/session/token"),
    ("post", "/v1/session/link"),
];

#[test]
fn every_route_but_the_open_ones_names_its_problems_and_needs_a_token() {
    let api: Value = serde_json::from_str(&r6_gateway::openapi()).unwrap();
    for (path, methods) in api["paths"].as_object().unwrap() {
        for (method, route) in methods.as_object().unwrap() {
            let statuses = route["responses"].as_object().unwrap();
            assert!(statuses.contains_key("403"), "{method} {path}");
            let is_open = OPEN.contains(&(method, path));
            assert_eq!(route["security"] == json!([{}]), is_open, "{method} {path}");
            if is_open {
                continue;
            }
            let names_thing = path.contains('{')
                || path == "/v1/programs/plan"
                || route["parameters"].to_string().contains("\"robot\"");
            // A stop is never refused for its number.
            assert_eq!(statuses.contains_key("429"), !path.ends_with("/stop"), "{method} {path}");
            assert!(statuses.contains_key("401"), "{method} {path}");
            // A point may be of a robot.
            let adds = method == "put" && path != "/v1/points/{point}";
            assert_eq!(statuses.contains_key("404"), names_thing && !adds, "{method} {path}");
            let told = statuses["403"]["description"].as_str().unwrap();
            assert_eq!(told.contains("`bad_csrf`"), method != "get", "{method} {path}");
        }
    }
    assert_eq!(api["security"], json!([{ "token": [] }, { "session": [] }]));
    let cookie = &api["components"]["securitySchemes"]["session"];
    assert_eq!((&cookie["in"], &cookie["name"]), (&json!("cookie"), &json!("r6_session_9780")));
}

#[test]
fn no_two_routes_have_one_operation_id() {
    let api: Value = serde_json::from_str(&r6_gateway::openapi()).unwrap();
    let routes = api["paths"].as_object().unwrap().iter().flat_map(|(path, methods)| {
        methods.as_object().unwrap().iter().map(move |(method, route)| (format!("{method} {path}"), route))
    });
    let mut seen = BTreeMap::new();
    for (route, described) in routes {
        let id = described["operationId"].as_str().unwrap_or_else(|| panic!("{route} has none"));
        let other = seen.insert(id, route.clone());
        assert_eq!(other, None, "{route} is `{id}` too");
    }
    assert!(seen.len() > 50, "{seen:?}");
}

#[tokio::test]
async fn the_description_is_served() {
    let hall = Hall::start().await;
    let api = hall.get(&hall.viewer, "/v1/openapi.json").await;
    assert_eq!(api["info"]["title"], "r6 gateway");
}
