//! `r6 sim` and `r6 up` as processes.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;

use crate::support::{Robot, Running, TempFile, r6};

#[test]
fn a_signal_ends_sim_cleanly() {
    for signal in ["INT", "TERM"] {
        let mut sim = Running::start(&["sim", "--listen", "127.0.0.1:0", "--count", "1"]);
        assert!(sim.line().starts_with("listening on 127.0.0.1:"));
        assert_eq!(sim.end(signal), Some(0), "{signal}");
    }
}

#[test]
fn a_damaged_state_is_told_before_anybody_connects() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("controller-1.json"), "{\"version\"").unwrap();
    let mut sim =
        Running::start(&["sim", "--listen", "127.0.0.1:0", "--state", folder.path().to_str().unwrap()]);
    assert!(sim.line().starts_with("listening on "));
    let told = sim.line();
    assert!(told.contains("alarm 14") && told.contains("controller-1.damaged-1.json"), "{told}");
    assert_eq!(sim.end("INT"), Some(0));
}

#[test]
fn several_addresses_are_several_controllers() {
    let args = [
        "sim",
        "--listen",
        "127.0.0.1:0",
        "--listen",
        "127.0.0.1:0",
        "--profile",
        "legacy",
        "--start",
        "auto",
    ];
    let mut sim = Running::start(&args);
    for _ in 0..2 {
        let line = sim.line();
        let address = line.strip_prefix("listening on ").unwrap();
        let status = r6(&["-r", address, "status", "--json"]).json();
        assert_eq!((&status["mode"], &status["firmware"]), (&2.into(), &"2.0.1.9".into()));
        assert_eq!(status["virtual"], true);
    }
}

#[test]
fn up_without_a_terminal_prints_lines() {
    for signal in ["INT", "TERM"] {
        let mut up = Running::start(&["up", "--listen", "127.0.0.1:0"]);
        let line = up.line();
        let address = line.strip_prefix("listening on ").unwrap().to_owned();
        assert!(up.line().contains("BRTIRUS0707A, profile hc1"));
        let panel = up.line();
        let panel = panel.strip_prefix("panel on http://").unwrap();
        let gateway = up.line();
        let gateway =
            gateway.strip_prefix("gateway on http://").unwrap().strip_suffix(", robot `virtual`").unwrap();
        let raw = up.line();
        let raw = raw.strip_prefix("raw port of the gateway, for socket scripts, on ").unwrap().to_owned();
        let page = up.line();
        let secret = page
            .strip_prefix(&format!("dashboard, with its sign-in for this start, on http://{gateway}/#"))
            .unwrap_or_else(|| panic!("{page}"));
        assert_eq!(secret.len(), 43, "{page}");
        for _ in 0..2 {
            let hint = up.line();
            assert!(hint.starts_with(&format!("try: r6 -r {address} ")), "{hint}");
        }
        assert_eq!(up.line(), format!("try: r6 panel --panel {panel} status"));
        let curl = up.line();
        let token = curl
            .strip_prefix("try: curl -sN -H @")
            .and_then(|rest| rest.strip_suffix(&format!(" '{gateway}/v1/live?signal=axis-0'")));
        let token = Path::new(token.unwrap_or_else(|| panic!("{curl}")));
        assert!(up.line().starts_with(&format!("try: r6 -r {address} watch ")));
        assert_eq!(r6(&["-r", &address, "stop"]).code, 0);
        assert_ne!(up.line(), "", "a change of state is a line");
        let header = std::fs::read_to_string(token).unwrap();
        follow(gateway, &header, "/v1/live?signal=axis-0", "\"address\":\"axis-0\",\"value\":0.0");
        // An old script moves the arm over the raw port.
        let start = r6(&["-r", &raw, "command", "startButton"]);
        assert_eq!(start.code, 0, "{start:?}");
        // The gateway has the panel of this robot, too.
        let url = format!("http://{gateway}");
        let ask = ["-g", &url, "--token-file", token.to_str().unwrap(), "panel", "button", "pause"];
        let paused = r6(&ask);
        assert!(paused.code == 0 && paused.out.contains(&address), "{paused:?}");
        let folder = token.parent().unwrap();
        let mode = std::os::unix::fs::PermissionsExt::mode(&std::fs::metadata(folder).unwrap().permissions());
        assert_eq!(mode & 0o777, 0o700, "the token is for its owner alone");
        assert_eq!(up.end(signal), Some(0), "{signal}");
        assert!(!folder.exists(), "the folder goes with the cell");
    }
}

