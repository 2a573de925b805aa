//! Reads the file of a profile.

use std::time::Duration;

use r6_motion::Turning;
use r6_program::Mistakes;
use r6_program::form::{self, Fields, Node};
use r6_proto::address::ADDRESSES;
use r6_proto::alarm::AlarmCode;
use r6_proto::dialect::{CommandReplyForm, CounterForm, KeyOrder, ReplyType};
use r6_proto::message::command::COMMANDS;
use r6_proto::{CommandName, Port};

use super::{
    IdleSingleCycle, LoneCurve, MissingOneshot, PathSpeedAnswer, Profile, ReplaceInMotion, SignalStop,
    StopButton, StopMode, Unarmed,
};

const PORTS: [(&str, Port); 2] = [("mainboard", Port::Mainboard), ("pendant", Port::Pendant)];

const KEY_ORDERS: [(&str, KeyOrder); 2] =
    [("alphabetical", KeyOrder::Alphabetical), ("manual", KeyOrder::Manual)];

const REPLY_TYPES: [(&str, ReplyType); 3] =
    [("as-sent", ReplyType::AsSent), ("templates", ReplyType::Templates), ("echo", ReplyType::Echo)];

const COMMAND_REPLIES: [(&str, CommandReplyForm); 2] =
    [("verdict", CommandReplyForm::Verdict), ("name-and-verdict", CommandReplyForm::NameAndVerdict)];

const COUNTER_FORMS: [(&str, CounterForm); 3] =
    [("numbers", CounterForm::Numbers), ("texts", CounterForm::Texts), ("old-text", CounterForm::OldText)];

const UNARMED: [(&str, Unarmed); 3] =
    [("refuse", Unarmed::Refuse), ("silent", Unarmed::Silent), ("arm", Unarmed::Arm)];

const REPLACE_IN_MOTION: [(&str, ReplaceInMotion); 2] =
    [("alarm200", ReplaceInMotion::Alarm200), ("take-over", ReplaceInMotion::TakeOver)];

const TURNINGS: [(&str, Turning); 2] = [("shortest", Turning::Shortest), ("as-told", Turning::AsTold)];

const LONE_CURVES: [(&str, LoneCurve); 2] = [("skip", LoneCurve::Skip), ("run", LoneCurve::Run)];

const PATH_SPEED_ANSWERS: [(&str, PathSpeedAnswer); 2] =
    [("ok", PathSpeedAnswer::Ok), ("err", PathSpeedAnswer::Err)];

const SIGNAL_STOPS: [(&str, SignalStop); 2] = [("level", SignalStop::Level), ("edge", SignalStop::Edge)];

const MISSING_ONESHOT: [(&str, MissingOneshot); 2] =
    [("keep", MissingOneshot::Keep), ("remove", MissingOneshot::Remove)];

const IDLE_SINGLE_CYCLES: [(&str, IdleSingleCycle); 2] =
    [("wait", IdleSingleCycle::Wait), ("end", IdleSingleCycle::End)];

const STOP_MODES: [(&str, StopMode); 2] = [("auto", StopMode::Auto), ("stop", StopMode::Stop)];

const STOP_BUTTONS: [(&str, StopButton); 2] =
    [("finish-cycle", StopButton::FinishCycle), ("at-once", StopButton::AtOnce)];

/// Overwrites a setting if the file has it.
fn set<T>(setting: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *setting = value;
    }
}

