//! A gateway over real sockets, in front of virtual controllers.

mod access;
mod alarms;
mod browsers;
mod busy;
mod cameras;
mod commands;
mod dials_in;
#[cfg(unix)]
mod far;
mod fleet;
#[cfg(unix)]
mod forward;
#[cfg(unix)]
mod gateways;
mod groups;
mod guard;
mod happenings;
mod heads;
mod held;
mod history;
mod idempotency;
mod late;
mod leases;
mod openapi;
#[cfg(unix)]
mod owner;
#[cfg(unix)]
mod owner_changes;
mod page;
mod panel;
#[cfg(unix)]
mod passed;
mod points;
mod production;
mod programs;
mod query;
mod raw;
mod roles;
mod roster;
mod runs;
mod settings;
mod sockets;
mod stops;
mod streams;
mod support;
mod tls;
mod twins;
#[cfg(unix)]
mod unread;
mod users;
