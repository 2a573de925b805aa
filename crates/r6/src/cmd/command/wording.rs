//! Describes in words what a command did: values with their units, signals by name, and the numbers on the
//! wire.

use r6_proto::dialect::Addressing;
use r6_proto::io_point::{IoPoint, PointKind};
use r6_proto::{Command, Request};

/// What the command asks for; `None` if its name is enough.
pub fn words(command: &Command<'_>) -> Option<String> {
    let keeps = |savable: bool| if savable { "kept over a power cut" } else { "not kept over a power cut" };
    Some(match command {
        Command::ModifyGspd { percent } => format!("global speed {percent} %"),
        Command::ModifyAccDec { acceleration, deceleration } => {
            format!("acceleration within {acceleration} s, deceleration within {deceleration} s")
        }
        Command::ModifyTool { tool, offset: [x, y, z, rx, ry, rz] } => {
            format!("tool {tool}: X {x} mm, Y {y} mm, Z {z} mm, RX {rx} deg, RY {ry} deg, RZ {rz} deg")
        }
        Command::ModifyStackData { stack, spacing: [dx, dy, dz], count: [nx, ny, nz] } => {
            format!("stack {stack}: {nx} x {ny} x {nz}, {dx} mm, {dy} mm and {dz} mm apart")
        }
        Command::ModifyOutput { board, point, on } => {
            let state = if *on { "on" } else { "off" };
            match IoPoint::of_command(*board, *point) {
                Some(named) => format!("point {point} of {} = {named}, {state}", bank(named)),
                None => format!("board {board}, point {point}, {state}"),
            }
        }
        Command::RewriteData { register, value, savable } => {
            format!("register {} = {value}, {}", register.number(), keeps(*savable))
        }
        Command::RewriteDataList { first, savable, values } => {
            let values: Vec<_> = values.iter().map(ToString::to_string).collect();
            format!("registers from {} = {}, {}", first.number(), values.join(", "), keeps(*savable))
        }
        Command::ModifyCounter { id, current, target } => {
            let told =
                |count: &Option<u32>| count.map_or_else(|| "as it was".to_owned(), |count| count.to_string());
            format!("counter {id}: count {}, target {}", told(current), told(target))
        }
        Command::SwitchMold { mold } => format!("program `{mold}`"),
        Command::SwitchTool { tool } => format!("tool {tool}"),
        Command::SwitchCoordinate { workbench } => format!("workbench {workbench}"),
        Command::ClearAlarmWith { first_line, only_alarm } => {
            let yes_no = |flag: &bool| if *flag { "yes" } else { "no" };
            format!("to the first line: {}, only the alarm: {}", yes_no(first_line), yes_no(only_alarm))
        }
        // The name is enough, or the arguments on the wire are shown.
        _ => return None,
    })
}

/// The arguments as sent, read from the encoded frame.
pub fn on_the_wire(command: &Command<'_>) -> Vec<String> {
    let mut frame = Vec::new();
    let encoded = Request::Command(command).encode(&Addressing::default(), &mut frame);
    let value = encoded.ok().and_then(|()| serde_json::from_slice::<serde_json::Value>(&frame).ok());
    let data = value.as_ref().and_then(|value| value.get("cmdData")?.as_array());
    let words = data.into_iter().flatten().skip(1);
    words.filter_map(|word| word.as_str().map(str::to_owned)).collect()
}

/// Whether the numbers on the wire differ from those on the command line, so that both are shown.
pub fn is_scaled(command: &Command<'_>) -> bool {
    command.name().info().arguments.iter().any(|argument| argument.kind.is_scaled())
}

/// Board and point of `modifyOutput` for a signal, or why the command cannot set it.
pub fn for_command(named: IoPoint) -> Result<(u8, u8), String> {
    named.for_command().ok_or_else(|| match named.kind {
        PointKind::X | PointKind::Eux => format!("{named} is an input, and is not set"),
        PointKind::Y | PointKind::M | PointKind::Euy => {
            format!("{named} cannot be set by this command: it has boards 0 to 3 of Y and 0 to 2 of M")
        }
    })
}

/// The bank of a signal: `Y`, `Y, board 1`.
fn bank(named: IoPoint) -> String {
    let letters = named.kind.letters();
    if named.board == 0 { letters.to_owned() } else { format!("{letters}, board {}", named.board) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_scaled_is_told_with_its_unit_and_as_the_wire_has_it() {
        let slow = Command::ModifyGspd { percent: 5.0 };
        assert_eq!(words(&slow).as_deref(), Some("global speed 5 %"));
        assert_eq!(on_the_wire(&slow), ["50"]);
        let ramps = Command::ModifyAccDec { acceleration: 0.2, deceleration: 0.35 };
        assert_eq!(words(&ramps).as_deref(), Some("acceleration within 0.2 s, deceleration within 0.35 s"));
        assert_eq!(on_the_wire(&ramps), ["200", "350"]);
        assert_eq!(words(&Command::ActionStop), None);
    }

    #[test]
    fn an_output_is_told_by_its_name() {
        let said = |board, point| words(&Command::ModifyOutput { board, point, on: true }).unwrap();
        assert_eq!(said(0, 10), "point 10 of Y = Y022, on");
        assert_eq!(said(1, 0), "point 0 of Y, board 1 = Y1.010, on");
        assert_eq!(said(4, 3), "point 3 of M = M013, on");
        for wrong in ["X010", "EUX010", "Y4.010", "M3.010"] {
            assert!(for_command(wrong.parse().unwrap()).is_err(), "{wrong}");
        }
    }
}
