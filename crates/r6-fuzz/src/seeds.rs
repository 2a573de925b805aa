//! Seeds made from the golden vectors, transcripts, examples, programs, models and scenarios.

mod every;

use std::fs;
use std::path::{Path, PathBuf};

use r6_traffic::random::Random;

use crate::files::KINDS;
use crate::mutation;

/// A file of a corpus: its name and its bytes.
pub type Seed = (String, Vec<u8>);

/// The maximum number of files of a corpus.
pub const MOST_FILES: usize = 60;

/// The maximum size of a corpus in bytes, because every test run reads it.
pub const MOST_BYTES: usize = 300_000;

/// The seeds of a target; empty for an unknown target.
#[must_use]
pub fn of(target: &str) -> Vec<Seed> {
    match target {
        "frames" => frames(),
        "messages" => frame_texts(),
        "client_session" => client_session(),
        "server_session" => server_session(),
        "controller" => controller(),
        "files" => files(),
        "saved_state" => saved_states(),
        "panel" => panel(),
        _ => Vec::new(),
    }
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The files with this extension in a folder and those below it, by name.
fn below(folder: &str, extension: &str) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    let mut folders = vec![repository().join(folder)];
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(&folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|found| found == extension) {
                let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                found.push((stem, crate::corpus::read(&path)));
            }
        }
    }
    found.sort();
    found
}

/// The frames of the golden vectors.
fn vectors() -> Vec<Seed> {
    below("vectors/messages", "json")
        .into_iter()
        .filter_map(|(name, text)| {
            let vector: serde_json::Value = serde_json::from_slice(&text).ok()?;
            Some((name, vector.get("frame")?.as_str()?.as_bytes().to_vec()))
        })
        .collect()
}

/// Selects at most `count` seeds, evenly spaced.
fn some(seeds: Vec<Seed>, count: usize) -> Vec<Seed> {
    let every = seeds.len().div_ceil(count).max(1);
    seeds.into_iter().step_by(every).collect()
}

fn frame_texts() -> Vec<Seed> {
    let every = every::EVERY.map(|(name, parts)| (name.to_owned(), parts.concat().into_bytes()));
    some(vectors(), MOST_FILES).into_iter().chain(every).collect()
}

fn frames() -> Vec<Seed> {
    let mut random = Random::new(1);
    let singles = some(vectors(), 40);
    let mut seeds = Vec::new();
    for (at, pair) in singles.windows(3).enumerate() {
        let between = [&b"\r\n"[..], b"", b"\0", b"\xEF\xBB\xBF", b" x ", b"}"][at % 6];
        let mut bytes = vec![random.next_number().to_le_bytes()[0], 0, random.next_number().to_le_bytes()[0]];
        for (_, frame) in pair {
            bytes.extend_from_slice(frame);
            bytes.extend_from_slice(between);
        }
        seeds.push((format!("stream-{at}"), bytes));
    }
    seeds
}

/// Random operations; requests that are lost completely, in part and not at all; and enough requests to fill
/// the output.
fn client_session() -> Vec<Seed> {
    const WINDOW: u8 = 64;
    let mut seeds = made_up(b"client", 40, 400);
    let request = |kind: u8| [0, 1, 0, 2, 3, 0, kind];
    let one_move = [&request(4)[..], &[1]].concat();
    let moves = one_move.repeat(3);
    for (name, left) in [("none", 0_u16), ("a-byte", 1), ("half", 200), ("one-and-a-half", 900)] {
        let bytes = [&[0][..], &moves, &[3], &left.to_le_bytes()].concat();
        seeds.push((format!("lost-{name}"), bytes));
    }
    let waits = [&[0][..], &moves, &[5, 11, 0xD0, 7, 11, 0xD0, 7]].concat();
    seeds.push(("waits-too-long".to_owned(), waits));
    let points = request(5).repeat(usize::from(WINDOW) - 4);
    let full = [&[0x80][..], &points, &[3, 0xFF, 0xFF], &points[..70], &[5], &points[..70]].concat();
    seeds.push(("fills-up".to_owned(), full));
    seeds
}

fn server_session() -> Vec<Seed> {
    let mut seeds = made_up(b"server", 25, 300);
    for (name, frame) in some(vectors(), 25) {
        let (first, second) = frame.split_at(frame.len().min(200) / 2);
        let mut bytes = vec![0];
        for piece in [first, second] {
            let Ok(length) = u16::try_from(piece.len()) else { continue };
            bytes.push(3);
            bytes.extend_from_slice(&length.to_le_bytes());
            bytes.extend_from_slice(piece);
            bytes.extend_from_slice(&[6, 2, b'r', 8, 20, 3, b's', 4, 30, 9]);
        }
        seeds.push((format!("frame-{name}"), bytes));
    }
    seeds
}

