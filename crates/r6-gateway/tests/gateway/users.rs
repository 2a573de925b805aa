//! Users: the first admin, signing in and out, what a session may do, and how it ends.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use futures_util::StreamExt;
use futures_util::future::join_all;
use r6_api::gateway::Role;
use r6_gateway::UserName;
use r6_sim::VirtualController;
use serde_json::{Value, json};
use tokio::net::TcpStream;
use tokio_tungstenite::client_async;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;

use crate::support::{Browser, Hall, PASSWORD, PATIENCE, Stream, cookie_name, request};

/// A stream ends within this time after its session; some of it is for a busy machine.
const SOON: Duration = Duration::from_secs(2);

fn told((status, problem): &(u16, Value)) -> (u16, &str) {
    (*status, problem["code"].as_str().unwrap_or_default())
}

async fn sign_in(hall: &Hall, name: &str, password: &str) -> (u16, Value) {
    let asked = json!({ "name": name, "password": password });
    hall.call("", "POST", "/v1/session", Some(&asked)).await
}

async fn set_up(hall: &Hall, secret: &str, name: &str, password: &str) -> (u16, Value) {
    let asked = json!({ "secret": secret, "name": name, "password": password });
    hall.call("", "POST", "/v1/setup", Some(&asked)).await
}

async fn put(hall: &Hall, name: &str, wanted: &Value) -> (u16, Value) {
    hall.call(&hall.admin, "PUT", &format!("/v1/users/{name}"), Some(wanted)).await
}

#[tokio::test]
async fn a_link_makes_the_first_admin_once() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    let first = hall.gateway.setup_link().await.unwrap().unwrap();
    let link = hall.gateway.setup_link().await.unwrap().unwrap();
    let (page, secret) = link.split_once('#').unwrap();
    assert_eq!((page, secret.len()), (format!("http://{address}/setup").as_str(), 64));

    let page = request(address, "", "GET", "/setup", None).await;
    let text = page.body.as_str().unwrap();
    assert!(page.status == 200 && text.contains("<script src=\"/setup.js\" defer></script>"), "{text}");
    let has_handler = text.split_whitespace().any(|word| word.starts_with("on") && word.contains('='));
    assert!(!has_handler && text.matches("<script").count() == 1, "no script in the page: {text}");
    let policy = page.head.lines().find_map(|line| line.strip_prefix("content-security-policy: "));
    assert!(policy.unwrap().starts_with("default-src 'none'; script-src 'self'; "), "{}", page.head);
    let script = request(address, "", "GET", "/setup.js", None).await;
    assert!(script.status == 200 && script.head.contains("content-type: text/javascript"), "{}", script.head);

    let old = set_up(&hall, first.split_once('#').unwrap().1, "anna", PASSWORD).await;
    assert_eq!(told(&old), (410, "link_void"), "the newer link took its place");
    assert_eq!(told(&set_up(&hall, secret, "Anna", PASSWORD).await), (422, "bad_value"));
    assert_eq!(told(&set_up(&hall, secret, "anna", "too short").await), (422, "bad_value"));
    assert_eq!(set_up(&hall, secret, "anna", PASSWORD).await.0, 204);
    assert_eq!(told(&set_up(&hall, secret, "ben", PASSWORD).await), (410, "link_void"));
    assert_eq!(hall.gateway.setup_link().await.unwrap(), None, "there is an admin");

    let anna = hall.browser("anna").await;
    let (status, users) = anna.call("GET", "/v1/users", None).await;
    assert_eq!(status, 200);
    let [user] = &users["users"].as_array().unwrap()[..] else { panic!("{users}") };
    assert_eq!(
        (&user["name"], &user["role"], &user["robot"]),
        (&json!("anna"), &json!("admin"), &Value::Null)
    );
    let made = hall.until_audited(|entry| entry["what"] == "user_made").await;
    assert_eq!((&made["actor"], &made["user"]), (&json!("link"), &json!("anna")));
}

