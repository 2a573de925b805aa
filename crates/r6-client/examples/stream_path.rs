//! Streams a path of 500 points without a pause between lists, and prints the progress. Ctrl-C or SIGTERM
//! stops the arm.
//!
//! `cargo run -p r6-client --example stream_path -- 127.0.0.1:9760`. **The arm moves**: J1 sways by ±20°
//! around its present position, and J5 and J6 with it: read docs/SAFETY.md first.

mod ending;

use std::error::Error;
use std::process::ExitCode;

use r6_client::units::{AxisPosition, Percent};
use r6_client::{Done, Motion, Robot, RobotSettings, RunOptions};

/// The number of points of the path. The controller takes eight at a time; the client splits the path.
pub const POINTS: u32 = 500;

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
    let address = std::env::args().nth(1).unwrap_or_else(|| "127.0.0.1:9760".to_owned());
    let robot = Robot::connect(&address, RobotSettings::default()).await?;
    tokio::select! {
        result = run(&robot) => { result?; }
        () = ending::told_to_end() => println!("{}", robot.stop().await?),
    }
    robot.close().await;
    Ok(())
}

/// The path from a start position: a wave that begins and ends there.
pub fn path(from: [f64; 6]) -> Vec<[f64; 6]> {
    (1..=POINTS)
        .map(|n| {
            let turn = std::f64::consts::TAU * f64::from(n) / f64::from(POINTS);
            let mut point = from;
            point[0] += 20.0 * (3.0 * turn).sin();
            point[4] += 10.0 * (5.0 * turn).sin();
            point[5] += 15.0 * (1.0 - turn.cos());
            point
        })
        .collect()
}

/// Streams the path. Returns where it should end, and where it ended.
pub async fn run(robot: &Robot) -> Result<([f64; 6], Done), Box<dyn Error>> {
    let status = robot.status().await?;
    let mut from = [0.0; 6];
    for (slot, axis) in from.iter_mut().zip(status.axes) {
        *slot = axis.ok_or("not all axes can be read")?;
    }
    let points = path(from);
    let speed = Percent::new(50.0)?;
    let motion = points
        .iter()
        .fold(Motion::new(), |motion, point| motion.axis_move(AxisPosition::degrees(*point), speed).blend(5));

    // `run` checks every step and reads the state of the machine first. If it is not ready, the error says
    // what to do.
    let handle = robot.run(&motion, RunOptions::default()).await?;
    let mut progress = handle.watch();
    let telling = async move {
        let mut told = 0;
        while progress.changed().await.is_ok() {
            let now = *progress.borrow();
            if now.done >= told + 50 {
                told = now.done;
                println!("{} of {} done, {} in the controller's list", now.done, now.total, now.under_way());
            }
        }
    };
    let (done, ()) = tokio::join!(handle.finished(), telling);
    // The error says at which step the motion failed, what was sent and not seen done, and what happened to
    // the arm.
    let done = done?;
    let end = points.last().copied().unwrap_or(from);
    let error = done.axes.iter().zip(end).filter_map(|(at, end)| Some((at.as_ref()? - end).abs()));
    println!(
        "the end, {:.4} deg from where it should be, after {:.1} s",
        error.fold(0.0, f64::max),
        done.took.as_secs_f64()
    );
    Ok((end, done))
}
