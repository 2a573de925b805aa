//! Failures as programs see them: one JSON object on stdout, the same for every command.

use std::net::{TcpListener, TcpStream};

use serde_json::{Value, json};

use crate::support::{Outcome, Robot, TempFile, r6};

/// The problem object of a failed run. It must be the only document on stdout.
fn problem(outcome: &Outcome) -> Value {
    let problem = outcome.json();
    holds(&problem, outcome);
    problem
}

/// Checks that a problem object agrees with the run itself.
fn holds(problem: &Value, outcome: &Outcome) {
    assert_eq!(problem["exit"], outcome.code, "{outcome:?}");
    assert!(problem["code"].as_str().is_some_and(|code| !code.is_empty()), "{outcome:?}");
    let message = problem["message"].as_str().unwrap_or_default();
    assert!(!message.is_empty() && !message.contains('\n'), "{outcome:?}");
    assert!(problem["advice"].is_string() || problem["advice"].is_null(), "{outcome:?}");
}

#[test]
fn a_wrong_command_line_is_a_problem() {
    for (args, message, advice) in [
        (&["query", "axis-9", "--json"][..], "nearest: `axis-n`", Value::Null),
        (
            &["query", "--jsn", "--json"],
            "unexpected argument '--jsn' found",
            json!("a similar argument exists: '--json'"),
        ),
        (
            &["stats", "--json"],
            "unrecognized subcommand 'stats'",
            json!("a similar subcommand exists: 'status'"),
        ),
        (&["move", "axes", "--json"], "required arguments were not provided: <DEGREES>...", Value::Null),
        (&["command", "modifyGSPD", "500", "--json"], "percent from 0 to 100", Value::Null),
        (&["run", "no-such.toml", "--json"], "cannot be read", Value::Null),
        (&["inspect", "no-such.bin", "--json"], "cannot be read", Value::Null),
        (&["plot", "no-such.toml", "--json"], "cannot be read", Value::Null),
        (&["discover", "127.0.0.1:no", "--json"], "is no address", Value::Null),
        (&["-r", "127.0.0.1:no", "status", "--json"], "is no address", Value::Null),
        (&["-r", "127.0.0.1", "panel", "status", "--json"], "nothing was done", Value::Null),
    ] {
        let outcome = r6(args);
        let problem = problem(&outcome);
        assert_eq!((outcome.code, &problem["code"]), (2, &json!("usage")), "{outcome:?}");
        assert!(problem["message"].as_str().unwrap().contains(message), "{args:?}: {problem}");
        if !advice.is_null() {
            assert_eq!(problem["advice"], advice, "{args:?}");
        }
        assert!(
            outcome.err.contains(message.split(": <").next().unwrap()),
            "people are told, too: {outcome:?}"
        );
        // Without `--json` stdout is for people.
        let without: Vec<_> = args.iter().copied().filter(|arg| *arg != "--json").collect();
        assert_eq!(r6(&without).out, "", "{without:?}");
    }
}

#[test]
fn nobody_there_is_a_problem() {
    // The local end of a connection: its port is in use, and no program listens on it.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let address = taken.local_addr().unwrap().to_string();
    for (args, code) in [
        (&["status"][..], "unreachable"),
        (&["query", "axis-0"], "unreachable"),
        (&["watch", "axis-0"], "unreachable"),
        (&["command", "actionStop"], "unreachable"),
        (&["move", "axes", "1"], "unreachable"),
        (&["stop"], "not_stopped"),
    ] {
        let outcome = r6(&[&["-r", &address], args, &["--json"]].concat());
        let problem = problem(&outcome);
        assert_eq!((outcome.code, problem["code"].as_str()), (3, Some(code)), "{outcome:?}");
    }
    let panel = r6(&["panel", "--panel", &address, "status", "--json"]);
    assert_eq!((panel.code, &problem(&panel)["code"]), (3, &json!("no_reply")), "{panel:?}");
    let found = r6(&["discover", &address, "--json"]);
    holds(&found.json()[0]["problem"], &found);
    assert_eq!(found.json()[0]["problem"]["code"], "unreachable");
}

#[test]
fn what_the_controller_refuses_is_a_problem() {
    let robot = Robot::start(&["--profile", "r6-host"]);
    let outcome = robot.r6(&["command", "clearAlarm", "--json"]);
    let refused = problem(&outcome);
    assert_eq!((outcome.code, &refused["code"]), (1, &json!("refused")), "{outcome:?}");
    let robot = Robot::start(&["--start", "stopped"]);
    for motion in [&["move", "axes", "1"][..], &["move", "axes", "1", "--append"]] {
        let outcome = robot.r6(&[motion, &["--json"]].concat());
        let not_ready = problem(&outcome);
        assert_eq!((outcome.code, &not_ready["code"]), (1, &json!("not_ready")), "{outcome:?}");
        assert_eq!(
            (&not_ready["event"], &not_ready["unmet"][0]["condition"]),
            (&json!("not_sent"), &json!("mode"))
        );
    }
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["move", "axes", "90", "--max-axis-step", "1", "--json"]);
    assert_eq!(problem(&outcome)["code"], "beyond_limits", "{outcome:?}");
}

