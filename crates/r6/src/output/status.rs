//! The state of a machine, for eyes and for programs.

use r6_client::{Readiness, Status, Unmet, Unproved};
use r6_proto::{AXES, AxisIndex, OperationMode, printable};
use serde_json::{Map, Value, json};

use crate::exit::Failure;
use crate::hint;
use crate::output::alarm;
use crate::output::problem::{self, Code};
use crate::output::table::Table;

/// How many axes and pose components are shown where the controller does not say how many it has.
const USUAL_AXES: usize = 6;

/// The whole state as text; the last lines say whether it takes motion, and if not, why. `remote_program` is one that does nothing but
/// wait for remote commands.
pub fn text(address: &str, status: &Status, remote_program: Option<&str>) -> String {
    let unknown = || "?".to_owned();
    let yes_no = |flag: Option<bool>| flag.map_or("?", |flag| if flag { "yes" } else { "no" });
    let seconds = |time: Option<f64>| time.map_or_else(unknown, |time| format!("{time:.1} s"));
    let mut table = Table::new();
    table.row([&"mode", &status.mode.map_or_else(unknown, |mode| mode.to_string())]);
    table.row([&"alarm", &status.alarm.map_or_else(unknown, alarm::short)]);
    table.row([&"homed", &yes_no(status.homed)]);
    table.row([&"moving", &yes_no(status.moving)]);
    table.row([&"list", &status.list_length.map_or_else(unknown, list_text)]);
    if let Some(program) = &status.program {
        table.row([&"program", program]);
    }
    table.row([&"cycle", &format!("{}, last {}", seconds(status.cycle), seconds(status.last_cycle))]);
    format!(
        "{}\n\n{table}\n\n{}\n\n{}",
        head(address, status),
        positions(status),
        verdict(status, remote_program)
    )
}

fn head(address: &str, status: &Status) -> String {
    let name = status.machine_name.as_deref().unwrap_or("unnamed machine");
    let firmware = status.firmware.as_deref().unwrap_or("unknown");
    let kind = if is_virtual(status) { ", a virtual controller" } else { "" };
    let (name, firmware, address) = (printable(name), printable(firmware), printable(address));
    format!("{name}, firmware {firmware}, at {address}{kind}")
}

/// Whether the machine says of itself, by its name, that it is none.
fn is_virtual(status: &Status) -> bool {
    status.machine_name.as_ref().is_some_and(|name| name.to_lowercase().contains("virtual"))
}

fn list_text(length: i64) -> String {
    match length {
        0 => "empty".to_owned(),
        1 => "1 instruction".to_owned(),
        length => format!("{length} instructions"),
    }
}

fn shown_axes(status: &Status) -> usize {
    let count = status.axis_count.and_then(|count| usize::try_from(count).ok());
    let known = status.axes.iter().rposition(Option::is_some).map_or(0, |last| last + 1);
    count.unwrap_or(USUAL_AXES).min(known.max(USUAL_AXES)).min(AXES)
}

/// Axes and pose of a state, one under the other.
fn positions(status: &Status) -> Table {
    position_table(status.axes.get(..shown_axes(status)).unwrap_or_default(), &status.pose)
}

/// Axes and pose, one under the other, as many axes as are given.
pub fn position_table(axes: &[Option<f64>], pose: &[Option<f64>]) -> Table {
    let mut table = Table::with_right_columns(&[1, 2, 3, 4, 5, 6, 7, 8]);
    let number = |value: &Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"));
    let shown = axes.iter().rposition(Option::is_some).map_or(0, |last| last + 1).max(USUAL_AXES);
    let mut row = |title: &str, cells: Vec<String>| table.push([vec![title.to_owned()], cells].concat());
    row("axis", AxisIndex::ALL.iter().take(shown).map(ToString::to_string).collect());
    row("deg", axes.iter().take(shown).map(number).collect());
    let components = AxisIndex::ALL.iter().take(USUAL_AXES);
    row("pose", components.map(|component| component.world_name().to_owned()).collect());
    row("mm, deg", pose.iter().take(USUAL_AXES).map(number).collect());
    table
}

