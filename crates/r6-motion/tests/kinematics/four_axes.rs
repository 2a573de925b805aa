//! SCARA and Cartesian machines: poses, masks, frames and moves.

use r6_motion::kinematics::{Frames, InverseError, all_solutions, forward, inverse, world};
use r6_motion::{
    Axes, AxisNumber, Conditions, Frame, LimitSide, Move, MoveMask, MoveSpeed, MoveTarget, Movement,
    PlanError, Pose, Ramps, RobotModel, Turning,
};

use crate::common::model;

fn axes(first: [f64; 4]) -> Axes {
    let [j1, j2, j3, j4] = first;
    Axes::of_arm([j1, j2, j3, j4, 0.0, 0.0]).unwrap()
}

fn scara() -> &'static RobotModel {
    model("GENERIC-SCARA")
}

fn cartesian() -> &'static RobotModel {
    model("GENERIC-CARTESIAN")
}

#[track_caller]
fn close(pose: &Pose, wanted: [f64; 6]) {
    for (got, want) in pose.components().into_iter().zip(wanted) {
        assert!((got - want).abs() < 1e-9, "{pose:?} {wanted:?}");
    }
}

fn moved(model: &RobotModel, start: &Axes, target: MoveTarget, mask: u8) -> Result<Movement, PlanError> {
    let order = Move { target, mask: MoveMask(mask), speed: MoveSpeed::PercentOfMax(50.0), delay: 0.0 };
    let conditions = Conditions {
        global: 1.0,
        ramps: Ramps::default(),
        frames: Frames::default(),
        turning: Turning::Shortest,
    };
    Movement::plan(model, start, &order, &conditions)
}

fn end(movement: &Movement) -> Axes {
    movement.state_at(movement.duration()).axes
}

#[test]
fn a_scara_is_where_its_links_put_it() {
    let none = Frame::identity();
    close(&forward(scara(), &Axes::ZERO, &none), [600.0, 0.0, 300.0, 0.0, 0.0, 0.0]);
    close(&forward(scara(), &axes([90.0, 0.0, -50.0, 10.0]), &none), [0.0, 600.0, 250.0, 100.0, 0.0, 0.0]);
    close(&forward(scara(), &axes([0.0, 90.0, 0.0, 0.0]), &none), [300.0, 300.0, 300.0, 90.0, 0.0, 0.0]);
    close(&forward(scara(), &axes([60.0, -120.0, 0.0, 30.0]), &none), [300.0, 0.0, 300.0, -30.0, 0.0, 0.0]);
}

#[test]
fn a_cartesian_machine_shows_its_axes() {
    let pose = forward(cartesian(), &axes([100.0, 200.0, -300.0, 45.0]), &Frame::identity());
    close(&pose, [100.0, 200.0, -300.0, 45.0, 0.0, 0.0]);
}

#[test]
fn the_elbow_bends_both_ways() {
    let pose = Pose { x: 300.0, y: 0.0, z: 250.0, u: -30.0, v: 0.0, w: 0.0 };
    let near = axes([50.0, -100.0, 0.0, 0.0]);
    let all = all_solutions(scara(), &pose, &Frame::identity(), &near);
    let wanted = [[60.0, -120.0, -50.0, 30.0], [-60.0, 120.0, -50.0, -90.0]];
    assert_eq!(all.len(), 2);
    for (found, wanted) in all.iter().zip(wanted) {
        for (found, wanted) in found.degrees().iter().zip(wanted) {
            assert!((found - wanted).abs() < 1e-9, "{all:?}");
        }
    }
}

#[test]
fn a_half_turn_written_the_other_way_does_not_turn_the_tool_round() {
    let stands = axes([20.0, 40.0, -20.0, 120.0]);
    let pose = forward(scara(), &stands, &Frame::identity());
    assert!((pose.u - 180.0).abs() < 1e-9, "{pose:?}");
    for u in [-180.0, 180.0, 540.0] {
        let found = inverse(scara(), &Pose { u, ..pose }, &Frame::identity(), &stands).unwrap();
        for (found, stood) in found.degrees().iter().zip(stands.degrees()) {
            assert!((found - stood).abs() < 1e-9, "{found} {stood}");
        }
        let movement = moved(scara(), &stands, MoveTarget::Line(Pose { u, ..pose }), 0x0F).unwrap();
        assert!(movement.duration() < 0.01, "{}", movement.duration());
    }
}

#[test]
fn out_of_reach_and_out_of_limits_are_told_apart() {
    let at = |x, z| Pose { x, y: 0.0, z, u: 0.0, v: 0.0, w: 0.0 };
    let none = Frame::identity();
    let find = |pose| inverse(scara(), &pose, &none, &Axes::ZERO);
    assert_eq!(find(at(601.0, 300.0)), Err(InverseError::Unreachable));
    assert_eq!(
        find(at(500.0, 301.0)),
        Err(InverseError::OutsideLimits { axis: AxisNumber::ARM[2], side: LimitSide::Plus })
    );
    assert_eq!(
        inverse(cartesian(), &at(-1.0, -10.0), &none, &Axes::ZERO),
        Err(InverseError::OutsideLimits { axis: AxisNumber::ARM[0], side: LimitSide::Minus })
    );
}

