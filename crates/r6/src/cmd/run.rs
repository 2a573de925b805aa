//! `r6 run`: sends the instructions of a file.

pub mod by_gateway;
mod kept;

use std::path::{Path, PathBuf};

use clap::Args;
use r6_client::RunOptions;
use r6_program::{MAX_FILE_BYTES, MotionProgram};

use crate::cmd::job::{self, JobArgs};
use crate::cmd::run::kept::{Kept, sha256};
use crate::exit::{Exit, Failure};
use crate::output;
use crate::robot::RobotArgs;
use crate::text_file;

/// The default of [`RunOptions::room`].
const USUAL_ROOM: u16 = 24;

/// Send the instructions of a file
#[derive(Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
FILE.json holds AddRCC frames as the manual prints them, // comments included, in any accepted \
spelling or shape; they are checked, and sent in one strict form.

FILE.toml is written by people: one [[instruction]] table for each step, in order.
  repeat = false          true: the list starts over, for ever
  append = false          true: append to the instruction list instead of replacing it
  [[instruction]]
  do = \"axis-move\"        to = [degrees of J1, J2, …]
  do = \"linear-move\"      to = [X, Y, Z] or [X, Y, Z, U, V, W], mm and degrees
  do = \"curve-move\"       through = [X, Y, Z, U, V, W], to = [X, Y, Z, U, V, W]
                          each move needs its speed (percent), and can have blend (0-9),
                          delay (seconds before), mask (0x3F), tool, work_frame
  do = \"wait\"             seconds; or: point, until (\"on\", \"off\", \"rising\", \"falling\";
                          on if left out), limit (seconds)
  do = \"output\"           point, on, delay (seconds before); or pulse (seconds)
  do = \"board-output\"     set = [\"Y010\", \"Y011\"], clear = [points], all of one board
  do = \"stop-on-signal\"   point, on (true if left out); watch = false ends it
                          a point has its name on the pendant (octal): \"X010\", \"M010\",
                          \"EUX010\"; on board 1 \"X1.010\". Numbers of points (with source,
                          kind and board) are an older spelling: it is read, with a hint
  do = \"path-speed\"       mm_per_s; without it the path speed is switched off
  do = \"workbench\"        number

The machine is looked at first, as for `r6 move`. A program that replaces the list and does not \
repeat is streamed: in frames of at most 8 instructions and 2048 bytes, each sent once and never \
again, as the controller has room, while the arm moves. With --wait, r6 waits until the end \
is proved, and ends a motion in which nothing goes on for 5 s. Without --wait, it ends once the last \
frame was accepted, and the arm finishes what is in its list. A list that repeats has to fit \
as a whole, and so does what --append sends, all at once and without looking at what is left in \
the list. A wait without a limit waits for ever.

With --wait the last line tells what proves the end (\"proof\" in --json): the arm stands where the \
last move ends (\"reached\"); or that cannot be compared (another tool or work frame), and the \
controller was seen to work through its list (\"consumed\"); or the list has no move, the arm stands \
and the list is empty (\"at_rest\"). Where an input that `stop-on-signal` watches ended the last move \
early, the line says CUT SHORT (\"cut_short\", with the axis, where it should be and where it is). \
The exit code is 0 then, too, because the program asked for it: a script that has to know looks at \
\"proof\". How far a list of --append is cannot be seen. Where its end cannot be compared with where \
the arm stands, or an input may have cut it short, nothing proves that it was carried out: exit code 4.

Ctrl-C and --timeout end the streaming: nothing more is sent, the arm finishes its list, and the \
last line tells how much that is; with --stop-on-interrupt the arm is stopped instead. When a \
streamed motion fails (alarm, stop, refusal, unknown outcome, nothing goes on), the arm is stopped \
and its list cleared, and the last line tells what became of the steps and of the arm.

The exit code of a motion that failed is 1 if the arm was then seen to stand. It is 4 if the arm was \
not seen to stand, or was left to finish its list. It is 4, even if the arm stands, if it is not \
known which steps were carried out:
  - The list is gone, and nothing proves that all of it was carried out.
  - The outcome of a frame is unknown.
  - The controller was lost, or refused, after it had taken a part.

FILE.toml of --guard has limits; what is left out is not limited:
  max_speed = 50          percent, of each move          max_path_speed = 500    mm/s
  max_axis_step = 90      degrees in one axis move       max_distance = 400      mm in one move of the tool
  [axes]                  J1 = [-120, 120]               degrees; [axes_mm] for axes that slide
  [workspace]             x = [250, 700]                 y, z likewise, mm; for moves of the tool
Axis limits are checked on axis moves, the workspace on moves of the tool. The distance of the first \
move is measured from the present position (--dry-run does not check it). If a file \
mixes axis moves and moves of the tool, leave out max_axis_step and max_distance: after an axis move \
the place of the tool is unknown, and after a move of the tool the axes are, so the file is refused.

With --gateway-url the gateway runs the program: it feeds the steps, and stops the arm if this program no \
longer renews the lease. r6 follows the run to its end, with --wait or without. Ctrl-C stops the arm. Only \
--json goes with it; its events are \"accepted\", \"progress\" and \"ended\", each with the run. In place of FILE, \
--kept names a program that the gateway keeps. Without a version it is the latest one, which somebody may have \
stored meanwhile: --sha256 refuses the run if its text is another than you looked at. A run whose answer was \
lost is never asked for again: look at the arm.

--json prints a line for each list that was accepted (event \"accepted\"), at most two a second on \
how many steps are done (\"progress\"), and one for the outcome: \"stands\" with --wait, \
\"not_sent\" with the conditions that are not met, or \"failed\" with the exit code, the steps and \
the stop.

Examples:
  r6 run examples/programs/square.toml --wait
  r6 run examples/programs/square.toml --wait --timeout 5m --stop-on-interrupt
  r6 run examples/programs/square.toml --guard examples/guard.toml --max-speed 20 --wait
  r6 run examples/programs/blend-j1.json --wait
  r6 run examples/programs/manual-6-1-1-axis-move.json --once --wait
  r6 run examples/programs/square.toml --dry-run       the frames that would be sent
  r6 run - --wait < examples/programs/square.toml      from stdin, JSON or TOML
  r6 -g http://127.0.0.1:9780 -r press-4 run examples/programs/square.toml
  r6 -g http://127.0.0.1:9780 -r press-4 run --kept pick@3"
)]
pub struct RunArgs {
    /// The program: .json or .toml, or - for stdin
    #[arg(value_name = "FILE", required_unless_present = "kept", conflicts_with = "kept")]
    file: Option<PathBuf>,
    /// Run a program that the gateway keeps: its latest version, or this one (with --gateway-url)
    #[arg(long, value_name = "NAME[@VERSION]")]
    kept: Option<Kept>,
    /// Run the program of --kept only if its text has this SHA-256, 64 hexadecimal digits
    #[arg(long, value_name = "HEX", value_parser = sha256)]
    sha256: Option<String>,
    /// Run a list that repeats only once
    #[arg(long)]
    once: bool,
    /// How many instructions the controller's list holds; a longer program is streamed as the list gets room
    #[arg(long, value_name = "INSTRUCTIONS", default_value_t = USUAL_ROOM, value_parser = clap::value_parser!(u16).range(1..=1000))]
    room: u16,
    #[command(flatten)]
    job: JobArgs,
}

