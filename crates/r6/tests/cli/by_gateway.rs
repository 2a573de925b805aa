//! `r6 -g URL`: the same commands over a gateway.

use r6_testkit::hostile::{Character, Delays};
use serde_json::Value;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use crate::gateway_calls::{gateway, get, token, until};
use crate::support::{Outcome, Robot, Running, TempFile, hostile, r6};

/// A gateway with robots, as the holder of a token sees it.
pub(crate) struct Hall {
    _folder: tempfile::TempDir,
    _running: Running,
    pub(crate) data: String,
    pub(crate) url: String,
    token: TempFile,
}

impl Hall {
    /// A gateway with these robots (`NAME=ADDRESS`), which are up, and a token of this role. `name` is
    /// unique among the tests.
    pub(crate) fn start(name: &str, robots: &[&str], role: &str, more: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path().join("data").display().to_string();
        let mut options: Vec<_> = robots.iter().flat_map(|robot| ["--robot", robot]).collect();
        options.extend(more);
        let (running, url) = gateway(&data, &options);
        let secret = token(&data, role);
        let hall =
            Self { _folder: folder, _running: running, data, url, token: TempFile::new(name, &secret) };
        if more.is_empty() {
            for robot in robots {
                let path = format!("/v1/robots/{}", robot.split('=').next().unwrap());
                until(|| (get(&hall.url, &secret, &path).1["link"] == "up").then_some(()));
            }
        }
        hall
    }

    pub(crate) fn r6(&self, args: &[&str]) -> Outcome {
        r6(&[&["-g", &self.url, "--token-file", self.token.path()], args].concat())
    }

    /// The same with a new token of another role.
    pub(crate) fn r6_as(&self, role: &str, args: &[&str]) -> Outcome {
        let file =
            TempFile::new(&format!("{role}-{}", args.join("-").replace('/', "")), &token(&self.data, role));
        r6(&[&["-g", &self.url, "--token-file", file.path()], args].concat())
    }
}

/// The code of the problem on stdout.
pub(crate) fn code(outcome: &Outcome) -> Value {
    outcome.json()["code"].clone()
}

#[test]
fn values_states_and_commands_go_over_a_gateway_as_to_the_robot_itself() {
    let robot = Robot::start(&[]);
    let hall = Hall::start("hall-1", &[&format!("press={}", robot.address())], "operator", &[]);

    let addresses = ["query", "version", "axis-0", "curMode", "counter-0", "Addr-800", "curAlarm", "ioIn-0"];
    let known: Vec<_> = addresses.into_iter().filter(|word| *word != "ioIn-0").collect();
    let (direct, over) = (robot.r6(&known), hall.r6(&known));
    assert_eq!((over.code, &over.out), (direct.code, &direct.out), "{}", over.err);
    let [direct, over] = [
        robot.r6(&[&known[..], &["--json"]].concat()).json(),
        hall.r6(&[&known[..], &["--json"]].concat()).json(),
    ];
    assert_eq!(over["values"], direct["values"]);
    assert_eq!(over["robot"], "press");

    let missing = hall.r6(&["query", "counter-9", "--json"]);
    assert_eq!(missing.code, robot.r6(&["query", "counter-9", "--json"]).code, "{missing:?}");

    let all = hall.r6(&["status"]);
    assert_eq!(all.code, 0, "{all:?}");
    assert!(
        all.out
            .lines()
            .any(|line| line.starts_with("press  ")
                && line.ends_with(" running (7)  none   free   not stopped")),
        "{}",
        all.out
    );
    let one = hall.r6(&["-r", "press", "status"]);
    assert_eq!(one.code, 0, "{one:?}");
    assert!(one.out.lines().any(|line| line.starts_with("axis-0 ") && line.contains("fresh")), "{}", one.out);
    assert!(one.out.contains("\nmode     running (7)\nalarm    none\n"), "{}", one.out);
    assert_eq!(hall.r6(&["-r", "press", "status", "--json"]).json()["name"], "press");

    let watched = hall.r6(&["watch", "axis-0", "--times", "2", "--every", "20ms", "--json"]);
    assert_eq!((watched.code, watched.out.lines().count()), (0, 2), "{watched:?}");

    let done = hall.r6(&["command", "rewriteData", "800", "77", "0"]);
    assert_eq!(done.code, 0, "{done:?}");
    assert!(done.out.starts_with("rewriteData accepted after "), "{}", done.out);
    assert_eq!(robot.value("Addr-800"), 77);
    let done = hall.r6(&["command", "modifyGSPD", "5"]);
    assert!(done.out.ends_with("ms: global speed 5 %; on the wire \"50\"\n"), "{}", done.out);
    let done = hall.r6(&["command", "modifyOutput", "Y013", "on", "--json"]);
    assert_eq!(done.code, 0, "{done:?}");
    assert_eq!(
        hall.r6(&["-r", "press", "status", "--json"]).json()["lease"],
        Value::Null,
        "it is given back"
    );
}

