//! Profiles: what one firmware does, as named settings that a user's own file can change.
//!
//! Four come with the product: `hc1` (what shipped controllers do), `r6-host` and `r6-pendant` (manual V6.0 to the
//! letter, for the mainboard's port and the hand panel's), `legacy` (before 2.0.2.1 / 1.6.4). A file names the one
//! it starts from and changes single settings:
//!
//! ```toml
//! base = "hc1"
//! name = "my-cell"
//! max_connections = 2
//! add_rcc_ack_ms = 25
//! ```

use std::fmt;
use std::time::Duration;

use r6_motion::Turning;
use r6_proto::address::{ADDRESSES, Ports};
use r6_proto::dialect::{CommandReplyForm, CounterForm, Dialect, KeyOrder, ReplyType};
use r6_proto::message::command::COMMANDS;
use r6_proto::{Address, CommandName, Port};
use serde::Deserialize;

/// Everything that differs between firmwares: how replies are written, what exists, how it behaves, what it takes.
///
/// Each setting says where its value comes from: captured, reported, manual, or chosen where nobody knows.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Its name.
    pub name: String,
    /// What `version` answers.
    pub version: String,
    /// How replies are written.
    pub dialect: Dialect,
    /// Which network port of the cabinet this is.
    pub port: Port,
    /// Addresses that are left out of `queryData`, by their name in the table (`curMold`, `Addr-n`). Captured, unit C.
    pub unsupported_addresses: Vec<String>,
    /// Commands that are refused.
    pub unsupported_commands: Vec<String>,
    /// Instructions that are refused, by action number.
    pub unsupported_actions: Vec<i64>,
    /// Whether a known command with unusable arguments is refused. `hc1` answers ok and does nothing (captured, unit C).
    pub checks_arguments: bool,
    /// AddRCC frames over this many bytes are neither answered nor executed. Inferred from unit A's thresholds.
    pub add_rcc_silent_over: Option<usize>,
    /// AddRCC frames over this many bytes reset the connection. Inferred from unit A's thresholds.
    pub add_rcc_reset_over: Option<usize>,
    /// How long the reply to AddRCC takes; other replies leave at once. Reported, unit A: 16–20 ms.
    pub add_rcc_ack: Duration,
    /// By how much that time varies either way, drawn from the seed. Reported, unit A: 16–20 ms, so 2 ms around 18.
    pub add_rcc_ack_spread: Duration,
    /// What AddRCC does while no program waits for remote commands. Reported, units A and B, who disagree.
    pub add_rcc_unarmed: Unarmed,
    /// What an AddRCC that replaces the list in mid-motion does. Reported, unit A: alarm 200.
    pub replace_in_motion: ReplaceInMotion,
    /// Which way round a line or curve turns the tool to a target more than half a turn away in U, V or W.
    pub turning: Turning,
    /// The most connections that are served; further ones are accepted and never answered. Chosen.
    pub max_connections: usize,
    /// Whether a heartbreak is answered. Nobody knows; chosen: no.
    pub answers_heartbreak: bool,
    /// Whether `heartbreak` sent as the word of a command feeds the watchdog and is answered ok, as one known client
    /// expects. Nobody knows; chosen: no, it is an unknown command.
    pub accepts_heartbreak_command: bool,
    /// How long after a heartbreak the next one is due (manual 7: 10 s).
    pub heartbeat_timeout: Duration,
    /// The alarm that a missed heartbreak raises. Nobody knows; chosen: 9, "connect host fail".
    pub heartbeat_alarm: u32,
    /// How long `actionStop` takes to bring the arm to rest. Reported, unit B: 0.078 s.
    pub action_stop_time: Duration,
    /// The alarm that `actionStop` leaves, 0 for none. Reported, unit B: 42; unit A: none.
    pub action_stop_alarm: u32,
    /// The mode after `actionStop`: 2, or 3 as reported by unit B.
    pub action_stop_mode: StopMode,
    /// How long `actionPause` takes to bring the arm to rest. Reported, unit B: 0.5 s.
    pub action_pause_time: Duration,
    /// What `stopButton` does first. Reported, unit C: it ends with the cycle, and a second press stops at once.
    pub stop_button: StopButton,
    /// Whether `modifyCounter` changes the target (manual 4.2.1 #7: not yet on the mainboard's port).
    pub counter_target_writable: bool,
    /// Whether `modifyOutput` reaches M (manual 4.2.1 #8: not yet on the pendant's port).
    pub m_output_writable: bool,
}

