//! `r6 gateway` in front of `r6 sim`, its tokens and its audit log.

use std::io::{BufRead, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::gateway_calls::{gateway, get, token, until};
use crate::support::{Robot, Running, TempFile, r6, shell};

/// The link that makes the first admin, which a gateway prints last.
fn setup_link(gateway: &mut Running) -> String {
    let line = gateway.line();
    let link = line.strip_prefix("to make the first admin, once and within an hour: ");
    link.unwrap_or_else(|| panic!("{line}")).to_owned()
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
    setup_link(&mut gateway);
    let admin = token(&data, "admin");
    assert_eq!(get(&url, &admin, "/v1/robots/saw").0, 404);

    std::fs::write(&file, table("press", &robots[0]) + &table("saw", &robots[1])).unwrap();
    gateway.signal("HUP");
    assert_eq!(gateway.line(), format!("read {path} again: 1 added, 0 changed, 0 removed, 2 robots now"));
    until(|| (get(&url, &admin, "/v1/robots/saw").1["link"] == "up").then_some(()));

    std::fs::write(&file, "[[robot]]\nname = \"Press\"\naddress = \"a\"\n").unwrap();
    gateway.signal("HUP");
    let mut errors = gateway.close_stdin().lines();
    let mut told = |what: &str| errors.find(|line| line.as_ref().unwrap().contains(what)).unwrap().unwrap();
    let refused = told("nothing was changed");
    assert!(refused.contains("hall.toml:2:"), "{refused}");
    assert_eq!(get(&url, &admin, "/v1/robots/saw").1["link"], "up");

    let raw = "[[raw]]\nrobot = \"saw\"\nlisten = \"127.0.0.1:0\"\n\
               [[raw_rule]]\nsource = \"127.0.0.1\"\nallow = \"read\"\nrobot = \"sau\"\n";
    std::fs::write(&file, table("press", &robots[0]) + &table("saw", &robots[1]) + raw).unwrap();
    gateway.signal("HUP");
    assert_eq!(gateway.line(), format!("read {path} again: 0 added, 0 changed, 0 removed, 2 robots now"));
    assert_eq!(gateway.line(), "1 rule for raw ports from now on");
    assert!(told("`sau`").contains("the [[raw_rule]] of 127.0.0.1 is for `sau`, and there is no such robot"));
    assert!(told("next start").ends_with("from the next start on: [[raw]]"));
    // With this file it would not start again.
    std::fs::write(&file, table("press", &robots[0]) + raw).unwrap();
    gateway.signal("HUP");
    assert!(told("nothing was changed").contains("would not start with it: a raw port is for `saw`"));
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
    let made = format!("r6: there was no folder {data}: it is made now, for a gateway with this --data\n");
    assert_eq!(early.err, made + "token 1: viewer of all robots. It is shown this once\n");
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
    // Two tokens, one revoked, the key of the log, a link, a start and an end.
    assert_eq!((&verified["whole"], &verified["entries"]), (&true.into(), &7.into()));
}

#[test]
fn a_head_that_was_kept_is_checked_with_its_key() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (data, other, kept) = (path("data"), path("other"), path("kept.json"));
    let (running, url) = gateway(&data, &[]);
    let engineer = token(&data, "engineer");
    let head = until(|| Some(get(&url, &engineer, "/v1/audit/head")).filter(|answer| answer.0 == 200)).1;
    assert_eq!(running.end("TERM"), Some(0));
    let (stranger, _) = gateway(&other, &[]);
    assert_eq!(stranger.end("TERM"), Some(0));

    std::fs::write(&kept, head.to_string()).unwrap();
    let key = head["key"].as_str().unwrap();
    let verify = |data: &str, more: &[&str]| {
        r6(&[["gateway", "verify", "--data", data, "--head", &kept].as_slice(), more].concat())
    };
    let whole = verify(&data, &["--key", key]);
    assert_eq!((whole.code, whole.out.contains("of the kept head of")), (0, true), "{whole:?}");
    assert!(whole.out.contains(key), "{whole:?}");
    let foreign = verify(&other, &[]);
    assert_eq!((foreign.code, foreign.err.contains("another key signed it")), (1, true), "{foreign:?}");
    let wrong = verify(&data, &["--key", "letter"]);
    assert_eq!((wrong.code, wrong.err.contains("r6-gateway/audit/")), (2, true), "{wrong:?}");
    std::fs::write(&kept, "letter").unwrap();
    let letter = verify(&data, &[]);
    assert_eq!((letter.code, letter.err.contains("not a head")), (2, true), "{letter:?}");
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
    setup_link(&mut gateway);
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

    // A file that is right, with robots that cannot be: none of it counts, the rules neither.
    hall("allow = \"deny\"\n");
    let same = format!("[[robot]]\nname = \"saw\"\naddress = \"{}\"\n", robot.address());
    let text = same + &std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text).unwrap();
    gateway.signal("HUP");
    let mut errors = gateway.close_stdin().lines();
    let told = errors.find(|line| line.as_ref().unwrap().contains("nothing was changed")).unwrap().unwrap();
    assert!(told.starts_with(&format!("r6: {path}: nothing was changed")), "{told}");
    assert!(ask().contains(r#""queryData":["7"]"#));
    let engineer = token(&data, "engineer");
    until(|| {
        let audit = get(&url, &engineer, "/v1/audit").1;
        let rules = audit["entries"].as_array()?.iter().rfind(|entry| entry["what"] == "raw_rules")?;
        (rules["rules"][0]["allow"] == "read").then_some(())
    });
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
    assert!(restored.err.contains("a stop holds for every robot"), "{restored:?}");

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

#[test]
fn a_robot_that_is_not_reached_is_in_the_log_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data").display().to_string();
    // A port on which nothing listens any more.
    let gone = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let (mut running, _) = gateway(&data, &["--robot", &format!("press={gone}")]);
    let mut lines = running.close_stdin().lines();
    let line = lines.find(|line| line.as_ref().unwrap().contains("no connection yet")).unwrap().unwrap();
    assert!(line.contains(&gone.to_string()) && line.contains("refused"), "{line}");
    assert_eq!(running.end("TERM"), Some(0));
}

#[test]
fn a_folder_with_which_no_gateway_ran_is_told_from_a_whole_log() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data").display().to_string();
    token(&data, "viewer");
    let alone = r6(&["gateway", "verify", "--data", &data]);
    assert!(alone.out.contains("data: it has no signed head: no gateway has run"), "{alone:?}");
    let (running, _) = gateway(&data, &[]);
    assert_eq!(running.end("TERM"), Some(0));
    let used = r6(&["gateway", "verify", "--data", &data]);
    assert!(used.code == 0 && !used.out.contains("no signed head"), "{used:?}");
}

