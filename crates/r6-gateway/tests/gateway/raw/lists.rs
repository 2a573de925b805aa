//! Instruction lists (`AddRCC`) over the raw port.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use r6_gateway::{RawAllow, RawPolicy, RawRule, RawSource};
use r6_sim::VirtualController;
use serde_json::json;

use super::{Raw, Script, verdict};
use crate::support::{Hall, PATIENCE, signal};

const RULES: &[(&str, RawAllow)] = &[("127.0.0.1", RawAllow::Command), ("127.0.0.2", RawAllow::Read)];

/// A list as scripts send it, with blanks and a key that no controller knows.
pub fn list(replace: bool, steps: &[String]) -> String {
    let steps = steps.join(", ");
    let empty = u8::from(replace);
    format!(
        r#"{{"dsID": "www.hc-system.com.HCRemoteCommand", "reqType": "AddRCC", "packID": "9", "by": "me", "emptyList": "{empty}", "instructions": [{steps}]}}"#
    )
}

/// A move of J1.
pub fn to(j1: &str, speed: &str) -> String {
    format!(
        r#"{{"oneshot":"1","action":"4","m0":"{j1}","m1":"0","m2":"0","m3":"0","m4":"0","m5":"0","ckStatus":"0x3F","speed":"{speed}","delay":"0","smooth":"0"}}"#
    )
}

/// Waits until the arm stands, as a script does.
async fn until_done(script: &mut Script) {
    let begun = Instant::now();
    while script.query("isMoving").await != ["0"] {
        assert!(begun.elapsed() < PATIENCE);
    }
}

#[tokio::test]
async fn a_list_moves_the_arm_and_the_script_never_takes_it_for_done_too_early() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), RULES).await;
    let mut script = raw.script().await;
    for (number, place) in (0..6).zip(["2", "-2", "2", "-2", "2", "-2"]) {
        // A reading from before the list is there.
        script.query("isMoving axis-0").await;
        let reply = script.ask(&list(number % 2 == 0, &[to(place, "60")])).await;
        assert_eq!(
            reply,
            r#"{"cmdReply":["AddRCC","ok"],"dsID":"www.hc-system.com.HCRemoteCommand","packID":"9","reqType":"AddRCC"}"#
        );
        until_done(&mut script).await;
        assert_eq!(script.query("axis-0").await, [format!("{place}.000000")]);
    }
    let sent = raw.tap.frames("AddRCC");
    assert_eq!(sent.len(), 6);
    assert!(sent.iter().all(|frame| !frame.contains("\"by\"") && !frame.contains(' ')), "{sent:?}");
    let intent = raw.hall.until_audited(|entry| entry["what"] == "command_intent").await;
    assert_eq!(
        (&intent["command"], &intent["actor"]),
        (&json!("AddRCC replace, 1 step: axis move"), &json!("raw 127.0.0.1 (rule 127.0.0.1)"))
    );
}

#[tokio::test]
async fn a_list_without_a_live_lease_never_reaches_the_controller() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), RULES).await;
    let (mut script, mut other) = (raw.script().await, Script::from(2, raw.address()).await);
    let reply = other.ask(&list(true, &[to("5", "10")])).await;
    assert_eq!(verdict(&reply), "err this address may only read and stop");
    let lease = raw.hall.lease(&raw.hall.operator, "press").await;
    let reply = script.ask(&list(true, &[to("5", "10")])).await;
    assert!(verdict(&reply).starts_with("err token 2 (operator) holds the lease"), "{reply}");
    let held = json!({ "lease": lease });
    raw.hall.call(&raw.hall.operator, "DELETE", "/v1/robots/press/lease", Some(&held)).await;

    assert_eq!(verdict(&script.ask(&list(true, &[to("50", "1"), to("-50", "1")])).await), "ok");
    raw.hall.until("press", |state| signal(state, "isMoving")["value"] == true).await;
    assert_eq!(other.command("actionPause").await, "ok");
    for replace in [true, false] {
        let reply = script.ask(&list(replace, &[to("5", "10")])).await;
        assert!(verdict(&reply).starts_with("err the robot was stopped"), "{reply}");
    }
    // Nor does it keep the lease from the person who clears the stop.
    let said = script.command("modifyGSPD 500").await;
    assert!(said.starts_with("err the robot was stopped"), "{said}");
    assert_eq!(raw.tap.frames("AddRCC").len(), 1);

    // Once the stop is cleared, what is left of the list is not run by what is appended to it.
    raw.hall.until("press", |state| state["lease"].is_null()).await;
    let held = json!({ "lease": raw.hall.lease(&raw.hall.operator, "press").await });
    let (status, _) = raw.hall.post(&raw.hall.operator, "/v1/robots/press/clear-stopped", &held).await;
    assert_eq!(status, 204);
    raw.hall.call(&raw.hall.operator, "DELETE", "/v1/robots/press/lease", Some(&held)).await;
    assert_ne!(script.query("RemoteCmdLen").await, ["0"], "the pause leaves the list as it is");
    let reply = script.ask(&list(false, &[to("5", "10")])).await;
    assert!(verdict(&reply).contains("left in the instruction list"), "{reply}");
    assert!(!reply.contains("run_leftover"), "a script has no such field: {reply}");
    // Nor when the script tries again, nor when it holds the lease for another reason.
    assert_eq!(script.command("modifyGSPD 500").await, "ok");
    for _ in 0..2 {
        let reply = script.ask(&list(false, &[to("5", "10")])).await;
        assert!(verdict(&reply).contains("left in the instruction list"), "{reply}");
    }
    assert_eq!(raw.tap.frames("AddRCC").len(), 1);
    assert_eq!(verdict(&script.ask(&list(true, &[])).await), "ok");
    assert_eq!(script.query("RemoteCmdLen").await, ["0"]);
}

