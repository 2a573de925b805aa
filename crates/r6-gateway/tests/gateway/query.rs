//! Values that are asked for once.

use std::time::Duration;

use r6_controller::Profile;
use r6_sim::VirtualController;
use serde_json::{Value, json};

use crate::support::{Hall, PATIENCE, call};

const QUERY: &str = "/v1/robots/press/query?address=";

fn value<'v>(answer: &'v Value, address: &str) -> &'v Value {
    let signals = answer["signals"].as_array().unwrap();
    signals
        .iter()
        .find(|signal| signal["address"] == address)
        .unwrap_or_else(|| panic!("{address}: {answer}"))
}

#[tokio::test]
async fn any_address_can_be_read_with_its_unit_and_quality() {
    let hall = Hall::start().await;
    let lease = hall.lease(&hall.operator, "press").await;
    let written = hall.command(&hall.operator, "press", &lease, "rewriteData 801 42 0").await;
    assert_eq!(written.0, 200, "{}", written.1);
    let answer = hall.get(&hall.viewer, &format!("{QUERY}Addr-801,axis-0,world-0,Addr-801,version")).await;
    let read: Vec<_> =
        answer["signals"].as_array().unwrap().iter().map(|signal| signal["address"].clone()).collect();
    assert_eq!(read, [json!("Addr-801"), json!("axis-0"), json!("world-0"), json!("version")]);
    assert_eq!((&value(&answer, "Addr-801")["value"], &answer["problems"]), (&json!(42), &json!([])));
    let pose = value(&answer, "world-0");
    assert_eq!((&pose["unit"], &pose["quality"]), (&json!("mm"), &json!("fresh")));
    assert!(pose["age_ms"].as_u64().unwrap() < 5_000);
}

#[tokio::test]
async fn an_address_that_is_wrong_or_missing_is_named() {
    let mut profile = Profile::hc1();
    profile.unsupported_addresses.push("lastCycle".to_owned());
    let robot = VirtualController::builder().profile(profile).start().await.unwrap();
    let hall = Hall::with(vec![robot]).await;
    let answer = hall.get(&hall.viewer, &format!("{QUERY}curMode,lastCycle")).await;
    assert_eq!(value(&answer, "curMode")["quality"], "fresh");
    let missing = value(&answer, "lastCycle");
    assert_eq!((&missing["value"], &missing["quality"]), (&json!(null), &json!("none")));
    assert_eq!(answer["problems"][0]["address"], "lastCycle");
    assert!(answer["problems"][0]["reason"].as_str().unwrap().contains("no such value"));
    let many = vec!["curMode"; 129].join(",");
    for (addresses, part) in [("axis-0,axis-99", "`axis-99`"), ("", "``"), (many.as_str(), "128")] {
        let (status, problem) = hall.call(&hall.viewer, "GET", &format!("{QUERY}{addresses}"), None).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")), "{addresses}");
        assert!(problem["message"].as_str().unwrap().contains(part), "{problem}");
    }
    let most = (800..=900).map(|number| format!("Addr-{number}")).collect::<Vec<_>>().join(",");
    let answer = hall.get(&hall.viewer, &format!("{QUERY}{most}")).await;
    assert_eq!(answer["signals"].as_array().unwrap().len(), 101);
    let (status, _) = hall.call(&hall.viewer, "GET", "/v1/robots/press/query", None).await;
    assert_eq!(status, 422);
}

#[tokio::test]
async fn a_robot_that_is_gone_is_not_asked() {
    let hall = Hall::start().await;
    let Hall { robots, gateway, viewer, data: _data, .. } = hall;
    drop(robots);
    let begun = std::time::Instant::now();
    loop {
        let path = format!("{QUERY}Addr-800");
        let (status, answer) = call(gateway.address(), &viewer, "GET", &path, None).await;
        if status == 409 {
            assert_eq!(answer["code"], "not_ready");
            break;
        }
        // Until the gateway has noticed, the query itself has no answer.
        assert!(status == 200 || answer["code"] == "no_reply", "{answer}");
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}
