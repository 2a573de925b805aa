//! Linear moves of every model, from plan to pose.

use r6_motion::kinematics::forward;
use r6_motion::{
    Conditions, Frame, Frames, Move, MoveMask, MoveSpeed, MoveTarget, Movement, Pose, Ramps, RobotModel,
    Turning,
};

use crate::common::{Numbers, apart, model};

/// How many lines to try on each model.
const LINES: usize = 300;

#[test]
fn every_model_draws_straight_lines() {
    for name in RobotModel::names() {
        let (model, mut numbers) = (model(name), Numbers(17));
        let conditions = Conditions {
            global: 1.0,
            ramps: Ramps::default(),
            frames: Frames::default(),
            turning: Turning::Shortest,
        };
        let mut drawn = 0;
        for _ in 0..LINES {
            let start = numbers.axes(model);
            let from = forward(model, &start, &Frame::identity());
            let [x, y, z] = [from.x, from.y, from.z].map(|at| at + 60.0 * numbers.part() - 30.0);
            let to = Pose { x, y, z, ..from };
            let order = Move {
                target: MoveTarget::Line(to),
                mask: MoveMask::SIX,
                speed: MoveSpeed::PercentOfMax(20.0),
                delay: 0.0,
            };
            // Some cannot be planned because of limits and singular wrists.
            let Ok(movement) = Movement::plan(model, &start, &order, &conditions) else { continue };
            drawn += 1;
            let wanted = to.to_isometry().unwrap();
            for n in 0..=20 {
                let state = movement.state_at(movement.duration() * f64::from(n) / 20.0);
                let place = state.pose.to_isometry().unwrap();
                let begun = place.translation.vector - from.to_isometry().unwrap().translation.vector;
                let whole = wanted.translation.vector - from.to_isometry().unwrap().translation.vector;
                let off = begun - whole * (begun.dot(&whole) / whole.norm_squared());
                assert!(off.norm() < 0.01, "{name}: {} mm beside the line", off.norm());
                assert_eq!(model.outside_limits(&state.axes), None, "{name}");
            }
            let there = movement.state_at(movement.duration()).pose.to_isometry().unwrap();
            let (place, turn) = apart(&there, &wanted);
            assert!(place < 1e-6 && turn < 1e-6, "{name}: {place} mm, {turn} degrees");
        }
        println!("{name}: {drawn} of {LINES} lines");
        assert!(drawn > LINES / 3, "{name}: {drawn} of {LINES}");
    }
}
