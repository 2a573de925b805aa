use std::ops::Range;
use std::sync::LazyLock;

use nalgebra::{Matrix3, Rotation3};
use proptest::prelude::*;

use super::*;

/// The default model without its calibration: at zero the upper arm is exactly upright and the forearm
/// exactly level.
pub(crate) fn model() -> &'static RobotModel {
    static STRAIGHT: LazyLock<RobotModel> = LazyLock::new(|| {
        let mut model = RobotModel::default();
        for axis in &mut model.axes {
            axis.offset = 0.0;
        }
        model
    });
    &STRAIGHT
}

/// Six angles anywhere in the soft limits.
pub(crate) fn arm_in_limits() -> impl Strategy<Value = [f64; ARM_AXES]> {
    let [r1, r2, r3, r4, r5, r6] =
        model().axes.map(|axis| Range { start: axis.soft.min, end: axis.soft.max });
    (r1, r2, r3, r4, r5, r6).prop_map(|(j1, j2, j3, j4, j5, j6)| [j1, j2, j3, j4, j5, j6])
}

/// The result of planning; rejects the input of this test case if planning failed.
pub(crate) fn possible<T>(planned: Result<T, PlanError>) -> Result<T, TestCaseError> {
    planned.map_err(|error| TestCaseError::reject(error.to_string()))
}

/// A tool that sticks out sideways and is turned.
pub(crate) fn bent_tool() -> Frame {
    Frame::at(&Pose { x: 20.0, y: -35.0, z: 120.0, u: 30.0, v: -40.0, w: 75.0 }).unwrap()
}

fn arm(degrees: [f64; ARM_AXES]) -> Axes {
    Axes::of_arm(degrees).unwrap()
}

fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    let place = (a.translation.vector - b.translation.vector).norm();
    // From the difference of the matrices, because an angle from an arc cosine would be mostly rounding.
    let turn: Matrix3<f64> =
        a.rotation.to_rotation_matrix().matrix() - b.rotation.to_rotation_matrix().matrix();
    (place, turn.abs().max())
}

/// The arm link by link in the URDF's own frame, with its joint axes and signs, then turned into the
/// controller's world. The flange's Z is its approach direction.
fn link_by_link(model: &RobotModel, arm: [f64; ARM_AXES]) -> Isometry3<f64> {
    let Geometry::SixAxis(g) = &model.geometry else { panic!("a six-axis arm") };
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let links = [
        (Vector3::zeros(), z, 1.0),
        (y * g.a1 + z * g.d1, -x, -1.0),
        (z * g.a2, -x, -1.0),
        (z * g.a3, y, 1.0),
        (y * g.d4, -x, -1.0),
        (Vector3::zeros(), -y, -1.0),
    ];
    let mut at = Isometry3::identity();
    for ((offset, axis, sign), degrees) in links.into_iter().zip(arm) {
        let turn = UnitQuaternion::from_scaled_axis(axis * (sign * degrees.to_radians()));
        at *= Isometry3::from_parts(offset.into(), turn);
    }
    at *= Translation3::from(y * (g.d6 + g.tool_offset));
    let to_world = UnitQuaternion::from_scaled_axis(z * -90.0_f64.to_radians());
    // At all axes 0 the flange's Z points along the world's X, and its X down.
    let flange = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[-z, -x, y]));
    (to_world * at) * UnitQuaternion::from_rotation_matrix(&flange)
}

#[test]
fn at_zero_the_forearm_points_along_x() {
    let pose = forward(model(), &Axes::ZERO, &Frame::identity());
    for (got, want) in pose.components().into_iter().zip([531.3, 0.0, 687.5, 0.0, 90.0, 0.0]) {
        assert!((got - want).abs() < 1e-9, "{pose:?}");
    }
}

#[test]
fn each_axis_turns_the_way_it_should() {
    let at = |degrees| forward(model(), &arm(degrees), &Frame::identity());
    let zero = at([0.0; 6]);
    assert!(at([10.0, 0.0, 0.0, 0.0, 0.0, 0.0]).y > zero.y + 50.0, "J1 + to the left");
    assert!(at([0.0, 10.0, 0.0, 0.0, 0.0, 0.0]).x < zero.x - 50.0, "J2 + leans back");
    assert!(at([0.0, 0.0, 10.0, 0.0, 0.0, 0.0]).z > zero.z + 50.0, "J3 + lifts");
    assert!(at([0.0, 0.0, 0.0, 0.0, 10.0, 0.0]).z > zero.z + 10.0, "J5 + lifts");
    let down = at([0.0, 0.0, 0.0, 0.0, -90.0, 0.0]);
    assert!((down.u.abs() - 180.0).abs() < 1e-9 && down.v.abs() < 1e-9, "tool down: {down:?}");
}

