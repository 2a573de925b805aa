//! The numbers of each arm: lengths, limits, speeds, and where each number comes from.
//!
//! A model is a TOML file (`docs/MODELS.md`). The files in `models/` are compiled in; a user's own file is
//! read by the same [`RobotModel::from_toml`].

mod file;
mod source;

use std::sync::{Arc, LazyLock};

use r6_program::Mistakes;
use rs_opw_kinematics::kinematics_impl::OPWKinematics;
use rs_opw_kinematics::parameters::opw_kinematics::Parameters;

pub use self::source::{Certainty, Source};
use super::axes::{ARM_AXES, AXES, Axes, AxisNumber, FARTHEST, MoveMask};
use super::error::LimitSide;

/// A range of an axis, both ends included, in degrees or mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The smallest position.
    pub min: f64,
    /// The largest position.
    pub max: f64,
}

impl Limits {
    /// Whether the position lies inside or on an end.
    #[must_use]
    pub fn contains(self, position: f64) -> bool {
        (self.min..=self.max).contains(&position)
    }

    /// The end that the position lies beyond; `None` if it is inside. NaN lies beyond the plus end.
    #[must_use]
    pub fn beyond(self, position: f64) -> Option<LimitSide> {
        if self.contains(position) {
            None
        } else if position < self.min {
            Some(LimitSide::Minus)
        } else {
            Some(LimitSide::Plus)
        }
    }
}

/// The motion of an axis, which sets the unit of its position, limits and speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisMotion {
    /// It turns: degrees.
    Turns,
    /// It slides: millimetres.
    Slides,
}

/// One axis of an arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisModel {
    /// Whether it turns or slides.
    pub motion: AxisMotion,
    /// The range of moves.
    pub soft: Limits,
    /// The range of the vendor's data sheet.
    pub vendor: Limits,
    /// Full speed in degrees or mm per second.
    pub max_speed: f64,
    /// Motor turns per turn of the axis, or per millimetre.
    pub gear_ratio: f64,
    /// The continuous torque of its drive, at the axis: Nm, or N on a linear axis; `None` if unknown.
    pub rated_torque: Option<f64>,
    /// 1 or −1: the direction of the axis, see [`Geometry`].
    pub sign: i8,
    /// The position of the geometry when the axis reads 0, in degrees or mm: geometry = sign · axis + offset.
    pub offset: f64,
}

impl AxisModel {
    /// A placeholder for an axis that the arm lacks: it never moves, and nothing is outside its limits.
    const ABSENT: Self = Self {
        motion: AxisMotion::Turns,
        soft: Limits { min: -FARTHEST, max: FARTHEST },
        vendor: Limits { min: -FARTHEST, max: FARTHEST },
        max_speed: 1.0,
        gear_ratio: 0.0,
        rated_torque: None,
        sign: 1,
        offset: 0.0,
    };

    /// The position of the geometry for a position of the axis.
    pub(crate) fn geometric(&self, position: f64) -> f64 {
        f64::from(self.sign) * position + self.offset
    }

    /// The position of the axis for a position of the geometry.
    pub(crate) fn position(&self, geometric: f64) -> f64 {
        f64::from(self.sign) * (geometric - self.offset)
    }
}

/// The lengths of an arm with parallel base and spherical wrist, in millimetres.
///
/// They apply with every axis at 0 of the geometry: upper arm upright, forearm level along +X. Positive
/// turns, before the sign of an axis: J1 to the left (about +Z), J2, J3 and J5 downwards (about +Y), J4 and
/// J6 about the forearm (+X).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SixAxisGeometry {
    /// Floor to shoulder, upwards.
    pub d1: f64,
    /// J1 to shoulder, forwards.
    pub a1: f64,
    /// J1's plane to the forearm's axis, to the left.
    pub b: f64,
    /// Shoulder to elbow, upwards.
    pub a2: f64,
    /// Elbow to forearm, upwards.
    pub a3: f64,
    /// Elbow to wrist centre, forwards.
    pub d4: f64,
    /// Wrist centre to flange, forwards.
    pub d6: f64,
    /// Flange to the point that the controller calls tool 0, along the flange axis.
    pub tool_offset: f64,
}

/// The lengths of a SCARA, in millimetres: J1 and J2 turn about +Z, J3 slides upwards, J4 turns about +Z.
///
/// With every axis at 0 the arm is stretched along +X.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaraGeometry {
    /// Floor to tool 0 at J3 = 0, upwards.
    pub height: f64,
    /// J1 to J2.
    pub upper_arm: f64,
    /// J2 to J4.
    pub forearm: f64,
}

/// The masses of the arm, each in one point, in kg ([`drive`](crate::drive)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Masses {
    /// In the middle of the upper arm; on a Cartesian machine, the load of X alone.
    pub upper_arm: f64,
    /// In the middle of the forearm; on a Cartesian machine, the load of Y too.
    pub forearm: f64,
    /// At tool 0: wrist, gripper and workpiece; on a Cartesian machine, the load of Z too.
    pub tool: f64,
}

/// How the axes carry the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Geometry {
    /// Six turning axes.
    SixAxis(SixAxisGeometry),
    /// Two links, a slide and a turn: four axes.
    Scara(ScaraGeometry),
    /// X, Y and Z slide; a fourth axis, if present, turns the tool about +Z.
    Cartesian,
}

