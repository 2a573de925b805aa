//! Robots of other gateways: their state, values and events at any gateway.

use std::cell::Cell;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use r6_controller::PanelAction;
use r6_sim::VirtualController;
use serde_json::{Value, json};

use crate::gateways::{Here, There, beside, database, lease};
use crate::support::{PATIENCE, Stream, call, ready_to_start, signal};

/// No fresh value is older: the period, what the client allows beyond it, and how long an owner may say
/// nothing.
const FRESH: Duration = Duration::from_millis(3_600);

/// The robot with this name in the list of a gateway, once it is as wanted.
pub async fn listed(here: &Here, robot: &str, is: impl Fn(&Value) -> bool) -> Value {
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

/// Waits for a snapshot, and for a value that is fresh, in it or after it.
async fn anew(stream: &mut Stream) {
    let begun = Cell::new(false);
    let is = |kind: &str, data: &Value| {
        begun.set(begun.get() || kind == "snapshot");
        begun.get() && has_fresh(data)
    };
    until(stream, is).await;
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
    let door = format!("http://{}", one.gateway.address());
    assert_eq!(seen["owner"], door.as_str());
    assert_eq!(one.call("GET", "/v1/robots/press", None).await.1["owner"], door.as_str());
    let (_, list) = other.call("GET", "/v1/robots", None).await;
    assert_eq!(list["robots"].as_array().unwrap().len(), 2, "{list}");

    let at = other.gateway.address();
    let mut live = Stream::open(at, &token, "/v1/live?robot=press&events=true", "").await;
    let is_fresh = |state: &Value| signal(state, "axis-0")["quality"] == "fresh";
    let state = until(&mut live, |kind, data| kind == "snapshot" && is_fresh(data)).await;
    assert!(signal(&state, "isMoving")["age_ms"].as_u64().unwrap() < 3_000, "{state}");
    // What a reader has of another gateway says nothing here.
    let mut elsewhere = Stream::open(one.gateway.address(), &token, "/v1/live", "").await;
    let place = loop {
        let message = elsewhere.next().await.unwrap();
        if !message.id.is_empty() {
            break message.id;
        }
    };
    let mut again = Stream::open(at, &token, &format!("/v1/live?resume={place}"), "").await;
    until(&mut again, |kind, _| kind == "reset").await;
    until(&mut again, |kind, data| kind == "snapshot" && data["name"] == "press").await;
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
    // What is read after an event is as new as the event.
    let (_, list) = other.call("GET", "/v1/robots", None).await;
    let seen = &list["robots"][0];
    assert_eq!((&seen["stopped"], &seen["stopped_by"]["by"]), (&json!(true), &json!("token 1")), "{list}");

    // The alarms of all robots, too.
    press.handle().operate(&PanelAction::EmergencyStop).unwrap();
    until(&mut events, |_, data| data["event"] == "alarm_began").await;
    for here in [&one, &other] {
        let (status, told) = here.call("GET", "/v1/alarms?active=true", None).await;
        assert_eq!((status, &told["alarms"][0]["robot"]), (200, &json!("press")), "{told}");
        assert_eq!((told["alarms"].as_array().unwrap().len(), &told["left_out"]), (1, &json!(0)), "{told}");
        assert_eq!((&told["not_known"], &told["robots"]), (&json!([]), &Value::Null), "{told}");
    }
    press.handle().operate(&PanelAction::ReleaseEmergencyStop).unwrap();

    // Its owner ends: the stream goes on, and the robot is this gateway's.
    one.gateway.shutdown().await.unwrap();
    other.until_up("press").await;
    anew(&mut live).await;
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
    let at = here.gateway.address();
    let mut live = Stream::open(at, &token, "/v1/live", "").await;
    let mut events = Stream::open(at, &token, "/v1/events", "").await;
    let is_fresh = |state: &Value| signal(state, "axis-0")["quality"] == "fresh";
    until(&mut live, |kind, data| kind == "snapshot" && is_fresh(data)).await;
    there.child.kill().unwrap();
    there.child.wait().unwrap();
    let killed = Instant::now();
    let gone = listed(&here, "press", |robot| robot["link"] == "down").await;
    assert!(killed.elapsed() < Duration::from_secs(4), "{:?}", killed.elapsed());
    assert_eq!(gone["lease"]["holder"], "token 1", "its owner may live");
    // No value says that the link is down, so readers begin anew.
    let is_stale =
        |kind: &str, data: &Value| kind == "snapshot" && data["link"] == "down" && !has_fresh(data);
    until(&mut live, is_stale).await;
    // What the owner told last may not have come.
    until(&mut events, |kind, _| kind == "reset").await;
    // The next owner tells anew. The lease ended with the one before.
    anew(&mut live).await;
    let state = here.until_up("press").await;
    assert_eq!(state["lease"], Value::Null);
    let (status, _) = call(here.gateway.address(), &token, "GET", "/v1/robots/press", None).await;
    assert_eq!(status, 200);
    here.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_value_of_a_frozen_gateway_is_never_told_as_younger_than_it_is() {
    let Some((_server, url, token)) = database("the test of a frozen gateway").await else { return };
    let press = ready_to_start().await;
    let robots = [("press", press.address())];
    let there = There::start(&url, &robots).await;
    lease(there.address, &token, "press").await;
    let here = Here::start(&url, &token, &robots).await;
    listed(&here, "press", |robot| robot["link"] == "up").await;
    let at = here.gateway.address();
    // Values that do not change are fresh for as long as their owner says so.
    tokio::time::sleep(Duration::from_secs(3)).await;
    let state = snapshot(at, &token).await;
    assert_eq!(signal(&state, "axis-0")["quality"], "fresh", "{state}");
    there.signal("STOP");
    let frozen = Instant::now();
    // It may have alarms that are not known here.
    let (status, told) = here.call("GET", "/v1/alarms", None).await;
    assert_eq!((status, &told["alarms"], &told["not_known"]), (200, &json!([]), &json!(["press"])), "{told}");
    let (mut looks, mut stale) = (0, 0);
    while here.gateway.owned() == Some(0) {
        let since = frozen.elapsed();
        let state = snapshot(at, &token).await;
        if here.gateway.owned() != Some(0) {
            break;
        }
        for signal in state["signals"].as_array().unwrap() {
            let Some(age) = signal["age_ms"].as_u64().map(Duration::from_millis) else { continue };
            assert!(age + Duration::from_millis(100) > since, "after {since:?}: {signal}");
            assert!(signal["quality"] != "fresh" || age < FRESH, "after {since:?}: {signal}");
            stale += u32::from(signal["quality"] == "stale");
        }
        looks += 1;
        tokio::time::sleep(Duration::from_millis(100)).await;
        assert!(since < PATIENCE);
    }
    assert!(looks > 5 && stale > 0, "{looks} looks, {stale} stale values");
    here.until_up("press").await;
    let mut live = Stream::open(at, &token, "/v1/live", "").await;
    anew(&mut live).await;
    there.signal("CONT");
    here.gateway.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn whether_a_stop_holds_is_told_of_a_robot_whose_gateway_cannot_be_reached() {
    let Some((server, url, token)) = database("the test of a gateway that is not reached").await else {
        return;
    };
    let press = ready_to_start().await;
    let robots = [("press", press.address())];
    let one = Here::start(&url, &token, &robots).await;
    one.until_up("press").await;
    let key = one.lease("press").await;
    let (server, rows) = (std::sync::Arc::new(server), url.clone());
    let door = move |door: String| {
        let (server, rows) = (std::sync::Arc::clone(&server), rows.clone());
        beside(move || drop(server.sql(&rows, &format!("UPDATE r6_gateway.gateway SET name = '{door}'"))))
    };
    door("http://127.0.0.1:1".to_owned()).await;
    let other = Here::start(&url, &token, &robots).await;
    let seen = listed(&other, "press", |_| true).await;
    assert_eq!((&seen["link"], &seen["stopped"]), (&json!("down"), &json!(false)));
    assert_eq!(seen["owner"], Value::Null, "no gateway tells that it has it");
    let mut live = Stream::open(other.gateway.address(), &token, "/v1/live?events=true", "").await;
    until(&mut live, |kind, _| kind == "snapshot").await;
    let (status, stopped) = one.call("POST", "/v1/robots/press/stop", None).await;
    assert_eq!(status, 200, "{stopped}");
    let state = until(&mut live, |kind, data| kind == "snapshot" && data["stopped"] == true).await;
    assert_eq!(state["stopped_by"]["by"], "token 1", "{state}");
    let (_, told) = other.call("GET", "/v1/alarms", None).await;
    assert_eq!(told["not_known"], json!(["press"]), "{told}");
    let cleared = json!({ "lease": key });
    assert_eq!(one.call("POST", "/v1/robots/press/clear-stopped", Some(&cleared)).await.0, 204);
    until(&mut live, |kind, data| kind == "snapshot" && data["stopped"] == false).await;
    // It is reached again. What happened meanwhile may be missing.
    door(format!("http://{}", one.gateway.address())).await;
    until(&mut live, |kind, _| kind == "events_lost").await;
    listed(&other, "press", |robot| robot["link"] == "up" && robot["lease"]["holder"] == "token 1").await;
    let (_, told) = other.call("GET", "/v1/alarms", None).await;
    assert_eq!(told["not_known"], json!([]), "{told}");
    one.gateway.shutdown().await.unwrap();
    other.gateway.shutdown().await.unwrap();
}

/// What a reader that begins now gets of the one robot.
async fn snapshot(at: SocketAddr, token: &str) -> Value {
    let mut live = Stream::open(at, token, "/v1/live", "").await;
    until(&mut live, |kind, _| kind == "snapshot").await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_that_is_added_and_removed_at_one_gateway_comes_and_goes_at_the_others() {
    let Some((_server, url, token)) = database("the test of a robot that is added").await else { return };
    let (press, saw) = (ready_to_start().await, ready_to_start().await);
    let robots = [("press", press.address())];
    let one = Here::start(&url, &token, &robots).await;
    one.until_up("press").await;
    let other = Here::start(&url, &token, &robots).await;
    listed(&other, "press", |robot| robot["link"] == "up").await;
    let mut lives = Vec::new();
    for here in [&one, &other] {
        lives.push(Stream::open(here.gateway.address(), &token, "/v1/live", "").await);
    }
    let wanted = json!({ "address": saw.address() });
    let (status, added) = other.call("PUT", "/v1/robots/saw", Some(&wanted)).await;
    assert_eq!(status, 201, "{added}");
    for (here, live) in [&one, &other].into_iter().zip(&mut lives) {
        listed(here, "saw", |robot| robot["link"] == "up").await;
        let is_saw = |data: &Value| data["robot"] == "saw" || data["name"] == "saw";
        until(live, |_, data| is_saw(data) && has_fresh(data)).await;
    }
    let (status, removed) = one.call("DELETE", "/v1/robots/saw", None).await;
    assert_eq!(status, 204, "{removed}");
    for (here, live) in [&one, &other].into_iter().zip(&mut lives) {
        until(live, |kind, data| kind == "removed" && data["robot"] == "saw").await;
        let (_, list) = here.call("GET", "/v1/robots", None).await;
        assert_eq!(list["robots"].as_array().unwrap().len(), 1, "{list}");
    }
    one.gateway.shutdown().await.unwrap();
    other.gateway.shutdown().await.unwrap();
}
