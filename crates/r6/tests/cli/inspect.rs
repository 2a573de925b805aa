//! `r6 inspect` on captured traffic.

use crate::support::{r6, r6_with_input};

const GOOD: &str = r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"1","queryAddr":["version","axis-0"]}"#;

#[test]
fn right_traffic_is_code_0() {
    let outcome = r6_with_input(&["inspect", "-"], format!("{GOOD}{GOOD}").as_bytes());
    assert_eq!(outcome.code, 0, "{outcome:?}");
    insta::assert_snapshot!(outcome.out, @r"
    #1 line 1 offset 0  PC → controller  query: version, axis-0
    #2 line 1 offset 106  PC → controller  query: version, axis-0
    2 frames (2 query); nothing wrong
    ");
}

#[test]
fn a_log_full_of_mistakes_names_the_right_words() {
    let log = [
        r#"10:00:00 TX {"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryAddrr":["version"]}"#,
        r#"10:00:01 TX {"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryAddr":["curAlrm","axis-9"]}"#,
        r#"10:00:02 TX {"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","cmdData":["clearAlarmAndContinue"]}"#,
        r#"10:00:03 TX {"dsID":"www.hc-system.com.RemoteMonitor","reqType":"heartbeat"}"#,
        r#"10:00:04 TX {"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","instructions":[{"action":"4","ckStatus", "speed":"80"}"#,
        r#"10:00:05 RX {"cmdReply":["startButton","err","alarm"],"dsID":"www.hc-system.com.RemoteMonitor","packID":"3","reqType":"command"}"#,
        r#"10:00:06 RX {"dsID":"www.hc-system.com.RemoteMonitor","packID":"0","queryAddr":["version","curMold"],"queryData":["HC-QC"],"reqType":"query"}"#,
        r"10:00:07 {'dsID': 'HCRemoteMonitor', 'cmdType': 'queryEcho'}",
    ]
    .join("\n");
    let outcome = r6_with_input(&["inspect", "-"], log.as_bytes());
    assert_eq!(outcome.code, 1);
    insta::assert_snapshot!(outcome.out);
    let json = r6_with_input(&["inspect", "-", "--json", "--problems"], log.as_bytes()).json();
    assert_eq!(json["frame_count"], 8);
    assert_eq!(json["frames"].as_array().map(Vec::len), Some(7));
    assert_eq!(json["counts"]["broken frame"], 1);
}

#[test]
fn a_transcript_is_read_on_both_sides() {
    let outcome = r6(&["inspect", "vectors/transcripts/photo_between_query_and_reply.jsonl"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    let directions: Vec<_> = outcome.out.lines().filter_map(|line| line.split("  ").nth(1)).collect();
    assert_eq!(directions, ["PC → controller", "controller → PC", "controller → PC", "PC → controller"]);
    // In this capture the controller leaves out the addresses that it does not know.
    let outcome = r6(&["inspect", "vectors/transcripts/connect_and_query.jsonl", "--problems"]);
    assert_eq!(outcome.code, 1);
    assert!(outcome.out.contains("2 addresses were asked for and 1 values came"), "{}", outcome.out);
    assert!(outcome.out.contains("7 addresses were asked for and 3 values came"), "{}", outcome.out);
}

#[test]
fn every_captured_and_printed_frame_is_taken_apart() {
    for vector in r6_testkit::vector::all() {
        let Some(frame) = vector.decodable() else { continue };
        let outcome = r6_with_input(&["inspect", "-", "--json"], frame);
        let json = outcome.json();
        assert_eq!(json["frame_count"], 1, "{}: {json}", vector.stem);
        assert_eq!(json["other_bytes"], 0, "{}: {json}", vector.stem);
        assert!(matches!(outcome.code, 0 | 1), "{}", vector.stem);
    }
}

#[test]
fn nothing_and_noise_are_no_frames() {
    let outcome = r6_with_input(&["inspect", "-"], b"");
    assert_eq!((outcome.code, outcome.out.as_str()), (0, "no frame; nothing wrong\n"));
    let outcome = r6_with_input(&["inspect", "-"], b"GET / HTTP/1.1\r\n\r\n");
    assert_eq!(
        (outcome.code, outcome.out.as_str()),
        (0, "no frame; nothing wrong; 12 bytes of other text\n")
    );
    assert_eq!(r6(&["inspect", "no/such/file"]).code, 2);
}
