//! Commands and stops: under the policy, with the implicit lease.

use std::time::{Duration, Instant};

use r6_controller::{Profile, Program, StartState};
use r6_gateway::{RawAllow, RawPolicy, RawRule, RawSource};
use r6_sim::VirtualController;
use serde_json::json;

use super::{Raw, Script, command, policy, verdict};
use crate::support::{PATIENCE, commands, ready_to_start, signal};

/// 127.0.0.1 and 127.0.0.3 may send commands, 127.0.0.2 may read.
const RULES: &[(&str, RawAllow)] =
    &[("127.0.0.1", RawAllow::Command), ("127.0.0.2", RawAllow::Read), ("127.0.0.3", RawAllow::Command)];

#[tokio::test]
async fn an_old_script_works_unchanged_while_another_polls() {
    let raw = Raw::start(ready_to_start().await, RULES).await;
    let address = raw.address();
    let polls = tokio::spawn(async move {
        let mut poller = Script::from(2, address).await;
        loop {
            assert_eq!(poller.query("curMode isMoving axis-0 Addr-803").await.len(), 4);
        }
    });
    let mut log = raw.hall.robots[0].handle().log();
    let mut script = raw.script().await;
    let begin = script.query("axis-0").await;
    assert_eq!(script.command("modifyGSPD 500").await, "ok");
    assert_eq!(script.command("rewriteData 803 42 0").await, "ok");
    assert_eq!(script.query("Addr-803").await, ["42"]);
    assert_eq!(script.command("startButton").await, "ok");
    // As such scripts do: right after the reply, without a wait.
    assert_eq!(script.query("isMoving").await, ["1"]);
    let begun = Instant::now();
    while script.query("axis-0").await == begin {
        assert!(begun.elapsed() < PATIENCE);
    }
    assert_eq!(script.command("actionPause").await, "ok");
    assert_eq!(commands(&mut log), ["modifyGSPD", "rewriteData", "startButton", "actionPause"]);
    assert!(!polls.is_finished());
    polls.abort();
    assert_eq!(raw.tap.connections(), 1);
    let intent = raw.hall.until_audited(|entry| entry["command"] == r#"rewriteData "803","42","0""#).await;
    assert_eq!(intent["actor"], "raw 127.0.0.1 (rule 127.0.0.1)");
    assert!(intent["source"].as_str().unwrap().starts_with("127.0.0.1:"));
}

#[tokio::test]
async fn no_reading_from_before_a_command_answers_after_it() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), RULES).await;
    let (mut script, mut other) = (raw.script().await, Script::from(2, raw.address()).await);
    for value in 1..=200 {
        let value = value.to_string();
        // Both have read it, so a fresh reading is there.
        other.query("Addr-805").await;
        assert_eq!(script.command(&format!("rewriteData 805 {value} 0")).await, "ok");
        let asked = if value.ends_with('5') { &mut other } else { &mut script };
        assert_eq!(asked.query("Addr-805").await, [value.as_str()]);
    }
}

