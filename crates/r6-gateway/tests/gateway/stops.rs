//! Stops: without a lease, at once, and they hold.

use std::time::Duration;

use futures_util::StreamExt as _;
use futures_util::stream::FuturesUnordered;
use r6_api::gateway::Role;
use r6_gateway::{Gateway, RobotConfig};
use serde_json::{Value, json};

use crate::support::{Hall, call, commands, name, ready_to_start, settings, signal};

#[tokio::test]
async fn no_gateway_begins_anew_in_a_folder_whose_store_is_missing() {
    for left in ["history", "restored"] {
        let data = tempfile::tempdir().unwrap();
        std::fs::create_dir(data.path().join(left)).unwrap();
        let refused = Gateway::start(settings(data.path(), Vec::new())).await.unwrap_err().to_string();
        assert!(refused.contains(&format!("`{left}` and no `control.db`")), "{refused}");
        // Nor does the command line make a store there.
        let refused = r6_gateway::make_token(data.path(), Role::Admin, None, String::new()).unwrap_err();
        assert!(refused.to_string().contains("no `control.db`"), "{refused}");
        assert_eq!(std::fs::read_dir(data.path()).unwrap().count(), 1, "nothing was made");
    }
}

#[tokio::test]
async fn a_stop_without_lease_stops_a_moving_arm_and_holds_until_it_is_cleared() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let lease = hall.lease(&hall.operator, "press").await;
    let (status, done) = hall.command(&hall.operator, "press", &lease, "startButton").await;
    assert_eq!(status, 200, "{done}");
    hall.until("press", |state| signal(state, "isMoving")["value"] == true).await;

    // Somebody else stops it.
    let (status, stopped) = hall.stop(&hall.engineer, "press").await;
    assert_eq!((status, &stopped["confirmed"]), (200, &json!(true)), "{stopped}");
    assert!(!hall.robots[0].handle().snapshot().moving);

    // The loop of the holder goes on, and nothing moves.
    let mut log = hall.robots[0].handle().log();
    for _ in 0..3 {
        let (status, problem) = hall.command(&hall.operator, "press", &lease, "startButton").await;
        assert_eq!((status, &problem["code"]), (409, &json!("stopped")));
    }
    assert!(commands(&mut log).is_empty());
    let (status, _) = hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await;
    assert_eq!(status, 200, "what cannot move the arm is sent");

    let clear = "/v1/robots/press/clear-stopped";
    let wrong = json!({ "lease": { "number": lease["number"], "secret": "0".repeat(32) } });
    let (status, problem) = hall.post(&hall.operator, clear, &wrong).await;
    assert_eq!((status, &problem["code"]), (409, &json!("no_lease")));
    let (status, _) = hall.post(&hall.operator, clear, &json!({ "lease": lease })).await;
    assert_eq!(status, 204);
    let (status, done) = hall.command(&hall.operator, "press", &lease, "startButton").await;
    assert_eq!(status, 200, "{done}");
    let stop = hall.until_audited(|entry| entry["what"] == "stop").await;
    assert_eq!((&stop["confirmed"], &stop["actor"]), (&json!(true), &json!("token 3 (engineer)")));
    hall.until_audited(|entry| entry["what"] == "stop_cleared").await;
}

#[tokio::test]
async fn a_command_that_stops_needs_no_lease_and_holds_too() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let (status, _) = hall.command(&hall.viewer, "press", &json!(null), "actionPause").await;
    assert_eq!(status, 403);
    let (status, done) = hall.command(&hall.operator, "press", &json!(null), "actionPause").await;
    assert_eq!((status, &done["command_id"]), (200, &json!(null)), "{done}");
    let lease = hall.lease(&hall.operator, "press").await;
    let (status, problem) = hall.command(&hall.operator, "press", &lease, "startButton").await;
    assert_eq!((status, &problem["code"]), (409, &json!("stopped")));
}

