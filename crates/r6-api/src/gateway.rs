//! The types of the gateway over HTTP: robots and their values, leases, commands, stops, events, the audit
//! log.
//!
//! Times are RFC 3339 in UTC with microseconds. Durations end in `_ms`.

use serde::{Deserialize, Serialize};

/// What a token allows. Each role allows everything that the roles before it allow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Reads values, states and events.
    Viewer,
    /// Stops robots; with a lease, sends commands.
    Operator,
    /// Accepts a robot that was exchanged; reads the audit log.
    Engineer,
    /// Takes a lease away from its holder.
    Admin,
}

impl Role {
    /// All roles, from the least rights to the most.
    pub const ALL: [Self; 4] = [Self::Viewer, Self::Operator, Self::Engineer, Self::Admin];

    /// Its word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Viewer => "viewer",
            Self::Operator => "operator",
            Self::Engineer => "engineer",
            Self::Admin => "admin",
        }
    }
}

/// All robots of the gateway that the token may see.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Robots {
    /// In the order of their names.
    pub robots: Vec<RobotSummary>,
}

/// One robot without its values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotSummary {
    /// Its name at the gateway.
    #[cfg_attr(feature = "openapi", schema(example = "press-4"))]
    pub name: String,
    /// Host and port, as configured.
    #[cfg_attr(feature = "openapi", schema(example = "192.168.1.10:9760"))]
    pub address: String,
    /// Who may change its address and what is read of it.
    pub managed_by: ManagedBy,
    /// Whether it can be reached.
    pub link: RobotLink,
    /// What it says of itself; `null` until it was read.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub identity: Option<RobotIdentity>,
    /// Set if another robot than before answers at this address. Commands are refused until an engineer
    /// accepts it.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub identity_changed: Option<IdentityChange>,
    /// Whether its name says that it is not a real machine; `null` until its name was read.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub r#virtual: Option<bool>,
    /// Who may send commands now; `null` if the lease is free.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub lease: Option<LeaseHolder>,
    /// Whether a stop was asked for and not cleared: commands that can move the robot are refused.
    pub stopped: bool,
    /// How many stops are under way now.
    pub stops_under_way: u32,
}

/// Where a robot is configured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum ManagedBy {
    /// In the file or on the command line of the gateway.
    File,
    /// An admin added it through the API.
    Api,
}

/// A robot to look after.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct RobotWanted {
    /// Host and port; 9760 if there is no port.
    #[cfg_attr(feature = "openapi", schema(example = "192.168.1.10"))]
    pub address: String,
    /// How often its values are read: 20 to 3 600 000 ms; 100 if it is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(minimum = 20, maximum = 3_600_000, example = 100))]
    pub period_ms: Option<u64>,
    /// Query addresses to read besides the usual ones, 200 at most.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(max_items = 200))]
    pub read: Vec<String>,
}

/// Whether a robot can be reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum RobotLink {
    /// It answers, and its state was read on this connection.
    Up,
    /// There is no connection, or nothing comes back over it.
    Down,
}

/// What a controller reports about itself. A part is `null` if the controller has no such value.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct RobotIdentity {
    /// `version`.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub firmware: Option<String>,
    /// `machineName`.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub machine_name: Option<String>,
    /// `axisNum`.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub axis_count: Option<i64>,
}

/// Another robot than before answers at an address.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct IdentityChange {
    /// The robot that this name stands for.
    pub expected: RobotIdentity,
    /// The robot that answers.
    pub found: RobotIdentity,
}

/// Who holds a lease. The secret is known to the holder alone.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LeaseHolder {
    /// Its number. A robot's next lease has a higher one.
    pub number: u64,
    /// The token of the holder: its number and name.
    pub holder: String,
    /// How long it lasts unless it is renewed.
    pub expires_in_ms: u64,
}

/// One robot with its values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotState {
    /// All but the values.
    #[serde(flatten)]
    pub summary: RobotSummary,
    /// How often the values are read.
    pub period_ms: u64,
    /// The number of the last change of a value, as in `GET /v1/live`.
    pub number: u64,
    /// The values, in the order in which they are read.
    pub signals: Vec<Signal>,
}

/// A value that is read again and again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Signal {
    /// The query address.
    #[cfg_attr(feature = "openapi", schema(example = "axis-0"))]
    pub address: String,
    /// The last value that was read; `null` without a value.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub value: Option<SignalValue>,
    /// The unit; `null` if the value has none, or if the protocol does not tell it.
    #[cfg_attr(feature = "openapi", schema(required = true, example = "mm"))]
    pub unit: Option<String>,
    /// Whether to act on the value.
    pub quality: SignalQuality,
    /// The time since the value was asked for; the value is no older. `null` without a value.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub age_ms: Option<u64>,
}

