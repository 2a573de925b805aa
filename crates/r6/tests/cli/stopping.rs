//! Signals during `r6 stop`: the first one does not interrupt a stop.

use std::sync::Arc;
use std::time::Duration;

use r6_testkit::hostile::serve::HostileController;
use r6_testkit::hostile::{Character, Effect, Program, Reaction, Stops};
use serde_json::json;

use crate::support::{Running, hostile};

/// A controller with a program that keeps moving the arm: `actionStop` and `stopButton` have no effect, so
/// that a stop takes more than a second.
fn stubborn() -> (String, Arc<HostileController>) {
    let no_effect = Reaction { effect: Effect::NoEffect, ..Reaction::default() };
    let stops = Stops { action_stop: no_effect, stop_button: no_effect, ..Stops::default() };
    let step =
        |j1: &str| json!({ "oneshot": "0", "action": "4", "m0": j1, "ckStatus": "0x3F", "speed": "10" });
    let program = Program { at: Duration::ZERO, steps: vec![step("80"), step("0")] };
    hostile(Character { stops, program: Some(program), ..Character::default() })
}

#[test]
fn a_signal_does_not_end_a_stop_halfway() {
    for signal in ["INT", "TERM", "HUP"] {
        let (address, _controller) = stubborn();
        let mut running = Running::start(&["-r", &address, "stop", "--json"]);
        std::thread::sleep(Duration::from_millis(400));
        running.signal(signal);
        let report = running.rest();
        let report: serde_json::Value =
            serde_json::from_str(&report).unwrap_or_else(|_| panic!("{signal}: {report:?}"));
        assert_eq!(report["confirmed"], true, "{signal}: {report}");
        // The signal came during the stop.
        assert!(report["took_ms"].as_f64().unwrap() > 500.0, "{signal}: {report}");
        assert_eq!(running.code(), Some(0), "{signal}");
    }
}

#[test]
fn a_second_signal_ends_the_program_and_says_that_nothing_is_known() {
    let (address, _controller) = stubborn();
    let mut running = Running::start(&["-r", &address, "stop", "--json"]);
    std::thread::sleep(Duration::from_millis(400));
    running.signal("INT");
    std::thread::sleep(Duration::from_millis(100));
    running.signal("INT");
    let problem: serde_json::Value = serde_json::from_str(&running.rest()).unwrap();
    assert_eq!(problem["code"], "not_stopped", "{problem}");
    assert_eq!(running.code(), Some(4));
}
