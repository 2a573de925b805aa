//! `r6 run` with more instructions than the controller's list holds, and what ends such a run early.

use std::fmt::Write;
use std::sync::Arc;

use r6_controller::{LogEntry, Profile, Scenario};
use r6_sim::{Clock, VirtualController};
use serde_json::Value;
use tokio::runtime::Runtime;
use tokio::sync::broadcast::Receiver;

use crate::support::{Outcome, Running, TempFile, r6};

/// How many instructions fit into the controller's list.
const ROOM: usize = 24;

/// How many times a test polls a controller before it fails. Each poll starts a program, so this takes
/// minutes.
pub const MANY_LOOKS: usize = 10_000;

/// A virtual controller in this process, with its log.
pub struct Cell {
    _runtime: Runtime,
    pub controller: VirtualController,
    log: Receiver<Arc<LogEntry>>,
    pub address: String,
}

impl Cell {
    pub fn new(profile: &str, clock: Clock) -> Self {
        Self::with(Profile::named(profile).unwrap(), clock, "")
    }

    pub fn with(profile: Profile, clock: Clock, scenario: &str) -> Self {
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().unwrap();
        let builder = VirtualController::builder().profile(profile).clock(clock);
        let builder = builder.scenario(Scenario::read(scenario).unwrap());
        let controller = runtime.block_on(builder.start()).unwrap();
        let (log, address) = (controller.handle().log(), controller.address().to_string());
        Self { _runtime: runtime, controller, log, address }
    }

    pub fn r6(&self, args: &[&str]) -> Outcome {
        r6(&[&["-r", &self.address], args].concat())
    }

    pub fn start(&self, args: &[&str]) -> Running {
        Running::start(&[&["-r", &self.address], args].concat())
    }

    pub fn list_length(&self) -> usize {
        self.controller.handle().snapshot().list_length
    }

    pub fn axes(&self) -> [f64; 8] {
        self.controller.handle().snapshot().axes
    }

    /// How many instructions the controller took since the last call.
    pub fn taken(&mut self) -> usize {
        let mut taken = 0;
        while let Ok(line) = self.log.try_recv() {
            taken += line.event.instructions_taken().unwrap_or(0);
        }
        taken
    }

    /// Polls until the arm has finished its list.
    fn has_finished(&self) {
        for _ in 0..MANY_LOOKS {
            let snapshot = self.controller.handle().snapshot();
            if !snapshot.moving && snapshot.list_length == 0 {
                return;
            }
            // Each poll starts a program, so this is no busy loop.
            assert_eq!(self.r6(&["query", "isMoving"]).code, 0);
        }
        panic!("the arm never stood");
    }
}

/// The points of a wave: every axis swings with its own period.
pub fn wave(points: u32) -> Vec<[f64; 6]> {
    let point = |n| {
        let t = f64::from(n) / 12.0;
        [40.0, 15.0, 20.0, 30.0, 25.0, 60.0].map(|size: f64| size * (t / (1.0 + size / 40.0)).sin())
    };
    (1..=points).map(point).collect()
}

/// A program in TOML that moves through these points.
pub fn through(points: &[[f64; 6]], speed: u32) -> String {
    let mut text = String::new();
    for point in points {
        let to: Vec<_> = point.iter().map(|angle| format!("{angle:.3}")).collect();
        let to = to.join(", ");
        writeln!(text, "[[instruction]]\ndo = \"axis-move\"\nspeed = {speed}\nblend = 5\nto = [{to}]")
            .unwrap();
    }
    text
}

fn count(event: &Value, what: &str) -> usize {
    usize::try_from(event["steps"][what].as_u64().unwrap()).unwrap()
}

/// Reads events until this many steps are done, and returns the last event.
fn until_done(running: &mut Running, steps: usize) -> Value {
    loop {
        let event = running.event().expect("it ended before its time");
        if event["event"] == "progress" && count(&event, "done") >= steps {
            return event;
        }
    }
}