#[tokio::test]
async fn a_link_of_the_first_admin_ends_with_the_gateway() {
    let hall = Hall::start().await;
    let link = hall.gateway.setup_link().await.unwrap().unwrap();
    let secret = link.split_once('#').unwrap().1.to_owned();
    let hall = hall.again(Vec::new(), Vec::new()).await;
    assert_eq!(told(&set_up(&hall, &secret, "anna", PASSWORD).await), (410, "link_void"));
}

#[tokio::test]
async fn a_link_of_the_command_line_gives_a_user_another_password() {
    let hall = Hall::start().await;
    hall.user("anna", Role::Operator).await;
    let anna = hall.browser("anna").await;
    let user = |name: &str| UserName::new(name).unwrap();
    let link = r6_gateway::make_link(hall.data.path(), user("anna")).unwrap();
    let secret = link.strip_prefix('#').unwrap().strip_suffix("&anna").unwrap();
    assert_eq!(anna.call("GET", "/v1/session", None).await.0, 200, "the link alone changes nothing");
    assert_eq!(told(&set_up(&hall, secret, "ben", "another password").await), (410, "link_void"));
    assert_eq!(set_up(&hall, secret, "anna", "another password").await.0, 204);
    assert_eq!(told(&anna.call("GET", "/v1/session", None).await), (401, "no_session"));
    assert_eq!(told(&sign_in(&hall, "anna", PASSWORD).await), (401, "wrong_password"));
    assert_eq!(sign_in(&hall, "anna", "another password").await.0, 200);
    assert_eq!(told(&set_up(&hall, secret, "anna", PASSWORD).await), (410, "link_void"));
    assert!(r6_gateway::make_link(hall.data.path(), user("no-user")).is_err());
}

#[tokio::test]
async fn a_user_commands_and_stops_and_the_log_names_the_user() {
    let hall = Hall::start().await;
    hall.user("anna", Role::Operator).await;
    let anna = hall.browser("anna").await;
    let (_, session) = anna.call("GET", "/v1/session", None).await;
    assert_eq!((&session["user"], &session["role"]), (&json!("anna"), &json!("operator")));
    let (idle, all) = (&session["idle_ends_in_ms"], &session["ends_in_ms"]);
    assert!((890_000..=900_000).contains(&idle.as_u64().unwrap()), "{session}");
    assert!((28_700_000..=28_800_000).contains(&all.as_u64().unwrap()), "{session}");
    let of_token = hall.get(&hall.viewer, "/v1/session").await;
    assert_eq!((&of_token["user"], &of_token["csrf"]), (&Value::Null, &Value::Null));
    assert!(of_token["token"].is_i64());

    let (status, lease) = anna.call("POST", "/v1/robots/press/lease", Some(&json!({}))).await;
    assert_eq!(status, 200, "{lease}");
    let holder = hall.get(&hall.viewer, "/v1/robots/press").await["lease"]["holder"].clone();
    assert_eq!(holder, "anna");
    let command = json!({ "command": "modifyGSPD", "arguments": ["5"], "lease": lease["lease"] });
    assert_eq!(anna.bare("POST", "/v1/robots/press/commands", Some(&command)).await.0, 403);
    assert_eq!(anna.call("POST", "/v1/robots/press/commands", Some(&command)).await.0, 200);
    assert_eq!(anna.bare("POST", "/v1/robots/press/stop", None).await.0, 403);
    // Beyond the limit of requests a stop still goes.
    let reads = async |_| anna.bare("GET", "/v1/no-such-path", None).await.0;
    let mut statuses = Vec::new();
    let begun = Instant::now();
    while !statuses.contains(&429) {
        assert!(begun.elapsed() < PATIENCE, "{statuses:?}");
        statuses.extend(join_all((0..30).map(reads)).await);
    }
    assert_eq!(anna.call("POST", "/v1/robots/press/stop", None).await.0, 200);
    for what in ["signed_in", "lease_began", "command_intent", "stop_began"] {
        let entry = hall.until_audited(|entry| entry["what"] == what).await;
        assert_eq!(entry["actor"], "anna", "{entry}");
        assert!(entry["source"].as_str().unwrap().starts_with("127.0.0.1:"), "{entry}");
    }
    assert_eq!(anna.call("DELETE", "/v1/session", None).await.0, 204);
    let entry = hall.until_audited(|entry| entry["what"] == "signed_out").await;
    assert_eq!(entry["actor"], "anna");
    assert_eq!(told(&anna.call("GET", "/v1/robots", None).await), (401, "no_session"));
}

