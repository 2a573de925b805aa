//! Tests that the crates of this workspace and the files of the client keep to their layers, and that
//! violations are found.

use std::fs;
use std::path::Path;

use r6_testkit::imports::Sources;
use r6_testkit::layers::{self, Layer, PURE_STD, RULES, Rule};
use serde_json::json;

#[test]
fn every_crate_keeps_to_its_layer() {
    let violations = layers::violations(&layers::metadata());
    assert!(violations.is_empty(), "\n{}", violations.join("\n"));
}

#[test]
fn every_rule_is_about_a_crate_of_this_workspace() {
    let metadata: serde_json::Value = serde_json::from_str(&layers::metadata()).unwrap();
    let packages: Vec<_> =
        metadata["packages"].as_array().unwrap().iter().map(|package| &package["name"]).collect();
    for rule in RULES {
        assert!(packages.contains(&&json!(rule.package)), "there is no crate `{}` any more", rule.package);
    }
}

/// A shell only because of a crate that it uses: its own sources are held to the rules of a pure crate.
const PURE_IN_ITSELF: [&str; 1] = ["r6-plot"];

fn keeps_to_pure_rules(rule: &Rule) -> bool {
    rule.layer == Layer::Pure || PURE_IN_ITSELF.contains(&rule.package)
}

#[test]
fn every_pure_crate_bans_clocks_sockets_and_threads() {
    for rule in RULES.iter().filter(|rule| keeps_to_pure_rules(rule)) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(rule.package).join("clippy.toml");
        let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        for banned in
            ["std::time::Instant::now", "std::net::TcpStream", "std::thread::spawn", "std::fs::File"]
        {
            assert!(text.contains(banned), "{} does not ban {banned}", path.display());
        }
    }
}

/// The violations of a made-up workspace: one crate with one dependency.
fn violations(package: &str, dependency: &str, kind: Option<&str>) -> Vec<String> {
    let dependency = json!({"name": dependency, "kind": kind, "req": "*"});
    let metadata = json!({"packages": [{"name": package, "dependencies": [dependency]}]});
    layers::violations(&metadata.to_string())
}

#[test]
fn forbidden_edges_are_reported() {
    let edges = [
        ("r6-proto", "r6-controller"),
        ("r6-proto", "r6-testkit"),
        ("r6-proto", "tokio"),
        ("r6-proto", "async-io"),
        ("r6-controller", "r6-sim"),
        ("r6-controller", "socket2"),
        ("r6-controller", "rand"),
        ("r6-client", "r6-sim"),
        ("r6-client", "r6-controller"),
        ("r6-sim", "r6-client"),
        ("r6-client", "r6-plot"),
        ("r6-gateway", "r6-sim"),
        ("r6-gateway", "r6-controller"),
        ("r6-sim", "r6-gateway"),
        ("r6-plot", "r6-sim"),
        ("r6-testkit", "r6-proto"),
        ("r6", "r6-testkit"),
    ];
    for (package, dependency) in edges {
        for kind in [None, Some("build")] {
            let found = violations(package, dependency, kind);
            assert_eq!(found.len(), 1, "{package} -> {dependency} ({kind:?}): {found:?}");
            assert!(
                found[0].starts_with(&format!("`{package}` depends on `{dependency}`: ")),
                "{}",
                found[0]
            );
        }
    }
}

#[test]
fn allowed_edges_are_not_reported() {
    let edges = [
        ("r6-proto", "encoding_rs", None),
        ("r6-controller", "r6-proto", None),
        ("r6-client", "r6-proto", None),
        ("r6-client", "tokio", None),
        ("r6-client", "r6-sim", Some("dev")),
        ("r6-proto", "r6-testkit", Some("dev")),
        ("r6-sim", "r6-controller", None),
        ("r6", "r6-sim", None),
    ];
    for (package, dependency, kind) in edges {
        assert_eq!(violations(package, dependency, kind), Vec::<String>::new(), "{package} -> {dependency}");
    }
}

#[test]
fn a_crate_without_a_rule_is_reported() {
    assert_eq!(
        violations("r6-newcomer", "serde", None),
        ["`r6-newcomer` has no rule: add one to layers::RULES"]
    );
}

#[test]
fn a_path_dependency_without_a_rule_is_reported() {
    let dependency = json!({"name": "r6-newcomer", "kind": null, "path": "crates/r6-newcomer"});
    let metadata = json!({"packages": [{"name": "r6", "dependencies": [dependency]}]});
    let found = layers::violations(&metadata.to_string());
    assert_eq!(found, ["`r6` depends on `r6-newcomer`: its rule does not allow this crate"]);
}

