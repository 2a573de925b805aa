//! What to do where a controller has refused a command.

use r6_proto::CommandName;

/// What to do about the refusal of this command, in the words that stand behind the refusal.
pub(super) fn after_refusal(command: CommandName) -> &'static str {
    match command {
        CommandName::ActionStop | CommandName::ActionPause | CommandName::StopButton => {
            "the arm may go on: use the emergency stop, then look at the arm"
        }
        CommandName::StartButton | CommandName::ActionSingleCycle => {
            "a program starts in auto, without an alarm, and with the emergency stop released: look at the mode, the \
             alarm and the key, then send it again"
        }
        CommandName::ClearAlarmRunNext | CommandName::ClearAlarmContinue => {
            "it clears the alarm and starts the program: remove the cause of the alarm, release the emergency stop, turn \
             the key to auto, then send it again"
        }
        CommandName::ClearAlarm => {
            "remove the cause of the alarm and release the emergency stop, then send it again; where the firmware does not \
             know the command, clear the alarm on the pendant"
        }
        CommandName::SwitchMold => {
            "compare the name with the programs of the controller (moldList); it changes only while the arm stands"
        }
        CommandName::ModifyCounter => "compare the number with the counters of the controller (counterList)",
        CommandName::ModifyOutput => "check that the controller has this board and this point",
        CommandName::ModifyStackData => {
            "check the number of the stack, the spacing and the counts; not every firmware changes stacks over the network"
        }
        CommandName::ModifyGspd => "check the value: the global speed is 0 to 100 percent",
        CommandName::RewriteData | CommandName::RewriteDataList => {
            "check the registers (800 to 900) and the values, and read them back"
        }
        CommandName::ModifyAccDec => "check both times: seconds from 0.001 to 60",
        CommandName::SwitchTool | CommandName::ModifyTool => {
            "check the number of the tool and its values against the tools on the pendant"
        }
        CommandName::SwitchCoordinate => {
            "check the number of the workbench against the workbenches on the pendant"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Refused;

    fn told(command: CommandName, reason: &str) -> String {
        Refused::Command { command, reason: Some(reason.to_owned()) }.to_string()
    }

    #[test]
    fn the_advice_is_about_the_command_that_was_refused() {
        for (command, words) in [
            (CommandName::ActionStop, "use the emergency stop"),
            (CommandName::StartButton, "in auto"),
            (CommandName::ClearAlarm, "remove the cause of the alarm"),
            (CommandName::ModifyGspd, "0 to 100 percent"),
            (CommandName::SwitchMold, "moldList"),
            (CommandName::ModifyCounter, "counterList"),
            (CommandName::RewriteData, "800 to 900"),
        ] {
            let told = told(command, "no");
            assert!(told.starts_with(&format!("the controller refused {command}: no; ")), "{told}");
            assert!(told.contains(words), "{told}");
        }
        // Only what starts the machine depends on its mode.
        for command in [CommandName::ModifyGspd, CommandName::SwitchMold, CommandName::ModifyOutput] {
            assert!(!told(command, "no").contains("mode"), "{command}");
        }
    }

    #[test]
    fn a_reason_cannot_forge_a_line() {
        let told = told(CommandName::ModifyGspd, "no\r\nREADY\u{1b}[2J");
        assert!(told.contains(r"no\r\nREADY\u{1b}[2J"), "{told}");
        assert!(!told.chars().any(char::is_control), "{told:?}");
    }
}
