//! Motions and taught programs are played and drawn.

use std::time::Duration;

use r6_client::Motion;
use r6_client::units::{AxisPosition, Percent};
use r6_controller::{ControllerSettings, Profile, Program, RobotModel};
use r6_plot::play::{self, Cell, InputChange, Limits};
use r6_plot::{Ending, Picture, PlayError, Recording, words};

fn cell() -> Cell {
    let model = RobotModel::named("BRTIRUS0707A").unwrap().clone();
    let settings = ControllerSettings::new(Profile::named("hc1").unwrap(), model);
    Cell { settings, from: Vec::new(), inputs: Vec::new(), limits: Limits::default() }
}

fn switched(at: u64, point: u8) -> Cell {
    let change = InputChange { at: Duration::from_millis(at), board: 0, point, on: true };
    Cell { inputs: vec![change], ..cell() }
}

fn played(cell: Cell, text: &str) -> Recording {
    attempt(cell, "cell", text).unwrap()
}

fn attempt(cell: Cell, name: &str, text: &str) -> Result<Recording, PlayError> {
    play::program(cell, &Program::read(name, text).unwrap(), &mut |_| ())
}

/// A step of a taught program.
fn step(what: &str, fields: &str) -> String {
    format!("[[step]]\ndo = \"{what}\"\n{fields}\n")
}

fn axis_move(to: &str) -> String {
    step("axis-move", &format!("to = [{to}]\nspeed = 50"))
}

fn numbers(recording: &Recording) -> Vec<usize> {
    recording.turns.iter().map(|turn| turn.step.number).collect()
}

fn svg(recording: &Recording) -> String {
    let model = RobotModel::named("BRTIRUS0707A").unwrap();
    r6_plot::svg(&Picture { title: "a < b", subtitle: "", trouble: None, model, recording })
}

#[test]
fn a_program_runs_one_pass() {
    let steps = [
        axis_move("30"),
        step("wait", "point = \"X010\""),
        step("output", "point = \"Y010\"\non = true"),
        step("wait", "seconds = 0.5"),
        step("output", "point = \"M012\"\non = true"),
        step("output", "point = \"Y010\"\non = false"),
        axis_move("0"),
    ];
    let recording = played(switched(2000, 0), &steps.concat());
    assert_eq!(recording.ending, Ending::Done);
    assert_eq!(numbers(&recording), [1, 2, 4, 7]);
    let ends: Vec<_> = recording.turns.iter().map(|turn| turn.end.unwrap()).collect();
    assert_eq!(&ends[1..3], [2.0, 2.5]);
    assert_eq!(ends[3], recording.duration);
    let axis = recording.axes[0];
    assert!((axis.way - 60.0).abs() < 1e-6 && axis.ends.1.abs() < 1e-6, "{axis:?}");
    let on: Vec<_> = recording
        .points
        .iter()
        .map(|track| (track.point.to_string(), track.on(recording.duration)))
        .collect();
    let row = |name: &str, from, to| (name.to_owned(), vec![(from, to)]);
    let end = recording.duration;
    assert_eq!(on, [row("X010", 2.0, end), row("Y010", 2.0, 2.5), row("M012", 2.5, end)]);
    assert_eq!(words::trouble(&recording), None);
    assert!(words::summary(&recording).contains(", 7 steps, "), "{}", words::summary(&recording));
    let picture = svg(&recording);
    assert_eq!(picture, svg(&played(switched(2000, 0), &steps.concat())));
    assert!(picture.contains("<title>a &lt; b</title>") && picture.contains(">X010<"));
}

#[test]
fn a_program_that_waits_for_ever_says_for_what() {
    for (last, wanted) in [
        (step("wait", "point = \"X012\""), "step 2 (wait until X012 is on) waits for ever from"),
        (step("remote", ""), "step 2 (wait for remote commands) waits for ever from"),
        (step("take-point", ""), "step 2 (take a point of camera 0) waits for ever from"),
        (
            step("wait-for-registers", "first = 850\ncount = 6"),
            "step 2 (wait until one of the registers 850 to 855 is written) waits for ever from",
        ),
    ] {
        let recording = played(cell(), &(axis_move("10") + &last + &axis_move("0")));
        assert_eq!(recording.ending, Ending::Waiting, "{last}");
        let trouble = words::trouble(&recording).unwrap();
        assert!(trouble.contains(&format!("program `cell`, {wanted}")), "{trouble}");
        assert_eq!((numbers(&recording).as_slice(), recording.turns[1].end), ([1, 2].as_slice(), None));
        assert!(svg(&recording).contains(">waits<"));
    }
}

