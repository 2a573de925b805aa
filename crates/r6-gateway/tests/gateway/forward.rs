//! Requests for a robot that another gateway owns: passed on to it, once.

use std::path::Path;
use std::time::{Duration, Instant};

use r6_gateway::{Gateway, GatewaySettings, TlsSettings};
use r6_sim::VirtualController;
use r6_testkit::postgres::Server;
use serde_json::{Value, json};

use crate::far::listed;
use crate::gateways::{Here, There, beside, command, database, lease, settings_of};
use crate::support::{Browser, PASSWORD, PATIENCE, call, call_with, commands, ready_to_start, request};
use crate::tls::exchange_with;

/// Within this time after its owner froze, a stop has come to the robot: a takeover takes 5 s, and a machine
/// that is busy longer.
const STOPPED: Duration = Duration::from_secs(9);

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn any_gateway_answers_for_any_robot() {
    let Some((_server, url, token)) = database("the test of requests that are passed on").await else {
        return;
    };
    let press = VirtualController::start().await.unwrap();
    let robots = [("press", press.address())];
    let one = Here::start(&url, &token, &robots).await;
    one.until_up("press").await;
    let other = Here::start(&url, &token, &robots).await;
    let (state, passed) =
        (one.call("GET", "/v1/robots/press", None).await, other.call("GET", "/v1/robots/press", None).await);
    assert_eq!((state.0, passed.0), (200, 200), "{}", passed.1);
    assert_eq!(state.1["address"], passed.1["address"]);
    let key = other.lease("press").await;
    let (status, done) = command(other.gateway.address(), &token, "press", &key).await;
    assert_eq!(status, 200, "{done}");
    assert_eq!(command(one.gateway.address(), &token, "press", &key).await.0, 200, "one lease for all");
    let (status, refused) = other.call("POST", "/v1/robots/press/lease", Some(&json!({}))).await;
    assert_eq!((status, &refused["code"]), (409, &json!("leased")));

    // A command comes twice, over both gateways, and is sent once.
    let body = json!({ "command": "modifyGSPD", "arguments": ["7"], "lease": key });
    let mut log = press.handle().log();
    let path = "/v1/robots/press/commands";
    let line = "Idempotency-Key: twice\r\n";
    let first = call_with(other.gateway.address(), &token, "POST", path, line, Some(&body)).await;
    let again = call_with(one.gateway.address(), &token, "POST", path, line, Some(&body)).await;
    assert_eq!((first.status, again.status), (200, 200), "{} {}", first.body, again.body);
    assert_eq!(first.body["command_id"], again.body["command_id"]);
    assert_eq!(commands(&mut log), ["modifyGSPD"]);

    let program = "[[instruction]]\ndo = \"axis-move\"\nto = [60, 0, 0, 0, 0, 0]\nspeed = 1\n".repeat(2);
    let asked = json!({ "program": program, "lease": key });
    let path = "/v1/robots/press/programs/run";
    let line = "Idempotency-Key: one\r\n";
    let run = call_with(other.gateway.address(), &token, "POST", path, line, Some(&asked)).await;
    assert_eq!(run.status, 202, "{}", run.body);
    let begun = Instant::now();
    while !press.handle().snapshot().moving {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let stopping = Instant::now();
    let (status, stopped) = other.call("POST", "/v1/robots/press/stop", None).await;
    assert_eq!((status, &stopped["confirmed"]), (200, &json!(true)), "{stopped}");
    assert!(stopping.elapsed() < Duration::from_secs(5), "{:?}", stopping.elapsed());
    assert!(!press.handle().snapshot().moving);
    let path = format!("/v1/robots/press/runs/{}", run.body["run_id"]);
    // The run ends beside the stop.
    loop {
        let (_, shown) = other.call("GET", &path, None).await;
        if shown["state"] == "stopped" {
            break;
        }
        assert!(stopping.elapsed() < PATIENCE, "{shown}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let cleared = json!({ "lease": key });
    assert_eq!(other.call("POST", "/v1/robots/press/clear-stopped", Some(&cleared)).await.0, 204);
    let history = other.call("GET", "/v1/robots/press/history?signal=isMoving", None).await;
    assert_eq!(history.0, 200, "{}", history.1);
    assert_eq!(other.call("DELETE", "/v1/robots/press/lease", Some(&cleared)).await.0, 204);

    // What is for all robots, the owner of the hall does.
    assert_eq!(other.call("GET", "/v1/audit/head", None).await.0, 200);
    let wanted = json!({ "address": "127.0.0.1:1" });
    let (status, added) = other.call("PUT", "/v1/robots/saw", Some(&wanted)).await;
    assert_eq!(status, 201, "{added}");

    // The log tells who asked, and from where.
    let (_, page) = one.call("GET", "/v1/audit?limit=1000", None).await;
    let entries = page["entries"].as_array().unwrap();
    let intent = entries.iter().find(|entry| entry["what"] == "command_intent").unwrap();
    assert_eq!(intent["actor"], "token 1");
    assert!(intent["source"].as_str().unwrap().starts_with("127.0.0.1:"), "{intent}");

    // What is no pass of a gateway opens nothing, with a token neither.
    for pass in ["x", "e30.e30", ""] {
        let headers = format!("Authorization: Bearer {token}\r\nR6-Pass: {pass}\r\n");
        let answer = request(one.gateway.address(), &headers, "GET", "/v1/robots/press", None).await;
        assert_eq!((answer.status, &answer.body["code"]), (401, &json!("no_token")), "{pass:?}");
    }
    one.gateway.shutdown().await.unwrap();
    other.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_browser_at_one_gateway_works_with_a_robot_of_another() {
    let Some((_server, url, token)) = database("the test of browsers at two gateways").await else { return };
    let press = VirtualController::start().await.unwrap();
    let robots = [("press", press.address())];
    let one = Here::start(&url, &token, &robots).await;
    one.until_up("press").await;
    let other = Here::start(&url, &token, &robots).await;
    let anna = json!({ "role": "operator", "password": PASSWORD });
    assert_eq!(one.call("PUT", "/v1/users/anna", Some(&anna)).await.0, 201);
    let viewer = json!({ "role": "viewer", "password": PASSWORD });
    assert_eq!(one.call("PUT", "/v1/users/ben", Some(&viewer)).await.0, 201);
    // The other one reads the users twice a second.
    tokio::time::sleep(Duration::from_secs(1)).await;
    let anna = Browser::sign_in(other.gateway.address(), "anna", PASSWORD).await;
    let (status, held) = anna.call("POST", "/v1/robots/press/lease", Some(&json!({}))).await;
    assert_eq!(status, 200, "{held}");
    let body = json!({ "command": "modifyGSPD", "arguments": ["5"], "lease": held["lease"] });
    assert_eq!(anna.call("POST", "/v1/robots/press/commands", Some(&body)).await.0, 200);
    let bare = anna.bare("POST", "/v1/robots/press/stop", None).await;
    assert_eq!((bare.0, &bare.1["code"]), (403, &json!("bad_csrf")), "pages of others are refused before");
    let (_, state) = one.call("GET", "/v1/robots/press", None).await;
    assert_eq!(state["lease"]["holder"], "anna");
    let ben = Browser::sign_in(other.gateway.address(), "ben", PASSWORD).await;
    let (status, refused) = ben.call("POST", "/v1/robots/press/lease", Some(&json!({}))).await;
    assert_eq!((status, &refused["code"]), (403, &json!("not_allowed")), "the owner looks what he may do");
    assert_eq!(anna.call("POST", "/v1/robots/press/stop", None).await.0, 200);
    one.gateway.shutdown().await.unwrap();
    other.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_command_to_a_frozen_owner_is_not_sent_again_and_a_stop_reaches_the_robot() {
    let Some((_server, url, token)) = database("the test of a frozen owner behind another").await else {
        return;
    };
    let press = ready_to_start().await;
    let robots = [("press", press.address())];
    let there = There::start(&url, &robots).await;
    let here = Here::start(&url, &token, &robots).await;
    let key = lease(here.gateway.address(), &token, "press").await;
    assert_eq!(command(here.gateway.address(), &token, "press", &key).await.0, 200);
    let mut log = press.handle().log();
    there.signal("STOP");
    let frozen = Instant::now();
    let at = here.gateway.address();
    let (asked, stopping) = (token.clone(), token.clone());
    let commanding = tokio::spawn(async move { command(at, &asked, "press", &key).await });
    let stopping =
        tokio::spawn(async move { call(at, &stopping, "POST", "/v1/robots/press/stop", None).await });
    let reading = here.call("GET", "/v1/robots/press", None).await;
    assert_eq!((reading.0, &reading.1["code"]), (503, &json!("no_owner")), "{}", reading.1);
    let (status, problem) = commanding.await.unwrap();
    assert_eq!((status, &problem["code"]), (504, &json!("outcome_unknown")), "{problem}");
    let (status, stopped) = stopping.await.unwrap();
    assert_eq!((status, &stopped["confirmed"]), (200, &json!(true)), "{stopped}");
    let took = frozen.elapsed();
    assert!(took < STOPPED, "{took:?}");
    let state = here.until_up("press").await;
    assert_eq!(state["stopped"], true);
    // Somebody holds the lease, so the robot is not given back to the gateway that goes on.
    here.lease("press").await;
    there.signal("CONT");
    tokio::time::sleep(Duration::from_secs(2)).await;
    let sent = commands(&mut log);
    assert!(!sent.is_empty() && sent.iter().all(|command| command == "actionStop"), "{sent:?}");
    here.gateway.shutdown().await.unwrap();
}

/// A gateway with a certificate that it makes, in front of this robot.
async fn with_tls(url: &str, data: &Path, press: &VirtualController) -> Gateway {
    let all = [("press".to_owned(), press.address())];
    let settings = GatewaySettings { tls: TlsSettings::Made, ..settings_of(url, data, &all) };
    Gateway::start(settings).await.unwrap()
}

/// From now on the rows of gateways for which this holds say another certificate, with each beat anew.
async fn with_wrong_certificate(server: Server, url: String, of: String) {
    let change = format!(
        "CREATE FUNCTION r6_gateway.wrong() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN
         NEW.certificate := 'AA:BB'; RETURN NEW; END $$;
         CREATE TRIGGER wrong BEFORE UPDATE ON r6_gateway.gateway FOR EACH ROW
         WHEN ({of}) EXECUTE FUNCTION r6_gateway.wrong();"
    );
    beside(move || server.sql(&url, &change)).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn gateways_with_tls_ask_each_other_with_their_certificates() {
    let Some((server, url, token)) = database("the test of certificates on both sides").await else { return };
    let press = VirtualController::start().await.unwrap();
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let one = with_tls(&url, folders[0].path(), &press).await;
    let other = with_tls(&url, folders[1].path(), &press).await;
    let certificate = std::fs::read(other.certificate().unwrap().path()).unwrap();
    let (at, bearer) = (other.address(), format!("Authorization: Bearer {token}\r\n"));
    let ask = async |method, path, body| {
        let reply = exchange_with((at, &certificate), method, path, &bearer, body).await.unwrap();
        let status: u16 = reply.split(' ').nth(1).unwrap().parse().unwrap();
        let body = serde_json::from_str(reply.split_once("\r\n\r\n").unwrap().1).unwrap_or(Value::Null);
        (status, body)
    };
    let begun = Instant::now();
    // What is passed on is answered, and live values come.
    loop {
        let (status, state) = ask("GET", "/v1/robots/press", "").await;
        let robots = ask("GET", "/v1/robots", "").await.1;
        if status == 200 && state["link"] == "up" && robots["robots"][0]["link"] == "up" {
            break;
        }
        assert!(begun.elapsed() < PATIENCE, "{status} {state} {robots}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert_eq!((one.owned(), other.owned()), (Some(1), Some(0)));
    let (status, lease) = ask("POST", "/v1/robots/press/lease", "{}").await;
    assert_eq!(status, 200, "{lease}");
    // The row of the gateway that asks has another certificate, so what it shows is not its own.
    let told = format!("https://localhost:{}", at.port());
    let told = [told, format!("https://{at}")];
    let urls = told.map(|url| format!("'{url}'")).join(", ");
    with_wrong_certificate(server, url, format!("NEW.name IN ({urls})")).await;
    let begun = Instant::now();
    loop {
        let (status, problem) = ask("GET", "/v1/robots/press", "").await;
        if status == 503 {
            let message = problem["message"].as_str().unwrap();
            assert!(message.contains("takes no request of this gateway"), "{problem}");
            break;
        }
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    let (status, problem) = ask("POST", "/v1/robots/press/lease", "{}").await;
    assert_eq!((status, &problem["code"]), (503, &json!("no_owner")), "nothing was done: {problem}");
    one.shutdown().await.unwrap();
    other.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_a_gateway_asks_is_answered_while_its_certificate_is_exchanged() {
    let Some((_server, url, token)) = database("the test of an exchanged certificate").await else { return };
    let press = VirtualController::start().await.unwrap();
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let one = with_tls(&url, folders[0].path(), &press).await;
    let other = with_tls(&url, folders[1].path(), &press).await;
    let (at, bearer) = (other.address(), format!("Authorization: Bearer {token}\r\n"));
    let path = other.certificate().unwrap().path().to_owned();
    let shown = rcgen::generate_simple_self_signed(vec!["localhost".to_owned()]).unwrap();
    let (before, after) = (std::fs::read(&path).unwrap(), shown.cert.pem().into_bytes());
    // The client of this test trusts both.
    let ask = async |certificate: &[u8]| {
        let reply = exchange_with((at, certificate), "GET", "/v1/robots/press", &bearer, "").await?;
        Ok::<u16, std::io::Error>(reply.split(' ').nth(1).unwrap().parse().unwrap())
    };
    let begun = Instant::now();
    while ask(&before).await.unwrap() != 200 {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert_eq!((one.owned(), other.owned()), (Some(1), Some(0)));
    std::fs::write(path.with_file_name("key.pem"), shown.signing_key.serialize_pem()).unwrap();
    std::fs::write(&path, &after).unwrap();
    let (begun, mut with_the_new_one) = (Instant::now(), 0);
    while with_the_new_one < 20 {
        let status = match ask(&before).await {
            Ok(status) => status,
            Err(_) => {
                with_the_new_one += 1;
                ask(&after).await.unwrap()
            }
        };
        assert_eq!(status, 200, "after {:?}, {with_the_new_one} with the new one", begun.elapsed());
        assert!(begun.elapsed() < 2 * PATIENCE);
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    one.shutdown().await.unwrap();
    other.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_gateway_with_tls_is_known_by_its_certificate() {
    let Some((server, url, token)) = database("the test of gateways with TLS").await else { return };
    let press = VirtualController::start().await.unwrap();
    let data = tempfile::tempdir().unwrap();
    let one = with_tls(&url, data.path(), &press).await;
    let other = Here::start(&url, &token, &[("press", press.address())]).await;
    let begun = Instant::now();
    let state = loop {
        let (status, state) = other.call("GET", "/v1/robots/press", None).await;
        if status == 200 && state["link"] == "up" {
            break state;
        }
        assert!(begun.elapsed() < PATIENCE, "{state}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    assert_eq!((one.owned(), &state["name"]), (Some(1), &json!("press")));
    // Streams and lists, too.
    listed(&other, "press", |robot| robot["link"] == "up").await;
    // Another certificate than that in the store: the row says the right one again with each beat.
    with_wrong_certificate(server, url, "NEW.certificate IS NOT NULL".to_owned()).await;
    let begun = Instant::now();
    loop {
        let (status, problem) = other.call("GET", "/v1/robots/press", None).await;
        if status == 503 {
            assert!(problem["message"].as_str().unwrap().contains("cannot be reached"), "{problem}");
            break;
        }
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    let (status, problem): (u16, Value) =
        other.call("POST", "/v1/robots/press/lease", Some(&json!({}))).await;
    assert_eq!((status, &problem["code"]), (503, &json!("no_owner")), "nothing was sent");
    one.shutdown().await.unwrap();
    other.gateway.shutdown().await.unwrap();
}
