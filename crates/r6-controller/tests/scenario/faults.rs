//! Faults: in force in their time, with their chance, each with its own effect only.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use crate::common::{Cell, axis_move};
use crate::{cell, seeded};

const ASK: &str = r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"5","queryAddr":["version","axisNum","origin"]}"#;

fn fault(word: &str, more: &str) -> String {
    format!("[[fault]]\nfault = \"{word}\"\n{more}\n")
}

fn frames(cell: &mut Cell) -> Vec<Vec<u8>> {
    let mut all = Vec::new();
    while let Some(frame) = cell.controller.poll_transmit(cell.now, cell.id) {
        all.push(frame.to_vec());
    }
    all
}

/// The replies to one query while this fault is in force.
fn reply(word: &str, more: &str) -> Vec<Vec<u8>> {
    let mut cell = cell(&fault(word, more));
    cell.send(ASK);
    frames(&mut cell)
}

fn object(frames: &[Vec<u8>]) -> Value {
    assert_eq!(frames.len(), 1);
    serde_json::from_slice(&frames[0])
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&frames[0])))
}

fn right() -> Value {
    object(&reply("not-executed", ""))
}

#[test]
fn a_window_begins_and_ends_to_the_nanosecond() {
    let mut cell = cell(&fault("echo", "from = 2\nfor = 3"));
    let mut struck = Vec::new();
    let mut passed = 0.0;
    for at in [1.999_999_999, 2.0, 4.999_999_999, 5.0] {
        cell.pass(at - passed);
        passed = at;
        struck.push(cell.ask(ASK) == ASK);
    }
    assert_eq!(struck, [false, true, true, false]);
    let strike = "connection 0: a reply was struck by fault echo\n".repeat(2);
    assert_eq!(cell.log(), format!("scenario: fault echo begins\n{strike}scenario: fault echo ends\n"));
}

#[test]
fn a_fault_that_begins_again_is_in_force_each_time_and_no_more() {
    let mut cell = cell(&fault("echo", "from = 2\nfor = 1\nevery = 10\ntimes = 2"));
    let mut passed = 0.0;
    let struck = [1.9, 2.0, 2.9, 3.0, 11.9, 12.0, 12.9, 13.0, 22.5].map(|at| {
        cell.pass(at - passed);
        passed = at;
        cell.ask(ASK) == ASK
    });
    assert_eq!(struck, [false, true, true, false, false, true, true, false, false]);
}

#[test]
fn from_the_beginning_to_the_end_unless_told() {
    let mut cell = cell(&fault("echo", ""));
    cell.pass(1e6);
    assert_eq!(cell.ask(ASK), ASK);
}

#[test]
fn as_likely_as_told() {
    let struck = |chance: &str, seed| {
        let mut cell = seeded(&fault("echo", &format!("chance = {chance}")), seed);
        (0..1000).map(|_| cell.ask(ASK) == ASK).collect::<Vec<_>>()
    };
    let count = |chance| struck(chance, 1).into_iter().filter(|hit| *hit).count();
    assert_eq!((count("0"), count("1"), count("1.0")), (0, 1000, 1000));
    let some = count("0.3");
    assert!((240..360).contains(&some), "{some}");
    assert_eq!(struck("0.3", 1), struck("0.3", 1));
    assert_ne!(struck("0.3", 1), struck("0.3", 2));
}

#[test]
fn replies_that_are_no_json() {
    let right = right().to_string();
    for kind in ["truncated", "deep", "byte-order-mark", "bad-utf8", "nul", "not-a-number"] {
        let all = reply("bad-json", &format!("kind = \"{kind}\""));
        assert!(serde_json::from_slice::<Value>(&all[0]).is_err(), "{kind}");
    }
    for kind in ["oversized", "huge-number", "duplicate-keys"] {
        let all = reply("bad-json", &format!("kind = \"{kind}\""));
        assert!(all[0].len() > right.len() + 100, "{kind}");
    }
    assert_eq!(object(&reply("bad-json", "kind = \"duplicate-keys\"")), self::right());
}

#[test]
fn replies_with_a_wrong_field() {
    let with = |kind| object(&reply("bad-field", &format!("kind = \"{kind}\"")));
    let mut right = right();
    let values = right["queryData"].take();
    assert_eq!(with("unknown")["queryData"], values);
    assert!(with("unknown").as_object().unwrap().len() > right.as_object().unwrap().len());
    assert!(with("missing").get("queryData").is_none());
    assert_eq!(with("renamed")["queryDatas"], values);
    assert_eq!(with("wrong-type")["queryData"], json!(7));
}

