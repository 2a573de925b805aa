//! The switch that closes all raw ports.

use r6_api::gateway::Role;
use r6_controller::Profile;
use r6_gateway::RawAllow;
use r6_sim::VirtualController;
use serde_json::{Value, json};
use tokio::io::AsyncReadExt;

use super::{Raw, Script, command, query};
use crate::support::{Hall, PATIENCE, name};

const RULES: &[(&str, RawAllow)] = &[("127.0.0.1", RawAllow::Command)];

async fn turn(hall: &Hall, token: &str, open: bool) -> (u16, Value) {
    hall.call(token, "PUT", "/v1/raw-ports", Some(&json!({ "open": open }))).await
}

/// Nothing but the end comes.
async fn is_closed(script: &mut Script) -> bool {
    let read = tokio::time::timeout(PATIENCE, script.stream.read(&mut [0; 16])).await;
    matches!(read.expect("it is closed in time"), Ok(0) | Err(_))
}

#[tokio::test]
async fn an_engineer_closes_all_raw_ports_at_once_and_only_an_admin_opens_them() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), RULES).await;
    let hall = &raw.hall;
    let mut script = raw.script().await;
    assert_eq!(script.query("curMode").await, ["7"]);
    let told = hall.get(&hall.viewer, "/v1/raw-ports").await;
    let port = json!({ "robot": "press", "listen": raw.address().to_string(), "clients": 1 });
    assert_eq!(told, json!({ "closed": null, "kept": true, "ports": [port] }));
    let of_press =
        r6_gateway::make_token(hall.data.path(), Role::Admin, Some(name("press").into()), "one".to_owned());
    let of_press = of_press.unwrap().1;
    for token in [&hall.viewer, &hall.operator, &of_press] {
        let (status, problem) = turn(hall, token, false).await;
        assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")), "{problem}");
    }
    assert_eq!(script.query("curMode").await, ["7"], "a caller without the right closes nothing");

    let (status, told) = turn(hall, &hall.engineer, false).await;
    assert_eq!((status, &told["closed"]["by"]), (200, &json!("token 3 (engineer)")), "{told}");
    assert!(is_closed(&mut script).await, "a client that asks for nothing is closed, too");
    let mut other = raw.script().await;
    let _ = tokio::io::AsyncWriteExt::write_all(&mut other.stream, query(&["curMode"]).as_bytes()).await;
    assert!(is_closed(&mut other).await);
    // The rules of the file can change meanwhile: that lets no client in.
    hall.gateway.set_raw_policy(super::policy(&[("127.0.0.0/8", RawAllow::Command)]));
    assert!(is_closed(&mut raw.script().await).await);

    let (status, problem) = turn(hall, &hall.engineer, true).await;
    assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")), "{problem}");
    assert!(is_closed(&mut raw.script().await).await);
    let refused = |entry: &Value| entry["what"] == "refused" && entry["request"] == "/v1/raw-ports";
    assert_eq!(hall.until_audited(refused).await["code"], "not_allowed");
    let (status, told) = turn(hall, &hall.admin, true).await;
    assert_eq!((status, &told["closed"]), (200, &Value::Null));
    assert_eq!(raw.script().await.query("curMode").await, ["7"]);
    let audit = hall.audit().await;
    let turned = audit.iter().filter(|entry| entry["what"] == "raw_ports");
    let turned: Vec<_> = turned.map(|entry| (entry["actor"].as_str().unwrap(), &entry["open"])).collect();
    // The gateway writes at each start how they are.
    let (open, closed) = (&json!(true), &json!(false));
    assert_eq!(turned, [("gateway", open), ("token 3 (engineer)", closed), ("token 4 (admin)", open)]);
}

#[tokio::test]
async fn closed_raw_ports_are_closed_after_a_restart() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), RULES).await;
    assert_eq!(turn(&raw.hall, &raw.hall.engineer, false).await.0, 200);
    let Raw { hall, tap } = raw;
    let hall = hall.again_with_raw(tap.address, super::policy(RULES)).await;
    assert_eq!(hall.get(&hall.viewer, "/v1/raw-ports").await["closed"]["by"], "token 3 (engineer)");
    let told: Vec<_> = hall.audit().await.into_iter().filter(|entry| entry["what"] == "raw_ports").collect();
    // At the first start, when they were closed, and at the second start.
    assert_eq!(told.iter().map(|entry| &entry["open"]).collect::<Vec<_>>(), [true, false, false]);
    assert!(is_closed(&mut Script::at(hall.raw()).await).await);
    assert_eq!(turn(&hall, &hall.admin, true).await.0, 200);
    assert_eq!(Script::at(hall.raw()).await.query("curMode").await, ["7"]);
}

/// A controller that does not repeat `packID`, to which the gateway sends one frame at a time.
async fn one_at_a_time() -> VirtualController {
    VirtualController::builder().profile(Profile::named("legacy").unwrap()).start().await.unwrap()
}

