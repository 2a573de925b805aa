//! A gateway that works is killed at random moments, and started again on its folder: what it acknowledged
//! is there, each lease, command, stop and program, and the audit log is whole. It is longer than it may
//! be, so its oldest entries are removed meanwhile, and it has the entries of the heads that were signed.
//! `R6_KILLS` says how often.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use serde_json::{Value, json};

use crate::gateway_calls::{attempt, gateway, get, token};
use crate::support::{Robot, r6};

/// How often it is killed, if nothing else is said.
const KILLS: u64 = 12;

/// How many entries of the audit log are kept, and how many it has before the first start.
const ENTRIES: (usize, usize) = (1_000, 1_050);

/// How long a caller waits for an answer. A gateway that is killed closes the connection.
const PATIENCE: Duration = Duration::from_secs(60);

/// The robots. Each has a caller that leases, commands and stops it.
const ROBOTS: [&str; 2] = ["press", "saw"];

/// What callers were told since the last start. The gateway may have done more than it could tell.
#[derive(Debug, Default)]
struct Told {
    /// The leases that were given out.
    began: Vec<u64>,
    /// Those that were taken back.
    ended: Vec<u64>,
    /// The commands that were accepted: the numbers of their intents.
    accepted: Vec<u64>,
    /// How many stops were confirmed.
    stops: usize,
    /// Whether a stop holds; `None` if the last request about that had no answer.
    stopped: Option<bool>,
    /// The last version of the program, with its text.
    program: Option<(u64, String)>,
}

/// One request. `None`: there was no answer, so the gateway is killed.
fn ask(url: &str, token: &str, method: &str, path: &str, lines: &str, body: &Value) -> Option<(u16, Value)> {
    // A token may make 100 requests a second.
    thread::sleep(Duration::from_millis(10 * (ROBOTS.len() as u64 + 2)));
    attempt(url, token, method, path, lines, body, PATIENCE)
}

/// Leases, commands and stops a robot until the gateway is killed.
fn command(url: &str, token: &str, robot: &str, told: &mut Told) -> Option<()> {
    let path = |what: &str| format!("/v1/robots/{robot}/{what}");
    let post = |what: &str, body: &Value| ask(url, token, "POST", &path(what), "", body);
    for round in 0_u64.. {
        let (status, lease) = post("lease", &json!({}))?;
        assert_eq!(status, 200, "{lease}");
        told.began.push(lease["lease"]["number"].as_u64().unwrap());
        if told.stopped.is_some() {
            assert_eq!(lease["stopped"].as_bool(), told.stopped, "{robot}: {told:?}");
        }
        let key = json!({ "lease": lease["lease"] });
        if lease["stopped"] == true {
            told.stopped = None;
            if post("clear-stopped", &key)?.0 == 204 {
                told.stopped = Some(false);
            }
        } else {
            told.stopped = Some(false);
        }
        let percent = (20 + round % 60).to_string();
        let wanted = json!({ "command": "modifyGSPD", "arguments": [percent], "lease": lease["lease"] });
        let (status, answer) = post("commands", &wanted)?;
        // The robot is just being connected to, or a list of it is being looked at.
        assert!(matches!(status, 200 | 409), "{answer}");
        if status == 200 {
            told.accepted.push(answer["command_id"].as_u64().unwrap());
        }
        if round % 2 == 1 {
            told.stopped = None;
            if post("stop", &Value::Null)?.0 == 200 {
                (told.stops, told.stopped) = (told.stops + 1, Some(true));
            }
        }
        let (status, answer) = ask(url, token, "DELETE", &path("lease"), "", &key)?;
        assert_eq!(status, 204, "{answer}");
        told.ended.push(lease["lease"]["number"].as_u64().unwrap());
    }
    None
}

