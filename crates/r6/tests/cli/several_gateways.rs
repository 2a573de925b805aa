//! Three gateways on one database are killed and frozen at random, while callers lease, command and stop.
//!
//! No controller accepts a command, a list or a stop of a gateway after another one became its owner; the
//! controllers tell what they accepted, and a trigger in the database when each owner of each robot began.
//! What was acknowledged is in the audit log, the log is whole, and the robots are readable again in time.
//! `R6_KILLS` says how often, and makes it a hall of 60 robots; `R6_ROBOTS` and `R6_SEED` say how many
//! robots, and which random numbers.

mod callers;
mod robots;

use std::collections::{BTreeMap, BTreeSet};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use r6_api::gateway::Role;
use r6_gateway::{At, Database};
use r6_testkit::postgres::{Server, shared};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::gateway_calls::{answer, attempt, begin_call, gateway};
use crate::support::{Running, r6};
use callers::{Caller, Doors, Kept, Told};
use robots::{Connection, Frame, Process, Processes, Robots};

/// How often one is killed or frozen, and how many robots there are, if nothing else is said.
const USUAL: (u64, usize) = (4, 6);

/// The robots of the whole trial.
const HALL: usize = 60;

/// How many gateways there are.
const GATEWAYS: usize = 3;

/// Within this time after a gateway was killed or frozen, each robot can be read again.
const READABLE: Duration = Duration::from_secs(5);

/// The same in `make test`, where other tests need the processors too.
const READABLE_WHEN_BUSY: Duration = Duration::from_secs(12);

/// How long one answer may take.
const ONE_ANSWER: Duration = Duration::from_secs(2);

/// How long a look at one robot may take. The gateway that is asked may wait for a frozen gateway.
const ONE_LOOK: Duration = Duration::from_millis(500);

/// How long something else may take.
const PATIENCE: Duration = Duration::from_secs(60);

/// Tells when each owner began.
const TRIGGER: &str = "
CREATE TABLE r6_gateway.began (robot text, fence bigint, gateway text, at double precision);
CREATE FUNCTION r6_gateway.begins() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN
    INSERT INTO r6_gateway.began SELECT NEW.robot, NEW.fence, name, extract(epoch FROM clock_timestamp())
    FROM r6_gateway.gateway WHERE id = NEW.gateway;
    RETURN NEW;
END $$;
CREATE TRIGGER begins AFTER UPDATE ON r6_gateway.owner FOR EACH ROW WHEN (NEW.fence <> OLD.fence)
    EXECUTE FUNCTION r6_gateway.begins();";

/// What happens to a gateway.
#[derive(Clone, Copy, Debug)]
enum Blow {
    Kill,
    /// It is frozen for this time.
    Freeze(Duration),
}

/// A gateway with a folder of its own.
struct Gateway {
    data: TempDir,
    running: Option<Running>,
}

/// An owner of a robot.
#[derive(Clone, Debug)]
struct Began {
    robot: String,
    fence: u64,
    gateway: String,
    at: SystemTime,
}

/// The gateways, their database and their robots.
struct Hall {
    server: Server,
    url: String,
    admin: String,
    config: tempfile::NamedTempFile,
    names: Vec<String>,
    robots: Robots,
    processes: Processes,
    gateways: Vec<Gateway>,
    doors: Doors,
    began: Vec<Began>,
    /// The last entry of the audit log that was looked at.
    seen: u64,
    kept: BTreeMap<String, Kept>,
    /// The keys of the gateways that signed heads of the log.
    keys: BTreeSet<String>,
    frames: usize,
}

