//! Profiles: the behaviour of one firmware, as named settings that a user's own file can change.
//!
//! Four come with the product: `hc1` (what shipped controllers do), `r6-host` and `r6-pendant` (exactly
//! manual V6.0, for the mainboard's port and the hand panel's), `legacy` (before 2.0.2.1 / 1.6.4). A file
//! names the profile it starts from and changes single settings:
//!
//! ```toml
//! base = "hc1"
//! name = "my-cell"
//! max_connections = 2
//! add_rcc_ack_ms = 25
//! ```

mod choices;
mod file;

use std::time::Duration;

use r6_motion::Turning;
use r6_program::Mistakes;
use r6_proto::address::{ADDRESSES, Ports};
use r6_proto::alarm::AlarmCode;
use r6_proto::dialect::Dialect;
use r6_proto::message::command::COMMANDS;
use r6_proto::{Address, CommandName, Port};

pub use choices::{
    IdleSingleCycle, LoneCurve, MissingOneshot, PathSpeedAnswer, ReplaceInMotion, SignalStop, StopButton,
    StopMode, Unarmed,
};

/// Everything that differs between firmwares: how replies are written, which names exist, how it behaves,
/// what it accepts.
///
/// Each setting says where its value comes from: captured, reported, manual, or chosen if unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Its name.
    pub name: String,
    /// The value of `version`.
    pub version: String,
    /// How replies are written.
    pub dialect: Dialect,
    /// Which network port of the cabinet this is.
    pub port: Port,
    /// Addresses that get no value in `queryData`, by their name in the table (`curMold`, `Addr-n`).
    /// Captured, unit C.
    pub unsupported_addresses: Vec<String>,
    /// Commands that are refused.
    pub unsupported_commands: Vec<String>,
    /// Instructions that are refused, by action number.
    pub unsupported_actions: Vec<i64>,
    /// Whether a known command with wrong arguments is refused. `hc1` answers ok and does nothing (captured,
    /// unit C).
    pub checks_arguments: bool,
    /// AddRCC frames over this many bytes are neither answered nor executed. Inferred from unit A's
    /// thresholds.
    pub add_rcc_silent_over: Option<usize>,
    /// AddRCC frames over this many bytes reset the connection. Inferred from unit A's thresholds.
    pub add_rcc_reset_over: Option<usize>,
    /// How long the reply to AddRCC takes; other replies are sent at once. Reported, unit A: 16–20 ms.
    pub add_rcc_ack: Duration,
    /// By how much that time varies in either direction, drawn from the seed. Reported, unit A: 16–20 ms, so
    /// 2 ms around 18.
    pub add_rcc_ack_spread: Duration,
    /// What AddRCC does while no program waits for remote commands. Reported, but units A and B disagree.
    pub add_rcc_unarmed: Unarmed,
    /// What an AddRCC that replaces the list in mid-motion does. Reported, unit A: alarm 200.
    pub replace_in_motion: ReplaceInMotion,
    /// In which direction a line or curve of the remote list turns the tool, if the target is more than half
    /// a turn away in U, V or W. Reported: a move to U +180, where U read −180, was a whole turn of the
    /// wrist. Steps of a taught program take the shortest way.
    pub turning: Turning,
    /// What a curve (action 17) does without a line (action 10) before it. Reported: answered ok, not
    /// executed.
    pub lone_curve: LoneCurve,
    /// The answer to an AddRCC list with a line after a path speed (actions 51, 10). Reported, unit B: `err`,
    /// though it ran.
    pub path_speed_answer: PathSpeedAnswer,
    /// When the signal of action 52 stops a move. Manual 6.1.4: its status; no report says which of the two.
    pub signal_stop: SignalStop,
    /// Whether the watch of action 52 continues after its list has ended or was replaced. Manual 6.1.4: until
    /// `isUse` 0.
    pub signal_stop_outlives_list: bool,
    /// What an instruction without `oneshot` means. Chosen.
    pub oneshot_missing: MissingOneshot,
    /// Whether `isMoving` is 1 while a move stands still for its `delay`. Manual 4.1.1 #21: 0 is "at rest".
    pub moving_in_delay: bool,
    /// What `actionSingleCycle` does while a program waits for remote commands and the list is empty. Chosen.
    pub idle_single_cycle: IdleSingleCycle,
    /// How many connections are served; further ones are accepted and never answered. Chosen.
    pub max_connections: usize,
    /// Whether a heartbreak is answered. Unknown; chosen: no.
    pub answers_heartbreak: bool,
    /// Whether `heartbreak` sent as a command feeds the watchdog and is answered ok, as one known client
    /// expects. Unknown; chosen: no, it is an unknown command.
    pub accepts_heartbreak_command: bool,
    /// How long after a heartbreak the next one is due (manual 7: 10 s).
    pub heartbeat_timeout: Duration,
    /// The alarm that a missed heartbreak raises. Unknown; chosen: 9, "connect host fail".
    pub heartbeat_alarm: AlarmCode,
    /// How long `actionStop` takes to bring the arm to rest. Reported, unit B: 0.078 s.
    pub action_stop_time: Duration,
    /// The alarm that `actionStop` leaves, 0 for none. Reported, unit B: 42; unit A: none.
    pub action_stop_alarm: AlarmCode,
    /// The mode after `actionStop`: 2, or 3 as reported by unit B.
    pub action_stop_mode: StopMode,
    /// How long `actionPause` takes to bring the arm to rest. Reported, unit B: 0.5 s.
    pub action_pause_time: Duration,
    /// What the first `stopButton` does. Reported, unit C: the program ends with its cycle, and a second
    /// press stops at once.
    pub stop_button: StopButton,
    /// Whether `modifyCounter` changes the target (manual 4.2.1 #7: not yet on the mainboard's port).
    pub counter_target_writable: bool,
    /// Whether `modifyOutput` reaches M (manual 4.2.1 #8: not yet on the pendant's port).
    pub m_output_writable: bool,
}

