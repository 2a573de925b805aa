//! Robots: their values, their links, and a robot that is exchanged.

use std::time::{Duration, Instant};

use r6_controller::{PanelAction, RobotModel};
use r6_gateway::RobotConfig;
use r6_sim::{SimSettings, Simulation, VirtualController};
use serde_json::json;

use crate::support::{Hall, call, commands, name, settings, signal, way};

#[tokio::test]
async fn values_have_unit_quality_and_age() {
    let hall = Hall::start().await;
    let state = hall.until("press", |state| signal(state, "world-0")["quality"] == "fresh").await;
    assert_eq!((&state["virtual"], &state["period_ms"]), (&json!(true), &json!(20)));
    assert_eq!(state["identity"]["machine_name"], "r6 virtual BRTIRUS0707A");
    let x = signal(&state, "world-0");
    assert!(x["value"].is_f64() && x["age_ms"].as_u64().unwrap() < 2_000, "{x}");
    assert_eq!((&x["unit"], &signal(&state, "world-3")["unit"]), (&json!("mm"), &json!("deg")));
    assert_eq!(signal(&state, "axis-0")["unit"], json!(null), "no address tells whether an axis turns");
    assert_eq!(signal(&state, "curMode")["value"], 7);
    assert_eq!(signal(&state, "isMoving")["value"], false);
}

#[tokio::test]
async fn a_robot_that_does_not_answer_delays_no_other() {
    let alive = VirtualController::start().await.unwrap();
    // It takes connections and never says a word.
    let deaf = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let fast = |called: &str, address: String| RobotConfig {
        period: Duration::from_millis(20),
        ..RobotConfig::new(name(called), address)
    };
    let configs = vec![
        fast("alive", alive.address().to_string()),
        fast("deaf", deaf.local_addr().unwrap().to_string()),
        // No program listens there.
        fast("dead", "127.0.0.1:1".to_owned()),
    ];
    let hall = Hall::at(tempfile::tempdir().unwrap(), configs, vec![alive]).await;
    hall.until_up("alive").await;
    for robot in ["deaf", "dead"] {
        let state = hall.get(&hall.viewer, &format!("/v1/robots/{robot}")).await;
        assert_eq!((&state["link"], &signal(&state, "axis-0")["quality"]), (&json!("down"), &json!("none")));
        let lease = hall.lease(&hall.operator, robot).await;
        let (status, problem) = hall.command(&hall.operator, robot, &lease, "modifyGSPD 5").await;
        assert_eq!((status, &problem["code"]), (409, &json!("not_ready")));
    }
    // Stops of the others are under way and take seconds.
    let stop = |robot: &'static str| {
        let (address, token) = (hall.gateway.address(), hall.operator.clone());
        let path = format!("/v1/robots/{robot}/stop");
        tokio::spawn(async move { call(address, &token, "POST", &path, None).await })
    };
    let others = [stop("deaf"), stop("dead")];
    let lease = hall.lease(&hall.operator, "alive").await;
    let begun = Instant::now();
    for _ in 0..20 {
        let (status, done) = hall.command(&hall.operator, "alive", &lease, "modifyGSPD 5").await;
        assert_eq!(status, 200, "{done}");
        let state = hall.get(&hall.viewer, "/v1/robots/alive").await;
        assert!(signal(&state, "curMode")["age_ms"].as_u64().unwrap() < 1_000, "{state:#}");
    }
    assert!(begun.elapsed() < Duration::from_secs(10), "{:?}", begun.elapsed());
    for other in others {
        let (status, problem) = other.await.unwrap();
        assert_eq!((status, &problem["code"]), (504, &json!("not_stopped")));
    }
}

#[tokio::test]
async fn a_robot_that_is_exchanged_gets_no_command_until_an_engineer_accepts_it() {
    let mut hall = Hall::start().await;
    let lease = hall.lease(&hall.operator, "press").await;
    let first = hall.robots.pop().unwrap();
    let address = first.address();
    first.shutdown().await.unwrap();
    let state = hall.until("press", |state| state["link"] == "down").await;
    assert_eq!(signal(&state, "curMode")["quality"], "stale");

    let model = RobotModel::named("BRTIRUS1510A").unwrap().clone();
    let settings = SimSettings { listen: vec![address], model, ..SimSettings::default() };
    let other = Simulation::start(settings).await.unwrap();
    let mut log = other.controllers()[0].log_from_start();
    let state = hall.until("press", |state| !state["identity_changed"].is_null()).await;
    let change = &state["identity_changed"];
    assert_eq!(change["expected"]["machine_name"], "r6 virtual BRTIRUS0707A");
    assert_eq!(change["found"]["machine_name"], "r6 virtual BRTIRUS1510A");
    assert_eq!(state["lease"], json!(null), "the lease has ended");
    let (status, problem) = hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await;
    assert_eq!((status, &problem["code"]), (409, &json!("identity_changed")));
    let (status, problem) = hall.post(&hall.operator, "/v1/robots/press/lease", &json!({})).await;
    assert_eq!((status, &problem["code"]), (409, &json!("identity_changed")));

    let accept = "/v1/robots/press/accept-identity";
    let (status, _) = hall.post(&hall.engineer, accept, &change["expected"]).await;
    assert_eq!(status, 409, "this is not the robot that answers");
    let (status, problem) = hall.post(&hall.engineer, accept, &change["found"]).await;
    assert_eq!(status, 204, "{problem}");
    hall.until_up("press").await;
    let lease = hall.lease(&hall.operator, "press").await;
    let (status, done) = hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await;
    assert_eq!(status, 200, "{done}");
    assert_eq!(commands(&mut log), ["modifyGSPD"]);
    hall.until_audited(|entry| entry["what"] == "identity_accepted").await;
}