/// Follows a stream of events, as `curl -H @FILE` does, until one has this text.
fn follow(gateway: &str, header: &str, path: &str, text: &str) {
    let mut stream = TcpStream::connect(gateway).unwrap();
    stream.set_read_timeout(Some(std::time::Duration::from_secs(20))).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {gateway}\r\n{}\r\n\r\n", header.trim_end()).unwrap();
    let mut lines = BufReader::new(stream).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.starts_with("data:") && line.contains(text)), "{text} never came");
}

/// A program from a file runs and can call another one. The error for a wrong program says where it is wrong.
#[test]
fn programs_of_ones_own_are_played() {
    let part = r#"{"step": [{"do": "register", "number": 850, "to": 77}]}"#;
    let part = TempFile::new("part.json", part);
    let stem = std::path::Path::new(part.path()).file_stem().unwrap().to_str().unwrap().to_owned();
    let main = format!("[[step]]\ndo = \"call\"\nprogram = \"{stem}\"\n[[step]]\ndo = \"remote\"\n");
    let main = TempFile::new("cell.toml", &main);
    let robot = Robot::start(&["--program", main.path(), "--program", part.path()]);
    assert_eq!(robot.value("Addr-850"), 77);
    let names = robot.value("moldList").to_string();
    assert!(names.contains("-cell\"") && names.contains(&stem) && names.contains("\"palletise\""), "{names}");
    let refused = |args: &[&str], complaint: &str| {
        let outcome = r6(&[&["sim", "--listen", "127.0.0.1:0"], args].concat());
        assert_eq!(outcome.code, 2, "{outcome:?}");
        assert!(outcome.err.contains(complaint), "{}", outcome.err);
    };
    refused(&["--program", main.path()], "which is not there");
    refused(&["--program", "palletize"], "there is no program `palletize`\n    nearest: `palletise`");
    let wrong = TempFile::new("wrong.toml", "[[step]]\ndo = \"wait\"\nsecond = 2\n");
    refused(&["--program", wrong.path()], "wrong.toml:3:1: step 1 (wait): there is no key `second`");
}

/// A file with five mistakes gets five lines, each with its place.
#[test]
fn five_mistakes_of_a_program_and_of_a_profile_are_five_lines() {
    let program = "[[step]]\ndo = \"axis-move\"\nto = [1]\nspeed = 0\n[[step]]\ndo = \"wait\"\npoint = \"X10\"\n\
                   [[step]]\ndo = \"jmp\"\n[[step]]\ndo = \"jump\"\nto = \"no\"\n[[step]]\ndo = \"photo\"\ntrys = 2\n";
    let profile = "base = \"hc2\"\nport = 1\nmax_connections = 0\nkey_ordr = \"manual\"\nunsupported_commands = [\"actoinStop\"]\n";
    for (option, text, places) in [
        ("--program", program, [":4:9", ":7:9", ":9:6", ":12:6", ":15:1"]),
        ("--profile", profile, [":1:8", ":2:8", ":3:19", ":4:1", ":5:24"]),
    ] {
        let file = TempFile::new("five.toml", text);
        let outcome = r6(&["sim", "--listen", "127.0.0.1:0", option, file.path()]);
        assert_eq!(outcome.code, 2, "{outcome:?}");
        let lines = outcome.err.lines();
        let found: Vec<_> =
            lines.filter_map(|line| line.strip_prefix(file.path())?.split(": ").next()).collect();
        assert_eq!(found, places, "{}", outcome.err);
    }
    // An older spelling is accepted with a hint.
    let old = TempFile::new(
        "old.toml",
        "[[step]]\ndo = \"output\"\nkind = \"y\"\npoint = 1\non = true\n[[step]]\ndo = \"remote\"\n",
    );
    let mut sim = Running::start(&["sim", "--listen", "127.0.0.1:0", "--program", old.path()]);
    let address = sim.line().strip_prefix("listening on ").unwrap().to_owned();
    assert_eq!(r6(&["-r", &address, "query", "output-0", "--json"]).json()["values"]["output-0"], 2);
}