/// Reads a profile from a file: its base profile, with single settings changed.
pub(super) fn read(text: &str) -> Result<Profile, Mistakes> {
    let (document, mut found) = form::parse(text);
    let fields = Fields::of(&document, &[], "");
    let bases = Profile::names().map(|name| (name, name));
    let base = fields.word("base", &bases).and_then(Profile::named);
    let mut profile = base.unwrap_or_else(Profile::hc1);
    let text = |name| fields.text(name, "a text").map(str::to_owned);
    let ms = |name| fields.whole(name, u64::MAX >> 1).map(Duration::from_millis);
    // 0 means no limit.
    let limit = |name| fields.whole(name, usize::MAX >> 1).map(|bytes| (bytes > 0).then_some(bytes));
    set(&mut profile.name, text("name"));
    set(&mut profile.version, text("version"));
    set(&mut profile.port, fields.word("port", &PORTS));
    set(&mut profile.dialect.key_order, fields.word("key_order", &KEY_ORDERS));
    set(&mut profile.dialect.reply_type, fields.word("reply_type", &REPLY_TYPES));
    set(&mut profile.dialect.command_reply, fields.word("command_reply", &COMMAND_REPLIES));
    set(&mut profile.dialect.echo_pack_id, fields.flag("echo_pack_id"));
    set(&mut profile.dialect.echo_query_addr, fields.flag("echo_query_addr"));
    set(&mut profile.dialect.counter, fields.word("counter_form", &COUNTER_FORMS));
    let addresses = ADDRESSES.map(|row| row.name);
    let is_address = |name: &str| addresses.contains(&name);
    set(&mut profile.unsupported_addresses, names(&fields, "unsupported_addresses", &addresses, is_address));
    let commands = COMMANDS.map(|row| row.word);
    let is_command = |word: &str| CommandName::exact(word.as_bytes()).is_some();
    set(&mut profile.unsupported_commands, names(&fields, "unsupported_commands", &commands, is_command));
    let actions =
        fields.optional("unsupported_actions", "numbers of actions in brackets, such as [51]", |value| {
            value.list()?.iter().map(Node::whole).collect()
        });
    set(&mut profile.unsupported_actions, actions);
    set(&mut profile.checks_arguments, fields.flag("checks_arguments"));
    set(&mut profile.add_rcc_silent_over, limit("add_rcc_silent_over"));
    set(&mut profile.add_rcc_reset_over, limit("add_rcc_reset_over"));
    set(&mut profile.add_rcc_ack, ms("add_rcc_ack_ms"));
    set(&mut profile.add_rcc_ack_spread, ms("add_rcc_ack_spread_ms"));
    set(&mut profile.add_rcc_unarmed, fields.word("add_rcc_unarmed", &UNARMED));
    set(&mut profile.replace_in_motion, fields.word("replace_in_motion", &REPLACE_IN_MOTION));
    set(&mut profile.turning, fields.word("turning", &TURNINGS));
    set(&mut profile.lone_curve, fields.word("lone_curve", &LONE_CURVES));
    set(&mut profile.path_speed_answer, fields.word("path_speed_answer", &PATH_SPEED_ANSWERS));
    set(&mut profile.signal_stop, fields.word("signal_stop", &SIGNAL_STOPS));
    set(&mut profile.signal_stop_outlives_list, fields.flag("signal_stop_outlives_list"));
    set(&mut profile.oneshot_missing, fields.word("oneshot_missing", &MISSING_ONESHOT));
    set(&mut profile.moving_in_delay, fields.flag("moving_in_delay"));
    set(&mut profile.idle_single_cycle, fields.word("idle_single_cycle", &IDLE_SINGLE_CYCLES));
    let connections = "a whole number, 1 or more: 0 would serve no client";
    set(&mut profile.max_connections, fields.whole_in("max_connections", connections, 1..=usize::MAX));
    set(&mut profile.answers_heartbreak, fields.flag("answers_heartbreak"));
    set(&mut profile.dialect.says_virtual, fields.flag("says_virtual"));
    set(&mut profile.accepts_heartbreak_command, fields.flag("accepts_heartbreak_command"));
    set(&mut profile.heartbeat_timeout, ms("heartbeat_timeout_ms"));
    set(&mut profile.heartbeat_alarm, fields.whole("heartbeat_alarm", u32::MAX).map(AlarmCode));
    set(&mut profile.action_stop_time, ms("action_stop_ms"));
    set(&mut profile.action_stop_alarm, fields.whole("action_stop_alarm", u32::MAX).map(AlarmCode));
    set(&mut profile.action_stop_mode, fields.word("action_stop_mode", &STOP_MODES));
    set(&mut profile.action_pause_time, ms("action_pause_ms"));
    set(&mut profile.stop_button, fields.word("stop_button", &STOP_BUTTONS));
    set(&mut profile.counter_target_writable, fields.flag("counter_target_writable"));
    set(&mut profile.m_output_writable, fields.flag("m_output_writable"));
    let profile = fields.finish(Ok(profile), &mut found);
    found.finish(profile)
}

/// Names of the protocol, in brackets. An unknown name is reported with the nearest known one.
fn names(
    fields: &Fields<'_>,
    key: &'static str,
    known: &[&'static str],
    is_known: impl Fn(&str) -> bool,
) -> Option<Vec<String>> {
    let wanted = format!("names in brackets, such as [\"{}\"]", known.first()?);
    let list = fields.optional(key, &wanted, |value| {
        value.list()?.iter().map(|name| name.text().map(str::to_owned)).collect::<Option<Vec<_>>>()
    })?;
    for name in list.iter().filter(|name| !is_known(name)) {
        let near = r6_proto::nearest(name, known.iter().copied());
        let near = near.map(|near| format!("; nearest: `{near}`")).unwrap_or_default();
        let name: String = name.chars().take(40).collect();
        fields.wrong(key, format!("`{key}`: `{name}` is not known{near}"));
    }
    Some(list)
}