/// What ends a session.
async fn end(hall: &Hall, how: &str, anna: &Browser) {
    match how {
        "sign out" => assert_eq!(anna.call("DELETE", "/v1/session", None).await.0, 204),
        "disable" => {
            let wanted = json!({ "role": "viewer", "disabled": true });
            assert_eq!(put(hall, "anna", &wanted).await.0, 204);
        }
        "role" => assert_eq!(put(hall, "anna", &json!({ "role": "operator" })).await.0, 204),
        "robot" => assert_eq!(put(hall, "anna", &json!({ "role": "viewer", "robot": "press" })).await.0, 204),
        "password" => {
            let wanted = json!({ "role": "viewer", "password": "another password" });
            assert_eq!(put(hall, "anna", &wanted).await.0, 204);
        }
        "remove" => assert_eq!(hall.call(&hall.admin, "DELETE", "/v1/users/anna", None).await.0, 204),
        "command line" => {
            r6_gateway::disable_user(hall.data.path(), UserName::new("anna").unwrap()).unwrap();
        }
        other => panic!("{other}"),
    }
}

#[tokio::test]
async fn streams_end_with_their_session() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    for how in ["sign out", "disable", "role", "robot", "password", "remove", "command line"] {
        let wanted = json!({ "role": "viewer", "robot": null, "disabled": false, "password": PASSWORD });
        let (status, _) = put(&hall, "anna", &wanted).await;
        assert!(status == 201 || status == 204, "{status}");
        let anna = hall.browser("anna").await;
        let mut live = Stream::open_with(address, &anna.headers(), "/v1/live", "").await;
        let mut events = Stream::open_with(address, &anna.headers(), "/v1/events", "").await;
        let mut socket = format!("ws://{address}/v1/live").into_client_request().unwrap();
        let headers = socket.headers_mut();
        headers.insert("cookie", format!("{}={}", cookie_name(address), anna.cookie).parse().unwrap());
        headers.insert("origin", format!("http://{address}").parse().unwrap());
        let stream = TcpStream::connect(address).await.unwrap();
        let (mut socket, _) = client_async(socket, stream).await.unwrap();
        assert_eq!(live.next().await.unwrap().kind, "snapshot");

        end(&hall, how, &anna).await;
        let ended = Instant::now();
        let all = async {
            while live.next().await.is_some() {}
            while events.next().await.is_some() {}
            while let Some(Ok(message)) = socket.next().await {
                if let Message::Close(frame) = message {
                    let frame = frame.unwrap();
                    assert!(frame.code == 1008.into() && frame.reason.starts_with("no_session"), "{frame:?}");
                }
            }
        };
        tokio::time::timeout(SOON, all).await.unwrap_or_else(|_| panic!("streams go on after: {how}"));
        assert!(ended.elapsed() < SOON, "{how}");
        assert_eq!(told(&anna.call("GET", "/v1/session", None).await), (401, "no_session"), "{how}");
    }
}

#[tokio::test]
async fn a_websocket_with_a_cookie_names_its_origin() {
    let hall = Hall::start().await;
    hall.user("anna", Role::Viewer).await;
    let anna = hall.browser("anna").await;
    let address = hall.gateway.address();
    let upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                   Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    let with = |header: &str| format!("{}{upgrade}{header}", anna.headers());
    for header in ["", "Origin: http://evil.example\r\n", "Origin: null\r\n"] {
        let answer = request(address, &with(header), "GET", "/v1/live", None).await;
        assert_eq!((answer.status, &answer.body["code"]), (403, &json!("foreign_origin")), "{header}");
    }
}

