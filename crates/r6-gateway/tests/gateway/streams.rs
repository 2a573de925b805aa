//! Streams: a snapshot, then what changes; events with their numbers.

use r6_api::gateway::Role;
use serde_json::json;

use crate::support::{Hall, Stream, is_of_values, name, ready_to_start};

#[tokio::test]
async fn live_begins_with_a_snapshot_and_numbers_grow() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let mut live = Stream::open(hall.gateway.address(), &hall.viewer, "/v1/live", "").await;
    let snapshot = live.next().await.unwrap();
    assert_eq!((snapshot.kind.as_str(), &snapshot.data["name"]), ("snapshot", &json!("press")));
    let mut number = snapshot.data["number"].as_u64().unwrap();
    let lease = hall.lease(&hall.operator, "press").await;
    let (status, _) = hall.command(&hall.operator, "press", &lease, "startButton").await;
    assert_eq!(status, 200);
    // An axis is followed while it moves.
    let (mut places, mut moving) = (Vec::new(), false);
    while places.len() < 5 || !moving {
        let change = live.next().await.unwrap();
        assert_eq!((change.kind.as_str(), &change.data["robot"]), ("change", &json!("press")));
        let next = change.data["number"].as_u64().unwrap();
        assert!(next > number, "{next} after {number}");
        number = next;
        for signal in change.data["signals"].as_array().unwrap() {
            if signal["address"] == "axis-0" {
                places.push(signal["value"].as_f64().unwrap());
            }
            moving |= signal["address"] == "isMoving" && signal["value"] == true;
        }
    }
    assert!(places.windows(2).all(|pair| pair[0] != pair[1]), "only changes are told: {places:?}");
}

#[tokio::test]
async fn chosen_values_are_followed_alone() {
    let hall = Hall::with(vec![ready_to_start().await]).await;
    let mut live =
        Stream::open(hall.gateway.address(), &hall.viewer, "/v1/live?robot=press&signal=axis-0,axis-1", "")
            .await;
    let snapshot = live.next().await.unwrap();
    let addresses = |data: &serde_json::Value| -> Vec<String> {
        let signals = data["signals"].as_array().unwrap().iter();
        signals.map(|signal| signal["address"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(addresses(&snapshot.data), ["axis-0", "axis-1"]);
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "startButton").await.0, 200);
    // `isMoving`, the pose and others change too.
    for _ in 0..5 {
        let change = live.next().await.unwrap();
        let seen = addresses(&change.data);
        assert!(!seen.is_empty() && seen.iter().all(|seen| seen.starts_with("axis-")), "{seen:?}");
    }
    for (wrong, part) in [("axis-99", "axis-99"), ("axiz-0", "axis-"), ("Addr-800", "not read"), ("", "")] {
        let path = format!("/v1/live?signal={wrong}");
        let (status, problem) = hall.call(&hall.viewer, "GET", &path, None).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")), "{path}");
        assert!(problem["message"].as_str().unwrap().contains(part), "{problem}");
    }
}

#[tokio::test]
async fn events_are_told_in_order_and_resumed() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    let mut events = Stream::open(address, &hall.viewer, "/v1/events", "").await;
    let lease = hall.lease(&hall.operator, "press").await;
    hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await;
    hall.stop(&hall.operator, "press").await;
    let mut seen: Vec<crate::support::Message> = Vec::new();
    while seen.last().is_none_or(|last| last.data["event"] != "stop_ended") {
        seen.push(events.next().await.unwrap());
    }
    let mut kinds: Vec<_> = seen.iter().map(|event| event.data["event"].as_str().unwrap()).collect();
    // The stop changes the mode, and that may be read before it is over.
    kinds.retain(|kind| !is_of_values(kind));
    let told = ["lease_began", "command_began", "global_speed", "command_ended", "stop_began", "stop_ended"];
    assert_eq!(kinds, told);
    let ids: Vec<_> = seen.iter().map(|event| event.data["id"].as_u64().unwrap()).collect();
    assert!(ids.windows(2).all(|pair| pair[1] == pair[0] + 1), "{ids:?}");

    let mut again = Stream::open(address, &hall.viewer, "/v1/events", &seen[2].id).await;
    assert_eq!(again.next().await.unwrap().data, seen[3].data);
    // An id of another start of the gateway: what is lost is said, then all that is kept is told.
    let mut lost = Stream::open(address, &hall.viewer, "/v1/events", "1-7").await;
    assert_eq!(lost.next().await.unwrap().kind, "reset");
    assert_eq!(lost.next().await.unwrap().data["id"], 1);
}

#[tokio::test]
async fn a_stream_ends_when_its_token_is_revoked() {
    let hall = Hall::start().await;
    let only = Some(name("press").into());
    let made = r6_gateway::make_token(hall.data.path(), Role::Viewer, only, String::new()).unwrap();
    let address = hall.gateway.address();
    let mut live = Stream::open(address, &made.1, "/v1/live?robot=press", "").await;
    let mut events = Stream::open(address, &made.1, "/v1/events", "").await;
    assert_eq!(live.next().await.unwrap().kind, "snapshot");
    assert_eq!(r6_gateway::revoke_token(hall.data.path(), made.0), Ok(true));
    while live.next().await.is_some() {}
    while events.next().await.is_some() {}
}
