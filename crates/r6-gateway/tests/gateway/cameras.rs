//! Cameras: who may send points and answers to photos, and what reaches the controller.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use r6_controller::{Button, Event, PanelAction, Program, StartState};
use r6_gateway::{Camera, RobotConfig};
use r6_motion::RobotModel;
use r6_sim::{SimSettings, Simulation, VirtualController};
use serde_json::{Value, json};

use crate::raw::Tap;
use crate::support::{Hall, PATIENCE, Stream, call, call_with, name, way};

const POINTS: &str = "/v1/robots/press/cameras/0/points";
const PHOTO: &str = "/v1/robots/press/cameras/0/photo";
const GRANTS: &str = "/v1/robots/press/cameras/0/grants";

impl Hall {
    /// A token with the grant for camera 0 of `press`: its number and its text.
    pub async fn camera(&self) -> (i64, String) {
        let made = r6_gateway::make_token(self.data.path(), Role::Viewer, None, "belt".to_owned());
        let (number, text) = made.unwrap();
        let (status, problem) = self.post(&self.admin, GRANTS, &json!({ "token": number })).await;
        assert_eq!(status, 201, "{problem}");
        (number, text)
    }

    /// How many points of cameras the controller has.
    pub fn taken(&self) -> usize {
        self.robots[0].handle().snapshot().points.iter().map(|(_, points)| points).sum()
    }

    /// A gateway in front of a virtual controller, and what goes to it.
    async fn tapped() -> (Self, Tap) {
        let robot = VirtualController::start().await.unwrap();
        let tap = Tap::before(robot.address()).await;
        let hall = Self::behind(robot, tap.address).await;
        (hall, tap)
    }

    /// A gateway whose way to `press` is this address.
    async fn behind(robot: VirtualController, address: SocketAddr) -> Self {
        let period = Duration::from_millis(20);
        let press = RobotConfig { period, ..RobotConfig::new(name("press"), address.to_string()) };
        let hall = Self::at(tempfile::tempdir().unwrap(), vec![press], vec![robot]).await;
        hall.until_up("press").await;
        hall
    }
}

fn parts(xs: &[f64]) -> Value {
    let points: Vec<_> = xs.iter().map(|x| json!({ "x": x, "y": -12.25, "z": 5, "angle": 90.5 })).collect();
    json!({ "points": points })
}

fn refused(answer: (u16, Value)) -> (u16, String) {
    (answer.0, answer.1["code"].as_str().unwrap_or_default().to_owned())
}

fn is(status: u16, code: &str) -> (u16, String) {
    (status, code.to_owned())
}

#[tokio::test]
async fn a_camera_with_a_grant_sends_points_without_the_lease() {
    let (hall, tap) = Hall::tapped().await;
    let (number, camera) = hall.camera().await;
    // Another holds the lease: the camera does not care.
    hall.lease(&hall.operator, "press").await;
    let (status, done) = hall.post(&camera, POINTS, &parts(&[888.001, 10.0])).await;
    assert_eq!((status, &done["sent"], &done["taken"]), (200, &json!(2), &json!(2)), "{done}");
    assert_eq!(hall.taken(), 2);
    let sent = tap.frames("AddPoints");
    assert_eq!(sent.len(), 1, "{sent:?}");
    let point =
        |x: &str| format!("{{\"ModelID\":0,\"X\":{x},\"Y\":-12.250,\"Z\":5.000,\"Angel\":90.500,\"Rel\":0}}");
    let data = format!("[{{\"camID\":0,\"data\":[{},{}]}}]", point("888.001"), point("10.000"));
    assert!(sent[0].contains("www.hc-system.com.cam") && sent[0].contains(&data), "{}", sent[0]);

    let audit = hall.audit().await;
    let entry = |what: &str| audit.iter().find(|entry| entry["what"] == what).unwrap();
    let granted = entry("camera_granted");
    assert_eq!((&granted["camera"], &granted["token"]), (&json!(0), &json!(number)));
    assert_eq!((&granted["actor"], &granted["robot"]), (&json!("token 4 (admin)"), &json!("press")));
    let (intent, outcome) = (entry("command_intent"), entry("command_outcome"));
    assert_eq!(intent["number"], done["command_id"]);
    assert_eq!((&intent["command"], &intent["lease"]), (&json!("AddPoints camera 0, 2 points"), &json!(0)));
    assert_eq!((&intent["actor"], &outcome["outcome"]), (&json!("token 5 (belt)"), &json!("accepted")));

    let seen = hall.get(&hall.viewer, "/v1/robots/press/cameras").await;
    let told = &seen["grants"][0];
    assert_eq!(seen["grants"].as_array().unwrap().len(), 1, "{seen}");
    assert_eq!(
        (&told["camera"], &told["token"], &told["token_name"]),
        (&json!(0), &json!(5), &json!("belt"))
    );
    assert_eq!(told["by"], "token 4 (admin)");
    assert_eq!(hall.post(&hall.admin, GRANTS, &json!({ "token": number })).await.0, 204, "it has it");
}

