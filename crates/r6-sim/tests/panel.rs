//! The panel over real sockets, as a script and as a hostile page would use it.

use std::path::Path;
use std::time::Duration;

use r6_sim::{SimError, SimSettings, Simulation};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

const ACTIONS: &str = "/v1/controllers/1/actions";

async fn start() -> Simulation {
    let settings =
        SimSettings { panel: Some("127.0.0.1:0".parse().unwrap()), count: 2, ..SimSettings::default() };
    Simulation::start(settings).await.unwrap()
}

/// Sends bytes and reads until the panel closes: status and body.
async fn raw(simulation: &Simulation, request: &str) -> (u16, Value) {
    let mut stream = TcpStream::connect(simulation.panel().unwrap()).await.unwrap();
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut reply = String::new();
    stream.read_to_string(&mut reply).await.unwrap();
    let status = reply.split(' ').nth(1).unwrap_or_else(|| panic!("{reply:?}")).parse().unwrap();
    let body = reply.split_once("\r\n\r\n").unwrap().1;
    (status, serde_json::from_str(body).unwrap_or_else(|_| json!(body)))
}

async fn request(
    simulation: &Simulation,
    method: &str,
    path: &str,
    headers: &str,
    body: &str,
) -> (u16, Value) {
    let length = body.len();
    let host = simulation.panel().unwrap();
    let head = format!("{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n");
    raw(simulation, &format!("{head}Content-Length: {length}\r\n{headers}\r\n{body}")).await
}

async fn get(simulation: &Simulation, path: &str) -> (u16, Value) {
    request(simulation, "GET", path, "", "").await
}

async fn act(simulation: &Simulation, action: &Value) -> (u16, Value) {
    request(simulation, "POST", ACTIONS, "Content-Type: application/json\r\n", &action.to_string()).await
}

#[tokio::test]
async fn controllers_are_numbered_and_shown() {
    let simulation = start().await;
    let (status, list) = get(&simulation, "/v1/controllers").await;
    assert_eq!(status, 200);
    let second = &list["controllers"][1];
    assert_eq!((second["number"].as_u64(), list["controllers"].as_array().unwrap().len()), (Some(2), 2));
    assert_eq!(second["address"], simulation.controllers()[1].address().to_string());

    let (status, state) = get(&simulation, "/v1/controllers/2").await;
    assert_eq!(status, 200);
    assert_eq!((&state["virtual"], &state["mode_name"]), (&json!(true), &json!("running (7)")));
    assert_eq!(state["address"], second["address"]);
    assert_eq!(
        state["axes"][5],
        json!({"name": "J6", "position": 0.0, "unit": "deg", "lowest": -340.0, "highest": 340.0})
    );
    assert_eq!(state["machine_name"], "r6 virtual BRTIRUS0707A");
    assert_eq!(state.get("alarm_text"), None);
}

#[tokio::test]
async fn the_state_tells_whether_it_takes_instructions_and_what_it_waits_for() {
    let simulation = start().await;
    let (_, state) = get(&simulation, "/v1/controllers/1").await;
    assert_eq!((&state["ready"], &state["not_ready"]), (&json!(true), &json!([])));
    let remote = json!({"program": "remote", "number": 1, "steps": 1, "text": "wait for remote commands"});
    assert_eq!(state["step"], remote);
    let (_, state) = act(&simulation, &json!({"do": "emergency_stop"})).await;
    assert_eq!(state["ready"], json!(false));
    let reason = state["not_ready"][0].as_str().unwrap();
    assert!(reason.contains("emergency stop"), "{reason}");
    for action in [
        json!({"do": "release_emergency_stop"}),
        json!({"do": "clear_alarm"}),
        json!({"do": "switch_program", "program": "register-move"}),
        json!({"do": "press", "button": "start"}),
    ] {
        assert_eq!(act(&simulation, &action).await.0, 200, "{action}");
    }
    let (_, state) = get(&simulation, "/v1/controllers/1").await;
    assert_eq!(state["ready"], json!(false), "a program that waits for registers takes no list: {state}");
    assert!(state["step"]["text"].as_str().unwrap().starts_with("wait until"), "{state}");
}

