use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;

use super::*;
use crate::axes::AxisNumber;
use crate::error::LimitSide;
use crate::kinematics::forward;
use crate::kinematics::tests::{bent_tool, model, possible};

/// Elbow up, tool down, far from every singularity.
fn tool_down() -> Axes {
    Axes::of_arm([0.0, -10.0, 10.0, 0.0, -90.0, 0.0]).unwrap()
}

fn line(frames: &Frames, start: &Axes, target: &Pose) -> Result<LinearPath, PlanError> {
    LinearPath::plan(model(), frames, start, target, MoveMask::SIX, Turning::Shortest)
}

fn tool_at(frames: &Frames, axes: &Axes) -> Isometry3<f64> {
    tool_isometry(model(), axes, &frames.tool)
}

fn pose_at(axes: &Axes) -> Pose {
    forward(model(), axes, &Frame::identity())
}

fn shifted(pose: Pose, x: f64, y: f64, z: f64) -> Pose {
    Pose { x: pose.x + x, y: pose.y + y, z: pose.z + z, ..pose }
}

fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    (
        (a.translation.vector - b.translation.vector).norm(),
        (a.rotation.inverse() * b.rotation).scaled_axis().norm(),
    )
}

#[test]
fn a_line_is_as_long_as_full_speed_takes() {
    let start = tool_down();
    let path = line(&Frames::default(), &start, &shifted(pose_at(&start), 0.0, 120.0, -160.0)).unwrap();
    assert!((path.length() - 200.0 / 2000.0).abs() < 1e-12);
    let turned = Pose { w: pose_at(&start).w + 40.0, ..shifted(pose_at(&start), 10.0, 0.0, 0.0) };
    let path = line(&Frames::default(), &start, &turned).unwrap();
    assert!((path.length() - 40.0 / 200.0).abs() < 1e-9, "turning takes longer than going");
}

#[test]
fn standing_still_is_a_path_of_no_length() {
    let start = tool_down();
    let path = LinearPath::plan(
        model(),
        &Frames::default(),
        &start,
        &Pose::default(),
        MoveMask(0),
        Turning::Shortest,
    )
    .unwrap();
    assert_eq!((path.length(), path.at(0.0).axes, path.at(1.0).slope), (0.0, start, [0.0; 6]));
}

/// A pose is read, rounded to three decimals, and sent back. With a straight wrist the rounding may point in
/// any direction.
#[test]
fn a_pose_sent_back_rounded_is_no_singularity() {
    for j1 in [0.0, 12.345_678, -77.777_777] {
        let start = Axes::of_arm([j1, 3.333_333, 7.654_321, 0.0, 0.0, 0.0]).unwrap();
        let rounded = pose_at(&start).components().map(|c| (c * 1000.0).round() / 1000.0);
        let path = line(&Frames::default(), &start, &Pose::from_components(rounded)).unwrap();
        let wanted = Pose::from_components(rounded).to_isometry().unwrap();
        for n in 0..=10 {
            let here = path.at(path.length() * f64::from(n) / 10.0);
            let (place, _) = apart(&tool_at(&Frames::default(), &here.axes), &wanted);
            assert!(place < 0.01, "{place}");
            for (slope, axis) in here.slope.into_iter().zip(&model().axes) {
                assert!(slope.abs() <= axis.max_speed * (1.0 + 1e-9));
            }
        }
        let end = path.at(path.length()).axes;
        assert!(apart(&tool_at(&Frames::default(), &end), &wanted).0 < 2e-4);
    }
}

#[test]
fn masked_out_components_keep_their_value() {
    let start = tool_down();
    let from = pose_at(&start);
    let target = Pose { u: 1.0, v: 2.0, w: 3.0, y: 999.0, ..shifted(from, -50.0, 0.0, 30.0) };
    let path =
        LinearPath::plan(model(), &Frames::default(), &start, &target, MoveMask(0b101), Turning::Shortest)
            .unwrap();
    let (is, wanted) = (path.at(path.length()).axes, shifted(from, -50.0, 0.0, 30.0).to_isometry().unwrap());
    let (place, turn) = apart(&tool_at(&Frames::default(), &is), &wanted);
    assert!(place < 1e-9 && turn < 1e-9, "{place} {turn}");
}