impl Hall {
    fn start(server: Server, robots: usize) -> Self {
        let url = server.database();
        let admin = token(&url, "test");
        server.sql(&url, TRIGGER);
        let processes = Processes::default();
        let robots = Robots::start(robots, &processes);
        let names: Vec<_> = (1..=robots.addresses.len()).map(|number| format!("press-{number}")).collect();
        let config = tempfile::NamedTempFile::new().unwrap();
        let of = |(name, address)| format!("[[robot]]\nname = \"{name}\"\naddress = \"{address}\"\n");
        std::fs::write(config.path(), names.iter().zip(&robots.addresses).map(of).collect::<String>())
            .unwrap();
        let gateways = (0..GATEWAYS).map(|_| Gateway { data: tempfile::tempdir().unwrap(), running: None });
        let mut hall = Self {
            server,
            url,
            admin,
            config,
            kept: names.iter().map(|name| (name.clone(), Kept::default())).collect(),
            names,
            robots,
            processes,
            gateways: gateways.collect(),
            doors: Arc::new(Mutex::new(vec![String::new(); GATEWAYS])),
            began: Vec::new(),
            seen: 0,
            keys: BTreeSet::new(),
            frames: 0,
        };
        (0..GATEWAYS).for_each(|number| hall.start_gateway(number));
        hall
    }

    fn start_gateway(&mut self, number: usize) {
        let data = self.gateways[number].data.path().display().to_string();
        let config = self.config.path().display().to_string();
        let (running, url) = gateway(&data, &["--store", &self.url, "--config", &config]);
        self.processes.lock().unwrap().push(Process { pid: running.pid(), url: url.clone() });
        self.doors.lock().unwrap()[number] = url;
        self.gateways[number].running = Some(running);
    }

    fn door(&self, number: usize) -> String {
        self.doors.lock().unwrap()[number].clone()
    }

    /// Reads the owners so far.
    fn read_owners(&mut self) {
        let select =
            "SELECT robot, fence, gateway, at FROM r6_gateway.began WHERE robot <> '' ORDER BY robot, fence";
        let rows = self.server.sql(&self.url, select);
        self.began = rows
            .lines()
            .map(|row| {
                let words: Vec<_> = row.split('|').collect();
                let at = UNIX_EPOCH + Duration::from_secs_f64(words[3].parse().unwrap());
                let (robot, gateway) = (words[0].to_owned(), words[2].to_owned());
                Began { robot, fence: words[1].parse().unwrap(), gateway, at }
            })
            .collect();
    }

    /// Which gateway had this robot last.
    fn owner(&self, robot: &str) -> Option<usize> {
        let last = self.began.iter().rfind(|began| began.robot == robot)?;
        self.doors.lock().unwrap().iter().position(|door| *door == last.gateway)
    }

    /// Kills or freezes a gateway. Returns how long it took until each robot was readable again.
    fn strike(
        &mut self,
        victim: usize,
        blow: Blow,
        lease: &dyn Fn() -> (String, String, Value),
    ) -> Vec<Duration> {
        let struck = Instant::now();
        match blow {
            Blow::Kill => self.gateways[victim].running.take().unwrap().kill(),
            Blow::Freeze(_) => self.gateways[victim].running.as_ref().unwrap().signal("STOP"),
        }
        let mut is_away = true;
        let mut times: BTreeMap<&String, Duration> = BTreeMap::new();
        let mut late = Vec::new();
        while times.len() < self.names.len() || (is_away && matches!(blow, Blow::Freeze(_))) {
            if let Blow::Freeze(time) = blow
                && is_away
                && struck.elapsed() >= time
            {
                // Requests wait for it when it goes on.
                late = self.send_late(victim, lease);
                self.gateways[victim].running.as_ref().unwrap().signal("CONT");
                is_away = false;
            }
            for number in (0..GATEWAYS).filter(|number| !is_away || *number != victim) {
                self.look(number, struck, &mut times);
            }
            assert!(struck.elapsed() < PATIENCE, "{blow:?}: readable again: {times:?}");
            thread::sleep(Duration::from_millis(50));
        }
        let times = times.into_values().collect();
        for mut stream in late {
            stream.set_read_timeout(Some(PATIENCE)).unwrap();
            // What it answers is checked by the frames, which may be those of an owner that still is one.
            answer(&mut stream);
        }
        if matches!(blow, Blow::Kill) {
            self.start_gateway(victim);
        }
        times
    }

