//! Programs without a robot: their check and their plan.
//!
//! - [`check`]: the mistakes of a text together, and where its steps can run.
//! - [`plan`]: what an arm would do, played on a virtual clock by `r6-plot`. No robot is asked.
//! - [`run`]: the steps of a program that is to be run.
//! - [`bench`]: where they compute, so that they delay nothing else.

pub mod bench;
pub mod check;
pub mod plan;
pub mod run;

use r6_motion::RobotModel;

/// The name of a model as we write it.
///
/// # Errors
/// There is no such model: a sentence with the names of all.
pub fn model(name: &str) -> Result<&'static RobotModel, String> {
    RobotModel::named(name).ok_or_else(|| {
        let name: String = name.chars().take(40).collect();
        let names: Vec<_> = RobotModel::names().collect();
        format!("there is no model `{}`; there are: {}", r6_proto::printable(&name), names.join(", "))
    })
}
