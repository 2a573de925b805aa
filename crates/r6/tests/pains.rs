//! A problem of users that the command line solves, by its number in docs/PAINS.md.

use std::io::Write;
use std::process::{Command, Stdio};

/// Words that were sent to real controllers, and the words that were meant.
const GUESSES: [(&str, &str); 6] = [
    (r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryAddrr":["version"]}"#, "queryAddr"),
    (
        r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","cmdData":["modifyStack","0"]}"#,
        "modifyStackData",
    ),
    (
        r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","cmdData":["clearAlarmAndContinue"]}"#,
        "clearAlarmContinue",
    ),
    (r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"heartbeat"}"#, "heartbreak"),
    (r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryAddr":["curAlrm"]}"#, "curAlarm"),
    (r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"actionStop"}"#, "command"),
];

fn inspect(traffic: &str) -> (Option<i32>, String) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_r6"))
        .args(["inspect", "-"])
        .env_remove("RUST_LOG")
        .env_remove("R6_LOG_FORMAT")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(traffic.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    (output.status.code(), String::from_utf8(output.stdout).unwrap())
}

#[test]
fn pain_13_a_guessed_word_is_named_with_the_right_one() {
    for (frame, meant) in GUESSES {
        let (code, told) = inspect(frame);
        assert_eq!(code, Some(1), "{frame}\n{told}");
        assert!(told.contains(meant), "{frame} was told as\n{told}");
    }
    let right = r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryAddr":["version"]}"#;
    assert_eq!(inspect(right).0, Some(0), "what is right is not complained of");
}
