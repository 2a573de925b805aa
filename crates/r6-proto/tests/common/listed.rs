//! Reads an instruction or a point from serde_json's value, by the rules of the manual (5.2 and 6) and as
//! simply as possible. The decoder is compared with this reference.
//!
//! A member may be absent if the manual allows it. A member that is present but invalid makes the whole value
//! invalid.

use r6_proto::AxisIndex;
use r6_proto::axis::AxisMask;
use r6_proto::io_point::PairMask;
use r6_proto::message::instruction::{
    BlendLevel, BoardOutput, Coordinates, CurveMove, Manner, Move, Output, OutputBoard, OutputKind,
    PathSpeed, StopOnSignal, Wait, WaitCondition, WaitSource, Workbench,
};
use r6_proto::message::{Action, Point};
use serde_json::{Map, Value};

type Members = Map<String, Value>;

/// A longer text is not a number; see `r6_proto::value`.
const LONGEST_NUMBER: usize = 64;

/// Up to here a double represents every whole number exactly.
const EXACT: f64 = 9_007_199_254_740_992.0;

/// A finite number, quoted or not, as the standard library reads it.
pub fn number(value: &Value) -> Option<f64> {
    let number: f64 = match value {
        Value::Number(number) => number.as_f64()?,
        Value::String(text) if text.trim_ascii().len() <= LONGEST_NUMBER => text.trim_ascii().parse().ok()?,
        Value::String(_) | Value::Null | Value::Bool(_) | Value::Array(_) | Value::Object(_) => return None,
    };
    number.is_finite().then_some(number)
}

/// A whole number, quoted or not, with decimals of zero or without.
pub fn integer(value: &Value) -> Option<i64> {
    let exact = match value {
        Value::Number(number) => number.as_i64(),
        Value::String(text) => text.trim_ascii().parse().ok(),
        Value::Null | Value::Bool(_) | Value::Array(_) | Value::Object(_) => None,
    };
    let whole = || number(value).filter(|number| number.fract() == 0.0 && number.abs() <= EXACT);
    #[expect(clippy::cast_possible_truncation, reason = "whole and within 2^53")]
    exact.or_else(|| whole().map(|number| number as i64))
}

/// 1 or 0, quoted or not, or true or false.
pub fn flag(value: &Value) -> Option<bool> {
    match (value, integer(value)) {
        (Value::Bool(flag), _) => Some(*flag),
        (_, Some(1)) => Some(true),
        (_, Some(0)) => Some(false),
        (_, _) => None,
    }
}

/// Reads an optional member. The outer `None` means that the member is present but invalid.
fn may<T>(members: &Members, key: &str, read: impl FnOnce(&Value) -> Option<T>) -> Option<Option<T>> {
    match members.get(key) {
        None => Some(None),
        Some(value) => read(value).map(Some),
    }
}

/// Reads a required member.
fn must<T>(members: &Members, key: &str, read: impl FnOnce(&Value) -> Option<T>) -> Option<T> {
    read(members.get(key)?)
}

fn up_to(last: i64) -> impl Fn(&Value) -> Option<u8> {
    move |value| integer(value).filter(|number| (0..=last).contains(number))?.try_into().ok()
}

fn of_32_bits(value: &Value) -> Option<u32> {
    integer(value)?.try_into().ok()
}

/// At most one day.
fn seconds(value: &Value) -> Option<f64> {
    number(value).filter(|seconds| (0.0..=86_400.0).contains(seconds))
}

/// What an instruction does.
#[derive(Debug, PartialEq)]
pub enum Does {
    /// One of the manual's actions.
    Known(Action),
    /// Another action, with this number.
    Unknown(i64),
}

/// Returns `oneshot` and the action of an instruction; `None` if it is invalid.
pub fn instruction(value: &Value) -> Option<(bool, Does)> {
    let members = value.as_object()?;
    let number = must(members, "action", integer)?;
    let oneshot = may(members, "oneshot", flag)?.unwrap_or(false);
    let on = |key| must(members, key, flag);
    let kind = || must(members, "type", integer);
    let action = match number {
        4 => Action::AxisMove(Move { target: eight(members, "")?, manner: manner(members)? }),
        10 => Action::LinearMove(Move { target: eight(members, "")?, manner: manner(members)? }),
        17 => Action::CurveMove(CurveMove {
            middle: eight(members, "")?,
            end: eight(members, "_p")?,
            manner: manner(members)?,
        }),
        51 => {
            Action::PathSpeed(PathSpeed { in_use: on("isUse")?, speed: may(members, "speed", self::number)? })
        }
        52 => Action::StopOnSignal(StopOnSignal {
            in_use: on("isUse")?,
            input: must(members, "ioNumber", up_to(31))?,
            on: on("io_status")?,
        }),
        100 => Action::Wait(wait(members)?),
        200 => Action::Output(Output {
            kind: match kind()? {
                0 => OutputKind::Y,
                5 => OutputKind::M,
                7 => OutputKind::Euy,
                100 => OutputKind::TimedY,
                _ => return None,
            },
            point: must(members, "point", up_to(32))?,
            on: on("io_status")?,
            delay: may(members, "delay", seconds)?.unwrap_or(0.0),
        }),
        204 => {
            let bits = |key| Some(PairMask::from_bits(may(members, key, of_32_bits)?.unwrap_or(0)));
            let board = match kind()? {
                0 => OutputBoard::Y(0),
                1 => OutputBoard::Y(1),
                5 => OutputBoard::M(0),
                6 => OutputBoard::M(1),
                _ => return None,
            };
            Action::BoardOutput(BoardOutput { board, low: bits("point")?, high: bits("point2")? })
        }
        800 => Action::Workbench(Workbench { id: must(members, "cnt_id", of_32_bits)? }),
        _ => return Some((oneshot, Does::Unknown(number))),
    };
    Some((oneshot, Does::Known(action)))
}

