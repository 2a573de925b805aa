//! Checks that docs/MODELS.md agrees with the model files.

use std::fmt::Write;

use r6_motion::robot_model::{AxisModel, AxisMotion};
use r6_motion::{Geometry, Masses, RobotModel};

const DOCUMENT: &str = include_str!("../../../docs/MODELS.md");

fn section(model: &RobotModel) -> String {
    let mut text = format!("## {}\n\n", model.name);
    if let Some(lengths) = lengths(&model.geometry) {
        writeln!(text, "{lengths} mm.").unwrap();
    }
    writeln!(
        text,
        "Lines {} mm/s and {}°/s, {} s to full speed.\n",
        model.max_line_speed, model.max_angular_speed, model.acceleration_time
    )
    .unwrap();
    if let Some(masses) = &model.masses {
        text.truncate(text.trim_end().len());
        let Masses { upper_arm, forearm, tool } = masses;
        writeln!(text, "\n`upper_arm` {upper_arm}, `forearm` {forearm}, `tool` {tool} kg.\n").unwrap();
    }
    text.push_str(
        "| axis | soft limits | vendor's limits | full speed | motor turns | rated torque | sign | offset |\n",
    );
    text.push_str("|---|---|---|---|---|---|---|---|\n");
    for (n, axis) in model.drives().enumerate() {
        writeln!(text, "| J{} {}", n + 1, row(axis)).unwrap();
    }
    text.push_str("\n| numbers | certainty | source |\n|---|---|---|\n");
    for source in model.sources.iter() {
        let of: Vec<_> = source.of.iter().map(|name| format!("`{name}`")).collect();
        writeln!(text, "| {} | {} | {} |", of.join(", "), source.certainty.word(), source.text).unwrap();
    }
    text
}

fn lengths(geometry: &Geometry) -> Option<String> {
    Some(match geometry {
        Geometry::SixAxis(g) => format!(
            "`d1` {}, `a1` {}, `b` {}, `a2` {}, `a3` {}, `d4` {}, `d6` {}, `tool_offset` {}",
            g.d1, g.a1, g.b, g.a2, g.a3, g.d4, g.d6, g.tool_offset
        ),
        Geometry::Scara(g) => {
            format!("`height` {}, `upper_arm` {}, `forearm` {}", g.height, g.upper_arm, g.forearm)
        }
        Geometry::Cartesian => return None,
    })
}

fn row(axis: &AxisModel) -> String {
    let (unit, turns, force) = match axis.motion {
        AxisMotion::Turns => ("°", format!("{} per turn", axis.gear_ratio), "Nm"),
        AxisMotion::Slides => (" mm", format!("one per {} mm", axis.gear_ratio.recip()), "N"),
    };
    let torque = axis.rated_torque.map_or_else(|| "unknown".to_owned(), |rated| format!("{rated} {force}"));
    format!(
        "| {} … {}{unit} | {} … {}{unit} | {}{unit}/s | {turns} | {torque} | {} | {}{unit} |",
        axis.soft.min,
        axis.soft.max,
        axis.vendor.min,
        axis.vendor.max,
        axis.max_speed,
        axis.sign,
        axis.offset
    )
}

#[test]
fn the_tables_are_those_of_the_files() {
    let models = RobotModel::names().filter_map(RobotModel::named);
    let written = models.map(section).collect::<Vec<_>>().join("\n");
    let (_, shown) = DOCUMENT.split_once("a test compares it. -->\n\n").unwrap();
    assert!(shown == written, "the end of docs/MODELS.md has to be:\n{written}");
}

fn example() -> &'static str {
    let (_, rest) = DOCUMENT.split_once("```toml\n").unwrap();
    rest.split_once("```").unwrap().0
}

#[test]
fn the_example_is_a_model() {
    let model = RobotModel::from_toml(example()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((&*model.name, model.axis_count()), ("my-scara", 4));
    assert_eq!((model.axes[1].sign, model.axes[1].offset), (-1, 10.0));
    assert_eq!(model.axes[2].gear_ratio, 1.0 / 16.0);
}

#[test]
fn the_complaints_are_those_of_the_reader() {
    let changes =
        [("kind = \"scara\"", "kind = \"skara\""), ("soft = [-120.0, 120.0]", "soft = [20.0, 120.0]")];
    for (from, to) in changes {
        assert!(example().contains(from), "{from}");
        let error = RobotModel::from_toml(&example().replacen(from, to, 1)).unwrap_err().to_string();
        assert!(DOCUMENT.lines().any(|line| line == error), "{error}");
    }
}