    /// Notes the robots that this gateway can read, with values asked for after the blow.
    fn look<'h>(&'h self, number: usize, struck: Instant, times: &mut BTreeMap<&'h String, Duration>) {
        let Some(list) = self.get_of(number, "/v1/robots") else { return };
        for robot in list["robots"].as_array().unwrap() {
            let name = self.names.iter().find(|name| robot["name"] == **name).unwrap();
            if robot["link"] != "up" || times.contains_key(name) {
                continue;
            }
            let path = format!("/v1/robots/{name}");
            let Some(state) = self.get_within(number, &path, ONE_LOOK) else { return };
            let since = struck.elapsed();
            let is_new = |signal: &Value| {
                signal["quality"] == "fresh"
                    && signal["age_ms"].as_u64().is_some_and(|age| Duration::from_millis(age) < since)
            };
            if state["signals"].as_array().unwrap().iter().any(is_new) {
                times.insert(name, since);
            }
        }
    }

    fn send_late(&self, victim: usize, lease: &dyn Fn() -> (String, String, Value)) -> Vec<TcpStream> {
        let one = |_| {
            let (robot, token, lease) = lease();
            let body = json!({ "command": "modifyGSPD", "arguments": ["5"], "lease": lease });
            let path = format!("/v1/robots/{robot}/commands");
            begin_call(&self.door(victim), &token, "POST", &path, "", &body)
        };
        (0..8).filter_map(one).collect()
    }

    /// Checks that no frame came from a gateway that was not the owner any more.
    fn check_frames(&mut self) {
        let frames = self.robots.frames();
        self.read_owners();
        for (robot, frame) in &frames {
            let name = &self.names[*robot];
            let began: Vec<_> = self.began.iter().filter(|began| began.robot == *name).collect();
            let term =
                term(&began, &frame.connection).unwrap_or_else(|| panic!("{name}: {frame:?}: no owner"));
            let later = began.iter().find(|began| began.fence > term.fence && began.at <= frame.at);
            if let Some(later) = later {
                panic!("{name} accepted under an old fence: {}", told(frame, term, later));
            }
        }
        self.frames += frames.len();
    }

    /// Checks that everything that the callers were told is in the audit log.
    fn check_log(&mut self, told: &[(String, Told)]) {
        loop {
            let page = self.get(&format!("/v1/audit?after={}&limit=1000", self.seen));
            for entry in page["entries"].as_array().unwrap() {
                let number = entry["number"].as_u64().unwrap();
                assert_eq!(number, self.seen + 1, "no entry is missing");
                self.seen = number;
                if entry["what"] == "audit_key" {
                    self.keys.insert(entry["key"].as_str().unwrap().to_owned());
                }
                let kept = entry["robot"].as_str().and_then(|robot| self.kept.get_mut(robot));
                if let Some(kept) = kept {
                    kept.add(entry);
                }
            }
            if page["next_after"].is_null() {
                break;
            }
        }
        for (robot, told) in told {
            self.kept[robot].check(robot, told);
        }
    }

    /// What one of the gateways answers.
    fn get(&self, path: &str) -> Value {
        until(path, || (0..GATEWAYS).find_map(|number| self.get_of(number, path)))
    }

    /// What this gateway answers; `None` if it has too many callers, or does not answer this at the moment.
    fn get_of(&self, number: usize, path: &str) -> Option<Value> {
        self.get_within(number, path, ONE_ANSWER)
    }

    fn get_within(&self, number: usize, path: &str, time: Duration) -> Option<Value> {
        let answer = attempt(&self.door(number), &self.admin, "GET", path, "", &Value::Null, time);
        answer.and_then(|(status, body)| (status == 200).then_some(body))
    }

    fn verify(&self) {
        let mut args = vec!["gateway", "verify", "--store", &self.url, "--json"];
        args.extend(self.keys.iter().flat_map(|key| ["--key", key.as_str()]));
        let verified = r6(&args);
        assert_eq!(verified.code, 0, "{verified:?}");
        assert_eq!(verified.json()["whole"], true, "{verified:?}");
    }
}