#[test]
fn an_alarm_ends_a_program_at_its_step() {
    for (last, number, code) in [
        (axis_move("500"), 2, 130),
        (step("alarm", "number = 5001"), 2, 5001),
        (step("wait", "point = \"X010\"\nlimit = 1.5"), 2, 2048),
        (step("photo", "limit = 1\ntries = 2\nalarm = 5002"), 2, 5002),
    ] {
        for after in ["", &axis_move("0")] {
            let recording = played(cell(), &format!("{}{last}{after}", axis_move("10")));
            let alarm = recording.alarm().unwrap_or_else(|| panic!("{last}: {:?}", recording.ending));
            assert_eq!(alarm.code, code, "{last}");
            assert_eq!(recording.ended_at.as_ref().map(|step| step.number), Some(number), "{last}");
            assert_eq!(numbers(&recording), [1, 2], "{last}");
            let trouble = words::trouble(&recording).unwrap();
            let wanted = format!("ends with alarm {code} (");
            assert!(trouble.contains("program `cell`, step 2 (") && trouble.contains(&wanted), "{trouble}");
        }
    }
}

#[test]
fn a_pass_without_an_end_is_given_up() {
    let label = step("label", "name = \"again\"");
    let jump = step("jump", "to = \"again\"");
    // Two steps that take turns; one step again and again; nothing that takes time.
    for (between, given_up) in [
        (axis_move("10") + &axis_move("0"), Ending::Endless),
        (step("wait", "seconds = 60"), Ending::TooLong),
        (String::new(), Ending::Endless),
    ] {
        let recording = played(cell(), &(label.clone() + &between + &jump));
        assert_eq!(recording.ending, given_up, "{between}");
        assert!(words::trouble(&recording).is_some());
        assert!(svg(&recording).len() < 16_000_000, "{}", svg(&recording).len());
    }
}

#[test]
fn a_program_begins_where_it_is_told_whatever_its_name() {
    for name in ["cell", "remote", "default"] {
        let from = Cell { from: vec![20.0, 5.0], ..cell() };
        let recording = attempt(from, name, &axis_move("30")).unwrap();
        assert_eq!(recording.ending, Ending::Done, "{name}");
        let (begin, end) = recording.axes[0].ends;
        assert!((begin - 20.0).abs() < 1e-6 && (end - 30.0).abs() < 1e-6, "{name}: {begin} {end}");
        assert_eq!(recording.samples[0].at, 0.0);
    }
    let from = Cell { from: vec![500.0], ..cell() };
    let refused = attempt(from, "cell", &axis_move("30")).unwrap_err();
    assert!(refused.to_string().starts_with("the start cannot be reached: alarm 130: "), "{refused}");
}

#[test]
fn a_program_may_call_those_of_the_library() {
    let mut cell = cell();
    cell.settings.library.load("sub", &axis_move("5")).unwrap();
    let text = axis_move("10") + &step("call", "program = \"sub\"");
    let recording = attempt(cell.clone(), "cell", &text).unwrap();
    let told: Vec<_> = recording
        .turns
        .iter()
        .map(|turn| (turn.step.program.as_deref().unwrap(), turn.step.number))
        .collect();
    assert_eq!(told, [("cell", 1), ("sub", 1)]);
    let missing = attempt(cell, "cell", &step("call", "program = \"sup\"")).unwrap_err();
    assert_eq!(missing.to_string(), "it calls `sup`, which is not there; nearest: `sub`");
}

#[test]
fn a_program_without_steps_is_refused() {
    assert_eq!(attempt(cell(), "cell", "").unwrap_err(), PlayError::NoSteps);
}

#[test]
fn a_motion_that_repeats_is_played_once() {
    let to = |degrees| AxisPosition::degrees([degrees]);
    let speed = Percent::new(50.0).unwrap();
    let motion = Motion::new()
        .axis_move(to(10.0), speed)
        .set_output("Y010".parse().unwrap(), true)
        .axis_move(to(0.0), speed);
    let once = play::motion(cell(), &motion, false, &mut |_| ()).unwrap();
    let repeated = play::motion(cell(), &motion.repeat(), false, &mut |_| ()).unwrap();
    assert_eq!(once.ending, Ending::Done);
    assert_eq!(svg(&once), svg(&repeated));
    assert_eq!(once.turns[1].step.text, "Y010 on");
}

#[test]
fn twelve_points_have_rows_and_the_others_are_named() {
    let outputs = (0..26).map(|point| {
        step("output", &format!("point = \"Y{}.0{:o}\"\non = true", point / 13 + 1, 8 + point % 13))
    });
    let recording = played(cell(), &(outputs.collect::<String>() + &step("wait", "seconds = 1")));
    assert_eq!(recording.points.len(), 26);
    let picture = svg(&recording);
    let rows = picture.split("<g class=\"points\">").nth(1).unwrap().split("</g>").next().unwrap();
    assert_eq!(rows.matches("<rect ").count(), 12);
    assert!(rows.contains("changed, too: Y1.024, Y2.010, Y2.011") && rows.contains("and 4 more"), "{rows}");
}

#[test]
fn a_picture_without_points_has_no_panel_of_them() {
    let recording = played(cell(), &axis_move("10"));
    assert!(!svg(&recording).contains("class=\"points\""));
    assert!(svg(&recording).contains("viewBox=\"0 0 1200 1130\""));
}
