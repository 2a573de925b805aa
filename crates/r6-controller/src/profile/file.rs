//! The TOML file of a profile.

use std::time::Duration;

use r6_motion::Turning;
use r6_proto::address::ADDRESSES;
use r6_proto::dialect::{CommandReplyForm, CounterForm, KeyOrder, ReplyType};
use r6_proto::message::command::COMMANDS;
use r6_proto::{CommandName, Port};
use serde::Deserialize;

use super::{
    IdleSingleCycle, LoneCurve, MissingOneshot, PathSpeedAnswer, Profile, ProfileError, ReplaceInMotion,
    SignalStop, StopButton, StopMode, Unarmed,
};

/// The profile that a file describes.
pub(super) fn read(text: &str) -> Result<Profile, ProfileError> {
    let file: ProfileFile = toml::from_str(text).map_err(|error| ProfileError(error.to_string()))?;
    file.apply()
}

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
    lone_curve: Option<LoneCurve>,
    path_speed_answer: Option<PathSpeedAnswer>,
    signal_stop: Option<SignalStop>,
    signal_stop_outlives_list: Option<bool>,
    oneshot_missing: Option<MissingOneshot>,
    moving_in_delay: Option<bool>,
    idle_single_cycle: Option<IdleSingleCycle>,
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
        set(&mut profile.lone_curve, self.lone_curve);
        set(&mut profile.path_speed_answer, self.path_speed_answer);
        set(&mut profile.signal_stop, self.signal_stop);
        set(&mut profile.signal_stop_outlives_list, self.signal_stop_outlives_list);
        set(&mut profile.oneshot_missing, self.oneshot_missing);
        set(&mut profile.moving_in_delay, self.moving_in_delay);
        set(&mut profile.idle_single_cycle, self.idle_single_cycle);
        if self.max_connections == Some(0) {
            let why = "0 would serve nobody, and it has to be 1 or more";
            return Err(ProfileError(format!("max_connections: {why}")));
        }
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
