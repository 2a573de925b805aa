//! The log of `r6`, which goes to stderr.

use std::io::BufRead;

use serde_json::{Value, json};

use crate::support::{Robot, Running, shell};

/// A gateway whose robot cannot be reached, which it logs at once.
const UNREACHED: [&str; 6] = ["gateway", "--listen", "127.0.0.1:0", "--robot", "press=127.0.0.1:1", "--data"];

#[test]
fn a_gateway_logs_an_object_of_json_a_line_if_the_environment_asks_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data").display().to_string();
    let args = [&UNREACHED[..], &[data.as_str()]].concat();
    let mut gateway = Running::start_with_variable("R6_LOG_FORMAT", "json", &args);
    let mut lines = gateway.close_stdin().lines().map(Result::unwrap);
    let logged = lines.find(|line| line.contains("no connection yet")).unwrap();
    let logged: Value = serde_json::from_str(&logged).unwrap();
    let told = ["level", "target", "robot", "address"].map(|key| &logged[key]);
    assert_eq!(
        told,
        [&json!("WARN"), &json!("r6_gateway::fleet::link"), &json!("press"), &json!("127.0.0.1:1")]
    );
    assert!(
        logged["timestamp"].is_string() && logged["error"].as_str().unwrap().contains("cannot be reached")
    );
}

#[test]
fn a_format_of_the_log_that_is_not_there_is_refused() {
    let outcome = shell("R6_LOG_FORMAT=xml \"$R6\" gateway --listen 127.0.0.1:0 --data /nonexistent/r6", &[]);
    assert_eq!(outcome.code, 2, "{outcome:?}");
    assert!(outcome.err.contains("R6_LOG_FORMAT is `xml`, but has to be text or json"), "{outcome:?}");
    // A stop is sent all the same.
    let robot = Robot::start(&[]);
    let outcome = shell("R6_LOG_FORMAT=xml \"$R6\" -r \"$1\" stop", &[robot.address()]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
}
