//! The file of a gateway: robots, raw ports, who may use these, HTTP, and the history.

mod audit;
mod groups;
mod hall;
mod history;
mod http;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use r6_client::Address;
use r6_client::units::{MillimetresPerSecond, Percent};
use r6_controller::{Profile, RobotModel};
use r6_gateway::{
    AuditSettings, Camera, Guard, Hall, HistorySettings, MAX_CAMERAS, MAX_PROGRAMS, MAX_READ, PERIODS,
    RawAllow, RawPolicy, RawPort, RawRule, RawSource, RobotAddress, RobotConfig, RobotName, raw_words,
};
use r6_program::Mistakes;
use r6_program::form::{self, Fields, Found, Node, Wrong};
use r6_proto::message::instruction::PathSpeed;

pub use groups::read as groups;
pub use hall::read as hall_and_shifts;
pub use http::{HOST_NAME, HttpSettings, host_name};

use crate::cmd::job::guard::file::Limits;
use crate::exit::Failure;
use crate::robot;
use crate::text_file;

/// The longest file. A robot takes a hundred bytes.
const MAX_FILE_BYTES: usize = 1024 * 1024;

/// What the file of a gateway says.
#[derive(Debug, Default)]
pub struct Config {
    /// `[[robot]]`.
    pub robots: Vec<RobotConfig>,
    /// The profiles of the robots that name one, for their twins.
    pub profiles: BTreeMap<RobotName, Profile>,
    /// `[[raw]]`.
    pub raw: Vec<RawPort>,
    /// `[[raw_rule]]`, if there is any.
    pub policy: Option<RawPolicy>,
    /// `[hall]` and `[[shift]]`, if there is any.
    pub hall: Option<Hall>,
    /// `[audit]`.
    pub audit: AuditSettings,
    /// `[history]`.
    pub history: HistorySettings,
    /// `[http]`.
    pub http: HttpSettings,
}

/// Reads the file.
pub fn read(path: &Path) -> Result<Config, Failure> {
    let name = path.display().to_string();
    let text = text_file::read(path, "a file of a gateway", MAX_FILE_BYTES)
        .map_err(|error| Failure::usage(format!("{name}: {error}")))?;
    parse(&text).map_err(|mistakes| Failure::in_file(&name, &mistakes))
}

fn parse(text: &str) -> Result<Config, Mistakes> {
    let (document, mut found) = form::parse(text);
    let fields = Fields::of(&document, &[], "");
    let mut robots: Vec<RobotConfig> = Vec::new();
    let mut profiles = BTreeMap::new();
    for (number, table) in (1..).zip(fields.tables("robot")) {
        let inner = Fields::of(table, &[], format!("[[robot]] {number}: "));
        let profile = profile(&inner);
        let guard = guard(&inner, number, &mut found);
        let groups = groups::read(&inner, &format!("[[robot]] {number}: "), &mut found);
        let read = one(&inner).and_then(|robot| {
            if robots.iter().any(|known| known.name == robot.name) {
                return Err(inner.wrong("name", format!("two robots are called `{}`", robot.name)));
            }
            profiles.extend(profile.map(|profile| (robot.name.clone(), profile)));
            Ok(RobotConfig { guard, groups, ..robot })
        });
        robots.extend(inner.finish(read, &mut found));
    }
    let mut raw: Vec<RawPort> = Vec::new();
    for (number, table) in (1..).zip(fields.tables("raw")) {
        let inner = Fields::of(table, &[], format!("[[raw]] {number}: "));
        let read = raw_port(&inner).and_then(|port| {
            if raw.iter().any(|known| known.robot == port.robot) {
                return Err(inner.wrong("robot", format!("`{}` has two raw ports", port.robot)));
            }
            Ok(port)
        });
        raw.extend(inner.finish(read, &mut found));
    }
    let mut rules = Vec::new();
    for (number, table) in (1..).zip(fields.tables("raw_rule")) {
        let inner = Fields::of(table, &[], format!("[[raw_rule]] {number}: "));
        let read = raw_rule(&inner);
        rules.extend(inner.finish(read, &mut found));
    }
    let policy = (!rules.is_empty()).then(|| RawPolicy::new(rules));
    let hall = fields.optional("hall", "a table: [hall]", |value| value.table());
    let hall = hall::read(hall, &fields.tables("shift"), &mut found);
    let audit = fields.optional("audit", "a table: [audit]", |value| value.table());
    let audit = audit.and_then(|table| audit::read(table, &mut found)).unwrap_or_default();
    let history = fields.optional("history", "a table: [history]", |value| value.table());
    let history = history.and_then(|table| history::read(table, &mut found)).unwrap_or_default();
    let http = fields.optional("http", "a table: [http]", |value| value.table());
    let http = http.and_then(|table| http::read(table, &mut found)).unwrap_or_default();
    let config =
        fields.finish(Ok(Config { robots, profiles, raw, policy, hall, audit, history, http }), &mut found);
    found.finish(config)
}