/// Random operations. Any bytes are a valid input.
fn made_up(name: &[u8], count: usize, most: usize) -> Vec<Seed> {
    let mut random = Random::new(name.iter().fold(7, |sum, byte| sum * 31 + u64::from(*byte)));
    let name = String::from_utf8_lossy(name);
    (0..count)
        .map(|number| {
            let length = 8 + mutation::below(&mut random, most);
            let bytes = (0..length).map(|_| random.next_number().to_le_bytes()[0]).collect();
            (format!("{name}-{number}"), bytes)
        })
        .collect()
}

/// Random operations, and moves that something stops, on each firmware.
fn controller() -> Vec<Seed> {
    let mut seeds = made_up(b"control", 25, 500);
    // One-shot axis moves at 20 %, to a tenth and a fifth of the way to the limits.
    let step = |part: i16| {
        let axes = [part, -part, part, 0, part, 0].map(i16::to_le_bytes).concat();
        [&[0, 1, 0], &axes[..]].concat()
    };
    let list =
        |replace: u8, parts: [i16; 2]| [&[0, replace, 2], &step(parts[0])[..], &step(parts[1])].concat();
    let panel = |which: u8, more: &[u8]| [&[9, 0, 0, 1, which], more].concat();
    let command = |number: u8| vec![3, number];
    let (later, soon) = ([8, 100], [7, 100]);
    let stops: [(&str, Vec<u8>); 9] = [
        ("stop", command(0)),
        ("pause", command(2)),
        ("stop-button", command(3)),
        ("key", panel(5, &[1])),
        ("emergency-stop", panel(6, &[])),
        ("alarm", panel(9, &[130, 0])),
        ("power-cut", vec![12, 2]),
        ("speed-0", command(8)),
        ("replace", list(1, [-100, 0])),
    ];
    for (at, (name, stop)) in stops.into_iter().enumerate() {
        let at = u8::try_from(at).unwrap_or_default();
        let bytes = [
            &[at % 4, 0, 0][..],
            &list(1, [100, -200]),
            &soon,
            &stop,
            &soon,
            &command(10),
            &later,
            &command(5),
            &command(1),
            &list(0, [50, 20]),
            &later,
            &[13],
        ];
        seeds.push((format!("then-{name}"), bytes.concat()));
    }
    // Moves that arrive at several speeds, and commands with an effect, on each firmware.
    for firmware in 0..4 {
        let arrives = [&list(1, [100, -200])[..], &later.repeat(10)].concat();
        let sets = [command(8), command(25), command(23), command(24), command(14), command(15)].concat();
        let bytes = [&[firmware, 0, 0], &arrives[..], &sets, &list(0, [50, 20]), &later.repeat(12)].concat();
        seeds.push((format!("arrives-{firmware}"), bytes));
    }
    // Moves by hand, with the key in manual.
    let jog = panel(11, &[0, 0x2C, 1, 200, 0]);
    let by_hand = [&[0, 0, 2][..], &jog, &soon, &panel(3, &[1]), &later, &jog, &soon, &panel(6, &[]), &later];
    seeds.push(("by-hand".to_owned(), by_hand.concat()));
    let homing = [&[1, 1, 0xF2][..], &panel(10, &[]), &later, &panel(5, &[0]), &command(1), &later];
    seeds.push(("homing".to_owned(), homing.concat()));
    seeds
}

fn files() -> Vec<Seed> {
    let of_kind = |kind: u8, files: Vec<Seed>| {
        files.into_iter().map(move |(name, text)| {
            let (_, what) = KINDS.iter().find(|(known, _)| *known == kind).expect("a kind of file");
            let word = what.rsplit(' ').next().unwrap_or(what).to_lowercase();
            (format!("{word}-{name}"), [&[kind], &text[..]].concat())
        })
    };
    let profile = b"base = \"hc1\"\nname = \"my-cell\"\nmax_connections = 2\nadd_rcc_ack_ms = 25\nkey_order = \"manual\"\n\
        counter_form = \"texts\"\naction_stop_mode = \"stop\"\nadd_rcc_unarmed = \"arm\"\nreplace_in_motion = \"take-over\"\n";
    of_kind(b'P', below("crates/r6-controller/programs", "toml"))
        .chain(of_kind(b'T', below("examples/programs", "toml")))
        .chain(of_kind(b'J', below("examples/programs", "json")))
        .chain(of_kind(b'M', below("crates/r6-motion/models", "toml")))
        .chain(of_kind(b'S', some(below("examples/scenarios", "toml"), 30)))
        .chain(of_kind(b'F', vec![("my-cell".to_owned(), profile.to_vec())]))
        .collect()
}

