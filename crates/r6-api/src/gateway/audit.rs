//! What happens at robots: events for streams, and records for the audit log.

use serde::{Deserialize, Serialize};

use super::{
    ActedBy, GlobalSpeed, IdentityChange, RobotIdentity, Role, RunEnd, RunState, Shift, UnseenBecause,
};
use crate::Code;

/// Something that happened, in the stream of `GET /v1/events`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Event {
    /// Its number; the next event has the next number. Numbers begin anew when the gateway starts.
    pub id: u64,
    /// When.
    pub time: String,
    /// The robot.
    pub robot: String,
    /// What.
    #[serde(flatten)]
    pub happened: Happened,
}

/// What happened to a robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Happened {
    /// It was added to the gateway.
    RobotAdded {},
    /// Its address, or what is read of it, was changed. Its lease has ended.
    RobotChanged {},
    /// It was removed from the gateway.
    RobotRemoved {},
    /// It answers, and its state was read.
    LinkUp {},
    /// There is no connection, or nothing comes back over it.
    LinkDown {},
    /// Another robot than before answers at its address.
    IdentityChanged(IdentityChange),
    /// An engineer accepted the robot that answers.
    IdentityAccepted {
        /// The robot.
        identity: RobotIdentity,
    },
    /// A lease began.
    LeaseBegan {
        /// Its number.
        lease: u64,
        /// Its holder.
        holder: String,
    },
    /// A lease ended.
    LeaseEnded {
        /// Its number.
        lease: u64,
        /// Who held it.
        holder: String,
        /// Why.
        cause: LeaseEnd,
    },
    /// A stop was asked for.
    StopBegan {
        /// By which user, token or raw client.
        by: String,
        /// Whether it holds until it is cleared. A stop by which the gateway ends a run does not.
        #[serde(default)]
        #[cfg_attr(feature = "openapi", schema(required = true))]
        holds: bool,
    },
    /// A stop came to its end.
    StopEnded {
        /// Whether it is proved that the arm stands; for one command that stops, or an action at the panel,
        /// whether it was accepted.
        confirmed: bool,
    },
    /// The holder of the lease cleared the stop.
    StopCleared {},
    /// A command is being sent.
    CommandBegan {
        /// The number of the command.
        command_id: u64,
        /// The command.
        command: String,
    },
    /// A command came to its end.
    CommandEnded {
        /// The number of the command.
        command_id: u64,
        /// How.
        outcome: CommandOutcome,
    },
    /// A run of a program began: its first list is being sent.
    RunBegan {
        /// The number of the run.
        run_id: u64,
        /// The name of the program; `null` if its text was sent.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        program: Option<String>,
        /// The steps of all rounds.
        steps: usize,
    },
    /// More steps of a run are done. It is told once a second at most.
    RunProgress {
        /// The number of the run.
        run_id: u64,
        /// How many steps the controller accepted.
        accepted: usize,
        /// How many steps are done.
        done: usize,
    },
    /// A run of a program ended.
    RunEnded {
        /// The number of the run.
        run_id: u64,
        /// How.
        state: RunState,
        /// Why.
        because: RunEnd,
        /// Who stopped the robot, and when, if `because` is `stop` or `lease_taken`; `null` otherwise.
        #[serde(default)]
        #[cfg_attr(feature = "openapi", schema(required = true))]
        stopped_by: Option<ActedBy>,
        /// How many steps are done, as far as was seen.
        done: usize,
    },
    /// The global speed was set over the gateway, or it is not known any more which one was set.
    GlobalSpeed {
        /// The speed; `null` if it is not known.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        set: Option<GlobalSpeed>,
    },
    /// `curAlarm` became this code.
    AlarmBegan {
        /// The code.
        code: u32,
        /// Its meaning, in a few words.
        text: String,
        /// What to do about it.
        remedy: String,
    },
    /// `curAlarm` is not this code any more.
    AlarmEnded {
        /// The code.
        code: u32,
        /// Its meaning, in a few words.
        text: String,
        /// For how long it was read; `null` if its begin was not seen.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        lasted_ms: Option<u64>,
    },
    /// Somebody acknowledged an alarm. Nothing changed at the robot.
    AlarmAcknowledged {
        /// The number of the alarm.
        alarm: u64,
        /// Its code.
        code: u32,
        /// Its meaning, in a few words.
        text: String,
        /// Who acknowledged it.
        by: String,
        /// What they said; `null` if nothing.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        comment: Option<String>,
    },
    /// The alarms of a code were shelved. Nothing changed at the robot. The end of the time has no event.
    AlarmShelved {
        /// The code.
        code: u32,
        /// Its meaning, in a few words.
        text: String,
        /// Who shelved it.
        by: String,
        /// Until when.
        until: String,
        /// Why.
        reason: String,
    },
    /// The alarms of a code were taken from the shelf.
    AlarmUnshelved {
        /// The code.
        code: u32,
        /// Its meaning, in a few words.
        text: String,
        /// Who took it away.
        by: String,
    },
    /// `curMode` changed.
    ModeChanged {
        /// The mode before.
        from: i64,
        /// The mode from now on.
        to: i64,
    },
    /// `curMold` changed.
    ProgramChanged {
        /// The program before.
        from: String,
        /// The program from now on.
        to: String,
    },
    /// A cycle ended since the last reading: `lastCycle` and `curCycle` say so.
    CycleDone {
        /// How many cycles are proved to have ended.
        count: u64,
        /// Whether more may have ended: the last one was shorter than the time between the two readings.
        at_least: bool,
        /// How long it took, from `lastCycle`; `null` if more may have ended.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        ms: Option<u64>,
        /// The last moment when it can have ended. It counts from the reply, so it may be behind `time`.
        at: String,
    },
    /// The counter of parts grew.
    Parts {
        /// The address of the counter, such as `counter-4`.
        counter: String,
        /// By how much.
        added: u64,
        /// What it counts now.
        total: i64,
    },
    /// The counter of parts went back. Parts between the last reading and the reset were not seen.
    PartsReset {
        /// The address of the counter.
        counter: String,
        /// What it counted before.
        from: i64,
        /// What it counts now.
        to: i64,
    },
    /// Nothing came back from the robot when it was due, or its connection ended. In streams, `link_down`
    /// says that.
    LinkLost {},
    /// The robot answers again. In streams, `link_up` says that.
    LinkBack {},
    /// More happened in this second than is told live. The history has all of it.
    MoreHappened {},
    /// The gateway did not see the robot for a time. What changed meanwhile has no event.
    Unseen {
        /// The last reading before; `null` if the gateway does not know since when.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        from: Option<String>,
        /// The first reading after.
        to: String,
        /// Why.
        because: UnseenBecause,
    },
}

