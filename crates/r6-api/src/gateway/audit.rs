//! The audit log.

use serde::{Deserialize, Serialize};

use super::{
    CommandOutcome, GuardWanted, IdentityChange, LeaseEnd, PollGroup, RobotIdentity, Role, RunEnd, RunState,
    Shift,
};
use crate::Code;

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
    /// The only commands and requests that these sources may send of those that need the lease; absent
    /// without a limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub commands: Option<Vec<String>>,
    /// The only programs of the controller that these sources may switch to and start; absent without a
    /// limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub programs: Option<Vec<String>>,
    /// The highest global speed that these sources may set, in percent; absent without a limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_global_speed: Option<f64>,
    /// The highest speed of moves in their lists, in percent; absent without a limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_speed: Option<f64>,
    /// The highest path speed in their lists, in mm/s; absent without a limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_path_speed: Option<u32>,
    /// The cameras as which they may send points and answer photos; absent without any.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<u16>,
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
    /// A gateway started.
    GatewayStarted {
        /// Its URL, if several gateways share a database; else `null`.
        #[serde(default)]
        #[cfg_attr(feature = "openapi", schema(required = true, example = "https://gateway-2:9780"))]
        url: Option<String>,
    },
    /// A gateway ended in order.
    GatewayEnded {
        /// Its URL, if several gateways share a database; else `null`.
        #[serde(default)]
        #[cfg_attr(feature = "openapi", schema(required = true, example = "https://gateway-2:9780"))]
        url: Option<String>,
    },
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
        /// When it ends; absent if it holds until it is revoked.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        expires_at: Option<String>,
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
        /// The robots, as `robot` of the user has them; `null` for all. Not to be confused with the robot of
        /// the entry.
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
        /// The robots, as `robot` of the user has them; `null` for all. Not to be confused with the robot of
        /// the entry.
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
        /// The command as it will be sent; `AddPoints`, the camera and the number of its points; or `panel`
        /// and an action at the panel of a virtual robot.
        command: String,
        /// The lease; 0 for the end of a fault and for points of a camera, which need none.
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
    /// An admin said that the arm is gone: a list of a run that may be at it is not stopped any more.
    OwedStopForgotten {
        /// Why.
        because: String,
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
        /// The values that are read with a period of their own.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        groups: Vec<PollGroup>,
        /// The model of its arm; absent if none is configured.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        model: Option<String>,
        /// The counter of parts; absent if none is configured.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        parts: Option<String>,
        /// The limits of its lists; absent if there are none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        guard: Option<Box<GuardWanted>>,
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
    /// All raw ports were closed or opened.
    RawPorts {
        /// Whether they are open from now on.
        open: bool,
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
    /// A token may send points as this camera of the robot from now on, without the lease.
    CameraGranted {
        /// The camera.
        camera: u16,
        /// The number of the token.
        token: i64,
    },
    /// A token may not send points as this camera of the robot any more. Without this entry, a grant ends
    /// with its token.
    CameraRevoked {
        /// The camera.
        camera: u16,
        /// The number of the token.
        token: i64,
    },
    /// A request for a photo will be answered. Controllers do not reply to that, so it has no outcome. If it
    /// is not sent in the end, `refused` follows.
    PhotoAnswer {
        /// The camera.
        camera: u16,
        /// Whether the picture was taken.
        taken: bool,
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
    /// A version of a point was stored.
    PointStored {
        /// The name of the point.
        point: String,
        /// The number of the version.
        version: u64,
        /// SHA-256 of its value.
        sha256: String,
    },
    /// A point was removed with all of its versions.
    PointRemoved {
        /// The name of the point.
        point: String,
        /// The number of its latest version.
        version: u64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_from_before_gateways_had_urls_are_read() {
        for (what, deed) in [
            ("gateway_started", Deed::GatewayStarted { url: None }),
            ("gateway_ended", Deed::GatewayEnded { url: None }),
        ] {
            let body =
                format!(r#"{{"time":"","actor":"gateway","source":null,"robot":null,"what":"{what}"}}"#);
            let record: AuditRecord = serde_json::from_str(&body).unwrap();
            assert_eq!(record.deed, deed);
        }
    }
}
