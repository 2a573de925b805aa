//! Robots, their values and their leases, as everybody may see them.

use std::fmt;

use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Serialize};

use crate::AddressValue;

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
    /// Host and port, as configured; `listen:ADDR:PORT,from:ADDR` of a robot that connects to the gateway.
    #[cfg_attr(feature = "openapi", schema(example = "192.168.1.10:9760"))]
    pub address: String,
    /// Who may change its address and what is read of it.
    pub managed_by: ManagedBy,
    /// The model of its arm; `null` if that is not configured. The protocol does not tell it.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true, example = "BRTIRUS0707A"))]
    pub model: Option<String>,
    /// The limits that each list over the gateway is checked against before it is sent; `null` if none are
    /// configured.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub guard: Option<RobotGuard>,
    /// The counter of parts, as configured, else the first counter that is read; `null` if none is.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true, example = "counter-0"))]
    pub parts: Option<String>,
    /// The robot that this virtual controller is the twin of, with `r6 gateway --twins`; `null` for every
    /// other robot.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub twin_of: Option<String>,
    /// The name of its twin, a virtual controller to try programs on; `null` if it has none.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true, example = "press-4-twin"))]
    pub twin: Option<String>,
    /// Whether the gateway reaches its panel, the person at the machine: twins and the robot of `r6 up` have
    /// one.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub panel: bool,
    /// The URL of the gateway that has the robot, if several share a database; `null` if none has it at the
    /// moment, as far as is known, and for a gateway with a store of its own.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true, example = "https://gateway-2:9780"))]
    pub owner: Option<String>,
    /// Whether it can be reached.
    pub link: RobotLink,
    /// What it says of itself; `null` until it was read.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub identity: Option<RobotIdentity>,
    /// Set if another robot than before answers at this address. Commands are refused until an engineer
    /// accepts it.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub identity_changed: Option<IdentityChange>,
    /// Whether its name says that it is not a real machine; `null` until its name was read. Always true for a
    /// twin.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub r#virtual: Option<bool>,
    /// Who may send commands now; `null` if the lease is free.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub lease: Option<LeaseHolder>,
    /// Whether a stop was asked for and not cleared: commands that can move the robot are refused.
    pub stopped: bool,
    /// Who made the stop that holds, and when: the first one since the last that was cleared. `null` if no
    /// stop holds, or if it is not known.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub stopped_by: Option<ActedBy>,
    /// How many stops are under way now.
    pub stops_under_way: u32,
    /// The number of its last stop that was told (`stop_began`), also if it was cleared: send it with
    /// `clear-stopped`, so that a stop that you have not seen is not cleared. Numbers only grow, and none
    /// comes twice, also not after a restart, unless the clock of the system was set back. A caller that
    /// stops a stopped robot again within a minute is told of once. Before the first one it is a number that
    /// no stop has.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub stop_number: u64,
    /// The global speed as it was last set over the gateway. The protocol does not tell it: a person at the
    /// pendant, or a program that is connected to the robot directly, can have set another one since. `null`
    /// if it was not set since the gateway started, if that is not sure, if the controller may have been
    /// switched off and on since (the link was down for a second), or if another robot answered.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub global_speed: Option<GlobalSpeed>,
}

/// Who did something, and when.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ActedBy {
    /// The name of the user; the number and the name of the token; `raw`, the address and the rule of a raw
    /// client; or `gateway`.
    #[cfg_attr(feature = "openapi", schema(example = "token 3 (op-2)"))]
    pub by: String,
    /// When.
    pub at: String,
}

/// A global speed that was set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct GlobalSpeed {
    /// Percent of the programmed speeds.
    #[cfg_attr(feature = "openapi", schema(example = 50.0))]
    pub percent: f64,
    /// Who set it: as in `stopped_by`.
    pub by: String,
    /// When the controller accepted it.
    pub at: String,
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct RobotWanted {
    /// Host and port; 9760 if there is no port. `listen:ADDR:PORT,from:ADDR` if the controller is in client
    /// mode: the gateway listens at the first for the robot at the second.
    #[cfg_attr(feature = "openapi", schema(example = "192.168.1.10"))]
    pub address: String,
    /// How often its values are read: 20 to 3 600 000 ms; 100 if it is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(minimum = 20, maximum = 3_600_000, example = 100))]
    pub period_ms: Option<u64>,
    /// Query addresses to read besides the usual ones, 200 at most. The first counter counts
    /// parts; after them, those of groups.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(max_items = 200))]
    pub read: Vec<String>,
    /// Values that are read with a period of their own: axes, the pose, and others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[cfg_attr(feature = "openapi", schema(max_items = 32))]
    pub groups: Vec<PollGroup>,
    /// The model of its arm, one of `r6 plot --help`: plans for this robot need it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(example = "BRTIRUS0707A"))]
    pub model: Option<String>,
    /// The counter of parts, `counter-n`; the first counter that is read if it is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(example = "counter-0"))]
    pub parts: Option<String>,
    /// The limits that each list over the gateway is checked against before it is sent; no limits if it is
    /// missing, also if the robot had some before.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "object")]
    pub guard: Option<GuardWanted>,
}

/// Limits that are named. Without this, a list of numbers would be taken in the order of the fields, and an
/// empty one would be no limits.
fn object<'de, D: serde::Deserializer<'de>>(field: D) -> Result<Option<GuardWanted>, D::Error> {
    field.deserialize_option(Named)
}

/// Reads an object with limits, or nothing.
struct Named;