fn wait(members: &Members) -> Option<Wait> {
    let kind = must(members, "type", integer)?;
    let point = may(members, "point", up_to(31))?;
    let condition = may(members, "io_status", |value| match integer(value)? {
        0 => Some(WaitCondition::Off),
        1 => Some(WaitCondition::On),
        2 => Some(WaitCondition::RisingEdge),
        3 => Some(WaitCondition::FallingEdge),
        _ => None,
    })?;
    let source = match kind {
        0..=4 => WaitSource::Input { board: kind.try_into().ok()?, point: point? },
        5..=7 => WaitSource::M { board: (kind - 5).try_into().ok()?, point: point? },
        8 => WaitSource::Eu { point: point? },
        100 => WaitSource::Time,
        _ => return None,
    };
    Some(Wait {
        source,
        // A wait for time has no state to wait for.
        condition: if kind == 100 { condition.unwrap_or(WaitCondition::Off) } else { condition? },
        limit: may(members, "limit", seconds)?.unwrap_or(0.0),
        unlimited: may(members, "isUnlimit", flag)?.unwrap_or(false),
    })
}

fn eight(members: &Members, tail: &str) -> Option<Coordinates> {
    let mut coordinates = Coordinates::default();
    for axis in AxisIndex::ALL {
        let given = may(members, &format!("m{}{tail}", axis.number()), number)?;
        if let Some(given) = given {
            coordinates.set(axis, given);
        }
        assert_eq!(coordinates.at(axis), given, "a coordinate is set, and is another");
    }
    Some(coordinates)
}

fn manner(members: &Members) -> Option<Manner> {
    let masked = Manner { mask: may(members, "ckStatus", mask)?, ..Manner::default() };
    Some(Manner {
        speed: may(members, "speed", number)?,
        delay: may(members, "delay", seconds)?,
        smooth: may(members, "smooth", |value| BlendLevel::new(up_to(9)(value)?))?,
        tool: may(members, "tool", of_32_bits)?,
        coord: may(members, "coord", of_32_bits)?,
        ..masked
    })
}

/// `"0x3F"`, `"0X3f"`, `"63"` or 63.
fn mask(value: &Value) -> Option<AxisMask> {
    let text = value.as_str().unwrap_or_default().trim_ascii();
    let bits = match text.strip_prefix("0x").or(text.strip_prefix("0X")) {
        None => up_to(255)(value)?,
        Some("") => return None,
        Some(digits) => digits.chars().try_fold(0_u8, |bits, digit| {
            let digit = u8::try_from(digit.to_digit(16)?).ok()?;
            bits.checked_mul(16)?.checked_add(digit)
        })?,
    };
    Some(AxisMask::from_bits(bits))
}

/// Reads the point. Its angle is the first of these spellings that is present. `None` if the point is
/// invalid.
pub fn point(value: &Value, spellings: [&str; 2]) -> Option<Point> {
    let members = value.as_object()?;
    let angle = spellings.into_iter().find(|key| members.contains_key(*key)).unwrap_or("Angel");
    Some(Point {
        model_id: may(members, "ModelID", integer)?.unwrap_or(0),
        x: must(members, "X", number)?,
        y: must(members, "Y", number)?,
        z: may(members, "Z", number)?,
        u: may(members, "U", number)?,
        v: may(members, "V", number)?,
        angle: may(members, angle, number)?,
        similarity: may(members, "Similarity", number)?,
        color: may(members, "Color", integer)?,
        relative: may(members, "Rel", flag)?.unwrap_or(false),
    })
}

/// The instructions that clients of 2020 send in `dsData`. `xpos` … `wpos` of a move stand for `m0` … `m5`
/// and take precedence over them.
pub fn from_2020(sets: &Value) -> Vec<Value> {
    let sets = sets.as_array().map_or(&[][..], Vec::as_slice);
    let mut steps: Vec<Value> =
        sets.iter().flat_map(|set| set["data"].as_array().expect("instructions").iter().cloned()).collect();
    for members in steps.iter_mut().filter_map(Value::as_object_mut) {
        if !matches!(must(members, "action", integer), Some(4 | 10 | 17)) {
            continue;
        }
        for (pos, m) in [("x", "m0"), ("y", "m1"), ("z", "m2"), ("u", "m3"), ("v", "m4"), ("w", "m5")] {
            if let Some(value) = members.get(&format!("{pos}pos")).cloned() {
                members.insert(m.to_owned(), value);
            }
        }
    }
    steps
}
