//! Robots of other gateways: their state, values and events at any gateway.

use std::time::{Duration, Instant};

use r6_sim::VirtualController;
use serde_json::{Value, json};

use crate::owner::{Here, There, database, lease};
use crate::support::{PATIENCE, Stream, call, ready_to_start, signal};

/// The robot with this name in the list of a gateway, once it is as wanted.
async fn listed(here: &Here, robot: &str, is: impl Fn(&Value) -> bool) -> Value {
    let begun = Instant::now();
    loop {
        let (status, list) = here.call("GET", "/v1/robots", None).await;
        assert_eq!(status, 200, "{list}");
        let found = list["robots"].as_array().unwrap().iter().find(|found| found["name"] == robot);
        if let Some(found) = found.filter(|found| is(found)) {
            return found.clone();
        }
        assert!(begun.elapsed() < PATIENCE, "{list}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// Whether a message has a value that is fresh.
fn has_fresh(data: &Value) -> bool {
    let signals = data["signals"].as_array();
    signals.is_some_and(|signals| signals.iter().any(|signal| signal["quality"] == "fresh"))
}

/// The next message of a stream that is as wanted.
async fn until(stream: &mut Stream, is: impl Fn(&str, &Value) -> bool) -> Value {
    let mut passed = Vec::new();
    let wanted = async {
        loop {
            let message = stream.next().await.expect("the stream goes on");
            if is(&message.kind, &message.data) {
                return message.data;
            }
            passed.push(format!("{} {}", message.kind, message.data));
        }
    };
    let wanted = tokio::time::timeout(PATIENCE, wanted).await.ok();
    wanted.unwrap_or_else(|| panic!("it did not come, only {passed:#?}"))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn any_gateway_tells_of_all_robots() {
    let Some((_server, url, token)) = database("the test of lists and streams").await else { return };
    let (press, saw) = (VirtualController::start().await.unwrap(), VirtualController::start().await.unwrap());
    let robots = [("press", press.address()), ("saw", saw.address())];
    let one = Here::start(&url, &token, &robots).await;
    one.until_up("press").await;
    one.until_up("saw").await;
    // Both stay where they are.
    let (key, _) = (one.lease("press").await, one.lease("saw").await);
    let other = Here::start(&url, &token, &robots).await;
    let seen = listed(&other, "press", |robot| robot["link"] == "up").await;
    assert_eq!((&seen["lease"]["holder"], seen["stopped"].as_bool()), (&json!("token 1"), Some(false)));
    let (_, list) = other.call("GET", "/v1/robots", None).await;
    assert_eq!(list["robots"].as_array().unwrap().len(), 2, "{list}");

    let at = other.gateway.address();
    let mut live = Stream::open(at, &token, "/v1/live?robot=press&events=true", "").await;
    let is_fresh = |state: &Value| signal(state, "axis-0")["quality"] == "fresh";
    let state = until(&mut live, |kind, data| kind == "snapshot" && is_fresh(data)).await;
    assert!(signal(&state, "isMoving")["age_ms"].as_u64().unwrap() < 3_000, "{state}");
    let mut events = Stream::open(at, &token, "/v1/events?robot=press", "").await;
    let program = "[[instruction]]\ndo = \"axis-move\"\nto = [60, 0, 0, 0, 0, 0]\nspeed = 1\n";
    let asked = json!({ "program": program, "lease": key });
    let run = crate::support::call_with(
        at,
        &token,
        "POST",
        "/v1/robots/press/programs/run",
        "Idempotency-Key: one\r\n",
        Some(&asked),
    );
    assert_eq!(run.await.status, 202);
    let moves = |kind: &str, data: &Value| {
        let signals = data["signals"].as_array().cloned().unwrap_or_default();
        kind == "change"
            && signals
                .iter()
                .any(|signal| signal["address"] == "axis-0" && signal["value"].as_f64() > Some(0.0))
    };
    let changed = until(&mut live, moves).await;
    assert_eq!(changed["robot"], "press");
    until(&mut events, |_, data| data["event"] == "run_began").await;
    let (status, stopped) = one.call("POST", "/v1/robots/press/stop", None).await;
    assert_eq!(status, 200, "{stopped}");
    until(&mut live, |kind, data| kind == "event" && data["event"] == "stop_ended").await;
    let seen = listed(&other, "press", |robot| robot["stopped"] == true).await;
    assert_eq!(seen["stopped_by"]["by"], "token 1");

    // Its owner ends: the stream goes on, and the robot is this gateway's.
    one.gateway.shutdown().await.unwrap();
    other.until_up("press").await;
    until(&mut live, |kind, _| kind == "snapshot").await;
    until(&mut live, |_, data| has_fresh(data)).await;
    let (_, list) = other.call("GET", "/v1/robots", None).await;
    assert_eq!(list["robots"].as_array().unwrap().len(), 2, "{list}");
    other.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_value_of_a_silent_gateway_is_told_as_fresh_and_the_next_owner_tells_anew() {
    let Some((_server, url, token)) = database("the test of a silent gateway").await else { return };
    let press = ready_to_start().await;
    let robots = [("press", press.address())];
    let mut there = There::start(&url, &robots).await;
    lease(there.address, &token, "press").await;
    let here = Here::start(&url, &token, &robots).await;
    listed(&here, "press", |robot| robot["link"] == "up").await;
    let mut live = Stream::open(here.gateway.address(), &token, "/v1/live", "").await;
    let is_fresh = |state: &Value| signal(state, "axis-0")["quality"] == "fresh";
    until(&mut live, |kind, data| kind == "snapshot" && is_fresh(data)).await;
    there.child.kill().unwrap();
    there.child.wait().unwrap();
    let killed = Instant::now();
    let gone = listed(&here, "press", |robot| robot["link"] == "down").await;
    assert!(killed.elapsed() < Duration::from_secs(4), "{:?}", killed.elapsed());
    assert_eq!(gone["lease"], Value::Null, "it ends with its owner");
    let is_stale = |kind: &str, data: &Value| {
        let signals = data["signals"].as_array().cloned().unwrap_or_default();
        kind == "change" && signals.iter().all(|signal| signal["quality"] == "stale") && !signals.is_empty()
    };
    until(&mut live, is_stale).await;
    // The next owner tells anew.
    until(&mut live, |kind, _| kind == "snapshot").await;
    until(&mut live, |_, data| has_fresh(data)).await;
    here.until_up("press").await;
    let (status, _) = call(here.gateway.address(), &token, "GET", "/v1/robots/press", None).await;
    assert_eq!(status, 200);
    here.gateway.shutdown().await.unwrap();
}