/// What AddRCC does while no program waits for remote commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unarmed {
    /// It is answered with `err` and dropped.
    Refuse,
    /// It is neither answered nor executed.
    Silent,
    /// In automatic it starts by itself (reported, unit B); elsewhere it is refused.
    Arm,
}

/// What an AddRCC that replaces the list in mid-motion does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReplaceInMotion {
    /// Alarm 200; the arm stops.
    Alarm200,
    /// The arm goes over to the new list without a stop, where its first step is a move that can be gone to in mid-move;
    /// else it stops and goes on with the new list.
    TakeOver,
}

/// The mode after `actionStop`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StopMode {
    /// 2: automatic, not running.
    Auto,
    /// 3: stop.
    Stop,
}

/// What the first press of the stop button does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StopButton {
    /// The cycle is finished; a second press stops at once.
    FinishCycle,
    /// The arm stops at once.
    AtOnce,
}

impl Profile {
    /// The names of the profiles that come with the product; the first is the default.
    #[must_use]
    pub fn names() -> [&'static str; 4] {
        ["hc1", "r6-host", "r6-pendant", "legacy"]
    }

    /// The profile of this name.
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

    /// What shipped HC1 controllers do on the mainboard's port: the default.
    #[must_use]
    pub fn hc1() -> Self {
        Self {
            name: "hc1".to_owned(),
            version: "HC-QC-RX-7.8.07-master-F5.2.1".to_owned(),
            dialect: Dialect::HC1,
            port: Port::Mainboard,
            unsupported_addresses: addresses_missing_on(Port::Mainboard),
            // The manual of 2020 lacks switchMold and modifyStackData here "for now"; later manuals do not repeat that.
            unsupported_commands: Vec::new(),
            unsupported_actions: Vec::new(),
            checks_arguments: false,
            add_rcc_silent_over: Some(2048),
            add_rcc_reset_over: Some(4096),
            add_rcc_ack: Duration::from_millis(18),
            add_rcc_ack_spread: Duration::from_millis(2),
            add_rcc_unarmed: Unarmed::Refuse,
            replace_in_motion: ReplaceInMotion::Alarm200,
            turning: Turning::Shortest,
            max_connections: 8,
            answers_heartbreak: false,
            accepts_heartbreak_command: false,
            heartbeat_timeout: Duration::from_secs(10),
            heartbeat_alarm: 9,
            action_stop_time: Duration::from_millis(78),
            action_stop_alarm: 0,
            action_stop_mode: StopMode::Auto,
            action_pause_time: Duration::from_millis(500),
            stop_button: StopButton::FinishCycle,
            counter_target_writable: true,
            m_output_writable: true,
        }
    }

    /// Manual V6.0 to the letter, on one of the two ports.
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
            counter_target_writable: port == Port::Pendant,
            m_output_writable: port == Port::Mainboard,
            ..Self::hc1()
        }
    }

    /// Before 2.0.2.1 / 1.6.4, on the hand panel's port.
    fn legacy() -> Self {
        Self {
            name: "legacy".to_owned(),
            version: "2.0.1.9".to_owned(),
            dialect: Dialect::LEGACY,
            ..Self::r6(Port::Pendant)
        }
    }

    /// The profile that a user's TOML file describes.
    ///
    /// # Errors
    /// [`ProfileError`] names the line, the setting and what it has to be.
    pub fn from_toml(text: &str) -> Result<Self, ProfileError> {
        let file: ProfileFile = toml::from_str(text).map_err(|error| ProfileError(error.to_string()))?;
        file.apply()
    }

    /// Whether a query for this address gets a value.
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

