//! `r6 panel` against the panel of `r6 sim` and `r6 up`.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};

use serde_json::Value;

use crate::gateway_calls::until;
use crate::support::{Outcome, Running, TempFile, r6};

/// Virtual controllers with a panel.
struct Cell {
    _running: Running,
    robot: String,
    panel: String,
}

impl Cell {
    fn start(args: &[&str]) -> Self {
        let panel = ["sim", "--listen", "127.0.0.1:0", "--panel", "127.0.0.1:0"];
        let mut running = Running::start(&[&panel, args].concat());
        let mut robot = String::new();
        loop {
            let line = running.line();
            if let Some(address) = line.strip_prefix("listening on ") {
                robot = address.to_owned();
            } else {
                let panel = line.strip_prefix("panel on ").unwrap_or_else(|| panic!("{line}")).to_owned();
                return Self { _running: running, robot, panel };
            }
        }
    }

    fn panel(&self, args: &[&str]) -> Outcome {
        r6(&[&["panel", "--panel", &self.panel], args].concat())
    }

    #[track_caller]
    fn done(&self, args: &[&str]) -> Outcome {
        let outcome = self.panel(args);
        assert_eq!(outcome.code, 0, "{args:?}: {outcome:?}");
        outcome
    }
}

#[test]
fn the_robot_of_the_demo_that_drifts_works_again_once_it_was_cleared_and_started() {
    let cell = Cell::start(&[
        "--model",
        "BRTIRUS0805A",
        "--profile",
        "r6-pendant",
        "--program",
        "examples/hall/glue.toml",
        "--start",
        "auto",
        "--clock",
        "200x",
    ]);
    let read = |address: &str| -> Value {
        let answer = r6(&["-r", &cell.robot, "query", address, "--json"]);
        assert_eq!(answer.code, 0, "{answer:?}");
        serde_json::from_str::<Value>(&answer.out).unwrap()["values"][address].clone()
    };
    cell.done(&["button", "start"]);
    until(|| (read("curAlarm") == 130).then_some(()));
    let parts = read("counter-1");
    cell.done(&["clear"]);
    cell.done(&["button", "start"]);
    // Without the mend the first move ends in the alarm again, and no part is made.
    until(|| (read("counter-1") != parts).then_some(()));
}

#[test]
fn an_emergency_stop_ends_what_runs_until_everything_is_undone() {
    let cell = Cell::start(&[]);
    let pressed = cell.done(&["estop"]);
    let said = format!(
        "controller 1 at {}: mode auto (2), alarm 7 (emergency stop), at rest, EMERGENCY STOP pressed\n",
        cell.robot
    );
    assert_eq!(pressed.out, said);
    let status = r6(&["-r", &cell.robot, "status"]);
    let head = status.out.lines().next().unwrap_or_default();
    assert!(head.ends_with(&format!("at {}, a virtual controller", cell.robot)), "{head}");
    assert!(status.code == 1 && status.out.contains("alarm 7"), "{status:?}");
    for (args, part) in [
        (["button", "start"].as_slice(), "the emergency stop is pressed"),
        (&["button", "single-cycle"], "the emergency stop is pressed"),
        (&["clear"], "the emergency stop is pressed"),
    ] {
        let refused = cell.panel(args);
        assert!(refused.code == 1 && refused.err.contains(part), "{args:?}: {refused:?}");
    }
    let refused = r6(&["-r", &cell.robot, "command", "clearAlarm"]);
    assert!(refused.code == 1 && refused.err.contains("emergency stop"), "{refused:?}");
    cell.done(&["release"]);
    let refused = cell.panel(&["button", "start"]);
    assert!(refused.code == 1 && refused.err.contains("clear it first"), "{refused:?}");
    cell.done(&["clear"]);
    let said = format!("controller 1 at {}: mode running (7), no alarm, at rest\n", cell.robot);
    assert_eq!(cell.done(&["button", "start"]).out, said);
    assert_eq!(r6(&["-r", &cell.robot, "status"]).code, 0);
}

#[test]
fn inputs_alarms_and_programs_show_in_the_status() {
    let cell = Cell::start(&["--profile", "r6-pendant"]);
    let said = cell.done(&["input", "x1.011", "on"]).out;
    assert!(said.starts_with("X1.011 is on; controller 1 "), "{said}");
    cell.done(&["input", "EUX010", "on"]);
    cell.done(&["alarm", "135"]);
    cell.done(&["program", "register-move"]);
    let state = cell.done(&["status", "--json"]).json();
    assert_eq!(state["inputs_on"], serde_json::json!(["X1.011", "EUX010"]));
    assert_eq!((&state["alarm"], &state["program"]), (&135.into(), &"register-move".into()));
    assert_eq!(r6(&["-r", &cell.robot, "query", "input-1", "--json"]).json()["values"]["input-1"], 2);
    cell.done(&["input", "X1.011", "off"]);
    let text = cell.done(&["status"]).out;
    for part in [
        "a virtual controller",
        "alarm           135 (J6: positive soft limit)",
        "EUX010",
        "J6",
        "340",
        "NOT READY: alarm 135",
        "1 of 4 in register-move: wait until M011 goes on",
        "camera points   none waiting",
    ] {
        assert!(text.contains(part), "{part} in\n{text}");
    }
    assert!(!text.contains("X1.011"), "{text}");
}