/// The value of an address.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(untagged)]
pub enum SignalValue {
    /// A flag.
    Flag(bool),
    /// A whole number, or 32 points as bits.
    Integer(i64),
    /// A decimal number.
    Decimal(f64),
    /// A text.
    Text(String),
    /// A list of texts.
    Texts(Vec<String>),
    /// A counter.
    Counter(CounterValue),
}

/// A counter of the controller.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[expect(missing_docs, reason = "the names say it")]
pub struct CounterValue {
    pub id: i64,
    pub target: i64,
    pub current: i64,
}

/// How much a value can be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum SignalQuality {
    /// It was read when it was due, over the connection that is alive now.
    Fresh,
    /// It is late, or it was read over an earlier connection.
    Stale,
    /// There is no value: it was not read yet, the controller does not have it, or it cannot be parsed.
    None,
}

/// A request for a lease. An empty object asks for a new lease of 10 s.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LeaseRequest {
    /// How long it lasts, 2 000 to 300 000 ms; 10 000 if it is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(minimum = 2_000, maximum = 300_000, example = 10_000))]
    pub duration_ms: Option<u64>,
    /// Renews the lease that the caller holds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub renew: Option<LeaseKey>,
    /// Takes the lease from its holder, for this reason: the robot is stopped first. Admins only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(max_length = 200))]
    pub take_because: Option<String>,
}

/// What proves that the caller holds a lease.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LeaseKey {
    /// The number of the lease.
    pub number: u64,
    /// The secret that the gateway gave out with it.
    pub secret: String,
}

/// A lease, as its holder gets it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Lease {
    /// What to send with each command.
    pub lease: LeaseKey,
    /// How long it lasts unless it is renewed.
    pub expires_in_ms: u64,
    /// Whether the robot is stopped. Clear that before a command that can move it.
    pub stopped: bool,
}

/// A request that needs the lease and nothing else.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct WithLease {
    /// The lease of the caller.
    pub lease: LeaseKey,
}

/// One command for a robot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CommandRequest {
    /// The word of the command, as in `r6 command --list`.
    #[cfg_attr(feature = "openapi", schema(example = "modifyGSPD"))]
    pub command: String,
    /// Its arguments, in the units of `r6 command --list`.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(max_items = 128))]
    pub arguments: Vec<String>,
    /// The lease of the caller. Commands that stop need none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lease: Option<LeaseKey>,
    /// Send a command that starts the machine even if instructions are left in its list.
    #[serde(default)]
    pub run_leftover: bool,
}

/// The controller accepted a command. This does not mean that the arm moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CommandDone {
    /// The number of the command: of its intent in the audit log. `null` for a stop, which does not wait for
    /// the log.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub command_id: Option<u64>,
    /// The command as it was sent.
    pub sent: String,
    /// How long the controller took to answer.
    pub after_ms: f64,
}

/// The arm stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Stopped {
    /// Always `true`: a stop that is not proved is answered with the problem `not_stopped`.
    pub confirmed: bool,
    /// The time until the standstill was proved.
    pub took_ms: f64,
}

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
        /// Why.
        cause: LeaseEnd,
    },
    /// A stop was asked for.
    StopBegan {
        /// By which token.
        by: String,
    },
    /// A stop came to its end.
    StopEnded {
        /// Whether it is proved that the arm stands.
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
    /// The token, its number and name; `gateway` for the gateway itself; `shell` for the command line.
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
    /// A lease began.
    LeaseBegan {
        /// Its number.
        lease: u64,
        /// Why it was taken from its holder; `null` if it was free.
        #[cfg_attr(feature = "openapi", schema(required = true))]
        taken_because: Option<String>,
    },
    /// A lease ended.
    LeaseEnded {
        /// Its number.
        lease: u64,
        /// Why.
        cause: LeaseEnd,
    },
    /// A command will be sent. Its outcome follows in another entry.
    CommandIntent {
        /// The command as it will be sent.
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
    /// A request was refused.
    Refused {
        /// What was asked for.
        request: String,
        /// The code of the problem.
        code: crate::Code,
    },
    /// A stop was asked for. Its outcome follows in another entry.
    StopBegan {
        /// What is sent: `stop`, or the word of a command that stops.
        request: String,
    },
    /// The robot was stopped, or that was tried.
    Stop {
        /// What was sent: `stop`, or the word of a command that stops.
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
    },
    /// The robot was removed.
    RobotRemoved {},
}

/// A message in the stream of `GET /v1/live`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LiveChange {
    /// The robot.
    pub robot: String,
    /// The number of the robot's last change in this message. A slow reader gets the latest values, and
    /// numbers in between are left out.
    pub number: u64,
    /// The values that changed.
    pub signals: Vec<Signal>,
}

/// The last message about a robot in the stream of `GET /v1/live`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LiveRemoved {
    /// The robot, which was removed from the gateway.
    pub robot: String,
}

/// Whether the gateway is ready.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Ready {
    /// Whether the store can be written.
    pub store: bool,
    /// How many robots are configured.
    pub robots: usize,
    /// How many of them are up.
    pub robots_up: usize,
}