/// What is wrong with a profile file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProfileError(String);

impl fmt::Display for ProfileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ProfileError {}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProfileFile {
    base: Option<String>,
    name: Option<String>,
    version: Option<String>,
    port: Option<PortWord>,
    key_order: Option<KeyOrderWord>,
    reply_type: Option<ReplyTypeWord>,
    command_reply: Option<CommandReplyWord>,
    echo_pack_id: Option<bool>,
    echo_query_addr: Option<bool>,
    counter_form: Option<CounterWord>,
    unsupported_addresses: Option<Vec<String>>,
    unsupported_commands: Option<Vec<String>>,
    unsupported_actions: Option<Vec<i64>>,
    checks_arguments: Option<bool>,
    /// 0: no limit.
    add_rcc_silent_over: Option<usize>,
    /// 0: no limit.
    add_rcc_reset_over: Option<usize>,
    add_rcc_ack_ms: Option<u64>,
    add_rcc_ack_spread_ms: Option<u64>,
    add_rcc_unarmed: Option<Unarmed>,
    replace_in_motion: Option<ReplaceInMotion>,
    turning: Option<TurningWord>,
    max_connections: Option<usize>,
    answers_heartbreak: Option<bool>,
    says_virtual: Option<bool>,
    accepts_heartbreak_command: Option<bool>,
    heartbeat_timeout_ms: Option<u64>,
    heartbeat_alarm: Option<u32>,
    action_stop_ms: Option<u64>,
    action_stop_alarm: Option<u32>,
    action_stop_mode: Option<StopMode>,
    action_pause_ms: Option<u64>,
    stop_button: Option<StopButton>,
    counter_target_writable: Option<bool>,
    m_output_writable: Option<bool>,
}

/// Declares the words that a file uses for a closed set of `r6-proto`, which knows no serde.
macro_rules! words {
    ($name:ident => $target:ty { $($word:ident => $value:expr),+ $(,)? }) => {
        #[derive(Clone, Copy, Deserialize)]
        #[serde(rename_all = "kebab-case")]
        enum $name { $($word),+ }

        impl From<$name> for $target {
            fn from(word: $name) -> Self {
                match word { $($name::$word => $value),+ }
            }
        }
    };
}

words!(TurningWord => Turning { Shortest => Turning::Shortest, AsTold => Turning::AsTold });
words!(PortWord => Port { Mainboard => Port::Mainboard, Pendant => Port::Pendant });
words!(KeyOrderWord => KeyOrder { Alphabetical => KeyOrder::Alphabetical, Manual => KeyOrder::Manual });
words!(ReplyTypeWord => ReplyType {
    AsSent => ReplyType::AsSent,
    Templates => ReplyType::Templates,
    Echo => ReplyType::Echo,
});
words!(CommandReplyWord => CommandReplyForm {
    Verdict => CommandReplyForm::Verdict,
    NameAndVerdict => CommandReplyForm::NameAndVerdict,
});
words!(CounterWord => CounterForm {
    Numbers => CounterForm::Numbers,
    Texts => CounterForm::Texts,
    OldText => CounterForm::OldText,
});

/// Overwrites a setting where the file has one.
fn set<T>(setting: &mut T, value: Option<impl Into<T>>) {
    if let Some(value) = value {
        *setting = value.into();
    }
}

fn set_ms(setting: &mut Duration, value: Option<u64>) {
    set(setting, value.map(Duration::from_millis));
}

