//! Lines on stdin of `r6 sim`, from a person or a script: inputs, photos, the mode key.

use std::io::{BufRead, IsTerminal, Read};
use std::time::Duration;

use r6_controller::{Key, PanelAction};
use r6_sim::ControllerHandle;

use crate::exit::Failure;
use crate::output;

/// The longest line that is read. The longest valid line has about 30 bytes.
const MAX_LINE_BYTES: u64 = 256;

/// How often a program in the background checks whether it is in the foreground now.
const FOREGROUND_CHECK: Duration = Duration::from_secs(1);

const WORDS: &str = "there are: input BOARD POINT on|off, photo CAM, key auto|manual|stop";

/// What a line asks for.
#[derive(Clone, Debug, PartialEq)]
enum Wish {
    Act(PanelAction),
    Photo { cam_id: i64 },
}

/// Starts to read lines, on a thread that lives as long as the program, because a read from a terminal cannot
/// be cancelled. The end of the input does not end the program.
pub fn listen(controllers: Vec<ControllerHandle>) -> Result<(), Failure> {
    let begun = std::thread::Builder::new().name("stdin".to_owned()).spawn(move || obey(&controllers));
    begun.map(drop).map_err(|error| Failure::usage(format!("the system gives no threads: {error}")))
}

fn obey(controllers: &[ControllerHandle]) {
    let mut bytes = Vec::new();
    loop {
        // Reading a terminal from the background would suspend the whole program.
        while std::io::stdin().is_terminal() && in_background() {
            std::thread::sleep(FOREGROUND_CHECK);
        }
        bytes.clear();
        match std::io::stdin().lock().take(MAX_LINE_BYTES).read_until(b'\n', &mut bytes) {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        if !bytes.ends_with(b"\n") && bytes.len() as u64 == MAX_LINE_BYTES {
            output::note(format_args!("r6: a line has {MAX_LINE_BYTES} bytes at most: it was left out"));
            if std::io::stdin().lock().skip_until(b'\n').is_err() {
                return;
            }
            continue;
        }
        let line = String::from_utf8_lossy(&bytes);
        if line.trim().is_empty() {
            continue;
        }
        match read(&line, controllers.len()) {
            Err(problem) => output::note(format_args!("r6: {problem}")),
            Ok((index, wish)) => {
                let Some(controller) = controllers.get(index) else { continue };
                match wish {
                    Wish::Act(action) => {
                        if let Err(refused) = controller.operate(&action) {
                            output::note(format_args!("r6: {refused}"));
                        }
                    }
                    Wish::Photo { cam_id } => controller.request_photo(cam_id),
                }
            }
        }
    }
}

/// Returns the index of the controller, counted from 0, and what the line asks for.
fn read(line: &str, count: usize) -> Result<(usize, Wish), String> {
    let (index, rest) = match line.split_once(':') {
        Some((number, rest)) => {
            let index = number.trim().parse::<usize>().ok().filter(|number| (1..=count).contains(number));
            let index =
                index.ok_or_else(|| format!("there is no controller `{}`: 1: to {count}:", number.trim()))?;
            (index - 1, rest)
        }
        None if count > 1 => return Err(format!("begin with the controller that is meant, 1: to {count}:")),
        None => (0, line),
    };
    let words: Vec<_> = rest.split_whitespace().collect();
    let wish = match words.as_slice() {
        ["input", board, point, state] => Wish::Act(PanelAction::SetInput {
            board: up_to("BOARD", board, 7)?,
            point: up_to("POINT", point, 31)?,
            on: match *state {
                "on" => true,
                "off" => false,
                _ => return Err(format!("an input is on or off, not `{state}`")),
            },
        }),
        ["photo", cam] => {
            Wish::Photo { cam_id: cam.parse().map_err(|_| format!("CAM is a whole number, not `{cam}`"))? }
        }
        ["key", "auto"] => Wish::Act(PanelAction::TurnKey(Key::Auto)),
        ["key", "manual"] => Wish::Act(PanelAction::TurnKey(Key::Manual)),
        ["key", "stop"] => Wish::Act(PanelAction::TurnKey(Key::Stop)),
        ["key", ..] => return Err("wanted: key auto|manual|stop".to_owned()),
        ["input", ..] => return Err("wanted: input BOARD POINT on|off".to_owned()),
        ["photo", ..] => return Err("wanted: photo CAM".to_owned()),
        _ => return Err(format!("unknown line `{}`; {WORDS}", rest.trim())),
    };
    Ok((index, wish))
}

fn up_to(name: &str, word: &str, last: u8) -> Result<u8, String> {
    let value = word.parse().ok().filter(|value| *value <= last);
    value.ok_or_else(|| format!("{name} is a whole number from 0 to {last}, not `{word}`"))
}

/// Whether another process group has the terminal. Known on Linux only; elsewhere `false`.
fn in_background() -> bool {
    // `pid (name) state parent group session terminal foreground-group …`; the name may contain any
    // character.
    let Ok(stat) = std::fs::read_to_string("/proc/self/stat") else { return false };
    let fields: Vec<_> = stat.rsplit_once(')').map_or("", |(_, fields)| fields).split_whitespace().collect();
    match (fields.get(2), fields.get(5)) {
        (Some(group), Some(foreground)) => group != foreground,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_name_what_and_where() {
        let input = |board, point, on| Wish::Act(PanelAction::SetInput { board, point, on });
        assert_eq!(read("input 0 31 on\n", 1), Ok((0, input(0, 31, true))));
        assert_eq!(read(" 3: input 7 0 off", 3), Ok((2, input(7, 0, false))));
        assert_eq!(read("key manual", 1), Ok((0, Wish::Act(PanelAction::TurnKey(Key::Manual)))));
        assert_eq!(read("1:photo -2", 1), Ok((0, Wish::Photo { cam_id: -2 })));
    }

    #[test]
    fn what_is_wrong_is_named_in_one_line() {
        for (line, count, wanted) in [
            ("photo 1", 2, "begin with the controller that is meant, 1: to 2:"),
            ("0: photo 1", 2, "there is no controller `0`: 1: to 2:"),
            ("3: photo 1", 2, "there is no controller `3`: 1: to 2:"),
            (
                "fly",
                1,
                "unknown line `fly`; there are: input BOARD POINT on|off, photo CAM, key auto|manual|stop",
            ),
            ("input 8 0 on", 1, "BOARD is a whole number from 0 to 7, not `8`"),
            ("input 0 32 on", 1, "POINT is a whole number from 0 to 31, not `32`"),
            ("input 0 0 1", 1, "an input is on or off, not `1`"),
            ("input 0", 1, "wanted: input BOARD POINT on|off"),
            ("photo", 1, "wanted: photo CAM"),
            ("key remote", 1, "wanted: key auto|manual|stop"),
            ("photo x", 1, "CAM is a whole number, not `x`"),
        ] {
            assert_eq!(read(line, count), Err(wanted.to_owned()), "{line}");
        }
    }
}