/// The owner that opened this connection, of those that the robot had.
fn term<'b>(began: &[&'b Began], connection: &Connection) -> Option<&'b Began> {
    let mut before = began.iter().rev().filter(|began| began.at <= connection.opened);
    let one = match &connection.gateway {
        Some(gateway) => before.find(|began| began.gateway == *gateway),
        None => before.next(),
    };
    one.copied()
}

fn told(frame: &Frame, term: &Began, later: &Began) -> String {
    let after = frame.at.duration_since(later.at).unwrap();
    format!("{after:?} after {later:?}: {} of {term:?}, over {:?}", frame.what, frame.connection)
}

fn token(url: &str, name: &str) -> String {
    let at = At::Database(Database::parse(url).unwrap());
    r6_gateway::make_token(at, Role::Admin, None, name.to_owned()).unwrap().1
}

/// A number from the environment.
fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().unwrap_or_else(|_| panic!("{name}={text}")))
}

/// Random numbers below a bound.
struct Dice(u64);

impl Dice {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % bound
    }
}

#[test]
fn no_gateway_of_three_acts_after_another_owns_the_robots_and_nothing_is_lost() {
    let Some(server) = shared("the trial of three gateways") else { return };
    let kills = number("R6_KILLS");
    let robots = number("R6_ROBOTS")
        .map_or(if kills.is_some() { HALL } else { USUAL.1 }, |robots| usize::try_from(robots).unwrap());
    let limit = if kills.is_some() { READABLE } else { READABLE_WHEN_BUSY };
    let kills = kills.unwrap_or(USUAL.0);
    let mut dice = Dice(number("R6_SEED").unwrap_or(0x2545_F491));
    let mut hall = Hall::start(server, robots);
    let end = AtomicBool::new(false);
    let make = |name: &String| Caller::new(name.clone(), token(&hall.url, name), Arc::clone(&hall.doors));
    let callers: Vec<_> = hall.names.iter().map(make).collect();
    let told: Vec<_> =
        callers.iter().map(|caller| (caller.robot.clone(), Arc::clone(&caller.told))).collect();
    let leases: Vec<_> = callers
        .iter()
        .map(|caller| (caller.robot.clone(), caller.token.clone(), Arc::clone(&caller.lease)))
        .collect();
    let gaveup: Vec<_> = callers.iter().map(|caller| Arc::clone(&caller.gaveup)).collect();
    let now = |told: &[(String, Arc<Mutex<Told>>)]| -> Vec<(String, Told)> {
        told.iter().map(|(robot, told)| (robot.clone(), told.lock().unwrap().clone())).collect()
    };
    let mut report = Report::default();
    thread::scope(|scope| {
        for caller in callers {
            let end = &end;
            scope.spawn(move || caller.run(end));
        }
        // The callers end too if a check fails.
        let ends = Ends(&end);
        let next = std::cell::Cell::new(0);
        let lease = || {
            next.set((next.get() + 1) % leases.len());
            let (robot, token, lease) = &leases[next.get()];
            (robot.clone(), token.clone(), lease.lock().unwrap().clone())
        };
        for kill in 0..kills {
            let robot = hall.names[usize::try_from(dice.below(robots as u64)).unwrap()].clone();
            let owner = until("there is an owner", || {
                hall.read_owners();
                hall.owner(&robot)
            });
            thread::sleep(Duration::from_millis(300 + dice.below(1_200)));
            // Every second time it is an owner for sure, and the other times any of them.
            let victim =
                if kill % 2 == 0 { owner } else { usize::try_from(dice.below(GATEWAYS as u64)).unwrap() };
            let blow = match dice.below(4) {
                0 | 1 if kill > 1 => Blow::Kill,
                2 if kill > 1 => Blow::Freeze(Duration::from_millis(500 + dice.below(3_000))),
                _ if kill == 0 => Blow::Kill,
                _ => Blow::Freeze(Duration::from_millis(3_500 + dice.below(3_000))),
            };
            hall.read_owners();
            let is_owner = |name: &&String| hall.owner(name) == Some(victim);
            let had: Vec<_> = hall.names.iter().filter(is_owner).cloned().collect();
            let was_owner = !had.is_empty();
            let struck = SystemTime::now();
            let times = hall.strike(victim, blow, &lease);
            hall.read_owners();
            let since = |began: &Began| began.at.duration_since(struck).ok();
            let taken = hall.began.iter().filter(|began| had.contains(&began.robot)).filter_map(since).min();
            report.add((kill, was_owner, blow), taken, &times);
            hall.check_frames();
            hall.check_log(&now(&told));
            let longest = times.iter().max().unwrap();
            assert!(*longest < limit, "{blow:?} of gateway {victim}, which had {had:?}: {times:?}");
        }
        drop(ends);
    });
    hall.check_frames();
    let told = now(&told);
    hall.check_log(&told);
    hall.kept.iter().for_each(|(robot, kept)| kept.check_end(robot));
    hall.verify();
    let counts = told.iter().fold([0; 3], |sum: [usize; 3], (_, told)| {
        let of = told.counts();
        [sum[0] + of[0], sum[1] + of[1], sum[2] + of[2]]
    });
    assert!(counts.iter().all(|count| *count > 0), "leases, commands, stops: {counts:?}");
    let gaveup: usize = gaveup.iter().map(|count| count.load(Ordering::SeqCst)).sum();
    println!(
        "{robots} robots; told and kept: {counts:?} leases, commands, stops; {gaveup} rounds without an answer; \
         {} frames, {} owners, {} entries; {report}",
        hall.frames,
        hall.began.len(),
        hall.seen
    );
}

