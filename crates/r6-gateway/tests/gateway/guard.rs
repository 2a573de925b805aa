//! The guard of a robot: no list with a step beyond it leaves the gateway.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use r6_client::AxisIndex;
use r6_client::units::{Degrees, Percent};
use r6_gateway::{Gateway, GatewaySettings, Guard, RawAllow, RawPort, RobotConfig};
use r6_sim::VirtualController;
use serde_json::{Value, json};

use crate::raw::lists::{list, to};
use crate::raw::{Script, policy, verdict};
use crate::support::{Hall, Reply, call_with, name, settings, signal};

/// J1 from -10 to 10 degrees, the tool from 700 to 900 mm above the floor, and half of the speed.
fn guard() -> Guard {
    Guard::new()
        .axis(AxisIndex::ALL[0], Degrees(-10.0).into(), Degrees(10.0).into())
        .workspace([None, None, Some((700.0, 900.0))])
        .max_speed(Percent::new(50.0).unwrap())
}

/// A gateway with one robot behind this guard, and its raw port, over which scripts of this machine command
/// it.
async fn hall(guard: Guard) -> Hall {
    let robot = VirtualController::start().await.unwrap();
    let period = Duration::from_millis(20);
    let press = RobotConfig {
        period,
        guard: Some(Arc::new(guard)),
        ..RobotConfig::new(name("press"), robot.address().to_string())
    };
    let data = tempfile::tempdir().unwrap();
    let port = RawPort { robot: name("press"), listen: SocketAddr::from(([127, 0, 0, 1], 0)) };
    let raw_policy = policy(&[("127.0.0.1", RawAllow::Command)]);
    let settings = GatewaySettings { raw: vec![port], raw_policy, ..settings(data.path(), vec![press]) };
    let gateway = Gateway::start(settings).await.unwrap();
    let hall = Hall::of(gateway, data, vec![robot]);
    hall.until_up("press").await;
    hall
}

/// A run of these steps of `press` with a lease of its own.
async fn run(hall: &Hall, key: &str, steps: &str) -> Reply {
    run_of(hall, "press", key, steps).await
}

async fn run_of(hall: &Hall, robot: &str, key: &str, steps: &str) -> Reply {
    let lease = hall.lease(&hall.operator, robot).await;
    let body = json!({ "program": steps, "lease": lease });
    let line = format!("Idempotency-Key: {key}\r\n");
    let path = format!("/v1/robots/{robot}/programs/run");
    let reply = call_with(hall.gateway.address(), &hall.operator, "POST", &path, &line, Some(&body)).await;
    if reply.status != 202 {
        let path = format!("/v1/robots/{robot}/lease");
        hall.call(&hall.operator, "DELETE", &path, Some(&json!({ "lease": lease }))).await;
    }
    reply
}

fn turn_j1(degrees: f64, speed: u32) -> String {
    format!("[[instruction]]\ndo = \"axis-move\"\nto = [{degrees:?}, 0, 0, 0, 0, 0]\nspeed = {speed}\n")
}

async fn axis(hall: &Hall) -> Value {
    let asked = hall.get(&hall.viewer, "/v1/robots/press/query?address=axis-0").await;
    signal(&asked, "axis-0")["value"].clone()
}

#[tokio::test]
async fn a_run_with_a_step_beyond_the_guard_does_not_move_the_arm_and_names_the_step() {
    let hall = hall(guard()).await;
    let before = axis(&hall).await;
    let low = "[[instruction]]\ndo = \"linear-move\"\nto = [500, 0, 600, 180, 0, 180]\nspeed = 10\n";
    for (key, steps, says) in [
        (
            "axis",
            turn_j1(5.0, 20) + &turn_j1(20.0, 20),
            "step 2: J1 goes to 20 deg, outside of -10 to 10 deg",
        ),
        ("speed", turn_j1(5.0, 60), "step 1: the speed is 60 %"),
        ("place", low.to_owned(), "step 1: Z gets to 600 mm, outside of 700 to 900 mm"),
    ] {
        let reply = run(&hall, key, &steps).await;
        assert_eq!((reply.status, &reply.body["code"]), (422, &json!("beyond_limits")), "{}", reply.body);
        assert!(reply.body["message"].as_str().unwrap().contains(says), "{}", reply.body);
    }
    assert_eq!(axis(&hall).await, before, "nothing was sent");
    assert_eq!(run(&hall, "within", &turn_j1(5.0, 50)).await.status, 202);
    hall.until("press", |state| signal(state, "axis-0")["value"] == 5.0).await;
}

