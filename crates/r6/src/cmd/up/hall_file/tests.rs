use std::time::Duration;

use r6_controller::{Controller, ControllerSettings, ControllerSnapshot, Event, LogEntry, OperationMode};
use r6_proto::AxisIndex;
use r6_proto::address::Address;
use r6_proto::alarm::AlarmCode;
use r6_proto::message::Reading;
use r6_proto::time::Instant;

use super::*;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples");

fn example() -> HallFile {
    read(&Path::new(ROOT).join("hall.toml")).unwrap_or_else(|failure| panic!("{failure}"))
}

/// One robot of the example, without a network and on a virtual clock.
struct Played {
    controller: Controller,
    log: Vec<LogEntry>,
    now: Instant,
}

impl Played {
    fn start(name: &str) -> Self {
        let file = example();
        let robot = file.robots.into_iter().find(|robot| robot.config.name.as_str() == name);
        let SimSettings { profile, model, start, library, mold, seed, scenario, .. } =
            robot.unwrap_or_else(|| panic!("there is no {name}")).settings;
        let settings = ControllerSettings {
            start,
            library,
            mold,
            seed,
            scenario,
            ..ControllerSettings::new(profile, model)
        };
        let now = Instant::ORIGIN;
        Self { controller: Controller::new(settings, now), log: Vec::new(), now }
    }

    /// Lets time pass until this many seconds after the start.
    fn until(&mut self, seconds: f64) -> &mut Self {
        let end = Instant::ORIGIN + Duration::from_secs_f64(seconds);
        while let Some(due) = self.controller.poll_timeout().filter(|due| *due <= end) {
            self.now = due.max(self.now);
            self.controller.handle_timeout(self.now);
            self.log.extend(std::iter::from_fn(|| self.controller.poll_log()));
        }
        self.now = end;
        self.controller.handle_timeout(end);
        self.log.extend(std::iter::from_fn(|| self.controller.poll_log()));
        self
    }

    fn parts(&mut self, counter: u32) -> i64 {
        match self.controller.reading(self.now, Address::Counter(counter)) {
            Some(Reading::Counter(counter)) => counter.current,
            other => panic!("{other:?}"),
        }
    }

    fn snapshot(&mut self) -> ControllerSnapshot {
        self.controller.snapshot(self.now)
    }

    fn mode(&mut self) -> OperationMode {
        self.snapshot().mode
    }

    fn alarm(&mut self) -> i64 {
        i64::from(self.snapshot().alarm)
    }

    fn step(&mut self) -> String {
        self.snapshot().step.map(|step| step.text).unwrap_or_default()
    }

    /// Whether the mains failed and came back.
    fn mains_came_back(&self) -> bool {
        self.log.iter().any(|entry| matches!(entry.event, Event::MainsAreBack))
    }
}

#[test]
fn the_example_has_twelve_robots_of_several_kinds_and_the_shifts() {
    let HallFile { robots, hall, library } = example();
    let stored: Vec<_> = library.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(stored, ["square", "reach"]);
    assert_eq!(robots.len(), 12);
    let distinct =
        |of: &dyn Fn(&HallRobot) -> String| robots.iter().map(of).collect::<std::collections::BTreeSet<_>>();
    assert_eq!(distinct(&|robot| robot.settings.profile.name.clone()).len(), 4);
    assert_eq!(distinct(&|robot| robot.settings.model.name.to_string()).len(), 7);
    assert_eq!(distinct(&|robot| robot.settings.seed.to_string()).len(), 12);
    let settings = hall.unwrap();
    assert_eq!(
        (settings.settings().time_zone.as_str(), settings.settings().shifts.len()),
        ("Europe/Berlin", 3)
    );
}

#[test]
fn those_that_work_count_parts_in_cycles_that_vary() {
    for (name, counter, least, most) in [
        ("press-01", 1, 300, 500),
        ("weld-02", 1, 40, 130),
        ("pick-01", 1, 500, 1400),
        ("pack-01", 2, 100, 500),
        ("gantry-01", 1, 40, 300),
    ] {
        let mut robot = Played::start(name);
        let mut cycles = Vec::new();
        for second in 1..=3_600 {
            let snapshot = robot.until(f64::from(second)).snapshot();
            cycles.push(snapshot.last_cycle_seconds);
        }
        let parts = robot.parts(counter);
        assert!((least..=most).contains(&parts), "{name}: {parts} parts in an hour, {}", robot.step());
        cycles.sort_by(f64::total_cmp);
        cycles.dedup();
        assert!(cycles.len() > 20, "{name}: the cycle times {cycles:?}");
    }
}

