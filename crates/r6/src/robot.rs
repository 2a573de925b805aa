//! Which robot a command is for, and the connection to it.

use std::sync::OnceLock;

use clap::Args;
use r6_client::{RequestError, Robot, RobotSettings};
use r6_proto::dialect::DsIdForm;
use r6_proto::message::TypeKey;

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
    /// The key of a request's type, for firmware that wants another one
    #[arg(
        long,
        global = true,
        value_name = "KEY",
        value_parser = ["reqType", "cmdType"],
        default_value = "reqType",
        hide_possible_values = true,
        help_heading = "Global options"
    )]
    type_key: String,
    /// The form of `dsID`, for older firmware: long or short (HCRemoteMonitor)
    #[arg(
        long,
        global = true,
        value_name = "FORM",
        value_parser = ["long", "short"],
        default_value = "long",
        hide_possible_values = true,
        help_heading = "Global options"
    )]
    ds_id: String,
}

/// The settings of this run of r6, once the command line is read.
static SETTINGS: OnceLock<RobotSettings> = OnceLock::new();

/// The settings of every connection to a robot.
pub fn settings() -> RobotSettings {
    SETTINGS.get().cloned().unwrap_or_default()
}

impl RobotArgs {
    /// Keeps what the command line says of the wire, for [`settings`].
    pub fn remember(&self) {
        let type_key = if self.type_key == "cmdType" { TypeKey::CmdType } else { TypeKey::ReqType };
        let ds_id = if self.ds_id == "short" { DsIdForm::Short } else { DsIdForm::Long };
        // The first call counts, and there is no second.
        let _ = SETTINGS.set(RobotSettings { type_key, ds_id, ..RobotSettings::default() });
    }

    /// The options that say how requests are written, as they have to be typed again; empty without any.
    pub fn wire_options(&self) -> String {
        let type_key = if self.type_key == "cmdType" { " --type-key cmdType" } else { "" };
        let ds_id = if self.ds_id == "short" { " --ds-id short" } else { "" };
        format!("{type_key}{ds_id}")
    }

    /// The address of the controller, as the user gave it.
    pub fn address(&self) -> &str {
        &self.robot
    }

    /// Connects to the controller.
    pub async fn connect(&self) -> Result<Robot, RequestError> {
        let connecting = Robot::connect(&self.robot, settings());
        waiting::told(&format!("connecting to {}", self.robot), connecting).await
    }

    /// Does what [`Self::with`] does, for work that a controller answers at once. If the answer is late,
    /// stderr says that r6 waits for it.
    pub async fn ask<T>(&self, work: impl AsyncFnOnce(&Robot) -> Result<T, Failure>) -> Result<T, Failure> {
        let waiting = format!("waiting for an answer of {}", self.robot);
        self.with(async |robot| waiting::told(&waiting, work(robot)).await).await
    }

    /// Runs `work` with the robot on one connection and always closes the connection properly. Controllers
    /// have few connections, and a half-open one can keep their port busy.
    pub async fn with<T>(&self, work: impl AsyncFnOnce(&Robot) -> Result<T, Failure>) -> Result<T, Failure> {
        let robot = self.connect().await?;
        let result = work(&robot).await.map_err(|failure| told_of(&robot, failure));
        robot.close().await;
        result
    }
}

/// Whether the controller accepted the connection and never answered on it. The controller may be dead, or
/// all its connections may be in use.
pub fn is_mute(robot: &Robot) -> bool {
    let link = robot.link_quality();
    link.requests > 0 && link.replies == 0 && link.strays == 0 && link.garbled == 0
}

/// Adapts the advice of a failure after the connection was made. It adds what to do if the controller never
/// answered, and removes the advice to start a controller.
pub fn told_of(robot: &Robot, failure: Failure) -> Failure {
    let failure = if failure.code() == Code::Unreachable { failure.without_advice() } else { failure };
    let is_silence = matches!(failure.exit(), Exit::NoReply | Exit::Unknown);
    if is_silence && is_mute(robot) { failure.unanswered() } else { failure }
}
