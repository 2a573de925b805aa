//! Limits that a list is held against before anything of it is sent: an envelope from a file and from options.

mod file;

use std::path::PathBuf;

use clap::Args;
use r6_client::units::{Degrees, Percent};
use r6_client::{Envelope, Instruction, Motion, Violation};

use crate::cmd::job::guard::file::Limits;
use crate::exit::Failure;
use crate::output::problem::Code;
use crate::units;

/// What a list may ask for.
#[derive(Debug, Args)]
pub struct GuardArgs {
    /// Limits of this cell (see `r6 run --help`): if a step goes beyond, nothing is sent
    #[arg(long, value_name = "FILE.toml")]
    guard: Option<PathBuf>,
    /// Refuse what has a faster move than this; of --guard and this, the lower counts
    #[arg(long, value_name = "PERCENT", value_parser = units::speed_percent)]
    max_speed: Option<f64>,
    /// Refuse what turns an axis further than this in one axis move; of --guard and this, the lower counts
    #[arg(long, value_name = "DEGREES", value_parser = units::largest_step)]
    max_axis_step: Option<f64>,
}

impl GuardArgs {
    /// The envelope; `None` if nothing is limited.
    pub fn envelope(&self) -> Result<Option<Envelope>, Failure> {
        if self.guard.is_none() && self.max_speed.is_none() && self.max_axis_step.is_none() {
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

/// Holds a list against an envelope, the way from the present position to its first target apart. A list that repeats
/// goes from its last target to its first one, too.
pub fn check(envelope: &Envelope, instructions: &[Instruction], repeats: bool) -> Result<(), Violation> {
    let rounds = if repeats { 2 } else { 1 };
    let steps = std::iter::repeat_n(instructions, rounds).flatten();
    let motion: Motion = steps.map(|step| Instruction { oneshot: true, ..*step }).collect();
    envelope.check_motion(&motion).map_err(|violation| {
        let count = instructions.len();
        let step = if violation.step > count { violation.step - count } else { violation.step };
        Violation { step, ..violation }
    })
}

/// What is told where a step goes beyond.
pub fn beyond(violation: &Violation) -> Failure {
    Failure::refused(format!("nothing was sent: {violation}"))
        .with_code(Code::BeyondLimits)
        .advise("the limits are those of --guard, --max-speed and --max-axis-step")
}

#[cfg(test)]
mod tests {
    use r6_client::units::AxisPosition;

    use super::*;

    #[test]
    fn a_list_that_repeats_is_measured_from_its_end_to_its_beginning() {
        let slow = Percent::new(5.0).unwrap();
        let motion = [0.0, 20.0, 40.0]
            .iter()
            .fold(Motion::new(), |motion, to| motion.axis_move(AxisPosition::degrees([*to]), slow));
        let steps = motion.instructions().unwrap();
        let envelope = Envelope::new().largest_axis_step(Degrees(30.0));
        assert_eq!(check(&envelope, steps, false), Ok(()));
        let violation = check(&envelope, steps, true).unwrap_err();
        assert_eq!(violation.to_string(), "step 1: J1 goes 40 deg in one step, more than 30 deg");
        let kept: Vec<_> = steps.iter().map(|step| Instruction { oneshot: false, ..*step }).collect();
        assert_eq!(check(&envelope, &kept, true), Err(violation), "what stays in the list is checked, too");
    }
}