#[test]
fn the_same_seed_is_the_same_day() {
    let day = || {
        let mut robot = Played::start("press-01");
        robot.until(600.0);
        robot.log.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    assert_eq!(day(), day());
}

#[test]
fn an_emergency_stop_is_pressed_and_released_and_the_robot_works_again() {
    let mut press = Played::start("press-02");
    press.until(170.0);
    let before = press.parts(1);
    assert!(before > 5 && press.mode() == OperationMode::Running, "{before}");
    assert!(press.until(200.0).snapshot().emergency_stop);
    assert!(!press.until(255.0).snapshot().emergency_stop);
    assert_eq!((press.mode(), press.alarm()), (OperationMode::Running, 0));
    press.until(400.0);
    assert!(press.parts(1) > before + 5, "{} after {before}", press.parts(1));
}

#[test]
fn one_is_in_alarm_until_a_person_clears_it() {
    let mut press = Played::start("press-03");
    press.until(35.0);
    assert_eq!(press.alarm(), 5001);
    assert_eq!(press.until(3_000.0).alarm(), 5001);
}

#[test]
fn one_loses_its_link_again_and_again() {
    use r6_controller::fault::LinkFault;
    let mut weld = Played::start("weld-02");
    for (at, is_lost) in [(70.0, false), (80.0, true), (95.0, false), (380.0, true), (395.0, false)] {
        let faults: Vec<_> = weld.until(at).controller.link_faults().iter().map(|now| now.fault).collect();
        assert_eq!(faults.contains(&LinkFault::Refuse), is_lost, "{at}: {faults:?}");
    }
}

#[test]
fn one_drifts_beyond_a_soft_limit_and_is_set_right() {
    let mut glue = Played::start("glue-01");
    let mut alarm = 0;
    let minute = (1..15).find(|minute| {
        alarm = glue.until(f64::from(*minute) * 60.0).alarm();
        alarm != 0
    });
    let minute = minute.unwrap_or_else(|| panic!("no alarm in a quarter of an hour, {}", glue.parts(1)));
    assert!((3..=10).contains(&minute) && glue.parts(1) > 40, "minute {minute}, {} parts", glue.parts(1));
    assert_eq!(alarm, i64::from(AlarmCode::positive_limit(AxisIndex::ALL[0])));
    let before = glue.parts(1);
    glue.until(930.0);
    assert_eq!((glue.alarm(), glue.mode()), (0, OperationMode::Running));
    assert!(glue.parts(1) > before);
}

#[test]
fn one_waits_for_an_input_that_does_not_come() {
    let mut pick = Played::start("pick-02");
    pick.until(300.0);
    assert_eq!(pick.parts(1), 20);
    assert!(pick.step().contains("X010"), "{}", pick.step());
    assert_eq!(pick.until(3_000.0).parts(1), 20);
}

#[test]
fn one_loses_its_mains_and_is_started_again() {
    let mut pack = Played::start("pack-02");
    let before = pack.until(290.0).parts(2);
    assert!(before > 10, "{before}");
    assert!(!pack.until(310.0).mains_came_back(), "{:?}", pack.log.last());
    let dark = pack.parts(2);
    assert!(pack.until(450.0).mains_came_back() && pack.parts(2) > dark, "{:?}", pack.log.last());
    assert!(pack.parts(2) > before && pack.mode() == OperationMode::Running, "{}", pack.parts(2));
}

#[test]
fn one_is_in_manual_and_one_waits_for_a_pc() {
    assert_eq!(Played::start("pack-03").until(100.0).mode(), OperationMode::Manual);
    let mut weld = Played::start("weld-01");
    assert!(weld.until(100.0).snapshot().is_ready());
}

/// Each part of a message stands at its line, and there are no others.
fn assert_told(text: &str, parts: &[(&str, &str)]) {
    let beside = |name: &str| match name {
        "bad.toml" => Ok("[[step]]\ndo = \"wait\"\nsecond = 1\n".to_owned()),
        "calls.toml" => Ok("[[step]]\ndo = \"call\"\nprogram = \"remot\"\n".to_owned()),
        _ => Err("the file cannot be read: no such file".to_owned()),
    };
    let mistakes = parse(text, &beside).map(|file| file.robots.len()).unwrap_err();
    let lines: Vec<_> = mistakes.lines("hall.toml").filter(|line| !line.starts_with(' ')).collect();
    let all = mistakes.to_string();
    assert_eq!(lines.len(), parts.len(), "{lines:#?}");
    for (line, part) in parts {
        let at = lines.iter().any(|told| told.starts_with(line));
        assert!(at && all.contains(part), "{line} {part}: {all}");
    }
}

#[test]
fn every_mistake_of_a_robot_is_told_with_its_line_and_the_nearest_word() {
    assert_told(
        "sed = 1\n[[robot]]\nname = \"press-01\"\nmodel = \"BRTIRUS1510\"\nprofile = \"hc2\"\nstart = \"waitng\"\n\
         programs = [\"palletize\"]\nperiod_ms = 1\nparts = \"axis-0\"\nspeed = 3\n\
         [[robot]]\nname = \"press-01\"\n[[robot]]\nname = \"press-01-twin\"\n[[robot]]\nmodel = \"GENERIC-SCARA\"\n",
        &[
            ("hall.toml:1:1: ", "nearest: `seed`"),
            ("hall.toml:4:9: [[robot]] 1 (press-01): ", "nearest: \"BRTIRUS1510A\""),
            ("hall.toml:5:11: [[robot]] 1 (press-01): ", "nearest: \"hc1\""),
            ("hall.toml:6:9: [[robot]] 1 (press-01): ", "nearest: \"waiting\""),
            (
                "hall.toml:7:12: [[robot]] 1 (press-01): ",
                "there is no program `palletize`; nearest: `palletise`",
            ),
            ("hall.toml:8:13: [[robot]] 1 (press-01): ", "`period_ms` is 1"),
            ("hall.toml:9:9: [[robot]] 1 (press-01): ", "`parts`"),
            ("hall.toml:10:1: [[robot]] 1 (press-01): ", "there is no key `speed`"),
            ("hall.toml:12:8: [[robot]] 2 (press-01): ", "two robots are called `press-01`"),
            ("hall.toml:14:8: [[robot]] 3 (press-01-twin): ", "a twin has the longer name already"),
            ("hall.toml:15:1: [[robot]] 4: ", "`name` is missing"),
        ],
    );
    assert_told("seed = 1\n", &[("hall.toml: ", "there is no [[robot]]")]);
    let long = format!("[[robot]]\nname = \"{}\"\n", "x".repeat(28));
    assert_told(&long, &[("hall.toml:2:8: ", "the name of its twin, is longer than 32 characters")]);
    let twice = "[[robot]]\nname = \"a\"\n[[robot]]\nname = \"a\"\n[[robot]]\nname = \"a-twin\"\n";
    assert_told(
        twice,
        &[("hall.toml:4:8: ", "two robots"), ("hall.toml:6:8: ", "a twin has the longer name")],
    );
}

#[test]
fn the_mistakes_of_what_happens_of_programs_and_of_shifts_are_told_too() {
    assert_told(
        "library = [\"bad.toml\", \"Bad name.toml\"]\n\
         [[robot]]\nname = \"a\"\nprograms = [\"bad.toml\"]\n[[robot.at]]\ntime = 1\ndo = \"alrm\"\n\
         [[robot.react]]\nwhen = \"X010\"\nthen = \"X010\"\n[[robot.fault]]\nfault = \"refuse\"\nform = 3\n\
         [[robot]]\nname = \"b\"\nprograms = [\"bad.toml\"]\n[[robot]]\nname = \"c\"\nprograms = [\"none.toml\"]\n\
         [[robot]]\nname = \"d\"\nprograms = [\"calls.toml\"]\n[[shift]]\nname = \"early\"\n",
        &[
            ("hall.toml:1:11: bad.toml:1:3: ", "a taught program runs on the controller"),
            ("hall.toml:1:11: Bad name.toml: its name", "1 to 64 characters"),
            ("hall.toml:1:11: Bad name.toml: the file", "no such file"),
            ("hall.toml:4:12: [[robot]] 1 (a): bad.toml:3:1: ", "nearest: `seconds`"),
            ("hall.toml:7:6: [[robot]] 1 (a): [[at]] 1 (alrm): ", "nearest: \"alarm\""),
            ("hall.toml:9:8: [[robot]] 1 (a): [[react]] 1 (X010): ", "an output Y010"),
            ("hall.toml:13:1: [[robot]] 1 (a): [[fault]] 1 (refuse): ", "there is no key `form`"),
            ("hall.toml:19:12: [[robot]] 3 (c): none.toml: the file cannot be read", "no such file"),
            ("hall.toml:22:12: [[robot]] 4 (d): program `calls`: ", "nearest: `remote`"),
            ("hall.toml:23:1: [[shift]] 1: ", "`days` is missing"),
            ("hall.toml:23:1: [[shift]] 1: ", "`begin` is missing"),
            ("hall.toml:23:1: [[shift]] 1: ", "`end` is missing"),
            ("hall.toml:24:8: [[shift]] 1: ", "a shift needs the `time_zone` of [hall]"),
        ],
    );
}
