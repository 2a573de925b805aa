use std::collections::BTreeSet;

use super::*;

fn model(name: &str) -> &'static RobotModel {
    RobotModel::named(name).unwrap()
}

fn file(name: &str) -> &'static str {
    FILES.into_iter().find(|text| RobotModel::from_toml(text).unwrap().name.as_ref() == name).unwrap()
}

/// The names of all numbers in a file, found without the reader under test.
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

/// Checks the whole error message for a file with one change.
#[track_caller]
fn complains(name: &str, from: &str, to: &str, complaint: &str) {
    let text = file(name);
    assert!(text.contains(from), "{from}");
    let error = RobotModel::from_toml(&text.replacen(from, to, 1)).unwrap_err();
    let found = error.to_string();
    assert_eq!(found.lines().collect::<Vec<_>>(), complaint.lines().collect::<Vec<_>>());
}

#[test]
fn a_wrong_file_says_where_and_what() {
    let six = "BRTIRUS0707A";
    complains(
        six,
        "a2 = 350.0",
        "a2 = -1",
        "12:6: [geometry]: `a2` is -1, but has to be a length of 0.001 mm or more",
    );
    complains(
        six,
        "a2 = 350.0 ",
        "a2 = \"long\" ",
        "12:6: [geometry]: `a2` is the text \"long\", but has to be a length of 0.001 mm or more",
    );
    complains(
        six,
        "tool_offset = ",
        "tool_ofset = ",
        "16:1: [geometry]: there is no key `tool_ofset`; nearest: `tool_offset`",
    );
    complains(six, "a1 = 50.0", "#", "9:1: [geometry]: `a1` is missing: a length, mm");
    complains(
        six,
        "kind = \"six-axis\"",
        "kind = \"six axes\"",
        "4:8: `kind` is \"six axes\", but has to be one of \"six-axis\", \"scara\", \"cartesian\"; nearest: \"six-axis\"",
    );
    complains(
        six,
        "max_speed = 270.0",
        "max_sped = 270.0",
        "33:1: J2: there is no key `max_sped`; nearest: `max_speed`",
    );
    complains(
        six,
        "max_speed = 270.0",
        "max_speed = inf",
        "33:13: J2: `max_speed` is inf, but has to be degrees per second 0.001 or more",
    );
    complains(
        six,
        "soft = [-105.0, 75.0]",
        "soft = [75.0, -105.0]",
        "31:8: J2: `soft` is a list, but has to be [min, max] in degrees, with 0 inside",
    );
    complains(
        six,
        "vendor = [-125.0, 85.0]",
        "vendor = [-100.0, 85.0]",
        "32:10: J2: `vendor` has to hold the limits of `soft`",
    );
    complains(
        six,
        "forearm = 8.0",
        "forearm = -8.0",
        "20:11: [masses]: `forearm` is -8.0, but has to be a mass, kg",
    );
    complains(six, "forearm = 8.0", "#", "18:1: [masses]: `forearm` is missing: a mass, kg");
    complains(
        six,
        "rated_torque = 230.0",
        "rated_torque = 0",
        "35:16: J2: `rated_torque` is 0, but has to be Nm at the axis, 0.001 or more",
    );
    complains(six, "sign = -1", "sign = 0", "36:8: J2: `sign` is 0, but has to be 1 or -1");
    complains(
        "GENERIC-SCARA",
        "lead = 20.0",
        "gear_ratio = 20.0",
        "31:1: J3: `lead` is missing: mm per motor turn, 0.001 or more\n34:1: J3: there is no key `gear_ratio`; there are: soft, vendor, max_speed, lead, rated_torque, sign, offset",
    );
    complains(
        "GENERIC-SCARA",
        "certainty = \"chosen\"",
        "certainty = \"choosen\"",
        "45:13: [[source]] 1: `certainty` is \"choosen\", but has to be one of \"measured\", \"published\", \"derived\", \
         \"borrowed\", \"assumed\", \"chosen\"; nearest: \"chosen\"",
    );
    complains(
        "GENERIC-SCARA",
        "of = [\"geometry.height\"",
        "of = [\"geometry.heigth\"",
        "44:6: [[source]] 1: `geometry.heigth` is the name of no number of this file; nearest: `geometry.height`",
    );
}

#[test]
fn a_wrong_number_of_axes_is_told() {
    let text = file("GENERIC-SCARA");
    let (start, rest) = text.split_once("[[axis]] # J4").unwrap();
    let (_, sources) = rest.split_once("[[source]]").unwrap();
    let error = RobotModel::from_toml(&format!("{start}[[source]]{sources}")).unwrap_err();
    let what = &error.first().what;
    assert!(what.contains("there have to be four [[axis]] tables, J1 to J4, not 3"), "{error}");
}

#[test]
fn what_is_no_toml_names_its_line() {
    let error = RobotModel::from_toml("name = \"a\"\nkind = \n").unwrap_err();
    assert_eq!(error.first().at.map(|(line, _)| line), Some(2));
    let error = RobotModel::from_toml(&"#".repeat(100_000)).unwrap_err();
    assert_eq!(error.to_string(), "the file is longer than 65536 bytes");
    let error = RobotModel::from_toml("").unwrap_err();
    assert!(error.to_string().starts_with("1:1: `name` is missing: a name in quotes\n"), "{error}");
}

#[test]
fn all_mistakes_of_a_file_are_told() {
    let wrong = file("GENERIC-SCARA")
        .replacen("name = ", "nam = ", 1)
        .replacen("height = ", "height = -1e9 # ", 1)
        .replacen("lead = 20.0", "lead = 0", 1)
        .replacen("certainty = \"chosen\"", "certainty = \"choosen\"", 1)
        .replacen("max_line_speed = ", "max_line_speed = true # ", 1);
    let mistakes = RobotModel::from_toml(&wrong).unwrap_err();
    let told = mistakes.to_string();
    assert_eq!((mistakes.iter().count(), mistakes.more()), (5, 0), "{told}");
    for part in
        ["`nam`", "`height`", "J3: `lead` is 0", "[[source]] 1: `certainty`", "`max_line_speed` is true"]
    {
        assert!(told.contains(part), "{part}: {told}");
    }
    assert!(mistakes.iter().all(|mistake| mistake.at.is_some()));
}

proptest::proptest! {
    /// A file with any part removed or inserted is refused or read, without a panic.
    #[test]
    fn no_text_breaks_the_reader(
        which in 0..FILES.len(), from in 0..4000_usize, length in 0..40_usize, put in "[ -~\n]{0,12}",
    ) {
        let text: Vec<char> = FILES[which].chars().collect();
        let from = from.min(text.len());
        let rest = (from + length).min(text.len());
        let changed: String = text[..from].iter().copied().chain(put.chars()).chain(text[rest..].iter().copied()).collect();
        if let Err(mistakes) = RobotModel::from_toml(&changed) {
            for mistake in mistakes.iter() {
                let line = mistake.at.map_or(1, |(line, _)| line);
                proptest::prop_assert!(line <= 1 + changed.lines().count() && !mistake.what.is_empty());
            }
        }
    }
}
