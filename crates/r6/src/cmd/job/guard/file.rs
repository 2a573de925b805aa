//! The limits of a cell, as a file.

use std::path::Path;

use r6_client::units::{AxisCoordinate, Degrees, Millimetres, MillimetresPerSecond, Percent};
use r6_client::{AxisIndex, Envelope};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::exit::Failure;
use crate::text_file;
use r6::program_file::lines;

/// The longest file: limits are a few lines.
const MAX_FILE_BYTES: usize = 64 * 1024;

/// The keys of the file.
const KEYS: [&str; 7] =
    ["max_speed", "max_path_speed", "max_axis_step", "max_distance", "axes", "axes_mm", "workspace"];

/// The keys of `[axes]` and `[axes_mm]`.
const AXES: [&str; 8] = ["J1", "J2", "J3", "J4", "J5", "J6", "J7", "J8"];

/// The keys of `[workspace]`.
const PLACES: [&str; 3] = ["x", "y", "z"];

/// What a list may ask for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Limits {
    /// `max_speed`, percent.
    pub max_speed: Option<Percent>,
    /// `max_axis_step`, degrees.
    pub max_axis_step: Option<Degrees>,
    max_path_speed: Option<MillimetresPerSecond>,
    max_distance: Option<Millimetres>,
    axes: Vec<(AxisIndex, AxisCoordinate, AxisCoordinate)>,
    workspace: Option<[(f64, f64); 3]>,
}

impl Limits {
    /// As the SDK checks them.
    pub fn envelope(&self) -> Envelope {
        let mut envelope = Envelope::new();
        if let Some(cap) = self.max_speed {
            envelope = envelope.speed_cap(cap);
        }
        if let Some(cap) = self.max_path_speed {
            envelope = envelope.path_speed_cap(cap);
        }
        if let Some(largest) = self.max_axis_step {
            envelope = envelope.largest_axis_step(largest);
        }
        if let Some(largest) = self.max_distance {
            envelope = envelope.largest_distance(largest);
        }
        for (axis, lowest, highest) in &self.axes {
            envelope = envelope.axis_limits(*axis, *lowest, *highest);
        }
        if let Some(workspace) = self.workspace {
            let [lowest, highest] = [workspace.map(|(low, _)| low), workspace.map(|(_, high)| high)];
            envelope = envelope.workspace(lowest.map(Millimetres), highest.map(Millimetres));
        }
        envelope
    }
}

/// Reads the limits of a file.
pub fn read(path: &Path) -> Result<Limits, Failure> {
    let name = path.display();
    let text = text_file::read(path, "a file of limits", MAX_FILE_BYTES)
        .map_err(|error| Failure::usage(format!("{name}: {error}")))?;
    parse(&text).map_err(|Wrong { at, what, advice }| {
        let (line, column) = lines::position(&text, at);
        let failure = Failure::usage(format!("{name}:{line}:{column}: {what}"));
        match advice {
            Some(advice) => failure.advise(advice),
            None => failure,
        }
    })
}

/// What is wrong with a file, and at which byte.
#[derive(Debug)]
struct Wrong {
    at: usize,
    what: String,
    advice: Option<String>,
}

fn parse(text: &str) -> Result<Limits, Wrong> {
    let file = DeTable::parse(text).map_err(|error| Wrong {
        at: error.span().map_or(0, |span| span.start),
        what: error.message().lines().collect::<Vec<_>>().join(" "),
        advice: None,
    })?;
    let mut limits = Limits::default();
    for (key, value) in file.get_ref() {
        let at = value.span().start;
        match known(key, &KEYS)? {
            "max_speed" => {
                let cap = Percent::new(number(key, value)?).map_err(|error| wrong(at, key, error.wanted))?;
                limits.max_speed = Some(cap);
            }
            "max_path_speed" => {
                let cap = whole(value).and_then(|cap| MillimetresPerSecond::new(cap).ok());
                let wanted = "a whole number of mm/s, from 1 to 100000";
                limits.max_path_speed = Some(cap.ok_or_else(|| wrong(at, key, wanted))?);
            }
            "max_axis_step" => limits.max_axis_step = Some(Degrees(above_zero(key, value)?)),
            "max_distance" => limits.max_distance = Some(Millimetres(above_zero(key, value)?)),
            "axes" => limits.axes.extend(axes(key, value, |angle| Degrees(angle).into())?),
            "axes_mm" => limits.axes.extend(axes(key, value, |length| Millimetres(length).into())?),
            _ => limits.workspace = Some(workspace(key, value)?),
        }
    }
    Ok(limits)
}

type Key<'t> = Spanned<std::borrow::Cow<'t, str>>;
type Value<'t> = Spanned<DeValue<'t>>;

/// The key, if it is one of these.
fn known(key: &Key<'_>, names: &[&'static str]) -> Result<&'static str, Wrong> {
    let word = key.get_ref().as_ref();
    names.iter().copied().find(|name| *name == word).ok_or_else(|| {
        let near = r6_proto::nearest(word, names.iter().copied()).map(|near| format!("nearest: `{near}`"));
        Wrong {
            at: key.span().start,
            what: format!("there is no limit `{word}`"),
            advice: near.or_else(|| Some(format!("there are: {}", names.join(", ")))),
        }
    })
}