#[tokio::test]
async fn without_the_grant_for_this_camera_nothing_leaves_whatever_the_role_and_the_lease() {
    let hall = Hall::start().await;
    let (_, camera) = hall.camera().await;
    hall.user("anna", Role::Admin).await;
    let lease = hall.lease(&hall.admin, "press").await;
    for token in [&hall.viewer, &hall.operator, &hall.engineer, &hall.admin] {
        for path in [POINTS, PHOTO] {
            assert_eq!(
                refused(hall.post(token, path, &parts(&[1.0])).await),
                is(403, "not_allowed"),
                "{path}"
            );
        }
    }
    let with_lease = json!({ "points": [{ "x": 1, "y": 2 }], "lease": lease });
    assert_eq!(refused(hall.post(&hall.admin, POINTS, &with_lease).await), is(403, "not_allowed"));
    let user = hall.browser("anna").await;
    assert_eq!(refused(user.call("POST", POINTS, Some(&parts(&[1.0]))).await), is(403, "not_allowed"));
    for path in ["/v1/robots/press/cameras/1/points", "/v1/robots/press/cameras/999/points"] {
        assert_eq!(refused(hall.post(&camera, path, &parts(&[1.0])).await), is(403, "not_allowed"), "{path}");
    }
    // The grant lets it send no command.
    let start = json!({ "command": "startButton" });
    assert_eq!(
        refused(hall.post(&camera, "/v1/robots/press/commands", &start).await),
        is(403, "not_allowed")
    );
    assert!(hall.taken() == 0);
    hall.until_audited(|entry| entry["what"] == "refused" && entry["request"] == "camera 1").await;
    let audit = hall.audit().await;
    assert!(audit.iter().all(|entry| entry["what"] != "command_intent"), "{audit:#?}");
    assert_eq!(hall.post(&camera, POINTS, &parts(&[1.0])).await.0, 200, "its own camera");
}

#[tokio::test]
async fn a_grant_that_is_revoked_is_over_at_once_and_so_is_that_of_a_revoked_token() {
    let hall = Hall::start().await;
    let (number, camera) = hall.camera().await;
    let revoke = format!("{GRANTS}/{number}");
    assert_eq!(hall.post(&camera, POINTS, &parts(&[1.0])).await.0, 200);
    assert_eq!(hall.call(&hall.admin, "DELETE", &revoke, None).await.0, 204);
    assert_eq!(refused(hall.post(&camera, POINTS, &parts(&[2.0])).await), is(403, "not_allowed"));
    assert_eq!(refused(hall.call(&hall.admin, "DELETE", &revoke, None).await), is(404, "no_such_token"));
    hall.until_audited(|entry| entry["what"] == "camera_revoked" && entry["token"] == json!(number)).await;
    // It is given on the command line, while the gateway runs.
    let given =
        |token| r6_gateway::grant_camera(hall.data.path(), token, name("press"), Camera::new(0).unwrap());
    assert_eq!(given(number), Ok(true));
    assert_eq!(hall.post(&camera, POINTS, &parts(&[3.0])).await.0, 200);
    // The token is revoked beside the gateway, which may not know it for half a second. Its grants are gone.
    assert_eq!(r6_gateway::revoke_token(hall.data.path(), number), Ok(true));
    let (status, _) = hall.post(&camera, POINTS, &parts(&[4.0])).await;
    assert!(status == 401 || status == 403, "{status}");
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press/cameras").await, json!({ "grants": [] }));
    assert_eq!(hall.taken(), 2);
}

