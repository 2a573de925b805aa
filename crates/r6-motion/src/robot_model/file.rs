//! The fields of a model file.

use std::sync::Arc;

use super::reader::{self, ModelError, Table, Value, suggestion};
use super::source::matches;
use super::{
    AxisModel, AxisMotion, Certainty, Geometry, Limits, Masses, RobotModel, ScaraGeometry, SixAxisGeometry,
    Source,
};
use crate::axes::ARM_AXES;

/// No length is greater, mm: a hundred metres.
const LONGEST_MM: f64 = 1e5;

/// No axis goes farther, degrees or mm.
const FARTHEST_LIMIT: f64 = 1e5;

/// No speed, gear ratio or lead is greater.
const MOST: f64 = 1e6;

/// No part is heavier, kg.
const HEAVIEST: f64 = 1e5;

/// None is smaller: at a thousandth of a millimetre or degree per second no move ends on the day it began.
const LEAST: f64 = 1e-3;

/// The acceleration times a controller can be set to, seconds (as [`Ramps`](crate::Ramps) has them).
const ACCELERATION_TIMES: std::ops::RangeInclusive<f64> = 0.001..=60.0;

/// No link is shorter, mm: the solvers divide by them.
const SHORTEST_LINK: f64 = 1e-3;

/// What a length may be.
#[derive(Clone, Copy)]
enum Length {
    /// Between two joints that bend the arm: above 0.
    Link,
    /// Either way, and 0.
    Any,
    /// The same, and 0 where it is left out.
    OrZero,
}

/// What an axis of each kind of machine does, and how many it has to have.
#[derive(Clone, Copy)]
struct Kind {
    build: fn(&mut File<'_>) -> Result<Geometry, ModelError>,
    motions: &'static [AxisMotion],
    fewest: usize,
    axes_wanted: &'static str,
}

/// A file half read.
struct File<'t> {
    root: Table<'t>,
    /// The names of the numbers in it.
    numbers: Vec<String>,
}

const SIX_AXIS: Kind = Kind {
    build: six_axis,
    motions: &[AxisMotion::Turns; ARM_AXES],
    fewest: ARM_AXES,
    axes_wanted: "six [[axis]] tables, J1 to J6",
};

const SCARA: Kind = Kind {
    build: scara,
    motions: &[AxisMotion::Turns, AxisMotion::Turns, AxisMotion::Slides, AxisMotion::Turns],
    fewest: 4,
    axes_wanted: "four [[axis]] tables, J1 to J4",
};

const CARTESIAN: Kind = Kind {
    build: cartesian,
    motions: &[AxisMotion::Slides, AxisMotion::Slides, AxisMotion::Slides, AxisMotion::Turns],
    fewest: 3,
    axes_wanted: "three or four [[axis]] tables: X, Y, Z and perhaps a turn about Z",
};

pub(super) fn parse(text: &str) -> Result<RobotModel, ModelError> {
    reader::parse(text, |root| File { root, numbers: Vec::new() }.read())
}