#[test]
fn the_status_of_a_hall_has_the_mode_and_the_alarm_of_each_robot() {
    let scenario = TempFile::new("alarm.toml", "[[at]]\ntime = 0.1\ndo = \"alarm\"\nnumber = 5001\n");
    let robot = Robot::start(&["--scenario", scenario.path()]);
    let named = format!("press={}", robot.address());
    let hall = Hall::start("hall-status", &[&named, "saw=127.0.0.1:1"], "viewer", &["-v"]);
    let line = |name: &str| {
        let all = hall.r6(&["status"]).out;
        all.lines().find(|line| line.starts_with(name)).unwrap_or_default().to_owned()
    };
    let press = until(|| Some(line("press")).filter(|line| line.contains("5001")));
    assert!(press.contains("  5001 (user alarm of the program)  "), "{press}");
    let saw = line("saw");
    assert!(saw.contains("DOWN") && saw.contains("  -  "), "{saw}");
    let one = hall.r6(&["-r", "press", "status"]).out;
    assert!(one.contains("alarm    5001 (user alarm of the program)\n"), "{one}");
}

#[test]
fn a_stop_holds_until_it_is_cleared() {
    let robot = Robot::start(&[]);
    let hall = Hall::start("hall-2", &[&format!("press={}", robot.address())], "operator", &[]);
    let stopped = hall.r6(&["stop"]);
    assert_eq!(stopped.code, 0, "{stopped:?}");
    assert!(
        stopped.out.starts_with("press stands, seen after ") && stopped.out.contains("stop --clear`"),
        "{}",
        stopped.out
    );
    assert!(stopped.out.contains("not an emergency stop"));

    let refused = hall.r6(&["command", "clearAlarmContinue", "--json"]);
    assert_eq!((refused.code, code(&refused)), (1, "stopped".into()), "{refused:?}");
    let status = hall.r6(&["-r", "press", "status"]);
    assert_eq!(status.code, 1);
    assert!(
        status.out.contains("STOPPED") && status.out.contains("--robot press --gateway-url"),
        "{}",
        status.out
    );

    let cleared = hall.r6(&["stop", "--clear", "--json"]);
    assert_eq!((cleared.code, cleared.json()["cleared"].clone()), (0, true.into()), "{cleared:?}");
    assert_eq!(hall.r6(&["status"]).code, 0);
    // What stops needs no lease, and holds too.
    assert_eq!(hall.r6(&["command", "actionStop"]).code, 0);
    assert_eq!(hall.r6(&["status", "--json"]).json()["robots"][0]["stopped"], true);

    let none = robot.r6(&["stop", "--clear"]);
    assert_eq!(none.code, 2);
    assert!(none.err.contains("--clear is for the robots of a gateway"), "{}", none.err);
}