/// The Python tests compare `Status.to_dict` with the same file.
#[test]
fn a_status_is_the_same_json_on_the_command_line_and_from_the_panel() {
    let cell = Cell::start(&[]);
    let host = cell.panel.strip_prefix("http://").unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    let request =
        format!("GET /v1/controllers/1/status HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    assert!(head.starts_with("HTTP/1.1 200"), "{head}");
    let of_the_panel: Value = serde_json::from_str(body).unwrap();
    let mut told = r6(&["-r", &cell.robot, "status", "--json"]).json();
    assert_eq!(told, of_the_panel);
    let robot = told.as_object_mut().unwrap().remove("robot");
    assert_eq!(robot, Some(cell.robot.clone().into()));
    assert_eq!(
        told,
        serde_json::from_str::<Value>(include_str!("../../../r6-api/tests/status.json")).unwrap()
    );
}

#[test]
fn an_axis_is_moved_by_hand() {
    let cell = Cell::start(&["--start", "manual"]);
    let moves = cell.done(&["jog", "j1", "-10", "--speed", "100"]).out;
    assert!(moves.ends_with(": mode manual (1), no alarm, moving\n"), "{moves}");
    let wait = || {
        // The loop is long enough: the move takes a tenth of a second, and each round runs a program.
        let states = (0..10_000).map(|_| cell.done(&["status", "--json"]).json());
        let mut states = states.skip_while(|state| state["moving"] == true);
        states.next().expect("the arm came to rest")
    };
    assert_eq!(wait()["axes"][0]["position"], -10.0);
    cell.done(&["home"]);
    let home = wait();
    assert_eq!((&home["axes"][0]["position"], &home["homed"]), (&0.0.into(), &true.into()));
    cell.done(&["key", "auto"]);
    let refused = cell.panel(&["jog", "J1", "+10"]);
    assert!(refused.code == 1 && refused.err.contains("turn the key to manual"), "{refused:?}");
}

#[test]
fn a_program_is_loaded_out_of_a_file() {
    let cell = Cell::start(&[]);
    let good = TempFile::new(
        "load.toml",
        "[[step]]\ndo = \"counter\"\nnumber = 0\nby = 1\n[[step]]\ndo = \"wait\"\nseconds = 3600\n",
    );
    let loaded = cell.done(&["load", good.path(), "--name", "my cell"]).out;
    assert!(loaded.ends_with(": mode running (7), no alarm, at rest\n"), "{loaded}");
    cell.done(&["program", "my cell"]);
    assert_eq!(cell.done(&["status", "--json"]).json()["program"], "my cell");
    assert_eq!(
        r6(&["-r", &cell.robot, "query", "counter-0", "--json"]).json()["values"]["counter-0"]["current"],
        1
    );
    // Without `--name` the program has the name of its file.
    let state = cell.done(&["load", good.path(), "--json"]).json();
    let stem = std::path::Path::new(good.path()).file_stem().unwrap().to_str().unwrap();
    assert!(state["programs"].as_array().unwrap().iter().any(|name| name == stem), "{state}");

    let bad = TempFile::new("bad.toml", "[[step]]\ndo = \"remote\"\n[[step]]\ndo = \"wiat\"\n");
    for (args, code, parts) in [
        (
            &["load", bad.path(), "--name", "bad"][..],
            2,
            &[bad.path(), "bad.toml:4:6: step 2", "\"wait\""][..],
        ),
        (&["load", good.path(), "--name", "my cell"], 1, &[good.path(), "`my cell` runs", "stop it first"]),
        (&["load", good.path(), "--name", ""], 2, &["--name"]),
        (&["load", "no-such.toml"], 2, &["no-such.toml", "cannot be read"]),
    ] {
        let outcome = cell.panel(args);
        assert_eq!(outcome.code, code, "{outcome:?}");
        for part in parts {
            assert!(outcome.err.contains(part), "{part}: {}", outcome.err);
        }
    }
}

#[test]
fn a_start_that_ends_at_once_in_an_alarm_is_no_success() {
    let file = TempFile::new("alarm.toml", "[[step]]\ndo = \"alarm\"\nnumber = 5007\n");
    let cell = Cell::start(&["--program", file.path()]);
    for button in ["start", "single-cycle", "single-step"] {
        cell.done(&["clear"]);
        let outcome = cell.panel(&["button", button]);
        assert_eq!(outcome.code, 1, "{outcome:?}");
        assert!(outcome.err.contains("5007") && outcome.out.contains("5007"), "{outcome:?}");
    }
    cell.done(&["clear"]);
    let outcome = cell.panel(&["button", "start", "--json"]);
    assert_eq!((outcome.code, &outcome.json()["alarm"]), (1, &5007.into()));
    // A press that starts nothing still succeeds.
    assert_eq!(cell.panel(&["button", "stop"]).code, 0);
}

#[test]
fn each_of_several_controllers_has_its_number() {
    let cell = Cell::start(&["--count", "2"]);
    cell.done(&["--controller", "2", "key", "stop"]);
    assert_eq!(cell.done(&["status", "--json"]).json()["mode"], 7);
    assert_eq!(cell.done(&["status", "--json", "--controller", "2"]).json()["mode"], 3);
    let outcome = cell.panel(&["status", "--controller", "3"]);
    assert!(outcome.code == 2 && outcome.err.contains("there are 1 to 2"), "{outcome:?}");
}

#[test]
fn what_is_wrong_is_told_with_its_exit_code() {
    let cell = Cell::start(&[]);
    for (args, code, part) in [
        (["input", "Y010", "on"].as_slice(), 2, "no input"),
        (&["input", "X10", "on"], 2, "X010"),
        (&["button", "strat"], 2, "start"),
        (&["jog", "J9", "1"], 2, "J1 to J8"),
        (&["jog", "J7", "1"], 2, "J1 to J6"),
        (&["jog", "J1", "0"], 2, "other than 0"),
        (&["alarm", "0"], 2, "10000"),
        (&["program", "remot"], 1, "nearest: `remote`"),
    ] {
        let outcome = cell.panel(args);
        assert_eq!(outcome.code, code, "{args:?}: {outcome:?}");
        assert!(outcome.err.contains(part), "{args:?}: {}", outcome.err);
    }
    assert_eq!(r6(&["panel", "--panel", "https://localhost", "status"]).code, 2);
}

#[test]
fn a_panel_that_is_not_there_or_says_nothing_is_no_reply() {
    let closed = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let outcome = r6(&["panel", "--panel", &closed, "estop"]);
    assert!(outcome.code == 3 && outcome.err.contains("r6 up"), "{outcome:?}");

    let mute = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = mute.local_addr().unwrap().to_string();
    let hang_up = std::thread::spawn(move || {
        for stream in mute.incoming().take(2) {
            drop(stream);
        }
    });
    assert_eq!(r6(&["panel", "--panel", &address, "status"]).code, 3);
    // The panel may have carried out the action.
    assert_eq!(r6(&["panel", "--panel", &address, "estop"]).code, 4);
    hang_up.join().unwrap();
}

#[test]
fn a_panel_for_other_machines_has_to_be_wanted() {
    for command in ["sim", "up"] {
        let outcome = r6(&[command, "--listen", "127.0.0.1:0", "--panel", "0.0.0.0:0"]);
        assert!(outcome.code == 2 && outcome.err.contains("--panel-open"), "{outcome:?}");
    }
    let mut open =
        Running::start(&["sim", "--listen", "127.0.0.1:0", "--panel", "0.0.0.0:0", "--panel-open"]);
    assert!(open.line().starts_with("listening on "));
    assert!(open.line().starts_with("panel on http://0.0.0.0:"));
}

#[test]
fn up_has_a_panel_unless_told() {
    let mut up = Running::start(&["up", "--listen", "127.0.0.1:0"]);
    let lines = [up.line(), up.line(), up.line()];
    while !up.line().contains(" move axes ") {}
    let panel = lines[2].strip_prefix("panel on http://").unwrap_or_else(|| panic!("{lines:?}"));
    assert_eq!(r6(&["panel", "--panel", panel, "key", "stop"]).code, 0);
    // A program that takes no motion from a PC would refuse the one to try, and be stopped.
    let mut pick = Running::start(&["up", "--listen", "127.0.0.1:0", "--program", "pick-and-place"]);
    loop {
        let line = pick.line();
        assert!(!line.contains(" move axes "), "{line}");
        if line.contains(" watch ") {
            break;
        }
    }
    let mut without =
        Running::start(&["up", "--listen", "127.0.0.1:0", "--panel", "off", "--gateway", "off"]);
    for _ in 0..2 {
        without.line();
    }
    assert!(without.line().starts_with("try: "));

    let holder = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = holder.local_addr().unwrap().to_string();
    let outcome = r6(&["up", "--listen", "127.0.0.1:0", "--panel", &address]);
    assert!(outcome.code == 2 && outcome.err.contains(&address), "{outcome:?}");
}

#[test]
fn where_no_panel_is_the_option_that_names_it_comes_first() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let refusing = listener.local_addr().unwrap().to_string();
    drop(listener);
    let outcome = r6(&["panel", "--panel", &refusing, "status"]);
    assert_eq!(outcome.code, 3, "{outcome:?}");
    let advice = outcome.err.lines().nth(1).unwrap();
    let option = advice.find("--panel ADDR:PORT").unwrap();
    assert!(advice.contains("R6_PANEL") && advice.contains("R6_ROBOT does not count"), "{advice}");
    assert!(advice.find("start one").is_some_and(|start| start > option), "{advice}");
}