#[tokio::test]
async fn a_user_changes_the_own_password_and_stays_signed_in_here_alone() {
    let hall = Hall::start().await;
    hall.user("anna", Role::Viewer).await;
    let [here, there] = [hall.browser("anna").await, hall.browser("anna").await];
    let change = async |old: &str, new: &str| {
        let asked = json!({ "old": old, "new": new });
        here.call("PUT", "/v1/session/password", Some(&asked)).await
    };
    assert_eq!(told(&change("wrong password", "another password").await), (401, "wrong_password"));
    assert_eq!(told(&change(PASSWORD, "too short").await), (422, "bad_value"));
    assert_eq!(change(PASSWORD, "another password").await.0, 204);
    assert_eq!(here.call("GET", "/v1/session", None).await.0, 200);
    assert_eq!(told(&there.call("GET", "/v1/session", None).await), (401, "no_session"));
    assert_eq!(change("another password", "the third password").await.0, 204, "it still is a session");
    assert_eq!(told(&sign_in(&hall, "anna", PASSWORD).await), (401, "wrong_password"));
    assert_eq!(sign_in(&hall, "anna", "the third password").await.0, 200);
    let entry = hall.until_audited(|entry| entry["what"] == "user_changed").await;
    assert_eq!((&entry["actor"], &entry["new_password"]), (&json!("anna"), &json!(true)));
}

#[tokio::test]
async fn what_a_change_does_not_name_stays() {
    let hall = Hall::start().await;
    let ben = || async { hall.get(&hall.admin, "/v1/users").await["users"][0].clone() };
    let first = json!({ "role": "operator", "robot": "press", "disabled": true });
    assert_eq!(put(&hall, "ben", &first).await.0, 201);
    assert_eq!(put(&hall, "ben", &json!({ "role": "viewer" })).await.0, 204);
    let now = ben().await;
    let told = (&now["role"], &now["robot"], &now["disabled"]);
    assert_eq!(told, (&json!("viewer"), &json!("press"), &json!(true)));
    let wanted = json!({ "role": "viewer", "robot": null, "password": PASSWORD });
    assert_eq!(put(&hall, "ben", &wanted).await.0, 204);
    let now = ben().await;
    assert_eq!((&now["robot"], &now["disabled"]), (&json!(null), &json!(true)));
    assert_eq!(put(&hall, "ben", &json!({ "role": "viewer", "disabled": false })).await.0, 204);
    assert_eq!(ben().await["disabled"], false);
}

#[tokio::test]
async fn the_last_admin_stays() {
    let hall = Hall::start().await;
    hall.user("anna", Role::Admin).await;
    let path = "/v1/users/anna";
    let last = |answer: &(u16, Value)| assert_eq!(told(answer), (409, "last_admin"));
    last(&hall.call(&hall.admin, "DELETE", path, None).await);
    last(&put(&hall, "anna", &json!({ "role": "engineer" })).await);
    last(&put(&hall, "anna", &json!({ "role": "admin", "robot": "press" })).await);
    last(&put(&hall, "anna", &json!({ "role": "admin", "disabled": true })).await);
    let user = UserName::new("anna").unwrap();
    assert!(r6_gateway::disable_user(hall.data.path(), user).is_err());
    // An admin who cannot sign in is no other admin.
    assert_eq!(put(&hall, "ben", &json!({ "role": "admin" })).await.0, 201);
    last(&hall.call(&hall.admin, "DELETE", path, None).await);

    let wanted = json!({ "role": "admin", "password": PASSWORD });
    assert_eq!(put(&hall, "ben", &wanted).await.0, 204);
    let both = join_all(["anna", "ben"].map(|name| {
        let path = format!("/v1/users/{name}");
        let hall = &hall;
        async move { hall.call(&hall.admin, "DELETE", &path, None).await.0 }
    }));
    let mut both = both.await;
    both.sort_unstable();
    assert_eq!(both, [204, 409], "of two at once, one is refused");
    let users = hall.get(&hall.admin, "/v1/users").await;
    assert_eq!(users["users"].as_array().unwrap().len(), 1, "{users}");
}

