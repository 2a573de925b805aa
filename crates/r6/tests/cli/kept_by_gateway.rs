//! `r6 -g URL run --kept NAME`: programs that a gateway keeps.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::by_gateway::{Hall, code};
use crate::gateway_calls::{call_with, token};
use crate::support::{Robot, Running, r6};
use crate::told_by_gateway::{Answer, Fake, lease};

/// Stores a version of the program `turn`. Returns what the gateway answers of it.
fn store(hall: &Hall, engineer: &str, degrees: f64, etag: Option<&Value>) -> Value {
    let text = format!("[[instruction]]\ndo = \"axis-move\"\nto = [{degrees}, 0, 0, 0, 0, 0]\nspeed = 80\n");
    let line = etag.map_or_else(String::new, |etag| format!("If-Match: {}\r\n", etag.as_str().unwrap()));
    let body = json!({ "program": text }).to_string();
    let (status, stored) = call_with(&hall.url, engineer, "PUT", "/v1/programs/turn", &line, &body);
    assert!(status == 200 || status == 201, "{stored}");
    stored
}

#[test]
fn a_kept_program_runs_in_the_version_that_was_named() {
    let robot = Robot::start(&[]);
    let hall = Hall::start("kept-1", &[&format!("press={}", robot.address())], "operator", &[]);
    let none = hall.r6(&["run", "--kept", "turn", "--json"]);
    assert_eq!((none.code, code(&none)), (2, "no_such_program".into()), "{none:?}");
    assert!(none.err.contains("the gateway keeps no program"), "{}", none.err);

    let engineer = token(&hall.data, "engineer");
    let first = store(&hall, &engineer, 10.0, None);
    let second = store(&hall, &engineer, 20.0, Some(&first["etag"]));
    let [old, new] = [&first, &second].map(|stored| stored["sha256"].as_str().unwrap());

    let done = hall.r6(&["run", "--kept", "turn@1", "--sha256", &old.to_uppercase(), "--json"]);
    assert_eq!(done.code, 0, "{done:?}");
    let last: Value = serde_json::from_str(done.last_line()).unwrap();
    let run = &last["run"];
    assert_eq!((&last["event"], &run["state"]), (&"ended".into(), &"done".into()), "{last}");
    assert_eq!((&run["program"], &run["version"], &run["sha256"]), (&"turn".into(), &1.into(), &old.into()));
    assert_eq!(robot.value("axis-0"), 10.0);

    let other = hall.r6(&["run", "--kept", "turn", "--sha256", old, "--json"]);
    assert_eq!((other.code, code(&other)), (1, "other_text".into()), "{other:?}");
    assert_eq!(robot.value("axis-0"), 10.0);
    assert_eq!(hall.r6(&["status", "--json"]).json()["robots"][0]["lease"], Value::Null, "it is given back");

    let latest = hall.r6(&["-r", "press", "run", "--kept", "turn", "--sha256", new]);
    assert_eq!(latest.code, 0, "{latest:?}");
    assert!(latest.out.starts_with("run 2 on press: 1 steps of turn, version 2\n"), "{}", latest.out);
    assert_eq!(robot.value("axis-0"), 20.0);

    for (kept, told) in [
        ("trun", "nearest: `turn`"),
        ("turn@9", "the gateway keeps these versions of `turn`: 2, 1"),
        ("weld-left", "the gateway keeps turn"),
    ] {
        let wrong = hall.r6(&["run", "--kept", kept, "--json"]);
        assert_eq!((wrong.code, code(&wrong)), (2, "no_such_program".into()), "{wrong:?}");
        assert!(wrong.err.contains(told), "{kept}: {}", wrong.err);
    }
    let viewer = hall.r6_as("viewer", &["run", "--kept", "turn", "--json"]);
    assert_eq!((viewer.code, code(&viewer)), (1, "not_allowed".into()), "{viewer:?}");
}

#[test]
fn mistakes_of_a_kept_program_have_its_name() {
    let robot = Robot::start(&[]);
    let hall = Hall::start("kept-bad", &[&format!("press={}", robot.address())], "operator", &[]);
    let engineer = token(&hall.data, "engineer");
    let step = "[[instruction]]\ndo = \"wait\"\nsecond = 1\n";
    for (name, text) in
        [("pick", step.repeat(2)), ("weld", "append = true\n".to_owned() + &step.replace("d =", "ds ="))]
    {
        let body = json!({ "program": text }).to_string();
        let path = format!("/v1/programs/{name}");
        assert_eq!(call_with(&hall.url, &engineer, "PUT", &path, "", &body).0, 201);
    }

    let wrong = hall.r6(&["run", "--kept", "pick"]);
    assert_eq!(wrong.code, 2, "{wrong:?}");
    let lines: Vec<_> = wrong.err.lines().collect();
    assert!(lines.len() > 1 && lines[0].starts_with("pick:3:1: "), "{}", wrong.err);
    assert!(lines.iter().any(|line| line.starts_with("pick:6:1: ")), "{}", wrong.err);
    let wrong = hall.r6(&["run", "--kept", "pick@1", "--json"]);
    assert_eq!((wrong.code, code(&wrong)), (2, "bad_program".into()), "{wrong:?}");
    let first = &wrong.json()["mistakes"][0];
    assert_eq!((&first["file"], &first["line"], &first["column"]), (&"pick@1".into(), &3.into(), &1.into()));
    assert!(wrong.err.starts_with("pick@1:3:1: "), "{}", wrong.err);

    let whole = hall.r6(&["run", "--kept", "weld"]);
    assert!(whole.err.starts_with("weld: it appends to a list that is there"), "{}", whole.err);
}

