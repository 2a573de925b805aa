//! `r6 plot`: the picture of a program and its figures.

use std::fmt::Write;
use std::path::PathBuf;

use serde_json::Value;

use crate::support::{Outcome, Robot, TempFile, r6, r6_with_input, root};

/// A program, and the picture that a test draws of it. Both files are removed at the end.
struct Plotted {
    program: TempFile,
    picture: PathBuf,
}

impl Plotted {
    fn new(name: &str, text: &str) -> Self {
        let program = TempFile::new(name, text);
        let picture = PathBuf::from(program.path()).with_extension("svg");
        Self { program, picture }
    }

    fn plot(&self, args: &[&str]) -> Outcome {
        r6(&[&["plot", self.program.path()], args].concat())
    }

    fn figures(&self, args: &[&str]) -> Value {
        self.plot(&[args, &["--json"]].concat()).json()
    }

    fn picture(&self) -> String {
        std::fs::read_to_string(&self.picture).unwrap()
    }
}

impl Drop for Plotted {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.picture);
    }
}

fn axis_move(to: &str, speed: f64, blend: u8) -> String {
    format!("[[instruction]]\ndo = \"axis-move\"\nto = [{to}]\nspeed = {speed}\nblend = {blend}\n")
}

fn assert_near(found: &Value, wanted: f64, tolerance: f64) {
    let found = found.as_f64().unwrap_or_else(|| panic!("{found} is no number"));
    assert!((found - wanted).abs() <= tolerance, "found {found}, wanted {wanted}");
}

/// The groups of this class, each with its lines.
fn groups<'p>(picture: &'p str, class: &str) -> Vec<Vec<&'p str>> {
    let begin = format!("<g class=\"{class}\">\n");
    let parts = picture.split(begin.as_str()).skip(1);
    parts.map(|part| part.split("</g>").next().unwrap().lines().collect()).collect()
}

/// The value of an attribute.
fn attribute<'l>(line: &'l str, name: &str) -> &'l str {
    line.split(&format!(" {name}=\"")).nth(1).unwrap_or_else(|| panic!("{line}")).split('"').next().unwrap()
}

/// The labels of an axis of the picture: the number, and its pixel.
fn labels(lines: &[&str], coordinate: &str, offset: f64) -> Vec<(f64, f64)> {
    let texts = lines.iter().filter(|line| line.starts_with("<text x"));
    texts
        .filter_map(|line| {
            let label = line.split('>').nth(1)?.split('<').next()?.parse().ok()?;
            Some((label, attribute(line, coordinate).parse::<f64>().ok()? - offset))
        })
        .collect()
}

/// The value at a pixel, interpolated between the first and the last label.
fn value_at(labels: &[(f64, f64)], pixel: f64) -> f64 {
    let ((low, from), (high, to)) = (labels[0], labels[labels.len() - 1]);
    low + (pixel - from) / (to - from) * (high - low)
}

fn points(line: &str) -> Vec<(f64, f64)> {
    let places = attribute(line, "points").split(' ');
    places
        .map(|place| place.split_once(',').unwrap())
        .map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap()))
        .collect()
}