#[tokio::test]
async fn every_action_does_something() {
    let simulation = start().await;
    // An action, and what the machine shows right after it.
    let steps = [
        (json!({"do": "set_input", "point": "X1.011", "on": true}), "inputs_on", json!(["X1.011"])),
        (json!({"do": "set_input", "point": "eux010", "on": true}), "inputs_on", json!(["X1.011", "EUX010"])),
        (json!({"do": "set_input", "point": "X1.011", "on": false}), "inputs_on", json!(["EUX010"])),
        (json!({"do": "switch_program", "program": "register-move"}), "program", json!("register-move")),
        (json!({"do": "switch_program", "program": "remote"}), "program", json!("remote")),
        (json!({"do": "turn_key", "key": "auto"}), "mode", json!(2)),
        (json!({"do": "press", "button": "start"}), "mode", json!(7)),
        (json!({"do": "press", "button": "pause"}), "mode", json!(2)),
        (json!({"do": "press", "button": "single_cycle"}), "mode", json!(9)),
        (json!({"do": "press", "button": "single_step"}), "mode", json!(2)),
        (json!({"do": "turn_key", "key": "stop"}), "mode", json!(3)),
        (json!({"do": "turn_key", "key": "manual"}), "mode", json!(1)),
        (json!({"do": "raise_alarm", "alarm": 135}), "alarm_text", json!("J6: positive soft limit")),
        (json!({"do": "clear_alarm"}), "alarm", json!(0)),
        (json!({"do": "emergency_stop"}), "emergency_stop", json!(true)),
        (json!({"do": "release_emergency_stop"}), "emergency_stop", json!(false)),
        (json!({"do": "clear_alarm"}), "alarm", json!(0)),
        (json!({"do": "clear_points"}), "camera_points", json!([])),
        (json!({"do": "jog", "axis": "J1", "by": 150.0, "speed_percent": 1.0}), "moving", json!(true)),
    ];
    for (action, field, wanted) in steps {
        let (status, state) = act(&simulation, &action).await;
        assert_eq!((status, &state[field]), (200, &wanted), "{action}: {state}");
    }
    let (status, problem) = act(&simulation, &json!({"do": "home"})).await;
    assert_eq!((status, &problem["code"]), (409, &json!("moving")));
    assert_eq!(act(&simulation, &json!({"do": "press", "button": "stop"})).await.0, 200);
    // The other controller is not affected.
    let (_, other) = get(&simulation, "/v1/controllers/2").await;
    assert_eq!((&other["mode"], &other["inputs_on"]), (&json!(7), &json!([])));
}