impl RunArgs {
    /// Refuses an option that would have no effect: with a file, `requires` of clap does not count.
    fn check(&self) -> Result<(), Failure> {
        if self.sha256.is_some() && self.kept.is_none() {
            return Err(Failure::usage("--sha256 goes with --kept alone, so nothing was sent")
                .advise("a file on this computer is read once: what you see there is what runs"));
        }
        Ok(())
    }
}

/// Prints the remarks on a program.
pub fn show_remarks(program: &MotionProgram, file: &Path) {
    let name = name(file);
    for remark in &program.remarks {
        output::note(format_args!("r6: {name}: {remark}"));
    }
}

/// The file's name in messages.
pub fn name(file: &Path) -> String {
    if is_stdin(file) { "stdin".to_owned() } else { file.display().to_string() }
}

/// Whether the file is stdin.
pub fn is_stdin(file: &Path) -> bool {
    file == Path::new("-")
}

/// Reads the file and sends its instructions.
pub async fn run(args: RunArgs, robot: RobotArgs) -> Result<Exit, Failure> {
    args.check()?;
    let Some(file) = &args.file else {
        return Err(Failure::usage("--kept is for the programs that a gateway keeps")
            .advise("name the gateway with --gateway-url URL; a controller runs the program of a file"));
    };
    let mut program = read(file)?;
    show_remarks(&program, file);
    if args.job.append
        && let Some(first) = program.lists.first_mut()
    {
        first.replace = false;
    }
    if args.once {
        program.run_once();
    }
    if args.job.wait && job::repeats(&program.lists) {
        return Err(Failure::usage(format!(
            "{} repeats until it is stopped, so there is no end to wait for",
            name(file)
        ))
        .advise("add --once to run it once"));
    }
    let options = RunOptions { room: usize::from(args.room), ..RunOptions::default() };
    job::carry_out(&args.job, program.lists, options, &robot).await
}

/// Reads a program from a file, or from stdin.
///
/// # Errors
/// The file cannot be read, or is wrong. The error says where and what.
pub fn read(file: &Path) -> Result<MotionProgram, Failure> {
    read_program(file, &read_text(file)?)
}

/// Reads a program from the text of a file, or of stdin.
///
/// # Errors
/// The text is wrong. The error says where and what.
pub fn read_program(file: &Path, text: &str) -> Result<MotionProgram, Failure> {
    let program = match file.extension().and_then(|extension| extension.to_str()) {
        _ if is_stdin(file) => MotionProgram::read(text),
        Some("json") => MotionProgram::from_json(text),
        Some(_) | None => MotionProgram::from_toml(text),
    };
    program.map_err(|mistakes| Failure::in_file(&name(file), &mistakes))
}

/// Reads the text of a file, or of stdin.
///
/// # Errors
/// The file's name does not end in .json or .toml, or it cannot be read.
pub fn read_text(file: &Path) -> Result<String, Failure> {
    if is_stdin(file) {
        let text = text_file::read_from(std::io::stdin().lock(), "stdin", "a program", MAX_FILE_BYTES);
        return text.map_err(Failure::usage);
    }
    if !file.extension().is_some_and(|extension| extension == "json" || extension == "toml") {
        return Err(Failure::usage(format!("{}: a program ends in .json or .toml", name(file))));
    }
    text_file::read(file, "a program", MAX_FILE_BYTES)
        .map_err(|problem| Failure::usage(problem).while_doing(file.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_room_of_the_help_is_the_usual_one() {
        assert_eq!(usize::from(USUAL_ROOM), RunOptions::default().room);
    }
}