/// A rule for clients of raw ports.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RawPortRule {
    /// The address or the network that it is for.
    pub source: String,
    /// The only robot that it is for; `null` for all.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub only: Option<String>,
    /// `deny`, `read` or `command`.
    pub allow: String,
    /// The highest global speed that these sources may set, in percent; absent without a limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_global_speed: Option<f64>,
    /// The highest speed of moves in their lists, in percent; absent without a limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_speed: Option<f64>,
    /// The highest path speed in their lists, in mm/s; absent without a limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_path_speed: Option<u32>,
}

/// Why a lease ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum LeaseEnd {
    /// Its holder gave it back.
    Released,
    /// Its holder did not renew it.
    Expired,
    /// An admin took it.
    Taken,
    /// Another robot answers.
    IdentityChanged,
    /// The address of the robot, or what is read of it, was changed.
    Reconfigured,
    /// The robot was removed from the gateway.
    Removed,
    /// The gateway ended in order.
    GatewayEnded,
}

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum CommandOutcome {
    /// The controller accepted it.
    Accepted,
    /// The controller refused it.
    Refused,
    /// Nothing reached the controller.
    NotSent,
    /// It left, and no usable answer came: the controller may have acted.
    Unknown,
}

/// A page of the audit log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Audit {
    /// The entries that the token may see, oldest first.
    pub entries: Vec<AuditEntry>,
    /// Ask for the entries after this number to read on; `null` at the end.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub next_after: Option<u64>,
}