#[tokio::test]
async fn what_is_refused_has_a_code_and_a_reason() {
    let simulation = start().await;
    for (action, status, code, part) in [
        (json!({"do": "jog", "axis": "J1", "by": 1.0}), 409, "not_manual", "turn the key to manual"),
        (json!({"do": "jog", "axis": "J7", "by": 1.0}), 422, "no_such_axis", "J1 to J6"),
        (json!({"do": "jog", "axis": "X", "by": 1.0}), 422, "bad_action", "J1 to J8"),
        (json!({"do": "jog", "axis": "J1", "by": 0.0}), 422, "no_distance", "degrees or mm"),
        (json!({"do": "jog", "axis": "J1", "by": 1.0, "speed_percent": 101}), 422, "bad_speed", "100"),
        (json!({"do": "switch_program", "program": "remot"}), 409, "program", "nearest: `remote`"),
        (json!({"do": "raise_alarm", "alarm": 0}), 422, "no_such_alarm", "1 to 10000"),
        (json!({"do": "raise_alarm", "alarm": -1}), 422, "bad_action", "-1"),
        (json!({"do": "set_input", "point": "Y010", "on": true}), 422, "bad_action", "no input"),
        (json!({"do": "set_input", "point": "X", "on": true}), 422, "bad_action", "X010"),
        (json!({"do": "set_input", "point": "X010", "on": 1}), 422, "bad_action", "boolean"),
        (json!({"do": "pres", "button": "start"}), 422, "bad_action", "nearest: `press`"),
        (json!({"do": "press", "button": "strat"}), 422, "bad_action", "nearest: `start`"),
        (json!({"do": "home", "now": true}), 422, "bad_action", "now"),
        (json!([]), 422, "bad_action", ""),
    ] {
        let (found, problem) = act(&simulation, &action).await;
        assert_eq!((found, &problem["code"]), (status, &json!(code)), "{action}: {problem}");
        let message = problem["message"].as_str().unwrap();
        assert!(message.contains(part) && !message.is_empty(), "{action}: {message}");
    }
    let json = "Content-Type: application/json; charset=utf-8\r\n";
    let long = format!("{{\"do\":\"switch_program\",\"program\":\"{}\"}}", "x".repeat(5_000));
    for (method, path, headers, body, status, code) in [
        ("POST", ACTIONS, json, "{\"do\":", 400, "bad_json"),
        ("POST", ACTIONS, json, "\u{0}", 400, "bad_json"),
        ("POST", ACTIONS, json, long.as_str(), 413, "too_long"),
        ("POST", ACTIONS, "", "{\"do\":\"home\"}", 415, "not_json"),
        ("POST", ACTIONS, "Content-Type: text/plain\r\n", "{\"do\":\"emergency_stop\"}", 415, "not_json"),
        ("POST", "/v1/controllers/3/actions", json, "{\"do\":\"home\"}", 404, "no_such_controller"),
        ("GET", "/v1/controllers/0", "", "", 404, "no_such_controller"),
        ("GET", "/v1/controllers/99999999999999999999", "", "", 404, "no_such_controller"),
        ("GET", "/v1/controller", "", "", 404, "no_such_path"),
        ("GET", "/", "", "", 404, "no_such_path"),
        ("GET", ACTIONS, "", "", 405, "no_such_method"),
        ("DELETE", "/v1/controllers/1", "", "", 405, "no_such_method"),
    ] {
        let (found, problem) = request(&simulation, method, path, headers, body).await;
        assert_eq!(
            (found, &problem["code"]),
            (status, &json!(code)),
            "{method} {path} {body:.40}: {problem}"
        );
    }
    assert!(!simulation.controllers()[0].snapshot().emergency_stop);
}

#[tokio::test]
async fn pages_of_a_browser_stop_nothing() {
    let simulation = start().await;
    let port = simulation.panel().unwrap().port();
    let body = r#"{"do":"emergency_stop"}"#;
    let length = body.len();
    let post = |host: &str, more: &str| {
        format!(
            "POST {ACTIONS} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\nContent-Type: application/json\r\n\
             Content-Length: {length}\r\n{more}\r\n{body}"
        )
    };
    for (request, code) in [
        (post("panel.evil.example", ""), "foreign_host"),
        (post(&format!("panel.evil.example:{port}"), ""), "foreign_host"),
        (post(&format!("127.0.0.1:{port}"), "Origin: http://evil.example\r\n"), "foreign_origin"),
        (post(&format!("localhost:{port}"), "Origin: null\r\n"), "foreign_origin"),
        (post(&format!("localhost:{port}"), "Sec-Fetch-Site: cross-site\r\n"), "foreign_origin"),
    ] {
        let (status, problem) = raw(&simulation, &request).await;
        assert_eq!((status, &problem["code"]), (403, &json!(code)), "{request}");
    }
    // A preflight for a foreign request gets no permission either.
    let preflight = format!(
        "OPTIONS {ACTIONS} HTTP/1.1\r\nHost: localhost:{port}\r\nConnection: close\r\nOrigin: http://evil.example\r\n\
         Access-Control-Request-Method: POST\r\n\r\n"
    );
    assert_eq!(raw(&simulation, &preflight).await.0, 403);
    assert!(!simulation.controllers()[0].snapshot().emergency_stop);
    let own = format!("Origin: http://localhost:{port}\r\n");
    assert_eq!(raw(&simulation, &post(&format!("localhost:{port}"), &own)).await.0, 200);
    assert!(simulation.controllers()[0].snapshot().emergency_stop);
}

