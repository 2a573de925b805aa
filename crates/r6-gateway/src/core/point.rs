//! The points that the gateway keeps: their names, and what a place of an arm may be.

use std::fmt;

use r6_api::gateway::PointValue;

use super::library;

/// The most points. All of them are listed at once, some 400 bytes each.
pub const MAX_KEPT: usize = 1_000;

/// The farthest number of a place, degrees or mm: beyond all arms.
const FARTHEST: f64 = 1e6;

/// The most axes of an arm.
const MAX_AXES: usize = 8;

/// The longest note, in bytes: a sentence.
const MAX_NOTE: usize = 200;

/// The name of a point: 1 to 64 characters of a to z, digits, `-` and `_`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PointName(String);

impl PointName {
    /// What a name is, for people.
    pub const WANTED: &str = "a name of 1 to 64 characters: a to z, digits, - and _";

    /// The name; `None` if the text is no name.
    #[must_use]
    pub fn new(text: &str) -> Option<Self> {
        library::is_name(text).then(|| Self(text.to_owned()))
    }

    /// Its text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for PointName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Checks that a value is a place that an arm could be told.
///
/// # Errors
/// What is wrong with it.
pub fn check(value: &PointValue) -> Result<(), String> {
    let PointValue { robot: _, axes, pose, tool, work_frame, note } = value;
    if axes.is_none() && pose.is_none() {
        return Err("a point has `axes`, `pose` or both, or else the `robot` that stands there".to_owned());
    }
    if axes.as_ref().is_some_and(|axes| !(1..=MAX_AXES).contains(&axes.len())) {
        return Err(format!("axes has 1 to {MAX_AXES} numbers, J1 first"));
    }
    if pose.as_ref().is_some_and(|pose| pose.len() != 6) {
        return Err("pose has 6 numbers: X, Y, Z, U, V, W".to_owned());
    }
    let mut numbers = axes.iter().chain(pose).flatten();
    if let Some(far) = numbers.find(|number| number.is_nan() || number.abs() > FARTHEST) {
        return Err(format!("no arm reaches {far}: numbers are from -{FARTHEST} to {FARTHEST}"));
    }
    if pose.is_none() && (tool.is_some() || work_frame.is_some()) {
        return Err("tool and work_frame are those of `pose`".to_owned());
    }
    if note.len() > MAX_NOTE || note.chars().any(char::is_control) {
        return Err(format!("note has at most {MAX_NOTE} bytes, and no control characters"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value() -> PointValue {
        let axes = Some(vec![0.0, -10.5, 20.0, 0.0, 90.0, 0.0]);
        PointValue { robot: None, axes, pose: None, tool: None, work_frame: None, note: String::new() }
    }

    #[test]
    fn a_place_is_checked() {
        let pose = Some(vec![531.6, 0.0, 600.0, 180.0, 0.0, 0.0]);
        let whole = PointValue { pose: pose.clone(), tool: Some(1), work_frame: Some(0), ..value() };
        for fits in [value(), whole.clone(), PointValue { axes: None, ..whole.clone() }] {
            assert_eq!(check(&fits), Ok(()), "{fits:?}");
        }
        for (wrong, told) in [
            (PointValue { axes: None, ..value() }, "`axes`, `pose` or both"),
            (PointValue { axes: Some(vec![]), ..value() }, "1 to 8 numbers"),
            (PointValue { axes: Some(vec![0.0; 9]), ..value() }, "1 to 8 numbers"),
            (PointValue { axes: Some(vec![f64::NAN]), ..value() }, "no arm reaches NaN"),
            (PointValue { axes: Some(vec![1.1e6]), ..value() }, "no arm reaches 1100000"),
            (PointValue { pose: Some(vec![0.0; 5]), ..value() }, "6 numbers"),
            (PointValue { pose: Some(vec![f64::INFINITY; 6]), ..value() }, "no arm reaches inf"),
            (PointValue { tool: Some(1), ..value() }, "those of `pose`"),
            (PointValue { work_frame: Some(1), ..value() }, "those of `pose`"),
            (PointValue { note: "x".repeat(201), ..value() }, "at most 200 bytes"),
            (PointValue { note: "a\nb".to_owned(), ..value() }, "control characters"),
        ] {
            let refused = check(&wrong).unwrap_err();
            assert!(refused.contains(told), "{refused}");
        }
    }

    #[test]
    fn a_point_may_be_called_as_programs_may_not() {
        for (name, fits) in
            [("above-belt", true), ("check", true), ("", false), ("Above", false), ("a/b", false)]
        {
            assert_eq!(PointName::new(name).is_some(), fits, "{name}");
        }
    }
}
