//! Moves the axes to a position and back, within an envelope. Ctrl-C or SIGTERM stops the arm.
//!
//! `cargo run -p r6-client --example move_axes -- 127.0.0.1:9760 20 0 -10 0 30 0`: the target, in degrees.
//! **The arm moves**, at 20 % of its speed times the global speed: read docs/SAFETY.md first.

mod ending;

use std::error::Error;
use std::process::ExitCode;

use r6_client::units::{AxisPosition, Degrees, Percent};
use r6_client::{Done, Envelope, Motion, Robot, RobotSettings, RunOptions};

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    match start().await {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

async fn start() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let address = arguments.next().unwrap_or_else(|| "127.0.0.1:9760".to_owned());
    let mut target = [20.0, 0.0, -10.0, 0.0, 30.0, 0.0];
    for (slot, argument) in target.iter_mut().zip(arguments) {
        *slot = argument.parse()?;
    }
    let robot = Robot::connect(&address, RobotSettings::default()).await?;
    tokio::select! {
        result = run(&robot, target) => { result?; }
        // The future of the motion is dropped here. Without the stop, the arm would finish what is in its
        // list.
        () = ending::told_to_end() => println!("{}", robot.stop().await?),
    }
    robot.close().await;
    Ok(())
}

/// Moves to the target and back. Returns where the arm stood at both ends.
pub async fn run(robot: &Robot, target: [f64; 6]) -> Result<[Done; 2], Box<dyn Error>> {
    let status = robot.status().await?;
    if !status.is_ready() {
        // A person has to do these steps. A program that clears alarms by itself would hide why they came.
        let unmet: Vec<String> = status.unmet().iter().map(ToString::to_string).collect();
        return Err(format!("the robot is not READY:\n  {}", unmet.join("\n  ")).into());
    }
    let mut home = [0.0; 6];
    for (slot, axis) in home.iter_mut().zip(status.axes) {
        *slot = axis.ok_or("not all axes can be read")?;
    }

    // Everything sent through this handle is checked against the envelope first.
    let envelope = Envelope::new().speed_cap(Percent::new(30.0)?).largest_axis_step(Degrees(90.0));
    let robot = robot.with_guard(envelope);
    let speed = Percent::new(20.0)?;
    let mut ends = Vec::new();
    for (name, axes) in [("there", target), ("back", home)] {
        let motion = Motion::new().axis_move(AxisPosition::degrees(axes), speed);
        let handle = robot.run(&motion, RunOptions::default()).await?;
        let done = handle.finished().await?;
        println!("{name}: at {:?} after {:.1} s", &done.axes[..6], done.took.as_secs_f64());
        ends.push(done);
    }
    ends.try_into().map_err(|_| "two ends".into())
}
