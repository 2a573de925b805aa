//! Commands that need no robot, and wrong command lines.

use crate::help::SUBCOMMANDS;
use crate::support::{TempFile, r6};

#[test]
fn an_alarm_is_explained() {
    let outcome = r6(&["alarm", "135"]);
    assert_eq!(outcome.code, 0);
    insta::assert_snapshot!(outcome.out, @r"
    alarm 135: J6: positive soft limit
      what to do: the target, or the way to it, lies beyond the soft limit: correct it, move the axis back by hand if it stands there, then clear the alarm
      real controllers were seen to raise it
    ");
    let json = r6(&["alarm", "42", "135", "--json"]).json();
    assert_eq!(json[0]["code"], 42);
    assert_eq!(json[1]["axis"], "J6");
}

#[test]
fn a_word_that_is_none_is_never_taken_for_one_that_moves() {
    for wrong in ["mov", "remove", "runn"] {
        let outcome = r6(&[wrong]);
        assert_eq!(outcome.code, 2);
        assert!(
            !outcome.err.contains("'move'") && !outcome.err.contains("'run'"),
            "{wrong}: {}",
            outcome.err
        );
    }
    assert!(r6(&["statu"]).err.contains("'status'"));
}

#[test]
fn an_alarm_that_nobody_knows_is_code_1() {
    let outcome = r6(&["alarm", "4999"]);
    assert_eq!(outcome.code, 1);
    assert!(outcome.out.contains("not in the table"), "{}", outcome.out);
}

#[test]
fn tables_are_printed_without_a_robot() {
    let commands = r6(&["command", "--list"]);
    assert_eq!(commands.code, 0);
    assert!(commands.out.contains("rewriteData REGISTER VALUE SAVABLE"), "{}", commands.out);
    assert_eq!(r6(&["command", "--list", "--json"]).json().as_array().map(Vec::len), Some(19));
    let addresses = r6(&["query", "--list"]);
    assert_eq!(addresses.code, 0);
    assert!(
        addresses.out.lines().any(|line| line.starts_with("axis-n") && line.contains("0–7")),
        "{}",
        addresses.out
    );
    assert_eq!(r6(&["query", "--list", "--json"]).json().as_array().map(Vec::len), Some(26));
}

#[test]
fn a_wrong_argument_is_answered_with_a_right_one() {
    for (args, right) in [
        (["query", "foo"], "`r6 query --list` prints them all"),
        (["watch", "currAlarm"], "nearest: `curAlarm`"),
        (["sim", "--listen=9760"], "127.0.0.1:9760 for this machine alone"),
        (["up", "--listen=localhost:9760"], "127.0.0.1:9760 for this machine alone"),
        (["sim", "--panel=9770"], "write IP:PORT, as 127.0.0.1:9770"),
        (
            ["up", "--panel=no"],
            "write IP:PORT, as 127.0.0.1:9770, or 127.0.0.1:0 for any free port; or `off`",
        ),
    ] {
        let outcome = r6(&args);
        assert_eq!(outcome.code, 2, "{args:?}");
        assert!(outcome.err.contains(right), "{args:?}: {}", outcome.err);
    }
}

#[test]
fn completions_are_for_every_shell() {
    for (shell, part) in [("bash", "complete -F"), ("zsh", "#compdef r6"), ("fish", "complete -c r6")] {
        let outcome = r6(&["completions", shell]);
        assert_eq!(outcome.code, 0);
        assert!(outcome.out.contains(part), "{shell}");
        let words = ["plot", "global-speed", "curAlarm", "axis-0", "modifyGSPD", "startButton"];
        // The script for fish does not complete arguments without an option.
        let known = if shell == "fish" { 2 } else { words.len() };
        for word in &words[..known] {
            assert!(outcome.out.contains(word), "{shell} does not complete {word}");
        }
    }
}

#[test]
fn every_subcommand_has_a_man_page() {
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("man");
    let outcome = r6(&["man", "--to", to.to_str().unwrap()]);
    assert_eq!((outcome.code, outcome.err.as_str()), (0, ""));
    let page = |name: &str| {
        std::fs::read_to_string(to.join(format!("{name}.1")))
            .unwrap_or_else(|error| panic!("{name}: {error}"))
    };
    for words in SUBCOMMANDS {
        let name = format!("r6-{}", words.replace(' ', "-"));
        let text = page(&name);
        assert!(text.contains(&format!(".TH {name} 1")), "{name}: {text}");
        // An example has a line of its own, as in the help.
        assert!(text.contains(".SH EXAMPLES\n.nf\n  r6 "), "{name}: {text}");
    }
    assert!(page("r6").contains(".SH \"EXIT STATUS\"\n.nf\n  0  done\n"), "{}", page("r6"));
    assert!(!to.join("r6-help.1").exists(), "what the help hides");

    let file = TempFile::new("no-folder", "");
    let outcome = r6(&["man", "--to", file.path()]);
    assert_eq!(outcome.code, 2);
    assert!(outcome.err.contains("cannot be written"), "{}", outcome.err);
}

#[test]
fn a_dry_run_prints_the_frame_and_asks_nobody() {
    let outcome = r6(&[
        "-r",
        "127.0.0.1:1",
        "move",
        "axes",
        "0",
        "10",
        "-20",
        "0",
        "30",
        "0",
        "--speed",
        "20",
        "--blend",
        "3",
        "--dry-run",
    ]);
    assert_eq!((outcome.code, outcome.err.as_str()), (0, ""));
    insta::assert_snapshot!(outcome.out, @r#"{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","packID":"1","emptyList":"1","instructions":[{"oneshot":"1","action":"4","m0":"0.000","m1":"10.000","m2":"-20.000","m3":"0.000","m4":"30.000","m5":"0.000","m6":"0.000","m7":"0.000","ckStatus":"0x3F","speed":"20.0","delay":"0.0","smooth":"3"}]}"#);
}

#[test]
fn lines_and_curves_have_their_own_actions() {
    let line = r6(&["move", "line", "450", "0", "500.5", "--append", "--dry-run"]).json();
    let step = &line["instructions"][0];
    assert_eq!(
        (&line["emptyList"], &step["action"], &step["ckStatus"]),
        (&"0".into(), &"10".into(), &"0x07".into())
    );
    assert_eq!(step["m2"], "500.500");
    let numbers = ["450", "50", "500", "180", "0", "0", "400", "-100", "500", "180", "0", "-1"];
    let curve = r6(&[&["move", "curve"][..], &numbers, &["--delay", "0.5", "--dry-run"]].concat()).json();
    let step = &curve["instructions"][0];
    assert_eq!((&step["action"], &step["ckStatus"]), (&"17".into(), &"0x3F".into()));
    assert_eq!(
        (&step["m1"], &step["m1_p"], &step["m5_p"]),
        (&"50.000".into(), &"-100.000".into(), &"-1.000".into())
    );
    assert_eq!(step["delay"], "0.5");
}

/// Each command line is wrong, and the message must contain the text beside it.
#[test]
fn a_wrong_command_line_is_code_2_and_says_why() {
    let cases: [(&[&str], &str); 18] = [
        (&["alarm", "-1"], "an alarm code is a whole number from 0 to 4294967295"),
        (&["query", "axis-9"], "nearest: `axis-n` with n from 0 to 7"),
        (&["query", "curAlrm"], "nearest: `curAlarm`"),
        (&["command", "modifyGSP", "5"], "nearest: `modifyGSPD`"),
        (&["command", "modifyGSPD", "500"], "percent from 0 to 100"),
        (&["command", "modifyOutput", "0", "3"], "usage: r6 command modifyOutput BOARD POINT STATE"),
        (&["move", "axes"], "required"),
        (&["move", "axes", "1", "2", "3", "4", "5", "6", "7", "8", "9"], "unexpected value"),
        (&["move", "axes", "nan"], "a number of mm or degrees"),
        (&["move", "axes", "1", "--speed", "0"], "percent from 0.1 to 100"),
        (&["move", "axes", "1", "--speed", "0.05"], "percent from 0.1 to 100"),
        (&["move", "axes", "1", "--blend", "10"], "from 0 to 9"),
        (&["move", "axes", "1", "2", "--mask", "0x07"], "mask 0x07 names J3, for which no number is given"),
        (&["move", "line", "1", "2", "3", "4"], "3 or 6 numbers"),
        (&["move", "curve", "1", "2", "3"], "a curve has 12 numbers, 3 given"),
        (&["watch", "axis-0", "--every", "1h"], "write a time as 100ms"),
        (&["sim", "--profile", "hc2"], "nearest: `hc1`"),
        (&["sim", "--listen", "127.0.0.1:0", "--model", "BRTIRUS0707B"], "nearest: `BRTIRUS0707A`"),
    ];
    for (args, wrong) in cases {
        let outcome = r6(args);
        assert_eq!(outcome.code, 2, "{args:?}: {outcome:?}");
        assert!(outcome.err.contains(wrong), "{args:?}: {}", outcome.err);
        assert_eq!(outcome.out, "", "{args:?}");
    }
}

#[test]
fn a_wrong_model_file_names_line_field_and_wanted_value() {
    let file = TempFile::new("wrong-model.toml", "name = \"my arm\"\nkind = \"skara\"\n");
    let outcome = r6(&["sim", "--model", file.path()]);
    assert_eq!(outcome.code, 2);
    let wanted = "wrong-model.toml:2:8: `kind` is \"skara\", but has to be one of \"six-axis\", \"scara\", \"cartesian\"\n    nearest: \"scara\"";
    assert!(outcome.err.contains(wanted), "{}", outcome.err);
    let outcome = r6(&["sim", "--model", "no-such-file.toml"]);
    assert_eq!(outcome.code, 2);
    assert!(outcome.err.contains("cannot be read"), "{}", outcome.err);
}

#[test]
fn a_wrong_profile_file_is_named() {
    let file = TempFile::new("wrong-profile.toml", "max_conections = 2");
    let outcome = r6(&["sim", "--profile", file.path()]);
    assert_eq!(outcome.code, 2);
    assert!(outcome.err.contains("max_connections"), "{}", outcome.err);
}
