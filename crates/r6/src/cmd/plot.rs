//! `r6 plot`: draws the motion of a program, without a robot.

mod inputs;
mod playback;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use r6_controller::ControllerSettings;
use r6_proto::message::Instruction;

use self::inputs::InputChange;
use self::playback::Cell;
use crate::cmd::sim::given;
use crate::cmd::{job, run};
use crate::exit::{Exit, Failure};
use crate::output::drawing::{self, Picture};
use crate::output::problem::{self, Code};
use crate::output::{self, plot};
use crate::recording::Recording;
use crate::units;
use r6_program::MotionProgram;

/// After this time the terminal shows progress.
const PATIENCE: Duration = Duration::from_secs(1);

/// How often the terminal shows progress.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(200);

/// Draw what a program does: axis positions, axis speeds and tool path, without a robot
#[derive(Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
The program runs on a virtual controller and a virtual clock: it takes no time, and no robot is \
asked. The picture is an SVG file, which every browser shows. It is written over without asking.

The times are those at which the controller counts an instruction as done. A blended move has begun \
in the corner before that. A list that repeats is drawn once.

An alarm, or a wait for a signal that never comes, ends the picture there: it is named with the \
number of its instruction, and the exit code is 1. Inputs are off unless --input sets them.

Examples:
  r6 plot examples/programs/square.toml                             writes examples/programs/square.svg
  r6 plot examples/programs/blend-j1.json --out blend.svg --global-speed 50
  r6 plot examples/programs/square-linear.json --from 0,10,-20,0,-80,0
  r6 plot examples/programs/io-and-wait.json --input X010=on@2.5s
  r6 plot examples/programs/square.toml --json | jq .duration_s
  r6 plot - --out - < examples/programs/square.toml > square.svg"
)]
pub struct PlotArgs {
    /// The program, as `r6 run` takes it: .json or .toml, or - for stdin
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The picture; - writes it to stdout [default: FILE with .svg at its end]
    #[arg(long, short, value_name = "FILE.svg", required_if_eq("file", "-"))]
    out: Option<PathBuf>,
    /// The arm: BRTIRUS0707A, 0805A, 1510A, 1820A or 2030A, GENERIC-SCARA, GENERIC-CARTESIAN, or a .toml file
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "BRTIRUS0707A")]
    model: String,
    /// The firmware: hc1, r6-host, r6-pendant, legacy, or a .toml file that changes one of them
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "hc1")]
    profile: String,
    /// The controller's global speed
    #[arg(long, value_name = "PERCENT", default_value = "100", value_parser = units::speed_percent)]
    global_speed: f64,
    /// Where the axes stand at the beginning, degrees or mm with commas between; 0 for those that are not
    /// given
    #[arg(
        long,
        value_name = "J1,J2,…",
        value_delimiter = ',',
        num_args = 1,
        allow_negative_numbers = true,
        allow_hyphen_values = true,
        value_parser = units::coordinate
    )]
    from: Vec<f64>,
    /// Switch an input, such as X010=on@2.5s; may be given several times
    #[arg(long, value_name = "INPUT=on|off[@TIME]", value_parser = inputs::input_change)]
    input: Vec<InputChange>,
    /// Print one JSON object: figures, instructions, and the series that was drawn
    #[arg(long)]
    json: bool,
}

/// Plays the program, draws it, and prints its figures.
pub fn run(args: PlotArgs) -> Result<Exit, Failure> {
    let out = args.out.clone().unwrap_or_else(|| args.file.with_extension("svg"));
    let to_stdout = out == Path::new("-");
    if to_stdout && args.json {
        return Err(Failure::usage("picture and JSON cannot both go to stdout").advise("give --out a file"));
    }
    if is_same_file(&out, &args.file) {
        return Err(Failure::usage(format!(
            "{} is the program: the picture would take its place",
            out.display()
        ))
        .advise("give --out a name that ends in .svg"));
    }
    let (profile, model) = (given::profile(&args.profile)?, given::model(&args.model)?);
    if args.from.len() > model.axis_count() {
        return Err(Failure::usage(format!(
            "--from has {} numbers, but {} has {} axes",
            args.from.len(),
            model.name,
            model.axis_count()
        )));
    }
    let program = program(&args.file)?;
    let instructions: Vec<Instruction> =
        program.lists.iter().flat_map(|list| &list.instructions).copied().collect();
    let settings =
        ControllerSettings { global_speed: args.global_speed, ..ControllerSettings::new(profile, model) };
    let cell = Cell { settings: settings.clone(), from: args.from.clone(), inputs: args.input.clone() };
    let mut progress = Progress::begin();
    let recording = playback::play(cell, program.lists, &mut |seconds| progress.show(seconds))?;
    progress.clear();
    let trouble = plot::trouble(&recording, &instructions);
    let picture = draw(&args, &settings, &recording, trouble.as_deref());
    if to_stdout {
        output::bytes(picture.as_bytes());
    } else {
        std::fs::write(&out, &picture)
            .map_err(|error| Failure::usage(format!("{} cannot be written: {error}", out.display())))?;
    }
    let failure = trouble.map(|trouble| {
        Failure::refused(trouble).with_code(Code::NotFinished).advise(advice(&recording)).told()
    });
    report(&args, &settings, &recording, &instructions, &out, failure.as_ref());
    failure.map_or(Ok(Exit::Done), Err)
}