/// `READY`, `UNKNOWN` with what no value tells, or `NOT READY` with each unmet condition; below what to do about it.
pub fn verdict(status: &Status, remote_program: Option<&str>) -> String {
    match status.readiness(remote_program) {
        Readiness::Ready => "READY".to_owned(),
        Readiness::NotReady(unmet) => not_ready(&unmet),
        Readiness::Unknown(unproved) => {
            let names: Vec<_> = unproved.iter().map(ToString::to_string).collect();
            let mut text = format!("UNKNOWN: {}; all that can be read is met", names.join(", and "));
            for unproved in unproved {
                text.push_str("\n  ");
                text.push_str(&what_to_look_at(unproved, status, remote_program));
            }
            text
        }
    }
}

/// Where to look for what no value tells.
fn what_to_look_at(unproved: Unproved, status: &Status, remote_program: Option<&str>) -> String {
    match unproved {
        Unproved::RemoteStep => {
            let named = match (remote_program, &status.program) {
                (Some(known), Some(found)) => format!("the program is `{found}`, not `{known}`; "),
                (Some(_), None) => "this controller does not tell its program; ".to_owned(),
                (None, Some(found)) => {
                    format!(
                        "if `{found}` only waits for remote commands, --remote-program {found} makes this READY; "
                    )
                }
                (None, None) => String::new(),
            };
            format!(
                "{named}mode 7 says that a program runs, not at which step: look at the pendant; where it is at another step, instructions \
                 are refused or wait, and `r6 run` stops the machine, production program included, when its list is refused"
            )
        }
        Unproved::ListLength => format!(
            "this firmware does not tell the length of the list: what is left in it would run first; `{}` clears it",
            hint::r6("stop")
        ),
    }
}

/// A condition's word for programs.
fn unproved_word(unproved: Unproved) -> &'static str {
    match unproved {
        Unproved::RemoteStep => "remote_step",
        Unproved::ListLength => "list_length",
    }
}

/// `NOT READY:`, the conditions in one line, and a line for each that says what to do.
pub fn not_ready(unmet: &[Unmet]) -> String {
    let mut text = format!("NOT READY: {}", conditions(unmet));
    for unmet in unmet {
        text.push_str("\n  ");
        text.push_str(&advice(*unmet));
    }
    text
}

/// The conditions that are not met, in one line.
pub fn conditions(unmet: &[Unmet]) -> String {
    let names: Vec<_> = unmet.iter().map(|unmet| condition(*unmet).1).collect();
    names.join(", ")
}

/// A condition's word for programs and its name for people.
fn condition(unmet: Unmet) -> (&'static str, String) {
    match unmet {
        Unmet::Mode { found } => ("mode", format!("mode is {found}")),
        Unmet::Alarm { code } => ("alarm", format!("alarm {code}")),
        Unmet::NotHomed => ("not_homed", "not homed".to_owned()),
        Unmet::Moving => ("moving", "moving".to_owned()),
        Unmet::LeftoverList { length } => {
            ("leftover_list", format!("{} left in the list", list_text(length)))
        }
        Unmet::Unknown { address } => ("unknown", format!("{address} unknown")),
    }
}

fn advice(unmet: Unmet) -> String {
    match unmet {
        Unmet::Alarm { code } => {
            format!(
                "alarm {}: {} (`{}`; firmware of manual V6.0 has only clearAlarmContinue and clearAlarmRunNext, which \
                 start the program again)",
                alarm::short(code),
                alarm::advice(code),
                hint::r6("command clearAlarm")
            )
        }
        Unmet::Mode { found: OperationMode::Manual | OperationMode::Stop } => {
            format!(
                "{unmet} (a virtual controller: {}, or type `key auto` at `r6 sim`; then `{}`)",
                hint::at_panel("key auto", "turn the key to auto"),
                hint::r6("command startButton")
            )
        }
        Unmet::Mode { .. } => {
            format!("{unmet} (a virtual controller: `{}`)", hint::r6("command startButton"))
        }
        Unmet::LeftoverList { length } => {
            let are = if length == 1 { "is" } else { "are" };
            format!(
                "{} {are} left in the list and would run first: clear it with `{}`, or wait until it is done",
                list_text(length),
                hint::r6("stop")
            )
        }
        Unmet::Moving => format!("{unmet} (`{}` does both)", hint::r6("stop")),
        Unmet::NotHomed | Unmet::Unknown { .. } => unmet.to_string(),
    }
}

