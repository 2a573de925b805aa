//! The ten lines of the README: they print what keeps the robot from moving, and move it.
//!
//! `cargo run -p r6-client --example ten_lines -- 127.0.0.1`. **The arm moves**: read docs/SAFETY.md first.

use r6_client::blocking::Robot;
use r6_client::units::{AxisPosition, Percent};
use r6_client::{Motion, RobotSettings, RunOptions};

/// Says what keeps the robot from moving, and moves it.
pub fn ten_lines(address: &str) -> Result<(), Box<dyn std::error::Error>> {
    let robot = Robot::connect(address, RobotSettings::default())?;
    for unmet in robot.status()?.unmet() {
        println!("not ready: {unmet}");
    }
    let target = AxisPosition::degrees([10.0, 0.0, 0.0, 0.0, 30.0, 0.0]);
    let motion = Motion::new().axis_move(target, Percent::new(20.0)?);
    let done = robot.run(&motion, RunOptions::default())?.finished()?;
    println!("J1 {:?}, J5 {:?}", done.axes[0], done.axes[4]);
    Ok(())
}

fn main() -> std::process::ExitCode {
    let address = std::env::args().nth(1).unwrap_or_else(|| "127.0.0.1".to_owned());
    match ten_lines(&address) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            std::process::ExitCode::FAILURE
        }
    }
}