impl Profile {
    /// The names of the profiles that come with the product; the first is the default.
    #[must_use]
    pub fn names() -> [&'static str; 4] {
        ["hc1", "r6-host", "r6-pendant", "legacy"]
    }

    /// The profile with this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "hc1" => Some(Self::hc1()),
            "r6-host" => Some(Self::r6(Port::Mainboard)),
            "r6-pendant" => Some(Self::r6(Port::Pendant)),
            "legacy" => Some(Self::legacy()),
            _ => None,
        }
    }

    /// The behaviour of shipped HC1 controllers on the mainboard's port: the default.
    #[must_use]
    pub fn hc1() -> Self {
        Self {
            name: "hc1".to_owned(),
            version: "HC-QC-RX-7.8.07-master-F5.2.1".to_owned(),
            dialect: Dialect::HC1,
            port: Port::Mainboard,
            unsupported_addresses: addresses_missing_on(Port::Mainboard),
            // The manual of 2020 says that switchMold and modifyStackData are missing here "for now"; later
            // manuals do not repeat that.
            unsupported_commands: Vec::new(),
            unsupported_actions: Vec::new(),
            checks_arguments: false,
            add_rcc_silent_over: Some(2048),
            add_rcc_reset_over: Some(4096),
            add_rcc_ack: Duration::from_millis(18),
            add_rcc_ack_spread: Duration::from_millis(2),
            add_rcc_unarmed: Unarmed::Refuse,
            replace_in_motion: ReplaceInMotion::Alarm200,
            turning: Turning::AsTold,
            lone_curve: LoneCurve::Skip,
            // Unit B answered `err` and ran the list. This profile is the firmware of unit A, for which there
            // is no such report.
            path_speed_answer: PathSpeedAnswer::Ok,
            signal_stop: SignalStop::Level,
            signal_stop_outlives_list: true,
            oneshot_missing: MissingOneshot::Keep,
            moving_in_delay: false,
            idle_single_cycle: IdleSingleCycle::Wait,
            max_connections: 8,
            answers_heartbreak: false,
            accepts_heartbreak_command: false,
            heartbeat_timeout: Duration::from_secs(10),
            heartbeat_alarm: AlarmCode::NO_HOST,
            action_stop_time: Duration::from_millis(78),
            action_stop_alarm: AlarmCode::NONE,
            action_stop_mode: StopMode::Auto,
            action_pause_time: Duration::from_millis(500),
            stop_button: StopButton::FinishCycle,
            counter_target_writable: true,
            m_output_writable: true,
        }
    }

    /// Exactly manual V6.0, on one of the two ports.
    fn r6(port: Port) -> Self {
        let later = ADDRESSES.iter().filter(|row| row.since != "V6.0").map(|row| row.name.to_owned());
        Self {
            name: match port {
                Port::Mainboard => "r6-host",
                Port::Pendant => "r6-pendant",
            }
            .to_owned(),
            version: "v1.1".to_owned(),
            dialect: Dialect::R6,
            port,
            unsupported_addresses: addresses_missing_on(port).into_iter().chain(later).collect(),
            unsupported_commands: COMMANDS
                .iter()
                .filter(|row| !row.ports.has(port) || row.since != "V6.0")
                .map(|row| row.word.to_owned())
                .collect(),
            unsupported_actions: vec![51, 200, 204],
            checks_arguments: true,
            add_rcc_silent_over: None,
            add_rcc_reset_over: None,
            add_rcc_ack: Duration::ZERO,
            add_rcc_ack_spread: Duration::ZERO,
            replace_in_motion: ReplaceInMotion::TakeOver,
            lone_curve: LoneCurve::Run,
            counter_target_writable: port == Port::Pendant,
            m_output_writable: port == Port::Mainboard,
            ..Self::hc1()
        }
    }

    /// The firmware before 2.0.2.1 / 1.6.4, on the hand panel's port.
    fn legacy() -> Self {
        Self {
            name: "legacy".to_owned(),
            version: "2.0.1.9".to_owned(),
            dialect: Dialect::LEGACY,
            ..Self::r6(Port::Pendant)
        }
    }

    /// Reads a profile from a user's TOML file.
    ///
    /// # Errors
    /// [`Mistakes`]: all places where the text is wrong, and the correct form of each setting.
    pub fn from_toml(text: &str) -> Result<Self, Mistakes> {
        file::read(text)
    }

    /// Whether a query of this address gets a value.
    #[must_use]
    pub fn answers(&self, address: Address) -> bool {
        !self.unsupported_addresses.iter().any(|name| name == address.info().name)
    }

    /// Whether this command exists.
    #[must_use]
    pub fn has_command(&self, name: CommandName) -> bool {
        !self.unsupported_commands.iter().any(|word| word == name.word())
    }
}

