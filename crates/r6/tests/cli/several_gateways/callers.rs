//! Callers that lease, command and stop robots through whichever gateway answers, and what they were told.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use serde_json::{Value, json};

use crate::gateway_calls::attempt;

/// How long a caller waits for an answer. A gateway that is frozen gives none: then the caller asks another
/// one.
const PATIENCE: Duration = Duration::from_secs(4);

/// A pause between two rounds of a caller, and before it asks another gateway.
const PAUSE: Duration = Duration::from_millis(150);

/// Where the gateways listen. It changes when one is started again.
pub type Doors = Arc<Mutex<Vec<String>>>;

/// What a caller was told of its robot.
#[derive(Clone, Debug, Default)]
pub struct Told {
    /// The leases that were given out.
    began: Vec<u64>,
    /// Those that were taken back.
    ended: Vec<u64>,
    /// The commands that were accepted: the numbers of their intents.
    accepted: Vec<u64>,
    /// How many stops were confirmed.
    stops: usize,
}

/// A caller of one robot. No other caller changes anything at this robot.
pub struct Caller {
    pub robot: String,
    pub token: String,
    pub doors: Doors,
    pub told: Arc<Mutex<Told>>,
    /// The last lease, for requests that come too late.
    pub lease: Arc<Mutex<Value>>,
    pub gaveup: Arc<AtomicUsize>,
    door: usize,
    /// Whether a stop holds; `None` if the last request about that had no answer.
    stopped: Option<bool>,
    last_lease: u64,
}

impl Caller {
    pub fn new(robot: String, token: String, doors: Doors) -> Self {
        Self {
            robot,
            token,
            doors,
            told: Arc::default(),
            lease: Arc::default(),
            gaveup: Arc::default(),
            door: 0,
            stopped: Some(false),
            last_lease: 0,
        }
    }

    /// Goes on until this is true.
    pub fn run(mut self, end: &AtomicBool) {
        let mut round = 0;
        while !end.load(Ordering::SeqCst) {
            if self.round(round).is_none() {
                self.gaveup.fetch_add(1, Ordering::SeqCst);
            }
            round += 1;
            thread::sleep(PAUSE);
        }
    }

    /// A lease, a command, now and then a stop, and the lease back. `None`: a request had no answer, or no
    /// gateway could carry it out.
    fn round(&mut self, round: u64) -> Option<()> {
        let robot = self.robot.clone();
        let (status, lease) = self.post("lease", &json!({ "duration_ms": 2_000 }))?;
        if status == 409 {
            // The last one was not given back, because there was no answer. Or this one ended before the
            // database had it: another gateway froze in the middle of a write, and that holds up the others
            // for 2 s. Or the robot is just given to another gateway.
            let code = lease["code"].as_str().unwrap();
            assert!(matches!(code, "leased" | "no_lease" | "not_ready"), "{robot}: {lease}");
            return Some(());
        }
        assert_eq!(status, 200, "{robot}: {lease}");
        let number = lease["lease"]["number"].as_u64().unwrap();
        assert!(number > self.last_lease, "{robot}: lease {number} after {}", self.last_lease);
        self.last_lease = number;
        self.told.lock().unwrap().began.push(number);
        if self.stopped.is_some() {
            assert_eq!(lease["stopped"].as_bool(), self.stopped, "{robot}: whether a stop holds");
        }
        let key = json!({ "lease": lease["lease"] });
        *self.lease.lock().unwrap() = key["lease"].clone();
        if lease["stopped"] == true {
            self.stopped = None;
            let (status, answer) = self.post("clear-stopped", &key)?;
            // The lease ended meanwhile, or the robot is just being connected to.
            assert!(matches!(status, 204 | 409), "{robot}: {answer}");
            self.stopped = Some(status != 204);
        } else {
            self.stopped = Some(false);
        }
        let percent = (20 + round % 60).to_string();
        let wanted = json!({ "command": "modifyGSPD", "arguments": [percent], "lease": lease["lease"] });
        let (status, answer) = self.post("commands", &wanted)?;
        assert!(matches!(status, 200 | 409), "{robot}: {answer}");
        if status == 200 {
            self.told.lock().unwrap().accepted.push(answer["command_id"].as_u64().unwrap());
        }
        if round % 2 == 1 {
            self.stopped = None;
            let (status, answer) = self.post("stop", &Value::Null)?;
            assert_eq!(status, 200, "{robot}: {answer}");
            self.stopped = Some(true);
            self.told.lock().unwrap().stops += 1;
        }
        let (status, answer) = self.ask("DELETE", "lease", &key)?;
        match status {
            204 => self.told.lock().unwrap().ended.push(number),
            // It expired.
            _ => assert_eq!(answer["code"], "no_lease", "{robot}: {answer}"),
        }
        Some(())
    }

