//! Reading from a robot and sending it commands.

use std::net::{TcpListener, TcpStream};

use r6_testkit::hostile::{Character, Kind, ListLength};

use crate::support::{Robot, Running, TempFile, hostile, r6};

#[test]
fn a_robot_that_may_be_ready_says_what_no_value_tells() {
    let robot = Robot::start(&[]);
    let status = robot.r6(&["status"]);
    assert_eq!(status.code, 0, "{status:?}");
    assert!(status.out.contains("\n\nUNKNOWN: whether the program sits in its"), "{}", status.out);
    assert!(!status.out.contains("READY"), "{}", status.out);
    let head = format!("at {}, a virtual controller", robot.address());
    assert!(status.out.lines().next().is_some_and(|line| line.ends_with(&head)), "{}", status.out);
    let json = robot.r6(&["status", "--json"]).json();
    assert_eq!(
        (&json["ready"], &json["mode"], &json["alarm"]),
        (&serde_json::Value::Null, &7.into(), &0.into())
    );
    assert_eq!(json["unknown"], serde_json::json!(["remote_step"]));
    assert_eq!(json["axes"].as_array().map(Vec::len), Some(6));
    assert!(json["pose"]["x_mm"].is_number());
}

/// The quick start and `r6 status` warn about this.
#[test]
fn a_list_that_a_production_program_refuses_stops_the_machine() {
    let robot = Robot::start(&["--program", "register-move"]);
    let status = robot.r6(&["status"]);
    assert_eq!(status.code, 0, "{status:?}");
    assert!(
        status.out.contains("do not use `r6 move` or `r6 run`: the controller refuses the list, and `r6` then stops the machine, its production \
             program too"),
        "{}",
        status.out
    );
    let outcome = robot.r6(&["run", "examples/programs/square.toml", "--wait"]);
    assert_eq!(outcome.code, 1, "{outcome:?}");
    assert!(outcome.err.contains("refused the instruction list"), "{}", outcome.err);
    assert!(outcome.err.contains("stopped: the arm stands"), "{}", outcome.err);
    assert!(outcome.err.contains("start the program again before the next motion"), "{}", outcome.err);
    assert!(outcome.err.contains("choose a program that does: at the pendant, or"), "{}", outcome.err);
    assert_ne!(robot.value("curMode"), 7);
    let page = std::fs::read_to_string(crate::support::root().join("docs/QUICKSTART.md")).unwrap();
    assert!(page.contains("`r6 run` stops production"), "{page}");
}

/// If the controller reports its program, the name of a program that only waits is the proof.
#[test]
fn a_program_that_only_waits_makes_it_ready() {
    let profile = TempFile::new("tells-all.toml", "unsupported_addresses = []\n");
    let robot = Robot::start(&["--profile", profile.path()]);
    let known = ["status", "--remote-program", "remote"];
    let status = robot.r6(&known);
    assert_eq!((status.code, status.last_line()), (0, "READY"), "{status:?}");
    assert_eq!(robot.r6(&[&known[..], &["--json"]].concat()).json()["ready"], true);
    // With another program, nothing proves that it waits for remote commands.
    assert_eq!(robot.r6(&["command", "switchMold", "register-follow"]).code, 0);
    let status = robot.r6(&known);
    assert_eq!(status.code, 1, "{status:?}");
    assert!(
        status.out.contains("NOT READY: another program")
            && status.out.contains("`register-follow`, not `remote`"),
        "{status:?}"
    );
    let json = robot.r6(&[&known[..], &["--json"]].concat()).json();
    assert_eq!((&json["ready"], &json["unmet"][0]["condition"]), (&false.into(), &"other_program".into()));
}

#[test]
fn a_log_through_a_pipe_has_no_colours() {
    let status = Robot::start(&[]).r6(&["-vvv", "status"]);
    assert!(["INFO", "DEBUG", "TRACE"].iter().any(|level| status.err.contains(level)), "{}", status.err);
    assert!(!status.err.contains('\u{1b}'), "{:?}", status.err);
}

