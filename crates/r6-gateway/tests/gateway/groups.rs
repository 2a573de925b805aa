//! Poll groups: values with a period of their own, and whether and how they are kept.

use std::collections::BTreeMap;
use std::time::Duration;

use r6_api::gateway::SignalQuality;
use r6_client::Address;
use r6_gateway::{PollGroup, RobotConfig};
use r6_sim::VirtualController;
use serde_json::{Value, json};

use crate::raw::Tap;
use crate::support::{Hall, name, signal};

const AXES: [&str; 6] = ["axis-0", "axis-1", "axis-2", "axis-3", "axis-4", "axis-5"];

/// What was asked for, query by query.
fn asked(tap: &Tap) -> Vec<Vec<String>> {
    let query = |frame: String| {
        let frame: Value = serde_json::from_str(&frame).unwrap();
        let list = frame["queryAddr"].as_array().unwrap().iter();
        list.map(|address| address.as_str().unwrap().to_owned()).collect()
    };
    tap.frames("queryAddr").into_iter().map(query).collect()
}

fn read(addresses: &[&str]) -> Vec<Address> {
    addresses.iter().map(|address| Address::parse(address).unwrap()).collect()
}

#[tokio::test]
async fn each_group_is_read_with_its_own_period_in_as_few_queries() {
    let controller = VirtualController::start().await.unwrap();
    let tap = Tap::before(controller.address()).await;
    let (fast, slow) = (Duration::from_millis(50), Duration::from_secs(2));
    let config = RobotConfig {
        period: Duration::from_millis(500),
        groups: vec![
            PollGroup::new(fast, read(&AXES)),
            PollGroup::new(slow, read(&["counter-0", "Addr-800"])),
        ],
        ..RobotConfig::new(name("press"), tap.address.to_string())
    };
    let hall = Hall::at(tempfile::tempdir().unwrap(), vec![config], vec![controller]).await;
    hall.until_up("press").await;
    hall.until("press", |state| signal(state, "counter-0")["quality"] == "fresh").await;
    let before = asked(&tap).len();
    let begun = std::time::Instant::now();
    tokio::time::sleep(Duration::from_secs(4)).await;
    let (asked, took) = (asked(&tap).split_off(before), begun.elapsed().as_secs_f64());
    let mut counts = BTreeMap::<&str, f64>::new();
    asked.iter().flatten().for_each(|address| *counts.entry(address).or_default() += 1.0);
    // A busy machine reads less often, and no machine more often.
    for (address, every) in
        [("axis-0", 0.05), ("axis-5", 0.05), ("world-0", 0.5), ("curMode", 0.5), ("counter-0", 2.0)]
    {
        let most = took / every;
        let times = counts.get(address).copied().unwrap_or_default();
        assert!(times <= most + 2.0 && times >= (most / 3.0).max(1.0), "{address}: {times} of {most:.1}");
    }
    assert_eq!(counts.get("counter-0"), counts.get("Addr-800"));
    // What is due at the same time is asked for together.
    let has = |query: &[String], address: &str| query.iter().any(|asked| asked == address);
    for query in asked.iter().filter(|query| has(query, "world-0")) {
        assert!(has(query, "world-5") && has(query, "curAlarm"), "{query:?}");
    }
    assert!(asked.iter().any(|query| has(query, "world-0") && has(query, "axis-0")), "{asked:?}");
    assert!(asked.iter().any(|query| *query == AXES), "the fast group is asked for alone: {asked:?}");
    // Each value is as fresh as its own period says.
    let state = hall.get(&hall.viewer, "/v1/robots/press").await;
    for address in ["axis-0", "world-0", "counter-0", "Addr-800"] {
        assert_eq!(signal(&state, address)["quality"], json!(SignalQuality::Fresh), "{address}");
    }
    let groups = json!([
        { "period_ms": 50, "read": AXES },
        { "period_ms": 2000, "read": ["counter-0", "Addr-800"] },
    ]);
    assert_eq!((&state["period_ms"], &state["groups"]), (&json!(500), &groups));
    // A command finds the mode, which is in no fast group.
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await.0, 200);
}