    fn post(&mut self, what: &str, body: &Value) -> Option<(u16, Value)> {
        self.ask("POST", what, body)
    }

    /// Asks the gateway that answered last. A request is never sent to another one: it may have been done.
    fn ask(&mut self, method: &str, what: &str, body: &Value) -> Option<(u16, Value)> {
        let url = {
            let doors = self.doors.lock().unwrap();
            doors[self.door % doors.len()].clone()
        };
        let path = format!("/v1/robots/{}/{what}", self.robot);
        match attempt(&url, &self.token, method, &path, "", body, PATIENCE) {
            Some((503 | 504, problem)) => {
                let codes = ["no_owner", "store_unavailable", "outcome_unknown", "not_stopped"];
                assert!(codes.contains(&problem["code"].as_str().unwrap()), "{path}: {problem}");
                self.door += 1;
                None
            }
            None => {
                self.door += 1;
                None
            }
            answer => answer,
        }
    }
}

/// What the audit log has of a robot.
#[derive(Debug, Default)]
pub struct Kept {
    began: BTreeSet<u64>,
    ended: BTreeSet<u64>,
    intents: BTreeSet<u64>,
    outcomes: BTreeMap<u64, String>,
    stops: usize,
}

impl Kept {
    /// Takes an entry of this robot.
    pub fn add(&mut self, entry: &Value) {
        let number = |field: &str| entry[field].as_u64().unwrap();
        match entry["what"].as_str().unwrap() {
            "lease_began" => drop(self.began.insert(number("lease"))),
            "lease_ended" => drop(self.ended.insert(number("lease"))),
            "command_intent" => drop(self.intents.insert(number("number"))),
            "command_outcome" => {
                let outcome = entry["outcome"].as_str().unwrap().to_owned();
                let before = self.outcomes.insert(number("intent"), outcome);
                assert_eq!(before, None, "a command has one outcome: {entry}");
            }
            "stop" if entry["confirmed"] == true => self.stops += 1,
            _ => {}
        }
    }

    /// Checks that everything that was told is there.
    pub fn check(&self, robot: &str, told: &Told) {
        let missing = |told: &[u64], kept: &BTreeSet<u64>| -> Vec<u64> {
            told.iter().copied().filter(|number| !kept.contains(number)).collect()
        };
        let none = Vec::<u64>::new();
        assert_eq!(missing(&told.began, &self.began), none, "leases of {robot}");
        assert_eq!(missing(&told.ended, &self.ended), none, "ends of leases of {robot}");
        assert_eq!(missing(&told.accepted, &self.intents), none, "intents of {robot}");
        for command in &told.accepted {
            let outcome = self.outcomes.get(command).map(String::as_str);
            assert_eq!(outcome, Some("accepted"), "{robot}: command {command}");
        }
        assert!(self.stops >= told.stops, "{robot}: {} of {} stops", self.stops, told.stops);
    }

    /// Checks that each command has an outcome, once no command is under way.
    pub fn check_end(&self, robot: &str) {
        let open: Vec<_> = self.intents.iter().filter(|intent| !self.outcomes.contains_key(intent)).collect();
        assert_eq!(open, Vec::<&u64>::new(), "{robot}: commands without an outcome");
    }
}

impl Told {
    /// Leases, commands and stops.
    pub fn counts(&self) -> [usize; 3] {
        [self.began.len(), self.accepted.len(), self.stops]
    }
}