/// Conditions as JSON: a word for programs, what is, and what to do.
pub fn unmet_json(unmet: &[Unmet]) -> Vec<Value> {
    let entry = |unmet: &Unmet| {
        let (word, name) = condition(*unmet);
        json!({ "condition": word, "is": name, "advice": advice(*unmet) })
    };
    unmet.iter().map(entry).collect()
}

/// A pose as JSON, units in the names.
pub fn pose_json(values: &[Option<f64>]) -> Value {
    let mut pose = Map::new();
    for (component, value) in AxisIndex::ALL.iter().zip(values).take(USUAL_AXES) {
        let unit = if component.number() < 3 { "mm" } else { "deg" };
        pose.insert(format!("{}_{unit}", component.world_name().to_lowercase()), json!(value));
    }
    Value::Object(pose)
}

/// The whole state as JSON, units in the names; `null` where the controller has no such value.
///
/// `ready` is `true` where every condition is proved, `false` where one is not met, and else `null`: then `unknown` has what no value tells.
pub fn json(address: &str, status: &Status, remote_program: Option<&str>) -> Value {
    let pose = pose_json(&status.pose);
    let axes: Vec<_> = status.axes.iter().take(shown_axes(status)).collect();
    let unknown: Vec<_> = status.unproved(remote_program).into_iter().map(unproved_word).collect();
    let ready = match status.readiness(remote_program) {
        Readiness::Ready => Some(true),
        Readiness::NotReady(_) => Some(false),
        Readiness::Unknown(_) => None,
    };
    let conditions = status.unmet();
    let problem = (!conditions.is_empty()).then(|| {
        let what = format!("NOT READY: {}", self::conditions(&conditions));
        problem::object(&Failure::refused(what).with_code(Code::NotReady))
    });
    let unmet = unmet_json(&conditions);
    let mut json = json!({
        "robot": address,
        "machine_name": status.machine_name,
        "virtual": is_virtual(status),
        "firmware": status.firmware,
        "program": status.program,
        "mode": status.mode.map(r6_client::OperationMode::number),
        "mode_name": status.mode.map(|mode| mode.to_string()),
        "alarm": status.alarm,
        "alarm_text": status.alarm.filter(|code| *code != 0).map(alarm::short),
        "homed": status.homed,
        "moving": status.moving,
        "list_length": status.list_length,
        "axis_count": status.axis_count,
        "axes_deg": axes,
        "pose": pose,
        "cycle_s": status.cycle,
        "last_cycle_s": status.last_cycle,
        "ready": ready,
        "unmet": unmet,
        "unknown": unknown,
    });
    if let Some(problem) = problem {
        json["problem"] = problem;
    }
    json
}

#[cfg(test)]
mod tests {
    use r6_client::OperationMode;

    use super::*;

    fn ready() -> Status {
        Status {
            firmware: Some("v1.1".to_owned()),
            machine_name: Some("r6 virtual BRTIRUS0707A".to_owned()),
            program: Some("remote".to_owned()),
            mode: Some(OperationMode::Running),
            alarm: Some(0),
            homed: Some(true),
            moving: Some(false),
            axis_count: Some(6),
            axes: [Some(0.0), Some(10.0), Some(-20.5), Some(0.0), Some(30.0), Some(0.0), None, None],
            pose: [Some(400.0), Some(-50.0), Some(500.0), Some(180.0), Some(0.0), Some(0.0), None, None],
            list_length: Some(0),
            cycle: Some(1.25),
            last_cycle: None,
        }
    }

