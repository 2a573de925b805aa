//! Commands: what needs the lease, what reaches the controller, and what the audit log has of it.

use std::time::Duration;

use r6_controller::StartState;
use r6_gateway::RobotConfig;
use r6_sim::VirtualController;
use serde_json::{Value, json};

use crate::support::{Hall, Stream, commands, name, ready_to_start, signal, way};

#[tokio::test]
async fn a_command_needs_role_and_lease_and_stands_in_the_audit_log() {
    let hall = Hall::start().await;
    let mut log = hall.robots[0].handle().log_from_start();
    let (status, problem) = hall.command(&hall.viewer, "press", &Value::Null, "modifyGSPD 5").await;
    assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")));
    let (status, problem) = hall.command(&hall.operator, "press", &Value::Null, "modifyGSPD 5").await;
    assert_eq!((status, &problem["code"]), (409, &json!("no_lease")));
    assert!(commands(&mut log).is_empty(), "nothing reached the controller");

    let lease = hall.lease(&hall.operator, "press").await;
    let (status, done) = hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await;
    assert_eq!((status, &done["sent"]), (200, &json!("modifyGSPD \"50\"")), "{done}");
    assert_eq!(commands(&mut log), ["modifyGSPD"]);

    let audit = hall.audit().await;
    let entry = |what: &str| audit.iter().find(|entry| entry["what"] == what).unwrap();
    let (intent, outcome) = (entry("command_intent"), entry("command_outcome"));
    assert_eq!(intent["number"], done["command_id"]);
    assert_eq!((&intent["command"], &intent["lease"]), (&json!("modifyGSPD \"50\""), &lease["number"]));
    assert_eq!((&intent["actor"], &intent["robot"]), (&json!("token 2 (operator)"), &json!("press")));
    assert!(intent["source"].as_str().unwrap().starts_with("127.0.0.1:"), "{intent}");
    assert_eq!((&outcome["intent"], &outcome["outcome"]), (&intent["number"], &json!("accepted")));
    let refused = audit.iter().filter(|entry| entry["what"] == "refused");
    let codes: Vec<_> = refused.map(|entry| &entry["code"]).collect();
    assert_eq!(codes, ["not_allowed", "no_lease"]);
    assert!(r6_gateway::verify(hall.data.path(), &[], None).unwrap().entries >= audit.len() as u64);
}

#[tokio::test]
async fn a_mistake_is_told_and_nothing_is_sent() {
    let hall = Hall::start().await;
    let mut log = hall.robots[0].handle().log_from_start();
    let lease = hall.lease(&hall.operator, "press").await;
    for (words, part) in [
        ("modifyGSPD 500", "percent from 0 to 100"),
        ("modifyGSPD", "1 argument"),
        ("modifyGspd 5", "nearest: `modifyGSPD`"),
        ("rm -rf", "no command `rm`"),
    ] {
        let (status, problem) = hall.command(&hall.operator, "press", &lease, words).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_command")), "{words}");
        assert!(problem["message"].as_str().unwrap().contains(part), "{problem}");
    }
    let path = "/v1/robots/press/commands";
    for body in [json!({}), json!([]), json!({ "command": "clearAlarm", "repeat": 2 })] {
        let (status, problem) = hall.post(&hall.operator, path, &body).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")), "{body}");
    }
    let (status, problem) = hall.call(&hall.operator, "POST", path, None).await;
    assert_eq!((status, &problem["code"]), (415, &json!("not_json")));
    let long = json!({ "command": "x".repeat(20_000) });
    let (status, problem) = hall.post(&hall.operator, path, &long).await;
    assert_eq!((status, &problem["code"]), (413, &json!("too_long")));
    assert!(commands(&mut log).is_empty());
}

#[tokio::test]
async fn in_manual_the_pendant_leads() {
    let manual = VirtualController::builder().stands(StartState::Manual).start().await.unwrap();
    let hall = Hall::with(vec![manual]).await;
    let mut log = hall.robots[0].handle().log_from_start();
    let lease = hall.lease(&hall.operator, "press").await;
    let (status, problem) = hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await;
    assert_eq!((status, &problem["code"]), (409, &json!("not_ready")));
    assert!(commands(&mut log).is_empty());
}

