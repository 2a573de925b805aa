//! Commands in advice. They name the robot that was asked, so that a copied command acts on no other robot.

use std::sync::OnceLock;

/// The default address of the panel: `r6 up` offers it there, and `r6 panel` looks for it there.
pub const DEFAULT_PANEL: &str = "127.0.0.1:9770";

/// The default addresses of `r6 up` and `r6 sim`. `r6 panel` without options reaches the panel of this robot.
const USUAL_ROBOTS: [&str; 4] = ["127.0.0.1", "127.0.0.1:9760", "localhost", "localhost:9760"];

/// The robot that this run is for. It is set once per run of r6.
static GIVEN: OnceLock<Given> = OnceLock::new();

/// The robot that this run is for: the part that advice has to repeat.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Given {
    /// `--robot` as it was typed. `None` if the robot came from the environment, which the next command reads
    /// too.
    typed: Option<String>,
    /// `--type-key` and `--ds-id` as they were typed: without them the controller would not answer.
    wire: String,
    /// Whether `r6 panel` without options acts on the same machine.
    own_panel: bool,
}

impl Given {
    fn of(robot: &str, typed: bool, wire: &str, panel: &str) -> Self {
        let own_panel = USUAL_ROBOTS.contains(&robot) && panel == DEFAULT_PANEL;
        Self { typed: typed.then(|| robot.to_owned()), wire: wire.to_owned(), own_panel }
    }

    fn r6(&self, words: &str) -> String {
        match &self.typed {
            Some(robot) => format!("r6 --robot {robot}{} {words}", self.wire),
            None => format!("r6{} {words}", self.wire),
        }
    }

    fn at_panel(&self, words: &str, by_hand: &str) -> String {
        if self.own_panel { format!("`r6 panel {words}`") } else { format!("{by_hand} at its panel") }
    }
}

/// Remembers which robot this run is for. `typed`: whether it came from `--robot`, not from the environment.
/// `wire`: the options that say how its requests are written.
pub fn remember(robot: &str, typed: bool, wire: &str) {
    let panel = std::env::var("R6_PANEL").unwrap_or_else(|_| DEFAULT_PANEL.to_owned());
    // This is called once; a second value would be ignored.
    let _ = GIVEN.set(Given::of(robot, typed, wire, &panel));
}

/// A command to type, with the robot: `r6 --robot 192.168.1.10 stop`.
pub fn r6(words: &str) -> String {
    GIVEN.get().cloned().unwrap_or_default().r6(words)
}

/// How to do something at the panel of a virtual machine: the `r6 panel` command if it acts on the same
/// machine, else the action by hand.
pub fn at_panel(words: &str, by_hand: &str) -> String {
    GIVEN.get().cloned().unwrap_or_default().at_panel(words, by_hand)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn advice_repeats_the_robot_that_was_typed() {
        let typed = Given::of("127.0.0.1:9762", true, "", DEFAULT_PANEL);
        assert_eq!(typed.r6("stop"), "r6 --robot 127.0.0.1:9762 stop");
        assert_eq!(typed.at_panel("key auto", "turn the key to auto"), "turn the key to auto at its panel");
        let other = Given::of("127.0.0.1:9762", true, " --type-key cmdType", DEFAULT_PANEL);
        assert_eq!(other.r6("stop"), "r6 --robot 127.0.0.1:9762 --type-key cmdType stop");
        let usual = Given::of("127.0.0.1:9760", false, "", DEFAULT_PANEL);
        assert_eq!(usual.r6("stop"), "r6 stop");
        assert_eq!(usual.at_panel("key auto", "turn the key to auto"), "`r6 panel key auto`");
        let elsewhere = Given::of("127.0.0.1:9760", false, "", "127.0.0.1:9771");
        assert!(!elsewhere.own_panel);
    }
}