#[test]
fn a_model_of_four_axes_is_played() {
    let document = include_str!("../../../../docs/MODELS.md");
    let (_, example) = document.split_once("```toml\n").unwrap();
    let file = TempFile::new("my-scara.toml", example.split_once("```").unwrap().0);
    // First stretched, then with the second link turned by 10 degrees.
    let bent = 225.0 + 175.0 * 10.0_f64.to_radians().cos();
    for (model, x, height, turn) in [("generic-scara", 600.0, 300.0, 0.0), (file.path(), bent, 220.0, 10.0)] {
        let robot = Robot::start(&["--model", model]);
        let shows = |address, wanted: f64| {
            let value = robot.value(address);
            assert!(
                (value.as_f64().unwrap() - wanted).abs() < 1e-5,
                "{model} {address}: {value}, not {wanted}"
            );
        };
        shows("axisNum", 4.0);
        for (address, wanted) in [("world-0", x), ("world-2", height), ("world-3", turn), ("world-5", 0.0)] {
            shows(address, wanted);
        }
        let moved = robot.r6(&["move", "axes", "0", "0", "-50", "30", "--wait"]);
        assert_eq!(moved.code, 0, "{moved:?}");
        for (address, wanted) in [("axis-2", -50.0), ("world-2", height - 50.0), ("world-3", turn + 30.0)] {
            shows(address, wanted);
        }
    }
}

#[test]
fn a_port_that_is_taken_names_the_option() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    for command in ["sim", "up"] {
        let outcome = r6(&[command, "--listen", &address]);
        assert_eq!(outcome.code, 2, "{outcome:?}");
        assert!(outcome.err.contains(&address) && outcome.err.contains("--listen"), "{}", outcome.err);
        assert_eq!(outcome.err.lines().count(), 1, "{}", outcome.err);
    }
}

#[test]
fn a_controller_can_be_started_in_every_state() {
    for (start, mode) in [("waiting", 7), ("stopped", 3), ("manual", 1), ("auto", 2)] {
        let robot = Robot::start(&["--start", start]);
        assert_eq!(robot.value("curMode"), mode, "{start}");
    }
}

/// Reads until `wanted` has come.
fn read_until(stream: &mut TcpStream, wanted: &str) -> String {
    let mut text = String::new();
    let mut bytes = [0; 4096];
    while !text.contains(wanted) {
        let count = stream.read(&mut bytes).unwrap();
        assert_ne!(count, 0, "the end came before {wanted}: {text}");
        text.push_str(std::str::from_utf8(&bytes[..count]).unwrap());
    }
    text
}

#[test]
fn nobody_has_to_read_what_sim_and_up_print() {
    for command in ["sim", "up"] {
        // With -v the same lines go to stderr too, which has no reader either.
        let count = if command == "sim" { 3 } else { 1 };
        let listen = ["-v", command].into_iter().chain(["--listen", "127.0.0.1:0"].repeat(count));
        let mut running = Running::start_with_pipes(&listen.collect::<Vec<_>>());
        let addresses: Vec<_> =
            (0..count).map(|_| running.line().strip_prefix("listening on ").unwrap().to_owned()).collect();
        let long = "x".repeat(200);
        let refused = format!(
            r#"{{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","packID":"1","cmdData":["{long}"]}}"#
        );
        for address in &addresses {
            let mut stream = TcpStream::connect(address).unwrap();
            stream.set_read_timeout(Some(std::time::Duration::from_secs(20))).unwrap();
            for _ in 0..2000 {
                stream.write_all(refused.as_bytes()).unwrap();
                assert!(read_until(&mut stream, "}").contains("err"), "{command}");
            }
        }
        for address in &addresses {
            assert_eq!(r6(&["-r", address, "query", "axis-0"]).code, 0, "{command}");
        }
        assert_eq!(running.end("TERM"), Some(0), "{command}");
    }
}

