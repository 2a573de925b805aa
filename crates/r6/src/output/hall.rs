//! Robots as a gateway knows them.

use r6_api::AddressValue;
use r6_api::gateway::{LeaseHolder, RobotLink, RobotState, RobotSummary, Robots, SignalQuality};
use r6_proto::{Address, OperationMode, printable};
use serde_json::{Value, json};

use crate::by_gateway::ListedRobot;
use crate::exit::Exit;
use crate::hint;
use crate::output::table::Table;
use crate::output::{alarm, problem, readings};

/// 1 if a robot cannot be reached, is stopped, or was exchanged.
pub fn exit<'a>(mut robots: impl Iterator<Item = &'a RobotSummary>) -> Exit {
    let is_fine = |robot: &RobotSummary| {
        robot.link == RobotLink::Up && !robot.stopped && robot.identity_changed.is_none()
    };
    if robots.all(is_fine) { Exit::Done } else { Exit::Refused }
}

/// The same for a list of all robots; 3 if no gateway answers for one of them. `read`: those whose state was
/// read.
pub fn exit_of_all(robots: &Robots, read: &[ListedRobot]) -> Exit {
    if read.iter().any(|robot| robot.no_owner.is_some()) { Exit::NoReply } else { exit(robots.robots.iter()) }
}

/// The list of all robots for programs. A robot that no gateway answers for has the member `problem`.
pub fn object(robots: &Robots, read: &[ListedRobot]) -> Value {
    let mut object = json!(robots);
    let listed = object["robots"].as_array_mut().into_iter().flatten();
    for (robot, summary) in listed.zip(&robots.robots) {
        let read = read.iter().find(|read| read.state.summary.name == summary.name);
        if let Some(failure) = read.and_then(|read| read.no_owner.as_ref()) {
            robot["problem"] = json!(problem::of(failure));
        }
    }
    object
}

/// A table of all robots.
pub fn robots(robots: &[ListedRobot]) -> String {
    if robots.is_empty() {
        return "the gateway has no robot that this token may see".to_owned();
    }
    let mut table = Table::new();
    table.row([&"ROBOT", &"ADDRESS", &"LINK", &"MODE", &"ALARM", &"LEASE", &"STATE"]);
    for ListedRobot { state: told, no_owner } in robots {
        let robot = &told.summary;
        let (mode, alarm) = (mode(told), alarm(told));
        if no_owner.is_some() {
            let stop = if robot.stopped { "STOPPED; " } else { "" };
            let state = format!("{stop}NO GATEWAY answers for it at the moment");
            table.row([&robot.name, &robot.address, &"-", &mode, &alarm, &"-", &state]);
            continue;
        }
        let lease = lease(robot.lease.as_ref());
        table.row([&robot.name, &robot.address, &link(robot), &mode, &alarm, &lease, &state(robot)]);
    }
    table.to_string()
}

/// One robot with its values.
pub fn robot(told: &RobotState) -> String {
    let robot = &told.summary;
    let mut head = Table::new();
    head.row([&"link", &link(robot)]);
    if let Some(identity) = &robot.identity {
        let unknown = || "?".to_owned();
        let name = identity.machine_name.clone().unwrap_or_else(unknown);
        let firmware = identity.firmware.clone().unwrap_or_else(unknown);
        head.row([&"machine", &format!("{name}, firmware {firmware}")]);
    }
    head.row([&"model", &robot.model.as_deref().unwrap_or("not configured")]);
    if let Some(real) = &robot.twin_of {
        head.row([&"twin of", &format!("{} (this one is virtual)", printable(real))]);
    }
    if let Some(twin) = &robot.twin {
        head.row([&"twin", &printable(twin)]);
    }
    head.row([&"mode", &mode(told)]);
    head.row([&"alarm", &alarm(told)]);
    head.row([&"lease", &lease(robot.lease.as_ref())]);
    head.row([&"state", &state(robot)]);
    let mut values = Table::with_right_columns(&[1, 4]);
    values.row([&"ADDRESS", &"VALUE", &"UNIT", &"QUALITY", &"AGE"]);
    for signal in &told.signals {
        let told = |value: &AddressValue| readings::told(&signal.address, value.clone());
        let value = signal.value.as_ref().map_or_else(|| "-".to_owned(), told);
        let quality = match signal.quality {
            SignalQuality::Fresh => "fresh",
            SignalQuality::Stale => "STALE",
            SignalQuality::None => "none",
        };
        let age = signal.age_ms.map_or_else(String::new, |age| format!("{age} ms"));
        values.row([&signal.address, &value, &signal.unit.as_deref().unwrap_or(""), &quality, &age]);
    }
    let name = format!("{} at {}", printable(&robot.name), printable(&robot.address));
    let mut text = format!("{name}\n\n{head}\n\n{values}");
    if robot.stopped {
        text.push_str(&format!("\n\na stop holds; `{}` clears it", hint::r6("stop --clear")));
    }
    text
}

fn link(robot: &RobotSummary) -> &'static str {
    match robot.link {
        RobotLink::Up => "up",
        RobotLink::Down => "DOWN",
    }
}

fn mode(robot: &RobotState) -> String {
    number(robot, Address::CurMode, |number| OperationMode::of_number(number).to_string())
}

fn alarm(robot: &RobotState) -> String {
    number(robot, Address::CurAlarm, alarm::short)
}

/// A number in words. What was read once and may be wrong by now is marked; `-` without a value.
fn number(robot: &RobotState, address: Address, words: impl Fn(i64) -> String) -> String {
    let signal = robot.signals.iter().find(|signal| signal.address == address.to_string());
    let Some((signal, Some(AddressValue::Integer(number)))) = signal.map(|signal| (signal, &signal.value))
    else {
        return "-".to_owned();
    };
    match signal.quality {
        SignalQuality::Fresh => words(*number),
        SignalQuality::Stale | SignalQuality::None => format!("{}, OLD", words(*number)),
    }
}

fn lease(lease: Option<&LeaseHolder>) -> String {
    match lease {
        None => "free".to_owned(),
        Some(held) => format!("{}, {} s left", held.holder, held.expires_in_ms.div_ceil(1000)),
    }
}

fn state(robot: &RobotSummary) -> &'static str {
    match robot {
        RobotSummary { identity_changed: Some(_), .. } => "ANOTHER ROBOT answers",
        RobotSummary { stops_under_way: 1.., .. } => "a stop is under way",
        RobotSummary { stopped: true, .. } => "STOPPED",
        _ => "not stopped",
    }
}
