//! `r6 up --cell`: a hall of virtual robots behind one gateway.

use serde_json::{Value, json};

use crate::gateway_calls::{get, until};
use crate::support::{Running, TempFile, r6};

const NAMES: [&str; 12] = [
    "press-01",
    "press-02",
    "press-03",
    "weld-01",
    "weld-02",
    "glue-01",
    "pick-01",
    "pick-02",
    "pack-01",
    "pack-02",
    "pack-03",
    "gantry-01",
];

/// A value of a robot, as the gateway reads it.
fn value(state: &Value, address: &str) -> Value {
    let signals = state["signals"].as_array().unwrap();
    let signal = signals.iter().find(|signal| signal["address"] == address);
    signal.map(|signal| signal["value"].clone()).unwrap_or_default()
}

#[test]
fn the_example_brings_twelve_robots_and_their_twins_up_and_its_trouble_comes() {
    let mut up =
        Running::start(&["up", "--cell", "examples/hall.toml", "--gateway", "127.0.0.1:0", "--clock", "10x"]);
    for name in NAMES {
        let line = up.line();
        assert!(line.starts_with(&format!("{name} on 127.0.0.1:")) && line.contains(", profile "), "{line}");
    }
    let line = up.line();
    let url = line.strip_prefix("gateway on ").and_then(|rest| rest.strip_suffix(", 12 robots, 12 twins"));
    let url = url.unwrap_or_else(|| panic!("{line}")).to_owned();
    let raw = up.line();
    let raw =
        raw.strip_prefix("raw port of weld-01, for socket scripts, on ").unwrap_or_else(|| panic!("{raw}"));
    assert!(up.line().starts_with(&format!("dashboard, with its sign-in for this start, on {url}/#")));
    let hint = up.line();
    let words: Vec<_> = hint.strip_prefix("try: r6 ").unwrap().split(' ').collect();
    let token = std::fs::read_to_string(words[3]).unwrap();
    let token = token.trim().strip_prefix("Authorization: Bearer ").unwrap();
    assert!(up.line().starts_with("try: curl "));
    assert_ne!(up.line(), "", "what happens is a line");

    let robot = |name: &str| get(&url, token, &format!("/v1/robots/{name}")).1;
    for name in NAMES {
        let twin = format!("{name}-twin");
        until(|| (robot(name)["link"] == "up").then_some(()));
        until(|| (robot(&twin)["link"] == "up").then_some(()));
        assert_eq!((&robot(name)["twin"], &robot(&twin)["twin_of"]), (&json!(twin), &json!(name)));
        assert_eq!(robot(name)["virtual"], true, "{name}");
    }
    assert_eq!(r6(&words).out.lines().count(), 1 + 2 * NAMES.len());
    // Seconds of the hall are tenths of a second here.
    until(|| (value(&robot("press-03"), "curAlarm") == 5001).then_some(()));
    until(|| value(&robot("pick-01"), "counter-1")["current"].as_i64().filter(|parts| *parts > 2));
    assert_eq!(value(&robot("pack-03"), "curMode"), 1);
    until(|| (robot("weld-02")["link"] == "down").then_some(()));
    until(|| (robot("weld-02")["link"] == "up").then_some(()));
    let settings = get(&url, token, "/v1/settings").1;
    assert!(
        settings.to_string().contains("Europe/Berlin") && settings.to_string().contains("night"),
        "{settings}"
    );
    let programs = get(&url, token, "/v1/programs").1["programs"].clone();
    assert_eq!(programs.as_array().map(Vec::len), Some(2), "{programs}");
    let audit = get(&url, token, "/v1/audit");
    assert!(
        audit.0 == 200 && audit.1.to_string().contains("square"),
        "the token is that of an admin: {audit:?}"
    );
    let asked = r6(&["-r", raw, "query", "curMode"]);
    assert!(asked.code == 0 && asked.out.contains('7'), "{asked:?}");
    assert_eq!(up.end("TERM"), Some(0));
    assert!(!std::path::Path::new(words[3]).exists(), "the folder goes with the hall");
}

