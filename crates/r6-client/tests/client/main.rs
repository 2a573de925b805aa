//! The client against a controller whose every byte the test decides.
#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests too")]

mod controller;

mod connection;
mod identity;
mod motion;
mod outcomes;
mod queries;
mod replies;
mod status;
mod stopping;
mod subscriptions;