/// Checks that the controller took everything that was accepted, and nothing that was not sent. The numbers
/// may differ by a list whose answer the client did not wait for.
fn is_what_was_sent(taken: usize, failed: &Value) {
    assert!((count(failed, "accepted")..=count(failed, "sent")).contains(&taken), "{taken} taken: {failed}");
}

/// Reads to the end of the output and returns the last event.
fn last(running: &mut Running) -> Value {
    std::iter::from_fn(|| running.event()).last().expect("it said nothing more")
}

fn text<'v>(event: &'v Value, what: &str) -> &'v str {
    event[what].as_str().unwrap()
}

#[test]
fn five_hundred_points_are_streamed_and_the_list_is_never_too_full() {
    for profile in ["hc1", "legacy"] {
        let mut cell = Cell::new(profile, Clock::Times(10.0));
        let points = wave(500);
        let file = TempFile::new(&format!("wave-{profile}.toml"), &through(&points, 100));
        let mut running = cell.start(&["run", file.path(), "--wait", "--json"]);
        let (mut accepted, mut done, mut progress) = (0, 0, 0);
        let stands = loop {
            let event = running.event().unwrap();
            let length = cell.list_length();
            assert!(length <= ROOM, "{profile}: {length} in the list");
            match text(&event, "event") {
                "accepted" => {
                    assert_eq!(event["replaced_list"], accepted == 0, "{profile}");
                    accepted += usize::try_from(event["instructions"].as_u64().unwrap()).unwrap();
                    assert_eq!(count(&event, "accepted"), accepted, "{profile}");
                }
                "progress" => {
                    assert!(count(&event, "done") > done, "{profile}: {event}");
                    done = count(&event, "done");
                    progress += 1;
                }
                _ => break event,
            }
        };
        assert_eq!(text(&stands, "event"), "stands", "{profile}: {stands}");
        assert_eq!(running.event(), None, "the outcome is last");
        assert_eq!(running.code(), Some(0), "{profile}");
        assert_eq!((accepted, cell.taken()), (500, 500), "{profile}: each step once");
        assert!(progress > 2, "{profile}: {progress} lines of progress");
        for (at, wanted) in cell.axes().iter().zip(points.last().unwrap()) {
            assert!((at - wanted).abs() < 0.01, "{profile}: {:?}", cell.axes());
        }
    }
}

