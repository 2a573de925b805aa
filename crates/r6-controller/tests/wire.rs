//! The behaviour of a connection: acknowledgements, limits, silence, dialects, bad input.

mod common;

use common::{Cell, axis_move};
use r6_controller::{Profile, StartState};
use serde_json::json;

const STATUS: &str =
    r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"0","queryAddr":["curMode"]}"#;
const STATUS_REPLY: &str = r#"{"dsID":"www.hc-system.com.RemoteMonitor","packID":"0","queryAddr":["curMode"],"queryData":["7"],"reqType":"query"}"#;

/// An AddRCC frame of exactly this many bytes.
fn add_rcc_of(bytes: usize) -> String {
    let step = axis_move([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0).to_string();
    let head =
        r#"{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","emptyList":"1","instructions":["#;
    let frame = format!("{head}{step}]}}");
    format!("{head}{}{step}]}}", " ".repeat(bytes - frame.len()))
}

#[test]
fn captured_replies_come_back_byte_for_byte() {
    let mut cell =
        Cell::with(Profile::from_toml("version = \"HC-QC-RX-7.8.07-master-F5\"").unwrap(), StartState::Auto);
    assert_eq!(
        cell.ask(r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"0","queryAddr":["version","curMold"]}"#),
        r#"{"dsID":"www.hc-system.com.RemoteMonitor","packID":"0","queryAddr":["version","curMold"],"queryData":["HC-QC-RX-7.8.07-master-F5"],"reqType":"query"}"#
    );
    assert_eq!(
        cell.ask(r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","packID":"45","cmdData":["rewriteDataList","800","1","0","5"]}"#),
        r#"{"cmdReply":["rewriteDataList","ok"],"dsID":"www.hc-system.com.RemoteMonitor","packID":"45","reqType":"command"}"#
    );
    assert_eq!(
        cell.ask(r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","packID":"3","cmdData":["startButton"]}"#),
        r#"{"cmdReply":["startButton","ok"],"dsID":"www.hc-system.com.RemoteMonitor","packID":"3","reqType":"command"}"#
    );
    assert_eq!(
        cell.ask(r#"{"dsID":"www.hc-system.com.cam","reqType":"AddPoints","dsData":[{"camID":0,"data":[{"ModelID":0,"X":1.0,"Y":2.0,"Z":3.0,"U":0,"V":0,"Angel":4.0}]}]}"#),
        r#"{"cmdReply":["AddPoints","1"],"dsID":"www.hc-system.com.cam","reqType":"AddPoints"}"#
    );
}

#[test]
fn the_older_forms_are_echoed_as_sent() {
    let mut cell = Cell::new();
    assert_eq!(
        cell.ask(r#"{"cmdType":"query","dsID":"HCRemoteMonitor","queryAddr":["curMode"]}"#),
        r#"{"cmdType":"query","dsID":"HCRemoteMonitor","queryAddr":["curMode"],"queryData":["7"]}"#
    );
    // A numeric packID stays a number.
    assert!(cell.ask(r#"{"reqType":"query","packID":7,"queryAddr":["curMode"]}"#).contains(r#""packID":7,"#));
}

#[test]
fn the_manual_to_the_letter() {
    let mut host = Cell::with_profile("r6-host");
    assert_eq!(
        host.ask(r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryAddr":["version"]}"#),
        r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryData":["v1.1"]}"#
    );
    assert_eq!(
        host.ask(
            r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","cmdData":["startButton"]}"#
        ),
        r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","cmdReply":["startButton","ok"]}"#
    );
    assert_eq!(
        host.ask(
            r#"{"dsID":"www.hc-system.com.cam","reqType":"AddPoints","dsData":[{"camID":"0","data":[]}]}"#
        ),
        r#"{"dsID":"www.hc-system.com.cam","reqType":"command","cmdReply":["AddPoints","0"]}"#
    );
    assert_eq!(
        host.ask(r#"{"dsID":"HCRemoteCommand","reqType":"AddRCC","emptyList":"1","instructions":[]}"#),
        r#"{"dsID":"HCRemoteCommand","reqType":"command","cmdReply":["AddRCC","ok"]}"#
    );
}

#[test]
fn before_2_0_2_1() {
    // Both replies that were captured from unit E, from their test vectors.
    let captured = |vector: &str| -> String {
        let vector: serde_json::Value = serde_json::from_str(vector).unwrap();
        vector["frame"].as_str().unwrap().to_owned()
    };
    let mut legacy = Cell::with_profile("legacy");
    assert_eq!(
        legacy.ask(r#"{"dsID":"HCRemoteMonitor","cmdType":"query","queryAddr":["curMode","curMold"]}"#),
        r#"{"dsID":"HCRemoteMonitor","cmdType":"queryEcho","queryData":["7","remote"]}"#
    );
    assert_eq!(
        legacy
            .ask(r#"{"dsID":"HCRemoteMonitor","cmdType":"command","cmdData":["modifyOutput","0","1","1"]}"#),
        captured(include_str!("../../../vectors/messages/captured/captured_unit_e_cmd_echo.json"))
    );
    assert_eq!(
        legacy
            .ask(r#"{"dsID":"HCRemoteMonitor","cmdType":"command","cmdData":["modifyOutput","0","99","1"]}"#),
        r#"{"dsID":"HCRemoteMonitor","cmdType":"cmdEcho","cmdReply":["modifyOutput","err","`modifyOutput argument 2 (point)` is \"99\", but has to be a point from 0 to 31"]}"#
    );
}

#[test]
fn add_rcc_is_acknowledged_after_18_ms_and_queries_at_once() {
    let mut cell = Cell::new();
    cell.send(add_rcc_of(2048));
    assert_eq!(cell.frame(), None);
    // A query sent after it is answered before it.
    assert_eq!(cell.ask(STATUS), STATUS_REPLY);
    cell.pass(0.017_9);
    assert_eq!(cell.frame(), None);
    assert_eq!(cell.controller.next_transmit(cell.id).map(|due| due.as_nanos()), Some(18_000_000));
    cell.pass(0.000_1);
    assert_eq!(
        cell.frame().unwrap(),
        r#"{"cmdReply":["AddRCC","ok"],"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC"}"#
    );
}

#[test]
fn add_rcc_over_2048_bytes_is_neither_answered_nor_executed() {
    for bytes in [2049, 4096] {
        let mut cell = Cell::new();
        cell.send(add_rcc_of(bytes));
        cell.pass(8.0);
        assert_eq!(cell.frame(), None);
        assert!(!cell.controller.is_over(cell.id));
        assert_eq!(
            cell.query(&["isMoving", "RemoteCmdLen", "axis-0"]),
            [json!("0"), json!("0"), json!("0.000000")]
        );
        assert!(cell.log().contains("neither executed nor answered"));
    }
}

#[test]
fn add_rcc_over_4096_bytes_resets_the_connection() {
    let mut cell = Cell::new();
    cell.send(add_rcc_of(4097));
    assert!(cell.controller.is_over(cell.id));
    let other = cell.controller.connect(cell.now);
    cell.controller.handle_input(cell.now, other, STATUS.as_bytes());
    assert!(cell.controller.poll_transmit(cell.now, other).is_some(), "no other connection suffers");
    // A profile without the limit accepts it.
    let mut host = Cell::with_profile("r6-host");
    host.send(add_rcc_of(5000));
    assert!(host.frame().unwrap().contains("\"ok\""));
}

#[test]
fn a_ninth_connection_is_accepted_but_never_answered() {
    let mut cell = Cell::new();
    let more: Vec<_> = (0..8).map(|_| cell.controller.connect(cell.now)).collect();
    let ninth = more[7];
    for id in &more {
        cell.controller.handle_input(cell.now, *id, STATUS.as_bytes());
        let answered = cell.controller.poll_transmit(cell.now, *id).is_some();
        assert_eq!(answered, *id != ninth);
        assert!(!cell.controller.is_over(*id));
    }
    // It stays ignored when another one ends; a new connection is served again.
    cell.controller.disconnect(more[0]);
    cell.controller.handle_input(cell.now, ninth, STATUS.as_bytes());
    assert!(cell.controller.poll_transmit(cell.now, ninth).is_none());
    let tenth = cell.controller.connect(cell.now);
    cell.controller.handle_input(cell.now, tenth, STATUS.as_bytes());
    assert!(cell.controller.poll_transmit(cell.now, tenth).is_some());
}

#[test]
fn malformed_input_gets_silence_and_a_log_line() {
    let deep = format!("{{\"a\":{}1{}}}", "[".repeat(40), "]".repeat(40));
    let long = format!("{{\"a\":\"{}\"}}", "x".repeat(70_000));
    let cases: [(&[u8], &str); 9] = [
        (b"GET / HTTP/1.1\r\n\r\n", "no JSON object"),
        (br#"{"reqType":"query","queryAddr":["axis-0",]}"#, "a value was due at byte"),
        (br#"{"reqType":"query" "queryAddr":[]}"#, "was due at byte"),
        (br#"{"reqType":"query","queryAddr"}"#, "key `queryAddr` has no value"),
        (br#"{'reqType':'query'}"#, "double quotes"),
        (deep.as_bytes(), "deeper"),
        (long.as_bytes(), "longer"),
        (br#"{"dsID":"x"}"#, "neither `reqType`"),
        (br#"{"reqType":"heartbeat"}"#, "nearest: `heartbreak`"),
    ];
    for (bytes, reason) in cases {
        let mut cell = Cell::new();
        cell.send(bytes);
        assert_eq!(cell.frame(), None, "{reason}");
        let log = cell.log();
        assert!(log.contains(reason), "{log}");
        // This connection and all others are still served.
        assert_eq!(cell.ask(STATUS), STATUS_REPLY, "{reason}");
    }
}

#[test]
fn a_frame_that_is_cut_off_does_not_eat_the_next_for_ever() {
    let mut cell = Cell::new();
    cell.send(r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryAddr":["#);
    cell.pass(6.0);
    assert!(cell.log().contains("never ended"));
    assert_eq!(cell.ask(STATUS), STATUS_REPLY);
}

#[test]
fn wrong_fields_are_refused_as_far_as_the_protocol_lets_us() {
    let mut cell = Cell::new();
    cell.send(r#"{"reqType":"AddRCC","emptyList":"1","instructions":[{"oneshot":"1","action":"4","m0":"fast","speed":"10"}]}"#);
    cell.pass(0.018);
    assert!(cell.frame().unwrap().contains(r#"["AddRCC","err"]"#));
    assert!(cell.log().contains("`instructions[0].m0` is \"fast\", but has to be a finite number"));
    assert_eq!(cell.text("isMoving"), "0");
    let reply = cell.ask(r#"{"reqType":"command","cmdData":[]}"#);
    assert!(reply.contains(r#""err""#) && reply.contains("cmdData[0]"), "{reply}");
    let reply = cell.ask(r#"{"reqType":"query","queryAddr":"axis-0"}"#);
    assert!(reply.contains(r#""queryData":[]"#), "{reply}");
    cell.log();
    cell.query(&["axis0"]);
    assert!(cell.log().contains("nearest: `axis-n`"));
    cell.ask(r#"{"reqType":"query","queryAddrr":["x"],"queryAddr":["curMode"]}"#);
    assert!(cell.log().contains("`queryAddrr`: unknown key; nearest: `queryAddr`"));
}

#[test]
fn thousands_of_wrong_words_are_counted_not_explained() {
    let mut cell = Cell::new();
    let words = vec!["\"axis9\""; 5000].join(",");
    let reply = cell.ask(format!(r#"{{"dsID":"HCRemoteMonitor","reqType":"query","queryAddr":[{words}]}}"#));
    assert!(reply.contains(r#""queryData":[]"#));
    let log = cell.log();
    assert!(log.contains("and 4992 more of the kind"), "{log}");
    assert_eq!(log.lines().count(), 9);
}

#[test]
fn heartbreak_is_not_answered_and_arms_the_watchdog() {
    let mut cell = Cell::new();
    cell.pass(60.0);
    assert_eq!(cell.text("curAlarm"), "0", "without heartbreak there is no watchdog");
    cell.send(r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"heartbreak"}"#);
    assert_eq!(cell.frame(), None);
    cell.pass(9.9);
    cell.send(r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"heartbreak"}"#);
    cell.pass(9.9);
    assert_eq!(cell.text("curAlarm"), "0");
    cell.pass(0.2);
    assert_eq!(cell.text("curAlarm"), "9");
    // After it is cleared, it does not come again until another heartbreak is missed.
    cell.ok(&["clearAlarm"]);
    cell.pass(60.0);
    assert_eq!(cell.text("curAlarm"), "0");
    cell.send(r#"{"reqType":"heartbreak"}"#);
    cell.pass(10.1);
    assert_eq!(cell.text("curAlarm"), "9");
    let answering = Profile::from_toml("answers_heartbreak = true").unwrap();
    let mut cell = Cell::with(answering, StartState::Waiting);
    assert!(cell.ask(r#"{"reqType":"heartbreak"}"#).contains(r#"["heartbreak","ok"]"#));
}

#[test]
fn what_was_refused_is_not_called_carried_out() {
    let mut cell = Cell::new();
    cell.log();
    // Without `reqType` there is no answer (manual 5.2, 6): the log says what happened to the request.
    cell.send(r#"{"cmdData":["switchMold","nobody"]}"#);
    let log = cell.log();
    assert!(log.contains("command switchMold refused: there is no program `nobody`"), "{log}");
    assert!(log.contains("command without `reqType`: not answered") && !log.contains("carried out"), "{log}");
    cell.send(r#"{"cmdData":["modifyGSPD","50"]}"#);
    let log = cell.log();
    assert!(log.contains("command without `reqType`: carried out, not answered"), "{log}");
    assert!(log.contains("modifyGSPD 50"), "the arguments as they were sent: {log}");
}

#[test]
fn a_peer_cannot_forge_a_line_of_the_log() {
    let mut cell = Cell::new();
    cell.log();
    cell.send("{\"reqType\":\"command\",\"cmdData\":[\"x\\r\\nREADY\\u001b[2J\"]}");
    let log = cell.log();
    assert!(log.contains(r"x\r\nREADY\u{1b}[2J"), "{log}");
    assert!(!log.chars().any(|character| character.is_control() && character != '\n'), "{log:?}");
    assert!(!log.lines().any(|line| line.starts_with("READY")), "{log}");
}

#[test]
fn a_missed_heartbreak_stops_the_motion() {
    let mut cell = Cell::new();
    cell.send(r#"{"reqType":"heartbreak"}"#);
    cell.ok(&["modifyGSPD", "100"]);
    cell.run_ok(&json!([axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0)]));
    cell.pass(10.1);
    let rest = cell.number("axis-0");
    cell.pass(5.0);
    assert_eq!(cell.query(&["curAlarm", "isMoving"]), [json!("9"), json!("0")]);
    assert!(cell.number("axis-0") == rest && rest < 30.0);
}

#[test]
fn photo_goes_to_the_camera_else_to_all() {
    let photo = r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":0}"#;
    let mut cell = Cell::new();
    let other = cell.controller.connect(cell.now);
    cell.controller.request_photo(cell.now, 0);
    assert_eq!(cell.frame().as_deref(), Some(photo), "captured, unit D, byte for byte");
    assert_eq!(cell.controller.poll_transmit(cell.now, other), Some(photo.as_bytes()));
    assert!(cell.controller.poll_woken().is_some());
    cell.controller.handle_input(
        cell.now,
        other,
        br#"{"dsID":"www.hc-system.com.cam", "reqType":"photo","camID":0,"ret":1}"#,
    );
    cell.controller.request_photo(cell.now, 3);
    assert_eq!(cell.frame(), None);
    assert!(cell.controller.poll_transmit(cell.now, other).is_some());
    // When the camera disconnects, all connections are asked again.
    cell.controller.disconnect(other);
    cell.controller.request_photo(cell.now, 0);
    assert!(cell.frame().is_some());
}

#[test]
fn points_are_taken_and_counted() {
    let mut cell = Cell::new();
    let points = r_points();
    assert!(cell.ask(points).contains(r#"["AddPoints","2"]"#));
    let taken: Vec<_> = cell.controller.machine().points().copied().collect();
    assert_eq!(taken.len(), 2);
    assert_eq!((taken[1].0, taken[1].1.x, taken[1].1.angle), (0, 888.001, Some(124.123)));
    // Without reqType the points are taken, but not answered (manual 5.2).
    cell.send(r#"{"dsID":"www.hc-system.com.cam","dsData":[{"camID":1,"data":[{"X":1,"Y":2}]}]}"#);
    assert_eq!(cell.frame(), None);
    assert_eq!(cell.controller.machine().points().len(), 3);
}

fn r_points() -> Vec<u8> {
    r6_testkit::vector::load("manual_8_3_add_points").frame
}

#[test]
fn every_ending_and_any_piece_is_understood() {
    // What existing clients together need: nothing, \n, \r\n or NUL at the end; several requests in one
    // segment; one request in pieces; blanks; duplicate keys; unknown keys; numbers where texts are
    // documented.
    for ending in ["", "\n", "\r\n", "\0", " ", "\u{feff}"] {
        let mut cell = Cell::new();
        assert_eq!(cell.ask(format!("{STATUS}{ending}")), STATUS_REPLY);
        assert_eq!(cell.ask(STATUS), STATUS_REPLY);
    }
    let mut cell = Cell::new();
    cell.send(format!("{STATUS}{STATUS}\n{STATUS}"));
    assert_eq!(
        [cell.frame(), cell.frame(), cell.frame()].map(Option::unwrap),
        [STATUS_REPLY; 3],
        "one frame each"
    );
    for byte in STATUS.as_bytes() {
        assert_eq!(cell.frame(), None);
        cell.send([*byte]);
    }
    assert_eq!(cell.frame().unwrap(), STATUS_REPLY);
    let odd = r#"{ "reqType" : "command" , "reqType" : "query", "spare" : [1,{"a":2}], "queryAddr" : [ "curMode" ] }"#;
    assert!(cell.ask(odd).contains(r#""queryData":["7"]"#));
    let numbers = r#"{"reqType":"AddRCC","emptyList":1,"instructions":[{"oneshot":1,"action":4,"m0":10,"ckStatus":63,"speed":50,"delay":0,"smooth":0}]}"#;
    cell.send(numbers);
    assert_eq!(cell.text("isMoving"), "1");
}

#[test]
fn a_controller_that_nobody_asks_has_no_deadline() {
    let mut cell = Cell::new();
    assert_eq!(cell.controller.poll_timeout(), None);
    cell.ask(STATUS);
    assert_eq!(cell.controller.poll_timeout(), None);
    cell.run_ok(&json!([axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]));
    assert!(cell.controller.poll_timeout().is_some());
    cell.pass(10.0);
    assert_eq!(cell.controller.poll_timeout(), None);
}