/// Everything about one model of arm. Cheap to clone.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotModel {
    /// The vendor's name.
    pub name: Arc<str>,
    /// J1 to J6; axes from [`RobotModel::axis_count`] on do not exist and never move.
    pub axes: [AxisModel; ARM_AXES],
    axis_count: usize,
    /// Its lengths.
    pub geometry: Geometry,
    /// Its masses; `None` if unknown.
    pub masses: Option<Masses>,
    /// Full speed of a linear or curve move, mm/s.
    pub max_line_speed: f64,
    /// Full turning speed of the tool in such a move, degrees per second.
    pub max_angular_speed: f64,
    /// The time from rest to full speed, and back, in seconds.
    pub acceleration_time: f64,
    /// Where the numbers come from; empty if the file does not say.
    pub sources: Arc<[Source]>,
}

/// The files of the models that come with the product; the first is the default.
const FILES: [&str; 7] = [
    include_str!("../models/BRTIRUS0707A.toml"),
    include_str!("../models/BRTIRUS0805A.toml"),
    include_str!("../models/BRTIRUS1510A.toml"),
    include_str!("../models/BRTIRUS1820A.toml"),
    include_str!("../models/BRTIRUS2030A.toml"),
    include_str!("../models/GENERIC-SCARA.toml"),
    include_str!("../models/GENERIC-CARTESIAN.toml"),
];

/// All models that come with the product. A test makes sure that no file is dropped.
static MODELS: LazyLock<Vec<RobotModel>> =
    LazyLock::new(|| FILES.iter().filter_map(|text| RobotModel::from_toml(text).ok()).collect());

impl Default for RobotModel {
    /// The BRTIRUS0707A.
    fn default() -> Self {
        let [default, ..] = FILES;
        #[expect(clippy::expect_used, reason = "the text is compiled in, and a test reads it")]
        Self::from_toml(default).expect("the default model's file is a model")
    }
}

impl RobotModel {
    /// The model with this name, in upper or lower case; `None` if no model has it.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        MODELS.iter().find(|model| model.name.eq_ignore_ascii_case(name))
    }

    /// The names of all models.
    pub fn names() -> impl Iterator<Item = &'static str> {
        MODELS.iter().map(|model| &*model.name)
    }

    /// Reads a model from a TOML file in the format of `docs/MODELS.md`.
    ///
    /// # Errors
    /// [`Mistakes`]: all places where the text is wrong, and the correct form of each field.
    pub fn from_toml(text: &str) -> Result<Self, Mistakes> {
        file::parse(text)
    }

    /// How many axes have a drive: 3 to 6 (`axisNum`, manual 4.1.1).
    #[must_use]
    pub const fn axis_count(&self) -> usize {
        self.axis_count
    }

    /// The axes that have a drive.
    pub fn drives(&self) -> impl Iterator<Item = &AxisModel> {
        self.axes.iter().take(self.axis_count)
    }

    /// The mask without the axes that the arm lacks.
    #[must_use]
    pub fn own_axes(&self, mask: MoveMask) -> MoveMask {
        let own = (0..self.axis_count).fold(0_u8, |bits, n| bits | (1 << n));
        MoveMask(mask.0 & own)
    }

    /// The soft limits, J1 to J6. Those of a missing axis are never exceeded.
    #[must_use]
    pub fn soft_limits(&self) -> [Limits; ARM_AXES] {
        self.axes.map(|axis| axis.soft)
    }

    /// The first axis outside its soft limits, and the end it lies beyond.
    #[must_use]
    pub fn outside_limits(&self, axes: &Axes) -> Option<(AxisNumber, LimitSide)> {
        first_outside(&self.soft_limits(), axes.arm())
    }

    /// Motor speeds in revolutions per minute (`curSpeed-n`, manual 4.1.1) for axis speeds in degrees or mm
    /// per second; 0 for missing axes.
    #[must_use]
    pub fn motor_rpm(&self, axis_speeds: &[f64; AXES]) -> [f64; AXES] {
        /// Degrees per second in one revolution per minute.
        const DEGREES_PER_SECOND_IN_RPM: f64 = 6.0;
        /// Seconds per minute.
        const SECONDS: f64 = 60.0;
        let mut rpm = [0.0; AXES];
        for ((slot, speed), axis) in rpm.iter_mut().zip(axis_speeds).zip(self.drives()) {
            *slot = match axis.motion {
                AxisMotion::Turns => speed * axis.gear_ratio / DEGREES_PER_SECOND_IN_RPM,
                AxisMotion::Slides => speed * axis.gear_ratio * SECONDS,
            };
        }
        rpm
    }

    /// The solver for a six-axis arm with these axes.
    ///
    /// The solver's zero is an arm stretched upright. It turns J2, J3 and J5 about +Y, and J4 and J6 about
    /// the forearm. The zero of the geometry has a level forearm, so J3 needs a quarter turn.
    pub(super) fn solver(&self, g: &SixAxisGeometry) -> OPWKinematics {
        let mut offsets = self.axes.map(|axis| -axis.offset.to_radians());
        let [_, _, j3, _, _, _] = &mut offsets;
        *j3 -= std::f64::consts::FRAC_PI_2;
        OPWKinematics::new(Parameters {
            a1: g.a1,
            a2: -g.a3,
            b: g.b,
            c1: g.d1,
            c2: g.a2,
            c3: g.d4,
            c4: g.d6 + g.tool_offset,
            offsets,
            sign_corrections: self.axes.map(|axis| axis.sign),
            dof: 6,
        })
    }
}

/// The first of six positions outside its limits, and the end it lies beyond.
pub(super) fn first_outside(
    limits: &[Limits; ARM_AXES],
    arm: [f64; ARM_AXES],
) -> Option<(AxisNumber, LimitSide)> {
    AxisNumber::ARM
        .into_iter()
        .zip(limits)
        .zip(arm)
        .find_map(|((axis, limits), position)| limits.beyond(position).map(|side| (axis, side)))
}

#[cfg(test)]
mod tests;