/// Whether both names lead to the same existing file.
fn is_same_file(one: &Path, other: &Path) -> bool {
    match (std::fs::canonicalize(one), std::fs::canonicalize(other)) {
        (Ok(one), Ok(other)) => one == other,
        (Ok(_) | Err(_), _) => false,
    }
}

/// Reads the program. A list that repeats runs once.
fn program(file: &Path) -> Result<MotionProgram, Failure> {
    let mut program = run::read(file)?;
    run::show_remarks(&program, file);
    if job::repeats(&program.lists) {
        output::note("r6: this list repeats until it is stopped; it is drawn once");
        program.run_once();
    }
    Ok(program)
}

fn draw(
    args: &PlotArgs,
    settings: &ControllerSettings,
    recording: &Recording,
    trouble: Option<&str>,
) -> String {
    let name = run::name(&args.file);
    // The picture shows the file's name without its folder, because the picture may be passed on.
    let name = args.file.file_name().map_or(name, |name| name.to_string_lossy().into_owned());
    let name = if args.file == Path::new("-") { "program".to_owned() } else { name };
    let subtitle = format!(
        "{}; profile {}, global speed {} %",
        plot::summary(recording),
        settings.profile.name,
        args.global_speed
    );
    drawing::svg(&Picture {
        title: &format!("{name} on {}", settings.model.name),
        subtitle: &subtitle,
        trouble,
        model: &settings.model,
        recording,
    })
}

fn report(
    args: &PlotArgs,
    settings: &ControllerSettings,
    recording: &Recording,
    instructions: &[Instruction],
    out: &Path,
    failure: Option<&Failure>,
) {
    let to_stdout = out == Path::new("-");
    if args.json {
        let mut figures = plot::json(recording, &settings.model, instructions);
        if let Some(figures) = figures.as_object_mut() {
            figures.insert("profile".to_owned(), settings.profile.name.as_str().into());
            figures.insert("global_speed_percent".to_owned(), args.global_speed.into());
            figures.insert("picture".to_owned(), out.display().to_string().into());
            figures.extend(failure.map(|failure| ("problem".to_owned(), problem::object(failure))));
        }
        output::json(&figures);
        return;
    }
    let text = format!(
        "{}\n\n{}\n\n{}",
        plot::turn_table(recording, instructions),
        plot::axis_table(recording, &settings.model),
        plot::summary(recording)
    );
    if to_stdout {
        output::note(text);
    } else {
        output::line(format_args!("{text}\npicture: {}", out.display()));
    }
}

fn advice(recording: &Recording) -> String {
    match &recording.ending {
        crate::recording::Ending::Alarm(alarm) => output::alarm::advice(alarm.code).to_owned(),
        crate::recording::Ending::Waiting => {
            "--input X010=on@2.5s switches an input; a wait with a limit ends with an alarm".to_owned()
        }
        crate::recording::Ending::Done | crate::recording::Ending::TooLong => {
            "give it shorter waits and faster moves".to_owned()
        }
    }
}

/// Shows the progress of a long program on a terminal.
struct Progress {
    /// When to show it next; `None` if stderr is no terminal.
    next: Option<Instant>,
    shown: bool,
}

impl Progress {
    fn begin() -> Self {
        let next = std::io::stderr().is_terminal().then(|| Instant::now() + PATIENCE);
        Self { next, shown: false }
    }

    fn show(&mut self, seconds: f64) {
        let now = Instant::now();
        if self.next.is_some_and(|next| next <= now) {
            output::rewrite_line(format_args!("{seconds:.1} s of the program"));
            self.next = Some(now + PROGRESS_INTERVAL);
            self.shown = true;
        }
    }

    fn clear(&self) {
        if self.shown {
            output::clear_line();
        }
    }
}