/// The one published pair of joint and world values (reported, unit C). It is from another model, so only the
/// orientation can be compared.
#[test]
fn a_real_arm_is_turned_the_same_way() {
    let pose = forward(model(), &arm([0.0285, 28.31, -34.69, 0.0154, -82.82, 0.0185]), &Frame::identity());
    let real = Pose { u: 179.984, v: 0.805, w: -179.992, ..pose };
    let (_, turn) = apart(&pose.to_isometry().unwrap(), &real.to_isometry().unwrap());
    assert!(turn.to_degrees() < 0.06, "{pose:?}");
}

#[test]
fn tool_and_work_frame_move_what_is_shown() {
    let tool = Frame::at(&Pose { z: 100.0, ..Pose::default() }).unwrap();
    let longer = forward(model(), &Axes::ZERO, &tool);
    assert!((longer.x - 631.3).abs() < 1e-9, "the tool sticks out along X: {longer:?}");
    let work = Frame::at(&Pose { x: 500.0, y: 100.0, z: 0.0, u: 0.0, v: 0.0, w: 90.0 }).unwrap();
    let shown = world(model(), &Axes::ZERO, &Frames { tool, work });
    for (got, want) in shown.components().into_iter().zip([-100.0, -131.3, 687.5, 0.0, 90.0, -90.0]) {
        assert!((got - want).abs() < 1e-9, "{shown:?}");
    }
}

#[test]
fn a_half_turn_written_the_other_way_does_not_send_the_wrist_round() {
    // Tool down, with a J6 for which U reads 180 and W is at the edge of its range.
    for j6 in [-179.5, 179.5, 300.0, -300.0] {
        let stands = arm([5.0, -10.0, 20.0, 3.0, -80.0, j6]);
        let mut pose = forward(model(), &stands, &Frame::identity());
        for (u, w) in [(360.0, 0.0), (-360.0, 360.0), (0.0, -360.0)] {
            (pose.u, pose.w) = (pose.u + u, pose.w + w);
            let found = inverse(model(), &pose, &Frame::identity(), &stands).unwrap();
            for (found, stood) in found.arm().into_iter().zip(stands.arm()) {
                assert!((found - stood).abs() < 1e-7, "{found} {stood}");
            }
        }
    }
}

#[test]
fn a_straight_wrist_keeps_its_axes() {
    for (j4, j6) in [(0.0, 0.0), (30.0, -30.0), (-100.0, 250.0)] {
        let stands = arm([10.0, 5.0, 10.0, j4, 0.0, j6]);
        let pose = forward(model(), &stands, &Frame::identity());
        let found = inverse(model(), &pose, &Frame::identity(), &stands).unwrap();
        for (found, stood) in found.arm().into_iter().zip(stands.arm()) {
            assert!((found - stood).abs() < 1e-6, "{:?}", found);
        }
    }
}

#[test]
fn a_straight_wrist_gives_j6_what_j4_may_not_turn() {
    // Another 150 degrees of the sum, shared evenly, would take J4 to 225.
    let stands = arm([0.0, 0.0, 0.0, 150.0, 0.0, 0.0]);
    let wanted = forward(model(), &arm([0.0, 0.0, 0.0, 150.0, 0.0, 150.0]), &Frame::identity());
    let found = inverse(model(), &wanted, &Frame::identity(), &stands).unwrap();
    assert_eq!(model().outside_limits(&found), None);
    // J4 goes as far as it may, and no whole turn back.
    let [.., j4, _, j6] = found.arm();
    assert!((j4 - 160.0).abs() < 1e-6 && (j6 - 140.0).abs() < 1e-6, "{found:?}");
    let reached = forward(model(), &found, &Frame::identity());
    let (place, turn) = apart(&reached.to_isometry().unwrap(), &wanted.to_isometry().unwrap());
    assert!(place < 1e-3 && turn < 1e-5, "{found:?}");
}

