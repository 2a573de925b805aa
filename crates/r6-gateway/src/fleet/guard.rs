//! The limits that each list of a robot is checked against before it is sent.

use std::collections::BTreeSet;

use r6_api::gateway::{GuardRange, GuardWanted, RobotGuard};
use r6_client::units::{AxisCoordinate, Degrees, Millimetres, MillimetresPerSecond, Percent};
use r6_client::{AxisIndex, Envelope};
use r6_proto::message::instruction::PathSpeed;

/// Limits of lists, as the client checks them and as the API tells them. They compare numbers with numbers,
/// and protect no people (`docs/SAFETY.md`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Guard {
    envelope: Envelope,
    wanted: GuardWanted,
}

impl Guard {
    /// Without limits.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Limits as the API takes them.
    ///
    /// # Errors
    /// The first limit that cannot be, with what it has to be.
    pub fn read(wanted: &GuardWanted) -> Result<Self, String> {
        let GuardWanted { max_speed, max_path_speed, max_axis_step, max_distance, axes, workspace } = wanted;
        let mut guard = Self::new();
        if let Some(cap) = max_speed {
            guard = guard.max_speed(Percent::new(*cap).map_err(|error| named("max_speed", &error))?);
        }
        if let Some(cap) = max_path_speed {
            // A whole number has no decimals as a text.
            let speed = cap.to_string().parse().ok().and_then(|speed| MillimetresPerSecond::new(speed).ok());
            let wrong = || named("max_path_speed", &format!("{cap} is not {}", PathSpeed::WANTED));
            guard = guard.max_path_speed(speed.ok_or_else(wrong)?);
        }
        if let Some(largest) = max_axis_step {
            guard = guard.max_axis_step(Degrees(above_zero("max_axis_step", *largest)?));
        }
        if let Some(largest) = max_distance {
            guard = guard.max_distance(Millimetres(above_zero("max_distance", *largest)?));
        }
        let mut seen = BTreeSet::new();
        for range in axes {
            let (lowest, highest) = ends("axes", range)?;
            let index = AxisIndex::ALL.into_iter().find(|axis| axis_name(*axis) == range.of);
            let axis =
                index.ok_or_else(|| named("axes", &format!("`{}` is not one of J1 to J8", range.of)))?;
            let of: fn(f64) -> AxisCoordinate = match range.unit.as_str() {
                "deg" => |value| Degrees(value).into(),
                "mm" => |value| Millimetres(value).into(),
                unit => {
                    let wrong =
                        format!("the unit of `{}` is `{unit}`, but has to be `deg` or `mm`", range.of);
                    return Err(named("axes", &wrong));
                }
            };
            // The client keeps one range of each axis.
            if !seen.insert(&range.of) {
                return Err(named("axes", &format!("`{}` has two ranges", range.of)));
            }
            guard = guard.axis(axis, of(lowest), of(highest));
        }
        let mut places = [None; 3];
        for range in workspace {
            let ends = ends("workspace", range)?;
            let mut slots = PLACES.iter().zip(&mut places);
            let slot = slots.find_map(|(place, slot)| (*place == range.of).then_some(slot));
            let slot =
                slot.ok_or_else(|| named("workspace", &format!("`{}` is not one of x, y and z", range.of)))?;
            if range.unit != "mm" {
                let wrong = format!("the unit of `{}` is `{}`, but has to be `mm`", range.of, range.unit);
                return Err(named("workspace", &wrong));
            }
            if slot.replace(ends).is_some() {
                return Err(named("workspace", &format!("`{}` has two ranges", range.of)));
            }
        }
        Ok(if workspace.is_empty() { guard } else { guard.workspace(places) })
    }

    /// The highest speed of moves, before the global speed.
    #[must_use]
    pub fn max_speed(mut self, cap: Percent) -> Self {
        self.wanted.max_speed = Some(cap.value());
        self.limited(|envelope| envelope.speed_cap(cap))
    }

