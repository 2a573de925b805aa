//! The torque of each axis, from gravity, inertia and friction.
//!
//! A simple model that gives torques of the right order, with the right sign, at the right time. It has three
//! point masses, no rotational inertia of links, motors or payload, no centrifugal forces, and friction in
//! proportion to the speed. The masses and rated torques of the models that come with the product are chosen
//! (`docs/MODELS.md`).

use nalgebra::Vector3;

use crate::axes::{ARM_AXES, AXES, Axes};
use crate::kinematics::mass_points;
use crate::robot_model::{AxisMotion, RobotModel};

/// Gravity, m/s².
const GRAVITY: f64 = 9.81;

/// The friction torque at full speed, as a fraction of the rated torque. Chosen.
const FRICTION_AT_FULL_SPEED: f64 = 0.2;

/// The axis step for numeric derivatives of the mass points, in degrees or mm. The points move on smooth
/// curves, so the error is a millionth.
const PROBE: f64 = 1e-3;

/// Millimetres in a metre.
const MM: f64 = 1e3;

/// The motion of the axes at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisMotions {
    /// Positions in degrees or mm.
    pub axes: Axes,
    /// Speeds in degrees or mm per second.
    pub speeds: [f64; AXES],
    /// Accelerations in degrees or mm per second squared.
    pub accelerations: [f64; AXES],
}

/// The torque of every axis as a fraction of its rated torque, positive in the direction of the axis:
/// gravity, inertia and friction. Without masses in the model, or a rated torque of the axis, it is friction
/// only. Missing axes read 0.
#[must_use]
pub fn torques(model: &RobotModel, motion: &AxisMotions) -> [f64; AXES] {
    let loads = loads(model, motion);
    let mut shares = [0.0; AXES];
    for ((slot, (load, axis)), speed) in
        shares.iter_mut().zip(loads.iter().zip(model.drives())).zip(motion.speeds)
    {
        let friction = FRICTION_AT_FULL_SPEED * speed / axis.max_speed;
        *slot = friction + axis.rated_torque.map_or(0.0, |rated| load / rated);
    }
    shares
}

/// The load of gravity and inertia on every axis: Nm on a turning axis, N on a linear one.
fn loads(model: &RobotModel, motion: &AxisMotions) -> [f64; ARM_AXES] {
    let mut loads = [0.0; ARM_AXES];
    let Some(masses) = &model.masses else { return loads };
    let ways = ways(model, motion.axes.arm());
    let masses = [masses.upper_arm, masses.forearm, masses.tool];
    for (n, mass) in masses.into_iter().enumerate() {
        // The acceleration that the mass feels: it is held against gravity, and accelerated.
        let mut felt = Vector3::new(0.0, 0.0, GRAVITY);
        for (way, acceleration) in ways.iter().zip(motion.accelerations) {
            felt += way.get(n).copied().unwrap_or_default() * (acceleration / MM);
        }
        for ((slot, way), axis) in loads.iter_mut().zip(&ways).zip(model.drives()) {
            let per_unit = mass * felt.dot(&way.get(n).copied().unwrap_or_default());
            // With these factors mm per degree become metres per radian, and mm per mm metres per metre.
            *slot += match axis.motion {
                AxisMotion::Turns => per_unit / MM * 1.0_f64.to_degrees(),
                AxisMotion::Slides => per_unit,
            };
        }
    }
    loads
}

/// How the mass points move with each axis: for every axis the motion of the three masses, in mm per degree
/// or mm.
fn ways(model: &RobotModel, arm: [f64; ARM_AXES]) -> [[Vector3<f64>; 3]; ARM_AXES] {
    let mut ways = [[Vector3::zeros(); 3]; ARM_AXES];
    for (n, way) in ways.iter_mut().enumerate().take(model.axis_count()) {
        let at = |by: f64| {
            let mut moved = arm;
            if let Some(axis) = moved.get_mut(n) {
                *axis += by;
            }
            mass_points(model, moved)
        };
        let (before, after) = (at(-PROBE), at(PROBE));
        for (slot, (before, after)) in way.iter_mut().zip(before.into_iter().zip(after)) {
            *slot = (after - before) / (2.0 * PROBE);
        }
    }
    ways
}

#[cfg(test)]
mod tests;
