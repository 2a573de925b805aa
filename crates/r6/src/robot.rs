//! Which robot a command is for, and the connection to it.

use clap::Args;
use r6_client::{RequestError, Robot, RobotSettings};

use crate::exit::{Exit, Failure};
use crate::output::problem::Code;
use crate::waiting;

/// Which robot a command is for.
#[derive(Debug, Args)]
pub struct RobotArgs {
    /// The controller
    #[arg(
        short,
        long,
        global = true,
        value_name = "HOST[:PORT]",
        env = "R6_ROBOT",
        hide_env_values = true,
        default_value = "127.0.0.1:9760",
        help_heading = "Global options"
    )]
    robot: String,
}

/// How robots are talked to.
pub fn settings() -> RobotSettings {
    RobotSettings::default()
}

impl RobotArgs {
    /// The controller, as it was given.
    pub fn address(&self) -> &str {
        &self.robot
    }

    /// Connects to it.
    pub async fn connect(&self) -> Result<Robot, RequestError> {
        let connecting = Robot::connect(&self.robot, settings());
        waiting::told(&format!("connecting to {}", self.robot), connecting).await
    }

    /// As [`Self::with`], for what a controller answers at once: an answer that does not come is said to be waited for.
    pub async fn ask<T>(&self, work: impl AsyncFnOnce(&Robot) -> Result<T, Failure>) -> Result<T, Failure> {
        let waiting = format!("waiting for an answer of {}", self.robot);
        self.with(async |robot| waiting::told(&waiting, work(robot)).await).await
    }

    /// Does something with the robot on one connection, which is closed properly whatever comes of it: controllers
    /// have few connections, and a half-open one can keep their port busy.
    pub async fn with<T>(&self, work: impl AsyncFnOnce(&Robot) -> Result<T, Failure>) -> Result<T, Failure> {
        let robot = self.connect().await?;
        let result = work(&robot).await.map_err(|failure| told_of(&robot, failure));
        robot.close().await;
        result
    }
}

/// Whether the controller took the connection and never answered anything on it. That looks as if it were dead, but a controller
/// all of whose connections are in use does it, too.
pub fn is_mute(robot: &Robot) -> bool {
    let link = robot.link_quality();
    link.requests > 0 && link.replies == 0 && link.strays == 0 && link.garbled == 0
}

/// The same failure of a robot that was connected: with what to do where nothing ever answered, and without the advice to start one.
pub fn told_of(robot: &Robot, failure: Failure) -> Failure {
    let failure = if failure.code() == Code::Unreachable { failure.without_advice() } else { failure };
    let is_silence = matches!(failure.exit(), Exit::NoReply | Exit::Unknown);
    if is_silence && is_mute(robot) { failure.unanswered() } else { failure }
}