#[tokio::test]
async fn many_stops_at_once_all_end_and_hold() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let lease = hall.lease(&hall.operator, "press").await;
    hall.command(&hall.operator, "press", &lease, "startButton").await;
    let stops = (0..12).map(|_| hall.stop(&hall.operator, "press"));
    let stops = futures_util::future::join_all(stops).await;
    assert!(stops.iter().all(|(status, _)| *status == 200), "{stops:?}");
    let state = hall.get(&hall.viewer, "/v1/robots/press").await;
    assert_eq!((&state["stopped"], &state["stops_under_way"]), (&json!(true), &json!(0)));
}

#[tokio::test]
async fn a_robot_that_cannot_be_reached_is_not_said_to_stand() {
    let mut hall = Hall::start().await;
    hall.robots.pop().unwrap().shutdown().await.unwrap();
    let (status, problem) = hall.stop(&hall.operator, "press").await;
    assert_eq!((status, &problem["code"]), (504, &json!("not_stopped")));
    assert!(problem["message"].as_str().unwrap().contains("emergency stop"), "{problem}");
    let state = hall.get(&hall.viewer, "/v1/robots/press").await;
    assert_eq!((&state["stopped"], &state["link"]), (&json!(true), &json!("down")));
}

#[tokio::test]
async fn a_stop_beyond_the_limit_is_answered_at_once_and_not_confirmed() {
    // No program listens there: each stop waits for a connection for seconds.
    let config = RobotConfig::new(name("press"), "127.0.0.1:1");
    let hall = Hall::at(tempfile::tempdir().unwrap(), vec![config], Vec::new()).await;
    let begun = std::time::Instant::now();
    let stops: FuturesUnordered<_> = (0..17).map(|_| hall.stop(&hall.operator, "press")).collect();
    let stops: Vec<_> = stops.map(|answer| (answer, begun.elapsed())).collect().await;
    for ((status, problem), _) in &stops {
        assert_eq!((*status, &problem["code"]), (504, &json!("not_stopped")));
        assert!(problem["message"].as_str().unwrap().contains("emergency stop"), "{problem}");
    }
    let (first, after) = &stops[0];
    assert!(first.1["message"].as_str().unwrap().starts_with("16 stops"), "{first:?}");
    assert!(*after < std::time::Duration::from_secs(3), "{after:?}");
    // Pauses have places of their own, so they cannot keep a stop from being sent.
    let (status, _) = hall.command(&hall.operator, "press", &json!(null), "actionPause").await;
    assert_eq!(status, 409);
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["stops_under_way"], 0);
    let audit = hall.audit().await;
    let count = |what: &str| audit.iter().filter(|entry| entry["what"] == what).count();
    // Of one caller's stops one a minute is written.
    assert!(count("stop_began") >= 2 && count("stop") >= 2, "{audit:#?}");
}

#[tokio::test]
async fn after_a_restore_every_robot_is_stopped_also_one_that_never_answered() {
    let hall = Hall::start().await;
    let (folder, backup) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (data, backup) = (folder.path().join("data"), backup.path().join("backup"));
    r6_gateway::backup(hall.data.path(), &backup, false, |_| ()).unwrap();
    r6_gateway::restore(&data, &backup, |_| ()).unwrap();
    // Only the configuration has it, and the backup has no seat of it.
    let silent = RobotConfig::new(name("silent"), "127.0.0.1:9".to_owned());
    let press = RobotConfig::new(name("press"), hall.robots[0].address().to_string());
    let gateway = Gateway::start(settings(&data, vec![silent, press])).await.unwrap();
    for robot in ["silent", "press"] {
        let path = format!("/v1/robots/{robot}");
        let (status, state) = call(gateway.address(), &hall.viewer, "GET", &path, None).await;
        assert_eq!((status, &state["stopped"]), (200, &json!(true)), "{robot}: {state}");
    }
}

#[tokio::test]
async fn stops_in_a_loop_are_all_made_and_written_once_a_minute() {
    let hall = Hall::start().await;
    let mut log = hall.robots[0].handle().log();
    for _ in 0..10 {
        assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    }
    assert_eq!(commands(&mut log).iter().filter(|command| command.starts_with("actionStop")).count(), 10);
    assert_eq!(hall.stop(&hall.engineer, "press").await.0, 200);
    let audit = hall.audit().await;
    let actors: Vec<_> =
        audit.iter().filter(|entry| entry["what"] == "stop").map(|entry| &entry["actor"]).collect();
    assert_eq!(actors, [&json!("token 2 (operator)"), &json!("token 3 (engineer)")], "each caller once");
}

