//! What a kill of `r6 gateway` cuts short: a command, a run, a request for a run.

use std::time::Duration;

use r6_testkit::hostile::{Character, Delays};
use serde_json::Value;

use crate::gateway_calls::{call, call_with, gateway, get, token, until};
use crate::support::{Robot, Running, hostile, r6};

/// A gateway with the robot `press`, which is up.
struct Hall {
    _folder: tempfile::TempDir,
    data: String,
    gateway: Running,
    url: String,
    admin: String,
}

impl Hall {
    /// `robot`: its name and its address, as for `--robot`.
    fn start(robot: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path().join("data").display().to_string();
        let (gateway, url) = gateway(&data, &["--robot", robot]);
        let admin = token(&data, "admin");
        until_up(&url, &admin);
        Self { _folder: folder, data, gateway, url, admin }
    }
}

fn until_up(url: &str, admin: &str) {
    until(|| (get(url, admin, "/v1/robots/press").1["link"] == "up").then_some(()));
}

#[test]
fn a_command_that_a_kill_cuts_short_is_unknown_at_the_next_start_and_never_sent_again() {
    // Each command is answered after a minute, so the gateway is killed before.
    let delays = Delays { command: Duration::from_secs(60), ..Delays::default() };
    let (robot, controller) = hostile(Character { arms_itself: true, delays, ..Character::default() });
    let robot = format!("press={robot}");
    let Hall { _folder, data, gateway: first, url, admin } = Hall::start(&robot);
    let (status, lease) = call(&url, &admin, "POST", "/v1/robots/press/lease", "{}");
    assert_eq!(status, 200, "{lease}");
    let body = format!(r#"{{"command":"clearAlarm","lease":{}}}"#, lease["lease"]);
    let caller = {
        let (url, admin) = (url.clone(), admin.clone());
        std::thread::spawn(move || call(&url, &admin, "POST", "/v1/robots/press/commands", &body))
    };
    let entries = |url: &str| get(url, &admin, "/v1/audit").1["entries"].as_array().unwrap().clone();
    let of = |entries: &[Value], what: &str| -> Vec<Value> {
        entries.iter().filter(|entry| entry["what"] == what).cloned().collect()
    };
    let intent = until(|| of(&entries(&url), "command_intent").pop());
    first.kill();
    assert_eq!(caller.join().unwrap().0, 0, "no answer is no outcome");

    let (_second, url) = gateway(&data, &["--robot", &robot]);
    let outcomes = of(&entries(&url), "command_outcome");
    assert_eq!(outcomes.len(), 1, "{outcomes:?}");
    assert_eq!((&outcomes[0]["intent"], &outcomes[0]["outcome"]), (&intent["number"], &"unknown".into()));
    assert_eq!(get(&url, &admin, "/v1/robots/press").1["lease"], Value::Null);
    until_up(&url, &admin);
    assert_eq!(r6(&["gateway", "verify", "--data", &data, "--json"]).json()["whole"], true);
    drop(controller);
}

#[test]
fn a_run_that_a_kill_cuts_short_is_stopped_first_at_the_next_start_and_never_run_again() {
    let robot = Robot::start(&[]);
    let named = format!("press={}", robot.address());
    let Hall { _folder, data, gateway: first, url, admin } = Hall::start(&named);
    let acquire = |url: &str| {
        let (status, lease) = call(url, &admin, "POST", "/v1/robots/press/lease", "{\"duration_ms\":60000}");
        assert_eq!(status, 200, "{lease}");
        lease["lease"].clone()
    };
    let step = |angle: i32| {
        format!("[[instruction]]\ndo = \"axis-move\"\nto = [{angle}, 0, 0, 0, 0, 0]\nspeed = 1\n")
    };
    let text: String = [60, -60].repeat(8).into_iter().map(step).collect();
    let body = serde_json::json!({ "program": text, "lease": acquire(&url) }).to_string();
    let run = |url: &str, key: &str, body: &str| {
        let line = format!("Idempotency-Key: {key}\r\n");
        call_with(url, &admin, "POST", "/v1/robots/press/programs/run", &line, body)
    };
    let (status, begun) = run(&url, "one", &body);
    assert_eq!(status, 202, "{begun}");
    let asked = "/v1/robots/press/query?address=isMoving,RemoteCmdLen";
    let values = |url: &str| {
        let answer = get(url, &admin, asked).1;
        (answer["signals"][0]["value"].clone(), answer["signals"][1]["value"].clone())
    };
    until(|| (values(&url).0 == true).then_some(()));
    first.kill();

    let (_second, url) = gateway(&data, &["--robot", &named]);
    let path = format!("/v1/robots/press/runs/{}", begun["run_id"]);
    let ended = get(&url, &admin, &path).1;
    assert_eq!(
        (&ended["state"], &ended["because"]),
        (&"unknown".into(), &"gateway_killed".into()),
        "{ended}"
    );
    until_up(&url, &admin);
    until(|| (values(&url) == (false.into(), 0.into())).then_some(()));
    // The same request gets the same answer, and nothing moves.
    let again = run(&url, "one", &body);
    assert_eq!(again, (202, begun));
    assert_eq!(values(&url), (false.into(), 0.into()));
    // Another one runs, once the list is stopped and the program of the controller was started again.
    let lease = acquire(&url);
    let start = serde_json::json!({ "command": "startButton", "lease": lease }).to_string();
    until(|| (call(&url, &admin, "POST", "/v1/robots/press/commands", &start).0 == 200).then_some(()));
    until(|| {
        let mode =
            get(&url, &admin, "/v1/robots/press/query?address=curMode").1["signals"][0]["value"].clone();
        (mode == 7).then_some(())
    });
    let text = step(0).replace("speed = 1", "speed = 100");
    let next = serde_json::json!({ "program": text, "lease": lease }).to_string();
    let (status, next) = run(&url, "two", &next);
    assert_eq!(status, 202, "{next}");
    let path = format!("/v1/robots/press/runs/{}", next["run_id"]);
    until(|| (get(&url, &admin, &path).1["state"] == "done").then_some(()));
    let entries = get(&url, &admin, "/v1/audit?limit=1000").1["entries"].as_array().unwrap().clone();
    let outcomes: Vec<_> = entries.iter().filter(|entry| entry["what"] == "run_outcome").collect();
    assert_eq!((outcomes.len(), &outcomes[0]["run"]), (2, &ended["run_id"]), "{outcomes:?}");
    let stop = entries.iter().find(|entry| entry["what"] == "stop").unwrap();
    assert_eq!((&stop["actor"], &stop["confirmed"]), (&"gateway".into(), &true.into()));
}

#[test]
fn a_request_for_a_run_that_a_kill_leaves_without_answer_is_unknown_and_not_sent_again() {
    // Each list is answered after a minute, so the gateway is killed before.
    let delays = Delays { list: Duration::from_secs(60), ..Delays::default() };
    let (robot, controller) = hostile(Character { arms_itself: true, delays, ..Character::default() });
    let robot = format!("press={robot}");
    let Hall { _folder, data, gateway: first, url, admin } = Hall::start(&robot);
    let (status, lease) = call(&url, &admin, "POST", "/v1/robots/press/lease", "{}");
    assert_eq!(status, 200, "{lease}");
    let text = "[[instruction]]\ndo = \"wait\"\nseconds = 1\n";
    let body = serde_json::json!({ "program": text, "lease": lease["lease"] }).to_string();
    let run = |url: String, admin: String, body: String| {
        let path = "/v1/robots/press/programs/run";
        call_with(&url, &admin, "POST", path, "Idempotency-Key: one\r\n", &body)
    };
    let caller = {
        let (url, admin, body) = (url.clone(), admin.clone(), body.clone());
        std::thread::spawn(move || run(url, admin, body))
    };
    let intents = |url: &str| {
        let entries = get(url, &admin, "/v1/audit").1["entries"].as_array().unwrap().clone();
        entries.iter().filter(|entry| entry["what"] == "run_intent").count()
    };
    until(|| (intents(&url) == 1).then_some(()));
    let (status, problem) = run(url.clone(), admin.clone(), body.clone());
    assert_eq!((status, &problem["code"]), (409, &"in_progress".into()), "{problem}");
    first.kill();
    assert_eq!(caller.join().unwrap().0, 0, "no answer is no outcome");

    let (_second, url) = gateway(&data, &["--robot", &robot]);
    let (status, problem) = run(url.clone(), admin.clone(), body);
    assert_eq!((status, &problem["code"]), (504, &"outcome_unknown".into()), "{problem}");
    assert_eq!(intents(&url), 1);
    drop(controller);
}
