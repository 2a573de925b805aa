//! One instruction, read as far as this machine needs it.

use std::time::Duration;

use serde_json::Value;

use super::AXES;
use super::track::WORLD_OFFSET;

/// A tool moves the flange so far from the target, mm in Z: the position that is told is another than the one
/// that was sent.
const TOOL_LENGTH: f64 = 50.0;

/// What one instruction is for this machine.
#[derive(Clone, Debug)]
pub(super) struct Step {
    /// The AddRCC that brought it, the first is 1, whoever sent it; 0 for the taught program.
    pub list: u32,
    /// Its place in that list, the first is 1.
    pub place: u32,
    pub act: Act,
    /// The arm does not stop at its point (`smooth` above 0).
    pub blended: bool,
    /// Executed once (`oneshot`, 1 if left out).
    pub once: bool,
    /// `tool` other than 0.
    pub tool: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Act {
    /// The axes that move, and where to: action 4.
    Axes([Option<f64>; AXES]),
    /// The same for an action 10, in degrees and mm of the axes.
    Line([Option<f64>; AXES]),
    /// An action 100, or the `delay` of another.
    Wait(Duration),
    /// An action 800.
    Workbench,
    /// Anything else: it takes no time and moves nothing.
    Nothing,
}

impl Step {
    /// Reads an instruction. What is missing or cannot be read counts as not there; this is a machine that
    /// does not validate.
    pub(super) fn read(list: u32, place: u32, instruction: &Value) -> Self {
        let number = |key: &str| number(&instruction[key]);
        let tool = number("tool").is_some_and(|tool| tool != 0.0);
        let act = match number("action") {
            Some(4.0) => Act::Axes(target(instruction)),
            Some(10.0 | 17.0) => Act::Line(flange(target(instruction), tool)),
            Some(100.0) => Act::Wait(seconds(number("limit"))),
            Some(800.0) => Act::Workbench,
            Some(_) | None => Act::Nothing,
        };
        Self {
            list,
            place,
            act,
            blended: number("smooth").is_some_and(|smooth| smooth > 0.0),
            once: number("oneshot") != Some(0.0),
            tool,
        }
    }
}

/// The target of each axis that is given and in the mask.
fn target(instruction: &Value) -> [Option<f64>; AXES] {
    let mask = instruction["ckStatus"].as_str().map_or(u32::MAX, mask);
    std::array::from_fn(|axis| number(&instruction[format!("m{axis}")]).filter(|_| mask >> axis & 1 == 1))
}

/// From the pose of the tool to the axes of the gantry.
fn flange(pose: [Option<f64>; AXES], tool: bool) -> [Option<f64>; AXES] {
    let mut axes = pose;
    for (value, offset) in axes.iter_mut().zip(WORLD_OFFSET) {
        *value = value.map(|value| value - offset);
    }
    if let Some(z) = axes.get_mut(2) {
        *z = z.map(|z| if tool { z + TOOL_LENGTH } else { z });
    }
    axes
}

/// A `ckStatus`: `"0x3F"` or decimal. One that cannot be read moves nothing.
fn mask(text: &str) -> u32 {
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u32::from_str_radix(digits, 16).unwrap_or(0),
        None => text.parse().unwrap_or(0),
    }
}

/// A finite number, given as a number or as text.
fn number(value: &Value) -> Option<f64> {
    let number = match value {
        Value::String(text) => text.trim().parse().ok()?,
        value => value.as_f64()?,
    };
    Some(number).filter(|number: &f64| number.is_finite())
}

fn seconds(value: Option<f64>) -> Duration {
    value.and_then(|value| Duration::try_from_secs_f64(value).ok()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_mask_leaves_axes_out() {
        let step = Step::read(1, 1, &json!({ "action": "4", "m0": "10.0", "m1": "5.0", "ckStatus": "0x02" }));
        let Act::Axes(target) = step.act else { panic!("{step:?}") };
        assert_eq!((target[0], target[1], target[2]), (None, Some(5.0), None));
    }

    #[test]
    fn a_line_is_told_as_a_pose_and_a_tool_is_longer_than_the_flange() {
        let told = |tool: &str| {
            let line = json!({ "action": "10", "m0": "510", "m2": "800", "tool": tool, "smooth": "3" });
            Step::read(1, 1, &line)
        };
        let Act::Line(flange) = told("0").act else { panic!() };
        assert_eq!((flange[0], flange[2]), (Some(10.0), Some(0.0)));
        let Act::Line(with_tool) = told("2").act else { panic!() };
        assert_eq!(with_tool[2], Some(50.0));
        assert!(told("2").tool && told("2").blended && !told("0").tool);
    }
}
