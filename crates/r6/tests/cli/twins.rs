//! `r6 gateway --twins`: programs are tried on virtual controllers beside the robots.

use std::net::TcpStream;

use serde_json::{Value, json};

use crate::gateway_calls::{call, call_with, gateway, get, token, until};
use crate::support::{Robot, TempFile, r6};

/// The address of a twin, from the line that names it.
fn address(line: &str, robot: &str) -> String {
    let rest = line.strip_prefix(&format!("twin of {robot}: {robot}-twin on "));
    let (address, _) = rest.and_then(|rest| rest.split_once(',')).unwrap_or_else(|| panic!("{line}"));
    address.to_owned()
}

#[test]
fn a_program_runs_on_a_twin_while_the_robots_stand_and_all_twins_end_with_the_gateway() {
    let robots = [Robot::start(&[]), Robot::start(&[])];
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data").display().to_string();
    let [press, saw] = ["press", "saw"].map(str::to_owned);
    let named = [format!("{press}={}", robots[0].address()), format!("{saw}={}", robots[1].address())];
    let start = ["--robot", &named[0], "--robot", &named[1], "--twins"];
    let (mut running, url) = gateway(&data, &start);
    let lines = [running.line(), running.line()];
    let twins = [address(&lines[0], "press"), address(&lines[1], "saw")];
    let operator = token(&data, "operator");
    let path = |robot: &str| format!("/v1/robots/{robot}");
    for robot in ["press", "saw", "press-twin", "saw-twin"] {
        until(|| (get(&url, &operator, &path(robot)).1["link"] == "up").then_some(()));
    }
    let state = get(&url, &operator, &path("press-twin")).1;
    assert_eq!(
        (&state["twin_of"], &state["virtual"], &state["address"]),
        (&json!("press"), &json!(true), &json!(twins[0]))
    );

    let text = "[[instruction]]\ndo = \"axis-move\"\nto = [30, 0, 0, 0, 0, 0]\nspeed = 100\n";
    let lease = call(&url, &operator, "POST", "/v1/robots/press-twin/lease", "{\"duration_ms\":60000}").1;
    let body = json!({ "program": text, "lease": lease["lease"] }).to_string();
    let key = "Idempotency-Key: one\r\n";
    let at = "/v1/robots/press-twin/programs/run";
    let (status, begun) = call_with(&url, &operator, "POST", at, key, &body);
    assert_eq!(status, 202, "{begun}");
    let run = format!("/v1/robots/press-twin/runs/{}", begun["run_id"]);
    let ended = until(|| Some(get(&url, &operator, &run).1).filter(|run| run["ended_at"] != Value::Null));
    assert_eq!(ended["state"], "done", "{ended}");
    // `r6 -g` tells them apart, as text and as JSON.
    let secret = TempFile::new("twins-token", &operator);
    let ask = |end: &[&str]| r6(&[&["-g", &url, "--token-file", secret.path()], end].concat());
    let told = ask(&["status", "--json"]).json();
    let told: Vec<_> = told["robots"]
        .as_array()
        .unwrap()
        .iter()
        .map(|robot| json!([robot["name"], robot["twin_of"], robot["twin"]]))
        .collect();
    let pair = |robot: &str| {
        let twin = format!("{robot}-twin");
        [json!([robot, null, twin]), json!([twin, robot, null])]
    };
    assert_eq!(told, [pair("press"), pair("saw")].concat());
    let of_twin = ask(&["-r", "press-twin", "status"]);
    assert!(of_twin.out.contains("press (this one is virtual)"), "{of_twin:?}");
    // A twin is never meant by leaving the name out.
    let nameless = ask(&["stop"]);
    assert_eq!(nameless.code, 2, "{nameless:?}");
    // The robots themselves are asked now, and not a value from before.
    let j1 = |robot: &str| {
        let asked = format!("/v1/robots/{robot}/query?address=axis-0");
        get(&url, &operator, &asked).1["signals"][0]["value"].as_f64().unwrap()
    };
    assert!((j1("press-twin") - 30.0).abs() < 0.01);
    assert_eq!([j1("press"), j1("saw"), j1("saw-twin")], [0.0; 3]);

    // The panel of a twin stops the twin, and a robot has none.
    let seen = ask(&["-r", "press-twin", "panel", "status", "--json"]).json();
    assert_eq!((&seen["virtual"], &seen["axes"][0]["name"]), (&json!(true), &json!("J1")));
    let refused = ask(&["-r", "press", "panel", "estop"]);
    assert!(
        refused.code == 2 && refused.err.contains("has no panel here, and nothing was done or stopped"),
        "{refused:?}"
    );
    let pressed = ask(&["-r", "press-twin", "panel", "estop"]);
    assert!(pressed.code == 0 && pressed.out.contains("EMERGENCY STOP pressed"), "{pressed:?}");
    let stopped = |robot: &str| get(&url, &operator, &path(robot)).1["stopped"].clone();
    assert_eq!(["press", "press-twin", "saw-twin"].map(stopped), [false, true, false].map(Value::from));
    // The run is over, and everything but a stop needs the lease.
    let held = json!({ "lease": lease["lease"] }).to_string();
    assert_eq!(call(&url, &operator, "DELETE", "/v1/robots/press-twin/lease", &held).0, 204);
    let released = ask(&["-r", "press-twin", "panel", "release"]);
    assert!(released.code == 0 && !released.out.contains("EMERGENCY"), "{released:?}");
    let refused = ask(&["-r", "press-twin", "panel", "button", "start"]);
    assert!(refused.code == 1 && refused.err.contains("the robot was stopped"), "{refused:?}");

    assert_eq!(running.end("TERM"), Some(0));
    for twin in twins {
        assert!(TcpStream::connect(&twin).is_err(), "{twin} has ended");
    }
}

