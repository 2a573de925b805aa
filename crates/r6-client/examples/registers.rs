//! Writes registers, reads them back, and lets a taught program move to them: the other way in which PCs move
//! these arms.
//!
//! `cargo run -p r6-client --example registers -- 127.0.0.1:9760`. The controller needs a program that, on a
//! pulse of M011, moves to registers 800 to 805 in degrees × 1000; `r6 sim --program register-move` runs one.
//! **The arm moves**, as fast as that program says: read docs/SAFETY.md first.

mod ending;

use std::error::Error;
use std::process::ExitCode;

use r6_client::{
    Address, AxisIndex, Keep, RegisterIndex, Robot, RobotSettings, WaitOptions, from_thousandths,
    to_thousandths,
};

/// The program begins at a pulse of this point.
const START: &str = "M011";

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
        result = run(&robot, [10.0, -5.5, 7.25, 0.0, 30.0, 0.0]) => { result?; }
        () = ending::told_to_end() => println!("{}", robot.stop().await?),
    }
    robot.close().await;
    Ok(())
}

/// Makes the program move to the target. Returns the registers as they were read back.
pub async fn run(robot: &Robot, target: [f64; 6]) -> Result<Vec<i64>, Box<dyn Error>> {
    let status = robot.status().await?;
    if !status.is_ready() {
        let unmet: Vec<String> = status.unmet().iter().map(ToString::to_string).collect();
        return Err(format!("the robot is not READY:\n  {}", unmet.join("\n  ")).into());
    }
    let first = RegisterIndex::new(800).ok_or("registers are 800 to 900")?;
    let values = target.iter().map(|degrees| to_thousandths(*degrees)).collect::<Result<Vec<_>, _>>()?;
    // An ok proves nothing: controllers accepted text with commas in it. So each value is read back and
    // compared.
    robot.write_registers(first, &values, Keep::UntilPowerCut).await?;
    let read = robot.read_registers(first, values.len()).await?;
    for (number, value) in (first.number()..).zip(&read) {
        println!("register {number}: {value}, which is {} deg", from_thousandths(*value));
    }

    let start = START.parse()?;
    for on in [true, false] {
        robot.set_output(start, on).await?;
    }
    // The program moves on its own. So the result is read from the state, not from the ok.
    let done = robot.wait_until_done(WaitOptions::default()).await?;
    for (axis, wanted) in AxisIndex::ALL.into_iter().zip(target) {
        let found = done.axes[axis.index()];
        if found.is_none_or(|found| (found - wanted).abs() > 0.01) {
            let running = robot.query(&[Address::CurMold]).await?;
            let program = running.text(Address::CurMold).unwrap_or("another one");
            return Err(format!(
                "{axis} is at {found:?}, not at {wanted}: does the program ({program}) move to registers 800 to 805?"
            )
            .into());
        }
    }
    println!("the arm stands at {:?}", &done.axes[..6]);
    Ok(read)
}