#[tokio::test]
async fn other_machines_reach_it_only_where_somebody_said_so() {
    let everywhere = Some("0.0.0.0:0".parse().unwrap());
    let settings = SimSettings { panel: everywhere, ..SimSettings::default() };
    let error = Simulation::start(settings.clone()).await.unwrap_err();
    assert!(matches!(error, SimError::PanelNotLocal { .. }), "{error}");
    assert!(error.to_string().contains("--panel-open"), "{error}");
    let simulation = Simulation::start(SimSettings { panel_open: true, ..settings }).await.unwrap();
    let port = simulation.panel().unwrap().port();
    let mut stream = TcpStream::connect(("127.0.0.1", port)).await.unwrap();
    stream
        .write_all(b"GET /v1/controllers HTTP/1.1\r\nHost: 192.0.2.1\r\nConnection: close\r\n\r\n")
        .await
        .unwrap();
    let mut reply = String::new();
    stream.read_to_string(&mut reply).await.unwrap();
    assert!(reply.starts_with("HTTP/1.1 200 "), "{reply}");
}

#[tokio::test]
async fn a_panel_that_cannot_be_offered_starts_nothing() {
    let taken = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let settings = SimSettings { panel: Some(taken.local_addr().unwrap()), ..SimSettings::default() };
    let error = Simulation::start(settings).await.unwrap_err();
    assert!(matches!(error, SimError::ListenPanel { .. }), "{error}");
    assert!(error.to_string().contains("--panel"), "{error}");
    assert_eq!(Simulation::start(SimSettings::default()).await.unwrap().panel(), None);
}

const COUNT: &str =
    "[[step]]\ndo = \"counter\"\nnumber = 0\nby = 1\n\n[[step]]\ndo = \"wait\"\nseconds = 3600\n";

async fn put(simulation: &Simulation, name: &str, text: &str) -> (u16, Value) {
    let path = format!("/v1/controllers/1/programs/{name}");
    // As `curl -T` sends it: without a `Content-Type`.
    request(simulation, "PUT", &path, "", text).await
}

#[tokio::test]
async fn a_program_is_loaded_chosen_and_replaced() {
    let simulation = start().await;
    let (status, state) = put(&simulation, "cell", COUNT).await;
    assert_eq!(status, 200, "{state}");
    assert!(state["programs"].as_array().unwrap().contains(&json!("cell")));
    assert_eq!(state["program"], "remote", "it is there, and not yet in use");
    assert_eq!(put(&simulation, "%E7%94%A8%E6%88%B7%2F1", COUNT).await.0, 200);
    let (_, state) =
        act(&simulation, &json!({"do": "switch_program", "program": "\u{7528}\u{6237}/1"})).await;
    assert_eq!((&state["program"], &state["mode"]), (&json!("\u{7528}\u{6237}/1"), &json!(7)));
    act(&simulation, &json!({"do": "switch_program", "program": "cell"})).await;

    let long = "#".repeat(256 * 1024 + 1);
    for (name, text, status, code, part) in [
        ("cell", COUNT, 409, "program_running", "stop it first"),
        (
            "new",
            "[[step]]\ndo=\"remote\"\n[[step]]\ndo=\"wiat\"",
            422,
            "bad_program",
            "program `new`: 4:4: step 2",
        ),
        ("new", "[[step]]\ndo=\"call\"\nprogram=\"cel\"", 422, "bad_program", "nearest: `cell`"),
        (&"n".repeat(65), COUNT, 422, "bad_program", "1 to 64 bytes"),
        ("new", &long, 413, "too_long", "262144 bytes"),
    ] {
        let (found, problem) = put(&simulation, name, text).await;
        assert_eq!((found, &problem["code"]), (status, &json!(code)), "{name}: {problem}");
        assert!(problem["message"].as_str().unwrap().contains(part), "{problem}");
    }
    // The longest possible text fits, and the limit of other bodies stays the same.
    assert_eq!(put(&simulation, "new", &long[1..]).await.0, 200);
    let (status, _) = request(&simulation, "PUT", "/v1/controllers/9/programs/x", "", COUNT).await;
    assert_eq!(status, 404);
    let (_, other) = get(&simulation, "/v1/controllers/2").await;
    assert!(!other["programs"].as_array().unwrap().contains(&json!("cell")));
    act(&simulation, &json!({"do": "turn_key", "key": "stop"})).await;
    assert_eq!(put(&simulation, "cell", COUNT).await.0, 200);
    // A web page cannot do it.
    let own = "Origin: http://evil.example\r\n";
    let (status, _) = request(&simulation, "PUT", "/v1/controllers/1/programs/evil", own, COUNT).await;
    assert_eq!(status, 403);
}