#[test]
fn beyond_reach_is_unreachable() {
    let far = Pose { x: 1500.0, ..forward(model(), &Axes::ZERO, &Frame::identity()) };
    assert_eq!(inverse(model(), &far, &Frame::identity(), &Axes::ZERO), Err(InverseError::Unreachable));
    assert!(all_solutions(model(), &far, &Frame::identity(), &Axes::ZERO).is_empty());
}

#[test]
fn what_is_no_number_is_unreachable() {
    for n in 0..6 {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, f64::MAX] {
            let mut components = [400.0, 0.0, 400.0, 180.0, 0.0, 0.0];
            components[n] = bad;
            let pose = Pose::from_components(components);
            assert_eq!(
                inverse(model(), &pose, &Frame::identity(), &Axes::ZERO),
                Err(InverseError::Unreachable)
            );
        }
    }
}

#[test]
fn outside_the_limits_names_axis_and_end() {
    // So far behind the base that the arm cannot reach it by bending backwards.
    let behind = arm([170.0, -60.0, 20.0, 0.0, -50.0, 0.0]);
    let pose = forward(model(), &behind, &Frame::identity());
    let near = arm([150.0, -60.0, 20.0, 0.0, -50.0, 0.0]);
    let error = inverse(model(), &pose, &Frame::identity(), &near).unwrap_err();
    assert_eq!(error, InverseError::OutsideLimits { axis: AxisNumber::ARM[0], side: LimitSide::Plus });
}

/// Rounding puts some of them a little outside.
#[test]
fn a_pose_exactly_on_a_limit_is_inside() {
    let limits = model().soft_limits();
    for (axis, limit) in
        limits.into_iter().enumerate().flat_map(|(n, range)| [(n, range.min), (n, range.max)])
    {
        for n in 0..20 {
            let mut degrees = [20.0, -20.0, 30.0, 10.0, -60.0, 20.0].map(|degrees| degrees + f64::from(n));
            degrees[axis] = limit;
            let stands = arm(degrees);
            let pose = forward(model(), &stands, &Frame::identity());
            let found = inverse(model(), &pose, &Frame::identity(), &stands).unwrap();
            for (found, stood) in found.arm().into_iter().zip(degrees) {
                assert!((found - stood).abs() < 1e-8, "{found} {stood}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn forward_agrees_with_the_arm_link_by_link(degrees in arm_in_limits()) {
        let solved = tool_isometry(model(), &arm(degrees), &Frame::identity());
        let (place, turn) = apart(&solved, &link_by_link(model(), degrees));
        prop_assert!(place < 1e-6 && turn < 1e-6, "{place} mm, {turn} rad");
    }
}

proptest! {
    #[test]
    fn inverse_finds_the_axes_it_stands_near(degrees in arm_in_limits()) {
        prop_assume!(degrees[4].abs() > 0.1);
        let stands = arm(degrees);
        let pose = forward(model(), &stands, &bent_tool());
        let found = inverse(model(), &pose, &bent_tool(), &stands).unwrap();
        for (found, stood) in found.arm().into_iter().zip(degrees) {
            prop_assert!((found - stood).abs() < 1e-5, "{found} {stood}");
        }
    }

    #[test]
    fn whatever_inverse_finds_is_there_and_within_limits(
        degrees in arm_in_limits(), near in arm_in_limits(), straight in any::<bool>(),
    ) {
        let mut degrees = degrees;
        if straight {
            degrees[4] = 0.0;
        }
        let pose = forward(model(), &arm(degrees), &bent_tool());
        let wanted = pose.to_isometry().unwrap();
        let near = Axes::new([near[0], near[1], near[2], near[3], near[4], near[5], 7.0, 8.0]).unwrap();
        let found = inverse(model(), &pose, &bent_tool(), &near).unwrap();
        let all = all_solutions(model(), &pose, &bent_tool(), &near);
        prop_assert_eq!(all.first(), Some(&found));
        // A straight wrist is solved to the solver's 1e-6 rad only.
        let (close, level) = if straight { (1e-3, 1e-5) } else { (1e-6, 1e-8) };
        for solution in all {
            prop_assert_eq!(model().outside_limits(&solution), None);
            prop_assert_eq!(&solution.degrees()[6..], &[7.0, 8.0]);
            let (place, turn) = apart(&tool_isometry(model(), &solution, &bent_tool()), &wanted);
            prop_assert!(place < close && turn < level, "{place} mm, {turn} rad");
        }
    }
}