/// With V very close to 90°, U and W are hardly determined; a masked-out orientation does not go through
/// them.
#[test]
fn a_kept_orientation_is_kept_to_the_last_digit() {
    let start = Axes::of_arm([20.0, 0.0, 0.0, 0.0, 0.0, 3e-7]).unwrap();
    let target = Pose { z: pose_at(&start).z + 50.0, ..pose_at(&start) };
    let path =
        LinearPath::plan(model(), &Frames::default(), &start, &target, MoveMask(0b100), Turning::Shortest)
            .unwrap();
    let end = tool_at(&Frames::default(), &path.at(path.length()).axes);
    let (_, turn) = apart(&end, &tool_at(&Frames::default(), &start));
    assert!(turn < 1e-12, "{turn}");
}

/// A tool with its point at the wrist's centre does not move while the wrist turns, so only the orientation
/// can be wrong.
#[test]
fn a_turn_in_place_is_followed_too() {
    let tool = Frame::at(&Pose { z: -118.3, ..Pose::default() }).unwrap();
    let frames = Frames { tool, work: Frame::identity() };
    let start = Axes::of_arm([0.0, -10.0, 10.0, 0.0, -20.0, 0.0]).unwrap();
    let from = tool_at(&frames, &start);
    let turn = Vector3::new(0.4, -0.9, 0.5);
    let to = from * UnitQuaternion::from_scaled_axis(turn);
    let path = line(&frames, &start, &Pose::from_isometry(&to)).unwrap();
    for n in 0..=500 {
        let part = f64::from(n) / 500.0;
        let wanted = from * UnitQuaternion::from_scaled_axis(turn * part);
        let (place, turn) = apart(&tool_at(&frames, &path.at(path.length() * part).axes), &wanted);
        assert!(place < 0.005 && turn.to_degrees() < 0.005, "{place} mm, {turn} rad astray");
    }
}

#[test]
fn masks_and_targets_count_in_the_work_frame() {
    let start = tool_down();
    let work = Frame::at(&Pose { x: 300.0, y: -50.0, z: 100.0, u: 0.0, v: 0.0, w: 90.0 }).unwrap();
    let frames = Frames { tool: Frame::identity(), work };
    let from = crate::kinematics::world(model(), &start, &frames);
    let target = Pose { x: from.x + 40.0, ..Pose::default() };
    let path = LinearPath::plan(model(), &frames, &start, &target, MoveMask(0b1), Turning::Shortest).unwrap();
    // X of a workbench that is turned by 90° is Y of the base.
    let wanted = shifted(pose_at(&start), 0.0, 40.0, 0.0).to_isometry().unwrap();
    let (place, turn) = apart(&tool_at(&frames, &path.at(path.length()).axes), &wanted);
    assert!(place < 1e-9 && turn < 1e-9, "{place} {turn}");
}

#[test]
fn a_line_out_of_reach_says_so() {
    let start = tool_down();
    let error = line(&Frames::default(), &start, &shifted(pose_at(&start), 900.0, 0.0, 0.0)).unwrap_err();
    assert_eq!(error, PlanError::Unreachable);
}

#[test]
fn a_line_close_over_the_base_would_spin_j1() {
    // The wrist passes over the base from one side to the other, 4 mm beside J1's own axis.
    let start = Axes::of_arm([89.0, 0.0, 50.0, 0.0, -30.0, 0.0]).unwrap();
    let target = shifted(pose_at(&start), 0.0, -320.0, 0.0);
    assert_eq!(
        line(&Frames::default(), &start, &target).map(|path| path.length()),
        Err(PlanError::Singular { axis: AxisNumber::ARM[0] })
    );
}

#[test]
fn a_limit_on_the_way_is_named() {
    // Lifting a tool that points down bends the wrist back until J5 reaches its limit.
    let start = tool_down();
    let error = line(&Frames::default(), &start, &shifted(pose_at(&start), 0.0, 0.0, 120.0)).unwrap_err();
    assert_eq!(error, PlanError::OutsideLimits { axis: AxisNumber::ARM[4], side: LimitSide::Minus });
}