/// Lets a command wait behind another one, does something, and lets the first one go on. Returns the outcome
/// of the second one from the audit log.
async fn waits_meanwhile(raw: &Raw, meanwhile: impl Future<Output = ()>) -> Value {
    let gate = raw.tap.hold("modifyGSPD");
    let (mut first, mut second) = (raw.script().await, raw.script().await);
    first.send(&command(&["modifyGSPD", "50"])).await;
    raw.hall.until_audited(|entry| entry["command"] == r#"modifyGSPD "50""#).await;
    second.send(&command(&["rewriteData", "803", "42", "0"])).await;
    let intent = raw.hall.until_audited(|entry| entry["command"] == r#"rewriteData "803","42","0""#).await;
    meanwhile.await;
    gate.send(true).unwrap();
    raw.hall.until_audited(|entry| entry["intent"] == intent["number"]).await
}

#[tokio::test]
async fn a_command_that_waits_behind_another_one_does_not_leave_once_the_ports_are_closed() {
    for opens_again in [false, true] {
        let raw = Raw::start(one_at_a_time().await, RULES).await;
        let outcome = waits_meanwhile(&raw, async {
            assert_eq!(turn(&raw.hall, &raw.hall.engineer, false).await.0, 200);
            if opens_again {
                assert_eq!(turn(&raw.hall, &raw.hall.admin, true).await.0, 200);
            }
        });
        let outcome = outcome.await;
        assert_eq!((&outcome["what"], &outcome["outcome"]), (&json!("command_outcome"), &json!("not_sent")));
        assert!(outcome["detail"].as_str().unwrap().contains("the ports were closed"), "{outcome}");
        assert_eq!((raw.tap.frames("rewriteData").len(), raw.tap.frames("modifyGSPD").len()), (0, 1));
    }
    // Without the switch, it leaves.
    let raw = Raw::start(one_at_a_time().await, RULES).await;
    assert_eq!(waits_meanwhile(&raw, async {}).await["outcome"], "accepted");
    assert_eq!(raw.tap.frames("rewriteData").len(), 1);
}

#[tokio::test]
async fn a_stop_that_came_right_before_is_sent_when_its_client_may_do_nothing_any_more() {
    for by_rule in [true, false] {
        let raw = Raw::start(VirtualController::start().await.unwrap(), RULES).await;
        let mut script = raw.script().await;
        assert_eq!(script.query("curMode").await, ["7"]);
        script.send(&(query(&["axis-0"]) + &command(&["actionStop"]))).await;
        if by_rule {
            raw.hall.gateway.set_raw_policy(super::policy(&[("127.0.0.1", RawAllow::Deny)]));
        } else {
            assert_eq!(turn(&raw.hall, &raw.hall.engineer, false).await.0, 200);
        }
        let state = raw.hall.until("press", |state| state["stopped"] == true).await;
        assert_eq!(state["stopped_by"]["by"], "raw 127.0.0.1 (rule 127.0.0.1)");
        raw.hall.until_audited(|entry| entry["what"] == "stop" && entry["request"] == "actionStop").await;
        assert_eq!(raw.tap.frames("actionStop").len(), 1);
    }
}

#[tokio::test]
async fn a_disk_that_does_not_take_it_is_tried_again_and_that_is_told() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), RULES).await;
    let hall = &raw.hall;
    let marker = hall.data.path().join("raw-ports-closed.json");
    std::fs::create_dir(&marker).unwrap();
    let (status, problem) = turn(hall, &hall.engineer, false).await;
    assert_eq!((status, &problem["code"]), (503, &json!("store_unavailable")), "{problem}");
    assert!(is_closed(&mut raw.script().await).await, "they are closed all the same");
    let told = hall.get(&hall.viewer, "/v1/raw-ports").await;
    assert_eq!((&told["closed"]["by"], &told["kept"]), (&json!("token 3 (engineer)"), &json!(false)));
    // They cannot be opened either: after a restart they would be as the disk says.
    let (status, problem) = turn(hall, &hall.admin, true).await;
    assert_eq!((status, &problem["code"]), (503, &json!("store_unavailable")), "{problem}");
    std::fs::remove_dir(&marker).unwrap();
    let begun = std::time::Instant::now();
    while hall.get(&hall.viewer, "/v1/raw-ports").await["kept"] != true {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(std::time::Duration::from_millis(20)).await;
    }
    let Raw { hall, tap } = raw;
    let hall = hall.again_with_raw(tap.address, super::policy(RULES)).await;
    assert!(is_closed(&mut Script::at(hall.raw()).await).await);
}

#[tokio::test]
async fn a_stop_behind_much_else_is_sent_too_when_its_client_may_do_nothing_any_more() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), RULES).await;
    let mut script = raw.script().await;
    assert_eq!(script.query("curMode").await, ["7"]);
    // More than one read of the socket takes.
    let many: Vec<_> = (0..128).map(|number| format!("counter-{}", number % 64)).collect();
    let many: Vec<_> = many.iter().map(String::as_str).collect();
    let long = query(&many).repeat(5);
    assert!(long.len() > 4_096, "{}", long.len());
    script.send(&(long + &command(&["actionStop"]))).await;
    raw.hall.gateway.set_raw_policy(super::policy(&[("127.0.0.1", RawAllow::Deny)]));
    raw.hall.until("press", |state| state["stopped"] == true).await;
}
