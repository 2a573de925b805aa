//! What the holder of a lease sends to a robot: a command, or a list of instructions.

use std::fmt;

use r6_proto::message::Instruction;
use r6_proto::{Command, Effect, Request};

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
        }
    }

    /// Whether a run of a program must not be interrupted by it: it moves, it changes the list, or it changes
    /// what the numbers of the moves mean.
    #[must_use]
    pub fn disturbs_run(&self) -> bool {
        match self {
            Self::Command(command) => self.effect() == Effect::Moves || command.name().info().changes_frame,
            Self::List { .. } => true,
        }
    }

    /// The global speed that it sets, in percent.
    #[must_use]
    pub fn global_speed(&self) -> Option<f64> {
        match self {
            // On the wire it has steps of 0.1 %.
            Self::Command(Command::ModifyGspd { percent }) => Some((percent * 10.0).round() / 10.0),
            Self::Command(_) | Self::List { .. } => None,
        }
    }

    /// Its word: that of the command, or `AddRCC`.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Command(command) => command.name().word(),
            Self::List { .. } => "AddRCC",
        }
    }

    /// Whether the arm also runs what is left in the instruction list.
    #[must_use]
    pub fn runs_leftover(&self) -> bool {
        match self {
            Self::Command(command) => command.name().starts(),
            Self::List { replace, steps } => !replace && !steps.is_empty(),
        }
    }
}

impl From<Command<'static>> for Order {
    fn from(command: Command<'static>) -> Self {
        Self::Command(command)
    }
}

impl fmt::Display for Order {
    /// A command as on the wire; of a list whether it replaces, and the names of its first steps.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (replace, steps) = match self {
            Self::Command(command) => return command.fmt(f),
            Self::List { replace, steps } => (replace, steps),
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
        assert!(list(true, 11).to_string().ends_with("path speed, …"));
    }
}
