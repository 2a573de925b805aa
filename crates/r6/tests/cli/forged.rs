//! Text of peers that tries to begin a new line or to control the terminal.

use std::io::Write;
use std::net::TcpStream;

use r6_controller::Profile;
use r6_sim::Clock;

use crate::streaming::Cell;
use crate::support::{Outcome, Running, r6, r6_with_input};

/// The text that a peer sends about itself.
const FORGED: &str = "v1\r\nREADY\u{1b}[2J\u{9b}1A";

/// The same text as r6 shows it.
const SHOWN: &str = r"v1\r\nREADY\u{1b}[2J\u{9b}1A";

/// Checks that no line begins with the forged word, and that no control character is left.
fn is_honest(outcome: &Outcome) {
    for text in [&outcome.out, &outcome.err] {
        assert!(!text.lines().any(|line| line.starts_with("READY")), "{outcome:?}");
        assert!(!text.chars().any(|c| c.is_control() && c != '\n'), "{outcome:?}");
    }
}

#[test]
fn a_controller_cannot_forge_a_line() {
    let profile = Profile { version: FORGED.to_owned(), ..Profile::hc1() };
    let cell = Cell::with(profile, Clock::AsFastAsPossible, "");
    let not_there = format!("no{FORGED}");
    for (args, code) in [
        (&["query", "version"][..], 0),
        (&["watch", "version", "--times", "2", "--every", "1ms"], 0),
        // The reason quotes what was asked for.
        (&["command", "switchMold", &not_there], 1),
    ] {
        let outcome = cell.r6(args);
        assert_eq!(outcome.code, code, "{args:?}: {outcome:?}");
        assert!(format!("{}{}", outcome.out, outcome.err).contains(SHOWN), "{args:?}: {outcome:?}");
        is_honest(&outcome);
    }
    let found = r6(&["discover", &cell.address]);
    assert!(found.code == 0 && found.out.contains(SHOWN), "{found:?}");
    is_honest(&found);
    let status = cell.r6(&["status"]);
    assert!(status.out.contains(&format!("firmware {SHOWN}, at ")), "{status:?}");
    assert_eq!(status.out.matches("\nREADY").count(), 0, "the controller's, not its own: {status:?}");
    assert_eq!(status.out.matches("\nUNKNOWN").count(), 1, "its own: {status:?}");
    // Programs get the unchanged text.
    let json = cell.r6(&["query", "version", "--json"]);
    assert_eq!(json.json()["values"]["version"], FORGED);
    is_honest(&json);
    let refused = cell.r6(&["command", "switchMold", &not_there, "--json"]);
    assert!(refused.json()["message"].as_str().unwrap().contains(SHOWN), "{refused:?}");
    // The same for logs.
    let log = cell.r6(&["-vvv", "query", "version"]);
    assert!(log.err.contains("received"), "{log:?}");
    is_honest(&log);
}

#[test]
fn a_client_cannot_forge_a_line_of_the_simulation() {
    let mut sim = Running::start(&["sim", "--listen", "127.0.0.1:0"]);
    let line = sim.line();
    let mut client = TcpStream::connect(line.strip_prefix("listening on ").unwrap()).unwrap();
    let word = serde_json::json!(FORGED);
    write!(client, "{{\"reqType\":\"command\",\"cmdData\":[{word}]}}").unwrap();
    let line = std::iter::repeat_with(|| sim.line()).take(100).find(|line| line.contains("unknown command"));
    let line = line.expect("a line of the log");
    assert!(line.contains(SHOWN) && !line.chars().any(char::is_control), "{line:?}");
}

#[test]
fn a_capture_cannot_forge_a_line() {
    let word = serde_json::json!(FORGED);
    let capture = format!(
        "{{\"reqType\":\"command\",\"packID\":\"1\",\"cmdReply\":[\"actionStop\",\"err\",{word}]}}\n\
         {{\"reqType\":\"query\",\"packID\":\"2\",\"queryAddr\":[{word}],{word}:1}}"
    );
    let outcome = r6_with_input(&["inspect", "-"], capture.as_bytes());
    assert_eq!(outcome.code, 1, "{outcome:?}");
    assert!(outcome.out.contains(&format!("note: refused: {SHOWN}")), "{outcome:?}");
    assert!(outcome.out.contains(&format!("problem: `{SHOWN}` is no query address")), "{outcome:?}");
    is_honest(&outcome);
    is_honest(&r6(&["discover", "a\u{1b}[2J b"]));
}