impl ProfileFile {
    fn apply(self) -> Result<Profile, ProfileError> {
        let base = self.base.as_deref().unwrap_or("hc1");
        let mut profile = Profile::named(base).ok_or_else(|| unknown("base", base, Profile::names()))?;
        set(&mut profile.name, self.name);
        set(&mut profile.version, self.version);
        set(&mut profile.port, self.port);
        set(&mut profile.dialect.key_order, self.key_order);
        set(&mut profile.dialect.reply_type, self.reply_type);
        set(&mut profile.dialect.command_reply, self.command_reply);
        set(&mut profile.dialect.echo_pack_id, self.echo_pack_id);
        set(&mut profile.dialect.echo_query_addr, self.echo_query_addr);
        set(&mut profile.dialect.counter, self.counter_form);
        if let Some(names) = &self.unsupported_addresses {
            for name in names {
                if !ADDRESSES.iter().any(|row| row.name == name) {
                    return Err(unknown("unsupported_addresses", name, ADDRESSES.map(|row| row.name)));
                }
            }
        }
        if let Some(words) = &self.unsupported_commands {
            for word in words {
                if CommandName::exact(word.as_bytes()).is_none() {
                    return Err(unknown("unsupported_commands", word, COMMANDS.map(|row| row.word)));
                }
            }
        }
        set(&mut profile.unsupported_addresses, self.unsupported_addresses);
        set(&mut profile.unsupported_commands, self.unsupported_commands);
        set(&mut profile.unsupported_actions, self.unsupported_actions);
        set(&mut profile.checks_arguments, self.checks_arguments);
        let limit = |bytes: usize| (bytes > 0).then_some(bytes);
        set(&mut profile.add_rcc_silent_over, self.add_rcc_silent_over.map(limit));
        set(&mut profile.add_rcc_reset_over, self.add_rcc_reset_over.map(limit));
        set_ms(&mut profile.add_rcc_ack, self.add_rcc_ack_ms);
        set_ms(&mut profile.add_rcc_ack_spread, self.add_rcc_ack_spread_ms);
        set(&mut profile.add_rcc_unarmed, self.add_rcc_unarmed);
        set(&mut profile.replace_in_motion, self.replace_in_motion);
        set(&mut profile.turning, self.turning);
        set(&mut profile.max_connections, self.max_connections);
        set(&mut profile.answers_heartbreak, self.answers_heartbreak);
        set(&mut profile.dialect.says_virtual, self.says_virtual);
        set(&mut profile.accepts_heartbreak_command, self.accepts_heartbreak_command);
        set_ms(&mut profile.heartbeat_timeout, self.heartbeat_timeout_ms);
        set(&mut profile.heartbeat_alarm, self.heartbeat_alarm);
        set_ms(&mut profile.action_stop_time, self.action_stop_ms);
        set(&mut profile.action_stop_alarm, self.action_stop_alarm);
        set(&mut profile.action_stop_mode, self.action_stop_mode);
        set_ms(&mut profile.action_pause_time, self.action_pause_ms);
        set(&mut profile.stop_button, self.stop_button);
        set(&mut profile.counter_target_writable, self.counter_target_writable);
        set(&mut profile.m_output_writable, self.m_output_writable);
        Ok(profile)
    }
}

fn unknown(setting: &str, word: &str, known: impl IntoIterator<Item = &'static str>) -> ProfileError {
    let known: Vec<_> = known.into_iter().collect();
    let nearest = r6_proto::nearest(word, known.iter().copied());
    ProfileError(match nearest {
        Some(near) => format!("{setting}: `{word}` is not known; nearest: `{near}`"),
        None => format!("{setting}: `{word}` is not known; there are: {}", known.join(", ")),
    })
}

#[cfg(test)]
mod tests {
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
        assert!(error.contains("line 2") && error.contains("alphabetical"), "{error}");
        let error = Profile::from_toml("max_conections = 2").unwrap_err().to_string();
        assert!(error.contains("max_conections") && error.contains("max_connections"), "{error}");
        let error = Profile::from_toml("base = \"hc2\"").unwrap_err().to_string();
        assert_eq!(error, "base: `hc2` is not known; nearest: `hc1`");
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