/// Changes a program until the gateway is killed.
fn write(url: &str, token: &str, told: &mut Told) -> Option<()> {
    let path = "/v1/programs/pick";
    let mut etag = match ask(url, token, "GET", path, "", &Value::Null)? {
        (200, found) => Some(found["etag"].as_str().unwrap().to_owned()),
        (404, _) => None,
        other => panic!("{other:?}"),
    };
    for round in 0.. {
        let text =
            format!("[[instruction]]\ndo = \"wait\"\nseconds = {round}.5\n# {:?}\n", told.program.as_ref());
        let text = text.chars().take(200).collect::<String>();
        let line = etag.map_or("If-None-Match: *\r\n".to_owned(), |etag| format!("If-Match: {etag}\r\n"));
        let (status, kept) = ask(url, token, "PUT", path, &line, &json!({ "program": text }))?;
        assert!(matches!(status, 200 | 201), "{kept}");
        told.program = Some((kept["version"].as_u64().unwrap(), text));
        etag = kept["etag"].as_str().map(str::to_owned);
    }
    None
}

/// Fetches signed heads until the gateway is killed.
fn keep_heads(url: &str, token: &str, kept: &mut Option<Value>) -> Option<()> {
    loop {
        let (status, head) = ask(url, token, "GET", "/v1/audit/head", "", &Value::Null)?;
        assert_eq!(status, 200, "{head}");
        *kept = Some(head);
    }
}

/// Whether the audit log is whole, and has the entry of this head. Returns how many entries were removed.
fn check_heads(kill: u64, data: &str, kept: Option<&Value>) -> u64 {
    let mut args = vec!["gateway", "verify", "--data", data, "--json"];
    let file = tempfile::NamedTempFile::new().unwrap();
    let path = file.path().display().to_string();
    if let Some(head) = kept {
        std::fs::write(file.path(), head.to_string()).unwrap();
        args.extend(["--head", &path, "--key", head["key"].as_str().unwrap()]);
    }
    let verified = r6(&args).json();
    assert_eq!(verified["whole"], true, "kill {kill}: {verified}");
    if let Some(head) = kept {
        assert_eq!(verified["kept_head"]["number"], head["number"], "kill {kill}: {verified}");
        assert_eq!(verified["key"], head["key"], "kill {kill}: the key stays");
    }
    verified["removed"].as_u64().unwrap()
}

/// The entries of the audit log after this one.
fn entries(url: &str, token: &str, mut after: u64) -> Vec<Value> {
    let mut all = Vec::new();
    loop {
        let page = get(url, token, &format!("/v1/audit?after={after}&limit=1000")).1;
        all.extend(page["entries"].as_array().unwrap().iter().cloned());
        match page["next_after"].as_u64() {
            Some(next) => after = next,
            None => return all,
        }
    }
}

/// Whether everything that was told of a robot is in its entries.
fn check(kill: u64, robot: &str, told: &Told, entries: &[Value]) {
    let of = |what: &str| -> Vec<&Value> {
        entries.iter().filter(|entry| entry["what"] == what && entry["robot"] == robot).collect()
    };
    let numbers = |what: &str, field: &str| -> BTreeSet<u64> {
        of(what).iter().map(|entry| entry[field].as_u64().unwrap()).collect()
    };
    let missing = |told: &[u64], kept: &BTreeSet<u64>| -> Vec<u64> {
        told.iter().copied().filter(|number| !kept.contains(number)).collect()
    };
    let none = Vec::<u64>::new();
    assert_eq!(
        missing(&told.began, &numbers("lease_began", "lease")),
        none,
        "kill {kill}: leases of {robot}"
    );
    assert_eq!(missing(&told.ended, &numbers("lease_ended", "lease")), none, "kill {kill}: ends of leases");
    assert_eq!(missing(&told.accepted, &numbers("command_intent", "number")), none, "kill {kill}: intents");
    let outcomes: BTreeMap<u64, &Value> = of("command_outcome")
        .iter()
        .map(|entry| (entry["intent"].as_u64().unwrap(), &entry["outcome"]))
        .collect();
    for command in &told.accepted {
        assert_eq!(outcomes.get(command), Some(&&json!("accepted")), "kill {kill}: command {command}");
    }
    let stops = of("stop").iter().filter(|entry| entry["confirmed"] == true).count();
    assert!(stops >= told.stops, "kill {kill}: {stops} of {} stops", told.stops);
}

