//! Robots that are added, changed and removed while the gateway runs.

use std::time::Duration;

use r6_api::gateway::Role;
use r6_gateway::{Changes, RobotConfig};
use r6_sim::VirtualController;
use serde_json::{Value, json};

use crate::support::{Hall, Stream, commands, is_of_values, name, signal};

const SAW: &str = "/v1/robots/saw";

async fn put(hall: &Hall, robot: &str, body: Value) -> (u16, Value) {
    hall.call(&hall.admin, "PUT", &format!("/v1/robots/{robot}"), Some(&body)).await
}

/// Sends commands to `press` with its lease until `done` ends. Returns how many were accepted.
async fn meanwhile<T>(hall: &Hall, lease: &Value, done: impl Future<Output = T>) -> (T, usize) {
    let mut done = std::pin::pin!(done);
    let mut accepted = 0;
    loop {
        let command = hall.command(&hall.operator, "press", lease, "modifyGSPD 5");
        let (status, answer) = command.await;
        assert_eq!(status, 200, "{answer}");
        accepted += 1;
        tokio::select! {
            biased;
            result = &mut done => return (result, accepted),
            // A token may make 100 requests a second.
            () = tokio::time::sleep(Duration::from_millis(15)) => {}
        }
    }
}

#[tokio::test]
async fn an_admin_adds_changes_and_removes_a_robot_and_the_others_go_on() {
    let hall = Hall::start().await;
    let lease = hall.lease(&hall.operator, "press").await;
    let mut live = Stream::open(hall.gateway.address(), &hall.viewer, "/v1/live?robot=press", "").await;
    let mut events = Stream::open(hall.gateway.address(), &hall.viewer, "/v1/events", "").await;
    assert_eq!(live.next().await.unwrap().kind, "snapshot");
    let saw = VirtualController::start().await.unwrap();
    let wanted = json!({ "address": saw.address().to_string(), "period_ms": 20 });
    assert_eq!(put(&hall, "saw", wanted.clone()).await.0, 201);
    assert_eq!(put(&hall, "saw", wanted).await.0, 204, "it is so already");
    let state = hall.until_up("saw").await;
    assert_eq!((&state["managed_by"], &state["period_ms"]), (&json!("api"), &json!(20)));
    let of_saw = hall.lease(&hall.operator, "saw").await;

    // It reads one more value, which needs a new connection. The lease ends, and the old key is dead.
    let more = json!({ "address": saw.address().to_string(), "read": ["Addr-800"] });
    let (answer, _) = meanwhile(&hall, &lease, put(&hall, "saw", more)).await;
    assert_eq!(answer.0, 204, "{}", answer.1);
    let state = hall.until("saw", |state| signal(state, "Addr-800")["quality"] == "fresh").await;
    assert_eq!((&state["lease"], &state["period_ms"]), (&json!(null), &json!(100)));
    let (status, _) = hall.command(&hall.operator, "saw", &of_saw, "modifyGSPD 5").await;
    assert_eq!(status, 409);

    let remove = hall.call(&hall.admin, "DELETE", SAW, None);
    let (answer, _) = meanwhile(&hall, &lease, remove).await;
    assert_eq!(answer.0, 204, "{}", answer.1);
    for (method, path) in [("GET", SAW), ("DELETE", SAW), ("GET", "/v1/live?robot=saw")] {
        let (status, problem) = hall.call(&hall.admin, method, path, None).await;
        assert_eq!((status, &problem["code"]), (404, &json!("no_such_robot")), "{method} {path}");
    }

    // The other robot kept its lease and its connection.
    let press = hall.get(&hall.viewer, "/v1/robots/press").await;
    assert_eq!((&press["lease"]["number"], &press["link"]), (&lease["number"], &json!("up")));
    let mut told = Vec::new();
    while told.last().is_none_or(|last| last != "robot_removed") {
        let event = events.next().await.unwrap().data;
        let kind = event["event"].as_str().unwrap().to_owned();
        assert!(event["robot"] == "saw" || !kind.starts_with("link"), "{event}");
        if event["robot"] == "saw" && !is_of_values(&kind) {
            told.push(kind);
        }
    }
    let wanted = [
        "robot_added",
        "link_up",
        "lease_began",
        "link_down",
        "lease_ended",
        "robot_changed",
        "link_up",
        "link_down",
        "robot_removed",
    ];
    assert_eq!(told, wanted);
    let configured = hall.until_audited(|entry| entry["what"] == "robot_removed").await;
    assert_eq!((&configured["actor"], &configured["robot"]), (&json!("token 4 (admin)"), &json!("saw")));
    let configured =
        hall.audit().await.into_iter().filter(|entry| entry["what"] == "robot_configured").count();
    assert_eq!(configured, 2);
}

