//! The client against a controller whose every byte comes from the test.
#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests too")]

mod controller;

mod attempts;
mod camera;
mod connection;
mod doubted;
mod driving;
mod events;
mod following;
mod identity;
mod listening;
mod motion;
mod one_robot;
mod outcomes;
mod pendant;
mod queries;
mod reconnecting;
mod registers;
mod replies;
mod safety;
mod status;
mod stopping;
mod subscriptions;