#[test]
fn axes_that_are_not_there_never_move() {
    let target = Axes::new([10.0, 20.0, -30.0, 40.0, 999.0, 999.0, 999.0, 999.0]).unwrap();
    let movement = moved(scara(), &Axes::ZERO, MoveTarget::Axes(target), 0xFF).unwrap();
    assert_eq!(end(&movement).degrees(), &[10.0, 20.0, -30.0, 40.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(movement.state_at(movement.duration() / 2.0).axis_speeds[4..], [0.0; 4]);
}

#[test]
fn a_slide_beyond_its_limit_is_named() {
    let error = moved(scara(), &Axes::ZERO, MoveTarget::Axes(axes([0.0, 0.0, 1.0, 0.0])), 0x0F).unwrap_err();
    assert_eq!(error, PlanError::OutsideLimits { axis: AxisNumber::ARM[2], side: LimitSide::Plus });
}

#[test]
fn a_line_is_straight_and_turns_the_tool() {
    let start = axes([30.0, 60.0, -20.0, 0.0]);
    let from = forward(scara(), &start, &Frame::identity());
    let to =
        Pose { x: from.x + 100.0, y: from.y - 150.0, z: from.z - 30.0, u: from.u + 90.0, v: 7.0, w: 8.0 };
    let movement = moved(scara(), &start, MoveTarget::Line(to), 0x3F).unwrap();
    for n in 0..=100 {
        let pose = movement.state_at(movement.duration() * f64::from(n) / 100.0).pose;
        let part = (pose.z - from.z) / -30.0;
        assert!((pose.x - from.x - 100.0 * part).abs() < 0.01, "{pose:?}");
        assert!((pose.y - from.y + 150.0 * part).abs() < 0.01, "{pose:?}");
        assert!((pose.u - from.u - 90.0 * part).abs() < 0.01, "{pose:?}");
        assert_eq!((pose.v, pose.w), (0.0, 0.0));
    }
    close(&forward(scara(), &end(&movement), &Frame::identity()), [to.x, to.y, to.z, to.u, 0.0, 0.0]);
}

#[test]
fn a_line_without_u_keeps_the_turn() {
    let start = axes([100.0, 200.0, -300.0, 45.0]);
    let to = Pose { x: 300.0, y: 250.0, z: -100.0, u: -90.0, v: 0.0, w: 0.0 };
    let movement = moved(cartesian(), &start, MoveTarget::Line(to), 0x07).unwrap();
    close(&forward(cartesian(), &end(&movement), &Frame::identity()), [300.0, 250.0, -100.0, 45.0, 0.0, 0.0]);
}

#[test]
fn a_machine_of_three_axes_takes_any_u() {
    let text = include_str!("../../models/GENERIC-CARTESIAN.toml");
    let (three, _) = text.split_once("[[axis]] # A").unwrap();
    let model = RobotModel::from_toml(three).unwrap();
    assert_eq!(model.axis_count(), 3);
    let pose = Pose { x: 10.0, y: 20.0, z: -30.0, u: 77.0, v: 1.0, w: 2.0 };
    let found = inverse(&model, &pose, &Frame::identity(), &Axes::ZERO).unwrap();
    assert_eq!(found.degrees(), &[10.0, 20.0, -30.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let movement = moved(&model, &Axes::ZERO, MoveTarget::Line(pose), 0x3F).unwrap();
    assert_eq!(end(&movement).arm(), found.arm());
}

#[test]
fn tool_and_work_frame_count_on_four_axes_too() {
    let tool = Frame::at(&Pose { x: 50.0, w: 20.0, ..Pose::default() }).unwrap();
    let work = Frame::at(&Pose { x: 300.0, w: 90.0, ..Pose::default() }).unwrap();
    let shown = world(scara(), &Axes::ZERO, &Frames { tool, work });
    close(&shown, [0.0, -350.0, 300.0, -70.0, 0.0, 0.0]);
    let order = Move {
        target: MoveTarget::Line(Pose { x: 30.0, y: -300.0, z: 250.0, u: -60.0, v: 0.0, w: 0.0 }),
        mask: MoveMask(0x0F),
        speed: MoveSpeed::PercentOfMax(10.0),
        delay: 0.0,
    };
    let frames = Frames { tool, work };
    let conditions = Conditions { global: 1.0, ramps: Ramps::default(), frames, turning: Turning::Shortest };
    let start = axes([10.0, 50.0, -10.0, 0.0]);
    let movement = Movement::plan(scara(), &start, &order, &conditions).unwrap();
    close(&world(scara(), &end(&movement), &frames), [30.0, -300.0, 250.0, -60.0, 0.0, 0.0]);
}

#[test]
fn a_tilted_tool_stays_tilted() {
    let tool = Frame::at(&Pose { z: -100.0, u: 40.0, ..Pose::default() }).unwrap();
    let stands = axes([15.0, 60.0, -20.0, 5.0]);
    let pose = forward(scara(), &stands, &tool);
    let found = inverse(scara(), &pose, &tool, &stands).unwrap();
    for (found, stood) in found.degrees().iter().zip(stands.degrees()) {
        assert!((found - stood).abs() < 1e-9, "{found} {stood}");
    }
}

#[test]
fn a_bench_that_is_tilted_is_out_of_reach_for_an_upright_tool() {
    let frames =
        Frames { tool: Frame::identity(), work: Frame::at(&Pose { u: 20.0, ..Pose::default() }).unwrap() };
    let start = axes([10.0, 50.0, -10.0, 0.0]);
    let from = world(scara(), &start, &frames);
    let line = |mask| {
        let target = MoveTarget::Line(Pose { x: from.x - 5.0, u: from.u + 5.0, ..from });
        let order = Move { target, mask: MoveMask(mask), speed: MoveSpeed::PercentOfMax(10.0), delay: 0.0 };
        let conditions =
            Conditions { global: 1.0, ramps: Ramps::default(), frames, turning: Turning::Shortest };
        Movement::plan(scara(), &start, &order, &conditions)
    };
    assert_eq!(line(0x0F).unwrap_err(), PlanError::Unreachable);
    assert!(line(0x07).is_ok());
}