#[test]
fn a_robot_that_is_not_ready_says_what_to_do() {
    let robot = Robot::start(&["--start", "stopped"]);
    let status = robot.r6(&["status"]);
    assert_eq!(status.code, 1);
    assert!(status.out.contains("NOT READY: mode is stop (3)\n  "), "{}", status.out);
    let json = robot.r6(&["status", "--json"]).json();
    assert_eq!(json["unmet"][0]["condition"], "mode");
}

#[test]
fn every_profile_can_be_asked() {
    for profile in ["hc1", "r6-host", "r6-pendant", "legacy"] {
        let robot = Robot::start(&["--profile", profile]);
        let status = robot.r6(&["status"]);
        // Only some profiles report how many instructions are left.
        let tells = robot.r6(&["query", "RemoteCmdLen"]).code == 0;
        let wanted = "whether instructions are left in the list";
        assert_eq!(status.code, 0, "{profile}: {status:?}");
        assert!(status.out.contains("\n\nUNKNOWN: whether the program sits in its"), "{profile}: {status:?}");
        assert_eq!(status.out.contains(wanted), !tells, "{profile}: {status:?}");
        assert_eq!(tells, ["hc1"].contains(&profile), "{profile}");
    }
}

#[test]
fn what_the_controller_does_not_have_is_code_1() {
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["query", "axis-0", "curMold", "curMode"]);
    assert_eq!(outcome.code, 1);
    insta::assert_snapshot!(outcome.out, @r"
    axis-0         0.000  deg or mm  position of J1 (mm on a linear axis)
    curMold            -             name of the program (mold) in use
    curMode  running (7)             operation mode
    ");
    assert_eq!(outcome.err, "r6: curMold: the controller has no such value\n");
    let outcome = robot.r6(&["query", "axis-0", "counterList", "origin", "output-0"]);
    assert_eq!((outcome.code, outcome.err.as_str()), (0, ""));
}

#[test]
fn watching_ends_by_count_or_by_signal() {
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["watch", "axis-0", "isMoving", "--every", "1ms", "--times", "3", "--json"]);
    assert_eq!(outcome.code, 0);
    let samples: Vec<serde_json::Value> =
        outcome.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(samples.len(), 3);
    assert_eq!(samples[2]["values"], serde_json::json!({"axis-0": 0.0, "isMoving": false}));
    assert!(samples[0]["unix_ms"].as_u64() <= samples[2]["unix_ms"].as_u64());
    let mut watch = Running::start(&["-r", robot.address(), "watch", "axis-0", "--every", "10ms"]);
    assert_eq!(watch.line(), "time  axis-0 [deg or mm]");
    let line = watch.line();
    let (time, value) = line.split_once("  ").unwrap();
    assert!(humantime::parse_rfc3339(time).is_ok() && time.ends_with('Z') && value == "0.000", "{line}");
    assert_eq!(watch.end("INT"), Some(0));
}

