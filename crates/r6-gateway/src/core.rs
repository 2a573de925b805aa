//! The decisions of the gateway, without I/O: times and events come in, decisions go out.
//!
//! - [`seat`]: who may send commands to a robot now: the lease, the stop that holds, the identity, the link.
//!   It alone makes a [`seat::Permit`], without which no command leaves.
//! - [`role`]: which role may do what.
//! - [`chain`]: the hash chain of the audit log.
//! - [`head`]: signed heads of the audit log.
//! - [`retention`]: how much of the audit log is kept.
//! - [`hall`]: the time zone of the hall, and which instants a shift has.
//! - [`history`]: which values are kept, and how.
//! - [`alarms`]: the alarms of a robot, acknowledged and shelved.
//! - [`account`]: users, their names, and which change of them is allowed.
//! - [`camera`]: standing grants by which cameras send points without the lease.
//! - [`session`]: the sessions of users.
//! - [`sign_in`]: how often passwords can be tried.
//! - [`name`]: names of robots.
//! - [`owner`]: which gateway owns the robots of a store that several share.
//! - [`order`]: what the holder of a lease sends, or a camera.
//! - [`panel`]: actions at the panel of a virtual robot, and what they need.
//! - [`pass`]: what a gateway says of a request that it passes on to another one.
//! - [`rate`]: how many requests a token may make.
//! - [`refusals`]: which refusals and repeated stops of one caller stand in the audit log.
//! - [`library`]: the programs that are kept, and which version a change is for.
//! - [`point`]: the points that are kept.
//! - [`live`]: what readers of values get, and where they go on.
//! - [`raw`]: the raw port.
//! - [`watch`]: what happens at a robot, from the values that are read of it.
//! - [`production`]: figures of production, from values and events.

pub mod account;
pub mod alarms;
pub mod camera;
pub mod chain;
pub mod hall;
pub mod head;
pub mod history;
pub mod library;
pub mod live;
pub mod name;
pub mod order;
pub mod owner;
pub mod panel;
pub mod pass;
pub mod point;
pub mod production;
pub mod rate;
pub mod raw;
pub mod refusals;
pub mod retention;
pub mod role;
pub mod seat;
pub mod session;
pub mod sign_in;
pub mod watch;