/// The signed end of the audit log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct AuditHead {
    /// The number of the last entry.
    pub number: u64,
    /// Its hash.
    pub hash: String,
    /// When it was signed: RFC 3339, UTC.
    pub time: String,
    /// The three above, signed: a C2SP signed note. Keep it on another machine.
    pub note: String,
    /// The public key that checks the note. Keep it too, once.
    pub key: String,
}

/// An entry of the audit log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct AuditEntry {
    /// Its number, without a gap.
    pub number: u64,
    /// What it says.
    #[serde(flatten)]
    pub record: AuditRecord,
    /// SHA-256 over the hash of the entry before, the number and the text of this one.
    pub hash: String,
}

/// What an entry of the audit log says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct AuditRecord {
    /// When.
    pub time: String,
    /// The name of a user; the number and the name of a token; `raw`, the address and the rule for a raw
    /// client; `gateway` for the gateway itself; `shell` for the command line; `link` for a one-time link.
    pub actor: String,
    /// The address that the request came from; `null` if there was none.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub source: Option<String>,
    /// The robot; `null` if it is about none.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub robot: Option<String>,
    /// What.
    #[serde(flatten)]
    pub deed: Deed,
}

/// What the audit log tells of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(tag = "what", rename_all = "snake_case")]
pub enum Deed {
    /// The gateway started.
    GatewayStarted {},
    /// The gateway ended in order.
    GatewayEnded {},
    /// The folder was made of a backup: what happened after it was made is not in this log. A stop holds for
    /// each robot.
    Restored {
        /// When the backup was made: RFC 3339, UTC.
        made: String,
        /// How many entries its log has.
        entries: u64,
    },
    /// The heads of the audit log are signed with this key from now on: at the first start, after a restore,
    /// and if the file `audit.key` was lost or exchanged.
    AuditKey {
        /// The public key.
        key: String,
    },
    /// A token was made.
    TokenMade {
        /// Its number.
        token: i64,
        /// Its role.
        role: Role,
        /// The robot that it is for; `null` for all. Not to be confused with the robot of the entry.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        only: Option<String>,
        /// Its name.
        name: String,
    },
    /// A token was revoked.
    TokenRevoked {
        /// Its number.
        token: i64,
    },
    /// A user was made.
    UserMade {
        /// The name.
        user: String,
        /// The role.
        role: Role,
        /// The only robot; `null` for all. Not to be confused with the robot of the entry.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        only: Option<String>,
        /// Whether the user cannot sign in.
        disabled: bool,
    },
    /// A user is as this from now on. All sessions of the user have ended, except the session that changed
    /// its own password.
    UserChanged {
        /// The name.
        user: String,
        /// The role.
        role: Role,
        /// The only robot; `null` for all. Not to be confused with the robot of the entry.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        only: Option<String>,
        /// Whether the user cannot sign in.
        disabled: bool,
        /// Whether the password is a new one.
        new_password: bool,
    },
    /// A user was removed.
    UserRemoved {
        /// The name.
        user: String,
    },
    /// A one-time link was made.
    LinkMade {
        /// The user who can set a password with it; `null` for the link that makes the first admin.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        user: Option<String>,
    },
    /// The actor signed in.
    SignedIn {},
    /// The actor signed out.
    SignedOut {},
    /// Somebody tried to sign in as a user, and did not have the password or may not. Later tries within a
    /// minute stand in one entry.
    SignInFailed {
        /// The user.
        user: String,
        /// How many tries.
        times: u64,
    },
    /// A lease began.
    LeaseBegan {
        /// Its number.
        lease: u64,
        /// Why it was taken from its holder; `null` if it was free.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        taken_because: Option<String>,
    },
    /// A lease ended. The actor is the caller who gave it back, and `gateway` for all other causes.
    LeaseEnded {
        /// Its number.
        lease: u64,
        /// Who held it; empty in entries from before this was noted.
        #[serde(default)]
        holder: String,
        /// Why.
        cause: LeaseEnd,
    },
    /// A command will be sent. Its outcome follows in another entry.
    CommandIntent {
        /// The command as it will be sent; or `panel` and an action at the panel of a virtual robot.
        command: String,
        /// The lease.
        lease: u64,
    },
    /// The outcome of a command.
    CommandOutcome {
        /// The number of the intent.
        intent: u64,
        /// How it ended.
        outcome: CommandOutcome,
        /// The details, for people.
        detail: String,
    },
    /// A program will be run: its first list will be sent. Its outcome follows in another entry.
    RunIntent {
        /// The number of the run.
        run: u64,
        /// The name of the program; `null` if its text was sent.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        program: Option<String>,
        /// The version of the program; `null` if its text was sent.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        version: Option<u64>,
        /// SHA-256 of its text.
        sha256: String,
        /// How often it runs.
        repeat: u32,
        /// The steps of all rounds.
        steps: usize,
        /// The lease.
        lease: u64,
    },
    /// The outcome of a run.
    RunOutcome {
        /// The number of the run.
        run: u64,
        /// How it ended.
        state: RunState,
        /// Why.
        because: RunEnd,
        /// How many steps are done, as far as was seen.
        done: usize,
        /// The details, for people.
        detail: String,
    },
    /// A request was refused.
    Refused {
        /// What was asked for.
        request: String,
        /// The code of the problem.
        code: Code,
    },
    /// A stop was asked for. Its outcome follows in another entry.
    StopBegan {
        /// What is sent: `stop`, the word of a command that stops, or `panel` and an action at the panel.
        request: String,
    },
    /// The robot was stopped, or that was tried.
    Stop {
        /// What was sent: `stop`, the word of a command that stops, or `panel` and an action at the panel.
        request: String,
        /// Whether it is proved that the arm stands; for a command, whether the controller accepted it.
        confirmed: bool,
        /// The details, for people.
        detail: String,
    },
    /// The holder of the lease cleared the stop.
    StopCleared {
        /// The lease.
        lease: u64,
    },
    /// Another robot than before answers.
    IdentityChanged(IdentityChange),
    /// An engineer accepted the robot that answers.
    IdentityAccepted {
        /// The robot.
        identity: RobotIdentity,
    },
    /// The robot was added or changed.
    RobotConfigured {
        /// Host and port.
        address: String,
        /// How often its values are read.
        period_ms: u64,
        /// The addresses that are read besides the usual ones.
        read: Vec<String>,
        /// The model of its arm; absent if none is configured.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        model: Option<String>,
    },
    /// The robot was removed.
    RobotRemoved {},
    /// An alarm was acknowledged.
    AlarmAcknowledged {
        /// Its number.
        alarm: u64,
        /// Its code.
        code: u32,
        /// What was said about it; `null` if nothing.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        comment: Option<String>,
    },
    /// The alarms of a code were shelved.
    AlarmShelved {
        /// The code.
        code: u32,
        /// Until when.
        until: String,
        /// Why.
        reason: String,
    },
    /// The alarms of a code were taken from the shelf.
    AlarmUnshelved {
        /// The code.
        code: u32,
    },
    /// These rules hold for the clients of raw ports from now on.
    RawRules {
        /// The rules, in their order: the first that fits decides.
        rules: Vec<RawPortRule>,
        /// How many more rules there are: the first 100 are told.
        more: usize,
    },
    /// The settings of the hall are these from now on.
    SettingsChanged {
        /// The number of their version.
        version: u64,
        /// The time zone.
        time_zone: String,
        /// The shifts.
        shifts: Vec<Shift>,
    },
    /// A version of a program was stored.
    ProgramStored {
        /// The name of the program.
        program: String,
        /// The number of the version.
        version: u64,
        /// SHA-256 of its text.
        sha256: String,
    },
    /// A program was removed with all of its versions.
    ProgramRemoved {
        /// The name of the program.
        program: String,
        /// The number of its latest version.
        version: u64,
    },
}