    /// The highest path speed.
    #[must_use]
    pub fn max_path_speed(mut self, cap: MillimetresPerSecond) -> Self {
        self.wanted.max_path_speed = Some(cap.value());
        self.limited(|envelope| envelope.path_speed_cap(cap))
    }

    /// How far an axis move turns an axis at most.
    #[must_use]
    pub fn max_axis_step(mut self, largest: Degrees) -> Self {
        self.wanted.max_axis_step = Some(largest.0);
        self.limited(|envelope| envelope.largest_axis_step(largest))
    }

    /// How far a move of the tool goes at most.
    #[must_use]
    pub fn max_distance(mut self, largest: Millimetres) -> Self {
        self.wanted.max_distance = Some(largest.0);
        self.limited(|envelope| envelope.largest_distance(largest))
    }

    /// The range of an axis in axis moves, the lowest value first, both in one unit.
    #[must_use]
    pub fn axis(mut self, axis: AxisIndex, lowest: AxisCoordinate, highest: AxisCoordinate) -> Self {
        let unit = if matches!(lowest, AxisCoordinate::Millimetres(_)) { "mm" } else { "deg" };
        let of = axis_name(axis);
        let (low, high) = (lowest.value(), highest.value());
        self.wanted.axes.push(GuardRange { of, unit: unit.to_owned(), lowest: low, highest: high });
        self.limited(|envelope| envelope.axis_limits(axis, lowest, highest))
    }

    /// The ranges of X, Y and Z in mm, the lowest value first, in the work frame in use; `None` is no limit.
    #[must_use]
    pub fn workspace(mut self, ranges: [Option<(f64, f64)>; 3]) -> Self {
        let told = PLACES.into_iter().zip(ranges).filter_map(|(of, range)| {
            let (lowest, highest) = range?;
            Some(GuardRange { of: of.to_owned(), unit: "mm".to_owned(), lowest, highest })
        });
        self.wanted.workspace = told.collect();
        let ranges = ranges.map(|range| range.unwrap_or((f64::NEG_INFINITY, f64::INFINITY)));
        let [lowest, highest] = [ranges.map(|(low, _)| low), ranges.map(|(_, high)| high)];
        self.limited(|envelope| envelope.workspace(lowest.map(Millimetres), highest.map(Millimetres)))
    }

    /// What the client checks.
    #[must_use]
    pub fn envelope(&self) -> &Envelope {
        &self.envelope
    }

    /// These limits as the API takes them.
    pub(crate) fn wanted(&self) -> &GuardWanted {
        &self.wanted
    }

    /// These limits as the API tells them.
    pub(crate) fn told(&self) -> RobotGuard {
        let GuardWanted { max_speed, max_path_speed, max_axis_step, max_distance, axes, workspace } =
            self.wanted.clone();
        RobotGuard { max_speed, max_path_speed, max_axis_step, max_distance, axes, workspace }
    }

    fn limited(mut self, limit: impl FnOnce(Envelope) -> Envelope) -> Self {
        self.envelope = limit(self.envelope);
        self
    }
}

/// The parts of a place that a workspace limits.
const PLACES: [&str; 3] = ["x", "y", "z"];

fn axis_name(axis: AxisIndex) -> String {
    format!("J{}", axis.index() + 1)
}

fn named(limit: &str, why: &impl std::fmt::Display) -> String {
    format!("`guard`: `{limit}`: {why}")
}

fn above_zero(limit: &str, number: f64) -> Result<f64, String> {
    let is_good = number > 0.0 && number.is_finite();
    is_good.then_some(number).ok_or_else(|| named(limit, &format!("{number} is not a number above 0")))
}