#[test]
fn the_curves_end_where_the_axes_are() {
    let plotted = Plotted::new("curves.toml", &axis_move("30, 0, -20, 0, -80, 0", 50.0, 0));
    let outcome = plotted.plot(&[]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    let picture = plotted.picture();
    let (curves, values, times) =
        (groups(&picture, "curves"), groups(&picture, "values"), groups(&picture, "time"));
    assert_eq!(curves.iter().map(Vec::len).collect::<Vec<_>>(), [6, 6], "an axis has a line in both panels");
    // Reads values off the picture with its own labels.
    let (degrees, seconds) = (labels(&values[0], "y", 4.0), labels(&times[0], "x", 0.0));
    let duration = plotted.figures(&[])["duration_s"].as_f64().unwrap();
    for (line, wanted) in curves[0].iter().zip([30.0, 0.0, -20.0, 0.0, -80.0, 0.0]) {
        let (x, y) = *points(line).last().unwrap();
        assert!((value_at(&degrees, y) - wanted).abs() < 0.1, "{wanted}: {line}");
        assert!((value_at(&seconds, x) - duration).abs() < 0.005, "{duration}: {line}");
        assert!(value_at(&degrees, points(line)[0].1).abs() < 0.1);
    }
    // J5 needs the most time and sets the pace: half of its full speed, backwards.
    let percent = labels(&values[1], "y", 4.0);
    let fastest = points(curves[1][4]).into_iter().map(|(_, y)| value_at(&percent, y)).fold(0.0, f64::min);
    assert!((fastest + 50.0).abs() < 0.5, "{fastest}");
    for text in ["axis position, degrees", "axis speed, % of full speed", "tool path, mm", "seconds", ">J6<"]
    {
        assert!(picture.contains(text), "{text}");
    }
    assert_eq!(groups(&picture, "view").len(), 2);
}

#[test]
fn the_figures_are_those_of_the_running_controller() {
    let text = axis_move("20", 100.0, 0);
    let plotted = Plotted::new("figures.toml", &text);
    let figures = plotted.figures(&[]);
    let robot = Robot::start(&[]);
    let radius = robot.value("world-0").as_f64().unwrap();
    assert_eq!(robot.r6(&["run", plotted.program.path(), "--wait"]).code, 0);
    // The cycle time of the controller is in the same seconds. The tool path is an arc about J1.
    assert_near(&figures["duration_s"], robot.value("lastCycle").as_f64().unwrap(), 0.002);
    assert_near(&figures["tool_path_mm"], radius * 20.0_f64.to_radians(), 0.01);
    assert_near(&figures["axes"][0]["way"], 20.0, 1e-6);
    assert_near(&figures["axes"][0]["to"], 20.0, 1e-6);
    assert_near(&figures["axes"][1]["way"], 0.0, 1e-6);
    assert_eq!((&figures["ended"], &figures["stops"]), (&"done".into(), &0.into()));
    let samples = &figures["samples"];
    let count = samples["t_s"].as_array().unwrap().len();
    assert!(count > 100, "{count}");
    for series in ["axes", "speeds_per_s", "tool_mm"] {
        assert_eq!(samples[series].as_array().unwrap().len(), count, "{series}");
    }
    // The speed is the slope of the position.
    let at = |series: &str, n: usize| samples[series][n][0].as_f64().unwrap();
    let time = |n: usize| samples["t_s"][n].as_f64().unwrap();
    let slope = (at("axes", 61) - at("axes", 59)) / (time(61) - time(59));
    assert!((slope - at("speeds_per_s", 60)).abs() < 0.5, "{slope}");
}

#[test]
fn only_a_rounded_corner_is_passed_without_a_stop() {
    for (blend, stops) in [(0, 2), (5, 0)] {
        let steps = ["20", "20, 20", "0, 20"].map(|to| axis_move(to, 50.0, blend));
        let plotted = Plotted::new(&format!("blend-{blend}.toml"), &steps.concat());
        let figures = plotted.figures(&[]);
        assert_eq!(figures["stops"], stops, "blend level {blend}");
        let turns = figures["instructions"].as_array().unwrap();
        assert_eq!(turns.len(), 3);
        assert_eq!(turns[0]["end_s"], turns[1]["begin_s"]);
        assert_eq!(turns[2]["end_s"], figures["duration_s"]);
        let words = if stops == 0 { "no stop".to_owned() } else { format!("{stops} stops") };
        assert!(plotted.picture().contains(&words));
    }
}

#[test]
fn half_the_global_speed_is_half_the_top_speed() {
    let plotted = Plotted::new("global.toml", &axis_move("90", 50.0, 0));
    let top = |args: &[&str]| plotted.figures(args)["axes"][0]["top_speed_percent"].as_f64().unwrap();
    assert!((top(&[]) - 50.0).abs() < 0.1);
    assert!((top(&["--global-speed", "50"]) - 25.0).abs() < 0.1);
}

#[test]
fn an_alarm_ends_the_picture_with_its_instruction() {
    let steps = axis_move("10", 50.0, 0) + &axis_move("500", 50.0, 0) + &axis_move("0", 50.0, 0);
    let plotted = Plotted::new("alarm.toml", &steps);
    let outcome = plotted.plot(&[]);
    assert_eq!(outcome.code, 1, "{outcome:?}");
    assert!(outcome.err.contains("instruction 2 (axis move) ends with alarm 130"), "{}", outcome.err);
    assert!(plotted.picture().contains(">alarm 130<"));
    let figures = plotted.figures(&[]);
    assert_eq!((&figures["alarm"], &figures["ended_at_instruction"]), (&130.into(), &2.into()));
    assert_near(&figures["axes"][0]["to"], 10.0, 1e-6);
    assert_eq!(figures["instructions"][1]["end_s"], Value::Null);
}

#[test]
fn a_wait_needs_somebody_who_sets_the_input() {
    let wait = "[[instruction]]\ndo = \"wait\"\nsource = \"input\"\npoint = 2\nuntil = \"on\"\n";
    let plotted = Plotted::new("wait.toml", &format!("{}{wait}", axis_move("10", 50.0, 0)));
    let outcome = plotted.plot(&[]);
    assert_eq!(outcome.code, 1, "{outcome:?}");
    assert!(outcome.err.contains("instruction 2 (wait until X012 is on) waits for ever"), "{}", outcome.err);
    assert!(outcome.err.contains("--input"), "{}", outcome.err);
    let figures = plotted.figures(&["--input", "X013=on@1s", "--input", "X012=on@2.5s"]);
    assert_eq!(figures["ended"], "done");
    assert_near(&figures["instructions"][1]["end_s"], 2.5, 1e-9);
    // A wait with a limit times out, as on the machine.
    let limited = Plotted::new("limit.toml", &format!("{wait}limit = 1.5\n"));
    let outcome = limited.plot(&["--json"]);
    assert_eq!(outcome.code, 1);
    assert_near(&outcome.json()["alarm_s"], 1.5, 1e-9);
    assert_eq!(outcome.json()["alarm"], 2050);
}

#[test]
fn a_program_longer_than_the_list_is_fed_as_the_list_drains() {
    let mut text = String::new();
    for step in 0..1300 {
        text.push_str(&axis_move(if step % 2 == 0 { "1" } else { "0" }, 100.0, 0));
    }
    let figures = Plotted::new("long.toml", &text).figures(&[]);
    assert_eq!((&figures["ended"], &figures["instruction_count"]), (&"done".into(), &1300.into()));
    assert_eq!(figures["stops"], 1299);
    assert_near(&figures["axes"][0]["way"], 1300.0, 1.0);
    assert!(figures["samples"]["t_s"].as_array().unwrap().len() <= 50_000);
}

#[test]
fn nobody_looks_for_longer_than_a_week() {
    let wait = "[[instruction]]\ndo = \"wait\"\nseconds = 86400\n";
    let plotted = Plotted::new("week.toml", &wait.repeat(8));
    let outcome = plotted.plot(&["--json"]);
    assert_eq!((outcome.code, &outcome.json()["ended"]), (1, &"too_long".into()));
}

#[test]
fn a_program_begins_where_it_is_told() {
    let plotted = Plotted::new("from.toml", &axis_move("10", 50.0, 0));
    let figures = plotted.figures(&["--from", "-20,5"]);
    assert_near(&figures["axes"][0]["from"], -20.0, 1e-6);
    assert_near(&figures["axes"][0]["way"], 30.0, 1e-6);
    assert_near(&figures["axes"][1]["to"], 5.0, 1e-6);
    assert_near(&figures["samples"]["t_s"][0], 0.0, 0.0);
    let outcome = plotted.plot(&["--from", "500"]);
    assert_eq!(outcome.code, 2);
    assert!(outcome.err.contains("--from cannot be reached: alarm 130"), "{}", outcome.err);
}

#[test]
fn a_sliding_axis_has_millimetres() {
    let plotted = Plotted::new("scara.toml", &axis_move("45, 0, -50, 0", 50.0, 0));
    let figures = plotted.figures(&["--model", "GENERIC-SCARA"]);
    let units: Vec<_> = figures["axes"].as_array().unwrap().iter().map(|axis| axis["unit"].clone()).collect();
    assert_eq!(units, ["deg", "deg", "mm", "deg"]);
    let picture = plotted.picture();
    assert!(picture.contains("axis position, mm") && picture.contains("axis position, degrees"));
    let curves = groups(&picture, "curves");
    assert_eq!(curves.iter().map(Vec::len).collect::<Vec<_>>(), [3, 1, 4]);
    let values = labels(&groups(&picture, "values")[1], "y", 4.0);
    let (_, y) = *points(curves[1][0]).last().unwrap();
    assert!((value_at(&values, y) + 50.0).abs() < 0.2, "{}", value_at(&values, y));
}

/// The rectangles of the panel of points, each from its left to its right edge, by the name of their row.
fn bars(picture: &str) -> Vec<(String, Vec<(f64, f64)>)> {
    let mut rows = Vec::new();
    for line in groups(picture, "points").concat() {
        if let Some(name) = line.strip_suffix("</text>").filter(|line| line.contains("\"end\"")) {
            rows.push((name.rsplit('>').next().unwrap().to_owned(), Vec::new()));
        } else if line.starts_with("<rect ") {
            let [left, width] = ["x", "width"].map(|name| attribute(line, name).parse::<f64>().unwrap());
            rows.last_mut().unwrap().1.push((left, left + width));
        }
    }
    rows
}

#[test]
fn points_that_change_have_a_bar_while_they_are_on() {
    let output =
        |point: &str, on: bool| format!("[[instruction]]\ndo = \"output\"\npoint = \"{point}\"\non = {on}\n");
    let wait = |seconds: f64| format!("[[instruction]]\ndo = \"wait\"\nseconds = {seconds:.1}\n");
    let steps = [
        output("M012", true),
        output("Y010", true),
        wait(1.0),
        output("Y010", false),
        wait(2.0),
        output("Y010", true),
        wait(1.0),
    ];
    let plotted = Plotted::new("points.toml", &steps.concat());
    let figures = plotted.figures(&["--input", "X011=on@500ms", "--input", "X011=off@1.5s"]);
    assert_eq!(
        figures["points"],
        serde_json::json!([
            { "point": "X011", "on_s": [[0.5, 1.5]] },
            { "point": "Y010", "on_s": [[0.0, 1.0], [3.0, 4.0]] },
            { "point": "M012", "on_s": [[0.0, 4.0]] },
        ])
    );
    let picture = plotted.picture();
    let times = groups(&picture, "time");
    assert_eq!(times.len(), 3, "each panel has its scale of time");
    let seconds = labels(&times[2], "x", 0.0);
    let rows = bars(&picture);
    assert_eq!(rows.iter().map(|row| row.0.as_str()).collect::<Vec<_>>(), ["X011", "Y010", "M012"]);
    for ((name, bars), wanted) in
        rows.iter().zip([vec![(0.5, 1.5)], vec![(0.0, 1.0), (3.0, 4.0)], vec![(0.0, 4.0)]])
    {
        assert_eq!(bars.len(), wanted.len(), "{name}");
        for (bar, wanted) in bars.iter().zip(wanted) {
            let (from, to) = (value_at(&seconds, bar.0), value_at(&seconds, bar.1));
            assert!((from - wanted.0).abs() < 0.01 && (to - wanted.1).abs() < 0.01, "{name}: {from} {to}");
        }
    }
}

#[test]
fn a_taught_program_is_drawn_for_one_pass() {
    let move_to = |to: f64| format!("[[step]]\ndo = \"axis-move\"\nto = [{to:.1}]\nspeed = 50\n");
    let text = move_to(20.0) + "[[step]]\ndo = \"wait\"\npoint = \"X010\"\n" + &move_to(0.0);
    let plotted = Plotted::new("taught.toml", &text);
    let outcome = plotted.plot(&["--input", "X010=on@3s"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!(
        outcome.out.contains("wait until X010 is on") && outcome.out.contains("3 steps"),
        "{}",
        outcome.out
    );
    assert!(plotted.picture().contains(">step<") && !plotted.picture().contains(">instruction<"));
    let figures = plotted.figures(&["--input", "X010=on@3s"]);
    assert_eq!((&figures["ended"], &figures["instruction_count"]), (&"done".into(), &3.into()));
    assert!(figures["program"].as_str().unwrap().ends_with("taught"), "{}", figures["program"]);
    assert_near(&figures["instructions"][1]["end_s"], 3.0, 1e-9);
    assert_near(&figures["axes"][0]["way"], 40.0, 1e-6);
    let waits = plotted.plot(&[]);
    assert_eq!(waits.code, 1, "{waits:?}");
    assert!(waits.err.contains("step 2 (wait until X010 is on) waits for ever from"), "{}", waits.err);
    // The same program in JSON, from stdin.
    let json = r#"{"step": [{"do": "axis-move", "to": [20], "speed": 50}]}"#;
    let outcome = r6_with_input(&["plot", "-", "--out", "-"], json.as_bytes());
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!(outcome.err.contains("1 step,"), "{}", outcome.err);
}

#[test]
fn the_contents_of_a_file_say_what_it_is() {
    let step = "[[step]]\ndo = \"jumpp\"\n";
    let neither = "[[move]]\nto = [1]\n";
    let both = format!("{}[[step]]\ndo = \"end\"\n", axis_move("10", 50.0, 0));
    for (name, text, wanted) in [
        ("wrong-step.toml", step, "nearest: \"jump\""),
        ("neither.toml", neither, "instructions for `r6 run` are [[instruction]] tables"),
        ("neither.json", "{\"move\": 1}", "a taught program has [[step]] tables"),
        ("both.toml", both.as_str(), "there is no key `step`"),
        ("calls.toml", "[[step]]\ndo = \"call\"\nprogram = \"remot\"\n", "nearest: `remote`"),
    ] {
        let outcome = Plotted::new(name, text).plot(&[]);
        assert_eq!(outcome.code, 2, "{name}: {outcome:?}");
        assert!(outcome.err.contains(wanted), "{name}: {}", outcome.err);
    }
}

#[test]
fn programs_come_from_stdin_and_pictures_go_to_stdout() {
    let toml = axis_move("10", 50.0, 0);
    let json = r#"{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","emptyList":"1","instructions":[{"oneshot":"1","action":"4","m0":"10.000","ckStatus":"0x01","speed":"50.0","delay":"0","smooth":"0"}]}"#;
    let pictures = [toml.as_bytes(), json.as_bytes()].map(|text| {
        let outcome = r6_with_input(&["plot", "-", "--out", "-"], text);
        assert_eq!(outcome.code, 0, "{outcome:?}");
        assert!(outcome.out.starts_with("<svg ") && outcome.out.ends_with("</svg>\n"));
        assert!(outcome.err.contains("axis move"), "the table is on stderr: {}", outcome.err);
        outcome.out
    });
    assert_eq!(pictures[0], pictures[1], "one program, one picture");
    let outcome = r6_with_input(&["run", "-", "--dry-run"], toml.as_bytes());
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert_eq!(outcome.out.lines().count(), 1);
}

#[test]
fn what_cannot_be_drawn_says_why() {
    let good = Plotted::new("good.toml", &axis_move("10", 50.0, 0));
    let many = Plotted::new("many.toml", &axis_move("0", 50.0, 0).repeat(10_001));
    let program = good.program.path();
    for (args, wanted) in [
        (vec!["plot", "-"], "--out"),
        (vec!["plot", program, "--out", program], "the picture would take its place"),
        (vec!["plot", program, "--out", "-", "--json"], "cannot both go to stdout"),
        (vec!["plot", program, "--out", "/no/such/folder/x.svg"], "cannot be written"),
        (
            vec!["plot", program, "--from", "1,2,3,4,5,6,7"],
            "--from has 7 numbers, but BRTIRUS0707A has 6 axes",
        ),
        (vec!["plot", program, "--input", "Y010=on"], "`Y010` is no input"),
        (vec!["plot", program, "--model", "BRTIRUS0707B"], "nearest: `BRTIRUS0707A`"),
        (vec!["plot", program, "--global-speed", "0"], "percent from 0.1 to 100"),
        (vec!["plot", "no-such.toml"], "cannot be read"),
        (vec!["plot", many.program.path()], "10001 instructions are too many"),
    ] {
        let outcome = r6(&args);
        assert_eq!(outcome.code, 2, "{args:?}: {outcome:?}");
        assert!(outcome.err.contains(wanted), "{args:?}: {}", outcome.err);
    }
}

#[test]
fn a_program_of_nothing_is_a_picture_of_the_arm_at_rest() {
    let empty = r#"{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","emptyList":"1","instructions":[]}"#;
    let outcome = r6_with_input(&["plot", "-", "--out", "-"], empty.as_bytes());
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!(outcome.err.contains("0.000 s, 0 instructions, tool path 0.0 mm, no stop"), "{}", outcome.err);
    assert!(!outcome.out.contains("NaN") && !outcome.out.contains("inf"), "{}", outcome.out);
}

#[test]
fn a_refused_action_is_told_in_the_controllers_words() {
    let step = "[[instruction]]\ndo = \"board-output\"\nset = [1]\n";
    let plotted = Plotted::new("legacy.toml", step);
    let outcome = plotted.plot(&["--profile", "legacy"]);
    assert_eq!(outcome.code, 1, "{outcome:?}");
    assert!(outcome.err.contains("this firmware does not know one of the actions"), "{}", outcome.err);
}

#[test]
fn the_picture_in_the_readme_is_the_one_that_is_drawn() {
    let name = "docs/square.svg";
    let drawn = r6(&["plot", "examples/programs/square.toml", "--out", "-"]);
    let committed = std::fs::read_to_string(root().join(name)).unwrap();
    assert!(drawn.out == committed, "draw it anew: r6 plot examples/programs/square.toml --out {name}");
    assert!(committed.len() < 100_000, "{} bytes", committed.len());
    assert!(std::fs::read_to_string(root().join("README.md")).unwrap().contains(name));
    let mut unclosed = String::new();
    for group in ["legend", "time", "values", "curves", "points", "view", "instructions"] {
        if groups(&committed, group).is_empty() {
            writeln!(unclosed, "{group}").unwrap();
        }
    }
    assert_eq!(unclosed, "", "groups that are missing");
}
