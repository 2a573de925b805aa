//! One query of twelve addresses through the whole controller, bytes in to bytes out, while the arm moves.
//!
//! For comparison it also measures the same query with the arm at rest, and a bare evaluation of rsruckig at
//! one instant. The controller reads a frame, computes the position of the arm once per query, and writes a
//! frame. Every contender goes through 1 024 different frames and instants. They take turns, a slice of a
//! quarter of a second each, in fifteen rounds.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use r6_controller::{ConnectionId, Controller, ControllerSettings, Profile, RobotModel, StartState};
use r6_proto::time::Instant;
use rsruckig::prelude::*;
use serde_json::{Value, json};

/// Different frames: enough that a branch predictor cannot learn them by heart.
const CASES: usize = 1024;

/// How often the contenders take turns.
const ROUNDS: usize = 15;

/// The time between two queries: shorter than any client polls.
const STEP: Duration = Duration::from_millis(1);

/// Addresses of one query.
const ADDRESSES: usize = 12;

/// A multiplicative generator: it gives the same frames in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(self.0 >> 33).unwrap_or(0) % limit
    }
}

/// The query of a program that watches an arm: mostly the six axes and the components of the pose.
fn query(random: &mut Random, number: usize) -> Vec<u8> {
    let fixed = ["curMode", "curAlarm", "isMoving", "RemoteCmdLen", "origin", "curCycle"];
    let address = |random: &mut Random| match random.below(10) {
        0..=3 => format!("axis-{}", random.below(6)),
        4..=6 => format!("world-{}", random.below(6)),
        7 => format!("curSpeed-{}", random.below(6)),
        _ => fixed[random.below(fixed.len())].to_owned(),
    };
    let addresses: Vec<String> = (0..ADDRESSES).map(|_| address(random)).collect();
    let frame = json!({
        "dsID": "www.hc-system.com.RemoteMonitor", "reqType": "query", "packID": number.to_string(),
        "queryAddr": addresses,
    });
    frame.to_string().into_bytes()
}

/// A controller on its own clock, with one connection.
struct Cell {
    controller: Controller,
    id: ConnectionId,
    now: Instant,
}

impl Cell {
    fn at_rest() -> Self {
        let model = RobotModel::named("BRTIRUS0707A").expect("a model that comes with r6-motion").clone();
        let profile = Profile::named("hc1").expect("a profile that comes with the crate");
        let settings =
            ControllerSettings { start: StartState::Waiting, ..ControllerSettings::new(profile, model) };
        let mut controller = Controller::new(settings, Instant::ORIGIN);
        let id = controller.connect(Instant::ORIGIN);
        Self { controller, id, now: Instant::ORIGIN }
    }

    /// Moves round four corners without end. The list keeps its steps and begins again.
    fn moving() -> Self {
        let mut cell = Self::at_rest();
        let step = |[j1, j2, j5]: [i32; 3]| {
            json!({
                "oneshot": "0", "action": "4", "ckStatus": "0x3F", "speed": "80", "delay": "0", "smooth": "5",
                "m0": j1.to_string(), "m1": j2.to_string(), "m2": "10", "m3": "0", "m4": j5.to_string(), "m5": "30",
            })
        };
        let corners = [[60, -10, -60], [60, 20, -90], [-60, 20, -60], [-60, -10, -90]];
        let list = json!({
            "dsID": "www.hc-system.com.HCRemoteCommand", "reqType": "AddRCC", "emptyList": "1",
            "instructions": corners.map(step),
        });
        cell.ask(list.to_string().as_bytes());
        cell.pass(Duration::from_millis(50));
        assert!(
            cell.reply_of(|reply| reply.is_some_and(|reply| reply.ends_with(b"}"))),
            "AddRCC is acknowledged"
        );
        let start = json!({
            "dsID": "www.hc-system.com.RemoteMonitor", "reqType": "command", "cmdData": ["startButton"],
        });
        cell.ask(start.to_string().as_bytes());
        cell.reply_of(|_| ());
        cell
    }

    fn pass(&mut self, time: Duration) {
        self.now += time;
        self.controller.handle_timeout(self.now);
    }

    fn ask(&mut self, frame: &[u8]) {
        self.controller.handle_input(self.now, self.id, frame);
    }

    fn reply_of<T>(&mut self, read: impl FnOnce(Option<&[u8]>) -> T) -> T {
        read(self.controller.poll_transmit(self.now, self.id))
    }

