//! `r6 gateway` in front of `r6 sim`, its tokens and its audit log.

use std::io::{BufRead, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use r6_testkit::hostile::{Character, Delays};
use serde_json::Value;

use crate::support::{Robot, Running, TempFile, hostile, r6};

/// One request: the status and the body.
fn call(gateway: &str, token: &str, method: &str, path: &str, body: &str) -> (u16, Value) {
    let host = gateway.strip_prefix("http://").unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    let head = format!("{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n");
    let length = format!("Content-Type: application/json\r\nContent-Length: {}\r\n", body.len());
    write!(stream, "{head}{length}Authorization: Bearer {token}\r\n\r\n{body}").unwrap();
    let mut reply = String::new();
    // A gateway that is killed meanwhile sends none.
    let _ = stream.read_to_string(&mut reply);
    let status = reply.split(' ').nth(1).map_or(0, |status| status.parse().unwrap());
    let body = reply.split_once("\r\n\r\n").map_or("", |(_, body)| body);
    (status, serde_json::from_str(body).unwrap_or(Value::Null))
}

fn get(gateway: &str, token: &str, path: &str) -> (u16, Value) {
    call(gateway, token, "GET", path, "")
}

/// A gateway of this folder with this robot, and its URL.
fn gateway(data: &str, more: &[&str]) -> (Running, String) {
    let start = [["gateway", "--listen", "127.0.0.1:0", "--data", data].as_slice(), more].concat();
    let mut gateway = Running::start_with_pipes(&start);
    let line = gateway.line();
    let url = line.split([' ', ',']).find(|word| word.starts_with("http://") || word.starts_with("https://"));
    let url = url.unwrap_or_else(|| panic!("{line}")).to_owned();
    (gateway, url)
}

/// A token of this folder.
fn token(data: &str, role: &str) -> String {
    r6(&["gateway", "token", "--data", data, "--role", role]).out.trim().to_owned()
}

/// Asks until `done` returns something.
fn until<T>(mut done: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(done) = done() {
            return done;
        }
        assert!(begun.elapsed() < Duration::from_secs(20));
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn a_command_that_a_kill_cuts_short_is_unknown_at_the_next_start_and_never_sent_again() {
    // Each command is answered after a minute, so the gateway is killed before.
    let delays = Delays { command: Duration::from_secs(60), ..Delays::default() };
    let (robot, controller) = hostile(Character { arms_itself: true, delays, ..Character::default() });
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data").display().to_string();
    let robot = format!("press={robot}");
    let (first, url) = gateway(&data, &["--robot", &robot]);
    let admin = token(&data, "admin");
    until(|| (get(&url, &admin, "/v1/robots/press").1["link"] == "up").then_some(()));
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
    until(|| (get(&url, &admin, "/v1/robots/press").1["link"] == "up").then_some(()));
    assert_eq!(r6(&["gateway", "verify", "--data", &data, "--json"]).json()["whole"], true);
    drop(controller);
}

#[test]
fn a_hangup_makes_it_read_the_file_again_and_a_mistake_changes_nothing() {
    let robots = [Robot::start(&[]), Robot::start(&[])];
    let folder = tempfile::tempdir().unwrap();
    let (data, file) = (folder.path().join("data").display().to_string(), folder.path().join("hall.toml"));
    let table = |name: &str, robot: &Robot| {
        format!("[[robot]]\nname = \"{name}\"\naddress = \"{}\"\n", robot.address())
    };
    std::fs::write(&file, table("press", &robots[0])).unwrap();
    let path = file.display().to_string();
    let (mut gateway, url) = gateway(&data, &["--config", &path]);
    let admin = token(&data, "admin");
    assert_eq!(get(&url, &admin, "/v1/robots/saw").0, 404);

    std::fs::write(&file, table("press", &robots[0]) + &table("saw", &robots[1])).unwrap();
    gateway.signal("HUP");
    assert_eq!(gateway.line(), format!("read {path} again: 1 added, 0 changed, 0 removed, 2 robots now"));
    until(|| (get(&url, &admin, "/v1/robots/saw").1["link"] == "up").then_some(()));

    std::fs::write(&file, "[[robot]]\nname = \"Press\"\naddress = \"a\"\n").unwrap();
    gateway.signal("HUP");
    let mut errors = gateway.close_stdin().lines();
    let told = errors.find(|line| line.as_ref().unwrap().contains("nothing was changed")).unwrap().unwrap();
    assert!(told.contains("hall.toml:2:"), "{told}");
    assert_eq!(get(&url, &admin, "/v1/robots/saw").1["link"], "up");

    std::fs::write(&file, table("press", &robots[0])).unwrap();
    gateway.signal("HUP");
    assert_eq!(gateway.line(), format!("read {path} again: 0 added, 0 changed, 1 removed, 1 robot now"));
    assert_eq!(get(&url, &admin, "/v1/robots/saw").0, 404);
    assert_eq!(gateway.end("TERM"), Some(0));
}

#[test]
fn a_value_is_read_with_a_token_and_the_log_is_whole_in_the_end() {
    let mut sim = Running::start(&["sim", "--listen", "127.0.0.1:0"]);
    let robot = sim.line().strip_prefix("listening on ").unwrap().to_owned();
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data").display().to_string();

    // A token can be made before the gateway runs for the first time, and while it runs.
    let early = r6(&["gateway", "token", "--data", &data, "--role", "viewer", "--name", "screen"]);
    assert_eq!(early.code, 0, "{early:?}");
    assert_eq!(early.err, "token 1: viewer of all robots. It is shown this once\n");
    let robot = format!("press={robot}");
    let start = ["gateway", "--listen", "127.0.0.1:0", "--data", &data, "--robot", &robot];
    let mut gateway = Running::start(&start);
    let line = gateway.line();
    let url =
        line.split([' ', ',']).find(|word| word.starts_with("http://")).unwrap_or_else(|| panic!("{line}"));
    assert!(line.contains(", 1 robot, data in "), "{line}");
    let late = r6(&["gateway", "token", "--data", &data, "--role", "operator", "--robot", "press"]);
    assert_eq!(late.err, "token 2: operator of press. It is shown this once\n");

    assert_eq!(get(url, "", "/healthz").0, 204);
    assert_eq!(get(url, "r6_0", "/v1/robots").0, 401);
    let begun = Instant::now();
    for token in [early.out.trim(), late.out.trim()] {
        loop {
            let (status, state) = get(url, token, "/v1/robots/press");
            assert_eq!(status, 200, "{state}");
            let is_mode = |signal: &&Value| signal["address"] == "curMode";
            let mode = state["signals"].as_array().unwrap().iter().find(is_mode).unwrap().clone();
            if mode["quality"] == "fresh" {
                assert_eq!(mode["value"], 7);
                break;
            }
            assert!(begun.elapsed() < Duration::from_secs(20), "{state:#}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }
    let second = r6(&start);
    assert!(second.code == 2 && second.err.contains("another gateway uses"), "{second:?}");

    let list = r6(&["gateway", "token", "--data", &data, "--list"]);
    assert!(list.out.contains("viewer of all robots") && list.out.contains("operator of press"), "{list:?}");
    assert!(!list.out.contains("r6_"), "{list:?}");
    assert_eq!(r6(&["gateway", "token", "--data", &data, "--revoke", "1"]).out, "token 1 is revoked\n");
    assert_eq!(r6(&["gateway", "token", "--data", &data, "--revoke", "1"]).code, 2);

    gateway.signal("TERM");
    assert_eq!(gateway.code(), Some(0));
    let verified = r6(&["gateway", "verify", "--data", &data, "--json"]).json();
    // Two tokens, one revoked, a start and an end.
    assert_eq!((&verified["whole"], &verified["entries"]), (&true.into(), &5.into()));
}

#[test]
fn mistakes_of_the_command_line_and_of_a_file_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data").display().to_string();
    for (args, part) in [
        (["gateway", "--robot", "192.168.1.10"].as_slice(), "NAME=HOST[:PORT]"),
        (&["gateway", "--robot", "Press=192.168.1.10"], "`Press` is not a name"),
        (&["gateway", "--robot", "a=127.0.0.1", "--robot", "a=127.0.0.2"], "two robots are called `a`"),
        (&["gateway", "--robot", "a=127.0.0.1", "--raw", "a"], "NAME=ADDR:PORT"),
        (&["gateway", "--robot", "a=127.0.0.1", "--raw", "a=9760"], "write IP:PORT"),
        (&["gateway", "verify", "--data", &data], "there is no "),
        (&["gateway", "token", "--data", &data], "--role"),
        (
            &["gateway", "--data", &data, "--robot", "a=127.0.0.1", "--robot", "b=127.0.0.1:9760"],
            "both have the address",
        ),
        (&["gateway", "--data", &data, "--robot", "a=127.0.0.1", "--raw", "b=127.0.0.1:0"], "no such robot"),
    ] {
        let wrong = r6(args);
        assert!(wrong.code == 2 && wrong.err.contains(part), "{args:?}: {wrong:?}");
    }
    let file = TempFile::new("hall.toml", "[[robot]]\nname = \"press\"\n");
    let wrong = r6(&["gateway", "--config", file.path()]);
    assert!(wrong.code == 2 && wrong.err.contains("`address` is missing"), "{wrong:?}");
}

#[test]
fn a_raw_port_answers_as_the_page_says() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/GATEWAY.md");
    let page = std::fs::read_to_string(page).unwrap();
    let after = |start: &str| page.split_once(start).unwrap().1.lines().next().unwrap().to_owned();
    let request = after("$ printf '%s' '");
    let request = request.split_once('\'').unwrap().0;
    let reply = page.lines().skip_while(|line| !line.starts_with("$ printf '%s' '")).nth(1).unwrap();

    let mut sim = Running::start(&["sim", "--listen", "127.0.0.1:0"]);
    let robot = format!("press-4={}", sim.line().strip_prefix("listening on ").unwrap());
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data").display().to_string();
    let (mut gateway, url) = gateway(&data, &["--robot", &robot, "--raw", "press-4=127.0.0.1:0"]);
    let line = gateway.line();
    let raw = line.strip_prefix("raw port of press-4 on ").unwrap_or_else(|| panic!("{line}"));
    let viewer = token(&data, "viewer");
    until(|| (get(&url, &viewer, "/v1/robots/press-4").1["link"] == "up").then_some(()));
    let mut script = TcpStream::connect(raw).unwrap();
    script.write_all(request.as_bytes()).unwrap();
    script.shutdown(std::net::Shutdown::Write).unwrap();
    let mut answer = String::new();
    script.read_to_string(&mut answer).unwrap();
    assert_eq!(answer, reply);
}

#[test]
fn a_hangup_exchanges_the_rules_of_raw_ports() {
    let robot = Robot::start(&[]);
    let folder = tempfile::tempdir().unwrap();
    let (data, file) = (folder.path().join("data").display().to_string(), folder.path().join("hall.toml"));
    let hall = |allow: &str| {
        let press = format!("[[robot]]\nname = \"press\"\naddress = \"{}\"\n", robot.address());
        let raw = "[[raw]]\nrobot = \"press\"\nlisten = \"127.0.0.1:0\"\n";
        std::fs::write(&file, press + raw + "[[raw_rule]]\nsource = \"127.0.0.1\"\n" + allow).unwrap();
    };
    hall("allow = \"deny\"\n");
    let path = file.display().to_string();
    let (mut gateway, url) = gateway(&data, &["--config", &path]);
    let raw = gateway.line().strip_prefix("raw port of press on ").unwrap().to_owned();
    let viewer = token(&data, "viewer");
    until(|| (get(&url, &viewer, "/v1/robots/press").1["link"] == "up").then_some(()));
    let ask = || {
        let mut script = TcpStream::connect(&raw).unwrap();
        // If it is denied, it may be closed before this.
        let _ = script.write_all(br#"{"reqType":"query","queryAddr":["curMode"]}"#);
        let _ = script.shutdown(std::net::Shutdown::Write);
        let mut answer = String::new();
        let _ = script.read_to_string(&mut answer);
        answer
    };
    assert_eq!(ask(), "");
    hall("allow = \"read\"\n");
    gateway.signal("HUP");
    assert!(gateway.line().starts_with("read "));
    assert!(ask().contains(r#""queryData":["7"]"#));
    assert_eq!(gateway.end("TERM"), Some(0));
}

#[test]
fn a_backup_of_a_gateway_that_runs_becomes_the_folder_of_another_where_a_stop_holds() {
    let robot = Robot::start(&[]);
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (data, backup, new) = (path("data"), path("backup"), path("new"));
    let press = format!("press={}", robot.address());
    let (mut running, url) = gateway(&data, &["--robot", &press, "--tls"]);
    assert!(url.starts_with("https://"), "{url}");
    let fingerprint = running.line();
    let operator = token(&data, "operator");
    // The gateway knows the robot once its values are kept.
    let history = folder.path().join("data/history");
    until(|| std::fs::read_dir(&history).ok()?.next().map(drop));

    let made = r6(&["gateway", "backup", "--data", &data, "--to", &backup]);
    assert_eq!((made.code, made.out.contains("backup: 4 files")), (0, true), "{made:?}");
    let again = r6(&["gateway", "backup", "--data", &data, "--to", &backup]);
    assert_eq!((again.code, again.err.contains("choose another folder")), (2, true), "{again:?}");
    assert_eq!(running.end("TERM"), Some(0));
    let restored = r6(&["gateway", "restore", "--data", &new, "--from", &backup]);
    assert_eq!(restored.code, 0, "{restored:?}");
    assert!(restored.err.contains("a stop holds for each robot"), "{restored:?}");

    // The same certificate; without it for the request.
    let (mut running, _) = gateway(&new, &["--robot", &press, "--tls"]);
    let in_new = running.line();
    assert_eq!(in_new.split_once("SHA-256").unwrap().1, fingerprint.split_once("SHA-256").unwrap().1);
    assert_eq!(running.end("TERM"), Some(0));
    let (running, url) = gateway(&new, &["--robot", &press]);
    until(|| (get(&url, &operator, "/v1/robots/press").1["link"] == "up").then_some(()));
    assert_eq!(get(&url, &operator, "/v1/robots/press").1["stopped"], true);
    assert_eq!(running.end("TERM"), Some(0));
    let verified = r6(&["gateway", "verify", "--data", &new]);
    assert_eq!(verified.code, 0, "{verified:?}");
}