#[test]
fn a_kept_program_is_named_right_and_needs_a_gateway() {
    let gateway = ["-g", "http://127.0.0.1:1"];
    for (args, told) in [
        (&["run", "--kept", "Pick"][..], "write NAME or NAME@VERSION"),
        (&["run", "--kept", "pick@0"], "write NAME or NAME@VERSION"),
        (&["run", "--kept", "pick", "square.toml"], "cannot be used with"),
        (&["run", "square.toml", "--sha256", "00"], "64 hexadecimal digits"),
        (&["run"], "Usage"),
    ] {
        let wrong = r6(&[&gateway[..], args].concat());
        assert_eq!(wrong.code, 2, "{args:?}: {wrong:?}");
        assert!((wrong.err + &wrong.out).contains(told), "{args:?}");
    }
    // Of a file it says nothing: without it the arm would move whatever the text is.
    let square = "../../examples/programs/square.toml";
    let hash = "0".repeat(64);
    for args in [
        &["run", square, "--sha256", &hash, "--dry-run"][..],
        &["-g", "http://127.0.0.1:1", "run", square, "--sha256", &hash],
    ] {
        let refused = r6(args);
        assert_eq!((refused.code, refused.out.as_str()), (2, ""), "{refused:?}");
        assert!(refused.err.contains("--sha256 goes with --kept alone"), "{}", refused.err);
    }
    let none = r6(&["run", "--kept", "pick"]);
    assert_eq!(none.code, 2, "{none:?}");
    assert!(
        none.err.contains("the programs that a gateway keeps") && none.err.contains("--gateway-url URL"),
        "{}",
        none.err
    );
}

/// Until the run is asked for, an interruption sends nothing.
#[test]
fn a_run_that_is_interrupted_while_the_lease_is_asked_for_is_not_asked_for() {
    let fake = Fake::start("kept", |_| Answer::Frozen);
    let run = Running::start_with_pipes(&fake.args(&["-r", "press-1", "run", "--kept", "pick"]));
    let begun = Instant::now();
    while fake.asked().is_empty() {
        assert!(begun.elapsed() < Duration::from_secs(10));
        std::thread::sleep(Duration::from_millis(5));
    }
    run.signal("INT");
    assert_eq!(run.code(), Some(1));
    assert_eq!(fake.asked(), ["POST /v1/robots/press-1/lease"]);
}

#[test]
fn a_run_that_is_not_the_one_that_was_asked_for_is_not_followed() {
    let run = |robot: &str, program: &str, version: u64, sha256: &str| {
        json!({
            "run_id": 5, "robot": robot, "state": "done", "program": program, "version": version, "sha256": sha256,
            "repeat": 1, "steps": 9, "accepted": 9, "done": 9, "lease": 1, "by": "token 1", "began_at": "…",
            "ended_at": "…", "because": null, "proof": "reached", "detail": "the arm stands",
        })
    };
    let asked = "1".repeat(64);
    for (told, code) in [
        (run("press-1", "pick", 3, &asked), 0),
        (run("saw", "pick", 3, &asked), 4),
        (run("press-1", "other", 3, &asked), 4),
        (run("press-1", "pick", 4, &asked), 4),
        (run("press-1", "pick", 3, &"0".repeat(64)), 4),
    ] {
        let shown = told.to_string();
        let fake = Fake::start("kept", move |what| match what {
            "POST /v1/robots/press-1/lease" | "DELETE /v1/robots/press-1/lease" => lease(),
            _ => Answer::With(202, told.clone()),
        });
        let done = fake.r6(&["run", "--kept", "pick@3", "--sha256", &asked]);
        assert_eq!(done.code, code, "{shown}: {done:?}");
        assert_eq!(done.err.contains("another run than asked for"), code == 4, "{}", done.err);
        assert_eq!(fake.asked().last().map(String::as_str), Some("DELETE /v1/robots/press-1/lease"));
    }
}

#[test]
fn a_run_of_a_kept_program_whose_answer_is_lost_is_asked_for_once() {
    let fake = Fake::start("kept", |what| match what {
        "POST /v1/robots/press-1/lease" | "DELETE /v1/robots/press-1/lease" => lease(),
        _ => Answer::Nothing,
    });
    let lost = fake.r6(&["run", "--kept", "pick@3"]);
    assert_eq!(lost.code, 4, "{lost:?}");
    assert!(lost.err.contains("look at the machine before going on"), "{}", lost.err);
    assert_eq!(
        fake.asked(),
        [
            "POST /v1/robots/press-1/lease",
            "POST /v1/robots/press-1/programs/run",
            "DELETE /v1/robots/press-1/lease"
        ]
    );
}
