//! One instruction, read as far as this machine needs.

use std::time::Duration;

use serde_json::Value;

use super::AXES;
use super::track::WORLD_OFFSET;

/// The distance by which a tool moves the flange from the target, mm in Z. So the reported position differs
/// from the sent one.
const TOOL_LENGTH: f64 = 50.0;

/// One instruction for this machine.
#[derive(Clone, Debug)]
pub(super) struct Step {
    /// The number of its AddRCC, from 1, from any client; 0 for the taught program.
    pub list: u32,
    /// Its place in that list, from 1.
    pub place: u32,
    pub act: Act,
    /// Whether the arm passes its point without stopping (`smooth` above 0).
    pub blended: bool,
    /// Whether it is executed only once (`oneshot`, 1 if left out).
    pub once: bool,
    /// Whether its `tool` is not 0.
    pub tool: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Act {
    /// Action 4: the axes that move, and their targets.
    Axes([Option<f64>; AXES]),
    /// Action 10 or 17 in the same form, in degrees and mm of the axes.
    Line([Option<f64>; AXES]),
    /// Action 100, or the `delay` of another action.
    Wait(Duration),
    /// Action 800.
    Workbench,
    /// Any other action: it takes no time and moves nothing.
    Nothing,
}

impl Step {
    /// Reads an instruction. Missing or invalid members count as absent, because this machine does not
    /// validate.
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

/// The target of each axis that has a coordinate and is in the mask.
fn target(instruction: &Value) -> [Option<f64>; AXES] {
    let mask = instruction["ckStatus"].as_str().map_or(u32::MAX, mask);
    std::array::from_fn(|axis| number(&instruction[format!("m{axis}")]).filter(|_| mask >> axis & 1 == 1))
}

/// Converts the pose of the tool to the axes of the gantry.
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

/// Reads a `ckStatus`: `"0x3F"` or decimal. An invalid one moves nothing.
fn mask(text: &str) -> u32 {
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u32::from_str_radix(digits, 16).unwrap_or(0),
        None => text.parse().unwrap_or(0),
    }
}

/// A finite number, sent as a number or as text.
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
