//! Cameras over the raw port: under the grant of a rule, without the lease.

use std::time::{Duration, Instant};

use r6_controller::{Button, Event, PanelAction};
use r6_gateway::{Camera, RawAllow, RawPolicy, RawRule, RawSource};
use r6_sim::VirtualController;
use serde_json::{Value, json};

use super::{Raw, Script, verdict};
use crate::cameras::asks_for_photos;
use crate::stops::with_slow_store;
use crate::support::{PATIENCE, Stream};

const PHOTO: &str = r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":0}"#;

/// 127.0.0.1 is camera 0 and reads, 127.0.0.2 is camera 1, 127.0.0.3 commands and is no camera.
fn policy() -> RawPolicy {
    let rule = |source: &str, allow, cameras: &[i64]| RawRule {
        cameras: cameras.iter().map(|number| Camera::new(*number).unwrap()).collect(),
        ..RawRule::new(RawSource::parse(source).unwrap(), allow)
    };
    RawPolicy::new(vec![
        rule("127.0.0.1", RawAllow::Read, &[0]),
        rule("127.0.0.2", RawAllow::Read, &[1]),
        rule("127.0.0.3", RawAllow::Command, &[]),
    ])
}

fn points(camera: i64, xs: &[f64]) -> String {
    let data: Vec<_> = xs
        .iter()
        .map(|x| json!({ "ModelID": "0", "X": x.to_string(), "Y": -12.25, "U": 2.3e-6, "Angel": 1.5e-7, "Similarity": 0.9997, "Rel": 0 }))
        .collect();
    let dsid = "www.hc-system.com.cam";
    json!({ "dsID": dsid, "reqType": "AddPoints", "dsData": [{ "camID": camera, "data": data }] }).to_string()
}

