//! Commands with an `Idempotency-Key`: a request that comes twice reaches the controller once.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use r6_client::RobotSettings;
use r6_controller::{Event, LogEntry, Scenario};
use r6_gateway::{Gateway, GatewaySettings, RobotConfig};
use r6_sim::VirtualController;
use serde_json::{Value, json};
use tokio::sync::broadcast::Receiver;

use crate::support::{Hall, Reply, call_with, commands, name, settings};

const COMMANDS: &str = "/v1/robots/press/commands";

/// A controller that answers this part of all commands never.
async fn silent(chance: f64, seed: u64) -> VirtualController {
    let text = format!("seed = {seed}\n[[fault]]\nfault = \"not-acknowledged\"\nchance = {chance:?}\n");
    VirtualController::builder().scenario(Scenario::read(&text).unwrap()).start().await.unwrap()
}

fn press(robot: &VirtualController) -> RobotConfig {
    let period = Duration::from_millis(20);
    RobotConfig { period, ..RobotConfig::new(name("press"), robot.address().to_string()) }
}

fn write(register: u64, value: i64, lease: &Value) -> Value {
    let arguments = [register.to_string(), value.to_string(), "0".to_owned()];
    json!({ "command": "rewriteData", "arguments": arguments, "lease": lease })
}

impl Hall {
    async fn once(&self, token: &str, key: &str, body: &Value) -> Reply {
        let line = format!("Idempotency-Key: {key}\r\n");
        call_with(self.gateway.address(), token, "POST", COMMANDS, &line, Some(body)).await
    }

    async fn minute(&self) -> Value {
        let (status, lease) =
            self.post(&self.operator, "/v1/robots/press/lease", &json!({ "duration_ms": 60_000 })).await;
        assert_eq!(status, 200, "{lease}");
        lease["lease"].clone()
    }
}

#[tokio::test]
async fn the_same_request_gets_the_same_answer_also_after_a_restart() {
    let hall = Hall::start().await;
    let mut log = hall.robots[0].handle().log_from_start();
    let lease = hall.minute().await;
    let body = write(800, 5, &lease);
    let first = hall.once(&hall.operator, "a", &body).await;
    assert_eq!(first.status, 200, "{}", first.body);
    assert!(first.body["command_id"].is_u64());
    let again = hall.once(&hall.operator, "a", &body).await;
    assert_eq!((again.status, &again.body), (200, &first.body));
    // No lease is needed for an answer that was given, and another one makes no other request.
    let without = json!({ "command": body["command"], "arguments": body["arguments"] });
    assert_eq!(hall.once(&hall.operator, "a", &without).await.body, first.body);
    for other in [write(800, 6, &lease), write(801, 5, &lease)] {
        let reply = hall.once(&hall.operator, "a", &other).await;
        assert_eq!((reply.status, &reply.body["code"]), (422, &json!("key_taken")));
    }
    // A caller without the right learns nothing, and other callers have keys of their own.
    let reply = hall.once(&hall.viewer, "a", &body).await;
    assert_eq!((reply.status, &reply.body["code"]), (403, &json!("not_allowed")));
    assert_eq!(hall.once(&hall.engineer, "a", &body).await.status, 200);
    assert_eq!(commands(&mut log), ["rewriteData", "rewriteData"]);

    // What is refused before it has a number uses no key up.
    let reply = hall.once(&hall.operator, "b", &without).await;
    assert_eq!((reply.status, &reply.body["code"]), (409, &json!("no_lease")));
    assert_eq!(hall.once(&hall.operator, "b", &body).await.status, 200);
    for wrong in ["", "two words", &"x".repeat(129), "a\r\nIdempotency-Key: b"] {
        let reply = hall.once(&hall.operator, wrong, &body).await;
        assert_eq!((reply.status, &reply.body["code"]), (400, &json!("needs_idempotency_key")), "{wrong}");
    }
    assert_eq!(commands(&mut log), ["rewriteData"]);

    let configs = vec![press(&hall.robots[0])];
    let mut hall = hall;
    let robots = std::mem::take(&mut hall.robots);
    let operator = hall.operator.clone();
    let hall = hall.again(configs, robots).await;
    hall.until_up("press").await;
    let again = hall.once(&operator, "a", &body).await;
    assert_eq!((again.status, &again.body), (200, &first.body));
    assert!(commands(&mut log).is_empty());
}

#[tokio::test]
async fn a_command_that_stops_is_sent_each_time() {
    let hall = Hall::start().await;
    let mut log = hall.robots[0].handle().log_from_start();
    for _ in 0..2 {
        let reply = hall.once(&hall.operator, "a", &json!({ "command": "actionStop" })).await;
        assert_eq!(reply.status, 200, "{}", reply.body);
    }
    assert_eq!(commands(&mut log), ["actionStop", "actionStop"]);
}