impl<'de> Visitor<'de> for Named {
    type Value = Option<GuardWanted>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object with the names of the limits")
    }

    fn visit_none<E>(self) -> Result<Self::Value, E> {
        Ok(None)
    }

    fn visit_some<D: serde::Deserializer<'de>>(self, there: D) -> Result<Self::Value, D::Error> {
        there.deserialize_map(self)
    }

    fn visit_map<A: MapAccess<'de>>(self, limits: A) -> Result<Self::Value, A::Error> {
        GuardWanted::deserialize(MapAccessDeserializer::new(limits)).map(Some)
    }
}

/// Values of a robot that are read with a period of their own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct PollGroup {
    /// How often they are read: 20 to 3 600 000 ms.
    #[cfg_attr(feature = "openapi", schema(minimum = 20, maximum = 3_600_000, example = 1000))]
    pub period_ms: u64,
    /// Their query addresses, in no other group: all six axes or none, all six coordinates of the pose or
    /// none, and addresses that are not read of every robot.
    #[cfg_attr(feature = "openapi", schema(min_items = 1, max_items = 256, example = json!(["counter-0"])))]
    pub read: Vec<String>,
    /// Whether the history keeps them; `true` if it is missing.
    #[serde(default = "keep", skip_serializing_if = "is_kept")]
    pub keep: bool,
    /// A value is kept if it differs from the last kept one by more than this, in its unit; as the history
    /// is set if it is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(minimum = 0.0, example = 0.5))]
    pub deadband: Option<f64>,
}

fn keep() -> bool {
    true
}

fn is_kept(keep: &bool) -> bool {
    *keep
}

/// Limits of lists. They compare numbers with numbers, and protect no people. A limit that is `null` or
/// missing is not checked.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotGuard {
    /// The highest speed of a move in percent, before the global speed.
    #[cfg_attr(feature = "openapi", schema(required = true, example = 50.0))]
    pub max_speed: Option<f64>,
    /// The highest path speed in mm/s.
    #[cfg_attr(feature = "openapi", schema(required = true, example = 500.0))]
    pub max_path_speed: Option<f64>,
    /// How far an axis move turns an axis at most, in degrees.
    #[cfg_attr(feature = "openapi", schema(required = true, example = 120.0))]
    pub max_axis_step: Option<f64>,
    /// How far a move of the tool goes at most, in mm.
    #[cfg_attr(feature = "openapi", schema(required = true, example = 400.0))]
    pub max_distance: Option<f64>,
    /// The ranges of axes, `J1` to `J8`, for axis moves.
    pub axes: Vec<GuardRange>,
    /// The ranges of `x`, `y` and `z` for linear and curve moves, in the work frame in use.
    pub workspace: Vec<GuardRange>,
}

/// Limits of lists to set. They compare numbers with numbers, and protect no people. A limit that is missing
/// is not checked.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct GuardWanted {
    /// The highest speed of a move in percent, before the global speed: 0.1 to 100 in steps of 0.1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(minimum = 0.1, maximum = 100, example = 50.0))]
    pub max_speed: Option<f64>,
    /// The highest path speed: a whole number of mm/s, 1 to 10 000.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(minimum = 1, maximum = 10_000, multiple_of = 1, example = 500))]
    pub max_path_speed: Option<f64>,
    /// How far an axis move turns an axis at most, in degrees: above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(exclusive_minimum = 0.0, example = 120.0))]
    pub max_axis_step: Option<f64>,
    /// How far a move of the tool goes at most, in mm: above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(exclusive_minimum = 0.0, example = 400.0))]
    pub max_distance: Option<f64>,
    /// The ranges of axes, `J1` to `J8`, for axis moves: each axis once, in degrees or in mm.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[cfg_attr(feature = "openapi", schema(max_items = 8))]
    pub axes: Vec<GuardRange>,
    /// The ranges of `x`, `y` and `z` in mm for linear and curve moves, in the work frame in use: each once.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[cfg_attr(feature = "openapi", schema(max_items = 3))]
    pub workspace: Vec<GuardRange>,
}

/// The lowest and the highest value that a guard allows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct GuardRange {
    /// What it is of.
    #[cfg_attr(feature = "openapi", schema(example = "x"))]
    pub of: String,
    /// `deg` or `mm`.
    #[cfg_attr(feature = "openapi", schema(example = "mm"))]
    pub unit: String,
    /// The lowest value.
    pub lowest: f64,
    /// The highest value.
    pub highest: f64,
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
    /// The name of the user; the token, its number and name; or `raw`, the address and the rule of a raw
    /// client.
    #[cfg_attr(feature = "openapi", schema(example = "token 1 (r6 up)"))]
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
    /// How often the values are read, besides those of its groups.
    pub period_ms: u64,
    /// Values that are read with a period of their own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub groups: Vec<PollGroup>,
    /// When this gateway started: numbers count from then.
    pub epoch: u64,
    /// The number of the last change of a value. All robots share one count of changes.
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
    pub value: Option<AddressValue>,
    /// The unit; `null` if the value has none, or if the protocol does not tell it.
    #[cfg_attr(feature = "openapi", schema(required = true, example = "mm"))]
    pub unit: Option<String>,
    /// Whether to act on the value.
    pub quality: SignalQuality,
    /// The time since the value was asked for; the value is no older. `null` without a value.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub age_ms: Option<u64>,
}

/// How much a value can be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum SignalQuality {
    /// It was read when it was due, over the connection that is alive now.
    Fresh,
    /// It is late, it was read over an earlier connection, or it is not known that this robot sent it.
    Stale,
    /// There is no value: it was not read yet, the controller does not have it, or it cannot be parsed.
    None,
}