fn raw_port(fields: &Fields<'_>) -> Result<RawPort, Wrong> {
    let robot = fields.due("robot", "the name of a robot", |value| RobotName::new(value.text()?));
    let listen =
        fields.due("listen", "ADDR:PORT, such as 192.168.1.2:9760", |value| value.text()?.parse().ok());
    Ok(RawPort { robot: robot?, listen: listen? })
}

fn raw_rule(fields: &Fields<'_>) -> Result<RawRule, Wrong> {
    let source = fields.due("source", RawSource::WANTED, |value| RawSource::parse(value.text()?));
    let words = [RawAllow::Deny, RawAllow::Read, RawAllow::Command].map(|allow| (allow.word(), allow));
    let allow = fields.due_word("allow", &words);
    let robot = fields.optional("robot", "the name of a robot", |value| RobotName::new(value.text()?));
    let words = raw_words();
    let commands = fields.optional("commands", "a list of commands in brackets, each once", |value| {
        let named: Vec<_> = value.list()?.iter().map(Node::text).collect::<Option<_>>()?;
        let once: BTreeSet<_> = named.iter().copied().collect();
        (once.len() == named.len()).then_some(named)
    });
    let unknown = commands.iter().flatten().find(|named| !words.contains(named));
    if let Some(unknown) = unknown {
        let near = r6_proto::nearest(unknown, words.iter().copied());
        let near = near.map(|near| format!("; nearest: `{near}`")).unwrap_or_default();
        let known = words.join(", ");
        let wrong = format!("`{unknown}` is no command that needs the lease{near}. These are: {known}");
        let _noted = fields.wrong("commands", wrong);
    }
    let known = |named: &str| words.iter().copied().find(|word| *word == named);
    let commands: Option<Vec<_>> = commands.map(|named| named.into_iter().filter_map(known).collect());
    let wanted = format!("at most {MAX_PROGRAMS} names of programs in brackets, such as [\"press\"]");
    let programs = fields.optional("programs", &wanted, |value| {
        let named = value.list()?.iter().map(|name| name.text().map(str::to_owned));
        named.collect::<Option<Vec<_>>>().filter(|named| named.len() <= MAX_PROGRAMS)
    });
    let max_global_speed = fields.number_in("max_global_speed", "percent from 0 to 100", 0.0..=100.0);
    let max_speed = fields.optional("max_speed", Percent::WANTED, |value| {
        value.number().filter(|percent| Percent::new(*percent).is_ok())
    });
    let max_path_speed = fields.optional("max_path_speed", PathSpeed::WANTED, |value| {
        let speed = u32::try_from(value.whole()?).ok()?;
        MillimetresPerSecond::new(speed).is_ok().then_some(speed)
    });
    let wanted = format!("at most {MAX_CAMERAS} numbers of cameras, 0 to 999, each once, such as [0, 1]");
    let cameras = fields.optional("cameras", &wanted, |value| {
        let cameras = value.list()?.iter().map(|camera| Camera::new(camera.whole()?));
        let cameras = cameras.collect::<Option<Vec<_>>>()?;
        let once: BTreeSet<_> = cameras.iter().collect();
        (once.len() == cameras.len() && cameras.len() <= MAX_CAMERAS).then_some(cameras)
    });
    let (rule, cameras) = (RawRule::new(source?, allow?), cameras.unwrap_or_default());
    if rule.allow == RawAllow::Deny && !cameras.is_empty() {
        return Err(
            fields.wrong("cameras", "a source that is denied is no camera: allow = \"read\"".to_owned())
        );
    }
    Ok(RawRule { robot, commands, programs, max_global_speed, max_speed, max_path_speed, cameras, ..rule })
}