/// Ends the callers.
struct Ends<'e>(&'e AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::SeqCst);
    }
}

fn until<T>(what: &str, mut done: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(done) = done() {
            return done;
        }
        assert!(begun.elapsed() < PATIENCE, "{what}");
        thread::sleep(Duration::from_millis(20));
    }
}

/// How long robots were away, by what happened.
#[derive(Debug, Default)]
struct Report(BTreeMap<&'static str, Vec<Duration>>);

impl Report {
    /// `taken`: when another gateway became the owner.
    fn add(
        &mut self,
        (kill, was_owner, blow): (u64, bool, Blow),
        taken: Option<Duration>,
        times: &[Duration],
    ) {
        let what = match (blow, was_owner) {
            (Blow::Kill, true) => "owner killed",
            (Blow::Kill, false) => "another killed",
            (Blow::Freeze(_), true) => "owner frozen",
            (Blow::Freeze(_), false) => "another frozen",
        };
        let (least, most) = (times.iter().min().unwrap(), times.iter().max().unwrap());
        println!(
            "{kill}: {blow:?}, {what}: taken after {taken:.3?}, readable after {least:.3?} to {most:.3?}"
        );
        self.0.entry(what).or_default().extend(times);
    }
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (what, times) in &self.0 {
            let mut times = times.clone();
            times.sort();
            let at = |part: usize| times[(times.len() - 1) * part / 100].as_secs_f64();
            let (least, half, most) = (at(0), at(50), at(100));
            let count = times.len();
            write!(f, "\n{what}: {count} times until a robot was readable: {least:.2} s to {most:.2} s, ")?;
            write!(f, "half within {half:.2} s, 99 % within {:.2} s", at(99))?;
        }
        Ok(())
    }
}
