//! What `r6 -g URL` says of a stop and of a command to which the gateway gives no good answer. A server of
//! the test answers in place of a gateway.

use std::io::{BufRead, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;

use serde_json::{Value, json};

use crate::support::{Outcome, Running, TempFile, r6};

/// What the server does with a request.
pub(crate) enum Answer {
    /// It answers with a status and a body.
    With(u16, Value),
    /// It reads the request and closes the connection.
    Nothing,
    /// It reads the request and keeps the connection, as a process that is frozen.
    Frozen,
}

/// A server in place of a gateway.
pub(crate) struct Fake {
    url: String,
    token: TempFile,
    /// Method and path of each request.
    asked: Arc<Mutex<Vec<String>>>,
}

impl Fake {
    /// `name` is unique among the tests. `answer`: by method and path.
    pub(crate) fn start(name: &str, answer: impl Fn(&str) -> Answer + Send + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let asked = Arc::new(Mutex::new(Vec::new()));
        let told = Arc::clone(&asked);
        thread::spawn(move || {
            let mut frozen = Vec::new();
            for stream in listener.incoming() {
                let mut stream = stream.unwrap();
                let what = read_request(&mut stream);
                let answer = answer(&what);
                told.lock().unwrap().push(what);
                match answer {
                    Answer::With(status, body) => {
                        let body = body.to_string();
                        let head = format!("HTTP/1.1 {status} X\r\nContent-Length: {}\r\n\r\n", body.len());
                        let _ = stream.write_all((head + &body).as_bytes());
                    }
                    Answer::Nothing => {}
                    Answer::Frozen => frozen.push(stream),
                }
            }
        });
        Self { url, token: TempFile::new(&format!("told-{name}"), "00ff"), asked }
    }

    pub(crate) fn args<'a>(&'a self, args: &[&'a str]) -> Vec<&'a str> {
        [&["-g", &self.url, "--token-file", self.token.path()], args].concat()
    }

    /// About the robot `press-1`.
    pub(crate) fn r6(&self, args: &[&str]) -> Outcome {
        r6(&self.args(&[&["-r", "press-1"], args].concat()))
    }

    pub(crate) fn asked(&self) -> Vec<String> {
        self.asked.lock().unwrap().clone()
    }
}

/// Reads a request with its body. Returns its method and path.
fn read_request(stream: &mut TcpStream) -> String {
    let mut request = Vec::new();
    let mut piece = [0; 4096];
    loop {
        let text = String::from_utf8_lossy(&request).into_owned();
        if let Some((head, body)) = text.split_once("\r\n\r\n") {
            let head = head.to_lowercase();
            let length = head.lines().find_map(|line| line.strip_prefix("content-length: ")?.parse().ok());
            if body.len() >= length.unwrap_or(0) {
                return text.split(" HTTP").next().unwrap().to_owned();
            }
        }
        let read = stream.read(&mut piece).unwrap();
        assert!(read > 0, "{text}");
        request.extend_from_slice(&piece[..read]);
    }
}

pub(crate) fn problem(status: u16, code: &str) -> Answer {
    Answer::With(status, json!({ "code": code, "message": "the text of the gateway" }))
}

/// The server has a lease for everybody.
pub(crate) fn lease() -> Answer {
    let lease = json!({ "number": 1, "secret": "00".repeat(16) });
    Answer::With(200, json!({ "lease": lease, "expires_in_ms": 10_000, "stopped": true }))
}

#[test]
fn a_stop_says_what_is_proved_and_no_more() {
    for (name, status, code, exit, told) in [
        // What the gateway answers after it has stopped the arm.
        ("after", 503, "store_unavailable", 4, "the stop was carried out and press-1 was seen to stand"),
        ("unproved", 504, "not_stopped", 4, "the text of the gateway"),
        ("unknown", 504, "outcome_unknown", 4, "it is not known whether the robot was stopped; the text"),
        ("failed", 500, "unknown", 4, "it is not known whether the robot was stopped; the text"),
        // What it answers before.
        ("unowned", 503, "no_owner", 3, "the stop was not sent; the text"),
        ("full", 503, "overloaded", 1, "the stop was not sent; the text"),
        ("viewer", 403, "not_allowed", 1, "the stop was not sent; the text"),
        ("unnamed", 404, "no_such_robot", 2, "the stop was not sent; the text"),
    ] {
        let fake = Fake::start(name, move |_| problem(status, code));
        let stopped = fake.r6(&["stop"]);
        assert_eq!(stopped.code, exit, "{name}: {stopped:?}");
        assert!(stopped.err.starts_with(&format!("r6: {told}")), "{name}: {}", stopped.err);
        assert!(exit == 2 || stopped.err.contains("use the emergency stop"), "{name}: {}", stopped.err);
        assert_eq!(fake.asked(), ["POST /v1/robots/press-1/stop"]);
    }
    let fake = Fake::start("json", |_| problem(503, "store_unavailable"));
    assert_eq!(fake.r6(&["stop", "--json"]).json()["code"], "store_unavailable");
    let as_command = fake.r6(&["command", "actionStop"]);
    assert_eq!(as_command.code, 4, "{as_command:?}");
    assert!(as_command.err.contains("actionStop was accepted by press-1"), "{}", as_command.err);
}

/// The same token cannot stop the robot later, nor at another gateway.
#[test]
fn a_stop_that_the_token_does_not_allow_names_a_token_that_does() {
    let fake = Fake::start("role", |_| problem(403, "not_allowed"));
    let refused = fake.r6(&["stop", "--json"]);
    let told = refused.json();
    assert_eq!((refused.code, &told["code"]), (1, &"not_stopped".into()), "{refused:?}");
    let advice = told["advice"].as_str().unwrap();
    let wanted = "use the emergency stop if the arm moves; a token with at least the role operator for press-1 can stop it, \
                  and `r6 --robot press-1 --gateway-url http";
    assert!(
        advice.starts_with(wanted) && advice.ends_with(" whoami` says what this token may do"),
        "{advice}"
    );
    assert!(!advice.contains("stops again") && !advice.contains("another one"), "{advice}");
}

#[test]
fn a_clearing_that_is_not_confirmed_is_no_refusal() {
    let fake = Fake::start("clear", |what| match what.split('/').next_back() {
        Some("lease") => lease(),
        _ => problem(503, "store_unavailable"),
    });
    let cleared = fake.r6(&["stop", "--clear"]);
    assert_eq!(cleared.code, 4, "{cleared:?}");
    assert!(cleared.err.contains("the stop of press-1 was cleared, but"), "{}", cleared.err);
}

#[test]
fn a_stop_without_an_answer_is_not_told_to_be_under_way() {
    let fake = Fake::start("frozen", |_| Answer::Frozen);
    let mut stop = Running::start_with_pipes(&fake.args(&["-r", "press-1", "stop"]));
    let mut said = stop.close_stdin();
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    let wanted = format!(
        "r6: no answer of {} yet: use the emergency stop if the arm moves; if gateways share its store, another of them may answer …\n",
        fake.url
    );
    assert_eq!(line, wanted);
    for wanted in ["the gateway has not answered", "interrupted twice before the gateway answered"] {
        stop.signal("INT");
        line.clear();
        said.read_line(&mut line).unwrap();
        assert!(line.contains(wanted), "{line}");
    }
    assert_eq!(stop.code(), Some(4));
}

#[test]
fn a_stop_that_reaches_no_gateway_names_the_emergency_stop_and_other_gateways() {
    let fake = Fake::start("gone", |_| Answer::Nothing);
    let gone = r6(&["-g", "http://127.0.0.1:1", "--token-file", fake.token.path(), "-r", "press-1", "stop"]);
    assert_eq!(gone.code, 3, "{gone:?}");
    for wanted in ["the stop was not sent; no gateway at", "emergency stop", "another one can stop the robot"]
    {
        assert!(gone.err.contains(wanted), "{}", gone.err);
    }
    // Without a name, the gateway is asked for its robots first.
    let nameless = r6(&fake.args(&["stop"]));
    assert!(nameless.err.starts_with("r6: the stop was not sent; "), "{}", nameless.err);
    // From here on it left.
    let silent = fake.r6(&["stop"]);
    assert_eq!(silent.code, 4, "{silent:?}");
    assert!(!silent.err.contains("not sent") && silent.err.contains("emergency stop"), "{}", silent.err);
}

#[test]
fn a_command_that_failed_at_its_lease_did_not_act() {
    let lost: [fn() -> Answer; 2] = [|| Answer::Nothing, || problem(504, "outcome_unknown")];
    for (number, answer) in lost.into_iter().enumerate() {
        let fake = Fake::start(&format!("lease-{number}"), move |_| answer());
        let failed = fake.r6(&["command", "modifyGSPD", "5"]);
        assert_eq!(failed.code, 3, "{failed:?}");
        assert!(failed.err.starts_with("r6: nothing was sent to the robot; "), "{}", failed.err);
        assert!(!failed.err.contains("may have acted"), "{}", failed.err);
        assert_eq!(fake.asked(), ["POST /v1/robots/press-1/lease"]);
    }
}

/// A robot in a list.
fn listed(name: &str, link: &str, stopped: bool) -> Value {
    json!({
        "name": name, "address": "192.168.1.10:9760", "managed_by": "file", "link": link, "identity": null,
        "identity_changed": null, "virtual": null, "lease": null, "stopped": stopped, "stops_under_way": 0,
        "stop_number": 1,
    })
}

#[test]
fn a_robot_without_an_owner_hides_no_other_robot() {
    let robots = [listed("press-1", "up", false), listed("press-2", "down", true)];
    let fake = Fake::start("hall", move |what| match what {
        "GET /v1/robots" => Answer::With(200, json!({ "robots": robots })),
        "GET /v1/robots/press-1" => {
            let mut state = robots[0].clone();
            state["period_ms"] = 100.into();
            state["epoch"] = 1.into();
            state["number"] = 1.into();
            state["signals"] = json!([{
                "address": "curMode", "value": 7, "unit": null, "quality": "fresh", "age_ms": 5,
            }]);
            Answer::With(200, state)
        }
        _ => problem(503, "no_owner"),
    });
    let status = r6(&fake.args(&["status"]));
    assert_eq!(status.code, 3, "{status:?}");
    let lines: Vec<_> = status.out.lines().collect();
    assert!(lines[1].starts_with("press-1") && lines[1].contains(" running (7) "), "{}", status.out);
    assert!(lines[2].starts_with("press-2"), "{}", status.out);
    assert!(lines[2].ends_with("STOPPED; NO GATEWAY answers for it at the moment"), "{}", status.out);
    let status = r6(&fake.args(&["status", "--json"]));
    let robots = status.json()["robots"].clone();
    assert_eq!(
        (status.code, &robots[0]["problem"], &robots[1]["problem"]["code"]),
        (3, &Value::Null, &"no_owner".into())
    );

    let one = r6(&fake.args(&["-r", "press-2", "query", "axis-0", "--json"]));
    assert_eq!((one.code, &one.json()["code"]), (3, &"no_owner".into()), "{one:?}");
}
