//! The state of a machine, for people and for programs.

use r6_api::position::SHOWN_AXES;
use r6_client::{Readiness, Status, Unmet, Unproved};
use r6_proto::{AxisIndex, OperationMode, printable};
use serde_json::{Value, json};

use crate::hint;
use crate::output::alarm;
use crate::output::table::Table;

/// The state for programs (`docs/COMMAND_LINE.md`). `remote_program` names a program that only waits for
/// remote commands.
pub fn told(address: &str, status: &Status, remote_program: Option<&str>) -> r6_api::Status {
    let unreadable = status.list_is_unreadable;
    r6_api::Status::read(address, remote_program, unreadable, |address| status.reading(address))
}

/// The whole state as text. The last lines say whether the machine takes motion, and if not, why.
pub fn text(address: &str, status: &Status, remote_program: Option<&str>) -> String {
    let unknown = || "?".to_owned();
    let yes_no = |flag: Option<bool>| flag.map_or("?", |flag| if flag { "yes" } else { "no" });
    let seconds = |time: Option<f64>| time.map_or_else(unknown, |time| format!("{time:.1} s"));
    let told = told(address, status, remote_program);
    let mut table = Table::new();
    table.row([&"mode", &told.mode_name.as_deref().unwrap_or("?")]);
    table.row([&"alarm", &told.alarm.map_or_else(unknown, alarm::short)]);
    table.row([&"homed", &yes_no(told.homed)]);
    table.row([&"moving", &yes_no(told.moving)]);
    table.row([&"list", &told.list_length.map_or_else(unknown, list_text)]);
    if let Some(program) = &told.program {
        table.row([&"program", program]);
    }
    table.row([&"cycle", &format!("{}, last {}", seconds(told.cycle_s), seconds(told.last_cycle_s))]);
    let axes = status.axes.get(..told.axes.len()).unwrap_or_default();
    format!(
        "{}\n\n{table}\n\n{}\n\n{}",
        head(&told),
        position_table(axes, &status.pose),
        verdict(status, remote_program)
    )
}

fn head(told: &r6_api::Status) -> String {
    let name = told.machine_name.as_deref().unwrap_or("unnamed machine");
    let firmware = told.firmware.as_deref().unwrap_or("unknown");
    let kind = if told.r#virtual { ", a virtual controller" } else { "" };
    let (name, firmware, address) = (printable(name), printable(firmware), printable(&told.robot));
    format!("{name}, firmware {firmware}, at {address}{kind}")
}

fn list_text(length: i64) -> String {
    match length {
        0 => "empty".to_owned(),
        1 => "1 instruction".to_owned(),
        length => format!("{length} instructions"),
    }
}

/// A table of axes above the pose, with at least the usual number of axes. The wire does not say whether an
/// axis turns or slides.
pub fn position_table(axes: &[Option<f64>], pose: &[Option<f64>]) -> Table {
    let mut table = Table::with_right_columns(&[1, 2, 3, 4, 5, 6, 7, 8]);
    let number = |value: &Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"));
    let shown = axes.iter().rposition(Option::is_some).map_or(0, |last| last + 1).max(SHOWN_AXES);
    let mut row = |title: &str, cells: Vec<String>| table.push([vec![title.to_owned()], cells].concat());
    row("axis", AxisIndex::ALL.iter().take(shown).map(ToString::to_string).collect());
    row("deg or mm", axes.iter().take(shown).map(number).collect());
    let components = AxisIndex::ALL.iter().take(SHOWN_AXES);
    row("pose", components.map(|component| component.world_name().to_owned()).collect());
    row("mm, deg", pose.iter().take(SHOWN_AXES).map(number).collect());
    table
}

/// `READY`, `UNKNOWN` with the conditions that no value proves, or `NOT READY` with each unmet condition.
/// Lines below say what to do.
pub fn verdict(status: &Status, remote_program: Option<&str>) -> String {
    match status.readiness(remote_program) {
        Readiness::Ready => "READY".to_owned(),
        Readiness::NotReady(unmet) => {
            let other = unmet.contains(&Unmet::OtherProgram).then_some((&status.program, remote_program));
            let named = match other {
                Some((Some(found), Some(known))) => format!("\n  it runs `{found}`, not `{known}`"),
                _ => String::new(),
            };
            not_ready(&unmet) + &named
        }
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

/// Advice for a condition that no value proves: where to look.
fn what_to_look_at(unproved: Unproved, status: &Status, remote_program: Option<&str>) -> String {
    match unproved {
        Unproved::RemoteStep => {
            let named = match (remote_program, &status.program) {
                (Some(_), None) => "this controller does not tell its program; ".to_owned(),
                (None, Some(found)) => format!(
                    "if you know that `{found}` only waits for remote commands, say so: --remote-program {found}; "
                ),
                (Some(_), Some(_)) | (None, None) => String::new(),
            };
            format!(
                "{named}mode 7 says that a program runs, not at which step: look at the pendant. If it is at another step, do not use \
                 `r6 move` or `r6 run`: the controller refuses the list, and `r6` then stops the machine, its production program too"
            )
        }
        Unproved::ListLength => format!(
            "this firmware does not tell the length of the list: what is left in it would run first; `{}` clears it",
            hint::r6("stop")
        ),
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
    let names: Vec<_> = unmet.iter().map(|unmet| r6_api::Unmet::of(unmet).is).collect();
    names.join(", ")
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
        Unmet::OtherProgram => {
            format!("{unmet} by --remote-program: look at the pendant, and choose the program there")
        }
        Unmet::Mode { .. } => unmet.to_string(),
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

/// Unmet conditions as JSON.
pub fn unmet_json(unmet: &[Unmet]) -> Value {
    json!(unmet.iter().map(r6_api::Unmet::of).collect::<Vec<_>>())
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
            list_is_unreadable: false,
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
        let axes = text.lines().find(|line| line.starts_with("deg or mm")).unwrap();
        assert!(axes.contains("  0.000   10.000  -20.500  "), "{axes}");
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
    }

    /// No value says at which step a program is. A program that only waits is proof if the controller tells
    /// its name.
    #[test]
    fn a_program_that_may_be_at_any_step_is_not_called_ready() {
        let status = ready();
        let unnamed = Status { program: None, ..ready() };
        for (status, known, words) in [
            (&unnamed, None, "look at the pendant"),
            (&unnamed, Some("remote"), "does not tell its program"),
            (&status, None, "--remote-program remote"),
        ] {
            let text = text("127.0.0.1:9760", status, known);
            let (_, verdict) = text.split_once("UNKNOWN: whether the program sits in its ").unwrap();
            assert!(verdict.contains(words), "{text}");
            assert_ne!(text.lines().next_back(), Some("READY"));
        }
        let other = verdict(&status, Some("wait"));
        assert!(other.starts_with("NOT READY: another program\n"), "{other}");
        assert!(other.contains("it runs `remote`, not `wait`"), "{other}");
        let both = Status { list_length: None, ..unnamed };
        assert_eq!(verdict(&both, None).lines().count(), 3);
    }

    #[test]
    fn programs_are_told_what_people_are_told() {
        let told = told("127.0.0.1:9760", &ready(), Some("remote"));
        assert_eq!((told.ready, told.r#virtual, told.axes.len()), (Some(true), true, 6));
        assert_eq!((told.axes[2].position, told.pose.x_mm), (Some(-20.5), Some(400.0)));
        assert_eq!((told.cycle_s, told.last_cycle_s), (Some(1.25), None));
        assert_eq!(told.program.as_deref(), Some("remote"));
    }
}