#[test]
fn an_arm_outside_its_limits_may_come_back_in() {
    let start = Axes::of_arm([0.0, -10.0, 10.0, 0.0, -103.0, 0.0]).unwrap();
    let inward = Pose { v: pose_at(&start).v - 5.0, ..pose_at(&start) };
    let outward = Pose { v: pose_at(&start).v + 5.0, ..pose_at(&start) };
    let results = [inward, outward].map(|target| line(&Frames::default(), &start, &target));
    assert_eq!(results.iter().filter(|result| result.is_ok()).count(), 1);
    let refused = PlanError::OutsideLimits { axis: AxisNumber::ARM[4], side: LimitSide::Minus };
    assert!(results.iter().any(|result| result.as_ref().err() == Some(&refused)));
}

#[test]
fn sideways_from_a_straight_wrist_is_singular() {
    let error =
        line(&Frames::default(), &Axes::ZERO, &shifted(pose_at(&Axes::ZERO), 0.0, 50.0, 0.0)).unwrap_err();
    assert!(
        matches!(error, PlanError::Singular { axis } if axis.index() == 3 || axis.index() == 5),
        "{error}"
    );
}

#[test]
fn within_its_plane_a_straight_wrist_is_no_trouble() {
    // From J5 = 0, and through it.
    let from = pose_at(&Axes::ZERO);
    let lifted = line(&Frames::default(), &Axes::ZERO, &shifted(from, -60.0, 0.0, 40.0)).unwrap();
    let start = lifted.at(lifted.length()).axes;
    let back = line(&Frames::default(), &start, &shifted(from, 60.0, 0.0, -40.0)).unwrap();
    let crossing = back.at(back.length() / 2.0).axes.arm();
    for (n, degrees) in crossing.into_iter().enumerate() {
        assert!(degrees.abs() < 1e-2, "J{} at {degrees}", n + 1);
    }
    let (first, last) = (start.arm()[4], back.at(back.length()).axes.arm()[4]);
    assert!(first * last < 0.0 && first.abs() > 1.0, "J5 went from {first} to {last}");
}

#[test]
fn close_by_a_singularity_the_path_is_slow() {
    let start = Axes::of_arm([0.0, -10.0, 10.0, 0.0, -2.0, 0.0]).unwrap();
    let path = line(&Frames::default(), &start, &shifted(pose_at(&start), 0.0, 40.0, 0.0)).unwrap();
    assert!(path.top_speed() < 0.2, "{}", path.top_speed());
}

fn curve(start: &Axes, middle: &Pose, end: &Pose) -> Result<CurvePath, PlanError> {
    let points = (middle, end);
    CurvePath::plan(model(), &Frames::default(), start, points, MoveMask::SIX, Turning::Shortest)
}

#[test]
fn a_curve_goes_through_its_middle() {
    let start = tool_down();
    let from = pose_at(&start);
    let (middle, end) = (shifted(from, 40.0, 40.0, 10.0), shifted(from, 0.0, 80.0, 0.0));
    let path = curve(&start, &middle, &end).unwrap();
    let nearest = (0..=2000)
        .map(|n| tool_at(&Frames::default(), &path.at(path.length() * f64::from(n) / 2000.0).axes))
        .map(|at| (at.translation.vector - Vector3::new(middle.x, middle.y, middle.z)).norm())
        .fold(f64::INFINITY, f64::min);
    assert!(nearest < 0.05, "{nearest}");
    let (place, turn) =
        apart(&tool_at(&Frames::default(), &path.at(path.length()).axes), &end.to_isometry().unwrap());
    assert!(place < 1e-9 && turn < 1e-9, "{place} {turn}");
}

#[test]
fn a_curve_without_a_circle_is_refused() {
    let start = tool_down();
    let from = pose_at(&start);
    let (middle, end) = (shifted(from, 0.0, 90.0, 0.0), shifted(from, 0.0, 80.0, 0.0));
    let path = curve(&start, &middle, &end);
    assert_eq!(path, Err(PlanError::CurvePoints));
}

