//! Browsers that sign in with a token.

use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use serde_json::{Value, json};
use tokio::net::TcpStream;
use tokio_tungstenite::client_async;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;

use crate::support::{Browser, Hall, PATIENCE};

fn told((status, problem): &(u16, Value)) -> (u16, &str) {
    (*status, problem["code"].as_str().unwrap_or_default())
}

#[tokio::test]
async fn a_browser_with_a_token_has_a_session_that_proves_its_page() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    let wrong = hall.call("", "POST", "/v1/session/token", Some(&json!({ "token": "r6_0000" }))).await;
    assert_eq!(told(&wrong), (401, "no_token"));
    let browser = Browser::with_token(address, &hall.operator).await;
    let (status, session) = browser.call("GET", "/v1/session", None).await;
    assert_eq!((status, &session["user"], &session["role"]), (200, &Value::Null, &json!("operator")));
    assert!(session["token"].is_i64() && session["csrf"] == json!(browser.csrf), "{session}");
    assert!(session["idle_ends_in_ms"].as_u64().is_some_and(|left| left <= 900_000), "{session}");

    let body = json!({});
    let path = "/v1/robots/press/lease";
    assert_eq!(told(&browser.bare("POST", path, Some(&body)).await), (403, "bad_csrf"));
    assert_eq!(browser.call("POST", path, Some(&body)).await.0, 200);
    assert_eq!(browser.call("GET", "/v1/audit", None).await.0, 403, "the rights are those of the token");
    let names = browser.call("PUT", "/v1/session/password", Some(&json!({ "old": "x", "new": "y" }))).await;
    assert_eq!(told(&names), (403, "not_allowed"));

    let url = format!("ws://{address}/v1/live");
    let open = async |origin: Option<String>| {
        let mut request = url.as_str().into_client_request().unwrap();
        let cookie = format!("r6_session={}", browser.cookie);
        request.headers_mut().insert("cookie", cookie.parse().unwrap());
        if let Some(origin) = origin {
            request.headers_mut().insert("origin", origin.parse().unwrap());
        }
        client_async(request, TcpStream::connect(address).await.unwrap()).await.is_ok()
    };
    assert!(open(Some(format!("http://{address}"))).await);
    assert!(!open(None).await && !open(Some("http://evil.example".to_owned())).await);

    assert_eq!(browser.call("DELETE", "/v1/session", None).await.0, 204);
    assert_eq!(told(&browser.call("GET", "/v1/session", None).await), (401, "no_session"));
    let plain = hall.call(&hall.operator, "DELETE", "/v1/session", None).await;
    assert_eq!(told(&plain), (403, "not_allowed"), "a token that is sent itself has no session");
}

#[tokio::test]
async fn the_session_of_a_token_ends_with_it_and_there_are_eight_at_most() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    let made = r6_gateway::make_token(hall.data.path(), Role::Viewer, None, "screen".to_owned());
    let (number, token) = made.unwrap();
    let first = Browser::with_token(address, &token).await;
    let mut others = Vec::new();
    for _ in 0..8 {
        others.push(Browser::with_token(address, &token).await);
    }
    assert_eq!(told(&first.call("GET", "/v1/session", None).await), (401, "no_session"));
    for other in &others {
        assert_eq!(other.call("GET", "/v1/session", None).await.0, 200);
    }
    assert_eq!(r6_gateway::revoke_token(hall.data.path(), number), Ok(true));
    let revoked = Instant::now();
    while others[0].call("GET", "/v1/session", None).await.0 != 401 {
        assert!(revoked.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}