fn one(fields: &Fields<'_>) -> Result<RobotConfig, Wrong> {
    let name = fields.due("name", RobotName::WANTED, |value| RobotName::new(value.text()?));
    let address = fields.due("address", RobotAddress::WANTED, |value| {
        value.text().filter(|text| RobotAddress::read(text).is_ok())
    });
    let models: Vec<_> = RobotModel::names().collect();
    let wanted = format!("a model: {}", models.join(", "));
    let model = fields.optional("model", &wanted, |value| RobotModel::named(value.text()?));
    // All keys are read before the first mistake counts: otherwise the others would be unknown keys.
    let values = values(fields);
    let robot = RobotConfig { settings: robot::settings(), ..RobotConfig::new(name?, address?) };
    Ok(RobotConfig { model: model.map(|model| model.name.to_string()), ..values.of(robot) })
}

/// What a table says of the values of a robot.
#[derive(Debug)]
pub struct Values {
    /// How often they are read.
    period: Option<u32>,
    /// Those besides the usual ones.
    addresses: Vec<Address>,
    /// The counter of parts.
    parts: Option<Address>,
}

impl Values {
    /// This robot with these values.
    pub fn of(self, robot: RobotConfig) -> RobotConfig {
        let Self { period, addresses, parts } = self;
        let period = period.map_or(robot.period, |period| Duration::from_millis(period.into()));
        RobotConfig { period, addresses, parts, ..robot }
    }
}

/// Reads what a table says of the values of a robot.
pub fn values(fields: &Fields<'_>) -> Values {
    let (wanted, range) = periods();
    let period = fields.whole_in("period_ms", &wanted, range);
    let wanted = format!("at most {MAX_READ} query addresses in brackets, such as [\"Addr-800\"]");
    let addresses = fields.optional("read", &wanted, |value| {
        let addresses = value.list()?.iter().map(address_of).collect::<Option<Vec<_>>>()?;
        Some(addresses).filter(|addresses| addresses.len() <= MAX_READ)
    });
    let parts = fields.optional("parts", "a counter, such as counter-1", |value| {
        Address::parse(value.text()?).ok().filter(|address| matches!(address, Address::Counter(_)))
    });
    Values { period, addresses: addresses.unwrap_or_default(), parts }
}

/// Which periods there are, in ms.
fn periods() -> (String, RangeInclusive<u32>) {
    let [shortest, longest] =
        [PERIODS.0, PERIODS.1].map(|period| u32::try_from(period.as_millis()).unwrap_or(u32::MAX));
    (format!("from {shortest} to {longest}"), shortest..=longest)
}

/// The limits of a robot: `[robot.guard]`, with the keys of a file of `r6 run --guard`.
fn guard(fields: &Fields<'_>, number: usize, found: &mut Found<'_>) -> Option<Arc<Guard>> {
    let table = fields.optional("guard", "a table: [robot.guard]", |value| value.table())?;
    let place = format!("[[robot]] {number}: [robot.guard]: ");
    Limits::of_table(table, &place, found).map(|limits| Arc::new(limits.guard()))
}

/// The profile of the firmware of a robot: what its twin answers.
fn profile(fields: &Fields<'_>) -> Option<Profile> {
    let wanted = format!("a profile: {}", Profile::names().join(", "));
    fields.optional("profile", &wanted, |value| Profile::named(value.text()?))
}

fn address_of(node: &Node) -> Option<Address> {
    Address::parse(node.text()?).ok()
}

#[cfg(test)]
mod tests {
    use r6_api::gateway::Weekday;