#[test]
fn what_is_refused_says_why_and_nothing_is_sent() {
    let robots = [Robot::start(&[]), Robot::start(&[])];
    let [press, saw] = ["press", "saw"].map(str::to_owned);
    let names = [format!("{press}={}", robots[0].address()), format!("{saw}={}", robots[1].address())];
    let hall = Hall::start("hall-3", &[&names[0], &names[1]], "operator", &[]);

    for args in [["stop", "--json"], ["query", "axis-0"]] {
        let which = hall.r6(&args);
        assert_eq!(which.code, 2, "{which:?}");
        assert!(
            which.err.contains("name one with --robot") && which.err.contains("press, saw"),
            "{}",
            which.err
        );
    }
    let unknown = hall.r6(&["-r", "pres", "query", "axis-0", "--json"]);
    assert_eq!((unknown.code, code(&unknown)), (2, "no_such_robot".into()), "{unknown:?}");
    let viewer = hall.r6_as("viewer", &["-r", "press", "command", "rewriteData", "800", "1", "0", "--json"]);
    assert_eq!((viewer.code, code(&viewer)), (1, "not_allowed".into()), "{viewer:?}");
    assert_eq!(hall.r6_as("viewer", &["-r", "press", "query", "axis-0"]).code, 0);
    assert_eq!(robots[0].value("Addr-800"), 0);

    let wrong = TempFile::new("hall-3-wrong", "Authorization: Bearer 00ff");
    let wrong = r6(&["-g", &hall.url, "--token-file", wrong.path(), "status", "--json"]);
    assert_eq!((wrong.code, code(&wrong)), (2, "no_token".into()), "{wrong:?}");
    let told = wrong.json()["message"].to_string();
    assert!(told.contains("does not know the token of --token-file "), "{wrong:?}");
    let none = r6(&["-g", &hall.url, "status"]);
    assert_eq!(none.code, 2);
    assert!(none.err.contains("R6_TOKEN"), "{}", none.err);

    let admin = token(&hall.data, "admin");
    let (status, _) = crate::gateway_calls::call(&hall.url, &admin, "POST", "/v1/robots/press/lease", "{}");
    assert_eq!(status, 200);
    let leased = hall.r6(&["-r", "press", "command", "rewriteData", "800", "1", "0", "--json"]);
    assert_eq!((leased.code, code(&leased)), (1, "leased".into()), "{leased:?}");
    for args in [&["-r", "press", "plot", "a.toml"][..], &["panel", "status"], &["up"]] {
        let other = hall.r6(args);
        assert_eq!(other.code, 2, "{args:?}: {other:?}");
    }

    // As without a gateway: a robot that is not there is no reply.
    drop(robots);
    let query = ["-r", "saw", "query", "axis-0", "--json"];
    let off = until(|| Some(hall.r6(&query)).filter(|outcome| code(outcome) == "not_ready"));
    assert_eq!(off.code, 3, "{off:?}");

    let url = hall.url.clone();
    let token = TempFile::new("hall-3-gone", &admin);
    drop(hall);
    let gone = r6(&["-g", &url, "--token-file", token.path(), "-r", "press", "stop", "--json"]);
    assert_eq!((gone.code, code(&gone)), (3, "not_stopped".into()), "{gone:?}");
    assert!(gone.json()["message"].as_str().unwrap().starts_with("the stop was not sent; "), "{gone:?}");
    let gone = r6(&["-g", &url, "--token-file", token.path(), "watch", "axis-0", "--times", "3", "--json"]);
    assert_eq!((gone.code, code(&gone)), (3, "unreachable".into()), "{gone:?}");
}

#[test]
fn an_outcome_that_the_gateway_does_not_know_is_exit_code_4() {
    let delays = Delays { command: Duration::from_secs(60), ..Delays::default() };
    let (robot, controller) = hostile(Character { arms_itself: true, delays, ..Character::default() });
    let hall = Hall::start("hall-4", &[&format!("press={robot}")], "operator", &[]);
    let outcome = hall.r6(&["command", "rewriteData", "800", "1", "0", "--json"]);
    assert_eq!((outcome.code, code(&outcome)), (4, "outcome_unknown".into()), "{outcome:?}");
    drop(controller);
}

/// A way to a gateway that swallows the first answer to a command. Returns its URL, and how many requests
/// for commands came.
fn lossy(gateway: &str) -> (String, Arc<AtomicUsize>) {
    let to = gateway.trim_start_matches("http://").to_owned();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let commands = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&commands);
    thread::spawn(move || {
        for near in listener.incoming() {
            let (Ok(mut near), Ok(mut far)) = (near, TcpStream::connect(&to)) else { return };
            let count = Arc::clone(&count);
            thread::spawn(move || {
                // Requests of these commands are short, and come in one or two pieces.
                let mut request = [0; 8192];
                let mut is_first = false;
                let mut back = far.try_clone().unwrap();
                let mut out = near.try_clone().unwrap();
                let mut pump = None;
                while let Ok(read @ 1..) = near.read(&mut request) {
                    if request[..read].windows(10).any(|part| part == b"/commands ") {
                        is_first = count.fetch_add(1, Ordering::SeqCst) == 0;
                    }
                    far.write_all(&request[..read]).unwrap();
                    let swallows = is_first;
                    pump.get_or_insert_with(|| {
                        let (mut back, mut out) = (back.try_clone().unwrap(), out.try_clone().unwrap());
                        thread::spawn(move || {
                            let mut answer = [0; 8192];
                            while let Ok(read @ 1..) = back.read(&mut answer) {
                                if swallows || out.write_all(&answer[..read]).is_err() {
                                    break;
                                }
                            }
                            let _ = out.shutdown(Shutdown::Both);
                        })
                    });
                }
                let _ = (back.flush(), out.flush());
                let _ = far.shutdown(Shutdown::Both);
            });
        }
    });
    (url, commands)
}