#[tokio::test]
async fn what_happened_is_counted_for_prometheus() {
    let hall = Hall::start().await;
    let lease = hall.lease(&hall.operator, "press").await;
    for _ in 0..3 {
        hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await;
    }
    hall.command(&hall.operator, "press", &Value::Null, "modifyGSPD 5").await;
    hall.stop(&hall.operator, "press").await;
    for (token, status) in [("wrong", 401), ("", 401), (&hall.viewer, 403)] {
        assert_eq!(hall.call(token, "POST", "/v1/robots/press/stop", None).await.0, status);
    }
    let (status, text) = hall.call(&hall.viewer, "GET", "/metrics", None).await;
    let text = text.as_str().unwrap();
    assert_eq!(status, 200, "{text}");
    for line in [
        "# TYPE r6_gateway_robot_up gauge",
        "r6_gateway_robot_up{robot=\"press\"} 1",
        "r6_gateway_robot_stopped{robot=\"press\"} 1",
        "r6_gateway_robot_leased{robot=\"press\"} 1",
        "r6_gateway_robot_exchanged{robot=\"press\"} 0",
        "r6_gateway_commands_total{robot=\"press\",outcome=\"accepted\"} 3",
        "r6_gateway_commands_total{robot=\"press\",outcome=\"unknown\"} 0",
        "r6_gateway_stops_total{robot=\"press\",confirmed=\"true\"} 1",
        "r6_gateway_stops_total{robot=\"press\",confirmed=\"false\"} 0",
        "r6_gateway_http_refused_total{status=\"401\"} 2",
        "r6_gateway_http_refused_total{status=\"403\"} 1",
    ] {
        assert!(text.lines().any(|told| told == line), "{line}: {text}");
    }
    // Each line but comments is a name with what it is of, and a number.
    let samples = text.lines().filter(|line| !line.starts_with('#'));
    assert!(samples.clone().all(|line| line.rsplit_once(' ').unwrap().1.parse::<u64>().is_ok()), "{text}");
    let other = r6_gateway::make_token(
        hall.data.path(),
        r6_api::gateway::Role::Viewer,
        Some(crate::support::name("saw").into()),
        String::new(),
    );
    let (_, text) = hall.call(&other.unwrap().1, "GET", "/metrics", None).await;
    let text = text.as_str().unwrap();
    assert!(!text.contains("press") && !text.contains("http_refused"), "{text}");
}

#[tokio::test]
async fn a_start_button_with_the_lease_moves_the_arm() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let lease = hall.lease(&hall.operator, "press").await;
    let (status, done) = hall.command(&hall.operator, "press", &lease, "startButton").await;
    assert_eq!(status, 200, "{done}");
    hall.until("press", |state| signal(state, "isMoving")["value"] == true).await;
}

#[tokio::test]
async fn the_global_speed_is_shown_as_last_set_until_the_controller_may_have_restarted() {
    let robot = VirtualController::start().await.unwrap();
    let (through, cut) = way(robot.address()).await;
    let press = RobotConfig {
        period: Duration::from_millis(20),
        ..RobotConfig::new(name("press"), through.to_string())
    };
    let hall = Hall::at(tempfile::tempdir().unwrap(), vec![press], vec![robot]).await;
    hall.until_up("press").await;
    let speed = async || hall.get(&hall.viewer, "/v1/robots/press").await["global_speed"].clone();
    assert_eq!(speed().await, json!(null), "the protocol does not tell it");
    let lease = hall.lease(&hall.operator, "press").await;
    let mut events = Stream::open(hall.gateway.address(), &hall.viewer, "/v1/events", "").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await.0, 200);
    let set = speed().await;
    assert_eq!((&set["percent"], &set["by"]), (&json!(5.0), &json!("token 2 (operator)")), "{set}");
    let mut told = async || loop {
        let event = events.next().await.unwrap();
        if event.data["event"] == "global_speed" {
            return event.data["set"].clone();
        }
    };
    assert_eq!(told().await, set);

    cut.send(true).unwrap();
    hall.until("press", |state| state["link"] == "down").await;
    hall.until("press", |state| state["global_speed"].is_null()).await;
    cut.send(false).unwrap();
    hall.until_up("press").await;
    assert_eq!((speed().await, told().await), (json!(null), json!(null)));
}