    use super::*;

    #[test]
    fn a_file_names_robots_and_what_to_read() {
        let text = "[[robot]]\nname = \"press-4\"\naddress = \"192.168.1.10\"\nperiod_ms = 50\n\
                    read = [\"Addr-800\", \"counter-1\"]\nmodel = \"brtirus0707a\"\nprofile = \"legacy\"\n\
                    [[robot]]\nname = \"saw\"\naddress = \"saw.hall:9761\"\n";
        let Config { robots, profiles, raw, policy, hall, audit, history, http } = parse(text).unwrap();
        assert!(hall.is_none());
        assert_eq!((history, http), (HistorySettings::default(), HttpSettings::default()));
        assert_eq!(audit, AuditSettings::default());
        assert!(raw.is_empty() && policy.is_none());
        let [press, saw] = &robots[..] else { panic!("{robots:?}") };
        assert_eq!((press.name.as_str(), press.period), ("press-4", Duration::from_millis(50)));
        assert_eq!((press.addresses.len(), press.model.as_deref()), (2, Some("BRTIRUS0707A")));
        assert_eq!(press.parts(), Some(Address::Counter(1)), "the first counter that is read");
        assert_eq!(saw.parts(), None);
        let profiles: Vec<_> =
            profiles.iter().map(|(robot, profile)| (robot, profile.name.as_str())).collect();
        assert_eq!(profiles, [(&press.name, "legacy")]);
        assert_eq!((saw.address.as_str(), saw.period), ("saw.hall:9761", r6_gateway::USUAL_PERIOD));
    }

    #[test]
    fn a_file_names_poll_groups() {
        let robot = "[[robot]]\nname = \"saw\"\naddress = \"a\"\n";
        let text = "[[robot.group]]\nperiod_ms = 50\nread = [\"axis-0\", \"Addr-800\"]\n\
                    [[robot.group]]\nperiod_ms = 10000\nread = [\"counter-0\"]\nkeep = false\ndeadband = 0.5\n";
        let saw = parse(&format!("{robot}{text}")).unwrap().robots.remove(0);
        let [fast, slow] = &saw.groups[..] else { panic!("{saw:?}") };
        assert_eq!(
            (fast.period.as_millis(), fast.addresses.len(), fast.is_kept, fast.deadband),
            (50, 2, true, None)
        );
        assert_eq!((slow.period.as_secs(), slow.is_kept, slow.deadband), (10, false, Some(0.5)));
        assert_eq!(saw.parts(), Some(Address::Counter(0)), "the first counter that is read");
        for (wrong, line, why) in [
            ("period_ms = 19\nread = [\"axis-0\"]\n", "hall.toml:5:", "from 20 to 3600000"),
            ("read = [\"axis-0\"]\n", "hall.toml:", "`period_ms`"),
            ("period_ms = 20\nread = []\n", "hall.toml:6:", "1 to 256 query addresses"),
            ("period_ms = 20\nread = [\"axis-x\"]\n", "hall.toml:6:", "1 to 256 query addresses"),
            ("period_ms = 20\nread = [\"axis-0\"]\ndeadband = -1\n", "hall.toml:7:", "a number from 0"),
            (
                "period_ms = 20\nread = [\"axis-0\"]\nkeeps = true\n",
                "hall.toml:7:",
                "there is no key `keeps`",
            ),
        ] {
            assert_told(&format!("{robot}[[robot.group]]\n{wrong}"), &[(line, why)]);
        }
        let many = "[[robot.group]]\nperiod_ms = 20\nread = [\"axis-0\"]\n".repeat(33);
        assert_told(&format!("{robot}{many}"), &[("hall.toml", "a robot has at most 32 groups")]);
    }

