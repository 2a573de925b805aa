//! Orders that were long on their way, or that came twice: nothing moves, and no stop is cleared, for them.

use r6_gateway::RobotConfig;
use serde_json::{Value, json};

use crate::support::{Hall, Reply, call_with, commands, name, ready_to_start};

const COMMANDS: &str = "/v1/robots/press/commands";
const CLEAR: &str = "/v1/robots/press/clear-stopped";
const PAST: &str = "Valid-Until: 2026-11-27T10:00:00Z\r\n";
const FUTURE: &str = "Valid-Until: 2999-12-31T10:00:00.5+08:00\r\n";

async fn post(hall: &Hall, path: &str, lines: &str, body: &Value) -> Reply {
    call_with(hall.gateway.address(), &hall.operator, "POST", path, lines, Some(body)).await
}

#[tokio::test]
async fn an_order_that_comes_after_its_time_is_refused_and_nothing_is_sent() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let lease = hall.lease(&hall.operator, "press").await;
    let mut log = hall.robots[0].handle().log();
    let start = json!({ "command": "startButton", "arguments": [], "lease": lease });
    let program = "[[instruction]]\ndo = \"axis-move\"\nto = [5, 0, 0, 0, 0, 0]\nspeed = 5\n";
    let run = json!({ "program": program, "lease": lease });
    let keyed = format!("Idempotency-Key: late\r\n{PAST}");
    for (path, lines, body) in [
        (COMMANDS, PAST, &start),
        ("/v1/robots/press/programs/run", &keyed, &run),
        (CLEAR, PAST, &json!({ "lease": lease })),
    ] {
        let late = post(&hall, path, lines, body).await;
        assert_eq!((late.status, &late.body["code"]), (409, &json!("too_late")), "{path}: {}", late.body);
    }
    for wrong in ["Valid-Until: soon\r\n", &format!("{FUTURE}{FUTURE}")] {
        let refused = post(&hall, COMMANDS, wrong, &start).await;
        assert_eq!((refused.status, &refused.body["code"]), (422, &json!("bad_value")), "{}", refused.body);
    }
    assert!(commands(&mut log).is_empty());
    let in_time = post(&hall, COMMANDS, FUTURE, &start).await;
    assert_eq!(in_time.status, 200, "{}", in_time.body);

    // What stops passes whenever it comes.
    let pause = json!({ "command": "actionPause", "arguments": [] });
    assert_eq!(post(&hall, COMMANDS, PAST, &pause).await.status, 200);
    let stop = post(&hall, "/v1/robots/press/stop", PAST, &json!({})).await;
    assert_eq!(stop.status, 200, "{}", stop.body);
}

#[tokio::test]
async fn a_command_that_came_in_time_is_answered_again_after_its_time() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let lease = hall.lease(&hall.operator, "press").await;
    let mut log = hall.robots[0].handle().log();
    let start = json!({ "command": "startButton", "arguments": [], "lease": lease });
    let first = post(&hall, COMMANDS, &format!("Idempotency-Key: one\r\n{FUTURE}"), &start).await;
    let again = post(&hall, COMMANDS, &format!("Idempotency-Key: one\r\n{PAST}"), &start).await;
    assert_eq!((first.status, again.status), (200, 200), "{}", again.body);
    assert_eq!(first.body, again.body);
    assert_eq!(commands(&mut log).len(), 1);
}

#[tokio::test]
async fn a_stop_that_the_caller_has_not_seen_is_not_cleared() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let lease = hall.lease(&hall.operator, "press").await;
    let state = hall.get(&hall.viewer, "/v1/robots/press").await;
    let none = state["stop_number"].as_u64().unwrap();
    let (status, stopped) = hall.stop(&hall.engineer, "press").await;
    assert_eq!(status, 200, "{stopped}");
    assert!(stopped["seen_at"].as_str().unwrap().ends_with('Z'), "{stopped}");
    let seen = hall.get(&hall.viewer, "/v1/robots/press").await["stop_number"].clone();
    assert_eq!(seen, none + 1);

    // The request to clear it is on its way when somebody stops again.
    assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    // A page sends its stop again until it is proved: that is no other stop.
    assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    let clear = json!({ "lease": lease, "stop_number": seen });
    let refused = post(&hall, CLEAR, "", &clear).await;
    assert_eq!((refused.status, &refused.body["code"]), (409, &json!("stopped")), "{}", refused.body);
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["stopped"], true);

    let clear = json!({ "lease": lease, "stop_number": none + 2 });
    assert_eq!(post(&hall, CLEAR, "", &clear).await.status, 204);
    // A browser sends it again. In between, somebody has stopped the robot.
    assert_eq!(hall.stop(&hall.engineer, "press").await.0, 200);
    assert_eq!(post(&hall, CLEAR, "", &clear).await.status, 409);
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["stopped"], true);
}

#[tokio::test]
async fn a_number_of_a_stop_from_before_a_restart_clears_no_later_stop() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    assert_eq!(hall.stop(&hall.engineer, "press").await.0, 200);
    let seen = hall.get(&hall.viewer, "/v1/robots/press").await["stop_number"].clone();
    let config = RobotConfig::new(name("press"), hall.robots[0].address().to_string());
    let mut hall = hall;
    let robots = std::mem::take(&mut hall.robots);
    let hall = hall.again(vec![config], robots).await;
    hall.until_up("press").await;
    assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    let lease = hall.lease(&hall.operator, "press").await;
    let late = post(&hall, CLEAR, "", &json!({ "lease": lease, "stop_number": seen })).await;
    assert_eq!((late.status, &late.body["code"]), (409, &json!("stopped")), "{}", late.body);
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["stopped"], true);
}
