//! Actions at the panel of a virtual robot: what each does, and what the gateway asks for before.

use std::fmt;

use r6_api::panel::{Action, Button, Key};
use r6_proto::{Effect, printable};

use crate::core::role::Right;

/// How many characters of a name that the caller chose are told. The longest that can be right is that of a
/// program: 64 bytes.
const MAX_NAME: usize = 64;

/// How many numbers of a fault are told. No fault has more than three.
const MAX_NUMBERS: usize = 4;

/// An action, with what the gateway has to know about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Press {
    /// The action.
    pub action: Action,
    /// What it does to the machine. What stops needs no lease.
    pub effect: Effect,
    /// The right that it needs.
    pub right: Right,
    /// Whether a run of a program must not be interrupted by it. A fault, an input or the mode key may: how a
    /// program takes them is what they are for.
    pub disturbs_run: bool,
    /// Whether the arm also runs what is left in the instruction list.
    pub runs_leftover: bool,
    /// What it needs besides the right.
    pub needs: Needs,
}

/// What an action needs besides the right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Nothing: [`Action::needs_no_lease`].
    Nothing,
    /// The lease. Whether the robot answers does not matter.
    Lease,
    /// The lease, and a robot that answers.
    Link,
}

impl Press {
    /// Classifies an action.
    #[must_use]
    pub fn new(action: Action) -> Self {
        use Effect::{Changes, Moves, Stops};
        let needs = match &action {
            action if action.needs_no_lease() => Needs::Nothing,
            Action::BeginFault { .. } | Action::CutPower { .. } | Action::EndJog {} => Needs::Lease,
            _ => Needs::Link,
        };
        let (effect, right, disturbs_run, runs_leftover) = match &action {
            Action::Press { button: Button::Stop | Button::Pause } | Action::EmergencyStop {} => {
                (Stops, Right::Stop, false, false)
            }
            Action::Press { button: Button::Start | Button::SingleCycle | Button::SingleStep } => {
                (Moves, Right::Command, true, true)
            }
            Action::Home {} | Action::Jog { .. } | Action::HoldJog { .. } | Action::KeepJog {} => {
                (Moves, Right::Command, true, false)
            }
            Action::EndJog {} => (Changes, Right::Command, false, false),
            Action::SwitchProgram { .. } => (Changes, Right::Command, true, false),
            Action::ReleaseEmergencyStop {} | Action::ClearAlarm {} => {
                (Changes, Right::Command, false, false)
            }
            // A program may wait for it, and moves the arm then.
            Action::SetInput { .. } => (Moves, Right::SetUpPanel, false, false),
            Action::TurnKey { .. }
            | Action::RaiseAlarm { .. }
            | Action::BeginFault { .. }
            | Action::EndFault { .. }
            | Action::EndFaults {}
            | Action::CutPower { .. }
            | Action::ClearPoints {} => (Changes, Right::SetUpPanel, false, false),
        };
        Self { action, effect, right, disturbs_run, runs_leftover, needs }
    }

    /// Whether the audit log has it. What a page sends several times a second while a button is held is not
    /// written, and does not wait for the disk: the log has `hold_jog`.
    #[must_use]
    pub fn is_written(&self) -> bool {
        !matches!(self.action, Action::KeepJog {} | Action::EndJog {})
    }
}

impl fmt::Display for Press {
    /// For the audit log: `panel`, and then as `r6 panel` has it. Names that the caller chose are printable
    /// and no longer than 64 characters.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |text: &str| printable(&text.chars().take(MAX_NAME).collect::<String>()).to_string();
        match &self.action {
            Action::SetInput { point, on } => {
                write!(f, "panel input {} {}", name(point), if *on { "on" } else { "off" })
            }
            Action::Press { button } => {
                let word = match button {
                    Button::Start => "start",
                    Button::Stop => "stop",
                    Button::Pause => "pause",
                    Button::SingleCycle => "single-cycle",
                    Button::SingleStep => "single-step",
                };
                write!(f, "panel button {word}")
            }
            Action::TurnKey { key } => {
                let word = match key {
                    Key::Manual => "manual",
                    Key::Auto => "auto",
                    Key::Stop => "stop",
                };
                write!(f, "panel key {word}")
            }
            Action::EmergencyStop {} => f.write_str("panel estop"),
            Action::ReleaseEmergencyStop {} => f.write_str("panel release"),
            Action::ClearAlarm {} => f.write_str("panel clear"),
            Action::RaiseAlarm { alarm } => write!(f, "panel alarm {alarm}"),
            Action::Home {} => f.write_str("panel home"),
            Action::Jog { axis, by, speed_percent } => {
                let sign = if *by < 0.0 { "" } else { "+" };
                write!(f, "panel jog {} {sign}{} --speed {}", name(axis), number(*by), number(*speed_percent))
            }
            Action::HoldJog { axis, up, speed_percent } => {
                let sign = if *up { '+' } else { '-' };
                write!(f, "panel jog {}{sign} held --speed {}", name(axis), number(*speed_percent))
            }
            Action::KeepJog {} => f.write_str("panel jog still held"),
            Action::EndJog {} => f.write_str("panel jog let go"),
            Action::BeginFault { fault, kind, chance, seconds, numbers } => {
                write!(f, "panel fault {}", name(fault))?;
                if let Some(kind) = kind {
                    write!(f, " --kind {}", name(kind))?;
                }
                // The numbers of a fault are few: more than these are refused by the panel.
                for (of, value) in numbers.iter().take(MAX_NUMBERS) {
                    write!(f, " --set {}={}", name(of), number(*value))?;
                }
                if *chance < 1.0 {
                    write!(f, " --chance {}", number(*chance))?;
                }
                seconds.map_or(Ok(()), |seconds| write!(f, " --seconds {}", number(seconds)))
            }
            Action::EndFault { number } => write!(f, "panel end-fault {number}"),
            Action::EndFaults {} => f.write_str("panel end-faults"),
            Action::CutPower { seconds } => write!(f, "panel power-cut {}", number(*seconds)),
            Action::ClearPoints {} => f.write_str("panel clear-points"),
            Action::SwitchProgram { program } => write!(f, "panel program {}", name(program)),
        }
    }
}