#[test]
fn what_is_no_number_is_refused() {
    let start = tool_down();
    for n in 0..6 {
        for bad in [f64::NAN, f64::INFINITY, 1e300] {
            let mut components = pose_at(&start).components();
            components[n] = bad;
            let bad = Pose::from_components(components);
            assert_eq!(line(&Frames::default(), &start, &bad), Err(PlanError::NotFinite));
            let curve = CurvePath::plan(
                model(),
                &Frames::default(),
                &start,
                (&bad, &pose_at(&start)),
                MoveMask::SIX,
                Turning::Shortest,
            );
            assert_eq!(curve, Err(PlanError::NotFinite));
        }
    }
}

#[test]
fn planning_needs_few_nodes() {
    let start = tool_down();
    let path = line(&Frames::default(), &start, &shifted(pose_at(&start), 100.0, 250.0, -150.0)).unwrap();
    assert!(path.0.nodes.len() < 60, "{}", path.0.nodes.len());
}

/// Exceeding a soft limit by this little is a rounding error, in degrees.
const ROUNDING: f64 = 1e-6;

/// Poses around the start, some out of reach.
fn nearby() -> impl Strategy<Value = ([f64; 3], [f64; 3])> {
    (prop::array::uniform3(-250.0..250.0), prop::array::uniform3(-1.2..1.2_f64))
}

/// Checks all promises of the path at the fraction `part`; `wanted` is the expected transform of the tool
/// there.
fn check(path: &ToolPath, frames: &Frames, wanted: &Isometry3<f64>, part: f64) -> Result<(), TestCaseError> {
    let position = path.length * part;
    let here = path.at(position);
    let (place, turn) = apart(&tool_at(frames, &here.axes), wanted);
    prop_assert!(place < 0.005 && turn.to_degrees() < 0.005, "{place} mm, {turn} rad astray");
    for (axis, limits) in here.axes.arm().into_iter().zip(model().soft_limits()) {
        prop_assert!(limits.min - 2.0 * ROUNDING <= axis && axis <= limits.max + 2.0 * ROUNDING);
    }
    for (slope, axis) in here.slope.into_iter().zip(&model().axes) {
        prop_assert!(slope.abs() * path.top_speed <= axis.max_speed * (1.0 + 1e-9));
    }
    // The slope is that of the axes.
    let h = 1e-7;
    let (before, after) = (path.at((position - h).max(0.0)), path.at((position + h).min(path.length)));
    let width = (position + h).min(path.length) - (position - h).max(0.0);
    for (n, (before, after)) in before.axes.arm().into_iter().zip(after.axes.arm()).enumerate() {
        let measured = (after - before) / width;
        let scale = 1.0 + here.slope[n].abs();
        prop_assert!(
            (measured - here.slope[n]).abs() < 0.02 * scale + 1.0,
            "J{}: {measured} {}",
            n + 1,
            here.slope[n]
        );
    }
    Ok(())
}

/// A wrist at W = 100 with the target −100, from a J6 that has room for either direction.
fn wrist_path(turning: Turning) -> LinearPath {
    let stance = |j6| Axes::of_arm([0.0, -10.0, 10.0, 0.0, -90.0, j6]).unwrap();
    let plan = |j6: f64, turning| {
        let from = pose_at(&stance(j6));
        let target = Pose { w: -100.0, ..from };
        LinearPath::plan(model(), &Frames::default(), &stance(j6), &target, MoveMask::SIX, turning)
    };
    let fits = |j6: &f64| [Turning::Shortest, Turning::AsTold].iter().all(|way| plan(*j6, *way).is_ok());
    let reads_100 = |j6: &f64| (pose_at(&stance(*j6)).w - 100.0).abs() < 1e-6;
    let j6 = (-340..=340).map(f64::from).find(|j6| reads_100(j6) && fits(j6));
    plan(j6.unwrap(), turning).unwrap()
}

