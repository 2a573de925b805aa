//! Runs of programs: the arm does what the program says, once, and stands when it must not go on.

mod list;

use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use r6_controller::RobotModel;
use r6_gateway::RobotConfig;
use r6_sim::{SimSettings, Simulation, VirtualController};
use serde_json::{Value, json};

use crate::support::{Hall, PATIENCE, Reply, Stream, call_with, commands, name, signal, way};

const RUN: &str = "/v1/robots/press/programs/run";
const LEASE: &str = "/v1/robots/press/lease";

/// One axis move of J1 for each angle, in degrees.
fn moves(speed: u32, angles: &[f64]) -> String {
    let step = |angle: &f64| {
        format!(
            "[[instruction]]\ndo = \"axis-move\"\nto = [{angle:?}, 0.0, 0.0, 0.0, 0.0, 0.0]\nspeed = {speed}\n"
        )
    };
    angles.iter().map(step).collect()
}

/// A program that takes minutes.
fn long() -> String {
    moves(1, &[60.0, -60.0, 60.0, -60.0, 60.0, -60.0, 60.0, -60.0])
}

impl Hall {
    async fn run(&self, token: &str, key: &str, body: &Value) -> Reply {
        let line = if key.is_empty() { String::new() } else { format!("Idempotency-Key: {key}\r\n") };
        call_with(self.gateway.address(), token, "POST", RUN, &line, Some(body)).await
    }

    /// Begins a run with this lease: its number.
    async fn begin(&self, lease: &Value, text: &str) -> u64 {
        let key = format!("of lease {} {}", lease["number"], text.len()).replace(' ', "-");
        let reply = self.run(&self.operator, &key, &json!({ "program": text, "lease": lease })).await;
        assert_eq!(reply.status, 202, "{}", reply.body);
        assert_eq!((&reply.body["state"], &reply.body["because"]), (&json!("running"), &json!(null)));
        reply.body["run_id"].as_u64().unwrap()
    }

    async fn run_of(&self, number: u64) -> Value {
        self.get(&self.viewer, &format!("/v1/robots/press/runs/{number}")).await
    }