#[test]
fn replies_with_a_wrong_list() {
    let with = |kind| object(&reply("bad-list", &format!("kind = \"{kind}\"")))["queryData"].clone();
    let values = right()["queryData"].as_array().unwrap().clone();
    assert_eq!(with("short"), json!(values[..2]));
    assert_eq!(with("long"), json!([values[0], values[1], values[2], values[2]]));
    assert_eq!(with("shifted"), json!([values[1], values[2], values[0]]));
}

#[test]
fn replies_to_another_number_twice_or_late() {
    let right = right();
    assert_ne!(object(&reply("bad-pack-id", "kind = \"wrong\""))["packID"], right["packID"]);
    assert_eq!(reply("bad-pack-id", "kind = \"repeated\"").len(), 2);
    let mut cell = cell(&fault("late-reply", "delay = 3"));
    cell.send(ASK);
    cell.pass(2.999);
    assert_eq!(cell.frame(), None);
    cell.pass(0.001);
    assert!(cell.frame().is_some());
}

#[test]
fn a_late_reply_keeps_no_other_one_waiting() {
    let mut cell = cell(&fault("late-reply", "delay = 30\nfor = 1"));
    cell.send(ASK);
    cell.pass(1.0);
    cell.run_ok(&json!([]));
    assert_eq!(cell.frame(), None);
}

