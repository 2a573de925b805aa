//! Changes of inputs while a program is played: `X010=on@2.5s`.

use std::time::Duration;

use r6_plot::play::InputChange;
use r6_proto::io_point::{IoPoint, PointKind};

/// The format, for errors.
const WANTED: &str = "write it as X010=on@2.5s: the input's name, on or off, and when";

/// Reads `X010=on`, `X1.047=off@2.5s`. Without a time the change is at the beginning.
pub fn input_change(text: &str) -> Result<InputChange, String> {
    let (name, rest) = text.split_once('=').ok_or(WANTED)?;
    let (state, at) = match rest.split_once('@') {
        None => (rest, Duration::ZERO),
        Some((state, "0" | "0s")) => (state, Duration::ZERO),
        Some((state, at)) => (state, crate::units::duration(at)?),
    };
    let on = match state {
        "on" | "1" => true,
        "off" | "0" => false,
        _ => return Err(WANTED.to_owned()),
    };
    let (board, point) = input(name).ok_or_else(|| {
        format!("`{name}` is no input: X010 to X047, or X1.010 to X7.047 of the other boards")
    })?;
    Ok(InputChange { at, board, point, on })
}

/// Board and point of an input by the name on its terminal: octal, from 010 on.
fn input(name: &str) -> Option<(u8, u8)> {
    let points = (0..8).flat_map(|board| (0..32).map(move |point| (board, point)));
    points.into_iter().find(|(board, point)| name_of(*board, *point).eq_ignore_ascii_case(name))
}

/// The name of an input on its terminal.
fn name_of(board: u8, point: u8) -> String {
    IoPoint { kind: PointKind::X, board, point }.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_have_their_names_and_times() {
        let change =
            |at, board, point, on| Ok(InputChange { at: Duration::from_millis(at), board, point, on });
        assert_eq!(input_change("X010=on@2.5s"), change(2500, 0, 0, true));
        assert_eq!(input_change("x047=off"), change(0, 0, 31, false));
        assert_eq!(input_change("X1.011=1@100ms"), change(100, 1, 1, true));
        assert_eq!(input_change("X010=0@0"), change(0, 0, 0, false));
    }

    #[test]
    fn wrong_ones_say_what_is_wanted() {
        for (text, wanted) in [
            ("X010", "write it as X010=on@2.5s"),
            ("X010=high", "write it as"),
            ("X018=on", "`X018` is no input"),
            ("Y010=on", "`Y010` is no input"),
            ("X010=on@soon", "write a time as"),
        ] {
            let error = input_change(text).unwrap_err();
            assert!(error.contains(wanted), "{text}: {error}");
        }
    }
}
