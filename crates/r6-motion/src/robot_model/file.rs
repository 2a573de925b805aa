//! Reads the fields of a model file.

use std::sync::Arc;

use r6_program::form::{self, Fields, Found, Node, Table, Wrong};
use r6_program::{Mistake, Mistakes};

use super::source::matches;
use super::{
    AxisModel, AxisMotion, Certainty, Geometry, Limits, Masses, RobotModel, ScaraGeometry, SixAxisGeometry,
    Source,
};
use crate::axes::ARM_AXES;

/// The longest model file, in bytes: the longest of the product's own has 4 000.
const LONGEST: usize = 65_536;

/// The greatest length, in mm: a hundred metres.
const LONGEST_MM: f64 = 1e5;

/// The farthest limit of an axis, in degrees or mm.
const FARTHEST_LIMIT: f64 = 1e5;

/// The greatest speed, gear ratio or lead.
const MOST: f64 = 1e6;

/// The heaviest part, in kg.
const HEAVIEST: f64 = 1e5;

/// The smallest of these: at a thousandth of a millimetre or degree per second no move ends on the day it
/// began.
const LEAST: f64 = 1e-3;

/// The acceleration times that a controller can be set to, in seconds (the same as in
/// [`Ramps`](crate::Ramps)).
const ACCELERATION_TIMES: std::ops::RangeInclusive<f64> = 0.001..=60.0;

/// The shortest link, in mm: the solvers divide by these.
const SHORTEST_LINK: f64 = 1e-3;

/// The allowed values of a length.
#[derive(Clone, Copy)]
enum Length {
    /// A link between two joints that bend the arm: above 0.
    Link,
    /// Any sign, and 0.
    Any,
    /// The same, and 0 if it is missing.
    OrZero,
}

/// The motions of the axes of each kind of machine, and how many axes it has to have.
#[derive(Clone, Copy)]
struct Kind {
    build: fn(&mut File<'_, '_>) -> Result<Geometry, Wrong>,
    motions: &'static [AxisMotion],
    fewest: usize,
    axes_wanted: &'static str,
}

/// A file while it is read.
struct File<'f, 't> {
    root: &'f Fields<'f>,
    found: &'f mut Found<'t>,
    /// The names of the numbers read so far.
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

const KINDS: [(&str, Kind); 3] = [("six-axis", SIX_AXIS), ("scara", SCARA), ("cartesian", CARTESIAN)];

const KEYS: [&str; 9] = [
    "name",
    "kind",
    "max_line_speed",
    "max_angular_speed",
    "acceleration_time",
    "geometry",
    "masses",
    "axis",
    "source",
];

pub(super) fn parse(text: &str) -> Result<RobotModel, Mistakes> {
    if text.len() > LONGEST {
        let what = format!("the file is longer than {LONGEST} bytes");
        return Err(Mistake::of_the_file(what, None).into());
    }
    let (document, mut found) = form::parse(text);
    let root = Fields::of(&document, &KEYS, "");
    let model = File { root: &root, found: &mut found, numbers: Vec::new() }.read();
    let model = root.finish(model, &mut found);
    found.finish(model)
}

impl File<'_, '_> {
    fn read(mut self) -> Result<RobotModel, Wrong> {
        let name = self.root.due("name", "a name in quotes", text);
        let max_line_speed = self.own("max_line_speed", "mm/s 0.001 or more", above_zero);
        let max_angular_speed = self.own("max_angular_speed", "degrees per second 0.001 or more", above_zero);
        let wanted = "seconds from 0.001 to 60";
        let acceleration_time = self.own("acceleration_time", wanted, |n| ACCELERATION_TIMES.contains(&n));
        let kind = self.root.due_word("kind", &KINDS)?;
        let geometry = (kind.build)(&mut self);
        let masses = self.masses();
        let axes = self.axes(&kind);
        // A source of a number that is wrong or misspelt must not cause another error.
        let all_known = geometry.is_ok() && masses.is_ok() && axes.is_ok();
        let sources = self.sources(all_known);
        let (axes, axis_count) = axes?;
        Ok(RobotModel {
            name: name?.into(),
            axes,
            axis_count,
            geometry: geometry?,
            masses: masses?,
            max_line_speed: max_line_speed?,
            max_angular_speed: max_angular_speed?,
            acceleration_time: acceleration_time?,
            sources: sources?,
        })
    }

    /// A number at the top level of the file.
    fn own(&mut self, field: &'static str, wanted: &str, fits: fn(f64) -> bool) -> Result<f64, Wrong> {
        self.numbers.push(field.to_owned());
        number(self.root, field, wanted, fits)
    }