#[tokio::test]
async fn limits_of_speed_hold_for_lists() {
    let rule = RawRule::new(RawSource::parse("127.0.0.1").unwrap(), RawAllow::Command);
    let slow = RawRule { max_speed: Some(20.0), max_path_speed: Some(100), ..rule };
    let raw = Raw::with(VirtualController::start().await.unwrap(), RawPolicy::new(vec![slow])).await;
    let mut script = raw.script().await;
    let path_speed =
        |speed: &str| format!(r#"{{"oneshot":"1","action":"51","isUse":"1","speed":"{speed}"}}"#);
    for steps in [vec![to("1", "21")], vec![to("1", "20"), to("2", "90")], vec![path_speed("101")]] {
        let reply = script.ask(&list(true, &steps)).await;
        assert!(verdict(&reply).starts_with("err step "), "{reply}");
    }
    assert!(raw.tap.frames("AddRCC").is_empty());
    assert_eq!(verdict(&script.ask(&list(true, &[to("1", "20")])).await), "ok");
}

/// Choices from a seed.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, sides: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % sides
    }
}

/// A script that sends everything that a script can send, in the order of its seed.
async fn scribble(last: u8, address: SocketAddr, seed: u64) {
    let mut dice = Dice(seed);
    let mut script = Script::from(last, address).await;
    for _ in 0..40 {
        match dice.roll(8) {
            0 => script = Script::from(last, address).await,
            1 => drop(script.ask(&list(dice.roll(2) == 0, &[to("0.5", "90")])).await),
            2 => drop(script.ask(&list(true, &[])).await),
            3 => drop(script.command("startButton").await),
            4 => drop(script.command(&format!("rewriteData 80{last} {} 0", dice.roll(9))).await),
            5 if dice.roll(8) == 0 => drop(script.command("actionPause").await),
            5 | 6 => drop(script.command("modifyGSPD 500").await),
            _ => drop(script.query("isMoving RemoteCmdLen").await),
        }
    }
}

/// A person who holds the lease now and then, clears stops, and takes the lease away.
async fn look_after(hall: &Hall, seed: u64) {
    let mut dice = Dice(seed);
    for _ in 0..30 {
        let because = if dice.roll(6) == 0 { json!({ "take_because": "test" }) } else { json!({}) };
        let (status, lease) = hall.post(&hall.admin, "/v1/robots/press/lease", &because).await;
        if status == 200 {
            let held = json!({ "lease": lease["lease"] });
            hall.post(&hall.admin, "/v1/robots/press/clear-stopped", &held).await;
            hall.command(&hall.admin, "press", &lease["lease"], "modifyGSPD 60").await;
            hall.call(&hall.admin, "DELETE", "/v1/robots/press/lease", Some(&held)).await;
        }
        tokio::time::sleep(Duration::from_millis(dice.roll(40))).await;
    }
}

#[tokio::test]
async fn whatever_scripts_and_people_do_nothing_leaves_without_a_live_lease() {
    for seed in 1..=3 {
        let raw = Raw::start(VirtualController::start().await.unwrap(), RULES).await;
        let address = raw.address();
        let scripts =
            [1, 1, 2, 2, 1].into_iter().zip(seed * 100..).map(|(last, seed)| scribble(last, address, seed));
        tokio::join!(futures_util::future::join_all(scripts), look_after(&raw.hall, seed));
        let audit = raw.hall.audit().await;
        assert!(audit.len() < 1_000, "the page has all entries");

        // Each command and list that reached the controller has its intent, under a lease that was live then.
        let mut live = None;
        let (mut intents, mut left) = (BTreeMap::new(), 0);
        for entry in &audit {
            match entry["what"].as_str().unwrap() {
                "lease_began" => {
                    assert_eq!(live, None, "seed {seed}: {entry}");
                    live = Some(entry["lease"].clone());
                }
                "lease_ended" => {
                    assert_eq!(live.as_ref(), Some(&entry["lease"]), "seed {seed}: {entry}");
                    live = None;
                }
                "command_intent" => {
                    let is_live = live.as_ref() == Some(&entry["lease"]);
                    intents.insert(entry["number"].as_u64(), is_live);
                }
                "command_outcome" => {
                    let is_live = intents.remove(&entry["intent"].as_u64());
                    // A lease may end while the intent is on its way to the disk: then nothing is sent.
                    let sent = entry["outcome"] != "not_sent";
                    assert!(is_live.is_some_and(|is_live| is_live || !sent), "seed {seed}: {entry}");
                    left += usize::from(sent);
                }
                _ => {}
            }
        }
        assert!(intents.is_empty(), "seed {seed}: {intents:?}");
        // The admin's stops send `actionStop` and clear the list: what the client does for a stop needs no
        // lease.
        let stops = audit.iter().filter(|entry| entry["request"] == "stop").count();
        let sent = ["modifyGSPD", "startButton", "rewriteData"].map(|word| raw.tap.frames(word).len());
        let lists = raw.tap.frames("AddRCC");
        let cleared = lists.iter().filter(|frame| frame.contains(r#""instructions":[]"#)).count();
        let orders = sent.iter().sum::<usize>() + lists.len();
        assert!(
            left > 20 && (left..=left + if stops > 0 { cleared } else { 0 }).contains(&orders),
            "{left} {orders}"
        );
        assert!(raw.tap.frames(r#""rewriteData","802""#).is_empty(), "127.0.0.2 may only read");
        assert_eq!(raw.tap.connections(), 1);
    }
}