#[test]
fn a_file_that_is_read_again_brings_twins_and_takes_them_away() {
    let folder = tempfile::tempdir().unwrap();
    let (data, file) = (folder.path().join("data").display().to_string(), folder.path().join("hall.toml"));
    let robot = |name: &str, port: u16| {
        let place = format!("[[robot]]\nname = \"{name}\"\naddress = \"127.0.0.1:{port}\"\n");
        place + "model = \"GENERIC-SCARA\"\nprofile = \"legacy\"\n"
    };
    std::fs::write(&file, robot("press", 1)).unwrap();
    let (mut running, url) = gateway(&data, &["--twins", "--config", &file.display().to_string()]);
    let line = running.line();
    assert!(line.ends_with(", GENERIC-SCARA, profile legacy"), "{line}");
    let of_press = address(&line, "press");
    assert!(running.line().starts_with("to make the first admin"));
    let viewer = token(&data, "viewer");
    let names = || -> Vec<_> {
        let robots = get(&url, &viewer, "/v1/robots").1["robots"].as_array().unwrap().clone();
        robots.iter().map(|robot| robot["name"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(names(), ["press", "press-twin"]);
    // It speaks as the firmware of its profile does.
    let up = || Some(get(&url, &viewer, "/v1/robots/press-twin").1).filter(|twin| twin["link"] == "up");
    assert_eq!(until(up)["identity"]["firmware"], "2.0.1.9");

    // `press` keeps its twin, and another robot brings one. A twin may have a raw port at the next start.
    let raw = "[[raw]]\nrobot = \"press-twin\"\nlisten = \"127.0.0.1:0\"\n";
    std::fs::write(&file, robot("press", 1) + &robot("saw", 2) + raw).unwrap();
    running.signal("HUP");
    let line = running.line();
    assert!(line.ends_with(": 2 added, 0 changed, 0 removed, 2 robots, 2 twins now"), "{line}");
    let of_saw = address(&running.line(), "saw");
    assert_eq!(names(), ["press", "press-twin", "saw", "saw-twin"]);
    assert_eq!(get(&url, &viewer, "/v1/robots/press-twin").1["address"], of_press);

    // A twin that was stopped goes with its robot: it has no arm that could be moved under another name.
    let operator = token(&data, "operator");
    until(|| (call(&url, &operator, "POST", "/v1/robots/saw-twin/stop", "").0 == 200).then_some(()));
    std::fs::write(&file, robot("press", 1) + raw).unwrap();
    running.signal("HUP");
    let line = running.line();
    assert!(line.ends_with(": 0 added, 0 changed, 2 removed, 1 robot, 1 twin now"), "{line}");
    assert_eq!(names(), ["press", "press-twin"]);
    assert!(TcpStream::connect(&of_saw).is_err(), "the twin of saw has ended");
    assert_eq!(running.end("TERM"), Some(0));
}

#[test]
fn twins_that_cannot_be_are_told_before_anything_starts() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data").display().to_string();
    let long = format!("{}=127.0.0.1:1", "x".repeat(28));
    for (robots, part) in [
        (["--robot", long.as_str()].as_slice(), "is longer than 32 characters"),
        (&["--robot", "a=127.0.0.1:1", "--robot", "a-twin=127.0.0.1:2"], "two robots are called `a-twin`"),
    ] {
        let args = [&["gateway", "--listen", "127.0.0.1:0", "--data", &data, "--twins"], robots].concat();
        let wrong = r6(&args);
        assert!(wrong.code == 2 && wrong.err.contains(part), "{args:?}: {wrong:?}");
    }
    assert!(!folder.path().join("data").exists(), "nothing was started");
    let file =
        TempFile::new("hall.toml", "[[robot]]\nname = \"a\"\naddress = \"127.0.0.1:1\"\nmodel = \"none\"\n");
    let wrong = r6(&["gateway", "--twins", "--config", file.path()]);
    assert!(wrong.code == 2 && wrong.err.contains("a model"), "{wrong:?}");
}