impl File<'_> {
    fn read(mut self) -> Result<RobotModel, ModelError> {
        self.root.only(&[
            "name",
            "kind",
            "max_line_speed",
            "max_angular_speed",
            "acceleration_time",
            "geometry",
            "masses",
            "axis",
            "source",
        ])?;
        let name = "a name in quotes";
        let name = self.root.required("name", name)?.text(name)?;
        let words = [("six-axis", SIX_AXIS), ("scara", SCARA), ("cartesian", CARTESIAN)];
        let kind = self.root.required("kind", "one of six-axis, scara, cartesian")?.word(&words)?;
        let max_line_speed = self.own("max_line_speed", "mm/s 0.001 or more", above_zero)?;
        let max_angular_speed =
            self.own("max_angular_speed", "degrees per second 0.001 or more", above_zero)?;
        let wanted = "seconds from 0.001 to 60";
        let acceleration_time = self.own("acceleration_time", wanted, |n| ACCELERATION_TIMES.contains(&n))?;
        let geometry = (kind.build)(&mut self)?;
        let masses = self.masses()?;
        let (axes, axis_count) = self.axes(&kind)?;
        let sources = self.sources()?;
        Ok(RobotModel {
            name: name.into(),
            axes,
            axis_count,
            geometry,
            masses,
            max_line_speed,
            max_angular_speed,
            acceleration_time,
            sources,
        })
    }

    /// A number of the file itself.
    fn own(&mut self, field: &str, wanted: &str, fits: fn(f64) -> bool) -> Result<f64, ModelError> {
        let value = self.root.required(field, wanted)?;
        self.numbers.push(value.name().to_owned());
        value.number(wanted, fits)
    }

    /// The lengths of `[geometry]`, in the order of `fields`.
    fn lengths<const N: usize>(&mut self, fields: [(&str, Length); N]) -> Result<[f64; N], ModelError> {
        let wanted = "a [geometry] table with the lengths";
        let table = self.root.required("geometry", wanted)?.table(wanted)?;
        table.only(&fields.map(|(field, _)| field))?;
        let mut lengths = [0.0; N];
        for (slot, (field, length)) in lengths.iter_mut().zip(fields) {
            let (wanted, least) = match length {
                Length::Link => ("a length of 0.001 mm or more", SHORTEST_LINK),
                Length::Any | Length::OrZero => ("a length, mm", -LONGEST_MM),
            };
            let value = match length {
                Length::Link | Length::Any => Some(table.required(field, wanted)?),
                Length::OrZero => table.optional(field),
            };
            let Some(value) = value else { continue };
            self.numbers.push(value.name().to_owned());
            *slot = value.number(wanted, |n| (least..=LONGEST_MM).contains(&n))?;
        }
        Ok(lengths)
    }

    /// The masses of `[masses]`, if there are any.
    fn masses(&mut self) -> Result<Option<Masses>, ModelError> {
        let Some(value) = self.root.optional("masses") else { return Ok(None) };
        let wanted = "a [masses] table with upper_arm, forearm and tool";
        let table = value.table(wanted)?;
        let fields = ["upper_arm", "forearm", "tool"];
        table.only(&fields)?;
        let mut masses = [0.0; 3];
        for (slot, field) in masses.iter_mut().zip(fields) {
            let wanted = "a mass, kg";
            let value = table.required(field, wanted)?;
            self.numbers.push(value.name().to_owned());
            *slot = value.number(wanted, |n| (0.0..=HEAVIEST).contains(&n))?;
        }
        let [upper_arm, forearm, tool] = masses;
        Ok(Some(Masses { upper_arm, forearm, tool }))
    }

    fn axes(&mut self, kind: &Kind) -> Result<([AxisModel; ARM_AXES], usize), ModelError> {
        let list = self.root.required("axis", kind.axes_wanted)?;
        let tables = list.list(kind.axes_wanted)?;
        let count = tables.len();
        if !(kind.fewest..=kind.motions.len()).contains(&count) {
            let mut error = list.refuse(kind.axes_wanted);
            error.wanted = format!("wanted {}, found {count}", kind.axes_wanted);
            return Err(error);
        }
        let mut axes = [AxisModel::ABSENT; ARM_AXES];
        for (n, ((slot, value), motion)) in axes.iter_mut().zip(tables).zip(kind.motions).enumerate() {
            *slot = self.axis(&value.called(format!("J{}", n + 1)), *motion)?;
        }
        Ok((axes, count))
    }

    fn axis(&mut self, value: &Value<'_>, motion: AxisMotion) -> Result<AxisModel, ModelError> {
        let torque_wanted = match motion {
            AxisMotion::Turns => "Nm at the axis, 0.001 or more",
            AxisMotion::Slides => "N, 0.001 or more",
        };
        let (gear, gear_wanted, speed_wanted) = match motion {
            AxisMotion::Turns => (
                "gear_ratio",
                "motor turns per turn of the axis, 0.001 or more",
                "degrees per second 0.001 or more",
            ),
            AxisMotion::Slides => ("lead", "mm per motor turn, 0.001 or more", "mm/s 0.001 or more"),
        };
        let table = value.table("an [[axis]] table")?;
        table.only(&["soft", "vendor", "max_speed", gear, "rated_torque", "sign", "offset"])?;
        let limits_wanted = match motion {
            AxisMotion::Turns => "[min, max] in degrees, with 0 inside",
            AxisMotion::Slides => "[min, max] in mm, with 0 inside",
        };
        let soft = limits(&table.required("soft", limits_wanted)?, limits_wanted)?;
        let vendor = match table.optional("vendor") {
            Some(value) => {
                let vendor = limits(&value, limits_wanted)?;
                if vendor.min > soft.min || vendor.max < soft.max {
                    return Err(value.refuse("limits that hold the soft ones"));
                }
                vendor
            }
            None => soft,
        };
        let max_speed = table.required("max_speed", speed_wanted)?.number(speed_wanted, above_zero)?;
        let gear_figure = table.required(gear, gear_wanted)?.number(gear_wanted, above_zero)?;
        let rated_torque = match table.optional("rated_torque") {
            Some(value) => Some(value.number(torque_wanted, above_zero)?),
            None => None,
        };
        let sign = match table.optional("sign") {
            Some(value) => value.number("1 or -1", |n| n.abs() == 1.0)?,
            None => 1.0,
        };
        let offset = match table.optional("offset") {
            Some(value) => value.number("degrees or mm", |n| n.abs() <= FARTHEST_LIMIT)?,
            None => 0.0,
        };
        for field in ["soft", "vendor", "max_speed", gear, "rated_torque", "sign", "offset"] {
            self.numbers.extend(table.optional(field).map(|value| value.name().to_owned()));
        }
        Ok(AxisModel {
            motion,
            soft,
            vendor,
            max_speed,
            gear_ratio: match motion {
                AxisMotion::Turns => gear_figure,
                AxisMotion::Slides => gear_figure.recip(),
            },
            rated_torque,
            sign: if sign < 0.0 { -1 } else { 1 },
            offset,
        })
    }

    fn sources(&self) -> Result<Arc<[Source]>, ModelError> {
        let Some(value) = self.root.optional("source") else { return Ok(Arc::default()) };
        let wanted = "[[source]] tables";
        value.list(wanted)?.iter().map(|value| self.source(&value.table(wanted)?)).collect()
    }

    fn source(&self, table: &Table<'_>) -> Result<Source, ModelError> {
        table.only(&["of", "certainty", "text"])?;
        let wanted = "a list of numbers' names, such as [\"geometry.d1\", \"J*.soft\"]";
        let mut of = Vec::new();
        for name in table.required("of", wanted)?.list(wanted)? {
            let text = name.text(wanted)?;
            if !self.numbers.iter().any(|number| matches(text, number)) {
                let known: Vec<_> = self.numbers.iter().map(String::as_str).collect();
                return Err(
                    name.refuse(&format!("the name of a number of this file ({})", suggestion(text, &known)))
                );
            }
            of.push(text.to_owned());
        }
        let words = Certainty::ALL.map(|certainty| (certainty.word(), certainty));
        let certainty = table.required("certainty", "how certain it is")?.word(&words)?;
        let wanted = "who says so";
        let text = table.required("text", wanted)?.text(wanted)?.to_owned();
        Ok(Source { of, certainty, text })
    }
}