    #[test]
    fn a_file_limits_the_lists_of_a_robot() {
        let robot = "[[robot]]\nname = \"saw\"\naddress = \"a\"\n";
        let guard = "[robot.guard]\nmax_speed = 50\n[robot.guard.workspace]\nz = [100, 900]\n";
        let saw = parse(&format!("{robot}{guard}")).unwrap().robots.remove(0);
        let wanted = Guard::new().max_speed(Percent::new(50.0).unwrap());
        assert_eq!(*saw.guard.unwrap(), wanted.workspace([None, None, Some((100.0, 900.0))]));
        assert!(parse(robot).unwrap().robots[0].guard.is_none());
        assert_told(
            &format!("{robot}[robot.guard]\nmax_sped = 50\n[robot.guard.axes]\nJ1 = [9, -9]\n"),
            &[("hall.toml:5:1", "[robot.guard]: there is no key `max_sped`"), ("hall.toml:7:6", "`J1`")],
        );
    }

    #[test]
    fn a_file_names_the_counter_of_parts() {
        let text =
            "[[robot]]\nname = \"saw\"\naddress = \"a\"\nparts = \"counter-4\"\nread = [\"counter-1\"]\n";
        let saw = parse(text).unwrap().robots.remove(0);
        assert_eq!(saw.parts(), Some(Address::Counter(4)));
        assert!(saw.all_addresses().contains(&Address::Counter(4)), "it is read");
    }

    #[test]
    fn a_file_says_what_is_kept() {
        let text = "[history]\nkeep_days = 7\nmax_mb = 512\n\
                    [[history.deadband]]\naddress = \"axis-0\"\nby = 0.05\n";
        let Config { history, .. } = parse(text).unwrap();
        assert_eq!((history.on, history.keep_days, history.max_bytes), (true, 7, 512 << 20));
        assert_eq!(history.deadband(Address::parse("axis-0").unwrap()), 0.05);
        assert_eq!(history.deadband(Address::parse("axis-1").unwrap()), 0.001);
        assert!(!parse("[history]\nkeep = false\n").unwrap().history.on);
        let days = |text: &str| {
            let history = parse(&format!("[history]\n{text}\n")).unwrap().history;
            (history.keep_minutes_days, history.keep_hours_days)
        };
        assert_eq!(days(""), (90, 1830));
        assert_eq!(days("keep_minutes_days = 20\nkeep_hours_days = 20"), (20, 20));
        assert_eq!(days("keep_minutes_days = 3000"), (3000, 3000), "hours are kept as long as minutes");
    }

    #[test]
    fn a_file_says_how_much_of_the_audit_log_is_kept() {
        let of = |count: u64| parse(&format!("[audit]\nmax_entries = {count}\n"));
        assert_eq!(of(1_000).unwrap().audit.max_entries, 1_000);
        assert_told("[audit]\nmax_entries = 999\n", &[("hall.toml:2:", "from 1000 to 1000000000")]);
        assert_told("[audit]\nkeep_days = 9\n", &[("hall.toml:2:", "`keep_days`")]);
    }

    #[test]
    fn a_file_has_the_time_zone_and_the_shifts() {
        let text = "[hall]\ntime_zone = \"Europe/Berlin\"\n\
                    [[shift]]\nname = \"early\"\ndays = [\"mon\", \"sun\"]\nbegin = \"06:00\"\nend = \"14:00\"\n\
                    [[shift]]\nname = \"night\"\ndays = [\"mon\"]\nbegin = \"22:00\"\nend = \"06:00\"\n";
        let hall = parse(text).unwrap().hall.unwrap();
        let settings = hall.settings();
        assert_eq!((settings.time_zone.as_str(), settings.shifts.len()), ("Europe/Berlin", 2));
        assert_eq!(settings.shifts[0].days, [Weekday::Mon, Weekday::Sun]);
        let zone = parse("[hall]\ntime_zone = \"Asia/Shanghai\"\n").unwrap().hall.unwrap();
        assert!(zone.settings().shifts.is_empty());
    }