#[tokio::test]
async fn a_robot_that_is_exchanged_while_the_gateway_is_off_is_noticed_too() {
    let hall = Hall::start().await;
    // The identity is on the disk before a lease is given out.
    hall.lease(&hall.operator, "press").await;
    // A robot of which nothing was kept has no past that could be told apart.
    hall.until_history("signal=curMode", |history| history["kept_until"].is_string()).await;
    let model = RobotModel::named("BRTIRUS1510A").unwrap().clone();
    let other = VirtualController::builder().model(model).start().await.unwrap();
    let config = RobotConfig::new(name("press"), other.address().to_string());
    let hall = hall.again(vec![config], vec![other]).await;
    let state = hall.until("press", |state| !state["identity_changed"].is_null()).await;
    let (status, problem) = hall.post(&hall.operator, "/v1/robots/press/lease", &json!({})).await;
    assert_eq!((status, &problem["code"]), (409, &json!("identity_changed")));

    // What it does is not told as what the other one did, until it is accepted.
    let told = hall.until_events("kind=unseen", |events| !events.is_empty()).await;
    assert_eq!((told.len(), &told[0]["because"]), (1, &json!("another_robot")), "{told:#?}");
    let before = hall.get(&hall.viewer, "/v1/robots/press/production").await;
    hall.robots[0].handle().operate(&PanelAction::EmergencyStop).unwrap();
    let state_of_other = hall.until("press", |state| signal(state, "curAlarm")["value"] == 7).await;
    assert_eq!(signal(&state_of_other, "curAlarm")["quality"], "stale", "it is no value of this robot");
    tokio::time::sleep(Duration::from_millis(600)).await;
    let after = hall.get(&hall.viewer, "/v1/robots/press/production").await;
    assert_eq!((&after["seen_ms"], &after["alarms"]["codes"]), (&before["seen_ms"], &json!(0)), "{after:#}");

    let found = &state["identity_changed"]["found"];
    assert_eq!(hall.post(&hall.engineer, "/v1/robots/press/accept-identity", found).await.0, 204);
    hall.until("press", |state| signal(state, "curAlarm")["quality"] == "fresh").await;
    let told = hall.until_events("kind=unseen", |events| events.len() > 1).await;
    assert_eq!((&told[1]["because"], &told[1]["from"]), (&json!("another_robot"), &told[0]["from"]));
    hall.robots[0].handle().operate(&PanelAction::ReleaseEmergencyStop).unwrap();
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "clearAlarm").await.0, 200);
    hall.until_events("kind=alarm_ended", |events| events.len() == 1).await;
}

#[tokio::test]
async fn two_gateways_do_not_share_a_folder() {
    let hall = Hall::start().await;
    let error = r6_gateway::Gateway::start(settings(hall.data.path(), Vec::new())).await.unwrap_err();
    assert!(error.to_string().contains("another gateway uses"), "{error}");
}

#[tokio::test]
async fn values_grow_old_also_while_a_new_connection_gets_no_answer() {
    let robot = VirtualController::start().await.unwrap();
    let (address, cut) = way(robot.address()).await;
    let period = Duration::from_millis(20);
    let press = RobotConfig { period, ..RobotConfig::new(name("press"), address.to_string()) };
    let hall = Hall::at(tempfile::tempdir().unwrap(), vec![press], vec![robot]).await;
    hall.until_up("press").await;
    cut.send(true).unwrap();
    let begun = Instant::now();
    let state = hall
        .until("press", |state| state["link"] == "down" && signal(state, "isMoving")["quality"] == "stale")
        .await;
    assert!(begun.elapsed() < Duration::from_secs(3), "{:?}: {state}", begun.elapsed());
}

/// The files of a folder and of the folders in it.
fn files(folder: &std::path::Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let names = entries.flat_map(|path| match path.is_dir() {
        true => files(&path),
        false => vec![path.file_name().unwrap().to_string_lossy().into_owned()],
    });
    names.collect()
}

#[tokio::test]
async fn an_orderly_end_leaves_no_logs_of_the_files_beside_them() {
    let hall = Hall::start().await;
    hall.until("press", |state| signal(state, "world-0")["quality"] == "fresh").await;
    let beside = |files: &[String]| files.iter().any(|name| name.ends_with("-wal") || name.ends_with("-shm"));
    assert!(beside(&files(hall.data.path())), "the gateway writes logs");
    hall.gateway.shutdown().await.unwrap();
    let left = files(hall.data.path());
    assert!(left.contains(&"control.db".to_owned()) && !beside(&left), "{left:?}");
}