fn addresses_missing_on(port: Port) -> Vec<String> {
    let missing = |ports: Ports| !ports.has(port);
    ADDRESSES.iter().filter(|row| missing(row.ports)).map(|row| row.name.to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use r6_proto::dialect::KeyOrder;

    use super::*;

    #[test]
    fn every_name_is_a_profile() {
        for name in Profile::names() {
            assert_eq!(Profile::named(name).map(|profile| profile.name), Some(name.to_owned()));
        }
        assert_eq!(Profile::named("hc2"), None);
    }

    #[test]
    fn a_file_changes_single_settings() {
        let text = "base = \"legacy\"\nname = \"cell\"\nmax_connections = 2\nadd_rcc_ack_ms = 25\nkey_order = \"alphabetical\"\n\
                    action_stop_mode = \"stop\"\nadd_rcc_silent_over = 0\nadd_rcc_reset_over = 9000";
        let profile = Profile::from_toml(text).unwrap();
        let mut expected = Profile::named("legacy").unwrap();
        expected.name = "cell".to_owned();
        expected.max_connections = 2;
        expected.add_rcc_ack = Duration::from_millis(25);
        expected.dialect.key_order = KeyOrder::Alphabetical;
        expected.action_stop_mode = StopMode::Stop;
        expected.add_rcc_silent_over = None;
        expected.add_rcc_reset_over = Some(9000);
        assert_eq!(profile, expected);
    }

    #[test]
    fn a_wrong_file_says_where_and_what() {
        let error =
            Profile::from_toml("max_connections = 2\nkey_order = \"random\"").unwrap_err().to_string();
        let wanted = "2:13: `key_order` is \"random\", but has to be one of \"alphabetical\", \"manual\"";
        assert_eq!(error, wanted);
        let error = Profile::from_toml("max_conections = 2").unwrap_err().to_string();
        assert!(error.contains("max_conections") && error.contains("max_connections"), "{error}");
        let error = Profile::from_toml("base = \"hc2\"").unwrap_err().to_string();
        assert!(
            error.starts_with("1:8: `base` is \"hc2\"") && error.ends_with("; nearest: \"hc1\""),
            "{error}"
        );
        let error = Profile::from_toml("max_connections = 0").unwrap_err().to_string();
        assert!(error.starts_with("1:19: `max_connections` is 0") && error.contains("1 or more"), "{error}");
        let error = Profile::from_toml("unsupported_commands = [\"actoinStop\"]").unwrap_err().to_string();
        assert!(error.contains("nearest: `actionStop`"), "{error}");
    }

    #[test]
    fn each_port_lacks_what_the_manual_says() {
        let host = Profile::named("r6-host").unwrap();
        let pendant = Profile::named("r6-pendant").unwrap();
        let lacks = |profile: &Profile, name: &str| !profile.answers(Address::parse(name).unwrap());
        assert!(lacks(&host, "curMold") && lacks(&host, "curAccount") && !lacks(&host, "curTorque-0"));
        assert!(
            !lacks(&pendant, "curMold") && lacks(&pendant, "curTorque-0") && lacks(&pendant, "curSpeed-0")
        );
        assert!(lacks(&host, "Addr-800") && lacks(&pendant, "RemoteCmdLen"));
        assert!(!host.has_command(CommandName::SwitchMold) && pendant.has_command(CommandName::SwitchMold));
        assert!(
            !host.has_command(CommandName::ClearAlarm) && Profile::hc1().has_command(CommandName::ClearAlarm)
        );
    }
}
