//! Random axes of each model, their pose, and all solutions for it, for comparison by
//! `tools/oracles/kinematics`.
//!
//! `cargo run --release --package r6-motion --example poses 10000` prints, for each model and each of 10 000
//! random axis positions within the soft limits, one line
//!
//! ```text
//! pose NAME J1 … Jn X Y Z U V W
//! ```
//!
//! and one line `back J1 … Jn` for each solution of the inverse kinematics.

use r6_motion::kinematics::{all_solutions, forward};
use r6_motion::{Axes, Frame, RobotModel};

#[path = "../tests/kinematics/common.rs"]
mod common;

use common::Numbers;

fn main() {
    let poses = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(100_u32);
    let mut numbers = Numbers(1);
    let tool = Frame::identity();
    for model in RobotModel::names().filter_map(RobotModel::named) {
        for _ in 0..poses {
            let (stands, near) = (numbers.axes(model), numbers.axes(model));
            let pose = forward(model, &stands, &tool);
            println!("pose {} {} {}", model.name, text(model, &stands), join(&pose.components()));
            for solution in all_solutions(model, &pose, &tool, &near) {
                println!("back {}", text(model, &solution));
            }
        }
    }
}

fn text(model: &RobotModel, axes: &Axes) -> String {
    let own: Vec<_> = axes.degrees().iter().take(model.axis_count()).copied().collect();
    join(&own)
}

fn join(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}
