//! The panel of a virtual robot: roles, leases, stops and the audit log hold for the person at the machine.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use r6_controller::{Program, StartState};
use r6_gateway::{Panel, RobotConfig};
use r6_sim::{SimSettings, Simulation};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::oneshot;

use crate::support::{Hall, PATIENCE, call_with, name, signal};

const PANEL: &str = "/v1/robots/press/panel";

/// A gateway with `press`, a virtual robot whose panel it knows.
struct Cell {
    hall: Hall,
    simulation: Simulation,
}

/// A virtual robot whose start button moves J1 back and forth for minutes.
fn long() -> SimSettings {
    let text = "[[step]]\ndo = \"axis-move\"\nto = [60, 0, 0, 0, 0, 0]\nspeed = 1\n\
                [[step]]\ndo = \"axis-move\"\nto = [-60, 0, 0, 0, 0, 0]\nspeed = 1\n";
    let mut settings =
        SimSettings { start: StartState::Auto, mold: "long".to_owned(), ..SimSettings::default() };
    settings.library.insert(Program::read("long", text).unwrap()).unwrap();
    settings
}

impl Cell {
    async fn start(settings: SimSettings) -> Self {
        Self::with_panel(settings, |panel| panel).await
    }

    /// The gateway reaches the panel at `seen`, which may be another address than that of the panel.
    async fn with_panel(settings: SimSettings, seen: impl FnOnce(SocketAddr) -> SocketAddr) -> Self {
        let panel = Some(SocketAddr::from(([127, 0, 0, 1], 0)));
        let simulation = Simulation::start(SimSettings { panel, ..settings }).await.unwrap();
        let press = RobotConfig {
            period: Duration::from_millis(20),
            panel: Panel::new(seen(simulation.panel().unwrap()), 1),
            ..RobotConfig::new(name("press"), simulation.controllers()[0].address().to_string())
        };
        let hall = Hall::at(tempfile::tempdir().unwrap(), vec![press], Vec::new()).await;
        hall.until_up("press").await;
        Self { hall, simulation }
    }

    /// Does something at the panel with this lease; `null` for none.
    async fn act(&self, token: &str, lease: &Value, action: Value) -> (u16, Value) {
        let mut body = json!({ "action": action });
        if !lease.is_null() {
            body["lease"] = lease.clone();
        }
        self.hall.post(token, PANEL, &body).await
    }

    /// The same, which has to be done.
    async fn done(&self, token: &str, lease: &Value, action: Value) -> Value {
        let (status, done) = self.act(token, lease, action).await;
        assert_eq!(status, 200, "{done}");
        done
    }

    /// The same, which has to be refused: the status and the code.
    async fn refused(&self, token: &str, lease: &Value, action: Value) -> (u16, String) {
        let (status, problem) = self.act(token, lease, action).await;
        (status, problem["code"].as_str().unwrap_or_else(|| panic!("{problem}")).to_owned())
    }

    /// A lease that outlasts the test.
    async fn lease(&self) -> Value {
        let asked = json!({ "duration_ms": 300_000 });
        let (status, lease) = self.hall.post(&self.hall.operator, "/v1/robots/press/lease", &asked).await;
        assert_eq!(status, 200, "{lease}");
        lease["lease"].clone()
    }

    async fn clear_stop(&self, lease: &Value) {
        let clear = json!({ "lease": lease });
        let path = "/v1/robots/press/clear-stopped";
        assert_eq!(self.hall.post(&self.hall.operator, path, &clear).await.0, 204);
    }

    fn is_moving(&self) -> bool {
        self.simulation.controllers()[0].snapshot().moving
    }
}

fn button(word: &str) -> Value {
    json!({ "do": "press", "button": word })
}

fn jog() -> Value {
    json!({ "do": "jog", "axis": "J1", "by": 10.0, "speed_percent": 100.0 })
}

fn refusal(status: u16, code: &str) -> (u16, String) {
    (status, code.to_owned())
}

