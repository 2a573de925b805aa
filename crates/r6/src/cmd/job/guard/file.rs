//! The file with the limits of a cell.

use std::path::Path;

use r6_client::units::{AxisCoordinate, Degrees, Millimetres, MillimetresPerSecond, Percent};
use r6_client::{AxisIndex, Envelope};
use r6_gateway::Guard;
use r6_program::Mistakes;
use r6_program::form::{self, Fields, Found, Node, Table};
use r6_proto::message::instruction::PathSpeed;

use crate::exit::Failure;
use crate::text_file;

/// The longest file. Limits take a few lines.
const MAX_FILE_BYTES: usize = 64 * 1024;

/// The keys of `[axes]` and `[axes_mm]`.
const AXES: [&str; 8] = ["J1", "J2", "J3", "J4", "J5", "J6", "J7", "J8"];

/// The keys of `[workspace]`.
const PLACES: [&str; 3] = ["x", "y", "z"];

/// An axis with its lowest and its highest value.
type AxisLimits = (AxisIndex, AxisCoordinate, AxisCoordinate);

/// The limits of a list.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Limits {
    /// `max_speed`, percent.
    pub max_speed: Option<Percent>,
    /// `max_axis_step`, degrees.
    pub max_axis_step: Option<Degrees>,
    max_path_speed: Option<MillimetresPerSecond>,
    max_distance: Option<Millimetres>,
    axes: Vec<AxisLimits>,
    workspace: Option<[Option<(f64, f64)>; 3]>,
}

impl Limits {
    /// The limits as the client library checks them.
    pub fn envelope(&self) -> Envelope {
        self.guard().envelope().clone()
    }

    /// The limits as a gateway has them.
    pub fn guard(&self) -> Guard {
        let mut guard = Guard::new();
        if let Some(cap) = self.max_speed {
            guard = guard.max_speed(cap);
        }
        if let Some(cap) = self.max_path_speed {
            guard = guard.max_path_speed(cap);
        }
        if let Some(largest) = self.max_axis_step {
            guard = guard.max_axis_step(largest);
        }
        if let Some(largest) = self.max_distance {
            guard = guard.max_distance(largest);
        }
        for (axis, lowest, highest) in &self.axes {
            guard = guard.axis(*axis, *lowest, *highest);
        }
        if let Some(workspace) = self.workspace {
            guard = guard.workspace(workspace);
        }
        guard
    }

    /// The limits of a table, such as `[robot.guard]`.
    pub fn of_table(table: &Table, place: &str, found: &mut Found<'_>) -> Option<Self> {
        let fields = Fields::of(table, &[], place);
        let limits = read_fields(&fields, found);
        fields.finish(Ok(limits), found)
    }
}

/// Reads the limits from a file.
pub fn read(path: &Path) -> Result<Limits, Failure> {
    let name = path.display().to_string();
    let text = text_file::read(path, "a file of limits", MAX_FILE_BYTES)
        .map_err(|error| Failure::usage(format!("{name}: {error}")))?;
    parse(&text).map_err(|mistakes| Failure::in_file(&name, &mistakes))
}

fn parse(text: &str) -> Result<Limits, Mistakes> {
    let (document, mut found) = form::parse(text);
    let fields = Fields::of(&document, &[], "");
    let limits = read_fields(&fields, &mut found);
    let limits = fields.finish(Ok(limits), &mut found);
    found.finish(limits)
}

fn read_fields(fields: &Fields<'_>, found: &mut Found<'_>) -> Limits {
    let above_zero = |name| {
        fields.optional(name, "a number above 0", |value| value.number().filter(|number| *number > 0.0))
    };
    Limits {
        max_speed: fields.optional("max_speed", Percent::WANTED, |value| Percent::new(value.number()?).ok()),
        max_path_speed: fields.optional("max_path_speed", PathSpeed::WANTED, |value| {
            MillimetresPerSecond::new(u32::try_from(value.whole()?).ok()?).ok()
        }),
        max_axis_step: above_zero("max_axis_step").map(Degrees),
        max_distance: above_zero("max_distance").map(Millimetres),
        axes: all_axes(fields, found),
        workspace: workspace(fields, found),
    }
}

/// The lowest and the highest value for each of `names` in a table; `None` if there is no such table.
fn ranges(
    fields: &Fields<'_>,
    name: &'static str,
    names: &'static [&'static str],
    found: &mut Found<'_>,
) -> Option<Vec<Option<(f64, f64)>>> {
    let table = fields.optional(name, &format!("a table [{name}]"), Node::table)?;
    let inner = Fields::of(table, names, "");
    let range = |value: &Node| match value.list()? {
        [low, high] => Some((low.number()?, high.number()?)).filter(|(low, high)| low <= high),
        _ => None,
    };
    let wanted = "the lowest and the highest value in brackets, such as [-90, 90]";
    let ranges = names.iter().map(|name| inner.optional(name, wanted, range)).collect();
    inner.finish(Ok(ranges), found)
}