    #[test]
    fn every_mistake_of_the_shifts_is_told() {
        let text = "[hall]\ntime_zone = \"Berlin\"\nzone = 1\n\
                    [[shift]]\nname = \"early\"\ndays = [\"monday\"]\nbegin = \"06:00\"\nend = 14\n\
                    [[shift]]\nname = \"A\"\ndays = [\"mon\"]\nbegin = \"6\"\nend = \"14:00\"\n\
                    [[shift]]\nname = \"b\"\ndays = [\"mon\"]\nbegin = \"06:00\"\nend = \"14:00\"\n\
                    [[shift]]\nname = \"c\"\ndays = [\"mon\"]\nbegin = \"13:59\"\nend = \"15:00\"\n";
        assert_told(
            text,
            &[
                ("hall.toml:2:", "`Berlin` is no time zone"),
                ("hall.toml:3:", "`zone`"),
                ("hall.toml:6:", "`days`"),
                ("hall.toml:8:", "`end`"),
                ("hall.toml:10:", "a shift has a name"),
                ("hall.toml:12:", "`6` is not a time"),
                ("hall.toml:22:", "on mon it overlaps with `b`"),
            ],
        );
        let shift = "[[shift]]\nname = \"a\"\ndays = [\"mon\"]\nbegin = \"06:00\"\nend = \"14:00\"\n";
        assert_told(shift, &[("hall.toml:2:", "needs the `time_zone` of [hall]")]);
    }

    #[test]
    fn every_mistake_of_the_history_is_told() {
        let text = "[history]\nkeep = 1\nkeep_days = 0\nmax_mb = 63\nmax_days = 1\n\
                    [[history.deadband]]\naddress = \"axis-99\"\nby = -1\n";
        assert_told(
            text,
            &[
                ("hall.toml:2:", "`keep`"),
                ("hall.toml:3:", "`keep_days`"),
                ("hall.toml:4:", "`max_mb`"),
                ("hall.toml:5:", "`max_days`"),
                ("hall.toml:7:", "`address`"),
                ("hall.toml:8:", "`by`"),
            ],
        );
        assert_told("[history]\nkeep_hours_days = 89\n", &[("hall.toml:2:", "from 90 to 3660")]);
        assert_told("[history]\nkeep_minutes_days = 0\n", &[("hall.toml:2:", "from 1 to 3660")]);
        assert_told("[history]\nkeep_minute_days = 9\n", &[("    nearest: ", "`keep_minutes_days`")]);
        assert_told("history = 3\n", &[("hall.toml:1:", "`history`")]);
    }

    #[test]
    fn a_file_has_raw_ports_and_rules_in_their_order() {
        let text = "[[raw]]\nrobot = \"press-4\"\nlisten = \"192.168.1.2:9760\"\n\
                    [[raw_rule]]\nsource = \"192.168.1.20\"\nallow = \"command\"\nrobot = \"press-4\"\n\
                    max_global_speed = 30\nmax_speed = 20.5\nmax_path_speed = 250\n\
                    commands = [\"AddRCC\", \"startButton\"]\nprograms = [\"press\"]\n\
                    [[raw_rule]]\nsource = \"192.168.1.0/24\"\nallow = \"read\"\ncameras = [0, 12]\n";
        let Config { raw, policy, .. } = parse(text).unwrap();
        assert_eq!(
            (raw[0].robot.as_str(), raw[0].listen.to_string()),
            ("press-4", "192.168.1.2:9760".to_owned())
        );
        let policy = policy.unwrap();
        let of = |address: &str, robot| policy.rule(address.parse().unwrap(), robot).cloned();
        let first = of("192.168.1.20", "press-4").unwrap();
        assert_eq!((first.allow, first.max_global_speed), (RawAllow::Command, Some(30.0)));
        assert_eq!((first.max_speed, first.max_path_speed), (Some(20.5), Some(250)));
        assert_eq!(first.commands.as_deref(), Some(&["AddRCC", "startButton"][..]));
        assert_eq!(first.programs, Some(vec!["press".to_owned()]));
        let second = of("192.168.1.20", "saw").unwrap();
        assert_eq!((second.allow, first.cameras.len()), (RawAllow::Read, 0));
        assert_eq!(second.cameras, [0, 12].map(|number| Camera::new(number).unwrap()));
        assert_eq!(of("10.0.0.1", "press-4"), None);
    }