#[test]
fn without_wait_it_ends_when_the_last_list_is_accepted() {
    let mut cell = Cell::new("hc1", Clock::Times(10.0));
    let points = wave(60);
    let file = TempFile::new("handed-over.toml", &through(&points, 100));
    let outcome = cell.r6(&["run", file.path()]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    let lines: Vec<_> = outcome.out.lines().collect();
    assert_eq!(
        lines[0],
        "streaming 60 instructions, at most 24 of them in the controller's list; Ctrl-C sends no more"
    );
    assert!(
        lines[1].starts_with("60 instructions accepted in 8 lists; the arm finishes the last "),
        "{lines:?}"
    );
    assert!(lines[2].ends_with(" stop") && lines[3].contains(" watch "), "{lines:?}");
    cell.has_finished();
    assert_eq!(cell.taken(), 60);
    assert!((cell.axes()[0] - points[59][0]).abs() < 0.01);
}

#[test]
fn interrupted_in_the_middle_the_arm_finishes_its_list() {
    let mut cell = Cell::new("hc1", Clock::Real);
    let points = wave(200);
    let file = TempFile::new("interrupted.toml", &through(&points, 60));
    let mut running = cell.start(&["run", file.path(), "--wait", "--json"]);
    until_done(&mut running, 2);
    running.signal("INT");
    let failed = last(&mut running);
    assert_eq!(running.code(), Some(4), "{failed}");
    let (sent, done) = (count(&failed, "sent"), count(&failed, "done"));
    assert!(done >= 2 && sent < 200, "{failed}");
    let wanted = format!(", {} never sent", 200 - sent);
    assert!(text(&failed, "message").contains(" in its list, "), "{failed}");
    assert!(text(&failed, "message").starts_with("interrupted; the arm may go on moving: "), "{failed}");
    assert!(text(&failed, "message").ends_with(&wanted), "{failed}");
    assert!(text(&failed, "advice").contains(" stop`"), "{failed}");
    // Nothing more is sent, and the controller carries out the rest of its list.
    assert!(cell.list_length() > 0);
    cell.has_finished();
    let taken = cell.taken();
    is_what_was_sent(taken, &failed);
    assert!((cell.axes()[0] - points[taken - 1][0]).abs() < 0.01);
}

#[test]
fn interrupted_with_the_wish_to_stop_the_arm_stands() {
    for signal in ["INT", "TERM", "HUP"] {
        let mut cell = Cell::new("hc1", Clock::Real);
        let file = TempFile::new(&format!("stopped-by-{signal}.toml"), &through(&wave(200), 60));
        let mut running = cell.start(&["run", file.path(), "--wait", "--json", "--stop-on-interrupt"]);
        until_done(&mut running, 2);
        running.signal(signal);
        let failed = last(&mut running);
        assert_eq!(running.code(), Some(1), "{failed}");
        let sent = count(&failed, "sent");
        let message = text(&failed, "message");
        assert!(message.starts_with("interrupted; "), "{failed}");
        assert!(message.contains(&format!("{} never sent; stopped: the arm stands", 200 - sent)), "{failed}");
        assert_eq!(
            (&failed["stop"]["confirmed"], &failed["stop"]["list"]),
            (&true.into(), &"cleared".into())
        );
        assert_eq!(cell.list_length(), 0);
        is_what_was_sent(cell.taken(), &failed);
    }
}

#[test]
fn a_stop_by_somebody_else_ends_it() {
    let mut cell = Cell::new("hc1", Clock::Real);
    let file = TempFile::new("stopped-elsewhere.toml", &through(&wave(200), 60));
    let mut running = cell.start(&["run", file.path(), "--wait", "--json"]);
    until_done(&mut running, 2);
    assert_eq!(cell.r6(&["stop"]).code, 0);
    let failed = last(&mut running);
    assert_eq!(running.code(), Some(1), "{failed}");
    let message = text(&failed, "message");
    assert!(message.starts_with("the motion was stopped: the operation mode is now "), "{failed}");
    assert!(message.contains(" never sent; stopped: the arm stands"), "{failed}");
    assert_eq!(cell.list_length(), 0);
    is_what_was_sent(cell.taken(), &failed);
}

#[test]
fn an_alarm_in_the_middle_ends_it() {
    let cell = Cell::new("hc1", Clock::Times(10.0));
    let mut points = wave(100);
    points[40][0] = 500.0;
    let file = TempFile::new("beyond.toml", &through(&points, 60));
    let outcome = cell.r6(&["run", file.path(), "--wait"]);
    assert_eq!(outcome.code, 1, "{outcome:?}");
    let start = "r6: the motion ended with alarm 130 (J1: positive soft limit); ";
    assert!(outcome.err.starts_with(start), "{}", outcome.err);
    assert!(outcome.err.contains(" of 100 steps done, "), "{}", outcome.err);
    assert!(outcome.err.contains(" never sent; stopped: the arm stands"), "{}", outcome.err);
    assert!(cell.axes()[0] < 180.0);
    assert_eq!(cell.list_length(), 0);
}

#[test]
fn a_list_that_nobody_answers_is_not_sent_again() {
    let silent = "[[fault]]\nfault = \"not-acknowledged\"";
    let mut cell = Cell::with(Profile::hc1(), Clock::Real, silent);
    let file = TempFile::new("unanswered.toml", &through(&wave(100), 20));
    let outcome = cell.r6(&["run", file.path(), "--json"]);
    assert_eq!(outcome.code, 4, "{outcome:?}");
    let failed: Value = serde_json::from_str(outcome.last_line()).unwrap();
    assert!(text(&failed, "message").contains("Do not send it again"), "{failed}");
    assert!(
        text(&failed, "message").contains("0 of 100 steps done, 8 sent and not seen to be done, 92 never")
    );
    // The controller carried the list out once. It did not answer the stop either, but the state proves that
    // the arm stands.
    assert!(text(&failed, "message").contains("stopped: the arm stands"), "{failed}");
    assert!(text(&failed, "message").contains("one frame that can move the arm had no answer"), "{failed}");
    assert_eq!(cell.taken() % 8, 0, "one list, and empty ones");
    assert_eq!(count(&failed, "sent"), 8);
}

#[test]
fn a_list_in_the_middle_that_nobody_answers_ends_it() {
    // Waits make short frames and moves of eight axes make long ones. This controller does not answer the
    // long ones.
    let mut profile = Profile::hc1();
    profile.add_rcc_silent_over = Some(1000);
    let mut cell = Cell::with(profile, Clock::Times(10.0), "");
    let waits = "[[instruction]]\ndo = \"wait\"\nseconds = 0.1\n".repeat(40);
    let file = TempFile::new("unanswered-later.toml", &(waits + &through(&wave(20), 20)));
    let outcome = cell.r6(&["run", file.path(), "--wait", "--json"]);
    assert_eq!(outcome.code, 4, "{outcome:?}");
    let failed: Value = serde_json::from_str(outcome.last_line()).unwrap();
    assert!(text(&failed, "message").contains("Do not send it again"), "{failed}");
    assert_eq!((count(&failed, "accepted"), count(&failed, "sent"), cell.taken()), (40, 48, 40));
    assert_eq!(failed["stop"]["confirmed"], true, "{failed}");
}

#[test]
fn when_the_time_is_up_nothing_more_is_sent() {
    let mut cell = Cell::new("hc1", Clock::Real);
    let file = TempFile::new("too-slow.toml", &through(&wave(200), 20));
    let run = ["run", file.path(), "--wait", "--json", "--timeout", "1s"];
    let outcome = cell.r6(&run);
    assert_eq!(outcome.code, 4, "{outcome:?}");
    let failed: Value = serde_json::from_str(outcome.last_line()).unwrap();
    let message = text(&failed, "message");
    assert!(message.starts_with("not done within 1s; the arm may go on moving: "), "{failed}");
    assert!(message.contains(" in its list, "), "{failed}");
    assert!(message.ends_with(&format!(", {} never sent", 200 - count(&failed, "sent"))), "{failed}");
    is_what_was_sent(cell.taken(), &failed);
    assert_eq!(cell.r6(&["stop"]).code, 0);
    assert_eq!(cell.r6(&["command", "startButton"]).code, 0);
    // With `--stop-on-interrupt` the arm stands.
    let outcome = cell.r6(&[&run[..], &["--stop-on-interrupt"]].concat());
    assert_eq!(outcome.code, 1, "{outcome:?}");
    let failed: Value = serde_json::from_str(outcome.last_line()).unwrap();
    assert!(text(&failed, "message").contains("; stopped: the arm stands"), "{failed}");
    assert_eq!(cell.list_length(), 0);
}

#[test]
fn what_goes_beyond_the_limits_is_not_sent() {
    let mut cell = Cell::new("hc1", Clock::AsFastAsPossible);
    let mut points = vec![[0.0; 6]; 3];
    points[1][1] = 20.0;
    let file = TempFile::new("limits.toml", &through(&points, 50));
    let guard = TempFile::new("guard.toml", "max_speed = 60\n[axes]\nJ2 = [-90, 10]\n");
    for (limits, beyond) in [
        (&["--max-speed", "20"][..], "step 1: the speed is 50 %, above 20 %"),
        (&["--max-axis-step", "15"], "step 2: J2 goes 20 deg in one step, more than 15 deg"),
        (&["--guard", guard.path()], "step 2: J2 goes to 20 deg, outside of -90 to 10 deg"),
        (&["--guard", guard.path(), "--max-speed", "30"], "step 1: the speed is 50 %, above 30 %"),
    ] {
        for more in [&["--dry-run"][..], &["--append", "--dry-run"], &["--wait"], &[]] {
            let outcome = cell.r6(&[&["run", file.path()], limits, more].concat());
            assert_eq!((outcome.code, outcome.out.as_str()), (1, ""), "{limits:?} {more:?}: {outcome:?}");
            let wanted = format!("r6: nothing was sent: {beyond}\n    the limits are those of --guard");
            assert!(outcome.err.starts_with(&wanted), "{limits:?} {more:?}: {}", outcome.err);
        }
    }
    // This step begins at the arm's position, which only a robot can report.
    let far = ["move", "axes", "30", "--max-axis-step", "25"];
    assert_eq!(cell.r6(&[&far[..], &["--dry-run"]].concat()).code, 0);
    for more in [&["--wait"][..], &["--append"]] {
        let outcome = cell.r6(&[&far[..], more].concat());
        assert_eq!(outcome.code, 1, "{outcome:?}");
        assert!(outcome.err.contains("J1 goes 30 deg in one step"), "{}", outcome.err);
    }
    assert_eq!(cell.taken(), 0);
    // Within the limits the run succeeds. The arm ends elsewhere than it begins, because this clock shows no
    // motion.
    points[2][1] = 20.0;
    let file = TempFile::new("within-limits.toml", &through(&points, 50));
    let outcome = cell.r6(&["run", file.path(), "--max-speed", "50", "--max-axis-step", "20", "--wait"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert_eq!(cell.taken(), 3);
}

#[test]
fn more_than_there_is_room_for_is_not_appended() {
    let mut cell = Cell::new("hc1", Clock::AsFastAsPossible);
    let file = TempFile::new("long-append.toml", &through(&[[0.0; 6]; 25], 50));
    for more in [&["--dry-run"][..], &[]] {
        let outcome = cell.r6(&[&["run", file.path(), "--append"], more].concat());
        assert_eq!((outcome.code, outcome.out.as_str()), (2, ""), "{outcome:?}");
        assert!(outcome.err.contains("25 are more than the 24"), "{}", outcome.err);
        assert!(outcome.err.contains("append fewer") && outcome.err.contains("--room 25"), "{}", outcome.err);
    }
    assert_eq!(cell.taken(), 0);
    assert_eq!(r6(&["run", file.path(), "--append", "--dry-run", "--room", "25"]).code, 0);
}

#[test]
fn a_guard_that_is_wrong_is_told_with_its_line() {
    let guard = TempFile::new("wrong-guard.toml", "max_speed = 20\nmax_axis_stp = 5\n");
    let outcome = r6(&["move", "axes", "1", "--guard", guard.path(), "--dry-run"]);
    assert_eq!(outcome.code, 2, "{outcome:?}");
    let wanted = ":2:1: there is no key `max_axis_stp`\n    nearest: `max_axis_step`";
    assert!(outcome.err.contains(wanted), "{}", outcome.err);
    let example =
        ["run", "examples/programs/square.toml", "--guard", "examples/guard.toml", "--max-speed", "20"];
    let outcome = r6(&[&example[..], &["--dry-run"]].concat());
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert_eq!(r6(&["run", "examples/programs/square.toml", "--guard", "none.toml", "--dry-run"]).code, 2);
}

#[test]
fn a_list_that_repeats_has_to_fit_as_a_whole() {
    let text = format!("repeat = true\n{}", through(&wave(30), 50));
    let file = TempFile::new("round.toml", &text);
    let outcome = r6(&["run", file.path(), "--dry-run"]);
    assert_eq!((outcome.code, outcome.out.as_str()), (2, ""), "{outcome:?}");
    assert!(outcome.err.contains("30 instructions are more than the 24"), "{}", outcome.err);
    assert!(outcome.err.contains("--once") && outcome.err.contains("--room 30"), "{}", outcome.err);
    assert_eq!(r6(&["run", file.path(), "--dry-run", "--room", "30"]).code, 0);
    let once = r6(&["run", file.path(), "--dry-run", "--once", "--room", "4"]);
    assert_eq!((once.code, once.out.lines().count()), (0, 8), "{once:?}");
}
