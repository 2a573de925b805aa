use std::collections::BTreeSet;

use super::*;

fn model(name: &str) -> &'static RobotModel {
    RobotModel::named(name).unwrap()
}

fn file(name: &str) -> &'static str {
    FILES.into_iter().find(|text| RobotModel::from_toml(text).unwrap().name.as_ref() == name).unwrap()
}

/// The names of all numbers in a file, read without the reader under test.
fn numbers(text: &str) -> BTreeSet<String> {
    let mut numbers = BTreeSet::new();
    let (mut table, mut axis) = (String::new(), 0);
    for line in text.lines() {
        if line.starts_with("[[axis]]") {
            axis += 1;
            table = format!("J{axis}.");
        } else if line.starts_with("[geometry]") {
            "geometry.".clone_into(&mut table);
        } else if line.starts_with("[masses]") {
            "masses.".clone_into(&mut table);
        } else if line.starts_with("[[source]]") {
            break;
        }
        let Some((field, value)) = line.split_once(" = ") else { continue };
        if !value.starts_with('"') {
            numbers.insert(format!("{table}{field}"));
        }
    }
    numbers
}

#[test]
fn names_find_their_model_in_any_case() {
    for name in RobotModel::names() {
        assert_eq!(RobotModel::named(name).map(|m| &*m.name), Some(name));
        assert_eq!(RobotModel::named(&name.to_ascii_lowercase()).map(|m| &*m.name), Some(name));
    }
    assert_eq!(RobotModel::named("BRTIRUS9999Z"), None);
    assert_eq!(RobotModel::named(""), None);
}

#[test]
fn every_file_is_a_model() {
    for text in FILES {
        if let Err(error) = RobotModel::from_toml(text) {
            panic!("{error}\n{text}");
        }
    }
    let names: Vec<_> = RobotModel::names().collect();
    let wanted =
        "BRTIRUS0707A BRTIRUS0805A BRTIRUS1510A BRTIRUS1820A BRTIRUS2030A GENERIC-SCARA GENERIC-CARTESIAN";
    assert_eq!(names.join(" "), wanted);
    let counts: Vec<_> = MODELS.iter().map(RobotModel::axis_count).collect();
    assert_eq!(counts, [6, 6, 6, 6, 6, 4, 4]);
}

#[test]
fn every_number_has_exactly_one_source() {
    for text in FILES {
        let model = RobotModel::from_toml(text).unwrap();
        for number in numbers(text) {
            let sources = model.sources.iter().filter(|source| source.covers(&number)).count();
            assert_eq!(sources, 1, "{} {number}", model.name);
        }
    }
}

#[test]
fn the_default_model_has_the_reported_figures() {
    let model = model("BRTIRUS0707A");
    let Geometry::SixAxis(g) = model.geometry else { panic!("six axes") };
    let lengths = [g.d1, g.a1, g.b, g.a2, g.a3, g.d4, g.d6, g.tool_offset];
    assert_eq!(lengths, [296.5, 50.0, 0.0, 350.0, 41.0, 363.0, 101.3, 17.0]);
    assert_eq!(model.axes.map(|axis| axis.max_speed), [220.8, 270.0, 375.0, 308.0, 300.0, 342.0]);
    assert_eq!(model.axes.map(|axis| axis.sign), [1, -1, -1, 1, -1, 1]);
    assert_eq!(model.axes[2].vendor, Limits { min: -60.0, max: 175.0 });
    assert_eq!(
        (model.max_line_speed, model.max_angular_speed, model.acceleration_time),
        (2000.0, 200.0, 0.25)
    );
}

#[test]
fn a_file_may_leave_out_what_has_a_default() {
    let model = model("GENERIC-SCARA");
    assert_eq!(model.axes[0].vendor, model.axes[0].soft);
    assert_eq!((model.axes[3].sign, model.axes[3].offset), (1, 0.0));
    assert_eq!(model.axes[2].motion, AxisMotion::Slides);
    let text = file("GENERIC-CARTESIAN").split("[[source]]").next().unwrap();
    assert!(RobotModel::from_toml(text).unwrap().sources.is_empty());
}

