//! A palletising cell: a camera that finds parts, sheets and pallets that come with a delay, a PC that reads
//! values and changes the pattern. All of it runs in virtual time, from one seed. A test lets it work for an
//! hour, a bench for a day.

use r6_controller::Event;
use std::collections::BTreeMap;
use std::time::Duration;

use r6_controller::io::OutputPoint;
use r6_controller::{
    ConnectionId, Controller, ControllerSettings, Library, PanelAction, Profile, RobotModel, StartState,
};
use r6_proto::time::Instant;

/// How often the PC polls.
const POLL: Duration = Duration::from_secs(1);

const QUERY: &str = r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"1","queryAddr":["curMode","curAlarm","isMoving","axis-0","axis-1","axis-2","world-0","world-1","world-2","counter-0","counter-5","output-0"]}"#;

/// The number of pallets after which the PC describes the next pattern.
pub const PALLETS_OF_A_PATTERN: u64 = 5;

/// Patterns of the stack that take turns: spacing in mm, count. The program itself brings another one.
const PATTERNS: [([f64; 3], [u32; 3]); 2] =
    [([40.0, 35.0, 30.0], [3, 3, 2]), ([50.0, 45.0, 25.0], [2, 3, 3])];

/// Place 0 of the stack, as in the program.
const FIRST: [f64; 3] = [340.0, -20.0, 420.0];

const GRIPPER: OutputPoint = OutputPoint::Y(0, 0);
const PALLET_IS_FULL: OutputPoint = OutputPoint::Y(0, 2);
const LAYER_IS_FULL: OutputPoint = OutputPoint::Y(0, 3);

/// Inputs of board 0.
const PALLET_IS_THERE: u8 = 1;
const SHEET_IS_THERE: u8 = 2;

/// What a cell did.
#[derive(Debug, Default, PartialEq)]
pub struct Day {
    /// Every byte that the controller sent to the PC and to the camera, in order: their count and their hash
    /// (FNV-1a, 64 bits).
    pub bytes: (u64, u64),
    pub frames: u64,
    pub photos: u64,
    /// Parts that were put down.
    pub parts: u64,
    /// Layers that reached the target of counter 2.
    pub layers: u64,
    pub pallets: u64,
    /// How often the PC described another pattern.
    pub patterns: u64,
    /// The largest distance of a part from its place in the pattern, mm.
    pub farthest: f64,
    /// The first alarm, in the words of the log.
    pub alarm: Option<String>,
}

/// An event in the cell, outside the controller.
#[derive(Clone, Copy, Debug)]
enum Happens {
    /// The PC polls.
    Poll,
    /// The camera answers a photo request; false if it could not take the photo.
    Answer(bool),
    /// The camera has found a part.
    Found,
    /// An input changes.
    Input(u8, bool),
}

struct Cell {
    controller: Controller,
    now: Instant,
    pc: ConnectionId,
    camera: ConnectionId,
    random: u64,
    day: Day,
    /// The planned events in order. The second number separates events at one instant.
    agenda: BTreeMap<(Instant, u64), Happens>,
    entries: u64,
    /// The outputs when the cell last read them.
    held: bool,
    pallet_full: bool,
    layer_full: bool,
    /// Parts on the current pallet.
    on_pallet: u32,
    camera_failed: bool,
    frame: Vec<u8>,
}

/// Lets a cell with this seed work for this long.
pub fn work(seed: u64, time: Duration) -> Day {
    let mut library = Library::default();
    library.load("day", include_str!("program.toml")).unwrap_or_else(|error| panic!("{error}"));
    let model = RobotModel::named("BRTIRUS0707A").expect("a model that comes with r6-motion").clone();
    let settings = ControllerSettings {
        start: StartState::Auto,
        library,
        mold: "day".to_owned(),
        seed,
        ..ControllerSettings::new(Profile::hc1(), model)
    };
    let mut controller = Controller::new(settings, Instant::ORIGIN);
    let (pc, camera) = (controller.connect(Instant::ORIGIN), controller.connect(Instant::ORIGIN));
    let mut cell = Cell {
        controller,
        now: Instant::ORIGIN,
        pc,
        camera,
        random: seed,
        day: Day { bytes: (0, 0xcbf2_9ce4_8422_2325), ..Day::default() },
        agenda: BTreeMap::new(),
        entries: 0,
        held: false,
        pallet_full: false,
        layer_full: false,
        on_pallet: 0,
        camera_failed: false,
        frame: Vec::new(),
    };
    cell.switch_on();
    let end = Instant::ORIGIN + time;
    while cell.step(end) {}
    cell.day
}