#[tokio::test]
async fn a_robot_of_the_api_outlives_a_new_start_and_its_lease_numbers_go_on() {
    let saw = VirtualController::start().await.unwrap();
    let hall = Hall::at(tempfile::tempdir().unwrap(), Vec::new(), vec![saw]).await;
    let wanted = json!({ "address": hall.robots[0].address().to_string(), "read": ["counter-1"] });
    assert_eq!(put(&hall, "saw", wanted.clone()).await.0, 201);
    hall.until_up("saw").await;
    let lease = hall.lease(&hall.operator, "saw").await;

    // Removed and added again, it is the same robot: no number is given out twice.
    assert_eq!(hall.call(&hall.admin, "DELETE", SAW, None).await.0, 204);
    assert_eq!(put(&hall, "saw", wanted).await.0, 201);
    hall.until_up("saw").await;
    assert_eq!(hall.stop(&hall.operator, "saw").await.0, 200);
    let hall = hall.again(Vec::new(), Vec::new()).await;
    let state = hall.get(&hall.viewer, SAW).await;
    assert_eq!((&state["managed_by"], &state["stopped"]), (&json!("api"), &json!(true)));
    assert_eq!(signal(&state, "counter-1")["address"], "counter-1");
    let next = hall.lease(&hall.operator, "saw").await;
    assert!(next["number"].as_u64() > lease["number"].as_u64());
}

#[tokio::test]
async fn an_address_that_never_answered_is_not_called_virtual() {
    let hall = Hall::start().await;
    let saw = VirtualController::start().await.unwrap();
    let at = |address: String| json!({ "address": address, "period_ms": 20 });
    assert_eq!(put(&hall, "saw", at(saw.address().to_string())).await.0, 201);
    let state = hall.until_up("saw").await;
    assert_eq!(state["virtual"], true);
    // Removed and added again elsewhere, and moved elsewhere.
    assert_eq!(hall.call(&hall.admin, "DELETE", SAW, None).await.0, 204);
    assert_eq!(put(&hall, "saw", at("127.0.0.1:1".to_owned())).await.0, 201);
    let elsewhere = hall.get(&hall.viewer, SAW).await;
    assert_eq!((&elsewhere["virtual"], &elsewhere["link"]), (&json!(null), &json!("down")));
    assert_eq!(elsewhere["identity"], state["identity"], "the robot that is expected");
    assert_eq!(put(&hall, "saw", at(saw.address().to_string())).await.0, 204);
    assert_eq!(hall.until_up("saw").await["virtual"], true);
    assert_eq!(put(&hall, "saw", at("127.0.0.1:2".to_owned())).await.0, 204);
    assert_eq!(hall.get(&hall.viewer, SAW).await["virtual"], Value::Null);
}

#[tokio::test]
async fn two_robots_cannot_have_one_address_and_the_file_is_not_changed_by_the_api() {
    let hall = Hall::start().await;
    let address = hall.robots[0].address().to_string();
    let (status, problem) = put(&hall, "saw", json!({ "address": address })).await;
    assert_eq!((status, &problem["code"]), (409, &json!("address_taken")));
    let (status, problem) = put(&hall, "press", json!({ "address": "127.0.0.2" })).await;
    assert_eq!((status, &problem["code"]), (409, &json!("managed_by_file")));
    for (robot, body) in [
        ("Saw", json!({ "address": "127.0.0.2" })),
        ("saw", json!({ "address": "a b" })),
        ("saw", json!({ "address": "127.0.0.2", "period_ms": 19 })),
        ("saw", json!({ "address": "127.0.0.2", "read": ["no-such-address"] })),
        ("saw", json!({ "address": "127.0.0.2", "read": vec!["Addr-800"; 201] })),
    ] {
        let (status, problem) = put(&hall, robot, body.clone()).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")), "{robot} {body}");
    }
    let robots = hall.get(&hall.viewer, "/v1/robots").await;
    assert_eq!(robots["robots"].as_array().unwrap().len(), 1);
}

#[tokio::test]
async fn a_configuration_that_is_read_again_touches_only_what_changed() {
    let robots = [VirtualController::start().await, VirtualController::start().await];
    let hall = Hall::with(robots.map(Result::unwrap).into()).await;
    let lease = hall.lease(&hall.operator, "press").await;
    let of_saw = hall.lease(&hall.operator, "saw").await;
    let mut log = hall.robots[1].handle().log();
    let third = VirtualController::start().await.unwrap();
    let fast = |called: &str, address: String| RobotConfig {
        period: Duration::from_millis(20),
        ..RobotConfig::new(name(called), address)
    };
    let press = fast("press", hall.robots[0].address().to_string());
    let oven = fast("oven", third.address().to_string());

    // A mistake changes nothing.
    let twice = vec![press.clone(), fast("oven", hall.robots[0].address().to_string())];
    let problem = hall.gateway.reload(twice).await.unwrap_err();
    assert_eq!(problem.code.word(), "address_taken");
    assert_eq!(hall.gateway.robots(), 2);

    let reload = hall.gateway.reload(vec![press.clone(), oven.clone()]);
    let (changes, _) = meanwhile(&hall, &lease, reload).await;
    assert_eq!(changes.unwrap(), Changes { added: 1, changed: 0, removed: 1 });
    hall.until_up("oven").await;
    let (status, _) = hall.command(&hall.operator, "saw", &of_saw, "modifyGSPD 5").await;
    assert_eq!(status, 404);
    assert!(commands(&mut log).is_empty());

    // The same again, with another address for one of them: another robot answers there.
    let other = hall.robots[1].address().to_string();
    let changes = hall.gateway.reload(vec![press, fast("oven", other)]).await.unwrap();
    assert_eq!(changes, Changes { added: 0, changed: 1, removed: 0 });
    let press = hall.get(&hall.viewer, "/v1/robots/press").await;
    assert_eq!(press["lease"]["number"], lease["number"]);
    hall.until_up("oven").await;
}

