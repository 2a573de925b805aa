//! The figures of each arm: lengths, limits, speeds.

use rs_opw_kinematics::kinematics_impl::OPWKinematics;
use rs_opw_kinematics::parameters::opw_kinematics::Parameters;

use super::axes::{ARM_AXES, AXES, Axes, AxisNumber};
use super::error::LimitSide;

/// A range an axis may stand in, both ends included, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The smallest angle.
    pub min: f64,
    /// The largest angle.
    pub max: f64,
}

impl Limits {
    /// Whether the angle lies inside or on an end.
    #[must_use]
    pub fn contains(self, degrees: f64) -> bool {
        (self.min..=self.max).contains(&degrees)
    }

    /// Which end the angle lies beyond; `None` inside. What is no number lies beyond the plus end.
    #[must_use]
    pub fn beyond(self, degrees: f64) -> Option<LimitSide> {
        if self.contains(degrees) {
            None
        } else if degrees < self.min {
            Some(LimitSide::Minus)
        } else {
            Some(LimitSide::Plus)
        }
    }
}

/// One axis of an arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisModel {
    /// Where moves may take it.
    pub soft: Limits,
    /// Where the vendor's data sheet ends.
    pub vendor: Limits,
    /// Full speed, degrees per second.
    pub max_speed: f64,
    /// Motor turns per turn of the axis.
    pub gear_ratio: f64,
}

/// The lengths of an arm with parallel base and spherical wrist, millimetres.
///
/// Read at all axes 0, upper arm upright, forearm level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Floor to shoulder, upwards.
    pub d1: f64,
    /// J1 to shoulder, forwards.
    pub a1: f64,
    /// Shoulder to elbow, upwards.
    pub a2: f64,
    /// Elbow to forearm, upwards.
    pub a3: f64,
    /// Elbow to wrist centre, forwards.
    pub d4: f64,
    /// Wrist centre to flange, forwards.
    pub d6: f64,
    /// Flange to the point the controller calls tool 0, along the flange axis.
    pub tool_offset: f64,
}

/// Everything about one model of arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotModel {
    /// The vendor's name.
    pub name: &'static str,
    /// J1 to J6.
    pub axes: [AxisModel; ARM_AXES],
    /// Its lengths.
    pub geometry: Geometry,
    /// Full speed of a linear or curve move, mm/s.
    pub max_line_speed: f64,
    /// Full turning speed of the tool in such a move, degrees per second.
    pub max_angular_speed: f64,
    /// From rest to full speed, and back, seconds.
    pub acceleration_time: f64,
}

/// BRTIRUS0707A, 7 kg.
///
/// Joint axes, limits and axis speeds: a public URDF of this arm and the soft limits set on one installation
/// (reported, unit A; its J6 soft limit is also given as ±355). Lengths: the chain of that URDF brought to
/// its equivalent, whole to about half a millimetre: with a tool offset of 17 mm it met the controller's own
/// X, Y, Z over 11 poses to 0.73 mm RMS. That fit also carried offsets of about 0.6° on J2, J3 and J5, one
/// arm's calibration, left out here. Line speed, angular speed and acceleration time: read off the pendant of
/// another six-axis arm (reported, unit B). Gear ratios: no figure is published for this arm; those of the
/// BRTIRUS0805A's public URDF are borrowed, so motor speeds are of the right order only.
const BRTIRUS0707A: RobotModel = RobotModel {
    name: "BRTIRUS0707A",
    axes: [
        axis((-155.0, 155.0), (-174.0, 174.0), 220.8, 100.0),
        axis((-105.0, 75.0), (-125.0, 85.0), 270.0, 100.0),
        axis((-45.0, 160.0), (-60.0, 175.0), 375.0, 101.0),
        axis((-160.0, 160.0), (-180.0, 180.0), 308.0, 80.0),
        axis((-100.0, 100.0), (-120.0, 120.0), 300.0, 51.0),
        axis((-340.0, 340.0), (-360.0, 360.0), 342.0, 50.0),
    ],
    geometry: Geometry { d1: 296.5, a1: 50.0, a2: 350.0, a3: 41.0, d4: 363.0, d6: 101.3, tool_offset: 17.0 },
    max_line_speed: 2000.0,
    max_angular_speed: 200.0,
    acceleration_time: 0.250,
};

/// Every model there is.
static MODELS: [RobotModel; 1] = [BRTIRUS0707A];

const fn axis(soft: (f64, f64), vendor: (f64, f64), max_speed: f64, gear_ratio: f64) -> AxisModel {
    AxisModel {
        soft: Limits { min: soft.0, max: soft.1 },
        vendor: Limits { min: vendor.0, max: vendor.1 },
        max_speed,
        gear_ratio,
    }
}