fn answer(taken: i64) -> String {
    format!(r#"{{"dsID":"www.hc-system.com.cam", "reqType":"photo","camID":0,"ret":{taken}}}"#)
}

#[tokio::test]
async fn an_old_script_of_a_camera_works_unchanged_while_others_poll_and_hold_the_lease() {
    let raw = Raw::with(asks_for_photos().await, policy()).await;
    raw.hall.lease(&raw.hall.operator, "press").await;
    let mut log = raw.hall.robots[0].handle().log_from_start();
    let (mut camera, mut other) = (raw.script().await, Script::from(2, raw.address()).await);
    let mut commander = Script::from(3, raw.address()).await;
    for script in [&mut camera, &mut other] {
        assert_eq!(script.query("curMode").await.len(), 1, "its connection is there");
    }
    raw.hall.robots[0].handle().operate(&PanelAction::Press(Button::Start)).unwrap();
    assert_eq!(camera.reply().await.unwrap(), PHOTO);
    camera.send(&answer(1)).await;
    let reply = camera.ask(&points(0, &[500.0, 1.5])).await;
    assert_eq!(
        reply,
        r#"{"cmdReply":["AddPoints","2"],"dsID":"www.hc-system.com.cam","reqType":"AddPoints"}"#
    );
    let begun = Instant::now();
    while raw.hall.taken() != 1 {
        assert!(begun.elapsed() < PATIENCE, "the program takes one of the two parts");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let answers = std::iter::from_fn(|| log.try_recv().ok());
    let answers = answers.filter(|entry| matches!(entry.event, Event::PhotoAnswered { camera: 0, ret: 1 }));
    assert_eq!(answers.count(), 1);
    let sent = raw.tap.frames("AddPoints");
    assert!(sent.len() == 1 && sent[0].contains(r#""X":500.000,"Y":-12.250"#), "{sent:?}");
    // Who is no camera 0 is not told of its photos.
    assert_eq!(other.query("curMode").await.len(), 1);
    assert_eq!(commander.query("curMode").await.len(), 1);

    let audit = raw.hall.audit().await;
    let entry = |what: &str| audit.iter().find(|entry| entry["what"] == what).unwrap();
    let actor = json!("raw 127.0.0.1 (rule 127.0.0.1)");
    let (photo, intent) = (entry("photo_answer"), entry("command_intent"));
    assert_eq!((&photo["actor"], &photo["taken"]), (&actor, &json!(true)));
    assert_eq!((&intent["actor"], &intent["lease"]), (&actor, &json!(0)));
    assert_eq!(intent["command"], "AddPoints camera 0, 2 points");
    assert_eq!(entry("command_outcome")["outcome"], "accepted");
    let rules = &entry("raw_rules")["rules"];
    assert_eq!((&rules[0]["cameras"], &rules[2]["cameras"]), (&json!([0]), &Value::Null));
}

#[tokio::test]
async fn without_a_grant_of_the_rule_nothing_of_a_camera_leaves() {
    let raw = Raw::with(VirtualController::start().await.unwrap(), policy()).await;
    let (mut other, mut commander) =
        (Script::from(2, raw.address()).await, Script::from(3, raw.address()).await);
    for script in [&mut other, &mut commander] {
        let told = verdict(&script.ask(&points(0, &[1.0])).await);
        assert_eq!(told, "err this address is not camera 0: a [[raw_rule]] names it in `cameras`");
    }
    let mut events = Stream::open(raw.hall.gateway.address(), &raw.hall.viewer, "/v1/events", "").await;
    raw.hall.robots[0].handle().request_photo(0);
    while events.next().await.unwrap().data["event"] != "photo_requested" {}
    let mut camera = raw.script().await;
    assert_eq!(camera.query("curMode").await.len(), 1, "its connection is there");
    raw.hall.robots[0].handle().request_photo(0);
    assert_eq!(camera.reply().await.unwrap(), PHOTO);
    commander.send(&answer(1)).await;
    raw.hall.until_audited(|entry| entry["what"] == "refused" && entry["request"] == "photo camera 0").await;
    assert_eq!(raw.tap.frames("\"ret\""), [] as [String; 0]);
    assert_eq!((raw.hall.taken(), raw.tap.frames("AddPoints").len()), (0, 0));
    assert_eq!(verdict(&other.ask(&points(1, &[1.0])).await), "1", "its own camera");
    assert_eq!(raw.hall.taken(), 1);
}

#[tokio::test]
async fn a_stop_holds_for_cameras_of_the_raw_port_too() {
    let raw = Raw::with(VirtualController::start().await.unwrap(), policy()).await;
    let mut camera = raw.script().await;
    assert_eq!(camera.query("curMode").await.len(), 1, "its connection is there");
    raw.hall.robots[0].handle().request_photo(0);
    assert_eq!(camera.reply().await.unwrap(), PHOTO);
    assert_eq!(raw.hall.stop(&raw.hall.operator, "press").await.0, 200);
    camera.send(&answer(1)).await;
    assert!(verdict(&camera.ask(&points(0, &[1.0])).await).starts_with("err "));
    assert_eq!(
        (raw.hall.taken(), raw.tap.frames("AddPoints").len(), raw.tap.frames("\"ret\"").len()),
        (0, 0, 0)
    );
    let refused =
        |word: &'static str| move |entry: &Value| entry["what"] == "refused" && entry["request"] == word;
    raw.hall.until_audited(refused("photo camera 0")).await;
    raw.hall.until_audited(refused("AddPoints camera 0")).await;
    let lease = raw.hall.lease(&raw.hall.operator, "press").await;
    let clear = json!({ "lease": lease });
    assert_eq!(raw.hall.post(&raw.hall.operator, "/v1/robots/press/clear-stopped", &clear).await.0, 204);
    // That photo was from before the stop.
    camera.send(&answer(1)).await;
    assert_eq!(verdict(&camera.ask(&points(0, &[1.0])).await), "1");
    assert_eq!((raw.hall.taken(), raw.tap.frames("\"ret\"").len()), (1, 0));
}

#[tokio::test]
async fn a_rule_that_is_gone_gives_no_grant_any_more() {
    let raw = Raw::with(VirtualController::start().await.unwrap(), policy()).await;
    let mut camera = raw.script().await;
    assert_eq!(verdict(&camera.ask(&points(0, &[1.0])).await), "1");
    raw.hall.gateway.set_raw_policy(super::policy(&[("127.0.0.1", RawAllow::Read)]));
    let told = verdict(&camera.ask(&points(0, &[2.0])).await);
    assert_eq!(told, "err this address is not camera 0: a [[raw_rule]] names it in `cameras`");
    let mut events = Stream::open(raw.hall.gateway.address(), &raw.hall.viewer, "/v1/events", "").await;
    raw.hall.robots[0].handle().request_photo(0);
    while events.next().await.unwrap().data["event"] != "photo_requested" {}
    for _ in 0..2 {
        assert_eq!(camera.query("curMode").await.len(), 1, "it is told of no photo");
    }
    assert_eq!(raw.hall.taken(), 1);
}

#[tokio::test]
async fn what_waits_for_the_disk_when_its_rule_goes_does_not_leave() {
    let raw = Raw::with(VirtualController::start().await.unwrap(), policy()).await;
    let mut camera = raw.script().await;
    assert_eq!(camera.query("curMode").await.len(), 1);
    with_slow_store(&raw.hall, async {
        camera.send(&points(0, &[1.0])).await;
        tokio::time::sleep(Duration::from_millis(300)).await;
        raw.hall.gateway.set_raw_policy(super::policy(&[("127.0.0.1", RawAllow::Read)]));
    })
    .await;
    let told = verdict(&camera.reply().await.unwrap());
    assert!(told.starts_with("err "), "{told}");
    assert_eq!((raw.hall.taken(), raw.tap.frames("AddPoints").len()), (0, 0));
}

#[tokio::test]
async fn what_waits_for_the_disk_when_all_raw_ports_are_closed_does_not_leave() {
    let raw = Raw::with(VirtualController::start().await.unwrap(), policy()).await;
    let mut camera = raw.script().await;
    assert_eq!(camera.query("curMode").await.len(), 1);
    let hall = &raw.hall;
    let closing = with_slow_store(hall, async {
        camera.send(&points(0, &[1.0])).await;
        tokio::time::sleep(Duration::from_millis(300)).await;
        let close = json!({ "open": false });
        let closed = hall.call(&hall.engineer, "PUT", "/v1/raw-ports", Some(&close));
        tokio::time::timeout(PATIENCE, closed).await.unwrap().0
    });
    assert_eq!(closing.await, 200);
    hall.until_audited(|entry| entry["outcome"] == "not_sent").await;
    assert_eq!((hall.taken(), raw.tap.frames("AddPoints").len()), (0, 0));
}

#[tokio::test]
async fn answers_that_no_photo_was_asked_for_take_no_request_from_the_other_cameras() {
    let raw = Raw::with(VirtualController::start().await.unwrap(), policy()).await;
    let (mut camera, mut other) = (raw.script().await, Script::from(2, raw.address()).await);
    for _ in 0..8 {
        for _ in 0..5 {
            camera.send(&answer(1)).await;
        }
        // Once it is answered, they have been carried out.
        assert_eq!(camera.query("curMode").await.len(), 1);
    }
    assert_eq!(verdict(&other.ask(&points(1, &[1.0])).await), "1");
    assert_eq!(raw.tap.frames("\"ret\""), [] as [String; 0]);
}

#[tokio::test]
async fn points_whose_meaning_would_change_are_refused_with_their_place() {
    let raw = Raw::with(VirtualController::start().await.unwrap(), policy()).await;
    let mut camera = raw.script().await;
    let frame = points(0, &[1.0, 2.0]);
    for (from, to, told) in [
        (
            "\"Rel\":0,\"Similarity\":0.9997,\"U\":2.3e-6,\"X\":\"2\"",
            "\"X\":\"2\"",
            "err point 2: `Rel` is missing",
        ),
        (
            "\"X\":\"2\"",
            "\"X\":\"2\",\"height\":3",
            "err point 2: the gateway does not send the key `height`",
        ),
        ("\"camID\":0", "\"camID\":0,\"camID\":0", "err `camID` in"),
    ] {
        let changed = frame.replace(from, to);
        assert_ne!(changed, frame, "{from}");
        let reply = verdict(&camera.ask(&changed).await);
        assert!(reply.starts_with(told), "{reply}");
    }
    assert_eq!((raw.hall.taken(), raw.tap.frames("AddPoints").len()), (0, 0));
    assert_eq!(verdict(&camera.ask(&frame).await), "2");
}

#[tokio::test]
async fn what_is_logged_of_an_answer_that_was_not_sent_keeps_no_refusal_from_the_audit_log() {
    let raw = Raw::with(VirtualController::start().await.unwrap(), policy()).await;
    let mut camera = raw.script().await;
    // The controller did not ask: a line in the log.
    camera.send(&answer(1)).await;
    raw.hall.until_audited(|entry| entry["request"] == "photo camera 0").await;
    // It is not known what this means.
    camera.send(&answer(2)).await;
    let refused = raw.hall.until_audited(|entry| entry["request"] == "photo").await;
    assert_eq!((&refused["what"], &refused["code"]), (&json!("refused"), &json!("bad_command")));
}
