//! `r6 plot`: draws the motion of a program, without a robot.

mod inputs;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use r6_controller::{ControllerSettings, Program};
use r6_plot::play::{self, Cell, InputChange, Limits};
use r6_plot::{Ending, Picture, PlayError, Recording, words};
use r6_program::{FileKind, MotionProgram};

use crate::cmd::sim::given;
use crate::cmd::{job, run};
use crate::exit::{Exit, Failure};
use crate::output::problem::{self, Code};
use crate::output::{self, plot};
use crate::units;

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

FILE holds instructions, as for `r6 run`, or a taught program ([[step]] tables, docs/PROGRAMS.md), as \
for `r6 sim --program`. A list that repeats is drawn once, and so is a taught program: one pass from \
its first step.

The times are those at which the controller counts an instruction or a step as done. A blended move \
has begun in the corner before that. Steps that take no time have no number in the picture.

Outputs, M points and inputs that change have a row each, with a bar while they are on.

An alarm, or a wait for a signal that never comes, ends the picture there: it is named with the \
number of its instruction or step, and the exit code is 1. Inputs are off unless --input sets them.

Examples:
  r6 plot examples/programs/square.toml                             writes examples/programs/square.svg
  r6 plot examples/programs/blend-j1.json --out blend.svg --global-speed 50
  r6 plot examples/programs/square-linear.json --from 0,10,-20,0,-80,0
  r6 plot examples/programs/io-and-wait.json --input X010=on@2.5s
  r6 plot examples/taught/pick.toml --input X010=on@1s              one pass of a taught program
  r6 plot examples/programs/square.toml --json | jq .duration_s
  r6 plot - --out - < examples/programs/square.toml > square.svg"
)]
pub struct PlotArgs {
    /// Instructions, as `r6 run` takes them, or a taught program: .json or .toml, or - for stdin
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
    let source = source(&args.file)?;
    let settings =
        ControllerSettings { global_speed: args.global_speed, ..ControllerSettings::new(profile, model) };
    let cell = Cell {
        settings: settings.clone(),
        from: args.from.clone(),
        inputs: args.input.clone(),
        limits: Limits::default(),
    };
    let mut progress = Progress::begin();
    let recording = play(cell, source, &mut |seconds| progress.show(seconds))?;
    progress.clear();
    let trouble = words::trouble(&recording);
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
    report(&args, &settings, &recording, &out, failure.as_ref());
    failure.map_or(Ok(Exit::Done), Err)
}

/// Whether both names lead to the same existing file.
fn is_same_file(one: &Path, other: &Path) -> bool {
    match (std::fs::canonicalize(one), std::fs::canonicalize(other)) {
        (Ok(one), Ok(other)) => one == other,
        (Ok(_) | Err(_), _) => false,
    }
}

/// What a file holds.
enum Source {
    Motion(MotionProgram),
    Program(Box<Program>),
}

/// Reads the file, which says by its contents what it holds. A list that repeats runs once.
fn source(file: &Path) -> Result<Source, Failure> {
    let text = run::read_text(file)?;
    match FileKind::of(&text) {
        FileKind::Instructions => {}
        FileKind::Taught => {
            let stem = file.file_stem().and_then(|stem| stem.to_str()).filter(|_| !run::is_stdin(file));
            let program = given::program_of(&text, stem.unwrap_or("program"), &run::name(file))?;
            return Ok(Source::Program(Box::new(program)));
        }
        FileKind::Neither => {
            return Err(Failure::usage(format!(
                "{} has neither instructions nor the steps of a taught program",
                run::name(file)
            ))
            .advise(
                "instructions for `r6 run` are [[instruction]] tables or AddRCC frames; a taught program has [[step]] tables",
            ));
        }
    }
    let mut program = run::read_program(file, &text)?;
    run::show_remarks(&program, file);
    if job::repeats(&program.lists) {
        output::note("r6: this list repeats until it is stopped; it is drawn once");
        program.run_once();
    }
    Ok(Source::Motion(program))
}

fn play(cell: Cell, source: Source, progress: &mut dyn FnMut(f64)) -> Result<Recording, Failure> {
    let recording = match source {
        Source::Motion(MotionProgram { lists, .. }) => {
            let append = lists.first().is_some_and(|list| !list.replace);
            play::motion(cell, &job::in_frames(lists), append, progress)
        }
        Source::Program(program) => play::program(cell, &program, progress),
    };
    recording.map_err(|error| match error {
        PlayError::StartNotReached { alarm, why } => {
            Failure::usage(format!("--from cannot be reached: alarm {alarm}: {why}"))
        }
        PlayError::FrameRefused { .. } => Failure::refused(error),
        _ => Failure::usage(error),
    })
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
        words::summary(recording),
        settings.profile.name,
        args.global_speed
    );
    r6_plot::svg(&Picture {
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
    out: &Path,
    failure: Option<&Failure>,
) {
    let to_stdout = out == Path::new("-");
    if args.json {
        let mut figures = plot::json(recording, &settings.model);
        figures.insert("profile".to_owned(), settings.profile.name.as_str().into());
        figures.insert("global_speed_percent".to_owned(), args.global_speed.into());
        figures.insert("picture".to_owned(), out.display().to_string().into());
        figures.extend(failure.map(|failure| ("problem".to_owned(), problem::object(failure))));
        output::json(&figures);
        return;
    }
    let text = format!(
        "{}\n\n{}\n\n{}",
        plot::turn_table(recording),
        plot::axis_table(recording, &settings.model),
        words::summary(recording)
    );
    if to_stdout {
        output::note(text);
    } else {
        output::line(format_args!("{text}\npicture: {}", out.display()));
    }
}

fn advice(recording: &Recording) -> String {
    match &recording.ending {
        Ending::Alarm(alarm) => output::alarm::advice(i64::from(alarm.code)).to_owned(),
        Ending::Waiting => {
            "--input X010=on@2.5s switches an input; a wait with a limit ends with an alarm".to_owned()
        }
        Ending::Done | Ending::TooLong => "give it shorter waits and faster moves".to_owned(),
        Ending::Endless => "a pass ends at the last step or at a step `end`: let it get there".to_owned(),
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