/// A request of a user: the status, the headers and the body.
fn send(gateway: &str, method: &str, path: &str, headers: &str, body: &str) -> (u16, String, Value) {
    let host = gateway.strip_prefix("http://").unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    let head = format!("{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n{headers}");
    let length = format!("Content-Type: application/json\r\nContent-Length: {}\r\n", body.len());
    write!(stream, "{head}{length}\r\n{body}").unwrap();
    let mut reply = String::new();
    stream.read_to_string(&mut reply).unwrap();
    let (head, body) = reply.split_once("\r\n\r\n").unwrap();
    let status = head.split(' ').nth(1).unwrap().parse().unwrap();
    (status, head.to_owned(), serde_json::from_str(body).unwrap_or(Value::Null))
}

/// All files below a folder.
fn files(folder: &std::path::Path) -> Vec<std::path::PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

#[test]
fn users_are_made_and_sign_in_and_no_secret_is_in_a_file_or_in_the_output() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data").display().to_string();
    let (mut gateway, url) = gateway(&data, &["-vvv", "--robot", "press=127.0.0.1:1"]);
    // It is read all the time, so that what it says is not held up.
    let mut errors = gateway.close_stdin();
    let errors = std::thread::spawn(move || {
        let mut text = String::new();
        errors.read_to_string(&mut text).map(|_| text)
    });
    let link = setup_link(&mut gateway);
    let secret = link.strip_prefix(&format!("{url}/setup#")).unwrap().to_owned();
    let asked = format!(r#"{{"secret":"{secret}","name":"anna","password":"first password"}}"#);
    assert_eq!(send(&url, "POST", "/v1/setup", "", &asked).0, 204);
    assert_eq!(send(&url, "POST", "/v1/setup", "", &asked).0, 410);

    // The admin forgot it.
    let link = r6(&["gateway", "user", "--data", &data, "--link", "anna", "--url", &url]).out;
    let (reset, name) = link.trim().strip_prefix(&format!("{url}/setup#")).unwrap().split_once('&').unwrap();
    assert_eq!(name, "anna");
    let asked = format!(r#"{{"secret":"{reset}","name":"anna","password":"second password"}}"#);
    assert_eq!(send(&url, "POST", "/v1/setup", "", &asked).0, 204);
    let sign_in = |password: &str| {
        let asked = format!(r#"{{"name":"anna","password":"{password}"}}"#);
        send(&url, "POST", "/v1/session", "", &asked)
    };
    assert_eq!(sign_in("first password").0, 401);
    let (status, head, session) = sign_in("second password");
    assert_eq!(status, 200, "{session}");
    let cookie = head.split_once("set-cookie: ").unwrap().1.split_once(';').unwrap().0.to_owned();
    assert!(cookie.starts_with("r6_session_"), "{cookie}");
    let csrf = session["csrf"].as_str().unwrap().to_owned();
    let headers = format!("Cookie: {cookie}\r\nX-CSRF-Token: {csrf}\r\n");
    let wanted = r#"{"role":"viewer","password":"third password"}"#;
    assert_eq!(send(&url, "PUT", "/v1/users/ben", &headers, wanted).0, 201);
    let change = r#"{"old":"second password","new":"fourth password"}"#;
    assert_eq!(send(&url, "PUT", "/v1/session/password", &headers, change).0, 204);
    assert_eq!(send(&url, "DELETE", "/v1/session", &headers, "").0, 204);

    let add = ["gateway", "user", "--data", &data, "--add"];
    let added = r6(&[&add[..], &["cem", "--role", "engineer", "--robot", "press"]].concat());
    assert!(added.code == 0 && added.out.starts_with(&format!("{url}/setup#")), "{added:?}");
    let of_cem = added.out.trim().split_once('#').unwrap().1.split_once('&').unwrap().0.to_owned();
    assert_eq!(r6(&[&add[..], &["cem", "--role", "viewer"]].concat()).code, 2, "the name is taken");
    assert_eq!(r6(&[&add[..], &["Cem", "--role", "viewer"]].concat()).code, 2);
    let list = |data: &str| r6(&["gateway", "user", "--data", data, "--list"]).out;
    let listed = list(&data);
    for part in ["anna", "admin of all robots", "ben", "cem", "engineer of press", "no password yet"] {
        assert!(listed.contains(part), "{part}: {listed}");
    }
    let disable = |name| r6(&["gateway", "user", "--data", &data, "--disable", name]);
    assert_eq!(disable("ben").out, "user ben is disabled\n");
    assert!(list(&data).contains("disabled"));
    let last = disable("anna");
    assert!(last.code == 2 && last.err.contains("last admin"), "{last:?}");
    assert_eq!(r6(&["gateway", "user", "--data", &data, "--link", "no-user"]).code, 2);
    // An option without effect is refused: a person would believe that a role has changed.
    for args in [&["--link", "anna", "--role", "viewer"][..], &["--list", "--robot", "saw"]] {
        let refused = r6(&[&["gateway", "user", "--data", &data][..], args].concat());
        assert!(refused.code == 2 && refused.err.contains("go with --add alone"), "{refused:?}");
    }
    let eva = ["--add", "eva", "--role", "operator", "--robot", "prss,*=viewer"];
    let eva = r6(&[&["gateway", "user", "--data", &data][..], &eva].concat());
    assert!(eva.err.contains("no robot prss is known here yet"), "{eva:?}");
    assert!(eva.err.contains("user eva: operator of prss; viewer of all others"), "{eva:?}");
    // A folder without a gateway so far: where a gateway listens if nothing else is said.
    let early = folder.path().join("early").display().to_string();
    let added = r6(&["gateway", "user", "--data", &early, "--add", "dora", "--role", "viewer"]);
    assert!(added.out.starts_with("http://127.0.0.1:9780/setup#"), "{added:?}");
    assert!(added.err.starts_with(&format!("r6: there was no folder {early}: ")), "{added:?}");

    gateway.signal("TERM");
    let errors = errors.join().unwrap().unwrap();
    assert!(errors.contains("a user signed in"), "it says what happens: {errors}");
    let output = errors + &gateway.rest();
    let passwords = ["first", "second", "third", "fourth"].map(|word| format!("{word} password"));
    let secrets = [secret, reset.to_owned(), of_cem, cookie, csrf];
    for text in passwords.iter().chain(&secrets) {
        assert!(!output.contains(text.as_str()), "{text} is in the output");
        for path in files(folder.path()) {
            let bytes = std::fs::read(&path).unwrap();
            assert!(
                !bytes.windows(text.len()).any(|part| part == text.as_bytes()),
                "{text}: {}",
                path.display()
            );
        }
    }
    // The next start has an admin, so it prints no link.
    let (again, _) = self::gateway(&data, &[]);
    again.signal("TERM");
    let mut again = again;
    assert_eq!(again.rest(), "");
}

#[test]
fn a_wrong_url_of_a_store_is_told_without_its_password() {
    // The first has no database, the second asks for TLS, the third is of something else.
    for url in [
        "postgres://r6:hush@localhost",
        "postgres://r6:hush@localhost/hall?sslmode=require",
        "mysql://r6:hush@h/d",
    ] {
        for command in [
            ["gateway", "token", "--list"].as_slice(),
            &["gateway", "user", "--list"],
            &["gateway", "verify"],
            &["gateway"],
        ] {
            let outcome = r6(&[command, &["--store", url]].concat());
            assert_eq!(outcome.code, 2, "{command:?} {url}: {outcome:?}");
            assert!(outcome.err.contains("the URL of --store is wrong"), "{command:?} {url}: {outcome:?}");
            assert!(!format!("{outcome:?}").contains("hush"), "{command:?} {url}: {outcome:?}");
        }
    }
    let scheme = r6(&["gateway", "verify", "--store", "mysql://h/d"]).err;
    assert!(scheme.contains("it has to begin with postgres:// or postgresql://"), "{scheme}");
}

#[cfg(unix)]
#[test]
fn a_file_of_passwords_is_read_if_other_users_cannot_read_it() {
    use std::os::unix::fs::PermissionsExt as _;

    let file = TempFile::new("passwords", "*:*:*:*:hush\n");
    let line = r#"PGPASSFILE="$1" "$R6" gateway token --store "$2" --list"#;
    let asked = |path: &str, url: &str| shell(line, &[path, url]);
    let allow = |mode| {
        std::fs::set_permissions(file.path(), std::fs::Permissions::from_mode(mode)).unwrap();
    };
    let url = "postgres:///hall?host=/no/such/folder";
    allow(0o640);
    let refused = asked(file.path(), url);
    assert!(refused.code == 2 && refused.err.contains("other users can read it"), "{refused:?}");
    let missing = asked("/no/such/file", url);
    assert!(missing.code == 2 && missing.err.contains("PGPASSFILE=/no/such/file"), "{missing:?}");
    allow(0o600);
    // It goes on to the server, which is not there. So it does with a password in the URL.
    for (path, url) in [(file.path(), url), ("/no/such/file", "postgres://r6:hush@127.0.0.1:1/hall")] {
        let outcome = asked(path, url);
        assert!(outcome.code != 0 && !outcome.err.contains("PGPASSFILE"), "{outcome:?}");
        assert!(!outcome.err.contains("hush"), "{outcome:?}");
    }
}