#[test]
fn axes_that_are_not_there_have_no_limits_and_no_motor() {
    let model = model("GENERIC-SCARA");
    let axes = Axes::new([0.0, 0.0, -10.0, 0.0, 999.0, -999.0, 0.0, 0.0]).unwrap();
    assert_eq!(model.outside_limits(&axes), None);
    assert_eq!(model.own_axes(MoveMask::SIX), MoveMask(0x0F));
    // 1000 mm/s at 20 mm per turn is 50 turns a second.
    let rpm = model.motor_rpm(&[6.0, 0.0, 1000.0, 0.0, 5.0, 5.0, 0.0, 0.0]);
    assert_eq!(rpm, [80.0, 0.0, 3000.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
}

#[test]
fn limits_name_the_end() {
    let limits = Limits { min: -45.0, max: 160.0 };
    assert_eq!(limits.beyond(-45.0), None);
    assert_eq!(limits.beyond(160.0), None);
    assert_eq!(limits.beyond(-45.000_001), Some(LimitSide::Minus));
    assert_eq!(limits.beyond(160.1), Some(LimitSide::Plus));
    assert!(limits.beyond(f64::NAN).is_some());
}

#[test]
fn the_first_axis_outside_is_named() {
    let model = model("BRTIRUS0707A");
    let axes = Axes::of_arm([0.0, 75.0, -45.1, 0.0, 0.0, 400.0]).unwrap();
    assert_eq!(model.outside_limits(&axes), Some((AxisNumber::ARM[2], LimitSide::Minus)));
    assert_eq!(model.outside_limits(&Axes::ZERO), None);
}

#[test]
fn motor_speed_goes_through_the_gear() {
    let rpm = model("brtirus0707a").motor_rpm(&[6.0, -6.0, 12.0, 0.0, 6.0, 342.0, 99.0, 99.0]);
    assert_eq!(rpm, [100.0, -100.0, 202.0, 0.0, 51.0, 2850.0, 0.0, 0.0]);
}

/// A file with one change in it: the whole complaint.
#[track_caller]
fn complains(name: &str, from: &str, to: &str, complaint: &str) {
    let text = file(name);
    assert!(text.contains(from), "{from}");
    let error = RobotModel::from_toml(&text.replacen(from, to, 1)).unwrap_err();
    assert_eq!(error.to_string(), complaint);
}

#[test]
fn a_wrong_file_says_where_and_what() {
    let six = "BRTIRUS0707A";
    complains(
        six,
        "a2 = 350.0",
        "a2 = -1",
        "line 12, `geometry.a2`: wanted a length of 0.001 mm or more, found -1",
    );
    complains(
        six,
        "a2 = 350.0 ",
        "a2 = \"long\" ",
        "line 12, `geometry.a2`: wanted a length of 0.001 mm or more, found \"long\"",
    );
    complains(
        six,
        "tool_offset = ",
        "tool_ofset = ",
        "line 16, `geometry.tool_ofset`: there is no such field; nearest: `tool_offset`",
    );
    complains(six, "a1 = 50.0", "#", "line 9, `geometry.a1`: is missing; wanted a length, mm");
    complains(
        six,
        "kind = \"six-axis\"",
        "kind = \"six axes\"",
        "line 4, `kind`: wanted one of six-axis, scara, cartesian (nearest: six-axis), found \"six axes\"",
    );
    complains(
        six,
        "max_speed = 270.0",
        "max_sped = 270.0",
        "line 33, `J2.max_sped`: there is no such field; nearest: `max_speed`",
    );
    complains(
        six,
        "max_speed = 270.0",
        "max_speed = inf",
        "line 33, `J2.max_speed`: wanted degrees per second 0.001 or more, found inf",
    );
    complains(
        six,
        "soft = [-105.0, 75.0]",
        "soft = [75.0, -105.0]",
        "line 31, `J2.soft`: wanted [min, max] in degrees, with 0 inside, found [75.0, -105.0]",
    );
    complains(
        six,
        "vendor = [-125.0, 85.0]",
        "vendor = [-100.0, 85.0]",
        "line 32, `J2.vendor`: wanted limits that hold the soft ones, found [-100.0, 85.0]",
    );
    complains(
        six,
        "forearm = 8.0",
        "forearm = -8.0",
        "line 20, `masses.forearm`: wanted a mass, kg, found -8.0",
    );
    complains(six, "forearm = 8.0", "#", "line 18, `masses.forearm`: is missing; wanted a mass, kg");
    complains(
        six,
        "rated_torque = 230.0",
        "rated_torque = 0",
        "line 35, `J2.rated_torque`: wanted Nm at the axis, 0.001 or more, found 0",
    );
    complains(six, "sign = -1", "sign = 0", "line 36, `J2.sign`: wanted 1 or -1, found 0");
    complains(
        "GENERIC-SCARA",
        "lead = 20.0",
        "gear_ratio = 20.0",
        "line 34, `J3.gear_ratio`: there is no such field; there are: soft, vendor, max_speed, lead, rated_torque, sign, offset",
    );
    complains(
        "GENERIC-SCARA",
        "certainty = \"chosen\"",
        "certainty = \"choosen\"",
        "line 45, `source.1.certainty`: wanted one of measured, published, derived, borrowed, assumed, chosen \
         (nearest: chosen), found \"choosen\"",
    );
    complains(
        "GENERIC-SCARA",
        "of = [\"geometry.height\"",
        "of = [\"geometry.heigth\"",
        "line 44, `source.1.of.1`: wanted the name of a number of this file (nearest: `geometry.height`), found \
         \"geometry.heigth\"",
    );
}

#[test]
fn a_wrong_number_of_axes_is_told() {
    let text = file("GENERIC-SCARA");
    let (start, rest) = text.split_once("[[axis]] # J4").unwrap();
    let (_, sources) = rest.split_once("[[source]]").unwrap();
    let error = RobotModel::from_toml(&format!("{start}[[source]]{sources}")).unwrap_err();
    assert_eq!(error.field, "axis");
    assert_eq!(error.wanted, "wanted four [[axis]] tables, J1 to J4, found 3");
}

#[test]
fn what_is_no_toml_names_its_line() {
    let error = RobotModel::from_toml("name = \"a\"\nkind = \n").unwrap_err();
    assert_eq!((error.line, error.field.as_str()), (2, ""));
    let error = RobotModel::from_toml(&"#".repeat(100_000)).unwrap_err();
    assert_eq!(error.to_string(), "line 1: the file is longer than 65536 bytes");
    let error = RobotModel::from_toml("").unwrap_err();
    assert_eq!(error.to_string(), "line 1, `name`: is missing; wanted a name in quotes");
}

proptest::proptest! {
    /// Whatever is cut out of a file, or put into it, is refused or read, never a panic.
    #[test]
    fn no_text_breaks_the_reader(
        which in 0..FILES.len(), from in 0..4000_usize, length in 0..40_usize, put in "[ -~\n]{0,12}",
    ) {
        let text: Vec<char> = FILES[which].chars().collect();
        let from = from.min(text.len());
        let rest = (from + length).min(text.len());
        let changed: String = text[..from].iter().copied().chain(put.chars()).chain(text[rest..].iter().copied()).collect();
        if let Err(error) = RobotModel::from_toml(&changed) {
            proptest::prop_assert!(error.line <= 1 + changed.lines().count() && !error.wanted.is_empty());
        }
    }
}