#[tokio::test]
async fn an_admin_of_one_robot_cannot_point_it_at_another_arm() {
    let hall = Hall::start().await;
    let saw = VirtualController::start().await.unwrap();
    let own = r6_gateway::make_token(hall.data.path(), Role::Admin, Some(name("saw").into()), String::new());
    let own = own.unwrap().1;
    let at = |address: String| json!({ "address": address });
    let press = hall.robots[0].address();
    let put_own = async |body: Value| hall.call(&own, "PUT", SAW, Some(&body)).await;
    let (status, problem) = put_own(at(saw.address().to_string())).await;
    assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")), "a robot that is not there yet");
    assert_eq!(put(&hall, "saw", at(saw.address().to_string())).await.0, 201);
    for address in [press.to_string(), format!("[::ffff:127.0.0.1]:{}", press.port()), "10.0.0.1".to_owned()]
    {
        let (status, problem) = put_own(at(address)).await;
        assert_eq!((status, &problem["code"]), (403, &json!("not_allowed")));
        assert!(!problem["message"].as_str().unwrap().contains("press"), "{problem}");
    }
    let period = json!({ "address": saw.address().to_string(), "period_ms": 50 });
    assert_eq!(put_own(period).await.0, 204);
    // Nor do two robots have one address that is written in two ways.
    let (status, problem) = put(&hall, "saw", at(format!("[::ffff:127.0.0.1]:{}", press.port()))).await;
    assert_eq!((status, &problem["code"]), (409, &json!("address_taken")));
}

#[tokio::test]
async fn a_robot_whose_stop_holds_keeps_its_arm() {
    let hall = Hall::start().await;
    let (saw, oven) = (VirtualController::start().await.unwrap(), VirtualController::start().await.unwrap());
    let at = |robot: &VirtualController| json!({ "address": robot.address().to_string() });
    assert_eq!(put(&hall, "saw", at(&saw)).await.0, 201);
    hall.until_up("saw").await;
    for robot in ["saw", "press"] {
        assert_eq!(hall.stop(&hall.operator, robot).await.0, 200);
    }
    let refused = [hall.call(&hall.admin, "DELETE", SAW, None).await, put(&hall, "saw", at(&oven)).await];
    for (status, problem) in refused {
        assert_eq!((status, &problem["code"]), (409, &json!("stopped")), "{problem}");
    }
    // The file takes the arm of a stopped robot away, gives it to another name, or exchanges two names.
    let config =
        |called: &str, robot: &VirtualController| RobotConfig::new(name(called), robot.address().to_string());
    let press = &hall.robots[0];
    for file in [
        Vec::new(),
        vec![config("press", &oven)],
        vec![config("press", &oven), config("cutter", press)],
        vec![config("press", &saw), config("saw", press)],
        vec![config("press", press), config("saw", &oven)],
    ] {
        let refused = hall.gateway.reload(file).await.unwrap_err();
        assert_eq!(refused.code.word(), "stopped", "{refused:?}");
    }
    for (robot, arm) in [("press", press), ("saw", &saw)] {
        let state = hall.get(&hall.viewer, &format!("/v1/robots/{robot}")).await;
        assert_eq!((&state["address"], &state["stopped"]), (&at(arm)["address"], &json!(true)));
    }
    // What does not touch its arm is changed, and the stop still holds.
    let often = json!({ "address": saw.address().to_string(), "period_ms": 50 });
    assert_eq!(put(&hall, "saw", often).await.0, 204);
    assert_eq!(hall.get(&hall.viewer, SAW).await["stopped"], true);

    // A stop can be cleared at a robot that does not answer: it may be scrapped.
    saw.shutdown().await.unwrap();
    hall.until("saw", |state| state["link"] != "up").await;
    for robot in ["saw", "press"] {
        let lease = hall.lease(&hall.operator, robot).await;
        let path = format!("/v1/robots/{robot}/clear-stopped");
        assert_eq!(hall.post(&hall.operator, &path, &json!({ "lease": lease })).await.0, 204);
    }
    assert_eq!(put(&hall, "saw", at(&oven)).await.0, 204);
    assert_eq!(hall.call(&hall.admin, "DELETE", SAW, None).await.0, 204);
    assert_eq!(hall.gateway.reload(Vec::new()).await.unwrap().removed, 1);
}
