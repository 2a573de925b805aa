//! What happens to robots, as events.

use serde::{Deserialize, Serialize};

use super::{ActedBy, GlobalSpeed, IdentityChange, RobotIdentity, RunEnd, RunState, UnseenBecause};
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
        /// Its number: `stop_number` of the robot from then on. 0 of a stop that does not hold.
        #[serde(default)]
        #[cfg_attr(feature = "openapi", schema(required = true))]
        number: u64,
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
    /// The controller asks a camera for a photo.
    PhotoRequested {
        /// The camera, as the controller wrote it.
        camera: i64,
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
    /// The gateway gave the robot to another one, or lost it because its database did not answer.
    OwnerChanged,
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

impl CommandOutcome {
    /// The word of the API for it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::Refused => "refused",
            Self::NotSent => "not_sent",
            Self::Unknown => "unknown",
        }
    }
}
