//! Motion, from the check of the machine to the stop.

use crate::support::{Robot, Running, r6};

/// An axis of a fresh robot, in degrees.
fn axis(robot: &Robot, number: u8) -> f64 {
    robot.value(&format!("axis-{number}")).as_f64().unwrap()
}

#[test]
fn the_first_motion_ends_where_it_was_sent() {
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["move", "axes", "10", "0", "0", "0", "30", "0", "--speed", "50", "--wait"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!(outcome.out.starts_with("1 instruction accepted after "), "{}", outcome.out);
    assert!(outcome.out.contains("\ndone after "), "{}", outcome.out);
    assert!((axis(&robot, 0) - 10.0).abs() < 1e-3 && (axis(&robot, 4) - 30.0).abs() < 1e-3);
    // A line of three numbers keeps the orientation.
    let before: Vec<_> = (3..6).map(|n| robot.value(&format!("world-{n}")).as_f64().unwrap()).collect();
    let x = robot.value("world-0").as_f64().unwrap() - 20.0;
    let (y, z) = (robot.value("world-1").as_f64().unwrap(), robot.value("world-2").as_f64().unwrap());
    let numbers = [x, y, z].map(|number| number.to_string());
    let numbers: Vec<_> = numbers.iter().map(String::as_str).collect();
    let outcome = robot.r6(&[&["move", "line"], &numbers[..], &["--speed", "20", "--wait"]].concat());
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!((robot.value("world-0").as_f64().unwrap() - x).abs() < 0.01);
    for (n, before) in (3..6).zip(before) {
        assert!((robot.value(&format!("world-{n}")).as_f64().unwrap() - before).abs() < 0.01, "world-{n}");
    }
}

#[test]
fn every_profile_takes_motion() {
    for profile in ["r6-host", "r6-pendant", "legacy"] {
        let robot = Robot::start(&["--profile", profile]);
        let outcome = robot.r6(&["move", "axes", "5", "--speed", "100", "--wait"]);
        assert_eq!(outcome.code, 0, "{profile}: {outcome:?}");
        assert!((axis(&robot, 0) - 5.0).abs() < 1e-3, "{profile}");
    }
}

#[test]
fn a_curve_goes_to_its_end() {
    let robot = Robot::start(&[]);
    let tool_down = ["move", "axes", "0", "10", "-20", "0", "-80", "0", "--speed", "100", "--wait"];
    assert_eq!(robot.r6(&tool_down).code, 0);
    let numbers = ["400", "50", "500", "180", "0", "180", "350", "100", "500", "180", "0", "180"];
    // The orientation is kept. A target of +180 for a tool that reads -180 would be a full turn.
    let curve = |more: &[&str]| {
        robot.r6(&[&["move", "curve"][..], &numbers, &["--speed", "20", "--mask", "0x07", "--wait"], more]
            .concat())
    };
    // The controller accepts a curve without a line before it in the list, and does not execute it. r6
    // reports that.
    let lone = curve(&[]);
    assert_eq!(lone.code, 1, "{lone:?}");
    assert!(
        lone.err.contains("not at 350.000 mm") && lone.err.contains("a curve wants a move before it"),
        "{lone:?}"
    );
    assert_eq!(robot.r6(&["command", "startButton"]).code, 0);
    let line = ["move", "line", "400", "0", "500", "--speed", "20", "--wait"];
    let outcome = robot.r6(&line);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    let outcome = curve(&["--append"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!((robot.value("world-0").as_f64().unwrap() - 350.0).abs() < 0.01);
    assert!((robot.value("world-1").as_f64().unwrap() - 100.0).abs() < 0.01);
}

#[test]
fn axes_that_are_not_given_stay() {
    let robot = Robot::start(&[]);
    assert_eq!(
        robot.r6(&["move", "axes", "0", "0", "0", "0", "20", "0", "--speed", "100", "--wait"]).code,
        0
    );
    assert_eq!(robot.r6(&["move", "axes", "-15", "--speed", "100", "--wait"]).code, 0);
    assert!((axis(&robot, 0) + 15.0).abs() < 1e-3 && (axis(&robot, 4) - 20.0).abs() < 1e-3);
}

#[test]
fn an_axis_that_is_not_there_is_named() {
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["move", "axes", "1", "2", "3", "4", "5", "6", "7", "--wait"]);
    assert_eq!(outcome.code, 2, "{outcome:?}");
    assert_eq!(
        outcome.err,
        "r6: nothing was sent: step 1: J7 has to be left out: by its axisNum this robot has fewer axes\n"
    );
    assert_eq!(robot.value("axis-0"), 0.0);
}

#[test]
fn a_robot_that_is_not_ready_is_sent_nothing() {
    let robot = Robot::start(&["--start", "stopped"]);
    let outcome = robot.r6(&["move", "axes", "10", "--wait"]);
    assert_eq!(outcome.code, 1);
    assert!(
        outcome.err.starts_with("r6: nothing was sent. NOT READY: mode is stop (3)\n"),
        "{}",
        outcome.err
    );
    assert_eq!(outcome.out, "");
    assert_eq!(robot.value("RemoteCmdLen"), 0);
}

#[test]
fn a_motion_beyond_the_limits_ends_with_its_alarm() {
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["move", "axes", "0", "0", "0", "0", "0", "359", "--speed", "100", "--wait"]);
    assert_eq!(outcome.code, 1, "{outcome:?}");
    assert!(outcome.err.contains("alarm 135 (J6: positive soft limit)"), "{}", outcome.err);
    let status = robot.r6(&["status"]);
    assert!(status.out.contains("NOT READY: alarm 135"), "{}", status.out);
}

#[test]
fn a_stop_ends_a_motion_and_clears_the_list() {
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["move", "axes", "90", "--speed", "1"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!(outcome.out.contains(" watch isMoving"), "{}", outcome.out);
    let outcome = robot.r6(&["stop"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!(outcome.out.contains("not an emergency stop"), "{}", outcome.out);
    let status = robot.r6(&["status", "--json"]).json();
    assert_eq!((&status["moving"], &status["list_length"]), (&false.into(), &0.into()));
    assert!(axis(&robot, 0) < 45.0);
    let json = robot.r6(&["stop", "--json"]).json();
    assert_eq!(json["confirmed"], true);
}

#[test]
fn giving_up_waiting_says_that_the_arm_goes_on() {
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["move", "axes", "90", "--speed", "1", "--wait", "--timeout", "50ms"]);
    assert_eq!(outcome.code, 4, "{outcome:?}");
    assert!(
        outcome.err.contains("the arm may go on moving") && outcome.err.contains(" stop`"),
        "{}",
        outcome.err
    );
    assert_eq!(robot.r6(&["stop"]).code, 0);
    // Ctrl-C has the same result.
    assert_eq!(robot.r6(&["command", "startButton"]).code, 0);
    let mut waiting =
        Running::start(&["-r", robot.address(), "move", "axes", "90", "--speed", "1", "--wait"]);
    assert!(waiting.line().starts_with("1 instruction accepted"));
    assert_eq!(waiting.end("INT"), Some(4));
}

#[test]
fn appending_goes_behind_what_runs() {
    let robot = Robot::start(&[]);
    assert_eq!(robot.r6(&["move", "axes", "5", "--speed", "1"]).code, 0);
    // Without --append r6 sends nothing to a moving robot.
    assert_eq!(robot.r6(&["move", "axes", "8", "--speed", "5"]).code, 1);
    let outcome = robot.r6(&["move", "axes", "8", "--speed", "100", "--append", "--wait"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!((axis(&robot, 0) - 8.0).abs() < 1e-3);
}

/// The JSON objects of stdout, one for each line.
fn events(out: &str) -> Vec<serde_json::Value> {
    out.lines()
        .map(|line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}")))
        .collect()
}

#[test]
fn programs_are_told_what_happens_line_by_line() {
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["move", "axes", "5", "--speed", "100", "--wait", "--json"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    // How often progress is seen depends on how busy the machine is.
    let told: Vec<_> =
        events(&outcome.out).into_iter().filter(|event| event["event"] != "progress").collect();
    let [accepted, stands] = &told[..] else { panic!("{outcome:?}") };
    assert_eq!((&accepted["event"], &accepted["instructions"]), (&"accepted".into(), &1.into()));
    assert_eq!((&accepted["replaced_list"], &accepted["repeats"]), (&true.into(), &false.into()));
    assert!(accepted["after_ms"].as_f64().unwrap() > 0.0);
    assert_eq!((&stands["event"], &stands["moved"]), (&"stands".into(), &true.into()));
    assert!((stands["axes"][0]["position"].as_f64().unwrap() - 5.0).abs() < 1e-3, "{stands}");
    assert_eq!(stands["pose"]["x_mm"], robot.value("world-0"));
    // A move beyond the limit raises an alarm, and the last line says so.
    let outcome = robot.r6(&["move", "axes", "500", "--speed", "100", "--wait", "--json"]);
    assert_eq!(outcome.code, 1, "{outcome:?}");
    let events_of = events(&outcome.out);
    let failed = events_of.last().unwrap();
    assert_eq!((&failed["event"], &failed["exit"]), (&"failed".into(), &1.into()));
    assert!(failed["message"].as_str().unwrap().contains("alarm 130"), "{failed}");
    assert!(outcome.err.contains("alarm 130"), "{}", outcome.err);
    // After the alarm the machine is not ready.
    let outcome = robot.r6(&["move", "axes", "1", "--json"]);
    assert_eq!(outcome.code, 1);
    let [not_sent] = &events(&outcome.out)[..] else { panic!("{outcome:?}") };
    assert_eq!(not_sent["event"], "not_sent");
    let conditions: Vec<_> =
        not_sent["unmet"].as_array().unwrap().iter().map(|one| one["condition"].clone()).collect();
    assert!(conditions.contains(&"alarm".into()), "{conditions:?}");
}

#[test]
fn a_program_that_is_run_tells_each_frame() {
    let robot = Robot::start(&["--profile", "r6-host"]);
    let outcome = robot.r6(&["run", "examples/programs/manual-6-1-1-axis-move.json", "--json"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    let [accepted] = &events(&outcome.out)[..] else { panic!("{outcome:?}") };
    assert_eq!((&accepted["event"], &accepted["repeats"]), (&"accepted".into(), &true.into()));
    assert_eq!(robot.r6(&["stop"]).code, 0);
    let outcome = r6(&["-r", "127.0.0.1:1", "run", "examples/programs/square.toml", "--json"]);
    assert_eq!((outcome.code, &events(&outcome.out)[0]["exit"]), (3, &3.into()));
}
