//! Solves six turning axes near a known solution, along a path, without computing all configurations of the
//! arm.

use nalgebra::{Isometry3, Matrix6, Rotation3, Translation3, UnitQuaternion, Vector3, Vector6};

use crate::axes::ARM_AXES;
use crate::pose::Frame;
use crate::robot_model::{RobotModel, SixAxisGeometry};

/// How far an axis may be from its start value, in degrees. Beyond that, another configuration may be nearer.
const CLOSE_BY: f64 = 20.0;

/// J5 this close to straight turns J4 and J6 about almost the same line, in degrees. There all configurations
/// are computed instead.
const WRIST_STRAIGHT: f64 = 0.5;

/// How many corrections to try. A nearby position never takes as many, because each correction squares the
/// error.
const CORRECTIONS: usize = 6;

/// The size of a correction that ends the search, in degrees.
const SETTLED: f64 = 1e-9;

/// The axes for a transform of the tool, and how they follow it.
pub(crate) struct Nearby {
    /// Axis positions in degrees.
    pub(crate) arm: [f64; ARM_AXES],
    /// Degrees per mm and per radian of the tool, in the base frame.
    inverse: Matrix6<f64>,
}

impl Nearby {
    /// How the axes move with a motion of the tool: mm and radians in, degrees out.
    pub(crate) fn follow(&self, tool: &Vector6<f64>) -> [f64; ARM_AXES] {
        (self.inverse * tool).into()
    }
}

/// The axes that put the tool there, computed from nearby axes. `None` if that is not certain: near a
/// singularity, or if they turn out not to be near.
pub(super) fn nearby(
    model: &RobotModel,
    g: &SixAxisGeometry,
    tool_at: &Isometry3<f64>,
    tool: &Frame,
    near: [f64; ARM_AXES],
) -> Option<Nearby> {
    let mut arm = near;
    for _ in 0..CORRECTIONS {
        let (is, jacobian) = tool_and_jacobian(model, g, arm, tool);
        let [_, _, _, _, j5, _] = &model.axes;
        let [_, _, _, _, at, _] = arm;
        if (j5.geometric(at).to_radians().sin()).abs() < WRIST_STRAIGHT.to_radians() {
            return None;
        }
        let inverse = jacobian.try_inverse()?;
        let way = tool_at.translation.vector - is.translation.vector;
        let turn = (tool_at.rotation * is.rotation.inverse()).scaled_axis();
        let correction: [f64; ARM_AXES] =
            (inverse * Vector6::new(way.x, way.y, way.z, turn.x, turn.y, turn.z)).into();
        let mut largest = 0.0_f64;
        for ((slot, correction), near) in arm.iter_mut().zip(correction).zip(near) {
            *slot += correction;
            largest = largest.max(correction.abs());
            // Not `>`, because NaN must not count as near.
            let is_close = (*slot - near).abs() <= CLOSE_BY;
            if !is_close {
                return None;
            }
        }
        if largest <= SETTLED {
            return Some(Nearby { arm, inverse });
        }
    }
    None
}