    /// Reads the fields of an inner table, with a label for its mistakes.
    fn inner<T>(
        &mut self,
        table: &Table,
        label: &str,
        read: impl FnOnce(&mut Self, &Fields<'_>) -> Result<T, Wrong>,
    ) -> Result<T, Wrong> {
        let fields = Fields::of(table, &[], format!("{label}: "));
        let inner = read(self, &fields);
        // The mistake is already noted.
        fields.finish(inner, self.found).ok_or_else(|| Wrong::from(""))
    }

    /// The lengths of `[geometry]`, in the order of `fields`.
    fn lengths<const N: usize>(&mut self, lengths: [(&'static str, Length); N]) -> Result<[f64; N], Wrong> {
        let table = self.root.due("geometry", "a [geometry] table with the lengths", Node::table)?;
        self.inner(table, "[geometry]", |file, fields| {
            let read = lengths.map(|(field, length)| {
                let (wanted, least) = match length {
                    Length::Link => ("a length of 0.001 mm or more", SHORTEST_LINK),
                    Length::Any | Length::OrZero => ("a length, mm", -LONGEST_MM),
                };
                if matches!(length, Length::OrZero) && !fields.has(field) {
                    fields.value(field);
                    return Ok(0.0);
                }
                file.numbers.push(format!("geometry.{field}"));
                number(fields, field, wanted, |n| (least..=LONGEST_MM).contains(&n))
            });
            all(read)
        })
    }

    /// The masses of `[masses]`, if present.
    fn masses(&mut self) -> Result<Option<Masses>, Wrong> {
        let wanted = "a [masses] table with upper_arm, forearm and tool";
        let Some(table) = self.root.optional("masses", wanted, Node::table) else { return Ok(None) };
        self.inner(table, "[masses]", |file, fields| {
            let [upper_arm, forearm, tool] = all(["upper_arm", "forearm", "tool"].map(|field| {
                file.numbers.push(format!("masses.{field}"));
                number(fields, field, "a mass, kg", |n| (0.0..=HEAVIEST).contains(&n))
            }))?;
            Ok(Some(Masses { upper_arm, forearm, tool }))
        })
    }

    fn axes(&mut self, kind: &Kind) -> Result<([AxisModel; ARM_AXES], usize), Wrong> {
        let tables = self.root.tables("axis");
        if !self.root.has("axis") {
            return self.root.due("axis", kind.axes_wanted, |_| None);
        }
        if !(kind.fewest..=kind.motions.len()).contains(&tables.len()) {
            let what = format!("there have to be {}, not {}", kind.axes_wanted, tables.len());
            return Err(self.root.wrong("axis", what));
        }
        let mut axes = [AxisModel::ABSENT; ARM_AXES];
        let mut good = true;
        for (n, ((slot, table), motion)) in axes.iter_mut().zip(&tables).zip(kind.motions).enumerate() {
            let name = format!("J{}", n + 1);
            let axis = self.inner(table, &name, |file, fields| file.axis(fields, &name, *motion));
            good &= axis.map(|axis| *slot = axis).is_ok();
        }
        if good { Ok((axes, tables.len())) } else { Err(Wrong::from("")) }
    }

    fn axis(&mut self, fields: &Fields<'_>, name: &str, motion: AxisMotion) -> Result<AxisModel, Wrong> {
        let (gear, gear_wanted) = match motion {
            AxisMotion::Turns => ("gear_ratio", "motor turns per turn of the axis, 0.001 or more"),
            AxisMotion::Slides => ("lead", "mm per motor turn, 0.001 or more"),
        };
        let (limits_wanted, speed_wanted, torque_wanted) = match motion {
            AxisMotion::Turns => (
                "[min, max] in degrees, with 0 inside",
                "degrees per second 0.001 or more",
                "Nm at the axis, 0.001 or more",
            ),
            AxisMotion::Slides => {
                ("[min, max] in mm, with 0 inside", "mm/s 0.001 or more", "N, 0.001 or more")
            }
        };
        let soft = fields.due("soft", limits_wanted, limits);
        let vendor = fields.optional("vendor", limits_wanted, limits);
        let max_speed = number(fields, "max_speed", speed_wanted, above_zero);
        let gear_figure = number(fields, gear, gear_wanted, above_zero);
        let rated_torque = fields.optional("rated_torque", torque_wanted, |value| {
            value.number().filter(|torque| above_zero(*torque))
        });
        let sign = fields.optional("sign", "1 or -1", |value| value.number().filter(|n| n.abs() == 1.0));
        let offset = fields.optional("offset", "degrees or mm", |value| {
            value.number().filter(|n| n.abs() <= FARTHEST_LIMIT)
        });
        let given = ["soft", "vendor", "max_speed", gear, "rated_torque", "sign", "offset"];
        self.numbers
            .extend(given.iter().filter(|field| fields.has(field)).map(|field| format!("{name}.{field}")));
        let soft = soft?;
        let vendor = vendor.unwrap_or(soft);
        if vendor.min > soft.min || vendor.max < soft.max {
            return Err(fields.wrong("vendor", "`vendor` has to hold the limits of `soft`"));
        }
        let gear_figure = gear_figure?;
        Ok(AxisModel {
            motion,
            soft,
            vendor,
            max_speed: max_speed?,
            gear_ratio: match motion {
                AxisMotion::Turns => gear_figure,
                AxisMotion::Slides => gear_figure.recip(),
            },
            rated_torque,
            sign: if sign.unwrap_or(1.0) < 0.0 { -1 } else { 1 },
            offset: offset.unwrap_or(0.0),
        })
    }

    fn sources(&mut self, all_known: bool) -> Result<Arc<[Source]>, Wrong> {
        let tables = self.root.tables("source");
        let source = |(n, table): (usize, &&Table)| {
            self.inner(table, &format!("[[source]] {}", n + 1), |file, fields| file.source(fields, all_known))
        };
        let read: Vec<_> = tables.iter().enumerate().map(source).collect();
        read.into_iter().collect()
    }

    /// Reads a source. `all_known` says whether the names of all numbers are known.
    fn source(&self, fields: &Fields<'_>, all_known: bool) -> Result<Source, Wrong> {
        let wanted = "a list of numbers' names, such as [\"geometry.d1\", \"J*.soft\"]";
        let of = fields.due("of", wanted, |value| {
            value.list()?.iter().map(|name| name.text().map(str::to_owned)).collect::<Option<Vec<_>>>()
        });
        for name in of.iter().flatten() {
            if all_known && !self.numbers.iter().any(|number| matches(name, number)) {
                let near = r6_program::nearest(name, self.numbers.iter().map(String::as_str));
                let near = near.map(|near| format!("; nearest: `{near}`")).unwrap_or_default();
                let name: String = name.chars().take(40).collect();
                fields.wrong("of", format!("`{name}` is the name of no number of this file{near}"));
            }
        }
        let words = Certainty::ALL.map(|certainty| (certainty.word(), certainty));
        let certainty = fields.due_word("certainty", &words);
        let text = fields.due("text", "who says so", text)?.to_owned();
        Ok(Source { of: of?, certainty: certainty?, text })
    }
}

fn six_axis(file: &mut File<'_, '_>) -> Result<Geometry, Wrong> {
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

fn scara(file: &mut File<'_, '_>) -> Result<Geometry, Wrong> {
    let fields = [("height", Length::Any), ("upper_arm", Length::Link), ("forearm", Length::Link)];
    let [height, upper_arm, forearm] = file.lengths(fields)?;
    Ok(Geometry::Scara(ScaraGeometry { height, upper_arm, forearm }))
}

fn cartesian(file: &mut File<'_, '_>) -> Result<Geometry, Wrong> {
    if file.root.value("geometry").is_some() {
        let what = "there has to be no [geometry]: a Cartesian machine has no lengths";
        return Err(file.root.wrong("geometry", what));
    }
    Ok(Geometry::Cartesian)
}

/// A number that is required, and has to fit.
fn number(
    fields: &Fields<'_>,
    field: &'static str,
    wanted: &str,
    fits: impl Fn(f64) -> bool,
) -> Result<f64, Wrong> {
    fields.due(field, wanted, |value| value.number().filter(|number| fits(*number)))
}

/// All numbers, if none is missing.
fn all<const N: usize>(read: [Result<f64, Wrong>; N]) -> Result<[f64; N], Wrong> {
    let mut numbers = [0.0; N];
    for (slot, number) in numbers.iter_mut().zip(read) {
        *slot = number?;
    }
    Ok(numbers)
}

/// A text that is not empty.
fn text(value: &Node) -> Option<&str> {
    value.text().filter(|text| !text.trim().is_empty())
}

fn limits(value: &Node) -> Option<Limits> {
    let [min, max] = value.list()? else { return None };
    let limits = Limits { min: min.number()?, max: max.number()? };
    let near = limits.min >= -FARTHEST_LIMIT && limits.max <= FARTHEST_LIMIT;
    // The arm is at 0 when it is switched on.
    (near && limits.min < limits.max && limits.contains(0.0)).then_some(limits)
}

fn above_zero(n: f64) -> bool {
    (LEAST..=MOST).contains(&n)
}