impl Cell {
    /// Lets the camera make itself known, and the PC describe the first pattern and start the program.
    fn switch_on(&mut self) {
        self.send(self.camera, r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":0,"ret":1}"#);
        self.describe(0);
        self.send(self.pc, r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","packID":"3","cmdData":["startButton"]}"#);
        self.put_down(POLL, Happens::Poll);
        self.look();
    }

    /// Goes to the next instant with an event; false at the end.
    fn step(&mut self, end: Instant) -> bool {
        let own = self.controller.poll_timeout();
        let held_back = [self.pc, self.camera].into_iter().filter_map(|id| self.controller.next_transmit(id));
        let others = self.agenda.keys().next().map(|(at, _)| *at);
        let next = held_back.chain(own).chain(others).min().unwrap_or(end);
        self.now = self.now.max(next);
        if self.now > end {
            return false;
        }
        self.controller.handle_timeout(self.now);
        while let Some(entry) = self.agenda.first_entry().filter(|entry| entry.key().0 <= self.now) {
            let happens = entry.remove();
            self.carry_out(happens);
        }
        self.look();
        true
    }

    fn carry_out(&mut self, happens: Happens) {
        match happens {
            Happens::Poll => {
                self.send(self.pc, QUERY);
                self.put_down(POLL, Happens::Poll);
            }
            Happens::Answer(taken) => {
                let ret = u8::from(taken);
                let answer =
                    format!(r#"{{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":0,"ret":{ret}}}"#);
                self.send(self.camera, &answer);
                if taken {
                    let soon = self.between(20, 120);
                    self.put_down(soon, Happens::Found);
                }
            }
            Happens::Found => {
                let [x, y, z] = [(380.0, 60.0), (-130.0, 60.0), (450.0, 20.0)]
                    .map(|(from, by)| from + by * self.fraction());
                let angle = 90.0 * self.fraction() - 45.0;
                let points = format!(
                    r#"{{"dsID":"www.hc-system.com.cam","reqType":"AddPoints","dsData":[{{"camID":"0","data":[{{"ModelID":"0","X":"{x:.3}","Y":"{y:.3}","Z":"{z:.3}","Angel":"{angle:.3}","Rel":"0"}}]}}]}}"#
                );
                self.send(self.camera, &points);
            }
            Happens::Input(point, on) => {
                let done = self.controller.operate(self.now, &PanelAction::SetInput { board: 0, point, on });
                assert_eq!(done, Ok(()));
            }
        }
    }

    /// Reads the sent frames, and reacts to the outputs.
    fn look(&mut self) {
        for id in [self.pc, self.camera] {
            while let Some(frame) = self.controller.poll_transmit(self.now, id) {
                self.frame.clear();
                self.frame.extend_from_slice(frame);
                self.read(id);
            }
        }
        while self.controller.poll_woken().is_some() {}
        while let Some(line) = self.controller.poll_log() {
            if self.day.alarm.is_none()
                && matches!(line.event, Event::AlarmRaised { .. } | Event::AlarmCleared { .. })
            {
                self.day.alarm = Some(line.to_string());
            }
        }
        let [held, pallet_full, layer_full] = [GRIPPER, PALLET_IS_FULL, LAYER_IS_FULL]
            .map(|point| self.controller.machine().io().is_set(point));
        if std::mem::replace(&mut self.held, held) && !held {
            self.part_was_put_down();
        }
        if !std::mem::replace(&mut self.layer_full, layer_full) && layer_full {
            self.day.layers += 1;
            let after = self.between(800, 2500);
            self.pulse(after, SHEET_IS_THERE);
        }
        if !std::mem::replace(&mut self.pallet_full, pallet_full) && pallet_full {
            self.day.pallets += 1;
            self.on_pallet = 0;
            let after = self.between(4000, 9000);
            self.pulse(after, PALLET_IS_THERE);
        }
    }

    fn read(&mut self, id: ConnectionId) {
        let (length, sum) = &mut self.day.bytes;
        *length += self.frame.len() as u64;
        for byte in &self.frame {
            *sum = (*sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
        self.day.frames += 1;
        let text = std::str::from_utf8(&self.frame).expect("UTF-8");
        if id == self.camera && text.contains(r#""reqType":"photo""#) {
            self.day.photos += 1;
            // One in twenty fails, but never two in a row.
            let taken = self.camera_failed || self.fraction() > 0.05;
            self.camera_failed = !taken;
            let after = self.between(120, 500);
            self.put_down(after, Happens::Answer(taken));
        } else if let Some((_, counter)) = text.split_once("[5,0,") {
            let pallets: u64 =
                counter.split(']').next().and_then(|number| number.parse().ok()).expect("a count");
            if pallets / PALLETS_OF_A_PATTERN > self.day.patterns - 1 {
                self.describe(self.day.patterns);
            }
        }
    }

    /// Lets the PC describe the pattern with this number, and how many parts a layer has.
    fn describe(&mut self, number: u64) {
        let (spacing, count) = PATTERNS[usize::try_from(number % 2).expect("0 or 1")];
        let ([dx, dy, dz], [nx, ny, nz]) = (spacing, count);
        self.day.patterns += 1;
        self.send(self.pc, &format!(r#"{{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","packID":"4","cmdData":["modifyStackData","0","{dx}","{dy}","{dz}","{nx}","{ny}","{nz}"]}}"#));
        let layer = nx * ny;
        self.send(self.pc, &format!(r#"{{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","packID":"5","cmdData":["modifyCounter","2","-1","{layer}"]}}"#));
    }

    /// Checks a part after the gripper has opened: the arm has to be at the next place of the pattern. The
    /// test counts places on its own.
    fn part_was_put_down(&mut self) {
        let (spacing, [nx, ny, _]) = PATTERNS[usize::try_from((self.day.patterns - 1) % 2).expect("0 or 1")];
        let n = self.on_pallet;
        let along = [n % nx, n / nx % ny, n / (nx * ny)];
        let pose = self.controller.machine().motion().pose.components();
        for axis in 0..3 {
            let wanted = FIRST[axis] + spacing[axis] * f64::from(along[axis]);
            self.day.farthest = self.day.farthest.max((pose[axis] - wanted).abs());
        }
        self.on_pallet += 1;
        self.day.parts += 1;
    }

    fn send(&mut self, id: ConnectionId, frame: &str) {
        self.controller.handle_input(self.now, id, frame.as_bytes());
    }

    fn put_down(&mut self, after: Duration, happens: Happens) {
        self.entries += 1;
        self.agenda.insert((self.now + after, self.entries), happens);
    }

    /// Plans that an input comes on after a time, and goes off a second later.
    fn pulse(&mut self, after: Duration, point: u8) {
        self.put_down(after, Happens::Input(point, true));
        self.put_down(after + Duration::from_secs(1), Happens::Input(point, false));
    }

    /// A random number from 0 to 1, from the seed (a multiplicative generator).
    fn fraction(&mut self) -> f64 {
        self.random =
            self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from(u32::try_from(self.random >> 32).expect("32 bits")) / f64::from(u32::MAX)
    }

    fn between(&mut self, from: u64, to: u64) -> Duration {
        Duration::from_millis(from) + Duration::from_millis(to - from).mul_f64(self.fraction())
    }
}
