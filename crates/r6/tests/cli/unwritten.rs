//! Output that cannot be written: it does not affect a motion, except with `--stop-on-interrupt`, and causes
//! no panic.

use std::io::Write;

use r6_sim::Clock;

use crate::streaming::{Cell, MANY_LOOKS, through, wave};
use crate::support::{Robot, Running, TempFile, broken, full, r6, r6_onto, shell};

/// The capacity of a pipe on Linux, bytes.
const PIPE_BYTES: usize = 65_536;

#[test]
fn a_reader_that_ends_stops_the_arm_where_that_was_promised() {
    let mut cell = Cell::new("hc1", Clock::Real);
    let file = TempFile::new("reader-ends.toml", &through(&wave(200), 60));
    let mut running = cell.start(&["run", file.path(), "--wait", "--json", "--stop-on-interrupt"]);
    // As with `| head -2`.
    for _ in 0..2 {
        assert_eq!(running.event().unwrap()["event"], "accepted");
    }
    running.close_stdout();
    assert_eq!(running.code(), Some(4));
    assert_eq!(cell.list_length(), 0, "nothing goes on");
    assert!(!cell.controller.handle().snapshot().moving);
    assert!(cell.taken() < 200);
}

#[test]
fn a_reader_that_ends_leaves_the_arm_alone_where_no_stop_was_promised() {
    for lines in [0, 2] {
        let mut cell = Cell::new("hc1", Clock::Times(10.0));
        let points = wave(60);
        let file = TempFile::new(&format!("reader-ends-{lines}.toml"), &through(&points, 100));
        let mut running = cell.start(&["run", file.path(), "--wait", "--json"]);
        for _ in 0..lines {
            running.event().unwrap();
        }
        running.close_stdout();
        assert_eq!(running.code(), Some(4));
        // The motion ran to its end.
        assert_eq!(cell.taken(), 60);
        assert!((cell.axes()[0] - points[59][0]).abs() < 0.01, "{:?}", cell.axes());
    }
}

/// `| head -1`, as in the table of the documentation.
#[test]
fn what_a_reader_that_ended_did_not_read_is_on_stderr() {
    let cell = Cell::new("hc1", Clock::Times(10.0));
    let outcome = r6_onto(
        &["-r", &cell.address, "move", "axes", "10", "--speed", "100", "--wait"],
        Some(broken()),
        None,
    );
    assert_eq!(outcome.code, 4, "{outcome:?}");
    assert!(outcome.err.starts_with("r6: stdout: it cannot be written: Broken pipe"), "{}", outcome.err);
    assert!(outcome.err.contains("    done after "), "{}", outcome.err);
    let page = std::fs::read_to_string(crate::support::root().join("docs/COMMAND_LINE.md")).unwrap();
    assert!(
        page.contains("stderr says that stdout could not be written, and has what it did not take"),
        "{page}"
    );
    assert!(!page.contains("goes on to the end without a word"), "{page}");
}

#[test]
fn a_full_stdout_stops_every_kind_of_motion_that_has_to_be_stopped() {
    // An appended motion is sent at once, and without --wait r6 does not follow it.
    for more in [&[][..], &["--append"], &["--append", "--wait"]] {
        let cell = Cell::new("hc1", Clock::Real);
        let motion = ["-r", &cell.address, "move", "axes", "90", "--speed", "1", "--stop-on-interrupt"];
        let outcome = r6_onto(&[&motion[..], more].concat(), Some(full()), None);
        assert_eq!(outcome.code, 4, "{more:?}: {outcome:?}");
        assert!(outcome.err.starts_with("r6: stdout cannot be written; "), "{more:?}: {}", outcome.err);
        assert!(outcome.err.contains("stopped: the arm stands"), "{more:?}: {}", outcome.err);
        let snapshot = cell.controller.handle().snapshot();
        assert_eq!((snapshot.list_length, snapshot.moving), (0, false), "{more:?}");
    }
}

#[test]
fn what_was_done_and_not_told_is_code_4_and_stderr_has_it() {
    let robot = Robot::start(&[]);
    assert_eq!(robot.r6(&["move", "axes", "90", "--speed", "1"]).code, 0);
    let outcome = r6_onto(&["-r", robot.address(), "stop"], Some(full()), None);
    assert_eq!(outcome.code, 4, "{outcome:?}");
    assert!(outcome.err.contains("No space left on device"), "{}", outcome.err);
    assert!(outcome.err.contains("    the arm stands"), "what stdout did not take: {}", outcome.err);
    // The robot carried out the stop.
    assert_eq!((robot.value("isMoving"), robot.value("RemoteCmdLen")), (false.into(), 0.into()));
    let command = ["-r", robot.address(), "command", "modifyGSPD", "5"];
    let outcome = r6_onto(&command, Some(broken()), None);
    assert_eq!(outcome.code, 4, "{outcome:?}");
    assert!(outcome.err.contains("    modifyGSPD accepted after "), "{}", outcome.err);
    // With a reader the exit code is 0 as usual.
    assert_eq!(robot.r6(&["stop"]).code, 0);
}