#[tokio::test]
async fn a_group_says_whether_and_from_which_difference_on_its_values_are_kept() {
    let controller = VirtualController::start().await.unwrap();
    let often = Duration::from_millis(20);
    let config = RobotConfig {
        period: often,
        groups: vec![
            PollGroup { is_kept: false, ..PollGroup::new(often, read(&["Addr-800"])) },
            PollGroup { deadband: Some(10.0), ..PollGroup::new(often, read(&["Addr-801"])) },
        ],
        addresses: read(&["Addr-802"]),
        ..RobotConfig::new(name("press"), controller.address().to_string())
    };
    let hall = Hall::at(tempfile::tempdir().unwrap(), vec![config], vec![controller]).await;
    hall.until_up("press").await;
    let lease = hall.lease(&hall.operator, "press").await;
    for value in [5, 12, 40] {
        for register in ["800", "801", "802"] {
            let command = format!("rewriteData {register} {value} 0");
            let (status, told) = hall.command(&hall.operator, "press", &lease, &command).await;
            assert_eq!(status, 200, "{told}");
        }
        let read = |state: &Value| signal(state, "Addr-802")["value"] == value;
        hall.until("press", read).await;
        hall.until("press", |state| signal(state, "Addr-800")["value"] == value).await;
    }
    let values = |history: &Value| -> Vec<i64> {
        let samples = history["samples"].as_array().unwrap().iter();
        samples.filter_map(|sample| sample["value"].as_i64()).collect()
    };
    let all = hall.until_history("signal=Addr-802", |history| values(history).ends_with(&[40])).await;
    assert!(values(&all).ends_with(&[5, 12, 40]), "{all}");
    let some = hall.until_history("signal=Addr-801", |history| values(history).ends_with(&[40])).await;
    // 5 is within 10 of 0, and 12 is not.
    assert!(values(&some).ends_with(&[12, 40]) && !values(&some).contains(&5), "{some}");
    assert!(values(&hall.get(&hall.viewer, "/v1/robots/press/history?signal=Addr-800").await).is_empty());
}

#[tokio::test]
async fn groups_come_over_the_api_and_are_there_after_a_start() {
    let saw = VirtualController::start().await.unwrap();
    let address = saw.address().to_string();
    let hall = Hall::start().await;
    let put =
        async |hall: &Hall, body: Value| hall.call(&hall.admin, "PUT", "/v1/robots/saw", Some(&body)).await;
    let groups = json!([{ "period_ms": 20, "read": ["Addr-805"], "keep": false, "deadband": 0.5 }]);
    let wanted = json!({ "address": address, "period_ms": 200, "groups": groups });
    assert_eq!(put(&hall, wanted).await.0, 201);
    let is_read = |state: &Value| signal(state, "Addr-805")["quality"] == "fresh";
    assert_eq!(hall.until("saw", is_read).await["groups"], groups);
    let audit = hall.get(&hall.admin, "/v1/audit").await.to_string();
    assert!(audit.contains("robot_configured") && audit.contains("\"deadband\":0.5"), "{audit}");
    let group = |read: &[&str]| json!([{ "period_ms": 20, "read": read, "keep": false }]);
    for (wrong, why) in [
        (json!([{ "period_ms": 19, "read": ["Addr-800"] }]), "group 1: its period is from 20ms to 3600s"),
        (group(&[]), "group 1: it reads 1 to 256 addresses"),
        (group(&["counter-x"]), "counter-x"),
        (
            json!([{ "period_ms": 20, "read": ["Addr-800"] }, { "period_ms": 50, "read": ["Addr-800"] }]),
            "group 2: `Addr-800` is read twice: give each address once, in `read` or in one group",
        ),
        (
            json!([{ "period_ms": 20, "read": ["Addr-800"], "deadband": -1 }]),
            "its deadband is a number from 0",
        ),
        (json!(vec![json!({ "period_ms": 20, "read": ["Addr-800"] }); 33]), "at most 32 groups"),
        (group(&["isMoving"]), "group 1: `isMoving` is read with the period of the robot"),
        (group(&["axis-0", "axis-1", "axis-6"]), "group 1: it has 2 of `axis-0` to `axis-5`"),
        (group(&["world-3"]), "it has 1 of `world-0` to `world-5`"),
        (group(&["counter-0"]), "`counter-0` counts parts: it cannot be in a group that is not kept"),
    ] {
        let (status, problem) = put(&hall, json!({ "address": address, "groups": wrong })).await;
        let message = problem["message"].as_str().unwrap();
        assert!(status == 422 && message.contains(why), "{status} {problem}");
    }
    let press = RobotConfig::new(name("press"), hall.robots[0].address().to_string());
    let hall = hall.again(vec![press], vec![saw]).await;
    assert_eq!(hall.until("saw", is_read).await["groups"], groups);
}