#[test]
fn commands_are_in_the_units_of_people() {
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["command", "rewriteData", "800", "-300000", "0"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!(outcome.out.starts_with("rewriteData accepted after "), "{}", outcome.out);
    assert_eq!(robot.value("Addr-800"), -300_000);
    assert_eq!(robot.r6(&["command", "rewriteDataList", "801", "2", "0", "7", "-8"]).code, 0);
    assert_eq!((robot.value("Addr-801"), robot.value("Addr-802")), (7.into(), (-8).into()));
    assert_eq!(robot.r6(&["command", "modifyOutput", "0", "3", "on"]).code, 0);
    assert_eq!(robot.value("output-0"), 8);
    let json = robot.r6(&["command", "modifyGSPD", "5", "--json"]).json();
    assert_eq!((&json["command"], &json["accepted"]), (&"modifyGSPD".into(), &true.into()));
    assert_eq!(
        (&json["means"], &json["on_the_wire"]),
        (&"global speed 5 %".into(), &serde_json::json!(["50"]))
    );
    let slow = robot.r6(&["command", "modifyGSPD", "5"]).out;
    assert!(slow.ends_with(" ms: global speed 5 %; on the wire \"50\"\n"), "{slow}");
    let output = robot.r6(&["command", "modifyOutput", "Y022", "on"]).out;
    assert!(output.ends_with(" ms: point 10 of Y = Y022, on\n"), "{output}");
    assert_eq!(robot.value("output-0"), 8 + 1024);
}

#[test]
fn a_refusal_is_code_1() {
    let robot = Robot::start(&["--profile", "r6-host"]);
    let outcome = robot.r6(&["command", "clearAlarm"]);
    assert_eq!(outcome.code, 1, "{outcome:?}");
    assert!(outcome.err.starts_with("r6: the controller refused clearAlarm"), "{}", outcome.err);
}

#[test]
fn nobody_there_is_code_3_and_names_the_way_out() {
    // The local end of a connection: its port is in use, and no program listens on it.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let address = taken.local_addr().unwrap().to_string();
    for args in [&["status"][..], &["query", "axis-0"], &["watch", "axis-0"], &["move", "axes", "1"]] {
        let outcome = r6(&[&["-r", &address], args].concat());
        assert_eq!(outcome.code, 3, "{args:?}: {outcome:?}");
        assert!(outcome.err.contains(&address) && outcome.err.contains("r6 up"), "{args:?}: {}", outcome.err);
        assert_eq!(outcome.err.lines().count(), 2, "{args:?}: {}", outcome.err);
    }
    assert_eq!(r6(&["-r", "127.0.0.1:no", "status"]).code, 2);
    // A stop has a more important message, which comes first.
    let stop = r6(&["-r", &address, "stop"]);
    let first = format!(
        "r6: the arm was NOT stopped: it may go on with what is in its list; use the emergency stop; nothing was sent: {address} "
    );
    assert_eq!(stop.code, 3, "{stop:?}");
    assert!(stop.err.starts_with(&first) && !stop.err.contains("r6 up"), "{}", stop.err);
    assert_eq!(r6(&["-r", "127.0.0.1:no", "stop"]).code, 2);
    let found = r6(&["discover", &address]);
    assert_eq!(
        (found.code, found.out.starts_with(&format!("{address}: nothing was sent"))),
        (3, true),
        "{found:?}"
    );
}

#[test]
fn no_reply_is_code_3() {
    // The listener accepts connections into its backlog and never answers.
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = silent.local_addr().unwrap().to_string();
    let outcome = r6(&["-r", &address, "query", "axis-0"]);
    assert_eq!(outcome.code, 3, "{outcome:?}");
    assert!(outcome.err.contains("no reply within"), "{}", outcome.err);
}

#[test]
fn what_takes_long_is_said_once_on_stderr_and_what_does_not_is_not() {
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = silent.local_addr().unwrap().to_string();
    let waits = format!("r6: waiting for an answer of {address} …\n");
    for (args, code, waits) in [
        (&["query", "axis-0"][..], 3, waits.as_str()),
        (&["move", "axes", "1", "--json"], 3, &waits),
        (&["stop"], 4, "r6: the stop is under way: waiting until the arm is seen to stand …\n"),
    ] {
        let outcome = r6(&[&["-r", &address], args].concat());
        assert_eq!(outcome.code, code, "{args:?}: {outcome:?}");
        assert!(outcome.err.starts_with(waits), "{args:?}: {outcome:?}");
        assert_eq!(outcome.err.matches("waiting").count(), 1, "{args:?}: {outcome:?}");
    }
    let robot = Robot::start(&[]);
    for args in [&["query", "axis-0"][..], &["stop"]] {
        assert_eq!(robot.r6(args).err, "", "{args:?}");
    }
}

#[test]
fn motion_without_an_answer_is_code_4_and_is_not_sent_again() {
    let profile = TempFile::new("silent.toml", "add_rcc_silent_over = 10");
    let robot = Robot::start(&["--profile", profile.path()]);
    let outcome = robot.r6(&["move", "axes", "10"]);
    assert_eq!(outcome.code, 4, "{outcome:?}");
    assert!(outcome.err.contains("Do not send it again"), "{}", outcome.err);
}

#[test]
fn the_address_comes_from_option_or_environment() {
    let robot = Robot::start(&[]);
    let outcome = std::process::Command::new(env!("CARGO_BIN_EXE_r6"))
        .args(["query", "axis-0"])
        .env("R6_ROBOT", robot.address())
        .output()
        .unwrap();
    assert!(outcome.status.success(), "{outcome:?}");
    assert_eq!(r6(&["query", "axis-0", "--robot", robot.address()]).code, 0);
}

#[test]
fn a_leftover_list_is_not_started_without_a_word() {
    let robot = Robot::start(&[]);
    assert_eq!(robot.r6(&["move", "axes", "90", "--speed", "1"]).code, 0);
    // This command alone stops the motion and keeps the list.
    assert_eq!(robot.r6(&["command", "actionStop"]).code, 0);
    let mode = robot.value("curMode");
    for command in ["startButton", "actionSingleCycle", "clearAlarmContinue", "clearAlarmRunNext"] {
        let outcome = robot.r6(&["command", command]);
        assert_eq!((outcome.code, outcome.out.as_str()), (1, ""), "{command}: {outcome:?}");
        let wanted = format!("r6: {command} was not sent: 1 instruction is left in the list");
        assert!(outcome.err.starts_with(&wanted) && outcome.err.contains(" stop`"), "{}", outcome.err);
    }
    assert_eq!(robot.value("curMode"), mode);
    let outcome = robot.r6(&["command", "startButton", "--run-leftover"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert_eq!(robot.r6(&["stop"]).code, 0);
    assert_eq!(robot.r6(&["command", "startButton"]).code, 0);
    // A length that cannot be read is not that of a firmware without one.
    let character = Character { list_length: ListLength::Unreadable, ..Character::default() };
    let (garbled, controller) = hostile(character);
    for args in [["command", "startButton"].as_slice(), &["move", "axes", "10", "--speed", "5"], &["status"]]
    {
        let outcome = r6(&[&["-r", &garbled], args].concat());
        assert_eq!(outcome.code, 1, "{args:?}: {outcome:?}");
        let said = format!("{}{}", outcome.out, outcome.err);
        assert!(said.contains("cannot be read"), "{args:?}: {outcome:?}");
    }
    let moved = |kind| controller.arm(|arm, _| arm.log().iter().any(|entry| entry.kind == kind));
    assert!(!moved(Kind::Command) && !moved(Kind::List), "nothing that moves was sent");
    // This firmware does not report the length of the list.
    let old = Robot::start(&["--profile", "r6-pendant", "--start", "auto"]);
    assert_eq!(old.r6(&["command", "startButton"]).code, 0);
}

#[test]
fn watching_a_robot_that_goes_away_is_not_code_0() {
    let robot = Robot::start(&[]);
    let watch = ["-r", robot.address(), "watch", "axis-0", "--every", "200ms", "--times", "2"];
    let mut watch = Running::start_with_pipes(&watch);
    assert_eq!(watch.line(), "time  axis-0 [deg or mm]");
    assert!(watch.line().ends_with("Z  0.000"));
    drop(robot);
    assert_eq!(watch.code(), Some(3));
}

#[test]
fn advice_is_for_the_robot_that_was_asked() {
    let robot = Robot::start(&["--start", "stopped"]);
    let status = robot.r6(&["status"]).out;
    let start = format!("`r6 --robot {} command startButton`", robot.address());
    assert!(
        status.contains(&start) && !status.contains("r6 command") && !status.contains("r6 panel"),
        "{status}"
    );
    assert!(status.contains("turn the key to auto at its panel"), "{status}");
}

#[test]
fn older_firmware_is_asked_in_its_own_words() {
    let robot = Robot::start(&["--profile", "legacy"]);
    let outcome = robot.r6(&["--type-key", "cmdType", "--ds-id", "short", "-vvv", "query", "version"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!(outcome.err.contains("cmdType") && outcome.err.contains("HCRemoteMonitor"), "{}", outcome.err);
    let usual = robot.r6(&["-vvv", "query", "version"]);
    assert!(usual.err.contains("reqType") && usual.err.contains("www.hc-system.com"), "{}", usual.err);
    let wrong = robot.r6(&["--ds-id", "shrt", "status"]);
    assert!(wrong.code == 2 && wrong.err.contains("short"), "{wrong:?}");
}

#[test]
fn a_robot_is_not_named_where_none_is_asked() {
    for (args, advice) in [
        (&["-r", "192.168.1.10", "up"][..], "`r6 up --listen 192.168.1.10`"),
        (&["-r", "192.168.1.10", "up"], "`r6 -r 192.168.1.10 status`"),
        (&["sim", "--robot", "10.0.0.7:9761"], "`r6 sim --listen 10.0.0.7:9761`"),
        (&["-r", "10.0.0.7", "discover", "127.0.0.1:9"], "`r6 discover 10.0.0.7`"),
        (&["-r", "10.0.0.7", "alarm", "27"], "leave --robot out"),
    ] {
        let outcome = r6(args);
        assert_eq!((outcome.code, outcome.out.as_str()), (2, ""), "{outcome:?}");
        assert!(outcome.err.contains("asks no robot") && outcome.err.contains(advice), "{}", outcome.err);
    }
}

#[test]
fn a_panel_is_not_named_by_robot() {
    let robot = Robot::start(&[]);
    for args in
        [&["-r", robot.address(), "panel", "status"][..], &["panel", "estop", "--robot", robot.address()]]
    {
        let outcome = r6(args);
        assert_eq!((outcome.code, outcome.out.as_str()), (2, ""), "{outcome:?}");
        assert!(
            outcome.err.contains("nothing was done") && outcome.err.contains("--panel ADDR:PORT"),
            "{}",
            outcome.err
        );
    }
}

#[test]
fn whoever_is_there_is_found_by_asking() {
    let robot = Robot::start(&[]);
    let found = r6(&["discover", robot.address()]);
    assert_eq!(found.code, 0, "{found:?}");
    assert!(
        found.out.starts_with(&format!("{}: machineName `r6 virtual ", robot.address())),
        "{}",
        found.out
    );
    let json = r6(&["discover", robot.address(), "--json"]).json();
    assert_eq!((&json[0]["robot"], &json[0]["axis_count"]), (&robot.address().into(), &6.into()));
}

/// The first fenced block of the quick start that has `has` in it.
fn block(has: &str) -> String {
    let page = std::fs::read_to_string(crate::support::root().join("docs/QUICKSTART.md")).unwrap();
    let mut blocks = page.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next());
    blocks.find(|block| block.contains(has)).unwrap_or_else(|| panic!("no block has {has}")).to_owned()
}

#[test]
fn the_motion_of_the_quick_start_runs_to_its_end() {
    let file = TempFile::new("quickstart.toml", &block("[[instruction]]"));
    let robot = Robot::start(&[]);
    for _ in 0..2 {
        let outcome = robot.r6(&["run", file.path(), "--wait"]);
        assert_eq!(outcome.code, 0, "{outcome:?}");
        assert!(outcome.out.contains("the arm stands where the last move ends"), "{outcome:?}");
    }
    let drawn = r6(&["plot", file.path(), "--out", "-"]);
    assert_eq!(drawn.code, 0, "{drawn:?}");
}

#[test]
fn the_taught_program_of_the_quick_start_is_the_example() {
    let file = crate::support::root().join("examples/taught/camera-pick.toml");
    let example = std::fs::read_to_string(file).unwrap();
    let (_, steps) = example.split_once("\n\n").unwrap();
    assert_eq!(block("do = \"photo\""), steps);
}
