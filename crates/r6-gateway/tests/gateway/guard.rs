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

/// A run of these steps with a lease of its own.
async fn run(hall: &Hall, key: &str, steps: &str) -> Reply {
    let lease = hall.lease(&hall.operator, "press").await;
    let body = json!({ "program": steps, "lease": lease });
    let line = format!("Idempotency-Key: {key}\r\n");
    let path = "/v1/robots/press/programs/run";
    let reply = call_with(hall.gateway.address(), &hall.operator, "POST", path, &line, Some(&body)).await;
    if reply.status != 202 {
        hall.call(&hall.operator, "DELETE", "/v1/robots/press/lease", Some(&json!({ "lease": lease }))).await;
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