#[test]
fn a_command_whose_answer_is_lost_is_asked_for_again_and_reaches_the_robot_once() {
    let robot = Robot::start(&[]);
    let hall = Hall::start("hall-once", &[&format!("press={}", robot.address())], "operator", &[]);
    let (url, commands) = lossy(&hall.url);
    let args =
        ["-g", &url, "--token-file", hall.token.path(), "command", "modifyCounter", "0", "5", "20", "--json"];
    let outcome = r6(&args);
    assert_eq!((outcome.code, &outcome.json()["accepted"]), (0, &Value::Bool(true)), "{outcome:?}");
    assert_eq!(commands.load(Ordering::SeqCst), 2, "the gateway was asked twice");
    let (status, audit) = get(&hall.url, &token(&hall.data, "engineer"), "/v1/audit?limit=1000");
    assert_eq!(status, 200);
    let entries = audit["entries"].as_array().unwrap();
    let intents = entries.iter().filter(|entry| entry["what"] == "command_intent").count();
    assert_eq!(intents, 1, "{audit:#}");
}

#[test]
fn tls_is_checked_against_the_file() {
    let robot = Robot::start(&[]);
    let robots = format!("press={}", robot.address());
    let hall = Hall::start("hall-5", &[&robots], "viewer", &["--tls"]);
    let other = Hall::start("hall-6", &[&robots], "viewer", &["--tls"]);
    let certificate = |hall: &Hall| format!("{}/tls/certificate.pem", hall.data);
    assert!(hall.url.starts_with("https://"));
    until(|| {
        let told = hall.r6(&["--ca-file", &certificate(&hall), "query", "curMode", "--json"]);
        (told.code == 0).then_some(())
    });
    let foreign = hall.r6(&["--ca-file", &certificate(&other), "query", "curMode", "--json"]);
    assert_eq!((foreign.code, code(&foreign)), (3, "unreachable".into()), "{foreign:?}");
    assert!(foreign.err.contains("TLS: "), "{}", foreign.err);
    assert_eq!(hall.r6(&["query", "curMode"]).code, 2, "the system's certificates are not asked");
    let no_file = hall.r6(&["--ca-file", hall.token.path(), "query", "curMode"]);
    assert!(no_file.err.contains("no certificate in PEM"), "{}", no_file.err);
}

#[test]
fn a_program_runs_over_a_gateway_to_its_end_and_an_interrupt_stops_the_arm() {
    let robot = Robot::start(&[]);
    let hall = Hall::start("hall-7", &[&format!("press={}", robot.address())], "operator", &[]);
    let turn = |name: &str, degrees: f64, speed: f64| {
        let step = format!(
            "[[instruction]]\ndo = \"axis-move\"\nto = [{degrees}, 0, 0, 0, 0, 0]\nspeed = {speed}\n"
        );
        TempFile::new(name, &step)
    };
    let file = turn("hall-7-quick.toml", 10.0, 80.0);
    let done = hall.r6(&["run", file.path(), "--json"]);
    assert_eq!(done.code, 0, "{done:?}");
    let last: Value = serde_json::from_str(done.last_line()).unwrap();
    assert_eq!((&last["event"], &last["run"]["state"]), (&"ended".into(), &"done".into()), "{last}");
    assert_eq!(robot.value("axis-0"), 10.0);

    let file = turn("hall-7-slow.toml", -100.0, 1.0);
    let token = ["-g", &hall.url, "--token-file", hall.token.path()];
    let mut running = Running::start(&[&token[..], &["run", file.path(), "--json"]].concat());
    assert_eq!(running.event().unwrap()["event"], "accepted");
    until(|| (robot.value("isMoving") == true).then_some(()));
    running.signal("INT");
    let last = std::iter::from_fn(|| running.event()).last().unwrap();
    assert_eq!(
        (&last["event"], &last["run"]["because"]),
        (&"ended".into(), &"lease_released".into()),
        "{last}"
    );
    assert_eq!(last["run"]["state"], "stopped");
    assert_eq!(running.code(), Some(1));
    assert_eq!(robot.value("isMoving"), false);
    let stands = robot.value("axis-0").as_f64().unwrap();
    assert!(stands > -99.0, "{stands}");

    let taught = TempFile::new("hall-7-wrong.toml", "[[instruction]]\ndo = \"axis-mov\"\n");
    let wrong = hall.r6(&["run", taught.path()]);
    assert_eq!(wrong.code, 2);
    assert!(wrong.err.contains("hall-7-wrong.toml:2:"), "{}", wrong.err);
    let append = hall.r6(&["run", file.path(), "--append"]);
    assert!(append.err.contains("--append does not go over a gateway"), "{}", append.err);
}
