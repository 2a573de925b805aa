//! Fuzzes the files that users write. Any text is accepted, or refused with a reason and a place. An accepted
//! file runs for a while without a panic and within the limits of the arm. A file that is written again reads
//! the same.
//!
//! An input is a byte for the kind of file, and its text.

use r6_client::{Motion, RobotSettings, RunOptions};
use r6_controller::{Controller, ControllerSettings, Library, Profile, Program, RobotModel, Scenario};
use r6_program::{Mistakes, MotionProgram};
use r6_proto::time::Instant;
use r6_proto::{Body, Decoder};

use crate::controller::cell::Cell;
use crate::controller::model::Model;
use crate::input::Input;
use crate::written::same_instructions;

/// The kinds, and the first byte of an input of each.
pub const KINDS: [(u8, &str); 6] = [
    (b'P', "a taught program"),
    (b'T', "a file of `r6 run` in TOML"),
    (b'J', "a file of `r6 run` in JSON"),
    (b'M', "a robot model"),
    (b'S', "a scenario"),
    (b'F', "a profile"),
];

/// The maximum length of a text. Longer texts only cost time, and the limits of each kind have their own
/// tests.
const MOST_BYTES: usize = 32 * 1024;

/// How long an accepted file runs, in s of the controller's time.
const RUNS: f64 = 4.0;

/// How often the arm is checked while time passes.
const LOOKS: u32 = 10;

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let kind = input.byte();
    let Ok(text) = std::str::from_utf8(input.rest()) else { return };
    if text.len() > MOST_BYTES {
        return;
    }
    match kind {
        b'P' => program(text),
        b'T' => program_file(text, MotionProgram::from_toml(text)),
        b'J' => program_file(text, MotionProgram::from_json(text)),
        b'M' => model(text),
        b'S' => scenario(text),
        b'F' => profile(text),
        _ => {}
    }
}

fn settings() -> ControllerSettings {
    ControllerSettings::new(Profile::hc1(), RobotModel::default())
}

/// Runs a controller, queries all its values and sends it work.
fn runs(settings: ControllerSettings) {
    let model = Model::new(&settings);
    let mut cell = Cell::around(Controller::new(settings, Instant::ORIGIN), Instant::ORIGIN);
    model.hold_within_limits(&mut cell);
    passes(&mut cell, &model, RUNS / 2.0);
    cell.ask_everything();
    cell.work();
    model.hold_within_limits(&mut cell);
    passes(&mut cell, &model, RUNS / 2.0);
}

/// Lets time pass, and checks the arm in between.
fn passes(cell: &mut Cell, model: &Model, seconds: f64) {
    for _ in 0..LOOKS {
        cell.pass(seconds / f64::from(LOOKS));
        model.hold_within_limits(cell);
    }
}

fn program(text: &str) {
    let program = match Program::read("tried", text) {
        Ok(program) => program,
        Err(mistakes) => return are_of(text, &mistakes),
    };
    assert_eq!(Program::read("tried", program.text()).as_ref(), Ok(&program));
    let mut library = Library::default();
    library.insert(program).expect("there is room for one more");
    runs(ControllerSettings { library, mold: "tried".to_owned(), ..settings() });
}

/// Checks that every mistake is at a place of the text.
fn are_of(text: &str, mistakes: &Mistakes) {
    let lines = text.split('\n').count();
    for mistake in mistakes.iter() {
        assert!(!mistake.what.is_empty());
        if let Some((line, column)) = mistake.at {
            assert!((1..=lines).contains(&line) && column > 0, "{mistake} is at no place of the text");
        }
    }
}

fn program_file(text: &str, read: Result<MotionProgram, Mistakes>) {
    let file = match read {
        Ok(file) => file,
        Err(mistakes) => return are_of(text, &mistakes),
    };
    let settings = settings();
    let model = Model::new(&settings);
    let mut cell = Cell::around(Controller::new(settings, Instant::ORIGIN), Instant::ORIGIN);
    for list in file.lists {
        let options = RunOptions { append: !list.replace, room: usize::MAX, ..RunOptions::default() };
        let (motion, settings) = (Motion::of_list(list.instructions), RobotSettings::default());
        // Values that the wire cannot carry are refused before anything is sent.
        let Ok(lists) = motion.lists(&settings, options) else { continue };
        let steps = motion.instructions().expect("it was cut");
        let parts: Vec<_> = lists.iter().map(|list| &steps[list.clone()]).collect();
        assert_eq!(parts.concat(), steps, "cut into frames it is another list");
        let frames = motion.frames(&settings, options).expect("it was encoded to be cut");
        for (part, frame) in parts.into_iter().zip(frames) {
            let mut decoder = Decoder::new();
            let message = decoder.decode(&frame).unwrap_or_else(|error| panic!("{error}"));
            let Body::AddRcc(read) = message.body else { panic!("{}", frame.escape_ascii()) };
            same_instructions(part, read.instructions);
            cell.send(&frame);
            cell.pass(0.1);
            model.hold_within_limits(&mut cell);
        }
    }
    passes(&mut cell, &model, RUNS);
}

fn model(text: &str) {
    let model = match RobotModel::from_toml(text) {
        Ok(model) => model,
        Err(mistakes) => return are_of(text, &mistakes),
    };
    assert!((1..=6).contains(&model.axis_count()));
    for drive in model.drives() {
        assert!(drive.soft.min <= drive.soft.max && drive.max_speed > 0.0 && drive.max_speed.is_finite());
    }
    runs(ControllerSettings::new(Profile::hc1(), model));
}

fn scenario(text: &str) {
    match Scenario::read(text) {
        Ok(scenario) => {
            assert_eq!(Scenario::read(text).as_ref(), Ok(&scenario));
            runs(ControllerSettings { scenario: Some(scenario.into()), ..settings() });
        }
        Err(mistakes) => are_of(text, &mistakes),
    }
}

fn profile(text: &str) {
    match Profile::from_toml(text) {
        Ok(profile) => {
            assert_eq!(Profile::from_toml(text).as_ref(), Ok(&profile));
            runs(ControllerSettings::new(profile, RobotModel::default()));
        }
        Err(mistakes) => are_of(text, &mistakes),
    }
}
