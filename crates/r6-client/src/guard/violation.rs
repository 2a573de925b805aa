//! Describes a step that goes beyond an envelope.

use std::fmt;

use r6_proto::axis::AxisIndex;

/// A step that goes beyond an envelope. Nothing of its list was sent.
#[derive(Clone, Copy, Debug)]
pub struct Violation {
    /// The step, counted from 1; 0 if the limits themselves are wrong.
    pub step: usize,
    /// The value that goes beyond the envelope.
    pub what: Checked,
    /// The number; `None` if it is not known, which counts as beyond.
    pub value: Option<f64>,
    /// The minimum and the maximum allowed, in the same unit.
    pub limit: (f64, f64),
}

/// A value that the guard compares with an envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Checked {
    /// The `speed` of a move, percent.
    Speed,
    /// The path speed, mm/s.
    PathSpeed,
    /// The target of an axis, degrees, or mm if it slides.
    Axis(AxisIndex, bool),
    /// How far a move turns an axis, degrees, or, if it slides, mm.
    AxisStep(AxisIndex, bool),
    /// The unit of an axis; `true` if the envelope has the axis slide, in mm, `false` if the envelope has it
    /// turn, in degrees.
    Unit(AxisIndex, bool),
    /// X, Y or Z of the tool, mm.
    Place(AxisIndex),
    /// How far a move goes, mm.
    Distance,
    /// The path of a curve that begins at an unknown place.
    Arc,
    /// The frame that a pose refers to: a different one than that of the envelope.
    Frame,
    /// The frame in use: this connection has selected a tool or a workbench since the guard was made.
    FrameUnknown,
    /// The kind of instruction, by its action number.
    Action(i64),
}

impl PartialEq for Violation {
    fn eq(&self, other: &Self) -> bool {
        let bits = |violation: &Self| {
            let (least, most) = violation.limit;
            (violation.value.map(f64::to_bits), least.to_bits(), most.to_bits())
        };
        (self.step, self.what, bits(self)) == (other.step, other.what, bits(other))
    }
}

// Numbers are compared bit by bit, so even NaN equals itself.
impl Eq for Violation {}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (least, most) = self.limit;
        let length = |slides: bool| if slides { "mm" } else { "deg" };
        if self.step == 0 {
            return self.wrong_limits(f);
        }
        write!(f, "step {}: ", self.step)?;
        match (self.what, self.value) {
            (Checked::Speed, Some(value)) => write!(f, "the speed is {value} %, above {most} %"),
            (Checked::Speed, None) => write!(f, "the move has no speed, and {most} % is the most"),
            (Checked::PathSpeed, Some(value)) => {
                write!(f, "the path speed is {value} mm/s, above {most} mm/s")
            }
            (Checked::PathSpeed, None) => write!(
                f,
                "the path speed is not known, because this list does not set it, and {most} mm/s is the most: set it with a path-speed \
                 step before the move, or give the move a speed"
            ),
            (Checked::Axis(axis, slides), value) => {
                let unit = length(slides);
                write!(f, "{axis} goes to {} {unit}, outside of {least} to {most} {unit}", Value(value))
            }
            (Checked::AxisStep(axis, slides), Some(value)) => {
                let unit = length(slides);
                write!(f, "{axis} goes {value} {unit} in one step, more than {most} {unit}")
            }
            (Checked::AxisStep(axis, slides), None) => write!(
                f,
                "how far {axis} goes is limited, and cannot be told: where it begins is not known, such as after a move of the \
                 tool. Begin a list of its own here, or leave out the limit `{}`",
                if slides { "max_distance" } else { "max_axis_step" }
            ),
            (Checked::Unit(axis, true), _) => {
                write!(f, "{axis} is told in degrees, but slides: its limits are in mm")
            }
            (Checked::Unit(axis, false), _) => {
                write!(f, "{axis} is told in mm, but turns: give it limits in mm if it slides")
            }
            (Checked::Place(axis), value) => {
                let name = axis.world_name();
                write!(f, "{name} gets to {} mm, outside of {least} to {most} mm", Value(value))
            }
            (Checked::Distance, Some(value)) => {
                write!(f, "the tool goes {value} mm in one step, more than {most} mm")
            }
            (Checked::Distance, None) => f.write_str(
                "how far the tool goes is limited, and cannot be told: where it begins is not known, such as after an axis \
                 move. Begin a list of its own here, or leave out the limit `max_distance`",
            ),
            (Checked::Arc, _) => f.write_str(
                "the way of the curve cannot be told, because where it begins is not known: begin it with a linear move",
            ),
            (Checked::Frame, _) => f.write_str(
                "the pose is told for another tool, work frame or workbench than the limits: the two do not compare",
            ),
            (Checked::FrameUnknown, _) => f.write_str(
                "a tool or a workbench was told over this connection since the guard was made, and whether the limits are told for it is \
                 not known: make a guard for the tool and workbench in use (with_guard of a handle without a guard)",
            ),
            (Checked::Action(number), _) => write!(f, "action {number} is not allowed"),
        }
    }
}

impl Violation {
    /// Writes the message for limits that are themselves wrong, such as a minimum above the maximum.
    fn wrong_limits(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (lowest, highest) = self.limit;
        match self.what {
            Checked::Axis(axis, slides) => {
                let unit = if slides { "mm" } else { "deg" };
                write!(f, "the limits of {axis} are {lowest} to {highest} {unit}")?;
            }
            Checked::Place(axis) => {
                write!(f, "the workspace of {} is {lowest} to {highest} mm", axis.world_name())?;
            }
            Checked::Unit(axis, _) => {
                write!(f, "the limits of {axis} are {lowest} and {highest}, one in mm and one in degrees")?;
            }
            Checked::Speed
            | Checked::PathSpeed
            | Checked::AxisStep(..)
            | Checked::Distance
            | Checked::Arc
            | Checked::Frame
            | Checked::FrameUnknown
            | Checked::Action(_) => write!(f, "the limits are {lowest} to {highest}")?,
        }
        f.write_str(": the lowest has to come first, and nothing is within them as they are")
    }
}

impl std::error::Error for Violation {}

struct Value(Option<f64>);

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            // A calculated step has more digits than the user entered.
            Some(value) => ((value * 1e6).round() / 1e6).fmt(f),
            None => f.write_str("?"),
        }
    }
}