#[tokio::test]
async fn a_grant_is_for_a_valid_token_of_this_robot() {
    let hall = Hall::start().await;
    let of_saw =
        r6_gateway::make_token(hall.data.path(), Role::Admin, Some(name("saw").into()), String::new());
    let (number, text) = of_saw.unwrap();
    for (token, wanted) in [(number, is(422, "bad_value")), (99, is(404, "no_such_token"))] {
        let answer = hall.post(&hall.admin, GRANTS, &json!({ "token": token })).await;
        assert_eq!(refused(answer), wanted, "{token}");
    }
    // An admin of another robot gives none.
    let answer = hall.post(&text, GRANTS, &json!({ "token": number })).await;
    assert_eq!(refused(answer), is(403, "not_allowed"));
    for camera in ["x", "1000", "-1", "%ff"] {
        let path = format!("/v1/robots/press/cameras/{camera}/grants");
        let answer = hall.post(&hall.admin, &path, &json!({ "token": 1 })).await;
        assert_eq!(refused(answer), is(422, "bad_value"), "{camera}");
    }
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press/cameras").await, json!({ "grants": [] }));
}

#[tokio::test]
async fn points_that_cannot_be_sent_are_told_before_anything_leaves() {
    let hall = Hall::start().await;
    let (_, camera) = hall.camera().await;
    let full = json!({ "model_id": -1, "x": -234.123_456, "y": -234.123_456, "z": -234.123_456,
        "u": -179.123_456, "v": -179.123_456, "angle": -179.123_456, "similarity": 0.123_456, "color": 255,
        "relative": true });
    for body in [
        json!({}),
        json!({ "points": [] }),
        json!({ "points": [{ "x": 1 }] }),
        json!({ "points": [{ "x": "1", "y": 2 }] }),
        json!({ "points": [{ "x": 1, "y": 2, "w": 3 }] }),
        json!({ "points": [{ "x": 1e300, "y": 2 }] }),
        json!({ "points": vec![json!({ "x": 1, "y": 2 }); 51] }),
        // More than a frame has room for.
        json!({ "points": vec![full.clone(); 40] }),
    ] {
        assert_eq!(refused(hall.post(&camera, POINTS, &body).await), is(422, "bad_value"), "{body}");
    }
    // What is told is for people who write no Rust.
    for (points, at, told) in [
        (json!([{ "x": 1, "y": 2 }, { "x": "1", "y": 2 }]), "points[1].x: ", "expected a number"),
        (json!([{ "x": 1, "y": 2, "color": "red" }]), "points[0].color: ", "expected a whole number"),
        (json!([{ "x": 1 }]), "points[0]: ", "missing field `y`"),
        (json!([{ "x": 1, "y": 2, "angel": 3 }]), "points[0]", "nearest: `angle`"),
    ] {
        let (_, problem) = hall.post(&camera, POINTS, &json!({ "points": points })).await;
        let message = problem["message"].as_str().unwrap();
        assert!(message.starts_with(at) && message.contains(told), "{message}");
    }
    let (_, problem) = hall.post(&camera, POINTS, &json!({ "points": vec![full.clone(); 40] })).await;
    assert!(problem["message"].as_str().unwrap().contains("fewer points in a request"), "{problem}");
    let (status, problem) = hall.call(&camera, "POST", POINTS, None).await;
    assert_eq!((status, &problem["code"]), (415, &json!("not_json")));
    assert!(hall.taken() == 0);
    let audit = hall.audit().await;
    assert!(audit.iter().all(|entry| entry["what"] != "command_intent"), "{audit:#?}");
    let (status, done) = hall.post(&camera, POINTS, &json!({ "points": vec![full; 10] })).await;
    assert_eq!((status, &done["taken"]), (200, &json!(10)), "{done}");
}

#[tokio::test]
async fn while_a_stop_holds_no_point_leaves() {
    let hall = Hall::start().await;
    let (_, camera) = hall.camera().await;
    assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    for (path, body) in [(POINTS, parts(&[1.0])), (PHOTO, json!({ "taken": true }))] {
        assert_eq!(refused(hall.post(&camera, path, &body).await), is(409, "stopped"), "{path}");
    }
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(refused(hall.post(&camera, POINTS, &parts(&[1.0])).await), is(409, "stopped"));
    assert!(hall.taken() == 0);
    let cleared =
        hall.post(&hall.operator, "/v1/robots/press/clear-stopped", &json!({ "lease": lease })).await;
    assert_eq!(cleared.0, 204);
    assert_eq!(hall.post(&camera, POINTS, &parts(&[1.0])).await.0, 200);
    let late = "Valid-Until: 2026-01-01T00:00:00Z\r\n";
    let body = parts(&[2.0]);
    let reply = call_with(hall.gateway.address(), &camera, "POST", POINTS, late, Some(&body)).await;
    assert_eq!((reply.status, &reply.body["code"]), (409, &json!("too_late")));
    assert_eq!(hall.taken(), 1);
}