/// A number that the caller chose, which is not checked yet: with an exponent if it would be long without.
fn number(chosen: f64) -> String {
    let is_short = chosen == 0.0 || (1e-4..1e7).contains(&chosen.abs());
    if is_short { chosen.to_string() } else { format!("{chosen:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An action of JSON.
    fn press(json: &str) -> Press {
        Press::new(serde_json::from_str(json).unwrap())
    }

    #[test]
    fn each_action_needs_what_the_page_says() {
        use Effect::{Changes, Moves, Stops};
        use Right::{Command, SetUpPanel, Stop};
        for (json, effect, right, disturbs_run, shown) in [
            (r#"{"do":"press","button":"stop"}"#, Stops, Stop, false, "panel button stop"),
            (r#"{"do":"press","button":"pause"}"#, Stops, Stop, false, "panel button pause"),
            (r#"{"do":"emergency_stop"}"#, Stops, Stop, false, "panel estop"),
            (r#"{"do":"press","button":"start"}"#, Moves, Command, true, "panel button start"),
            (r#"{"do":"press","button":"single_cycle"}"#, Moves, Command, true, "panel button single-cycle"),
            (r#"{"do":"press","button":"single_step"}"#, Moves, Command, true, "panel button single-step"),
            (r#"{"do":"home"}"#, Moves, Command, true, "panel home"),
            (r#"{"do":"jog","axis":"J1","by":10}"#, Moves, Command, true, "panel jog J1 +10 --speed 10"),
            (r#"{"do":"switch_program","program":"a"}"#, Changes, Command, true, "panel program a"),
            (r#"{"do":"release_emergency_stop"}"#, Changes, Command, false, "panel release"),
            (r#"{"do":"clear_alarm"}"#, Changes, Command, false, "panel clear"),
            (
                r#"{"do":"set_input","point":"X010","on":true}"#,
                Moves,
                SetUpPanel,
                false,
                "panel input X010 on",
            ),
            (r#"{"do":"turn_key","key":"manual"}"#, Changes, SetUpPanel, false, "panel key manual"),
            (r#"{"do":"raise_alarm","alarm":850}"#, Changes, SetUpPanel, false, "panel alarm 850"),
            (r#"{"do":"clear_points"}"#, Changes, SetUpPanel, false, "panel clear-points"),
            (
                r#"{"do":"hold_jog","axis":"J2","up":false}"#,
                Moves,
                Command,
                true,
                "panel jog J2- held --speed 10",
            ),
            (r#"{"do":"keep_jog"}"#, Moves, Command, true, "panel jog still held"),
            (r#"{"do":"end_jog"}"#, Changes, Command, false, "panel jog let go"),
            (r#"{"do":"begin_fault","fault":"silence"}"#, Changes, SetUpPanel, false, "panel fault silence"),
            (
                r#"{"do":"begin_fault","fault":"bad-json","kind":"nul","chance":0.5,"seconds":2.5}"#,
                Changes,
                SetUpPanel,
                false,
                "panel fault bad-json --kind nul --chance 0.5 --seconds 2.5",
            ),
            (
                r#"{"do":"begin_fault","fault":"slow","numbers":{"bytes_per_second":5}}"#,
                Changes,
                SetUpPanel,
                false,
                "panel fault slow --set bytes_per_second=5",
            ),
            (r#"{"do":"end_fault","number":3}"#, Changes, SetUpPanel, false, "panel end-fault 3"),
            (r#"{"do":"end_faults"}"#, Changes, SetUpPanel, false, "panel end-faults"),
            (r#"{"do":"cut_power"}"#, Changes, SetUpPanel, false, "panel power-cut 10"),
        ] {
            let press = press(json);
            let told = (press.effect, press.right, press.disturbs_run);
            assert_eq!(told, (effect, right, disturbs_run), "{json}");
            assert_eq!(press.to_string(), shown);
            let is_button = matches!(press.action, Action::Press { .. });
            assert_eq!(press.runs_leftover, is_button && effect == Moves, "{json}");
            let is_free = effect == Stops || shown.starts_with("panel end-");
            assert_eq!(press.needs == Needs::Nothing, is_free, "{json}");
            assert_eq!(press.is_written(), !["panel jog still held", "panel jog let go"].contains(&shown));
        }
    }

    #[test]
    fn a_name_that_the_caller_chose_is_printable_and_not_long() {
        let program = "a\u{1b}[2J".to_owned() + &"b".repeat(200);
        let told = Press::new(Action::SwitchProgram { program }).to_string();
        assert!(told.len() < 100 && !told.contains('\u{1b}'), "{told}");
    }

    #[test]
    fn a_number_that_the_caller_chose_is_not_long() {
        for (by, speed, told) in [
            ("-12.5", "20", "panel jog J1 -12.5 --speed 20"),
            ("1e308", "1e-308", "panel jog J1 +1e308 --speed 1e-308"),
            ("-1.7976931348623157e308", "0", "panel jog J1 -1.7976931348623157e308 --speed 0"),
        ] {
            let json = format!(r#"{{"do":"jog","axis":"J1","by":{by},"speed_percent":{speed}}}"#);
            assert_eq!(press(&json).to_string(), told);
        }
    }
}