#[tokio::test]
async fn a_move_by_hand_needs_the_lease_and_the_key_an_engineer_and_both_are_in_the_audit_log() {
    let cell = Cell::start(SimSettings::default()).await;
    let Hall { viewer, operator, engineer, .. } = &cell.hall;
    let none = Value::Null;
    let seen = cell.hall.get(viewer, PANEL).await;
    assert_eq!((&seen["virtual"], &seen["emergency_stop"]), (&json!(true), &json!(false)), "{seen}");
    assert_eq!(cell.hall.get(viewer, "/v1/robots/press").await["panel"], true);
    assert_eq!(cell.refused(viewer, &none, button("stop")).await, refusal(403, "not_allowed"));
    assert_eq!(cell.refused(operator, &none, jog()).await, refusal(409, "no_lease"));

    let lease = cell.lease().await;
    let wrong = json!({ "number": lease["number"], "secret": "0".repeat(32) });
    assert_eq!(cell.refused(operator, &wrong, jog()).await, refusal(409, "no_lease"));
    for action in [
        json!({ "do": "turn_key", "key": "manual" }),
        json!({ "do": "set_input", "point": "X010", "on": true }),
        json!({ "do": "raise_alarm", "alarm": 850 }),
        json!({ "do": "clear_points" }),
    ] {
        assert_eq!(
            cell.refused(operator, &lease, action.clone()).await,
            refusal(403, "not_allowed"),
            "{action}"
        );
        assert_eq!(cell.refused(engineer, &none, action.clone()).await, refusal(409, "no_lease"), "{action}");
    }
    assert_eq!(cell.refused(operator, &lease, jog()).await, refusal(409, "not_manual"), "as the panel says");

    cell.done(engineer, &lease, json!({ "do": "turn_key", "key": "manual" })).await;
    // The pendant leads: a command waits for it, and the panel is the pendant.
    cell.hall.until("press", |state| signal(state, "curMode")["value"] == 1).await;
    let (status, problem) = cell.hall.command(operator, "press", &lease, "modifyGSPD 5").await;
    assert_eq!((status, &problem["code"]), (409, &json!("not_ready")), "{problem}");
    let done = cell.done(operator, &lease, jog()).await;
    assert_eq!(done["panel"]["mode"], 1, "{done}");
    let at_ten = |state: &Value| signal(state, "axis-0")["value"].as_f64().is_some_and(|j1| j1 > 9.99);
    cell.hall.until("press", at_ten).await;

    let jogged = "panel jog J1 +10 --speed 100";
    let entries = cell.hall.audit().await;
    let of = |what: &str, key: &str, value: Value| {
        let found = entries.iter().find(|entry| entry["what"] == what && entry[key] == value);
        found.unwrap_or_else(|| panic!("{what} {value}: {entries:#?}")).clone()
    };
    let intent = of("command_intent", "number", done["command_id"].clone());
    let told = (&intent["command"], &intent["actor"], &intent["lease"]);
    assert_eq!(told, (&json!(jogged), &json!("token 2 (operator)"), &lease["number"]), "{intent}");
    assert_eq!(of("command_outcome", "intent", done["command_id"].clone())["outcome"], "accepted");
    // The action that the machine refused has both entries, too.
    let refused =
        entries.iter().find(|entry| entry["what"] == "command_intent" && entry["command"] == jogged);
    let refused = refused.unwrap()["number"].clone();
    assert_eq!(of("command_outcome", "intent", refused)["outcome"], "refused");
    of("refused", "request", json!("panel alarm 850"));
    of("refused", "request", json!(jogged));
}

