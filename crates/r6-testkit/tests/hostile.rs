//! Tests of each misbehaviour, as seen on the wire.

use std::time::Duration;

use r6_testkit::hostile::{Arm, Character, Did};
use serde_json::{Value, json};

/// A client of the core. Everything that it sends arrives at once.
struct Wire {
    arm: Arm,
    now: Duration,
    pack: u32,
}

fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

impl Wire {
    fn to(character: Value) -> Self {
        let character: Character = serde_json::from_value(character).expect("a character");
        let mut arm = Arm::new(character);
        assert_eq!(arm.open(Duration::ZERO), Some(1));
        Self { arm, now: Duration::ZERO, pack: 0 }
    }

    /// Lets time pass.
    fn pass(&mut self, milliseconds: u64) -> Vec<String> {
        self.now += ms(milliseconds);
        self.take(1)
    }

    fn take(&mut self, connection: u32) -> Vec<String> {
        let sent = self.arm.poll(self.now, connection).frames;
        sent.into_iter().map(|frame| String::from_utf8(frame).unwrap()).collect()
    }

    fn send(&mut self, connection: u32, frame: Value) {
        self.arm.receive(self.now, connection, frame.to_string().as_bytes());
    }

    /// The values of a query on the first connection, 20 ms later; `null` without a reply.
    fn ask(&mut self, addresses: &[&str]) -> Value {
        self.pack += 1;
        let pack = self.pack.to_string();
        self.send(1, json!({ "dsID": "d", "reqType": "query", "packID": pack, "queryAddr": addresses }));
        let replies = self.pass(20);
        let read = |text: &String| serde_json::from_str::<Value>(text).unwrap();
        replies.iter().map(read).find(|reply| reply["packID"] == pack.as_str()).unwrap_or_default()["queryData"].take()
    }

    fn command(&mut self, word: &str) -> Vec<String> {
        self.send(1, json!({ "dsID": "d", "reqType": "command", "packID": "c", "cmdData": [word] }));
        self.pass(20)
    }

    fn list(&mut self, replace: bool, instructions: &Value) -> Vec<String> {
        let empty = if replace { "1" } else { "0" };
        self.send(1, json!({
            "dsID": "d", "reqType": "AddRCC", "packID": "l", "emptyList": empty, "instructions": instructions,
        }));
        self.pass(20)
    }

    fn j1(&self) -> f64 {
        self.arm.position_at(1, self.now)[0]
    }
}

/// An axis move of J1.
fn to(degrees: f64) -> Value {
    json!({ "oneshot": "1", "action": "4", "m0": degrees.to_string(), "ckStatus": "0x01", "smooth": "0" })
}

const OK: &str = r#"{"cmdReply":["AddRCC","ok"],"dsID":"d","packID":"l","reqType":"AddRCC"}"#;
const ERR: &str = r#"{"cmdReply":["AddRCC","err"],"dsID":"d","packID":"l","reqType":"AddRCC"}"#;