    /// Waits until a run is over.
    async fn until_over(&self, number: u64) -> Value {
        let begun = Instant::now();
        loop {
            let run = self.run_of(number).await;
            if run["state"] != "running" {
                return run;
            }
            assert!(begun.elapsed() < PATIENCE, "{run:#}");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    async fn until_moving(&self) {
        self.until("press", |state| signal(state, "isMoving")["value"] == true).await;
    }

    /// Whether the arm stands, and the list is empty, as the robot says.
    async fn stands(&self) -> bool {
        let path = "/v1/robots/press/query?address=isMoving,RemoteCmdLen";
        let asked = self.get(&self.viewer, path).await;
        (signal(&asked, "isMoving")["value"] == false) && (signal(&asked, "RemoteCmdLen")["value"] == 0)
    }

    /// Starts the program of the controller again, which a stop ends: it takes lists only while that runs.
    async fn start_again(&self, lease: &Value) {
        let (status, done) = self.command(&self.operator, "press", lease, "startButton").await;
        assert_eq!(status, 200, "{done}");
        self.until("press", |state| signal(state, "curMode")["value"] == 7).await;
    }

    /// A lease of this many seconds.
    async fn long_lease(&self, seconds: u64) -> Value {
        let (status, lease) =
            self.post(&self.operator, LEASE, &json!({ "duration_ms": seconds * 1000 })).await;
        assert_eq!(status, 200, "{lease}");
        lease["lease"].clone()
    }
}

#[tokio::test]
async fn the_arm_ends_where_the_program_says_and_a_request_that_comes_twice_runs_once() {
    let hall = Hall::start().await;
    let lease = hall.long_lease(60).await;
    let text = moves(100, &[4.0, 8.0, 4.0, 8.0, 4.0, 8.0, 4.0, 8.0, 4.0, 8.0, 4.0, 12.5]);
    let body = json!({ "program": text, "lease": lease });
    let first = hall.run(&hall.operator, "one", &body).await;
    assert_eq!(first.status, 202, "{}", first.body);
    let number = first.body["run_id"].as_u64().unwrap();
    assert_eq!((&first.body["steps"], &first.body["robot"]), (&json!(12), &json!("press")));
    let done = hall.until_over(number).await;
    assert_eq!((&done["state"], &done["proof"]), (&json!("done"), &json!("reached")), "{done:#}");
    assert_eq!((&done["done"], &done["because"]), (&json!(12), &json!("finished")));
    assert!(hall.stands().await);
    let state = hall.until("press", |state| signal(state, "axis-0")["value"] == 12.5).await;
    assert_eq!(state["stopped"], false);

    // The same request again gets the same answer, and the arm stays where it is.
    let again = hall.run(&hall.operator, "one", &body).await;
    assert_eq!((again.status, &again.body), (202, &first.body));
    let reordered = format!("{{\"lease\":{lease},\"repeat\":null,\"program\":{}}}", body["program"]);
    let reordered: Value = serde_json::from_str(&reordered).unwrap();
    assert_eq!(hall.run(&hall.operator, "one", &reordered).await.body, first.body);
    // With another lease it is the same request: the first one may have ended meanwhile.
    let key = json!({ "lease": lease });
    assert_eq!(hall.call(&hall.operator, "DELETE", LEASE, Some(&key)).await.0, 204);
    let lease = hall.long_lease(60).await;
    let renewed = json!({ "program": text, "lease": lease });
    assert_eq!(hall.run(&hall.operator, "one", &renewed).await.body, first.body);
    // With another program it is refused. Another caller has keys of its own.
    let other = json!({ "program": moves(100, &[3.0]), "lease": lease });
    let reply = hall.run(&hall.operator, "one", &other).await;
    assert_eq!((reply.status, &reply.body["code"]), (422, &json!("key_taken")));
    let reply = hall.run(&hall.admin, "one", &other).await;
    assert_eq!(reply.status, 202, "{}", reply.body);
    hall.until_over(reply.body["run_id"].as_u64().unwrap()).await;

    let audit = hall.audit().await;
    let of = |what: &str| -> Vec<&Value> { audit.iter().filter(|entry| entry["what"] == what).collect() };
    let (intents, outcomes) = (of("run_intent"), of("run_outcome"));
    assert_eq!((intents.len(), outcomes.len()), (2, 2), "{audit:#?}");
    assert_eq!((&intents[0]["run"], &intents[0]["steps"]), (&json!(number), &json!(12)));
    assert_eq!((&outcomes[0]["run"], &outcomes[0]["state"]), (&json!(number), &json!("done")));
    assert!(intents[0]["number"].as_u64() < outcomes[0]["number"].as_u64());
    let mut events = Stream::open(hall.gateway.address(), &hall.viewer, "/v1/events", "0").await;
    let mut kinds = Vec::new();
    while kinds.last().is_none_or(|kind| kind != "run_ended") {
        let event = events.next().await.unwrap().data;
        kinds.extend(event["event"].as_str().filter(|kind| kind.starts_with("run_")).map(str::to_owned));
    }
    assert_eq!((kinds.first().unwrap().as_str(), kinds.last().unwrap().as_str()), ("run_began", "run_ended"));
}

#[tokio::test]
async fn a_run_carries_out_the_text_that_was_checked_or_nothing() {
    let hall = Hall::start().await;
    let path = "/v1/programs/pick";
    let put = async |to: f64, line: &str| {
        let body = json!({ "program": moves(100, &[to]) });
        call_with(hall.gateway.address(), &hall.engineer, "PUT", path, line, Some(&body)).await
    };
    let first = put(1.0, "").await;
    let checked = first.body["sha256"].clone();
    let etag = format!("If-Match: {}\r\n", first.etag.unwrap());
    let removed = call_with(hall.gateway.address(), &hall.engineer, "DELETE", path, &etag, None).await;
    assert_eq!(removed.status, 204);
    // Another text has the same name and version now.
    let second = put(2.0, "If-None-Match: *\r\n").await;
    assert_eq!((&second.body["version"], second.status), (&first.body["version"], 201));
    assert_ne!(second.body["sha256"], checked);
    let kept = hall.get(&hall.viewer, path).await;
    assert_eq!(kept["sha256"], second.body["sha256"]);

    let lease = hall.long_lease(60).await;
    let mut log = hall.robots[0].handle().log();
    let body = |sha256: &Value| json!({ "name": "pick", "version": 1, "sha256": sha256, "lease": lease });
    for (number, sha256) in [&checked, &json!("0".repeat(64))].into_iter().enumerate() {
        let refused = hall.run(&hall.operator, &format!("a{number}"), &body(sha256)).await;
        assert_eq!((refused.status, &refused.body["code"]), (409, &json!("other_text")), "{}", refused.body);
    }
    assert!(hall.audit().await.iter().all(|entry| entry["what"] != "run_intent"));
    assert!(commands(&mut log).is_empty());
    for no_hash in ["", "0", &"g".repeat(64)] {
        let refused = hall.run(&hall.operator, "c", &body(&json!(no_hash))).await;
        assert_eq!((refused.status, &refused.body["code"]), (422, &json!("bad_value")), "{no_hash}");
    }
    let run = hall.run(&hall.operator, "b", &body(&kept["sha256"])).await;
    assert_eq!((run.status, &run.body["sha256"]), (202, &kept["sha256"]), "{}", run.body);
    let other = hall.run(&hall.operator, "b", &body(&checked)).await;
    assert_eq!((other.status, &other.body["code"]), (422, &json!("key_taken")), "{}", other.body);
    assert_eq!(hall.until_over(run.body["run_id"].as_u64().unwrap()).await["state"], "done");
}

#[tokio::test]
async fn a_kept_program_runs_in_several_rounds() {
    let hall = Hall::start().await;
    let put = json!({ "program": moves(100, &[5.0, 2.0]) });
    for expected in [201, 428] {
        let (status, _) = hall.call(&hall.engineer, "PUT", "/v1/programs/pick", Some(&put)).await;
        assert_eq!(status, expected);
    }
    let lease = hall.long_lease(60).await;
    let body = |more: Value| {
        let mut body = json!({ "lease": lease });
        body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        body
    };
    let reply = hall.run(&hall.operator, "a", &body(json!({ "name": "pick", "repeat": 3 }))).await;
    assert_eq!(reply.status, 202, "{}", reply.body);
    assert_eq!((&reply.body["program"], &reply.body["version"]), (&json!("pick"), &json!(1)));
    let done = hall.until_over(reply.body["run_id"].as_u64().unwrap()).await;
    assert_eq!((&done["steps"], &done["done"], &done["state"]), (&json!(6), &json!(6), &json!("done")));
    for (more, status, code) in [
        (json!({ "name": "pick", "version": 2 }), 404, "no_such_program"),
        (json!({ "name": "place" }), 404, "no_such_program"),
        (json!({ "name": "pick", "program": "" }), 422, "bad_value"),
        (json!({}), 422, "bad_value"),
        (json!({ "name": "pick", "repeat": 0 }), 422, "bad_value"),
        (json!({ "name": "pick", "repeat": 1001 }), 422, "bad_value"),
    ] {
        let reply = hall.run(&hall.operator, "b", &body(more.clone())).await;
        assert_eq!((reply.status, &reply.body["code"]), (status, &json!(code)), "{more}");
    }
    let runs = "/v1/robots/press/runs";
    for number in ["999", "x", "-1", "18446744073709551615"] {
        let (status, problem) = hall.call(&hall.viewer, "GET", &format!("{runs}/{number}"), None).await;
        assert_eq!((status, &problem["code"]), (404, &json!("no_such_run")), "{number}");
    }
}

#[tokio::test]
async fn what_cannot_be_run_is_refused_before_anything_is_sent() {
    let hall = Hall::start().await;
    let lease = hall.long_lease(60).await;
    let mut log = hall.robots[0].handle().log();
    let body = |text: &str| json!({ "program": text, "lease": lease });
    let good = body(&moves(100, &[5.0]));
    let reply = hall.run(&hall.operator, "", &good).await;
    assert_eq!((reply.status, &reply.body["code"]), (400, &json!("needs_idempotency_key")));
    let reply = hall.run(&hall.operator, &"k".repeat(129), &good).await;
    assert_eq!((reply.status, &reply.body["code"]), (400, &json!("needs_idempotency_key")));
    let reply = hall.run(&hall.viewer, "a", &good).await;
    assert_eq!((reply.status, &reply.body["code"]), (403, &json!("not_allowed")));

    let bad = hall
        .run(&hall.operator, "a", &body("[[instruction]]\ndo = \"axis-move\"\nto = [1]\nsped = 5\n"))
        .await;
    assert_eq!((bad.status, &bad.body["code"]), (422, &json!("bad_program")));
    assert!(bad.body["message"].as_str().unwrap().contains("4:1: "), "{}", bad.body);
    let taught = hall.run(&hall.operator, "a", &body("[[step]]\ndo = \"label\"\nname = \"a\"\n")).await;
    assert_eq!((taught.status, &taught.body["code"]), (422, &json!("bad_program")));
    assert!(taught.body["message"].as_str().unwrap().contains("startButton"), "{}", taught.body);

    let mut none = good.clone();
    none["lease"] = json!({ "number": lease["number"], "secret": "0".repeat(32) });
    let reply = hall.run(&hall.operator, "a", &none).await;
    assert_eq!((reply.status, &reply.body["code"]), (409, &json!("no_lease")));
    hall.until_audited(|entry| entry["request"] == "run a program" && entry["code"] == "no_lease").await;
    assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    while log.try_recv().is_ok() {}
    let reply = hall.run(&hall.operator, "a", &good).await;
    assert_eq!((reply.status, &reply.body["code"]), (409, &json!("stopped")));
    assert!(commands(&mut log).is_empty());
    assert!(hall.audit().await.iter().all(|entry| entry["what"] != "run_intent"));

    // None of these used the key up.
    let clear = json!({ "lease": lease });
    assert_eq!(hall.post(&hall.operator, "/v1/robots/press/clear-stopped", &clear).await.0, 204);
    hall.start_again(&lease).await;
    let reply = hall.run(&hall.operator, "a", &good).await;
    assert_eq!(reply.status, 202, "{}", reply.body);
    assert_eq!(hall.until_over(reply.body["run_id"].as_u64().unwrap()).await["state"], "done");
}

#[tokio::test]
async fn a_lease_that_expires_stops_the_arm_and_is_free_once_it_stands() {
    let hall = Hall::start().await;
    let lease = hall.long_lease(2).await;
    let number = hall.begin(&lease, &long()).await;
    hall.until_moving().await;
    let run = hall.until_over(number).await;
    assert_eq!((&run["state"], &run["because"]), (&json!("stopped"), &json!("lease_expired")), "{run:#}");
    assert!(run["accepted"].as_u64().unwrap() <= 10, "it was fed at most 10 ahead: {run:#}");
    assert!(hall.stands().await);
    // The next holder can begin at once: no person stopped it.
    let lease = hall.long_lease(60).await;
    hall.start_again(&lease).await;
    let next = hall.begin(&lease, &moves(100, &[1.0])).await;
    assert_eq!(hall.until_over(next).await["state"], "done");
    let audit = hall.audit().await;
    let at = |what: &str| audit.iter().position(|entry| entry["what"] == what).unwrap();
    assert!(at("stop") < at("run_outcome") && at("run_outcome") < at("lease_ended"), "{audit:#?}");
}

#[tokio::test]
async fn a_lease_that_is_given_back_stops_the_arm_before_the_answer() {
    let hall = Hall::start().await;
    let lease = hall.long_lease(60).await;
    let number = hall.begin(&lease, &long()).await;
    hall.until_moving().await;
    let (status, problem) =
        hall.call(&hall.operator, "DELETE", LEASE, Some(&json!({ "lease": lease }))).await;
    assert_eq!(status, 204, "{problem}");
    assert!(hall.stands().await);
    let run = hall.run_of(number).await;
    assert_eq!((&run["state"], &run["because"]), (&json!("stopped"), &json!("lease_released")), "{run:#}");
    hall.lease(&hall.admin, "press").await;
}

#[tokio::test]
async fn somebody_who_stops_the_robot_ends_the_run_and_the_stop_holds() {
    for pauses in [false, true] {
        let hall = Hall::start().await;
        let lease = hall.long_lease(60).await;
        let number = hall.begin(&lease, &long()).await;
        hall.until_moving().await;
        let (status, done) = if pauses {
            hall.command(&hall.engineer, "press", &json!(null), "actionPause").await
        } else {
            hall.stop(&hall.engineer, "press").await
        };
        assert_eq!(status, 200, "{done}");
        let run = hall.until_over(number).await;
        assert_eq!((&run["state"], &run["because"]), (&json!("stopped"), &json!("stop")), "{run:#}");
        assert!(hall.stands().await);
        let (by, at) = (&run["stopped_by"]["by"], run["stopped_by"]["at"].as_str().unwrap());
        assert_eq!(by, "token 3 (engineer)");
        assert!(run["began_at"].as_str().unwrap() < at && at <= run["ended_at"].as_str().unwrap(), "{run:#}");
        assert!(
            run["detail"].as_str().unwrap().starts_with("token 3 (engineer) stopped the robot"),
            "{run:#}"
        );
        let state = hall.get(&hall.viewer, "/v1/robots/press").await;
        assert_eq!((&state["stopped"], &state["lease"]["number"]), (&json!(true), &lease["number"]));
        let body = json!({ "program": moves(100, &[1.0]), "lease": lease });
        let reply = hall.run(&hall.operator, "next", &body).await;
        assert_eq!((reply.status, &reply.body["code"]), (409, &json!("stopped")));
    }
}

#[tokio::test]
async fn an_admin_who_takes_the_lease_stops_the_run_first() {
    let hall = Hall::start().await;
    let lease = hall.long_lease(60).await;
    let number = hall.begin(&lease, &long()).await;
    hall.until_moving().await;
    let (status, taken) = hall.post(&hall.admin, LEASE, &json!({ "take_because": "it is in the way" })).await;
    assert_eq!((status, &taken["stopped"]), (200, &json!(true)), "{taken}");
    assert!(hall.stands().await);
    let run = hall.run_of(number).await;
    assert_eq!((&run["state"], &run["because"]), (&json!("stopped"), &json!("lease_taken")), "{run:#}");
    assert_eq!(run["stopped_by"]["by"], "token 4 (admin)");
}

#[tokio::test]
async fn one_run_has_the_robot_and_only_what_does_not_disturb_it_is_sent() {
    let hall = Hall::start().await;
    let lease = hall.long_lease(60).await;
    let text = moves(20, &[20.0, 0.0]);
    // Two at once: one runs.
    let body = json!({ "program": text, "lease": lease });
    let (one, other) =
        tokio::join!(hall.run(&hall.operator, "one", &body), hall.run(&hall.operator, "other", &body));
    let (won, lost) = if one.status == 202 { (one, other) } else { (other, one) };
    assert_eq!((won.status, lost.status, &lost.body["code"]), (202, 409, &json!("run_under_way")));
    let mut log = hall.robots[0].handle().log();
    for (words, status) in [
        ("modifyGSPD 90", 200),
        ("modifyCounter 1 5 0", 200),
        ("modifyOutput 0 3 1", 409),
        ("startButton", 409),
        ("switchTool 1", 409),
        ("switchMold other", 409),
    ] {
        let (found, problem) = hall.command(&hall.operator, "press", &lease, words).await;
        assert_eq!(found, status, "{words}: {problem}");
        if status == 409 {
            assert_eq!(problem["code"], "run_under_way", "{words}");
        }
    }
    assert_eq!(commands(&mut log), ["modifyGSPD", "modifyCounter"]);
    let number = won.body["run_id"].as_u64().unwrap();
    let renew = json!({ "renew": lease, "duration_ms": 60_000 });
    assert_eq!(hall.post(&hall.operator, LEASE, &renew).await.0, 200);
    let run = hall.until_over(number).await;
    assert_eq!((&run["state"], &run["proof"]), (&json!("done"), &json!("reached")), "{run:#}");
    // Afterwards the same is sent again.
    let (status, problem) = hall.command(&hall.operator, "press", &lease, "switchTool 1").await;
    assert_ne!(problem["code"], "run_under_way", "{status}");
}

#[tokio::test]
async fn the_same_request_twice_at_once_is_one_run() {
    let hall = Hall::start().await;
    let lease = hall.long_lease(60).await;
    let body = json!({ "program": moves(100, &[2.0]), "lease": lease });
    let ask = || hall.run(&hall.operator, "one", &body);
    let (one, two) = tokio::join!(ask(), ask());
    let replies = [one, two];
    let number = replies.iter().find_map(|reply| reply.body["run_id"].as_u64()).unwrap();
    for reply in replies {
        let is_it = reply.status == 202 && reply.body["run_id"] == number;
        let is_beginning = reply.status == 409 && reply.body["code"] == "in_progress";
        assert!(is_it || is_beginning, "{} {}", reply.status, reply.body);
    }
    hall.until_over(number).await;
    assert_eq!(hall.audit().await.iter().filter(|entry| entry["what"] == "run_intent").count(), 1);
}

#[tokio::test]
async fn a_robot_that_comes_back_is_stopped_first_and_its_run_is_unknown() {
    let robot = VirtualController::start().await.unwrap();
    let (address, cut) = way(robot.address()).await;
    let period = Duration::from_millis(20);
    let press = RobotConfig { period, ..RobotConfig::new(name("press"), address.to_string()) };
    let hall = Hall::at(tempfile::tempdir().unwrap(), vec![press], vec![robot]).await;
    hall.until_up("press").await;
    let lease = hall.long_lease(120).await;
    let number = hall.begin(&lease, &long()).await;
    hall.until_moving().await;
    cut.send(true).unwrap();
    let run = hall.until_over(number).await;
    assert_eq!((&run["state"], &run["because"]), (&json!("unknown"), &json!("link_lost")), "{run:#}");
    assert!(hall.robots[0].handle().snapshot().moving, "it is out of reach");
    let (status, problem) = hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await;
    assert_eq!((status, &problem["code"]), (409, &json!("not_ready")), "{problem}");

    let mut log = hall.robots[0].handle().log();
    cut.send(false).unwrap();
    hall.until("press", |state| state["link"] == "up").await;
    let begun = Instant::now();
    while hall.robots[0].handle().snapshot().moving {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    assert_eq!(
        commands(&mut log).first().map(String::as_str),
        Some("actionStop"),
        "first of all it is stopped"
    );
    // The run is never resumed, and the holder of the lease can go on once that stop has ended.
    hall.until_audited(|entry| entry["what"] == "stop" && entry["confirmed"] == true).await;
    let begun = Instant::now();
    while hall.command(&hall.operator, "press", &lease, "modifyGSPD 100").await.0 != 200 {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    hall.start_again(&lease).await;
    let next = hall.begin(&lease, &moves(100, &[0.0])).await;
    assert_eq!(hall.until_over(next).await["state"], "done");
    assert_eq!(hall.run_of(number).await, run);
}

#[tokio::test]
async fn an_arm_that_is_owed_a_stop_is_not_lost_by_a_file_that_is_read_again() {
    let robot = VirtualController::start().await.unwrap();
    let (address, cut) = way(robot.address()).await;
    let config = |address: String| RobotConfig {
        period: Duration::from_millis(20),
        ..RobotConfig::new(name("press"), address)
    };
    let here = vec![config(address.to_string())];
    let hall = Hall::at(tempfile::tempdir().unwrap(), here.clone(), vec![robot]).await;
    hall.until_up("press").await;
    let lease = hall.long_lease(120).await;
    let number = hall.begin(&lease, &long()).await;
    hall.until_moving().await;
    cut.send(true).unwrap();
    assert_eq!(hall.until_over(number).await["state"], "unknown");
    let files = [vec![config("127.0.0.1:1".to_owned())], Vec::new()];
    for file in files.clone() {
        let refused = hall.gateway.reload(file).await.unwrap_err();
        assert_eq!(refused.code.word(), "not_ready", "{refused:?}");
    }
    // Not either after a stop that does not reach it.
    assert_eq!(hall.stop(&hall.operator, "press").await.0, 504);
    for file in files {
        let refused = hall.gateway.reload(file).await.unwrap_err();
        assert_eq!(refused.code.word(), "not_ready", "{refused:?}");
    }
    assert_eq!(hall.gateway.reload(here).await.unwrap(), r6_gateway::Changes::default());
    // It is still stopped as soon as it answers.
    cut.send(false).unwrap();
    hall.until_audited(|entry| entry["what"] == "stop" && entry["confirmed"] == true).await;
    assert!(hall.stands().await);
}

#[tokio::test]
async fn an_arm_that_is_owed_a_stop_is_not_lost_by_another_address() {
    let robot = VirtualController::start().await.unwrap();
    let (address, cut) = way(robot.address()).await;
    let hall = Hall::at(tempfile::tempdir().unwrap(), Vec::new(), vec![robot]).await;
    let put = async |address: String| {
        let wanted = json!({ "address": address, "period_ms": 20 });
        hall.call(&hall.admin, "PUT", "/v1/robots/press", Some(&wanted)).await
    };
    let remove = async || hall.call(&hall.admin, "DELETE", "/v1/robots/press", None).await;
    assert_eq!(put(address.to_string()).await.0, 201);
    hall.until_up("press").await;
    let lease = hall.long_lease(120).await;
    let number = hall.begin(&lease, &long()).await;
    hall.until_moving().await;
    cut.send(true).unwrap();
    assert_eq!(hall.until_over(number).await["state"], "unknown");
    for (status, problem) in [put("127.0.0.1:1".to_owned()).await, remove().await] {
        assert_eq!((status, &problem["code"]), (409, &json!("not_ready")), "{problem}");
    }
    let gone = json!({ "because": "the arm was scrapped" });
    let forget = async |token: &str| hall.post(token, "/v1/robots/press/forget-owed-stop", &gone).await;
    let (status, problem) = forget(&hall.admin).await;
    assert_eq!((status, &problem["code"]), (409, &json!("not_ready")), "no stop holds: {problem}");
    // A stop that does not reach the arm holds, and the arm may still move: it keeps its name.
    let (status, problem) = hall.post(&hall.operator, "/v1/robots/press/stop", &json!({})).await;
    assert_eq!((status, &problem["code"]), (504, &json!("not_stopped")), "{problem}");
    for (status, problem) in [put("127.0.0.1:1".to_owned()).await, remove().await] {
        assert_eq!((status, &problem["code"]), (409, &json!("not_ready")), "{problem}");
    }
    // Only an admin of all robots can say that the arm is gone. The stop holds until somebody clears it.
    let own =
        r6_gateway::make_token(hall.data.path(), Role::Admin, Some(name("press").into()), String::new());
    assert_eq!(forget(&own.unwrap().1).await.0, 403);
    assert_eq!(forget(&hall.admin).await.0, 204);
    assert_eq!(forget(&hall.admin).await.0, 409, "nothing is owed any more");
    let told = hall.until_audited(|entry| entry["what"] == "owed_stop_forgotten").await;
    assert_eq!((&told["because"], &told["robot"]), (&gone["because"], &json!("press")));
    let (status, problem) = remove().await;
    assert_eq!((status, &problem["code"]), (409, &json!("stopped")), "{problem}");
    let body = json!({ "lease": lease });
    assert_eq!(hall.post(&hall.operator, "/v1/robots/press/clear-stopped", &body).await.0, 204);
    assert_eq!(remove().await.0, 204);
}

#[tokio::test]
async fn another_robot_gets_nothing_of_a_run() {
    let mut hall = Hall::start().await;
    let lease = hall.long_lease(120).await;
    let number = hall.begin(&lease, &long()).await;
    hall.until_moving().await;
    let first = hall.robots.pop().unwrap();
    let address = first.address();
    first.shutdown().await.unwrap();
    let run = hall.until_over(number).await;
    assert_eq!(run["state"], "unknown", "{run:#}");
    let model = RobotModel::named("BRTIRUS1510A").unwrap().clone();
    let settings = SimSettings { listen: vec![address], model, ..SimSettings::default() };
    let other = Simulation::start(settings).await.unwrap();
    let mut log = other.controllers()[0].log_from_start();
    let state = hall.until("press", |state| !state["identity_changed"].is_null()).await;
    // Longer than the gateway waits to stop a list that is left.
    tokio::time::sleep(Duration::from_secs(1)).await;
    assert!(commands(&mut log).is_empty());
    let found = &state["identity_changed"]["found"];
    assert_eq!(hall.post(&hall.engineer, "/v1/robots/press/accept-identity", found).await.0, 204);
    hall.until_up("press").await;
    let lease = hall.lease(&hall.operator, "press").await;
    let (status, done) = hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await;
    assert_eq!(status, 200, "{done}");
    assert_eq!(commands(&mut log), ["modifyGSPD"]);
}

#[tokio::test]
async fn a_gateway_that_ends_stops_the_arm_first() {
    let mut hall = Hall::start().await;
    let lease = hall.long_lease(60).await;
    let number = hall.begin(&lease, &long()).await;
    hall.until_moving().await;
    let robots = std::mem::take(&mut hall.robots);
    let handle = robots[0].handle().clone();
    let config = RobotConfig::new(name("press"), robots[0].address().to_string());
    let hall = hall.again(vec![config], robots).await;
    assert!(!handle.snapshot().moving);
    let run = hall.run_of(number).await;
    assert_eq!((&run["state"], &run["because"]), (&json!("stopped"), &json!("gateway_ended")), "{run:#}");
    hall.until_up("press").await;
    let lease = hall.long_lease(60).await;
    hall.start_again(&lease).await;
    let next = hall.begin(&lease, &moves(100, &[1.0])).await;
    assert!(number < next);
    assert_eq!(hall.until_over(next).await["state"], "done");
}

#[tokio::test]
async fn a_machine_that_is_not_ready_is_told_and_the_answer_stays() {
    let hall = Hall::start().await;
    hall.robots[0].handle().operate(&r6_controller::PanelAction::EmergencyStop).unwrap();
    hall.until("press", |state| signal(state, "curAlarm")["value"] == 7).await;
    let lease = hall.long_lease(60).await;
    let body = json!({ "program": moves(100, &[1.0]), "lease": lease });
    let first = hall.run(&hall.operator, "one", &body).await;
    assert_eq!((first.status, &first.body["code"]), (409, &json!("not_ready")), "{}", first.body);
    let again = hall.run(&hall.operator, "one", &body).await;
    assert_eq!((again.status, &again.body), (409, &first.body));
    let outcome = hall.until_audited(|entry| entry["what"] == "run_outcome").await;
    assert_eq!((&outcome["state"], &outcome["because"]), (&json!("refused"), &json!("not_ready")));
}
