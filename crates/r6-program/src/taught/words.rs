//! Displays the steps of taught programs in English: `wait until X010 is on`.

use std::fmt;

use r6_proto::message::instruction::WaitCondition;
use r6_proto::message::{Action, action};

use super::{Change, Compare, Condition, Step};

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Instruction(Action::Wait(wait)) | Self::Wait { wait, .. } => match wait.source.point() {
                Some(point) => write!(f, "wait until {point} {}", state(wait.condition)),
                None => write!(f, "wait for {} s", wait.limit),
            },
            Self::Instruction(instruction) => {
                f.write_str(action::name(instruction.number()).unwrap_or("an action that is not known"))
            }
            Self::Set { point, on } => write!(f, "set {point} {}", if *on { "on" } else { "off" }),
            Self::MoveToRegisters { first, .. } => {
                write!(f, "move to the place in registers from {}", first.number())
            }
            Self::TakePoint { camera, model: None, .. } => write!(f, "take a point of camera {camera}"),
            Self::TakePoint { camera, model: Some(model), .. } => {
                write!(f, "take a point of camera {camera}, template {model}")
            }
            Self::MoveToPoint { .. } => f.write_str("move to the point that was taken"),
            Self::MoveToStack { stack, .. } => write!(f, "move to the place in stack {stack}"),
            Self::WaitForRegisters { first, count: 1, .. } => {
                write!(f, "wait until register {} is written", first.number())
            }
            Self::WaitForRegisters { first, count, .. } => {
                let last = first.number().saturating_add(count.saturating_sub(1));
                write!(f, "wait until one of the registers {} to {last} is written", first.number())
            }
            Self::Photo(photo) => write!(f, "photo of camera {}", photo.camera),
            Self::Alarm { number } => write!(f, "raise alarm {number}"),
            Self::Tool(number) => write!(f, "use tool {number}"),
            Self::Counter { id, change } => write!(f, "counter {id} {change}"),
            Self::Register { register, change } => write!(f, "register {} {change}", register.number()),
            Self::Remote => f.write_str("wait for remote commands"),
            Self::Label => f.write_str("label"),
            Self::Jump(to) => write!(f, "jump to step {}", to + 1),
            Self::If { condition, to } => write!(f, "jump to step {} if {condition}", to + 1),
            Self::Call(name) => write!(f, "call program `{name}`"),
            Self::Return => f.write_str("return"),
            Self::End => f.write_str("end of the cycle"),
        }
    }
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::To(value) => write!(f, "becomes {value}"),
            Self::By(step) => write!(f, "changes by {step}"),
        }
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Point(source, on) => {
                let on = if *on { "on" } else { "off" };
                match source.point() {
                    Some(point) => write!(f, "{point} is {on}"),
                    None => f.write_str("time has passed"),
                }
            }
            Self::Counter(id, compare) => write!(f, "counter {id} is {compare}"),
            Self::CounterReached(id) => write!(f, "counter {id} has reached its target"),
            Self::Register(register, compare) => write!(f, "register {} is {compare}", register.number()),
            Self::Points(camera, None) => write!(f, "camera {camera} has sent a point"),
            Self::Points(camera, Some(model)) => {
                write!(f, "camera {camera} has sent a point of template {model}")
            }
            Self::StackFull { stack, .. } => write!(f, "stack {stack} is full"),
        }
    }
}

impl fmt::Display for Compare {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AtLeast(than) => write!(f, "at least {than}"),
            Self::Below(than) => write!(f, "below {than}"),
            Self::Equals(than) => write!(f, "{than}"),
        }
    }
}

fn state(condition: WaitCondition) -> &'static str {
    match condition {
        WaitCondition::On => "is on",
        WaitCondition::Off => "is off",
        WaitCondition::RisingEdge => "goes on",
        WaitCondition::FallingEdge => "goes off",
    }
}
