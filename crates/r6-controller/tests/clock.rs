//! The clock that runs as fast as it can, and the seed: the same input gives the same bytes.

use std::time::Duration;

use r6_controller::{
    ConnectionId, Controller, ControllerSettings, FastClock, Key, Profile, RobotModel, StartState,
};
use r6_proto::time::Instant;
use serde_json::{Value, json};

/// A controller with a clock that only the input drives, and one connection.
struct Fast {
    controller: Controller,
    clock: FastClock,
    id: ConnectionId,
}

impl Fast {
    fn new() -> Self {
        Self::seeded(0)
    }

    fn seeded(seed: u64) -> Self {
        Self::of(ControllerSettings { seed, ..settings() })
    }

    fn of(settings: ControllerSettings) -> Self {
        let mut controller = Controller::new(settings, Instant::ORIGIN);
        let id = controller.connect(Instant::ORIGIN);
        Self { controller, clock: FastClock::new(Instant::ORIGIN), id }
    }

    fn send(&mut self, bytes: impl AsRef<[u8]>) {
        self.clock.handle_input(&mut self.controller, self.id, bytes.as_ref());
    }

    /// All frames that can be sent now.
    fn frames(&mut self) -> Vec<String> {
        let mut frames = Vec::new();
        while let Some(frame) = self.controller.poll_transmit(self.clock.now(), self.id) {
            frames.push(String::from_utf8(frame.to_vec()).unwrap());
        }
        frames
    }

    fn value(&mut self, address: &str) -> String {
        self.send(query(address));
        let frames = self.frames();
        let reply: Value = serde_json::from_str(frames.last().expect("a reply")).unwrap();
        reply["queryData"][0].as_str().expect("a value").to_owned()
    }

    fn seconds(&self) -> f64 {
        self.clock.now().as_secs_f64()
    }
}

fn settings() -> ControllerSettings {
    ControllerSettings::new(Profile::hc1(), RobotModel::default())
}

fn query(address: &str) -> String {
    json!({"dsID": "www.hc-system.com.RemoteMonitor", "reqType": "query", "queryAddr": [address]}).to_string()
}

fn command(words: &[&str]) -> String {
    json!({"dsID": "www.hc-system.com.RemoteMonitor", "reqType": "command", "cmdData": words}).to_string()
}

fn add_rcc(instructions: &Value) -> String {
    json!({
        "dsID": "www.hc-system.com.HCRemoteCommand", "reqType": "AddRCC", "emptyList": "1",
        "instructions": instructions,
    })
    .to_string()
}

fn axis_move(oneshot: &str, j1: f64) -> Value {
    json!({
        "oneshot": oneshot, "action": "4", "m0": j1.to_string(), "m1": "0", "m2": "0", "m3": "0", "m4": "0",
        "m5": "0", "ckStatus": "0x3F", "speed": "10", "delay": "0", "smooth": "0",
    })
}

fn wait_for_input(limit: &str) -> Value {
    json!({
        "oneshot": "1", "action": "100", "type": "0", "point": "3", "io_status": "1", "limit": limit, "isUnlimit": "0",
    })
}

/// A conversation with every kind of frame.
fn conversation() -> Vec<String> {
    vec![
        query("curMode"),
        add_rcc(&json!([axis_move("1", 30.0), axis_move("1", -30.0)])),
        query("axis-0"),
        "{\"reqType\":\"heartbreak\"}".to_owned(),
        command(&["rewriteDataList", "800", "2", "1", "5000", "6000"]),
        add_rcc(&json!([axis_move("0", 10.0), axis_move("0", 0.0)])),
        query("lastCycle"),
        query("axis-0"),
        command(&["actionStop"]),
        command(&["actoinStop"]),
        query("curAlarm"),
        command(&["startButton"]),
        query("curCycle"),
    ]
}