/// The lowest and the highest value of a range.
fn ends(limit: &str, range: &GuardRange) -> Result<(f64, f64), String> {
    let GuardRange { of, lowest, highest, .. } = range;
    let is_range = lowest.is_finite() && highest.is_finite() && lowest <= highest;
    let why =
        || named(limit, &format!("the lowest value of `{of}`, {lowest}, is above the highest, {highest}"));
    is_range.then_some((*lowest, *highest)).ok_or_else(why)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    use serde_json::json;

    use super::*;

    fn read(wanted: serde_json::Value) -> Result<Guard, String> {
        let wanted: GuardWanted = serde_json::from_value(wanted).map_err(|error| error.to_string())?;
        Guard::read(&wanted)
    }

    #[test]
    fn limits_over_the_api_are_those_of_a_file_and_are_kept_as_they_were_wanted() {
        let wanted = json!({
            "max_speed": 50.0, "max_path_speed": 250.0, "max_axis_step": 30.5, "max_distance": 200.0,
            "axes": [{ "of": "J1", "unit": "deg", "lowest": -90.0, "highest": 90.0 },
                     { "of": "J7", "unit": "mm", "lowest": 0.0, "highest": 1500.5 }],
            "workspace": [{ "of": "z", "unit": "mm", "lowest": 100.0, "highest": 900.0 }],
        });
        let guard = read(wanted.clone()).unwrap();
        let [first, .., seventh, _] = AxisIndex::ALL;
        let of_file = Guard::new()
            .max_speed(Percent::new(50.0).unwrap())
            .max_path_speed(MillimetresPerSecond::new(250).unwrap())
            .max_axis_step(Degrees(30.5))
            .max_distance(Millimetres(200.0))
            .axis(first, Degrees(-90.0).into(), Degrees(90.0).into())
            .axis(seventh, Millimetres(0.0).into(), Millimetres(1500.5).into())
            .workspace([None, None, Some((100.0, 900.0))]);
        assert_eq!(guard, of_file);
        assert_eq!(serde_json::to_value(guard.wanted()).unwrap(), wanted);
        assert_eq!(read(json!({})).unwrap(), Guard::new());
    }

    #[test]
    fn a_limit_that_cannot_be_is_named() {
        let axis = |of: &str, unit: &str, lowest: f64| json!({ "of": of, "unit": unit, "lowest": lowest, "highest": 9.0 });
        for (wanted, why) in [
            (json!({ "max_sped": 1.0 }), "unknown field `max_sped`"),
            (
                json!({ "max_speed": 0.0 }),
                "`guard`: `max_speed`: 0 is not allowed: it has to be percent, from 0.1 to 100",
            ),
            (json!({ "max_path_speed": 0 }), "`max_path_speed`: 0 is not a whole number of mm/s"),
            (json!({ "max_path_speed": 2.5 }), "`max_path_speed`: 2.5 is not a whole number of mm/s"),
            (json!({ "max_axis_step": 0.0 }), "`max_axis_step`: 0 is not a number above 0"),
            (json!({ "max_distance": -1.0 }), "`max_distance`: -1 is not a number above 0"),
            (json!({ "axes": [axis("J9", "deg", 0.0)] }), "`axes`: `J9` is not one of J1 to J8"),
            (
                json!({ "axes": [axis("J1", "rad", 0.0)] }),
                "the unit of `J1` is `rad`, but has to be `deg` or `mm`",
            ),
            (
                json!({ "axes": [axis("J1", "deg", 10.0)] }),
                "the lowest value of `J1`, 10, is above the highest, 9",
            ),
            (json!({ "axes": [axis("J1", "deg", 0.0), axis("J1", "deg", 1.0)] }), "`J1` has two ranges"),
            (json!({ "axes": [axis("J1", "deg", 0.0), axis("J1", "mm", 1.0)] }), "`J1` has two ranges"),
            (json!({ "workspace": [axis("u", "mm", 0.0)] }), "`workspace`: `u` is not one of x, y and z"),
            (json!({ "workspace": [axis("x", "deg", 0.0)] }), "the unit of `x` is `deg`, but has to be `mm`"),
            (json!({ "workspace": [axis("x", "mm", 0.0), axis("x", "mm", 1.0)] }), "`x` has two ranges"),
        ] {
            let told = read(wanted.clone()).unwrap_err();
            assert!(told.contains(why), "{wanted}: {told}");
        }
    }
}