fn wrong(at: usize, key: &Key<'_>, wanted: &str) -> Wrong {
    Wrong { at, what: format!("`{}` has to be {wanted}", key.get_ref()), advice: None }
}

fn whole(value: &Value<'_>) -> Option<u32> {
    let integer = value.get_ref().as_integer()?;
    u32::from_str_radix(integer.as_str(), integer.radix()).ok()
}

/// A number that is one: TOML also has infinity, and `nan`.
fn finite(value: &DeValue<'_>) -> Option<f64> {
    let number = match value {
        DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str().parse::<f64>().ok(),
        DeValue::Float(float) => float.as_str().parse::<f64>().ok(),
        DeValue::Integer(_)
        | DeValue::String(_)
        | DeValue::Boolean(_)
        | DeValue::Datetime(_)
        | DeValue::Array(_)
        | DeValue::Table(_) => None,
    };
    number.filter(|number| number.is_finite())
}

fn number(key: &Key<'_>, value: &Value<'_>) -> Result<f64, Wrong> {
    finite(value.get_ref()).ok_or_else(|| wrong(value.span().start, key, "a number"))
}

fn above_zero(key: &Key<'_>, value: &Value<'_>) -> Result<f64, Wrong> {
    let number = number(key, value)?;
    if number > 0.0 { Ok(number) } else { Err(wrong(value.span().start, key, "a number above 0")) }
}

/// The entries of a table, each the lowest and the highest value of one of these names.
fn ranges(key: &Key<'_>, value: &Value<'_>, names: &[&'static str]) -> Result<Vec<(usize, f64, f64)>, Wrong> {
    let table = value.get_ref().as_table().ok_or_else(|| {
        let wanted = format!("a table [{}]", key.get_ref());
        wrong(value.span().start, key, &wanted)
    })?;
    let mut ranges = Vec::new();
    for (key, value) in table {
        let name = known(key, names)?;
        let range = value.get_ref().as_array().and_then(|range| {
            let mut range = range.iter().map(|one| finite(one.get_ref()));
            match (range.next(), range.next(), range.next()) {
                (Some(Some(low)), Some(Some(high)), None) if low <= high => Some((low, high)),
                _ => None,
            }
        });
        let wanted = "the lowest and the highest value in brackets, such as [-90, 90]";
        let (low, high) = range.ok_or_else(|| wrong(value.span().start, key, wanted))?;
        ranges.extend(names.iter().position(|one| *one == name).map(|at| (at, low, high)));
    }
    Ok(ranges)
}

fn axes(
    key: &Key<'_>,
    value: &Value<'_>,
    coordinate: impl Fn(f64) -> AxisCoordinate,
) -> Result<Vec<(AxisIndex, AxisCoordinate, AxisCoordinate)>, Wrong> {
    let ranges = ranges(key, value, &AXES)?.into_iter();
    let limits = ranges
        .filter_map(|(at, low, high)| Some((*AxisIndex::ALL.get(at)?, coordinate(low), coordinate(high))));
    Ok(limits.collect())
}

/// A component that is not named is not limited.
fn workspace(key: &Key<'_>, value: &Value<'_>) -> Result<[(f64, f64); 3], Wrong> {
    let mut workspace = [(f64::NEG_INFINITY, f64::INFINITY); 3];
    for (at, low, high) in ranges(key, value, &PLACES)? {
        if let Some(slot) = workspace.get_mut(at) {
            *slot = (low, high);
        }
    }
    Ok(workspace)
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
    fn what_is_wrong_is_told_with_its_place_and_the_nearest_word() {
        for (text, at, what, advice) in [
            ("max_sped = 20", 0, "there is no limit `max_sped`", Some("nearest: `max_speed`")),
            ("max_speed = 0", 12, "`max_speed` has to be percent, from 0.1 to 100 in steps of 0.1", None),
            ("max_speed = \"20\"", 12, "`max_speed` has to be a number", None),
            ("max_speed = nan", 12, "`max_speed` has to be a number", None),
            (
                "max_path_speed = 2.5",
                17,
                "`max_path_speed` has to be a whole number of mm/s, from 1 to 100000",
                None,
            ),
            ("max_axis_step = 0", 16, "`max_axis_step` has to be a number above 0", None),
            ("[axes]\nj1 = [0, 1]", 7, "there is no limit `j1`", Some("nearest: `J1`")),
            (
                "[axes]\nJ1 = [90, -90]",
                12,
                "`J1` has to be the lowest and the highest value in brackets, such as [-90, 90]",
                None,
            ),
            (
                "[axes]\nJ1 = [1, 2, 3]",
                12,
                "`J1` has to be the lowest and the highest value in brackets, such as [-90, 90]",
                None,
            ),
            ("workspace = 5", 12, "`workspace` has to be a table [workspace]", None),
        ] {
            let error = parse(text).unwrap_err();
            assert_eq!((error.at, error.what.as_str()), (at, what), "{text}");
            assert_eq!(error.advice.as_deref(), advice, "{text}");
        }
        assert!(parse("a = [").is_err());
    }
}