#[test]
fn replies_have_the_captured_form_and_drop_what_is_unknown() {
    let mut wire = Wire::to(json!({}));
    wire.send(1, json!({ "dsID": "d", "reqType": "query", "packID": "9", "queryAddr": ["version", "curMold", "world-0"] }));
    assert_eq!(wire.pass(17), Vec::<String>::new());
    let reply = r#"{"dsID":"d","packID":"9","queryAddr":["version","curMold","world-0"],"queryData":["HC-QC-RX-7.8.07-master-F5.2.1","500.000000"],"reqType":"query"}"#;
    assert_eq!(wire.pass(1), [reply]);
    assert_eq!(
        wire.command("startButton"),
        [r#"{"cmdReply":["startButton","ok"],"dsID":"d","packID":"c","reqType":"command"}"#]
    );
}

#[test]
fn frames_may_come_in_pieces_and_rubbish_ends_the_connection() {
    let mut wire = Wire::to(json!({}));
    let frame = json!({ "reqType": "query", "queryAddr": ["curMode"] }).to_string();
    let (head, tail) = frame.split_at(7);
    wire.arm.receive(wire.now, 1, head.as_bytes());
    assert!(wire.pass(20).is_empty());
    wire.arm.receive(wire.now, 1, tail.as_bytes());
    assert_eq!(wire.pass(20).len(), 1);
    wire.arm.receive(wire.now, 1, b"]");
    assert!(wire.arm.poll(wire.now, 1).ended);
}

#[test]
fn a_list_is_carried_out_step_by_step() {
    let mut wire = Wire::to(json!({}));
    assert_eq!(wire.list(true, &json!([to(30.0), to(0.0)])), [OK]);
    assert_eq!(wire.ask(&["isMoving", "RemoteCmdLen", "curMode"]), json!(["1", "2", "7"]));
    wire.pass(480);
    assert!((wire.j1() - 15.6).abs() < 1e-9, "{}", wire.j1());
    wire.pass(600);
    assert_eq!(wire.ask(&["isMoving", "RemoteCmdLen"]), json!(["1", "1"]));
    wire.pass(1000);
    assert_eq!(wire.ask(&["isMoving", "RemoteCmdLen", "axis-0"]), json!(["0", "0", "0.000000"]));
    assert_eq!(wire.arm.carried(1).iter().filter(|step| step.whole).count(), 2);
    assert!((wire.arm.path_since(1, Duration::ZERO)[0] - 60.0).abs() < 1e-9);
}

#[test]
fn it_dwells_and_may_say_that_its_list_is_empty_meanwhile() {
    for (lie, told) in [(false, "1"), (true, "0")] {
        let mut wire = Wire::to(json!({ "dwell": 0.3, "dwell_told_empty": lie }));
        wire.list(true, &json!([to(30.0), to(0.0)]));
        wire.pass(1100);
        assert_eq!(wire.ask(&["isMoving", "RemoteCmdLen", "axis-0"]), json!(["0", told, "30.000000"]));
        wire.pass(500);
        assert_eq!(wire.ask(&["isMoving", "RemoteCmdLen"]), json!(["1", "1"]));
    }
}

#[test]
fn the_length_of_the_list_may_be_absent_or_a_lie() {
    for (word, told) in [("absent", json!([])), ("zero", json!(["0"])), ("true", json!(["1"]))] {
        let mut wire = Wire::to(json!({ "list_length": word }));
        wire.list(true, &json!([to(30.0)]));
        assert_eq!(wire.ask(&["RemoteCmdLen"]), told, "{word}");
    }
}

#[test]
fn a_stop_works_after_its_time_and_leaves_mode_alarm_and_list() {
    let mut wire = Wire::to(json!({}));
    wire.list(true, &json!([to(30.0), to(0.0)]));
    wire.pass(480);
    let asked = wire.now;
    wire.command("actionStop");
    wire.pass(480);
    let path = wire.arm.path_since(1, asked)[0];
    assert!((path - 2.4).abs() < 1e-9, "80 ms at 30 degrees a second: {path}");
    assert_eq!(wire.ask(&["curMode", "curAlarm", "isMoving", "RemoteCmdLen"]), json!(["3", "42", "0", "2"]));
    assert!(!wire.arm.carried(1)[0].whole);
    assert_eq!(wire.list(false, &json!([to(1.0)])), [ERR], "not in mode 3");
    wire.command("clearAlarm");
    wire.command("startButton");
    assert_eq!(wire.ask(&["curMode", "isMoving"]), json!(["7", "1"]), "what is left runs at the next start");
}

#[test]
fn each_effect_of_a_stop_is_what_it_says() {
    for (effect, answer, stops) in [
        ("works", Some("ok"), true),
        ("no-effect", Some("ok"), false),
        ("refused", Some("err"), false),
        ("refused-but-works", Some("err"), true),
        ("works-unanswered", None, true),
        ("lost", None, false),
    ] {
        for (means, word) in
            [("action_stop", "actionStop"), ("stop_button", "stopButton"), ("action_pause", "actionPause")]
        {
            let mut wire =
                Wire::to(json!({ "stops": { means: { "effect": effect, "mode": 9, "alarm": 5 } } }));
            wire.list(true, &json!([to(90.0)]));
            let replies = wire.command(word);
            let told = replies
                .first()
                .map(|reply| serde_json::from_str::<Value>(reply).unwrap()["cmdReply"][1].clone());
            assert_eq!(told, answer.map(Value::from), "{effect} {word}");
            let since = wire.now;
            wire.pass(500);
            assert_eq!(wire.arm.path_since(1, since)[0] == 0.0, stops, "{effect} {word}");
            let mode = if effect == "lost" { "7" } else { "9" };
            assert_eq!(wire.ask(&["curMode"]), json!([mode]), "{effect} {word}");
        }
    }
}

#[test]
fn a_clear_drops_what_waits_or_nothing() {
    for (effect, left) in [("works", "1"), ("no-effect", "3"), ("refused", "3"), ("works-unanswered", "1")] {
        let mut wire = Wire::to(json!({ "stops": { "clear": { "effect": effect } } }));
        wire.list(true, &json!([to(30.0), to(0.0), to(10.0)]));
        wire.list(true, &json!([]));
        assert_eq!(wire.ask(&["RemoteCmdLen"]), json!([left]), "{effect}");
    }
}

#[test]
fn replies_are_late_by_their_kind() {
    let mut wire = Wire::to(json!({ "delays": { "command": 0.3 } }));
    assert_eq!(wire.command("startButton").len(), 0);
    assert_eq!(wire.ask(&["curMode"]), json!(["7"]));
    assert_eq!(wire.pass(260).len(), 1);
}

#[test]
fn a_deaf_connection_takes_bytes_and_answers_nothing() {
    let mut wire = Wire::to(json!({ "deaf": [{ "connection": 1, "at": 1.0, "lasts": 2.0 }] }));
    assert_eq!(wire.ask(&["curMode"]), json!(["7"]));
    wire.pass(1000);
    wire.list(true, &json!([to(90.0)]));
    assert_eq!(wire.ask(&["curMode"]), Value::Null);
    assert_eq!(wire.arm.open(wire.now), Some(2));
    wire.send(2, json!({ "reqType": "query", "queryAddr": ["isMoving"] }));
    wire.now += ms(20);
    assert_eq!(wire.take(2), [r#"{"queryAddr":["isMoving"],"queryData":["0"],"reqType":"query"}"#]);
    assert_eq!(wire.arm.log().iter().filter(|entry| entry.did == Did::NotHeard).count(), 2);
    wire.pass(2000);
    assert_eq!(wire.ask(&["curMode"]), json!(["7"]));
}

#[test]
fn a_deaf_connection_may_obey() {
    let mut wire = Wire::to(json!({ "deaf": [{ "obeys": true }] }));
    assert!(wire.list(true, &json!([to(90.0)])).is_empty());
    wire.pass(1000);
    assert!(wire.j1() > 20.0);
}

#[test]
fn the_answer_with_a_number_is_lost_and_its_request_carried_out() {
    let mut wire = Wire::to(json!({ "lost": [{ "kind": "list", "nth": 2 }] }));
    assert_eq!(wire.list(false, &json!([to(10.0)])), [OK]);
    assert!(wire.list(false, &json!([to(20.0)])).is_empty());
    assert_eq!(wire.list(false, &json!([to(30.0)])), [OK]);
    assert_eq!(wire.arm.list_length(1), 3);
}

#[test]
fn a_list_may_be_taken_late_and_answered_never() {
    let mut wire = Wire::to(json!({ "late": [{ "nth": 1, "taken_after": 1.0 }] }));
    assert!(wire.list(true, &json!([to(30.0)])).is_empty());
    wire.list(true, &json!([]));
    assert_eq!(wire.ask(&["isMoving", "RemoteCmdLen"]), json!(["0", "0"]));
    wire.pass(1000);
    assert_eq!(
        wire.ask(&["isMoving", "RemoteCmdLen"]),
        json!(["1", "1"]),
        "it runs although it was cleared before"
    );
}

#[test]
fn instructions_are_answered_ok_and_never_carried_out() {
    let with_tool = json!({ "action": "10", "m0": "510", "ckStatus": "0x01", "tool": "1" });
    let workbench = json!({ "action": "800", "cnt_id": "1" });
    for (word, list, left) in [
        ("always", json!([to(9.0), to(8.0)]), "0"),
        ("with-tool", json!([to(9.0), with_tool]), "1"),
        ("after-workbench", json!([to(9.0), to(8.0), workbench, to(7.0)]), "2"),
    ] {
        let mut wire = Wire::to(json!({ "never_executed": word }));
        assert_eq!(wire.list(true, &list), [OK], "{word}");
        assert_eq!(wire.ask(&["RemoteCmdLen"]), json!([left]), "{word}");
    }
}

#[test]
fn other_clients_clear_and_append() {
    let mut wire = Wire::to(json!({ "foreign": [
        { "at": 0.5, "replace": true },
        { "at": 1.5, "instructions": [to(0.0)] },
    ] }));
    wire.list(true, &json!([to(30.0), to(60.0)]));
    wire.pass(1000);
    assert_eq!(wire.ask(&["RemoteCmdLen", "axis-0"]), json!(["0", "30.000000"]));
    wire.pass(1600);
    assert_eq!(wire.j1(), 0.0);
}

#[test]
fn another_robot_answers_at_a_time_or_from_a_connection_on() {
    let five = json!({ "name": "cell 5", "axes": [7, 0, 0, 0, 0, 0, 0, 0] });
    let mut wire = Wire::to(json!({ "swap": { "when": { "at": 1.0 }, "to": five } }));
    wire.list(true, &json!([to(90.0)]));
    wire.pass(1000);
    assert!(wire.arm.poll(wire.now, 1).ended);
    let before = wire.j1();
    wire.pass(500);
    assert!(wire.j1() > before, "the first robot goes on");
    let mut wire = Wire::to(json!({ "swap": { "when": { "at": 1.0 }, "links": "carried", "to": five } }));
    wire.pass(1000);
    assert_eq!(wire.ask(&["machineName", "axis-0"]), json!(["cell 5", "7.000000"]));
    let mut wire = Wire::to(json!({ "swap": { "when": { "connection": 2 }, "to": five } }));
    wire.arm.open(wire.now);
    assert_eq!(wire.ask(&["machineName"]), json!(["cell 4"]));
    wire.send(2, json!({ "reqType": "query", "queryAddr": ["machineName"] }));
    wire.now += ms(20);
    assert!(wire.take(2)[0].contains("cell 5"));
}

#[test]
fn a_reboot_ends_connections_and_motion_and_keeps_the_place() {
    let mut wire = Wire::to(json!({ "reboot": { "at": 0.5, "away": 1.0, "alarm": 9 } }));
    wire.list(true, &json!([to(30.0)]));
    wire.pass(980);
    assert_eq!((wire.j1(), wire.arm.list_length(1)), (15.0, 0));
    assert!(wire.arm.poll(wire.now, 1).ended);
    assert_eq!(wire.arm.open(wire.now), None);
    wire.now += ms(500);
    assert_eq!(wire.arm.open(wire.now), Some(2));
    wire.send(2, json!({ "reqType": "query", "queryAddr": ["machineName", "curMode", "origin", "curAlarm", "axis-0"] }));
    wire.now += ms(20);
    assert!(wire.take(2)[0].contains(r#"["cell 4","3","0","9","15.000000"]"#));
}

#[test]
fn a_taught_program_waits_without_motion_and_goes_on() {
    let wait = json!({ "action": "100", "type": "100", "limit": "2.0" });
    let mut wire = Wire::to(json!({ "program": { "steps": [to(30.0), wait, to(0.0)] } }));
    wire.pass(1500);
    assert_eq!(wire.ask(&["isMoving", "curMode", "RemoteCmdLen"]), json!(["0", "7", "0"]));
    wire.pass(2000);
    assert_eq!(wire.ask(&["isMoving", "curMode", "RemoteCmdLen"]), json!(["1", "7", "0"]));
}

#[test]
fn in_mode_2_a_list_is_refused_or_arms_the_controller() {
    for (arms_itself, answer, mode) in [(false, ERR, "2"), (true, OK, "7")] {
        let mut wire = Wire::to(json!({ "cabinet": { "mode": 2 }, "arms_itself": arms_itself }));
        assert_eq!(wire.list(true, &json!([to(30.0)])), [answer]);
        assert_eq!(wire.ask(&["curMode"]), json!([mode]));
    }
}

#[test]
fn steps_that_are_not_one_shot_come_again_without_holding_time_up() {
    let mut wire = Wire::to(json!({}));
    let still = json!({ "oneshot": "0", "action": "4", "m0": "0", "ckStatus": "0x01" });
    wire.list(true, &json!([still]));
    wire.pass(1000);
    assert!(wire.arm.carried(1).len() > 900);
    assert_eq!(wire.ask(&["RemoteCmdLen"]), json!(["1"]));
}

#[test]
fn an_unknown_member_of_a_character_is_an_error() {
    serde_json::from_value::<Character>(json!({ "dwel": 1.0 })).unwrap_err();
    serde_json::from_value::<Character>(json!({ "dwell": -1.0 })).unwrap_err();
}