/// What the brain of the client may name besides [`PURE_STD`]: futures and what they wait for, but nothing
/// that carries bytes or time.
const BRAIN: [&str; 15] = [
    "std::future",
    "std::io::ErrorKind",
    "std::net::SocketAddr",
    "std::panic",
    "std::pin",
    "std::slice",
    "std::sync::Mutex",
    "std::sync::MutexGuard",
    "std::sync::OnceLock",
    "std::sync::PoisonError",
    "std::sync::atomic",
    "std::task",
    "tokio::pin",
    "tokio::select",
    "tokio::sync",
];
const HANDS: [&str; 2] = ["hands", "blocking"];

/// In a larger circle of files there is no place where a reader can begin.
const LARGEST_CIRCLE: usize = 6;

#[test]
fn no_large_circle_of_files_is_in_any_crate() {
    for rule in RULES {
        let circles = Sources::of_package(rule.package).circles_of_more_than(LARGEST_CIRCLE);
        assert!(circles.is_empty(), "{}:\n{}", rule.package, circles.join("\n"));
    }
}

#[test]
fn only_the_hands_of_the_client_know_sockets_clocks_and_threads() {
    let sources = Sources::of_package("r6-client");
    let named = names_outside(&sources, &HANDS);
    assert!(named.is_empty(), "\n{}", named.join("\n"));
    assert!(!names_outside(&sources, &[]).is_empty(), "the hands name them");
}

/// The decisions of the gateway are pure: times and events come in.
#[test]
fn the_core_of_the_gateway_knows_no_clocks_sockets_and_threads() {
    let sources = Sources::of_package("r6-gateway");
    let shell = [
        "accounts",
        "auditor",
        "backup",
        "certificate",
        "clock",
        "files",
        "fleet",
        "folder",
        "gateway",
        "history",
        "http",
        "live",
        "outage",
        "ownership",
        "peers",
        "problem",
        "programs",
        "raw_port",
        "reserve",
        "secret",
        "settings",
        "sharing",
        "shell",
        "simulated",
        "simulation",
        "store",
        "tokens",
        "traces",
        "verify",
    ];
    // An address is a value: the policy of the raw port is about addresses.
    let allowed = [PURE_STD, &["std::net::IpAddr", "std::net::Ipv6Addr", "std::net::SocketAddr"]].concat();
    let named = sources.names_outside(
        &["std", "tokio", "rusqlite", "tokio_postgres", "axum", "r6_client"],
        &allowed,
        &shell,
    );
    assert!(named.is_empty(), "\n{}", named.join("\n"));
}

#[test]
fn only_the_store_of_the_gateway_knows_databases() {
    let sources = Sources::of_package("r6-gateway");
    let databases = ["rusqlite", "tokio_postgres"];
    let named = sources.names_outside(&databases, &[], &["store"]);
    // Tests break files on purpose.
    let named: Vec<_> = named.into_iter().filter(|named| !named.contains("::tests")).collect();
    assert!(named.is_empty(), "\n{}", named.join("\n"));
    assert!(!sources.names_outside(&databases, &[], &[]).is_empty(), "the store names them");
}

fn names_outside(brain: &Sources, exempt: &[&str]) -> Vec<String> {
    brain.names_outside(&["std", "core", "tokio"], &[PURE_STD, &BRAIN].concat(), exempt)
}

#[test]
fn pure_crates_name_nothing_of_the_standard_library_that_is_not_allowed() {
    for rule in RULES.iter().filter(|rule| keeps_to_pure_rules(rule)) {
        let allowed = match rule.package {
            // Processor instructions: `sixteen_bytes.rs`.
            "r6-proto" => [PURE_STD, &["std::arch"]].concat(),
            _ => PURE_STD.to_vec(),
        };
        let named = Sources::of_package(rule.package).names_outside(&["std", "core", "alloc"], &allowed, &[]);
        assert!(named.is_empty(), "{}:\n{}", rule.package, named.join("\n"));
    }
}

/// The statements of a source, each on one line: the formatter breaks the long ones.
fn statements(text: &str) -> Vec<String> {
    let mut statements = vec![String::new()];
    for line in text.lines().map(str::trim) {
        if let Some(statement) = statements.last_mut() {
            statement.push_str(line);
        }
        if line.ends_with([';', '{', '}', ':', ',']) {
            statements.push(String::new());
        }
    }
    statements
}