    /// Each part of a message stands at its line.
    fn assert_told(text: &str, parts: &[(&str, &str)]) {
        let mistakes = parse(text).unwrap_err();
        let lines: Vec<_> = mistakes.lines("hall.toml").collect();
        for (line, part) in parts {
            let is_told = lines.iter().any(|told| told.starts_with(line) && told.contains(part));
            assert!(is_told, "{part}: {lines:#?}");
        }
    }

    #[test]
    fn keys_beside_a_mistake_are_not_unknown() {
        let text = "[[robot]]\nname = \"Press\"\naddress = \"listen:1.2.3.4:1\"\nread = [\"Addr-800\"]\nperiod_ms = 50\n\
                    parts = \"counter-1\"\nmodel = \"brtirus0707a\"\n";
        let mistakes = parse(text).unwrap_err();
        let lines: Vec<_> = mistakes.lines("hall.toml").collect();
        let places: Vec<_> = lines.iter().map(|line| line.split(": ").next().unwrap()).collect();
        assert_eq!(places, ["hall.toml:2:8", "hall.toml:3:11"], "{lines:#?}");
    }

    #[test]
    fn every_mistake_of_a_raw_port_or_a_rule_is_told() {
        let text = "[[raw]]\nrobot = \"a\"\nlisten = \"9760\"\n[[raw]]\nlisten = \"127.0.0.1:0\"\n\
                    [[raw_rule]]\nsource = \"10.0.0.1/8\"\nallow = \"write\"\nmax_global_speed = 101\n\
                    [[raw_rule]]\nallow = \"read\"\nspeed = 3\n\
                    [[raw]]\nrobot = \"b\"\nlisten = \"127.0.0.1:0\"\n\
                    [[raw]]\nrobot = \"b\"\nlisten = \"127.0.0.1:0\"\n\
                    [[raw_rule]]\nsource = \"10.0.0.1\"\nallow = \"read\"\ncameras = [0, 1000]\n\
                    [[raw_rule]]\nsource = \"10.0.0.1\"\nallow = \"deny\"\ncameras = [0]\n\
                    [[raw_rule]]\nsource = \"10.0.0.1\"\nallow = \"command\"\ncommands = [\"startbutton\"]\n";
        assert_told(
            text,
            &[
                ("hall.toml:3:", "`listen`"),
                ("hall.toml:4:", "`robot` is missing"),
                ("hall.toml:7:", "`source`"),
                ("hall.toml:8:", "`allow`"),
                ("hall.toml:9:", "`max_global_speed` is 101"),
                ("hall.toml:10:", "`source` is missing"),
                ("hall.toml:12:", "`speed`"),
                ("hall.toml:17:", "two raw ports"),
                ("hall.toml:22:", "`cameras`"),
                ("hall.toml:26:", "is no camera"),
                ("hall.toml:30:", "`startbutton` is no command that needs the lease; nearest: `startButton`"),
            ],
        );
    }

    #[test]
    fn every_mistake_is_told_with_its_line() {
        let text = "[[robot]]\nname = \"Press 4\"\naddress = \"a:b:c\"\n[[robot]]\nname = \"saw\"\naddress = \"a\"\n\
                    period_ms = 1\nread = [\"axis-99\"]\nx = 1\nmodel = \"X\"\nparts = \"axis-0\"\n\
                    profile = \"hc2\"\n";
        assert_told(
            text,
            &[
                ("hall.toml:2:", "`name` is the text \"Press 4\""),
                ("hall.toml:3:", "`address`"),
                ("hall.toml:7:", "`period_ms` is 1"),
                ("hall.toml:8:", "`read`"),
                ("hall.toml:9:", "`x`"),
                ("hall.toml:10:", "BRTIRUS0707A"),
                ("hall.toml:11:", "`parts`"),
                ("hall.toml:12:", "a profile: hc1, r6-host"),
            ],
        );
        let twice =
            "[[robot]]\nname = \"saw\"\naddress = \"a\"\n[[robot]]\nname = \"saw\"\naddress = \"b\"\n";
        assert!(parse(twice).unwrap_err().first().what.contains("two robots"));
    }
}
