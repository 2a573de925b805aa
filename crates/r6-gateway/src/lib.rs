//! The gateway: one safe, recorded door to every robot of a hall.
//!
//! It holds the one connection that each controller can bear, and gives everyone else values, leases,
//! commands and stops over HTTP. `docs/GATEWAY.md` says how to use it.
//!
//! # A command through the gateway
//!
//! `POST /v1/robots/press-4/commands`:
//!
//! 1. `r6-http/src/access.rs` looks at `Host` and `Origin`. `http/caller.rs` finds the token or the session,
//!    and its role; a route about a robot cannot be written without it. `http/commands.rs` reads the command,
//!    and `http/deadline.rs` refuses what comes late.
//! 2. `fleet/command.rs` asks the seat of the robot (`core/seat.rs`), writes the intent (`store/keeper.rs`, a
//!    thread), and asks the seat again, for a permit (`core/seat/permit.rs`).
//! 3. `fleet/send.rs` takes the permit and is the only place that sends. The client checks the permit's
//!    conditions (`r6-client/src/conditions.rs`) in the call that writes the first byte.
//! 4. If permits become void meanwhile (a lease ends, a stop begins, another robot answers),
//!    `fleet/station.rs` withdraws the permission before it returns.
//!
//! A stop takes `http/commands.rs` and `fleet/command.rs` alone: no lease, no disk. `fleet/link.rs` keeps the
//! connection and takes in values (`live/board.rs`), and `http/streams.rs` reads them for each client at its
//! own pace. `fleet/clerk.rs` ends leases in time, and writes what need not be written first.
//! `fleet/roster.rs` adds, changes and removes robots. The walk of a run of a program is in `fleet/run.rs`,
//! that of an action at the panel of a virtual robot in `fleet/panel.rs`, that of the points of a camera,
//! which needs a standing grant and no lease, in `fleet/camera.rs`.
//!
//! # The parts
//!
//! - `core`: the decisions, pure: who may send what now, which role may do what, the chain of the audit log,
//!   what happens at a robot, the figures of production.
//! - `fleet`: a task and a connection for each robot, through `r6-client`.
//! - `live`: values that change, and events.
//! - `history`: values and events that are kept, by a thread and in files of their own.
//! - `programs`: the check and the plan of programs, without a robot. Their runs are in `fleet`.
//! - `accounts`: users, their passwords and sessions.
//! - `auditor`: signs the heads of the audit log and removes its oldest entries; `verify` checks it.
//! - `settings`: the time zone and the shifts of the hall.
//! - `sharing`: a gateway that shares its store with others, each of which owns some robots (`ownership`).
//!   `peers`: how it reaches them; `http/forward.rs` passes requests on, `live/far.rs` has what they tell.
//! - `store`: tokens, users, the audit log, the state of the seats; nothing else knows SQL.
//! - `http`: the API.
//! - `traces`: spans of requests and commands, for a subscriber that asks for them.
//! - `raw_port`: the robots' own protocol, for old scripts.
//! - `simulation`: a whole gateway whose time, network and disk are simulated (`docs/SIMULATION.md`). It is
//!   there with the feature `simulation` alone, which nothing that ships has.
#![cfg_attr(
    not(test),
    warn(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

mod accounts;
mod auditor;
mod backup;
mod certificate;
mod clock;
mod core;
mod expiry;
mod files;
mod fleet;
mod folder;
mod gateway;
mod history;
mod http;
mod live;
mod outage;
mod ownership;
mod peers;
mod problem;
mod programs;
mod raw_port;
mod reserve;
mod secret;
mod settings;
mod sharing;
mod shell;
#[cfg(feature = "simulation")]
mod simulated;
#[cfg(feature = "simulation")]
pub mod simulation;
mod store;
mod tokens;
pub mod traces;
mod verify;

pub use crate::auditor::AuditSettings;
pub use crate::backup::{Backup, BackupError, backup, restore};
pub use crate::certificate::{Certificate, CertificateError, TlsSettings};
pub use crate::core::account::{Account, PasswordHash, UserName};
pub use crate::core::camera::{Camera, CameraGrant};
pub use crate::core::hall::{Hall, Mistake as HallMistake};
pub use crate::core::head::PublicKey;
pub use crate::core::name::RobotName;
pub use crate::core::raw::policy::{
    MAX_CAMERAS, MAX_PROGRAMS, RawAllow, RawPolicy, RawRule, RawSource, raw_words,
};
pub use crate::core::retention::LEAST_ENTRIES;
pub use crate::core::role::{BadRobots, Grant, GrantRobots};
pub use crate::expiry::Expiry;
pub use crate::fleet::address::RobotAddress;
pub use crate::fleet::config::{MAX_READ, PERIODS, RobotConfig, USUAL_PERIOD};
pub use crate::fleet::group::{MAX_GROUPS, MAX_OF_GROUP, PollGroup};
pub use crate::fleet::guard::Guard;
pub use crate::fleet::panel::Panel;
pub use crate::fleet::roster::Changes;
pub use crate::folder::is_of_database;
pub use crate::gateway::{Gateway, GatewayError, GatewaySettings};
pub use crate::history::{HistorySettings, LEAST_MAX_BYTES};
pub use crate::http::{history_table, openapi};
pub use crate::problem::Problem;
pub use crate::raw_port::RawPort;
pub use crate::shell::{
    At, add_user, disable_user, grant_camera, has_certificate, is_robot_known, list_cameras, list_tokens,
    list_users, make_link, make_token, make_token_until, revoke_token,
};
pub use crate::store::postgres::Database;
pub use crate::store::{StoreError, Token};
pub use crate::verify::{Signed, Verified, VerifyError, verify};

/// The default port of the gateway.
pub const DEFAULT_PORT: u16 = 9780;
