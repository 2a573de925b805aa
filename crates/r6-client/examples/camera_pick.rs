//! Is the camera of a cell: answers photo requests, and pushes the points of what it found, while a taught program picks.
//!
//! `cargo run -p r6-client --example camera_pick -- 127.0.0.1:9760`; on the virtual controller `r6 sim --program pick-and-place` picks
//! (it puts a part down once X010 says that the belt has room: `r6 panel input X010 on`). **Points move the arm**: read
//! docs/SAFETY.md first.

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
        // Without a camera the program waits; it finishes the part that it has.
        () = ending::told_to_end() => println!("the camera is switched off"),
    }
    robot.close().await;
    Ok(())
}

/// What the camera will see: the parts of each picture. A real one would look.
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

/// Serves photos until that cannot go on.
pub async fn run(robot: &Robot, mut pictures: VecDeque<Vec<Point>>) -> PhotosEnded {
    loop {
        // Also after a lost connection: this looks at the machine, which lets points through again.
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