/// Readers of a virtual controller's log must decide by its events, which have fields. The text of an event
/// is for people.
#[test]
fn nothing_outside_the_controller_decides_by_the_text_of_an_event() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let (mut sources, mut folders) = (Vec::new(), vec![crates.clone()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let of_the_controller = path == crates.join("r6-controller/src");
            if path.is_dir() && !of_the_controller {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs" || extension == "py") {
                sources.push(path);
            }
        }
    }
    let parses = |statement: &String| {
        let shown =
            ["line.to_string()", "entry.to_string()", "event.to_string()", ".text(Language", "line.text"];
        let asks =
            ["contains(", "starts_with(", "ends_with(", "strip_prefix(", "split_once(", "startswith(", "=="];
        // A log that is kept as text is asked elsewhere.
        let takes = ["== ", "contains(&", " in ", "log.push("];
        shown.iter().filter_map(|shown| statement.split_once(shown)).any(|(before, after)| {
            asks.iter().any(|ask| after.contains(ask)) || takes.iter().any(|take| before.ends_with(take))
        })
    };
    let reads_a_log =
        |text: &str| text.contains("LogEntry") || text.contains(".log()") || text.contains("poll_log");
    let mut read = 0;
    for path in &sources {
        let text = fs::read_to_string(path).unwrap();
        if reads_a_log(&text) && !path.ends_with("r6-testkit/tests/layers.rs") {
            read += 1;
            let lines: Vec<_> = statements(&text).into_iter().filter(parses).collect();
            assert!(lines.is_empty(), "{}: {lines:#?}", path.display());
        }
    }
    assert!(read > 20, "only {read} files read a log: is this looking in the right place?");
}

#[test]
fn a_circle_of_files_is_reported() {
    let files = [
        ("lib.rs", "mod a; pub use c::Third;"),
        ("a.rs", "use crate::b::{First, Second}; mod inner;"),
        ("a/inner.rs", "use super::Outer; use crate::d;"),
        ("b.rs", "fn third(of: crate::Third) {}"),
        ("c.rs", "use crate::{Other, a::inner as within};"),
        ("d.rs", "use crate::{a, b, c};"),
        // A parent and its child alone are no circle.
        ("e.rs", "mod child; use child::Inner;"),
        ("e/child.rs", "use super::Outer;"),
    ];
    let sources = Sources::of(files);
    assert_eq!(sources.circles_of_more_than(5), Vec::<String>::new());
    let circles = sources.circles_of_more_than(4);
    assert_eq!(
        circles,
        [
            "5 files import each other in a circle:\n  a imports b\n  a::inner imports d\n  b imports c\n  c imports \
          a::inner\n  d imports a, b, c"
        ]
    );
}

#[test]
fn a_socket_outside_of_the_hands_is_reported() {
    let named = |text| names_outside(&Sources::of([("robot/requests.rs", text)]), &HANDS);
    for (text, path) in [
        ("use tokio::time::sleep;", "tokio::time::sleep"),
        ("use tokio::{sync::watch, net::TcpStream as Stream};", "tokio::net::TcpStream"),
        ("async fn run() { tokio::spawn(async {}); }", "tokio::spawn"),
        ("fn now() -> std::time::Instant { ::std::time::Instant::now() }", "std::time::Instant"),
        ("use std::{fmt, time::{Duration, SystemTime}};", "std::time::SystemTime"),
        ("use std::time;", "std::time"),
        ("use std::time::*;", "std::time"),
        ("const QUOTE: char = '\"'; use std::thread;", "std::thread"),
        ("#[cfg(test)] mod tests { use std::fs; } use std::net::TcpStream;", "std::net::TcpStream"),
        ("use std::net::UdpSocket;", "std::net::UdpSocket"),
        ("fn f() { std::process::Command::new(text) }", "std::process::Command::new"),
        ("use std::thread::Builder;", "std::thread::Builder"),
        ("use std::fs::OpenOptions;", "std::fs::OpenOptions"),
    ] {
        let found = named(text);
        assert!(found.contains(&format!("`robot::requests` names `{path}`")), "{text}: {found:?}");
    }
    for text in [
        "use std::time::Duration; use tokio::sync::Mutex; use r6_proto::time::Instant;",
        "// use std::thread;\n/* std::fs /* std::net */ std::fs */ const TEXT: &str = \"std::fs\";",
        "const RAW: &str = r#\"\"std::fs\"#; fn long<'a>(text: &'a str) {}",
        "#[cfg(test)]\nmod tests {\n    use std::{fs, thread};\n    fn f() {}\n}",
        "#[cfg(test)] use std::fs;",
    ] {
        assert_eq!(named(text), Vec::<String>::new(), "{text}");
    }
    let hand = Sources::of([("hands/tokio.rs", "use tokio::net;"), ("blocking.rs", "use std::thread;")]);
    assert_eq!(names_outside(&hand, &HANDS), Vec::<String>::new());
    assert_eq!(names_outside(&hand, &["hand"]).len(), 2, "a part of a name is no folder");
}
