//! Alarms that are listed, acknowledged and shelved.

use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use r6_controller::{PanelAction, RobotModel};
use r6_gateway::RobotConfig;
use r6_sim::VirtualController;
use serde_json::{Value, json};

use crate::support::{Hall, PATIENCE, Stream, is_of_values, name};

const ALARMS: &str = "/v1/robots/press/alarms";

impl Hall {
    /// Waits until the alarms of `press` are as `is` says.
    async fn until_alarms(&self, is: impl Fn(&[Value]) -> bool) -> Vec<Value> {
        let begun = Instant::now();
        loop {
            let told = self.get(&self.viewer, ALARMS).await;
            let alarms = told["alarms"].as_array().unwrap();
            if is(alarms) {
                return alarms.clone();
            }
            assert!(begun.elapsed() < PATIENCE, "{told:#}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }

    /// Presses the emergency stop of `press`: its alarm.
    async fn emergency(&self) -> Value {
        self.robots[0].handle().operate(&PanelAction::EmergencyStop).unwrap();
        self.until_alarms(|alarms| alarms.first().is_some_and(|alarm| alarm["state"] == "active"))
            .await
            .remove(0)
    }

    /// Ends the alarm of the emergency stop.
    async fn clear(&self) {
        self.robots[0].handle().operate(&PanelAction::ReleaseEmergencyStop).unwrap();
        let lease = self.lease(&self.operator, "press").await;
        assert_eq!(self.command(&self.operator, "press", &lease, "clearAlarm").await.0, 200);
        self.until_alarms(|alarms| alarms.iter().all(|alarm| alarm["state"] == "ended")).await;
        let key = json!({ "lease": lease });
        assert_eq!(self.call(&self.operator, "DELETE", "/v1/robots/press/lease", Some(&key)).await.0, 204);
    }

    async fn acknowledge(&self, token: &str, alarm: &Value, body: &Value) -> (u16, Value) {
        self.post(token, &format!("{ALARMS}/{}/acknowledge", alarm["id"]), body).await
    }

    async fn shelve(&self, alarm: &Value, body: &Value) -> (u16, Value) {
        self.post(&self.engineer, &format!("{ALARMS}/{}/shelve", alarm["id"]), body).await
    }
}

/// A hall whose alarm was read as 0 once.
async fn quiet() -> Hall {
    let hall = Hall::start().await;
    hall.until("press", |state| crate::support::signal(state, "curAlarm")["value"] == 0).await;
    hall
}

#[tokio::test]
async fn an_alarm_is_acknowledged_once_and_is_another_one_when_it_comes_again() {
    let hall = quiet().await;
    assert_eq!(hall.get(&hall.viewer, ALARMS).await, json!({ "alarms": [], "left_out": 0, "not_known": [] }));
    let mut live = Stream::open(hall.gateway.address(), &hall.viewer, "/v1/events", "").await;
    let first = hall.emergency().await;
    assert_eq!((&first["robot"], &first["code"]), (&json!("press"), &json!(7)));
    assert_eq!((&first["text"], &first["begin_seen"]), (&json!("emergency stop"), &json!(true)));
    assert_eq!((&first["acknowledged"], &first["until"]), (&json!(null), &json!(null)));
    let began = hall.until_events("kind=alarm_began", |events| !events.is_empty()).await;
    assert_eq!(began[0]["time"], first["since"], "the same moment");

    let comment = json!({ "comment": "guard door" });
    let (status, told) = hall.acknowledge(&hall.operator, &first, &comment).await;
    assert_eq!((status, &told["acknowledged"]["comment"]), (200, &json!("guard door")));
    assert_eq!(told["acknowledged"]["by"], "token 2 (operator)");
    let (status, again) = hall.acknowledge(&hall.engineer, &first, &json!({})).await;
    assert_eq!((status, &again["acknowledged"]), (200, &told["acknowledged"]), "the first one stays");
    assert_eq!(hall.until_alarms(|_| true).await[0]["acknowledged"], told["acknowledged"]);
    let event = loop {
        let event = live.next().await.unwrap().data;
        if event["event"] == "alarm_acknowledged" {
            break event;
        }
    };
    assert!(is_of_values("alarm_began"));
    assert_eq!((&event["alarm"], &event["comment"]), (&first["id"], &json!("guard door")));
    assert_eq!((&event["by"], &event["robot"]), (&json!("token 2 (operator)"), &json!("press")));
    let audit = hall.audit().await;
    let entries: Vec<_> = audit.iter().filter(|entry| entry["what"] == "alarm_acknowledged").collect();
    let [entry] = &entries[..] else { panic!("{entries:#?}") };
    assert_eq!((&entry["alarm"], &entry["code"]), (&first["id"], &json!(7)));
    assert_eq!((&entry["robot"], &entry["actor"]), (&json!("press"), &json!("token 2 (operator)")));
    assert!(entry["source"].as_str().unwrap().starts_with("127.0.0.1:"), "{entry}");
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["lease"], json!(null), "it took no lease");
    let read = crate::support::signal(&hall.get(&hall.viewer, "/v1/robots/press").await, "curAlarm").clone();
    assert_eq!(read["value"], 7, "nothing changed at the robot");

    hall.clear().await;
    let second = hall.emergency().await;
    assert!(second["id"].as_u64() > first["id"].as_u64());
    assert_eq!(second["acknowledged"], json!(null));
    let both = hall.until_alarms(|alarms| alarms.len() == 2).await;
    assert_eq!((&both[1]["id"], &both[1]["state"]), (&first["id"], &json!("ended")));
    assert_eq!(both[1]["acknowledged"]["by"], "token 2 (operator)");
    assert_eq!((&both[0]["end_seen"], &both[1]["end_seen"]), (&json!(false), &json!(true)));
    assert!(both[1]["until"].as_str() > both[1]["since"].as_str(), "{both:#?}");
    // An alarm that ended is acknowledged too.
    hall.clear().await;
    assert_eq!(hall.acknowledge(&hall.operator, &second, &json!({})).await.0, 200);
    let active = hall.get(&hall.viewer, &format!("{ALARMS}?active=true")).await;
    assert_eq!(active, json!({ "alarms": [], "left_out": 0, "not_known": [] }));
    let one = hall.get(&hall.viewer, &format!("{ALARMS}?limit=1")).await;
    assert_eq!((&one["alarms"][0]["id"], &one["left_out"]), (&second["id"], &json!(1)));
}

#[tokio::test]
async fn a_shelf_holds_for_the_code_until_its_time_ends() {
    let hall = quiet().await;
    let mut live = Stream::open(hall.gateway.address(), &hall.viewer, "/v1/events", "").await;
    let first = hall.emergency().await;
    let wanted = json!({ "for_ms": 60_000, "reason": "door is being mended" });
    let (status, told) = hall.shelve(&first, &wanted).await;
    assert_eq!((status, &told["shelved"]["reason"]), (200, &json!("door is being mended")));
    assert_eq!(told["shelved"]["by"], "token 3 (engineer)");
    hall.clear().await;
    let second = hall.emergency().await;
    assert_eq!((&second["shelved"], &second["acknowledged"]), (&told["shelved"], &json!(null)));
    let path = format!("{ALARMS}/{}/shelve", first["id"]);
    let (status, told) = hall.call(&hall.engineer, "DELETE", &path, None).await;
    assert_eq!((status, &told["shelved"]), (200, &json!(null)));
    assert_eq!(hall.call(&hall.engineer, "DELETE", &path, None).await.0, 200, "it is not shelved");
    let (status, _) = hall.shelve(&second, &json!({ "for_ms": 1_000, "reason": "x" })).await;
    assert_eq!(status, 200);
    let alarms = hall.until_alarms(|alarms| alarms[0]["shelved"] == json!(null)).await;
    assert_eq!(alarms[0]["id"], second["id"], "it is still there");

    let mut events = Vec::new();
    while events.len() < 3 {
        let event = live.next().await.unwrap().data;
        if event["event"].as_str().unwrap().ends_with("shelved") {
            events.push(event);
        }
    }
    let kinds: Vec<_> = events.iter().map(|event| event["event"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["alarm_shelved", "alarm_unshelved", "alarm_shelved"]);
    assert_eq!((&events[0]["code"], &events[0]["text"]), (&json!(7), &json!("emergency stop")));
    let audit = hall.audit().await;
    let told = audit.iter().filter(|entry| entry["what"].as_str().unwrap().ends_with("shelved"));
    let told: Vec<_> = told.map(|entry| entry["what"].as_str().unwrap()).collect();
    assert_eq!(told, kinds, "what changes nothing has no entry");
}

#[tokio::test]
async fn what_was_answered_survives_the_end_of_the_process() {
    let hall = quiet().await;
    let alarm = hall.emergency().await;
    assert_eq!(hall.acknowledge(&hall.operator, &alarm, &json!({ "comment": "seen" })).await.0, 200);
    assert_eq!(hall.shelve(&alarm, &json!({ "for_ms": 3_600_000, "reason": "worn" })).await.0, 200);
    // What the disk has at this moment is all that is left after `kill -9`.
    let copy = tempfile::tempdir().unwrap();
    for file in ["control.db", "control.db-wal"] {
        std::fs::copy(hall.data.path().join(file), copy.path().join(file)).unwrap();
    }
    let Hall { gateway, robots, data, viewer, operator, engineer, admin } = hall;
    gateway.shutdown().await.unwrap();
    drop(data);
    let period = Duration::from_millis(20);
    let config = RobotConfig { period, ..RobotConfig::new(name("press"), robots[0].address().to_string()) };
    let settings = crate::support::settings(copy.path(), vec![config]);
    let gateway = r6_gateway::Gateway::start(settings).await.unwrap();
    let hall = Hall { gateway, robots, data: copy, viewer, operator, engineer, admin };
    let known = hall.until_alarms(|alarms| !alarms.is_empty()).await;
    assert_eq!((known.len(), &known[0]["id"]), (1, &alarm["id"]), "it is there before the robot is");
    let again = hall.until_alarms(|alarms| alarms[0]["state"] == "active").await;
    assert_eq!((&again[0]["id"], &again[0]["since"]), (&alarm["id"], &alarm["since"]));
    assert_eq!(again[0]["acknowledged"]["comment"], "seen");
    assert_eq!(again[0]["shelved"]["reason"], "worn");
    // Another one of this code is shelved too, and not acknowledged.
    hall.clear().await;
    let next = hall.emergency().await;
    assert_eq!((&next["shelved"]["reason"], &next["acknowledged"]), (&json!("worn"), &json!(null)));
}

#[tokio::test]
async fn an_acknowledgement_does_not_pass_to_another_robot() {
    let hall = quiet().await;
    let alarm = hall.emergency().await;
    assert_eq!(hall.acknowledge(&hall.operator, &alarm, &json!({})).await.0, 200);
    let model = RobotModel::named("BRTIRUS1510A").unwrap().clone();
    let other = VirtualController::builder().model(model).start().await.unwrap();
    other.handle().operate(&PanelAction::EmergencyStop).unwrap();
    let config = RobotConfig::new(name("press"), other.address().to_string());
    let hall = hall.again(vec![config], vec![other]).await;
    let state = hall.until("press", |state| !state["identity_changed"].is_null()).await;
    let found = &state["identity_changed"]["found"];
    assert_eq!(hall.post(&hall.engineer, "/v1/robots/press/accept-identity", found).await.0, 204);
    let told = hall.until_alarms(|alarms| alarms[0]["state"] == "active").await;
    assert_ne!(told[0]["id"], alarm["id"]);
    assert_eq!(told[0]["acknowledged"], json!(null), "{told:#?}");
    assert_eq!((&told[1]["id"], &told[1]["state"]), (&alarm["id"], &json!("ended")));
}

#[tokio::test]
async fn an_alarm_of_a_robot_that_is_gone_is_unseen() {
    let mut hall = quiet().await;
    let alarm = hall.emergency().await;
    hall.robots.pop().unwrap().shutdown().await.unwrap();
    let told = hall.until_alarms(|alarms| alarms[0]["state"] == "unseen").await;
    assert_eq!((&told[0]["id"], &told[0]["until"]), (&alarm["id"], &json!(null)));
    assert_eq!(hall.get(&hall.viewer, "/v1/alarms?active=true").await["alarms"][0]["state"], "unseen");
}

#[tokio::test]
async fn every_caller_sees_and_answers_the_alarms_of_its_robots() {
    let robots = [VirtualController::start().await, VirtualController::start().await];
    let hall = Hall::with(robots.map(Result::unwrap).into()).await;
    hall.until("press", |state| crate::support::signal(state, "curAlarm")["value"] == 0).await;
    let press = hall.emergency().await;
    // The number of another robot's alarm names none of this one, which has its own numbers.
    let path = format!("/v1/robots/saw/alarms/{}/acknowledge", press["id"]);
    let (status, problem) = hall.post(&hall.operator, &path, &json!({})).await;
    assert_eq!((status, &problem["code"]), (404, &json!("no_such_alarm")));
    hall.robots[1].handle().operate(&PanelAction::EmergencyStop).unwrap();
    let both = async || {
        let begun = Instant::now();
        loop {
            let told = hall.get(&hall.viewer, "/v1/alarms").await;
            if told["alarms"].as_array().unwrap().len() == 2 {
                return told;
            }
            assert!(begun.elapsed() < PATIENCE, "{told:#}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    let told = both().await;
    let since: Vec<_> = [0, 1].map(|at| told["alarms"][at]["since"].as_str().unwrap().to_owned()).into();
    assert!(since[0] >= since[1], "the latest first: {told:#}");
    let limited = hall.get(&hall.viewer, "/v1/alarms?limit=1").await;
    assert_eq!((&limited["alarms"][0], &limited["left_out"]), (&told["alarms"][0], &json!(1)));
    let only =
        r6_gateway::make_token(hall.data.path(), Role::Engineer, Some(name("saw").into()), String::new());
    let only = only.unwrap().1;
    let seen = hall.get(&only, "/v1/alarms").await;
    assert_eq!(seen["alarms"].as_array().unwrap().len(), 1);
    assert_eq!(seen["alarms"][0]["robot"], "saw");
    assert_eq!(hall.acknowledge(&only, &press, &json!({})).await.0, 403);

    for (path, body, part) in [
        ("acknowledge", json!({ "comment": "" }), "comment is a text of 1 to 200 bytes"),
        ("acknowledge", json!({ "comment": "x".repeat(201) }), "comment is"),
        ("acknowledge", json!({ "comment": "a\nb" }), "without control characters"),
        ("acknowledge", json!({ "comment": 3 }), "expected a string"),
        ("shelve", json!({ "for_ms": 1_000 }), "reason"),
        ("shelve", json!({ "for_ms": 1_000, "reason": "  " }), "reason is a text"),
        ("shelve", json!({ "for_ms": 999, "reason": "x" }), "for_ms is from 1000 to 28800000"),
        ("shelve", json!({ "for_ms": 28_800_001, "reason": "x" }), "for_ms is"),
        (
            "shelve",
            json!({ "for_ms": -1, "reason": "x" }),
            "for_ms: invalid value: integer `-1`, expected a whole number",
        ),
    ] {
        let path = format!("{ALARMS}/{}/{path}", press["id"]);
        let (status, problem) = hall.post(&hall.engineer, &path, &body).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")), "{path} {body}: {problem}");
        assert!(problem["message"].as_str().unwrap().contains(part), "{body}: {problem}");
    }
    for query in ["limit=0", "limit=1001", "active=yes", "page=1"] {
        assert_eq!(hall.call(&hall.viewer, "GET", &format!("/v1/alarms?{query}"), None).await.0, 422);
        assert_eq!(hall.call(&hall.viewer, "GET", &format!("{ALARMS}?{query}"), None).await.0, 422);
    }
    for id in ["0", "7", "-1", "x", "99999999999999999999"] {
        let path = format!("{ALARMS}/{id}/acknowledge");
        let (status, problem) = hall.post(&hall.operator, &path, &json!({})).await;
        assert_eq!((status, &problem["code"]), (404, &json!("no_such_alarm")), "{id}");
    }
}