#[tokio::test]
async fn a_stop_that_is_not_confirmed_is_written_also_right_after_one_that_was() {
    let mut hall = Hall::start().await;
    assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    hall.robots.pop().unwrap().shutdown().await.unwrap();
    for _ in 0..2 {
        assert_eq!(hall.stop(&hall.operator, "press").await.0, 504);
    }
    let (status, _) = hall.command(&hall.operator, "press", &json!(null), "actionPause").await;
    assert_ne!(status, 200);
    let audit = hall.audit().await;
    let stops: Vec<_> = audit
        .iter()
        .filter(|entry| entry["what"] == "stop")
        .map(|entry| (entry["request"].as_str().unwrap(), entry["confirmed"] == true))
        .collect();
    assert_eq!(stops, [("stop", true), ("stop", false), ("actionPause", false)], "once a minute: {audit:#?}");
}

/// Holds up the store of the hall while `act` runs: another process does so, or a slow disk.
pub async fn with_slow_store<T>(hall: &Hall, act: impl Future<Output = T>) -> T {
    let store = rusqlite::Connection::open(hall.data.path().join("control.db")).unwrap();
    store.execute_batch("BEGIN IMMEDIATE").unwrap();
    let done = act.await;
    store.execute_batch("COMMIT").unwrap();
    done
}

#[tokio::test]
async fn a_start_that_waited_for_the_disk_is_not_sent_after_a_stop_although_that_was_cleared() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let lease = hall.lease(&hall.operator, "press").await;
    let mut log = hall.robots[0].handle().log();
    let others = with_slow_store(&hall, async {
        // Its intent waits for the disk.
        tokio::time::sleep(Duration::from_millis(300)).await;
        assert_eq!(hall.stop(&hall.engineer, "press").await.0, 200);
        let clear = "/v1/robots/press/clear-stopped";
        assert_eq!(hall.post(&hall.operator, clear, &json!({ "lease": lease })).await.0, 204);
    });
    let ((status, problem), ()) =
        tokio::join!(hall.command(&hall.operator, "press", &lease, "startButton"), others);
    assert_eq!((status, &problem["code"]), (409, &json!("not_ready")), "{problem}");
    assert!(!commands(&mut log).iter().any(|command| command.contains("startButton")));
    assert!(!hall.robots[0].handle().snapshot().moving);
}

#[tokio::test]
async fn all_see_who_stopped_the_robot_until_it_is_cleared() {
    let hall = Hall::start().await;
    let by = |state: &Value| state["stopped_by"]["by"].clone();
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["stopped_by"], json!(null));
    assert_eq!(hall.stop(&hall.engineer, "press").await.0, 200);
    let state = hall.get(&hall.viewer, "/v1/robots/press").await;
    assert_eq!(by(&state), "token 3 (engineer)");
    let at = state["stopped_by"]["at"].clone();
    let began = hall.until_audited(|entry| entry["what"] == "stop_began").await;
    assert_eq!(at.as_str().unwrap()[..19], began["time"].as_str().unwrap()[..19]);
    // The stop holds since the first one.
    assert_eq!(hall.stop(&hall.admin, "press").await.0, 200);
    assert_eq!(hall.get(&hall.viewer, "/v1/robots").await["robots"][0]["stopped_by"]["at"], at);
    // It is known after a restart, too.
    let config = RobotConfig::new(name("press"), hall.robots[0].address().to_string());
    let mut hall = hall;
    let robots = std::mem::take(&mut hall.robots);
    let hall = hall.again(vec![config], robots).await;
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["stopped_by"]["at"], at);
    hall.until_up("press").await;
    let lease = json!({ "lease": hall.lease(&hall.operator, "press").await });
    assert_eq!(hall.post(&hall.operator, "/v1/robots/press/clear-stopped", &lease).await.0, 204);
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["stopped_by"], json!(null));
}