#[tokio::test]
async fn a_list_of_a_script_beyond_the_guard_is_answered_with_err_and_does_not_move_the_arm() {
    let hall = hall(guard()).await;
    let before = axis(&hall).await;
    let mut script = Script::at(hall.raw()).await;
    let reply = script.ask(&list(true, &[to("5", "20"), to("20", "20")])).await;
    let said = verdict(&reply);
    assert!(said.starts_with("err ") && said.contains("step 2: J1 goes to 20"), "{said}");
    assert_eq!(axis(&hall).await, before);
    assert_eq!(verdict(&script.ask(&list(true, &[to("5", "20")])).await), "ok");
    hall.until("press", |state| signal(state, "axis-0")["value"] == 5.0).await;
}

#[tokio::test]
async fn the_api_tells_the_limits_of_a_robot() {
    let hall = hall(guard()).await;
    let state = hall.get(&hall.viewer, "/v1/robots/press").await;
    let expected = json!({
        "max_speed": 50.0,
        "max_path_speed": null,
        "max_axis_step": null,
        "max_distance": null,
        "axes": [{ "of": "J1", "unit": "deg", "lowest": -10.0, "highest": 10.0 }],
        "workspace": [{ "of": "z", "unit": "mm", "lowest": 700.0, "highest": 900.0 }],
    });
    assert_eq!(state["guard"], expected);
}

#[tokio::test]
async fn a_robot_of_the_api_has_its_limits_after_a_new_start_and_until_it_is_put_without_them() {
    let saw = VirtualController::start().await.unwrap();
    let mut hall = Hall::at(tempfile::tempdir().unwrap(), Vec::new(), vec![saw]).await;
    let address = hall.robots[0].address().to_string();
    let limits = json!({ "axes": [{ "of": "J1", "unit": "deg", "lowest": -10.0, "highest": 10.0 }] });
    let put = |body: Value| {
        let hall = &hall;
        async move { hall.call(&hall.admin, "PUT", "/v1/robots/saw", Some(&body)).await }
    };
    let wrong = json!({ "address": address, "guard": { "max_speed": 0.0 } });
    let (status, problem) = put(wrong).await;
    assert_eq!((status, &problem["code"]), (422, &json!("bad_value")));
    assert!(
        problem["message"].as_str().unwrap().contains("`guard`: `max_speed`: 0 is not allowed"),
        "{problem}"
    );
    // A list would be taken in the order of the fields, and an empty one would be no limits.
    for list in [json!([]), json!([10.0])] {
        let (status, problem) = put(json!({ "address": address, "guard": list })).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")));
        assert!(problem["message"].as_str().unwrap().contains("an object with the names"), "{problem}");
    }
    let (status, problem) = put(json!([address])).await;
    assert_eq!((status, &problem["message"]), (422, &json!("the body is a list: it has to be an object")));
    let (status, problem) = put(json!({ "address": address, "parts": "axis-0" })).await;
    assert_eq!((status, &problem["code"]), (422, &json!("bad_value")));
    assert!(problem["message"].as_str().unwrap().contains("`parts` is a counter"), "{problem}");
    let wanted = json!({ "address": address, "period_ms": 20, "parts": "counter-3", "guard": limits });
    assert_eq!(put(wanted).await.0, 201);
    hall.until_up("saw").await;
    let robots = std::mem::take(&mut hall.robots);
    let hall = hall.again(Vec::new(), robots).await;
    let state = hall.until_up("saw").await;
    assert_eq!((&state["guard"]["axes"], &state["parts"]), (&limits["axes"], &json!("counter-3")));
    let reply = run_of(&hall, "saw", "beyond", &turn_j1(20.0, 20)).await;
    assert_eq!((reply.status, &reply.body["code"]), (422, &json!("beyond_limits")), "{}", reply.body);
    let configured = hall.until_audited(|entry| entry["what"] == "robot_configured").await;
    assert_eq!((&configured["guard"], &configured["parts"]), (&limits, &json!("counter-3")));

    let bare = json!({ "address": address, "period_ms": 20 });
    let (status, _) = hall.call(&hall.admin, "PUT", "/v1/robots/saw", Some(&bare)).await;
    assert_eq!(status, 204);
    let state = hall.until("saw", |state| state["link"] == "up" && state["guard"].is_null()).await;
    assert_eq!(state["parts"], Value::Null);
    assert_eq!(run_of(&hall, "saw", "free", &turn_j1(20.0, 20)).await.status, 202);
}
