//! Two robots of one cell: they move at the same time and wait for each other after each move. If one fails,
//! both are stopped.
//!
//! `cargo run -p r6-client --example two_robots -- 127.0.0.1:9760 127.0.0.1:9761`; `r6 sim --count 2` starts
//! two virtual controllers at these addresses. **Both arms move**: J1 by 15° and back, J5 by 10°. This
//! example does not keep the two arms out of each other's way: read docs/SAFETY.md first.

mod ending;

use std::error::Error;
use std::process::ExitCode;

use r6_client::units::{AxisPosition, Percent};
use r6_client::{AxisIndex, Motion, MotionError, Robot, RobotSettings, RunOptions};

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
    let mut addresses = std::env::args().skip(1);
    let left = addresses.next().unwrap_or_else(|| "127.0.0.1:9760".to_owned());
    let right = addresses.next().unwrap_or_else(|| "127.0.0.1:9761".to_owned());
    let connect = |address: String| async move { Robot::connect(&address, RobotSettings::default()).await };
    let (left, right) = tokio::try_join!(connect(left), connect(right))?;
    tokio::select! {
        result = run(&left, &right) => result?,
        () = ending::told_to_end() => stop_both(&left, &right).await,
    }
    tokio::join!(left.close(), right.close());
    Ok(())
}

/// Makes three moves with both arms. Each move begins only when both arms stand.
pub async fn run(left: &Robot, right: &Robot) -> Result<(), Box<dyn Error>> {
    for robot in [left, right] {
        let status = robot.status().await?;
        if !status.is_ready() {
            let unmet: Vec<String> = status.unmet().iter().map(ToString::to_string).collect();
            return Err(format!("{} is not READY: {}", robot.address(), unmet.join("; ")).into());
        }
    }
    let from = (standing(left).await?, standing(right).await?);
    for (j1, j5) in [(15.0, 10.0), (-15.0, 0.0), (0.0, 0.0)] {
        // `try_join` drops both futures as soon as one fails. The other arm would finish its list.
        let moves = tokio::try_join!(move_by(left, from.0, j1, j5), move_by(right, from.1, -j1, j5));
        if let Err(error) = moves {
            stop_both(left, right).await;
            return Err(error.into());
        }
        println!("both stand");
    }
    Ok(())
}

/// The position of J1 and J5 of a standing arm.
async fn standing(robot: &Robot) -> Result<[f64; 2], Box<dyn Error>> {
    let axes = robot.status().await?.axes;
    match (axes[0], axes[4]) {
        (Some(j1), Some(j5)) => Ok([j1, j5]),
        _ => Err(format!("{}: J1 and J5 cannot be read", robot.address()).into()),
    }
}

async fn move_by(robot: &Robot, from: [f64; 2], j1: f64, j5: f64) -> Result<(), MotionError> {
    use r6_client::units::Degrees;
    let to = AxisPosition::none()
        .with(AxisIndex::ALL[0], Degrees(from[0] + j1))
        .with(AxisIndex::ALL[4], Degrees(from[1] + j5));
    let speed = Percent::new(30.0).unwrap_or(Percent::MAX);
    let handle = robot.run(&Motion::new().axis_move(to, speed), RunOptions::default()).await?;
    let done = handle.finished().await?;
    println!("{}: J1 at {:?}", robot.address(), done.axes[0]);
    Ok(())
}

async fn stop_both(left: &Robot, right: &Robot) {
    let (first, second) = tokio::join!(left.stop(), right.stop());
    for (robot, stopped) in [(left, first), (right, second)] {
        match stopped {
            Ok(report) => println!("{}: {report}", robot.address()),
            Err(error) => println!("{}: {error}", robot.address()),
        }
    }
}
