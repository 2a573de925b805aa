//! Follows a moving target, 20 times a second. Ctrl-C or SIGTERM stops the arm.
//!
//! `cargo run -p r6-client --example follow_target -- 127.0.0.1:9760`. Add `--while-moving` for closer
//! following. **The arm moves**: J1 follows a target that sways by ±15° around its present position. Read
//! docs/SAFETY.md first.
//!
//! The protocol has no command for following: replacing the list of a moving arm raises an alarm, and small
//! steps without a pause have overloaded the servos of a real arm (reported). So each step is slow, at least
//! 1° and at most 10°, and by default it is sent only while the arm stands. The newest target counts; those
//! in between are skipped. The example prints how far the arm is behind.

mod ending;

use std::error::Error;
use std::process::ExitCode;
use std::time::Duration;

use r6_client::units::AxisPosition;
use r6_client::{AxisIndex, FollowOptions, Followed, Robot, RobotSettings, TargetSender};
use tokio::time::{Instant, interval};

/// Targets per second.
const RATE: u32 = 20;

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
    let mut address = "127.0.0.1:9760".to_owned();
    let mut while_moving = false;
    for argument in std::env::args().skip(1) {
        match argument.as_str() {
            "--while-moving" => while_moving = true,
            other => other.clone_into(&mut address),
        }
    }
    let robot = Robot::connect(&address, RobotSettings::default()).await?;
    tokio::select! {
        result = run(&robot, Duration::from_secs(20), while_moving) => { result?; }
        () = ending::told_to_end() => println!("{}", robot.stop().await?),
    }
    robot.close().await;
    Ok(())
}

/// Follows for this time, until the target has stood still for two seconds.
pub async fn run(robot: &Robot, time: Duration, while_moving: bool) -> Result<Followed, Box<dyn Error>> {
    let first = AxisIndex::ALL[0];
    let status = robot.status().await?;
    let [Some(middle), ..] = status.axes else { return Err("J1 cannot be read".into()) };
    let (target, targets) = TargetSender::new();

    // The position of the target: in a cell, a camera or a conveyor reports it. The source keeps sending when
    // nothing changes, because the client does not follow a target older than half a second.
    let source = async move {
        let begun = Instant::now();
        let mut tick = interval(Duration::from_secs(1) / RATE);
        while begun.elapsed() < time + Duration::from_secs(2) {
            tick.tick().await;
            let seconds = begun.elapsed().min(time).as_secs_f64();
            let sway = 15.0 * (seconds * std::f64::consts::TAU / 10.0).sin();
            target.send(AxisPosition::degrees([middle + sway]));
        }
        // The sender is dropped here: the arm makes its last step, and the following ends.
    };
    let watching = async {
        let Ok(mut seen) = robot.subscribe(&[r6_client::Address::Axis(first)], Duration::from_millis(500))
        else {
            return;
        };
        while let Some(snapshot) = seen.next().await {
            println!("{first}: {:?}", snapshot.fresh(r6_client::Address::Axis(first)));
        }
    };
    let options = FollowOptions { while_moving, ..FollowOptions::default() };
    let following = async { tokio::join!(robot.follow(targets, options), source).0 };
    let followed = tokio::select! {
        followed = following => followed?,
        () = watching => return Err("the handle was closed".into()),
    };
    let behind = followed.behind.map_or("not known how far".to_owned(), |behind| format!("{behind:.2}"));
    println!("{} steps, {behind} from the last target", followed.steps);
    Ok(followed)
}