#[tokio::test]
async fn a_program_that_was_acknowledged_survives_a_power_cut() {
    let folder = tempfile::TempDir::new().unwrap();
    let settings = SimSettings {
        panel: Some("127.0.0.1:0".parse().unwrap()),
        state: Some(folder.path().to_owned()),
        ..SimSettings::default()
    };
    let simulation = Simulation::start(settings.clone()).await.unwrap();
    assert_eq!(put(&simulation, "cell", COUNT).await.0, 200);
    // A power cut leaves exactly what is on the disk at this moment.
    let text = std::fs::read_to_string(folder.path().join("controller-1.json")).unwrap();
    assert!(r6_controller::SavedState::from_json(&text).is_ok());
    simulation.shutdown().await.unwrap();
    std::fs::write(folder.path().join("controller-1.json"), text).unwrap();
    let simulation = Simulation::start(settings).await.unwrap();
    let (_, state) = act(&simulation, &json!({"do": "switch_program", "program": "cell"})).await;
    assert_eq!(state["program"], "cell");
}

/// Time passes at once if no task has anything to do.
#[tokio::test(start_paused = true)]
async fn a_connection_that_says_nothing_is_not_kept() {
    let simulation = start().await;
    let host = simulation.panel().unwrap();
    let begun = tokio::time::Instant::now();
    let half = format!("POST {ACTIONS} HTTP/1.1\r\nHost: {host}\r\n");
    let body = format!("{half}Content-Type: application/json\r\nContent-Length: 100\r\n\r\n{{");
    for said in ["", half.as_str(), body.as_str()] {
        let mut stream = TcpStream::connect(host).await.unwrap();
        stream.write_all(said.as_bytes()).await.unwrap();
        let mut reply = Vec::new();
        let _ = stream.read_to_end(&mut reply).await;
    }
    assert!(begun.elapsed() < Duration::from_secs(60), "{:?}", begun.elapsed());
}

/// `UPDATE_OPENAPI=1 cargo test -p r6-sim --test panel` writes the file again.
#[test]
fn the_committed_description_is_up_to_date() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../openapi/panel.json");
    let described = r6_sim::panel::openapi();
    if std::env::var_os("UPDATE_OPENAPI").is_some() {
        std::fs::write(&path, &described).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == described,
        "openapi/panel.json is not what the panel is: UPDATE_OPENAPI=1 writes it anew"
    );
    let api: Value = serde_json::from_str(&described).unwrap();
    let codes = r6_api::Code::ALL.iter().copied().chain([r6_api::Code::Unknown]);
    let words: Vec<Value> = codes.map(|code| code.word().into()).collect();
    assert_eq!(api["components"]["schemas"]["Code"]["enum"], Value::Array(words));
    let members = |schema: &str, member: &str| {
        let members = &api["components"]["schemas"][schema][member];
        let of_object = members.as_object().map(|all| all.keys().cloned().collect::<Vec<_>>());
        let mut names = of_object.unwrap_or_else(|| serde_json::from_value(members.clone()).unwrap());
        names.sort();
        names
    };
    for schema in ["Pose", "AxisPosition", "Unmet", "CommandProblem"] {
        assert_eq!(
            members(schema, "required"),
            members(schema, "properties"),
            "{schema}: all are always sent"
        );
    }
    let but_problem: Vec<_> =
        members("Status", "properties").into_iter().filter(|name| name != "problem").collect();
    assert_eq!(members("Status", "required"), but_problem);
    let paths: Vec<_> = api["paths"].as_object().unwrap().keys().cloned().collect();
    assert_eq!(
        paths,
        [
            "/v1/controllers",
            "/v1/controllers/{n}",
            "/v1/controllers/{n}/actions",
            "/v1/controllers/{n}/faults",
            "/v1/controllers/{n}/programs/{name}",
            "/v1/controllers/{n}/status",
            "/v1/openapi.json"
        ]
    );
}

#[tokio::test]
async fn the_description_is_served() {
    let simulation = start().await;
    let (status, api) = get(&simulation, "/v1/openapi.json").await;
    assert_eq!((status, &api["info"]["title"]), (200, &json!("r6 panel")));
}
