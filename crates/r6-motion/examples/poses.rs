//! Random axes of each model, the pose they make, and every way back: what `tools/oracles/kinematics` compares.
//!
//! `cargo run --release --package r6-motion --example poses 10000` prints, for each model and each of 10 000 random
//! axis positions within the soft limits, one line
//!
//! ```text
//! pose NAME J1 … Jn X Y Z U V W
//! ```
//!
//! and one line `back J1 … Jn` for each solution of the inverse kinematics.

use r6_motion::kinematics::{all_solutions, forward};
use r6_motion::{Axes, Frame, RobotModel};

fn main() {
    let poses = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(100_u32);
    let mut seed = 1_u64;
    let tool = Frame::identity();
    for model in RobotModel::names().filter_map(RobotModel::named) {
        for _ in 0..poses {
            let (stands, near) = (random(model, &mut seed), random(model, &mut seed));
            let pose = forward(model, &stands, &tool);
            println!("pose {} {} {}", model.name, text(model, &stands), join(&pose.components()));
            for solution in all_solutions(model, &pose, &tool, &near) {
                println!("back {}", text(model, &solution));
            }
        }
    }
}

/// Anywhere in the soft limits (splitmix64).
fn random(model: &RobotModel, seed: &mut u64) -> Axes {
    let mut positions = [0.0; 8];
    for (slot, axis) in positions.iter_mut().zip(model.drives()) {
        *seed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = *seed;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        let part = f64::from((z >> 32) as u32) / f64::from(u32::MAX);
        *slot = axis.soft.min + part * (axis.soft.max - axis.soft.min);
    }
    Axes::new(positions).unwrap_or(Axes::ZERO)
}

fn text(model: &RobotModel, axes: &Axes) -> String {
    let own: Vec<_> = axes.degrees().iter().take(model.axis_count()).copied().collect();
    join(&own)
}

fn join(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}
