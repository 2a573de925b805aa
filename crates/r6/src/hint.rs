//! Commands in advice: for the robot that was asked, so that what is typed as advised acts on no other one.

use std::sync::OnceLock;

/// Where `r6 up` offers the panel, and `r6 panel` looks for it unless told otherwise.
pub const DEFAULT_PANEL: &str = "127.0.0.1:9770";

/// Where `r6 up` and the usual `r6 sim` listen: the panel of this one is where `r6 panel` looks.
const USUAL_ROBOTS: [&str; 4] = ["127.0.0.1", "127.0.0.1:9760", "localhost", "localhost:9760"];

/// How this run was told which robot it is for. There is one for each run of r6.
static GIVEN: OnceLock<Given> = OnceLock::new();

/// Which robot a run is for, as far as advice has to repeat it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Given {
    /// `--robot` as it was typed; what the environment says is there for the next command, too.
    typed: Option<String>,
    /// Whether `r6 panel`, as it is, acts on the same machine.
    own_panel: bool,
}

impl Given {
    fn of(robot: &str, typed: bool, panel: &str) -> Self {
        let own_panel = USUAL_ROBOTS.contains(&robot) && panel == DEFAULT_PANEL;
        Self { typed: typed.then(|| robot.to_owned()), own_panel }
    }

    fn r6(&self, words: &str) -> String {
        match &self.typed {
            Some(robot) => format!("r6 --robot {robot} {words}"),
            None => format!("r6 {words}"),
        }
    }

    fn at_panel(&self, words: &str, by_hand: &str) -> String {
        if self.own_panel { format!("`r6 panel {words}`") } else { format!("{by_hand} at its panel") }
    }
}

/// Remembers which robot this run is for; `typed`: by `--robot`, and not by the environment.
pub fn remember(robot: &str, typed: bool) {
    let panel = std::env::var("R6_PANEL").unwrap_or_else(|_| DEFAULT_PANEL.to_owned());
    // The first one counts, and there is no second.
    let _ = GIVEN.set(Given::of(robot, typed, &panel));
}

/// A command as it has to be typed: `r6 --robot 192.168.1.10 stop`.
pub fn r6(words: &str) -> String {
    GIVEN.get().cloned().unwrap_or_default().r6(words)
}

/// What is done at the panel of a virtual machine: the command, where it acts on the same machine, else by hand.
pub fn at_panel(words: &str, by_hand: &str) -> String {
    GIVEN.get().cloned().unwrap_or_default().at_panel(words, by_hand)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn advice_repeats_the_robot_that_was_typed() {
        let typed = Given::of("127.0.0.1:9762", true, DEFAULT_PANEL);
        assert_eq!(typed.r6("stop"), "r6 --robot 127.0.0.1:9762 stop");
        assert_eq!(typed.at_panel("key auto", "turn the key to auto"), "turn the key to auto at its panel");
        let usual = Given::of("127.0.0.1:9760", false, DEFAULT_PANEL);
        assert_eq!(usual.r6("stop"), "r6 stop");
        assert_eq!(usual.at_panel("key auto", "turn the key to auto"), "`r6 panel key auto`");
        let elsewhere = Given::of("127.0.0.1:9760", false, "127.0.0.1:9771");
        assert!(!elsewhere.own_panel);
    }
}