#[test]
fn two_replies_change_places() {
    let mut cell = cell(&fault("bad-pack-id", "kind = \"reordered\"\nfor = 10"));
    let mut order = Vec::new();
    for n in 0..9 {
        cell.send(format!(r#"{{"reqType":"query","packID":"{n}","queryAddr":["version"]}}"#));
        for frame in frames(&mut cell) {
            let reply: Value = serde_json::from_slice(&frame).unwrap();
            order.push(reply["packID"].as_str().unwrap().to_owned());
        }
    }
    assert_eq!(order.concat(), "10325476", "and 8 waits");
    cell.pass(10.0);
    assert!(cell.frame().unwrap().contains(r#""packID":"8""#), "there is no next one when it is over");
}

#[test]
fn replies_that_are_held_go_with_their_connection() {
    let mut cell = cell(&fault("bad-pack-id", "kind = \"reordered\""));
    let size = format!("{:?}", cell.controller).len();
    for _ in 0..300 {
        cell.send(ASK);
        cell.controller.disconnect(cell.id);
        cell.id = cell.controller.connect(cell.now);
    }
    while cell.controller.poll_log().is_some() {}
    let now = format!("{:?}", cell.controller).len();
    assert!(now < size + 10_000, "{size} to {now}");
}

#[test]
fn everybody_gets_a_crossed_reply_and_who_reads_nothing_is_given_up() {
    let mut cell = cell(&fault("crossed-reply", ""));
    let other = cell.controller.connect(cell.now);
    let reply = cell.ask(ASK);
    assert_eq!(cell.controller.poll_transmit(cell.now, other), Some(reply.as_bytes()));
    for _ in 0..10_000 {
        cell.ask(ASK);
    }
    assert!(cell.controller.is_over(other));
    assert!(!cell.controller.is_over(cell.id));
}

#[test]
fn frames_that_nobody_asked_for() {
    let mut kinds = BTreeSet::new();
    let mut cell = cell(&fault("unsolicited", ""));
    for _ in 0..50 {
        cell.send(ASK);
        let all = frames(&mut cell);
        assert_eq!(all.len(), 2);
        assert_eq!(object(&all[1..]), right());
        kinds.insert(all[0].clone());
    }
    assert_eq!(kinds.len(), 4);
}

fn moved(cell: &mut Cell) -> (Vec<String>, f64) {
    cell.add_rcc("1", &json!([axis_move([5.0; 6], 90.0), axis_move([10.0; 6], 90.0)]));
    cell.pass(0.018);
    let reply = cell.frame().map(|frame| serde_json::from_str::<Value>(&frame).unwrap()["cmdReply"].clone());
    cell.pass(3.0);
    let words = reply.map(|words| {
        words.as_array().unwrap().iter().map(|word| word.as_str().unwrap().to_owned()).collect()
    });
    (words.unwrap_or_default(), cell.controller.snapshot(cell.now).axes[0])
}

#[test]
fn lists_and_commands() {
    for (word, verdict, j1) in [
        ("not-executed", Some("ok"), 0.0),
        ("not-acknowledged", None, 10.0),
        ("list-full", Some("err"), 0.0),
        ("list-frozen", Some("ok"), 0.0),
        ("rejected-mid-batch", Some("err"), 5.0),
        ("task-dead", None, 0.0),
        ("frozen-values", Some("ok"), 10.0),
    ] {
        let mut one = cell(&fault(word, "for = 10"));
        let (words, axis) = moved(&mut one);
        assert_eq!(words.last().map(String::as_str), verdict, "{word}");
        assert!((axis - j1).abs() < 1e-6, "{word}: J1 at {axis}");
        let mut never = cell(&fault(word, "for = 10\nchance = 0"));
        assert_eq!(
            moved(&mut never),
            (vec!["AddRCC".to_owned(), "ok".to_owned()], 10.0),
            "{word} that never strikes"
        );
        assert_eq!(never.number("axis-0"), 10.0, "{word}");
    }
}

#[test]
fn a_stop_that_is_ignored_is_answered_and_the_arm_goes_on() {
    for (kind, words, verdict, j1) in [
        ("ok", ["actionStop", "actionStop"], "ok", 10.0),
        ("err", ["actionStop", "actionStop"], "err", 10.0),
        ("every", ["actionPause", "stopButton"], "ok", 10.0),
    ] {
        let mut cell = cell(&fault("stop-ignored", &format!("kind = \"{kind}\"\nfor = 10")));
        cell.run_ok(&json!([axis_move([10.0; 6], 90.0)]));
        for word in words {
            assert_eq!(cell.command(&[word]), [word, verdict], "{kind}");
        }
        cell.pass(5.0);
        assert_eq!(cell.number("axis-0"), j1, "{kind}");
    }
    let mut cell = cell(&fault("stop-ignored", "kind = \"ok\"\nfor = 10"));
    cell.run_ok(&json!([axis_move([10.0; 6], 90.0)]));
    cell.ok(&["actionPause"]);
    cell.pass(5.0);
    assert!(cell.number("axis-0") < 10.0, "other means work");
}

#[test]
fn clearing_the_list_is_ignored_with_every_stop() {
    for (kind, left) in [("every", "1"), ("ok", "0")] {
        let mut cell =
            cell(&(fault("list-frozen", "for = 10") + &fault("stop-ignored", &format!("kind = \"{kind}\""))));
        cell.run_ok(&json!([axis_move([10.0; 6], 90.0)]));
        cell.run_ok(&json!([]));
        assert_eq!(cell.text("RemoteCmdLen"), left, "{kind}");
    }
}

#[test]
fn the_arm_dwells_between_two_moves_and_not_after_the_last() {
    let mut cell = cell(&fault("dwell", "rest = 2"));
    cell.run_ok(&json!([axis_move([5.0; 6], 90.0), axis_move([0.0; 6], 90.0)]));
    cell.pass(2.0);
    let stands = (cell.text("RemoteCmdLen"), cell.text("isMoving"), cell.number("axis-0"));
    assert_eq!(stands, ("1".to_owned(), "0".to_owned(), 5.0));
    cell.pass(4.0);
    assert_eq!((cell.text("RemoteCmdLen"), cell.number("axis-0")), ("0".to_owned(), 0.0));
}

#[test]
fn a_late_list_is_taken_after_it_was_cleared() {
    let mut cell = cell(&fault("late-list", "delay = 3\nfor = 1"));
    cell.add_rcc("1", &json!([axis_move([5.0; 6], 90.0)]));
    cell.pass(1.5);
    assert_eq!(cell.frame(), None);
    assert_eq!(cell.text("RemoteCmdLen"), "0");
    cell.run_ok(&json!([]));
    cell.pass(4.0);
    assert_eq!(cell.number("axis-0"), 5.0);
}

#[test]
fn a_late_list_is_lost_with_the_mains() {
    let cut = "[[at]]\ntime = 1\ndo = \"power-cut\"\nfor = 0.5\n";
    let mut cell = cell(&(fault("late-list", "delay = 3\nfor = 0.9") + cut));
    cell.add_rcc("1", &json!([axis_move([5.0; 6], 90.0)]));
    cell.pass(6.0);
    assert_eq!(cell.controller.snapshot(cell.now).axes[0], 0.0);
}

#[test]
fn a_frozen_list_goes_on_when_it_is_over() {
    let mut cell = cell(&fault("list-frozen", "for = 10"));
    cell.run_ok(&json!([axis_move([5.0; 6], 90.0)]));
    cell.pass(9.0);
    assert_eq!(cell.text("RemoteCmdLen"), "1");
    cell.pass(4.0);
    assert_eq!((cell.text("RemoteCmdLen"), cell.number("axis-0")), ("0".to_owned(), 5.0));
}

#[test]
fn a_frozen_list_that_was_stopped_does_not_go_on() {
    let mut cell = cell(&fault("list-frozen", "for = 10"));
    cell.run_ok(&json!([axis_move([5.0; 6], 90.0)]));
    cell.ok(&["actionStop"]);
    cell.pass(20.0);
    assert_eq!(cell.number("axis-0"), 0.0);
}

#[test]
fn values_stay_as_they_were() {
    let mut cell = cell(&fault("frozen-values", "from = 1\nfor = 10"));
    cell.pass(1.0);
    cell.run_ok(&json!([axis_move([5.0; 6], 90.0)]));
    cell.ok(&["modifyOutput", "0", "0", "1"]);
    cell.pass(5.0);
    assert_eq!((cell.number("axis-0"), cell.text("output-0")), (0.0, "0".to_owned()));
    cell.pass(5.0);
    assert_eq!((cell.number("axis-0"), cell.text("output-0")), (5.0, "1".to_owned()));
}

#[test]
fn values_that_are_frozen_again_are_those_of_then() {
    let mut cell =
        cell(&(fault("frozen-values", "from = 1\nfor = 1") + &fault("frozen-values", "from = 5\nfor = 10")));
    cell.pass(3.0);
    cell.ok(&["modifyOutput", "0", "0", "1"]);
    cell.pass(3.0);
    assert_eq!(cell.text("output-0"), "1");
}

#[test]
fn a_dead_task_answers_heartbreaks() {
    let mut cell = cell(&fault("task-dead", ""));
    cell.send(ASK);
    assert_eq!(cell.frame(), None);
    for _ in 0..5 {
        assert!(cell.ask(br#"{"reqType":"heartbreak"}"#).contains("heartbreak"));
        cell.pass(6.0);
    }
    assert_eq!(cell.controller.snapshot(cell.now).alarm, 0, "the watchdog is fed");
}

#[test]
fn faults_strike_one_after_the_other() {
    let mut cell =
        cell(&(fault("bad-pack-id", "kind = \"repeated\"") + &fault("bad-list", "kind = \"short\"")));
    cell.send(ASK);
    let all = frames(&mut cell);
    assert_eq!(all.len(), 2);
    assert!(
        all.iter()
            .all(|frame| object(std::slice::from_ref(frame))["queryData"].as_array().unwrap().len() == 2)
    );
}

#[test]
fn those_of_the_link_are_told_and_wake_everybody() {
    let mut cell = cell(&fault("latency", "from = 1\nto_client = 0.3\nchance = 0.5"));
    assert!(cell.controller.link_faults().is_empty());
    cell.pass(1.0);
    assert_eq!(cell.controller.link_faults().len(), 1);
    assert_eq!(cell.controller.poll_woken(), Some(cell.id));
    assert_eq!(cell.log(), "scenario: fault latency begins\n");
}

/// Several faults that double a reply double it only a few times, however often the file names them.
#[test]
fn many_faults_at_once_stay_within_bounds() {
    for (word, more) in [("bad-pack-id", "kind = \"repeated\""), ("bad-json", "kind = \"duplicate-keys\"")] {
        let mut cell = cell(&fault(word, more).repeat(40));
        cell.send(ASK);
        let frames = frames(&mut cell);
        let bytes: usize = frames.iter().map(Vec::len).sum();
        assert!(
            (2..=32).contains(&frames.len()) || word == "bad-json" && frames.len() == 1,
            "{}",
            frames.len()
        );
        assert!(bytes > 2000 && bytes < 3 << 20, "{bytes}");
    }
}

#[test]
fn what_was_not_carried_out_is_told_so() {
    let mut cell = cell(&fault("not-executed", ""));
    cell.ok(&["modifyOutput", "0", "0", "1"]);
    cell.run_ok(&json!([axis_move([5.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]));
    let log = cell.log();
    assert_eq!(log.matches("answered ok and not carried out (fault not-executed)").count(), 2, "{log}");
}

/// The log has a line for each strike, so that a chance can be checked.
#[test]
fn each_strike_is_told() {
    for (word, more, told) in [
        ("bad-json", "kind = \"truncated\"", "a reply was struck by fault bad-json (truncated)"),
        ("task-dead", "", "not answered: fault task-dead"),
    ] {
        let mut cell = cell(&(fault(word, more) + "chance = 0.5"));
        let mut quiet = 0;
        for _ in 0..100 {
            cell.send(ASK);
            let whole = frames(&mut cell).iter().any(|frame| frame.ends_with(b"}"));
            quiet += usize::from(!whole);
        }
        assert!((20..80).contains(&quiet), "{quiet}");
        assert_eq!(cell.log().matches(told).count(), quiet, "{word}");
    }
    let mut frozen = cell(&fault("frozen-values", ""));
    frozen.send(ASK);
    frozen.send(r#"{"reqType":"command","cmdData":["modifyGSPD","500"]}"#);
    assert_eq!(frozen.log().matches("answered with old values: fault frozen-values").count(), 1);
    let mut cell = cell(&fault("not-acknowledged", ""));
    cell.send(r#"{"reqType":"command","cmdData":["modifyGSPD","500"]}"#);
    assert_eq!(frames(&mut cell).len(), 0);
    assert!(cell.log().contains("not answered: fault not-acknowledged"));
    cell.send(ASK);
    assert!(!cell.log().contains("not answered"));
}