#[tokio::test]
async fn wrong_passwords_wait_longer_and_longer_and_names_cannot_be_told_apart() {
    let hall = Hall::start().await;
    hall.user("anna", Role::Viewer).await;
    let before = Instant::now();
    let mut seen = Vec::new();
    for name in ["anna", "no-user", "anna", "no-user", "anna"] {
        let (status, problem) = sign_in(&hall, name, "a wrong password").await;
        assert_eq!(told(&(status, problem.clone())), (401, "wrong_password"), "{name}");
        seen.push(problem);
    }
    assert!(seen.iter().all(|problem| *problem == seen[0]), "{seen:?}");
    let refused = request(
        hall.gateway.address(),
        "",
        "POST",
        "/v1/session",
        Some(&json!({ "name": "anna", "password": PASSWORD })),
    )
    .await;
    // On a machine that is slow enough, the wait is over by now.
    if before.elapsed() < Duration::from_millis(900) {
        assert_eq!((refused.status, &refused.body["code"]), (429, &json!("too_many_requests")));
        assert!(refused.head.contains("retry-after: "), "{}", refused.head);
    }
    let begun = Instant::now();
    while sign_in(&hall, "anna", PASSWORD).await.0 != 200 {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    // Where anna signed in, strangers do not make her wait any more.
    for _ in 0..20 {
        sign_in(&hall, "no-user", "a wrong password").await;
    }
    assert_eq!(sign_in(&hall, "anna", PASSWORD).await.0, 200);

    let failed = hall.until_audited(|entry| entry["what"] == "sign_in_failed").await;
    assert_eq!((&failed["user"], &failed["times"]), (&json!("anna"), &json!(1)));
    let entries = hall.audit().await;
    let of = |name: &str| entries.iter().filter(|entry| entry.to_string().contains(name)).count();
    assert_eq!(of("no-user"), 0, "strangers' words do not stand in the log");
    assert_eq!(entries.iter().filter(|entry| entry["what"] == "sign_in_failed").count(), 1, "{entries:#?}");
}

#[tokio::test]
async fn a_thousand_tries_at_once_delay_no_stop() {
    let hall = Hall::start().await;
    hall.user("anna", Role::Viewer).await;
    // Strangers, and an admin whose hashes take all places, until the stops are over.
    let over = AtomicBool::new(false);
    let tries = async {
        let mut statuses = Vec::new();
        let mut round = 0;
        while round < 50 || !over.load(Ordering::SeqCst) {
            let tried = (0..20).map(|number| {
                let (hall, name) = (&hall, format!("name-{round}-{number}"));
                async move { sign_in(hall, &name, "a wrong password").await.0 }
            });
            statuses.extend(join_all(tried).await);
            round += 1;
        }
        statuses
    };
    // An admin who makes users has no limit besides that of requests: two hashes are always under way.
    let hashes = async {
        let mut hashed = 0;
        while !over.load(Ordering::SeqCst) {
            let wanted = json!({ "role": "viewer", "password": PASSWORD });
            let put = (0..8).map(|number| {
                let (hall, wanted, name) = (&hall, &wanted, format!("user-{number}"));
                async move { put(hall, &name, wanted).await.0 }
            });
            let statuses = join_all(put).await;
            hashed += statuses.iter().filter(|status| matches!(status, 201 | 204)).count();
        }
        hashed
    };
    let stops = async {
        let mut longest = Duration::ZERO;
        for _ in 0..20 {
            tokio::time::sleep(Duration::from_millis(50)).await;
            let begun = Instant::now();
            assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
            longest = longest.max(begun.elapsed());
        }
        over.store(true, Ordering::SeqCst);
        longest
    };
    let (statuses, hashed, longest) = tokio::join!(tries, hashes, stops);
    let count = |status: u16| statuses.iter().filter(|one| **one == status).count();
    assert_eq!(count(401) + count(429) + count(503), statuses.len());
    assert!(statuses.len() >= 1_000 && count(401) <= 12, "{} passwords were tried", count(401));
    assert!(hashed > 8, "the places of hashes were taken: {hashed}");
    // Each takes milliseconds; the rest is for a busy machine.
    assert!(longest < Duration::from_secs(2), "{longest:?}");
}

#[tokio::test]
async fn a_disk_that_hangs_delays_no_stop_and_keeps_no_user_out() {
    let hall = Hall::start().await;
    hall.user("anna", Role::Operator).await;
    let anna = hall.browser("anna").await;
    let other = rusqlite::Connection::open(hall.data.path().join("control.db")).unwrap();
    other.execute_batch("BEGIN IMMEDIATE").unwrap();
    let begun = Instant::now();
    let again = hall.browser("anna").await;
    let signed_in = begun.elapsed();
    let begun = Instant::now();
    assert_eq!(anna.call("POST", "/v1/robots/press/stop", None).await.0, 200);
    let stopped = begun.elapsed();
    assert_eq!(again.call("DELETE", "/v1/session", None).await.0, 204);
    // A write gives up after 5 s.
    assert!(
        signed_in < Duration::from_secs(3) && stopped < Duration::from_secs(3),
        "{signed_in:?} {stopped:?}"
    );
    other.execute_batch("ROLLBACK").unwrap();
    for (what, count) in [("signed_in", 2), ("signed_out", 1)] {
        hall.until_audited(|entry| entry["what"] == "signed_out").await;
        let entries = hall.audit().await;
        assert_eq!(entries.iter().filter(|entry| entry["what"] == what).count(), count, "{entries:#?}");
    }
}

#[tokio::test]
async fn a_restart_signs_out_and_keeps_the_users() {
    let hall = Hall::start().await;
    hall.user("anna", Role::Viewer).await;
    let anna = hall.browser("anna").await;
    let hall = hall.again(Vec::new(), vec![VirtualController::start().await.unwrap()]).await;
    // It has another port by now, and so another name of the cookie.
    let headers = format!("Cookie: {}={}\r\n", cookie_name(hall.gateway.address()), anna.cookie);
    let answer = request(hall.gateway.address(), &headers, "GET", "/v1/robots", None).await;
    assert_eq!((answer.status, &answer.body["code"]), (401, &json!("no_session")));
    hall.browser("anna").await;
}

#[tokio::test]
async fn an_admin_of_one_robot_changes_no_users() {
    let hall = Hall::start().await;
    let wanted = json!({ "role": "admin", "robot": "press", "password": PASSWORD });
    assert_eq!(put(&hall, "ben", &wanted).await.0, 201);
    let ben = hall.browser("ben").await;
    let wanted = json!({ "role": "admin", "password": PASSWORD });
    for (method, path, body) in [
        ("GET", "/v1/users", None),
        ("PUT", "/v1/users/ben", Some(&wanted)),
        ("DELETE", "/v1/users/ben", None),
        ("GET", "/v1/tokens", None),
        ("POST", "/v1/tokens", Some(&json!({ "role": "admin" }))),
    ] {
        assert_eq!(told(&ben.call(method, path, body).await), (403, "not_allowed"), "{method} {path}");
    }
    assert_eq!(ben.call("GET", "/v1/robots/press", None).await.0, 200);
    assert_eq!(ben.call("GET", "/v1/robots/saw", None).await.0, 403);
    let entry = hall.until_audited(|entry| entry["what"] == "refused").await;
    assert_eq!((&entry["actor"], &entry["code"]), (&json!("ben"), &json!("not_allowed")));
}

#[tokio::test]
async fn an_admin_makes_and_revokes_tokens() {
    let hall = Hall::start().await;
    hall.user("anna", Role::Admin).await;
    let anna = hall.browser("anna").await;
    let wanted = json!({ "role": "viewer", "robot": "press", "name": "screen" });
    let (status, made) = anna.call("POST", "/v1/tokens", Some(&wanted)).await;
    assert_eq!(status, 201, "{made}");
    let token = made["token"].as_str().unwrap();
    assert_eq!(hall.get(token, "/v1/session").await["robot"], "press");
    let (_, listed) = anna.call("GET", "/v1/tokens", None).await;
    let listed = listed["tokens"].as_array().unwrap().clone();
    let screen = listed.iter().find(|known| known["number"] == made["number"]).unwrap();
    let (number, never) = (&made["number"], Value::Null);
    let wanted = json!({ "number": number, "role": "viewer", "robot": "press", "name": "screen", "expires_at": never });
    assert_eq!(*screen, wanted);

    let path = format!("/v1/tokens/{}", made["number"]);
    assert_eq!(anna.call("DELETE", &path, None).await.0, 204);
    assert_eq!(hall.call(token, "GET", "/v1/session", None).await.0, 401, "at once");
    assert_eq!(told(&anna.call("DELETE", &path, None).await), (404, "no_such_token"));
    for wrong in
        [json!({ "role": "viewer", "robot": "No" }), json!({ "role": "viewer", "name": "x".repeat(65) })]
    {
        assert_eq!(told(&anna.call("POST", "/v1/tokens", Some(&wrong)).await), (422, "bad_value"));
    }
    for what in ["token_made", "token_revoked"] {
        let of_anna = |entry: &Value| entry["what"] == what && entry["actor"] == "anna";
        assert_eq!(hall.until_audited(of_anna).await["token"], made["number"]);
    }
}

#[tokio::test]
async fn wrong_users_are_refused_and_no_answer_repeats_a_password() {
    let hall = Hall::start().await;
    let long = "y".repeat(129);
    for (name, wanted) in [
        ("Anna", json!({ "role": "viewer" })),
        ("gateway", json!({ "role": "viewer" })),
        ("3", json!({ "role": "viewer" })),
        ("%FF", json!({ "role": "viewer" })),
        ("anna", json!({ "role": "king" })),
        ("anna", json!({ "role": "viewer", "robot": "No" })),
        ("anna", json!({ "role": "viewer", "password": "hunter2" })),
        ("anna", json!({ "role": "viewer", "password": long })),
        ("anna", json!({ "role": "viewer", "password": 8_675_309 })),
        ("anna", json!({ "role": "viewer", "password": ["hunter2"] })),
    ] {
        let answer = put(&hall, name, &wanted).await;
        assert_eq!(told(&answer), (422, "bad_value"), "{wanted}");
        let text = answer.1.to_string();
        assert!(!["hunter2", "yyyy", "8675309"].iter().any(|secret| text.contains(secret)), "{text}");
    }
    assert_eq!(hall.get(&hall.admin, "/v1/users").await, json!({ "users": [] }));
    // Any characters make a password.
    let password = "🔑 ключ и замок 锁";
    assert_eq!(put(&hall, "anna", &json!({ "role": "viewer", "password": password })).await.0, 201);
    assert_eq!(sign_in(&hall, "anna", password).await.0, 200);
    // Without a password a user cannot sign in, and not with an empty one.
    assert_eq!(put(&hall, "ben", &json!({ "role": "viewer" })).await.0, 201);
    assert_eq!(told(&sign_in(&hall, "ben", "").await), (401, "wrong_password"));
}

#[tokio::test]
async fn cookies_of_other_programs_lock_no_browser_out() {
    let hall = Hall::start().await;
    hall.user("anna", Role::Operator).await;
    let [anna, other] = [hall.browser("anna").await, hall.browser("anna").await];
    let address = hall.gateway.address();
    let ask = async |cookies: &str, csrf: &str, method: &str, path: &str| {
        let headers = format!("Cookie: {cookies}\r\nX-CSRF-Token: {csrf}\r\n");
        let answer = request(address, &headers, method, path, None).await;
        (answer.status, answer.body["code"].as_str().unwrap_or_default().to_owned())
    };
    let named = cookie_name(address);
    let (ours, theirs) = (format!("{named}={}", anna.cookie), format!("{named}={}", other.cookie));
    let stop = "/v1/robots/press/stop";
    for cookies in [
        format!("name=жора; {ours}"),
        format!("{named}=planted; {ours}"),
        format!("{ours}; {named}=planted; {named}="),
        format!("{theirs}; {ours}"),
    ] {
        assert_eq!(ask(&cookies, "", "GET", "/v1/session").await.0, 200, "{cookies}");
        assert_eq!(ask(&cookies, &anna.csrf, "POST", stop).await.0, 200, "{cookies}");
        let wrong = ask(&cookies, "0", "POST", stop).await;
        assert_eq!(wrong, (403, "bad_csrf".to_owned()), "{cookies}");
    }
    let planted = format!("{}{ours}", format!("{named}=planted; ").repeat(4));
    assert_eq!(ask(&planted, &anna.csrf, "GET", "/v1/session").await, (401, "no_session".to_owned()));
    // The proof says which of two sessions is meant.
    let both = format!("{theirs}; {ours}");
    assert_eq!(ask(&both, &anna.csrf, "DELETE", "/v1/session").await.0, 204);
    assert_eq!(ask(&ours, "", "GET", "/v1/session").await.0, 401);
    assert_eq!(ask(&theirs, "", "GET", "/v1/session").await.0, 200);
}

#[tokio::test]
async fn a_user_who_signs_in_without_end_waits_and_can_stop() {
    let hall = Hall::start().await;
    hall.user("anna", Role::Operator).await;
    let anna = hall.browser("anna").await;
    let begun = Instant::now();
    let mut refused = None;
    while refused.is_none() {
        assert!(begun.elapsed() < PATIENCE);
        let answer = sign_in(&hall, "anna", PASSWORD).await;
        assert!(matches!(answer.0, 200 | 429), "{answer:?}");
        refused = (answer.0 == 429).then_some(answer);
    }
    assert_eq!(told(&refused.unwrap()), (429, "too_many_requests"));
    let signed_in = hall.audit().await.iter().filter(|entry| entry["what"] == "signed_in").count();
    assert!(signed_in >= 10, "{signed_in}");
    // A user has eight sessions: that of the first browser has ended. Another user is not concerned.
    assert_eq!(told(&anna.call("GET", "/v1/session", None).await), (401, "no_session"));
    hall.user("ben", Role::Operator).await;
    let ben = hall.browser("ben").await;
    assert_eq!(ben.call("POST", "/v1/robots/press/stop", None).await.0, 200);
}

#[tokio::test]
async fn a_change_holds_at_once_also_if_the_users_cannot_be_read_after_it() {
    let hall = Hall::start().await;
    hall.user("anna", Role::Operator).await;
    let anna = hall.browser("anna").await;
    // From the next change on, the disk has a user that cannot be read.
    let other = rusqlite::Connection::open(hall.data.path().join("control.db")).unwrap();
    other
        .execute_batch(
            "CREATE TRIGGER broken AFTER UPDATE ON user BEGIN
             INSERT INTO user VALUES ('zoe', 'king', NULL, 0, NULL, '', 0); END;",
        )
        .unwrap();
    let wanted = json!({ "role": "operator", "disabled": true });
    assert_eq!(put(&hall, "anna", &wanted).await.0, 204);
    assert_eq!(told(&anna.call("GET", "/v1/session", None).await), (401, "no_session"));
    assert_eq!(hall.get(&hall.admin, "/v1/users").await["users"][0]["disabled"], true);
    assert_eq!(told(&sign_in(&hall, "anna", PASSWORD).await), (401, "wrong_password"));
}