#[tokio::test]
async fn an_unknown_outcome_stays_and_what_is_under_way_is_told() {
    let hall = Hall::with(vec![silent(1.0, 1).await]).await;
    let mut log = hall.robots[0].handle().log_from_start();
    let lease = hall.minute().await;
    let body = write(800, 5, &lease);
    let first = hall.once(&hall.operator, "a", &body);
    let meanwhile = async {
        hall.until_audited(|entry| entry["what"] == "command_intent").await;
        let reply = hall.once(&hall.operator, "a", &body).await;
        assert_eq!((reply.status, &reply.body["code"]), (409, &json!("in_progress")), "{}", reply.body);
        assert!(reply.body["command_id"].is_u64(), "{}", reply.body);
        let other = hall.once(&hall.operator, "a", &write(800, 6, &lease)).await;
        assert_eq!(other.body["code"], json!("key_taken"));
        // What the disk has now is what a gateway that is killed leaves.
        let killed = tempfile::tempdir().unwrap();
        for file in ["control.db", "control.db-wal", "audit.key"] {
            std::fs::copy(hall.data.path().join(file), killed.path().join(file)).unwrap();
        }
        killed
    };
    let (first, killed) = tokio::join!(first, meanwhile);
    assert_eq!((first.status, &first.body["code"]), (504, &json!("outcome_unknown")));
    // The caller finds what is known of it in the audit log.
    let intent = hall.until_audited(|entry| entry["number"] == first.body["command_id"]).await;
    assert_eq!((&intent["what"], intent["number"].is_u64()), (&json!("command_intent"), true), "{intent}");
    let again = hall.once(&hall.operator, "a", &body).await;
    assert_eq!((again.status, &again.body), (504, &first.body));
    assert_eq!(commands(&mut log), ["rewriteData"]);

    let operator = hall.operator.clone();
    let configs = vec![press(&hall.robots[0])];
    let next = Hall::at(killed, configs, Vec::new()).await;
    let again = next.once(&operator, "a", &body).await;
    assert_eq!((again.status, &again.body["code"]), (504, &json!("outcome_unknown")), "{}", again.body);
    assert_eq!(again.body["command_id"], first.body["command_id"]);
    assert!(commands(&mut log).is_empty());
}

/// How often the controller took a write to each register.
fn written(log: &mut Receiver<Arc<LogEntry>>, counts: &mut BTreeMap<String, usize>) {
    while let Ok(entry) = log.try_recv() {
        if let Event::CommandAccepted { command, arguments, .. } = &entry.event
            && command.as_str() == "rewriteData"
        {
            *counts.entry(arguments[0].as_str().to_owned()).or_default() += 1;
        }
    }
}

/// Numbers from a seed: the same ones each time (the generator of Numerical Recipes).
struct Draws(u32);

impl Draws {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (u64::from(self.0 >> 8) * end) >> 24
    }
}

/// Random requests with random keys, several at once, at a controller that often does not answer, and with a
/// restart of the gateway between them.
#[tokio::test]
async fn a_changing_frame_is_sent_at_most_once_for_a_key() {
    const KEYS: u64 = 6;
    for seed in 1..=4 {
        let mut random = Draws(u32::try_from(seed).unwrap());
        let robot = silent(0.4, seed).await;
        let config = press(&robot);
        let mut log = robot.handle().log_from_start();
        let data = tempfile::tempdir().unwrap();
        let reply_timeout = Duration::from_millis(150);
        let start = async |path: &std::path::Path| {
            let robot_settings = RobotSettings { reply_timeout, ..RobotSettings::default() };
            Gateway::start(GatewaySettings { robot_settings, ..settings(path, vec![config.clone()]) })
                .await
                .unwrap()
        };
        let mut hall = Hall::of(start(data.path()).await, data, vec![robot]);
        let operator = hall.operator.clone();
        let (mut answers, mut counts) = (BTreeMap::<u64, Vec<(u16, Value)>>::new(), BTreeMap::new());
        for wave in 0..8 {
            if wave == 4 {
                let Hall { gateway, data, robots, .. } = hall;
                gateway.shutdown().await.unwrap();
                hall = Hall::of(start(data.path()).await, data, robots);
            }
            hall.until_up("press").await;
            let lease = hall.minute().await;
            let mut asked = Vec::new();
            for _ in 0..6 {
                let key = random.below(KEYS);
                let value = if random.below(5) == 0 { 99 } else { 1 };
                let (address, operator) = (hall.gateway.address(), operator.clone());
                let body = write(800 + key, value, &lease);
                let line = format!("Idempotency-Key: seed-{seed}-{key}\r\n");
                let call = async move {
                    (key, call_with(address, &operator, "POST", COMMANDS, &line, Some(&body)).await)
                };
                asked.push(tokio::spawn(call));
            }
            for call in asked {
                let (key, Reply { status, body, .. }) = call.await.unwrap();
                // Other requests, and what uses no key up on a machine that is slow.
                let passing = ["in_progress", "key_taken", "not_ready", "overloaded"];
                if !passing.map(|code| json!(code)).contains(&body["code"]) {
                    answers.entry(key).or_default().push((status, body));
                }
            }
            let lease = json!({ "lease": lease });
            hall.call(&operator, "DELETE", "/v1/robots/press/lease", Some(&lease)).await;
            written(&mut log, &mut counts);
        }
        assert!(answers.len() as u64 > KEYS / 2, "seed {seed}: {answers:#?}");
        for (key, given) in answers {
            let sent = counts.get(&(800 + key).to_string()).copied().unwrap_or(0);
            assert_eq!(sent, 1, "seed {seed}, key {key}: {given:#?}");
            assert!(given.windows(2).all(|pair| pair[0] == pair[1]), "seed {seed}, key {key}: {given:#?}");
            let (status, body) = &given[0];
            assert!(
                *status == 200 || body["code"] == "outcome_unknown",
                "seed {seed}, key {key}: {given:#?}"
            );
        }
        hall.gateway.shutdown().await.unwrap();
    }
}