/// The transform of the tool in the base frame, and how it moves with each axis: mm and radians per degree.
fn tool_and_jacobian(
    model: &RobotModel,
    g: &SixAxisGeometry,
    arm: [f64; ARM_AXES],
    tool: &Frame,
) -> (Isometry3<f64>, Matrix6<f64>) {
    let (x, y, z) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
    let links = [
        (z, Vector3::new(g.a1, g.b, g.d1)),
        (y, Vector3::new(0.0, 0.0, g.a2)),
        (y, Vector3::new(0.0, 0.0, g.a3)),
        (x, Vector3::new(g.d4, 0.0, 0.0)),
        (y, Vector3::new(g.d6 + g.tool_offset, 0.0, 0.0)),
        (x, Vector3::zeros()),
    ];
    let (mut turned, mut at) = (Rotation3::identity(), Vector3::zeros());
    let mut joints = [(Vector3::zeros(), Vector3::zeros()); ARM_AXES];
    for (((axis, link), joint), (position, figures)) in
        links.into_iter().zip(&mut joints).zip(arm.into_iter().zip(&model.axes))
    {
        let sign = f64::from(figures.sign).to_radians();
        *joint = (turned * axis.into_inner() * sign, at);
        turned *= Rotation3::from_axis_angle(&axis, figures.geometric(position).to_radians());
        at += turned * link;
    }
    // The flange's Z is the forearm's X.
    turned *= Rotation3::from_axis_angle(&y, std::f64::consts::FRAC_PI_2);
    let flange = Isometry3::from_parts(Translation3::from(at), UnitQuaternion::from_rotation_matrix(&turned));
    let tool_at = flange * tool.isometry();
    let mut jacobian = Matrix6::zeros();
    for (mut column, (axis, origin)) in jacobian.column_iter_mut().zip(joints) {
        let way = axis.cross(&(tool_at.translation.vector - origin));
        column.copy_from(&Vector6::new(way.x, way.y, way.z, axis.x, axis.y, axis.z));
    }
    (tool_at, jacobian)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::axes::Axes;
    use crate::kinematics::tests::{arm_in_limits, bent_tool};
    use crate::kinematics::{continued, tool_isometry};
    use crate::robot_model::Geometry;

    proptest! {
        /// The chain here matches the solver's on every model.
        #[test]
        fn the_chain_is_that_of_the_solver(arm in arm_in_limits(), which in 0..5_usize) {
            let names: Vec<_> = RobotModel::names().collect();
            let model = RobotModel::named(names[which]).unwrap();
            let Geometry::SixAxis(g) = &model.geometry else { unreachable!() };
            let tool = bent_tool();
            let (is, jacobian) = tool_and_jacobian(model, g, arm, &tool);
            let wanted = tool_isometry(model, &Axes::of_arm(arm).unwrap(), &tool);
            prop_assert!((is.translation.vector - wanted.translation.vector).norm() < 1e-9);
            prop_assert!(is.rotation.angle_to(&wanted.rotation) < 1e-9);
            for n in 0..6 {
                let mut moved = arm;
                moved[n] += 1e-6;
                let (next, _) = tool_and_jacobian(model, g, moved, &tool);
                let way = (next.translation.vector - is.translation.vector) / 1e-6;
                let turn = (next.rotation * is.rotation.inverse()).scaled_axis() / 1e-6;
                prop_assert!((jacobian.fixed_view::<3, 1>(0, n) - way).norm() < 1e-4);
                prop_assert!((jacobian.fixed_view::<3, 1>(3, n) - turn).norm() < 1e-4);
            }
        }

        /// The solution found nearby is also the nearest of the solver's.
        #[test]
        fn nearby_is_the_nearest_of_all(arm in arm_in_limits(), off in prop::array::uniform6(-1.0..1.0_f64)) {
            let model = crate::kinematics::tests::model();
            let Geometry::SixAxis(g) = &model.geometry else { unreachable!() };
            let tool = bent_tool();
            let tool_at = tool_isometry(model, &Axes::of_arm(arm).unwrap(), &tool);
            let mut near = arm;
            near.iter_mut().zip(off).for_each(|(slot, off)| *slot += off);
            let Some(found) = nearby(model, g, &tool_at, &tool, near) else { return Ok(()) };
            let again = tool_isometry(model, &Axes::of_arm(found.arm).unwrap(), &tool);
            prop_assert!((again.translation.vector - tool_at.translation.vector).norm() < 1e-9);
            let all = continued(model, &tool_at, &tool, &Axes::of_arm(near).unwrap()).unwrap();
            let time = |arm: [f64; 6]| -> f64 { arm.iter().zip(near).zip(&model.axes).map(|((a, b), axis)| (a - b).abs() / axis.max_speed).sum() };
            // The solver may find another configuration that is nearer, but not by more than half.
            prop_assert!(time(found.arm) <= time(all) + 1e-6 || time(all) > 0.5 * time(found.arm), "{:?} {all:?}", found.arm);
        }
    }
}