#[test]
fn a_mere_question_is_code_1() {
    let robot = Robot::start(&[]);
    let address = robot.address();
    for args in [
        &["-r", address, "status"][..],
        &["-r", address, "query", "axis-0"],
        &["-r", address, "query", "axis-0", "--json"],
        // This command does not end until it is stopped.
        &["-r", address, "watch", "axis-0", "--every", "1ms"],
        &["-r", address, "command", "--list"],
        &["query", "--list"],
        &["discover", address],
        &["alarm", "42", "--json"],
        &["inspect", "vectors/transcripts/connect_and_query.jsonl"],
        &["run", "examples/programs/square.toml", "--dry-run"],
        &["plot", "examples/programs/square.toml", "--out", "-"],
        &["completions", "bash"],
        &["--help"],
        &["--version"],
    ] {
        let outcome = r6_onto(args, Some(full()), None);
        assert_eq!(outcome.code, 1, "{args:?}: {outcome:?}");
        assert!(outcome.err.contains("No space left on device"), "{args:?}: {}", outcome.err);
        // If the reader ends early, r6 says nothing.
        let outcome = r6_onto(args, Some(broken()), None);
        assert_eq!(outcome.code, 1, "{args:?}: {outcome:?}");
        assert!(!outcome.err.contains("cannot be written"), "{args:?}: {}", outcome.err);
    }
    // Another failure keeps its exit code.
    assert_eq!(r6_onto(&["query", "nothing", "--json"], Some(full()), None).code, 2);
}

#[test]
fn nothing_panics_without_a_stderr() {
    let robot = Robot::start(&[]);
    let address = robot.address();
    for (args, code) in [
        (&["-r", address, "-vvv", "query", "curMold"][..], 1),
        (&["query", "nothing"], 2),
        (&["-r", address, "-vvv", "move", "axes", "1", "--wait"], 0),
        (&["-r", address, "-vvv", "stop"], 0),
        (&["plot", "examples/programs/square.toml", "--out", "-"], 0),
    ] {
        for err in [full, broken] {
            let outcome = r6_onto(args, None, Some(err()));
            assert_eq!(outcome.code, code, "{args:?}: {outcome:?}");
            let neither = r6_onto(args, Some(full()), Some(err())).code;
            assert!([1, 2, 4].contains(&neither), "{args:?}: {neither}");
        }
        // A stream that is closed from the start behaves like /dev/null.
        for line in [r#"exec "$R6" "$@" 2>&-"#, r#"exec "$R6" "$@" >&- 2>&-"#] {
            assert_eq!(shell(line, args).code, code, "{line} {args:?}");
        }
    }
}

#[test]
fn a_reader_that_does_not_read_keeps_no_signal_waiting() {
    for (stop, code) in [(&["--stop-on-interrupt"][..], 4), (&[], 4)] {
        let cell = Cell::new("hc1", Clock::Real);
        let file = TempFile::new(&format!("nobody-reads-{}.toml", stop.len()), &through(&wave(200), 60));
        let (reader, mut writer) = std::io::pipe().unwrap();
        // The pipe is full.
        writer.write_all(&[b' '; PIPE_BYTES]).unwrap();
        let args = [&["-r", &cell.address, "run", file.path(), "--wait", "--json"][..], stop].concat();
        let running = Running::start_with_stdout(&args, writer);
        // Each poll starts a program, so this is no busy loop.
        let mut looks = std::iter::repeat_with(|| cell.r6(&["query", "isMoving", "--json"])).take(MANY_LOOKS);
        assert!(looks.any(|look| look.json()["values"]["isMoving"] == true), "the arm never moved");
        assert_eq!(running.end("INT"), Some(code));
        if !stop.is_empty() {
            assert_eq!(cell.list_length(), 0);
        }
        drop(reader);
    }
}

#[test]
fn watching_for_a_reader_that_does_not_read_can_be_ended() {
    let cell = Cell::new("hc1", Clock::Real);
    let (_reader, mut writer) = std::io::pipe().unwrap();
    writer.write_all(&[b' '; PIPE_BYTES]).unwrap();
    let watch = ["-r", &cell.address, "watch", "axis-0", "--every", "1ms"];
    let running = Running::start_with_stdout(&watch, writer);
    // A connection shows that `r6 watch` runs and has taken over the signals. `r6 alarm` connects to nothing.
    let mut looks = (0..MANY_LOOKS).map(|_| r6(&["alarm", "1"]).code);
    assert!(looks.any(|code| code == 0 && cell.controller.handle().snapshot().connections > 0));
    assert_eq!(running.end("INT"), Some(0));
}

#[test]
fn a_simulation_goes_on_without_a_reader() {
    let mut sim = Running::start(&["sim", "--listen", "127.0.0.1:0"]);
    let line = sim.line();
    let address = line.strip_prefix("listening on ").unwrap().to_owned();
    sim.close_stdout();
    for percent in ["5", "6", "7"] {
        let outcome = r6_onto(&["-r", &address, "command", "modifyGSPD", percent], None, None);
        assert_eq!(outcome.code, 0, "{outcome:?}");
    }
    assert_eq!(sim.end("TERM"), Some(1), "what it logged was not read");
    let mut sim = Running::start(&["sim", "--listen", "127.0.0.1:0"]);
    sim.line();
    assert_eq!(sim.end("HUP"), Some(0), "a hangup ends it in order");
}