#[test]
fn the_wrist_turns_the_short_way_unless_it_is_told_otherwise() {
    let (short, told) = (wrist_path(Turning::Shortest), wrist_path(Turning::AsTold));
    assert!((short.length() - 160.0 / 200.0).abs() < 1e-9, "{}", short.length());
    assert!((told.length() - 200.0 / 200.0).abs() < 1e-9, "{}", told.length());
    let turned = |path: &LinearPath| path.at(9.0).axes.arm()[5] - path.at(0.0).axes.arm()[5];
    assert!((turned(&short).abs() - 160.0).abs() < 1e-6 && (turned(&told).abs() - 200.0).abs() < 1e-6);
    assert!(turned(&short) * turned(&told) < 0.0, "the other way round");
    let (a, b) = (pose_at(&short.at(9.0).axes), pose_at(&told.at(9.0).axes));
    assert!((a.w - b.w).abs() < 1e-6 && (a.x - b.x).abs() < 1e-6);
    let middle = pose_at(&told.at(told.length() / 2.0).axes);
    assert!(middle.w.abs() < 1e-6, "by way of 0: {}", middle.w);
}

/// U +180 where it reads −180, seen on a real unit: with `AsTold` it is a whole turn, which J6 cannot do.
#[test]
fn half_a_turn_told_with_the_other_sign_is_a_whole_turn_as_told() {
    let start = Axes::of_arm([0.0, -10.0, 10.0, 0.0, -89.9, 0.0]).unwrap();
    let from = pose_at(&start);
    let plan = |turning| {
        let other = Pose { w: from.w - 360.0 * from.w.signum(), ..from };
        LinearPath::plan(model(), &Frames::default(), &start, &other, MoveMask::SIX, turning)
    };
    assert!(from.w.abs() > 1.0 || from.u.abs() > 1.0);
    assert!(plan(Turning::Shortest).unwrap().length() < 1e-9);
    let error = plan(Turning::AsTold).unwrap_err();
    assert!(matches!(error, PlanError::OutsideLimits { axis, .. } if axis == AxisNumber::ARM[5]), "{error}");
}

proptest! {
    #[test]
    fn the_tool_keeps_to_the_line(
        (by, turn) in nearby(), bent in any::<bool>(), j1 in -60.0..60.0,
        parts in prop::collection::vec(0.0..1.0, 8),
    ) {
        let tool = if bent { bent_tool() } else { Frame::identity() };
        let frames = Frames { tool, work: Frame::identity() };
        let start = Axes::of_arm([j1, -10.0, 10.0, 20.0, -60.0, 30.0]).unwrap();
        let from = tool_at(&frames, &start);
        let mut to = from;
        to.translation.vector += Vector3::from(by);
        to.rotation = UnitQuaternion::from_scaled_axis(Vector3::from(turn)) * to.rotation;
        let path = possible(line(&frames, &start, &Pose::from_isometry(&to)))?;
        for part in parts {
            let place = from.translation.vector.lerp(&to.translation.vector, part);
            let rotation = from.rotation.slerp(&to.rotation, part);
            check(&path.0, &frames, &Isometry3::from_parts(place.into(), rotation), part)?;
        }
        prop_assert_eq!(path.at(0.0).axes, start);
        let (place, turn) = apart(&tool_at(&frames, &path.at(path.length()).axes), &to);
        prop_assert!(place < 1e-8 && turn < 1e-9, "the end is {place} mm, {turn} rad astray");
    }

    #[test]
    fn the_tool_keeps_to_the_arc(
        (by, turn) in nearby(), side in prop::array::uniform3(-150.0..150.0),
        parts in prop::collection::vec(0.0..1.0, 8),
    ) {
        let frames = Frames::default();
        let start = Axes::of_arm([10.0, -10.0, 10.0, 20.0, -60.0, 30.0]).unwrap();
        let from = tool_at(&frames, &start);
        let (mut middle, mut to) = (from, from);
        middle.translation.vector += Vector3::from(side);
        to.translation.vector += Vector3::from(by);
        to.rotation = UnitQuaternion::from_scaled_axis(Vector3::from(turn)) * to.rotation;
        let points = (&Pose::from_isometry(&middle), &Pose::from_isometry(&to));
        let path = possible(CurvePath::plan(model(), &frames, &start, points, MoveMask::SIX, Turning::Shortest))?;
        let track = Track::arc(from, Point3::from(middle.translation.vector), to).unwrap();
        for part in parts {
            check(&path.0, &frames, &track.at(part), part)?;
        }
    }
}