#[tokio::test]
async fn a_stop_at_the_panel_needs_no_lease_and_holds_for_starts_and_moves_by_hand() {
    let cell = Cell::start(long()).await;
    let Hall { operator, engineer, .. } = &cell.hall;
    let none = Value::Null;
    let lease = cell.lease().await;
    for stop in [button("pause"), button("stop"), json!({ "do": "emergency_stop" })] {
        cell.done(operator, &lease, button("start")).await;
        cell.hall.until("press", |state| signal(state, "isMoving")["value"] == true).await;
        let stopped = cell.done(engineer, &none, stop.clone()).await;
        assert_eq!(stopped["command_id"], json!(null), "{stopped}");
        if stop == button("stop") {
            // The program would go on to the end of its cycle.
            cell.done(engineer, &none, stop.clone()).await;
        }
        cell.hall.until("press", |state| signal(state, "isMoving")["value"] == false).await;
        assert_eq!(cell.hall.get(operator, "/v1/robots/press").await["stopped"], true, "{stop}");
        for action in
            [button("start"), button("single_cycle"), button("single_step"), jog(), json!({ "do": "home" })]
        {
            assert_eq!(
                cell.refused(operator, &lease, action.clone()).await,
                refusal(409, "stopped"),
                "{action}"
            );
        }
        // A program may wait for it.
        let input = json!({ "do": "set_input", "point": "X010", "on": true });
        assert_eq!(cell.refused(&cell.hall.engineer, &lease, input).await, refusal(409, "stopped"));
        assert!(!cell.is_moving());
        cell.clear_stop(&lease).await;
    }
    // The machine itself refuses now. What moves nothing may be done while a stop holds.
    assert_eq!(cell.refused(operator, &lease, button("start")).await, refusal(409, "emergency_stop"));
    cell.done(operator, &none, json!({ "do": "emergency_stop" })).await;
    cell.done(operator, &lease, json!({ "do": "release_emergency_stop" })).await;
    let cleared = cell.done(operator, &lease, json!({ "do": "clear_alarm" })).await;
    assert_eq!((&cleared["panel"]["alarm"], &cleared["panel"]["moving"]), (&json!(0), &json!(false)));
    cell.clear_stop(&lease).await;
    cell.done(operator, &lease, button("start")).await;
    cell.hall.until("press", |state| signal(state, "isMoving")["value"] == true).await;

    let is_stop = |entry: &Value| entry["what"] == "stop" && entry["request"] == "panel estop";
    let stop = cell.hall.until_audited(is_stop).await;
    assert_eq!((&stop["confirmed"], &stop["actor"]), (&json!(true), &json!("token 3 (engineer)")));
    cell.hall.until_audited(|entry| entry["what"] == "stop_began" && entry["request"] == "panel estop").await;
}

#[tokio::test]
async fn a_run_is_not_disturbed_and_meets_the_emergency_stop() {
    let cell = Cell::start(SimSettings::default()).await;
    let operator = &cell.hall.operator;
    let lease = cell.lease().await;
    let text = "[[instruction]]\ndo = \"axis-move\"\nto = [60, 0, 0, 0, 0, 0]\nspeed = 1\n";
    let body = json!({ "program": text, "lease": lease });
    let (address, key) = (cell.hall.gateway.address(), "Idempotency-Key: one\r\n");
    let begun = call_with(address, operator, "POST", "/v1/robots/press/programs/run", key, Some(&body)).await;
    assert_eq!(begun.status, 202, "{}", begun.body);
    cell.hall.until("press", |state| signal(state, "isMoving")["value"] == true).await;
    for action in [button("start"), jog(), json!({ "do": "switch_program", "program": "remote" })] {
        assert_eq!(
            cell.refused(operator, &lease, action.clone()).await,
            refusal(409, "run_under_way"),
            "{action}"
        );
    }
    // An input is what a program may wait for.
    cell.done(&cell.hall.engineer, &lease, json!({ "do": "set_input", "point": "X010", "on": true })).await;

    cell.done(operator, &Value::Null, json!({ "do": "emergency_stop" })).await;
    let run = format!("/v1/robots/press/runs/{}", begun.body["run_id"]);
    let waits = Instant::now();
    let run = loop {
        let run = cell.hall.get(operator, &run).await;
        if run["state"] != "running" {
            break run;
        }
        assert!(waits.elapsed() < PATIENCE, "{run}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    };
    assert_eq!((&run["state"], &run["because"]), (&json!("stopped"), &json!("stop")), "{run}");
    assert!(!cell.is_moving());
    cell.done(operator, &lease, json!({ "do": "release_emergency_stop" })).await;
    cell.done(operator, &lease, json!({ "do": "clear_alarm" })).await;
}

#[tokio::test]
async fn a_real_robot_has_no_panel_and_is_not_stopped_by_one() {
    let hall = Hall::start().await;
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["panel"], false);
    let (status, problem) = hall.call(&hall.viewer, "GET", PANEL, None).await;
    assert_eq!((status, &problem["code"]), (404, &json!("no_panel")), "{problem}");
    let lease = hall.lease(&hall.operator, "press").await;
    let (status, problem) = hall.call(&hall.viewer, "GET", "/v1/robots/press/panel/faults", None).await;
    assert_eq!((status, &problem["code"]), (404, &json!("no_panel")), "{problem}");
    for action in [
        json!({ "do": "emergency_stop" }),
        button("start"),
        jog(),
        held(true),
        json!({ "do": "keep_jog" }),
        json!({ "do": "end_jog" }),
        json!({ "do": "begin_fault", "fault": "silence" }),
        json!({ "do": "end_faults" }),
        json!({ "do": "cut_power" }),
    ] {
        for body in [json!({ "action": action }), json!({ "action": action, "lease": lease })] {
            let (status, problem) = hall.post(&hall.engineer, PANEL, &body).await;
            assert_eq!((status, &problem["code"]), (404, &json!("no_panel")), "{problem}");
        }
    }
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["stopped"], false, "nothing was stopped");
}

