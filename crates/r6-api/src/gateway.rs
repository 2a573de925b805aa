//! The types of the gateway over HTTP: robots and their values, leases, commands, stops, events, programs,
//! the audit log, users and tokens.
//!
//! Times are RFC 3339 in UTC with microseconds. Durations end in `_ms`.

mod account;
mod alarm;
mod audit;
mod camera;
mod command;
mod event;
mod history;
mod live;
mod model;
mod panel;
mod point;
mod production;
mod program;
mod raw;
mod robot;
mod run;
mod settings;

use serde::{Deserialize, Serialize};

pub use account::{
    LinkSignIn, PasswordChange, Secret, Session, Setup, SignIn, Token, TokenMade, TokenSignIn, TokenWanted,
    Tokens, User, UserWanted, Users,
};
pub use alarm::{
    AcknowledgeRequest, Acknowledged, RobotAlarm, RobotAlarmState, RobotAlarms, ShelveRequest, Shelved,
};
pub use audit::{Audit, AuditEntry, AuditHead, AuditRecord, Deed, RawPortRule};
pub use camera::{
    CameraGrant, CameraGrantWanted, CameraGrants, CameraPoint, PhotoRequest, PointsDone, PointsRequest,
};
pub use command::{
    ClearRequest, CommandDone, CommandRequest, Lease, LeaseKey, LeaseRequest, Stopped, WithLease, WithReason,
};
pub use event::{CommandOutcome, Event, Happened, LeaseEnd};
pub use history::{
    AveragesUsed, Gap, History, HistoryAverages, HistoryBucket, HistoryEvent, HistoryEvents, HistorySample,
    HistoryState, UnseenBecause,
};
pub use live::{
    LiveAlive, LiveChange, LiveMessage, LiveNothing, LiveRemoved, LiveRequest, LiveReset, LiveResume,
    LiveSent, LiveSubscribe, LiveSubscribed,
};
pub use model::{ArmAxis, ArmGeometry, ArmModel, Models};
pub use panel::{PanelDone, PanelRequest};
pub use point::{PointValue, PointVersions, PointWanted, StoredPoint, StoredPoints};
pub use production::{
    AlarmFigure, AlarmFigures, Availability, CycleFigures, PartFigures, Production, ProductionByShift,
    ProductionFigures, StateFigures,
};
pub use program::{
    PlanEnd, PlanProblem, PlanProblemType, PlanRequest, PlanSample, PlannedAxis, PlannedStep, ProgramChecked,
    ProgramPlan, ProgramProblem, ProgramStep, ProgramText, ProgramType, ProgramVersion, ProgramVersions,
    ProgramWanted, Programs, Queried, QueryProblem, StepRuns, StoredProgram,
};
pub use raw::{RawPortState, RawPorts, RawPortsWanted};
pub use robot::{
    ActedBy, GlobalSpeed, GuardRange, GuardWanted, IdentityChange, LeaseHolder, ManagedBy, PollGroup,
    RobotGuard, RobotIdentity, RobotLink, RobotState, RobotSummary, RobotWanted, Robots, Signal,
    SignalQuality,
};
pub use run::{Run, RunEnd, RunProof, RunRequest, RunState, Runs};
pub use settings::{HallSettings, Settings, Shift, ShiftSpan, Weekday};

/// What a token or a user may do. Each role allows everything that the roles before it allow.
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
    /// Takes a lease away from its holder; for all robots, changes users and tokens.
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

    /// The role with this word.
    #[must_use]
    pub fn of_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|role| role.word() == word)
    }
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
    /// Whether the values of robots are kept. Commands and stops do not depend on it.
    pub history: HistoryState,
}