#[test]
fn nothing_that_a_gateway_acknowledged_is_lost_when_it_is_killed() {
    let kills = std::env::var("R6_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(KILLS);
    let robots = ROBOTS.map(|name| (name, Robot::start(&[])));
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data").display().to_string();
    let named = robots.each_ref().map(|(name, robot)| format!("{name}={}", robot.address()));
    let config = folder.path().join("hall.toml").display().to_string();
    std::fs::write(&config, format!("[audit]\nmax_entries = {}\n", ENTRIES.0)).unwrap();
    for _ in 0..ENTRIES.1 {
        let viewer = r6_api::gateway::Role::Viewer;
        r6_gateway::make_token(Path::new(&data), viewer, None, String::new()).unwrap();
    }
    let start = || gateway(&data, &["--robot", &named[0], "--robot", &named[1], "--config", &config]);
    let (mut running, mut url) = start();
    let admin = token(&data, "admin");
    // A killed gateway takes the new token once it has read it.
    let mut seen = 0;
    let mut stopped: [Option<bool>; 2] = [Some(false); 2];
    let (mut seed, mut last_lease) = (0x2545_F491_u64, [0; 2]);
    let mut counts = [0_usize; 4];
    let (mut heads, mut removed) = (0, 0);
    for kill in 0..kills {
        crate::gateway_calls::until(|| (get(&url, &admin, "/v1/robots").0 == 200).then_some(()));
        let is_killed = AtomicBool::new(false);
        let mut told = [0, 1].map(|at: usize| Told { stopped: stopped[at], ..Told::default() });
        let mut of_program = Told::default();
        let mut kept = None;
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let lives = Duration::from_micros(20_000 + (seed >> 33) % 600_000);
        thread::scope(|scope| {
            let (url, admin, is_killed) = (url.as_str(), admin.as_str(), &is_killed);
            for (robot, told) in ROBOTS.iter().zip(&mut told) {
                scope.spawn(move || {
                    command(url, admin, robot, told);
                    assert!(is_killed.load(Ordering::SeqCst), "{robot}: a request had no answer: {told:?}");
                });
            }
            let of_program = &mut of_program;
            scope.spawn(move || {
                write(url, admin, of_program);
                assert!(is_killed.load(Ordering::SeqCst), "a request about a program had no answer");
            });
            let kept = &mut kept;
            scope.spawn(move || {
                keep_heads(url, admin, kept);
                assert!(is_killed.load(Ordering::SeqCst), "a request for a head had no answer");
            });
            thread::sleep(lives);
            is_killed.store(true, Ordering::SeqCst);
            running.kill();
        });
        heads += usize::from(kept.is_some());
        let now = check_heads(kill, &data, kept.as_ref());
        assert!(now >= removed, "kill {kill}: {now} removed entries, and there were {removed}");
        removed = now;
        (running, url) = start();
        let entries = entries(&url, &admin, seen);
        seen = entries.last().map_or(seen, |entry| entry["number"].as_u64().unwrap());
        for (at, (robot, told)) in ROBOTS.iter().zip(&told).enumerate() {
            check(kill, robot, told, &entries);
            let began = told.began.iter().copied();
            assert!(
                began.clone().all(|lease| lease > last_lease[at]),
                "kill {kill}: a lease has an old number"
            );
            last_lease[at] = began.max().unwrap_or(last_lease[at]);
            stopped[at] = told.stopped;
            counts = [
                counts[0] + told.began.len(),
                counts[1] + told.accepted.len(),
                counts[2] + told.stops,
                counts[3],
            ];
        }
        if let Some((version, text)) = of_program.program {
            let (status, kept) = get(&url, &admin, &format!("/v1/programs/pick?version={version}"));
            assert_eq!((status, &kept["program"]), (200, &json!(text)), "kill {kill}: version {version}");
            counts[3] += 1;
        }
    }
    assert!(counts.iter().all(|count| *count > 0), "leases, commands, stops, programs: {counts:?}");
    assert!(heads > 0 && removed > 0, "{heads} heads, {removed} removed entries");
    println!(
        "{kills} kills; told and kept: {counts:?} leases, commands, stops, last versions of programs; {heads} heads; \
         {removed} entries removed"
    );
}