/// The limits of axes that turn and of axes that slide.
fn all_axes(fields: &Fields<'_>, found: &mut Found<'_>) -> Vec<AxisLimits> {
    let turning = axes(fields, "axes", found, |angle| Degrees(angle).into());
    let sliding = axes(fields, "axes_mm", found, |length| Millimetres(length).into());
    // The client keeps one range of each axis.
    if let Some((twice, ..)) =
        sliding.iter().find(|(axis, ..)| turning.iter().any(|(other, ..)| other == axis))
    {
        let wrong = format!("J{} has a range in [axes] too: an axis turns or slides", twice.index() + 1);
        let _noted = fields.wrong("axes_mm", wrong);
    }
    [turning, sliding].concat()
}

fn axes(
    fields: &Fields<'_>,
    name: &'static str,
    found: &mut Found<'_>,
    coordinate: impl Fn(f64) -> AxisCoordinate,
) -> Vec<AxisLimits> {
    let ranges = ranges(fields, name, &AXES, found).unwrap_or_default();
    let limits = AxisIndex::ALL.into_iter().zip(ranges);
    limits
        .filter_map(|(axis, range)| range.map(|(low, high)| (axis, coordinate(low), coordinate(high))))
        .collect()
}

/// The limits of the workspace. A component without an entry is not limited.
fn workspace(fields: &Fields<'_>, found: &mut Found<'_>) -> Option<[Option<(f64, f64)>; 3]> {
    let ranges = ranges(fields, "workspace", &PLACES, found)?;
    ranges.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_limits_are_read() {
        let limits = parse(
            "max_speed = 20\nmax_path_speed = 250\nmax_axis_step = 30.5\nmax_distance = 200\n\
             [axes]\nJ1 = [-90, 90]\n[axes_mm]\nJ7 = [0, 1500.5]\n[workspace]\nz = [100, 600]\n",
        )
        .unwrap();
        let j = AxisIndex::ALL;
        let expected = Envelope::new()
            .speed_cap(Percent::new(20.0).unwrap())
            .path_speed_cap(MillimetresPerSecond::new(250).unwrap())
            .largest_axis_step(Degrees(30.5))
            .largest_distance(Millimetres(200.0))
            .axis_limits(j[0], Degrees(-90.0), Degrees(90.0))
            .axis_limits(j[6], Millimetres(0.0), Millimetres(1500.5))
            .workspace(
                [f64::NEG_INFINITY, f64::NEG_INFINITY, 100.0].map(Millimetres),
                [f64::INFINITY, f64::INFINITY, 600.0].map(Millimetres),
            );
        assert_eq!(limits.envelope(), expected);
        assert_eq!(parse("").unwrap(), Limits::default());
    }

    #[test]
    fn all_mistakes_are_told_with_their_places_and_the_nearest_word() {
        let range = "but has to be the lowest and the highest value in brackets, such as [-90, 90]";
        for (text, wanted) in [
            (
                "max_sped = 20\nmax_speed = 0\nmax_path_speed = 2.5\nmax_axis_step = 0\n[axes]\nj1 = [0, 1]",
                &[
                    "1:1: there is no key `max_sped`; nearest: `max_speed`",
                    "2:13: `max_speed` is 0, but has to be percent, from 0.1 to 100 in steps of 0.1",
                    "3:18: `max_path_speed` is 2.5, but has to be a whole number of mm/s, from 1 to 10000",
                    "4:17: `max_axis_step` is 0, but has to be a number above 0",
                    "6:1: there is no key `j1`; nearest: `J1`",
                ][..],
            ),
            (
                "max_speed = \"20\"\nmax_distance = nan\n[axes]\nJ1 = [90, -90]\nJ2 = [1, 2, 3]",
                &[
                    "1:13: `max_speed` is the text \"20\", but has to be percent, from 0.1 to 100 in steps of 0.1",
                    "2:16: `max_distance` is nan, but has to be a number above 0",
                    &format!("4:6: `J1` is a list, {range}"),
                    &format!("5:6: `J2` is a list, {range}"),
                ],
            ),
            (
                "[axes]\nJ7 = [0, 9]\n[axes_mm]\nJ7 = [0, 9]",
                &["3:1: J7 has a range in [axes] too: an axis turns or slides"],
            ),
            ("workspace = 5", &["1:13: `workspace` is 5, but has to be a table [workspace]"]),
        ] {
            let mistakes = parse(text).unwrap_err().to_string();
            assert_eq!(mistakes.lines().collect::<Vec<_>>(), wanted, "{text}");
        }
        assert!(parse("a = [").is_err());
    }
}