    /// Advances the time, sends one frame and reads one; returns the length of the reply.
    fn turn(&mut self, frame: &[u8]) -> usize {
        self.now += STEP;
        self.ask(frame);
        let bytes = self.reply_of(|reply| black_box(reply).map_or(0, <[u8]>::len));
        // A shell reads the log, too.
        while let Some(line) = self.controller.poll_log() {
            black_box(line);
        }
        bytes
    }

    /// Checks that every query is answered in full, in JSON, and that the arm moves or rests as expected.
    fn check(&mut self, frames: &[Vec<u8>], moves: bool) {
        let mut places = Vec::new();
        for frame in frames {
            self.now += STEP;
            self.ask(frame);
            let reply: Value =
                self.reply_of(|reply| serde_json::from_slice(reply.expect("a reply")).expect("JSON"));
            let asked: Value = serde_json::from_slice(frame).expect("JSON");
            assert_eq!((&reply["queryAddr"], &reply["packID"]), (&asked["queryAddr"], &asked["packID"]));
            let values = reply["queryData"].as_array().expect("a list");
            assert_eq!(values.len(), ADDRESSES, "{reply}");
            let addresses = asked["queryAddr"].as_array().expect("a list");
            let place = addresses.iter().position(|address| address == "axis-0");
            places.extend(place.and_then(|place| values[place].as_str()).map(str::to_owned));
        }
        let changes = places.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert_eq!(changes > 0, moves, "J1: {places:?}");
    }
}

/// The work of one contender for the frame with this number. The number it returns depends on the result, so
/// that the compiler removes nothing.
type Work<'a> = Box<dyn FnMut(usize) -> usize + 'a>;

/// Six axes planned by rsruckig.
fn trajectory() -> Trajectory<6> {
    let mut input = InputParameter::<6>::new(None);
    for (n, target) in [120.0, 30.0, 40.0, -60.0, 30.0, 90.0].into_iter().enumerate() {
        input.target_position[n] = target;
        input.max_velocity[n] = 200.0;
        input.max_acceleration[n] = 1000.0;
        input.max_jerk[n] = 8000.0;
    }
    let mut trajectory = Trajectory::new(None);
    Ruckig::<6, ThrowErrorHandler>::new(None, 0.001)
        .calculate(&input, &mut trajectory)
        .expect("it is possible");
    trajectory
}

fn evaluated(trajectory: &Trajectory<6>, time: f64) -> usize {
    let [mut position, mut speed, mut acceleration] = [(); 3].map(|()| DataArrayOrVec::new(None, 0.0));
    let (at, by, of) = (&mut Some(&mut position), &mut Some(&mut speed), &mut Some(&mut acceleration));
    trajectory.at_time(time, at, by, of, &mut None, &mut None);
    black_box((position, speed, acceleration));
    0
}

fn query_of_twelve(criterion: &mut Criterion) {
    let mut random = Random(1);
    let frames: Vec<Vec<u8>> = (0..CASES).map(|number| query(&mut random, number)).collect();
    let (mut moving, mut resting) = (Cell::moving(), Cell::at_rest());
    moving.check(&frames, true);
    resting.check(&frames, false);
    let trajectory = trajectory();
    let times: Vec<f64> =
        (0..CASES).map(|_| trajectory.get_duration() * random.below(CASES) as f64 / CASES as f64).collect();
    let mut contenders: [(&str, Work<'_>); 3] = [
        ("r6", Box::new(|at| moving.turn(&frames[at]))),
        ("r6 at rest", Box::new(|at| resting.turn(&frames[at]))),
        ("rsruckig, one state", Box::new(|at| evaluated(&trajectory, times[at]))),
    ];
    let mut group = criterion.benchmark_group("query of 12 through the controller, moving");
    group.sample_size(10).nresamples(1001).warm_up_time(Duration::from_millis(50));
    group.measurement_time(Duration::from_millis(200));
    for round in 0..ROUNDS {
        for (contender, work) in &mut contenders {
            let mut turn = 0_usize;
            group.bench_function(BenchmarkId::new(*contender, round), |bencher| {
                bencher.iter(|| {
                    // The step is odd, so every frame comes once in each pass.
                    turn = (turn + 389) % CASES;
                    work(black_box(turn))
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, query_of_twelve);
criterion_main!(benches);
