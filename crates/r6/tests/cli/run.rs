//! `r6 run`: programs in JSON and in TOML.

use std::fmt::Write;

use crate::support::{Robot, TempFile, r6, root};

const MANUAL_EXAMPLE: &str = "examples/programs/manual-6-1-1-axis-move.json";

#[test]
fn the_manuals_example_runs_once() {
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["run", MANUAL_EXAMPLE, "--once", "--wait"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    let angle = robot.value("axis-4").as_f64().unwrap();
    assert!((angle + 90.0).abs() < 1e-3, "{angle}");
}

#[test]
fn a_list_that_repeats_is_named_and_has_no_end() {
    let outcome = r6(&["run", MANUAL_EXAMPLE, "--wait"]);
    assert_eq!(outcome.code, 2);
    assert!(outcome.err.contains("add --once"), "{}", outcome.err);
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["run", MANUAL_EXAMPLE]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    let stop = format!("this list repeats until stopped: r6 --robot {} stop\n", robot.address());
    assert!(outcome.out.contains(&stop), "{}", outcome.out);
    assert_eq!(robot.value("RemoteCmdLen"), 1);
    assert_eq!(robot.r6(&["stop"]).code, 0);
    assert_eq!(robot.value("RemoteCmdLen"), 0);
}

#[test]
fn the_example_in_toml_runs() {
    let robot = Robot::start(&[]);
    assert_eq!(robot.r6(&["command", "modifyGSPD", "100"]).code, 0);
    let outcome = robot.r6(&["run", "examples/programs/square.toml", "--wait"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!((robot.value("world-1").as_f64().unwrap() + 50.0).abs() < 0.01);
    assert_eq!(robot.value("output-0"), 0);
}

#[test]
fn every_example_is_read() {
    let mut count = 0;
    for entry in std::fs::read_dir(root().join("examples/programs")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "svg") {
            // A picture that a user plotted.
            continue;
        }
        let outcome = r6(&["run", path.to_str().unwrap(), "--dry-run"]);
        assert_eq!(outcome.code, 0, "{}: {outcome:?}", path.display());
        assert!(outcome.out.lines().all(|frame| frame.len() <= 2048 && frame.contains("\"AddRCC\"")));
        count += 1;
    }
    assert!(count > 1);
}

#[test]
fn a_long_list_goes_out_in_several_frames() {
    let mut text = String::new();
    for step in 0..20 {
        writeln!(text, "[[instruction]]\ndo = \"axis-move\"\nto = [{}]\nspeed = 100\nblend = 1", step % 2)
            .unwrap();
    }
    let program = TempFile::new("long.toml", &text);
    let frames = r6(&["run", program.path(), "--dry-run"]);
    let empty: Vec<_> = frames.out.lines().map(|frame| frame.contains("\"emptyList\":\"1\"")).collect();
    assert!(empty.len() > 1 && empty[0] && empty[1..].iter().all(|replace| !replace), "{empty:?}");
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["run", program.path(), "--wait"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert_eq!(outcome.out.matches("accepted after").count(), empty.len());
    assert!((robot.value("axis-0").as_f64().unwrap() - 1.0).abs() < 1e-3);
}

#[test]
fn nothing_is_sent_of_a_program_of_which_a_part_cannot_be() {
    let frame = |replace: u8, speed: &str| {
        format!(
            r#"{{"reqType":"AddRCC","emptyList":"{replace}","instructions":[{{"oneshot":"0","action":"4","m0":"10","m4":"30","ckStatus":"0x11","speed":"{speed}"}}]}}"#
        )
    };
    let program = TempFile::new("half.json", &format!("{}\n{}\n", frame(1, "20.0"), frame(0, "0.0")));
    let robot = Robot::start(&[]);
    for arguments in [&["run", program.path()][..], &["run", program.path(), "--once"]] {
        let outcome = robot.r6(arguments);
        assert_eq!(outcome.code, 2, "{outcome:?}");
        assert!(outcome.err.contains("step 2: `speed`"), "{}", outcome.err);
        assert_eq!((robot.value("RemoteCmdLen"), robot.value("axis-0")), (0.into(), 0.0.into()));
    }
}

/// A controller may take 0 for a coordinate that is left out, and does not report that it rounded a setting.
#[test]
fn what_a_controller_would_have_to_guess_is_not_sent() {
    let step = |mask: &str, speed: &str| {
        format!(
            r#"{{"reqType":"AddRCC","emptyList":"1","instructions":[{{"oneshot":"1","action":"10","m0":"400","m1":"0","m2":"500","ckStatus":"{mask}","speed":"{speed}"}}]}}"#
        )
    };
    let robot = Robot::start(&[]);
    for (step, says) in [
        (
            step("0x3F", "20.0"),
            "step 1: the axes that move has to be a mask of axes that all have a coordinate",
        ),
        (step("0x07", "5.55"), "step 1: `speed` has to be in steps of 0.1 percent; nearest: 5.5 or 5.6"),
    ] {
        let program = TempFile::new("guess.json", &step);
        let outcome = robot.r6(&["run", program.path()]);
        assert_eq!(outcome.code, 2, "{outcome:?}");
        assert!(outcome.err.contains(says), "{}", outcome.err);
    }
    for command in [&["modifyGSPD", "5.55"][..], &["modifyTool", "1", "0.0004", "0", "0", "0", "0", "0"]] {
        let outcome = robot.r6(&[&["command"], command].concat());
        assert_eq!(outcome.code, 2, "{outcome:?}");
        assert!(outcome.err.contains("nearest: "), "{}", outcome.err);
    }
}

#[test]
fn the_printed_example_is_refused_with_its_misprints() {
    let vector = r6_testkit::vector::load("manual_6_1_1_axis_move");
    let printed = TempFile::new("printed.json", &String::from_utf8_lossy(&vector.frame));
    let outcome = r6(&["run", printed.path(), "--dry-run"]);
    assert_eq!(outcome.code, 2, "{outcome:?}");
    assert!(outcome.err.contains(":18:19: key `ckStatus` has no value"), "{}", outcome.err);
    assert!(outcome.err.contains("0x3F"), "{}", outcome.err);
    assert_eq!(outcome.err.lines().count(), 2, "{}", outcome.err);
}

#[test]
fn comments_and_odd_spellings_are_taken_and_remarked() {
    let text = r#"{ // 唯一标识
        "dsID":"HCRemoteCommand", "cmdType":"AddRCC", "emptyList":1,
        "instructions":[{"oneshot":1,"action":4,"m0":5,"ckStatus":1,"speed":"20","remark":"red"}] // end
    }"#;
    let program = TempFile::new("odd.json", text);
    let outcome = r6(&["run", program.path(), "--dry-run"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    insta::assert_snapshot!(outcome.out, @r#"{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","packID":"1","emptyList":"1","instructions":[{"oneshot":"1","action":"4","m0":"5.000","ckStatus":"0x01","speed":"20.0"}]}"#);
    assert!(outcome.err.contains("`remark`"), "{}", outcome.err);
}

#[test]
fn what_is_wrong_in_a_file_has_its_line() {
    for (name, text, wrong) in [
        (
            "key.toml",
            "[[instruction]]\ndo = \"axis-move\"\nto = [1]\nsped = 5\n",
            ":4:1: instruction 1: there is no key `sped`\n    nearest: `speed`",
        ),
        (
            "kind.toml",
            "[[instruction]]\ndo = \"axes\"\n",
            ":2:6: instruction 1: `do` is \"axes\", but has to be one of \"axis-move\", ",
        ),
        (
            "type.toml",
            "[[instruction]]\ndo = \"axis-move\"\nto = [1]\nspeed = \"fast\"\n",
            ":4:9: instruction 1: `speed` is the text \"fast\", but has to be a number",
        ),
        ("one.toml", "[instruction]\ndo = \"wait\"\n", "in two pairs of brackets"),
        (
            "two.toml",
            "repeet = 1\n[[instruction]]\ndo = \"wait\"\nseconds = true\n",
            "two.toml:4:11: instruction 1: `seconds` is true, but has to be a number\n",
        ),
        ("step.toml", "\n[[instruction]]\ndo = \"wait\"\n", ":2:1: instruction 1: `seconds` is missing"),
        ("query.json", "{\"reqType\":\"query\",\"queryAddr\":[]}", ":1:1: this frame has no instructions"),
        (
            "two.json",
            "{\"reqType\":\"AddRCC\",\"instructions\":[]} {\"reqType\":\"AddRCC\",\"emptyList\":1,\"instructions\":[]}",
            "a later frame replaces the list",
        ),
        ("program.txt", "", "ends in .json or .toml"),
    ] {
        let file = TempFile::new(name, text);
        let outcome = r6(&["run", file.path(), "--dry-run"]);
        assert_eq!(outcome.code, 2, "{name}: {outcome:?}");
        assert!(outcome.err.contains(wrong), "{name}: {}", outcome.err);
        assert!(
            outcome.err.lines().count() <= if name == "two.toml" { 3 } else { 2 },
            "{name}: {}",
            outcome.err
        );
    }
}

#[test]
fn five_mistakes_are_five_lines_with_their_places_in_run_plot_and_guard() {
    let text = "repeet = true\n[[instruction]]\ndo = \"axis-move\"\nto = [1, 2]\nsped = 5\nblend = 12\n\
                [[instruction]]\ndo = \"linear-move\"\nspeed = 500\n";
    let file = TempFile::new("five.toml", text);
    let wrong_limits =
        "max_sped = 20\nmax_speed = 0\nmax_path_speed = 2.5\n[axes]\nJ1 = [90, -90]\nj2 = [0, 1]\n";
    let limits = TempFile::new("five-limits.toml", wrong_limits);
    let square = "examples/programs/square.toml";
    let of_program = [":1:1", ":5:1", ":6:9", ":7:1", ":9:9"];
    let of_limits = [":1:1", ":2:13", ":3:18", ":5:6", ":6:1"];
    for (file, wanted, args) in [
        (&file, of_program, &["run", file.path()][..]),
        (&file, of_program, &["plot", file.path()]),
        (&limits, of_limits, &["run", square, "--dry-run", "--guard", limits.path()]),
    ] {
        let outcome = r6(args);
        assert_eq!(outcome.code, 2, "{outcome:?}");
        let places: Vec<_> = outcome
            .err
            .lines()
            .filter_map(|line| line.strip_prefix(file.path())?.split(": ").next())
            .collect();
        assert_eq!(places, wanted, "{args:?}: {}", outcome.err);
    }
    let outcome = r6(&["run", file.path(), "--json"]);
    let problem: serde_json::Value = serde_json::from_str(outcome.out.lines().next().unwrap()).unwrap();
    let mistakes = problem["mistakes"].as_array().unwrap_or_else(|| panic!("{problem}"));
    assert_eq!(mistakes.len(), 5, "{problem}");
    assert_eq!((&mistakes[1]["line"], &mistakes[1]["column"]), (&5.into(), &1.into()), "{problem}");
}

/// The errors for the two kinds of programs point at each other.
#[test]
fn a_taught_program_is_told_apart() {
    let taught = TempFile::new("taught.toml", "[[step]]\ndo = \"remote\"\n");
    let outcome = r6(&["run", taught.path()]);
    assert!(
        outcome.code == 2 && outcome.err.contains("a taught program runs on the controller"),
        "{outcome:?}"
    );
    let outcome = r6(&["sim", "--listen", "127.0.0.1:0", "--program", "examples/programs/square.toml"]);
    assert!(
        outcome.code == 2 && outcome.err.contains("a list of instructions for a PC to send"),
        "{outcome:?}"
    );
}
