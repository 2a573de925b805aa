//! A controller with all its connections in use: it accepts another one and never answers on it.

use std::net::TcpListener;

use serde_json::Value;

use crate::support::{Outcome, Robot, Running, TempFile, r6};

const CLOSE_OTHERS: &str = "other programs may hold all the connections of the controller: close them";

fn says_so(args: &[&str], outcome: &Outcome) {
    assert!(outcome.err.contains(CLOSE_OTHERS), "{args:?}: {outcome:?}");
    assert!(
        !outcome.err.contains("ask again") && !outcome.err.contains("send it again"),
        "{args:?}: {outcome:?}"
    );
}

#[test]
fn where_nothing_ever_answered_the_others_have_to_be_closed() {
    let profile = TempFile::new("one.toml", "base = \"hc1\"\nname = \"one\"\nmax_connections = 1\n");
    let robot = Robot::start(&["--profile", profile.path()]);
    let mut watching = Running::start(&["-r", robot.address(), "watch", "axis-0", "--every", "100ms"]);
    assert_eq!(watching.line(), "time  axis-0 [deg or mm]");
    for (args, code) in [
        (&["status"][..], 3),
        (&["query", "axis-0"], 3),
        (&["watch", "axis-0", "--times", "1"], 3),
        (&["move", "axes", "1", "--wait"], 3),
        (&["command", "startButton"], 3),
        (&["stop"], 4),
    ] {
        let outcome = robot.r6(args);
        assert_eq!(outcome.code, code, "{args:?}: {outcome:?}");
        says_so(args, &outcome);
    }
    let found = r6(&["discover", robot.address()]);
    assert!(found.code == 3 && found.out.contains(CLOSE_OTHERS), "{found:?}");
    let stop = robot.r6(&["stop", "--json"]);
    let problem: Value = stop.json();
    assert_eq!(problem["code"], "not_stopped", "{problem}");
    assert!(problem["advice"].as_str().unwrap().contains(CLOSE_OTHERS), "{problem}");
    assert!(problem["message"].as_str().unwrap().contains("use the emergency stop"), "{problem}");
}

/// A controller that answered before is not full, so the advice about other programs is missing.
#[test]
fn where_something_answered_nothing_is_said_of_others() {
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["query", "axis-9"]);
    assert!(!outcome.err.contains(CLOSE_OTHERS), "{outcome:?}");
    // The connection itself is refused.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    drop(listener);
    let outcome = r6(&["-r", &address, "status"]);
    assert!(!outcome.err.contains(CLOSE_OTHERS), "{outcome:?}");
}