#[test]
fn a_move_is_seen_to_begin_and_has_ended_at_the_second_look() {
    let mut cell = Fast::new();
    cell.send(add_rcc(&json!([axis_move("1", 90.0)])));
    let frames = cell.frames();
    assert_eq!(frames.len(), 1);
    assert!(frames[0].contains(r#"["AddRCC","ok"]"#), "{}", frames[0]);
    assert!(cell.seconds() < 0.1, "{}", cell.seconds());
    assert_eq!(cell.value("isMoving"), "1");
    // 90 degrees at a tenth of 220.8 degrees a second.
    assert!(cell.seconds() > 4.0, "{}", cell.seconds());
    assert_eq!(cell.value("axis-0"), "90.000000");
    assert_eq!(cell.value("isMoving"), "0");
}

#[test]
fn a_list_is_seen_to_get_shorter() {
    let mut cell = Fast::new();
    let list: Vec<_> = (1..=8).map(|n| axis_move("1", f64::from(n))).collect();
    cell.send(add_rcc(&json!(list)));
    cell.frames();
    let lengths: Vec<_> = (0..6).map(|_| cell.value("RemoteCmdLen")).collect();
    assert_eq!(lengths, ["8", "5", "3", "2", "1", "0"]);
}

#[test]
fn time_stands_while_nobody_says_anything_and_nothing_is_under_way() {
    let mut cell = Fast::new();
    cell.send(query("curMode"));
    assert_eq!(cell.clock.now(), Instant::ORIGIN);
    assert_eq!(cell.clock.pause(&cell.controller), None);
}

#[test]
fn pieces_and_bursts_give_the_same_bytes() {
    let whole = conversation().concat();
    let mut bytes_of = Vec::new();
    for size in [whole.len(), 1, 7, 100] {
        let mut cell = Fast::seeded(3);
        for piece in whole.as_bytes().chunks(size) {
            cell.send(piece);
        }
        let frames = cell.frames();
        assert_eq!(frames.len(), conversation().len() - 1, "a heartbreak is not answered");
        bytes_of.push((frames.concat(), cell.clock.now()));
    }
    // One frame at a time, each answered before the next.
    let mut cell = Fast::seeded(3);
    let mut answered = String::new();
    for frame in conversation() {
        cell.send(frame);
        answered.push_str(&cell.frames().concat());
    }
    bytes_of.push((answered, cell.clock.now()));
    for other in &bytes_of {
        assert_eq!(other, &bytes_of[0]);
    }
}

#[test]
fn the_seed_says_how_long_an_acknowledgement_takes() {
    let acknowledged = |seed: u64| {
        let mut controller = Controller::new(ControllerSettings { seed, ..settings() }, Instant::ORIGIN);
        let id = controller.connect(Instant::ORIGIN);
        let mut times = Vec::new();
        for n in 0..50 {
            let sent = Instant::ORIGIN + Duration::from_secs(n);
            controller.handle_input(sent, id, add_rcc(&json!([])).as_bytes());
            let due = controller.next_transmit(id).unwrap();
            assert!(controller.poll_transmit(due, id).is_some());
            times.push(due.since(sent));
        }
        times
    };
    let times = acknowledged(1);
    assert_eq!(times, acknowledged(1));
    assert_ne!(times, acknowledged(2));
    let (low, high) = (Duration::from_millis(16), Duration::from_millis(20));
    assert!(times.iter().all(|time| (low..=high).contains(time)), "{times:?}");
    assert!(times.iter().max() > times.iter().min(), "{times:?}");
}

#[test]
fn acknowledgements_leave_in_the_order_of_their_requests() {
    for seed in 0..20 {
        let mut controller = Controller::new(ControllerSettings { seed, ..settings() }, Instant::ORIGIN);
        let id = controller.connect(Instant::ORIGIN);
        for n in 0..10 {
            let request =
                format!(r#"{{"reqType":"AddRCC","packID":"{n}","emptyList":"1","instructions":[]}}"#);
            controller.handle_input(Instant::ORIGIN, id, request.as_bytes());
        }
        let later = Instant::ORIGIN + Duration::from_millis(20);
        for n in 0..10 {
            let frame = String::from_utf8(controller.poll_transmit(later, id).unwrap().to_vec()).unwrap();
            assert!(frame.contains(&format!(r#""packID":"{n}""#)), "seed {seed}: {frame}");
        }
    }
}

#[test]
fn a_list_that_never_ends_makes_one_pass_for_each_frame() {
    let mut cell = Fast::new();
    cell.send(add_rcc(&json!([axis_move("0", 10.0), axis_move("0", 0.0)])));
    assert_eq!(cell.frames().len(), 1);
    cell.send(query("curMode"));
    let first = cell.seconds();
    cell.send(query("curMode"));
    let second = cell.seconds();
    let pass: f64 = cell.value("lastCycle").parse().unwrap();
    assert!((second - first - pass).abs() < 1e-3, "{first} {second} {pass}");
    // Without input it makes one more cycle after a while.
    let before = cell.seconds();
    assert_eq!(cell.clock.pause(&cell.controller), Some(Duration::from_secs(1)));
    cell.clock.go_on(&mut cell.controller);
    assert!((cell.seconds() - before - pass).abs() < 1e-3);
}

#[test]
fn a_list_whose_steps_take_no_time_does_not_spin() {
    let bench = json!({"oneshot": "0", "action": "800", "cnt_id": "1"});
    let mut cell = Fast::new();
    cell.send(add_rcc(&json!([bench])));
    assert_eq!(cell.frames().len(), 1);
    let before = cell.seconds();
    cell.send(query("curMode"));
    assert!(cell.seconds() - before <= 0.002, "{}", cell.seconds() - before);
}

#[test]
fn a_pushed_photo_gives_its_receiver_the_word() {
    let mut cell = Fast::new();
    cell.send(command(&["switchMold", "register-move"]));
    cell.send(command(&["rewriteDataList", "800", "6", "0", "9000", "0", "0", "0", "0", "0"]));
    cell.send(command(&["modifyOutput", "4", "1", "1"]));
    let frames = cell.frames();
    assert!(frames[3].contains("\"photo\""), "{frames:?}");
    assert_eq!(cell.value("axis-0"), "9.000000");
    assert_eq!(cell.clock.pause(&cell.controller), None);
}

#[test]
fn a_jump_takes_no_time_from_others() {
    let mut cell = Fast::new();
    cell.send(r#"{"reqType":"heartbreak"}"#);
    // A minute of moves; a heartbreak is due every ten seconds.
    let list: Vec<_> = (0..8).map(|n| axis_move("1", if n % 2 == 0 { 90.0 } else { -90.0 })).collect();
    cell.send(r#"{"reqType":"que"#);
    let other = cell.controller.connect(cell.clock.now());
    cell.clock.handle_input(&mut cell.controller, other, add_rcc(&json!(list)).as_bytes());
    // Each query sees two thirds of what was left.
    for _ in 0..6 {
        cell.clock.handle_input(&mut cell.controller, other, query("isMoving").as_bytes());
    }
    assert!(cell.seconds() > 40.0, "{}", cell.seconds());
    assert_eq!(cell.controller.snapshot(cell.clock.now()).alarm, 0);
    // The incomplete frame is still understood, and silence is measured in real time.
    cell.send(r#"ry","queryAddr":["curMode"]}"#);
    assert!(cell.frames()[0].contains("curMode"));
    let before = cell.seconds();
    let pause = cell.clock.pause(&cell.controller).unwrap();
    assert_eq!(pause, Duration::from_secs(10));
    cell.clock.go_on(&mut cell.controller);
    assert!((cell.seconds() - before - 10.0).abs() < 1e-6);
    assert_eq!(cell.controller.snapshot(cell.clock.now()).alarm, 9);
}

#[test]
fn a_signal_may_take_as_long_as_its_limit_in_real_time() {
    let mut cell = Fast::new();
    cell.send(add_rcc(&json!([wait_for_input("5"), axis_move("1", 20.0)])));
    assert_eq!(cell.frames().len(), 1);
    assert!(cell.seconds() < 0.021, "{}", cell.seconds());
    for _ in 0..10 {
        assert_eq!(cell.value("curAlarm"), "0", "asking is no signal, and takes no time");
    }
    let mut late = Fast { controller: cell.controller, clock: cell.clock, id: cell.id };
    let limit = late.clock.pause(&late.controller).unwrap().as_secs_f64();
    late.clock.act(&mut late.controller, |controller, now| controller.set_input(now, 0, 3, true));
    assert_eq!(late.value("axis-0"), "20.000000");

    let mut never = Fast::new();
    never.send(add_rcc(&json!([wait_for_input("5"), axis_move("1", 20.0)])));
    never.clock.go_on(&mut never.controller);
    assert_eq!(never.value("curAlarm"), (2048 + 3).to_string());
    assert!(limit <= 5.0 && limit > 0.4, "{limit}");
}

#[test]
fn a_key_that_is_turned_lets_time_go_on() {
    let mut cell = Fast::of(ControllerSettings { start: StartState::Waiting, ..settings() });
    cell.send(add_rcc(&json!([axis_move("0", 10.0), axis_move("0", 0.0)])));
    cell.clock.act(&mut cell.controller, |controller, now| controller.turn_key(now, Key::Manual));
    assert_eq!(cell.clock.pause(&cell.controller), None);
    assert_eq!(cell.value("curMode"), "1");
}
