//! A controller on a virtual clock, with one connection.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::time::Duration;

use r6_controller::{
    ConnectionId, Controller, ControllerSettings, Profile, RobotModel, SavedState, StartState,
};
use r6_proto::time::Instant;
use serde_json::{Value, json};

pub struct Cell {
    pub controller: Controller,
    pub now: Instant,
    pub id: ConnectionId,
}

impl Cell {
    pub fn new() -> Self {
        Self::with_profile("hc1")
    }

    pub fn with_profile(name: &str) -> Self {
        Self::with(Profile::named(name).unwrap(), StartState::Waiting)
    }

    pub fn with(profile: Profile, start: StartState) -> Self {
        let model = RobotModel::named("BRTIRUS0707A").unwrap().clone();
        Self::of(ControllerSettings { start, ..ControllerSettings::new(profile, model) })
    }

    /// A cell on which AddRCC takes exactly the time of the profile; `clock.rs` tests how that time varies.
    pub fn of(settings: ControllerSettings) -> Self {
        Self::around(Controller::new(even(settings), Instant::ORIGIN))
    }

    /// The same after a power cut that left this state.
    pub fn restored(settings: ControllerSettings, saved: &SavedState) -> Self {
        Self::around(Controller::restored(even(settings), saved, Instant::ORIGIN))
    }

    fn around(mut controller: Controller) -> Self {
        let now = Instant::ORIGIN;
        let id = controller.connect(now);
        Self { controller, now, id }
    }

    /// Lets time pass from deadline to deadline, as a shell does.
    pub fn pass(&mut self, seconds: f64) {
        let end = self.now + Duration::from_secs_f64(seconds);
        while let Some(due) = self.controller.poll_timeout().filter(|due| *due <= end) {
            self.now = self.now.max(due);
            self.controller.handle_timeout(self.now);
        }
        self.now = end;
        self.controller.handle_timeout(end);
    }

    pub fn send(&mut self, bytes: impl AsRef<[u8]>) {
        self.controller.handle_input(self.now, self.id, bytes.as_ref());
    }

    /// The next frame that can be sent now.
    pub fn frame(&mut self) -> Option<String> {
        let frame = self.controller.poll_transmit(self.now, self.id)?;
        // A client's bytes that are not UTF-8 are echoed unchanged.
        Some(String::from_utf8_lossy(frame).into_owned())
    }

    /// Sends a frame and returns the reply, which has to come at once.
    pub fn ask(&mut self, bytes: impl AsRef<[u8]>) -> String {
        self.send(bytes);
        let reply = self.frame().expect("a reply");
        assert_eq!(self.frame(), None, "one request, one reply");
        reply
    }

    /// Sends a query and returns its values.
    pub fn query(&mut self, addresses: &[&str]) -> Vec<Value> {
        let request =
            json!({"dsID": "www.hc-system.com.RemoteMonitor", "reqType": "query", "queryAddr": addresses});
        let reply: Value = serde_json::from_str(&self.ask(request.to_string())).unwrap();
        reply["queryData"].as_array().unwrap().clone()
    }

    /// The single value of one address.
    pub fn value(&mut self, address: &str) -> Value {
        let mut values = self.query(&[address]);
        assert_eq!(values.len(), 1, "{address}");
        values.remove(0)
    }

    /// The single value of one address as text.
    pub fn text(&mut self, address: &str) -> String {
        self.value(address).as_str().unwrap_or_else(|| panic!("{address} is no text")).to_owned()
    }

    pub fn number(&mut self, address: &str) -> f64 {
        self.text(address).parse().unwrap()
    }

    pub fn axes(&mut self) -> [f64; 6] {
        std::array::from_fn(|axis| self.number(&format!("axis-{axis}")))
    }

    pub fn world(&mut self) -> [f64; 6] {
        std::array::from_fn(|component| self.number(&format!("world-{component}")))
    }

    /// Sends a command and returns the words of the reply.
    pub fn command(&mut self, words: &[&str]) -> Vec<String> {
        let request =
            json!({"dsID": "www.hc-system.com.RemoteMonitor", "reqType": "command", "cmdData": words});
        let reply: Value = serde_json::from_str(&self.ask(request.to_string())).unwrap();
        reply["cmdReply"].as_array().unwrap().iter().map(|word| word.as_str().unwrap().to_owned()).collect()
    }

    /// Sends a command that has to be answered ok.
    pub fn ok(&mut self, words: &[&str]) {
        assert_eq!(self.command(words), [words[0], "ok"]);
    }

    /// Sends a list of instructions; `frame` returns the reply.
    pub fn add_rcc(&mut self, empty_list: &str, instructions: &Value) {
        let request = json!({
            "dsID": "www.hc-system.com.HCRemoteCommand", "reqType": "AddRCC", "emptyList": empty_list,
            "instructions": instructions,
        });
        self.send(request.to_string());
    }

    /// Replaces the list, waits for the acknowledgement and returns its verdict.
    pub fn run(&mut self, instructions: &Value) -> Vec<String> {
        self.add_rcc("1", instructions);
        self.pass(0.018);
        let reply: Value = serde_json::from_str(&self.frame().expect("a reply to AddRCC")).unwrap();
        reply["cmdReply"].as_array().unwrap().iter().map(|word| word.as_str().unwrap().to_owned()).collect()
    }

    pub fn run_ok(&mut self, instructions: &Value) {
        assert_eq!(self.run(instructions), ["AddRCC", "ok"]);
    }

    /// Appends to the list and waits for the acknowledgement.
    pub fn append_ok(&mut self, instructions: &Value) {
        self.add_rcc("0", instructions);
        self.pass(0.018);
        let reply = self.frame().expect("a reply to AddRCC");
        assert!(reply.contains(r#""cmdReply":["AddRCC","ok"]"#), "{reply}");
    }

    /// Every log line so far.
    pub fn log(&mut self) -> String {
        let mut log = String::new();
        while let Some(line) = self.controller.poll_log() {
            log.push_str(&line.to_string());
            log.push('\n');
        }
        log
    }
}

fn even(mut settings: ControllerSettings) -> ControllerSettings {
    settings.profile.add_rcc_ack_spread = Duration::ZERO;
    settings
}

/// Commands that stop, start, or change what runs, for tests that send them in any order.
pub const STOPS_AND_STARTS: [&[&str]; 10] = [
    &["actionStop"],
    &["actionPause"],
    &["actionSingleCycle"],
    &["startButton"],
    &["stopButton"],
    &["clearAlarm"],
    &["clearAlarmRunNext"],
    &["clearAlarmContinue"],
    &["modifyGSPD", "0"],
    &["modifyGSPD", "700"],
];

/// A one-shot axis move.
pub fn axis_move(axes: [f64; 6], speed: f64) -> Value {
    move_of("4", axes, speed)
}

/// A one-shot linear move.
pub fn linear_move(pose: [f64; 6], speed: f64) -> Value {
    move_of("10", pose, speed)
}

fn move_of(action: &str, target: [f64; 6], speed: f64) -> Value {
    let mut step = json!({"oneshot": "1", "action": action, "ckStatus": "0x3F", "speed": speed.to_string(), "delay": "0", "smooth": "0"});
    for (n, value) in target.into_iter().enumerate() {
        step[format!("m{n}")] = json!(format!("{value:.6}"));
    }
    step
}

#[track_caller]
pub fn assert_near(found: [f64; 6], wanted: [f64; 6], tolerance: f64) {
    for (found_one, wanted_one) in found.into_iter().zip(wanted) {
        assert!((found_one - wanted_one).abs() <= tolerance, "found {found:?}, wanted {wanted:?}");
    }
}
