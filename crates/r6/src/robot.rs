//! Which robot a command is for, and the connection to it.

use clap::Args;
use r6_client::{RequestError, Robot, RobotSettings};

use crate::exit::Failure;

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
        Robot::connect(&self.robot, settings()).await
    }

    /// Does something with the robot on one connection, which is closed properly whatever comes of it: controllers
    /// have few connections, and a half-open one can keep their port busy.
    pub async fn with<T>(&self, work: impl AsyncFnOnce(&Robot) -> Result<T, Failure>) -> Result<T, Failure> {
        let robot = self.connect().await?;
        let result = work(&robot).await;
        robot.close().await;
        result
    }
}