fn six_axis(file: &mut File<'_>) -> Result<Geometry, ModelError> {
    let [d1, a1, a2, a3, d4, d6, tool_offset, b] = file.lengths([
        ("d1", Length::Any),
        ("a1", Length::Any),
        ("a2", Length::Link),
        ("a3", Length::Any),
        ("d4", Length::Link),
        ("d6", Length::Any),
        ("tool_offset", Length::OrZero),
        ("b", Length::OrZero),
    ])?;
    Ok(Geometry::SixAxis(SixAxisGeometry { d1, a1, b, a2, a3, d4, d6, tool_offset }))
}

fn scara(file: &mut File<'_>) -> Result<Geometry, ModelError> {
    let fields = [("height", Length::Any), ("upper_arm", Length::Link), ("forearm", Length::Link)];
    let [height, upper_arm, forearm] = file.lengths(fields)?;
    Ok(Geometry::Scara(ScaraGeometry { height, upper_arm, forearm }))
}

fn cartesian(file: &mut File<'_>) -> Result<Geometry, ModelError> {
    match file.root.optional("geometry") {
        None => Ok(Geometry::Cartesian),
        Some(value) => Err(value.refuse("no [geometry]: a Cartesian machine has no lengths")),
    }
}

fn limits(value: &Value<'_>, wanted: &str) -> Result<Limits, ModelError> {
    let list = value.list(wanted)?;
    let [min, max] = list.as_slice() else { return Err(value.refuse(wanted)) };
    let far = |n: f64| n.abs() <= FARTHEST_LIMIT;
    let limits = Limits { min: min.number(wanted, far)?, max: max.number(wanted, far)? };
    // The arm stands at 0 when it is switched on.
    if limits.min < limits.max && limits.contains(0.0) { Ok(limits) } else { Err(value.refuse(wanted)) }
}

fn above_zero(n: f64) -> bool {
    (LEAST..=MOST).contains(&n)
}