#[tokio::test]
async fn a_panel_that_cannot_be_reached_got_nothing_and_a_stop_holds_all_the_same() {
    // Nothing listens on port 1.
    let cell = Cell::with_panel(long(), |_| SocketAddr::from(([127, 0, 0, 1], 1))).await;
    let operator = &cell.hall.operator;
    let (status, problem) = cell.hall.call(operator, "GET", PANEL, None).await;
    assert_eq!((status, &problem["code"]), (504, &json!("no_reply")), "{problem}");
    let lease = cell.lease().await;
    assert_eq!(cell.refused(operator, &lease, button("start")).await, refusal(409, "not_ready"));
    cell.hall.until_audited(|entry| entry["outcome"] == "not_sent").await;
    let estop = json!({ "do": "emergency_stop" });
    assert_eq!(cell.refused(operator, &Value::Null, estop).await, refusal(409, "not_ready"));
    assert_eq!(cell.hall.get(operator, "/v1/robots/press").await["stopped"], true);
    let stop = cell.hall.until_audited(|entry| entry["what"] == "stop").await;
    assert_eq!(stop["confirmed"], false, "{stop}");
}

/// Reads a request of the gateway to a panel.
async fn request(stream: &mut TcpStream) -> Vec<u8> {
    let mut read = Vec::new();
    // The bodies of these tests end with their action.
    while !read.ends_with(b"}") {
        let mut bytes = [0; 4096];
        let count = stream.read(&mut bytes).await.unwrap();
        assert!(count > 0, "the request is whole");
        read.extend_from_slice(&bytes[..count]);
    }
    read
}

#[tokio::test]
async fn an_action_without_an_answer_may_have_been_done() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let silent = listener.local_addr().unwrap();
    let cell = Cell::with_panel(long(), |_| silent).await;
    let lease = cell.lease().await;
    let taken = tokio::spawn(async move { request(&mut listener.accept().await.unwrap().0).await });
    let told = cell.refused(&cell.hall.operator, &lease, button("start")).await;
    assert_eq!(told, refusal(504, "outcome_unknown"));
    let taken = String::from_utf8(taken.await.unwrap()).unwrap();
    assert!(taken.starts_with("POST /v1/controllers/1/actions HTTP/1.1\r\n"), "{taken}");
    assert!(!taken.contains("r6_"), "no token of the gateway's goes on: {taken}");
    cell.hall.until_audited(|entry| entry["outcome"] == "unknown").await;
}

#[tokio::test]
async fn a_stop_that_overtakes_a_start_on_its_way_to_the_panel_is_sent_again_behind_it() {
    overtake(false).await;
}

#[tokio::test]
async fn a_stop_that_overtook_a_start_and_was_cleared_before_it_arrived_is_sent_again_too() {
    overtake(true).await;
}

/// A start waits on its way to the panel while the robot is stopped and, perhaps, the stop is cleared.
async fn overtake(is_cleared: bool) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let slow = listener.local_addr().unwrap();
    let mut panel = slow;
    let cell = Cell::with_panel(long(), |own| std::mem::replace(&mut panel, own)).await;
    assert_ne!(panel, slow);
    let (arrived, has_arrived) = oneshot::channel();
    let (go, may_go) = oneshot::channel::<()>();
    let way = tokio::spawn(async move {
        let mut near = listener.accept().await.unwrap().0;
        let request = request(&mut near).await;
        arrived.send(()).unwrap();
        may_go.await.unwrap();
        let mut far = TcpStream::connect(panel).await.unwrap();
        far.write_all(&request).await.unwrap();
        let _ = tokio::io::copy(&mut far, &mut near).await;
    });
    let lease = cell.lease().await;
    let start = cell.act(&cell.hall.operator, &lease, button("start"));
    let stop = async {
        has_arrived.await.unwrap();
        let stopped = cell.hall.stop(&cell.hall.engineer, "press").await;
        assert_eq!(stopped.0, 200, "{stopped:?}");
        if is_cleared {
            cell.clear_stop(&lease).await;
        }
        go.send(()).unwrap();
    };
    let ((status, started), ()) = tokio::join!(start, stop);
    assert_eq!(status, 200, "the panel took it: {started}");
    // By the time the caller is told, the arm stands again.
    let state = cell.hall.get(&cell.hall.operator, "/v1/robots/press").await;
    assert_eq!(state["stopped"], true);
    assert!(!cell.is_moving());
    let is_second = |entry: &Value| entry["what"] == "stop" && entry["actor"] == "gateway";
    assert_eq!(cell.hall.until_audited(is_second).await["confirmed"], true);
    way.abort();
}

