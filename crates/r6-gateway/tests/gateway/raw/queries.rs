//! Queries: what a script sees is what the robot would tell it.

use std::time::{Duration, Instant};

use r6_controller::{Profile, RobotModel};
use r6_gateway::RawAllow;
use r6_sim::VirtualController;
use tokio::io::AsyncWriteExt;

use super::{Raw, Script, policy, query};
use crate::support::PATIENCE;

const READ: &[(&str, RawAllow)] = &[("127.0.0.0/8", RawAllow::Read)];

/// Requests as old scripts send them: both spellings of the type, with and without `packID`, numbers without
/// quotes, blanks, addresses that the robot lacks or nobody knows, counters, texts, lists.
const REQUESTS: &[&str] = &[
    r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"0","queryAddr":["version","curMold"]}"#,
    r#"{"dsID": "HCRemoteMonitor", "reqType": "query", "packID": 17, "queryAddr": ["axis-0", "axis-1", "world-0"]}"#,
    r#"{"dsID":"HCRemoteMonitor","cmdType":"query","queryAddr":["curMode","curAlarm","isMoving","origin"]}"#,
    r#"{"reqType":"query","queryAddr":["counterList","counter-0","counter-8","Addr-800","nobody","axisNum"]}"#,
    r#"{"reqType":"query","packID":"a\u0062\"c","queryAddr":["machineName","moldList","toolCoord","boardIONum"]}"#,
    r#"{"reqType":"query","packID":"1","queryAddr":["nobody"]}"#,
    r#"{"reqType":"query","packID":"1","queryAddr":[]}"#,
    r#"{"reqType":"query","packID":"1","queryAddr":["axis-0","axis-0","RemoteCmdLen"]}"#,
];

async fn replies_are_the_robots_own(profile: &str) {
    let builder = VirtualController::builder().profile(Profile::named(profile).unwrap());
    let raw = Raw::start(builder.start().await.unwrap(), READ).await;
    let mut script = raw.script().await;
    let mut direct = Script::at(raw.hall.robots[0].address()).await;
    for end in ["", "\n", "\r\n", "\0"] {
        for request in REQUESTS {
            let request = format!("{request}{end}");
            // Twice: from the robot, then perhaps from a reading.
            for _ in 0..2 {
                assert_eq!(script.ask(&request).await, direct.ask(&request).await, "{profile}: {request:?}");
            }
        }
    }
}

#[tokio::test]
async fn a_script_gets_the_bytes_that_the_robot_itself_would_send() {
    replies_are_the_robots_own("hc1").await;
}

#[tokio::test]
async fn a_script_gets_the_dialect_of_an_old_robot_too() {
    replies_are_the_robots_own("legacy").await;
}

#[tokio::test]
async fn many_scripts_share_the_one_connection() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), READ).await;
    let address = raw.address();
    let poll = |number: u8| async move {
        let mut script = Script::from(number, address).await;
        for _ in 0..50 {
            let read = script.query("curMode isMoving axis-0 axis-1 axis-2 Addr-800").await;
            assert_eq!(read, ["7", "0", "0.000000", "0.000000", "0.000000", "0"]);
        }
    };
    futures_util::future::join_all((1..=16).map(poll)).await;
    assert_eq!(raw.tap.connections(), 1);
}

#[tokio::test]
async fn a_fresh_reading_saves_the_robot_a_query() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), READ).await;
    let (mut one, mut other) = (raw.script().await, Script::from(2, raw.address()).await);
    let begun = Instant::now();
    // A register is not among the values that the gateway polls. On a busy machine the second query may come
    // later than the reading is fresh.
    loop {
        let before = raw.tap.frames("Addr-801").len();
        one.query("Addr-801").await;
        let after_one = raw.tap.frames("Addr-801").len();
        other.query("Addr-801").await;
        if after_one == before + 1 && raw.tap.frames("Addr-801").len() == after_one {
            return;
        }
        assert!(begun.elapsed() < PATIENCE);
    }
}

#[tokio::test]
async fn a_client_may_close_its_half_and_still_gets_its_replies() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), READ).await;
    for _ in 0..20 {
        let mut script = raw.script().await;
        script.send(&query(&["curMode"])).await;
        script.stream.shutdown().await.unwrap();
        assert!(script.reply().await.unwrap().contains(r#""queryData":["7"]"#));
        assert_eq!(script.reply().await, None);
    }
}

#[tokio::test]
async fn a_lost_robot_closes_its_clients_and_lets_none_in_until_it_is_back() {
    let mut raw = Raw::start(VirtualController::start().await.unwrap(), READ).await;
    let mut script = raw.script().await;
    assert_eq!(script.query("curMode").await, ["7"]);
    raw.hall.robots.pop().unwrap().shutdown().await.unwrap();
    assert_eq!(script.reply().await, None);
    let mut late = raw.script().await;
    assert_eq!(late.reply().await, None);
    let metrics = raw.hall.get(&raw.hall.viewer, "/metrics").await;
    let metrics = metrics.as_str().unwrap();
    let count = "r6_gateway_raw_closed_total{robot=\"press\",cause=\"robot_down\"} 2";
    assert!(metrics.contains(count), "{metrics}");
}

#[tokio::test]
async fn values_of_another_robot_are_no_answer_until_it_is_accepted() {
    let Raw { hall, .. } = Raw::start(VirtualController::start().await.unwrap(), READ).await;
    // The identity is on the disk before a lease is given out.
    hall.lease(&hall.operator, "press").await;
    let model = RobotModel::named("BRTIRUS1510A").unwrap().clone();
    let other = VirtualController::builder().model(model).start().await.unwrap();
    let hall = hall.again_with_raw(other.address(), policy(READ)).await;
    let state = hall.until("press", |state| !state["identity_changed"].is_null()).await;
    let mut script = Script::at(hall.raw()).await;
    script.send(&query(&["curMode"])).await;
    let reply = tokio::time::timeout(Duration::from_millis(500), script.reply()).await;
    assert!(reply.is_err(), "{reply:?}");

    let found = &state["identity_changed"]["found"];
    assert_eq!(hall.post(&hall.engineer, "/v1/robots/press/accept-identity", found).await.0, 204);
    assert_eq!(Script::at(hall.raw()).await.query("curMode").await, ["7"]);
}