#[tokio::test]
async fn what_a_read_only_source_may_not_never_reaches_the_controller() {
    let raw = Raw::start(ready_to_start().await, RULES).await;
    let mut script = Script::from(2, raw.address()).await;
    for command in ["modifyGSPD 50", "startButton", "rewriteData 800 1 0", "clearAlarm", "modifyOutput 0 3 1"]
    {
        assert_eq!(script.command(command).await, "err this address may only read and stop", "{command}");
    }
    for frame in [
        r#"{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","packID":"1","emptyList":"1","instructions":[]}"#,
        r#"{"reqType":"AddPoints","packID":"1","dsData":[{"camID":"0","data":[]}]}"#,
        r#"{"reqType":"command","packID":"1","cmdData":["fly","1"]}"#,
    ] {
        let reply = script.ask(frame).await;
        assert!(verdict(&reply).starts_with("err "), "{reply}");
    }
    // These get no reply, from a controller either.
    script.send(r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"heartbreak"}"#).await;
    script.send(r#"{"cmdData":["startButton"]}"#).await;
    assert_eq!(script.query("curMode").await, ["2"]);
    assert_eq!(raw.tap.frames(r#""reqType":"query""#).len(), raw.tap.frames("").len());
    for (word, code) in [
        ("modifyGSPD", "not_allowed"),
        ("startButton", "not_allowed"),
        ("AddRCC", "not_allowed"),
        ("AddPoints camera 0", "not_allowed"),
        ("fly", "bad_command"),
    ] {
        let refused = raw.hall.until_audited(|entry| entry["request"] == word).await;
        assert_eq!((&refused["what"], &refused["code"]), (&json!("refused"), &json!(code)), "{word}");
    }
    // A loop does not fill the log.
    let entries = raw.hall.audit().await.len();
    for _ in 0..50 {
        script.command("startButton").await;
    }
    assert!(raw.hall.audit().await.len() <= entries + 1);
}

#[tokio::test]
async fn a_read_only_source_stops_the_arm_and_the_stop_holds() {
    let raw = Raw::start(ready_to_start().await, RULES).await;
    let (mut one, mut other) = (raw.script().await, Script::from(2, raw.address()).await);
    assert_eq!(one.command("startButton").await, "ok");
    raw.hall.until("press", |state| signal(state, "isMoving")["value"] == true).await;
    assert_eq!(other.command("actionStop").await, "ok");
    raw.hall.until("press", |state| signal(state, "isMoving")["value"] == false).await;
    let state = raw.hall.get(&raw.hall.viewer, "/v1/robots/press").await;
    assert_eq!(state["stopped"], true);
    let starts = raw.tap.frames("startButton").len();
    for _ in 0..3 {
        assert!(one.command("startButton").await.starts_with("err the robot was stopped"));
    }
    assert_eq!(raw.tap.frames("startButton").len(), starts);
    let stop = raw.hall.until_audited(|entry| entry["what"] == "stop").await;
    let actor = json!("raw 127.0.0.2 (rule 127.0.0.2)");
    assert_eq!((&stop["actor"], &stop["request"]), (&actor, &json!("actionStop")));

    // The stop ends the implicit lease, so that a person can take the lease, look, and clear the stop.
    raw.hall.until("press", |state| state["lease"].is_null()).await;
    let lease = raw.hall.lease(&raw.hall.operator, "press").await;
    let held = json!({ "lease": lease });
    let cleared = raw.hall.post(&raw.hall.operator, "/v1/robots/press/clear-stopped", &held);
    assert_eq!(cleared.await.0, 204);
    assert!(one.command("startButton").await.starts_with("err token 2 (operator) holds the lease"));
    let (status, _) =
        raw.hall.call(&raw.hall.operator, "DELETE", "/v1/robots/press/lease", Some(&held)).await;
    assert_eq!(status, 204);
    assert_eq!(one.command("startButton").await, "ok");
}

#[tokio::test]
async fn one_source_holds_the_lease_and_all_its_scripts_have_it() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), RULES).await;
    let (mut one, mut twin, mut other) =
        (raw.script().await, raw.script().await, Script::from(3, raw.address()).await);
    assert_eq!(raw.hall.get(&raw.hall.viewer, "/v1/robots/press").await["lease"], json!(null));
    let (first, second) = tokio::join!(one.command("modifyGSPD 500"), twin.command("modifyGSPD 600"));
    assert_eq!((first.as_str(), second.as_str()), ("ok", "ok"));
    let denied = other.command("modifyGSPD 700").await;
    assert!(denied.starts_with("err raw 127.0.0.1 (rule 127.0.0.1) holds the lease for "), "{denied}");
    let state = raw.hall.get(&raw.hall.viewer, "/v1/robots/press").await;
    assert_eq!(state["lease"]["holder"], "raw 127.0.0.1 (rule 127.0.0.1)");
    assert_eq!(state["lease"]["number"], 1);
    let (status, problem) = raw.hall.post(&raw.hall.operator, "/v1/robots/press/lease", &json!({})).await;
    assert_eq!((status, &problem["code"]), (409, &json!("leased")));

    // 10 s after the last frame of the source, the lease is free; reading is a frame too.
    let begun = Instant::now();
    drop((one, twin));
    while other.command("modifyGSPD 700").await != "ok" {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    assert!(begun.elapsed() > Duration::from_secs(9), "{:?}", begun.elapsed());
    assert_eq!(raw.tap.frames("modifyGSPD").len(), 3);
}

#[tokio::test]
async fn an_arm_that_moves_keeps_the_lease_of_a_script_that_has_gone() {
    let raw = Raw::start(ready_to_start().await, RULES).await;
    let mut script = raw.script().await;
    assert_eq!(script.command("startButton").await, "ok");
    drop(script);
    raw.hall.until("press", |state| signal(state, "isMoving")["value"] == true).await;
    let begun = Instant::now();
    // Longer than a source without a frame keeps the lease of an arm at rest.
    while begun.elapsed() < Duration::from_secs(12) {
        let state = raw.hall.get(&raw.hall.viewer, "/v1/robots/press").await;
        assert_eq!(state["lease"]["holder"], "raw 127.0.0.1 (rule 127.0.0.1)");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    raw.hall.stop(&raw.hall.operator, "press").await;
    raw.hall.until("press", |state| state["lease"].is_null()).await;
}

#[tokio::test]
async fn a_reading_of_an_arm_at_rest_frees_no_lease_once_it_is_old() {
    let (period, robot) = (Duration::from_secs(8), VirtualController::start().await.unwrap());
    let raw = Raw::read_every(period, robot, policy(RULES)).await;
    let mut script = raw.script().await;
    assert_eq!(script.command("modifyGSPD 500").await, "ok");
    drop(script);
    let begun = Instant::now();
    let lease = async || raw.hall.get(&raw.hall.viewer, "/v1/robots/press").await["lease"].clone();
    // After 10 s without a frame the lease ends if the arm stands. That was read after 8 s, and is read again
    // after 16 s.
    while begun.elapsed() < Duration::from_secs(14) {
        assert_eq!(lease().await["holder"], "raw 127.0.0.1 (rule 127.0.0.1)", "{:?}", begun.elapsed());
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    raw.hall.until("press", |state| state["lease"].is_null()).await;
}

#[tokio::test]
async fn a_limit_of_the_global_speed_holds() {
    let rule = RawRule::new(RawSource::parse("127.0.0.1").unwrap(), RawAllow::Command);
    let slow = RawRule { max_global_speed: Some(30.0), ..rule };
    let raw = Raw::with(VirtualController::start().await.unwrap(), RawPolicy::new(vec![slow])).await;
    let mut script = raw.script().await;
    assert_eq!(
        script.command("modifyGSPD 301").await,
        "err this address may set a global speed of 30 % at most, not 30.1 %"
    );
    assert_eq!(script.command("modifyGSPD 300").await, "ok");
    assert_eq!(raw.tap.frames("modifyGSPD").len(), 1);
}

#[tokio::test]
async fn a_rule_limits_the_commands_and_the_programs() {
    let rule = RawRule::new(RawSource::parse("127.0.0.1").unwrap(), RawAllow::Command);
    let of = |programs: &[&str]| RawRule {
        commands: Some(vec!["startButton", "switchMold"]),
        programs: Some(programs.iter().map(|name| (*name).to_owned()).collect()),
        ..rule.clone()
    };
    let pendant = || VirtualController::builder().profile(Profile::named("r6-pendant").unwrap());
    let long = || Program::read("long", "[[step]]\ndo = \"axis-move\"\nto = [60]\nspeed = 1\n").unwrap();
    let ready = async || pendant().program(long()).unwrap().stands(StartState::Auto).start().await.unwrap();

    let raw = Raw::with(ready().await, RawPolicy::new(vec![of(&["drill"])])).await;
    let mut script = raw.script().await;
    let told = script.command("modifyGSPD 300").await;
    assert_eq!(told, "err this address may send only startButton, switchMold, not modifyGSPD");
    let other = "err this address may run only the programs drill, not `long`";
    assert_eq!(script.command("switchMold long").await, other);
    assert_eq!(script.command("startButton").await, other);
    assert_eq!(raw.tap.frames("cmdData").len(), 0, "none of it reached the controller");
    let refused = raw.hall.until_audited(|entry| entry["request"] == "startButton").await;
    assert_eq!(refused["code"], "not_allowed", "{refused}");

    let raw = Raw::with(ready().await, RawPolicy::new(vec![of(&["drill", "long"])])).await;
    let mut script = raw.script().await;
    assert_eq!(script.command("startButton").await, "ok");
    raw.hall.until("press", |state| signal(state, "isMoving")["value"] == true).await;

    // Over the port for hosts, controllers have no `curMold`.
    let raw = Raw::with(ready_to_start().await, RawPolicy::new(vec![of(&["long"])])).await;
    let told = raw.script().await.command("startButton").await;
    assert!(told.ends_with("the controller does not say which one is loaded (it has no curMold)"), "{told}");
    assert_eq!(raw.tap.frames("cmdData").len(), 0);
}

#[tokio::test]
async fn commands_are_sent_in_our_encoding_and_mistakes_are_refused() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), RULES).await;
    let mut script = raw.script().await;
    let odd = r#"{"extra":[1,{"x":"startButton"}],"cmdData":["modifyGSPD",500,"startButton"],"reqType":"command","packID":"k"}"#;
    assert_eq!(verdict(&script.ask(odd).await), "ok");
    let sent = raw.tap.frames("modifyGSPD");
    assert!(sent[0].ends_with(r#""cmdData":["modifyGSPD","500"]}"#), "{sent:?}");
    assert!(raw.tap.frames("startButton").is_empty());
    for wrong in ["modifyGSPD x", "modifyGSPD 1001", "modifyGSPD", "rewriteData 799 1 0", "modifyGSPD 505.55"]
    {
        assert!(script.command(wrong).await.starts_with("err "), "{wrong}");
    }
    assert_eq!(raw.tap.frames("cmdData").len(), 1);
}

#[tokio::test]
async fn an_old_dialect_has_its_own_words_for_the_outcome() {
    let legacy = VirtualController::builder().profile(Profile::named("legacy").unwrap());
    let raw = Raw::start(legacy.start().await.unwrap(), RULES).await;
    let mut script = raw.script().await;
    let mut direct = Script::at(raw.hall.robots[0].address()).await;
    let request = r#"{"dsID":"HCRemoteMonitor","cmdType":"command","cmdData":["modifyGSPD","500"]}"#;
    assert_eq!(script.ask(request).await, direct.ask(request).await);
}

#[tokio::test]
async fn an_unknown_outcome_is_silence() {
    let raw = Raw::start(VirtualController::start().await.unwrap(), RULES).await;
    let mut script = raw.script().await;
    raw.tap.lose("rewriteData");
    script.send(&command(&["rewriteData", "800", "1", "0"])).await;
    // Replies come in order, so one to the command would come first.
    assert_eq!(script.query("Addr-800").await, ["0"]);
    let outcome = raw.hall.until_audited(|entry| entry["what"] == "command_outcome").await;
    assert_eq!(outcome["outcome"], "unknown");
    assert_eq!(raw.tap.frames("rewriteData").len(), 1, "it is never sent again");
}

#[tokio::test]
async fn a_loop_of_stops_or_commands_does_not_fill_the_disk() {
    let raw = Raw::start(ready_to_start().await, RULES).await;
    let mut script = Script::from(2, raw.address()).await;
    for _ in 0..100 {
        assert_eq!(script.command("actionPause").await, "ok");
    }
    assert_eq!(raw.tap.frames("actionPause").len(), 100, "a stop is never refused");
    raw.hall.until_audited(|entry| entry["what"] == "stop").await;
    let audit = raw.hall.audit().await;
    let stops = audit.iter().filter(|entry| entry["request"] == "actionPause").count();
    assert_eq!(stops, 2, "one began and ended");

    raw.hall.until("press", |state| state["lease"].is_null()).await;
    let held = json!({ "lease": raw.hall.lease(&raw.hall.operator, "press").await });
    let (status, _) = raw.hall.post(&raw.hall.operator, "/v1/robots/press/clear-stopped", &held).await;
    assert_eq!(status, 204);
    raw.hall.call(&raw.hall.operator, "DELETE", "/v1/robots/press/lease", Some(&held)).await;
    let begun = Instant::now();
    let loops = (0..6).map(async |_| {
        let (mut script, mut sent) = (raw.script().await, 0);
        for _ in 0..100 {
            let said = script.command("modifyGSPD 500").await;
            assert!(said == "ok" || said.starts_with("err too many commands"), "{said}");
            sent += usize::from(said == "ok");
        }
        sent
    });
    let sent: usize = futures_util::future::join_all(loops).await.into_iter().sum();
    let most = 200.0 + 100.0 * begun.elapsed().as_secs_f64();
    assert!(sent as f64 <= most, "{sent} commands, {most} at most");
    assert_eq!(raw.tap.frames("modifyGSPD").len(), sent);
}
