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
    assert_eq!(told, json!({ "closed": null, "ports": [port] }));
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
    let turned = |open: bool| move |entry: &Value| entry["what"] == "raw_ports" && entry["open"] == open;
    assert_eq!(hall.until_audited(turned(false)).await["actor"], "token 3 (engineer)");
    assert_eq!(hall.until_audited(turned(true)).await["actor"], "token 4 (admin)");
}

#[tokio::test]
async fn closed_raw_ports_are_closed_after_a_restart() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), RULES).await;
    assert_eq!(turn(&raw.hall, &raw.hall.engineer, false).await.0, 200);
    let Raw { hall, tap } = raw;
    let hall = hall.again_with_raw(tap.address, super::policy(RULES)).await;
    assert_eq!(hall.get(&hall.viewer, "/v1/raw-ports").await["closed"]["by"], "token 3 (engineer)");
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
