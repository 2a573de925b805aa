//! `r6 move`: one motion.

use clap::{Args, Subcommand};
use r6_client::RunOptions;
use r6_program::{MotionList, eight, first_axes};
use r6_proto::AxisMask;
use r6_proto::message::Instruction;
use r6_proto::message::instruction::{Action, BlendLevel, CurveMove, Manner, Move};

use crate::cmd::job::{self, JobArgs};
use crate::exit::{Exit, Failure};
use crate::robot::RobotArgs;
use crate::units;

/// Make one motion: of the axes, along a line, or along a curve
#[derive(Debug, Args)]
#[command(after_help = "\
Before anything is sent the machine is looked at: it has to be in mode 7 (a program \
runs; it has to be at its step that waits for remote commands), without alarm, homed, at rest, and with an empty list. If not, each condition \
is named and nothing is sent. What Ctrl-C, --timeout, --guard and --json do, and what becomes of a \
motion that fails, is told by `r6 run --help`.

Examples:
  r6 move axes 10 0 0 0 30 0 --speed 50 --wait         axes J1 to J6, degrees
  r6 move axes 0 10 -20 0 30 0 --speed 20 --blend 3
  r6 move axes 10 --wait --json | jq .event            for programs
  r6 move axes 10 --max-axis-step 20 --wait            only if J1 is no further away than that
  r6 move line 450 0 500 --speed 10 --wait             the tool to X Y Z, orientation kept
  r6 move line 450 0 500 180 0 180 --speed 10          and to the orientation U V W
  r6 move curve 450 50 500 180 0 180 400 100 500 180 0 180 --append    behind a line: through a pose to a pose")]
pub struct MoveArgs {
    #[command(subcommand)]
    path: Path,
}

#[derive(Debug, Subcommand)]
enum Path {
    /// Move every axis straight to its angle, all arriving together
    #[command(after_help = "\
Examples:
  r6 move axes 10 0 0 0 30 0 --speed 50 --wait
  r6 move axes 15 --speed 5                            J1 alone: the axes that are not given stay
  r6 move axes 0 10 -20 0 30 0 --mask 0x06             only J2 and J3 of these")]
    Axes {
        /// Angles of J1, J2, … in degrees (mm on a linear axis)
        #[arg(value_name = "DEGREES", required = true, num_args = 1..=8, allow_negative_numbers = true, value_parser = units::coordinate)]
        axes: Vec<f64>,
        #[command(flatten)]
        how: How,
        #[command(flatten)]
        job: JobArgs,
    },
    /// Move the tool straight to a pose
    #[command(
        override_usage = "r6 move line [OPTIONS] X Y Z [U V W]",
        after_help = "\
With X Y Z alone the orientation is kept. +180 and -180 are the same orientation and a full turn \
of the wrist apart: give U, V and W near their present values. 100 % is 2000 mm/s, times the \
global speed.

Examples:
  r6 move line 450 0 500 --speed 10 --wait
  r6 move line 450 0 500 180 0 180 --speed 10 --blend 3"
    )]
    Line {
        /// X Y Z in mm, then U V W in degrees: 3 or 6 numbers
        #[arg(value_name = "NUMBER", required = true, num_args = 1..=6, allow_negative_numbers = true, value_parser = units::coordinate)]
        pose: Vec<f64>,
        #[command(flatten)]
        how: How,
        #[command(flatten)]
        job: JobArgs,
    },
    /// Move the tool through a middle pose to an end pose
    #[command(
        override_usage = "r6 move curve [OPTIONS] X Y Z U V W X Y Z U V W",
        after_help = "\
Controllers accept a curve without a line before it in the list and do not move: make a line first \
and give the curve --append, or use `r6 run`. +180 and -180 are a full turn of the wrist apart: give U, V \
and W near their present values, or --mask 0x07 to keep the orientation.

Examples:
  r6 move line 450 0 500 --speed 10 --wait
  r6 move curve 450 50 500 180 0 180 400 100 500 180 0 180 --speed 10 --append --wait"
    )]
    Curve {
        /// The middle pose, then the end pose: X Y Z in mm, U V W in degrees, 12 numbers
        #[arg(value_name = "NUMBER", required = true, num_args = 1..=12, allow_negative_numbers = true, value_parser = units::coordinate)]
        poses: Vec<f64>,
        #[command(flatten)]
        how: How,
        #[command(flatten)]
        job: JobArgs,
    },
}

/// Manner of a motion.
#[derive(Debug, Args)]
struct How {
    /// Speed in percent, 0.1 to 100, in steps of 0.1; the controller's global speed multiplies it
    #[arg(long, value_name = "PERCENT", default_value = "10", value_parser = units::speed_percent)]
    speed: f64,
    /// Blend level, 0 to 9: how far the corner to the next motion is rounded
    #[arg(long, value_name = "LEVEL", default_value = "0", value_parser = units::blend_level)]
    blend: BlendLevel,
    /// Seconds to wait before the motion, in steps of 0.1
    #[arg(long, value_name = "SECONDS", default_value = "0", value_parser = units::delay_seconds)]
    delay: f64,
    /// Axis mask such as 0x3F: only these axes (or components of the pose) move
    #[arg(long, value_name = "MASK", value_parser = units::axis_mask)]
    mask: Option<AxisMask>,
}

impl How {
    /// The manner of a motion with so many coordinates.
    fn manner(&self, given: usize) -> Result<Manner, Failure> {
        let mask = self.mask.unwrap_or_else(|| first_axes(given));
        if let Some(axis) = mask.axes().find(|axis| axis.index() >= given) {
            return Err(Failure::usage(format!("mask {mask} names {axis}, for which no number is given"))
                .advise("give a number for every axis (or component of the pose) of the mask"));
        }
        Ok(Manner {
            mask: Some(mask),
            speed: Some(self.speed),
            delay: Some(self.delay),
            smooth: Some(self.blend),
            ..Manner::default()
        })
    }
}

/// Makes the motion.
pub async fn run(args: MoveArgs, robot: RobotArgs) -> Result<Exit, Failure> {
    let (action, job) = match &args.path {
        Path::Axes { axes, how, job } => {
            (Action::AxisMove(Move { target: eight(axes), manner: how.manner(axes.len())? }), job)
        }
        Path::Line { pose, how, job } => {
            if !matches!(pose.len(), 3 | 6) {
                return Err(Failure::usage(format!("a line goes to 3 or 6 numbers, {} given", pose.len()))
                    .advise("X Y Z in mm keep the orientation; X Y Z U V W set it"));
            }
            (Action::LinearMove(Move { target: eight(pose), manner: how.manner(pose.len())? }), job)
        }
        Path::Curve { poses, how, job } => {
            if poses.len() != 12 {
                return Err(Failure::usage(format!("a curve has 12 numbers, {} given", poses.len()))
                    .advise("X Y Z U V W of the middle pose, then X Y Z U V W of the end pose"));
            }
            let (middle, end) = poses.split_at(poses.len() / 2);
            (
                Action::CurveMove(CurveMove {
                    middle: eight(middle),
                    end: eight(end),
                    manner: how.manner(end.len())?,
                }),
                job,
            )
        }
    };
    let list = MotionList { replace: !job.append, instructions: vec![Instruction { oneshot: true, action }] };
    job::carry_out(job, vec![list], RunOptions::default(), &robot).await
}
