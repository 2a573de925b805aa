//! A robot behind one TCP connection: typed queries, commands and instructions for Huacheng R6 / HC1
//! controllers.
//!
//! [`Robot`] is the handle; its clones share one connection. A call that waits for an answer drives that
//! connection for all calls (`drive.rs`). A state machine without a socket decides what is sent and when
//! (`connection.rs`). Only `hands/` and `blocking/` know sockets, clocks and tasks.
//! [`r6_proto::client::ClientSession`] knows the protocol.
//!
//! Errors are sorted by what the caller must do ([`RequestError`]): change the request, send it again, read
//! why the controller refused it, or find out whether it was carried out. This crate repeats only queries,
//! and the commands of [`Robot::stop`]. "ok" means accepted, not done: the state of the arm shows whether it
//! moved ([`Robot::wait_until_done`], [`Robot::stop`]).
//!
//! To read values repeatedly, subscribe to them ([`Robot::subscribe`]): one poller reads them for all clones.
//! After a reconnect, the client first reads the identity of the robot. It sends no command to a robot other
//! than the one before ([`Robot::accept_identity`]). A [`Motion`] is built from typed values ([`units`]),
//! streamed by [`Robot::run`] and followed through its [`MotionHandle`]. [`Robot::with_guard`] checks it
//! against an [`Envelope`] first.
//!
//! [`blocking`] offers all of this without `async`.
//!
//! The stop of this crate is an ordinary command on a network. It is not an emergency stop.
#![cfg_attr(not(test), warn(clippy::indexing_slicing, clippy::expect_used, clippy::panic))]

mod backoff;
pub mod blocking;
mod board;
mod camera;
mod closing;
mod conditions;
mod connection;
mod done;
mod doubt;
mod drive;
mod errands;
mod error;
mod event;
mod evidence;
mod follow;
mod guard;
mod handle;
mod hands;
mod hub;
mod identity;
mod introduction;
mod job;
mod link;
mod link_quality;
mod motion;
mod motions;
mod moves;
mod observe;
mod path;
mod pendant;
mod poll_plan;
mod progress;
mod pushed;
mod query;
mod raw;
mod recording;
mod registers;
mod reply;
mod robot;
mod seats;
mod sent_settings;
mod settings;
mod status;
mod stop;
mod stream;
mod subscription;
mod tap;
mod time;
pub mod units;

pub use camera::{PhotosEnded, Shot};
pub use closing::StopsUnderWay;
pub use conditions::{Conditions, ListGate, Permission};
pub use error::{Effect, Invalid, NotSent, OutcomeUnknown, Refused, RequestError, Sent};
pub use event::Event;
pub use evidence::restart::Restart;
pub use evidence::standstill::StandProof;
pub use follow::{FollowOptions, Followed, TargetSender, Targets};
pub use guard::{Checked, Envelope, Violation};
pub use handle::{MotionHandle, Progress, StepHandle, StepState};
pub use hands::callback;
pub use hands::connect::{Connect, DEFAULT_PORT, address_with_port, check_address};
pub use hands::discover::{Discovered, discover};
pub use hands::listen::Listen;
pub use identity::{Found, Identity};
pub use job::CameraSet;
pub use link_quality::{Latency, LinkQuality, LinkState};
pub use motion::{Done, EndProof, WaitError, WaitOptions};
pub use moves::{MAX_STEPS, Motion, StepError};
pub use path::place::Missed;
pub use pushed::{LostReason, Pushed};
pub use query::{NoReading, QueryResult};
pub use r6_proto::io_point::{IoPoint, PairMask, PointKind};
pub use r6_proto::message::instruction::{
    BlendLevel, BoardOutput, Instruction, OutputBoard, OutputKind, WaitCondition, WaitSource, WrongPoint,
};
pub use r6_proto::message::{PhotoAnswer, Point, Reading};
pub use r6_proto::{Address, AxisIndex, AxisMask, Command, OperationMode, RegisterIndex};
pub use raw::{RawReply, RawValue};
pub use recording::{Recorded, Recording};
pub use registers::{Keep, RegisterError, from_thousandths, to_thousandths};
pub use robot::{Accepted, Closed, Robot};
pub use settings::{Heartbeat, Liveness, Reconnect, RobotSettings};
pub use status::{Readiness, Status, Unmet, Unproved};
pub use stop::{DoubtAfterStop, ListAfterStop, NotTried, SecondConnection, StopMeans, StopReport};
pub use stream::{Cause, MotionError, NotProved, RunOptions};
pub use subscription::{Changes, NotSubscribed, Quality, Snapshot, Subscription, Value};