fn saved_states() -> Vec<Seed> {
    let mut seeds: Vec<Seed> = Vec::new();
    let settings = crate::saved_state::settings();
    let machine = r6_controller::machine::Machine::new(settings, r6_proto::time::Instant::ORIGIN);
    let fresh = machine.saved().to_json();
    let with = |member: &str, value: &str| {
        fresh.replace(&format!("\"{member}\": {{}}"), &format!("\"{member}\": {value}"))
    };
    seeds.push(("tools".to_owned(), with("tools", r#"{"1": [0, 0, 100.5, 0, 90, 0]}"#).into_bytes()));
    seeds.push(("benches".to_owned(), with("benches", r#"{"31": [1e6, -5, 0, 180, 0, 0]}"#).into_bytes()));
    seeds.push(("registers".to_owned(), with("registers", r#"{"800": -300000, "900": 7}"#).into_bytes()));
    let stack = r#"{"0": {"spacing": [100.0, 50.0, 0.5], "count": [2, 3, 4]}}"#;
    seeds.push(("stacks".to_owned(), with("stacks", stack).into_bytes()));
    for mode in ["manual", "stop"] {
        seeds.push((format!("mode-{mode}"), fresh.replace("\"auto\"", &format!("\"{mode}\"")).into_bytes()));
    }
    let programs = ",\n  \"programs\": {\"mine\": \"[[step]]\\ndo = \\\"wait\\\"\\nseconds = 1\\n\"}\n}";
    let newer = fresh.replace("\"version\": 1", "\"version\": 2").replace("\"remote\"", "\"mine\"");
    seeds.push((
        "programs".to_owned(),
        newer.trim_end().trim_end_matches('}').trim_end().to_owned().into_bytes(),
    ));
    if let Some((_, bytes)) = seeds.last_mut() {
        bytes.extend_from_slice(programs.as_bytes());
    }
    seeds.push(("fresh".to_owned(), fresh.into_bytes()));
    seeds
}

fn panel() -> Vec<Seed> {
    const ACTIONS: [&str; 12] = [
        r#"{"do":"set_input","point":"X1.011","on":true}"#,
        r#"{"do":"set_input","point":"eux010","on":true}"#,
        r#"{"do":"switch_program","program":"register-move"}"#,
        r#"{"do":"turn_key","key":"manual"}"#,
        r#"{"do":"press","button":"single_cycle"}"#,
        r#"{"do":"raise_alarm","alarm":135}"#,
        r#"{"do":"clear_alarm"}"#,
        r#"{"do":"emergency_stop"}"#,
        r#"{"do":"release_emergency_stop"}"#,
        r#"{"do":"jog","axis":"J1","by":150.0,"speed_percent":1.0}"#,
        r#"{"do":"home"}"#,
        r#"{"do":"press","button":"pausse"}"#,
    ];
    let request = |head: &str, body: &str| {
        let length = u16::try_from(body.len()).unwrap_or(u16::MAX).to_le_bytes();
        [format!("{head}\n\n").as_bytes(), &length, body.as_bytes()].concat()
    };
    let own = "Host: 127.0.0.1:9770";
    let post = |number: usize, body: &str| {
        request(
            &format!("POST\n/v1/controllers/{number}/actions\n{own}\nContent-Type: application/json"),
            body,
        )
    };
    let mut seeds: Vec<Seed> = Vec::new();
    for (at, pair) in ACTIONS.windows(2).enumerate() {
        let bytes =
            [post(1, pair[0]), post(1, pair[1]), request(&format!("GET\n/v1/controllers/1\n{own}"), "")];
        seeds.push((format!("actions-{at}"), bytes.concat()));
    }
    let by_hand = [post(2, ACTIONS[3]), post(2, ACTIONS[9]), post(2, ACTIONS[10]), post(2, ACTIONS[7])];
    seeds.push(("by-hand".to_owned(), by_hand.concat()));
    let paths = ["/v1/controllers", "/v1/openapi.json", "/v1/controllers/3", "/v1/controllers/x%20y", "/"];
    for (at, path) in paths.into_iter().enumerate() {
        seeds.push((format!("get-{at}"), request(&format!("GET\n{path}\n{own}"), "")));
    }
    let program = "[[step]]\ndo = \"wait\"\nseconds = 1\n";
    let put = format!("PUT\n/v1/controllers/1/programs/mine\n{own}\nContent-Type: text/plain");
    seeds.push(("program".to_owned(), request(&put, program)));
    seeds.push(("bad-program".to_owned(), request(&put, "[[step]]\ndo = \"jump\"\n")));
    for (name, header) in [
        ("foreign-host", "Host: evil.example"),
        ("foreign-origin", "Host: localhost:9770\nOrigin: http://evil.example"),
        ("foreign-port", "Origin: http://127.0.0.1:9770\nHost: 127.0.0.1"),
        ("name-like-localhost", "Host: localhost.evil.example:9770"),
        ("name-like-an-address", "Host: 127.0.0.1.evil.example"),
        ("password-like-an-address", "Host: 127.0.0.1:1@evil.example"),
        ("own-origin", "Host: localhost:9770\nOrigin: http://localhost:9770"),
        ("cross-site", "Host: localhost\nSec-Fetch-Site: cross-site"),
        ("two-hosts", "Host: localhost\nHost: evil.example"),
        ("plain-text", "Host: localhost\nContent-Type: text/plain"),
    ] {
        let head = format!("POST\n/v1/controllers/1/actions\n{header}\nContent-Type: application/json");
        seeds.push((name.to_owned(), request(&head, ACTIONS[7])));
    }
    seeds.push(("delete".to_owned(), request(&format!("DELETE\n/v1/controllers/1\n{own}"), "")));
    seeds
}
