//! What the holder of a lease sends to a robot: a command, or a list of instructions. What a camera sends.

use std::fmt;

use r6_proto::message::{Instruction, Point};
use r6_proto::{Command, Effect, Request};

use super::camera::Camera;

/// How many steps of a list the audit log names. Controllers take 10 at most.
const NAMED_STEPS: usize = 10;

/// Something that changes or moves a robot.
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// A command.
    Command(Command<'static>),
    /// Instructions for the instruction list (`AddRCC`).
    List {
        /// Whether they replace the list; otherwise they are appended.
        replace: bool,
        /// The instructions.
        steps: Vec<Instruction>,
    },
    /// The parts that a camera found (`AddPoints`). It needs a standing grant, and no lease permits it.
    Points {
        /// The camera.
        camera: Camera,
        /// The parts.
        points: Vec<Point>,
    },
    /// The answer of a camera to a request for a photo. It needs a standing grant, and no lease permits it.
    Photo {
        /// The camera.
        camera: Camera,
        /// Whether the picture was taken.
        taken: bool,
    },
}

impl Order {
    /// Its effect on the machine.
    #[must_use]
    pub fn effect(&self) -> Effect {
        match self {
            Self::Command(command) => command.name().effect(),
            Self::List { replace, steps } => {
                Request::AddRcc { empty_list: *replace, instructions: steps }.effect()
            }
            // On the wire an answer to a photo changes something. But the program on the controller waits for
            // it, and goes on.
            Self::Points { .. } | Self::Photo { .. } => Effect::Moves,
        }
    }

    /// Whether a run of a program must not be interrupted by it: it moves, it changes the list, or it changes
    /// what the numbers of the moves mean.
    #[must_use]
    pub fn disturbs_run(&self) -> bool {
        match self {
            Self::Command(command) => self.effect() == Effect::Moves || command.name().info().changes_frame,
            Self::List { .. } | Self::Points { .. } | Self::Photo { .. } => true,
        }
    }

    /// The camera that sends it; `None` if the holder of the lease does.
    #[must_use]
    pub fn camera(&self) -> Option<Camera> {
        match self {
            Self::Command(_) | Self::List { .. } => None,
            Self::Points { camera, .. } | Self::Photo { camera, .. } => Some(*camera),
        }
    }

    /// The global speed that it sets, in percent.
    #[must_use]
    pub fn global_speed(&self) -> Option<f64> {
        match self {
            // On the wire it has steps of 0.1 %.
            Self::Command(Command::ModifyGspd { percent }) => Some((percent * 10.0).round() / 10.0),
            Self::Command(_) | Self::List { .. } | Self::Points { .. } | Self::Photo { .. } => None,
        }
    }

    /// The word of a list.
    pub const LIST: &str = "AddRCC";

    /// Its word: that of the command, or the type of the request.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Command(command) => command.name().word(),
            Self::List { .. } => Self::LIST,
            Self::Points { .. } => "AddPoints",
            Self::Photo { .. } => "photo",
        }
    }

    /// Whether the arm also runs what is left in the instruction list.
    #[must_use]
    pub fn runs_leftover(&self) -> bool {
        match self {
            Self::Command(command) => command.name().starts(),
            Self::List { replace, steps } => !replace && !steps.is_empty(),
            Self::Points { .. } | Self::Photo { .. } => false,
        }
    }
}

impl From<Command<'static>> for Order {
    fn from(command: Command<'static>) -> Self {
        Self::Command(command)
    }
}

impl fmt::Display for Order {
    /// A command as on the wire; of a list whether it replaces, and the names of its first steps; of a camera
    /// what it sends.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (replace, steps) = match self {
            Self::Command(command) => return command.fmt(f),
            Self::List { replace, steps } => (replace, steps),
            Self::Points { camera, points } => {
                let plural = if points.len() == 1 { "" } else { "s" };
                return write!(f, "AddPoints camera {camera}, {} point{plural}", points.len());
            }
            Self::Photo { camera, taken } => {
                return write!(f, "photo camera {camera}, {}", if *taken { "taken" } else { "failed" });
            }
        };
        let how = if *replace { "replace" } else { "append" };
        let plural = if steps.len() == 1 { "" } else { "s" };
        write!(f, "AddRCC {how}, {} step{plural}", steps.len())?;
        for (at, step) in steps.iter().take(NAMED_STEPS).enumerate() {
            write!(f, "{}{}", if at == 0 { ": " } else { ", " }, step.action.name())?;
        }
        if steps.len() > NAMED_STEPS { f.write_str(", …") } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use r6_proto::message::Action;
    use r6_proto::message::instruction::PathSpeed;

    use super::*;

    #[test]
    fn an_order_has_its_effect_and_says_what_it_is() {
        let step = Instruction {
            oneshot: true,
            action: Action::PathSpeed(PathSpeed { in_use: false, speed: None }),
        };
        let list = |replace, count| Order::List { replace, steps: vec![step; count] };
        for (order, effect, leftover, shown) in [
            (Command::StartButton.into(), Effect::Moves, true, "startButton"),
            (Command::ModifyGspd { percent: 5.0 }.into(), Effect::Changes, false, r#"modifyGSPD "50""#),
            (list(true, 2), Effect::Moves, false, "AddRCC replace, 2 steps: path speed, path speed"),
            (list(false, 1), Effect::Moves, true, "AddRCC append, 1 step: path speed"),
            (list(true, 0), Effect::Changes, false, "AddRCC replace, 0 steps"),
            (list(false, 0), Effect::Changes, false, "AddRCC append, 0 steps"),
        ] {
            assert_eq!((order.effect(), order.runs_leftover()), (effect, leftover), "{order}");
            let is_speed = matches!(order, Order::Command(Command::ModifyGspd { .. }));
            assert_eq!(order.disturbs_run(), !is_speed, "{order}");
            assert_eq!(order.global_speed(), is_speed.then_some(5.0), "{order}");
            assert_eq!(order.to_string(), shown);
        }
        let camera = Camera::new(2).unwrap();
        for (order, shown) in [
            (Order::Points { camera, points: vec![Point::default()] }, "AddPoints camera 2, 1 point"),
            (Order::Points { camera, points: vec![Point::default(); 3] }, "AddPoints camera 2, 3 points"),
            (Order::Photo { camera, taken: true }, "photo camera 2, taken"),
            (Order::Photo { camera, taken: false }, "photo camera 2, failed"),
        ] {
            assert_eq!((order.effect(), order.runs_leftover()), (Effect::Moves, false), "{order}");
            assert_eq!((order.disturbs_run(), order.camera()), (true, Some(camera)), "{order}");
            assert_eq!(order.to_string(), shown);
        }
        assert!(list(true, 11).to_string().ends_with("path speed, …"));
    }
}
