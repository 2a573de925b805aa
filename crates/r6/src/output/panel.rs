//! What an operator sees at a virtual machine, as text.

use r6_api::panel::{Axis, Snapshot};
use r6_proto::printable;

use crate::output::table::Table;

/// The whole state.
pub fn text(state: &Snapshot) -> String {
    let yes_no = |flag| if flag { "yes" } else { "no" };
    let mut table = Table::new();
    table.row([&"mode", &state.mode_name]);
    table.row([&"alarm", &alarm(state)]);
    table.row([&"emergency stop", &if state.emergency_stop { "PRESSED" } else { "released" }]);
    table.row([&"homed", &yes_no(state.homed)]);
    table.row([&"moving", &yes_no(state.moving)]);
    table.row([&"ready", &ready(state)]);
    table.row([&"program", &format!("{} (of {})", state.program, state.programs.join(", "))]);
    if let Some(step) = &state.step {
        table
            .row([&"step", &format!("{} of {} in {}: {}", step.number, step.steps, step.program, step.text)]);
    }
    table.row([&"list", &state.list_length]);
    table.row([&"global speed", &format!("{:.1} %", state.global_speed_percent)]);
    table.row([&"cycle", &format!("{:.1} s, last {:.1} s", state.cycle_seconds, state.last_cycle_seconds)]);
    table.row([&"inputs on", &points(&state.inputs_on)]);
    table.row([&"outputs on", &points(&state.outputs_on)]);
    table.row([&"M on", &points(&state.m_on)]);
    table.row([&"camera points", &camera_points(state)]);
    table.row([&"faults", &faults(state)]);
    table.row([&"connections", &state.connections]);
    format!(
        "{}, firmware {}, controller {} at {}, a virtual controller\n\n{table}\n\n{}",
        printable(&state.machine_name),
        printable(&state.firmware),
        state.number,
        printable(&state.address),
        axes(&state.axes)
    )
}

/// The result of an action, in one line.
pub fn summary(state: &Snapshot) -> String {
    let motion = if state.moving { "moving" } else { "at rest" };
    let pressed = if state.emergency_stop { ", EMERGENCY STOP pressed" } else { "" };
    let alarm = if state.alarm == 0 { "no alarm".to_owned() } else { format!("alarm {}", alarm(state)) };
    let (number, address) = (state.number, &state.address);
    printable(&format!(
        "controller {number} at {address}: mode {}, {alarm}, {motion}{pressed}",
        state.mode_name
    ))
    .to_string()
}

fn alarm(state: &Snapshot) -> String {
    match &state.alarm_text {
        Some(text) => format!("{} ({text})", state.alarm),
        None => "none".to_owned(),
    }
}

fn ready(state: &Snapshot) -> String {
    match state.not_ready.first() {
        None => "READY".to_owned(),
        Some(reason) => format!("NOT READY: {reason}"),
    }
}

fn camera_points(state: &Snapshot) -> String {
    let counts: Vec<_> = state
        .camera_points
        .iter()
        .map(|waiting| format!("camera {}: {}", waiting.camera, waiting.points))
        .collect();
    if counts.is_empty() { "none waiting".to_owned() } else { counts.join(", ") }
}

/// The faults in force, each with the number by which it is ended.
fn faults(state: &Snapshot) -> String {
    let power = state.power_off.then(|| "the power is cut".to_owned());
    let faults = state.faults.iter().map(|fault| {
        let kind = fault.kind.as_ref().map(|kind| format!(" ({kind})")).unwrap_or_default();
        let left = fault.seconds_left.map(|left| format!(", ends in {left:.1} s")).unwrap_or_default();
        format!("{} {}{kind}{left}", fault.number, fault.fault)
    });
    let told: Vec<_> = power.into_iter().chain(faults).collect();
    if told.is_empty() { "none".to_owned() } else { told.join("; ") }
}

fn points(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(" ") }
}

fn axes(axes: &[Axis]) -> Table {
    let mut table = Table::with_right_columns(&[1, 3, 4]);
    table.row([&"axis", &"position", &"", &"lowest", &"highest"]);
    for axis in axes {
        // A value that rounds to zero has no sign.
        let position = if axis.position.abs() < 0.0005 { 0.0 } else { axis.position };
        table.row([
            &axis.name,
            &format!("{position:.3}"),
            &axis.unit.word(),
            &format!("{:.0}", axis.lowest),
            &format!("{:.0}", axis.highest),
        ]);
    }
    table
}