impl RobotModel {
    /// The model with this name, upper or lower case alike; `None` when there is none.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        MODELS.iter().find(|model| model.name.eq_ignore_ascii_case(name))
    }

    /// The names of all models.
    pub fn names() -> impl Iterator<Item = &'static str> {
        MODELS.iter().map(|model| model.name)
    }

    /// How many axes have a drive: 6.
    #[must_use]
    pub const fn axis_count(&self) -> usize {
        ARM_AXES
    }

    /// The soft limits, J1 to J6.
    #[must_use]
    pub fn soft_limits(&self) -> [Limits; ARM_AXES] {
        self.axes.map(|axis| axis.soft)
    }

    /// The first axis outside its soft limits, and the end it lies beyond.
    #[must_use]
    pub fn outside_limits(&self, axes: &Axes) -> Option<(AxisNumber, LimitSide)> {
        first_outside(&self.soft_limits(), axes.arm())
    }

    /// Motor speeds in revolutions per minute (`curSpeed-n`, manual 4.1.1) for axis speeds in degrees per
    /// second; 0 for J7 and J8.
    #[must_use]
    pub fn motor_rpm(&self, axis_speeds: &[f64; AXES]) -> [f64; AXES] {
        /// Degrees per second in one revolution per minute.
        const DEGREES_PER_SECOND_IN_RPM: f64 = 6.0;
        let mut rpm = [0.0; AXES];
        for ((slot, speed), axis) in rpm.iter_mut().zip(axis_speeds).zip(&self.axes) {
            *slot = speed * axis.gear_ratio / DEGREES_PER_SECOND_IN_RPM;
        }
        rpm
    }

    /// The solver for this arm.
    ///
    /// It counts from an arm stretched upright, turning J2, J3 and J5 about +Y and J4 and J6 about the
    /// forearm. The controller counts from a level forearm (hence a quarter turn on J3) and the other way on
    /// J2, J3 and J5: the joint axes of the URDF are (+z, −x, −x, +y, −x, −y), its signs (+, −, −, +, −, −),
    /// and the controller's world is the URDF's turned by −90° about Z, which makes URDF +y the world's +X.
    pub(super) fn solver(&self) -> OPWKinematics {
        let g = &self.geometry;
        OPWKinematics::new(Parameters {
            a1: g.a1,
            a2: -g.a3,
            b: 0.0,
            c1: g.d1,
            c2: g.a2,
            c3: g.d4,
            c4: g.d6 + g.tool_offset,
            offsets: [0.0, 0.0, -std::f64::consts::FRAC_PI_2, 0.0, 0.0, 0.0],
            sign_corrections: [1, -1, -1, 1, -1, 1],
            dof: 6,
        })
    }
}

/// The first of six angles outside its limits, and the end it lies beyond.
pub(super) fn first_outside(
    limits: &[Limits; ARM_AXES],
    arm: [f64; ARM_AXES],
) -> Option<(AxisNumber, LimitSide)> {
    AxisNumber::ARM
        .into_iter()
        .zip(limits)
        .zip(arm)
        .find_map(|((axis, limits), degrees)| limits.beyond(degrees).map(|side| (axis, side)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_find_their_model_in_any_case() {
        for name in RobotModel::names() {
            assert_eq!(RobotModel::named(name).map(|m| m.name), Some(name));
            assert_eq!(RobotModel::named(&name.to_ascii_lowercase()).map(|m| m.name), Some(name));
        }
        assert_eq!(RobotModel::named("BRTIRUS9999Z"), None);
        assert_eq!(RobotModel::named(""), None);
    }

    #[test]
    fn every_model_is_sane() {
        for model in &MODELS {
            assert_eq!(model.axis_count(), 6);
            for axis in &model.axes {
                assert!(
                    axis.vendor.min <= axis.soft.min && axis.soft.max <= axis.vendor.max,
                    "{}",
                    model.name
                );
                assert!(axis.soft.contains(0.0) && axis.max_speed > 0.0 && axis.gear_ratio > 0.0);
            }
            assert!(
                model.max_line_speed > 0.0 && model.max_angular_speed > 0.0 && model.acceleration_time > 0.0
            );
        }
    }

    #[test]
    fn limits_name_the_end() {
        let limits = Limits { min: -45.0, max: 160.0 };
        assert_eq!(limits.beyond(-45.0), None);
        assert_eq!(limits.beyond(160.0), None);
        assert_eq!(limits.beyond(-45.000_001), Some(LimitSide::Minus));
        assert_eq!(limits.beyond(160.1), Some(LimitSide::Plus));
        assert!(limits.beyond(f64::NAN).is_some());
    }

    #[test]
    fn the_first_axis_outside_is_named() {
        let model = RobotModel::named("BRTIRUS0707A").unwrap();
        let axes = Axes::of_arm([0.0, 75.0, -45.1, 0.0, 0.0, 400.0]).unwrap();
        assert_eq!(model.outside_limits(&axes), Some((AxisNumber::ARM[2], LimitSide::Minus)));
        assert_eq!(model.outside_limits(&Axes::ZERO), None);
    }

    #[test]
    fn motor_speed_goes_through_the_gear() {
        let model = RobotModel::named("brtirus0707a").unwrap();
        let rpm = model.motor_rpm(&[6.0, -6.0, 12.0, 0.0, 6.0, 342.0, 99.0, 99.0]);
        assert_eq!(rpm, [100.0, -100.0, 202.0, 0.0, 51.0, 2850.0, 0.0, 0.0]);
    }
}
