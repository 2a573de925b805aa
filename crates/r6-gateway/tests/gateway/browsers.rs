//! Browsers that sign in with a token.

use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use serde_json::{Value, json};
use tokio::net::TcpStream;
use tokio_tungstenite::client_async;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;

use crate::support::{Browser, Hall, PATIENCE, cookie_name, request};

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
    assert_eq!(session["token_name"], "operator");
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
        let mut asked = url.as_str().into_client_request().unwrap();
        let cookie = format!("{}={}", cookie_name(address), browser.cookie);
        asked.headers_mut().insert("cookie", cookie.parse().unwrap());
        if let Some(origin) = origin {
            asked.headers_mut().insert("origin", origin.parse().unwrap());
        }
        client_async(asked, TcpStream::connect(address).await.unwrap()).await.is_ok()
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

#[tokio::test]
async fn two_gateways_on_one_host_do_not_sign_each_other_out() {
    let halls = [Hall::start().await, Hall::start().await];
    let mut browsers = Vec::new();
    for hall in &halls {
        browsers.push(Browser::with_token(hall.gateway.address(), &hall.viewer).await);
    }
    // A browser sends the cookies of a host to all its ports.
    let both: Vec<_> = browsers.iter().map(|browser| browser.headers().trim_end().to_owned()).collect();
    let both = both.join("\r\n") + "\r\n";
    for (hall, browser) in halls.iter().zip(&browsers) {
        let answer = request(hall.gateway.address(), &both, "GET", "/v1/session", None).await;
        assert_eq!((answer.status, &answer.body["csrf"]), (200, &json!(browser.csrf)), "{}", answer.body);
    }
}

#[tokio::test]
async fn a_session_with_a_token_stands_in_the_audit_log_once_a_minute() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    let mut last = None;
    for _ in 0..3 {
        last = Some(Browser::with_token(address, &hall.operator).await);
    }
    assert_eq!(last.unwrap().call("DELETE", "/v1/session", None).await.0, 204);
    let audit = hall.audit().await;
    let of = |what: &str| audit.iter().filter(|entry| entry["what"] == what).collect::<Vec<_>>();
    let (signed_in, signed_out) = (of("signed_in"), of("signed_out"));
    assert_eq!((signed_in.len(), signed_out.len()), (1, 1), "{audit:#?}");
    for entry in [signed_in[0], signed_out[0]] {
        assert_eq!(entry["actor"], "token 2 (operator)");
        assert!(entry["source"].as_str().unwrap().starts_with("127.0.0.1:"), "{entry}");
    }
}

#[tokio::test]
async fn a_link_gives_sessions_of_its_token_and_is_no_token() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    let made = r6_gateway::make_token(hall.data.path(), Role::Operator, None, "r6 up".to_owned());
    let (number, token) = made.unwrap();
    hall.get(&token, "/v1/robots").await;
    let secret = hall.gateway.sign_in_secret(number).unwrap();
    let path = "/v1/session/link";
    let link = json!({ "secret": secret });

    // Who it is for can be asked without a session.
    let look = json!({ "secret": secret, "look": true });
    let answer = request(address, "", "POST", path, Some(&look)).await;
    assert_eq!((answer.status, &answer.body["token"]), (200, &json!(number)), "{}", answer.body);
    assert_eq!((&answer.body["token_name"], &answer.body["csrf"]), (&json!("r6 up"), &Value::Null));
    assert!(!answer.head.contains("set-cookie"), "{}", answer.head);

    // A second browser opens it too.
    let browsers = [Browser::open(address, path, &link).await, Browser::open(address, path, &link).await];
    for (browser, status) in browsers.iter().zip([200, 409]) {
        let lease = browser.call("POST", "/v1/robots/press/lease", Some(&json!({}))).await;
        assert_eq!(lease.0, status, "its role is operator: {}", lease.1);
    }
    for no_token in [&secret, &format!("r6_{secret}")] {
        assert_eq!(told(&hall.call(no_token, "GET", "/v1/robots", None).await), (401, "no_token"));
        let asked = json!({ "token": no_token });
        assert_eq!(told(&hall.call("", "POST", "/v1/session/token", Some(&asked)).await), (401, "no_token"));
    }
    for wrong in ["", "0000", token.as_str(), &"0".repeat(64)] {
        let asked = json!({ "secret": wrong });
        assert_eq!(told(&hall.call("", "POST", path, Some(&asked)).await), (410, "link_void"), "{wrong}");
    }
    assert_eq!(r6_gateway::revoke_token(hall.data.path(), number), Ok(true));
    let revoked = Instant::now();
    while told(&hall.call("", "POST", path, Some(&look)).await) != (410, "link_void") {
        assert!(revoked.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}