#[test]
fn a_result_that_is_not_all_right_has_its_problem_in_it() {
    let robot = Robot::start(&["--start", "stopped"]);
    let status = robot.r6(&["status", "--json"]);
    holds(&status.json()["problem"], &status);
    assert_eq!((status.code, &status.json()["problem"]["code"]), (1, &json!("not_ready")));
    let query = robot.r6(&["query", "axis-0", "curMold", "--json"]);
    holds(&query.json()["problem"], &query);
    assert_eq!(
        (&query.json()["problem"]["code"], &query.json()["values"]["axis-0"]),
        (&json!("no_value"), &json!(0.0))
    );
    let alarm = r6(&["alarm", "42", "999999", "--json"]);
    assert_eq!(alarm.json()[0]["problem"], Value::Null);
    holds(&alarm.json()[1]["problem"], &alarm);
    let capture = TempFile::new("problem.bin", r#"{"reqType":"query","queryAddr":["axs-0"]}"#);
    let inspect = r6(&["inspect", capture.path(), "--json"]);
    holds(&inspect.json()["problem"], &inspect);
    let picture = TempFile::new("problem.svg", "");
    let wait = "[[instruction]]\ndo = \"wait\"\npoint = \"X010\"\nuntil = \"on\"\n";
    let wait = TempFile::new("problem.toml", wait);
    let plot = r6(&["plot", wait.path(), "--out", picture.path(), "--json"]);
    holds(&plot.json()["problem"], &plot);
    assert_eq!(plot.json()["problem"]["code"], "not_finished");
    // A run without a failure has no problem object.
    let ready = Robot::start(&[]);
    for args in [&["status"][..], &["query", "axis-0"], &["stop"]] {
        let outcome = ready.r6(&[args, &["--json"]].concat());
        assert_eq!((outcome.code, &outcome.json()["problem"]), (0, &Value::Null), "{outcome:?}");
    }
}

#[test]
fn watching_what_is_not_there_ends_as_asking_for_it() {
    let robot = Robot::start(&[]);
    let query = robot.r6(&["query", "axis-0", "curMold"]);
    let watch = robot.r6(&["watch", "axis-0", "curMold", "--every", "1ms", "--times", "3"]);
    assert_eq!((watch.code, watch.code), (1, query.code), "{watch:?}");
    assert_eq!(watch.err, query.err, "said once");
    let (heading, lines) = watch.out.split_once('\n').unwrap();
    assert_eq!(heading, "time  axis-0 [deg or mm]  curMold");
    let values: Vec<_> =
        lines.lines().filter_map(|line| line.split_once("  ")).map(|(_, values)| values).collect();
    assert_eq!(values, ["0.000  -"; 3]);
    let mut watch =
        crate::support::Running::start(&["-r", robot.address(), "watch", "curMold", "--every", "10ms"]);
    assert_eq!(watch.line(), "time  curMold");
    assert!(watch.line().ends_with("Z  -"));
    // The line comes before the reading is counted.
    watch.line();
    assert_eq!(watch.end("INT"), Some(1));
    let json = robot.r6(&["watch", "curMold", "--times", "1", "--json"]);
    holds(&json.json()["problem"], &json);
}

#[test]
fn nobody_is_asked_where_an_address_is_none() {
    let robot = Robot::start(&[]);
    let outcome = r6(&["discover", robot.address(), "127.0.0.1:no"]);
    assert_eq!((outcome.code, outcome.out.as_str()), (2, ""), "{outcome:?}");
    assert!(outcome.err.contains("`127.0.0.1:no` is no address"), "{}", outcome.err);
}

#[test]
fn the_newest_form_of_clear_alarm_can_be_sent() {
    let robot = Robot::start(&[]);
    let outcome = robot.r6(&["command", "clearAlarm", "1", "1"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!(outcome.out.ends_with(" ms: to the first line: yes, only the alarm: yes\n"), "{}", outcome.out);
    let json = robot.r6(&["command", "clearAlarm", "0", "1", "--json"]).json();
    assert_eq!(json["on_the_wire"], json!(["0", "1"]));
    assert_eq!(robot.r6(&["command", "clearAlarm", "--json"]).json()["on_the_wire"], json!([]));
    let wrong = robot.r6(&["command", "clearAlarm", "1"]);
    assert_eq!(wrong.code, 2, "{wrong:?}");
    assert!(wrong.err.contains("usage: r6 command clearAlarm [FIRST_LINE ONLY_ALARM]"), "{}", wrong.err);
}