fn held(up: bool) -> Value {
    json!({ "do": "hold_jog", "axis": "J1", "up": up, "speed_percent": 5.0 })
}

impl Cell {
    fn j1(&self) -> f64 {
        self.simulation.controllers()[0].snapshot().axes[0]
    }

    /// Waits until the arm stands, and returns how long that took.
    async fn until_at_rest(&self) -> Duration {
        let begun = Instant::now();
        while self.is_moving() {
            assert!(begun.elapsed() < PATIENCE);
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
        begun.elapsed()
    }

    /// Holds a button for this long. `false` if the machine did not hear of it in time, and ended the move.
    async fn holds_on(&self, lease: &Value, lasts: Duration) -> bool {
        let operator = &self.hall.operator;
        let begun = self.done(operator, lease, held(true)).await;
        assert!(begun["command_id"].is_u64(), "{begun}");
        let until = Instant::now() + lasts;
        while Instant::now() < until {
            let (status, kept) = self.act(operator, lease, json!({ "do": "keep_jog" })).await;
            if status != 200 {
                assert_eq!((status, &kept["code"]), (409, &json!("not_held")), "{kept}");
                return false;
            }
            assert_eq!((&kept["command_id"], &kept["panel"]["moving"]), (&json!(null), &json!(true)));
            // As often as a page says it: a token has 200 requests at once, and 100 a second.
            tokio::time::sleep(Duration::from_millis(40)).await;
        }
        true
    }

    /// In manual, with a lease.
    async fn by_hand(&self) -> Value {
        let lease = self.lease().await;
        self.done(&self.hall.engineer, &lease, json!({ "do": "turn_key", "key": "manual" })).await;
        lease
    }
}

#[tokio::test]
async fn an_axis_moves_while_its_button_is_held_and_stops_when_nothing_is_said_of_it() {
    let cell = Cell::start(SimSettings::default()).await;
    let operator = &cell.hall.operator;
    let lease = cell.by_hand().await;
    let (keep, end) = (json!({ "do": "keep_jog" }), json!({ "do": "end_jog" }));
    assert_eq!(cell.refused(operator, &lease, keep.clone()).await, refusal(409, "not_held"));
    assert_eq!(cell.refused(operator, &Value::Null, held(true)).await, refusal(409, "no_lease"));
    let begun = Instant::now();
    // On a machine that is busy with other tests, one word may be late: then it begins anew.
    while !cell.holds_on(&lease, Duration::from_millis(600)).await {
        assert!(begun.elapsed() < PATIENCE);
        cell.until_at_rest().await;
    }
    // A page that stalls says nothing any more.
    cell.until_at_rest().await;
    let rests = cell.j1();
    assert!(rests > 0.5, "{rests}");
    assert_eq!(cell.refused(operator, &lease, keep.clone()).await, refusal(409, "not_held"));

    cell.done(operator, &lease, held(false)).await;
    cell.done(operator, &lease, end.clone()).await;
    cell.until_at_rest().await;
    assert!(cell.j1() < rests);

    // The log has each begin, and nothing of what is said while a button is held.
    let entries = cell.hall.audit().await;
    let begins: Vec<_> = entries.iter().filter(|entry| entry["what"] == "command_intent").collect();
    let told: Vec<_> = begins.iter().map(|entry| entry["command"].as_str().unwrap()).collect();
    let (first, last) =
        (["panel key manual", "panel jog J1+ held --speed 5"], "panel jog J1- held --speed 5");
    assert!(told.starts_with(&first) && told.last() == Some(&last), "{told:?}");
    assert!(told[1..told.len() - 1].iter().all(|one| *one == first[1]), "{told:?}");
    let said =
        |entry: &Value| entry["request"].as_str().is_some_and(|request| request.contains("still held"));
    assert!(!entries.iter().any(said), "{entries:#?}");
}

#[tokio::test]
async fn a_stop_ends_a_held_move_and_nothing_keeps_it_any_more() {
    let cell = Cell::start(SimSettings::default()).await;
    let operator = &cell.hall.operator;
    let lease = cell.by_hand().await;
    cell.done(operator, &lease, held(true)).await;
    let stopped = cell.hall.stop(&cell.hall.engineer, "press").await;
    assert_eq!(stopped.0, 200, "{stopped:?}");
    assert!(!cell.is_moving());
    for action in [json!({ "do": "keep_jog" }), held(true)] {
        assert_eq!(cell.refused(operator, &lease, action).await, refusal(409, "stopped"));
    }
    cell.clear_stop(&lease).await;
    assert_eq!(cell.refused(operator, &lease, json!({ "do": "keep_jog" })).await, refusal(409, "not_held"));
    // Who gives the lease back holds no button any more.
    cell.done(operator, &lease, held(true)).await;
    let key = json!({ "lease": lease });
    assert_eq!(cell.hall.call(operator, "DELETE", "/v1/robots/press/lease", Some(&key)).await.0, 204);
    assert_eq!(cell.refused(operator, &lease, json!({ "do": "keep_jog" })).await, refusal(409, "no_lease"));
    cell.until_at_rest().await;
}

#[tokio::test]
async fn a_fault_cuts_the_robot_off_and_its_end_needs_no_lease() {
    let cell = Cell::start(SimSettings::default()).await;
    let Hall { viewer, operator, engineer, .. } = &cell.hall;
    let known = cell.hall.get(viewer, "/v1/robots/press/panel/faults").await;
    let known = known["faults"].as_array().unwrap();
    let word = |word: &str| known.iter().find(|fault| fault["fault"] == word).unwrap();
    assert_eq!((&word("silence")["class"], &word("silence")["kinds"]), (&json!("T3"), &json!([])));
    assert!(word("bad-json")["kinds"].as_array().unwrap().contains(&json!("nul")));
    assert_eq!(word("slow")["numbers"], json!(["bytes_per_second"]));

    let lease = cell.lease().await;
    let begin = |fault: &str| json!({ "do": "begin_fault", "fault": fault });
    let none = Value::Null;
    assert_eq!(cell.refused(operator, &lease, begin("task-dead")).await, refusal(403, "not_allowed"));
    assert_eq!(cell.refused(engineer, &none, begin("task-dead")).await, refusal(409, "no_lease"));
    assert_eq!(cell.refused(engineer, &lease, begin("task-deaf")).await, refusal(422, "bad_fault"));
    let cut = json!({ "do": "cut_power", "seconds": 3601 });
    assert_eq!(cell.refused(engineer, &lease, cut).await, refusal(422, "bad_fault"));
    let done = cell.done(engineer, &lease, begin("task-dead")).await;
    let fault = &done["panel"]["faults"][0];
    assert_eq!((&fault["fault"], &fault["chance"]), (&json!("task-dead"), &json!(1.0)), "{done}");
    cell.hall.until("press", |state| signal(state, "curMode")["quality"] == "stale").await;
    // A second one begins all the same.
    let late = json!({ "do": "begin_fault", "fault": "latency", "chance": 0.5, "seconds": 3600,
                       "numbers": { "to_client": 0.25 } });
    let done = cell.done(engineer, &lease, late).await;
    assert_eq!(done["panel"]["faults"].as_array().unwrap().len(), 2, "{done}");
    assert!(done["panel"]["faults"][1]["seconds_left"].as_f64().unwrap() > 3500.0);

    assert_eq!(
        cell.refused(operator, &none, json!({ "do": "end_faults" })).await,
        refusal(403, "not_allowed")
    );
    let first = json!({ "do": "end_fault", "number": fault["number"] });
    let done = cell.done(engineer, &none, first.clone()).await;
    assert_eq!(done["panel"]["faults"][0]["fault"], "latency", "{done}");
    cell.done(engineer, &none, first).await;
    let done = cell.done(engineer, &none, json!({ "do": "end_faults" })).await;
    assert_eq!(done["panel"]["faults"], json!([]));
    cell.hall.until("press", |state| signal(state, "curMode")["quality"] == "fresh").await;

    let entries = cell.hall.audit().await;
    let of = |command: &str| {
        entries.iter().find(|entry| entry["what"] == "command_intent" && entry["command"] == command).unwrap()
    };
    assert_eq!(of("panel fault task-dead")["lease"], lease["number"]);
    of("panel fault latency --set to_client=0.25 --chance 0.5 --seconds 3600");
    assert_eq!(of("panel end-faults")["lease"], 0);
}