#[tokio::test]
async fn a_robot_that_is_not_there_or_is_another_or_is_in_manual_gets_no_points() {
    let robot = VirtualController::start().await.unwrap();
    let (address, cut) = way(robot.address()).await;
    let hall = Hall::behind(robot, address).await;
    let (_, camera) = hall.camera().await;
    cut.send(true).unwrap();
    hall.until("press", |state| state["link"] == "down").await;
    assert_eq!(refused(hall.post(&camera, POINTS, &parts(&[1.0])).await), is(409, "not_ready"));
    assert!(hall.taken() == 0);

    let manual = VirtualController::builder().stands(StartState::Manual).start().await.unwrap();
    let hall = Hall::with(vec![manual]).await;
    let (_, camera) = hall.camera().await;
    assert_eq!(refused(hall.post(&camera, POINTS, &parts(&[1.0])).await), is(409, "not_ready"));
    assert!(hall.taken() == 0);

    let mut hall = Hall::start().await;
    let (_, camera) = hall.camera().await;
    let first = hall.robots.pop().unwrap();
    let address = first.address();
    first.shutdown().await.unwrap();
    let model = RobotModel::named("BRTIRUS1510A").unwrap().clone();
    let settings = SimSettings { listen: vec![address], model, ..SimSettings::default() };
    let other = Simulation::start(settings).await.unwrap();
    hall.until("press", |state| !state["identity_changed"].is_null()).await;
    assert_eq!(refused(hall.post(&camera, POINTS, &parts(&[1.0])).await), is(409, "identity_changed"));
    assert!(other.controllers()[0].snapshot().points.is_empty());
}

#[tokio::test]
async fn what_the_controller_said_is_told_and_no_more() {
    let (hall, tap) = Hall::tapped().await;
    let (_, camera) = hall.camera().await;
    // A controller that cannot read a number of the frame says no.
    tap.change("\"X\":7.000", "\"X\":\"seven\"");
    let (status, problem) = hall.post(&camera, POINTS, &parts(&[7.0])).await;
    assert_eq!((status, &problem["code"]), (409, &json!("refused")), "{problem}");
    let refused_with = hall.until_audited(|entry| entry["outcome"] == "refused").await;
    assert_eq!(refused_with["detail"], problem["message"]);
    assert_eq!((hall.taken(), tap.frames("AddPoints").len()), (0, 1));

    // Without a reply, what became of them is not known, and they are not sent again.
    tap.lose("AddPoints");
    assert_eq!(refused(hall.post(&camera, POINTS, &parts(&[8.0])).await), is(504, "outcome_unknown"));
    hall.until_audited(|entry| entry["outcome"] == "unknown").await;
    assert_eq!(tap.frames("8.000").len(), 1);
    let audit = hall.audit().await;
    let intents = audit.iter().filter(|entry| entry["what"] == "command_intent").count();
    assert_eq!((intents, tap.connections()), (2, 1));
}

/// A controller whose program asks camera 0 for a photo and takes a point.
pub async fn asks_for_photos() -> VirtualController {
    let text = "[[step]]\ndo = \"photo\"\nlimit = 30\n[[step]]\ndo = \"take-point\"\nlimit = 30\n\
                [[step]]\ndo = \"output\"\npoint = \"Y010\"\non = true\n\
                [[step]]\ndo = \"wait\"\npoint = \"X010\"\n";
    let program = Program::read("pick", text).unwrap();
    let builder = VirtualController::builder().program(program).unwrap().stands(StartState::Auto);
    builder.start().await.unwrap()
}

