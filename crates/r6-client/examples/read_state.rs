//! Reads the state of a robot, prints what keeps it from moving, and then watches some values.
//!
//! `cargo run -p r6-client --example read_state -- 127.0.0.1:9760`; nothing moves.

use std::error::Error;
use std::process::ExitCode;
use std::time::Duration;

use r6_client::{Address, AxisIndex, Quality, Robot, RobotSettings, Status};

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
    run(&robot, 20).await?;
    robot.close().await;
    Ok(())
}

/// Prints the state once, then `updates` changes of it. Returns the state read first, and how many values
/// were fresh.
pub async fn run(robot: &Robot, updates: usize) -> Result<(Status, usize), Box<dyn Error>> {
    let status = robot.status().await?;
    println!("{} with {}", told(&status.machine_name), told(&status.firmware));
    let mode = status.mode.map(|mode| mode.to_string());
    println!("mode {}, alarm {:?}, homed {:?}", told(&mode), status.alarm, status.homed);
    for (axis, degrees) in AxisIndex::ALL.into_iter().zip(status.axes) {
        if let Some(degrees) = degrees {
            println!("  {axis} {degrees:9.3}");
        }
    }
    if status.is_ready() {
        println!("all that can be read is met; no value tells whether the program waits for instructions");
    }
    for unmet in status.unmet() {
        println!("not ready: {unmet}");
    }

    // One poller serves all subscriptions of a program. Each value comes with its age.
    let axis = Address::Axis(AxisIndex::ALL[0]);
    let watched = [axis, Address::CurMode, Address::CurAlarm, Address::CurMold];
    let mut subscription = robot.subscribe(&watched, Duration::from_millis(50))?;
    let mut fresh = 0;
    for _ in 0..updates {
        let Some(snapshot) = subscription.next().await else { break };
        for value in snapshot.values() {
            let age = value.age.unwrap_or_default().as_millis();
            match (&value.reading, &value.quality) {
                (Some(reading), Quality::Fresh) => {
                    fresh += 1;
                    println!("{}: {reading:?}, {age} ms old", value.address);
                }
                // A screen may show stale values, but a program must not act on them.
                (reading, quality) => println!("{}: {quality:?}, last {reading:?}", value.address),
            }
        }
    }
    println!("{}", robot.link_quality());
    Ok((status, fresh))
}

fn told(text: &Option<String>) -> &str {
    text.as_deref().unwrap_or("?")
}