#[test]
fn a_line_on_stdin_sets_an_input_or_asks_for_a_photo() {
    let mut sim = Running::start_with_pipes(&["sim", "--listen", "127.0.0.1:0"]);
    let address = sim.line().strip_prefix("listening on ").unwrap().to_owned();
    let mut camera = TcpStream::connect(&address).unwrap();
    camera.set_read_timeout(Some(std::time::Duration::from_secs(20))).unwrap();
    let query = br#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"1","queryAddr":["version"]}"#;
    camera.write_all(query).unwrap();
    read_until(&mut camera, "}");
    sim.say("input 0 3 on");
    sim.say("photo 2");
    let photo = read_until(&mut camera, "}");
    assert!(photo.contains(r#""camID":2"#), "{photo}");
    // The photo came after the input.
    let read = r6(&["-r", &address, "query", "input-0", "--json"]).json();
    assert_eq!(read["values"]["input-0"], 8);
    sim.say("wave");
    let mut error = String::new();
    sim.close_stdin().read_line(&mut error).unwrap();
    assert_eq!(
        error,
        "r6: unknown line `wave`; there are: input BOARD POINT on|off, photo CAM, key auto|manual|stop\n"
    );
    // The end of stdin does not end `r6 sim`.
    assert_eq!(r6(&["-r", &address, "query", "version"]).code, 0);
    assert_eq!(sim.end("TERM"), Some(0));
}

#[test]
fn up_shows_one_controller() {
    let outcome = r6(&["up", "--listen", "127.0.0.1:0", "--listen", "127.0.0.1:0"]);
    assert_eq!(outcome.code, 2, "{outcome:?}");
    assert!(outcome.err.contains("cannot be used multiple times"), "{}", outcome.err);
}

#[test]
fn a_camera_that_listens_is_dialled() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let camera = format!("3={}", listener.local_addr().unwrap());
    let mut running = Running::start_with_pipes(&["sim", "--listen", "127.0.0.1:0", "--camera", &camera]);
    let (mut stream, _) = listener.accept().unwrap();
    let lines = [running.line(), running.line()];
    assert!(
        lines[0].starts_with("listening on ") && lines[1].contains("connected to camera 3 at"),
        "{lines:?}"
    );
    running.say("photo 3");
    let photo = r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":3}"#;
    let mut frame = vec![0; photo.len()];
    stream.read_exact(&mut frame).unwrap();
    assert_eq!(String::from_utf8(frame).unwrap(), photo);

    for (cameras, part) in [
        (&["--camera", "here"][..], "127.0.0.1:9000"),
        (&["--camera", "x=127.0.0.1:9000"], "whole number"),
        (&["--camera", "127.0.0.1:1", "--camera", "127.0.0.1:2"], "ID=ADDR:PORT"),
    ] {
        let outcome = r6(&[&["sim", "--listen", "127.0.0.1:0"], cameras].concat());
        assert!(outcome.code == 2 && outcome.err.contains(part), "{outcome:?}");
    }
}

/// An input follows an output, as the scenario says. The error for a wrong scenario says where it is wrong.
#[test]
fn a_scenario_happens() {
    let text = "[[react]]\nwhen = \"Y010\"\nthen = \"X012\"\nafter = 0.2\n\
                [[at]]\ntime = 0.5\ndo = \"alarm\"\nnumber = 5001\n";
    let file = TempFile::new("scenario.toml", text);
    let path = file.path();
    let mut sim = Running::start(&["sim", "--listen", "127.0.0.1:0", "--clock", "max", "--scenario", path]);
    let line = sim.line();
    let address = line.strip_prefix("listening on ").unwrap().to_owned();
    assert_eq!(r6(&["-r", &address, "command", "modifyOutput", "0", "0", "1"]).code, 0);
    let read = r6(&["-r", &address, "query", "input-0", "--json"]).json();
    assert_eq!(read["values"]["input-0"], 4, "{read}");
    // The timeline runs on its own clock; no client has to wait for it.
    let lines: Vec<_> = (0..3).map(|_| sim.line()).collect();
    let wanted = ["modifyOutput", "scenario: input X012 on", "scenario: alarm 5001"];
    assert!(lines.iter().zip(wanted).all(|(line, wanted)| line.contains(wanted)), "{lines:?}");
    assert!(sim.line().contains("alarm 5001"), "the machine's own line");
    assert_eq!(r6(&["-r", &address, "status", "--json"]).json()["alarm"], 5001);
    drop(sim);

    for (text, complaint) in [
        (
            "[[fault]]\nfault = \"ech\"",
            &[":2:9: [[fault]] 1 (ech): `fault` is \"ech\", which means nothing here", "\"echo\""][..],
        ),
        ("seed = 1\n[[at]]\ntime = 1", &[":2:1: [[at]] 1: `do` is missing"]),
        ("seed =", &[":1:"]),
        (
            "seed = -1\n[[at]]\ntime = -1\ndo = \"fhoto\"\n[[react]]\nwhen = \"X010\"\nthen = \"Y010\"\n",
            &[".toml:1:8: ", ".toml:3:8: ", ".toml:4:6: ", ".toml:6:8: ", ".toml:7:8: "],
        ),
    ] {
        let file = TempFile::new("scenario.toml", text);
        let out = r6(&["sim", "--listen", "127.0.0.1:0", "--scenario", file.path()]);
        assert_eq!(out.code, 2, "{out:?}");
        assert!(complaint.iter().all(|part| out.err.contains(part)), "{}", out.err);
    }
    let out = r6(&["sim", "--scenario", "no-such-file.toml"]);
    assert!(out.code == 2 && out.err.contains("the file cannot be read"), "{out:?}");
}

#[test]
fn the_log_is_json_for_machines() {
    let mut sim = Running::start(&["sim", "--listen", "127.0.0.1:0", "--log", "json", "--lang", "zh"]);
    let mut line = || -> serde_json::Value { serde_json::from_str(&sim.line()).unwrap() };
    let listening = line();
    assert_eq!(listening["event"], "listening");
    let address = listening["controller"].as_str().unwrap().to_owned();
    assert_eq!(r6(&["-r", &address, "command", "modifyGSPD", "5"]).code, 0);
    let set = line();
    assert_eq!((&set["event"], &set["level"]), (&"command_accepted".into(), &"info".into()), "{set}");
    assert_eq!((&set["command"], &set["arguments"]), (&"modifyGSPD".into(), &["50"].into()), "{set}");
    assert_eq!((&set["controller"], &set["connection"]), (&address.into(), &0.into()), "{set}");
    assert_eq!(set["text"], "命令 modifyGSPD 50");
    assert!(set["at_s"].as_f64().is_some_and(|at| at >= 0.0), "{set}");
}

/// The next event of this kind.
fn event(sim: &mut Running, kind: &str) -> serde_json::Value {
    loop {
        let event = sim.event().unwrap_or_else(|| panic!("no {kind}"));
        if event["what"] == kind || event["event"] == kind {
            return event;
        }
    }
}

#[test]
fn connections_that_cannot_be_accepted_are_told_once() {
    let mut sim = Running::start_with_few_files(24, &["sim", "--listen", "127.0.0.1:0", "--log", "json"]);
    let listening = event(&mut sim, "listening");
    let address = listening["controller"].as_str().unwrap();
    let connect = || std::net::TcpStream::connect(address).unwrap();
    let connections: Vec<_> = (0..24).map(|_| connect()).collect();
    let cannot = event(&mut sim, "cannot_accept");
    assert_eq!(cannot["level"], "warning", "{cannot}");
    assert!(cannot["text"].as_str().unwrap().contains("os error 24"), "{cannot}");
    // The simulation tries to accept every 100 ms.
    std::thread::sleep(std::time::Duration::from_millis(350));
    drop(connections);
    let _served = connect();
    let next = event(&mut sim, "shell");
    assert_eq!(next["what"], "accepts_again", "{next}");
}

#[test]
fn the_log_speaks_chinese() {
    let mut sim = Running::start(&["sim", "--listen", "127.0.0.1:0", "--lang", "zh"]);
    let address = sim.line().strip_prefix("监听地址 ").unwrap().to_owned();
    assert_eq!(r6(&["-r", &address, "command", "actionStop"]).code, 0);
    let lines = [sim.line(), sim.line()];
    assert!(lines.iter().any(|line| line.ends_with("连接 0：命令 actionStop")), "{lines:?}");

    let mut up = Running::start(&["up", "--listen", "127.0.0.1:0", "--panel", "127.0.0.1:0", "--lang", "zh"]);
    let address = up.line().strip_prefix("监听地址 ").unwrap().to_owned();
    assert!(up.line().ends_with("，控制器配置 hc1，模式 7"));
    assert!(up.line().starts_with("面板地址 http://127.0.0.1:"));
    assert!(up.line().starts_with("网关地址 http://127.0.0.1:"));
    assert!(up.line().starts_with("网关的原始端口（供 socket 脚本使用）127.0.0.1:"));
    assert!(up.line().starts_with("仪表板（附本次启动的登录）http://127.0.0.1:"));
    for program in ["r6", "r6", "r6", "curl", "r6"] {
        assert!(up.line().starts_with(&format!("可以试试：{program} ")));
    }
    assert_eq!(r6(&["-r", &address, "command", "actionStop"]).code, 0);
    let lines = [up.line(), up.line()];
    assert!(lines.iter().any(|line| line.ends_with("连接 1：命令 actionStop")), "{lines:?}");
}

/// A folder has the name of the new file. So the file cannot be written, as on a full disk.
#[test]
fn a_state_that_cannot_be_written_is_told_and_is_no_good_end() {
    for command in ["sim", "up"] {
        let folder = tempfile::TempDir::new().unwrap();
        let state = folder.path().to_str().unwrap();
        let mut running = Running::start_with_pipes(&[command, "--listen", "127.0.0.1:0", "--state", state]);
        let address = running.line().strip_prefix("listening on ").unwrap().to_owned();
        let kept = folder.path().join("controller-1.json");
        assert_eq!(r6(&["-r", &address, "command", "modifyCounter", "0", "3", "9"]).code, 0);
        std::fs::create_dir(folder.path().join("controller-1.json.new")).unwrap();
        let before = std::fs::read_to_string(&kept).unwrap();
        assert_eq!(r6(&["-r", &address, "command", "switchTool", "1"]).code, 4, "it is not acknowledged");
        let told = std::iter::repeat_with(|| running.line())
            .take(20)
            .find(|line| line.contains("cannot be written"));
        assert!(told.as_ref().is_some_and(|line| line.contains("acknowledged")), "{told:?}");
        running.signal("TERM");
        let mut error = String::new();
        running.close_stdin().read_to_string(&mut error).unwrap();
        assert!(error.contains("cannot be written") && error.contains("controller-1.json"), "{error}");
        assert_eq!(running.code(), Some(1), "{command}");
        assert_eq!(std::fs::read_to_string(&kept).unwrap(), before);
    }
}

#[test]
fn a_program_that_alarms_at_its_first_step_says_so_at_once() {
    let file = TempFile::new("far.toml", "[[step]]\ndo = \"axis-move\"\nto = [400]\nspeed = 50\n");
    let mut sim = Running::start_with_pipes(&["sim", "--listen", "127.0.0.1:0", "--program", file.path()]);
    let mut told = String::new();
    sim.close_stdin().read_line(&mut told).unwrap();
    assert!(told.contains("alarm 130 (J1: positive soft limit) from the start (program "), "{told}");
}
