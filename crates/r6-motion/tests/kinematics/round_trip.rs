//! Inverse kinematics of every model: forward kinematics of the result gives the pose again.

use r6_motion::kinematics::{all_solutions, forward, inverse};
use r6_motion::{Frame, Pose, RobotModel};

use crate::common::{Numbers, apart, model};

/// How many poses to check for each model.
const POSES: usize = 5000;

/// A tool that sticks out sideways, and is tilted if the arm can tilt it.
fn tool(model: &RobotModel) -> Frame {
    let turn = if model.axis_count() == 6 { 30.0 } else { 0.0 };
    Frame::at(&Pose { x: 20.0, y: -35.0, z: 120.0, u: turn, v: -turn, w: 75.0 }).unwrap()
}

#[test]
fn every_solution_of_every_model_is_there() {
    for name in RobotModel::names() {
        let (model, mut numbers) = (model(name), Numbers(11));
        let tool = tool(model);
        let mut found = 0;
        let (mut farthest, mut most_turned) = (0.0_f64, 0.0_f64);
        for _ in 0..POSES {
            let stands = numbers.axes(model);
            let wanted = forward(model, &stands, &tool);
            let near = numbers.axes(model);
            let all = all_solutions(model, &wanted, &tool, &near);
            assert_eq!(
                inverse(model, &wanted, &tool, &near).ok(),
                all.first().copied(),
                "{name}: {stands:?}"
            );
            assert!(!all.is_empty(), "{name}: {stands:?}");
            found += all.len();
            for solution in &all {
                assert_eq!(model.outside_limits(solution), None, "{name}");
                let reached = forward(model, solution, &tool).to_isometry().unwrap();
                let (place, turn) = apart(&reached, &wanted.to_isometry().unwrap());
                farthest = farthest.max(place);
                most_turned = most_turned.max(turn);
            }
        }
        println!("{name}: {found} solutions, at most {farthest:.1e} mm and {most_turned:.1e} degrees away");
        assert!(farthest < 1e-6 && most_turned < 1e-6, "{name}: {farthest} mm, {most_turned} degrees");
    }
}

#[test]
fn the_solution_next_to_where_it_stands_is_where_it_stands() {
    for name in RobotModel::names() {
        let (model, mut numbers) = (model(name), Numbers(13));
        for _ in 0..POSES / 5 {
            let stands = numbers.axes(model);
            let [_, j2, _, _, j5, _] = stands.arm();
            // With a straight wrist or elbow the axes are not unique.
            if (model.axis_count() == 6 && j5.abs() < 0.1) || (name == "GENERIC-SCARA" && j2.abs() < 0.1) {
                continue;
            }
            let wanted = forward(model, &stands, &Frame::identity());
            let found = inverse(model, &wanted, &Frame::identity(), &stands).unwrap();
            for (found, stood) in found.degrees().iter().zip(stands.degrees()) {
                assert!((found - stood).abs() < 1e-5, "{name}: {found} {stood}");
            }
        }
    }
}
