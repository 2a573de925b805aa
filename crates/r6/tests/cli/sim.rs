//! `r6 sim` and `r6 up` as programs.

use std::net::TcpListener;

use crate::support::{Robot, Running, r6};

#[test]
fn a_signal_ends_sim_cleanly() {
    for signal in ["INT", "TERM"] {
        let mut sim = Running::start(&["sim", "--listen", "127.0.0.1:0", "--count", "1"]);
        assert!(sim.line().starts_with("listening on 127.0.0.1:"));
        assert_eq!(sim.end(signal), Some(0), "{signal}");
    }
}

#[test]
fn several_addresses_are_several_controllers() {
    let args = [
        "sim",
        "--listen",
        "127.0.0.1:0",
        "--listen",
        "127.0.0.1:0",
        "--profile",
        "legacy",
        "--start",
        "auto",
    ];
    let mut sim = Running::start(&args);
    for _ in 0..2 {
        let line = sim.line();
        let address = line.strip_prefix("listening on ").unwrap();
        let status = r6(&["-r", address, "status", "--json"]).json();
        assert_eq!((&status["mode"], &status["firmware"]), (&2.into(), &"2.0.1.9".into()));
        assert_eq!(status["virtual"], true);
    }
}

#[test]
fn up_without_a_terminal_prints_lines() {
    for signal in ["INT", "TERM"] {
        let mut up = Running::start(&["up", "--listen", "127.0.0.1:0"]);
        let line = up.line();
        let address = line.strip_prefix("listening on ").unwrap().to_owned();
        assert!(up.line().contains("BRTIRUS0707A, profile hc1"));
        for _ in 0..3 {
            let hint = up.line();
            assert!(hint.starts_with(&format!("try: r6 -r {address} ")), "{hint}");
        }
        assert_eq!(r6(&["-r", &address, "stop"]).code, 0);
        assert_ne!(up.line(), "", "a change of state is a line");
        assert_eq!(up.end(signal), Some(0), "{signal}");
    }
}

#[test]
fn a_port_that_is_taken_names_the_option() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    for command in ["sim", "up"] {
        let outcome = r6(&[command, "--listen", &address]);
        assert_eq!(outcome.code, 2, "{outcome:?}");
        assert!(outcome.err.contains(&address) && outcome.err.contains("--listen"), "{}", outcome.err);
        assert_eq!(outcome.err.lines().count(), 1, "{}", outcome.err);
    }
}

#[test]
fn a_controller_can_be_started_in_every_state() {
    for (start, mode) in [("waiting", 7), ("stopped", 3), ("manual", 1), ("auto", 2)] {
        let robot = Robot::start(&["--start", start]);
        assert_eq!(robot.value("curMode"), mode, "{start}");
    }
}