    #[test]
    fn a_ready_machine_ends_with_ready() {
        let text = text("127.0.0.1:9760", &ready(), Some("remote"));
        let mut lines = text.lines();
        assert_eq!(
            lines.next(),
            Some("r6 virtual BRTIRUS0707A, firmware v1.1, at 127.0.0.1:9760, a virtual controller")
        );
        assert_eq!(lines.next_back(), Some("READY"));
        assert!(text.contains("mode     running (7)"), "{text}");
        assert!(text.contains("list     empty"), "{text}");
        assert!(text.contains("deg        0.000   10.000  -20.500"), "{text}");
    }

    #[test]
    fn every_unmet_condition_is_named_and_has_its_advice() {
        let status = Status {
            mode: Some(OperationMode::Stop),
            alarm: Some(42),
            homed: None,
            list_length: Some(3),
            ..ready()
        };
        let text = verdict(&status, None);
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(
            lines.first(),
            Some(&"NOT READY: 3 instructions left in the list, alarm 42, origin unknown, mode is stop (3)")
        );
        assert_eq!(lines.len(), 5);
        let one = verdict(&Status { list_length: Some(1), ..ready() }, None);
        assert!(one.contains("  1 instruction is left in the list and would run first"), "{one}");
        assert!(text.contains("clearAlarm") && text.contains("r6 stop"), "{text}");
    }

    #[test]
    fn a_list_that_is_not_told_is_not_called_ready() {
        let status = Status { list_length: None, ..ready() };
        let text = text("127.0.0.1:9760", &status, Some("remote"));
        assert!(text.contains("list     ?") && !text.contains("READY"), "{text}");
        let first = "UNKNOWN: whether instructions are left in the list; all that can be read is met\n  ";
        assert!(text.contains(first), "{text}");
        assert!(text.contains("r6 stop"), "{text}");
        let json = json("127.0.0.1:9760", &status, Some("remote"));
        assert_eq!((&json["ready"], &json["unknown"]), (&Value::Null, &json!(["list_length"])));
    }

    /// No value tells the step of a program; a program that is known to do nothing but wait is proof where its name is told.
    #[test]
    fn a_program_that_may_be_at_any_step_is_not_called_ready() {
        let status = ready();
        let unnamed = Status { program: None, ..ready() };
        for (status, known, words) in [
            (&unnamed, None, "look at the pendant"),
            (&unnamed, Some("remote"), "does not tell its program"),
            (&status, None, "--remote-program remote"),
            (&status, Some("wait"), "the program is `remote`, not `wait`"),
        ] {
            let text = text("127.0.0.1:9760", status, known);
            let (_, verdict) = text.split_once("UNKNOWN: whether the program sits in its ").unwrap();
            assert!(verdict.contains(words), "{text}");
            assert_ne!(text.lines().next_back(), Some("READY"));
            let json = json("127.0.0.1:9760", status, known);
            assert_eq!((&json["ready"], &json["unknown"]), (&Value::Null, &json!(["remote_step"])));
            assert_eq!(json["unmet"], json!([]));
        }
        let both = Status { list_length: None, ..unnamed };
        assert_eq!(super::json("", &both, None)["unknown"], json!(["remote_step", "list_length"]));
        assert_eq!(verdict(&both, None).lines().count(), 3);
    }

    #[test]
    fn json_has_units_in_its_names() {
        let json = json("127.0.0.1:9760", &ready(), Some("remote"));
        assert_eq!(json["pose"]["x_mm"], 400.0);
        assert_eq!(json["pose"]["u_deg"], 180.0);
        assert_eq!(json["axes_deg"].as_array().map(Vec::len), Some(6));
        assert_eq!(json["last_cycle_s"], Value::Null);
        assert_eq!((&json["ready"], &json["unknown"]), (&true.into(), &json!([])));
        let moving = Status { moving: Some(true), ..ready() };
        assert_eq!(super::json("", &moving, None)["ready"], false);
    }
}