#[tokio::test]
async fn a_camera_learns_that_it_is_asked_answers_once_and_its_part_is_taken() {
    let hall = Hall::with(vec![asks_for_photos().await]).await;
    let (_, camera) = hall.camera().await;
    let mut log = hall.robots[0].handle().log_from_start();
    // The controller has not asked yet.
    let taken = json!({ "taken": true });
    assert_eq!(refused(hall.post(&camera, PHOTO, &taken).await), is(409, "not_ready"));
    let mut events = Stream::open(hall.gateway.address(), &camera, "/v1/events", "").await;
    hall.robots[0].handle().operate(&PanelAction::Press(Button::Start)).unwrap();
    let begun = Instant::now();
    loop {
        assert!(begun.elapsed() < PATIENCE);
        let message = events.next().await.unwrap();
        if message.data["event"] == "photo_requested" {
            assert_eq!((&message.data["camera"], &message.data["robot"]), (&json!(0), &json!("press")));
            break;
        }
    }
    assert_eq!(hall.call(&camera, "POST", PHOTO, Some(&taken)).await.0, 204);
    assert_eq!(refused(hall.post(&camera, PHOTO, &taken).await), is(409, "not_ready"), "it has the answer");
    assert_eq!(hall.post(&camera, POINTS, &parts(&[500.0])).await.0, 200);
    while hall.taken() > 0 {
        assert!(begun.elapsed() < PATIENCE, "the program takes the part");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let answers = std::iter::from_fn(|| log.try_recv().ok());
    let answers = answers.filter(|entry| matches!(entry.event, Event::PhotoAnswered { camera: 0, ret: 1 }));
    assert_eq!(answers.count(), 1);
    let entry = hall.until_audited(|entry| entry["what"] == "photo_answer").await;
    assert_eq!((&entry["camera"], &entry["taken"]), (&json!(0), &json!(true)));
    assert_eq!(entry["actor"], "token 5 (belt)");
}

#[tokio::test]
async fn a_photo_from_before_a_stop_is_not_answered_after_it() {
    let hall = Hall::start().await;
    let (_, camera) = hall.camera().await;
    let mut events = Stream::open(hall.gateway.address(), &camera, "/v1/events", "").await;
    hall.robots[0].handle().request_photo(0);
    while events.next().await.unwrap().data["event"] != "photo_requested" {}
    assert_eq!(hall.stop(&hall.operator, "press").await.0, 200);
    let lease = hall.lease(&hall.operator, "press").await;
    let cleared =
        hall.post(&hall.operator, "/v1/robots/press/clear-stopped", &json!({ "lease": lease })).await;
    assert_eq!(cleared.0, 204);
    let failed = json!({ "taken": false });
    assert_eq!(refused(hall.post(&camera, PHOTO, &failed).await), is(409, "not_ready"));
    hall.robots[0].handle().request_photo(0);
    while events.next().await.unwrap().data["event"] != "photo_requested" {}
    assert_eq!(hall.post(&camera, PHOTO, &failed).await.0, 204);
}

#[tokio::test]
async fn a_camera_in_a_loop_is_told_to_wait() {
    let hall = Hall::start().await;
    let (_, camera) = hall.camera().await;
    let mut codes = Vec::new();
    for _ in 0..60 {
        codes.push(hall.post(&camera, POINTS, &parts(&[1.0])).await.0);
    }
    let accepted = codes.iter().filter(|status| **status == 200).count();
    assert!(codes.iter().all(|status| [200, 429].contains(status)), "{codes:?}");
    assert!(accepted >= 20 && codes.contains(&429), "{codes:?}");
    assert_eq!(hall.taken(), accepted);
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_grant_holds_at_each_gateway_and_after_a_takeover() {
    use crate::gateways::{Here, database};
    let Some((_server, url, token)) = database("the test of cameras at two gateways").await else { return };
    let press = VirtualController::start().await.unwrap();
    let robots = [("press", press.address())];
    let one = Here::start(&url, &token, &robots).await;
    one.until_up("press").await;
    let other = Here::start(&url, &token, &robots).await;
    let wanted = json!({ "role": "viewer", "name": "belt" });
    let (status, made) = other.call("POST", "/v1/tokens", Some(&wanted)).await;
    assert_eq!(status, 201, "{made}");
    let number = json!({ "token": made["number"] });
    let camera = made["token"].as_str().unwrap();
    let (status, problem) = other.call("POST", GRANTS, Some(&number)).await;
    assert_eq!(status, 201, "{problem}");
    for gateway in [&one, &other] {
        let body = parts(&[1.0]);
        let sent = call(gateway.gateway.address(), camera, "POST", POINTS, Some(&body)).await;
        assert_eq!(sent.0, 200, "{}", sent.1);
        let (_, grants) = gateway.call("GET", "/v1/robots/press/cameras", None).await;
        assert_eq!(grants["grants"][0]["token_name"], "belt", "{grants}");
    }
    assert_eq!(press.handle().snapshot().points, [(0, 2)]);
    one.gateway.shutdown().await.unwrap();
    other.until_up("press").await;
    let at = other.gateway.address();
    assert_eq!(call(at, camera, "POST", POINTS, Some(&parts(&[2.0]))).await.0, 200);
    let revoke = format!("{GRANTS}/{}", made["number"]);
    assert_eq!(other.call("DELETE", &revoke, None).await.0, 204);
    let answer = call(at, camera, "POST", POINTS, Some(&parts(&[3.0]))).await;
    assert_eq!(refused(answer), is(403, "not_allowed"));
    assert_eq!(press.handle().snapshot().points, [(0, 3)]);
    other.gateway.shutdown().await.unwrap();
}
