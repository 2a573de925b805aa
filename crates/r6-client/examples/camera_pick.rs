//! Acts as the camera of a cell: answers photo requests, and sends the points it found, while a taught
//! program picks.
//!
//! `cargo run -p r6-client --example camera_pick -- 127.0.0.1:9760`. On the virtual controller, `r6 sim
//! --program pick-and-place` picks. It puts a part down once X010 signals that the belt has room: `r6 panel
//! input X010 on`. **Points move the arm**: read docs/SAFETY.md first.

mod ending;

use std::collections::VecDeque;
use std::error::Error;
use std::process::ExitCode;

use r6_client::{PhotosEnded, Point, Robot, RobotSettings, Shot};

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
        ended = run(&robot, parts()) => return Err(ended.into()),
        // Without a camera the program finishes its present part, then waits.
        () = ending::told_to_end() => println!("the camera is switched off"),
    }
    robot.close().await;
    Ok(())
}

/// The parts in each picture that the camera will see. A real camera would take pictures.
pub fn parts() -> VecDeque<Vec<Point>> {
    let part = |x: f64, y: f64| Point {
        x,
        y,
        z: Some(440.0),
        u: Some(180.0),
        v: Some(0.0),
        angle: Some(0.0),
        ..Point::default()
    };
    [vec![part(360.0, -80.0), part(330.0, -40.0)], vec![], vec![part(380.0, 0.0)]].into()
}

/// Serves photos until that is no longer possible.
pub async fn run(robot: &Robot, mut pictures: VecDeque<Vec<Point>>) -> PhotosEnded {
    loop {
        // This also runs after a lost connection: reading the state allows points to be sent again.
        match robot.status().await {
            Ok(status) => {
                for unmet in status.unmet() {
                    println!("the program does not run, perhaps: {unmet}");
                }
            }
            Err(error) => return PhotosEnded::Request { cam_id: 0, error },
        }
        println!("waiting for a program that asks for a photo");
        let ended = robot
            .serve_photos(|cam_id| {
                let seen = pictures.pop_front().unwrap_or_default();
                println!("camera {cam_id}: {} parts", seen.len());
                async move { Shot::Points(seen) }
            })
            .await;
        println!("{ended}");
        match ended {
            PhotosEnded::ConnectionLost(_) | PhotosEnded::FellBehind { .. } => {}
            PhotosEnded::Stopped
            | PhotosEnded::Closed
            | PhotosEnded::ServedAlready
            | PhotosEnded::Request { .. } => return ended,
        }
    }
}