#[test]
fn the_lines_are_chinese_if_they_are_asked_for_and_a_hall_needs_no_gateway() {
    let file = TempFile::new("hall-one.toml", "[[robot]]\nname = \"saw\"\nmodel = \"GENERIC-SCARA\"\n");
    let up = ["up", "--cell", file.path(), "--lang", "zh"];
    let mut alone = Running::start(&[&up[..], &["--gateway", "off"]].concat());
    let line = alone.line();
    assert!(line.starts_with("saw 监听地址 127.0.0.1:"), "{line}");
    assert!(line.ends_with("，GENERIC-SCARA，控制器配置 hc1"), "{line}");
    let address = line.split([' ', '，']).nth(2).unwrap().to_owned();
    assert_eq!(r6(&["-r", &address, "stop"]).code, 0);
    assert!(alone.line().starts_with("saw  "), "a line of the log has the name");
    assert_eq!(alone.end("TERM"), Some(0));
    let mut behind = Running::start(&[&up[..], &["--gateway", "127.0.0.1:0"]].concat());
    behind.line();
    let line = behind.line();
    assert!(line.starts_with("网关地址 http://127.0.0.1:") && line.contains("，1 台机器人，"), "{line}");
    assert!(behind.line().starts_with("saw 的原始端口"));
    assert_eq!(behind.end("TERM"), Some(0));
}

#[test]
fn beside_the_robot_that_waits_a_demo_works_by_itself() {
    let up = ["up", "--demo", "--listen", "127.0.0.1:0", "--clock", "10x", "--gateway", "127.0.0.1:0"];
    let mut up = Running::start(&up);
    let (mut url, mut token) = (String::new(), String::new());
    while token.is_empty() {
        let line = up.line();
        if let Some(address) = line.strip_prefix("gateway on ") {
            url = address.strip_suffix(", 2 robots").unwrap_or_else(|| panic!("{line}")).to_owned();
        } else if let Some(curl) = line.strip_prefix("try: curl -sN -H @") {
            let file = std::fs::read_to_string(curl.split(' ').next().unwrap()).unwrap();
            file.trim().strip_prefix("Authorization: Bearer ").unwrap().clone_into(&mut token);
        }
    }
    let robot = |name: &str| get(&url, &token, &format!("/v1/robots/{name}")).1;
    until(|| (value(&robot("demo"), "isMoving") == json!(true)).then_some(()));
    until(|| (value(&robot("demo"), "axis-0").as_f64()? > 30.0).then_some(()));
    let waiting = robot("virtual");
    assert_eq!((value(&waiting, "isMoving"), value(&waiting, "axis-0")), (json!(false), json!(0.0)));
    assert_eq!(robot("demo")["panel"], true);
    assert_eq!(up.end("TERM"), Some(0));
    assert_eq!(r6(&["up", "--demo", "--cell", "examples/hall.toml"]).code, 2);
}

#[test]
fn a_wrong_file_starts_nothing_and_each_mistake_has_its_line() {
    let file = TempFile::new(
        "hall-wrong.toml",
        "[[robot]]\nname = \"a\"\nmodel = \"GENERIC-SKARA\"\n[[robot.at]]\ntime = 1\ndo = \"alrm\"\n",
    );
    let wrong = r6(&["up", "--cell", file.path()]);
    assert_eq!((wrong.code, wrong.out.as_str()), (2, ""), "{wrong:?}");
    for part in [
        ":3:9: [[robot]] 1 (a): `model` is \"GENERIC-SKARA\"",
        "nearest: \"GENERIC-SCARA\"",
        ":6:6: [[robot]] 1 (a): [[at]] 1 (alrm): ",
        "nearest: \"alarm\"",
    ] {
        assert!(wrong.err.contains(part), "{part}: {}", wrong.err);
    }
    let none = r6(&["up", "--cell", "no-such-hall.toml"]);
    assert!(none.code == 2 && none.err.contains("no-such-hall.toml: the file cannot be read"), "{none:?}");
    for option in [["--model", "GENERIC-SCARA"], ["--listen", "127.0.0.1:0"], ["--seed", "1"]] {
        let both = r6(&[&["up", "--cell", "examples/hall.toml"][..], &option].concat());
        assert!(both.code == 2 && both.err.contains("cannot be used with"), "{both:?}");
    }
}
