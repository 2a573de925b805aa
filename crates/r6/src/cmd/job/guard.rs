//! Limits that a list is checked against before anything is sent: an envelope from a file and from options.

pub mod file;

use std::path::PathBuf;

use clap::Args;
use r6_client::units::{Degrees, Percent};
use r6_client::{Envelope, Violation};

use crate::cmd::job::guard::file::Limits;
use crate::exit::Failure;
use crate::output::problem::Code;
use crate::units;

/// The limits of a list.
#[derive(Debug, Args)]
pub struct GuardArgs {
    /// Limits of this cell (see `r6 run --help`): if a step exceeds them, nothing is sent
    #[arg(long, value_name = "FILE.toml")]
    guard: Option<PathBuf>,
    /// Refuse a motion with a faster move than this; of --guard and this, the lower counts
    #[arg(long, value_name = "PERCENT", value_parser = units::speed_percent)]
    max_speed: Option<f64>,
    /// Refuse a motion that turns an axis further than this in one axis move; of --guard and this, the lower
    /// counts
    #[arg(long, value_name = "DEGREES", value_parser = units::largest_step)]
    max_axis_step: Option<f64>,
}

impl GuardArgs {
    /// Whether there is a limit.
    pub fn is_given(&self) -> bool {
        self.guard.is_some() || self.max_speed.is_some() || self.max_axis_step.is_some()
    }

    /// The envelope; `None` if there are no limits.
    pub fn envelope(&self) -> Result<Option<Envelope>, Failure> {
        if !self.is_given() {
            return Ok(None);
        }
        let mut limits = self.guard.as_deref().map_or_else(|| Ok(Limits::default()), file::read)?;
        if let Some(speed) = self.max_speed {
            let cap = Percent::new(speed).map_err(Failure::usage)?;
            limits.max_speed = Some(limits.max_speed.map_or(cap, |of_file| lower(of_file, cap)));
        }
        if let Some(degrees) = self.max_axis_step.map(Degrees) {
            limits.max_axis_step = Some(limits.max_axis_step.map_or(degrees, |file| lower(file, degrees)));
        }
        Ok(Some(limits.envelope()))
    }
}

fn lower<T: PartialOrd>(one: T, other: T) -> T {
    if one < other { one } else { other }
}

/// The failure for a step that exceeds a limit.
pub fn beyond(violation: &Violation) -> Failure {
    Failure::refused(format!("nothing was sent: {violation}"))
        .with_code(Code::BeyondLimits)
        .advise("the limits are those of --guard, --max-speed and --max-axis-step")
}
